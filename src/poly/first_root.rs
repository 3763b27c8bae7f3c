//! The first point of `[0, reach]` at which a polynomial falls below zero.

use super::{
    bernstein::{self, Bernstein, Signs},
    eval_with_derivatives, eval_with_slope,
};
use crate::vectors::{Baseline, Path};

/// First fall through zero of a polynomial that starts positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstRoot {
    /// Proven: no fall.
    None,
    /// Place of the fall, proven to be the first.
    At(f64),
}

/// Result of the isolation of the first root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isolation {
    /// The first fall through zero.
    pub root: FirstRoot,
    /// First place before the root where the polynomial is zero within the uncertainty without crossing. It is near the lowest point, which
    /// may lie beyond an end.
    pub touch: Option<f64>,
    /// Number of subdivisions.
    pub splits: u32,
    /// True if the coefficients alone prove that the polynomial is above the uncertainty on all of `[0, 1]`.
    pub is_clear: bool,
}

impl Isolation {
    const CLEAR: Self = Self { root: FirstRoot::None, touch: None, splits: 0, is_clear: true };
}

/// Maximum number of halvings: 2⁻⁵² of the step, one unit in its last place.
const MAX_DEPTH: u32 = 52;

/// Finds the first place in `[0, limit]`, `limit ≤ 1`, where `p` falls through zero.
///
/// `uncertainty ≥ 0` bounds the error of the values of `p` on `[0, 1]` (truncated tail and rounding). Values within it cannot be
/// distinguished from zero: a dip no deeper than that is a touch, not a crossing. If the first non-zero coefficient is negative, the root
/// is at 0, unless the polynomial returns above zero without a deeper dip.
///
/// # Panics
/// If `p` is empty or has a degree above [`MAX_DEGREE`](super::MAX_DEGREE).
#[must_use]
pub fn first_root(p: &[f64], limit: f64, uncertainty: f64) -> Isolation {
    if bernstein::certainly_positive(p, uncertainty) {
        Isolation::CLEAR
    } else {
        first_root_on(Baseline, p, limit, uncertainty)
    }
}

/// Does the same as [`first_root`], compiled for the set of `path`, without the test of the lowest coefficients: every set gives the same
/// bits.
#[inline(always)]
pub(crate) fn first_root_on<P: Path>(path: P, p: &[f64], limit: f64, uncertainty: f64) -> Isolation {
    let root = match bernstein::signs(path, p, limit, uncertainty) {
        Signs::Above => FirstRoot::None,
        Signs::Fall(guess) => FirstRoot::At(polish(p, 0.0, limit, guess * limit)),
        Signs::Mixed => return search(p, limit, uncertainty),
    };
    Isolation { root, is_clear: false, ..Isolation::CLEAR }
}

/// Searches for the first root by subdivision, where the signs of all coefficients together do not decide.
fn search(p: &[f64], limit: f64, uncertainty: f64) -> Isolation {
    // Trailing terms that stay far below the uncertainty only increase the degree.
    let (mut n, mut dropped) = (p.len() - 1, 0.0);
    while n > 1 && dropped + p[n].abs() <= 0.125 * uncertainty {
        dropped += p[n].abs();
        n -= 1;
    }
    let (all, p) = (p, &p[..=n]);
    let mut search = RootSearch { p, limit, uncertainty: uncertainty + dropped, shallow: None, touch: None, splits: 0 };
    let start = Bernstein::from_power(p, limit);
    // A fall below zero without a return is a crossing, however small.
    let root = search.first(start, 0.0, limit, 0).or(search.shallow);
    if let (Some(t), Some(x)) = (search.touch, root)
        && t < x
        && super::eval(p, 0.5 * (t + x)) <= search.uncertainty
    {
        // The polynomial stays within the uncertainty up to the crossing: one crossing of high order.
        search.touch = None;
    }
    let root = root.map(|root| if n + 1 < all.len() { closer(all, root, limit, dropped) } else { root });
    Isolation {
        root: root.map_or(FirstRoot::None, FirstRoot::At),
        touch: search.touch,
        splits: search.splits,
        is_clear: false,
    }
}

/// Refines a root of the shortened polynomial to that of `p` by Newton's method. It stops when the values no longer shrink, or when the
/// root moves further than the `dropped` terms explain.
fn closer(p: &[f64], root: f64, limit: f64, dropped: f64) -> f64 {
    let (mut x, (mut f, mut slope)) = (root, eval_with_slope(p, root));
    while f != 0.0 && slope < 0.0 {
        let next = (x - f / slope).clamp(0.0, limit);
        let (value, rate) = eval_with_slope(p, next);
        if value.abs() >= f.abs() || (next - root).abs() > 4.0 * dropped / slope.abs() {
            break;
        }
        (x, f, slope) = (next, value, rate);
    }
    x
}

struct RootSearch<'a> {
    p: &'a [f64],
    limit: f64,
    uncertainty: f64,
    /// Place of the last fall through zero, while the polynomial has neither gone below the uncertainty nor returned.
    shallow: Option<f64>,
    touch: Option<f64>,
    splits: u32,
}

