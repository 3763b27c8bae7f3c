//! The common form of every train:
//!
//! ```text
//! M q̈ + C q̇ + K q + Σ_j g_j F_j = f(t),    δ_j = g_jᵀ q − e_j(t),    f(t) = f₀ + Σ_i f_i cos(ω_i t + φ_i)
//! ```

use nalgebra::DMatrix;

use crate::gear::{Harmonic, Stiffness, contact::Law};

/// Which flanks of a mesh exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flanks {
    /// Drive flank at `δ = +b` and back flank at `δ = −b`.
    Both,
    /// Drive flank only: a wall.
    Drive,
}

/// One contact element: a rank-one coupling with a direction, an error, a gap and a law.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSpec {
    /// Name used in logs and messages, such as `sun-planet 1`.
    pub name: String,
    /// Direction `g = ∂δ/∂q`, `[n]`.
    pub direction: Vec<f64>,
    /// Transmission error `e(t) = Σ a cos(ω t + φ)`, m; positive opens the drive flank.
    pub error: Vec<Harmonic>,
    /// Constant part of the error, m (an offset of the deflection).
    pub error_offset: f64,
    /// Half the total backlash, b, m, ≥ 0: the drive flank is touched at `δ = b`. May be negative for a
    /// single flank only (the position of a wall).
    pub half_backlash: f64,
    /// Which flanks exist.
    pub flanks: Flanks,
    /// Stiffness schedule; ignored by a rigid law.
    pub stiffness: Stiffness,
    /// The law.
    pub law: Law,
}

impl ContactSpec {
    /// Error and its rate at time `t`, s, without the constant part: m, m/s.
    #[must_use]
    pub fn error_at(&self, t: f64) -> [f64; 2] {
        self.error.iter().fold([0.0; 2], |[e, rate], h| {
            let (sin, cos) = libm::sincos(h.omega * t + h.phase);
            [e + h.amplitude * cos, rate - h.amplitude * h.omega * sin]
        })
    }
}

/// A harmonic load `f cos(ω t + φ)`.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadHarmonic {
    /// Amplitudes, N, `[n]`.
    pub vector: Vec<f64>,
    /// Frequency ω, rad/s, > 0.
    pub omega: f64,
    /// Phase φ, rad.
    pub phase: f64,
}

/// A linear structure with contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// Names of the freedoms, `[n]`.
    pub freedoms: Vec<String>,
    /// Mass matrix M, kg, `[n × n]`, symmetric positive definite.
    pub mass: DMatrix<f64>,
    /// Damping matrix C, N s/m, `[n × n]` (gyroscopic terms make it unsymmetric).
    pub damping: DMatrix<f64>,
    /// Stiffness matrix K of supports and bearings, N/m, `[n × n]`; contacts excluded.
    pub stiffness: DMatrix<f64>,
    /// Constant load f₀, N, `[n]`.
    pub load: Vec<f64>,
    /// Harmonic loads.
    pub load_harmonics: Vec<LoadHarmonic>,
    /// The contacts.
    pub contacts: Vec<ContactSpec>,
    /// Base frequency of the forcing (mesh frequency), rad/s, if the train names one.
    pub omega: Option<f64>,
}
