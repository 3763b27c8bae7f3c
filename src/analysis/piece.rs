//! Piece of a step, with polynomials on it.

use std::sync::LazyLock;

use super::quadrature::{Quadrature, theta_at};
use crate::{
    hybrid::{Clock, Instant, Power, SAMPLES, Samples, StepQuantity},
    integrate::DenseStep,
    poly::{self, CHEBYSHEV, Chebyshev, DEGREE},
};

/// Polynomial on the piece, `[0, 1]`; empty for zero.
pub(super) type Polynomial = Vec<f64>;

/// Number of terms of the longest row: a series of order 24.
const MOMENTS: usize = 25;

/// Places and weights of the quadrature of powers.
static GAUSS: LazyLock<[Samples; 2]> = LazyLock::new(|| {
    let rule = Quadrature::gauss(SAMPLES);
    [std::array::from_fn(|i| rule.nodes[i]), std::array::from_fn(|i| rule.weights[i])]
});

/// Piece `[low, low + width]` of a step.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    clock: Clock,
    low: f64,
    width: f64,
    /// Length of the piece, s.
    pub length: f64,
    /// Rate `dt/dθ` on the piece, s.
    rate: Polynomial,
    /// Moments `∫ θˡ dt` over the piece, s.
    moments: [f64; MOMENTS],
    x: Vec<f64>,
}

impl Piece {
    pub fn new(clock: Clock, dim: usize) -> Self {
        Self {
            clock,
            low: 0.0,
            width: 1.0,
            length: 0.0,
            rate: Polynomial::new(),
            moments: [0.0; MOMENTS],
            x: vec![0.0; dim],
        }
    }

    /// Sets the piece to the part from `low` to `high` of `step`.
    pub fn cut(&mut self, step: &dyn DenseStep, low: f64, high: f64) {
        (self.low, self.width) = (low, high - low);
        self.length = if low == 0.0 { step.time(high) } else { step.time(high) - step.time(low) };
        self.rate.clear();
        match step.plain_span() {
            Some(_) => self.rate.push(self.length),
            None => {
                let mut rate = std::mem::take(&mut self.rate);
                self.rows(step, [StepQuantity::Time], [&mut rate], |_, _, theta| [step.time(theta)]);
                derive(&mut rate);
                self.rate = rate;
            }
        }
        poly::moments(&self.rate, &mut self.moments);
    }

    /// Writes quantities of the step as rows on the piece. If the step does not have them, `value` is interpolated: it takes the instant,
    /// the state there, and θ in the step.
    pub fn rows<const M: usize>(
        &mut self,
        step: &dyn DenseStep,
        shown: [StepQuantity; M],
        mut rows: [&mut Polynomial; M],
        mut value: impl FnMut(Instant, &[f64], f64) -> [f64; M],
    ) {
        if shown.iter().zip(&mut rows).all(|(what, row)| step.show(*what, row)) {
            rows.into_iter().for_each(|row| poly::shift(row, self.low, self.width));
            return;
        }
        let mut values = [[0.0; DEGREE + 1]; M];
        for i in 0..=DEGREE {
            let theta = self.low + self.width * Chebyshev::point(i, DEGREE);
            step.state(theta, &mut self.x);
            let at = self.clock.advance(step.start(), step.time(theta));
            for (values, value) in values.iter_mut().zip(value(at, &self.x, theta)) {
                values[i] = value;
            }
        }
        for (row, values) in rows.into_iter().zip(&values) {
            let mut coefficients = [0.0; DEGREE + 1];
            CHEBYSHEV.coefficients(values, &mut coefficients);
            row.resize(DEGREE + 1, 0.0);
            CHEBYSHEV.to_powers(&coefficients, row);
        }
    }

    /// Returns the integrals `∫ P dt` of powers over the piece. If unknown to the step, `value` computes P from instant and state.
    pub fn integrals<const M: usize>(
        &mut self,
        step: &dyn DenseStep,
        powers: [Power; M],
        mut value: impl FnMut(Instant, &[f64]) -> [f64; M],
    ) -> [f64; M] {
        let [nodes, weights] = &*GAUSS;
        let thetas: Samples = std::array::from_fn(|i| self.low + self.width * nodes[i]);
        let mut values = [[0.0; SAMPLES]; M];
        if !powers.iter().zip(&mut values).all(|(what, values)| step.sample(*what, &thetas, values)) {
            for (i, theta) in thetas.iter().enumerate() {
                step.state(*theta, &mut self.x);
                let at = self.clock.advance(step.start(), step.time(*theta));
                for (values, value) in values.iter_mut().zip(value(at, &self.x)) {
                    values[i] = value;
                }
            }
        }
        let mut rates = [0.0; SAMPLES];
        self.values(nodes, &self.rate, &mut rates);
        values.map(|values| (0..SAMPLES).fold(0.0, |sum, i| sum + weights[i] * rates[i] * values[i]))
    }

    /// Returns `dt/dθ` on the piece, s.
    pub fn rate(&self) -> &[f64] {
        &self.rate
    }

    /// Computes values of a row at `nodes` of the piece.
    pub fn values<const N: usize>(&self, nodes: &[f64], row: &[f64], values: &mut [f64; N]) {
        values.fill(0.0);
        for c in row.iter().rev() {
            values.iter_mut().zip(nodes).for_each(|(value, node)| *value = *value * node + c);
        }
    }

    /// Returns `∫ row² dt` over the piece, exact to degree 15 of the row in plain time.
    pub fn square(&self, row: &[f64]) -> f64 {
        let [nodes, weights] = &*GAUSS;
        let [mut values, mut rates] = [[0.0; SAMPLES]; 2];
        self.values(nodes, row, &mut values);
        self.values(nodes, &self.rate, &mut rates);
        (0..SAMPLES).fold(0.0, |sum, i| sum + weights[i] * rates[i] * values[i] * values[i])
    }

    /// Returns `∫ row dt` over the piece.
    pub fn integral(&self, row: &[f64]) -> f64 {
        poly::dot(&self.moments, row)
    }
}

/// Returns the parts of a step up to `until`, cut where the measured time begins: low end, high end, and whether they are measured.
pub(super) fn measured_parts(
    clock: &Clock,
    from: Option<Instant>,
    step: &dyn DenseStep,
    until: f64,
) -> impl Iterator<Item = (f64, f64, bool)> + use<> {
    let wait = from.map_or(0.0, |from| clock.between(step.start(), from));
    let cut = theta_at(step, wait, until);
    [(0.0, cut, false), (cut, until, true)].into_iter().filter(|(low, high, _)| low < high)
}

/// Replaces a row by its derivative.
fn derive(row: &mut Polynomial) {
    if !row.is_empty() {
        row.remove(0);
    }
    row.iter_mut().enumerate().for_each(|(k, c)| *c *= (k + 1) as f64);
}
