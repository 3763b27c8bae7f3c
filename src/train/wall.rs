//! One mass against one wall or between two.

use nalgebra::DMatrix;

use super::error::{TrainError, check};
use crate::gear::contact::Law;
use crate::gear::{Harmonic, Stiffness};
use crate::system::{ContactSpec, Flanks, LoadHarmonic, Spec};

/// Positions of the walls, m, given as the position of the mass at touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Walls {
    /// The mass stays at `x ≤ position`.
    Above {
        /// Position, m, any sign.
        position: f64,
    },
    /// The mass stays at `x ≥ position`.
    Below {
        /// Position, m, any sign.
        position: f64,
    },
    /// The mass stays at `−half_gap ≤ x ≤ half_gap`.
    Between {
        /// Half the gap, m, ≥ 0.
        half_gap: f64,
    },
}

/// `m ẍ + c ẋ + k x + F = f₀ + Σ f cos(ω t + φ)`, walls at their position plus `w(t) = Σ a cos(ω t + φ)`.
#[derive(Clone, Debug, PartialEq)]
pub struct WalledOscillator {
    /// Mass m, kg, > 0.
    pub mass: f64,
    /// Damper to ground c, N s/m, ≥ 0.
    pub damping: f64,
    /// Spring to ground k, N/m, ≥ 0.
    pub stiffness: f64,
    /// Constant load f₀, N.
    pub load: f64,
    /// Harmonic loads, N.
    pub load_harmonics: Vec<Harmonic>,
    /// The walls.
    pub walls: Walls,
    /// Common motion w of the walls, m, in the direction of x.
    pub motion: Vec<Harmonic>,
    /// Contact law.
    pub law: Law,
    /// Contact stiffness, N/m (N/mⁿ for a power law); a rigid law ignores it.
    pub contact_stiffness: Stiffness,
    /// Reference frequency of sections and spectra, rad/s, if there is one.
    pub omega: Option<f64>,
}

impl WalledOscillator {
    /// A free mass, kg, under a law; no load, no motion.
    #[must_use]
    pub fn new(mass: f64, walls: Walls, law: Law, contact_stiffness: Stiffness) -> Self {
        Self {
            mass,
            damping: 0.0,
            stiffness: 0.0,
            load: 0.0,
            load_harmonics: Vec::new(),
            walls,
            motion: Vec::new(),
            law,
            contact_stiffness,
            omega: None,
        }
    }

    /// Returns a train with one degree of freedom `x` and one contact `wall` (`walls` if there are two).
    ///
    /// A wall below is a wall above in terms of `−x`: direction −1 and negated motion.
    ///
    /// # Errors
    /// [`TrainError::Value`] for a value outside its range.
    pub fn assemble(&self) -> Result<Spec, TrainError> {
        check("mass", self.mass, self.mass > 0.0, "> 0")?;
        check("damping", self.damping, self.damping >= 0.0, ">= 0")?;
        check("stiffness", self.stiffness, self.stiffness >= 0.0, ">= 0")?;
        let (name, sign, half_backlash, flanks) = match self.walls {
            Walls::Above { position } => ("wall", 1.0, position, Flanks::Drive),
            Walls::Below { position } => ("wall", -1.0, -position, Flanks::Drive),
            Walls::Between { half_gap } => {
                check("half gap", half_gap, half_gap >= 0.0, ">= 0")?;
                ("walls", 1.0, half_gap, Flanks::Both)
            }
        };
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        Ok(Spec {
            freedoms: vec!["x".into()],
            mass: one(self.mass),
            damping: one(self.damping),
            stiffness: one(self.stiffness),
            load: vec![self.load],
            load_harmonics: self
                .load_harmonics
                .iter()
                .map(|h| LoadHarmonic { vector: vec![h.amplitude], omega: h.omega, phase: h.phase })
                .collect(),
            contacts: vec![ContactSpec {
                name: name.into(),
                direction: vec![sign],
                error: self.motion.iter().map(|h| Harmonic { amplitude: sign * h.amplitude, ..*h }).collect(),
                error_offset: 0.0,
                half_backlash,
                flanks,
                stiffness: self.contact_stiffness.clone(),
                law: self.law,
                gap_damping: 0.0,
                back: None,
            }],
            omega: self.omega,
            bearings: Vec::new(),
            shared: Vec::new(),
            load_schedules: vec![],
        })
    }
}
