//! The common form of every train:
//!
//! ```text
//! M q̈ + C q̇ + K q + Σ_j g_j F_j = f(t),    δ_j = g_jᵀ q − e_j(t),    f(t) = f₀ + Σ_i f_i cos(ω_i t + φ_i) + Σ_l p_l(t) d_l
//! ```

use nalgebra::{DMatrix, DVector};

use crate::gear::{Harmonic, Stiffness, contact::Law};

/// Number of samples of an error on a period of its highest harmonic, and highest order for a search over a period of the lowest.
const SAMPLES: f64 = 32.0;
const HIGHEST: f64 = 1000.0;

/// Flanks of a mesh.
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
    /// Flanks of the contact.
    pub flanks: Flanks,
    /// Stiffness schedule; ignored by a rigid law.
    pub stiffness: Stiffness,
    /// The law.
    pub law: Law,
    /// Damper `c δ̇` between the bodies in every state, N s/m, ≥ 0. It is no part of the contact force that decides the release.
    pub gap_damping: f64,
    /// Back flank, if it differs from the drive flank.
    pub back: Option<BackFlank>,
}

/// A back flank with different stiffness and error, touched at `gᵀq − e = −b`. Law and b are those of the contact.
#[derive(Clone, Debug, PartialEq)]
pub struct BackFlank {
    /// Stiffness schedule; ignored by a rigid law.
    pub stiffness: Stiffness,
    /// Transmission error, m; positive closes the back flank.
    pub error: Vec<Harmonic>,
    /// Constant part of the error, m.
    pub error_offset: f64,
}

impl ContactSpec {
    /// Stiffness schedules of both flanks.
    pub fn schedules(&self) -> impl Iterator<Item = &Stiffness> {
        [&self.stiffness].into_iter().chain(self.back.as_ref().map(|back| &back.stiffness))
    }

    /// Stiffness schedules of both flanks, mutable.
    pub fn schedules_mut(&mut self) -> impl Iterator<Item = &mut Stiffness> {
        [&mut self.stiffness].into_iter().chain(self.back.as_mut().map(|back| &mut back.stiffness))
    }

    /// Transmission errors of both flanks.
    pub fn errors(&self) -> impl Iterator<Item = &Vec<Harmonic>> {
        [&self.error].into_iter().chain(self.back.as_ref().map(|back| &back.error))
    }

    /// Transmission errors of both flanks, mutable.
    pub fn errors_mut(&mut self) -> impl Iterator<Item = &mut Vec<Harmonic>> {
        [&mut self.error].into_iter().chain(self.back.as_mut().map(|back| &mut back.error))
    }

    /// Moves the teeth of both flanks by `offset`, m.
    pub(crate) fn shift(&mut self, offset: f64) {
        self.error_offset += offset;
        self.back.iter_mut().for_each(|back| back.error_offset += offset);
    }

    /// Returns the contact with the drive flank alone, if the back flank is a separate contact.
    pub(super) fn front(&self) -> Self {
        let flanks = if self.back.is_some() { Flanks::Drive } else { self.flanks };
        Self { flanks, back: None, ..self.clone() }
    }

    /// Returns the back flank as the drive flank of a reversed contact.
    pub(super) fn turned(&self) -> Option<Self> {
        let BackFlank { stiffness, error, error_offset } = self.back.clone()?;
        Some(Self {
            direction: self.direction.iter().map(|g| -g).collect(),
            error: error.into_iter().map(|h| Harmonic { amplitude: -h.amplitude, ..h }).collect(),
            error_offset: -error_offset,
            stiffness,
            ..self.front()
        })
    }

    /// Returns a lower bound on the distance of the flanks, `2b + e − e_back`, m.
    pub(super) fn narrowest_gap(&self) -> f64 {
        let Some(back) = &self.back else { return 2.0 * self.half_backlash };
        // Waves of one frequency add as phasors.
        let mut phasors: Vec<(f64, [f64; 2])> = Vec::new();
        let waves = self.error.iter().map(|h| (1.0, h)).chain(back.error.iter().map(|h| (-1.0, h)));
        for (sign, h) in waves {
            let (sin, cos) = libm::sincos(h.phase);
            let part = [cos, sin].map(|x| sign * h.amplitude * x);
            match phasors.iter_mut().find(|(omega, _)| *omega == h.omega) {
                Some((_, sum)) => *sum = [sum[0] + part[0], sum[1] + part[1]],
                None => phasors.push((h.omega, part)),
            }
        }
        let swing: f64 = phasors.iter().map(|(_, [x, y])| libm::hypot(*x, *y)).sum();
        2.0 * self.half_backlash + self.error_offset - back.error_offset - swing
    }

    /// Returns the error and its rate at time `t`, s, without the constant part: m, m/s.
    #[must_use]
    pub fn error_at(&self, t: f64) -> [f64; 2] {
        sum_at(&self.error, t)
    }

