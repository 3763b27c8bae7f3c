//! Section points and impacts of motions along one number.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{
    cell::LEAST_CYCLES,
    plane::PlaneError,
    walk::{Record, Strike, Walk},
};
use crate::{
    orbit::{Section, SectionMap, components},
    output::{Fault, Folder, OutputError, csv_line, in_a_line, label, number, read_text},
    scene::Scene,
    simulation::{Parameter, Simulation, SimulationError},
    study::numbered,
    sweep::{
        Begin, CommandFiles, Ending, Grid, GridError, Journal, Outcome, Plan, RowWork, Seeding, Share, SweepDirection,
        SweepError, Write, run,
    },
    system::ContactMode,
    task::Task,
};

/// Starts and cycles of a diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Sampling {
    /// Number of starts at the first value: that of the scene, then others spread around it.
    pub starts: usize,
    /// Cycles dropped at each value.
    pub transient_cycles: u64,
    /// Cycles recorded at each value.
    pub recorded_cycles: u64,
}

impl Default for Sampling {
    fn default() -> Self {
        Self { starts: 1, transient_cycles: 200, recorded_cycles: 100 }
    }
}

/// Start of the next value.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seed {
    x: Vec<f64>,
    contacts: Vec<ContactMode>,
}

/// Stored rows of a diagram.
pub type DiagramRows = Journal<Record, Seed>;

/// Maximum number of points of a series that a picture shows.
const MOST_POINTS: usize = 60_000;
/// Fractional part of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Points of a picture, thinned out as their number grows.
#[derive(Clone, Debug)]
pub(super) struct ThinPoints {
    seen: u64,
    share: f64,
    /// Place in the order of removal, tag, point.
    kept: Vec<(f64, u32, [f64; 2])>,
}

impl Default for ThinPoints {
    fn default() -> Self {
        Self { seen: 0, share: 1.0, kept: Vec::new() }
    }
}

impl ThinPoints {
    fn push(&mut self, tag: u32, x: f64, y: f64) {
        // Multiples of the golden ratio are spread evenly, and so is every second, third … of them (Weyl 1916). For any period of a motion,
        // points of all its cycles stay.
        let place = (self.seen as f64 * GOLDEN).fract();
        self.seen += 1;
        if place < self.share {
            self.kept.push((place, tag, [x, y]));
        }
        if self.kept.len() > MOST_POINTS {
            self.share *= 0.5;
            self.kept.retain(|point| point.0 < self.share);
        }
    }

    /// Returns whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    /// Returns the points in their order, and the tag of each.
    pub fn points(&self) -> impl Iterator<Item = (usize, [f64; 2])> {
        self.kept.iter().map(|(_, tag, point)| (*tag as usize, *point))
    }
}

/// Indices of the series of [`Points`]: first components of section points, phases and speeds of impacts and closures, exponents.
pub(super) const SECTIONS: usize = 0;
pub(super) const PHASES: usize = 1;
pub(super) const SPEEDS: usize = 2;
pub(super) const EXPONENTS: usize = 3;
/// Ends of the bands of exponents.
pub(super) const BANDS: usize = 4;

/// Points of a diagram for a picture. Memory does not grow with their number.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Points {
    /// Least and largest value that has points.
    pub ends: [f64; 2],
    /// Number of section points.
    pub sections: u64,
    /// Number of rows that failed.
    pub failed: usize,
    /// Number of starts that run side by side.
    pub starts: usize,
    /// Series, each upwards and downwards. Tags of points are starts; tags of closures are the drive flank (0) or the back flank (1).
    pub(super) shown: [[ThinPoints; 2]; 5],
}

impl Points {
    fn new(starts: usize) -> Self {
        Self { ends: [f64::INFINITY, f64::NEG_INFINITY], sections: 0, failed: 0, starts, shown: Default::default() }
    }

    fn add(&mut self, value: f64, direction: SweepDirection, start: u32, record: &Record) {
        self.ends = [self.ends[0].min(value), self.ends[1].max(value)];
        self.sections += record.points.len() as u64;
        let down = usize::from(direction == SweepDirection::Down);
        let mut push = |shown: usize, tag: u32, y: f64| self.shown[shown][down].push(tag, value, y);
        record.points.iter().for_each(|x| push(SECTIONS, start, x[0]));
        for strike in &record.strikes {
            let flank = u32::from(strike.side < 0.0);
            push(PHASES, flank, strike.phase);
            push(SPEEDS, flank, strike.speed);
        }
        if let Some([exponent, band]) = record.exponent {
            push(EXPONENTS, start, exponent);
            [exponent - band, exponent + band].into_iter().for_each(|end| push(BANDS, start, end));
        }
    }
}

