use super::{GuardSet, Instant, Mode};

/// Rates at which energy enters and leaves a system, W, with the signs of their names.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Powers {
    /// Work of the external loads on the structure.
    pub load: f64,
    /// Work of the transmission error against the contact forces, `−Σ F ė`: energy put in.
    pub error: f64,
    /// Change of stored energy by a time-varying stiffness, `½ k̇ δ²`.
    pub parametric: f64,
    /// Dissipation in the structure's dampers, not negative for a passive structure.
    pub damping: f64,
    /// Dissipation in the contacts.
    pub contact: f64,
}

/// A jump with mode and state before and after it.
#[derive(Clone, Copy, Debug)]
pub struct Transition<'a> {
    /// Instant of the jump.
    pub at: Instant,
    /// The guards that fired.
    pub fired: &'a GuardSet,
    /// Mode before.
    pub from: &'a Mode,
    /// Mode after.
    pub to: &'a Mode,
    /// State before, `[dim]`.
    pub x_minus: &'a [f64],
    /// State after, `[dim]`.
    pub x_plus: &'a [f64],
}

/// Changes of the energy of a system at one instant, J. Their sum is the whole change, `ΔE = parametric + error − release − impact +
/// projection`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyJump {
    /// Work of stiffness switches, `½ Δk p²` (under deflected contacts).
    pub parametric: f64,
    /// Work of moving flanks during impacts, `−Σ P ė`.
    pub error: f64,
    /// Stored energy lost where a contact detaches while still deflected (negative where it closes again).
    pub release: f64,
    /// Energy lost in impacts, `Σ P (δ̇⁻ + δ̇⁺)/2`.
    pub impact: f64,
    /// Change by moving the state onto guards, at the level of rounding.
    pub projection: f64,
}

/// Energy and powers of a system, for an energy ledger.
pub trait PowerBalance {
    /// Returns the kinetic plus stored energy, J.
    fn energy(&self, mode: &Mode, at: Instant, x: &[f64]) -> f64;
    /// Returns the powers at an instant. The balance is `Ė = load + error + parametric − damping − contact`.
    fn powers(&self, mode: &Mode, at: Instant, x: &[f64]) -> Powers;
    /// Returns the changes of energy in a jump.
    fn energy_jump(&self, transition: &Transition<'_>) -> EnergyJump;
}
