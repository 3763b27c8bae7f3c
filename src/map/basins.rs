//! Basins of attraction: the end of the motion from each start of a plane.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde_json::{Map, Value, json};

use super::{
    attractor::Attractor,
    cell::{Cell, CellRule},
    edges::{Boundary, Figures},
    plane::{PlaneError, StateComponent, two_axes, varied},
    walk::Walk,
};
use crate::{
    engine::State,
    ensemble::in_order,
    orbit::{Drift, MotionKind, SectionMap},
    output::{Fault, Folder, OutputError, csv_line, in_a_line, number},
    scene::Scene,
    simulation::{Simulation, SimulationError},
    sweep::{Begin, CommandFiles, Ending, Grid, GridError, Records, Rows, Share, SweepError},
    task::Task,
};

/// Distance from an orbit, in its scales, within which a start has reached the orbit.
const REACHED: f64 = 1e-6;
/// Maximum number of starts along each axis of the coarse grid on which attractors are searched for first.
const SURVEY: usize = 24;

/// End of the motion from one start.
enum StartOutcome {
    /// On a known attractor, reached after this number of cycles.
    Known(usize, u64),
    /// On an attractor that the row itself describes, after this number of cycles.
    Own(Box<Attractor>, u64),
    /// On no attractor, with the kind of the motion.
    Open(MotionKind, u64),
    Failed(String),
}

/// Basins of attraction of a scene in a plane of its starts.
#[derive(Debug)]
pub struct Basins {
    simulation: Simulation,
    hash: String,
    grid: Grid,
    varied: [StateComponent; 2],
    values: [Vec<f64>; 2],
    q: Vec<f64>,
    v: Vec<f64>,
    rule: CellRule,
}

/// Attractors and measures of all starts.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BasinResult {
    /// Attractors in the order of their numbers.
    pub attractors: Vec<Attractor>,
    /// Counts for the measures, and the starts that a picture shows.
    pub boundary: Boundary,
    /// Measures.
    pub figures: Figures,
}

impl Basins {
    /// The files of `flank basins`.
    pub const FILES: CommandFiles =
        CommandFiles { command: "basins", files: &["basins.rows", "basins.json", "basins.csv", "attractors.json"] };

    /// Returns the starts of `scene` over two `axes`, `/initial/q/I` or `/initial/v/I`, I a number or a name of a freedom. The other
    /// coordinates and velocities are those of the scene, and zero if it has none or starts `static` or at `rest`.
    ///
    /// # Errors
    /// [`PlaneError`] for other axes, and for a scene without a forcing period.
    pub fn new(scene: Scene, axes: &[impl AsRef<str>], rule: CellRule) -> Result<Self, PlaneError> {
        let grid = two_axes(axes)?;
        let (hash, is_written) = (scene.hash(), scene.resolved()["initial"].is_object());
        let simulation = Simulation::from_scene(scene)?.in_common_cycles()?;
        let mut faults = Vec::new();
        let freedoms = &simulation.structure.spec().freedoms;
        let found: Vec<StateComponent> = grid
            .axes()
            .iter()
            .filter_map(|axis| varied(&axis.pointer, freedoms).map_err(|fault| faults.push(fault)).ok())
            .collect();
        let [first, second] = found[..] else { return Err(GridError(faults).into()) };
        if (first.is_velocity, first.freedom) == (second.is_velocity, second.freedom) {
            let fault = Fault::new(&grid.axes()[1].pointer, "a number varied by two axes", "one axis for each number");
            return Err(GridError(vec![fault]).into());
        }
        SectionMap::new(&simulation)?.repeats()?;
        let zeros = vec![0.0; freedoms.len()];
        let (q, v) = if is_written { (simulation.q0.clone(), simulation.v0.clone()) } else { (zeros.clone(), zeros) };
        let values = [0, 1].map(|i| grid.axes()[i].all());
        let rule = CellRule { averages: true, ..rule };
        Ok(Self { simulation, hash, grid, varied: [first, second], values, q, v, rule })
    }

    /// The axes.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The simulation.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Returns the number of starts; the second coordinate varies fastest.
    #[must_use]
    pub fn starts(&self) -> usize {
        self.grid.points()
    }

    /// Returns both coordinates of a start.
    #[must_use]
    pub fn values(&self, start: usize) -> [f64; 2] {
        let line = self.values[1].len();
        [self.values[0][start / line], self.values[1][start % line]]
    }

