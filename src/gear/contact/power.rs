/// A ratio of small whole numbers, `p/q`, the exponent of a power law.
///
/// The flow through a contact start is analytic in `y = δ^(1/q)`, so the exponent is kept as a ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ratio {
    /// Numerator, > 0.
    pub p: u32,
    /// Denominator, 1 to 16.
    pub q: u32,
}

impl Ratio {
    /// Largest denominator for which the root clock is well conditioned.
    pub const MAX_DENOMINATOR: u32 = 16;

    /// The ratio equal to `n` to 4 units in the last place, if one with a denominator up to 16 exists.
    #[must_use]
    pub fn from_f64(n: f64) -> Option<Self> {
        (1..=Self::MAX_DENOMINATOR).find_map(|q| {
            let p = (n * f64::from(q)).round();
            ((p / f64::from(q) - n).abs() <= 4.0 * f64::EPSILON * n && (1.0..64.0).contains(&p))
                .then_some(Self { p: p as u32, q })
        })
    }

    /// `p/q`.
    #[must_use]
    pub fn value(self) -> f64 {
        f64::from(self.p) / f64::from(self.q)
    }

    /// `x^(p/q)`, `x ≥ 0`. Most laws are those of Hertz, with a square root.
    #[must_use]
    pub fn power(self, x: f64) -> f64 {
        match self.q {
            1 => x.powi(self.p as i32),
            2 => x.sqrt() * x.powi((self.p / 2) as i32),
            _ => libm::pow(x, self.value()),
        }
    }
}

/// `F = K pⁿ (1 + χ ṗ)` with `χ = D/v₀`, `v₀` the approach speed latched at each contact start.
///
/// As `v₀ → 0` the factor χ grows without bound; `v₀` is floored at `speed_floor`, and before the first
/// contact start (a run that begins in contact) `v₀ = initial_speed`.
/// The law never pulls: where `1 + χ ṗ` falls through zero the contact is *detached*, and in contact again
/// (without a new latch) when it rises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// Exponent n.
    pub exponent: Ratio,
    /// Hysteresis coefficient D, `[0, ∞)`; 0 for an elastic contact.
    pub hysteresis: f64,
    /// Smallest latched speed, m/s, > 0.
    pub speed_floor: f64,
    /// Latched speed before the first contact start, m/s, > 0.
    pub initial_speed: f64,
}
