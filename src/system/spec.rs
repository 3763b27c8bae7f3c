//! The common form of every train:
//!
//! ```text
//! M q̈ + C q̇ + K q + Σ_j g_j F_j = f(t),    δ_j = g_jᵀ q − e_j(t),    f(t) = f₀ + Σ_i f_i cos(ω_i t + φ_i)
//! ```

use nalgebra::DMatrix;

use crate::gear::{Harmonic, Stiffness, contact::Law};

/// Samples of an error on a period of its highest harmonic, and the highest order for which a period of the lowest is searched.
const SAMPLES: f64 = 32.0;
const HIGHEST: f64 = 1000.0;

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

    /// Largest `|ë|` of the error, m/s²: the bound `Σ |a| ω²`, which harmonics of unrelated frequencies come as near to as one likes, or the
    /// largest over a period if all are multiples of the lowest.
    #[must_use]
    pub fn largest_acceleration(&self) -> f64 {
        let bound = self.error.iter().map(|h| h.amplitude.abs() * h.omega * h.omega).sum();
        let lowest = self.error.iter().map(|h| h.omega).fold(f64::INFINITY, f64::min);
        let orders: Vec<f64> = self.error.iter().map(|h| h.omega / lowest).collect();
        if self.error.len() < 2 || orders.iter().any(|order| (order - order.round()).abs() > 1e-9 || *order > HIGHEST) {
            return bound;
        }
        // ë, its first and its second derivative by the angle.
        let at = |angle: f64| {
            self.error.iter().zip(&orders).fold([0.0; 3], |[a, slope, bend], (h, order)| {
                let (sin, cos) = libm::sincos(order.round() * angle + h.phase);
                let size = -h.amplitude * h.omega * h.omega;
                [a + size * cos, slope - size * order * sin, bend - size * order * order * cos]
            })
        };
        let highest = orders.iter().fold(1.0, |most: f64, order| most.max(*order));
        let count = (SAMPLES * highest).ceil();
        // OK to convert: few.
        let samples = (0..count as u32).map(|i| std::f64::consts::TAU * f64::from(i) / count);
        let coarse = samples.max_by(|a, b| at(*a)[0].abs().total_cmp(&at(*b)[0].abs())).unwrap_or(0.0);
        let peak = (0..4).fold(coarse, |angle, _| {
            let [_, slope, bend] = at(angle);
            if bend == 0.0 { angle } else { angle - slope / bend }
        });
        at(coarse)[0].abs().max(at(peak)[0].abs())
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
    /// The bearings whose forces are measured. Their stiffness and damping are in K and C already.
    pub bearings: Vec<Bearing>,
    /// Contacts that share the load of a central gear: those of all its planets.
    pub shared: Vec<Vec<usize>>,
}

/// A bearing: a body held by springs and dampers.
#[derive(Clone, Debug, PartialEq)]
pub struct Bearing {
    /// Name of the body.
    pub name: String,
    /// A spring for each direction in which it gives way.
    pub springs: Vec<BearingSpring>,
}

/// Spring and damper in one direction of a bearing.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingSpring {
    /// Name of the direction, such as `x` or `radial`.
    pub name: &'static str,
    /// Direction `d` of the stretch `d·q`, `[n]`.
    pub direction: Vec<f64>,
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Damping c, N s/m.
    pub damping: f64,
}

impl BearingSpring {
    /// Force `k d·q + c d·q̇` in a state that begins with q and q̇, N.
    #[must_use]
    pub fn force(&self, x: &[f64]) -> f64 {
        let along = |part: &[f64]| self.direction.iter().zip(part).fold(0.0, |sum, (d, x)| sum + d * x);
        self.stiffness * along(x) + self.damping * along(&x[self.direction.len()..])
    }
}
