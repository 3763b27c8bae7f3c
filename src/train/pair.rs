//! A pair of gears: the dimensionless model of Kahraman and Singh with one degree of freedom, and pairs with real geometry.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::assembly::{Assembly, LineOfAction, Wheel};
use super::body::Body;
use super::drawing::{Drawing, GearDrawing, point, rows};
use super::error::{TrainError, check};
use super::mesh::{Mesh, check_stiffness};
use crate::gear::contact::{Law, Linear, Release};
use crate::gear::{MeshHarmonic, MeshKind, MeshStiffness};
use crate::system::{ContactSpec, Flanks, LoadHarmonic, Spec};

/// `x″ + 2ζ x′ + κ(t) f(x) = F_m + Σ F_h (hΩ)² cos(hΩ t + φ_h)` with `f(x) = x ∓ 1` beyond `±1`, 0 between
/// (Kahraman & Singh, J. Sound Vib. 142, 1990, and 146, 1991).
///
/// Lengths are in half backlashes and times in `1/ω_n` with `ω_n = √(k̄/m_e)`; everything here is dimensionless.
#[derive(Clone, Debug, PartialEq)]
pub struct KahramanSingh {
    /// Damping ratio ζ, ≥ 0.
    pub damping_ratio: f64,
    /// Mean load F_m.
    pub mean_load: f64,
    /// Harmonics of the static transmission error, amplitude F_h and phase φ_h; read as cosines.
    pub excitation: Vec<MeshHarmonic>,
    /// Mesh stiffness κ, mean 1 by the scaling (not enforced); its clock is `Ω t/2π`.
    pub stiffness: MeshStiffness,
    /// Excitation frequency Ω, > 0.
    pub omega: f64,
    /// True if the damper acts in the gap too (the classical equation). Otherwise it acts in contact only, and the contact ends at x = ±1
    /// for any sign of the force.
    pub damping_in_gap: bool,
}

impl KahramanSingh {
    /// The classical equation, κ = 1 and one harmonic of phase 0.
    #[must_use]
    pub fn new(damping_ratio: f64, mean_load: f64, excitation: f64, omega: f64) -> Self {
        Self {
            damping_ratio,
            mean_load,
            excitation: vec![MeshHarmonic { order: 1.0, amplitude: excitation, phase: 0.0 }],
            stiffness: MeshStiffness::Constant(1.0),
            omega,
            damping_in_gap: true,
        }
    }

    /// Returns a train with one degree of freedom `x` and one contact `mesh` with both flanks.
    ///
    /// # Errors
    /// [`TrainError::Value`] for a value outside its range.
    pub fn assemble(&self) -> Result<Spec, TrainError> {
        check("omega", self.omega, self.omega > 0.0, "> 0")?;
        check("damping ratio", self.damping_ratio, self.damping_ratio >= 0.0, ">= 0")?;
        check("mean load", self.mean_load, true, "finite")?;
        for h in &self.excitation {
            check("excitation order", h.order, h.order > 0.0, "> 0")?;
            check("excitation amplitude", h.amplitude, true, "finite")?;
        }
        check_stiffness("mesh", &self.stiffness)?;
        let c = 2.0 * self.damping_ratio;
        let (everywhere, in_contact) = if self.damping_in_gap { (c, 0.0) } else { (0.0, c) };
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let frequency = self.omega / TAU;
        Ok(Spec {
            freedoms: vec!["x".into()],
            mass: one(1.0),
            damping: one(everywhere),
            stiffness: one(0.0),
            load: vec![self.mean_load],
            load_harmonics: self
                .excitation
                .iter()
                .map(|h| {
                    let omega = h.order * self.omega;
                    LoadHarmonic { vector: vec![h.amplitude * omega * omega], omega, phase: h.phase }
                })
                .collect(),
            contacts: vec![ContactSpec {
                name: "mesh".into(),
                direction: vec![1.0],
                error: Vec::new(),
                error_offset: 0.0,
                half_backlash: 1.0,
                flanks: Flanks::Both,
                stiffness: self.stiffness.schedule(frequency.recip(), 0.0),
                law: Law::KelvinVoigt(Linear { damping: in_contact }, Release::Deflection),
                gap_damping: 0.0,
                back: None,
            }],
            omega: Some(self.omega),
            bearings: Vec::new(),
            shared: Vec::new(),
            load_schedules: vec![],
        })
    }
}

/// Two external gears. Gear 1 drives, its centre at the origin; gear 2 sits at `(a, 0)`. Rotations `u = r θ`
/// counter-clockwise positive, so that the deflection on the line of action is `u₁ + u₂ − e`.
#[derive(Clone, Debug, PartialEq)]
pub struct GearPair {
    /// Tooth number of the driving gear.
    pub driving_teeth: u32,
    /// The driving gear, radius = base radius.
    pub driving: Body,
    /// The driven gear, radius = base radius.
    pub driven: Body,
    /// Working pressure angle α in the transverse plane, rad, `[0, π/2)`.
    pub pressure_angle: f64,
    /// Base helix angle β_b, rad: the deflection along the normal of the teeth is `cos β_b` times that of spur gears.
    pub base_helix: f64,
    /// The mesh.
    pub mesh: Mesh,
    /// Speed of the driving gear, rev/min, ≥ 0; 0 only without anything that varies with the mesh frequency.
    pub rpm: f64,
    /// Torque on the driving gear T, N m. The driven gear's load balances it: `F = T/r₁` on both base circles.
    pub torque: f64,
}

