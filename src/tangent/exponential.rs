//! Columns over a span of a mode with constant `f_x = A`: `exp(A h) ξ`.
//!
//! Tables hold `exp(A h) − 1`: beside fast rates, the digits of the 1 would hide the slow rates.

use super::{Tangent, is_small, largest};
use crate::{
    hybrid::{Columns, HybridSystem, Mode},
    system::{Gradient, LANES, Sticking, Structure},
    vectors::{Path, Work, fused},
};

/// Maximum number of terms of a series: if rates times span are below [`LONG`], the rest is below rounding.
const TERMS: usize = 60;
/// Product of rates and span above which a span is halved, without tables: the largest terms are then some hundred times the sum.
const LONG: f64 = 8.0;
/// Product of rates and span for tables: the largest term is then twice the first one.
const SHORT: f64 = 2.0;
/// Share of a unit below which a term of a table is omitted: entries in other units are some thousand times smaller at most.
const NEGLIGIBLE: f64 = f64::EPSILON / 1024.0;
/// Largest number of components of a state with tables: a product of two costs the cube.
const MOST: usize = 64;
/// Number of multiplications per entry of a column and term of a series: a row has some entries, and a loop.
const PER_ENTRY: usize = 8;

/// Matrices of a mode that give its exponential over any span. They depend on the mode alone.
pub(super) struct Tables {
    /// Span of the series, s: a power of two, so that its multiples and the remainder of a time are exact.
    span: f64,
    /// `(A span)ᵏ/k!` from k = 1 on, `[dim][dim]` each.
    terms: Vec<Vec<f64>>,
    /// `exp(A 2ᵏ span) − 1` from k = 0 on, as far as requested.
    doubled: Vec<Vec<f64>>,
    /// `exp(A h) − 1` over the remainder of a time.
    rest: Vec<f64>,
    /// Last requested span, s. `repeated` is the exponential over a span requested twice in a row: between switches of a stiffness it
    /// repeats with each cycle.
    last: f64,
    repeated: Option<(f64, Vec<f64>)>,
    sums: Vec<f64>,
}

/// Computes `F ξ` of `count` columns, into `sums`.
#[inline(always)]
fn product<P: Path>(matrix: &[f64], columns: &[f64], count: usize, sums: &mut Vec<f64>) {
    sums.clear();
    for row in matrix.chunks_exact(columns.len() / count) {
        let mut first = 0;
        while first + LANES <= count {
            let mut sum = [0.0; LANES];
            for (factor, column) in row.iter().zip(columns.chunks_exact(count)) {
                let column = &column[first..first + LANES];
                sum = std::array::from_fn(|l| fused::<P>(*factor, column[l], sum[l]));
            }
            sums.extend_from_slice(&sum);
            first += LANES;
        }
        for l in first..count {
            let column = columns[l..].iter().step_by(count);
            sums.push(row.iter().zip(column).fold(0.0, |sum, (factor, c)| fused::<P>(*factor, *c, sum)));
        }
    }
}

/// `ξ + F ξ`.
struct Product<'a> {
    matrix: &'a [f64],
    columns: &'a mut Columns,
    sums: &'a mut Vec<f64>,
}

impl Work for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, _: P) {
        let Columns { count, values } = self.columns;
        product::<P>(self.matrix, values, *count, self.sums);
        values.iter_mut().zip(self.sums).for_each(|(c, s)| *c += *s);
    }
}

/// `(1 + F)(1 + W) − 1`, with F applied after the whole W.
struct Composition<'a> {
    matrix: &'a [f64],
    whole: &'a mut [f64],
    count: usize,
    sums: &'a mut Vec<f64>,
}

impl Work for Composition<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, _: P) {
        product::<P>(self.matrix, self.whole, self.count, self.sums);
        self.whole.iter_mut().zip(self.matrix).zip(self.sums).for_each(|((w, f), s)| *w += f + *s);
    }
}

/// `Σ_k B_k shareᵏ`, from k = 1 on.
struct Sum<'a> {
    terms: &'a [Vec<f64>],
    share: f64,
    sum: &'a mut Vec<f64>,
}

impl Work for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, _: P) {
        let Self { terms, share, sum } = self;
        sum.clear();
        let [lower @ .., last] = terms else { return };
        sum.extend_from_slice(last);
        for term in lower.iter().rev() {
            sum.iter_mut().zip(term).for_each(|(s, t)| *s = fused::<P>(*s, share, *t));
        }
        sum.iter_mut().for_each(|s| *s *= share);
    }
}

