//! Bodies, springs and meshes in all degrees of freedom of a train, and the same train in the degrees of freedom that it keeps.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::{Body, Mesh, Support, TrainError};
use crate::{
    gear::MeshKind,
    system::{Bearing, BearingSpring, ContactSpec, LoadHarmonic, Spec},
};

/// Degrees of freedom of one gear, by index among all.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wheel {
    /// Index of the first of the two degrees of freedom of its centre.
    pub centre: usize,
    /// Direction of that first degree of freedom, rad, counter-clockwise from x.
    pub turned: f64,
    /// Index of its rotation, and metres on its base circle per unit of that degree of freedom.
    pub rotation: (usize, f64),
    /// Index of its motion along the axis.
    pub axial: Option<usize>,
}

impl Wheel {
    /// Returns a gear with the degrees of freedom x, y, u from `row` on, u on its base circle.
    pub fn at(row: usize, turned: f64) -> Self {
        Self { centre: row, turned, rotation: (row + 2, 1.0), axial: None }
    }
}

/// The line along which a pinion pushes, on the drive flank of a mesh.
///
/// With ψ the direction from its centre to the pitch point, s the sense of the push and β_b the base helix angle:
///
/// ```text
/// δ = cos β_b (n·(x₁ − x₂) + s (u₁ ± u₂)) − s sin β_b (w₁ − w₂) − e,    n = s (−sin(ψ − s α), cos(ψ − s α))
/// ```
///
/// with `+` for two external gears. The normal of a right-handed flank that pushes counter-clockwise leans to −z.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineOfAction {
    pub kind: MeshKind,
    /// Direction ψ from the pinion's centre to the pitch point, rad.
    pub pitch: f64,
    /// Working pressure angle α in the transverse plane, rad.
    pub pressure_angle: f64,
    /// Sense s of the push: 1 counter-clockwise, −1 clockwise.
    pub sense: f64,
    /// Base helix angle β_b, rad, positive for a right-handed pinion.
    pub base_helix: f64,
}

impl LineOfAction {
    /// The vector n in axes turned by an angle, rad.
    pub fn normal(&self, turned: f64) -> [f64; 2] {
        let (sin, cos) = libm::sincos((self.pitch - turned) - self.sense * self.pressure_angle);
        [-self.sense * sin, self.sense * cos]
    }

    /// Returns `∂δ/∂q` in all `n` degrees of freedom.
    pub fn direction(&self, pinion: Wheel, wheel: Wheel, n: usize) -> DVector<f64> {
        let (helix_sin, helix_cos) = libm::sincos(self.base_helix);
        let mut g = DVector::zeros(n);
        let partner = if self.kind == MeshKind::External { 1.0 } else { -1.0 };
        for (gear, side, turn) in [(pinion, 1.0, 1.0), (wheel, -1.0, partner)] {
            let [x, y] = self.normal(gear.turned);
            g[gear.centre] += side * helix_cos * x;
            g[gear.centre + 1] += side * helix_cos * y;
            g[gear.rotation.0] += turn * self.sense * helix_cos * gear.rotation.1;
            if let Some(row) = gear.axial {
                g[row] -= side * self.sense * helix_sin;
            }
        }
        g
    }
}

/// A train in all of its degrees of freedom.
pub(super) struct Assembly {
    pub mass: DMatrix<f64>,
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
    pub load: DVector<f64>,
    pub load_harmonics: Vec<LoadHarmonic>,
    pub contacts: Vec<ContactSpec>,
    pub bearings: Vec<Bearing>,
}

impl Assembly {
    pub fn new(n: usize) -> Self {
        let zero = DMatrix::zeros(n, n);
        Self {
            mass: zero.clone(),
            damping: zero.clone(),
            stiffness: zero,
            load: DVector::zeros(n),
            load_harmonics: Vec::new(),
            contacts: Vec::new(),
            bearings: Vec::new(),
        }
    }

    /// Adds a body with the degrees of freedom x, y, u from `row` on.
    pub fn body(&mut self, row: usize, body: &Body) {
        let inertias = [body.mass, body.mass, body.rotary_mass];
        inertias.iter().enumerate().for_each(|(k, m)| self.mass[(row + k, row + k)] += *m);
    }

