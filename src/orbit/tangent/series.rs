//! Columns along a step by their own series, from the series of the step.

use super::{DEEPEST, Tangent, is_small, largest};
use crate::{
    hybrid::{Mode, Shown},
    integrate::DenseStep,
    system::{Columns, Gradient, Sticking, Structure},
    vectors::{Path, Work, fused},
};

/// Highest power of the columns' series.
const ORDER: usize = 28;

/// The series of a step that the derivative along it is made from, in the step's clock.
pub(super) struct Coefficients {
    /// `dt/dθ`.
    clock: Vec<f64>,
    /// For each contact that changes: it, its latched speed, and its changes times the clock's rate.
    changes: Vec<(usize, Option<usize>, [Vec<f64>; 3])>,
}

impl Coefficients {
    /// Those of `step`; `None` where it does not know them.
    pub fn new(structure: &Structure, mode: &Mode, step: &dyn DenseStep) -> Option<Self> {
        let show = |what: Shown| {
            let mut series = Vec::new();
            step.show(what, &mut series).then_some(series)
        };
        let clock = show(Shown::Time)?.iter().enumerate().skip(1).map(|(k, t)| k as f64 * t).collect();
        let changes = structure.changing(mode).map(|(j, latch)| {
            let by = [show(Shown::ByDeflection(j))?, show(Shown::ByRate(j))?, show(Shown::ByLatch(j))?];
            Some((j, latch, by))
        });
        Some(Self { clock, changes: changes.collect::<Option<_>>()? })
    }

    /// The same on `[from, to]`, by a clock that goes from 0 to 1 there.
    fn part(&self, from: f64, to: f64) -> Self {
        let part = |series: &Vec<f64>| {
            let mut shifted = series.clone();
            // Taylor's shift by Horner's scheme, then the scale.
            for i in 0..shifted.len() {
                for k in (i..shifted.len() - 1).rev() {
                    shifted[k] += from * shifted[k + 1];
                }
            }
            let mut power = to - from;
            for c in &mut shifted {
                *c *= power;
                power *= to - from;
            }
            shifted
        };
        let changes = self.changes.iter().map(|(j, latch, by)| (*j, *latch, std::array::from_fn(|i| part(&by[i]))));
        Self { clock: part(&self.clock), changes: changes.collect() }
    }
}

/// A series goes on while its terms, as many in a row as a root clock may leave out, are above this share of a rounding.
const NEGLIGIBLE: f64 = 1.0 / 16.0;

/// The recurrence of the columns' series.
struct Recurrence<'a> {
    structure: &'a Structure,
    held: Option<&'a Sticking>,
    coefficients: &'a Coefficients,
    /// Sizes of the components.
    sizes: &'a [f64],
    /// The terms; the first one is there.
    orders: &'a mut [Columns],
    /// `f_x` without contacts, applied to them.
    base: &'a mut [Columns],
    /// `gᵀδq` and `gᵀδq̇` of each contact, order by order.
    along: &'a mut [[Vec<f64>; 2]],
    force: &'a mut [f64],
}

impl Work for Recurrence<'_> {
    /// The highest order formed; `None` where the series is not short enough.
    type Output = Option<usize>;

    #[inline(always)]
    fn on<P: Path>(self) -> Option<usize> {
        let Self { structure: s, held, coefficients: c, sizes, orders, base, along, force } = self;
        let (n, m, none) = (s.freedoms(), orders[0].count, Gradient::default());
        let gap = 3 + c.clock.iter().take_while(|a| **a == 0.0).count();
        let mut small = 0;
        for k in 0..ORDER {
            let (low, high) = orders.split_at_mut(k + 1);
            let next = &mut high[0];
            s.apply(&none, None, &low[k], &mut base[k]);
            convolve::<P>(&c.clock[..c.clock.len().min(k + 1)], &base[..=k], &mut next.values);
            for ((j, latch, [by_deflection, by_rate, by_latch]), along) in c.changes.iter().zip(&mut *along) {
                force.fill(0.0);
                for ((first, by), along) in [(0, by_deflection), (n, by_rate)].into_iter().zip(along) {
                    along[k * m..(k + 1) * m].fill(0.0);
                    s.add_along(*j, first, 1.0, &low[k], &mut along[k * m..(k + 1) * m]);
                    for (i, a) in by.iter().enumerate().take(k + 1).filter(|(_, a)| **a != 0.0) {
                        add::<P>(*a, &along[(k - i) * m..(k - i + 1) * m], force);
                    }
                }
                if let (Some(latch), Some(a)) = (latch, by_latch.get(k)) {
                    add::<P>(*a, low[0].row(*latch), force);
                }
                s.push_columns(*j, force, next);
            }
            if let Some(held) = held {
                s.take_out(held, n, next, &mut |_, _| ());
            }
            let share = 1.0 / (k + 1) as f64;
            next.values.iter_mut().for_each(|x| *x *= share);
            small = if is_small(next, sizes, NEGLIGIBLE * f64::EPSILON) { small + 1 } else { 0 };
            if small > gap {
                return Some(k + 1);
            }
        }
        orders[ORDER - 1..=ORDER].iter().all(|last| is_small(last, sizes, 4.0 * f64::EPSILON)).then_some(ORDER)
    }
}

