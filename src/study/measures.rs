//! Measures of contacts and bearings in tables.

use super::steady::{ContactSteady, Steady};
use crate::{analysis::BearingReport, output::Fault, system::Structure};

/// Measure of each contact, or of each bearing.
#[derive(Debug)]
enum MeasureScope {
    Contact(fn(&ContactSteady) -> Option<f64>),
    Bearing(fn(&BearingReport) -> f64),
}

/// Column of each contact or bearing: its name, its unit, the value.
#[derive(Debug)]
struct Measure(&'static str, &'static str, MeasureScope);

const ALL: [Measure; 34] = [
    Measure("apart_fraction", "", MeasureScope::Contact(|c| Some(c.report.apart_fraction))),
    Measure("no_force_fraction", "", MeasureScope::Contact(|c| Some(c.report.no_force_fraction))),
    Measure("separations_per_cycle", "", MeasureScope::Contact(|c| c.report.separations_per_cycle)),
    Measure("contacts_per_cycle", "", MeasureScope::Contact(|c| c.report.contacts_per_cycle)),
    Measure("no_force_mean", "_s", MeasureScope::Contact(|c| c.report.durations.mean)),
    Measure("no_force_longest", "_s", MeasureScope::Contact(|c| c.report.durations.max)),
    Measure("force_mean", "_n", MeasureScope::Contact(|c| Some(c.report.force_mean))),
    Measure("force_min", "_n", MeasureScope::Contact(|c| c.report.force_min)),
    Measure("force_max", "_n", MeasureScope::Contact(|c| c.report.force_max)),
    Measure("force_amplitude", "_n", MeasureScope::Contact(|c| Some(c.force_amplitude))),
    Measure("force_harmonic_1", "_n", MeasureScope::Contact(|c| c.force_harmonics.first().copied())),
    Measure("force_harmonic_2", "_n", MeasureScope::Contact(|c| c.force_harmonics.get(1).copied())),
    Measure("deflection_min", "_m", MeasureScope::Contact(|c| c.report.deflection_min)),
    Measure("deflection_max", "_m", MeasureScope::Contact(|c| c.report.deflection_max)),
    Measure("transmission_mean", "_m", MeasureScope::Contact(|c| Some(c.transmission_mean))),
    Measure("transmission_rms", "_m", MeasureScope::Contact(|c| Some(c.transmission_rms))),
    Measure("transmission_peak_to_peak", "_m", MeasureScope::Contact(|c| Some(c.transmission_peak_to_peak))),
    Measure("force_deviation", "_n", MeasureScope::Contact(|c| c.report.force_deviation)),
    Measure("energy_loss_rate", "_w", MeasureScope::Contact(|c| Some(c.report.energy_loss_rate))),
    Measure("impulse", "_n_s", MeasureScope::Contact(|c| Some(c.report.impulse))),
    Measure("load_share", "", MeasureScope::Contact(|c| c.report.load_share)),
    Measure("rattle_index", "", MeasureScope::Contact(|c| c.report.rattle_index)),
    Measure("drive_impacts", "", MeasureScope::Contact(|c| Some(c.report.impacts.drive as f64))),
    Measure("back_impacts", "", MeasureScope::Contact(|c| Some(c.report.impacts.back as f64))),
    Measure("impacts_per_cycle", "", MeasureScope::Contact(|c| c.report.impacts.per_cycle)),
    Measure("impact_speed_max", "_m_per_s", MeasureScope::Contact(|c| c.report.impacts.speed_max)),
    Measure("impact_speed_mean", "_m_per_s", MeasureScope::Contact(|c| c.report.impacts.speed_mean)),
    Measure("impact_speed_rms", "_m_per_s", MeasureScope::Contact(|c| c.report.impacts.speed_rms)),
    Measure("impact_speed_50", "_m_per_s", MeasureScope::Contact(|c| c.report.impacts.speed_50)),
    Measure("impact_speed_95", "_m_per_s", MeasureScope::Contact(|c| c.report.impacts.speed_95)),
    Measure("impact_speed_99", "_m_per_s", MeasureScope::Contact(|c| c.report.impacts.speed_99)),
    Measure("bearing_force_mean", "_n", MeasureScope::Bearing(|b| b.force_mean)),
    Measure("bearing_force_deviation", "_n", MeasureScope::Bearing(|b| b.force_deviation)),
    Measure("bearing_force_max", "_n", MeasureScope::Bearing(|b| b.force_max)),
];

/// Default measures of a table.
const USUAL: [&str; 19] = [
    "apart_fraction",
    "no_force_fraction",
    "separations_per_cycle",
    "contacts_per_cycle",
    "no_force_mean",
    "no_force_longest",
    "force_mean",
    "force_min",
    "force_max",
    "force_amplitude",
    "force_harmonic_1",
    "force_harmonic_2",
    "deflection_min",
    "deflection_max",
    "transmission_rms",
    "impacts_per_cycle",
    "impact_speed_max",
    "bearing_force_deviation",
    "bearing_force_max",
];

/// Contacts and bearings of a table, with the measures of each.
#[derive(Clone, Debug)]
pub(crate) struct Measures {
    measures: Vec<&'static Measure>,
    contacts: Vec<String>,
    bearings: Vec<String>,
}

