//! Bernstein form on `[0, 1]`.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use super::MAX_DEGREE;
use crate::vectors::{Baseline, Path};

/// Degree of the first test.
const LOW: usize = 6;

/// Rounding of a sum of some forty terms relative to the sum of their sizes.
const MARGIN: f64 = 64.0 * f64::EPSILON;

/// Bernstein coefficients of `1, x, …, x⁶` in degree 6, padded to eight lanes by repeating the last.
const LOW_BASIS: [[f64; 8]; LOW + 1] = {
    let mut basis = [[0.0; 8]; LOW + 1];
    let mut k = 0;
    while k <= LOW {
        let mut i = k;
        while i < 8 {
            // C(i, k)/C(n, k); the last lane repeats the one before it.
            let at = if i > LOW { LOW } else { i };
            let (mut ratio, mut l) = (1.0, 0);
            while l < k {
                ratio *= (at - l) as f64 / (LOW - l) as f64;
                l += 1;
            }
            basis[k][i] = ratio;
            i += 1;
        }
        k += 1;
    }
    basis
};

/// Bounds on the sums that the terms of four polynomials add to their constants on `[0, 1]`.
#[derive(Clone, Copy)]
pub(crate) struct FourRanges<P: Path> {
    /// Least and largest sum.
    pub range: [P::Four; 2],
    /// Sums of the sizes of the terms.
    pub sizes: P::Four,
}

impl<P: Path> FourRanges<P> {
    /// Bounds the polynomials `Σ_{k≥1} rows_k powers_k θᵏ`: by the Bernstein coefficients of the low degrees, and the sizes of the others.
    #[inline(always)]
    pub fn new<const N: usize, const M: usize>(path: P, rows: &[[f64; 4]; N], powers: &[f64; M]) -> Self {
        let zero = path.all(0.0);
        let [mut low_sizes, mut high_sizes, mut least, mut most] = [zero; 4];
        let mut sums = [zero; LOW];
        for k in 1..=LOW {
            let term = path.times(path.four(rows[k]), path.all(powers[k]));
            low_sizes = path.plus(low_sizes, path.sizes(term));
            for i in 0..LOW {
                sums[i] = path.fused(path.all(LOW_BASIS[k][i + 1]), term, sums[i]);
            }
        }
        for k in LOW + 1..N {
            high_sizes = path.plus(high_sizes, path.sizes(path.times(path.four(rows[k]), path.all(powers[k]))));
        }
        for i in 0..LOW {
            most = path.larger(sums[i], most);
            least = path.larger(path.minus(zero, sums[i]), least);
        }
        let range = [path.minus(path.minus(zero, least), high_sizes), path.plus(most, high_sizes)];
        Self { range, sizes: path.plus(low_sizes, high_sizes) }
    }
}

/// Returns the Bernstein coefficients of a polynomial of degree 6 at most, plus `start`.
#[inline(always)]
fn low_coefficients(low: &[f64], start: f64) -> [f64; 8] {
    let mut b = [start; 8];
    for (c, basis) in low.iter().zip(&LOW_BASIS) {
        for l in 0..8 {
            b[l] += c * basis[l];
        }
    }
    b
}

/// Returns whether `p` is proven positive: the Bernstein coefficients of the low-degree part exceed the sum of the other terms.
#[inline(always)]
pub(crate) fn certainly_positive(p: &[f64], uncertainty: f64) -> bool {
    let (low, high) = p.split_at(p.len().min(LOW + 1));
    let mut sums = [0.0; 4];
    let fours = high.chunks_exact(4);
    let rest: f64 = fours.remainder().iter().fold(uncertainty, |s, c| s + c.abs());
    for four in fours {
        for l in 0..4 {
            sums[l] += four[l].abs();
        }
    }
    let rest = rest + (sums[0] + sums[1]) + (sums[2] + sums[3]);
    if low[0] <= rest {
        return false;
    }
    // Usually not even the sum of the sizes of all terms reaches it.
    if low[0] > low[1..].iter().fold(rest, |s, c| s + c.abs()) {
        return true;
    }
    low_coefficients(low, -rest).iter().all(|b| *b > 0.0)
}

