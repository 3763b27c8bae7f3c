//! `flank map`.

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
    map::{CellRule, KindMap, Tally, figure},
    plot::Print,
    scene::Scene,
    sweep::{Begin, CommandFiles, Ending, Records, Share, SweepError},
};

/// Arguments of `flank map`.
#[derive(Debug, clap::Args, Deserialize, Serialize)]
pub struct MapArguments {
    /// Scene file; the reference scene if left out
    #[serde(skip)]
    scene: Option<PathBuf>,
    /// A number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or POINTER=V1,V2,…; twice, the
    /// last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Measures of each contact, by their names in sweep.csv without unit, separated by commas [default: apart_fraction]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    columns: Vec<String>,
    #[command(flatten)]
    rule: RuleArguments,
    #[command(flatten)]
    #[serde(skip)]
    work: LongWork,
    /// Folder of map.csv, map.json and the figure
    #[arg(long, value_name = "DIR", default_value = "map")]
    #[serde(skip)]
    out: PathBuf,
    #[command(flatten)]
    #[serde(skip)]
    pictures: Pictures,
}

/// Lengths of the runs, in cycles.
#[derive(Debug, clap::Args, Deserialize, Serialize)]
pub struct RuleArguments {
    /// Cycles of the transient
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    transient: u64,
    /// Cycles after it that decide on the kind of a motion without an orbit
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u64).range(100..=1_000_000))]
    further: u64,
}

impl RuleArguments {
    pub fn rule(&self) -> CellRule {
        CellRule { transient_cycles: self.transient, further_cycles: self.further, ..CellRule::default() }
    }
}

/// Returns the number of cells of each kind, one line each.
pub fn counts(tally: &Tally) -> String {
    let share = |count: u64| 100.0 * count as f64 / tally.cells().max(1) as f64;
    tally.kinds().into_iter().map(|(kind, count)| format!("{kind}: {count} ({:.2} %)\n", share(count))).collect()
}

/// Map, and the form of its figure.
struct Map {
    map: KindMap,
    form: Print,
}

impl Points for Map {
    const COMMAND: &'static str = "map";
    const THINGS: &'static str = "cells";
    type Rows = Records;

    fn kept() -> CommandFiles {
        KindMap::FILES
    }

    fn rows(&self) -> [usize; 2] {
        [self.map.plane().cells(); 2]
    }

    fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Records>, SweepError> {
        self.map.open(folder, begin, share)
    }

    fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Records, SweepError> {
        self.map.merged(folders, out)
    }

    fn records(rows: &mut Records) -> &mut Records {
        rows
    }

    fn run(&self, rows: &mut Records, _: &LongWork, task: Task<'_>) -> Result<Ending, Error> {
        Ok(self.map.run(rows, task)?)
    }

    fn finish(&self, rows: Records, work: &LongWork, out: &Path) -> Result<Completion, Error> {
        let map = &self.map;
        let name = stem(map.plane().scene().name());
        let tally = map.finish(rows, |tally, folder| {
            let dimensionless = map.plane().own().dimensionless;
            figure(&name, map.plane().grid(), tally, &map.shown(), dimensionless).draw_into(folder, &self.form)
        })?;
        work.say(&format!("{}{} cells: {}\n", counts(&tally), tally.cells(), out.join("map.csv").display()))?;
        Ok(Completion::with_failed(tally.failed(), tally.cells() as u64))
    }
}

impl Map {
    fn new(arguments: &MapArguments, scene: Scene, pictures: &Pictures) -> Result<Self, Error> {
        let map = KindMap::new(scene, &arguments.vary, arguments.rule.rule(), &arguments.columns)?;
        Ok(Self { map, form: pictures.print()? })
    }
}

/// Maps the kinds of motion.
pub fn execute(arguments: &MapArguments) -> Result<Completion, Error> {
    let scene = arguments.work.scene(arguments.scene.as_deref())?;
    let map = Map::new(arguments, scene.clone(), &arguments.pictures)?;
    let asked = serde_json::to_value(arguments).unwrap_or_default();
    work::execute(&map, (&scene, &asked), &arguments.work, (arguments.scene.as_deref(), &arguments.out))
}

/// Merges parts of a map.
pub fn merge(asked: Value, scene: Scene, pictures: &Pictures, parts: &Merge<'_>) -> Result<Completion, Error> {
    work::merge(&Map::new(&work::read(asked)?, scene, pictures)?, parts)
}
