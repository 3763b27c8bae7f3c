use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::{
    StudyError,
    figures::families,
    measures::Measures,
    steady::{Rule, Seed, Steady, steady},
};
use crate::{
    orbit::Motion,
    output::{Fault, Folder, OutputError, in_a_line, number},
    scene::{Scene, SceneError},
    simulation::Simulation,
    sweep::{Begin, CommandFiles, Ending, Journal, Outcome, Plan, RowWork, SWEEP, Share, SweepError, Tally, run},
    task::Task,
};

/// Steady motions at the points of a grid of scene numbers, kept in a [`Journal`].
///
/// ```no_run
/// use flank::{Task, scene::Scene, study::{SteadySweep, steady::Rule}, sweep::{Begin, Grid, Plan, Seeding, Share}};
///
/// let plan = Plan::new(Grid::parse(&["/train/speed_rpm=500:900:9"])?, Seeding::Up);
/// let sweep = SteadySweep::new(Scene::reference()?, plan, Rule::default())?;
/// let folder = std::path::Path::new("sweep");
/// let mut journal = sweep.open(folder, Begin::New, Share::ALL)?.expect("a new sweep is open");
/// sweep.run(&mut journal, Task::default())?;
/// let tally = sweep.finish(journal, |_, _| Ok(()))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SteadySweep {
    scene: Scene,
    plan: Plan,
    rule: Rule,
    dimensionless: bool,
    /// Vector instructions of its runs.
    instructions: &'static str,
    /// Measures in its table.
    measures: Measures,
}

impl SteadySweep {
    /// The files of `flank sweep`.
    pub const FILES: CommandFiles = SWEEP;

    /// Checks that the scene holds and has a forcing period at both ends of every axis, with each other.
    ///
    /// # Errors
    /// [`StudyError::Simulation`]: faults of the scenes at all corners, or what the first corner that cannot run lacks.
    pub fn new(scene: Scene, plan: Plan, rule: Rule) -> Result<Self, StudyError> {
        let mut sweep = Self { scene, plan, rule, dimensionless: false, instructions: "", measures: Measures::usual() };
        let mut corners = vec![Vec::new()];
        for axis in sweep.plan.grid().axes() {
            let ends = [0, axis.count() - 1].map(|i| axis.value(i));
            corners =
                corners.iter().flat_map(|corner: &Vec<f64>| ends.map(|end| [&corner[..], &[end]].concat())).collect();
        }
        let (mut scenes, mut faults) = (Vec::new(), Vec::new());
        for corner in corners {
            match sweep.at(&corner) {
                Ok(scene) => scenes.push(scene),
                Err(error) => error.faults.into_iter().for_each(|fault| {
                    if !faults.contains(&fault) {
                        faults.push(fault);
                    }
                }),
            }
        }
        if !faults.is_empty() {
            return Err(SceneError { name: sweep.scene.name().to_owned(), faults }.into());
        }
        for scene in scenes {
            let simulation = Simulation::from_scene(scene)?;
            simulation.period()?;
            sweep.dimensionless = simulation.dimensionless;
            sweep.instructions = simulation.settings.instructions.name();
        }
        Ok(sweep)
    }

    /// Returns it with these measures of contacts and bearings in its table, by names without unit; the usual ones if there are none.
    ///
    /// # Errors
    /// Faults of names that no measure has.
    pub fn with_columns(mut self, names: &[impl AsRef<str>]) -> Result<Self, Vec<Fault>> {
        self.measures = Measures::named(names)?;
        Ok(self)
    }

    /// The scene at a point of the grid.
    ///
    /// # Errors
    /// [`SceneError`] if it does not hold there.
    pub fn at(&self, values: &[f64]) -> Result<Scene, SceneError> {
        // Whole numbers are written as such: some keys take no others. Below 2⁵³ nothing is lost.
        let json = |v: f64| if v.fract() == 0.0 && v.abs() < 9e15 { Value::from(v as i64) } else { Value::from(v) };
        let axes = self.plan.grid().axes().iter().zip(values);
        self.scene.with_all(axes.map(|(axis, value)| (axis.pointer.as_str(), json(*value))))
    }

    /// The points and their order.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the data that identify the sweep: a journal with another header is not continued.
    #[must_use]
    pub fn header(&self) -> Map<String, Value> {
        let mut header = self.plan.header();
        header.insert("flank".to_owned(), env!("CARGO_PKG_VERSION").into());
        header.insert("instructions".to_owned(), self.instructions.into());
        header.insert("scene_sha256".to_owned(), self.scene.hash().into());
        header.insert("rule".to_owned(), json!(self.rule));
        header
    }

    /// Opens the journal of a share of its rows in `folder`.
    ///
    /// # Errors
    /// As [`Records::open`](crate::sweep::Records::open).
    pub fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Journal<Steady, Seed>>, SweepError> {
        Journal::open_for(SWEEP, folder, (begin, share), self.header(), &self.plan)
    }

