//! `flank run`.

use std::{
    io::{BufWriter, LineWriter},
    ops::ControlFlow,
    path::PathBuf,
};

use flank::{
    analysis::{Balance, Contacts, EventLog, Grid, Ledger, Trajectory},
    engine::Outcome,
    output::Request,
    study::StudyError,
};

use super::{
    CliError, Done, print,
    progress::{Progress, catch_interrupt},
    report,
    session::Session,
    summary::{Ending, Integrator, Provenance, Summary, Train},
    trajectory::{self, TrajectoryFile},
    watch::EventFile,
};

/// Arguments of `flank run`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Write events.jsonl and summary.json into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write trajectory.csv too (a scene with output.samples_per_cycle > 0 always does)
    #[arg(long, requires = "out")]
    trajectory: bool,
    /// Stop after this many events
    #[arg(long, value_name = "N")]
    events: Option<u64>,
    /// Check every event, and that there are no others, by two other ways; exit code 1 if one does not agree
    #[arg(long)]
    verify: bool,
    /// Write into a folder that is not empty
    #[arg(long, requires = "out")]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

const EVENTS: &str = "events.jsonl";
const TRAJECTORY: &str = "trajectory.csv";
const SUMMARY: &str = "summary.json";

/// Runs a scene.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let session = Session::open(arguments.scene.as_deref())?;
    let run = &session.case.built.run;
    let most = run.event_budget.min(arguments.events.unwrap_or(u64::MAX));
    let (mut engine, why) = session.engine(most)?;
    let warnings: Vec<String> = session.case.built.warnings.iter().map(ToString::to_string).collect();

    let sampled = arguments.trajectory || run.samples_per_cycle > 0;
    let files = [Some(EVENTS), sampled.then_some(TRAJECTORY), Some(SUMMARY)];
    let files = files.into_iter().flatten().map(String::from).collect();
    let (input, force) = (arguments.scene.as_deref(), arguments.force);
    let request = arguments.out.as_deref().map(|folder| Request { folder, command: "run", input, force, files });
    let mut folder = request.map(|request| request.open()).transpose()?;
    // Each line reaches the file as it is written.
    let mut events = EventFile::new(folder.as_mut().map(|f| f.create(EVENTS)).transpose()?.map(LineWriter::new));
    let file = folder.as_mut().filter(|_| sampled).map(|folder| folder.create(TRAJECTORY)).transpose()?;
    let mut samples = file.map(|file| TrajectoryFile::new(&session, BufWriter::new(file)));

    let structure = &session.case.structure;
    let [from, measured, end] = session.instants;
    let measures = Contacts::new(structure, Some(measured)).keep(0);
    let mut log = EventLog::new(structure, measures, |row| events.write(&row));
    let mut ledger = Ledger::new(structure);
    // A grid that is never due stands for no trajectory.
    let grid = if samples.is_some() { trajectory::grid(&session) } else { Grid::Interval { interval: 0.0 } };
    let mut trajectory = Trajectory::new(structure, grid, from, |sample| match &mut samples {
        Some(file) => file.write(sample),
        None => ControlFlow::Continue(()),
    });
    let mut progress = Progress::new(*structure.clock(), session.instants, run.period, arguments.quiet);
    let mut check = (arguments.verify || run.verify).then(|| session.case.verifier(&session.start));
    catch_interrupt();
    let result = engine.run(end, &mut (((&mut log, &mut check), &mut ledger), (&mut trajectory, &mut progress)));
    progress.finish();
    let state = engine.state();
    if let Ok(Outcome::ReachedEnd) = result {
        // A break here is a file that cannot be written: it is reported with the file.
        let _ = trajectory.finish(state);
    }
    let verified = check.as_mut().map_or(Ok(()), |check| check.finish(state.at));
    let summary = Summary {
        flank: env!("CARGO_PKG_VERSION"),
        scene: Provenance::of(&session),
        train: Train::of(&session),
        integrator: Integrator {
            asked: run.method.name(),
            tolerance: run.tolerance,
            why,
            modes: engine.integrator().chosen().into_iter().map(|(m, name)| (session.mode_in_words(m), name)).collect(),
        },
        outcome: Ending::of(&session, &result, state),
        measured_time: log.contacts().time(),
        contacts: (0..structure.contacts().len()).map(|j| log.contacts().report(j)).collect(),
        energy: ledger.balance(),
        work: engine.counters().into(),
        verification: check.as_ref().map(flank::verify::Verifier::verification),
        warnings,
    };
    let place = |name: &'static str| move |error| CliError::file(name, error);
    let written = events.finish().map_err(place(EVENTS));
    let sampled = samples.map_or(Ok(()), TrajectoryFile::finish).map_err(place(TRAJECTORY));
    folder.map_or(Ok(()), |mut folder| folder.complete(SUMMARY, &summary))?;
    written.and(sampled)?;
    if !arguments.quiet {
        print(&report::text(&session, &summary).unwrap_or_default())?;
    }
    // A difference comes before what follows from it.
    verified.map_err(StudyError::from)?;
    // The ledger takes K as symmetric, and knows rounding only.
    let (spec, steps) = (structure.spec(), engine.counters().steps);
    let is_exact = summary.integrator.modes.iter().all(|(_, name)| *name == "taylor");
    let step = structure.clock().between(from, state.at) / steps.max(1) as f64;
    let energy = structure.rounded_energy(step, summary.energy.throughput);
    let is_symmetric = spec.stiffness == spec.stiffness.transpose();
    if result.is_ok() && is_exact && is_symmetric && summary.energy.is_open(energy, steps) {
        let (closure, throughput) = (summary.energy.closure(), summary.energy.throughput);
        let beside = if throughput > 0.0 { energy / throughput } else { 0.0 };
        let rounding = Balance::rounding(steps) * (1.0 + beside);
        return Err(CliError::Energy { closure, rounding });
    }
    // A run that failed says so itself.
    if let Some(measure) = summary.overflow().filter(|_| result.is_ok()) {
        return Err(CliError::Overflow(measure));
    }
    let asked = arguments.events.is_some_and(|n| n <= run.event_budget);
    match result {
        Ok(Outcome::ReachedEnd) => Ok(Done::Completely),
        Ok(Outcome::EventBudgetSpent) if asked => Ok(Done::Completely),
        Ok(_) => Ok(Done::Partly),
        Err(error) => Err(StudyError::from(error).into()),
    }
}
