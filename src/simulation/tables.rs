//! Measures of a run as tables.

use super::{Simulation, Summary};
use crate::{
    analysis::ContactReport,
    output::{Table, five_digits as number},
};

impl Summary {
    /// Returns the table of separations of each contact.
    #[must_use]
    pub fn separation_table(&self, simulation: &Simulation) -> Table {
        let per = per_cycle(simulation);
        let s = |name: &str| with_unit(name, simulation.unit("s"));
        let head = [
            "contact".to_owned(),
            "apart %".to_owned(),
            "no force %".to_owned(),
            format!("separations{per}"),
            s("no force: min"),
            s("mean"),
            s("max"),
        ];
        let each = self.by_cycle(simulation);
        let row = |c: &ContactReport| {
            let [apart, share] = [c.apart_fraction, c.no_force_fraction].map(|fraction| number(100.0 * fraction));
            let [least, mean, most] = [c.durations.min, c.durations.mean, c.durations.max].map(number);
            vec![c.name.clone(), apart, share, each(c.separations), least, mean, most]
        };
        let title = format!("Separations over {}", with_unit(&number(self.measured_time), simulation.unit("s")));
        Table::new(head).with(self.contacts.iter().map(row)).titled(&title, "")
    }

    /// Returns the table of forces and impacts of each contact, and of its dynamic transmission error.
    #[must_use]
    pub fn force_table(&self, simulation: &Simulation) -> Table {
        let per = per_cycle(simulation);
        let head = [
            "contact".to_owned(),
            with_unit("mean force", simulation.unit("N")),
            with_unit("largest", simulation.unit("N")),
            format!("contacts{per}"),
            format!("impacts{per}"),
            with_unit("fastest", simulation.unit("m/s")),
            with_unit("DTE: RMS", simulation.unit("m")),
        ];
        let each = self.by_cycle(simulation);
        let row = |(j, c): (usize, &ContactReport)| {
            let [force, largest] = [c.force_mean, c.force_abs_max].map(number);
            let [closed, impacts] = [c.drive_contacts + c.back_contacts, c.impacts.drive + c.impacts.back].map(&each);
            let error = number(self.transmission.get(j).map(|t| t.rms));
            vec![c.name.clone(), force, largest, closed, impacts, number(c.impacts.speed_max), error]
        };
        let note = "Contacts: force begins. Impacts: it begins out of the gap. DTE: dynamic transmission error, about its mean.";
        Table::new(head).with(self.contacts.iter().enumerate().map(row)).titled("Forces and impacts", note)
    }

    /// Returns the table of forces of the bearings.
    #[must_use]
    pub fn bearing_table(&self, simulation: &Simulation) -> Table {
        let n = |name: &str| with_unit(name, simulation.unit("N"));
        let rows = self.bearings.iter().map(|bearing| {
            let forces = [bearing.force_mean, bearing.force_deviation, bearing.force_max].map(number);
            [vec![bearing.name.clone()], forces.to_vec()].concat()
        });
        Table::new(["bearing of".to_owned(), n("mean force"), n("RMS about it"), n("largest")])
            .with(rows)
            .titled("Bearings", "Sizes of force vectors.")
    }

    /// Returns the table of the energy ledger.
    #[must_use]
    pub fn energy_table(&self, simulation: &Simulation) -> Table {
        let e = &self.energy;
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
        Table::default()
            .with(shown.map(|(name, value)| vec![name.to_owned(), number(value)]))
            .titled(&with_unit("Energy", simulation.unit("J")), "")
    }

    /// Returns counts per cycle of the run; plain counts if its scene has no cycles.
    fn by_cycle(&self, simulation: &Simulation) -> impl Fn(u64) -> String + use<> {
        let cycles = simulation.settings.period.map_or(1.0, |period| self.measured_time / period);
        move |count: u64| number((cycles > 0.0).then(|| count as f64 / cycles))
    }
}

fn per_cycle(simulation: &Simulation) -> &'static str {
    if simulation.settings.period.is_some() { "/cycle" } else { "" }
}

fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} {unit}") }
}
