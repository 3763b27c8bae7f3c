//! Mesh phases of a gearbox: positions of its teeth at time 0.
//!
//! A mesh is at its pitch point at the whole numbers of its clock `τ = f_m t + γ`. With θ the angle of a tooth of the pinion (of a space of
//! a ring), h half its angle on the working pitch circle, s the sense of the push and σ the sense of rotation:
//!
//! ```text
//! γ = frac(σ Z₁ (θ₁ + s h₁ − ψ)/2π)
//!   = frac(−σ Z₂ (θ₂ + s h₂ − ψ − π)/2π)    of an external wheel
//!   = frac( σ Z₂ (θ₂ + s h₂ − ψ)/2π)        of a ring
//! ```
//!
//! The first driving gear has its drive flank in the direction of x. Gears fixed on one shaft have a tooth at the same angle. If a loop of
//! meshes determines the angles of two gears, one of them is set on its shaft to fit, unless something else holds it.

use std::f64::consts::{PI, TAU};

use super::{Gearbox, GearboxFault, Part, PlacedMesh, ShaftGear, layout::is_rounding};
use crate::gear::MeshKind;

/// Largest misfit of teeth, as a part of a pitch: angles in a scene are rounded.
const FITS: f64 = 1e-4;

/// A gear in a mesh: the angle of its flank from its tooth, and the pitch point seen from its centre.
struct GearInMesh {
    teeth: f64,
    /// Sense of rotation.
    sense: f64,
    /// `s h`, rad.
    flank: f64,
    /// Direction of the pitch point, rad.
    pitch: f64,
}

impl GearInMesh {
    /// Ends of a mesh, pinion first.
    fn both(gearbox: &Gearbox, i: usize, line: &PlacedMesh) -> [Self; 2] {
        let is_internal = line.geometry.kind == MeshKind::Internal;
        let of = |k: usize, sense: f64, pitch: f64| {
            let gear = gearbox.gears[line.gears[k]].teeth;
            let half = gear.half_tooth_angle(&gearbox.meshes[i].rack, line.geometry.pressure_angle);
            Self { teeth: f64::from(gear.teeth), sense, flank: line.sense * half, pitch }
        };
        let wheel = if is_internal { of(1, line.turning, line.pitch) } else { of(1, -line.turning, line.pitch + PI) };
        [of(0, line.turning, line.pitch), wheel]
    }

    /// Phase of a tooth at this angle, periods, not reduced.
    fn phase(&self, angle: f64) -> f64 {
        self.sense * self.teeth * (angle + self.flank - self.pitch) / TAU
    }

    /// Angle of a tooth with this phase, rad.
    fn angle(&self, phase: f64) -> f64 {
        self.pitch - self.flank + self.sense * TAU * phase / self.teeth
    }
}

/// The angle of a tooth of gear `k` of mesh `i` at time 0, rad.
pub(super) fn tooth_angle(gearbox: &Gearbox, i: usize, line: &PlacedMesh, k: usize) -> f64 {
    GearInMesh::both(gearbox, i, line)[k].angle(line.phase)
}

/// Returns the number of the body that turns as one with a gear: a shaft with its fixed gears, or a loose gear.
fn rotor(gearbox: &Gearbox, gear: usize) -> usize {
    let ShaftGear { shaft, is_loose, .. } = gearbox.gears[gear];
    if is_loose { gearbox.shafts.len() + gear } else { shaft }
}

