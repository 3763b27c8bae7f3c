//! `flank run`.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    time::Instant,
};

use super::{
    Completion, open,
    pictures::Pictures,
    print,
    progress::{Estimate, cancellable, catch_interrupt, running, show},
    tell, wrapped,
};
use crate::{
    Error, Progress, Simulation,
    hybrid::Clock,
    output::{Request, five_digits as number, label},
    plot::{Item, Print, Report},
    scene::{Duration, strict},
    simulation::{EndKind, RunRecord, Summary, event_head, event_lines},
    study::run_page,
};

/// Arguments of `flank run`.
#[derive(Debug, clap::Args)]
pub struct RunArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Write events.jsonl, events.csv, summary.json and report.html with its figures into this folder; `-` writes the table of events to
    /// standard output, and nothing else
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write trajectory.csv too (a scene with output.samples_per_cycle > 0 always does)
    #[arg(long, requires = "out")]
    trajectory: bool,
    /// Write no events.jsonl and no events.csv
    #[arg(long, requires = "out")]
    no_log: bool,
    /// Write no report.html and no figures: a report takes as long as the decision on the kind of the motion
    #[arg(long, requires = "out")]
    no_report: bool,
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
    #[command(flatten)]
    pictures: Pictures,
}

/// Runs a scene.
pub fn execute(arguments: &RunArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let simulation = open(arguments.scene.as_deref())?;
    if arguments.strict && !simulation.warnings.is_empty() {
        return Err(Error::Arguments(strict(&simulation.warnings, "--strict")));
    }
    let ([from, _, end], run) = (simulation.instants(), &simulation.settings);
    let cycles = run.period.map(|period| Clock::between(simulation.clock(), from, end) / period);
    if let Some(warning) = simulation.budget_warning().filter(|_| !arguments.quiet) {
        tell(&format!("warning: {warning}"));
    }
    let bar = running(arguments.quiet);
    let (estimate, began) = (Estimate::default(), Instant::now());
    let written = || {
        let size = |name: &str| {
            arguments.out.as_ref().and_then(|out| out.join(name).metadata().ok()).map_or(0, |data| data.len())
        };
        ["events.jsonl", "events.csv", "trajectory.csv"].into_iter().map(size).sum()
    };
    let progress = |progress| {
        show(&bar, progress, cycles);
        if let Progress::Share(done) = progress
            && !arguments.quiet
            && let Some(words) = estimate.words(done, began.elapsed().as_secs_f64(), written)
        {
            bar.suspend(|| tell(&words));
        }
    };
    let mut job = simulation.job();
    job.task = cancellable(&progress);
    job.max_events = run.event_budget.min(arguments.events.unwrap_or(u64::MAX));
    job.verify |= arguments.verify;
    job.trajectory |= arguments.trajectory;
    job.replace = arguments.force;
    // Without `--out` nobody reads rows.
    job.log = arguments.out.is_some() && !arguments.no_log;
    let to_output = arguments.out.as_deref() == Some(Path::new("-"));
    let out = arguments.out.as_deref().filter(|_| !to_output);
    job.trajectory &= !to_output;
    let page = out.filter(|_| !arguments.no_report);
    let files = Report::files(run_page::FIGURES, &["events.jsonl", "events.csv", "trajectory.csv", "summary.json"]);
    let input = arguments.scene.as_deref();
    let request = page.map(|folder| Request { folder, command: "run", input, force: arguments.force, files });
    request.as_ref().map(Request::check).transpose()?;
    let working = catch_interrupt();
    let task = job.task;
    let record = job.attempt(out);
    let written = match (&record, request) {
        (Ok(record), Some(request)) if record.outcome.kind == EndKind::ReachedEnd => {
            write_page(&simulation, record, request, (&form, task))
        }
        _ => Ok(()),
    };
    drop(working);
    bar.finish_and_clear();
    let record = record?;
    if to_output {
        let head = std::iter::once(event_head(simulation.dimensionless));
        let lines = head.chain(record.events.iter().flat_map(event_lines));
        print(&lines.map(|line| line + "\n").collect::<String>())?;
    } else if !arguments.quiet {
        print(&text(&simulation, &record).unwrap_or_default())?;
    }
    if let Err(reason) = &written {
        tell(&format!("warning: no report.html: {reason}"));
    }
    if let Some(out) = out.filter(|_| !arguments.quiet) {
        let names = ["events.jsonl", "events.csv", "summary.json", "trajectory.csv", "report.html"];
        let there: Vec<&str> = names.into_iter().filter(|name| out.join(name).exists()).collect();
        print(&format!("\nWritten into {}: {}\n", out.display(), there.join(", ")))?;
    }
    let asked = arguments.events.is_some_and(|n| n <= run.event_budget);
    match (record.failure, record.summary.outcome.kind) {
        (Some(failure), _) => Err(failure.into()),
        (None, EndKind::ReachedEnd) => Ok(Completion::Completely),
        (None, EndKind::EventBudgetSpent) if asked => Ok(Completion::Completely),
        (None, EndKind::EventBudgetSpent) => {
            let cycle = record.summary.outcome.cycle;
            tell(&format!(
                "the event budget of the scene, {}, was spent in cycle {cycle}: raise /run/event_budget, or end the run earlier",
                run.event_budget
            ));
            Ok(Completion::BudgetSpent)
        }
        (None, EndKind::Interrupted) => Ok(Completion::Interrupted),
        _ => Ok(Completion::Partly),
    }
}

/// Writes the page of a run, with its figures; returns the reason if there is none.
fn write_page(
    simulation: &Simulation,
    record: &RunRecord,
    request: Request<'_>,
    (print, task): (&Print, crate::Task<'_>),
) -> Result<(), String> {
    let page = run_page::page(simulation, record, &record.end, task).map_err(|error| error.to_string())?;
    let write = || {
        let mut folder = Request { force: true, ..request }.reopen()?;
        for item in page.sections.iter().flat_map(|section| &section.items) {
            if let Item::Figure(figure) = item {
                figure.write(&mut folder, print)?;
            }
        }
        page.write(&mut folder, print)
    };
    write().map_err(|error: crate::output::OutputError| error.to_string())
}

/// Returns the whole report.
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
    writeln!(out, "{}", wrapped(&summary.integrator.why, "  "))?;
    for (mode, name) in &summary.integrator.modes {
        writeln!(out, "    {name}: {mode}")?;
    }
    let mut tables = vec![summary.separation_table(simulation), summary.force_table(simulation)];
    tables.extend((!summary.bearings.is_empty()).then(|| summary.bearing_table(simulation)));
    tables.push(summary.energy_table(simulation));
    for table in tables {
        write!(out, "\n{}\n{}", table.title.clone(), table.fit())?;
    }
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
        writeln!(out, "{}", wrapped(&format!("warning: {warning}"), ""))?;
    }
    Ok(out)
}