    fn state(&self, start: usize) -> Result<State, SimulationError> {
        let (mut q, mut v) = (self.q.clone(), self.v.clone());
        for (varied, value) in self.varied.iter().zip(self.values(start)) {
            if varied.is_velocity { v[varied.freedom] = value } else { q[varied.freedom] = value }
        }
        self.simulation.start_at(&q, &v)
    }

    /// Returns the end of a start, with some attractors `known`. `None` if the work is interrupted.
    fn end(
        &self,
        walk: &mut Walk<'_>,
        start: usize,
        known: &[Attractor],
        task: Task<'_>,
    ) -> Result<Option<StartOutcome>, SimulationError> {
        let map = SectionMap::new(&self.simulation)?;
        let drift = map.drift();
        let transient = self.rule.counted(&self.simulation).transient_cycles;
        // Starts of a family almost never end on the same orbit.
        if known.iter().any(|attractor| !attractor.is_family)
            && let Some(reached) = self.reach(walk, start, known, transient, (&map, &drift))?
        {
            return Ok(Some(StartOutcome::Known(reached.0, reached.1)));
        }
        let Some(cell) = self.rule.decide(&self.simulation, self.state(start)?, task)? else {
            let reason = "the limit on events is reached".to_owned();
            return Ok(if task.is_cancelled() { None } else { Some(StartOutcome::Failed(reason)) });
        };
        let (kind, cycles) = (cell.motion.kind, cell.motion.cycles);
        if matches!(kind, MotionKind::Transient | MotionKind::Undecided) {
            return Ok(Some(StartOutcome::Open(kind, cycles)));
        }
        let own = Attractor::new(&map, cell)?;
        let reached = self.reach(walk, start, std::slice::from_ref(&own), 2 * cycles, (&map, &drift))?;
        Ok(Some(StartOutcome::Own(Box::new(own), reached.map_or(cycles, |(_, reached)| reached))))
    }

