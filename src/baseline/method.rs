use super::{
    Alpha, Penalty, alpha::GeneralisedAlpha, drive::Stepper, euler::SemiImplicitEuler, rk4::RungeKutta, verlet::Verlet,
};

/// A fixed-step method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The classical Runge–Kutta method.
    Rk4,
    /// Newmark, HHT-α, generalised-α.
    Alpha(Alpha),
    /// Semi-implicit Euler.
    SemiImplicitEuler,
    /// Velocity Verlet.
    Verlet,
}

impl Method {
    /// Order on smooth problems.
    #[must_use]
    pub fn order(self) -> u32 {
        match self {
            Self::Rk4 => 4,
            Self::Alpha(_) | Self::Verlet => 2,
            Self::SemiImplicitEuler => 1,
        }
    }

    /// Largest `h ω` at which an undamped oscillation of frequency ω does not grow; `None` for a method that is stable at any.
    ///
    /// `2√2` for RK4, 2 for semi-implicit Euler and velocity Verlet.
    #[must_use]
    pub fn stability_limit(self) -> Option<f64> {
        match self {
            Self::Rk4 => Some(2.0 * std::f64::consts::SQRT_2),
            Self::Alpha(_) => None,
            Self::SemiImplicitEuler | Self::Verlet => Some(2.0),
        }
    }

    pub(super) fn stepper(self, model: &Penalty, h: f64) -> Box<dyn Stepper> {
        match self {
            Self::Rk4 => Box::new(RungeKutta::new(model)),
            Self::Alpha(alpha) => Box::new(GeneralisedAlpha::new(model, alpha, h)),
            Self::SemiImplicitEuler => Box::new(SemiImplicitEuler::new(model)),
            Self::Verlet => Box::new(Verlet::new(model)),
        }
    }
}

/// An adaptive solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// Tsitouras 5(4).
    Explicit,
    /// ESDIRK 3(4).
    Sdirk,
    /// Backward differences of order 1 to 5.
    Bdf,
}
