//! Smooth motion by Picard's iteration on Chebyshev nodes: an explicit method that only evaluates `f(t, x)`.
//!
//! On a step, `x(θ) = x₀ + h ∫ f` is solved at the nodes, with f replaced by the polynomial through its values (Clenshaw and Norton 1963).
//! The values are found one node after the other, in rounds, until nothing changes.

use std::{array::from_fn, f64::consts::PI};

use super::arc::Arc;

/// Degree of the polynomial of f: 17 nodes, the ends among them.
pub(super) const DEGREE: usize = 16;
const NODES: usize = DEGREE + 1;
/// Number of rounds after which a step counts as too long: `(hL)^k/k!` is then below rounding up to `hL = 12`.
const ROUNDS: usize = 50;
/// Truncation relative to the terms of a component.
pub(super) const RTOL: f64 = 1e-13;

/// Values at the nodes, or coefficients of Chebyshev's polynomials.
pub(super) type Nodal = [f64; NODES];

pub(super) struct Collocation {
    /// Nodes in `[0, 1]`, rising, the ends exact.
    pub nodes: Nodal,
    /// Map from values to coefficients.
    to_series: [Nodal; NODES],
    /// Map from values to `∫₀^θ` at the nodes.
    integral: [Nodal; NODES],
    dim: usize,
    /// States and rates at the nodes, `[NODES · dim]`.
    states: Vec<f64>,
    rates: Vec<f64>,
}

impl Collocation {
    pub fn new(dim: usize) -> Self {
        let n = DEGREE as f64;
        // T_k at node j.
        let chebyshev = |k: i32, j: usize| libm::cos(PI * f64::from(k) * (DEGREE - j) as f64 / n);
        let end = |j: usize| if j == 0 || j == DEGREE { 0.5 } else { 1.0 };
        let to_series: [Nodal; NODES] = from_fn(|k| from_fn(|j| 2.0 / n * end(k) * end(j) * chebyshev(k as i32, j)));
        // 4 ∫T_k dθ = T_{k+1}/(k+1) − T_{k−1}/(k−1), without the constant; T_{−1} = T_1.
        let part = |k: i32, j: usize| if k == 0 { 0.0 } else { 0.25 * chebyshev(k, j) / f64::from(k) };
        let primitive = |k: i32, j: usize| part(k + 1, j) - part(k - 1, j);
        let definite = |k: usize, j: usize| primitive(k as i32, j) - primitive(k as i32, 0);
        Self {
            nodes: from_fn(|j| libm::sin(0.5 * PI * j as f64 / n).powi(2)),
            to_series,
            integral: from_fn(|j| from_fn(|l| (0..NODES).map(|k| definite(k, j) * to_series[k][l]).sum())),
            dim,
            states: vec![0.0; NODES * dim],
            rates: vec![0.0; NODES * dim],
        }
    }

    /// Returns the state at node `j`, and its rate.
    pub fn at(&self, j: usize) -> (&[f64], &[f64]) {
        let range = j * self.dim..(j + 1) * self.dim;
        (&self.states[range.clone()], &self.rates[range])
    }

    /// Returns the Chebyshev coefficients of the function with `values` at the nodes.
    pub fn series(&self, values: &Nodal) -> Nodal {
        from_fn(|k| self.to_series[k].iter().zip(values).map(|(c, v)| c * v).sum())
    }

    /// Makes one step of length `h` from `x`, `t` s after the start of the arc. Returns its error over the tolerance, infinite if the
    /// rounds do not converge. Updates `sizes` of the terms of the guards.
    pub fn step(&mut self, arc: &Arc<'_>, (t, h): (f64, f64), x: &[f64], sizes: &mut [f64]) -> f64 {
        let (dim, field) = (self.dim, arc.field());
        let mut weights = Vec::new();
        field.eval(&arc.lane.last.jump.mode, arc.lane.last.at, t, x, &mut self.rates[..dim]);
        for j in 1..NODES {
            self.rates.copy_within(..dim, j * dim);
        }
        self.states[..dim].copy_from_slice(x);
        for round in 0..ROUNDS {
            let mut change: f64 = 0.0;
            for j in 1..NODES {
                let state = &mut self.states[j * dim..(j + 1) * dim];
                let mut moved = 0.0;
                for i in 0..dim {
                    let sum: f64 = (0..NODES).map(|l| self.integral[j][l] * self.rates[l * dim + i]).sum();
                    let next = x[i] + h * sum;
                    moved += weights.get(i).map_or(0.0, |w| w * (next - state[i]).abs());
                    state[i] = next;
                }
                change = change.max(moved);
                let rate = &mut self.rates[j * dim..(j + 1) * dim];
                field.eval(&arc.lane.last.jump.mode, arc.lane.last.at, t + h * self.nodes[j], state, rate);
            }
            if round == 0 {
                for (g, size) in sizes.iter_mut().enumerate() {
                    *size = [0, DEGREE].iter().fold(*size, |m, j| m.max(arc.size(g, self.at(*j), h)));
                }
                weights = arc.weights(sizes, h);
            } else if change <= 0.1 * RTOL {
                let rest = |i: usize| h * tail(&self.series(&from_fn(|j| self.rates[j * dim + i])));
                return weights.iter().enumerate().map(|(i, w)| w * rest(i)).sum::<f64>() / RTOL;
            }
        }
        f64::INFINITY
    }
}

/// Returns the truncation of a series, estimated from its last coefficients.
pub(super) fn tail(series: &Nodal) -> f64 {
    series[DEGREE].abs() + series[DEGREE - 1].abs()
}

/// Evaluates a Chebyshev series at `θ`, by Clenshaw's recurrence.
pub(super) fn value(series: &Nodal, theta: f64) -> f64 {
    let s = 2.0 * theta - 1.0;
    let (b1, b2) = series[1..].iter().rev().fold((0.0, 0.0), |(b1, b2), c| (2.0 * s * b1 - b2 + c, b1));
    series[0] + s * b1 - b2
}
