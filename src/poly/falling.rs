//! Bernstein polynomials on `[0, 1]` in rows of fixed length: their values, and the zero of one that falls once, told by the signs of its
//! coefficients.

use super::bernstein::INVERSE_BINOMIALS;
use crate::vectors::{Path, fused};

/// Room of a row: whole vectors of four. A row of degree n has n + 1 coefficients, the others are zero.
pub(crate) const LENGTH: usize = 24;

/// Bernstein coefficients.
pub(crate) type Row = [f64; LENGTH];

/// What the signs of Bernstein coefficients tell of a polynomial on `[0, 1]`, up to an uncertainty of its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// All coefficients are above the uncertainty, and so are all values.
    Clear,
    /// Coefficients above it, at most one that is neither, coefficients below its negative: one zero, and it is a fall.
    Falls,
    /// Anything else.
    Unclear,
}

/// The pattern of the Bernstein coefficients `b` of a polynomial whose values are known to `uncertainty`.
pub(crate) fn pattern(b: &[f64], uncertainty: f64) -> Pattern {
    let above = b.iter().take_while(|c| **c > uncertainty).count();
    if above == b.len() {
        return Pattern::Clear;
    }
    let below = b[above..].iter().rev().take_while(|c| **c < -uncertainty).count();
    if above > 0 && below > 0 && above + below + 1 >= b.len() { Pattern::Falls } else { Pattern::Unclear }
}

/// Replaces the Bernstein coefficients on `[0, 1]` by those on `[0, ½]`.
pub(crate) fn halve(b: &mut [f64]) {
    for j in 1..b.len() {
        for i in (j..b.len()).rev() {
            b[i] = 0.5 * (b[i] + b[i - 1]);
        }
    }
}

/// `C(n, i)` in rows.
static BINOMIALS: [Row; LENGTH] = {
    let mut rows = [[0.0; LENGTH]; LENGTH];
    let mut n = 0;
    while n < LENGTH {
        let mut i = 0;
        while i <= n {
            rows[n][i] = 1.0 / INVERSE_BINOMIALS[n][i];
            i += 1;
        }
        n += 1;
    }
    rows
};

/// `uⁱ`, four side by side.
#[inline(always)]
fn powers(u: f64) -> Row {
    let square = u * u;
    let (mut four, fourth) = ([1.0, u, square, square * u], square * square);
    let mut row = [0.0; LENGTH];
    for powers in row.as_chunks_mut::<4>().0 {
        *powers = four;
        four.iter_mut().for_each(|power| *power *= fourth);
    }
    row
}

/// The Bernstein polynomials of one degree at a place: `B_i(t) = C(n, i) tⁱ (1 − t)ⁿ⁻ⁱ`.
pub(crate) struct Place {
    /// Without the factor that is `weight`.
    basis: Row,
    nearer: f64,
    n: usize,
}

impl Place {
    /// Those of degree `n` at `t`.
    #[inline(always)]
    pub fn new(t: f64, n: usize) -> Self {
        // The place nearest to t whose distance from 1 is a double: the power n would multiply a rounding of that.
        let rest = 1.0 - t;
        let (is_left, t) = (t <= 0.5, 1.0 - rest);
        let (u, nearer) = if is_left { (t / rest, rest) } else { (rest / t, t) };
        let mut basis = powers(u);
        if !is_left {
            basis[..=n].reverse();
        }
        basis.iter_mut().zip(&BINOMIALS[n]).for_each(|(b, binomial)| *b *= binomial);
        Self { basis, nearer, n }
    }

    /// What [`value`](Self::value) leaves out: `(1 − t)ⁿ`, or `tⁿ` nearer to that end.
    pub fn weight<P: Path>(&self) -> f64 {
        power::<P>(self.nearer, self.n)
    }

