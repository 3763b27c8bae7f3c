//! Columns of a propagator: contribution of a unit of one input to a quantity over a span, as Bernstein coefficients.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use std::sync::LazyLock;

use super::two::{self, Two};
use crate::{
    hybrid::Wide,
    poly::{MOST_FOURS, Numbers, Row},
    vectors::{Path, Work},
};

/// Maximum number of powers of θ from which a column is formed.
pub const MOST_POWERS: usize = 56;

/// Columns of a quantity, F fours each. If many are zero, only the others are kept, each with the index of its term.
#[derive(Debug)]
pub struct Columns {
    /// Term of each column; `None` if all columns are kept, in order.
    terms: Option<Box<[u8]>>,
    fours: Box<[[f64; 4]]>,
}

/// Share of nonzero columns above which all columns are kept: a look-up of a term takes as long as a few products.
const FULL: f64 = 0.75;

impl Columns {
    /// Forms the list from `all` columns.
    pub fn new(all: &[Numbers<MOST_FOURS>], fours: usize) -> Self {
        let is_other = |term: &usize| largest(&all[*term]) > 0.0;
        let others: Vec<usize> = (0..all.len()).filter(is_other).collect();
        let is_full = others.len() as f64 > FULL * all.len() as f64;
        let kept = if is_full { (0..all.len()).collect() } else { others };
        Self {
            fours: kept.iter().flat_map(|term| &all[*term][..fours]).copied().collect(),
            terms: (!is_full).then(|| kept.iter().map(|term| *term as u8).collect()),
        }
    }

    /// Iterates over the terms and their columns.
    #[inline(always)]
    pub fn iter<const F: usize>(&self) -> impl Iterator<Item = (usize, &Numbers<F>)> {
        let term = |i: usize| self.terms.as_ref().map_or(i, |terms| usize::from(terms[i]));
        self.fours.as_chunks::<F>().0.iter().enumerate().map(move |(i, column)| (term(i), column))
    }

    /// Returns `Σ columns_i z_i`.
    #[inline(always)]
    pub fn combine<P: Path, const F: usize>(&self, path: P, z: &[f64]) -> Row<P, F> {
        let mut row = [path.all(0.0); F];
        let columns = self.fours.as_chunks::<F>().0;
        if let Some(terms) = &self.terms {
            for (term, column) in terms.iter().zip(columns) {
                add(path, z[usize::from(*term)], column, &mut row);
            }
        } else {
            for (z, column) in z.iter().zip(columns) {
                add(path, *z, column, &mut row);
            }
        }
        row
    }
}

#[inline(always)]
fn add<P: Path, const F: usize>(path: P, z: f64, column: &Numbers<F>, row: &mut Row<P, F>) {
    let z = path.all(z);
    for i in 0..F {
        row[i] = path.fused(path.four(column[i]), z, row[i]);
    }
}

/// Returns the size of the largest coefficient.
pub fn largest(column: &[[f64; 4]]) -> f64 {
    column.as_flattened().iter().fold(0.0, |m: f64, c| m.max(c.abs()))
}

/// Bernstein coefficients of the Chebyshev series of the powers of θ, cut after the degree of F fours, and sizes of the cut parts.
struct Powers<const F: usize> {
    high: [Numbers<F>; MOST_POWERS],
    low: [Numbers<F>; MOST_POWERS],
    cut: [f64; MOST_POWERS],
}

static SHORT: LazyLock<Box<Powers<5>>> = LazyLock::new(Powers::new);
static LONG: LazyLock<Box<Powers<6>>> = LazyLock::new(Powers::new);