    /// Returns the first of the `known` orbits that a start reaches within some cycles, and the number of these cycles.
    fn reach(
        &self,
        walk: &mut Walk<'_>,
        start: usize,
        known: &[Attractor],
        most_cycles: u64,
        (map, drift): (&SectionMap<'_>, &Drift),
    ) -> Result<Option<(usize, u64)>, SimulationError> {
        if known.iter().all(|attractor| attractor.period_cycles.is_none()) || !walk.begin(self.state(start)?)? {
            return Ok(None);
        }
        for cycle in 0..=most_cycles {
            let x = walk.x();
            if let Some(number) = known.iter().position(|attractor| attractor.holds(map, drift, x, REACHED)) {
                return Ok(Some((number, cycle)));
            }
            if cycle < most_cycles && !walk.cycle()? {
                return Ok(None);
            }
        }
        Ok(None)
    }

    /// Returns the values on which the rows depend.
    #[must_use]
    pub fn header(&self) -> Map<String, Value> {
        let mut header = Map::new();
        header.insert("axes".to_owned(), json!(self.grid.axes()));
        header.insert("flank".to_owned(), env!("CARGO_PKG_VERSION").into());
        header.insert("instructions".to_owned(), self.simulation.settings.instructions.name().into());
        header.insert("scene_sha256".to_owned(), self.hash.clone().into());
        header.insert("rule".to_owned(), json!(self.rule));
        header.insert("reached_within".to_owned(), json!(REACHED));
        header
    }

    /// Opens the file of rows in `folder`.
    ///
    /// # Errors
    /// Errors of [`Records::open`].
    pub fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Records>, SweepError> {
        Records::open(folder, Self::FILES, (begin, share), self.header(), Rows::alone(self.starts()))
    }

    /// Returns the rows of several parts, which are in `folders`, as those of an undivided run, to be finished in `out`.
    ///
    /// # Errors
    /// Errors of [`Records::merged`].
    pub fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Records, SweepError> {
        Records::merged(folders, Self::FILES, out, self.header(), Rows::alone(self.starts()))
    }

    /// Returns the first line of the table.
    #[must_use]
    pub fn head(&self) -> String {
        let pointers = self.grid.axes().iter().map(|axis| axis.pointer.as_str());
        csv_line(pointers.chain(["attractor", "cycles", "error"]))
    }

    /// Returns the attractors of some starts on a coarse grid, which have the first numbers. `None` if the work is interrupted. All parts
    /// of divided work start from the same attractors.
    ///
    /// # Errors
    /// [`SimulationError`] if the section of the scene has no map.
    pub fn survey(&self, task: Task<'_>) -> Result<Option<Vec<Attractor>>, SimulationError> {
        let places = [0, 1].map(|i| {
            let count = self.values[i].len();
            let most = count.min(SURVEY);
            (0..most).map(|k| (2 * k + 1) * count / (2 * most)).collect::<Vec<_>>()
        });
        let line = self.values[1].len();
        let starts: Vec<usize> = places[0].iter().flat_map(|i| places[1].iter().map(move |j| i * line + j)).collect();
        let (map, mut found) = (SectionMap::new(&self.simulation)?, Vec::new());
        let (drift, mut taken) = (map.drift(), 0);
        let decide = |(): &mut (), i: usize| {
            let own = || -> Result<Option<Attractor>, SimulationError> {
                let cell = self.rule.decide(&self.simulation, self.state(starts[i])?, task)?;
                let is_open = |cell: &Cell| matches!(cell.motion.kind, MotionKind::Transient | MotionKind::Undecided);
                let map = SectionMap::new(&self.simulation)?;
                cell.filter(|cell| !is_open(cell)).map(|cell| Attractor::new(&map, cell)).transpose()
            };
            // The row of a failed start gives the failure.
            (!task.is_cancelled()).then(|| own().ok().flatten())
        };
        in_order(
            0..starts.len(),
            1,
            || (),
            decide,
            |_, own: Option<Attractor>| {
                taken += 1;
                if let Some(own) = own.filter(|own| found.iter().all(|known: &Attractor| !known.is(&map, &drift, own)))
                {
                    found.push(own);
                }
                Ok::<(), SimulationError>(())
            },
        )?;
        Ok((taken == starts.len() && !task.is_cancelled()).then_some(found))
    }

    /// Computes every missing row of its share, on the threads of the current pool. A row depends only on its start: attractors are
    /// numbered in the order of the starts, after those of the `survey`.
    ///
    /// # Errors
    /// [`SweepError`] if a row cannot be stored.
    pub fn run(&self, rows: &mut Records, survey: &[Attractor], task: Task<'_>) -> Result<Ending, BasinsError> {
        let map = SectionMap::new(&self.simulation)?;
        let (drift, share) = (map.drift(), rows.share());
        // Attractors of stored rows beyond the survey; the number of a damaged row is given again.
        let mut all: Vec<Option<Attractor>> = survey.iter().cloned().map(Some).collect();
        for (number, start) in
            self.newcomers(rows, survey.len())?.into_iter().map(|((_, number), start)| (number, start))
        {
            all.resize(all.len().max(number + 1), None);
            let mut walk = Walk::new(&self.simulation)?;
            if let Some(StartOutcome::Own(own, _)) = self.end(&mut walk, start, survey, task)? {
                all[number] = Some(*own);
            }
        }
        let work = |walk: &mut Option<Walk<'_>>, i: usize| {
            if task.is_cancelled() {
                return None;
            }
            let ended = walk.as_mut().map(|walk| self.end(walk, share.chain(i), survey, task))?;
            match ended {
                Ok(ended) => ended,
                Err(error) => Some(StartOutcome::Failed(in_a_line(&error.to_string()))),
            }
        };
        for missing in rows.missing() {
            let keep = |i: usize, ended: StartOutcome| {
                let start = share.chain(i);
                let (attractor, cycles, error) = match ended {
                    StartOutcome::Known(number, cycles) => (number.to_string(), cycles.to_string(), String::new()),
                    StartOutcome::Own(own, cycles) => {
                        let is_own = |known: &Option<Attractor>| {
                            known.as_ref().is_some_and(|known| known.is(&map, &drift, &own))
                        };
                        let number = all.iter().position(is_own).unwrap_or_else(|| {
                            let free = all.iter().position(Option::is_none).unwrap_or(all.len());
                            all.resize(all.len().max(free + 1), None);
                            all[free] = Some(*own);
                            free
                        });
                        (number.to_string(), cycles.to_string(), String::new())
                    }
                    StartOutcome::Open(kind, cycles) => (kind.word().to_owned(), cycles.to_string(), String::new()),
                    StartOutcome::Failed(why) => ("failed".to_owned(), String::new(), why),
                };
                let values = self.values(start).map(number);
                rows.keep(start, &csv_line(values.into_iter().chain([attractor, cycles, error])))?;
                task.advance();
                Ok::<(), SweepError>(())
            };
            in_order(missing, 16, || Walk::new(&self.simulation).ok(), work, keep)?;
        }
        rows.sync()?;
        Ok(if rows.is_complete() { Ending::Complete } else { Ending::Interrupted })
    }

