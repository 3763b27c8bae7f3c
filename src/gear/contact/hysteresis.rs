//! Hysteresis damping: from a desired restitution to the coefficient D, and the restitution that each formula returns.
//!
//! For a free impact under `F = K pⁿ (1 + D ṗ/v₀)` the energy integral gives, for any K, n and mass,
//!
//! ```text
//! D (1 + e) = ln( (1 + D) / (1 − e D) ),      0 < e ≤ 1,   0 ≤ D < 1/e.
//! ```

/// Formula that converts a desired restitution to D.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hysteresis {
    /// Elastic: D = 0.
    None,
    /// Hunt & Crossley (1975): `3(1 − e)/2`.
    HuntCrossley,
    /// Herbert & McWhannell (1977): `6(1 − e)/((2e − 1)² + 3)`.
    HerbertMcWhannell,
    /// Lankarani & Nikravesh (1990): `3(1 − e²)/4`.
    LankaraniNikravesh,
    /// Gonthier et al. (2004), closed approximation: `(1 − e²)/e`.
    Gonthier,
    /// Flores et al. (2011): `8(1 − e)/(5e)`.
    Flores,
    /// Hu & Guo (2015): `3(1 − e)/(2e)`.
    HuGuo,
    /// The relation above, solved for D: the restitution is exactly the desired one.
    Exact,
}

/// Returns the coefficient D for a desired restitution `e`, `(0, 1]`.
#[must_use]
pub fn coefficient(model: Hysteresis, e: f64) -> f64 {
    match model {
        Hysteresis::None => 0.0,
        Hysteresis::HuntCrossley => 1.5 * (1.0 - e),
        Hysteresis::HerbertMcWhannell => 6.0 * (1.0 - e) / ((2.0 * e - 1.0).powi(2) + 3.0),
        Hysteresis::LankaraniNikravesh => 0.75 * (1.0 - e * e),
        Hysteresis::Gonthier => (1.0 - e * e) / e,
        Hysteresis::Flores => 1.6 * (1.0 - e) / e,
        Hysteresis::HuGuo => 1.5 * (1.0 - e) / e,
        Hysteresis::Exact => exact_coefficient(e),
    }
}

/// `D(1 + e) − ln((1 + D)/(1 − eD))`, without cancellation for small D.
fn residual(d: f64, e: f64) -> f64 {
    d * (1.0 + e) - libm::log1p(d) + libm::log1p(-e * d)
}

/// Solves the exact relation for D, given `e` in `(0, 1]`.
#[must_use]
pub fn exact_coefficient(e: f64) -> f64 {
    // The residual is positive between 0 and the root, negative from the root to the pole at 1/e.
    let (mut lo, mut hi) = (1.5 * (1.0 - e) * 0.5, 1.0 / e);
    if e >= 1.0 {
        return 0.0;
    }
    for _ in 0..200 {
        let mid = 0.5 * (lo + hi);
        if mid <= lo || mid >= hi {
            break;
        }
        if residual(mid, e) > 0.0 { lo = mid } else { hi = mid }
    }
    0.5 * (lo + hi)
}

/// Returns the restitution of a free impact with coefficient `d ≥ 0`.
#[must_use]
pub fn restitution(d: f64) -> f64 {
    if d <= 0.0 {
        return 1.0;
    }
    // In e the residual falls from positive at 0 (for any D) to −∞ at the pole 1/D, or is negative at 1.
    let (mut lo, mut hi) = (0.0, 1.0f64.min(1.0 / d));
    for _ in 0..200 {
        let mid = 0.5 * (lo + hi);
        if mid <= lo || mid >= hi {
            break;
        }
        if residual(d, mid) > 0.0 { lo = mid } else { hi = mid }
    }
    0.5 * (lo + hi)
}
