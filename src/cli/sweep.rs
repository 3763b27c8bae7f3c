//! `flank sweep`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    Completion,
    pictures::Pictures,
    work::{self, LongWork, Merge, Points, stem},
};
use crate::{
    Error, Task,
    map::sweep_figure,
    plot::Print,
    scene::Scene,
    study::{
        SteadySweep,
        steady::{Rule, Seed, Steady},
    },
    sweep::{Begin, CommandFiles, Ending, Grid, Journal, Plan, Records, Seeding, Share, SweepError},
};

/// Arguments of `flank sweep`.
#[derive(Debug, clap::Args, Deserialize, Serialize)]
pub struct SweepArguments {
    /// Scene file; the reference scene if left out
    #[serde(skip)]
    scene: Option<PathBuf>,
    /// A number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or
    /// POINTER=V1,V2,…; once or twice, the last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Start of a point: as the scene says, or the end of its neighbour along the last axis
    #[arg(long, value_enum, default_value = "fresh")]
    seed: Seeding,
    /// Folder of sweep.csv, sweep.jsonl, sweep.json and the figure
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    #[serde(skip)]
    out: PathBuf,
    #[command(flatten)]
    #[serde(skip)]
    pictures: Pictures,
    #[command(flatten)]
    #[serde(skip)]
    work: LongWork,
    /// Measures of contacts in sweep.csv, by their names without unit; the usual ones if left out
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    columns: Vec<String>,
    /// Largest relative distance between the ends of an orbit [default: 1e-9]
    #[arg(long, value_name = "REL", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Maximum number of cycles of the search for an orbit [default: 400]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    max_cycles: Option<u64>,
    /// Cycles measured [default: 4 of a periodic motion, 200 of any other; always whole periods]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    measure_cycles: Option<u64>,
}

/// Reads a tolerance: below rounding no motion settles; above a tenth every motion does.
fn tolerance(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|value| (1e-13..=0.1).contains(value));
    value.ok_or_else(|| "a number from 1e-13 to 0.1 is wanted".to_owned())
}

/// Sweep, and the form of its figure.
struct SweepWithForm {
    sweep: SteadySweep,
    name: String,
    form: Print,
}

impl Points for SweepWithForm {
    const COMMAND: &'static str = "sweep";
    const THINGS: &'static str = "rows";
    type Rows = Journal<Steady, Seed>;

    fn kept() -> CommandFiles {
        SteadySweep::FILES
    }

    fn rows(&self) -> [usize; 2] {
        [self.sweep.plan().rows(), self.sweep.plan().chains()]
    }

    fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Self::Rows>, SweepError> {
        self.sweep.open(folder, begin, share)
    }

    fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Self::Rows, SweepError> {
        self.sweep.merged(folders, out)
    }

    fn records(rows: &mut Self::Rows) -> &mut Records {
        rows.records_mut()
    }

    fn run(&self, rows: &mut Self::Rows, _: &LongWork, task: Task<'_>) -> Result<Ending, Error> {
        Ok(self.sweep.run(rows, task)?)
    }

    fn finish(&self, rows: Self::Rows, work: &LongWork, out: &Path) -> Result<Completion, Error> {
        let sweep = &self.sweep;
        let tally = sweep.finish(rows, |rows, folder| {
            match sweep_figure(&self.name, sweep.plan(), rows, sweep.dimensionless()) {
                Some(figure) => figure.draw_into(folder, &self.form),
                None => Ok(()),
            }
        })?;
        let failed = match tally.failed {
            0 => String::new(),
            failed => format!(", {failed} of them failed (column error)"),
        };
        work.say(&format!("{} rows{failed}: {}\n", tally.rows, out.join("sweep.csv").display()))?;
        Ok(Completion::with_failed(tally.failed as u64, tally.rows as u64))
    }
}

impl SweepWithForm {
    fn new(arguments: &SweepArguments, scene: Scene, pictures: &Pictures) -> Result<Self, Error> {
        let name = stem(scene.name());
        let grid = Grid::parse(&arguments.vary)?;
        let sweep = SteadySweep::new(scene, Plan::new(grid, arguments.seed), rule(arguments))?;
        let sweep = sweep.with_columns(&arguments.columns).map_err(Error::Arguments)?;
        Ok(Self { sweep, name, form: pictures.print()? })
    }
}

/// Sweeps a scene.
pub fn execute(arguments: &SweepArguments) -> Result<Completion, Error> {
    let scene = arguments.work.scene(arguments.scene.as_deref())?;
    let swept = SweepWithForm::new(arguments, scene.clone(), &arguments.pictures)?;
    let asked = serde_json::to_value(arguments).unwrap_or_default();
    work::execute(&swept, (&scene, &asked), &arguments.work, (arguments.scene.as_deref(), &arguments.out))
}

/// Merges parts of a sweep.
pub fn merge(asked: Value, scene: Scene, pictures: &Pictures, parts: &Merge<'_>) -> Result<Completion, Error> {
    work::merge(&SweepWithForm::new(&work::read(asked)?, scene, pictures)?, parts)
}

fn rule(arguments: &SweepArguments) -> Rule {
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
