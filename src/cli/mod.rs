//! The command line of Flank. Commands, one file each, print and write files; the rest of the library does neither.

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
    ffi::OsString,
    io::Write,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::{
    Error, Simulation,
    output::{Fault, Request},
    scene::{self, Scene},
    sweep::Axis,
};

/// The exit codes of all commands.
const EXIT_CODES: &str = "\
Exit codes:
  0    the work is done
  1    the work failed or contradicts itself (an alarm, or --verify): do not use its numbers
  2    the usage or the scene is wrong
  3    all work is done, and some points failed (column error)
  4    the event budget of the scene was spent
  73   another command writes into the folder
  74   a file cannot be written
  75   interrupted by a signal or the time limit: the same command with --resume goes on, where it keeps work
  130  ended at once by a second signal";

/// Gear vibro-impact with exact events.
#[derive(Debug, Parser)]
#[command(name = "flank", version, propagate_version = true, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Wait up to this time for another command that writes into the same folder
    #[arg(long, global = true, value_name = "SECONDS", default_value_t = 0, hide_default_value = true)]
    lock_wait: u32,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scene: events, measures, energy ledger
    Run(run::RunArguments),
    /// Make every figure and number of a study, with a report to look at
    Study(study::StudyArguments),
    /// Simplify a scene step by step: change and saving of each step, and the freedoms that matter
    Advise(advise::AdviseArguments),
    /// Measure the steady motion at every point of a grid of scene numbers
    Sweep(sweep::SweepArguments),
    /// Find the load below which meshes lose contact: a graze, to rounding, or a bracket where the motion jumps
    Threshold(threshold::ThresholdArguments),
    /// Decide what the motion is in every cell over two numbers: periodic, chaotic, teeth apart, one flank or both
    Map(map::MapArguments),
    /// Draw section points, impacts and exponents of motions against one number, on the way up and down
    Diagram(diagram::DiagramArguments),
    /// Merge the parts of a divided sweep, map, diagram or basins
    Merge(merge::MergeArguments),
    /// Find the end of each start in a plane of starts: attractors, their basins, the form of their boundary
    Basins(basins::BasinsArguments),
    /// Solve for the periodic orbit that a scene starts on or approaches: stable or not, with its multipliers
    Orbit(orbit::OrbitArguments),
    /// Follow periodic orbits along a number of the scene, and locate the points at which the motion changes
    Continue(continuation::ContinueArguments),
    /// Measure all Lyapunov exponents of the motion that a scene runs to, with their bands
    Lyapunov(lyapunov::LyapunovArguments),
    /// Compare Flank with fixed-step and adaptive codes on a scene: accuracy against work
    Compare(compare::CompareArguments),
    /// Show what a scene builds: freedoms, contacts, natural frequencies, integrators, warnings
    Check(check::CheckArguments),
    /// Map where fixed-step methods give the right motion: their step against stiffness, damping or backlash
    Stability(stability::StabilityArguments),
    /// Find numbers of a scene from natural frequencies and static contact forces
    Identify(identify::IdentifyArguments),
    /// Find numbers of a study for which most of its claims about motions are met, and which claims exclude each other
    Fit(fit::FitArguments),
    /// Render the impacts of a scene as sound, through a transfer path
    Sound(sound::SoundArguments),
    /// Make a scene of a gearbox file that another program wrote, with the origin of each number
    Import(import::ImportArguments),
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
    Scene(SceneCommand),
}

#[derive(Debug, Subcommand)]
enum SceneCommand {
    /// Print a scene with every default written out
    Show {
        /// Scene file; the reference scene if left out
        scene: Option<PathBuf>,
    },
}

/// Words of the command line, which `--plan` repeats.
static WORDS: OnceLock<Vec<String>> = OnceLock::new();

/// Runs the command of a command line, the first word of which is the name of the program. Returns the exit code; `--help` lists
/// them. Prints to the standard streams, and ends the process itself after a second signal. A process calls it once: an interrupt stays.
pub fn main(words: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = words.into_iter().collect();
    WORDS.get_or_init(|| words.iter().map(|word| word.to_string_lossy().into_owned()).collect());
    let arguments = match Arguments::read(words) {
        Ok(arguments) => arguments,
        Err(error) => return show(&error),
    };
    match execute(arguments) {
        Ok(done) => done.code(),
        Err(error) => error.report(),
    }
}

impl Arguments {
    /// Reads a command line. A negative number is a value, not an option, so that a fault names the range of its argument.
    fn read(words: Vec<OsString>) -> Result<Self, clap::Error> {
        let signed = |arg: clap::Arg| {
            let takes_values = arg.get_action().takes_values();
            arg.allow_negative_numbers(takes_values)
        };
        let command = Self::command().mut_subcommands(|command| command.mut_args(signed));
        Self::from_arg_matches(&command.try_get_matches_from(words)?)
    }
}

