/// Linear damper beside the mesh spring: `F = k(t) p + c ṗ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Damping c in contact, N s/m, ≥ 0.
    pub damping: f64,
}

/// Condition for the loss of a Kelvin–Voigt contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Release {
    /// At `p = 0`, whatever the sign of the force: the damper may pull just before.
    Deflection,
    /// At `F = 0`: the contact never pulls. It is then *detached*, still inside the zone of the flank, until `p` falls through zero or the
    /// force rises through zero again.
    Force,
}
