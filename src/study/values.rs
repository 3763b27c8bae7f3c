//! The reference set's numbers beside those of an independent implementation.
//!
//! The other values come from a fixed-step prototype of the same equations (Runge–Kutta, 5 µs, checked by halving the
//! step), the rows marked *events* from a second one with located events (order 8, relative tolerance 1e-8), statics and
//! the heavy load from linear algebra. Each row has the tolerance stated for it; where none was, half a unit of the last
//! digit printed (and 0.3 % of forces under light load), or 0.002 for fractions.

use serde_json::{Value, json};

use super::{
    StudyError,
    figures::{self, Context},
    steady::{ContactSteady, Steady},
    threshold::{Search, locate},
};
use crate::{
    scene::Scene,
    train::{Damping, Freedoms, Support, TrainError, equilibrium, planetary::presets::reference_heavy},
};

/// One number, twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// What it is.
    pub quantity: String,
    /// The other implementation's value.
    pub expected: f64,
    /// How far the two may lie apart.
    pub tolerance: f64,
    /// Flank's value.
    pub found: f64,
}

impl Checked {
    /// Whether the two lie within the tolerance.
    #[must_use]
    pub fn holds(&self) -> bool {
        (self.found - self.expected).abs() <= self.tolerance
    }
}

/// Scenes of the reference set.
pub(super) struct Scenes<'s> {
    pub heavy: &'s Scene,
    pub light: &'s Scene,
    pub floating: &'s Scene,
}

const SPEED: &str = "/train/speed_rpm";
const LOAD: &str = "/train/load/output_torque_nm";

/// All numbers.
///
/// # Errors
/// [`StudyError`] of the runs.
pub(super) fn values(context: &Context<'_>, scenes: &Scenes<'_>) -> Result<Vec<Checked>, StudyError> {
    let parts: [&(dyn Fn() -> Result<Vec<Checked>, StudyError> + Sync); 6] = [
        &statics,
        &|| heavy(context, scenes.heavy),
        &|| modulated(context, scenes.heavy),
        &|| light(context, scenes.light),
        &|| thresholds(context, scenes.light),
        &|| paths(context, scenes.floating),
    ];
    Ok(context.each(&parts, |part| part())?.concat())
}

fn row(quantity: impl Into<String>, expected: f64, tolerance: f64, found: f64) -> Checked {
    Checked { quantity: quantity.into(), expected, tolerance, found }
}

/// Mean mesh force at rest, N.
fn statics() -> Result<Vec<Checked>, StudyError> {
    let force = |torque: f64, sun: f64, carrier: f64| -> Result<f64, StudyError> {
        let mut stage = reference_heavy(500.0, torque).map_err(TrainError::from)?;
        let free = |support: Support, stiffness: f64| match stiffness {
            0.0 => Support { stiffness, damping: Damping::Viscous(0.0) },
            _ => Support { stiffness, ..support },
        };
        stage.sun.rotation = free(stage.sun.rotation, sun);
        stage.carrier.rotation = free(stage.carrier.rotation, carrier);
        Ok(equilibrium(&stage.assemble(&Freedoms::InPhase)?)?.forces[0])
    };
    let ratio = reference_heavy(500.0, 500.0).map_err(TrainError::from)?.teeth.ratio();
    let rows = [
        ("T_in = 500 N m, determinate", 500.0 * ratio, 0.0, 5e8, 3701.21, 0.01),
        ("T_out = 500 N m, determinate", 500.0, 0.0, 5e8, 968.01, 0.01),
        ("T_out = 500 N m, with springs", 500.0, 2.4e7, 5e8, 773.25, 0.01),
        ("T_out = 400 N m, determinate", 400.0, 0.0, 5e8, 774.41, 0.01),
        ("springs 1.2e7, 5e8 N/m", 500.0, 1.2e7, 5e8, 853.1, 0.05),
        ("springs 2.4e7, 2.5e8 N/m", 500.0, 2.4e7, 2.5e8, 791.6, 0.05),
        ("springs 2.4e7, 1e10 N/m", 500.0, 2.4e7, 1e10, 751.9, 0.05),
        ("springs 4.8e7, 5e8 N/m", 500.0, 4.8e7, 5e8, 669.6, 0.05),
    ];
    let rows = rows.into_iter().map(|(words, torque, sun, carrier, expected, tolerance)| {
        Ok(row(format!("mean mesh force, {words}, N"), expected, tolerance, force(torque, sun, carrier)?))
    });
    rows.collect()
}

fn both(steady: &Steady) -> Result<[&ContactSteady; 2], StudyError> {
    match (steady.contact("sun"), steady.contact("ring")) {
        (Some(sun), Some(ring)) => Ok([sun, ring]),
        _ => Err(StudyError::missing("reference", "sun and ring meshes")),
    }
}

