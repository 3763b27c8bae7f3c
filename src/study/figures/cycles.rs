use serde_json::json;

use super::{Context, Units, load_pointer, number, representatives, speed_pointer};
use crate::{
    analysis::{Spectrum, Window},
    hybrid::ContactMode,
    plot::{Axis, Band, Figure, Panel, Series, Style},
    scene::Scene,
    study::{
        Case, StudyError,
        record::{Recording, Spell, record},
        steady::settled,
    },
};

/// What one load showed, of the last family of meshes.
#[derive(Clone, Debug, PartialEq)]
pub struct Cycle {
    /// Load, N m.
    pub load: f64,
    /// Maxima of the force in a mesh period, rounded to whole ones.
    pub peaks: usize,
    /// Smallest force on the samples, N.
    pub smallest: f64,
    /// Amplitudes of the force at 1, 2, … times the mesh frequency, N.
    pub harmonics: Vec<f64>,
    /// Time without force over the mesh period.
    pub apart: f64,
    /// Time in which no family of meshes carries force, over the mesh period.
    pub together: f64,
}

/// Mesh periods shown.
const SHOWN: u64 = 3;
/// Mesh periods measured of a motion without a period.
const IRREGULAR: u64 = 60;
const PER_CYCLE: u32 = 512;

/// Forces over a few mesh periods at several loads, N m, with the modes of the last mesh family shaded and its events
/// marked; below them the angular speed of a planet (or the deflection, in other trains).
///
/// # Errors
/// [`StudyError`] of the runs.
pub fn cycles(context: &Context<'_>, scene: &Scene, loads: &[f64]) -> Result<(Figure, Vec<Cycle>), StudyError> {
    let columns = context.each(loads, |&load| {
        let scene = match load_pointer(scene) {
            Some(pointer) => scene.with(pointer, json!(load))?,
            None => scene.clone(),
        };
        let case = Case::new(&scene)?;
        let (mut engine, settled, _) = settled(&case, None, &context.rule, context.interrupted)?;
        // Whole periods of the motion are measured, three mesh periods are shown.
        let cycles = settled.period.map_or(IRREGULAR, |period| SHOWN.next_multiple_of(u64::from(period)));
        let recording = record(&case, &mut engine, cycles, PER_CYCLE)?;
        (context.done)();
        let contacts = representatives(&case);
        let shaded = contacts.last().cloned().unwrap_or_default();
        let at_load = load_pointer(&scene).map(|_| format!("{load} N m"));
        let at_speed = speed_pointer(&scene).map(|pointer| format!("{} rev/min", number(&scene, pointer)));
        let title = at_load.into_iter().chain(at_speed).collect::<Vec<_>>().join(", ");
        let found = found(load, &recording, &contacts, settled.window());
        let recording = recording.first(SHOWN);
        let units = Units::of(&case);
        let upper = forces(&title, &recording, &contacts, &shaded, &units);
        let lower = match speed_of_planet(&case, &scene, &recording, &shaded, &units) {
            Some(panel) => panel,
            None => deflection(&recording, &shaded, &units),
        };
        Ok(([upper, lower], found))
    })?;
    let (columns, found): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
    let count = columns.len();
    let (upper, lower): (Vec<Panel>, Vec<Panel>) = columns.into_iter().map(|[upper, lower]| (upper, lower)).unzip();
    let figure = Figure {
        id: "cycles".to_owned(),
        title: "Contact and separation over three mesh periods".to_owned(),
        caption:
            "Shaded: the mesh carries no force (separated: between the flanks; detached: inside the flank's zone while \
                  the law would pull). Open circles: its events, at their exact times."
                .to_owned(),
        columns: count,
        panels: upper.into_iter().chain(lower).collect(),
    };
    Ok((figure, found))
}

fn found(load: f64, recording: &Recording, contacts: &[(usize, String)], window: Window) -> Cycle {
    let Some(&(last, _)) = contacts.last() else {
        return Cycle { load, peaks: 0, smallest: 0.0, harmonics: Vec::new(), apart: 0.0, together: 0.0 };
    };
    let force = &recording.force[last];
    let n = force.len();
    let cycles = n as f64 / f64::from(PER_CYCLE);
    let peaks = (0..n).filter(|&i| force[i] > force[(i + n - 1) % n] && force[i] >= force[(i + 1) % n]).count();
    let spectrum = Spectrum::new(force, f64::from(PER_CYCLE), window);
    let span = cycles * recording.period;
    let open = |j: usize| recording.spells[j].iter().filter(|spell| !spell.mode.is_closed());
    // Stretches in which all families so far are open.
    let mut shared = vec![(0.0, span)];
    for &(j, _) in contacts {
        let parts = |&(from, to): &(f64, f64)| {
            let cut = open(j).map(move |spell| (spell.from.max(from), spell.to.min(to)));
            cut.filter(|(from, to)| to > from).collect::<Vec<_>>()
        };
        shared = shared.iter().flat_map(parts).collect();
    }
    Cycle {
        load,
        peaks: (peaks as f64 / cycles).round() as usize,
        smallest: force.iter().copied().fold(f64::INFINITY, f64::min),
        harmonics: (1..=6).map(|h| spectrum.at(f64::from(h))).collect(),
        apart: open(last).fold(0.0, |sum, spell| sum + spell.to - spell.from) / span,
        together: shared.iter().fold(0.0, |sum, (from, to)| sum + to - from) / span,
    }
}