impl Measures {
    /// Returns the usual measures, of no contact yet.
    pub fn usual() -> Self {
        let usual = ALL.iter().filter(|measure| USUAL.contains(&measure.0));
        Self { measures: usual.collect(), contacts: Vec::new(), bearings: Vec::new() }
    }

    /// Returns measures by their names without unit; the usual ones if no names are given.
    ///
    /// # Errors
    /// Names that are unknown.
    pub fn named(names: &[impl AsRef<str>]) -> Result<Self, Vec<Fault>> {
        let (mut faults, mut measures) = (Vec::new(), Vec::new());
        for name in names.iter().map(AsRef::as_ref) {
            match ALL.iter().find(|measure| measure.0 == name) {
                Some(measure) => measures.push(measure),
                None => {
                    let allowed: Vec<&str> = ALL.iter().map(|measure| measure.0).collect();
                    let fault = Fault::new("columns", format!("{name:?}"), allowed.join(", "));
                    faults.push(fault.remedy("name one of them"));
                }
            }
        }
        let usual = Self::usual();
        let measures = if names.is_empty() { usual.measures } else { measures };
        if faults.is_empty() { Ok(Self { measures, ..usual }) } else { Err(faults) }
    }

    /// Adds the contacts and bearings of a train.
    pub fn of(mut self, structure: &Structure) -> Self {
        self.contacts = numbered(structure.contacts().iter().map(|contact| &*contact.spec.name));
        self.bearings = numbered(structure.spec().bearings.iter().map(|bearing| &*bearing.name));
        self
    }

    /// Adds those contacts and bearings of a motion that are missing in the table.
    pub fn take(&mut self, steady: &Steady) {
        for (names, own) in [(&mut self.contacts, contacts(steady)), (&mut self.bearings, bearings(steady))] {
            for name in own {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
    }

    /// Returns each column: its contact or bearing, and its measure; those of contacts first.
    fn each(&self) -> impl Iterator<Item = (&String, &'static Measure)> {
        let of = |is_of_contact: bool| {
            move |name| {
                let own =
                    self.measures.iter().filter(move |m| matches!(m.2, MeasureScope::Contact(_)) == is_of_contact);
                own.map(move |measure| (name, *measure))
            }
        };
        self.contacts.iter().flat_map(of(true)).chain(self.bearings.iter().flat_map(of(false)))
    }

    /// Returns the names of the columns. A dimensionless train has no units.
    pub fn columns(&self, is_dimensionless: bool) -> Vec<String> {
        self.each().map(|(part, measure)| format!("{part} {}", measure.title(is_dimensionless))).collect()
    }

    /// Returns the values of the columns, none if a motion has no such contact.
    pub fn values(&self, steady: Option<&Steady>) -> Vec<Option<f64>> {
        let Some(steady) = steady else { return vec![None; self.each().count()] };
        let [contacts, bearings] = [contacts(steady), bearings(steady)];
        let value = |(part, measure): (&String, &Measure)| match measure.2 {
            MeasureScope::Contact(value) => {
                contacts.iter().position(|name| name == part).and_then(|j| value(&steady.contacts[j]))
            }
            MeasureScope::Bearing(value) => {
                bearings.iter().position(|name| name == part).map(|j| value(&steady.bearings[j]))
            }
        };
        self.each().map(value).collect()
    }

    /// Returns the places of the columns of the first measure.
    pub fn of_first(&self) -> Vec<usize> {
        let is_first = |(_, (_, measure)): &(usize, (&String, &Measure))| {
            self.measures.first().is_some_and(|first| first.0 == measure.0)
        };
        self.each().enumerate().filter(is_first).map(|(i, _)| i).collect()
    }

    /// Returns the title of the first measure: its contact or bearing, or that it is the largest of all, and its name with unit.
    pub fn title(&self, is_dimensionless: bool) -> String {
        let Some(first) = self.measures.first() else { return String::new() };
        let (parts, all) = match first.2 {
            MeasureScope::Contact(_) => (&self.contacts, "contacts"),
            MeasureScope::Bearing(_) => (&self.bearings, "bearings"),
        };
        let part = match &parts[..] {
            [part] => part.clone(),
            _ => format!("largest of all {all}"),
        };
        let title = first.title(is_dimensionless);
        format!("{part}: {}", if title == "apart_fraction" { "time apart / period" } else { &title })
    }
}

impl Measure {
    /// Returns the name with its unit.
    fn title(&self, is_dimensionless: bool) -> String {
        format!("{}{}", self.0, if is_dimensionless { "" } else { self.1 })
    }
}

fn contacts(steady: &Steady) -> Vec<String> {
    numbered(steady.contacts.iter().map(|contact| &*contact.report.name))
}

fn bearings(steady: &Steady) -> Vec<String> {
    numbered(steady.bearings.iter().map(|bearing| &*bearing.name))
}

/// Returns unique names: a repeated one gets a number.
pub(crate) fn numbered<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let names: Vec<&str> = names.collect();
    let name = |j: usize| {
        let before = names[..j].iter().filter(|other| **other == names[j]).count();
        if before == 0 { names[j].to_owned() } else { format!("{} ({})", names[j], before + 1) }
    };
    (0..names.len()).map(name).collect()
}
