//! Columns along a step by series, formed from the series of the step.

use super::{DEEPEST, Tangent, largest};
use crate::{
    hybrid::{Columns, Mode, StepQuantity},
    integrate::DenseStep,
    system::{Eight, Gradient, LANES, Lanes, Sticking, Structure},
    vectors::{Path, Work},
};

/// Highest power of the series of the columns.
const ORDER: usize = 28;

/// Series of a step from which its derivative is formed, in the clock of the step.
pub(super) struct Coefficients {
    /// `dt/dθ`.
    clock: Vec<f64>,
    /// Each changing contact: its index, the index of its latched speed, and its changes times the rate of the clock.
    changes: Vec<(usize, Option<usize>, [Vec<f64>; 3])>,
}

impl Coefficients {
    /// Reads the series of `step`; `None` if the step does not know them.
    pub fn new(structure: &Structure, mode: &Mode, step: &dyn DenseStep) -> Option<Self> {
        let show = |what: StepQuantity| {
            let mut series = Vec::new();
            step.show(what, &mut series).then_some(series)
        };
        let clock = show(StepQuantity::Time)?.iter().enumerate().skip(1).map(|(k, t)| k as f64 * t).collect();
        let changes = structure.changing(mode).map(|(j, latch)| {
            let by =
                [show(StepQuantity::ByDeflection(j))?, show(StepQuantity::ByRate(j))?, show(StepQuantity::ByLatch(j))?];
            Some((j, latch, by))
        });
        Some(Self { clock, changes: changes.collect::<Option<_>>()? })
    }

