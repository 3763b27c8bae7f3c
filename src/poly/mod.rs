//! Polynomials on `[0, 1]`: evaluation, bounds, and the first root with a certificate.
//!
//! Coefficients are in rising powers. A *certificate* is a proof in the coefficients, not a sample: all
//! Bernstein coefficients positive proves "no root"; one sign change among them proves "exactly one".

mod bernstein;
mod chebyshev;
mod deflated;
mod extremes;
mod falling;
mod first_root;

pub(crate) use bernstein::{FourRanges, bounds, certainly_positive};
pub(crate) use chebyshev::{CHEBYSHEV, Chebyshev, DEGREE};
pub(crate) use deflated::Deflated;
pub use extremes::{extremes, minima};
pub(crate) use falling::{
    BernsteinBasis, MOST_FOURS, Numbers, PARTS, Pattern, Row, Signed, fall, fours, largest, numbers, pattern, restrict,
    stays_above,
};
pub(crate) use first_root::first_root_on;
pub use first_root::{FirstRoot, Isolation, first_root};

/// Evaluates `p(x)` by Horner's rule.
#[must_use]
pub fn eval(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |s, c| s * x + c)
}

/// Returns `Σ |p_k| xᵏ`: the sum of the sizes of the terms at `x ≥ 0`, four side by side.
#[inline(always)]
pub(crate) fn terms(p: &[f64], x: f64) -> f64 {
    let square = x * x;
    let (fourth, mut s) = (square * square, top(p).map(f64::abs));
    for four in p.as_chunks::<4>().0.iter().rev() {
        for l in 0..4 {
            s[l] = s[l] * fourth + four[l].abs();
        }
    }
    (s[0] + x * s[1]) + square * (s[2] + x * s[3])
}

/// Returns the coefficients beyond the last whole four, padded with zeros.
#[inline(always)]
fn top(p: &[f64]) -> [f64; 4] {
    match *p.as_chunks::<4>().1 {
        [a, b, c] => [a, b, c, 0.0],
        [a, b] => [a, b, 0.0, 0.0],
        [a] => [a, 0.0, 0.0, 0.0],
        _ => [0.0; 4],
    }
}

/// Evaluates `p(x)`, `p′(x)` and `p″(x)`, four coefficients side by side: `p = Σ_l xˡ s_l(x⁴)`. Horner's rule would make each operation
/// wait for the last. No product is fused: all instruction sets give the same bits, and so do a step and the leap in its place.
#[inline(always)]
pub(crate) fn eval_with_derivatives(p: &[f64], x: f64) -> [f64; 3] {
    let (square, cube) = (x * x, x * x * x);
    let (fourth, mut s, mut slopes, mut bends) = (square * square, top(p), [0.0; 4], [0.0; 4]);
    for four in p.as_chunks::<4>().0.iter().rev() {
        for l in 0..4 {
            bends[l] = bends[l] * fourth + slopes[l];
            slopes[l] = slopes[l] * fourth + s[l];
            s[l] = s[l] * fourth + four[l];
        }
    }
    // xˡ and its derivatives; the second derivative of s is twice `bends`.
    let (w, w1, w2) = ([1.0, x, square, cube], [0.0, 1.0, 2.0 * x, 3.0 * square], [0.0, 0.0, 2.0, 6.0 * x]);
    let mut terms = [[0.0; 4]; 3];
    for l in 0..4 {
        terms[0][l] = w[l] * s[l];
        terms[1][l] = w1[l] * s[l] + 4.0 * cube * (w[l] * slopes[l]);
        let by_slope = 8.0 * cube * w1[l] + 12.0 * square * w[l];
        terms[2][l] = w2[l] * s[l] + by_slope * slopes[l] + 32.0 * (cube * cube) * (w[l] * bends[l]);
    }
    terms.map(|[a, b, c, d]| (a + b) + (c + d))
}

/// Evaluates `(p(x), p′(x))` by Horner's rule.
#[must_use]
pub fn eval_with_slope(p: &[f64], x: f64) -> (f64, f64) {
    p.iter().rev().fold((0.0, 0.0), |(s, d), c| (s * x + c, d * x + s))
}

/// Highest degree that these routines accept.
pub const MAX_DEGREE: usize = 40;

/// Replaces `p(θ)` by `p(low + width θ)`.
pub fn shift(p: &mut [f64], low: f64, width: f64) {
    if low != 0.0 {
        for level in 1..p.len() {
            for k in (level..p.len()).rev() {
                p[k - 1] += low * p[k];
            }
        }
    }
    if width != 1.0 {
        let mut power = 1.0;
        for c in p {
            *c *= power;
            power *= width;
        }
    }
}

/// `1/(k + 1)`: the integral of the power `k` over `[0, 1]`.
static INTEGRALS: [f64; 2 * MAX_DEGREE + 1] = {
    let mut table = [1.0; 2 * MAX_DEGREE + 1];
    let mut k = 1;
    while k < table.len() {
        table[k] = 1.0 / (k + 1) as f64;
        k += 1;
    }
    table
};

/// Computes `∫₀¹ p xˡ dx` for each l, for degrees of at most 80 together: the integral of `p q` is the [`dot`] product with q.
pub fn moments(p: &[f64], moments: &mut [f64]) {
    if let [constant] = p {
        moments.iter_mut().zip(&INTEGRALS).for_each(|(moment, integral)| *moment = constant * integral);
        return;
    }
    for (l, moment) in moments.iter_mut().enumerate() {
        *moment = dot(p, &INTEGRALS[l..]);
    }
}

/// Returns `Σ a_k b_k` over the shorter slice, four terms side by side.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let length = a.len().min(b.len());
    let ((a, a_rest), (b, b_rest)) = (a[..length].as_chunks::<4>(), b[..length].as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for l in 0..4 {
            sums[l] += a[l] * b[l];
        }
    }
    a_rest.iter().zip(b_rest).fold((sums[0] + sums[1]) + (sums[2] + sums[3]), |sum, (a, b)| sum + a * b)
}