    /// Merges the journals of the parts in `folders` into that of an undivided run, to be finished in `out`.
    ///
    /// # Errors
    /// As [`Records::merged`](crate::sweep::Records::merged).
    pub fn merged(
        &self,
        folders: (&[PathBuf], usize),
        out: (&Path, Begin),
    ) -> Result<Journal<Steady, Seed>, SweepError> {
        Journal::merged(folders, SWEEP, out, self.header(), &self.plan)
    }

    /// Computes every row that the journal does not hold, as [`run`].
    ///
    /// # Errors
    /// As [`run`].
    pub fn run(&self, journal: &mut Journal<Steady, Seed>, task: Task<'_>) -> Result<Ending, SweepError> {
        let point = |cell: &RowWork, seed: Option<&Seed>| {
            let scene = self.at(&cell.values).map_err(StudyError::from);
            let measured = scene.and_then(|scene| steady(scene, seed, &self.rule, task));
            let steady =
                measured.map_err(|error| in_a_line(&format!("{}: {error}", self.plan.grid().place(&cell.values))))?;
            let end = steady.end.clone();
            Ok::<_, String>((steady, end))
        };
        run(&self.plan, journal, point, task)
    }

    /// Writes the table and the rows of a complete sweep. `picture` draws its rows, those that did not fail, into the folder; of more than
    /// 10⁶ rows it gets none.
    ///
    /// # Errors
    /// As [`Journal::finish`].
    pub fn finish(
        &self,
        mut journal: Journal<Steady, Seed>,
        picture: impl FnOnce(&[SweepRow], &mut Folder) -> Result<(), OutputError>,
    ) -> Result<Tally, SweepError> {
        // Where the train itself is varied, not every row has each contact.
        let mut measures = self.measures.clone();
        let mut rows = Vec::new();
        journal.each(|row, outcome| {
            if let Outcome::Done { result, .. } = outcome {
                measures.take(&result);
                if self.plan.rows() <= DRAWN {
                    rows.push(SweepRow::of(row, result));
                }
            }
            Ok(())
        })?;
        let columns = columns(self.dimensionless, &measures);
        let draw = |folder: &mut Folder| picture(&rows, folder);
        journal.finish(&self.plan, &columns, |steady| cells(steady, &measures), draw)
    }

    /// Returns whether its scene is dimensionless.
    #[must_use]
    pub fn dimensionless(&self) -> bool {
        self.dimensionless
    }
}

/// Rows that a picture is drawn of, at most: they are in memory.
const DRAWN: usize = 1_000_000;

/// Measures of a row for a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepRow {
    /// Number of the row.
    pub row: usize,
    /// The motion.
    pub motion: Motion,
    /// The first contact of each family, with its name.
    pub contacts: Vec<(String, ContactMeasures)>,
}

/// Measures of a contact for a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactMeasures {
    /// Share of the time apart.
    pub apart: f64,
    /// Largest force, N.
    pub force: Option<f64>,
    /// Least and largest deflection, m.
    pub deflection: [Option<f64>; 2],
}

impl SweepRow {
    fn of(row: usize, steady: Steady) -> Self {
        let shown = |(j, name): (usize, String)| {
            let report = &steady.contacts[j].report;
            let deflection = [report.deflection_min, report.deflection_max];
            (name, ContactMeasures { apart: report.apart_fraction, force: report.force_max, deflection })
        };
        let contacts = families(&steady).into_iter().map(shown).collect();
        Self { row, motion: steady.motion, contacts }
    }
}

/// Columns of the table. A dimensionless train has no units.
fn columns(dimensionless: bool, measures: &Measures) -> Vec<String> {
    let with = |unit: &'static str| if dimensionless { "" } else { unit };
    let motion = [
        "seeded",
        "kind",
        "period_cycles",
        "word",
        "multiplier",
        "transient_cycles",
        "orbit_distance",
        "measured_cycles",
        "exponent",
        "exponent_band",
        "rotation",
        "reason",
    ];
    let mut columns: Vec<String> = motion.map(String::from).to_vec();
    columns.extend([format!("cycle{}", with("_s")), "events".to_owned(), "grazes".to_owned()]);
    columns.extend(measures.columns(dimensionless));
    columns
}

/// A row of the table.
fn cells(steady: &Steady, measures: &Measures) -> Vec<String> {
    let motion = &steady.motion;
    let optional = |value: Option<f64>| value.map_or_else(String::new, number);
    let mut cells = vec![
        steady.seeded.to_string(),
        motion.kind.word().to_owned(),
        motion.period.map_or_else(String::new, |period| period.to_string()),
        motion.word.clone().unwrap_or_default(),
        optional(motion.multiplier),
        motion.cycles.to_string(),
        number(motion.distance),
        steady.measured_cycles.to_string(),
        optional(motion.exponent.map(|[exponent, _]| exponent)),
        optional(motion.exponent.map(|[_, band]| band)),
        optional(motion.rotation),
        motion.reason.clone().unwrap_or_default(),
        number(steady.period_s),
        steady.events.to_string(),
        steady.grazes.to_string(),
    ];
    cells.extend(measures.values(Some(steady)).into_iter().map(optional));
    cells
}
