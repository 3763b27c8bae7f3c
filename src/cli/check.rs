//! `flank check`.

use std::{fmt::Write, path::PathBuf};

use flank::{
    Simulation,
    gear::{
        MeshGeometry,
        contact::{Law, Release},
        phase,
    },
    hybrid::{ContactMode, HybridSystem, Mode},
    integrate::PerMode,
    linalg::multiplicities,
    output::{Table, five_digits as number},
    scene::Duration,
    system::{ContactSpec, Flanks, bonded_modes, contact_mode, set_contact},
};
use serde_json::Value;

use super::{CliError, open, print};

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
    out.push_str(&geometry(simulation.resolved(), &simulation.meshes)?);
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

/// Geometry and phases of the meshes of a resolved scene; nothing for trains without teeth.
fn geometry(scene: &Value, meshes: &[(String, MeshGeometry)]) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    if !meshes.is_empty() {
        let head = ["mesh", "working angle deg", "centre distance mm", "base radii mm", "contact ratio"];
        let rows = meshes.iter().map(|(name, g)| {
            let [one, two] = g.base_radii.map(|r| number(1e3 * r));
            let [angle, distance] = [g.pressure_angle.to_degrees(), 1e3 * g.centre_distance].map(number);
            vec![(*name).to_owned(), angle, distance, format!("{one} {two}"), number(g.path.contact_ratio())]
        });
        write!(out, "\nMesh geometry\n{}", Table::new(head).with(rows))?;
    }
    let train = &scene["train"];
    Ok(if train["kind"] == "planetary" { out + &phases(train)? } else { out })
}

/// Positions of the planets and mesh phases as the scene has them.
fn phases(train: &Value) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let listed = |key: &str| train[key].as_array().map(|l| l.iter().filter_map(Value::as_f64).collect::<Vec<f64>>());
    let degrees = listed("positions_deg").map(|l| l.into_iter().map(f64::to_radians).collect());
    let count = train["planets"].as_u64().and_then(|n| usize::try_from(n).ok());
    let positions = listed("positions_rad").or(degrees).or(count.map(phase::equally_spaced)).unwrap_or_default();
    let words = |values: &[f64]| values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ");
    let turned: Vec<f64> = positions.iter().map(|p| p.to_degrees()).collect();
    writeln!(out, "\nPlanets at {} deg, {} planets", words(&turned), positions.len())?;
    match train["phases"].as_str() {
        Some(how) => writeln!(out, "Mesh phases: {how}")?,
        None => writeln!(out, "Mesh phases: sun {}, ring {}", train["phases"]["sun"], train["phases"]["ring"])?,
    }
    if train["phases"] == "teeth" {
        let teeth = |name: &str| train["teeth"][name].as_u64().and_then(|z| u32::try_from(z).ok()).unwrap_or(0);
        let offset = train["ring_phase"].as_f64();
        writeln!(out, "  sun meshes  {} periods", words(&phase::sun_phases(teeth("sun"), &positions)))?;
        let ring = phase::ring_phases(teeth("ring"), &positions, offset.unwrap_or(0.0));
        let note = if offset.is_some() { "" } else { ", plus the phase between a planet's two meshes" };
        writeln!(out, "  ring meshes {} periods{note}", words(&ring))?;
    }
    Ok(out)
}
