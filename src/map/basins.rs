//! Where each start of a plane of starts ends.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde_json::{Map, Value, json};

use super::{
    attractor::Attractor,
    cell::{Cell, Rule},
    edges::{Boundary, Figures},
    plane::{PlaneError, Varied, two_axes, varied},
    walk::Walk,
};
use crate::{
    engine::State,
    ensemble::in_order,
    orbit::{Drift, Kind, SectionMap},
    output::{Fault, Folder, OutputError, csv_line, in_a_line, number},
    scene::Scene,
    simulation::{Simulation, SimulationError},
    sweep::{Begin, Ending, Grid, GridError, Kept, Records, Rows, Share, SweepError},
    task::Task,
};

/// Distance from an orbit, in its scales, within which a start has reached it.
const REACHED: f64 = 1e-6;
/// Starts along each axis that attractors are looked for from first, at most.
const SURVEY: usize = 24;

/// What comes of one start.
enum Ended {
    /// On a known attractor, after so many cycles.
    Known(usize, u64),
    /// On one that is described by itself.
    Own(Box<Attractor>, u64),
    /// Of a kind that is no attractor.
    Open(Kind, u64),
    Failed(String),
}

/// The basins of attraction of a scene in a plane of its starts.
#[derive(Debug)]
pub struct Basins {
    simulation: Simulation,
    hash: String,
    grid: Grid,
    varied: [Varied; 2],
    values: [Vec<f64>; 2],
    q: Vec<f64>,
    v: Vec<f64>,
    rule: Rule,
}

/// What is known of all starts together.
#[derive(Clone, Debug)]
pub struct Found {
    /// The attractors, in the order of their numbers.
    pub attractors: Vec<Attractor>,
    /// What a picture shows and what is measured.
    pub boundary: Boundary,
    /// Measures.
    pub figures: Figures,
}

impl Basins {
    /// The files of `flank basins`.
    pub const FILES: Kept =
        Kept { command: "basins", files: &["basins.rows", "basins.json", "basins.csv", "attractors.json"] };

    /// Starts of `scene` over two `axes`, `/initial/q/I` or `/initial/v/I`, I a number or a name of a freedom. The other coordinates and
    /// velocities are those that the scene writes, and zero where it writes none or starts `static` or at `rest`.
    ///
    /// # Errors
    /// [`PlaneError`] for other axes, and for a scene without a forcing period.
    pub fn new(scene: Scene, axes: &[impl AsRef<str>], rule: Rule) -> Result<Self, PlaneError> {
        let grid = two_axes(axes)?;
        let (hash, is_written) = (scene.hash(), scene.resolved()["initial"].is_object());
        let simulation = Simulation::from_scene(scene)?.in_common_cycles()?;
        let mut faults = Vec::new();
        let freedoms = &simulation.structure.spec().freedoms;
        let found: Vec<Varied> = grid
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
        let rule = Rule { averages: true, ..rule };
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

    /// How many starts; the second number runs fastest.
    #[must_use]
    pub fn starts(&self) -> usize {
        self.grid.points()
    }

    /// Both numbers of a start.
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

    /// Where a start ends, with some attractors `known`. `None` if the work is broken off.
    fn end(
        &self,
        walk: &mut Walk<'_>,
        start: usize,
        known: &[Attractor],
        task: Task<'_>,
    ) -> Result<Option<Ended>, SimulationError> {
        let map = SectionMap::new(&self.simulation)?;
        let drift = map.drift();
        let transient = self.rule.counted(&self.simulation).transient_cycles;
        // Starts of a family hardly ever end on the same orbit.
        if known.iter().any(|attractor| !attractor.is_family)
            && let Some(reached) = self.reach(walk, start, known, transient, (&map, &drift))?
        {
            return Ok(Some(Ended::Known(reached.0, reached.1)));
        }
        let Some(cell) = self.rule.decide(&self.simulation, self.state(start)?, task)? else {
            let reason = "the limit on events is reached".to_owned();
            return Ok(if task.is_cancelled() { None } else { Some(Ended::Failed(reason)) });
        };
        let (kind, cycles) = (cell.motion.kind, cell.motion.cycles);
        if matches!(kind, Kind::Transient | Kind::Undecided) {
            return Ok(Some(Ended::Open(kind, cycles)));
        }
        let own = Attractor::new(&map, cell)?;
        let reached = self.reach(walk, start, std::slice::from_ref(&own), 2 * cycles, (&map, &drift))?;
        Ok(Some(Ended::Own(Box::new(own), reached.map_or(cycles, |(_, reached)| reached))))
    }

    /// The first of the `known` orbits that a start reaches within some cycles, and after how many.
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

    /// What the rows depend on.
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
    /// As [`Records::open`].
    pub fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Records>, SweepError> {
        Records::open(folder, Self::FILES, (begin, share), self.header(), Rows::alone(self.starts()))
    }

    /// The rows of so many parts, which are in `folders`, as those of an undivided run, to be finished in `out`.
    ///
    /// # Errors
    /// As [`Records::merged`].
    pub fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Records, SweepError> {
        Records::merged(folders, Self::FILES, out, self.header(), Rows::alone(self.starts()))
    }

    /// The first line of the table.
    #[must_use]
    pub fn head(&self) -> String {
        let pointers = self.grid.axes().iter().map(|axis| axis.pointer.as_str());
        csv_line(pointers.chain(["attractor", "cycles", "error"]))
    }

    /// The attractors that some starts on a coarse grid lead to: the first numbers. `None` if the work is broken off. All parts of divided
    /// work start from the same ones.
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
                let is_open = |cell: &Cell| matches!(cell.motion.kind, Kind::Transient | Kind::Undecided);
                let map = SectionMap::new(&self.simulation)?;
                cell.filter(|cell| !is_open(cell)).map(|cell| Attractor::new(&map, cell)).transpose()
            };
            // A start that fails has a row that says so.
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

