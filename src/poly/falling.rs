//! Bernstein polynomials of degree 19 or 23 on `[0, 1]`, four coefficients side by side: their values, and the zero of a function that
//! falls once, isolated by the signs of its coefficients.
//!
//! A function is `f(t) = s + t p(t)`, with s its value at the start and p the polynomial. After an exact zero, s = 0, only p is tested: the
//! zero at the start is divided out.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler unrolls

use super::bernstein::{INVERSE_BINOMIALS, crossing};
use crate::vectors::{Path, fused};

/// Bernstein coefficients in F vectors of four, of degree 4F − 1.
pub(crate) type Row<P, const F: usize> = [<P as Path>::Four; F];

/// Bernstein coefficients as plain numbers.
pub(crate) type Numbers<const F: usize> = [[f64; 4]; F];

/// Largest number of vectors of four in a row.
pub(crate) const MOST_FOURS: usize = 6;
/// Number of coefficients of the largest row.
const MOST: usize = 4 * MOST_FOURS;

/// Pattern of the signs of the Bernstein coefficients of a function on `[0, 1]`, up to an uncertainty of its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// All coefficients are above the uncertainty, and so are all values.
    Clear,
    /// Coefficients above the uncertainty, at most one undecided, then coefficients below its negative: one zero, a fall.
    Falls,
    /// Anything else.
    Unclear,
}

/// Tables for rows of F vectors of four.
struct Tables<const F: usize>;

impl<const F: usize> Tables<F> {
    /// Degree.
    const LAST: usize = 4 * F - 1;
    /// `(i + 1)/(n + 1)`, n the degree: coefficient i + 1 of `t p` is that times `p_i`.
    const SHARES: Numbers<F> = {
        let mut table = [[0.0; 4]; F];
        let mut i = 0;
        while i < 4 * F {
            table[i / 4][i % 4] = (i + 1) as f64 / (4 * F) as f64;
            i += 1;
        }
        table
    };
    /// `C(n, i)`.
    const BINOMIALS: Numbers<F> = {
        let mut table = [[0.0; 4]; F];
        let mut i = 0;
        while i < 4 * F {
            table[i / 4][i % 4] = 1.0 / INVERSE_BINOMIALS[Self::LAST][i];
            i += 1;
        }
        table
    };
    /// `C(n + 1, i + 1)`.
    const RAISED: Numbers<F> = {
        let (mut table, mut i, mut binomial) = ([[0.0; 4]; F], 0, 1.0);
        while i < 4 * F {
            // A whole number: product and quotient are exact.
            binomial = binomial * (4 * F - i) as f64 / (i + 1) as f64;
            table[i / 4][i % 4] = binomial;
            i += 1;
        }
        table
    };
    /// Index i: the power of `u` from the left end.
    const INDICES: Numbers<F> = {
        let mut table = [[0.0; 4]; F];
        let mut i = 0;
        while i < 4 * F {
            table[i / 4][i % 4] = i as f64;
            i += 1;
        }
        table
    };
}

/// Loads a row of numbers into vectors of four.
#[inline(always)]
pub(crate) fn fours<P: Path, const F: usize>(path: P, row: &Numbers<F>) -> Row<P, F> {
    let mut all = [path.all(0.0); F];
    for (four, row) in all.iter_mut().zip(row) {
        *four = path.four(*row);
    }
    all
}

/// Returns the numbers of a row.
#[inline(always)]
pub(crate) fn numbers<P: Path, const F: usize>(path: P, row: &Row<P, F>) -> Numbers<F> {
    let mut numbers = [[0.0; 4]; F];
    for (four, row) in numbers.iter_mut().zip(row) {
        *four = path.numbers(*row);
    }
    numbers
}

/// Returns the sum of four numbers.
#[inline(always)]
fn total([a, b, c, d]: [f64; 4]) -> f64 {
    (a + b) + (c + d)
}

