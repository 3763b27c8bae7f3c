//! Largest and smallest value on `[0, 1]`.

use super::{
    MAX_DEGREE,
    bernstein::{Bernstein, certainly_positive},
    eval, eval_with_slope,
};

/// Rounding as a share of the size of the values: values that differ by less are equal.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Halvings after which an interval is as short as the spacing of numbers near one.
const MAX_DEPTH: u32 = 52;

/// Returns the largest and the smallest value of `p` on `[0, 1]`, to rounding; for an empty `p`, which is zero, 0 and 0.
///
/// Interior extremes are roots of the derivative, isolated by its Bernstein coefficients. These are the differences of the coefficients of
/// `p`; one sign change among them proves one root. Intervals are skipped if the coefficients of `p` prove that it stays between values
/// already found.
///
/// # Panics
/// If the degree is above [`MAX_DEGREE`].
#[must_use]
pub fn extremes(p: &[f64]) -> [f64; 2] {
    let size = p.iter().fold(0.0, |sum, c| sum + c.abs());
    // Trailing terms within rounding only make the polynomial longer.
    let (mut n, mut dropped) = (p.len(), 0.0);
    while n > 1 && dropped + p[n - 1].abs() <= 0.25 * f64::EPSILON * size {
        dropped += p[n - 1].abs();
        n -= 1;
    }
    if n < 2 {
        let value = p.first().copied().unwrap_or(0.0);
        return [value; 2];
    }
    let p = &p[..n];
    let (start, end) = (p[0], eval(p, 1.0));
    let mut slope = [0.0; MAX_DEGREE + 1];
    let slope = derivative(p, &mut slope);
    let mut search = ExtremeSearch { p, slope, found: [start.max(end), start.min(end)], rounding: ROUNDING * size };
    if has_one_sign(slope) {
        return search.found;
    }
    let mut curvature = [0.0; MAX_DEGREE + 1];
    if !has_one_sign(derivative(slope, &mut curvature)) {
        search.look(Bernstein::from_power(p, 1.0), 0.0, 1.0, 0);
    } else if slope[0] * eval(slope, 1.0) < 0.0 {
        search.take(eval(p, search.turn(0.0, 1.0, -slope[0])));
    }
    search.found
}

/// Number of halvings after which two minima cannot be distinguished.
const APART: u32 = 20;

/// Returns the places of the local minima of `p` inside `(0, 1)`, in order: the roots of its derivative with rising sign.
///
/// # Panics
/// If the degree is above [`MAX_DEGREE`].
#[must_use]
pub fn minima(p: &[f64]) -> Vec<f64> {
    let mut slope = [0.0; MAX_DEGREE + 1];
    let mut found = Vec::new();
    if p.len() > 2 {
        let slope = derivative(p, &mut slope);
        let search = ExtremeSearch { p, slope, found: [0.0; 2], rounding: 0.0 };
        search.rises(Bernstein::from_power(slope, 1.0), 0.0, 1.0, 0, &mut found);
    }
    found
}

fn derivative<'a>(p: &[f64], out: &'a mut [f64; MAX_DEGREE + 1]) -> &'a [f64] {
    for (k, (d, c)) in out.iter_mut().zip(&p[1..]).enumerate() {
        *d = (k + 1) as f64 * c;
    }
    &out[..p.len() - 1]
}

/// Returns whether a few Bernstein coefficients prove that `p` does not change its sign on `[0, 1]`.
fn has_one_sign(p: &[f64]) -> bool {
    let mut negative = [0.0; MAX_DEGREE + 1];
    match p.first() {
        None => true,
        Some(start) if *start > 0.0 => certainly_positive(p, 0.0),
        _ => {
            negative.iter_mut().zip(p).for_each(|(n, c)| *n = -c);
            certainly_positive(&negative[..p.len()], 0.0)
        }
    }
}

struct ExtremeSearch<'a> {
    p: &'a [f64],
    slope: &'a [f64],
    /// Largest and smallest value so far.
    found: [f64; 2],
    rounding: f64,
}

impl ExtremeSearch<'_> {
    fn take(&mut self, value: f64) {
        self.found = [self.found[0].max(value), self.found[1].min(value)];
    }

    fn rises(&self, mut b: Bernstein, low: f64, high: f64, depth: u32, found: &mut Vec<f64>) {
        let middle = 0.5 * (low + high);
        match b.sign_changes() {
            0 => {}
            1 if b.first_sign() > 0.0 => {}
            1 => found.push(self.turn(low, high, 1.0)),
            _ if depth >= APART => {}
            _ => {
                let right = b.split();
                // A root exactly between both halves.
                if right.b[0] == 0.0 && b.first_sign() < 0.0 {
                    found.push(middle);
                }
                self.rises(b, low, middle, depth + 1, found);
                self.rises(right, middle, high, depth + 1, found);
            }
        }
    }

    fn look(&mut self, mut b: Bernstein, low: f64, high: f64, depth: u32) {
        let between = |c: &f64| *c <= self.found[0] + self.rounding && *c >= self.found[1] - self.rounding;
        if b.coefficients().iter().all(between) {
            return;
        }
        let slopes = b.coefficients().windows(2).map(|pair| pair[1] - pair[0]).filter(|slope| *slope != 0.0);
        let (mut changes, mut last) = (0, 0.0);
        for slope in slopes {
            changes += u32::from(slope * last < 0.0);
            last = slope;
        }
        let middle = 0.5 * (low + high);
        match changes {
            0 => {}
            1 => self.take(eval(self.p, self.turn(low, high, last))),
            _ if depth >= MAX_DEPTH => self.take(eval(self.p, middle)),
            _ => {
                let right = b.split();
                self.take(right.b[0]);
                self.look(b, low, middle, depth + 1);
                self.look(right, middle, high, depth + 1);
            }
        }
    }

    /// Returns the value at the single root of the derivative in `[low, high]`, where it changes to the sign of `last`. Newton's method
    /// stays inside a shrinking bracket. The value is wrong by the square of the error of the place.
    fn turn(&self, mut low: f64, mut high: f64, last: f64) -> f64 {
        let mut x = 0.5 * (low + high);
        for _ in 0..100 {
            let (slope, curvature) = eval_with_slope(self.slope, x);
            if slope * last > 0.0 {
                high = x;
            } else {
                low = x;
            }
            let newton = x - slope / curvature;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            // The square of this is below rounding.
            if (next - x).abs() <= 1e-9 {
                return next;
            }
            x = next;
        }
        x
    }
}
