use std::f64::consts::TAU;

use serde_json::{Value, json};

use super::{Context, Quantity, Units, maxima, number, representatives};
use crate::{
    analysis::{Spectrum, Window},
    hybrid::ContactMode,
    plot::{Axis, Band, Figure, Panel, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::{
        StudyError,
        record::{ModeInterval, Recording},
        steady,
    },
};

/// Least and largest number of cycles shown.
const SHOWN: [u64; 2] = [3, 60];
/// Mesh periods measured of a motion without a period.
const IRREGULAR: u64 = 60;
const PER_CYCLE: u32 = 512;

/// Draws forces over a few mesh periods at several loads (or at the load of the scene, if none can vary). The modes of the last mesh family
/// are shaded and its events marked. Below is the angular speed of a planet (in other trains the deflection).
pub fn cycles(
    context: &Context<'_>,
    scene: &Scene,
    [load, speed]: [Option<Quantity>; 2],
    loads: &[f64],
) -> Result<(Figure, Vec<Value>), StudyError> {
    let loads: Vec<Option<f64>> = match &load {
        Some(_) => loads.iter().copied().map(Some).collect(),
        None => vec![None],
    };
    let columns = context.each(&loads, |value| {
        let scene = match (&load, value) {
            (Some(load), Some(value)) => scene.with(&load.pointer, json!(value))?,
            _ => scene.clone(),
        };
        let simulation = Simulation::from_scene(&scene)?;
        // Whole periods of the motion are measured, three mesh periods are shown.
        // The slowest forcing is shown whole, if that is readable.
        let own = simulation.period()?;
        let slowest = simulation.structure.oscillators.iter().map(|o| TAU / o.omega.abs() / own).fold(0.0, f64::max);
        // OK to convert: a few cycles.
        let count = (slowest.min(SHOWN[1] as f64) - 1e-9).ceil().max(SHOWN[0] as f64) as u64;
        let irregular = context.rule.irregular_cycles.min(IRREGULAR);
        let cycles = |period: Option<u64>| period.map_or(irregular, |period| count.next_multiple_of(period));
        let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, false), cycles)?;
        let contacts = representatives(&simulation);
        let shaded = contacts.last().cloned().unwrap_or_default();
        let told = |quantity: &Option<Quantity>| {
            let Quantity { pointer, axis } = quantity.as_ref()?;
            Some(format!("{} {}", number(&scene, pointer).ok()?, axis.unit).trim_end().to_owned())
        };
        let title = [&load, &speed].into_iter().filter_map(told).collect::<Vec<_>>().join(", ");
        let found = found(*value, &recording, &contacts, steady::window(&settled));
        let shown = LoadRecording { recording: &recording.first(count), shaded, units: Units::of(&simulation) };
        let upper = shown.forces(&title, &contacts);
        let lower = shown.speed_of_planet(&simulation, &scene).unwrap_or_else(|| shown.deflection());
        Ok(([upper, lower], found, count))
    })?;
    let cycles = columns.iter().map(|(.., cycles)| *cycles).max().unwrap_or(SHOWN[0]);
    let (columns, found): (Vec<_>, Vec<_>) = columns.into_iter().map(|(panels, found, _)| (panels, found)).unzip();
    let count = columns.len();
    let (upper, lower): (Vec<Panel>, Vec<Panel>) = columns.into_iter().map(|[upper, lower]| (upper, lower)).unzip();
    let figure = Figure {
        id: "cycles".to_owned(),
        title: format!("Contact and separation over {cycles} mesh periods"),
        caption:
            "Shaded: the mesh carries no force (separated: between the flanks; detached: inside the flank's zone while \
                  the law would pull). Open circles: its events, at their exact times."
                .to_owned(),
        columns: count,
        panels: upper.into_iter().chain(lower).collect(),
    };
    Ok((figure, found))
}