impl GearPair {
    /// Mesh frequency `f_m = n Z₁/60`, Hz.
    #[must_use]
    pub fn mesh_frequency(&self) -> f64 {
        self.rpm / 60.0 * f64::from(self.driving_teeth)
    }

    /// Returns a train with the two degrees of freedom `u_1`, `u_2`; without torsional supports both may turn together freely (`u₁ = −u₂`).
    ///
    /// # Errors
    /// [`TrainError`] for a value outside its range or a standing pair with a varying mesh.
    pub fn torsional(&self) -> Result<Spec, TrainError> {
        self.assemble(&TORSIONAL)
    }

    /// Returns a train with the six degrees of freedom `x_1, y_1, u_1, x_2, y_2, u_2` and `δ = x₁ sin α + y₁ cos α + u₁ − x₂ sin α − y₂ cos
    /// α + u₂ − e`.
    ///
    /// # Errors
    /// As for [`torsional`](Self::torsional).
    pub fn translational(&self) -> Result<Spec, TrainError> {
        self.assemble(&TRANSLATIONAL)
    }

    /// Returns the drawing of the pair, in the coordinates of [`translational`](Self::translational) or [`torsional`](Self::torsional).
    #[must_use]
    pub fn drawing(&self, is_translational: bool) -> Drawing {
        let kept: &[usize] = if is_translational { &TRANSLATIONAL } else { &TORSIONAL };
        let p = projection(kept);
        let cos = libm::cos(self.pressure_angle);
        let [driving, driven] = [&self.driving, &self.driven].map(|body| body.radius / cos);
        let count = (f64::from(self.driving_teeth) * driven / driving).round().max(1.0);
        let (speed, half) = (self.rpm * TAU / 60.0, std::f64::consts::FRAC_PI_2);
        let gear = |name: &str, radius: f64, teeth: f64, row: usize, base: f64| {
            let mut gear = GearDrawing {
                name: name.to_owned(),
                centre: [0.0; 2],
                radius,
                // OK to convert: a tooth number.
                teeth: teeth as u32,
                is_ring: false,
                angle: (TAU * self.mesh.phase - half) / teeth,
                speed,
                motion: rows(6, row, 0.0, (row + 2, base.recip())),
            };
            gear.reduce(&p, kept.len());
            gear
        };
        let first = gear("gear 1", driving, f64::from(self.driving_teeth), 0, self.driving.radius);
        let second = GearDrawing {
            centre: [driving + driven, 0.0],
            angle: std::f64::consts::PI - (TAU * self.mesh.phase + half) / count,
            speed: -speed * driving / driven,
            ..gear("gear 2", driven, count, 3, self.driven.radius)
        };
        Drawing { points: vec![point([0.0; 2], driving, 0.0)], gears: vec![first, second] }
    }

    /// Returns the pair in the degrees of freedom with these indices among all six.
    fn assemble(&self, kept: &[usize]) -> Result<Spec, TrainError> {
        self.driving.check("driving gear")?;
        self.driven.check("driven gear")?;
        check("rpm", self.rpm, self.rpm >= 0.0, ">= 0")?;
        check("torque", self.torque, true, "finite")?;
        let quarter = std::f64::consts::FRAC_PI_2;
        check("pressure angle", self.pressure_angle, (0.0..quarter).contains(&self.pressure_angle), "in [0, pi/2)")?;
        let all = ["x_1", "y_1", "u_1", "x_2", "y_2", "u_2"];
        let mut assembly = Assembly::new(all.len());
        for (row, body, name) in [(0, &self.driving, "gear 1"), (3, &self.driven, "gear 2")] {
            assembly.body(row, body);
            assembly.bearing_at(name, row, body);
            assembly.hold(row + 2, body.rotation, body.rotary_mass);
            assembly.load[row + 2] = self.torque / self.driving.radius;
        }
        let line = LineOfAction {
            kind: MeshKind::External,
            pitch: 0.0,
            pressure_angle: self.pressure_angle,
            sense: 1.0,
            base_helix: self.base_helix,
        };
        let direction = line.direction(Wheel::at(0, 0.0), Wheel::at(3, 0.0), all.len());
        let frequency = self.mesh_frequency();
        assembly.mesh("mesh".into(), &direction, &self.mesh, frequency)?;
        let names = kept.iter().map(|row| all[*row].to_owned()).collect();
        Ok(assembly.reduced(names, &projection(kept), 1.0, frequency))
    }
}

/// Indices of the kept degrees of freedom among all six.
const TORSIONAL: [usize; 2] = [2, 5];
const TRANSLATIONAL: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// Returns P of `q_all = P q`.
fn projection(kept: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(TRANSLATIONAL.len(), kept.len(), |row, column| f64::from(row == kept[column]))
}
