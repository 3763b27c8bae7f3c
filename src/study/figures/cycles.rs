use serde_json::json;

use super::{Context, load_pointer, number, representatives};
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
    /// Maxima of the force in a mesh period.
    pub peaks: usize,
    /// Amplitudes of the force at 1, 2, … times the mesh frequency, N.
    pub harmonics: Vec<f64>,
    /// Time without force over the mesh period.
    pub apart: f64,
    /// Time in which no family of meshes carries force, over the mesh period.
    pub together: f64,
}

/// Mesh periods shown.
const SHOWN: u64 = 3;
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
        let (mut engine, ..) = settled(&case, None, &context.rule, context.interrupted)?;
        let recording = record(&case, &mut engine, SHOWN, PER_CYCLE)?;
        (context.done)();
        let contacts = representatives(&case);
        let shaded = contacts.last().cloned().unwrap_or_default();
        let title = format!("{load} N m, {} rev/min", number(&scene, "/train/speed_rpm"));
        let upper = forces(&title, &recording, &contacts, &shaded);
        let lower = match speed_of_planet(&case, &scene, &recording, &shaded) {
            Some(panel) => panel,
            None => deflection(&recording, &shaded),
        };
        Ok(([upper, lower], found(load, &recording, &contacts)))
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

fn found(load: f64, recording: &Recording, contacts: &[(usize, String)]) -> Cycle {
    let Some(&(last, _)) = contacts.last() else {
        return Cycle { load, peaks: 0, harmonics: Vec::new(), apart: 0.0, together: 0.0 };
    };
    let force = &recording.force[last];
    let (from, to) = (PER_CYCLE as usize, 2 * PER_CYCLE as usize);
    let peaks = (from..to.min(force.len() - 1)).filter(|&i| force[i] > force[i - 1] && force[i] >= force[i + 1]);
    let spectrum = Spectrum::new(force, f64::from(PER_CYCLE), Window::Rectangular);
    let span = SHOWN as f64 * recording.period;
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
        peaks: peaks.count(),
        harmonics: (1..=6).map(|h| spectrum.at(f64::from(h))).collect(),
        apart: open(last).fold(0.0, |sum, spell| sum + spell.to - spell.from) / span,
        together: shared.iter().fold(0.0, |sum, (from, to)| sum + to - from) / span,
    }
}

fn milliseconds(recording: &Recording) -> Vec<f64> {
    recording.t.iter().map(|t| 1e3 * t).collect()
}

fn panel(title: &str, recording: &Recording, y: Axis, shaded: &(usize, String)) -> Panel {
    let end = 1e3 * SHOWN as f64 * recording.period;
    let bands = recording.spells[shaded.0].iter().filter(|spell| !spell.mode.is_closed()).map(|spell| Band {
        x: [1e3 * spell.from, 1e3 * spell.to],
        name: format!("{} {}", shaded.1, spell.mode.name()),
        colour: usize::from(spell.mode != ContactMode::Separated),
    });
    Panel {
        title: title.to_owned(),
        x: Axis::new("time", "ms").between(0.0, end),
        y,
        bands: bands.collect(),
        ..Panel::default()
    }
}

/// The events of the shaded contact, and a value at each.
fn marks(recording: &Recording, (j, family): &(usize, String), value: impl Fn(&Spell) -> f64) -> Option<Series> {
    let events = recording.spells[*j].iter().skip(1);
    let (x, y): (Vec<f64>, Vec<f64>) = events.map(|spell| (1e3 * spell.from, value(spell))).unzip();
    (!x.is_empty()).then(|| Series { name: format!("events of {family}"), x, y, style: Style::Marks, colour: 7 })
}

fn forces(title: &str, recording: &Recording, contacts: &[(usize, String)], shaded: &(usize, String)) -> Panel {
    let mut panel = panel(title, recording, Axis::new("mesh force", "N"), shaded);
    for (colour, (j, family)) in contacts.iter().enumerate() {
        panel.series.push(Series::line(family, colour, milliseconds(recording), recording.force[*j].clone()));
    }
    panel.series.extend(marks(recording, shaded, |spell| spell.force));
    panel
}

/// Spin of the first planet beside the carrier: its mean, `(ω_s − ω_c) Z_s/Z_p`, and what it fluctuates by.
fn speed_of_planet(case: &Case, scene: &Scene, recording: &Recording, shaded: &(usize, String)) -> Option<Panel> {
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
    let mut panel = panel("", recording, Axis::new("planet's speed relative to the carrier", "rad/s"), shaded);
    panel.series.push(Series::line("planet's speed", 2, milliseconds(recording), y));
    panel.series.extend(marks(recording, shaded, |spell| speed(spell.x[n + freedom])));
    Some(panel)
}

fn deflection(recording: &Recording, shaded: &(usize, String)) -> Panel {
    let mut panel = panel("", recording, Axis::new("deflection", "µm"), shaded);
    let y = recording.deflection[shaded.0].iter().map(|d| 1e6 * d).collect();
    panel.series.push(Series::line(&shaded.1, 2, milliseconds(recording), y));
    panel
}
