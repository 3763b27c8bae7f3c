//! The sampled trajectory as CSV.

use std::{
    fs::File,
    io::{BufWriter, Write},
    ops::ControlFlow,
};

use super::{Simulation, SimulationError};
use crate::{
    analysis::{Grid, Sample, Trajectory},
    engine::{Engine, Observer, Options, Outcome},
    hybrid::{ContactView, Instant, Mode},
    integrate::DenseStep,
    output::csv_line,
    scene::Frame,
    system::Structure,
    task::Task,
    train::frame::to_fixed,
};

/// Default samples per cycle.
const PER_CYCLE: u64 = 64;

/// Samples of a run without cycles.
const PER_RUN: f64 = 1000.0;

pub fn sample_grid(simulation: &Simulation) -> Grid {
    let run = &simulation.settings;
    let per_cycle = if run.samples_per_cycle > 0 { run.samples_per_cycle } else { PER_CYCLE };
    if simulation.clock().period().is_some() {
        // Exact: a scene allows 2²⁰ at most.
        return Grid::Phases { per_cycle: per_cycle as u32 };
    }
    let [from, _, to] = simulation.instants();
    let span = simulation.clock().between(from, to);
    Grid::Interval { interval: run.period.map_or(span / PER_RUN, |period| period / per_cycle as f64) }
}

/// Columns of samples: time, cycle, phase, coordinates, velocities, and deflection and force of each contact.
struct SampleColumns<'s> {
    structure: &'s Structure,
    /// Coordinate pairs in a rotating plane, and its speed, rad/s; empty for output in the frame of the equations.
    turning: Vec<[usize; 2]>,
    speed: f64,
}

impl<'s> SampleColumns<'s> {
    fn new(simulation: &'s Simulation) -> Self {
        let structure = &simulation.structure;
        let freedoms = &structure.spec().freedoms;
        let column = |name: String| freedoms.iter().position(|freedom| *freedom == name);
        let pair = |body| Some([column(format!("x_{body}"))?, column(format!("y_{body}"))?]);
        let speed = simulation.carrier_speed.filter(|_| simulation.settings.frame == Frame::Fixed);
        // Planets are written along and across their radius, which turns with them in any frame.
        let turning = speed.map(|_| ["s", "c", "r"].into_iter().filter_map(pair).collect()).unwrap_or_default();
        Self { structure, turning, speed: speed.unwrap_or(0.0) }
    }

    /// Returns their names; those of time, cycle and phase are the first.
    fn names(&self) -> Vec<String> {
        let spec = self.structure.spec();
        let names = spec.freedoms.iter().map(|name| name.to_owned());
        let rates = spec.freedoms.iter().map(|name| format!("{name}_rate"));
        let contacts =
            spec.contacts.iter().flat_map(|c| [format!("{} deflection", c.name), format!("{} force", c.name)]);
        ["t", "cycle", "phase"].map(String::from).into_iter().chain(names).chain(rates).chain(contacts).collect()
    }

    /// Returns the values of a sample after time, cycle and phase.
    fn values(&self, sample: &Sample<'_>) -> impl Iterator<Item = f64> {
        let n = self.structure.freedoms();
        let mut x = sample.x[..2 * n].to_vec();
        self.turn(&mut x, sample.at, n);
        let contacts = (0..self.structure.contacts().len()).flat_map(|j| {
            let (deflection, _) = self.structure.deflection(j, sample.at, sample.x);
            [deflection, self.structure.force(j, sample.mode, sample.at, sample.x)]
        });
        x.into_iter().chain(contacts)
    }

    /// Transforms into the frame at rest: positions `R q`, velocities `R (q̇ + ω × q)`.
    fn turn(&self, x: &mut [f64], at: Instant, n: usize) {
        if self.turning.is_empty() {
            return;
        }
        let angle = self.structure.clock().angle(self.speed, None, at);
        for [i, j] in &self.turning {
            let (position, rate) = ([x[*i], x[*j]], [x[n + i], x[n + j]]);
            let carried = [rate[0] - self.speed * position[1], rate[1] + self.speed * position[0]];
            [x[*i], x[*j]] = to_fixed(position, angle);
            [x[n + i], x[n + j]] = to_fixed(carried, angle);
        }
    }
}