/// Diagram of the motions of a scene along one of its numbers.
#[derive(Debug)]
pub struct Diagram {
    scene: Scene,
    parameter: Parameter,
    plan: Plan,
    sampling: Sampling,
    own: Simulation,
}

/// Lines of a branch of orbits: values, and the first component at all starts of cycles.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct BranchLine {
    /// True if its orbits are stable.
    pub is_stable: bool,
    /// Values of the number.
    pub x: Vec<f64>,
    /// First component of the state.
    pub y: Vec<f64>,
}

impl Diagram {
    /// Files of `flank diagram`.
    pub const FILES: CommandFiles = CommandFiles {
        command: "diagram",
        files: &["diagram.journal", "diagram.json", "diagram.csv", "impacts.csv", "exponents.csv"],
    };

    /// Returns a diagram over `axis` of `scene`, in the directions of `seeding`.
    ///
    /// # Errors
    /// [`PlaneError`] for other than one axis of two values, and for whole numbers. Also for a scene that is invalid at the ends or has no
    /// forcing period.
    pub fn new(
        scene: Scene,
        axis: &[impl AsRef<str>],
        seeding: Seeding,
        sampling: Sampling,
    ) -> Result<Self, PlaneError> {
        let grid = Grid::parse(axis)?;
        let [axis] = grid.axes() else {
            let found = format!("{} of them", grid.axes().len());
            return Err(GridError(vec![Fault::new("the axes", found, "one, with --vary")]).into());
        };
        let pointers: Vec<&str> = axis.pointer.split(',').collect();
        let mut faults = Vec::new();
        if axis.count() < 2 {
            faults.push(super::plane::one_value(&axis.pointer));
        }
        let parameter = Parameter::new(scene.resolved(), &pointers)
            .map_err(|reason| faults.push(Fault::new(&axis.pointer, reason, "pointers to numbers of the scene")));
        if let Ok(parameter) = &parameter {
            faults.extend(super::plane::whole(&scene, parameter));
        }
        let Some(parameter) = parameter.ok().filter(|_| faults.is_empty()) else {
            return Err(GridError(faults).into());
        };
        let ends = axis.all().into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let parameter = parameter.checked(&scene, ends)?;
        let own = Simulation::from_scene(scene.clone())?.in_common_cycles()?;
        for end in ends {
            Simulation::from_built(scene.name(), parameter.build(&scene, end)?)?.period()?;
        }
        let places: Vec<String> = (0..sampling.starts).map(|start| start.to_string()).collect();
        let values: Vec<String> = axis.all().into_iter().map(number).collect();
        let grid = Grid::parse_up_to(
            &[format!("/start={}", places.join(",")), format!("/value={}", values.join(","))],
            super::MOST_CELLS,
        )?;
        Ok(Self { parameter, plan: Plan::new(grid, seeding), sampling, own, scene })
    }

