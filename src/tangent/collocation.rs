//! Columns along a step by collocation: for steps without series, and for columns of parameters.

use std::sync::LazyLock;

use super::{DEEPEST, Tangent, difference, is_small, largest};
use crate::{
    analysis::Quadrature,
    hybrid::{Columns, Mode},
    integrate::DenseStep,
    system::Evaluation,
};

/// Number of nodes of the collocation where `f_x` changes along a step.
const NODES: usize = 10;

/// Gauss–Legendre nodes on `[0, 1]`, weights, and the matrix of integrals up to each node. `last` has the weights of the highest Legendre
/// coefficient of a function given at the nodes.
struct Collocation {
    rule: Quadrature,
    matrix: Vec<[f64; NODES]>,
    last: [f64; NODES],
}

static COLLOCATION: LazyLock<Collocation> = LazyLock::new(|| {
    let rule = Quadrature::gauss(NODES);
    // Legendre polynomials on [0, 1] at x up to degree NODES.
    let legendre = |x: f64| {
        let (x, mut p) = (2.0 * x - 1.0, [1.0; NODES + 1]);
        p[1] = x;
        for k in 2..=NODES {
            let n = k as f64;
            p[k] = ((2.0 * n - 1.0) * x * p[k - 1] - (n - 1.0) * p[k - 2]) / n;
        }
        p
    };
    let at: Vec<[f64; NODES + 1]> = rule.nodes.iter().map(|x| legendre(*x)).collect();
    let integral = |i: usize, l: usize| match l {
        0 => rule.nodes[i],
        l => (at[i][l + 1] - at[i][l - 1]) / (2.0 * (2 * l + 1) as f64),
    };
    let entry =
        |i: usize, j: usize| (0..NODES).map(|l| (2 * l + 1) as f64 * rule.weights[j] * at[j][l] * integral(i, l)).sum();
    let matrix = (0..NODES).map(|i| std::array::from_fn(|j| entry(i, j))).collect();
    let last = std::array::from_fn(|j| (2 * NODES - 1) as f64 * rule.weights[j] * at[j][NODES - 1]);
    Collocation { rule, matrix, last }
});

/// Product of rates and span above which a piece is halved.
const PIECE: f64 = 1.5;
/// Maximum number of Picard iterations of a piece.
const SWEEPS: usize = 60;
/// Change in a sweep below which the iteration has converged: some ten roundings of a sum.
const CONVERGED: f64 = 1e-14;
/// Change below which a stagnating iteration has converged to the rounding of its terms.
const STALLED: f64 = 1e-9;
/// Ratio of successive changes above which the iteration stagnates.
const NO_WAY: f64 = 0.9;
/// Largest share of the highest Legendre coefficient of a piece: the ends of pieces are exact to its square.
const RESOLVED: f64 = 1e-8;
/// Rounding of the rates from which a difference of trains is formed.
const ROUNDED: f64 = 64.0 * f64::EPSILON;
/// Columns that are collocated.
pub(super) struct CollocationColumns {
    pub columns: Columns,
    /// Values and slopes at the nodes of the collocation, formed at the first one.
    nodes: Vec<[Columns; 2]>,
    sum: Columns,
}

impl CollocationColumns {
    pub fn new(columns: Columns) -> Self {
        Self { nodes: Vec::new(), sum: columns.clone(), columns }
    }
}