/// Writer of samples.
pub struct SampleFile<'s> {
    columns: SampleColumns<'s>,
    file: BufWriter<File>,
    error: Option<std::io::Error>,
}

impl<'s> SampleFile<'s> {
    pub fn new(simulation: &'s Simulation, mut file: BufWriter<File>) -> Self {
        let columns = SampleColumns::new(simulation);
        let error = writeln!(file, "{}", csv_line(columns.names())).err();
        Self { columns, file, error }
    }

    /// Writes a sample; interrupts the run if that fails.
    pub fn write(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        let start = [sample.t.to_string(), sample.at.cycle.to_string(), sample.at.phase.value().to_string()];
        let cells = start.into_iter().chain(self.columns.values(sample).map(|value| value.to_string()));
        match writeln!(self.file, "{}", csv_line(cells)) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.error = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    pub fn finish(mut self) -> std::io::Result<()> {
        self.error.map_or_else(|| self.file.flush(), Err)
    }
}

/// Samples of a motion, row by row: `[rows][names]`.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SampleTable {
    /// Names of the columns, as in `trajectory.csv`: `t`, `cycle`, `phase`, the freedoms, their rates (`…_rate`), and of each contact
    /// `… deflection` and `… force`.
    pub names: Vec<String>,
    /// Values in SI units, row by row.
    pub values: Vec<f64>,
}

impl Simulation {
    /// Returns the motion from the start of the run to `end` on a grid of times, by its dense output; a sample at an event has the state
    /// after it. Times before the start give no sample. Nothing else is measured.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] for times in another order than rising; [`SimulationError`] if the run cannot start or fails. A cancelled
    /// task returns the samples up to there.
    pub fn sample(&self, grid: Grid, end: Instant, task: Task<'_>) -> Result<SampleTable, SimulationError> {
        if let Grid::Times(times) = &grid
            && !times.is_sorted()
        {
            return Err(self.missing("the times of its samples are not in rising order"));
        }
        // The run that is sampled has passed its limits, or has ended before `end`.
        let options = Options { max_events: u64::MAX, max_steps: u64::MAX, ..self.options() };
        let mut engine = Engine::new(&self.structure, self.integrator()?, options, self.start()?);
        let columns = SampleColumns::new(self);
        let mut table = SampleTable { names: columns.names(), values: Vec::new() };
        let mut trajectory = Trajectory::new(&self.structure, grid, self.instants()[0], |sample: &Sample<'_>| {
            // Exact: a run has fewer than 2⁵³ cycles.
            table.values.extend([sample.t, sample.at.cycle as f64, sample.at.phase.value()]);
            table.values.extend(columns.values(sample));
            task.flow()
        });
        // A sparse grid has no sample for a long time.
        let mut watch = CancelObserver { task };
        if engine.run(end, &mut (&mut trajectory, &mut watch))? == Outcome::ReachedEnd {
            let _ = trajectory.finish(engine.state());
        }
        Ok(table)
    }
}

/// Observer that stops a cancelled run, and looks at nothing.
pub(crate) struct CancelObserver<'a> {
    pub task: Task<'a>,
}

impl Observer for CancelObserver<'_> {
    fn wants_events(&self) -> bool {
        false
    }

    fn observed_from(&self) -> Instant {
        Instant::LAST
    }

    fn skip(&mut self, _: Instant) -> ControlFlow<()> {
        self.task.flow()
    }

    fn step(&mut self, _: &Mode, _: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        self.task.flow()
    }

    fn leap(&mut self, _: &Mode, _: f64) -> ControlFlow<()> {
        self.task.flow()
    }
}
