//! `flank identify`.

use std::{fmt::Write, path::PathBuf, str::FromStr};

use flank::{
    output::Request,
    scene::{Fault, Scene},
    study::identify::{Identification, IdentifyError, Parameter, Side, Target, check, identify_watched},
};
use serde::Serialize;

use super::{
    CliError, Done, print,
    progress::{catch_interrupt, counting, unless_interrupted},
    session,
    table::{Table, number},
};

/// Arguments of `flank identify`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
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

/// `identify.json`.
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
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let scene = session::read(arguments.scene.as_deref())?;
    let mut faults = Vec::new();
    let parameters: Vec<Parameter> = read(&arguments.vary, &mut faults);
    let targets: Vec<Target> = read(&arguments.target, &mut faults);
    faults.extend(check(&scene, &parameters, &targets).err().unwrap_or_default());
    if !faults.is_empty() {
        return Err(IdentifyError { faults }.into());
    }
    let request = arguments.out.as_deref().map(|folder| {
        let (input, files) = (arguments.scene.as_deref(), [SCENE, ANSWER].map(String::from).to_vec());
        Request { folder, command: "identify", input, force: arguments.force, files }
    });
    let folder = request.map(|request| request.open()).transpose()?;
    catch_interrupt();
    let bar = counting("descents", arguments.quiet);
    let found = identify_watched(&scene, &parameters, &targets, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        unless_interrupted()
    });
    bar.finish_and_clear();
    let Some(found) = found? else {
        eprintln!("stopped: nothing is found, nothing is written");
        return Ok(Done::Partly);
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
    Ok(Done::Completely)
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
    numbers(&mut out, found)?;
    targets(&mut out, found)?;
    sensitivity(&mut out, found)?;
    writeln!(out, "\n{}", found.uniqueness)?;
    solutions(&mut out, found)?;
    if !found.converged {
        writeln!(out, "warning: the descent was cut off before it came to rest")?;
    }
    Ok(out)
}

fn numbers(out: &mut String, found: &Identification) -> std::fmt::Result {
    writeln!(out, "\nNumbers")?;
    let mut table = Table::new(&["", "scene", "found", "standard error", "between", "and", ""]);
    for (i, p) in found.parameters.iter().enumerate() {
        let bound =
            p.at_bound.map_or("", |side| if side == Side::Low { "on its lower bound" } else { "on its upper bound" });
        table.row(vec![
            format!("[{}] {}", i + 1, p.pointers.join(",")),
            number(p.own),
            number(p.found),
            p.standard_error.map_or("not determined".to_owned(), number),
            number(p.low),
            number(p.high),
            bound.to_owned(),
        ]);
    }
    write!(out, "{table}")
}

fn targets(out: &mut String, found: &Identification) -> std::fmt::Result {
    writeln!(out, "\nTargets")?;
    let mut table = Table::new(&["", "wanted", "sigma", "got", "off", "off %", "off / sigma"]);
    for t in &found.targets {
        let matched = t.matched.as_ref().map_or(String::new(), |name| format!(" ({name})"));
        table.row(vec![
            format!("{}{matched} {}", t.quantity, t.unit),
            number(t.wanted),
            number(t.sigma),
            number(t.got),
            rounded(t.residual, t.wanted),
            t.relative_residual.map_or("-".to_owned(), |off| rounded(100.0 * off, 100.0)),
            rounded(t.residual / t.sigma, 1.0),
        ]);
    }
    write!(out, "{table}")
}

/// A difference to four decimals; nothing where that, or a millionth of `scale`, is more than it is.
fn rounded(value: f64, scale: f64) -> String {
    if value.abs() < f64::max(5e-5, 1e-6 * scale.abs()) { "0".to_owned() } else { format!("{value:+.4}") }
}

fn sensitivity(out: &mut String, found: &Identification) -> std::fmt::Result {
    writeln!(out, "\nSensitivity, % per %")?;
    let columns = (1..=found.parameters.len()).map(|i| format!("[{i}]"));
    let head: Vec<String> = std::iter::once(String::new()).chain(columns).collect();
    let mut table = Table::new(head);
    for (target, row) in found.targets.iter().zip(&found.sensitivity) {
        let cells = row.iter().map(|cell| cell.map_or("-".to_owned(), |percent| rounded(percent, 1.0)));
        table.row(std::iter::once(target.quantity.clone()).chain(cells).collect());
    }
    write!(out, "{table}")?;
    let values: Vec<String> = found.uniqueness.singular_values.iter().map(|value| number(*value)).collect();
    writeln!(out, "  singular values, sigma per factor e: {}", values.join(" "))
}

fn solutions(out: &mut String, found: &Identification) -> std::fmt::Result {
    let count = found.solutions.len();
    if !found.uniqueness.is_unique() && count > 1 {
        writeln!(out, "{count} points of equal quality were found. They range over")?;
        let mut table = Table::new(&["", "from", "to"]);
        for (i, parameter) in found.parameters.iter().enumerate() {
            let values = || found.solutions.iter().map(|solution| solution.values[i]);
            let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            table.row(vec![format!("[{}] {}", i + 1, parameter.pointers.join(",")), number(low), number(high)]);
        }
        write!(out, "{table}")?;
    } else if count > 1 {
        writeln!(out, "{count} distinct solutions of equal quality were found:")?;
        let mut table = Table::default();
        for (i, parameter) in found.parameters.iter().enumerate() {
            let values = found.solutions.iter().map(|solution| number(solution.values[i]));
            let name = format!("[{}] {}", i + 1, parameter.pointers.join(","));
            table.row(std::iter::once(name).chain(values).collect());
        }
        write!(out, "{table}")?;
    } else {
        writeln!(out, "No other solution of equal quality was found.")?;
    }
    if found.poorer > 0 {
        writeln!(out, "{} of {} descents ended in poorer minima.", found.poorer, found.starts)?;
    }
    Ok(())
}
