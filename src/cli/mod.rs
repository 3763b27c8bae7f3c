//! Commands, one file each. They print and write files; the library does neither.

mod advise;
mod basins;
mod check;
mod checkpoint;
mod compare;
mod continuation;
mod diagram;
mod error;
mod fit;
mod identify;
mod import;
mod lyapunov;
mod map;
mod merge;
mod orbit;
mod pictures;
mod progress;
mod run;
mod sound;
mod stability;
mod study;
mod sweep;
mod threshold;
mod work;

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use flank::{
    Simulation,
    output::{Fault, Request},
    scene::{self, Scene},
    sweep::Axis,
};

pub use error::CliError;

/// Gear vibro-impact with exact events.
#[derive(Debug, Parser)]
#[command(name = "flank", version, propagate_version = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Wait so long for another command that writes into the same folder
    #[arg(long, global = true, value_name = "SECONDS", default_value_t = 0, hide_default_value = true)]
    lock_wait: u32,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scene: events, measures, energy ledger
    Run(run::Arguments),
    /// Make every figure and number of a study, with a report to look at
    Study(study::Arguments),
    /// Make a scene simpler step by step: what each step changes and what it saves, and which freedoms matter
    Advise(advise::Arguments),
    /// Measure the steady motion at every point of a grid of scene numbers
    Sweep(sweep::Arguments),
    /// Find the load below which meshes lose contact: a graze to all digits, or a bracket where the motion jumps
    Threshold(threshold::Arguments),
    /// Decide what the motion is in every cell over two numbers: periodic, chaotic, teeth apart, one flank or both
    Map(map::Arguments),
    /// Draw section points, impacts and exponents of motions against one number, on the way up and down
    Diagram(diagram::Arguments),
    /// Take the parts of a divided sweep, map, diagram or basins together
    Merge(merge::Arguments),
    /// Find where each start in a plane of starts ends: attractors, their basins, how their boundary looks
    Basins(basins::Arguments),
    /// Solve for the periodic orbit that a scene starts on or approaches: stable or not, with its multipliers
    Orbit(orbit::Arguments),
    /// Follow periodic orbits along a number of the scene, and locate the points at which the motion changes
    Continue(continuation::Arguments),
    /// Measure all Lyapunov exponents of the motion that a scene runs to, with their bands
    Lyapunov(lyapunov::Arguments),
    /// Compare Flank with fixed-step and adaptive codes on a scene: accuracy against work
    Compare(compare::Arguments),
    /// Show what a scene builds: freedoms, contacts, natural frequencies, integrators, warnings
    Check(check::Arguments),
    /// Map where fixed-step methods give the right motion: their step against stiffness, damping or backlash
    Stability(stability::Arguments),
    /// Find numbers of a scene from natural frequencies and static contact forces
    Identify(identify::Arguments),
    /// Find numbers of a study for which most of its claims about motions are met, and which claims exclude each other
    Fit(fit::Arguments),
    /// Render the impacts of a scene as sound, through a transfer path
    Sound(sound::Arguments),
    /// Make a scene of a gearbox file that another program wrote, with the origin of each number
    Import(import::Arguments),
    /// Print the JSON Schema of scenes
    Schema,
    /// Print completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page (roff), or write a page for every command
    Man {
        /// Write flank.1 and a page for each command into this folder, which must exist
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Look at scenes
    #[command(subcommand)]
    Scene(Look),
}

#[derive(Debug, Subcommand)]
enum Look {
    /// Print a scene with every default written out
    Show {
        /// Scene file; the reference scene if left out
        scene: Option<PathBuf>,
    },
}

impl Arguments {
    /// Reads the command line. A negative number is a value, so that the range of an argument is named, and no option.
    pub fn read() -> Self {
        let signed = |arg: clap::Arg| {
            let takes_values = arg.get_action().takes_values();
            arg.allow_negative_numbers(takes_values)
        };
        let command = Self::command().mut_subcommands(|command| command.mut_args(signed));
        let matches = command.try_get_matches().unwrap_or_else(|error| exit(&error));
        Self::from_arg_matches(&matches).unwrap_or_else(|error| exit(&error))
    }
}

/// Ends the program with what clap has to say: a fault of the words, or the help that was asked for.
fn exit(error: &clap::Error) -> ! {
    let written = error.print().and_then(|()| std::io::stdout().flush());
    let is_lost = written.is_err_and(|error| error.kind() != std::io::ErrorKind::BrokenPipe);
    std::process::exit(if is_lost && !error.use_stderr() { 74 } else { error.exit_code() })
}

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Done {
    /// As asked.
    Completely,
    /// It failed, or does not tell what was asked.
    Partly,
    /// All was done, and some points failed.
    SomeFailed,
    /// The event budget of a scene was spent.
    BudgetSpent,
    /// It was interrupted, and can be resumed where it keeps what was done.
    Interrupted,
}

impl Done {
    /// The exit code.
    pub fn code(self) -> ExitCode {
        match self {
            Self::Completely => ExitCode::SUCCESS,
            Self::Partly => ExitCode::from(1),
            Self::SomeFailed => ExitCode::from(3),
            Self::BudgetSpent => ExitCode::from(4),
            // EX_TEMPFAIL of sysexits.h: the same command may succeed later.
            Self::Interrupted => ExitCode::from(75),
        }
    }

