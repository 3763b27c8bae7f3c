use std::{
    cell::Cell,
    collections::BTreeSet,
    io::BufWriter,
    ops::{ControlFlow, Deref},
    path::Path,
};

use super::{
    IntegratorUsed, Provenance, RunEnd, Simulation, SimulationError, Summary, TrainUsed,
    rows::EventRows,
    samples::{SampleFile, sample_grid},
};
use crate::{
    analysis::{Bearings, Contacts, EventLog, EventRow, Grid, Ledger, Trajectory, TransmissionError, of_train},
    engine::{Observer, Outcome, State},
    event::EventRecord,
    hybrid::{Clock, Instant, Mode},
    integrate::{Choice, DenseStep},
    output::Request,
    tangent::Inherited,
    task::{Progress, Task},
};

const EVENTS: &str = "events.jsonl";
const TABLE: &str = "events.csv";
const TRAJECTORY: &str = "trajectory.csv";
const SUMMARY: &str = "summary.json";

/// Steps between two reports of progress.
const EVERY: u32 = 64;
/// Harmonics of the transmission errors.
const HARMONICS: usize = 8;

/// One run of a [`Simulation`], with its options. The fields are initialised from the settings of the simulation.
#[must_use = "a job does nothing until it runs or writes"]
pub struct Job<'a> {
    /// Simulation that runs.
    pub simulation: &'a Simulation,
    /// Observer of the run, which may interrupt it.
    pub observer: Option<&'a mut dyn Observer>,
    /// Task that cancels and follows the run. A cancelled run gives a record too.
    pub task: Task<'a>,
    /// Number of events after which the run stops.
    pub max_events: u64,
    /// True to check every event in two other ways; see [`verify`](crate::verify).
    pub verify: bool,
    /// True to write `trajectory.csv` too, with 64 samples per cycle by default.
    pub trajectory: bool,
    /// True to write `events.jsonl` and `events.csv`, or to store the rows of events in the record. Without them a long run takes neither
    /// disk space nor memory.
    pub log: bool,
    /// Receives the rows of events in place of the record, and may stop the run.
    pub rows: Option<&'a mut (dyn FnMut(EventRow) -> ControlFlow<()> + 'a)>,
    /// True to replace the files of an earlier run, and no others, in a folder that is not empty.
    pub replace: bool,
}

/// Record of a run. It dereferences to its [`Summary`]: `record.contacts`, `record.energy`.
#[derive(Debug)]
#[non_exhaustive]
pub struct RunRecord {
    /// Measures, with their origin.
    pub summary: Summary,
    /// A row of every event; empty after [`Job::write`], which has them in `events.jsonl`, and with [`Job::rows`].
    pub events: Vec<EventRow>,
    /// State at the end of the run.
    pub end: State,
    /// Reason for which the numbers must not be used, if any.
    pub failure: Option<SimulationError>,
}

impl Deref for RunRecord {
    type Target = Summary;

    fn deref(&self) -> &Summary {
        &self.summary
    }
}

impl<'a> Job<'a> {
    pub(super) fn new(simulation: &'a Simulation) -> Self {
        let run = &simulation.settings;
        Self {
            simulation,
            observer: None,
            task: Task::default(),
            max_events: run.event_budget,
            verify: run.verify,
            trajectory: run.samples_per_cycle > 0,
            log: true,
            rows: None,
            replace: false,
        }
    }

    /// Runs to the end and stores a row of every event.
    ///
    /// # Errors
    /// [`SimulationError`] if the run cannot start, fails, or contradicts itself.
    pub fn run(self) -> Result<RunRecord, SimulationError> {
        self.attempt(None).and_then(RunRecord::sound)
    }

    /// Runs to the end and writes `events.jsonl`, `summary.json`, the manifest, and `trajectory.csv` if requested.
    ///
    /// # Errors
    /// Errors of [`run`](Self::run); [`SimulationError::Output`] or [`SimulationError::File`] if a file cannot be written. Files already
    /// written are kept.
    pub fn write(self, folder: impl AsRef<Path>) -> Result<RunRecord, SimulationError> {
        self.attempt(Some(folder.as_ref())).and_then(RunRecord::sound)
    }