    /// Returns the largest `|ë|` of the error, m/s², over a period if all harmonics are multiples of the lowest. Otherwise it is the bound
    /// `Σ |a| ω²`, which harmonics of unrelated frequencies approach arbitrarily closely.
    #[must_use]
    pub fn largest_acceleration(&self) -> f64 {
        let bound = self.error.iter().map(|h| h.amplitude.abs() * h.omega * h.omega).sum();
        let lowest = self.error.iter().map(|h| h.omega).fold(f64::INFINITY, f64::min);
        let orders: Vec<f64> = self.error.iter().map(|h| h.omega / lowest).collect();
        if self.error.len() < 2 || orders.iter().any(|order| (order - order.round()).abs() > 1e-9 || *order > HIGHEST) {
            return bound;
        }
        // ë, and its first and second derivatives with respect to the angle.
        let at = |angle: f64| {
            self.error.iter().zip(&orders).fold([0.0; 3], |[a, slope, bend], (h, order)| {
                let (sin, cos) = libm::sincos(order.round() * angle + h.phase);
                let size = -h.amplitude * h.omega * h.omega;
                [a + size * cos, slope - size * order * sin, bend - size * order * order * cos]
            })
        };
        let highest = orders.iter().fold(1.0, |most: f64, order| most.max(*order));
        let count = (SAMPLES * highest).ceil();
        // OK to convert: a small number.
        let samples = (0..count as u32).map(|i| std::f64::consts::TAU * f64::from(i) / count);
        let coarse = samples.max_by(|a, b| at(*a)[0].abs().total_cmp(&at(*b)[0].abs())).unwrap_or(0.0);
        let peak = (0..4).fold(coarse, |angle, _| {
            let [_, slope, bend] = at(angle);
            if bend == 0.0 { angle } else { angle - slope / bend }
        });
        at(coarse)[0].abs().max(at(peak)[0].abs())
    }
}

/// Sum of harmonics, and its rate, at time `t`.
pub(super) fn sum_at(harmonics: &[Harmonic], t: f64) -> [f64; 2] {
    harmonics.iter().fold([0.0; 2], |[e, rate], h| {
        let (sin, cos) = libm::sincos(h.omega * t + h.phase);
        [e + h.amplitude * cos, rate - h.amplitude * h.omega * sin]
    })
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

/// A load with a schedule, `p(t) · vector`, which always acts.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadSchedule {
    /// Direction and size, `[n]`.
    pub vector: Vec<f64>,
    /// Factor p, N if the vector has no unit: steps and ramps, [`Stiffness::Periodic`] or [`Stiffness::Listed`].
    pub factor: Stiffness,
}

/// A linear structure with contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// Names of the degrees of freedom, `[n]`.
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
    /// Loads in steps and ramps.
    pub load_schedules: Vec<LoadSchedule>,
    /// The contacts.
    pub contacts: Vec<ContactSpec>,
    /// Base frequency of the forcing (mesh frequency), rad/s, if the train names one.
    pub omega: Option<f64>,
    /// The bearings whose forces are measured. Their stiffness and damping are in K and C already.
    pub bearings: Vec<Bearing>,
    /// Contacts that share the load of a central gear: those with all its planets.
    pub shared: Vec<Vec<usize>>,
}

impl Spec {
    /// Moves the dampers of the gaps into C and the loads: `c δ̇ = c (gᵀq̇ − ė)`.
    pub(super) fn with_gap_dampers(mut self) -> Self {
        for contact in &mut self.contacts {
            let c = std::mem::take(&mut contact.gap_damping);
            if c == 0.0 {
                continue;
            }
            let g = DVector::from_column_slice(&contact.direction);
            self.damping += c * (&g * g.transpose());
            for h in &contact.error {
                // The derivative of a cosine is a cosine a quarter turn ahead.
                let (omega, phase) = (h.omega, h.phase + std::f64::consts::FRAC_PI_2);
                let push = g.iter().map(|g| c * h.amplitude * omega * g);
                // One load for all planets: equal bodies have equal loads.
                match self.load_harmonics.iter_mut().find(|load| load.omega == omega && load.phase == phase) {
                    Some(load) => load.vector.iter_mut().zip(push).for_each(|(sum, push)| *sum += push),
                    None => self.load_harmonics.push(LoadHarmonic { vector: push.collect(), omega, phase }),
                }
            }
        }
        self
    }

    /// Iterates over the flanks as contacts: all contacts, then the back flanks that differ.
    pub(super) fn flanks(&self) -> impl Iterator<Item = ContactSpec> {
        let fronts = self.contacts.iter().map(ContactSpec::front);
        fronts.chain(self.contacts.iter().filter_map(ContactSpec::turned))
    }

    /// Returns the load without its harmonics, N, `[n]`: schedules with their means, listed ones with their value at `t = 0`.
    #[must_use]
    pub fn resting_load(&self) -> Vec<f64> {
        let mut load = self.load.clone();
        for LoadSchedule { vector, factor } in &self.load_schedules {
            let factor = if let Stiffness::Listed { .. } = factor { factor.at(0.0) } else { factor.mean() };
            load.iter_mut().zip(vector).for_each(|(load, part)| *load += factor * part);
        }
        load
    }
}

/// A bearing: springs and dampers that support a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Bearing {
    /// Name of the body.
    pub name: String,
    /// One spring for each direction in which the bearing is elastic.
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
    /// Returns the force `k d·q + c d·q̇` in a state that begins with q and q̇, N.
    #[must_use]
    pub fn force(&self, x: &[f64]) -> f64 {
        let along = |part: &[f64]| self.direction.iter().zip(part).fold(0.0, |sum, (d, x)| sum + d * x);
        self.stiffness * along(x) + self.damping * along(&x[self.direction.len()..])
    }
}
