//! Contact laws, one per file.
//!
//! `p` is the penetration, m, positive in contact; `ṗ` its rate, m/s; `F ≥ 0` pushes the flanks apart (only a bilateral law may pull).

mod hysteresis;
mod linear;
mod power;
mod rigid;

pub use hysteresis::{Hysteresis, coefficient, exact_coefficient, restitution};
pub use linear::{Linear, Release, damped_restitution};
pub use power::{PowerLaw, Ratio};
pub use rigid::{MOST_POINTS, Restitution, Rigid};

/// The law of one contact element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Linear spring and damper that never separates: no guard, no backlash.
    Bilateral(Linear),
    /// Linear spring and damper (Kelvin–Voigt) beyond the backlash.
    KelvinVoigt(Linear, Release),
    /// `F = K pⁿ (1 + χ ṗ)`, hysteresis latched at each contact start.
    Power(PowerLaw),
    /// No penetration: Newton restitution, sustained contact held by a multiplier.
    Rigid(Rigid),
}

impl Law {
    /// Returns whether the law permits no penetration.
    #[must_use]
    pub fn is_rigid(&self) -> bool {
        matches!(self, Self::Rigid(_))
    }

    /// Returns whether the contact never separates.
    #[must_use]
    pub fn is_bilateral(&self) -> bool {
        matches!(self, Self::Bilateral(_))
    }

    /// Returns whether the law is a linear spring and damper while it carries force.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Bilateral(_) | Self::KelvinVoigt(..))
    }

    /// Returns the power law, if it is one.
    #[must_use]
    pub fn power(&self) -> Option<PowerLaw> {
        if let Self::Power(law) = self { Some(*law) } else { None }
    }

    /// Returns whether the contact keeps its approach speed: the hysteresis of a power law depends on it.
    #[must_use]
    pub fn is_latched(&self) -> bool {
        self.power().is_some_and(|law| law.hysteresis > 0.0)
    }

    /// Returns the damping c of a linear law, N s/m; 0 of another one.
    #[must_use]
    pub fn damping(&self) -> f64 {
        if let Self::Bilateral(law) | Self::KelvinVoigt(law, _) = self { law.damping } else { 0.0 }
    }

    /// Returns the damping that makes the force jump where the contact begins and ends, N s/m; 0 if the force is continuous there.
    #[must_use]
    pub fn jump_damping(&self) -> f64 {
        if self.is_bilateral() { 0.0 } else { self.damping() }
    }

    /// Returns the damping of a linear law that releases at zero force, N s/m. Without damping, `F = k p` is zero on the flank, and
    /// everywhere if k is zero: the deflection is watched, which determines the flank in both cases.
    #[must_use]
    pub fn release_damping(&self) -> Option<f64> {
        matches!(self, Self::KelvinVoigt(law, Release::Force) if law.damping > 0.0).then(|| self.damping())
    }

    /// Returns the number that sets the loss in contact: the damping c of a linear law, N s/m, or the hysteresis coefficient D of a power
    /// law. A rigid law has none.
    #[must_use]
    pub fn loss(&self) -> Option<f64> {
        let mut law = *self;
        law.loss_mut().copied()
    }

    /// Returns the number of [`loss`](Self::loss), through which it can be changed.
    pub fn loss_mut(&mut self) -> Option<&mut f64> {
        match self {
            Self::Bilateral(law) | Self::KelvinVoigt(law, _) => Some(&mut law.damping),
            Self::Power(law) => Some(&mut law.hysteresis),
            Self::Rigid(_) => None,
        }
    }

    /// Returns whether the law loses no energy.
    #[must_use]
    pub fn is_lossless(&self) -> bool {
        match self {
            Self::Rigid(law) => law.restitution == Restitution::Constant(1.0),
            law => law.loss().is_none_or(|loss| loss == 0.0),
        }
    }

    /// Returns the restitution of a free impact at `speed`, m/s, of the effective mass `mass` with the mean stiffness `stiffness`; `None`
    /// if the law has no impacts.
    #[must_use]
    pub fn free_restitution(&self, speed: f64, stiffness: f64, mass: f64) -> Option<f64> {
        match self {
            Self::Rigid(law) => Some(law.restitution.at(speed)),
            Self::Power(law) => Some(restitution(law.hysteresis)),
            Self::KelvinVoigt(law, release) => {
                let critical = 2.0 * (stiffness * mass).sqrt();
                Some(damped_restitution(law.damping / critical, *release))
            }
            Self::Bilateral(_) => None,
        }
    }

    /// Returns the slope of the force under the force `force`, N/m: the stiffness of a linear law, `n K^{1/n} F^{1−1/n}` of a power law; 0
    /// of a rigid law.
    #[must_use]
    pub fn slope(&self, stiffness: f64, force: f64) -> f64 {
        match self.power() {
            Some(law) => {
                let n = law.exponent.value();
                n * libm::pow(stiffness, n.recip()) * libm::pow(force.abs(), 1.0 - n.recip())
            }
            None if self.is_rigid() => 0.0,
            None => stiffness,
        }
    }

    /// Returns the law in words.
    #[must_use]
    pub fn words(&self) -> &'static str {
        match self {
            Self::Bilateral(_) => "bilateral",
            Self::KelvinVoigt(..) if self.release_damping().is_some() => "linear, never pulls",
            Self::KelvinVoigt(..) => "linear",
            Self::Power(law) if law.hysteresis > 0.0 => "power, hysteresis",
            Self::Power(_) => "power",
            Self::Rigid(_) => "rigid",
        }
    }

    /// Returns the first condition that the numbers of the law break, if any.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        // A comparison with NaN is false, so NaN is out of range.
        let is_permitted = |x: f64| (0.0..f64::INFINITY).contains(&x);
        let (is_met, condition) = match self {
            Self::Bilateral(law) | Self::KelvinVoigt(law, _) => {
                (is_permitted(law.damping), "its damping must be finite and >= 0")
            }
            Self::Rigid(law) => (
                law.restitution.fault().is_none(),
                "its restitution must lie in [0, 1]; one that depends on the speed must be above 0 and start below 1",
            ),
            Self::Power(law) => {
                let n = law.exponent;
                if !(n.q > 0 && n.q <= Ratio::MAX_DENOMINATOR && n.p >= n.q && n.p <= 5 * n.q) {
                    (false, "a power law needs an exponent p/q from 1 to 5 with q from 1 to 16")
                } else if !is_permitted(law.hysteresis) {
                    (false, "its hysteresis must be finite and >= 0")
                } else {
                    (law.speed_floor > 0.0 && law.initial_speed > 0.0, "its latched speeds must be > 0")
                }
            }
        };
        (!is_met).then_some(condition)
    }
}
