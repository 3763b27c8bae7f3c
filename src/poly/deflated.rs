//! A polynomial that starts at an exact zero.

use super::{eval, terms};

/// A polynomial with the exact zeros at its start divided out, `p(θ) = θ^m p̃(θ)`, and its errors on `[0, 1]`.
#[derive(Clone, Copy)]
pub(crate) struct Deflated<'a> {
    /// p̃.
    pub p: &'a [f64],
    /// m.
    pub order: usize,
    /// Bound on the error where it starts.
    pub start: f64,
    /// The error that a search goes by: the same, or from an exact zero on that of what the series adds.
    pub error: f64,
}

/// Rounding of what a series adds to its start, relative to the sum of its terms: a few units for each.
const ADDED: f64 = 8.0 * f64::EPSILON;

impl<'a> Deflated<'a> {
    /// Of a series `p` whose values are off by at most `tail`, and where one is formed from scratch by `rounding`.
    ///
    /// One that is exactly zero at the start starts on its surface: the first non-zero derivative decides which side it goes to. One that
    /// only cannot be told from zero is searched as it is.
    pub fn new(p: &'a [f64], tail: f64, rounding: f64) -> Self {
        let order = p.iter().take_while(|c| **c == 0.0).count();
        // From an exact zero on, errors are relative to what the series adds.
        let (p, start) = if order == 0 { (p, tail + rounding) } else { (&p[order.min(p.len() - 1)..], tail) };
        let mut series = Self { p, order, start, error: start };
        if order > 0 {
            series.error = series.error_at(1.0);
        }
        series
    }

    /// Whether both are the same all the way, as those of equal contacts are.
    #[inline(always)]
    pub fn is_twin(&self, other: &Self) -> bool {
        self.error == other.error && self.p == other.p
    }

    /// The value at `theta`.
    pub fn value(&self, theta: f64) -> f64 {
        eval(self.p, theta) * theta.powi(self.order as i32)
    }

    /// A bound on the size of the values of p̃ up to `theta`.
    pub fn largest(&self, theta: f64) -> f64 {
        terms(self.p, theta)
    }

    /// The error of a value of p̃ between the start and `theta`: that of the start, and that of what the series adds.
    pub fn error_at(&self, theta: f64) -> f64 {
        let first = usize::from(self.order == 0);
        self.start + ADDED * terms(&self.p[first..], theta)
    }
}
