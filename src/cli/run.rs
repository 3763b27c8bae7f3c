//! `flank run`.

use std::path::PathBuf;

use flank::{hybrid::Clock, simulation::Ended};

use super::{
    CliError, Done, open, print,
    progress::{cancellable, catch_interrupt, running, show},
    report,
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

/// Runs a scene.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let simulation = open(arguments.scene.as_deref())?;
    let ([from, _, end], run) = (simulation.instants(), &simulation.settings);
    let cycles = run.period.map(|period| Clock::between(simulation.clock(), from, end) / period);
    let bar = running(arguments.quiet);
    let progress = |progress| show(&bar, progress, cycles);
    let mut job = simulation.job();
    job.task = cancellable(&progress);
    job.max_events = run.event_budget.min(arguments.events.unwrap_or(u64::MAX));
    job.verify |= arguments.verify;
    job.trajectory |= arguments.trajectory;
    job.replace = arguments.force;
    catch_interrupt();
    let record = job.attempt(arguments.out.as_deref());
    bar.finish_and_clear();
    let record = record?;
    if !arguments.quiet {
        print(&report::text(&simulation, &record).unwrap_or_default())?;
    }
    let asked = arguments.events.is_some_and(|n| n <= run.event_budget);
    match (record.failure, record.summary.outcome.kind) {
        (Some(failure), _) => Err(failure.into()),
        (None, Ended::ReachedEnd) => Ok(Done::Completely),
        (None, Ended::EventBudgetSpent) if asked => Ok(Done::Completely),
        _ => Ok(Done::Partly),
    }
}