impl<const F: usize> Powers<F> {
    fn new() -> Box<Self> {
        let count = 4 * F;
        // T_k on [0, 1]: (−1)^(k−i) C(2k, 2i)/C(k, i) in degree k, then raised to the degree of all.
        let mut chebyshev = vec![vec![Wide::default(); count]; count];
        for (k, row) in chebyshev.iter_mut().enumerate() {
            let (mut upper, mut lower) = (1.0, 1.0);
            for i in 0..=k {
                let sign = if (k - i) % 2 == 0 { 1.0 } else { -1.0 };
                row[i] = Wide::quotient((sign * upper).into(), lower);
                let [above, below] = [2 * (k - i), 2 * i].map(|m| m as f64);
                // Binomials below 2⁵³: every product is exact before it is divided.
                upper = (upper * above / (below + 1.0)) * (above - 1.0) / (below + 2.0);
                lower = lower * (0.5 * above) / (0.5 * below + 1.0);
            }
            for degree in k + 1..count {
                let before = row.clone();
                for i in 0..=degree {
                    let kept = before[i] * (degree - i) as f64 + before[i.saturating_sub(1)] * i as f64;
                    row[i] = Wide::quotient(kept, degree as f64);
                }
            }
        }
        let zero = [[[0.0; 4]; F]; MOST_POWERS];
        let mut powers = Box::new(Self { high: zero, low: zero, cut: [0.0; MOST_POWERS] });
        // θᵐ = Σ a_k T_k, from θ T_k = (T_{k+1} + 2 T_k + T_{|k−1|})/4.
        let mut a = [Wide::default(); MOST_POWERS + 1];
        a[0] = 1.0.into();
        for m in 0..MOST_POWERS {
            for i in 0..count {
                let sum = (0..count).fold(Wide::default(), |sum, k| sum + a[k] * chebyshev[k][i]);
                (powers.high[m][i / 4][i % 4], powers.low[m][i / 4][i % 4]) = (sum.hi, sum.lo);
            }
            powers.cut[m] = a[count..].iter().map(|a| a.hi).sum();
            let before = a;
            for (k, next) in a.iter_mut().enumerate() {
                let at = |k: usize| before.get(k).copied().unwrap_or_default();
                let (lower, upper) = if k == 0 { (Wide::default(), at(1)) } else { (at(k - 1), at(k + 1)) };
                *next = (lower * if k == 1 { 2.0 } else { 1.0 } + at(k) * 2.0 + upper) * 0.25;
            }
        }
        powers
    }

    #[inline(always)]
    fn convert<P: Path>(&self, path: P, series: &[Wide], is_coarse: bool) -> (Numbers<F>, f64) {
        let (mut all, mut cut) = ([Two::zero(path); F], 0.0);
        for (m, a) in series.iter().enumerate() {
            cut += a.hi.abs() * self.cut[m];
            let [hi, lo] = [a.hi, a.lo].map(|a| path.all(a));
            if is_coarse || m >= 4 * F {
                for i in 0..F {
                    all[i].lo = path.plus(all[i].lo, path.times(hi, path.four(self.high[m][i])));
                }
                continue;
            }
            for i in 0..F {
                let [high, rest] = [path.four(self.high[m][i]), path.four(self.low[m][i])];
                let product = two::product(path, hi, high);
                let next = two::sum(path, all[i].hi, product.hi);
                let added = path.plus(path.plus(next.lo, product.lo), path.times(hi, rest));
                let added = path.plus(added, path.times(lo, high));
                all[i] = Two { hi: next.hi, lo: path.plus(all[i].lo, added) };
            }
        }
        let mut column = [[0.0; 4]; F];
        for i in 0..F {
            column[i] = path.numbers(path.plus(all[i].hi, all[i].lo));
        }
        (column, cut)
    }
}

/// Bernstein coefficients of `Σ series_k θᵏ⁻¹`, cut after the degree of five or six fours, and a bound on the cut part.
pub struct Conversion<'a> {
    pub series: &'a [Wide],
    pub fours: usize,
    /// True if the rounding of doubles suffices.
    pub is_coarse: bool,
}

impl Work for Conversion<'_> {
    type Output = (Numbers<MOST_FOURS>, f64);

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> (Numbers<MOST_FOURS>, f64) {
        let Self { series, fours, is_coarse } = self;
        let mut column = [[0.0; 4]; MOST_FOURS];
        if series.iter().all(|a| a.hi == 0.0) {
            return (column, 0.0);
        }
        if fours == MOST_FOURS {
            return LONG.convert(path, series, is_coarse);
        }
        let (short, cut) = SHORT.convert(path, series, is_coarse);
        column[..short.len()].copy_from_slice(&short);
        (column, cut)
    }
}
