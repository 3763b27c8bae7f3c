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

/// Returns the restitution of a free impact on a spring and damper with damping ratio ζ.
///
/// Release at `p = 0` for ζ < 1: `exp(−πζ/√(1−ζ²))`. Release at `F = 0`: `exp(−ζφ/√(1−ζ²))` with
/// `φ = 2 arccos ζ` (and its continuation `2 arcosh ζ` beyond ζ = 1). ζ ≥ 0.
#[must_use]
pub fn damped_restitution(zeta: f64, release: Release) -> f64 {
    let root = (1.0 - zeta * zeta).abs().sqrt();
    match release {
        Release::Deflection if zeta >= 1.0 => 0.0,
        Release::Deflection => libm::exp(-std::f64::consts::PI * zeta / root),
        Release::Force if zeta < 1.0 => libm::exp(-zeta * 2.0 * libm::acos(zeta) / root),
        Release::Force if zeta == 1.0 => libm::exp(-2.0f64),
        Release::Force => libm::exp(-zeta * 2.0 * libm::acosh(zeta) / root),
    }
}
