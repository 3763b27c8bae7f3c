//! A pair of gears: the dimensionless single freedom of Kahraman and Singh, and pairs with real geometry.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::body::{Body, Support};
use super::error::{TrainError, check};
use super::mesh::{Mesh, check_stiffness};
use crate::gear::contact::{Law, Linear, Release};
use crate::gear::{MeshHarmonic, MeshStiffness};
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
    /// Whether the damper acts in the gap too (the classical equation) or in contact only, where the contact then
    /// ends at x = ±1 whatever the sign of the force.
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

    /// One freedom `x`, one contact `mesh` with both flanks.
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
            }],
            omega: Some(self.omega),
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
    /// Working pressure angle α, rad, `[0, π/2)`.
    pub pressure_angle: f64,
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

    /// Two freedoms `u_1`, `u_2`; without torsional supports both may turn together freely (`u₁ = −u₂`).
    ///
    /// # Errors
    /// [`TrainError`] for a value outside its range or a standing pair with a varying mesh.
    pub fn torsional(&self) -> Result<Spec, TrainError> {
        self.assemble(&["u_1", "u_2"], &[1.0, 1.0], |body| vec![(body.rotary_mass, body.rotation)])
    }

    /// Six freedoms `x_1, y_1, u_1, x_2, y_2, u_2` with
    /// `δ = x₁ sin α + y₁ cos α + u₁ − x₂ sin α − y₂ cos α + u₂ − e`.
    ///
    /// # Errors
    /// As for [`torsional`](Self::torsional).
    pub fn translational(&self) -> Result<Spec, TrainError> {
        let (sin, cos) = libm::sincos(self.pressure_angle);
        self.assemble(&["x_1", "y_1", "u_1", "x_2", "y_2", "u_2"], &[sin, cos, 1.0, -sin, -cos, 1.0], |body| {
            vec![(body.mass, body.translation), (body.mass, body.translation), (body.rotary_mass, body.rotation)]
        })
    }

    fn assemble(
        &self,
        freedoms: &[&str],
        direction: &[f64],
        supports: impl Fn(&Body) -> Vec<(f64, Support)>,
    ) -> Result<Spec, TrainError> {
        self.driving.check("driving gear")?;
        self.driven.check("driven gear")?;
        check("rpm", self.rpm, self.rpm >= 0.0, ">= 0")?;
        check("torque", self.torque, true, "finite")?;
        let quarter = std::f64::consts::FRAC_PI_2;
        check("pressure angle", self.pressure_angle, (0.0..quarter).contains(&self.pressure_angle), "in [0, pi/2)")?;
        let held: Vec<_> = [&self.driving, &self.driven].into_iter().flat_map(supports).collect();
        let diagonal = |values: Vec<f64>| DMatrix::from_diagonal(&values.into());
        let frequency = self.mesh_frequency();
        let force = self.torque / self.driving.radius;
        let load = freedoms.iter().map(|name| if name.starts_with('u') { force } else { 0.0 }).collect();
        Ok(Spec {
            freedoms: freedoms.iter().map(ToString::to_string).collect(),
            mass: diagonal(held.iter().map(|(mass, _)| *mass).collect()),
            damping: diagonal(held.iter().map(|(mass, support)| support.coefficient(*mass)).collect()),
            stiffness: diagonal(held.iter().map(|(_, support)| support.stiffness).collect()),
            load,
            load_harmonics: Vec::new(),
            contacts: vec![self.mesh.contact("mesh".into(), direction.to_vec(), frequency)?],
            omega: (frequency > 0.0).then_some(TAU * frequency),
        })
    }
}
