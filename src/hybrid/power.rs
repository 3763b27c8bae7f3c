use super::{GuardSet, Instant, Mode};

/// Rates at which energy enters and leaves a system, W. Each is signed as its name says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Powers {
    /// Work of the outside loads on the structure.
    pub load: f64,
    /// Work of the transmission error against the contact forces, `−Σ F ė`: energy put in.
    pub error: f64,
    /// Change of stored energy by a stiffness that varies in time, `½ k̇ δ²`.
    pub parametric: f64,
    /// Dissipation in the structure's dampers, not negative for a passive structure.
    pub damping: f64,
    /// Dissipation in the contacts.
    pub contact: f64,
}

/// A jump: what was before and what is after it.
#[derive(Clone, Copy, Debug)]
pub struct Transition<'a> {
    /// When.
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

/// What an instant changes in the energy of a system, J. The sum of all parts is the whole change,
/// `ΔE = parametric + error − release − impact + projection`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyJump {
    /// Work of stiffness switches, `½ Δk p²` (under deflected contacts).
    pub parametric: f64,
    /// Work of moving flanks during impacts, `−Σ P ė`.
    pub error: f64,
    /// Stored energy dropped where a contact lets go while still deflected (negative where it takes hold again).
    pub release: f64,
    /// Energy lost in impacts, `Σ P (δ̇⁻ + δ̇⁺)/2`.
    pub impact: f64,
    /// Change by moving the state onto guards: rounding.
    pub projection: f64,
}

/// What an energy ledger asks of a system.
pub trait PowerBalance {
    /// Kinetic plus stored energy, J.
    fn energy(&self, mode: &Mode, at: Instant, x: &[f64]) -> f64;
    /// The powers at an instant. The balance is `Ė = load + error + parametric − damping − contact`.
    fn powers(&self, mode: &Mode, at: Instant, x: &[f64]) -> Powers;
    /// What a jump changes.
    fn energy_jump(&self, transition: &Transition<'_>) -> EnergyJump;
}