/// Function `s + t p`, with start s and p = `sign` times a row.
pub(crate) struct Signed<'r, P: Path, const F: usize> {
    pub start: f64,
    pub sign: f64,
    pub row: &'r Row<P, F>,
}

/// Returns the pattern of `s + t p` on `[0, 1]` with values known to `uncertainty`, and a place. For a fall this is its approximate place,
/// for an unclear pattern the place where the coefficients rise above the uncertainty again.
#[inline(always)]
pub(crate) fn pattern<P: Path, const F: usize>(path: P, of: &Signed<'_, P, F>, uncertainty: f64) -> (Pattern, f64) {
    let Signed { start, row, .. } = *of;
    let (sign, high, low) = (path.all(of.sign), path.all(uncertainty), path.all(-uncertainty));
    let shares = Tables::<F>::SHARES;
    let is_whole = start != 0.0;
    let (mut b, mut above, mut below) = (*row, u32::from(start > uncertainty), u32::from(start < -uncertainty));
    for i in 0..F {
        let by = if is_whole { path.times(sign, path.four(shares[i])) } else { sign };
        b[i] = path.fused(row[i], by, path.all(start));
        above |= path.above(b[i], high) << (4 * i + 1);
        below |= path.above(low, b[i]) << (4 * i + 1);
    }
    if !is_whole {
        (above, below) = (above >> 1, below >> 1);
    }
    let count = 4 * F as u32 + u32::from(is_whole);
    let falling = (above.trailing_ones(), (below << (u32::BITS - count)).leading_ones());
    if falling.0 == count {
        return (Pattern::Clear, f64::NAN);
    }
    if falling.0 == 0 || falling.1 == 0 || falling.0 + falling.1 + 1 < count {
        let again = (above >> falling.0).trailing_zeros().min(count - falling.0) + falling.0;
        return (Pattern::Unclear, f64::from(again) / f64::from(count));
    }
    let mut points = [start; MOST + 1];
    for i in 0..F {
        points[4 * i + usize::from(is_whole)..][..4].copy_from_slice(&path.numbers(b[i]));
    }
    // The sign of the coefficient that may be undecided decides.
    let first = falling.0 as usize;
    (Pattern::Falls, crossing(&points[..count as usize], first + usize::from(points[first] >= 0.0)))
}

/// Returns whether all coefficients of `s + t p` are above the `uncertainty` because no coefficient of `p` outweighs s.
#[inline(always)]
pub(crate) fn stays_above<P: Path, const F: usize>(path: P, start: f64, row: &Row<P, F>, uncertainty: f64) -> bool {
    let (room, mut below) = (path.all(start - uncertainty), 0b1111);
    for four in row {
        below &= path.above(room, path.sizes(*four));
    }
    below == 0b1111
}

/// Returns the largest size of `s + t p` at its control points up to `end`. Control point i lies at i over the number of points.
#[inline(always)]
pub(crate) fn largest<P: Path, const F: usize>(path: P, start: f64, row: &Row<P, F>, end: f64) -> f64 {
    let (start, mut most) = (path.all(start), path.all(start.abs()));
    let reached = ((end * (4 * F) as f64) as usize + 1).div_ceil(4).min(F);
    for (four, shares) in row[..reached].iter().zip(&Tables::<F>::SHARES) {
        most = path.larger(path.sizes(path.fused(*four, path.four(*shares), start)), most);
    }
    path.numbers(most).into_iter().fold(0.0, f64::max)
}

/// Ends of the intervals `[0, t]` to which a polynomial may be restricted.
pub(crate) const PARTS: [f64; 3] = [0.5, 0.25, 0.125];

