//! `flank identify`.

use std::{fmt::Write, path::PathBuf, str::FromStr};

use serde::Serialize;

use super::{Completion, print, progress::counted, read_scene, request, tell};
use crate::{
    Error, Task,
    output::{Fault, Table, five_digits as number},
    scene::Scene,
    study::{
        StudyError,
        identify::{Identification, IdentifyError, Parameter, STARTS, Side, Target, check, identify},
    },
};

/// Arguments of `flank identify`.
#[derive(Debug, clap::Args)]
pub struct IdentifyArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Numbers to find: JSON pointers (several joined by commas stay equal) with their bounds
    #[arg(long, value_name = "POINTER=LOW:HIGH", num_args = 1.., required = true)]
    vary: Vec<String>,
    /// Values to meet: rotational:N, translational:N, planet:N, mode:N, frequency (the nearest one) in Hz,
    /// force:CONTACT in N; with a standard deviation as VALUE:SIGMA, else 1 %
    #[arg(long, value_name = "QUANTITY=VALUE", num_args = 1.., required = true)]
    target: Vec<String>,
    /// Write identify.json and scene.json, the scene with the numbers found, into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty
    #[arg(long, requires = "out")]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

const ANSWER: &str = "identify.json";
const SCENE: &str = "scene.json";

/// Content of `identify.json`.
#[derive(Serialize)]
struct File<'a> {
    flank: &'static str,
    scene: Source<'a>,
    #[serde(flatten)]
    found: &'a Identification,
}

#[derive(Serialize)]
struct Source<'a> {
    name: &'a str,
    sha256: String,
}

/// Finds numbers of a scene.
pub fn execute(arguments: &IdentifyArguments) -> Result<Completion, Error> {
    let scene = read_scene(arguments.scene.as_deref())?;
    let mut faults = Vec::new();
    let parameters: Vec<Parameter> = read(&arguments.vary, &mut faults);
    let targets: Vec<Target> = read(&arguments.target, &mut faults);
    faults.extend(check(&scene, &parameters, &targets).err().unwrap_or_default());
    if !faults.is_empty() {
        return Err(StudyError::from(IdentifyError { faults }).into());
    }
    let (out, files) = (arguments.out.as_deref(), [SCENE, ANSWER].map(String::from).to_vec());
    let request = request(out, "identify", arguments.scene.as_deref(), arguments.force, files)?;
    let folder = request.map(|request| request.open()).transpose()?;
    let descend = |task: Task<'_>| identify(&scene, &parameters, &targets, task);
    let found = match counted(STARTS, 0, "descents", arguments.quiet, descend) {
        Err(StudyError::Interrupted) => {
            tell("stopped: nothing is found, nothing is written");
            return Ok(Completion::Interrupted);
        }
        found => found?,
    };
    if let Some(mut folder) = folder {
        let source = Source { name: scene.name(), sha256: scene.hash() };
        let file = File { flank: env!("CARGO_PKG_VERSION"), scene: source, found: &found };
        folder.complete(SCENE, found.apply(&scene)?.given())?;
        folder.complete(ANSWER, &file)?;
    }
    if !arguments.quiet {
        print(&text(&scene, &found).unwrap_or_default())?;
    }
    Ok(Completion::Completely)
}

fn read<T: FromStr<Err = IdentifyError>>(texts: &[String], faults: &mut Vec<Fault>) -> Vec<T> {
    texts
        .iter()
        .filter_map(|text| text.parse().map_err(|error: IdentifyError| faults.extend(error.faults)).ok())
        .collect()
}

