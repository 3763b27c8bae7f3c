//! `flank sweep`.

use std::path::PathBuf;

use flank::{
    map::sweep_figure,
    study::{SteadySweep, steady::Rule},
    sweep::{Begin, Ending, Grid, Journal, Plan, Seeding},
};

use super::{CliError, Done, map::stem, pictures::Pictures, print, progress::counted, read_scene, threads};

/// Arguments of `flank sweep`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// A number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or
    /// POINTER=V1,V2,…; once or twice, the last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Where a point starts: as the scene says, or from the end of its neighbour along the last axis
    #[arg(long, value_enum, default_value = "fresh")]
    seed: Seeding,
    /// Folder of sweep.csv, sweep.jsonl, sweep.json and the figure
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    out: PathBuf,
    #[command(flatten)]
    pictures: Pictures,
    /// Go on with a sweep that was broken off
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Measures of contacts in sweep.csv, by their names without unit; the usual ones if left out
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    columns: Vec<String>,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Relative distance between the ends of an orbit that counts [default: 1e-9]
    #[arg(long, value_name = "REL", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Cycles after which no orbit is looked for any more [default: 400]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    max_cycles: Option<u64>,
    /// Cycles measured [default: 4 of a periodic motion, 200 of any other; always whole periods]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    measure_cycles: Option<u64>,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// Below rounding nothing settles; above a tenth everything does.
fn tolerance(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|value| (1e-13..=0.1).contains(value));
    value.ok_or_else(|| "a number from 1e-13 to 0.1 is wanted".to_owned())
}

/// Sweeps a scene.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let form = arguments.pictures.print()?;
    let scene = read_scene(arguments.scene.as_deref())?;
    let name = stem(scene.name());
    let grid = Grid::parse(&arguments.vary)?;
    let sweep = SteadySweep::new(scene, Plan::new(grid, arguments.seed), rule(arguments))?;
    let sweep = sweep.with_columns(&arguments.columns).map_err(CliError::Arguments)?;
    let begin = match (arguments.resume, arguments.force) {
        (true, _) => Begin::Resume,
        (_, true) => Begin::Replace,
        _ => Begin::New,
    };
    if begin != Begin::New {
        begin.request(&arguments.out, arguments.scene.as_deref()).check()?;
    }
    let (out, rows) = (arguments.out.display(), sweep.plan().rows());
    let say = |text: String| if arguments.quiet { Ok(()) } else { print(&text) };
    let Some(mut journal) = Journal::open(&arguments.out, begin, sweep.header(), rows)? else {
        say(format!("{out} holds the whole sweep\n"))?;
        return Ok(Done::Completely);
    };
    let (kept, pool) = (journal.kept(), threads(arguments.threads)?);
    let ending = counted(rows, kept, "rows", arguments.quiet, |task| pool.install(|| sweep.run(&mut journal, task)))?;
    if ending == Ending::Interrupted {
        let kept = journal.kept();
        say(format!("interrupted: {kept} of {rows} rows are kept in {out}; the same command with --resume goes on\n"))?;
        return Ok(Done::Partly);
    }
    let tally =
        sweep.finish(journal, |rows, folder| match sweep_figure(&name, sweep.plan(), rows, sweep.dimensionless()) {
            Some(figure) => figure.draw_into(folder, &form),
            None => Ok(()),
        })?;
    let failed = match tally.failed {
        0 => String::new(),
        failed => format!(", {failed} of them failed (column error)"),
    };
    say(format!("{} rows{failed}: {}\n", tally.rows, arguments.out.join("sweep.csv").display()))?;
    Ok(if tally.failed < tally.rows { Done::Completely } else { Done::Partly })
}

fn rule(arguments: &Arguments) -> Rule {
    let mut rule = Rule::default();
    if let Some(tolerance) = arguments.tolerance {
        rule.approach.tolerance = tolerance;
    }
    if let Some(cycles) = arguments.max_cycles {
        rule.approach.most_cycles = cycles;
    }
    if let Some(cycles) = arguments.measure_cycles {
        (rule.measured_cycles, rule.irregular_cycles) = (cycles, cycles);
    }
    rule
}