impl Tangent<'_> {
    /// Advances the columns of a start along a part of a step, by collocation.
    pub(crate) fn collocate_start(&mut self, mode: &Mode, step: &dyn DenseStep, part: [f64; 2]) {
        self.collocated.columns.values.copy_from_slice(&self.columns.values);
        self.collocate(mode, step, part, false, 0);
        self.columns.values.copy_from_slice(&self.collocated.columns.values);
    }

    /// Advances columns along a part of a step with varying `f_x` by collocation in its clock: those of a start, or of parameters.
    pub(crate) fn collocate(
        &mut self,
        mode: &Mode,
        step: &dyn DenseStep,
        [from, to]: [f64; 2],
        of_numbers: bool,
        depth: u32,
    ) {
        let span = to - from;
        let Collocation { rule, matrix, last } = &*COLLOCATION;
        let Self { structure: s, by_number, collocated, x, modes, variations, volume, .. } = self;
        let Some(known) = modes.get(mode) else { return };
        let set = if of_numbers { by_number } else { collocated };
        let CollocationColumns { columns, nodes, sum } = set;
        nodes.resize_with(NODES, || [columns.clone(), columns.clone()]);
        let clock = s.clock();
        let mut along = Vec::with_capacity(NODES);
        let (mut divergence, mut fastest) = (0.0, 0.0f64);
        for (node, weight) in rule.nodes.iter().zip(&rule.weights) {
            let theta = from + span * node;
            step.state(theta, x);
            let at = clock.advance(step.start(), step.time(theta));
            let (gradient, rate) = (s.gradient(mode, at, x), span * step.rate(theta));
            divergence += weight * rate * s.divergence(&gradient);
            fastest = fastest.max(rate * (known.rate + s.rate_by(&gradient)));
            along.push((gradient, rate, at));
        }
        let mut converged = fastest <= PIECE;
        if converged {
            // Contributions of the parameters at the nodes.
            let (mut forcing, mut rounded): (Vec<Columns>, [f64; 2]) = (Vec::new(), [0.0; 2]);
            for (node, (_, rate, at)) in rule.nodes.iter().zip(&along).take(if of_numbers { NODES } else { 0 }) {
                step.state(from + span * node, x);
                let mut added = columns.clone();
                let [slopes, values] =
                    s.forcing(mode, known.held.as_ref(), Evaluation { variations, at: *at, x }, &mut added);
                rounded =
                    std::array::from_fn(|i| rounded[i].max(rate * ROUNDED * slopes[i] + f64::EPSILON * values[i]));
                added.values.iter_mut().for_each(|c| *c *= rate);
                forcing.push(added);
            }
            for [value, _] in &mut *nodes {
                value.values.copy_from_slice(&columns.values);
            }
            converged = false;
            let mut before = f64::INFINITY;
            for _ in 0..SWEEPS {
                for (i, ([value, slope], (gradient, rate, _))) in nodes.iter_mut().zip(&along).enumerate() {
                    s.apply(gradient, known.held.as_ref(), value, slope);
                    slope.values.iter_mut().for_each(|c| *c *= rate);
                    let added = forcing.get(i).into_iter().flat_map(|added| &added.values);
                    slope.values.iter_mut().zip(added).for_each(|(c, a)| *c += a);
                }
                let mut moved = 0.0f64;
                for i in 0..NODES {
                    sum.values.copy_from_slice(&columns.values);
                    for (weight, [_, slope]) in matrix[i].iter().zip(&*nodes) {
                        sum.values.iter_mut().zip(&slope.values).for_each(|(s, f)| *s += weight * f);
                    }
                    let [value, _] = &mut nodes[i];
                    let size = largest(s.freedoms(), sum);
                    moved = moved.max(difference(value, sum, &size));
                    value.values.copy_from_slice(&sum.values);
                }
                // If far larger terms cancel in a component, their rounding ends the iteration: its change no longer falls.
                if moved <= CONVERGED || moved <= STALLED && moved >= NO_WAY * before {
                    converged = true;
                    break;
                }
                before = moved;
            }
            // Test of the resolution: the motion of the columns.
            sum.values.fill(0.0);
            for (weight, [_, slope]) in last.iter().zip(&*nodes) {
                sum.values.iter_mut().zip(&slope.values).for_each(|(s, f)| *s += weight * f);
            }
            let mut sizes = largest(s.freedoms(), columns);
            let ends = largest(s.freedoms(), &nodes[NODES - 1][0]);
            sizes.iter_mut().zip(ends).for_each(|(size, end)| *size = size.max(end));
            // The limit covers the digits lost in differences of trains, and the rounding of the state over the step of a parameter.
            let (q, v) = (s.freedoms(), 2 * s.freedoms());
            sizes[..q].iter_mut().for_each(|size| *size = size.max(rounded[0] / RESOLVED));
            sizes[q..v].iter_mut().for_each(|size| *size = size.max(rounded[1] / RESOLVED));
            converged &= is_small(sum, &sizes, RESOLVED);
        }
        if !converged && depth >= DEEPEST {
            self.is_unresolved = true;
            return;
        }
        if !converged {
            let middle = from + 0.5 * span;
            self.collocate(mode, step, [from, middle], of_numbers, depth + 1);
            return self.collocate(mode, step, [middle, to], of_numbers, depth + 1);
        }
        for (weight, [_, slope]) in rule.weights.iter().zip(&*nodes) {
            columns.values.iter_mut().zip(&slope.values).for_each(|(c, f)| *c += weight * f);
        }
        if !of_numbers {
            *volume += if known.held.is_some() { f64::NAN } else { divergence };
        }
    }
}
