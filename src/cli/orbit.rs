//! `flank orbit`.

use std::{fmt::Write, path::PathBuf};

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
    Error, Simulation,
    orbit::{Search, SearchResult, SearchState, SectionMap, pictures},
    output::{Request, Table, five_digits as number},
    plot::Figure,
};

const ORBIT: &str = "orbit.json";
const STATE: &str = "orbit.state";

/// Arguments of `flank orbit`.
#[derive(Debug, clap::Args)]
pub struct OrbitArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Folder of orbit.json and its picture
    #[arg(long, value_name = "DIR", default_value = "orbit")]
    out: PathBuf,
    /// Period, cycles; the smallest that is found if left out
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    period: Option<u64>,
    /// Search from this many further starts, for other orbits
    #[arg(long, value_name = "N", default_value_t = 0)]
    starts: usize,
    /// Threads; as many as there are cores if left out
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

/// Solves for orbits.
pub fn execute(arguments: &OrbitArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let simulation = open(arguments.scene.as_deref())?.in_common_cycles()?;
    SectionMap::new(&simulation)?.repeats()?;
    let mut files = [&Figure::files(pictures::ORBIT)[..], &[ORBIT.to_owned()]].concat();
    files.push(STATE.to_owned());
    let force = arguments.force || arguments.resume;
    let request = Request { folder: &arguments.out, command: "orbit", input: arguments.scene.as_deref(), force, files };
    let asked = json!({
        "flank": env!("CARGO_PKG_VERSION"), "scene_sha256": simulation.hash(), "period": arguments.period,
        "starts": arguments.starts,
    });
    let begun = Checkpoint::begin::<SearchState>(&request, STATE, &asked, (arguments.resume, arguments.quiet))?;
    let (mut checkpoint, earlier) = match begun {
        CommandStart::Open(checkpoint, earlier) => (checkpoint, earlier),
        CommandStart::Finished(done) => return Ok(done),
    };
    let search = Search { period: arguments.period, starts: arguments.starts };
    let bar = running(arguments.quiet);
    let progress = |progress| show(&bar, progress, None);
    let working = catch_interrupt();
    let (task, mut failed, mut is_kept) = (cancellable(&progress), None, earlier.is_some());
    let mut keep = |work: &SearchState| {
        failed = failed.take().or(checkpoint.keep(work).err());
        is_kept = true;
    };
    let pool = threads(arguments.threads)?;
    let found = pool.install(|| search.go_on(&simulation, earlier, &mut keep, task));
    drop(working);
    bar.finish_and_clear();
    if let Some(error) = failed {
        return Err(error.into());
    }
    let found = found?;
    checkpoint.folder.complete(ORBIT, &found.report(&simulation))?;
    if let Some(orbit) = found.orbits.first() {
        pictures::orbit(&simulation, orbit, found.orbits.len())?.write(&mut checkpoint.folder, &form)?;
    }
    let done = if found.reason.is_some() { Completion::Partly } else { Completion::Completely };
    if !task.is_cancelled() {
        checkpoint.finish(done)?;
    }
    if !arguments.quiet {
        print(&text(&simulation, &found).unwrap_or_default())?;
    }
    if !task.is_cancelled() {
        return Ok(done);
    }
    if !arguments.quiet {
        let kept = if is_kept { "; the same command with --resume goes on" } else { "" };
        print(&format!("what was found is in {ORBIT}{kept}\n"))?;
    }
    Ok(Completion::Interrupted)
}

fn text(simulation: &Simulation, found: &SearchResult) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let count = found.orbits.len();
    writeln!(out, "{}: {count} {}", simulation.name, if count == 1 { "orbit" } else { "orbits" })?;
    let head = ["period", "word", "stable", "largest multiplier", "residual"].map(String::from);
    let rows = found.orbits.iter().map(|orbit| {
        let stable = orbit.stability().0;
        let [largest, residual] = [orbit.largest_multiplier(), orbit.residual].map(number);
        let word = if orbit.image.word.is_empty() { "no event".to_owned() } else { orbit.word() };
        vec![orbit.period.to_string(), word, stable.to_owned(), largest, residual]
    });
    if !found.orbits.is_empty() {
        write!(out, "{}", Table::new(head).with(rows))?;
    }
    if found.orbits.iter().any(|orbit| orbit.image.has_event_at_section) {
        writeln!(
            out,
            "an event lies on phase 0: it may be missing from word and multipliers, or be there twice; shift the phase of the forcing"
        )?;
    }
    if found.orbits.iter().any(|orbit| orbit.image.corner.is_some()) {
        writeln!(
            out,
            "impacts that depend on each other fall on one instant (corner): multipliers hold for neighbours that keep them together, and do not tell whether the orbit is stable"
        )?;
    }
    match &found.reason {
        Some(reason) if count == 0 => writeln!(out, "no orbit: {reason} (best residual {})", number(found.best))?,
        Some(reason) => writeln!(out, "{reason}")?,
        None => {}
    }
    Ok(out)
}