/// Shares `C(i, j) tʲ (1 − t)ⁱ⁻ʲ` of coefficient j in coefficient i on `[0, t]`, by part, j and i, for any degree. They are whole numbers
/// over powers of two. They are exact, except those of the eighth from i = 19 on: their errors together are 0.6 ε.
static ON_PARTS: [[[f64; MOST]; MOST]; PARTS.len()] = {
    let mut all = [[[0.0; MOST]; MOST]; PARTS.len()];
    let mut number = 0;
    while number < PARTS.len() {
        let (t, mut i) = (PARTS[number], 0);
        while i < MOST {
            let (mut j, mut power) = (0, 1.0);
            while j < i {
                power *= 1.0 - t;
                j += 1;
            }
            let (mut j, mut binomial) = (0, 1.0);
            while j <= i {
                all[number][j][i] = binomial * power;
                binomial = binomial * (i - j) as f64 / (j + 1) as f64;
                power = power / (1.0 - t) * t;
                j += 1;
            }
            i += 1;
        }
        number += 1;
    }
    all
};

/// Returns the rounding of one of `count` coefficients on a part, in units of ε times the largest coefficient: half a unit for each sum,
/// half a unit for all products, and one for the errors of the shares.
const fn roundings(count: usize) -> f64 {
    0.5 * count as f64 + 1.5
}

/// Returns the row of `t p(t)` on `[0, PARTS[number]]`, and a bound on its rounding.
#[inline(always)]
pub(crate) fn restrict<P: Path, const F: usize>(path: P, row: &Row<P, F>, number: usize) -> (Row<P, F>, f64) {
    let (mut sums, mut most, from) = ([path.all(0.0); F], path.all(0.0), numbers(path, row));
    for (b, column) in from.as_flattened().iter().zip(&ON_PARTS[number]) {
        let (b, column) = (path.all(*b), column.as_chunks::<4>().0);
        for i in 0..F {
            sums[i] = path.fused(path.four(column[i]), b, sums[i]);
        }
    }
    let by = path.all(PARTS[number]);
    for i in 0..F {
        most = path.larger(path.sizes(row[i]), most);
        sums[i] = path.times(by, sums[i]);
    }
    let most = path.numbers(most).into_iter().fold(0.0, f64::max);
    (sums, PARTS[number] * f64::EPSILON * roundings(4 * F) * most)
}

/// Bernstein polynomials of degree n at a place: `B_i(t) = C(n, i) tⁱ (1 − t)ⁿ⁻ⁱ`.
pub(crate) struct BernsteinBasis<P: Path, const F: usize> {
    /// Values without the common factor `weight`.
    basis: Row<P, F>,
    far: f64,
}

impl<P: Path, const F: usize> BernsteinBasis<P, F> {
    /// Evaluates the Bernstein polynomials at `t`.
    #[inline(always)]
    pub fn new(path: P, t: f64) -> Self {
        let is_left = t <= 0.5;
        // Powers do not multiply the rounding of a distance that is a double.
        let rest = 1.0 - t;
        let (near, far) = if is_left { (1.0 - rest, rest) } else { (rest, 1.0 - rest) };
        let u = near / far;
        let (square, fours) = (u * u, Tables::<F>::BINOMIALS);
        let (rising, fourth) = ([1.0, u, square, square * u], path.all(square * square));
        let mut powers = path.four(if is_left { rising } else { [rising[3], rising[2], u, 1.0] });
        let mut basis = [powers; F];
        for i in 0..F {
            let at = if is_left { i } else { F - 1 - i };
            basis[at] = path.times(powers, path.four(fours[at]));
            powers = path.times(powers, fourth);
        }
        Self { basis, far }
    }

    /// Returns the factor that [`value`](Self::value) omits: `(1 − t)ⁿ`, or `tⁿ` nearer to that end.
    #[inline(always)]
    pub fn weight(&self) -> f64 {
        let product = |a: [f64; 2], b: [f64; 2]| {
            let high = a[0] * b[0];
            [high, a[0].mul_add(b[0], -high) + fused::<P>(a[0], b[1], a[1] * b[0])]
        };
        let one = [self.far, 0.0];
        let two = product(one, one);
        let four = product(two, two);
        let eight = product(four, four);
        let three = product(two, one);
        // 4F − 1 = 16 + 4(F − 5) + 3.
        let all = product(product(eight, eight), if F == MOST_FOURS { product(four, three) } else { three });
        all[0] + all[1]
    }

