//! Smooth motion by Picard's iteration on Chebyshev nodes: an explicit method that needs nothing but `f(t, x)`.
//!
//! On a step, `x(θ) = x₀ + h ∫ f` is asked for at the nodes, with the polynomial through the values of f in place of f
//! (Clenshaw and Norton 1963). The values are found one node after the other, round by round, until nothing changes.

use super::sizes::Norm;
use crate::hybrid::{Instant, Mode, VectorField};

/// Degree of the polynomial of f: 17 nodes, the ends among them.
pub(super) const DEGREE: usize = 16;
const NODES: usize = DEGREE + 1;
/// Rounds after which a step counts as too long: `(hL)^k/k!` is then below rounding up to `hL = 12`.
const ROUNDS: usize = 50;
/// Truncation relative to the terms of a component.
pub(super) const RTOL: f64 = 1e-13;

type Square = [[f64; NODES]; NODES];

/// The method and its working space.
pub(super) struct Collocation {
    /// In `[0, 1]`, rising, the ends exact.
    pub nodes: [f64; NODES],
    /// Coefficients of Chebyshev's polynomials from values at the nodes.
    to_series: Square,
    /// `∫₀^θ` at the nodes from values at the nodes.
    integral: Square,
    dim: usize,
    /// States and rates at the nodes, `[NODES · dim]`.
    states: Vec<f64>,
    rates: Vec<f64>,
    scratch: Vec<f64>,
}

/// `T_k(2θ − 1)`.
fn chebyshev(k: usize, theta: f64) -> f64 {
    (k as f64 * (2.0 * theta - 1.0).clamp(-1.0, 1.0).acos()).cos()
}

impl Collocation {
    pub fn new(dim: usize) -> Self {
        let n = DEGREE as f64;
        let nodes: [f64; NODES] = std::array::from_fn(|j| (0.5 * std::f64::consts::PI * j as f64 / n).sin().powi(2));
        let end = |j: usize| if j == 0 || j == DEGREE { 0.5 } else { 1.0 };
        let to_series: Square =
            std::array::from_fn(|k| std::array::from_fn(|j| 2.0 / n * end(k) * end(j) * chebyshev(k, nodes[j])));
        // With s = 2θ − 1, ∫T_k ds = T_{k+1}/(2(k+1)) − T_{k−1}/(2(k−1)) from k = 2 on; dθ = ds/2.
        let antiderivative = |k: usize, theta: f64| match k {
            0 => theta,
            1 => theta * (theta - 1.0),
            _ => {
                let low = chebyshev(k - 1, theta) / (k - 1) as f64;
                0.25 * (chebyshev(k + 1, theta) / (k + 1) as f64 - low)
            }
        };
        let integral = std::array::from_fn(|j| {
            std::array::from_fn(|l| {
                (0..NODES).map(|k| (antiderivative(k, nodes[j]) - antiderivative(k, 0.0)) * to_series[k][l]).sum()
            })
        });
        let room = vec![0.0; NODES * dim];
        Self { nodes, to_series, integral, dim, states: room.clone(), rates: room, scratch: vec![0.0; dim] }
    }

    /// The state at node `j`.
    pub fn state(&self, j: usize) -> &[f64] {
        &self.states[j * self.dim..(j + 1) * self.dim]
    }

    /// Its rate.
    pub fn rate(&self, j: usize) -> &[f64] {
        &self.rates[j * self.dim..(j + 1) * self.dim]
    }

    /// Chebyshev coefficients of what has `values` at the nodes.
    pub fn series(&self, values: impl Fn(usize) -> f64) -> [f64; NODES] {
        let values: [f64; NODES] = std::array::from_fn(values);
        std::array::from_fn(|k| self.to_series[k].iter().zip(&values).map(|(c, v)| c * v).sum())
    }

    /// One step of length `h` from `x` at `t`, s after `base`. Returns its error over the tolerance, infinite if the rounds do
    /// not end, and the sizes of the guards' terms with it.
    pub fn step(
        &mut self,
        field: &dyn VectorField,
        mode: Mode,
        (base, t, h): (Instant, f64, f64),
        x: &[f64],
        norm: &mut Norm<'_>,
    ) -> (f64, Vec<f64>) {
        let dim = self.dim;
        let mut sizes = Vec::new();
        field.eval(mode, base, t, x, &mut self.rates[..dim]);
        for j in 1..NODES {
            self.rates.copy_within(..dim, j * dim);
        }
        self.states[..dim].copy_from_slice(x);
        for round in 0..ROUNDS {
            let mut change: f64 = 0.0;
            for j in 1..NODES {
                self.scratch.fill(0.0);
                for (weight, rate) in self.integral[j].iter().zip(self.rates.chunks_exact(dim)) {
                    self.scratch.iter_mut().zip(rate).for_each(|(sum, f)| *sum += weight * f);
                }
                let (state, scratch) = (&mut self.states[j * dim..(j + 1) * dim], &mut self.scratch);
                scratch.iter_mut().zip(x).for_each(|(sum, x)| *sum = x + h * *sum);
                change = change.max(norm.of(|i| scratch[i] - state[i]));
                state.copy_from_slice(scratch);
                field.eval(mode, base, t + h * self.nodes[j], state, &mut self.rates[j * dim..(j + 1) * dim]);
            }
            if round == 0 {
                sizes = norm.with_step([(x, self.rate(0)), (self.state(DEGREE), self.rate(DEGREE))], h);
            } else if change <= 0.1 * RTOL {
                let last = |i: usize| {
                    let series = self.series(|j| self.rates[j * dim + i]);
                    h * (series[DEGREE].abs() + series[DEGREE - 1].abs())
                };
                return (norm.of(last) / RTOL, sizes);
            }
        }
        (f64::INFINITY, sizes)
    }
}

/// A Chebyshev series at `θ`, by Clenshaw's recurrence.
pub(super) fn value(series: &[f64], theta: f64) -> f64 {
    let s = 2.0 * theta - 1.0;
    let (b1, b2) = series[1..].iter().rev().fold((0.0, 0.0), |(b1, b2), c| (2.0 * s * b1 - b2 + c, b1));
    series[0] + s * b1 - b2
}
