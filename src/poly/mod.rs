//! Polynomials on `[0, 1]`: evaluation, bounds, and the first root with a certificate.
//!
//! Coefficients are in rising powers. A *certificate* is a proof in the coefficients, not a sample: all
//! Bernstein coefficients positive proves "no root"; one sign change among them proves "exactly one".

mod bernstein;
mod first_root;

pub use first_root::{FirstRoot, Isolation, first_root};

/// `p(x)` by Horner's rule.
#[must_use]
pub fn eval(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |s, c| s * x + c)
}

/// `Σ |p_k| xᵏ`: the sum of the sizes of the terms at `x ≥ 0`.
pub(crate) fn terms(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |s, c| s * x + c.abs())
}

/// `(p(x), p′(x))` by Horner's rule.
#[must_use]
pub fn eval_with_slope(p: &[f64], x: f64) -> (f64, f64) {
    p.iter().rev().fold((0.0, 0.0), |(s, d), c| (s * x + c, d * x + s))
}

/// Highest degree these routines accept.
pub const MAX_DEGREE: usize = 40;