    /// `Σ b_i B_i(t)` over the weight; coefficients beyond the last are zero.
    #[inline(always)]
    pub fn value<P: Path>(&self, b: &[f64]) -> f64 {
        let mut sums = [0.0; 4];
        for (b, basis) in b.as_chunks::<4>().0.iter().zip(self.basis.as_chunks::<4>().0) {
            for l in 0..4 {
                sums[l] = fused::<P>(b[l], basis[l], sums[l]);
            }
        }
        total(sums)
    }
}

/// `xⁿ` by squares, each with its rounding.
#[inline(always)]
fn power<P: Path>(x: f64, mut n: usize) -> f64 {
    let product = |a: [f64; 2], b: [f64; 2]| {
        let high = a[0] * b[0];
        [high, a[0].mul_add(b[0], -high) + fused::<P>(a[0], b[1], a[1] * b[0])]
    };
    let (mut power, mut square) = ([1.0, 0.0], [x, 0.0]);
    while n > 0 {
        if n % 2 == 1 {
            power = product(power, square);
        }
        square = product(square, square);
        n /= 2;
    }
    power[0] + power[1]
}

/// Iterations of Newton's method: from the zero of the control polygon three or four are enough.
const NEWTON: usize = 24;
/// A step this short, relative to the place, is the last one: its square is below rounding.
const SETTLED: f64 = 1e-10;

/// `Σ c_i uⁱ` and `Σ i c_i uⁱ`.
#[inline(always)]
fn sums<P: Path>(c: &Row, u: f64) -> [f64; 2] {
    let powers = powers(u);
    let (mut sums, mut moments, mut index) = ([0.0; 4], [0.0; 4], [0.0, 1.0, 2.0, 3.0]);
    for (c, powers) in c.as_chunks::<4>().0.iter().zip(powers.as_chunks::<4>().0) {
        for l in 0..4 {
            let term = c[l] * powers[l];
            sums[l] += term;
            moments[l] = fused::<P>(index[l], term, moments[l]);
            index[l] += 4.0;
        }
    }
    [total(sums), total(moments)]
}

/// The sum of four.
#[inline(always)]
fn total([a, b, c, d]: [f64; 4]) -> f64 {
    (a + b) + (c + d)
}

/// The zero of a polynomial of degree `n` that [`Falls`](Pattern::Falls), by its Bernstein coefficients, and value and slope there;
/// `None` if Newton's method does not settle.
#[inline(always)]
pub(crate) fn fall<P: Path>(b: &Row, n: usize) -> Option<(f64, [f64; 2])> {
    // Where the control polygon falls through zero.
    let i = b.iter().position(|c| *c < 0.0)?.max(1);
    let mut t = ((i - 1) as f64 + b[i - 1] / (b[i - 1] - b[i])) / n as f64;
    // From the nearer end: `p = (1 − t)ⁿ Σ c_i uⁱ`, `u = t/(1 − t)`, and `p′ t (1 − t) = (1 − t)ⁿ Σ (i − n t) c_i uⁱ`.
    let is_left = t <= 0.5;
    let mut c = *b;
    if !is_left {
        c[..=n].reverse();
    }
    c.iter_mut().zip(&BINOMIALS[n]).for_each(|(c, binomial)| *c *= binomial);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..NEWTON {
        // As in `Place`.
        let rest = 1.0 - t;
        let at = 1.0 - rest;
        let (near, far) = if is_left { (at, rest) } else { (rest, at) };
        let [value, moment] = sums::<P>(&c, near / far);
        let slope = (moment - n as f64 * near * value) / (at * rest);
        let slope = if is_left { slope } else { -slope };
        let next = at - value / slope;
        if (next - t).abs() <= SETTLED * t {
            // What is left is of second order in the last step, and its value of first order.
            let weight = power::<P>(far, n);
            return Some((next, [value + slope * (next - at), slope].map(|v| v * weight)));
        }
        if value > 0.0 {
            low = t
        } else {
            high = t
        }
        t = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    None
}
