//! Rigid bodies and their supports.

use std::fmt;

use super::error::{TrainError, check};
use crate::gear::geometry::radius_of_gyration;

/// Damping beside a spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damping {
    /// Ratio ζ: `c = 2 ζ √(k m)` with the spring's stiffness and the moving mass, `[0, ∞)`.
    Ratio(f64),
    /// Coefficient c, N s/m, ≥ 0.
    Viscous(f64),
}

/// Spring and damper between a body and its support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Stiffness k, N/m, ≥ 0; for a rotation on `u = r θ`, so torsional stiffness over r².
    pub stiffness: f64,
    /// Damping.
    pub damping: Damping,
}

impl Support {
    /// Free: no spring, no damper.
    pub const FREE: Self = Self { stiffness: 0.0, damping: Damping::Viscous(0.0) };

    /// Spring k, N/m, with damping ratio ζ.
    #[must_use]
    pub fn ratio(stiffness: f64, ratio: f64) -> Self {
        Self { stiffness, damping: Damping::Ratio(ratio) }
    }

    /// Spring k, N/m, with damper c, N s/m.
    #[must_use]
    pub fn viscous(stiffness: f64, damping: f64) -> Self {
        Self { stiffness, damping: Damping::Viscous(damping) }
    }

    /// Damping coefficient c for a moving mass, kg; N s/m.
    #[must_use]
    pub fn coefficient(&self, mass: f64) -> f64 {
        match self.damping {
            Damping::Ratio(ratio) => 2.0 * ratio * (self.stiffness * mass).sqrt(),
            Damping::Viscous(c) => c,
        }
    }
}

/// A rigid body in the plane. Its rotation is counted on its base circle, `u = r θ`, counter-clockwise positive
/// (a carrier's on the circle of its planet centres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass m, kg, > 0.
    pub mass: f64,
    /// Rotary mass `I/r²`, kg, > 0.
    pub rotary_mass: f64,
    /// Radius r on which the rotation is counted, m, > 0.
    pub radius: f64,
    /// Largest radius of the material of the body, m, if known; only for the plausibility check of its inertia.
    pub outer_radius: Option<f64>,
    /// Support of its centre, the same in every direction, in the frame, or for a planet in the carrier.
    pub translation: Support,
    /// Support of its rotation (on u) in the frame.
    pub rotation: Support,
}

impl Body {
    /// A free body of mass m, kg, and moment of inertia I, kg m², counted on radius r, m.
    #[must_use]
    pub fn new(mass: f64, inertia: f64, radius: f64) -> Self {
        Self {
            mass,
            rotary_mass: inertia / (radius * radius),
            radius,
            outer_radius: None,
            translation: Support::FREE,
            rotation: Support::FREE,
        }
    }

    /// Moment of inertia `I = (I/r²) r²`, kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.rotary_mass * self.radius * self.radius
    }

    /// Returns the radius of gyration if it lies beyond the outer radius, both in m: `(gyration, outer)`.
    #[must_use]
    pub fn impossible_gyration(&self) -> Option<(f64, f64)> {
        let gyration = radius_of_gyration(self.mass, self.inertia());
        self.outer_radius.filter(|&outer| gyration > outer).map(|outer| (gyration, outer))
    }

    /// Checks the ranges.
    pub(super) fn check(&self, name: impl fmt::Display) -> Result<(), TrainError> {
        check(format_args!("{name}: mass"), self.mass, self.mass > 0.0, "> 0")?;
        check(format_args!("{name}: rotary mass"), self.rotary_mass, self.rotary_mass > 0.0, "> 0")?;
        check(format_args!("{name}: radius"), self.radius, self.radius > 0.0, "> 0")?;
        for (which, support, mass) in
            [("translation", self.translation, self.mass), ("rotation", self.rotation, self.rotary_mass)]
        {
            check(format_args!("{name}: {which} stiffness"), support.stiffness, support.stiffness >= 0.0, ">= 0")?;
            let c = support.coefficient(mass);
            check(format_args!("{name}: {which} damping"), c, c >= 0.0, ">= 0")?;
        }
        Ok(())
    }
}
