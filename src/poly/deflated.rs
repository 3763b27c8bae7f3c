//! A polynomial that starts at an exact zero.

use super::{eval, terms};

/// A polynomial with the exact zeros at its start divided out, `p(θ) = θ^m p̃(θ)`, and its errors on `[0, 1]`.
#[derive(Clone, Copy)]
pub(crate) struct Deflated<'a> {
    /// p̃.
    pub p: &'a [f64],
    /// m.
    pub order: usize,
    /// Bound on the error at the start.
    pub start: f64,
    /// Error used in a search: the same bound, plus, after an exact zero, the rounding of the terms of the series.
    pub error: f64,
}

/// Rounding of the terms of a series beyond its start, relative to the sum of their sizes: a few units for each.
const ADDED: f64 = 8.0 * f64::EPSILON;

impl<'a> Deflated<'a> {
    /// Deflates a series `p` with values wrong by at most `tail`, and by `rounding` more where a value is formed from scratch.
    ///
    /// A series that is exactly zero at the start starts on its surface: the first non-zero derivative decides the side. A series that is
    /// zero only within the uncertainty is searched unchanged.
    #[inline(always)]
    pub fn new(p: &'a [f64], tail: f64, rounding: f64) -> Self {
        let order = p.iter().take_while(|c| **c == 0.0).count();
        // After an exact zero, errors are relative to the terms of the series.
        let (p, start) = if order == 0 { (p, tail + rounding) } else { (&p[order.min(p.len() - 1)..], tail) };
        let mut series = Self { p, order, start, error: start };
        if order > 0 {
            series.error = series.error_at(1.0);
        }
        series
    }

    /// Returns whether both series are identical, as those of equal contacts are.
    #[inline(always)]
    pub fn is_twin(&self, other: &Self) -> bool {
        self.error == other.error && self.p == other.p
    }

    /// Returns the value at `theta`.
    pub fn value(&self, theta: f64) -> f64 {
        eval(self.p, theta) * theta.powi(self.order as i32)
    }

    /// Returns a bound on the size of the values of p̃ up to `theta`.
    pub fn largest(&self, theta: f64) -> f64 {
        terms(self.p, theta)
    }

    /// Returns the error of a value of p̃ between the start and `theta`: that at the start, and the rounding of the other terms.
    #[inline(always)]
    pub fn error_at(&self, theta: f64) -> f64 {
        let first = usize::from(self.order == 0);
        self.start + ADDED * terms(&self.p[first..], theta)
    }
}
