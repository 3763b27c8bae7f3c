//! `flank check`.

use std::{fmt::Write, path::PathBuf};

use flank::{
    gear::contact::{Law, Release},
    hybrid::{HybridSystem, Mode},
    integrate::PerMode,
    linalg::multiplicities,
    scene::Duration,
    train::{ContactMode, ContactSpec, Flanks, bonded_modes, with_contact},
};

use super::{
    CliError, geometry, print,
    session::Session,
    table::{Table, number},
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
    let session = Session::open(arguments.scene.as_deref())?;
    let (engine, why) = session.engine(u64::MAX)?;
    drop(engine);
    print(&text(&session, &why).unwrap_or_default())
}

fn text(session: &Session, why: &str) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let (spec, s) = (session.case.structure.spec(), session.unit("s"));
    let kind = session.scene.resolved()["train"]["kind"].as_str().unwrap_or_default();
    writeln!(out, "{}  ({kind})", session.scene.name())?;
    writeln!(out, "  scene {}", session.scene.hash())?;
    writeln!(out, "  freedoms: {}", spec.freedoms.join(" "))?;
    writeln!(out, "  state: {} numbers, latched speeds included", session.case.structure.dim())?;
    let run = &session.case.built.run;
    let length = match run.duration {
        Duration::Cycles(n) => format!("{n} cycles, the first {} not measured", run.transient_cycles),
        Duration::Until(end) => format!("until t = {end} {s}"),
    };
    let period = run.period.map_or("none".to_owned(), |p| format!("{} {s}", number(p)));
    writeln!(out, "  run: {length}; cycle {period}")?;
    contacts(&mut out, session)?;
    let mut warnings: Vec<String> = session.case.built.warnings.iter().map(ToString::to_string).collect();
    frequencies(&mut out, session, &mut warnings)?;
    out.push_str(&geometry::text(&session.scene)?);
    integrators(&mut out, session, why)?;
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

fn contacts(out: &mut String, session: &Session) -> std::fmt::Result {
    let spec = session.case.structure.spec();
    writeln!(out, "\nContacts, delta positive towards the drive flank")?;
    let mut table = Table::new(&["contact", "law", "b", "mean stiffness", "modes", "guards", "starts"]);
    for (j, contact) in spec.contacts.iter().enumerate() {
        let (law, modes, guards) = automaton(contact);
        table.row(vec![
            contact.name.clone(),
            law.to_owned(),
            number(contact.half_backlash),
            number(contact.stiffness.mean()),
            modes,
            guards,
            flank::train::contact_mode(session.start.jump.mode, j).name().to_owned(),
        ]);
    }
    write!(out, "{table}")
}

fn frequencies(out: &mut String, session: &Session, warnings: &mut Vec<String>) -> std::fmt::Result {
    let spec = session.case.structure.spec();
    let modes = match bonded_modes(spec) {
        Ok(modes) => modes,
        Err(error) => {
            warnings.push(format!("no natural frequencies: {error}"));
            return Ok(());
        }
    };
    let unit = if session.case.built.dimensionless { "rad per unit of time" } else { "Hz" };
    let values = if session.case.built.dimensionless { modes.omega.clone() } else { modes.hertz() };
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
    let forcing = session.case.structure.clock().omega();
    if forcing > 0.0 && highest > STIFF * forcing {
        let ratio = number(highest / forcing);
        warnings.push(format!("the highest natural frequency is {ratio} times the forcing frequency: steps are short"));
    }
    Ok(())
}

fn integrators(out: &mut String, session: &Session, why: &str) -> std::fmt::Result {
    let structure = &session.case.structure;
    writeln!(out, "\nIntegrator\n  {why}")?;
    let count = structure.contacts().len();
    let set = |state| (0..count).fold(session.start.jump.mode, |mode, j| with_contact(mode, j, state));
    let modes: [(&str, Mode); 3] = [
        ("at the start", session.start.jump.mode),
        ("every contact open", set(ContactMode::Separated)),
        ("every contact on its drive flank", set(ContactMode::Drive)),
    ];
    let [from, _, end] = session.instants;
    let mut table = Table::new(&["mode", "fastest decay 1/s", "fastest oscillation rad/s", "stiff"]);
    for (name, mode) in modes {
        let rates = structure.rates(mode).unwrap_or_default();
        let stiff = PerMode::is_stiff(structure, mode, structure.clock().between(from, end));
        table.row(vec![
            name.to_owned(),
            number(rates.damped),
            number(rates.oscillating),
            if stiff { "yes" } else { "no" }.to_owned(),
        ]);
    }
    write!(out, "{table}")
}
