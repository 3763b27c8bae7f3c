//! Contact laws, one per file.
//!
//! `p` is the penetration, m, positive in contact; `ṗ` its rate, m/s; `F ≥ 0` pushes the flanks apart (only a bilateral law may pull).

mod hysteresis;
mod linear;
mod power;
mod rigid;

pub use hysteresis::{Hysteresis, coefficient, exact_coefficient, restitution};
pub use linear::{Linear, Release};
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
}