    /// Returns `Σ b_i B_i(t)` divided by the weight.
    #[inline(always)]
    pub fn value(&self, path: P, row: &Row<P, F>) -> f64 {
        let mut sums = path.times(row[0], self.basis[0]);
        for i in 1..F {
            sums = path.fused(row[i], self.basis[i], sums);
        }
        total(path.numbers(sums))
    }
}

/// Maximum number of iterations of Halley's method; two usually suffice from the first guess.
const ITERATIONS: usize = 32;

/// Longest last step, relative to the place x. If `x² p‴` is below a hundred slopes, the remaining error is below a tenth of a unit in the
/// last place. The error is of third order: the square of the relative change of the slope times the step must be below rounding.
const SETTLED: f64 = 1e-6;

/// Function f in scaled Bernstein form, by the ratio u of the distances from both ends (Farouki and Rajan 1988).
///
/// From the left end u is `t/(1 − t)`, and `f = (1 − t)ᴺ (s + Σ_i c_i uⁱ⁺¹)`. After an exact zero `p = (1 − t)ᴺ Σ_i c_i uⁱ`. From the right
/// end u is `(1 − t)/t`, and powers count down.
struct ScaledBernstein<P: Path, const F: usize> {
    /// The terms `c_i`, and the same times their exponents and the squares of their exponents.
    rows: [Row<P, F>; 3],
    is_left: bool,
    /// The start s; 0 after an exact zero.
    start: f64,
    /// Degree N.
    degree: f64,
}

/// Terms of Halley's method at a ratio u of the distances.
struct RatioTerms {
    /// `f`, `u f_u` and `u² f_uu`, over `(1 − t)ᴺ`, or `tᴺ` from the right end.
    f: [f64; 3],
    /// `1/(1 + u)`.
    far: f64,
}

impl<P: Path, const F: usize> ScaledBernstein<P, F> {
    #[inline(always)]
    fn new(path: P, of: &Signed<'_, P, F>, is_left: bool) -> Self {
        let (row, sign, start) = (of.row, path.all(of.sign), path.all(of.start));
        let tables = [&Tables::<F>::BINOMIALS, &Tables::<F>::RAISED, &Tables::<F>::INDICES];
        let [binomials, raised, indices] = tables.map(|table| fours(path, table));
        let is_whole = of.start != 0.0;
        let (last, whole) = (path.all(Tables::<F>::LAST as f64), path.all(f64::from(u8::from(is_whole))));
        let mut rows = [[path.all(0.0); F]; 3];
        for i in 0..F {
            rows[0][i] = path.fused(start, raised[i], path.times(path.times(sign, row[i]), binomials[i]));
            let exponent = if is_left { path.plus(indices[i], whole) } else { path.minus(last, indices[i]) };
            rows[1][i] = path.times(rows[0][i], exponent);
            rows[2][i] = path.times(rows[1][i], exponent);
        }
        Self { rows, is_left, start: of.start, degree: (Tables::<F>::LAST + usize::from(is_whole)) as f64 }
    }