    /// Runs as [`write`](Self::write) does, or as [`run`](Self::run) without a folder, and returns the record of a failed run too.
    ///
    /// # Errors
    /// [`SimulationError`] if the run cannot start or a file cannot be written.
    pub fn attempt(self, folder: Option<&Path>) -> Result<RunRecord, SimulationError> {
        let Self { simulation, mut observer, task, mut rows, .. } = self;
        let (run, structure) = (&simulation.settings, &simulation.structure);
        let start = simulation.start()?;
        let mut check = self.verify.then(|| simulation.verifier(&start));
        let (is_kept, mut kept) = (folder.is_none() && self.log, Vec::new());
        let logged = self.log && folder.is_some();
        let is_read = is_kept || logged || rows.is_some();
        let amplified = Cell::new(None);
        let left_out = simulation.options().left_out();
        let inherit = || Inherited::new(structure, &start, left_out, &amplified);
        let mut inherited = (run.inherited_uncertainty && is_read).then(inherit);
        let (mut engine, why) = simulation.limited(start, self.max_events)?;

        let sampled = self.trajectory && folder.is_some();
        let logs = logged.then_some([EVENTS, TABLE]).into_iter().flatten();
        let files = logs.chain(sampled.then_some(TRAJECTORY)).chain([SUMMARY]).map(String::from).collect();
        let (input, force) = (simulation.file.as_deref(), self.replace);
        let request = folder.map(|folder| Request { folder, command: "run", input, force, files });
        let mut folder = request.map(|request| request.open()).transpose()?;
        let mut file = |name: &str| folder.as_mut().filter(|_| logged).map(|folder| folder.create(name)).transpose();
        let files = [file(EVENTS)?, file(TABLE)?];
        let mut keep = |row| {
            if let Some(take) = &mut rows {
                return take(row);
            }
            if is_kept {
                kept.push(row);
            }
            ControlFlow::Continue(())
        };
        let mut rows = EventRows::new(files, simulation.dimensionless, &mut keep)
            .map_err(|error| SimulationError::File(TABLE, error))?;
        let file = folder.as_mut().filter(|_| sampled).map(|folder| folder.create(TRAJECTORY)).transpose()?;
        let mut samples = file.map(|file| SampleFile::new(simulation, BufWriter::new(file)));

        let [from, measured, end] = simulation.instants();
        let measures = Contacts::new(structure, Some(measured)).keep(0);
        let mut log = EventLog::new(structure, measures, |mut row: EventRow| {
            row.inherited_uncertainty = amplified.get();
            rows.take(row)
        });
        if !is_read {
            log = log.silent();
        }
        let mut ledger = Ledger::new(structure).since(measured);
        let contacts = 0..structure.contacts().len();
        let mut transmission = TransmissionError::new(structure, contacts.clone(), HARMONICS, Some(measured));
        let mut bearings = Bearings::new(structure, Some(measured));
        // A grid that is never due stands for no trajectory.
        let grid = if sampled { sample_grid(simulation) } else { Grid::Interval { interval: 0.0 } };
        let mut trajectory = Trajectory::new(structure, grid, from, |sample| match &mut samples {
            Some(file) => file.write(sample),
            None => ControlFlow::Continue(()),
        });
        let clock = structure.clock();
        let mut watch = ProgressObserver { task, clock, at: from, from, span: clock.between(from, end), steps: 0 };
        let measures = ((&mut log, &mut check), (&mut ledger, (&mut transmission, &mut bearings)));
        let result = engine.run(end, &mut (((&mut inherited, measures), (&mut trajectory, &mut watch)), &mut observer));
        let state = engine.state();
        if let Ok(Outcome::ReachedEnd) = result {
            // An interruption here is a file that cannot be written: it is reported with the file.
            let _ = trajectory.finish(state);
        }
        let verified = check.as_mut().map_or(Ok(()), |check| check.finish(state.at));
        let name = |(mode, name): (Mode, _)| (simulation.mode_name(&mode), name);
        // Pieces of a stiffness make modes of the same states.
        let mut told = BTreeSet::new();
        let mut summary = Summary {
            flank: env!("CARGO_PKG_VERSION"),
            scene: Provenance { name: simulation.name.clone(), sha256: simulation.hash() },
            train: TrainUsed {
                kind: simulation.kind().to_owned(),
                freedoms: structure.spec().freedoms.clone(),
                dimensionless: simulation.dimensionless,
                cycle: run.period,
            },
            common_cycle: simulation.clock().period().and_then(|_| structure.common_cycle().ok()),
            integrator: IntegratorUsed {
                asked: run.method.name(),
                tolerance: run.tolerance,
                event_tolerance: run.event_tolerance,
                instructions: run.instructions.name(),
                why,
                modes: engine
                    .integrator()
                    .chosen()
                    .into_iter()
                    .map(name)
                    .filter(|mode| told.insert(mode.clone()))
                    .collect(),
            },
            outcome: RunEnd::new(simulation, &result, task.is_cancelled(), state),
            measured_time: log.contacts().time(),
            contacts: of_train(contacts.map(|j| log.contacts().report(j)).collect(), structure),
            transmission: transmission.reports(),
            bearings: bearings.reports(),
            energy: ledger.balance(),
            work: engine.counters(),
            verification: check.as_ref().map(crate::verify::Verifier::verification),
            warnings: simulation.warnings_in_words(),
        };
        let end = state.clone();
        let step = clock.between(measured, state.at).max(0.0) / ledger.steps().max(1) as f64;
        // A difference is reported before its consequences; a failed run has a reason already.
        let failure = verified.err().map(SimulationError::from).or_else(|| match result {
            Ok(_) => alarm(simulation, &summary, (ledger.steps(), step, ledger.reach()), left_out),
            Err(error) => Some(error.into()),
        });
        if let Some(failure) = &failure {
            summary.outcome.fail(failure);
        }
        let written = rows.finish();
        let sampled = samples.map_or(Ok(()), SampleFile::finish);
        folder.map_or(Ok(()), |mut folder| folder.complete(SUMMARY, &summary))?;
        written.map_err(|error| SimulationError::File(EVENTS, error))?;
        sampled.map_err(|error| SimulationError::File(TRAJECTORY, error))?;
        Ok(RunRecord { summary, events: kept, end, failure })
    }
}

