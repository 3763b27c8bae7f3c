//! `flank lyapunov`.

use std::{fmt::Write, path::PathBuf};

use flank::{
    orbit::{Exponents, Lyapunov, SectionMap, pictures},
    output::{Table, five_digits as number},
};

use super::{
    CliError, Done, open, picture_files, print,
    progress::{cancellable, catch_interrupt, running, show},
    request,
};

const LYAPUNOV: &str = "lyapunov.json";

/// Arguments of `flank lyapunov`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Folder of lyapunov.json and its picture
    #[arg(long, value_name = "DIR", default_value = "lyapunov")]
    out: PathBuf,
    /// Cycles averaged; until the band of the largest exponent is below 1e-3 of the largest if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    cycles: Option<u64>,
    /// Add what one gets if the change of event times is left out
    #[arg(long)]
    without_saltation: bool,
    /// Add the finite-time exponents of the first N cycles from the start
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    finite: Option<u64>,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// Measures exponents.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let simulation = open(arguments.scene.as_deref())?;
    SectionMap::new(&simulation)?;
    let files = picture_files(pictures::EXPONENTS, LYAPUNOV);
    let request =
        request(Some(arguments.out.as_path()), "lyapunov", arguments.scene.as_deref(), arguments.force, files)?;
    let asked =
        Lyapunov { cycles: arguments.cycles, without_saltation: arguments.without_saltation, finite: arguments.finite };
    let bar = running(arguments.quiet);
    let progress = |progress| show(&bar, progress, None);
    catch_interrupt();
    let exponents = asked.run(&simulation, cancellable(&progress));
    bar.finish_and_clear();
    let exponents = exponents?;
    if let Some(request) = request {
        let mut folder = request.open()?;
        if !exponents.course.is_empty() {
            pictures::exponents(&simulation, &exponents).write(&mut folder)?;
        }
        folder.complete(LYAPUNOV, &exponents)?;
    }
    if !arguments.quiet {
        print(&text(&simulation.name, &exponents).unwrap_or_default())?;
    }
    Ok(if exponents.reason.as_deref() == Some("interrupted") { Done::Partly } else { Done::Completely })
}

fn text(name: &str, e: &Exponents) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    writeln!(out, "{name}: exponents over {} cycles, {}", e.cycles, e.unit)?;
    let rows = e.exponents.iter().zip(&e.band).enumerate().map(|(i, (exponent, band))| {
        let exponent = exponent.map_or("-infinity".to_owned(), number);
        vec![(i + 1).to_string(), exponent, band.map_or(String::new(), |band| format!("± {}", number(band)))]
    });
    write!(out, "{}", Table::default().with(rows))?;
    let rule = e.sum_rule.map_or(String::new(), |rule| format!(", must be {}", number(rule)));
    writeln!(out, "sum {}{rule}", number(e.sum))?;
    if let Some(reason) = &e.reason {
        writeln!(out, "{reason}")?;
    }
    Ok(out)
}