fn heavy(context: &Context<'_>, scene: &Scene) -> Result<Vec<Checked>, StudyError> {
    let steady = context.steady(scene, None)?;
    let mut rows = Vec::new();
    let expected =
        [("sun", 168.02, 610.0, [34.62, 29.14, 70.95, 61.77]), ("ring", 117.93, 681.0, [47.77, 41.42, 41.63, 41.26])];
    for (contact, (mesh, amplitude, smallest, harmonics)) in both(&steady)?.into_iter().zip(expected) {
        rows.push(row(format!("heavy: {mesh} mesh, mean force, N"), 773.25, 0.01, contact.report.force_mean));
        rows.push(row(format!("heavy: {mesh} mesh, amplitude, N"), amplitude, 0.1, contact.force_amplitude));
        let least = contact.report.force_min.unwrap_or_default();
        rows.push(row(format!("heavy: {mesh} mesh, smallest force, N"), smallest, 0.5, least));
        for (h, expected) in harmonics.into_iter().enumerate() {
            let words = format!("heavy: {mesh} mesh, harmonic {}, N", h + 1);
            rows.push(row(words, expected, 0.02, contact.force_harmonics[h]));
        }
    }
    for (rpm, sun, ring) in [
        (500.0, 34.6, 47.8),
        (1000.0, 14.4, 125.5),
        (1400.0, 65.6, 87.3),
        (1600.0, 101.0, 87.2),
        (2000.0, 195.2, 125.4),
        (2400.0, 252.9, 114.5),
        (3000.0, 262.8, 188.4),
    ] {
        let steady = context.steady(&scene.with(SPEED, json!(rpm))?, None)?;
        for (contact, (mesh, expected)) in both(&steady)?.into_iter().zip([("sun", sun), ("ring", ring)]) {
            let words = format!("heavy: {mesh} mesh, first harmonic at {rpm} rev/min, N");
            rows.push(row(words, expected, 0.05, contact.force_harmonics[0]));
        }
    }
    Ok(rows)
}

/// Stiffness that follows the tooth pairs in contact.
fn modulated(context: &Context<'_>, scene: &Scene) -> Result<Vec<Checked>, StudyError> {
    let stiffness = |mesh: &str, kind: &str, modulation: f64| {
        let mean = figures::number(scene, &format!("/train/{mesh}_mesh/stiffness"));
        let mut value = json!({ "kind": kind, "mean": mean, "modulation": modulation });
        if kind == "tooth-pairs-trapezoidal" {
            value["ramp"] = json!(0.1);
        }
        value
    };
    let changed = |kind: &str, modulation: f64| -> Result<Scene, StudyError> {
        Ok(scene.with_all([
            ("/train/sun_mesh/stiffness", stiffness("sun", kind, modulation)),
            ("/train/ring_mesh/stiffness", stiffness("ring", kind, modulation)),
            ("/train/rack", reference_rack()),
        ])?)
    };
    let ramped = changed("tooth-pairs-trapezoidal", 0.5)?;
    let stepped = changed("tooth-pairs", 0.25)?;
    let mut rows = Vec::new();
    for (words, scene, expected) in
        [("ramped, s = 0.5", ramped, [169.5, 120.0]), ("stepped, s = 0.25", stepped, [215.6, 137.9])]
    {
        let steady = context.steady(&scene, None)?;
        for ((contact, mesh), expected) in both(&steady)?.into_iter().zip(["sun", "ring"]).zip(expected) {
            let words = format!("heavy: {mesh} mesh, amplitude, stiffness {words}, N");
            rows.push(row(words, expected, 0.1, contact.force_amplitude));
        }
    }
    Ok(rows)
}

/// The rack of the reference gears: what tooth-pair stiffness takes its contact ratios from.
fn reference_rack() -> Value {
    json!({
        "module_m": 0.003, "pressure_angle_deg": 28,
        "profile_shift": { "sun": -0.02, "planet": 0.02, "ring": 0.02 }
    })
}

