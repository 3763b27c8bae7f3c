//! `flank check`.

use std::{fmt::Write, path::PathBuf};

use super::{open, pictures::Pictures, print, read_scene, wrapped};
use crate::{
    Error, Simulation,
    hybrid::{ContactMode, HybridSystem, Mode as HybridMode},
    integrate::PerMode,
    output::{Request, Table, five_digits as number},
    plot::Item,
    scene::Duration,
    study::check_page,
    system::bonded_modes,
};

/// Arguments of `flank check`.
#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Print the same as JSON
    #[arg(long)]
    json: bool,
    /// Write report.html with figures of the train, its stiffnesses, errors and loads, and its critical speeds into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty
    #[arg(long, requires = "out")]
    force: bool,
    #[command(flatten)]
    pictures: Pictures,
}

/// Ratio of the highest natural frequency to the forcing frequency above which a warning is given.
const STIFF: f64 = 1e3;

/// Shows the train that a scene builds.
pub fn execute(arguments: &CheckArguments) -> Result<(), Error> {
    let form = arguments.pictures.print()?;
    let input = arguments.scene.as_deref();
    let simulation = open(input)?;
    if let Some(folder) = &arguments.out {
        let mut files: Vec<String> = check_page::FIGURES.iter().flat_map(|id| crate::plot::Figure::files(id)).collect();
        files.push("report.html".to_owned());
        let mut folder = Request { folder, command: "check", input, force: arguments.force, files }.open()?;
        let page = check_page::page(&read_scene(input)?, &simulation);
        for item in page.sections.iter().flat_map(|section| &section.items) {
            if let Item::Figure(figure) = item {
                figure.write(&mut folder, &form)?;
            }
        }
        page.write(&mut folder, &form)?;
    }
    if arguments.json {
        let report = serde_json::to_string_pretty(&simulation.report()).unwrap_or_default();
        return print(&(report + "\n"));
    }
    let start = simulation.start()?;
    let (_, why) = simulation.limited(start.clone(), u64::MAX)?;
    print(&text(&simulation, &start.jump.mode, &why).unwrap_or_default())?;
    print(&super::report_line(arguments.out.as_deref()))
}

fn text(simulation: &Simulation, start: &HybridMode, why: &str) -> Result<String, std::fmt::Error> {
    let report = simulation.report();
    let mut out = String::new();
    let (spec, s) = (simulation.structure.spec(), simulation.unit("s"));
    writeln!(out, "{}  ({})", simulation.name, simulation.kind())?;
    writeln!(out, "  scene {}", simulation.hash().unwrap_or_default())?;
    writeln!(out, "{}", wrapped(&format!("freedoms: {}", spec.freedoms.join(" ")), "  "))?;
    writeln!(out, "  state: {} numbers, latched speeds included", simulation.structure.dim())?;
    let run = &simulation.settings;
    let length = match run.duration {
        Duration::Cycles(n) => format!("{n} cycles, the first {} not measured", run.transient_cycles),
        Duration::Until(end) => format!("until t = {end} {s}"),
    };
    let period = run.period.map_or("none".to_owned(), |p| format!("{} {s}", number(p)));
    let common = report.common_cycle.filter(|cycles| *cycles > 1);
    let common = common.map_or(String::new(), |cycles| format!("; all forcing repeats after {cycles} of them"));
    writeln!(out, "  run: {length}; cycle {period}{common}")?;
    for table in report.tables() {
        write!(out, "\n{}\n{table}", table.title.clone())?;
        if !table.note.is_empty() {
            writeln!(out, "{}", wrapped(&table.note, "  "))?;
        }
    }
    integrators(&mut out, simulation, start, why)?;
    writeln!(out)?;
    for remark in &report.remarks {
        writeln!(out, "{}", wrapped(remark, ""))?;
    }
    let mut warnings = report.warnings;
    warnings.extend(stiffness(simulation));
    if warnings.is_empty() {
        writeln!(out, "No warnings")?;
    }
    for warning in warnings {
        writeln!(out, "{}", wrapped(&format!("warning: {warning}"), ""))?;
    }
    Ok(out)
}

/// Warns of a train without natural frequencies, or with one far above the forcing.
fn stiffness(simulation: &Simulation) -> Option<String> {
    let modes = match bonded_modes(simulation.structure.spec()) {
        Ok(modes) => modes,
        Err(error) => return Some(format!("no natural frequencies: {error}")),
    };
    let highest = modes.omega.iter().copied().fold(0.0, f64::max);
    let forcing = simulation.structure.clock().omega();
    (forcing > 0.0 && highest > STIFF * forcing).then(|| {
        let ratio = number(highest / forcing);
        format!("the highest natural frequency is {ratio} times the forcing frequency: steps are short")
    })
}

fn integrators(out: &mut String, simulation: &Simulation, start: &HybridMode, why: &str) -> std::fmt::Result {
    let structure = &simulation.structure;
    writeln!(out, "\nIntegrator\n  {why}")?;
    let count = structure.contacts().len();
    let set = |state| {
        let mut mode = start.clone();
        (0..count).for_each(|j| structure.set_contact(&mut mode, j, state));
        mode
    };
    let modes: [(&str, HybridMode); 3] = [
        ("at the start", start.clone()),
        ("every contact open", set(ContactMode::Separated)),
        ("every contact on its drive flank", set(ContactMode::Drive)),
    ];
    let [from, _, end] = simulation.instants();
    let rows = modes.into_iter().map(|(name, mode)| {
        let rates = structure.rates(&mode).unwrap_or_default();
        let stiff = PerMode::is_stiff(structure, &mode, structure.clock().between(from, end));
        let stiff = if stiff { "yes" } else { "no" };
        vec![name.to_owned(), number(rates.damped), number(rates.oscillating), stiff.to_owned()]
    });
    let head = ["mode", "fastest decay 1/s", "fastest oscillation rad/s", "stiff"];
    write!(out, "{}", Table::new(head).with(rows))
}