/// Shows the message of clap, an error in the arguments or the help text. Returns the exit code.
fn show(error: &clap::Error) -> u8 {
    let written = error.print().and_then(|()| std::io::stdout().flush());
    let is_lost = written.is_err_and(|error| error.kind() != std::io::ErrorKind::BrokenPipe);
    match error.exit_code() {
        _ if is_lost && !error.use_stderr() => 74,
        0 => 0,
        _ => 2,
    }
}

/// End of a command, from which its exit code follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Completion {
    /// The command did all that was asked.
    Completely,
    /// The command failed, or has no answer to what was asked.
    Partly,
    /// All was done, and some points failed.
    SomeFailed,
    /// The event budget of a scene was spent.
    BudgetSpent,
    /// The command was interrupted; it can be resumed if it keeps a checkpoint.
    Interrupted,
}

impl Completion {
    /// Returns the exit code.
    pub fn code(self) -> u8 {
        match self {
            Self::Completely => 0,
            Self::Partly => 1,
            Self::SomeFailed => 3,
            Self::BudgetSpent => 4,
            // EX_TEMPFAIL of sysexits.h: the same command may succeed later.
            Self::Interrupted => 75,
        }
    }

    /// Returns the end of work of `all` points, `failed` of which failed.
    pub fn with_failed(failed: u64, all: u64) -> Self {
        match failed {
            0 => Self::Completely,
            failed if failed >= all => Self::Partly,
            _ => Self::SomeFailed,
        }
    }
}

/// Executes the command that the arguments name.
fn execute(arguments: Arguments) -> Result<Completion, Error> {
    crate::output::wait_for_others(std::time::Duration::from_secs(arguments.lock_wait.into()));
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
            .map_err(|error| Error::File(folder.display().to_string(), error))?,
        Command::Man { out: None } => {
            let mut text = Vec::new();
            let written = clap_mangen::Man::new(Arguments::command()).render(&mut text);
            written.map_err(|error| Error::File("flank.1".to_owned(), error))?;
            print(&String::from_utf8_lossy(&text))?;
        }
        Command::Scene(SceneCommand::Show { scene }) => {
            print(&format!("{:#}\n", read_scene(scene.as_deref())?.resolved()))?
        }
    }
    Ok(Completion::Completely)
}

/// Reads a scene; `-` is standard input, no path the reference scene.
fn read_scene(path: Option<&Path>) -> Result<Scene, Error> {
    match path {
        None => Ok(Scene::reference()?),
        Some(path) if path == Path::new("-") => Ok(Scene::from_stream(std::io::stdin().lock(), "standard input")?),
        Some(path) => Ok(Scene::from_file(path)?),
    }
}

/// Reads a scene and makes it ready to run.
fn open(path: Option<&Path>) -> Result<Simulation, Error> {
    match path.filter(|path| *path != Path::new("-")) {
        Some(path) => Ok(Simulation::from_file(path)?),
        None => Ok(Simulation::from_scene(read_scene(path)?)?),
    }
}

/// Returns the request of a command that reads `input` and writes into `out`, if given; checked before any work, nothing is changed yet.
fn request<'a>(
    out: Option<&'a Path>,
    command: &'a str,
    input: Option<&'a Path>,
    force: bool,
    files: Vec<String>,
) -> Result<Option<Request<'a>>, Error> {
    let request = out.map(|folder| Request { folder, command, input, force, files });
    request.as_ref().map(Request::check).transpose()?;
    Ok(request)
}

/// Returns the line that names the report page of a command; empty if it writes none.
fn report_line(out: Option<&Path>) -> String {
    out.map_or_else(String::new, |out| format!("report: {}\n", out.join("report.html").display()))
}

/// Reads an argument in the form of the values of an axis; its name takes the place of the pointer.
fn axis(name: &str, text: &str, faults: &mut Vec<Fault>) -> Option<Axis> {
    Axis::parse(&format!("/{name}={text}")).map_err(|found| faults.extend(found)).ok()
}

/// Returns a pool of `count` threads, or of as many as there are cores.
fn threads(count: Option<u16>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count.map_or(0, usize::from)).build();
    pool.map_err(|error| Error::file("threads", std::io::Error::other(error)))
}

/// Columns of a terminal for reports.
const COLUMNS: usize = 100;

/// Returns text in lines that fit a terminal, each behind `indent`; further lines are indented more.
fn wrapped(text: &str, indent: &str) -> String {
    let further = format!("{indent}  ");
    textwrap::fill(text, textwrap::Options::new(COLUMNS).initial_indent(indent).subsequent_indent(&further))
}

/// Writes a line to standard error. A failure is ignored: nobody could read it.
fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Writes text to standard output. A closed reader, such as `head`, is no error.
fn print(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::file("standard output", error)),
        _ => Ok(()),
    }
}
