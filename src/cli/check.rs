//! `flank check`.

use std::{fmt::Write, path::PathBuf};

use super::{CliError, open, print};
use flank::{
    Simulation,
    gear::contact::{Law, Release},
    hybrid::{ContactMode, HybridSystem, Mode},
    integrate::PerMode,
    linalg::multiplicities,
    output::{Table, five_digits as number},
    scene::{Duration, ToothMesh},
    system::{ContactSpec, Flanks, bonded_modes, contact_mode, set_contact},
};

/// Arguments of `flank check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
}

/// A highest natural frequency so many times the forcing frequency is worth a word.
const STIFF: f64 = 1e3;
/// Frequencies closer than this, relative, are one.
const SAME: f64 = 1e-9;

/// Shows what a scene builds.
pub fn execute(arguments: &Arguments) -> Result<(), CliError> {
    let simulation = open(arguments.scene.as_deref())?;
    let start = simulation.start()?;
    let (_, why) = simulation.limited(start.clone(), u64::MAX)?;
    print(&text(&simulation, &start.jump.mode, &why).unwrap_or_default())
}

fn text(simulation: &Simulation, start: &Mode, why: &str) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let (spec, s) = (simulation.structure.spec(), simulation.unit("s"));
    writeln!(out, "{}  ({})", simulation.name, simulation.kind())?;
    writeln!(out, "  scene {}", simulation.hash().unwrap_or_default())?;
    writeln!(out, "  freedoms: {}", spec.freedoms.join(" "))?;
    writeln!(out, "  state: {} numbers, latched speeds included", simulation.structure.dim())?;
    let run = &simulation.settings;
    let length = match run.duration {
        Duration::Cycles(n) => format!("{n} cycles, the first {} not measured", run.transient_cycles),
        Duration::Until(end) => format!("until t = {end} {s}"),
    };
    let period = run.period.map_or("none".to_owned(), |p| format!("{} {s}", number(p)));
    writeln!(out, "  run: {length}; cycle {period}")?;
    contacts(&mut out, simulation, start)?;
    let mut warnings = simulation.warnings_in_words();
    frequencies(&mut out, simulation, &mut warnings)?;
    out.push_str(&speeds(simulation)?);
    out.push_str(&geometry(&simulation.meshes)?);
    integrators(&mut out, simulation, start, why)?;
    writeln!(out)?;
    if warnings.is_empty() {
        writeln!(out, "No warnings")?;
    }
    for warning in warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(out)
}

/// Law, modes and guards of a contact, in words.
fn automaton(contact: &ContactSpec) -> (&'static str, String, String) {
    let (law, can_detach) = match contact.law {
        Law::Bilateral(_) => return ("bilateral", "closed".to_owned(), "none".to_owned()),
        Law::KelvinVoigt(l, Release::Force) if l.damping > 0.0 => ("linear, never pulls", true),
        Law::KelvinVoigt(..) => ("linear", false),
        Law::Power(l) if l.hysteresis > 0.0 => ("power, hysteresis", true),
        Law::Power(_) => ("power", false),
        Law::Rigid(_) => ("rigid", false),
    };
    let (sides, flanks) =
        if contact.flanks == Flanks::Both { ("drive, back", "delta = +b, -b") } else { ("drive", "delta = b") };
    match contact.law {
        Law::Rigid(_) => {
            let where_to = if contact.flanks == Flanks::Both { "resting on either flank" } else { "resting" };
            (law, format!("separated, {where_to}"), format!("{flanks}; multiplier = 0"))
        }
        _ if can_detach => (law, format!("separated, {sides}, detached"), format!("{flanks}; force = 0")),
        _ => (law, format!("separated, {sides}"), flanks.to_owned()),
    }
}

fn contacts(out: &mut String, simulation: &Simulation, start: &Mode) -> std::fmt::Result {
    let spec = simulation.structure.spec();
    writeln!(out, "\nContacts, delta positive towards the drive flank")?;
    let rows = spec.contacts.iter().enumerate().map(|(j, contact)| {
        let (law, modes, guards) = automaton(contact);
        let [b, stiffness] = [contact.half_backlash, contact.stiffness.mean()].map(number);
        let state = contact_mode(start, j).name().to_owned();
        vec![contact.name.clone(), law.to_owned(), b, stiffness, modes, guards, state]
    });
    let head = ["contact", "law", "b", "mean stiffness", "modes", "guards", "starts"];
    write!(out, "{}", Table::new(head).with(rows))
}