/// Adds `a x` to `sum`.
#[inline(always)]
fn add<P: Path>(a: f64, x: &[f64], sum: &mut [f64]) {
    sum.iter_mut().zip(x).for_each(|(s, x)| *s = fused::<P>(a, *x, *s));
}

/// Numbers that stay in registers while all orders are added.
const BLOCK: usize = 32;

/// `Σ a_i x_{k−i}` with k the last of `x`, into `sum`.
#[inline(always)]
fn convolve<P: Path>(a: &[f64], x: &[Columns], sum: &mut [f64]) {
    let last = x.len() - 1;
    for (block, sum) in sum.chunks_mut(BLOCK).enumerate() {
        let from = block * BLOCK;
        let mut total = [0.0; BLOCK];
        for (i, a) in a.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            let x = &x[last - i].values[from..from + sum.len()];
            if let Ok(x) = <&[f64; BLOCK]>::try_from(x) {
                total.iter_mut().zip(x).for_each(|(t, x)| *t = fused::<P>(*a, *x, *t));
            } else {
                total.iter_mut().zip(x).for_each(|(t, x)| *t = fused::<P>(*a, *x, *t));
            }
        }
        let length = sum.len();
        sum.copy_from_slice(&total[..length]);
    }
}

impl Tangent<'_> {
    /// The columns along a part of a step, by their own series; `false` where they are not short enough.
    fn expand(&mut self, mode: &Mode, c: &Coefficients) -> bool {
        let Self { structure: s, columns, modes, orders, base, along, .. } = self;
        let Some(known) = modes.get(mode) else { return true };
        let m = columns.count;
        along.resize_with(c.changes.len(), Default::default);
        along.iter_mut().flatten().for_each(|rows| rows.resize(ORDER * m, 0.0));
        orders.resize_with(ORDER + 1, || columns.clone());
        base.resize_with(ORDER, || columns.clone());
        orders[0].values.copy_from_slice(&columns.values);
        let sizes = largest(s.freedoms(), columns);
        let mut force = vec![0.0; m];
        let recurrence = Recurrence {
            structure: s,
            held: known.held.as_ref(),
            coefficients: c,
            sizes: &sizes,
            orders,
            base,
            along,
            force: &mut force,
        };
        let Some(highest) = s.instructions().run(recurrence) else { return false };
        for order in orders[1..=highest].iter().rev() {
            columns.values.iter_mut().zip(&order.values).for_each(|(c, o)| *c += o);
        }
        let by_rate = c.changes.iter().map(|(j, _, by)| s.divergence_by(*j) * integral(&by[1]));
        let divergence = s.divergence(&Gradient::default()) * integral(&c.clock) + by_rate.sum::<f64>();
        self.volume += if known.held.is_some() { f64::NAN } else { divergence };
        true
    }

    /// The same, in as many parts as it takes; what no series is short enough for is collocated.
    pub(super) fn expand_parts(
        &mut self,
        mode: &Mode,
        step: &dyn DenseStep,
        c: &Coefficients,
        [from, to]: [f64; 2],
        depth: u32,
    ) {
        if self.expand(mode, &c.part(from, to)) {
            return;
        }
        if depth >= DEEPEST {
            return self.collocate_start(mode, step, [from, to]);
        }
        let middle = 0.5 * (from + to);
        self.expand_parts(mode, step, c, [from, middle], depth + 1);
        self.expand_parts(mode, step, c, [middle, to], depth + 1);
    }
}

/// The integral of a series over `[0, 1]`.
fn integral(series: &[f64]) -> f64 {
    series.iter().enumerate().map(|(k, c)| c / (k + 1) as f64).sum()
}
