//! A run told on a terminal.

use std::fmt::Write;

use super::{
    session::Session,
    summary::{Summary, asked_for},
    table::{Table, number},
};

/// The whole report.
pub fn text(session: &Session, summary: &Summary) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let train = &summary.train;
    let closed = session.case.structure.contacts().len();
    writeln!(out, "{}  ({}, {} freedoms, {closed} contacts)", summary.scene.name, train.kind, train.freedoms.len())?;
    let s = session.unit("s");
    let ending = &summary.outcome;
    write!(out, "  {}: {}, t = {} {s}", asked_for(session), ending.kind.replace('-', " "), number(ending.seconds))?;
    if let Some(cycle) = train.cycle {
        write!(out, ", cycle {}", number((ending.seconds / cycle * 1e9).round() / 1e9))?;
    }
    writeln!(out, "  [{}]", ending.mode)?;
    if let Some(reason) = &ending.reason {
        writeln!(out, "  {reason}")?;
    }
    writeln!(out, "  {}", summary.integrator.why)?;
    for (mode, name) in &summary.integrator.modes {
        writeln!(out, "    {name}: {mode}")?;
    }
    contacts(&mut out, session, summary)?;
    energy(&mut out, session, summary)?;
    let w = &summary.work;
    writeln!(
        out,
        "\nWork: {} events in {} steps, {} known switches, {} grazes, {} impact sequences summed",
        w.events, w.steps, w.switches, w.grazes, w.accumulations
    )?;
    for warning in &summary.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(out)
}

fn contacts(out: &mut String, session: &Session, summary: &Summary) -> std::fmt::Result {
    let (s, n) = (session.unit("s"), session.unit("N"));
    let unit = |name: &str, unit: &str| if unit.is_empty() { name.to_owned() } else { format!("{name} {unit}") };
    writeln!(out, "\nContacts over {} {s}", number(summary.measured_time))?;
    let per = if session.case.built.run.period.is_some() { "/cycle" } else { "" };
    let head = [
        "contact".to_owned(),
        "apart %".to_owned(),
        format!("separations{per}"),
        unit("shortest", s),
        unit("mean", s),
        unit("longest", s),
        format!("contacts{per}"),
        unit("mean force", n),
        unit("max force", n),
    ];
    let mut table = Table::new(head);
    // Cycles of the run; of the train's own forcing where the scene names none.
    let cycles = session.case.built.run.period.map_or(1.0, |period| summary.measured_time / period);
    let each = |count: u64| number((cycles > 0.0).then(|| count as f64 / cycles));
    for c in &summary.contacts {
        table.row(vec![
            c.name.clone(),
            number(100.0 * c.no_force_fraction),
            each(c.separations),
            number(c.durations.min),
            number(c.durations.mean),
            number(c.durations.max),
            each(c.drive_contacts + c.back_contacts),
            number(c.force_mean),
            number(c.force_abs_max),
        ]);
    }
    write!(out, "{table}")
}

fn energy(out: &mut String, session: &Session, summary: &Summary) -> std::fmt::Result {
    let e = &summary.energy;
    let j = session.unit("J");
    writeln!(out, "\nEnergy {j}")?;
    let mut table = Table::default();
    for (name, value) in [
        ("at the start", e.start),
        ("+ work of loads", e.load),
        ("+ work of errors", e.error),
        ("+ work of varying stiffness", e.parametric),
        ("- dampers", e.damping),
        ("- contacts", e.contact),
        ("- let go under load", e.release),
        ("- rigid impacts", e.impact),
        ("at the end", e.end),
        ("unexplained", e.residual),
    ] {
        if value != 0.0 || !name.starts_with(['+', '-']) {
            table.row(vec![name.to_owned(), number(value)]);
        }
    }
    write!(out, "{table}")
}