impl RunRecord {
    /// Returns the record, if its numbers can be used.
    fn sound(mut self) -> Result<Self, SimulationError> {
        self.failure.take().map_or(Ok(self), Err)
    }
}

/// Returns the contradiction in the numbers of a run, if any. The measured time has `steps` steps of `step` seconds on average, with the
/// truncation `left_out` of the rates; `reach` is the largest size of each component of the state in it.
fn alarm(
    simulation: &Simulation,
    summary: &Summary,
    (steps, step, reach): (u64, f64, &[f64]),
    left_out: f64,
) -> Option<SimulationError> {
    // The ledger assumes a symmetric K, and includes rounding and truncation only.
    let spec = simulation.structure.spec();
    let modes = &summary.integrator.modes;
    // A method that was requested by name lists no modes.
    let is_exact = modes.iter().all(|(_, name)| *name == "taylor")
        && (!modes.is_empty() || simulation.settings.method == Choice::Taylor);
    let is_symmetric = spec.stiffness == spec.stiffness.transpose();
    let throughput = summary.energy.throughput;
    let energy = simulation.structure.rounded_energy(step, throughput);
    let held = simulation.structure.held_energy(reach, throughput);
    // Each degree of freedom has a kinetic energy and that of springs: products of two factors, each with an error of twice the truncation.
    let left_out = 8.0 * spec.freedoms.len() as f64 * left_out;
    let limit = summary.energy.limit([energy, held], steps, left_out);
    if is_exact && is_symmetric && summary.energy.residual.abs() > limit {
        let rounding = if throughput > 0.0 { limit / throughput } else { limit };
        return Some(SimulationError::Energy { closure: summary.energy.closure(), rounding });
    }
    summary.overflow().map(SimulationError::Overflow)
}

/// Observer that reports the progress of a run, and interrupts it once its task is cancelled.
struct ProgressObserver<'a> {
    task: Task<'a>,
    clock: &'a Clock,
    /// Start of the last step, or end of the last leap or event.
    at: Instant,
    from: Instant,
    span: f64,
    steps: u32,
}

impl ProgressObserver<'_> {
    /// Counts a step or leap; the run has reached `at`.
    fn count(&mut self, at: Instant) -> ControlFlow<()> {
        self.at = at;
        self.steps = (self.steps + 1) % EVERY;
        if self.steps == 0 {
            self.report();
        }
        self.task.flow()
    }

    fn report(&self) {
        self.task.report(Progress::Share(self.clock.between(self.from, self.at) / self.span));
    }
}

impl Observer for ProgressObserver<'_> {
    fn observed_from(&self) -> Instant {
        Instant::LAST
    }

    fn skip(&mut self, at: Instant) -> ControlFlow<()> {
        self.at = at;
        self.report();
        self.task.flow()
    }

    fn step(&mut self, _: &Mode, step: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        self.count(step.start())
    }

    fn leap(&mut self, _: &Mode, time: f64) -> ControlFlow<()> {
        self.count(self.clock.advance(self.at, time))
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.at = record.at;
        self.task.flow()
    }
}
