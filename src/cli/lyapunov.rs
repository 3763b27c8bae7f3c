//! `flank lyapunov`.

use std::{
    fmt::Write,
    path::PathBuf,
    time::{Duration, Instant},
};

use serde_json::json;

use super::{
    Completion,
    checkpoint::{Checkpoint, CommandStart},
    open,
    pictures::Pictures,
    print,
    progress::{cancellable, catch_interrupt, running, show},
    threads,
};
use crate::{
    Error,
    orbit::{Averaging, Exponents, INTERRUPTED, Lyapunov, SectionMap, pictures},
    output::{Request, Table, five_digits as number},
    plot::Figure,
};

const LYAPUNOV: &str = "lyapunov.json";
const STATE: &str = "lyapunov.state";
/// Least time between two writes of the state.
const PAUSE: Duration = Duration::from_secs(1);

/// Arguments of `flank lyapunov`.
#[derive(Debug, clap::Args)]
pub struct LyapunovArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Folder of lyapunov.json and its picture
    #[arg(long, value_name = "DIR", default_value = "lyapunov")]
    out: PathBuf,
    /// Cycles averaged; until the band of the largest exponent is below 1e-3 of the largest if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    cycles: Option<u64>,
    /// Add the exponents without the change of event times
    #[arg(long)]
    without_saltation: bool,
    /// Add the finite-time exponents of the first N cycles from the start
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    finite: Option<u64>,
    /// Threads; one motion takes one of them, finite-time exponents two
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Resume the same interrupted command
    #[arg(long)]
    resume: bool,
    /// Write into a folder that is not empty
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    pictures: Pictures,
}

/// Computes exponents.
pub fn execute(arguments: &LyapunovArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let simulation = open(arguments.scene.as_deref())?;
    SectionMap::new(&simulation)?;
    let mut files = [&Figure::files(pictures::EXPONENTS)[..], &[LYAPUNOV.to_owned()]].concat();
    files.push(STATE.to_owned());
    let force = arguments.force || arguments.resume;
    let request =
        Request { folder: &arguments.out, command: "lyapunov", input: arguments.scene.as_deref(), force, files };
    let asked = json!({
        "flank": env!("CARGO_PKG_VERSION"), "scene_sha256": simulation.hash(), "cycles": arguments.cycles,
        "without_saltation": arguments.without_saltation, "finite": arguments.finite,
    });
    let begun = Checkpoint::begin::<Averaging>(&request, STATE, &asked, (arguments.resume, arguments.quiet))?;
    let (mut checkpoint, earlier) = match begun {
        CommandStart::Open(checkpoint, earlier) => (checkpoint, earlier),
        CommandStart::Finished(done) => return Ok(done),
    };
    let method =
        Lyapunov { cycles: arguments.cycles, without_saltation: arguments.without_saltation, finite: arguments.finite };
    let bar = running(arguments.quiet);
    let progress = |progress| show(&bar, progress, None);
    let working = catch_interrupt();
    let (mut last, mut written, mut failed) = (None, Instant::now(), None);
    let mut keep = |work: &Averaging| {
        if written.elapsed() >= PAUSE {
            failed = failed.take().or(checkpoint.keep(work).err());
            written = Instant::now();
        }
        last = Some(work.clone());
    };
    let pool = threads(arguments.threads)?;
    let exponents = pool.install(|| method.go_on(&simulation, earlier, &mut keep, cancellable(&progress)));
    drop(working);
    bar.finish_and_clear();
    if let Some(error) = failed {
        return Err(error.into());
    }
    let exponents = exponents?;
    let is_interrupted = exponents.reason.as_deref() == Some(INTERRUPTED);
    let done = if exponents.is_whole { Completion::Completely } else { Completion::Partly };
    if !exponents.course.is_empty() {
        pictures::exponents(&simulation, &exponents).write(&mut checkpoint.folder, &form)?;
    }
    checkpoint.folder.complete(LYAPUNOV, &exponents)?;
    match &last {
        _ if !is_interrupted => checkpoint.finish(done)?,
        Some(last) => checkpoint.keep(last)?,
        None => {}
    }
    if !arguments.quiet {
        print(&text(&simulation.name, &exponents).unwrap_or_default())?;
    }
    if !is_interrupted {
        return Ok(done);
    }
    if !arguments.quiet {
        let kept = if last.is_some() { "the averages so far are kept" } else { "too few cycles for averages to keep" };
        print(&format!("interrupted: {kept}; the same command with --resume goes on\n"))?;
    }
    Ok(Completion::Interrupted)
}

fn text(name: &str, e: &Exponents) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let cycles = if e.cycles == 1 { "cycle" } else { "cycles" };
    writeln!(out, "{name}: exponents over {} {cycles}, {}", e.cycles, e.unit)?;
    let list = |values: &[Option<f64>]| {
        let value = |value: &Option<f64>| value.map_or("-infinity".to_owned(), number);
        values.iter().map(value).collect::<Vec<_>>().join(", ")
    };
    let rows = e.exponents.iter().zip(&e.band).enumerate().map(|(i, (exponent, band))| {
        let exponent = exponent.map_or("-infinity".to_owned(), number);
        vec![(i + 1).to_string(), exponent, band.map_or(String::new(), |band| format!("± {}", number(band)))]
    });
    write!(out, "{}", Table::default().with(rows))?;
    let rule = e.sum_rule.map_or(String::new(), |rule| format!(", must be {}", number(rule)));
    if let Some(sum) = e.sum {
        writeln!(out, "sum {}{rule}", number(sum))?;
    }
    if let Some(without) = &e.without_saltation {
        writeln!(out, "without saltation: {}", list(&without.exponents))?;
    }
    if let Some(finite) = &e.finite {
        writeln!(out, "over the first {} cycles from the start: {}", finite.cycles, list(&finite.exponents))?;
    }
    if e.piecewise {
        writeln!(
            out,
            "impacts that depend on each other fell on one instant: exponents are those of neighbours that keep them together"
        )?;
    }
    if let Some(reason) = &e.reason {
        writeln!(out, "{reason}")?;
    }
    Ok(out)
}