fn text(scene: &Scene, found: &Identification) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    writeln!(out, "{}: {} descents", scene.name(), found.starts)?;
    if !found.tangent_contacts.is_empty() {
        let contacts = found.tangent_contacts.join(", ");
        writeln!(out, "  natural frequencies about the static equilibrium: tangent stiffness of {contacts}")?;
    }
    writeln!(out, "\nNumbers\n{}\nTargets\n{}", numbers(found), targets(found))?;
    let values: Vec<String> = found.uniqueness.singular_values.iter().map(|value| number(*value)).collect();
    let values = format!("  singular values, sigma per factor e: {}", values.join(" "));
    writeln!(out, "Sensitivity, % per %\n{}{values}\n\n{}", sensitivity(found), found.uniqueness)?;
    solutions(&mut out, found)?;
    if !found.converged {
        writeln!(out, "warning: the descent was cut off before it came to rest")?;
    }
    Ok(out)
}

/// Returns the names of the numbers sought, each with its place in the list.
fn names(found: &Identification) -> impl Iterator<Item = String> {
    found.parameters.iter().enumerate().map(|(i, p)| format!("[{}] {}", i + 1, p.pointers.join(",")))
}

fn numbers(found: &Identification) -> Table {
    let rows = names(found).zip(&found.parameters).map(|(name, p)| {
        let bound =
            p.at_bound.map_or("", |side| if side == Side::Low { "on its lower bound" } else { "on its upper bound" });
        let error = p.standard_error.map_or("not determined".to_owned(), number);
        vec![name, number(p.own), number(p.found), error, number(p.low), number(p.high), bound.to_owned()]
    });
    Table::new(["", "scene", "found", "standard error", "between", "and", ""]).with(rows)
}

fn targets(found: &Identification) -> Table {
    let rows = found.targets.iter().map(|t| {
        let matched = t.matched.as_ref().map_or(String::new(), |name| format!(" ({name})"));
        vec![
            format!("{}{matched} {}", t.quantity, t.unit),
            number(t.wanted),
            number(t.sigma),
            number(t.got),
            rounded(t.residual, t.wanted),
            t.relative_residual.map_or("-".to_owned(), |off| rounded(100.0 * off, 100.0)),
            rounded(t.residual / t.sigma, 1.0),
        ]
    });
    Table::new(["", "wanted", "sigma", "got", "off", "off %", "off / sigma"]).with(rows)
}

/// Returns a difference to four decimals; `0` if it is below 5e-5 or a millionth of `scale`.
fn rounded(value: f64, scale: f64) -> String {
    if value.abs() < f64::max(5e-5, 1e-6 * scale.abs()) { "0".to_owned() } else { format!("{value:+.4}") }
}

fn sensitivity(found: &Identification) -> Table {
    let columns = (1..=found.parameters.len()).map(|i| format!("[{i}]"));
    let rows = found.targets.iter().zip(&found.sensitivity).map(|(target, row)| {
        let cells = row.iter().map(|cell| cell.map_or("-".to_owned(), |percent| rounded(percent, 1.0)));
        std::iter::once(target.quantity.clone()).chain(cells).collect()
    });
    Table::new(std::iter::once(String::new()).chain(columns)).with(rows)
}

fn solutions(out: &mut String, found: &Identification) -> std::fmt::Result {
    let count = found.solutions.len();
    if !found.uniqueness.is_unique() && count > 1 {
        writeln!(out, "{count} points of equal quality were found. They range over")?;
        let rows = names(found).enumerate().map(|(i, name)| {
            let values = || found.solutions.iter().map(|solution| solution.values[i]);
            let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            vec![name, number(low), number(high)]
        });
        write!(out, "{}", Table::new(["", "from", "to"]).with(rows))?;
    } else if count > 1 {
        writeln!(out, "{count} distinct solutions of equal quality were found:")?;
        let rows = names(found).enumerate().map(|(i, name)| {
            let values = found.solutions.iter().map(|solution| number(solution.values[i]));
            std::iter::once(name).chain(values).collect()
        });
        write!(out, "{}", Table::default().with(rows))?;
    } else {
        writeln!(out, "No other solution of equal quality was found.")?;
    }
    if found.poorer > 0 {
        writeln!(out, "{} of {} descents ended in poorer minima.", found.poorer, found.starts)?;
    }
    Ok(())
}