impl Tables {
    /// Returns the tables of `A = gradient` with rates of at most `rate`, rad/s; `None` for a state with too many components.
    pub fn new(s: &Structure, gradient: &Gradient, held: Option<&Sticking>, rate: f64) -> Option<Self> {
        let (n, dim) = (s.freedoms(), HybridSystem::dim(s));
        if dim > MOST {
            return None;
        }
        let longest = if rate > 0.0 { SHORT / rate } else { 1.0 };
        // The exponent of the double is the power of two.
        let span = f64::from_bits(longest.to_bits() & f64::INFINITY.to_bits());
        // A velocity counts as large as its displacement times the rate.
        let unit = |i: usize| if (n..2 * n).contains(&i) { 1.0 / span } else { 1.0 };
        let mut terms = vec![Columns::unit(dim)];
        while terms.len() <= TERMS {
            let mut next = Columns { count: dim, values: vec![0.0; dim * dim] };
            s.apply(gradient, held, &terms[terms.len() - 1], &mut next);
            let share = span / terms.len() as f64;
            next.values.iter_mut().for_each(|entry| *entry *= share);
            let size = |i: usize, j: usize| next.values[i * dim + j].abs() * unit(j) / unit(i);
            let is_last = (0..dim).all(|i| (0..dim).all(|j| size(i, j) <= NEGLIGIBLE));
            if is_last && terms.len() as f64 > SHORT {
                break;
            }
            terms.push(next);
        }
        let terms = terms.into_iter().skip(1).map(|term| term.values).collect();
        Some(Self {
            span,
            terms,
            doubled: Vec::new(),
            rest: Vec::new(),
            last: f64::NAN,
            repeated: None,
            sums: Vec::new(),
        })
    }

    /// Splits `time` into multiples of the span, as powers of two, and the remainder, s. Forms the tables of the multiples.
    fn multiples(&mut self, s: &Structure, time: f64) -> (Vec<usize>, f64) {
        let (instructions, count) = (s.instructions(), HybridSystem::dim(s));
        let parts = (time / self.span).floor();
        let bits = (0..u64::BITS as usize).filter(|bit| parts as u64 >> bit & 1 == 1).collect::<Vec<_>>();
        while self.doubled.len() <= bits.last().copied().unwrap_or(0) {
            let mut next = Vec::new();
            match self.doubled.last() {
                None => instructions.run(Sum { terms: &self.terms, share: 1.0, sum: &mut next }),
                Some(matrix) => {
                    // `exp(2Ah) − 1 = 2F + F²`.
                    next.clone_from(matrix);
                    instructions.run(Composition { matrix, whole: &mut next, count, sums: &mut self.sums });
                }
            }
            self.doubled.push(next);
        }
        (bits, time - parts * self.span)
    }

    /// Advances `columns` over `time`, if that span is requested at least twice in a row; returns whether it did.
    fn again(&mut self, s: &Structure, time: f64, columns: &mut Columns) -> bool {
        let (instructions, dim) = (s.instructions(), HybridSystem::dim(s));
        if self.repeated.as_ref().is_none_or(|(known, _)| *known != time) && self.last == time {
            let (bits, rest) = self.multiples(s, time);
            let mut whole = vec![0.0; dim * dim];
            instructions.run(Sum { terms: &self.terms, share: rest / self.span, sum: &mut self.rest });
            for matrix in bits.iter().map(|bit| &self.doubled[*bit]).chain([&self.rest]) {
                instructions.run(Composition { matrix, whole: &mut whole, count: dim, sums: &mut self.sums });
            }
            self.repeated = Some((time, whole));
        }
        self.last = time;
        let Some((_, matrix)) = self.repeated.as_ref().filter(|(known, _)| *known == time) else { return false };
        instructions.run(Product { matrix, columns, sums: &mut self.sums });
        true
    }

    /// Advances `columns` over `time`, shorter than the span, if tables take fewer multiplications than a series; returns whether it did.
    fn rest(&mut self, s: &Structure, time: f64, columns: &mut Columns) -> bool {
        let (dim, terms, count) = (HybridSystem::dim(s), self.terms.len(), columns.count);
        if dim * (terms + count) > PER_ENTRY * terms * count {
            return false;
        }
        let Self { terms, rest, sums, .. } = self;
        let instructions = s.instructions();
        instructions.run(Sum { terms, share: time / self.span, sum: rest });
        instructions.run(Product { matrix: rest, columns, sums });
        true
    }
}

impl Tangent<'_> {
    /// Advances the columns over `time`, s, in `mode`, if its `f_x` is constant.
    pub(super) fn exponential(&mut self, mode: &Mode, time: f64) {
        let Self { structure: s, columns, work: [term, next], modes, volume, .. } = self;
        let Some(known) = modes.get_mut(mode) else { return };
        let Some(gradient) = &known.gradient else { return };
        let (held, rate) = (known.held.as_ref(), known.rate);
        *volume += if held.is_some() { f64::NAN } else { s.divergence(gradient) * time };
        let mut time = time;
        if let Some(tables) = &mut known.tables {
            if tables.again(s, time, columns) {
                return;
            }
            let bits;
            (bits, time) = tables.multiples(s, time);
            let Tables { doubled, sums, .. } = tables;
            bits.iter().for_each(|bit| s.instructions().run(Product { matrix: &doubled[*bit], columns, sums }));
            if tables.rest(s, time, columns) {
                return;
            }
        }
        let parts = (rate * time / LONG).ceil().max(1.0);
        let h = time / parts;
        for _ in 0..parts as u64 {
            term.values.copy_from_slice(&columns.values);
            let size = largest(s.freedoms(), columns);
            for k in 1..=TERMS {
                s.apply(gradient, held, term, next);
                let share = h / k as f64;
                next.values.iter_mut().for_each(|c| *c *= share);
                columns.values.iter_mut().zip(&next.values).for_each(|(c, t)| *c += t);
                std::mem::swap(term, next);
                if k as f64 > rate * h && is_small(term, &size, f64::EPSILON / 16.0) {
                    break;
                }
            }
        }
    }
}
