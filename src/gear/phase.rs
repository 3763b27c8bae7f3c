//! Mesh phases of a planetary stage, and the positions at which its planets can be assembled.
//!
//! The clock of a mesh is `τ = f_m t + γ`, zero at pitch-point contact. The sun turns counter-clockwise; planet n
//! sits at ψ_n (Parker & Lin, J. Mech. Des. 126, 2004, with the phase's sign reversed).

use std::f64::consts::TAU;

use super::{BasicRack, Gear};

/// Phases of the sun meshes, `γ_n = frac(−Z_s ψ_n/2π)`, periods; `positions` in rad.
#[must_use]
pub fn sun_phases(sun_teeth: u32, positions: &[f64]) -> Vec<f64> {
    positions.iter().map(|psi| fraction(-f64::from(sun_teeth) * psi / TAU)).collect()
}

/// Phases of the ring meshes, `γ_n = frac(Z_r ψ_n/2π − γ_rs)`, periods; `positions` in rad.
#[must_use]
pub fn ring_phases(ring_teeth: u32, positions: &[f64], sun_to_ring: f64) -> Vec<f64> {
    positions.iter().map(|psi| fraction(f64::from(ring_teeth) * psi / TAU - sun_to_ring)).collect()
}

/// Phase between the meshes of one planet, with s_p its tooth thickness on the reference circle and working pressure angles α_ws, α_wr:
///
/// ```text
/// γ_rs = frac(Z_p/2 − s_p/(π m_t) + Z_p (inv α_ws + inv α_wr − 2 inv α_t)/2π),
/// inv α_ws − inv α_t = 2 tan α (x_s + x_p)/(Z_s + Z_p),    inv α_wr − inv α_t = 2 tan α (x_r − x_p)/(Z_r − Z_p)
/// ```
#[must_use]
pub fn sun_to_ring_phase(rack: &BasicRack, sun: Gear, planet: Gear, ring: Gear) -> f64 {
    let teeth = f64::from(planet.teeth);
    // The tooth thickness there follows from the involutes between the reference circle and the working circles.
    let involutes = (sun.shift + planet.shift) / (f64::from(sun.teeth) + teeth)
        + (ring.shift - planet.shift) / (f64::from(ring.teeth) - teeth);
    let turned = teeth * 2.0 * libm::tan(rack.pressure_angle) * involutes / TAU;
    fraction(0.5 * teeth - planet.tooth_thickness(rack) / (std::f64::consts::PI * rack.transverse_module()) + turned)
}

/// `count` positions from 0, equally spaced, rad.
#[must_use]
pub fn equally_spaced(count: usize) -> Vec<f64> {
    (0..count).map(|i| TAU * i as f64 / count as f64).collect()
}

/// Smallest angle between positions at which planets can be assembled, `2π/(Z_s + Z_r)`, rad.
#[must_use]
pub fn assembly_pitch(sun_teeth: u32, ring_teeth: u32) -> f64 {
    TAU / f64::from(sun_teeth + ring_teeth)
}

/// Assemblable positions nearest to the desired ones, rad: whole multiples of the assembly pitch from the first planet, which stays.
#[must_use]
pub fn nearest_assemblable(sun_teeth: u32, ring_teeth: u32, positions: &[f64]) -> Vec<f64> {
    let pitch = assembly_pitch(sun_teeth, ring_teeth);
    let first = positions.first().copied().unwrap_or(0.0);
    positions.iter().map(|psi| first + ((psi - first) / pitch).round() * pitch).collect()
}

/// Returns whether every planet sits at an assemblable position, to `tolerance` rad.
///
/// For N equally spaced planets this is the condition that `(Z_s + Z_r)/N` is whole.
#[must_use]
pub fn assemblable(sun_teeth: u32, ring_teeth: u32, positions: &[f64], tolerance: f64) -> bool {
    nearest_assemblable(sun_teeth, ring_teeth, positions).iter().zip(positions).all(|(a, b)| (a - b).abs() <= tolerance)
}

/// The fraction of `x`, `[0, 1)`, with round-off of a whole number brought back to 0.
fn fraction(x: f64) -> f64 {
    let part = x - x.floor();
    if 1.0 - part <= 8.0 * f64::EPSILON * x.abs().max(1.0) || part <= 8.0 * f64::EPSILON * x.abs().max(1.0) {
        0.0
    } else {
        part
    }
}
