//! Picture of a train: its gears in place, and their motion with the degrees of freedom.

use nalgebra::{DMatrix, RowDVector};

/// Gears and meshes of a train in the plane.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Drawing {
    /// Gears and the carrier of a stage.
    pub gears: Vec<GearDrawing>,
    /// Pitch point of each contact, m.
    pub points: Vec<[f64; 2]>,
}

/// A gear of a drawing. Planets stand still: its frame turns with their carrier.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct GearDrawing {
    /// Name of the gear.
    pub name: String,
    /// Centre at rest, m.
    pub centre: [f64; 2],
    /// Radius of its working pitch circle, m.
    pub radius: f64,
    /// Tooth number; 0 of a carrier, whose circle goes through the centres of its planets.
    pub teeth: u32,
    /// True if the teeth point inwards.
    pub is_ring: bool,
    /// Angle of a tooth (of a ring: of a space) at time 0, rad.
    pub angle: f64,
    /// Mean speed in its frame, rad/s, counter-clockwise positive.
    pub speed: f64,
    /// Displacements x and y of the centre, m, and rotation, rad, beside these: rows `r` of `r·q`, `[n]`.
    pub motion: [Vec<f64>; 3],
}

impl GearDrawing {
    /// Converts rows of all degrees of freedom to the kept ones, `q_all = P q`, and keeps the first `n`.
    pub(super) fn reduce(&mut self, p: &DMatrix<f64>, n: usize) {
        for row in &mut self.motion {
            let kept = RowDVector::from_vec(std::mem::take(row)) * p;
            *row = kept.iter().take(n).copied().collect();
        }
    }
}

/// Returns the rows of a centre with first coordinate at `row`, `turned` rad from x, and of a rotation at `(place, factor)`.
pub(super) fn rows(n: usize, row: usize, turned: f64, rotation: (usize, f64)) -> [Vec<f64>; 3] {
    let (sin, cos) = libm::sincos(turned);
    let along = |entries: &[(usize, f64)]| {
        let mut along = vec![0.0; n];
        entries.iter().for_each(|(place, factor)| along[*place] = *factor);
        along
    };
    [along(&[(row, cos), (row + 1, -sin)]), along(&[(row, sin), (row + 1, cos)]), along(&[rotation])]
}

/// The pitch point of a mesh, on the line from `centre` in the direction `pitch`, rad.
pub(super) fn point(centre: [f64; 2], radius: f64, pitch: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(pitch);
    [centre[0] + radius * cos, centre[1] + radius * sin]
}