    /// Computes every row of its share that is not kept, on the threads of the pool it is called in. A row depends on nothing but
    /// its start: numbers of attractors are given in the order of the starts, after those of the `survey`.
    ///
    /// # Errors
    /// [`SweepError`] if a row cannot be kept.
    pub fn run(&self, rows: &mut Records, survey: &[Attractor], task: Task<'_>) -> Result<Ending, BasinsError> {
        let map = SectionMap::new(&self.simulation)?;
        let (drift, share) = (map.drift(), rows.share());
        // What rows that are kept have found beyond the survey; a number whose rows are damaged is given again.
        let mut all: Vec<Option<Attractor>> = survey.iter().cloned().map(Some).collect();
        for (number, start) in
            self.newcomers(rows, survey.len())?.into_iter().map(|((_, number), start)| (number, start))
        {
            all.resize(all.len().max(number + 1), None);
            let mut walk = Walk::new(&self.simulation)?;
            if let Some(Ended::Own(own, _)) = self.end(&mut walk, start, survey, task)? {
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
                Err(error) => Some(Ended::Failed(in_a_line(&error.to_string()))),
            }
        };
        for missing in rows.missing() {
            let keep = |i: usize, ended: Ended| {
                let start = share.chain(i);
                let (attractor, cycles, error) = match ended {
                    Ended::Known(number, cycles) => (number.to_string(), cycles.to_string(), String::new()),
                    Ended::Own(own, cycles) => {
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
                    Ended::Open(kind, cycles) => (kind.word().to_owned(), cycles.to_string(), String::new()),
                    Ended::Failed(why) => ("failed".to_owned(), String::new(), why),
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

    /// The first start that ends on each attractor beyond the survey, by part and number.
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
    /// [`BasinsError`] if a file cannot be read or written; the rows stay then.
    pub fn finish(
        &self,
        mut rows: Records,
        survey: &[Attractor],
        picture: impl FnOnce(&Found, &mut Folder) -> Result<(), OutputError>,
    ) -> Result<Found, BasinsError> {
        let map = SectionMap::new(&self.simulation)?;
        let drift = map.drift();
        let mut attractors = survey.to_vec();
        let mut numbers: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let mut newcomers: Vec<_> = self.newcomers(&rows, survey.len())?.into_iter().collect();
        newcomers.sort_by_key(|(_, start)| *start);
        let mut walk = Walk::new(&self.simulation)?;
        for (of_part, start) in newcomers {
            let Some(Ended::Own(own, _)) = self.end(&mut walk, start, survey, Task::default())? else { continue };
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
        let found = Found { attractors: attractors.clone(), boundary, figures };
        picture(&found, rows.outputs()).map_err(SweepError::from)?;
        let others = [("attractors.json", format!("{:#}\n", self.report(&found)))];
        rows.table(&self.head(), renumbered, &others, json!(found.figures))?;
        Ok(found)
    }

    /// The attractors with their fractions, and the measures.
    fn report(&self, found: &Found) -> Value {
        let all = found.attractors.iter().enumerate().map(|(number, attractor)| {
            let mut entry = json!(attractor);
            // What tells it from others.
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

/// Number of the attractor in a row, if its start ends on one.
fn attractor(row: &str) -> Option<usize> {
    row.split(',').nth(2)?.parse().ok()
}

/// Why basins cannot be computed or kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BasinsError {
    /// The scene cannot be run.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A row cannot be kept.
    #[error(transparent)]
    Sweep(#[from] SweepError),
}