    /// Evaluates the terms at the ratio `u` of the near distance to the far one.
    #[inline(always)]
    fn at(&self, path: P, u: f64) -> RatioTerms {
        let Self { rows, is_left, start, degree } = self;
        let square = u * u;
        let quartic = square * square;
        let (fourth, eighth) = (path.all(quartic), path.all(quartic * quartic));
        let first = if *is_left && *start != 0.0 { u } else { 1.0 };
        let rising = [first, first * u, first * square, first * square * u];
        let low = path.four(if *is_left { rising } else { [rising[3], rising[2], u, 1.0] });
        let mut sums = [0.0; 3];
        for (sum, row) in sums.iter_mut().zip(rows) {
            let at = |i: usize| if *is_left { row[i] } else { row[F - 1 - i] };
            // Pairs first: the chain of products is shorter.
            let pair = |i: usize| if i + 1 < F { path.fused(at(i + 1), fourth, at(i)) } else { at(i) };
            let last = (F - 1) / 2 * 2;
            let mut all = pair(last);
            for i in (0..last).rev().step_by(2) {
                all = path.fused(all, eighth, pair(i - 1));
            }
            *sum = total(path.numbers(path.times(all, low)));
        }
        if *is_left {
            sums[0] += start;
        } else if *start != 0.0 {
            let mut top = *start;
            (0..F).for_each(|_| top *= quartic);
            sums = [sums[0] + top, fused::<P>(*degree, top, sums[1]), fused::<P>(degree * degree, top, sums[2])];
        }
        let [value, first, second] = sums;
        let far = 1.0 / (1.0 + u);
        // Minus the derivative of the logarithm of `(1 + u)⁻ᴺ` by log u.
        let (near, decay) = (u * far, u * far * degree);
        let f = [
            value,
            fused::<P>(-decay, value, first),
            fused::<P>(-2.0 * decay, first, second - first) + decay * (decay + near) * value,
        ];
        RatioTerms { f, far }
    }

    /// Returns `(1 − t)ᴺ⁻²`, or `tᴺ⁻²` from the right end, N the degree, from the far distance.
    #[inline(always)]
    fn weight(&self, far: f64) -> f64 {
        let two = far * far;
        let four = two * two;
        let eight = four * four;
        // N is 4F, or 4F − 1 after an exact zero.
        let rest = if self.start != 0.0 { two } else { far };
        (eight * eight) * if F == MOST_FOURS { four * rest } else { rest }
    }
}

/// Largest ratio of the distances, far beyond a rough guess: squares of its powers remain in the range of numbers.
const FARTHEST: f64 = 1e5;

/// Returns the zero of `s + t p` on `[0, until]`, a fall by [`Falls`](Pattern::Falls), from a `guess`, with value and slope there (of `p`
/// if `s` is zero). `None` if Halley's method does not converge.
///
/// Halley's step leads to the zero of a fractional linear function: it is the same in t and in the ratio u. Terms in u have shorter chains
/// of operations.
#[inline(always)]
pub(crate) fn fall<P: Path, const F: usize>(
    path: P,
    of: &Signed<'_, P, F>,
    guess: f64,
    until: f64,
) -> Option<(f64, [f64; 2])> {
    let is_left = guess <= 0.5;
    let series = ScaledBernstein::new(path, of, is_left);
    let ratio = |t: f64| (if is_left { t / (1.0 - t) } else { (1.0 - t) / t }).min(FARTHEST);
    let place = |u: f64| if is_left { u / (1.0 + u) } else { 1.0 / (1.0 + u) };
    // Ratios before and after the fall.
    let (mut u, mut before, mut after) = (ratio(guess), ratio(0.0), ratio(until));
    for _ in 0..ITERATIONS {
        let RatioTerms { f: [value, slope, bent], far } = series.at(path, u);
        let by = -2.0 * value * slope / (2.0 * slope * slope - value * bent);
        let next = fused::<P>(u, by, u);
        // Step relative to t or to the distance of t from 1, the smaller one, and the relative change of the slope by t.
        let step = by * far * if is_left { u.max(1.0) } else { u };
        let share = by * (bent / slope + 2.0 * u * far);
        if step.abs() <= SETTLED && share * share * step.abs() <= 0.25 * f64::EPSILON {
            let weight = series.weight(far);
            let side = if is_left { weight } else { -weight };
            let residual = value + by * (slope + 0.5 * by * bent);
            return Some((place(next), [weight * far * far * residual, side * slope / u * (1.0 + share)]));
        }
        *(if value > 0.0 { &mut before } else { &mut after }) = u;
        let is_between = next > before.min(after) && next < before.max(after);
        u = if is_between { next } else { ratio(0.5 * (place(before) + place(after))) };
    }
    None
}

#[cfg(test)]
#[path = "../../tests/unit/falling.rs"]
mod tests;