/// Returns the measures at one load, of the last family of meshes: maxima of the force in a mesh period, its least value and its harmonics.
/// Shares of the mesh period without force are those of this family (`apart`) and of all families (`together`).
fn found(load: Option<f64>, recording: &Recording, contacts: &[(usize, String)], window: Window) -> Value {
    let Some(&(last, _)) = contacts.last() else {
        return json!({ "load": load, "peaks": 0, "smallest": 0.0, "harmonics": [], "apart": 0.0, "together": 0.0 });
    };
    let force = &recording.force[last];
    let cycles = force.len() as f64 / f64::from(PER_CYCLE);
    let spectrum = Spectrum::new(force, f64::from(PER_CYCLE), window);
    let span = cycles * recording.period;
    let open = |j: usize| recording.spells[j].iter().filter(|spell| !spell.mode.is_closed());
    // Intervals in which all families so far are open.
    let mut shared = vec![(0.0, span)];
    for &(j, _) in contacts {
        let parts = |&(from, to): &(f64, f64)| {
            let cut = open(j).map(move |spell| (spell.from.max(from), spell.to.min(to)));
            cut.filter(|(from, to)| to > from).collect::<Vec<_>>()
        };
        shared = shared.iter().flat_map(parts).collect();
    }
    json!({
        "load": load,
        "peaks": (maxima(force) as f64 / cycles).round() as usize,
        "smallest": force.iter().copied().fold(f64::INFINITY, f64::min),
        "harmonics": (1..=6).map(|h| spectrum.at(f64::from(h))).collect::<Vec<_>>(),
        "apart": open(last).fold(0.0, |sum, spell| sum + spell.to - spell.from) / span,
        "together": shared.iter().fold(0.0, |sum, (from, to)| sum + to - from) / span,
    })
}

/// Recording of one load, with the modes of one contact shaded.
struct LoadRecording<'a> {
    recording: &'a Recording,
    /// Index and family of the contact.
    shaded: (usize, String),
    units: Units,
}

impl LoadRecording<'_> {
    fn times(&self) -> Vec<f64> {
        self.recording.t.iter().map(|t| self.units.time.0 * t).collect()
    }

    fn panel(&self, title: &str, y: Axis) -> Panel {
        let ((factor, unit), (j, family)) = (self.units.time, &self.shaded);
        let bands = self.recording.spells[*j].iter().filter(|spell| !spell.mode.is_closed()).map(|spell| Band {
            x: [factor * spell.from, factor * spell.to],
            name: format!("{family} {}", spell.mode.name()),
            colour: usize::from(spell.mode != ContactMode::Separated),
        });
        Panel {
            title: title.to_owned(),
            x: Axis::new("time", unit).between(0.0, factor * self.recording.t.last().copied().unwrap_or_default()),
            y,
            bands: bands.collect(),
            ..Panel::default()
        }
    }

    /// Returns the events of the shaded contact, with a value at each.
    fn marks(&self, value: impl Fn(&ModeInterval) -> f64) -> Option<Series> {
        let (j, family) = &self.shaded;
        let events = self.recording.spells[*j].iter().skip(1);
        let (x, y): (Vec<f64>, Vec<f64>) = events.map(|spell| (self.units.time.0 * spell.from, value(spell))).unzip();
        (!x.is_empty()).then(|| Series { name: format!("events of {family}"), x, y, style: Style::Marks, colour: 7 })
    }

    fn forces(&self, title: &str, contacts: &[(usize, String)]) -> Panel {
        let mut panel = self.panel(title, Axis::new("contact force", self.units.force));
        for (colour, (j, family)) in contacts.iter().enumerate() {
            panel.series.push(Series::line(family, colour, self.times(), self.recording.force[*j].clone()));
        }
        panel.series.extend(self.marks(|spell| spell.force));
        panel
    }

    /// Returns the spin of the first planet relative to the carrier: its mean, `(ω_s − ω_c) Z_s/Z_p`, and its fluctuation.
    fn speed_of_planet(&self, simulation: &Simulation, scene: &Scene) -> Option<Panel> {
        let freedom = simulation.freedom("u_1").or_else(|_| simulation.freedom("u")).ok()?;
        let number = |pointer: &str| number(scene, pointer).ok();
        let [sun, planet, ring] =
            [number("/train/teeth/sun")?, number("/train/teeth/planet")?, number("/train/teeth/ring")?];
        let (radius, rpm) = (number("/train/planet/radius_m")?, number("/train/speed_rpm")?);
        let carried = rpm * std::f64::consts::TAU / 60.0 * (ring / (sun + ring)) * sun / planet;
        let n = simulation.structure.freedoms();
        // The planet turns against the sun: counter-clockwise is positive, and the sun turns that way.
        let speed = |rate: f64| carried - rate / radius;
        let y = self.recording.x[n + freedom].iter().map(|rate| speed(*rate)).collect();
        let mut panel = self.panel("", Axis::new("planet's speed relative to the carrier", "rad/s"));
        panel.series.push(Series::line("planet's speed", 2, self.times(), y));
        panel.series.extend(self.marks(|spell| speed(spell.x[n + freedom])));
        Some(panel)
    }

    fn deflection(&self) -> Panel {
        let ((j, family), (factor, unit)) = (&self.shaded, self.units.length);
        let mut panel = self.panel("", Axis::new("deflection", unit));
        let y = self.recording.deflection[*j].iter().map(|d| factor * d).collect();
        panel.series.push(Series::line(family, 2, self.times(), y));
        panel
    }
}