/// Returns an upper and a lower bound on the values of `p` on `[0, 1]`: the Bernstein coefficients of its low-degree part, the sum of the
/// sizes of its other terms, and the rounding of these sums.
pub(crate) fn bounds(p: &[f64]) -> [f64; 2] {
    let (low, high) = p.split_at(p.len().min(LOW + 1));
    let rest = high.iter().fold(0.0, |sum, c| sum + c.abs());
    let b = low_coefficients(low, 0.0);
    let rest = rest + MARGIN * low.iter().fold(rest, |sum, c| sum + c.abs());
    [b.iter().fold(b[0], |m, b| m.max(*b)) + rest, b.iter().fold(b[0], |m, b| m.min(*b)) - rest]
}

/// A polynomial of degree `n` by its Bernstein coefficients `b_0 … b_n` on some interval.
#[derive(Clone, Copy)]
pub(super) struct Bernstein {
    pub n: usize,
    pub b: [f64; MAX_DEGREE + 1],
}

/// `1/C(n, k)`.
pub(super) static INVERSE_BINOMIALS: [[f64; MAX_DEGREE + 1]; MAX_DEGREE + 1] = {
    let mut table = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    let mut n = 0;
    while n <= MAX_DEGREE {
        let (mut k, mut binomial) = (0, 1.0);
        while k <= n {
            table[n][k] = 1.0 / binomial;
            binomial *= (n - k) as f64 / (k + 1) as f64;
            k += 1;
        }
        n += 1;
    }
    table
};

/// Number of vectors of four that hold the coefficients of a polynomial.
const FOURS: usize = MAX_DEGREE / 4 + 1;

/// `C(i, k)` for four i from a multiple of four on, and each k; zero for `i < k`.
static BINOMIALS: [[[f64; 4]; MAX_DEGREE + 1]; FOURS] = {
    let mut table = [[[0.0; 4]; MAX_DEGREE + 1]; FOURS];
    let mut k = 0;
    while k <= MAX_DEGREE {
        let (mut i, mut binomial) = (k, 1.0);
        while i < 4 * FOURS {
            table[i / 4][k][i % 4] = binomial;
            binomial = binomial * (i + 1) as f64 / (i + 1 - k) as f64;
            i += 1;
        }
        k += 1;
    }
    table
};

/// Result of a test of the signs of all Bernstein coefficients.
pub(super) enum Signs {
    /// All coefficients are above the uncertainty.
    Above,
    /// The signs change once, and the last coefficient is below −uncertainty: one zero, a fall. The value is its approximate place.
    Fall(f64),
    /// Anything else.
    Mixed,
}

/// Number of fours of the longest polynomial whose coefficients are formed all at once.
const FEW: usize = 7;

/// Returns the Bernstein coefficients of `p` on `[0, limit]`; `p` has power coefficients and a degree below 4 N. The rest is padding.
///
/// `b_i = Σ_{k≤i} C(i,k)/C(n,k) p_k`; binomials are exact and every factor is at most one, so the rounding error of each coefficient is
/// at most `n ε Σ|p_k|`. No product is fused: all sets of instructions give the same bits.
#[inline(always)]
fn sums<P: Path, const N: usize>(path: P, p: &[f64], limit: f64) -> [P::Four; N] {
    let (mut sums, mut power) = ([path.all(0.0); N], 1.0);
    for (k, (c, inverse)) in p.iter().zip(&INVERSE_BINOMIALS[p.len() - 1]).enumerate() {
        let scaled = path.all(c * power * inverse);
        power *= limit;
        for (sum, binomials) in sums.iter_mut().zip(&BINOMIALS) {
            *sum = path.plus(*sum, path.times(scaled, path.four(binomials[k])));
        }
    }
    sums
}