    /// Returns the first start that ends on each attractor beyond the survey, by part and number.
    fn newcomers(&self, rows: &Records, survey: usize) -> Result<BTreeMap<(usize, usize), usize>, SweepError> {
        let mut first = BTreeMap::new();
        rows.in_order(|start, row, part| {
            if let Some(number) = attractor(row).filter(|number| *number >= survey) {
                first.entry((part, number)).or_insert(start);
            }
            Ok(())
        })?;
        Ok(first)
    }

    /// Numbers the attractors in the order of the starts, measures the basins and writes the final files. `picture` draws them into the
    /// folder.
    ///
    /// # Errors
    /// [`BasinsError`] if a file cannot be read or written; the rows are kept then.
    pub fn finish(
        &self,
        mut rows: Records,
        survey: &[Attractor],
        picture: impl FnOnce(&BasinResult, &mut Folder) -> Result<(), OutputError>,
    ) -> Result<BasinResult, BasinsError> {
        let map = SectionMap::new(&self.simulation)?;
        let drift = map.drift();
        let mut attractors = survey.to_vec();
        let mut numbers: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let mut newcomers: Vec<_> = self.newcomers(&rows, survey.len())?.into_iter().collect();
        newcomers.sort_by_key(|(_, start)| *start);
        let mut walk = Walk::new(&self.simulation)?;
        for (of_part, start) in newcomers {
            let Some(StartOutcome::Own(own, _)) = self.end(&mut walk, start, survey, Task::default())? else {
                continue;
            };
            let known = attractors.iter().position(|known| known.is(&map, &drift, &own));
            numbers.insert(of_part, known.unwrap_or(attractors.len()));
            if known.is_none() {
                attractors.push(*own);
            }
        }
        let renumbered = |row: &str, part: usize| -> String {
            let number = attractor(row).and_then(|number| Some((number, *numbers.get(&(part, number))?)));
            let Some((old, new)) = number.filter(|(old, new)| old != new) else { return row.to_owned() };
            let mut fields: Vec<&str> = row.split(',').collect();
            let new = new.to_string();
            debug_assert_eq!(fields[2], old.to_string());
            fields[2] = &new;
            fields.join(",")
        };
        let mut boundary = Boundary::new([0, 1].map(|i| self.values[i].len()), attractors.len());
        rows.in_order(|_, row, part| {
            boundary.add(&renumbered(row, part));
            Ok(())
        })?;
        let figures = boundary.figures();
        let found = BasinResult { attractors: attractors.clone(), boundary, figures };
        picture(&found, rows.outputs()).map_err(SweepError::from)?;
        let others = [("attractors.json", format!("{:#}\n", self.report(&found)))];
        rows.table(&self.head(), renumbered, &others, json!(found.figures))?;
        Ok(found)
    }

    /// Returns the attractors with their fractions, and the measures.
    fn report(&self, found: &BasinResult) -> Value {
        let all = found.attractors.iter().enumerate().map(|(number, attractor)| {
            let mut entry = json!(attractor);
            // Data that only identify the attractor.
            let inner = ["rests", "scales", "contacts"];
            entry.as_object_mut().into_iter().for_each(|entry| entry.retain(|key, _| !inner.contains(&key.as_str())));
            entry["number"] = json!(number);
            entry["fraction"] = json!(found.figures.fractions[number].fraction);
            entry["standard_error"] = json!(found.figures.fractions[number].standard_error);
            entry
        });
        let freedoms = &self.simulation.structure.spec().freedoms;
        json!({
            "state": freedoms.iter().map(|f| format!("q {f}")).chain(freedoms.iter().map(|f| format!("v {f}"))).collect::<Vec<_>>(),
            "attractors": all.collect::<Vec<_>>(),
            "measures": found.figures,
        })
    }
}

/// Returns the number of the attractor in a row, if its start ends on one.
fn attractor(row: &str) -> Option<usize> {
    row.split(',').nth(2)?.parse().ok()
}

/// Error of the computation or storage of basins.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BasinsError {
    /// The scene cannot be run.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A row cannot be stored.
    #[error(transparent)]
    Sweep(#[from] SweepError),
}