impl RootSearch<'_> {
    fn first(&mut self, b: Bernstein, lo: f64, hi: f64, depth: u32) -> Option<f64> {
        if self.shallow.is_some() {
            return self.follow(b, lo, hi, depth);
        }
        let start = b.first_sign();
        if start < 0.0 && b.b[0] < -self.uncertainty {
            return Some(lo);
        }
        if start < 0.0 {
            // The polynomial is outside from the start, but within the uncertainty there.
            self.shallow = Some(lo);
            return self.follow(b, lo, hi, depth);
        }
        let changes = b.sign_changes();
        if changes == 0 {
            self.near(b, lo, hi, depth);
            return None;
        }
        if changes == 1 {
            let is_deep = b.coefficients().iter().any(|c| *c < -self.uncertainty);
            if b.b[b.n] < -self.uncertainty || !is_deep {
                let root = polish(self.p, lo, hi, lo + b.crossing() * (hi - lo));
                return self.fallen(root, &b);
            }
        }
        if depth >= MAX_DEPTH || b.largest() <= self.uncertainty {
            // The whole interval is within the uncertainty: a touch, unless the polynomial ends negative.
            if b.b[b.n] < 0.0 {
                return self.fallen(0.5 * (lo + hi), &b);
            }
            self.touch.get_or_insert(0.5 * (lo + hi));
            return None;
        }
        self.halves(b, lo, hi, depth)
    }

    fn halves(&mut self, mut b: Bernstein, lo: f64, hi: f64, depth: u32) -> Option<f64> {
        self.splits += 1;
        let mid = 0.5 * (lo + hi);
        let right = b.split();
        self.first(b, lo, mid, depth + 1).or_else(|| self.first(right, mid, hi, depth + 1))
    }

    /// Searches an interval without a change of sign: the first place within the uncertainty is a touch.
    fn near(&mut self, mut b: Bernstein, lo: f64, hi: f64, depth: u32) {
        if self.touch.is_some() || b.first_sign() <= 0.0 || b.coefficients().iter().all(|c| *c > self.uncertainty) {
            return;
        }
        // A polynomial that falls strictly up to the limit has no minimum inside.
        if hi >= self.limit && b.coefficients().is_sorted_by(|a, b| a > b) {
            return;
        }
        if b.largest() <= self.uncertainty || depth >= MAX_DEPTH {
            self.touch = Some(0.5 * (lo + hi));
            return;
        }
        self.splits += 1;
        let mid = 0.5 * (lo + hi);
        let right = b.split();
        self.near(b, lo, mid, depth + 1);
        self.near(right, mid, hi, depth + 1);
    }

    /// Handles a fall through zero at `root` on an interval that ends below zero: a crossing if its end is deeper than the uncertainty.
    fn fallen(&mut self, root: f64, b: &Bernstein) -> Option<f64> {
        if b.b[b.n] < -self.uncertainty {
            return Some(root);
        }
        self.shallow = Some(root);
        None
    }

    /// Continues after a shallow fall. The fall is a crossing if the polynomial gets deeper than the uncertainty before it returns above
    /// zero, else a touch.
    fn follow(&mut self, b: Bernstein, lo: f64, hi: f64, depth: u32) -> Option<f64> {
        let end = b.b[b.n];
        let is_deep = b.coefficients().iter().any(|c| *c < -self.uncertainty);
        if end < -self.uncertainty && b.sign_changes() == 0 {
            return self.shallow;
        }
        if !is_deep && (end <= 0.0 || b.sign_changes() <= 1) || depth >= MAX_DEPTH {
            if end > 0.0 {
                self.touch = self.touch.or(self.shallow.take());
            }
            return None;
        }
        self.halves(b, lo, hi, depth)
    }
}

/// Step of Halley's method, relative to the root, after which it has arrived. One part of the error is then `step³ p‴/6p′`, and
/// `|p‴| ≤ n³ Σ|p_k|`: for the degrees of this module that is far below the rounding of the root, `ε Σ|p_k|/|p′|`.
const CLOSE: f64 = 1e-9;

/// Returns the single zero in `[lo, hi]`, where `p` falls: Halley's method inside a shrinking bracket.
#[inline(always)]
fn polish(p: &[f64], mut lo: f64, mut hi: f64, start: f64) -> f64 {
    let mut x = start;
    for _ in 0..100 {
        let [f, slope, bent] = eval_with_derivatives(p, x);
        if f == 0.0 {
            return x;
        }
        if f > 0.0 {
            lo = x;
        } else {
            hi = x;
        }
        // Ratios are used because products of small values vanish.
        let newton = -f / slope;
        let step = newton / (1.0 + 0.5 * newton * (bent / slope));
        let is_inside = x + step >= lo && x + step <= hi;
        let next = if is_inside { x + step } else { 0.5 * (lo + hi) };
        // The other part of the error is `step³ (p″/2p′)²`.
        let share = step * (bent / slope);
        let is_close = is_inside && step.abs() <= CLOSE * x && share * share * step.abs() <= f64::EPSILON * x;
        if is_close || (next - x).abs() <= f64::EPSILON * x || hi - lo <= f64::EPSILON * hi {
            return next;
        }
        x = next;
    }
    x
}