/// Returns the signs of the Bernstein coefficients of `p` on `[0, limit]`.
#[inline(always)]
pub(super) fn signs<P: Path>(path: P, p: &[f64], limit: f64, uncertainty: f64) -> Signs {
    let n = p.len() - 1;
    if n >= 4 * FEW {
        return Signs::Mixed;
    }
    let sums: [P::Four; FEW] = sums(path, p, limit);
    let (high, zero, low) = (path.all(uncertainty), path.all(0.0), path.all(-uncertainty));
    let [mut above, mut positive, mut negative, mut below] = [0u32; 4];
    let mut b = [[0.0; 4]; FEW];
    for (i, (sum, b)) in sums.into_iter().zip(&mut b).enumerate() {
        above |= path.above(sum, high) << (4 * i);
        positive |= path.above(sum, zero) << (4 * i);
        negative |= path.above(zero, sum) << (4 * i);
        below |= path.above(low, sum) << (4 * i);
        *b = path.numbers(sum);
    }
    let all = u32::MAX >> (31 - n);
    (positive, negative) = (positive & all, negative & all);
    if above & all == all {
        return Signs::Above;
    }
    let first = negative.trailing_zeros();
    if negative == 0 || positive == 0 || positive.ilog2() > first || below >> n & 1 == 0 {
        return Signs::Mixed;
    }
    Signs::Fall(crossing(&b.as_flattened()[..=n], first as usize))
}

/// Returns the approximate place in `[0, 1]` at which the polynomial with the coefficients `b` falls. Its control polygon falls before
/// coefficient `i ≥ 1`. The polynomial differs from the polygon by `t (1 − t)/2n` times the second derivative of the polygon, n the degree.
#[inline(always)]
pub(super) fn crossing(b: &[f64], i: usize) -> f64 {
    let (before, after) = (b[i - 1], b[i]);
    let (fall, cell) = (before - after, ((b.len() - 1) as f64).recip());
    let t = ((i - 1) as f64 + if fall > 0.0 { before / fall } else { 0.5 }) * cell;
    let bent = match i {
        _ if i + 1 < b.len() => before - 2.0 * after + b[i + 1],
        _ if i > 1 => b[i - 2] - 2.0 * before + after,
        _ => return t,
    };
    let by = 0.5 * t * (1.0 - t) * (bent / fall);
    if by.abs() <= cell { (t + by).clamp(0.0, 1.0) } else { t }
}

impl Bernstein {
    /// Converts power coefficients on `[0, limit]`.
    pub fn from_power(p: &[f64], limit: f64) -> Self {
        let (n, mut b) = (p.len() - 1, [0.0; MAX_DEGREE + 1]);
        // Fewer vectors give the same bits.
        if n < 4 * FEW {
            let sums: [[f64; 4]; FEW] = sums(Baseline, p, limit);
            b[..=n].copy_from_slice(&sums.as_flattened()[..=n]);
        } else {
            let sums: [[f64; 4]; FOURS] = sums(Baseline, p, limit);
            b[..=n].copy_from_slice(&sums.as_flattened()[..=n]);
        }
        Self { n, b }
    }

    pub fn coefficients(&self) -> &[f64] {
        &self.b[..=self.n]
    }

    /// Returns the number of sign changes among the coefficients, zeros skipped, counted up to 2.
    pub fn sign_changes(&self) -> u32 {
        let (mut last, mut changes) = (0.0, 0);
        for &c in self.coefficients() {
            if c != 0.0 {
                if last != 0.0 && (c > 0.0) != (last > 0.0) {
                    changes += 1;
                    if changes == 2 {
                        break;
                    }
                }
                last = c;
            }
        }
        changes
    }

    /// Splits at the middle by de Casteljau's scheme: `self` becomes the left half, and the right half is returned.
    pub fn split(&mut self) -> Self {
        let n = self.n;
        let mut right = [0.0; MAX_DEGREE + 1];
        for j in 0..=n {
            right[n - j] = self.b[n];
            for i in (j + 1..=n).rev() {
                self.b[i] = 0.5 * (self.b[i] + self.b[i - 1]);
            }
        }
        Self { n, b: right }
    }

    /// Returns the approximate place of the first fall, in `[0, 1]`: a first guess of a single root.
    pub fn crossing(&self) -> f64 {
        let b = self.coefficients();
        crossing(b, b.iter().position(|c| *c < 0.0).unwrap_or(self.n).max(1))
    }

    pub fn first_sign(&self) -> f64 {
        self.coefficients().iter().copied().find(|c| *c != 0.0).unwrap_or(0.0)
    }

    pub fn largest(&self) -> f64 {
        self.coefficients().iter().fold(0.0, |m, c| c.abs().max(m))
    }
}

#[cfg(test)]
#[path = "../../tests/unit/bernstein.rs"]
mod tests;
