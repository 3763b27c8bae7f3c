//! `flank orbit`.

use std::{fmt::Write, path::PathBuf};

use flank::{
    Simulation,
    orbit::{Found, Search, SectionMap, pictures},
    output::{Table, five_digits as number},
};

use super::{
    CliError, Done, open, picture_files, print,
    progress::{cancellable, catch_interrupt, running, show},
    request, threads,
};

const ORBIT: &str = "orbit.json";

/// Arguments of `flank orbit`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Folder of orbit.json and its picture
    #[arg(long, value_name = "DIR", default_value = "orbit")]
    out: PathBuf,
    /// Period, cycles; the smallest that is found if left out
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    period: Option<u64>,
    /// Look from this many further starts, for other orbits
    #[arg(long, value_name = "N", default_value_t = 0)]
    starts: usize,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// Solves for orbits.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let simulation = open(arguments.scene.as_deref())?;
    SectionMap::new(&simulation)?;
    let files = picture_files(pictures::ORBIT, ORBIT);
    let request = request(Some(arguments.out.as_path()), "orbit", arguments.scene.as_deref(), arguments.force, files)?;
    let search = Search { period: arguments.period, starts: arguments.starts };
    let bar = running(arguments.quiet);
    let progress = |progress| show(&bar, progress, None);
    catch_interrupt();
    let found = threads(arguments.threads)?.install(|| search.run(&simulation, cancellable(&progress)));
    bar.finish_and_clear();
    let found = found?;
    if let Some(request) = request {
        let mut folder = request.open()?;
        if let Some(orbit) = found.orbits.first() {
            pictures::orbit(&simulation, orbit)?.write(&mut folder)?;
        }
        folder.complete(ORBIT, &found.report(&simulation))?;
    }
    if !arguments.quiet {
        print(&text(&simulation, &found).unwrap_or_default())?;
    }
    Ok(if found.orbits.is_empty() { Done::Partly } else { Done::Completely })
}

fn text(simulation: &Simulation, found: &Found) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    writeln!(out, "{}: {} orbits", simulation.name, found.orbits.len())?;
    let head = ["period", "word", "stable", "largest multiplier", "residual"].map(String::from);
    let rows = found.orbits.iter().map(|orbit| {
        let stable = if orbit.is_stable { "yes" } else { "no" };
        let [largest, residual] = [orbit.largest_multiplier(), orbit.residual].map(number);
        vec![orbit.period.to_string(), orbit.word(), stable.to_owned(), largest, residual]
    });
    if !found.orbits.is_empty() {
        write!(out, "{}", Table::new(head).with(rows))?;
    }
    if let Some(reason) = &found.reason {
        writeln!(out, "no orbit: {reason} (best residual {})", number(found.best))?;
    }
    Ok(out)
}