    /// Returns the series on `[from, to]`, with a clock from 0 to 1 there.
    fn part(&self, from: f64, to: f64) -> Self {
        let part = |series: &Vec<f64>| {
            let mut shifted = series.clone();
            // Taylor's shift by Horner's scheme, then the scale.
            for i in 0..if from == 0.0 { 0 } else { shifted.len() } {
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

/// Share of a rounding below which terms end a series. As many in a row must be small as a root clock may leave out.
const NEGLIGIBLE: f64 = 1.0 / 16.0;

/// Recurrence of the series of the columns, some columns side by side.
struct Recurrence<'a> {
    structure: &'a Structure,
    held: Option<&'a Sticking>,
    coefficients: &'a Coefficients,
    /// Sizes of the components, for the ends of the series.
    sizes: &'a [f64],
    columns: &'a mut Columns,
    work: &'a mut Orders,
}

/// Buffers of the recurrence; each has a row for each component or contact, order by order.
#[derive(Default)]
pub(super) struct Orders {
    /// Terms of the series.
    terms: Vec<Lanes>,
    /// `f_x` without contacts, applied to the terms.
    base: Vec<Lanes>,
    /// `gᵀδq` and `gᵀδq̇` of contacts, all orders of one contact together.
    along: [Vec<Lanes>; 2],
    /// Sums of the series, for all columns.
    sums: Vec<f64>,
}

impl Work for Recurrence<'_> {
    /// True if the series are short enough. The columns are then advanced.
    type Output = bool;

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> bool {
        let Self { structure, held, coefficients, sizes, columns, work } = self;
        let (dim, m, contacts) = (sizes.len(), columns.count, coefficients.changes.len());
        work.terms.resize((ORDER + 1) * dim, [0.0; LANES]);
        work.base.resize(ORDER * dim, [0.0; LANES]);
        work.along.iter_mut().for_each(|along| along.resize(ORDER * contacts, [0.0; LANES]));
        work.sums.resize(dim * m, 0.0);
        for first in (0..m).step_by(LANES) {
            let width = LANES.min(m - first);
            for (term, row) in work.terms.iter_mut().zip(columns.values.chunks_exact(m)) {
                *term = [0.0; LANES];
                term[..width].copy_from_slice(&row[first..first + width]);
            }
            let Some(highest) = expand(path, (structure, held), coefficients, sizes, work) else { return false };
            for (i, row) in work.sums.chunks_exact_mut(m).enumerate() {
                let mut sum = Eight::zero(path);
                for k in (0..=highest).rev() {
                    sum.add(path, 1.0, &work.terms[k * dim + i]);
                }
                row[first..first + width].copy_from_slice(&sum.numbers(path)[..width]);
            }
        }
        columns.values.copy_from_slice(&work.sums);
        true
    }
}

/// Computes the terms up to the returned order; `None` if they are not short enough.
#[inline(always)]
fn expand<P: Path>(
    path: P,
    (s, held): (&Structure, Option<&Sticking>),
    c: &Coefficients,
    sizes: &[f64],
    work: &mut Orders,
) -> Option<usize> {
    let (n, dim) = (s.freedoms(), sizes.len());
    let gap = 3 + c.clock.iter().take_while(|a| **a == 0.0).count();
    let mut small = 0;
    for k in 0..ORDER {
        let (low, high) = work.terms.split_at_mut((k + 1) * dim);
        let (start, low, next) = (&low[..dim], &low[k * dim..], &mut high[..dim]);
        s.apply_lanes(path, low, &mut work.base[k * dim..(k + 1) * dim]);
        for (i, term) in next.iter_mut().enumerate() {
            let mut sum = Eight::zero(path);
            for (a, clock) in c.clock.iter().enumerate().take(k + 1) {
                sum.add(path, *clock, &work.base[(k - a) * dim + i]);
            }
            *term = sum.numbers(path);
        }
        for (place, (j, latch, [by_deflection, by_rate, by_latch])) in c.changes.iter().enumerate() {
            let mut force = Eight::zero(path);
            for (half, by) in [by_deflection, by_rate].into_iter().enumerate() {
                let along = &mut work.along[half][place * ORDER..][..=k];
                along[k] = s.along_lanes(path, *j, &low[half * n..]);
                for (by, x) in by.iter().zip(along.iter().rev()) {
                    force.add(path, *by, x);
                }
            }
            if let (Some(latch), Some(by)) = (latch, by_latch.get(k)) {
                force.add(path, *by, &start[*latch]);
            }
            s.push_lanes(path, *j, &force.numbers(path), &mut next[n..]);
        }
        if let Some(held) = held {
            let mut columns = Columns { count: LANES, values: next.as_flattened().to_vec() };
            s.take_out(held, n, &mut columns, &mut |_, _| ());
            next.as_flattened_mut().copy_from_slice(&columns.values);
        }
        let share = 1.0 / (k + 1) as f64;
        let mut is_small = true;
        for (term, size) in next.iter_mut().zip(sizes) {
            let mut x = Eight::zero(path);
            x.add(path, share, term);
            *term = x.numbers(path);
            is_small &= x.is_below(path, NEGLIGIBLE * f64::EPSILON * size + f64::MIN_POSITIVE);
        }
        small = if is_small { small + 1 } else { 0 };
        if small > gap {
            return Some(k + 1);
        }
    }
    let last = &work.terms[(ORDER - 1) * dim..(ORDER + 1) * dim];
    let is_small = |(lanes, size): (&Lanes, &f64)| lanes.iter().all(|x| x.abs() <= 4.0 * f64::EPSILON * size);
    last.chunks_exact(dim).all(|terms| terms.iter().zip(sizes).all(is_small)).then_some(ORDER)
}

impl Tangent<'_> {
    /// Advances the columns along a part of a step by series; returns `false` if the series are not short enough.
    fn expand(&mut self, mode: &Mode, c: &Coefficients) -> bool {
        let Self { structure: s, columns, modes, orders, .. } = self;
        let Some(known) = modes.get(mode) else { return true };
        let sizes = largest(s.freedoms(), columns);
        let held = known.held.as_ref();
        let recurrence = Recurrence { structure: s, held, coefficients: c, sizes: &sizes, columns, work: orders };
        if !s.instructions().run(recurrence) {
            return false;
        }
        let by_rate = c.changes.iter().map(|(j, _, by)| s.divergence_by(*j) * integral(&by[1]));
        let divergence = s.divergence(&Gradient::default()) * integral(&c.clock) + by_rate.sum::<f64>();
        self.volume += if held.is_some() { f64::NAN } else { divergence };
        true
    }

    /// Advances the columns in as many parts as needed; parts without a short series are collocated.
    pub(super) fn expand_parts(
        &mut self,
        mode: &Mode,
        step: &dyn DenseStep,
        c: &Coefficients,
        [from, to]: [f64; 2],
        depth: u32,
    ) {
        let is_whole = from == 0.0 && to == 1.0;
        if is_whole && self.expand(mode, c) || !is_whole && self.expand(mode, &c.part(from, to)) {
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

/// Returns the integral of a series over `[0, 1]`.
fn integral(series: &[f64]) -> f64 {
    series.iter().enumerate().map(|(k, c)| c / (k + 1) as f64).sum()
}
