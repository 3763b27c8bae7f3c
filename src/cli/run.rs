//! `flank run`.

use std::{fmt::Write, path::PathBuf};

use flank::{
    Simulation,
    analysis::ContactReport,
    hybrid::Clock,
    output::{Table, five_digits as number, label},
    scene::{Duration, strict},
    simulation::{Ended, Summary},
};

use super::{
    CliError, Done, open, print,
    progress::{cancellable, catch_interrupt, running, show},
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
    /// Refuse a scene with warnings; exit code 2
    #[arg(long)]
    strict: bool,
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
    if arguments.strict && !simulation.warnings.is_empty() {
        return Err(CliError::Arguments(strict(&simulation.warnings, "--strict")));
    }
    let ([from, _, end], run) = (simulation.instants(), &simulation.settings);
    let cycles = run.period.map(|period| Clock::between(simulation.clock(), from, end) / period);
    if let Some(warning) = simulation.budget_warning().filter(|_| !arguments.quiet) {
        eprintln!("warning: {warning}");
    }
    let bar = running(arguments.quiet);
    let progress = |progress| show(&bar, progress, cycles);
    let mut job = simulation.job();
    job.task = cancellable(&progress);
    job.max_events = run.event_budget.min(arguments.events.unwrap_or(u64::MAX));
    job.verify |= arguments.verify;
    job.trajectory |= arguments.trajectory;
    job.replace = arguments.force;
    let working = catch_interrupt();
    let record = job.attempt(arguments.out.as_deref());
    drop(working);
    bar.finish_and_clear();
    let record = record?;
    if !arguments.quiet {
        print(&text(&simulation, &record).unwrap_or_default())?;
    }
    let asked = arguments.events.is_some_and(|n| n <= run.event_budget);
    match (record.failure, record.summary.outcome.kind) {
        (Some(failure), _) => Err(failure.into()),
        (None, Ended::ReachedEnd) => Ok(Done::Completely),
        (None, Ended::EventBudgetSpent) if asked => Ok(Done::Completely),
        _ => Ok(Done::Partly),
    }
}

/// The whole report.
fn text(simulation: &Simulation, summary: &Summary) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let train = &summary.train;
    let closed = simulation.structure.contacts().len();
    writeln!(out, "{}  ({}, {} freedoms, {closed} contacts)", summary.scene.name, train.kind, train.freedoms.len())?;
    let s = simulation.unit("s");
    let ending = &summary.outcome;
    let asked = match simulation.settings.duration {
        Duration::Cycles(n) => format!("{n} cycles"),
        Duration::Until(end) => format!("until t = {end}"),
    };
    let kind = label(ending.kind).replace('-', " ");
    write!(out, "  {asked}: {kind}, t = {} {s}", number(ending.seconds))?;
    if let Some(cycle) = train.cycle {
        write!(out, ", cycle {}", number((ending.seconds / cycle * 1e9).round() / 1e9))?;
    }
    writeln!(out, "  [{}]", ending.mode)?;
    if let Some(reason) = &ending.reason {
        writeln!(out, "  {reason}")?;
    }
    writeln!(out, "  {}", summary.integrator.why)?;
    for (mode, name) in &summary.integrator.modes {
        writeln!(out, "    {name}: {mode}")?;
    }
    contacts(&mut out, simulation, summary)?;
    write!(out, "\nEnergy {}\n{}", simulation.unit("J"), energy(summary))?;
    let w = &summary.work;
    writeln!(
        out,
        "\nWork: {} events in {} steps, {} known switches, {} grazes, {} impact sequences summed",
        w.events, w.steps, w.switches, w.grazes, w.accumulations
    )?;
    let tolerance = summary.integrator.event_tolerance;
    if tolerance > 0.0 {
        let n = w.near_touches;
        writeln!(out, "Event tolerance {tolerance:e} of a cycle: {n} near touches, known less well")?;
    }
    for warning in &summary.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(out)
}

fn contacts(out: &mut String, simulation: &Simulation, summary: &Summary) -> std::fmt::Result {
    let (s, n) = (simulation.unit("s"), simulation.unit("N"));
    let unit = |name: &str, unit: &str| if unit.is_empty() { name.to_owned() } else { format!("{name} {unit}") };
    writeln!(out, "\nContacts over {} {s}", number(summary.measured_time))?;
    let per = if simulation.settings.period.is_some() { "/cycle" } else { "" };
    let head = [
        "contact".to_owned(),
        "apart %".to_owned(),
        "no force %".to_owned(),
        format!("separations{per}"),
        unit("no force: min", s),
        unit("mean", s),
        unit("max", s),
        format!("contacts{per}"),
        unit("force mean", n),
        unit("abs max", n),
    ];
    // Cycles of the run; of the train's own forcing where the scene names none.
    let cycles = simulation.settings.period.map_or(1.0, |period| summary.measured_time / period);
    let each = |count: u64| number((cycles > 0.0).then(|| count as f64 / cycles));
    let row = |c: &ContactReport| {
        let [least, mean, most] = [c.durations.min, c.durations.mean, c.durations.max].map(number);
        let [apart, share] = [c.apart_fraction, c.no_force_fraction].map(|fraction| number(100.0 * fraction));
        let closed = each(c.drive_contacts + c.back_contacts);
        let [force, largest] = [c.force_mean, c.force_abs_max].map(number);
        vec![c.name.clone(), apart, share, each(c.separations), least, mean, most, closed, force, largest]
    };
    write!(out, "{}", Table::new(head).with(summary.contacts.iter().map(row)))
}

fn energy(summary: &Summary) -> Table {
    let e = &summary.energy;
    let rows = [
        ("at the start", e.start),
        ("+ work of loads", e.load),
        ("+ work of errors", e.error),
        ("+ work of varying stiffness", e.parametric),
        ("- dampers", e.damping),
        ("- contacts", e.contact),
        ("- let go under load", e.release),
        ("- rigid impacts", e.impact),
        ("at the end", e.end),
        ("unexplained", e.residual),
    ];
    let shown = rows.into_iter().filter(|(name, value)| *value != 0.0 || !name.starts_with(['+', '-']));
    Table::default().with(shown.map(|(name, value)| vec![name.to_owned(), number(value)]))
}