    /// Adds a spring and a damper between one degree of freedom and the frame; `mass`, kg, is the reference of a damping ratio.
    pub fn hold(&mut self, row: usize, support: Support, mass: f64) {
        self.stiffness[(row, row)] += support.stiffness;
        self.damping[(row, row)] += support.coefficient(mass);
    }

    /// Adds a spring and a damper whose stretch is `direction · q`.
    pub fn join(&mut self, direction: &DVector<f64>, support: Support, mass: f64) {
        let outer = direction * direction.transpose();
        self.damping += support.coefficient(mass) * &outer;
        self.stiffness += support.stiffness * outer;
    }

    /// Adds a bearing of `body`: springs and dampers whose stretches are `direction · q`.
    pub fn bearing(&mut self, body: &str, directions: &[(&'static str, DVector<f64>)], support: Support, mass: f64) {
        directions.iter().for_each(|(_, direction)| self.join(direction, support, mass));
        let (stiffness, damping) = (support.stiffness, support.coefficient(mass));
        if stiffness > 0.0 {
            let spring = |(name, direction): &(&'static str, DVector<f64>)| {
                let direction = direction.iter().copied().collect();
                BearingSpring { name, direction, stiffness, damping }
            };
            let springs = directions.iter().map(spring);
            match self.bearings.last_mut().filter(|bearing| bearing.name == body) {
                Some(bearing) => bearing.springs.extend(springs),
                None => self.bearings.push(Bearing { name: body.to_owned(), springs: springs.collect() }),
            }
        }
    }

    /// Adds the bearing of the centre of a body in the frame, with the degrees of freedom x, y from `row` on.
    pub fn bearing_at(&mut self, name: &str, row: usize, body: &Body) {
        let n = self.load.len();
        let along = |row: usize| DVector::from_fn(n, |i, _| f64::from(i == row));
        self.bearing(name, &[("x", along(row)), ("y", along(row + 1))], body.translation, body.mass);
    }

    /// Adds a mesh at mesh frequency f_m, Hz.
    pub fn mesh(
        &mut self,
        name: String,
        direction: &DVector<f64>,
        mesh: &Mesh,
        frequency: f64,
    ) -> Result<&mut ContactSpec, TrainError> {
        self.contacts.push(mesh.contact(name, direction.iter().copied().collect(), frequency)?);
        Ok(self.contacts.last_mut().expect("one was added"))
    }

    /// Returns the train in the coordinates `q` of `q_all = P q`: `Pᵀ M P` and so on, directions `Pᵀ g`; bodies and loads times `share`.
    pub fn reduced(self, freedoms: Vec<String>, p: &DMatrix<f64>, share: f64, frequency: f64) -> Spec {
        let reduce = |matrix: &DMatrix<f64>| share * p.tr_mul(matrix) * p;
        let symmetric = |matrix: DMatrix<f64>| 0.5 * (&matrix + matrix.transpose());
        let direction = |g: Vec<f64>| -> Vec<f64> { p.tr_mul(&DVector::from_vec(g)).iter().copied().collect() };
        let load = |f: &DVector<f64>| (share * p.tr_mul(f)).iter().copied().collect();
        Spec {
            freedoms,
            mass: symmetric(reduce(&self.mass)),
            damping: reduce(&self.damping),
            stiffness: symmetric(reduce(&self.stiffness)),
            load: load(&self.load),
            load_harmonics: self
                .load_harmonics
                .into_iter()
                .map(|harmonic| LoadHarmonic { vector: load(&DVector::from_vec(harmonic.vector)), ..harmonic })
                .collect(),
            contacts: self
                .contacts
                .into_iter()
                .map(|contact| ContactSpec { direction: direction(contact.direction), ..contact })
                .collect(),
            omega: (frequency > 0.0).then_some(TAU * frequency),
            bearings: self
                .bearings
                .into_iter()
                .map(|mut bearing| {
                    bearing.springs.iter_mut().for_each(|s| s.direction = direction(std::mem::take(&mut s.direction)));
                    bearing.springs.retain(|spring| spring.direction.iter().any(|d| *d != 0.0));
                    bearing
                })
                .filter(|bearing| !bearing.springs.is_empty())
                .collect(),
            shared: Vec::new(),
            load_schedules: vec![],
        }
    }
}