fn frequencies(out: &mut String, simulation: &Simulation, warnings: &mut Vec<String>) -> std::fmt::Result {
    let spec = simulation.structure.spec();
    let modes = match bonded_modes(spec) {
        Ok(modes) => modes,
        Err(error) => {
            warnings.push(format!("no natural frequencies: {error}"));
            return Ok(());
        }
    };
    let unit = if simulation.dimensionless { "rad per unit of time" } else { "Hz" };
    let values = if simulation.dimensionless { modes.omega.clone() } else { modes.hertz() };
    writeln!(out, "\nNatural frequencies, every contact closed at its mean stiffness, {unit}")?;
    if spec.contacts.iter().any(|c| matches!(c.law, Law::Power(_) | Law::Rigid(_))) {
        writeln!(out, "  (laws that are not linear are taken at stiffness K: an order of magnitude at best)")?;
    }
    let words = multiplicities(&values, SAME).into_iter().map(|(f, count)| match count {
        1 => number(f),
        _ => format!("{} ({count} times)", number(f)),
    });
    writeln!(out, "  {}", words.collect::<Vec<_>>().join(", "))?;
    let highest = modes.omega.iter().copied().fold(0.0, f64::max);
    let forcing = simulation.structure.clock().omega();
    if forcing > 0.0 && highest > STIFF * forcing {
        let ratio = number(highest / forcing);
        warnings.push(format!("the highest natural frequency is {ratio} times the forcing frequency: steps are short"));
    }
    Ok(())
}

fn integrators(out: &mut String, simulation: &Simulation, start: &Mode, why: &str) -> std::fmt::Result {
    let structure = &simulation.structure;
    writeln!(out, "\nIntegrator\n  {why}")?;
    let count = structure.contacts().len();
    let set = |state| {
        let mut mode = start.clone();
        (0..count).for_each(|j| set_contact(&mut mode, j, state));
        mode
    };
    let modes: [(&str, Mode); 3] = [
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

/// Mean speeds of the shafts of a gearbox, with the frequencies of their rotation.
fn speeds(simulation: &Simulation) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    if !simulation.speeds.is_empty() {
        let rows = simulation.speeds.iter().map(|(name, speed)| {
            vec![name.clone(), number(speed * 30.0 / std::f64::consts::PI), number(speed.abs() / std::f64::consts::TAU)]
        });
        write!(out, "\nSpeeds, counter-clockwise positive\n{}", Table::new(["shaft", "rev/min", "Hz"]).with(rows))?;
    }
    Ok(out)
}

/// Clocks of the meshes, and their geometry as far as the teeth are given.
fn geometry(meshes: &[ToothMesh]) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let words = |values: &[f64]| values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ");
    if meshes.iter().any(|mesh| mesh.frequency > 0.0) {
        let rows = meshes.iter().map(|mesh| vec![mesh.name.clone(), number(mesh.frequency), words(&mesh.phases)]);
        write!(out, "\nMesh clocks\n{}", Table::new(["mesh", "frequency Hz", "phases, periods"]).with(rows))?;
    }
    let given: Vec<&ToothMesh> = meshes.iter().filter(|mesh| mesh.is_given).collect();
    if !given.is_empty() {
        let head =
            ["mesh", "working angle deg", "centre distance mm", "base radii mm", "contact ratio", "overlap ratio"];
        let rows = given.into_iter().map(|mesh| {
            let g = &mesh.geometry;
            let radii = words(&g.base_radii.map(|r| 1e3 * r));
            let [angle, distance] = [g.pressure_angle.to_degrees(), 1e3 * g.centre_distance].map(number);
            vec![mesh.name.clone(), angle, distance, radii, number(g.path.contact_ratio()), number(g.path.overlap)]
        });
        write!(out, "\nMesh geometry\n{}", Table::new(head).with(rows))?;
    }
    Ok(out)
}
