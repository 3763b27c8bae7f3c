//! A run told on a terminal.

use std::fmt::Write;

use flank::{
    Simulation,
    analysis::ContactReport,
    output::{Table, five_digits as number, label},
    scene::Duration,
    simulation::Summary,
};

/// The whole report.
pub fn text(simulation: &Simulation, summary: &Summary) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let train = &summary.train;
    let closed = simulation.structure.contacts().len();
    writeln!(out, "{}  ({}, {} freedoms, {closed} contacts)", summary.scene.name, train.kind, train.freedoms.len())?;
    let s = simulation.unit("s");
    let ending = &summary.outcome;
    let asked = match simulation.settings.duration {
        Duration::Cycles(n) => format!("{n} cycles"),
        Duration::Until(end) => format!("until t = {end}"),
    };
    let kind = label(ending.kind).replace('-', " ");
    write!(out, "  {asked}: {kind}, t = {} {s}", number(ending.seconds))?;
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
    contacts(&mut out, simulation, summary)?;
    write!(out, "\nEnergy {}\n{}", simulation.unit("J"), energy(summary))?;
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

fn contacts(out: &mut String, simulation: &Simulation, summary: &Summary) -> std::fmt::Result {
    let (s, n) = (simulation.unit("s"), simulation.unit("N"));
    let unit = |name: &str, unit: &str| if unit.is_empty() { name.to_owned() } else { format!("{name} {unit}") };
    writeln!(out, "\nContacts over {} {s}", number(summary.measured_time))?;
    let per = if simulation.settings.period.is_some() { "/cycle" } else { "" };
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
    // Cycles of the run; of the train's own forcing where the scene names none.
    let cycles = simulation.settings.period.map_or(1.0, |period| summary.measured_time / period);
    let each = |count: u64| number((cycles > 0.0).then(|| count as f64 / cycles));
    let row = |c: &ContactReport| {
        let [least, mean, most] = [c.durations.min, c.durations.mean, c.durations.max].map(number);
        let (share, closed) = (number(100.0 * c.no_force_fraction), each(c.drive_contacts + c.back_contacts));
        let [force, largest] = [c.force_mean, c.force_abs_max].map(number);
        vec![c.name.clone(), share, each(c.separations), least, mean, most, closed, force, largest]
    };
    write!(out, "{}", Table::new(head).with(summary.contacts.iter().map(row)))
}

fn energy(summary: &Summary) -> Table {
    let e = &summary.energy;
    let rows = [
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
    ];
    let shown = rows.into_iter().filter(|(name, value)| *value != 0.0 || !name.starts_with(['+', '-']));
    Table::default().with(shown.map(|(name, value)| vec![name.to_owned(), number(value)]))
}