    /// The end of work of so many points, some of which failed.
    pub fn with_failed(failed: u64, all: u64) -> Self {
        match failed {
            0 => Self::Completely,
            failed if failed >= all => Self::Partly,
            _ => Self::SomeFailed,
        }
    }
}

/// Executes what the arguments ask for.
pub fn execute(arguments: Arguments) -> Result<Done, CliError> {
    flank::output::wait_for_others(std::time::Duration::from_secs(arguments.lock_wait.into()));
    match arguments.command {
        Command::Run(arguments) => return run::execute(&arguments),
        Command::Study(arguments) => return study::execute(&arguments),
        Command::Advise(arguments) => return advise::execute(&arguments),
        Command::Sweep(arguments) => return sweep::execute(&arguments),
        Command::Threshold(arguments) => return threshold::execute(&arguments),
        Command::Diagram(arguments) => return diagram::execute(&arguments),
        Command::Basins(arguments) => return basins::execute(&arguments),
        Command::Map(arguments) => return map::execute(&arguments),
        Command::Merge(arguments) => return merge::execute(&arguments),
        Command::Orbit(arguments) => return orbit::execute(&arguments),
        Command::Continue(arguments) => return continuation::execute(&arguments),
        Command::Lyapunov(arguments) => return lyapunov::execute(&arguments),
        Command::Compare(arguments) => return compare::execute(&arguments),
        Command::Stability(arguments) => return stability::execute(&arguments),
        Command::Identify(arguments) => return identify::execute(&arguments),
        Command::Fit(arguments) => return fit::execute(&arguments),
        Command::Sound(arguments) => return sound::execute(&arguments),
        Command::Check(arguments) => check::execute(&arguments)?,
        Command::Import(arguments) => import::execute(&arguments)?,
        Command::Schema => print(&format!("{:#}\n", scene::schema()))?,
        Command::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "flank", &mut text);
            print(&String::from_utf8_lossy(&text))?;
        }
        Command::Man { out: Some(folder) } => clap_mangen::generate_to(Arguments::command(), &folder)
            .map_err(|error| CliError::File(folder.display().to_string(), error))?,
        Command::Man { out: None } => {
            let mut text = Vec::new();
            let written = clap_mangen::Man::new(Arguments::command()).render(&mut text);
            written.map_err(|error| CliError::File("flank.1".to_owned(), error))?;
            print(&String::from_utf8_lossy(&text))?;
        }
        Command::Scene(Look::Show { scene }) => print(&format!("{:#}\n", read_scene(scene.as_deref())?.resolved()))?,
    }
    Ok(Done::Completely)
}

/// Reads a scene; `-` is standard input, nothing the reference scene.
fn read_scene(path: Option<&Path>) -> Result<Scene, CliError> {
    match path {
        None => Ok(Scene::reference()?),
        Some(path) if path == Path::new("-") => Ok(Scene::from_stream(std::io::stdin().lock(), "standard input")?),
        Some(path) => Ok(Scene::from_file(path)?),
    }
}

/// The same, ready to run.
fn open(path: Option<&Path>) -> Result<Simulation, CliError> {
    match path.filter(|path| *path != Path::new("-")) {
        Some(path) => Ok(Simulation::from_file(path)?),
        None => Ok(Simulation::from_scene(read_scene(path)?)?),
    }
}

/// What a command that reads `scene` is to write into `out`, if that is given. Refused before any work; nothing is changed yet.
fn request<'a>(
    out: Option<&'a Path>,
    command: &'a str,
    input: Option<&'a Path>,
    force: bool,
    files: Vec<String>,
) -> Result<Option<Request<'a>>, CliError> {
    let request = out.map(|folder| Request { folder, command, input, force, files });
    request.as_ref().map(Request::check).transpose()?;
    Ok(request)
}

/// Where the page of a command lies; nothing if it writes none.
fn report_line(out: Option<&Path>) -> String {
    out.map_or_else(String::new, |out| format!("report: {}\n", out.join("report.html").display()))
}

/// An argument written as the values of an axis, which has a pointer in a sweep and here the name of the argument.
fn axis(name: &str, text: &str, faults: &mut Vec<Fault>) -> Option<Axis> {
    Axis::parse(&format!("/{name}={text}")).map_err(|found| faults.extend(found)).ok()
}

/// Threads to work on: `count`, or as many as there are cores.
fn threads(count: Option<u16>) -> Result<rayon::ThreadPool, CliError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count.map_or(0, usize::from)).build();
    pool.map_err(|error| CliError::file("threads", std::io::Error::other(error)))
}

/// Columns of a terminal that reports fit.
const COLUMNS: usize = 100;

/// Text in lines that fit a terminal, each behind `indent`; further lines are set in.
fn wrapped(text: &str, indent: &str) -> String {
    let further = format!("{indent}  ");
    textwrap::fill(text, textwrap::Options::new(COLUMNS).initial_indent(indent).subsequent_indent(&further))
}

/// Writes a line to standard error. Where that cannot be written into, nobody reads it.
fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Writes text to standard output. A reader that has gone away, as `head` does, is no error.
fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(CliError::file("standard output", error)),
        _ => Ok(()),
    }
}
