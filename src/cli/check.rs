//! `flank check`.

use std::{fmt::Write, path::PathBuf};

use super::{CliError, open, print};
use flank::{
    Simulation,
    gear::contact::{Law, Release},
    hybrid::{ContactMode, HybridSystem, Mode as HybridMode},
    integrate::PerMode,
    linalg::multiplicities,
    output::{Table, five_digits as number},
    scene::Duration,
    simulation::{Mode, Report},
    system::{ContactSpec, Flanks, bonded_modes, contact_mode, set_contact},
};

/// Arguments of `flank check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Print the same as JSON
    #[arg(long)]
    json: bool,
}

/// A highest natural frequency so many times the forcing frequency is worth a word.
const STIFF: f64 = 1e3;
/// Frequencies closer than this, relative, are one.
const SAME: f64 = 1e-9;

/// Shows what a scene builds.
pub fn execute(arguments: &Arguments) -> Result<(), CliError> {
    let simulation = open(arguments.scene.as_deref())?;
    if arguments.json {
        let report = serde_json::to_string_pretty(&simulation.report()).unwrap_or_default();
        return print(&(report + "\n"));
    }
    let start = simulation.start()?;
    let (_, why) = simulation.limited(start.clone(), u64::MAX)?;
    print(&text(&simulation, &start.jump.mode, &why).unwrap_or_default())
}

fn text(simulation: &Simulation, start: &HybridMode, why: &str) -> Result<String, std::fmt::Error> {
    let report = simulation.report();
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
    let common = report.common_cycle.filter(|cycles| *cycles > 1);
    let common = common.map_or(String::new(), |cycles| format!("; all forcing repeats after {cycles} of them"));
    writeln!(out, "  run: {length}; cycle {period}{common}")?;
    contacts(&mut out, simulation, start)?;
    let mut warnings = report.warnings.clone();
    frequencies(&mut out, simulation, &report)?;
    warnings.extend(stiffness(simulation));
    out.push_str(&kinematics(&report)?);
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

fn contacts(out: &mut String, simulation: &Simulation, start: &HybridMode) -> std::fmt::Result {
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

fn frequencies(out: &mut String, simulation: &Simulation, report: &Report) -> std::fmt::Result {
    let unit = if simulation.dimensionless { "rad per unit of time" } else { "Hz" };
    if report.modes.is_empty() {
        return Ok(());
    }
    writeln!(out, "\nNatural frequencies, every contact closed at its mean stiffness, {unit}")?;
    let contacts = &simulation.structure.spec().contacts;
    if contacts.iter().any(|c| matches!(c.law, Law::Power(_) | Law::Rigid(_))) {
        writeln!(out, "  (laws that are not linear are taken at stiffness K: an order of magnitude at best)")?;
    }
    let values: Vec<f64> = report.modes.iter().map(|mode| mode.frequency_hz).collect();
    let words = multiplicities(&values, SAME).into_iter().map(|(f, count)| match count {
        1 => number(f),
        _ => format!("{} ({count} times)", number(f)),
    });
    writeln!(out, "  {}", words.collect::<Vec<_>>().join(", "))?;
    let rows: Vec<Vec<String>> = report.modes.iter().filter_map(beside_orders).collect();
    if rows.is_empty() {
        return Ok(());
    }
    write!(
        out,
        "\nModes beside what excites them\n{}",
        Table::new(["mode Hz", "moves, % of its energy", "nearest order", "Hz", "apart %"]).with(rows)
    )
}

/// A mode, what moves in it and the nearest order.
fn beside_orders(mode: &Mode) -> Option<Vec<String>> {
    let nearest = mode.nearest.as_ref()?;
    let moves = mode.moves.iter().map(|share| format!("{} {:.0}", share.freedom, 100.0 * share.share));
    let [frequency, of, apart] = [mode.frequency_hz, nearest.frequency_hz, 100.0 * nearest.apart].map(number);
    Some(vec![frequency, moves.collect::<Vec<_>>().join(", "), nearest.of.clone(), of, apart])
}

fn integrators(out: &mut String, simulation: &Simulation, start: &HybridMode, why: &str) -> std::fmt::Result {
    let structure = &simulation.structure;
    writeln!(out, "\nIntegrator\n  {why}")?;
    let count = structure.contacts().len();
    let set = |state| {
        let mut mode = start.clone();
        (0..count).for_each(|j| set_contact(&mut mode, j, state));
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

/// Mean speeds of the shafts of a gearbox, clocks of the meshes, and their geometry as far as the teeth are given.
fn kinematics(report: &Report) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    if !report.speeds.is_empty() {
        let rows = report.speeds.iter().map(|s| vec![s.name.clone(), number(s.speed_rpm), number(s.frequency_hz)]);
        write!(out, "\nSpeeds, counter-clockwise positive\n{}", Table::new(["shaft", "rev/min", "Hz"]).with(rows))?;
    }
    let words = |values: &[f64]| values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ");
    if report.meshes.iter().any(|mesh| mesh.frequency_hz > 0.0) {
        let rows = report.meshes.iter().map(|m| vec![m.name.clone(), number(m.frequency_hz), words(&m.phases)]);
        write!(out, "\nMesh clocks\n{}", Table::new(["mesh", "frequency Hz", "phases, periods"]).with(rows))?;
    }
    let rows: Vec<Vec<String>> = report
        .meshes
        .iter()
        .filter_map(|m| {
            let radii = words(&m.base_radii_m?.map(|r| 1e3 * r));
            let [angle, distance, ratio, overlap] =
                [m.working_angle_deg, m.centre_distance_m.map(|a| 1e3 * a), m.contact_ratio, m.overlap_ratio]
                    .map(number);
            Some(vec![m.name.clone(), angle, distance, radii, ratio, overlap])
        })
        .collect();
    if !rows.is_empty() {
        let head =
            ["mesh", "working angle deg", "centre distance mm", "base radii mm", "contact ratio", "overlap ratio"];
        write!(out, "\nMesh geometry\n{}", Table::new(head).with(rows))?;
    }
    Ok(out)
}