fn light(context: &Context<'_>, scene: &Scene) -> Result<Vec<Checked>, StudyError> {
    let at = |rpm: f64, load: f64| context.steady(&scene.with_all([(SPEED, json!(rpm)), (LOAD, json!(load))])?, None);
    let mut rows = Vec::new();
    for (rpm, load, mean, ring, sun, apart) in [
        (50.0, 0.0, 6.9682, 14.253, 14.404, 0.3494),
        (500.0, 0.0, 29.523, 120.27, 68.47, 0.2541),
        (1000.0, 0.0, 59.92, 250.8, 141.3, 0.2758),
        (2000.0, 0.0, 121.29, 365.3, 437.4, 0.1092),
        (500.0, 20.5, 52.50, 124.9, 84.8, 0.0804),
    ] {
        let steady = at(rpm, load)?;
        let [s, r] = both(&steady)?;
        let place = format!("light (events): {rpm} rev/min, {load} N m");
        rows.push(row(format!("{place}, mean force, N"), mean, 0.003 * mean, r.report.force_mean));
        let largest = |c: &ContactSteady| c.report.force_max.unwrap_or_default();
        rows.push(row(format!("{place}, largest ring force, N"), ring, 0.003 * ring, largest(r)));
        rows.push(row(format!("{place}, largest sun force, N"), sun, 0.003 * sun, largest(s)));
        rows.push(row(format!("{place}, time without force, T"), apart, 0.002, r.report.no_force_fraction));
        if rpm == 50.0 {
            let durations = &r.report.durations;
            let [long, short] = [durations.max, durations.min].map(|d| 1e3 * d.unwrap_or_default());
            rows.push(row("light: 50 rev/min, long separation, ms", 15.4, 0.05, long));
            rows.push(row("light: 50 rev/min, short separation, ms", 1.3, 0.05, short));
        }
    }
    for (load, apart) in [
        (3.0, 0.239),
        (6.0, 0.223),
        (9.0, 0.204),
        (12.0, 0.185),
        (15.0, 0.161),
        (17.0, 0.140),
        (19.0, 0.115),
        (20.0, 0.095),
        (21.0, 0.0),
    ] {
        let steady = at(500.0, load)?;
        let words = format!("light: 500 rev/min, {load} N m, time without force, T");
        rows.push(row(words, apart, 0.002, both(&steady)?[1].report.no_force_fraction));
    }
    for (load, amplitude) in [(0.0, 60.1), (20.5, 62.7), (30.0, 63.0), (60.0, 64.2)] {
        let steady = at(500.0, load)?;
        let words = format!("light: 500 rev/min, {load} N m, amplitude, N");
        rows.push(row(words, amplitude, 0.05 + 0.003 * amplitude, both(&steady)?[1].force_amplitude));
    }
    for (rpm, apart, amplitude) in [
        (50.0, 0.349, Some(7.1)),
        (100.0, 0.316, None),
        (200.0, 0.326, Some(22.0)),
        (300.0, 0.359, None),
        (400.0, 0.405, None),
        (600.0, 0.131, None),
        (700.0, 0.161, None),
        (800.0, 0.312, None),
        (1000.0, 0.276, Some(125.0)),
        (1200.0, 0.229, None),
        (1500.0, 0.182, Some(136.0)),
        (1800.0, 0.155, None),
        (2000.0, 0.109, Some(182.0)),
        (2500.0, 0.0, None),
    ] {
        let steady = at(rpm, 0.0)?;
        let ring = both(&steady)?[1];
        let words = format!("light: {rpm} rev/min, no load, time without force, T");
        rows.push(row(words, apart, 0.002, ring.report.no_force_fraction));
        if let Some(amplitude) = amplitude {
            let words = format!("light: {rpm} rev/min, no load, amplitude, N");
            rows.push(row(words, amplitude, 0.5 + 0.003 * amplitude, ring.force_amplitude));
        }
    }
    Ok(rows)
}

fn thresholds(context: &Context<'_>, scene: &Scene) -> Result<Vec<Checked>, StudyError> {
    let search = Search { range: [0.0, 60.0], scan: 13, resolution: 0.02 };
    let table =
        [(200.0, 11.3), (300.0, 13.3), (500.0, 20.65), (700.0, 3.5), (1000.0, 49.0), (1500.0, 11.3), (2000.0, 15.2)];
    context.each(&table, |&(rpm, expected)| {
        let found = locate(context, &scene.with(SPEED, json!(rpm))?, LOAD, "ring", &search)?;
        let tolerance = if rpm == 500.0 { 0.2 } else { 0.05 };
        let words = format!("light: {rpm} rev/min, threshold load, N m");
        Ok(row(words, expected, tolerance, found.middle().unwrap_or(0.0)))
    })
}

fn paths(context: &Context<'_>, scene: &Scene) -> Result<Vec<Checked>, StudyError> {
    let mut rows = Vec::new();
    let (_, found) = figures::trajectories(context, scene, (SPEED, &[100.0]))?;
    for (path, (range, tolerance)) in found.iter().zip([(4.7, 0.05), (0.010, 0.0005)]) {
        rows.push(row(
            format!("floating: 100 rev/min, range of the {}, µm", path.body),
            range,
            tolerance,
            1e6 * path.range,
        ));
        rows.push(row(format!("floating: 100 rev/min, residual of the {}", path.body), 0.0, 5e-4, path.residual));
    }
    Ok(rows)
}