/// Sets the phases of all meshes.
pub(super) fn set(gearbox: &Gearbox, lines: &mut [PlacedMesh]) -> Result<(), Vec<GearboxFault>> {
    let mut angles: Vec<Option<f64>> = vec![None; gearbox.shafts.len() + gearbox.gears.len()];
    let on_shaft = |gear: usize| gearbox.gears[gear].tooth_angle.unwrap_or(0.0);
    let ends: Vec<[GearInMesh; 2]> =
        lines.iter().enumerate().map(|(i, line)| GearInMesh::both(gearbox, i, line)).collect();
    let rotors: Vec<[usize; 2]> = lines.iter().map(|line| line.gears.map(|gear| rotor(gearbox, gear))).collect();
    let mut open: Vec<usize> = (0..lines.len()).collect();
    while !open.is_empty() {
        let known = |i: usize| rotors[i].map(|rotor| angles[rotor]);
        // Meshes that continue a known gear come before those that start a new group.
        let leads = open.iter().position(|i| known(*i).iter().flatten().count() == 1);
        let Some(at) = leads.or_else(|| open.iter().position(|i| known(*i) == [None, None])) else { break };
        let i = open.remove(at);
        let line = &lines[i];
        if known(i) == [None, None] {
            let k = usize::from(line.gears[0] != gearbox.meshes[i].gears[0]);
            angles[rotors[i][k]] = Some(-ends[i][k].flank - on_shaft(line.gears[k]));
        }
        let k = usize::from(angles[rotors[i][0]].is_none());
        let tooth = angles[rotors[i][k]].unwrap_or(0.0) + on_shaft(line.gears[k]);
        let phase = gearbox.meshes[i].phase.unwrap_or_else(|| ends[i][k].phase(tooth));
        let other = 1 - k;
        if rotors[i][0] != rotors[i][1] {
            angles[rotors[i][other]] = Some(ends[i][other].angle(phase) - on_shaft(line.gears[other]));
        }
        lines[i].phase = fraction(phase);
    }
    let faults: Vec<GearboxFault> = open.into_iter().filter_map(|i| close(gearbox, lines, &ends, &angles, i)).collect();
    // Teeth in phase remain in phase to the last bit.
    for i in 1..lines.len() {
        let (before, own) = lines.split_at_mut(i);
        let equal = before.iter().map(|line| line.phase).find(|phase| is_rounding(phase - own[0].phase));
        own[0].phase = equal.unwrap_or(own[0].phase);
    }
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

/// Sets the phase of a mesh between gears with known angles.
fn close(
    gearbox: &Gearbox,
    lines: &mut [PlacedMesh],
    ends: &[[GearInMesh; 2]],
    angles: &[Option<f64>],
    i: usize,
) -> Option<GearboxFault> {
    let gears = lines[i].gears;
    let phases = [0, 1].map(|k| {
        let on_shaft = gearbox.gears[gears[k]].tooth_angle.unwrap_or(0.0);
        ends[i][k].phase(angles[rotor(gearbox, gears[k])].unwrap_or(0.0) + on_shaft)
    });
    let apart = (phases[0] - phases[1]) - (phases[0] - phases[1]).round();
    let is_free = |gear: usize| {
        let meshes = gearbox.meshes.iter().filter(|mesh| mesh.gears.contains(&gear)).count();
        gearbox.gears[gear].tooth_angle.is_none() && meshes == 1
    };
    let phase = match gearbox.meshes[i].phase {
        Some(phase) => phase,
        None if is_free(gears[0]) && !is_free(gears[1]) => phases[1],
        _ if apart.abs() <= FITS || is_free(gears[1]) => phases[0],
        None => {
            let [one, two] = gears.map(|gear| gearbox.gears[gear].name.as_str());
            return Some(GearboxFault::new(
                Part::Mesh(i),
                "gears",
                format!("teeth of {one} and {two} that are {:.4} of a pitch apart", apart.abs()),
                format!("teeth that fit to {FITS} of a pitch in every loop of meshes"),
                "move a shaft (planets sit at multiples of 360 deg/(sun + ring teeth)), leave tooth_angle_deg out, or give the phase",
            ));
        }
    };
    lines[i].phase = fraction(phase);
    None
}

/// The part of a period beyond whole ones, in `[0, 1)`, with the rounding of a whole number brought back to 0.
fn fraction(x: f64) -> f64 {
    let part = x - x.floor();
    let rounding = 64.0 * f64::EPSILON * x.abs().max(1.0);
    if part <= rounding || 1.0 - part <= rounding { 0.0 } else { part }
}
