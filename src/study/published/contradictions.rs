//! Where the paper contradicts itself, with the numbers that show it.

use super::{Comparison, Verdict, statement};
use crate::gear::contact::{Hysteresis, coefficient, restitution};
use crate::train::planetary::presets::{reference_geometry, reference_heavy, reference_light};
use crate::train::{Teeth, TrainError};

/// What the paper says, and what its own data give.
///
/// # Errors
/// [`TrainError`] never in fact: the presets are part of the library.
pub fn contradictions() -> Result<Vec<Comparison>, TrainError> {
    let teeth: Teeth = reference_geometry().teeth();
    let mesh = |rpm: f64| teeth.mesh_frequency(rpm);
    let speed = |hertz: f64| hertz / mesh(1.0);
    let heavy = reference_heavy(500.0, 500.0)?;
    let light = reference_light(2000.0, 0.0)?;
    // n K^{1/n} F^{1−1/n} of the Hertz law at 500 N.
    let tangent = 1.5 * light.planets[0].sun_mesh.stiffness.mean().powf(2.0 / 3.0) * 500.0f64.cbrt();
    let determinate = heavy.input_torque() / (3.0 * heavy.sun.radius);
    let sum = f64::from(teeth.sun + teeth.ring);
    let gyration = |body: &crate::train::Body| {
        let inertia = body.rotary_mass * body.radius * body.radius;
        1e3 * (inertia / body.mass).sqrt()
    };
    let row = |place, quantity: &str, published: &str, found: String| {
        statement(place, quantity, published, found, Verdict::Contradiction)
    };
    Ok(vec![
        row("5b", "mesh frequency at 500 rev/min", "212 Hz", format!("{:.2} Hz from the tooth numbers", mesh(500.0))),
        row(
            "7",
            "412 Hz excited",
            "at 706 rev/min",
            format!(
                "f_m there is {:.1} Hz, n Z_s/60 is {:.0} Hz; f_m = 412 Hz at {:.1} rev/min, where the beat is seen",
                mesh(706.0),
                706.0 / 60.0 * f64::from(teeth.sun),
                speed(412.0)
            ),
        ),
        row(
            "7",
            "1046 Hz excited by the third harmonic",
            "at 1000 rev/min",
            format!(
                "3 f_m = {:.1} Hz there, as f_m at 3000 and 2 f_m at 1500 rev/min, and no named mode; 3 f_m = 1046 Hz at {:.0} rev/min",
                3.0 * mesh(1000.0),
                speed(1046.0 / 3.0)
            ),
        ),
        row(
            "7",
            "1791 Hz excited by 2 f_m",
            "at 2800 rev/min",
            format!(
                "2 f_m = {:.0} Hz there; 2 f_m = 1791 Hz at {:.0} rev/min",
                2.0 * mesh(2800.0),
                speed(1791.0 / 2.0)
            ),
        ),
        row(
            "5, 6",
            "mean mesh forces at 500 N m",
            "774 N and 750 N",
            format!(
                "without springs to ground both are {determinate:.1} N, and 774 N are {:.2} of it; they differ only by drag on the planets",
                774.0 / determinate
            ),
        ),
        row(
            "8",
            "sections at 1050 and 2000 rev/min",
            "orders of f_m",
            format!(
                "f_m is {:.0} and {:.0} Hz there, n Z_s/60 is {:.0} and {:.0} Hz: the latter (or 2 f_m) meet the named modes",
                mesh(1050.0),
                mesh(2000.0),
                1050.0 / 60.0 * f64::from(teeth.sun),
                2000.0 / 60.0 * f64::from(teeth.sun)
            ),
        ),
        row(
            "table 1",
            "three equally spaced planets",
            "assumed",
            format!("(Z_s + Z_r)/3 = {:.2} is not whole: they cannot be assembled", sum / 3.0),
        ),
        row(
            "table 1",
            "inertias",
            "0.008, 0.007, 0.178 kg m2",
            format!(
                "radii of gyration {:.1}, {:.1}, {:.0} mm: outside the bodies",
                gyration(&heavy.sun),
                gyration(&heavy.planets[0].body),
                gyration(&heavy.ring)
            ),
        ),
        row(
            "text",
            "889 Hz",
            "three repeated",
            "a symmetric set of three planets has pairs and single frequencies only".to_owned(),
        ),
        row(
            "5 to 13",
            "transmission errors",
            "one gear set",
            format!(
                "{:.1} µm fit the heavy load, {:.1} µm the light load",
                1e6 * amplitude(&heavy.planets[0].sun_mesh),
                1e6 * amplitude(&light.planets[0].sun_mesh)
            ),
        ),
        row(
            "9 to 13",
            "drag",
            "one model",
            format!(
                "figures 9 to 11 need a drag that grows with speed ({:.0} N m at 2000 rev/min, more than the threshold load itself), figures 12 and 13 exclude it",
                light.load.total_output(2000.0)
            ),
        ),
        row(
            "eq. 4",
            "law under heavy load",
            "always in contact",
            "it pulls where the force falls below zero: see the range of the force against speed".to_owned(),
        ),
        row(
            "eqs 6, 9",
            "Hertz stiffness and restitution",
            "for gear teeth, 0.743",
            format!(
                "the formula is that of spheres; the damping computed from 0.743 returns {:.3}; at 500 N the contact is {:.1} times \
                 softer than the linear mesh",
                restitution(coefficient(Hysteresis::LankaraniNikravesh, 0.743)),
                heavy.planets[0].sun_mesh.stiffness.mean() / tangent
            ),
        ),
    ])
}

/// Largest error harmonic, m.
fn amplitude(mesh: &crate::train::Mesh) -> f64 {
    mesh.error.iter().fold(0.0, |m, h| m.max(h.amplitude))
}