fn times(recording: &Recording, units: &Units) -> Vec<f64> {
    recording.t.iter().map(|t| units.time.0 * t).collect()
}

fn panel(title: &str, recording: &Recording, y: Axis, shaded: &(usize, String), units: &Units) -> Panel {
    let (factor, unit) = units.time;
    let end = factor * SHOWN as f64 * recording.period;
    let bands = recording.spells[shaded.0].iter().filter(|spell| !spell.mode.is_closed()).map(|spell| Band {
        x: [factor * spell.from, factor * spell.to],
        name: format!("{} {}", shaded.1, spell.mode.name()),
        colour: usize::from(spell.mode != ContactMode::Separated),
    });
    Panel {
        title: title.to_owned(),
        x: Axis::new("time", unit).between(0.0, end),
        y,
        bands: bands.collect(),
        ..Panel::default()
    }
}

/// The events of the shaded contact, and a value at each.
fn marks(
    recording: &Recording,
    (j, family): &(usize, String),
    units: &Units,
    value: impl Fn(&Spell) -> f64,
) -> Option<Series> {
    let events = recording.spells[*j].iter().skip(1);
    let (x, y): (Vec<f64>, Vec<f64>) = events.map(|spell| (units.time.0 * spell.from, value(spell))).unzip();
    (!x.is_empty()).then(|| Series { name: format!("events of {family}"), x, y, style: Style::Marks, colour: 7 })
}

fn forces(
    title: &str,
    recording: &Recording,
    contacts: &[(usize, String)],
    shaded: &(usize, String),
    units: &Units,
) -> Panel {
    let mut panel = panel(title, recording, Axis::new("contact force", units.force), shaded, units);
    for (colour, (j, family)) in contacts.iter().enumerate() {
        panel.series.push(Series::line(family, colour, times(recording, units), recording.force[*j].clone()));
    }
    panel.series.extend(marks(recording, shaded, units, |spell| spell.force));
    panel
}

/// Spin of the first planet beside the carrier: its mean, `(ω_s − ω_c) Z_s/Z_p`, and what it fluctuates by.
fn speed_of_planet(
    case: &Case,
    scene: &Scene,
    recording: &Recording,
    shaded: &(usize, String),
    units: &Units,
) -> Option<Panel> {
    let freedom = case.freedom("u_1").or_else(|_| case.freedom("u")).ok()?;
    let [sun, planet, ring] = ["sun", "planet", "ring"].map(|gear| number(scene, &format!("/train/teeth/{gear}")));
    let (radius, rpm) = (number(scene, "/train/planet/radius_m"), number(scene, "/train/speed_rpm"));
    if radius <= 0.0 || planet <= 0.0 {
        return None;
    }
    let carried = rpm * std::f64::consts::TAU / 60.0 * (ring / (sun + ring)) * sun / planet;
    let n = case.structure.freedoms();
    // The planet turns against the sun: counter-clockwise is positive, and the sun turns that way.
    let speed = |rate: f64| carried - rate / radius;
    let y = recording.x[n + freedom].iter().map(|rate| speed(*rate)).collect();
    let mut panel = panel("", recording, Axis::new("planet's speed relative to the carrier", "rad/s"), shaded, units);
    panel.series.push(Series::line("planet's speed", 2, times(recording, units), y));
    panel.series.extend(marks(recording, shaded, units, |spell| speed(spell.x[n + freedom])));
    Some(panel)
}

fn deflection(recording: &Recording, shaded: &(usize, String), units: &Units) -> Panel {
    let mut panel = panel("", recording, Axis::new("deflection", units.length.1), shaded, units);
    let y = recording.deflection[shaded.0].iter().map(|d| units.length.0 * d).collect();
    panel.series.push(Series::line(&shaded.1, 2, times(recording, units), y));
    panel
}
