/// Penetration in a penalty law: `max(p, 0)`, sharp or smoothed over a width `1/σ`, σ in 1/m.
///
/// Each form is `r(p)` with its slope `r′(p)`, which measures how far the contact is closed: it multiplies the damping.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Ramp {
    /// `max(p, 0)`.
    #[default]
    Sharp,
    /// `p (1 + tanh σp)/2`: common in the gear literature. Up to 0.139232/σ too small, and negative for `p < 0`: it pulls just
    /// inside the gap.
    Tanh(f64),
    /// `(p + √(p² + 1/σ²))/2`: at most 1/(2σ) too large, never negative.
    SquareRoot(f64),
    /// `(p + w)³ (3w − p)/(16 w³)` for `|p| < w = 1/σ`, sharp beyond: twice continuously differentiable, at most 3/(16σ) too
    /// large, exact outside the width.
    Polynomial(f64),
}

impl Ramp {
    /// Returns `r(p)`, `r′(p)` and `r″(p)`; the last, which implicit methods need, is 0 at the corner of the sharp form.
    #[inline(always)]
    #[must_use]
    pub fn at(self, p: f64) -> [f64; 3] {
        match self {
            Self::Sharp if p > 0.0 => [p, 1.0, 0.0],
            Self::Sharp => [0.0; 3],
            Self::Tanh(s) => {
                let t = libm::tanh(s * p);
                let slope = 0.5 * (1.0 + t + s * p * (1.0 - t * t));
                [0.5 * p * (1.0 + t), slope, s * (1.0 - t * t) * (1.0 - s * p * t)]
            }
            Self::SquareRoot(s) => {
                let root = libm::hypot(p, s.recip());
                [0.5 * (p + root), 0.5 * (1.0 + p / root), 0.5 / (s * s * root * root * root)]
            }
            Self::Polynomial(s) => {
                let u = s * p;
                if u <= -1.0 {
                    [0.0; 3]
                } else if u >= 1.0 {
                    [p, 1.0, 0.0]
                } else {
                    let v = u + 1.0;
                    let curvature = 0.75 * s * (1.0 - s * s * p * p);
                    [v * v * v * (3.0 - u) / (16.0 * s), v * v * (2.0 - u) * 0.25, curvature]
                }
            }
        }
    }

    /// Returns the largest `|r(p) − max(p, 0)|`, m: `½ max u (1 − tanh u) = 0.139232` in units of 1/σ for tanh.
    #[must_use]
    pub fn bias(self) -> f64 {
        match self {
            Self::Sharp => 0.0,
            Self::Tanh(s) => 0.139_232_271_380_536_9 / s,
            Self::SquareRoot(s) => 0.5 / s,
            Self::Polynomial(s) => 0.1875 / s,
        }
    }

    /// Returns the sharpness σ, 1/m; none for the sharp form.
    pub(crate) fn sharpness(self) -> Option<f64> {
        match self {
            Self::Sharp => None,
            Self::Tanh(s) | Self::SquareRoot(s) | Self::Polynomial(s) => Some(s),
        }
    }
}
