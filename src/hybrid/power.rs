use super::{Instant, Mode};

/// Rates at which energy enters and leaves a system, W. Each is signed as its name says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Powers {
    /// Work of the outside loads on the structure.
    pub load: f64,
    /// Work of the transmission error against the contact forces, `Σ F ė`, with the sign of energy put in.
    pub error: f64,
    /// Change of stored energy by a stiffness that varies in time, `½ k̇ δ²`.
    pub parametric: f64,
    /// Dissipation in the structure's dampers, not negative for a passive structure.
    pub damping: f64,
    /// Dissipation in the contacts.
    pub contact: f64,
}

/// What an energy ledger asks of a system.
pub trait PowerBalance {
    /// Kinetic plus stored energy, J.
    fn energy(&self, mode: Mode, at: Instant, x: &[f64]) -> f64;
    /// The powers at an instant. The balance is `Ė = load + error + parametric − damping − contact`.
    fn powers(&self, mode: Mode, at: Instant, x: &[f64]) -> Powers;
}
