//! Which number of the reference set controls which result: one change at a time.

use serde_json::{Value, json};

use super::{
    StudyError,
    figures::Context,
    threshold::{Search, locate},
};
use crate::scene::Scene;

/// A change of a scene, in words and as values at JSON pointers.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// What is changed.
    pub words: String,
    /// The new values.
    pub values: Vec<(String, Value)>,
}

/// What a change did to the motion of the last mesh family.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// The change.
    pub words: String,
    /// Time without force over the mesh period at each speed.
    pub apart: Vec<f64>,
    /// The load at which separations end, N m; 0 if there are none at any load.
    pub threshold: f64,
    /// Largest force, N.
    pub largest: f64,
}

/// Speeds at which the time apart is compared, rev/min; threshold and force belong to the second.
pub const SPEEDS: [f64; 3] = [50.0, 500.0, 2000.0];

fn scaled(scene: &Scene, pointer: &str, factors: &[f64]) -> (String, Value) {
    let mut harmonics = scene.resolved().pointer(pointer).cloned().unwrap_or_default();
    for (i, harmonic) in harmonics.as_array_mut().into_iter().flatten().enumerate() {
        let factor = factors.get(i).or(factors.last()).copied().unwrap_or(1.0);
        harmonic["amplitude_m"] = json!(harmonic["amplitude_m"].as_f64().unwrap_or(0.0) * factor);
    }
    (pointer.to_owned(), harmonics)
}

/// The changes of the reference set under light load.
#[must_use]
pub fn changes(scene: &Scene) -> Vec<Change> {
    let own = |pointer: &str| scene.resolved().pointer(pointer).and_then(Value::as_f64).unwrap_or(0.0);
    let change = |words: &str, values: Vec<(String, Value)>| Change { words: words.to_owned(), values };
    let (sun, ring) = ("/train/sun_mesh/error", "/train/ring_mesh/error");
    let errors = |factors: [f64; 2]| vec![scaled(scene, sun, &factors), scaled(scene, ring, &factors)];
    let set =
        |pointers: &[&str], value: f64| pointers.iter().map(|p| ((*p).to_owned(), json!(value))).collect::<Vec<_>>();
    let times = |pointers: &[&str], factor: f64| -> Vec<(String, Value)> {
        pointers.iter().map(|p| ((*p).to_owned(), json!(factor * own(p)))).collect()
    };
    let slope = "/train/load/drag_torque_nm_per_rpm";
    let restitution = ["/train/sun_mesh/law/restitution", "/train/ring_mesh/law/restitution"];
    let (sun_turn, carrier_turn) =
        ("/train/sun/rotation/stiffness_n_per_m", "/train/carrier/rotation/stiffness_n_per_m");
    let sun_damping = "/train/sun/rotation/damping_ratio";
    let supports = [
        "/train/sun/translation/damping_ratio",
        "/train/planet/translation/damping_ratio",
        "/train/ring/translation/damping_ratio",
        "/train/ring/rotation/damping_ratio",
        "/train/carrier/rotation/damping_ratio",
        "/train/planet/rotation/damping_n_s_per_m",
    ];
    vec![
        change("base", Vec::new()),
        change("errors x 0.75", errors([0.75, 0.75])),
        change("errors x 1.25", errors([1.25, 1.25])),
        change("second harmonics x 0.75", errors([1.0, 0.75])),
        change("second harmonics x 1.25", errors([1.0, 1.25])),
        change("no second harmonics", errors([1.0, 0.0])),
        change("errors of the sun meshes x 0.75", vec![scaled(scene, sun, &[0.75])]),
        change("errors of the sun meshes x 1.25", vec![scaled(scene, sun, &[1.25])]),
        change("drag per speed x 0.75", times(&[slope], 0.75)),
        change("drag per speed x 1.25", times(&[slope], 1.25)),
        change("no drag per speed", set(&[slope], 0.0)),
        change("no drag", set(&[slope, "/train/load/drag_torque_nm"], 0.0)),
        change("restitution 0.3", set(&restitution, 0.3)),
        change("restitution 0.95", set(&restitution, 0.95)),
        change("sun shaft 1.8e7 N/m", set(&[sun_turn], 1.8e7)),
        change("sun shaft 3e7 N/m", set(&[sun_turn], 3e7)),
        change("carrier shaft 2.5e8 N/m", set(&[carrier_turn], 2.5e8)),
        change("carrier shaft 1e9 N/m", set(&[carrier_turn], 1e9)),
        change("support damping x 0.75", times(&supports, 0.75)),
        change("support damping x 1.25", times(&supports, 1.25)),
        change("sun shaft damping x 0.75", times(&[sun_damping], 0.75)),
        change("sun shaft damping x 1.25", times(&[sun_damping], 1.25)),
    ]
}

/// Time apart, threshold and largest force of the meshes `stem` under each change, all from cold starts.
///
/// # Errors
/// [`StudyError`] of the runs.
pub fn effects(
    context: &Context<'_>,
    scene: &Scene,
    stem: &str,
    changes: &[Change],
    search: &Search,
) -> Result<Vec<Effect>, StudyError> {
    context.each(changes, |change| {
        let changed = scene.with_all(change.values.iter().map(|(pointer, value)| (pointer.as_str(), value.clone())))?;
        let mut apart = Vec::new();
        let mut largest = 0.0;
        for rpm in SPEEDS {
            let steady = context.steady(&changed.with("/train/speed_rpm", json!(rpm))?, None)?;
            let contact = steady.expect(stem, scene)?;
            apart.push(contact.report.no_force_fraction);
            if rpm == SPEEDS[1] {
                largest = contact.report.force_max.unwrap_or_default();
            }
        }
        let at = changed.with("/train/speed_rpm", json!(SPEEDS[1]))?;
        let threshold = locate(context, &at, "/train/load/output_torque_nm", stem, search)?;
        Ok(Effect { words: change.words.clone(), apart, threshold: threshold.middle().unwrap_or(0.0), largest })
    })
}