    /// Returns the number of rows: one for each value, direction and start.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.plan.rows()
    }

    /// Returns the rows and their chains.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the simulation of the scene itself.
    #[must_use]
    pub fn own(&self) -> &Simulation {
        &self.own
    }

    /// Returns the pointer that is varied.
    #[must_use]
    pub fn pointer(&self) -> String {
        self.parameter.pointers().collect::<Vec<_>>().join(",")
    }

    fn simulation(&self, value: f64) -> Result<Simulation, SimulationError> {
        Simulation::from_built(self.scene.name(), self.parameter.build(&self.scene, value)?)?.in_common_cycles()
    }

    /// Returns start number `start` of `simulation`: that of the scene, then others that fill a box of two backlashes around it evenly.
    fn start(simulation: &Simulation, start: usize) -> Result<crate::engine::State, SimulationError> {
        if start == 0 {
            return simulation.start();
        }
        let backlash = simulation.structure.spec().contacts.iter().map(|c| c.half_backlash).fold(0.0, f64::max);
        let reach =
            if backlash > 0.0 { 2.0 * backlash } else { simulation.q0.iter().fold(0.0, |m: f64, q| m.max(q.abs())) };
        let omega = simulation.clock().omega();
        // Multiples of square roots of primes are spread evenly (Weyl 1916). A start inside a rigid flank is replaced by a later one.
        let spread = |i: usize, k: usize| 2.0 * (k as f64 * PRIMES[i % PRIMES.len()].sqrt()).fract() - 1.0;
        let n = simulation.q0.len();
        let mut last = simulation.start();
        for attempt in 0..ATTEMPTS {
            let k = start + attempt * 1000;
            let q: Vec<f64> = (0..n).map(|i| simulation.q0[i] + reach * spread(2 * i, k)).collect();
            let v: Vec<f64> = (0..n).map(|i| simulation.v0[i] + reach * omega * spread(2 * i + 1, k)).collect();
            last = simulation.start_at(&q, &v);
            if last.is_ok() {
                break;
            }
        }
        last
    }

    fn point(&self, cell: &RowWork, seed: Option<&Seed>) -> Result<(Record, Seed), SimulationError> {
        let simulation = self.simulation(cell.values[1])?;
        let map = SectionMap::new(&simulation)?;
        let section = |seed: &Seed| Section { x: seed.x.clone(), contacts: seed.contacts.clone() };
        let seeded = seed.and_then(|seed| map.state(&section(seed)).ok());
        // Exact: the values are whole numbers.
        let start = seeded.map_or_else(|| Self::start(&simulation, cell.values[0] as usize), Ok)?;
        let mut walk = Walk::new(&simulation)?;
        let stopped = || {
            simulation.missing("its run stops within the cycles asked for, as a rule by its limit on events: raise it")
        };
        if !walk.begin(start)? {
            return Err(stopped());
        }
        for _ in 0..simulation.cycles_in(self.sampling.transient_cycles, LEAST_CYCLES) {
            if !walk.cycle()? {
                return Err(stopped());
            }
        }
        let record = walk.record(self.sampling.recorded_cycles)?.ok_or_else(stopped)?;
        let Section { x, contacts } = walk.section();
        Ok((record, Seed { x, contacts }))
    }

    /// Returns the values on which the rows depend.
    #[must_use]
    pub fn header(&self) -> Map<String, Value> {
        let mut header = self.plan.header();
        header.insert("pointers".to_owned(), json!(self.pointer()));
        header.insert("flank".to_owned(), env!("CARGO_PKG_VERSION").into());
        header.insert("instructions".to_owned(), self.own.settings.instructions.name().into());
        header.insert("scene_sha256".to_owned(), self.scene.hash().into());
        header.insert("sampling".to_owned(), json!(self.sampling));
        header
    }

    /// Opens the journal of rows in `folder`.
    ///
    /// # Errors
    /// Errors of [`Journal::open`].
    pub fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<DiagramRows>, SweepError> {
        Journal::open_for(Self::FILES, folder, (begin, share), self.header(), &self.plan)
    }

    /// Returns the rows of several parts, which are in `folders`, as those of an undivided run, to be finished in `out`.
    ///
    /// # Errors
    /// Errors of [`Records::merged`](crate::sweep::Records::merged).
    pub fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<DiagramRows, SweepError> {
        Journal::merged(folders, Self::FILES, out, self.header(), &self.plan)
    }

    /// Computes every missing row.
    ///
    /// # Errors
    /// [`SweepError`] if a row cannot be stored.
    pub fn run(&self, rows: &mut DiagramRows, task: Task<'_>) -> Result<Ending, SweepError> {
        let point = |cell: &RowWork, seed: Option<&Seed>| {
            self.point(cell, seed).map_err(|error| format!("{} = {}: {error}", self.pointer(), number(cell.values[1])))
        };
        run(&self.plan, rows, point, task)
    }

    /// Returns the column that names the number, and the first ones of all tables.
    fn head<'a>(more: impl IntoIterator<Item = &'a str>) -> String {
        csv_line(["parameter", "direction", "start"].into_iter().chain(more))
    }

    /// Writes the final files. `picture` draws the diagram into the folder.
    ///
    /// # Errors
    /// [`SweepError::Output`] if a file cannot be read or written.
    pub fn finish(
        &self,
        mut rows: DiagramRows,
        picture: impl FnOnce(&Points, &mut Folder) -> Result<(), OutputError>,
    ) -> Result<Points, SweepError> {
        let mut points = Points::new(self.sampling.starts);
        rows.each(|row, outcome| {
            let cell = self.plan.cell(row);
            match outcome {
                Outcome::Done { result, .. } => {
                    points.add(cell.values[1], cell.direction, cell.values[0] as u32, &result)
                }
                Outcome::Failed(_) => points.failed += 1,
            }
            Ok(())
        })?;
        rows.draw(|folder| picture(&points, folder))?;
        let found = json!({ "rows": self.rows(), "failed": points.failed });
        let contacts = numbered(self.own.structure.contacts().iter().map(|contact| &*contact.spec.name));
        let components = components(&self.own);
        let write = |table: usize, row: usize, outcome: Outcome<Record, Seed>, line: &mut Write<'_>| {
            let cell = self.plan.cell(row);
            let start = [number(cell.values[1]), label(cell.direction), (cell.values[0] as usize).to_string()];
            let start = start.iter().map(String::as_str);
            match (table, outcome) {
                (0, Outcome::Done { result, .. }) => {
                    for (cycle, x) in result.points.iter().enumerate() {
                        let x: Vec<String> = x.iter().copied().map(number).collect();
                        let cycle = cycle.to_string();
                        line(&csv_line(start.clone().chain([cycle.as_str()]).chain(x.iter().map(String::as_str))))?;
                    }
                }
                (1, Outcome::Done { result, .. }) => {
                    for Strike { cycle, contact, side, phase, speed } in &result.strikes {
                        let side = if *side > 0.0 { "drive" } else { "back" };
                        let (cycle, phase, speed) = (cycle.to_string(), number(*phase), number(*speed));
                        let of = [cycle.as_str(), &contacts[*contact], side, &phase, &speed];
                        line(&csv_line(start.clone().chain(of)))?;
                    }
                }
                (2, Outcome::Done { result, .. }) => {
                    let cells = result.exponent.map_or([const { String::new() }; 2], |e| e.map(number));
                    line(&csv_line(start.chain(cells.iter().map(String::as_str)).chain([""])))?;
                }
                (2, Outcome::Failed(why)) => {
                    let why = in_a_line(&why);
                    line(&csv_line(start.chain(["", "", why.as_str()])))?;
                }
                _ => {}
            }
            Ok(())
        };
        let heads = [
            Self::head(["cycle"].into_iter().chain(components.iter().map(String::as_str))),
            Self::head(["cycle", "contact", "side", "phase", "speed"]),
            Self::head(["exponent", "exponent_band", "error"]),
        ];
        let names = ["diagram.csv", "impacts.csv", "exponents.csv"];
        let tables: Vec<_> = names.into_iter().zip(heads.map(Some)).collect();
        rows.seal(&tables, write, &[("found", found)])?;
        Ok(points)
    }

    /// Returns the branches that `flank continue` has written into `folder`: the first component of their orbits at all starts of cycles.
    ///
    /// # Errors
    /// The fault of the folder, in words.
    pub fn branches(&self, folder: &Path) -> Result<Vec<BranchLine>, String> {
        let path = folder.join("branches.csv");
        let text = read_text(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut lines = text.lines();
        let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let names = components(&self.own);
        let place = |name: &str| head.iter().position(|other| *other == name);
        let columns: Option<Vec<usize>> = names.iter().map(|name| place(name)).collect();
        let wanted = ["branch", "parameter", "period_cycles", "stable"].map(place);
        let (Some(columns), [Some(branch), Some(value), Some(period), Some(stable)]) = (columns, wanted) else {
            return Err(format!("{} is no table of branches of this train", path.display()));
        };
        let (mut all, mut last): (Vec<BranchLine>, Option<(String, bool, u64)>) = (Vec::new(), None);
        for line in lines {
            // Words come before the state and contain no commas.
            let fields: Vec<&str> = line.split(',').collect();
            let numbers: Option<Vec<f64>> = columns.iter().map(|i| fields.get(*i)?.parse().ok()).collect();
            let (Some(x), Some(Ok(value)), Some(Ok(period))) =
                (numbers, fields.get(value).map(|w| w.parse::<f64>()), fields.get(period).map(|w| w.parse::<u64>()))
            else {
                continue;
            };
            let is_stable = fields.get(stable).is_some_and(|word| *word == "true");
            let of = (fields[branch].to_owned(), is_stable, period);
            if last.as_ref() != Some(&of) {
                let new = (0..period).map(|_| BranchLine { is_stable, ..BranchLine::default() });
                all.extend(new);
                last = Some(of);
            }
            let count = all.len();
            let lines = &mut all[count - period as usize..];
            let simulation = self.simulation(value).map_err(|error| error.to_string())?;
            let map = SectionMap::new(&simulation).map_err(|error| error.to_string())?;
            let mut section =
                Section { x, contacts: vec![ContactMode::Separated; simulation.structure.contacts().len()] };
            for line in lines {
                line.x.push(value);
                line.y.push(section.x[0]);
                if period > 1 {
                    section = map.follow(&section, 1).map_err(|error| error.to_string())?;
                }
            }
        }
        Ok(all)
    }
}

/// Small primes: their square roots are independent.
const PRIMES: [f64; 12] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0];
/// Maximum number of candidates tried for one start.
const ATTEMPTS: usize = 32;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_all_cycles_stay_where_they_are_thinned() {
        let (mut points, count) = (ThinPoints::default(), 7 * MOST_POINTS);
        // A motion of period 8: every second, fourth or eighth point would leave most of it out.
        (0..count).for_each(|i| points.push(0, i as f64, (i % 8) as f64));
        let (x, y): (Vec<f64>, Vec<f64>) = points.points().map(|(_, [x, y])| (x, y)).unzip();
        assert!((MOST_POINTS / 2 - 2..=MOST_POINTS).contains(&x.len()), "{}", x.len());
        assert!(x.is_sorted());
        for cycle in 0..8 {
            let share = y.iter().filter(|y| **y == f64::from(cycle)).count() as f64 / y.len() as f64;
            assert!((share - 0.125).abs() < 1e-3, "{cycle}: {share}");
        }
    }
}
