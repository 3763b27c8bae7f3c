//! How far a series holds, and what it leaves out.

use super::{Expansion, ORDER};
use crate::{
    gear::contact::Law,
    hybrid::Jet,
    train::{assemble::Contact, contact_mode::contact_mode},
};

/// Largest ratio of successive terms the tail is summed with.
const LARGEST_RATIO: f64 = 0.75;

/// A little less than `x^(1/k)` for `x > 0`, within 7 %: the exponent and the leading bits divided by k.
///
/// The double's bits are a piecewise linear logarithm, off by at most 0.0861 in log₂, twice over in the quotient.
pub(super) fn root_below(x: f64, k: usize) -> f64 {
    const ONE: i64 = 1023 << 52;
    let bits = (x.to_bits() as i64 - ONE) / k as i64 + ONE;
    f64::from_bits(bits as u64) * 0.94
}

impl Expansion<'_> {
    /// The weighted size of the rates at order `k`, those of the contacts included.
    fn size(&self, k: usize, out: &Jet) -> f64 {
        let s = self.s;
        let v = &out.state[k * s.dim + s.n..k * s.dim + 2 * s.n];
        let size = v.iter().zip(&s.weights).fold(0.0, |m: f64, (v, w)| m.max(v.abs() * w));
        // (δ̇)_k = (k+1) δ_{k+1}/h.
        let k = k.min(ORDER - 1) + 1;
        let per_time = k as f64 / self.h;
        s.contacts
            .iter()
            .enumerate()
            .fold(size, |m, (j, c)| m.max((out.work[self.layout.deflection(j, k)] * per_time).abs() * c.weight))
    }

    /// Largest `θ ≤ 1` at which the series holds in plain time: the last two terms are below `tolerance` times the largest of
    /// the first ones. Not finite if the coefficients overflowed.
    pub(super) fn reach(&self, out: &Jet) -> f64 {
        let tolerance = self.request.tolerance;
        let first = [0, 1, 2].map(|k| self.size(k, out));
        let last = [ORDER - 1, ORDER].map(|k| self.size(k, out));
        if !first.iter().chain(&last).all(|v| v.is_finite()) {
            return f64::NAN;
        }
        let mut reach: f64 = 1.0;
        for _ in 0..4 {
            let allowed = tolerance * first[0].max(first[1] * reach).max(first[2] * reach * reach);
            let terms = last.iter().zip([ORDER - 1, ORDER]).filter(|(a, _)| **a > allowed);
            let next = terms.fold(1.0, |m: f64, (a, k)| m.min(root_below(allowed / a, k)));
            let settled = (next - reach).abs() <= 0.1 * next;
            reach = next;
            if settled {
                break;
            }
        }
        // The tail is proven only where it falls like a geometric series.
        let proven = LARGEST_RATIO * ORDER as f64 / (self.h * self.growth());
        if self.s.affine { reach.min(proven) } else { reach }
    }

    /// Bound on the growth rate of the mode, 1/s; with every contact open, that of the structure alone.
    fn growth(&self) -> f64 {
        let s = self.s;
        let open = |(j, c): (usize, &Contact)| {
            !matches!(c.spec.law, Law::Bilateral(_)) && !contact_mode(self.request.mode, j).is_closed()
        };
        let growth = if s.contacts.iter().enumerate().all(open) { s.open_growth } else { s.growth };
        s.oscillators.iter().fold(growth, |g, o| g.max(o.omega))
    }

    /// Writes what the truncated terms can add to each contact's rate up to `reach`, and returns the
    /// factor that turns that into deflection, s.
    ///
    /// For affine modes `‖x_{k+1}‖ ≤ ‖x_k‖ h L/(k+1)` with L the growth bound: a geometric tail, a proof.
    /// Where a product or a power of series is involved the ratio of the last terms stands for L: an estimate.
    pub(super) fn tail(&self, out: &mut Jet) -> f64 {
        let s = self.s;
        let h = self.h * out.reach;
        let power = out.reach.powi(ORDER as i32 - 1);
        let last = [self.size(ORDER - 1, out) * power, self.size(ORDER, out) * power * out.reach];
        let mut ratio = h * self.growth() / ORDER as f64;
        if !s.affine {
            let before = self.size(ORDER - 2, out) * power / out.reach;
            if before > 0.0 {
                ratio = ratio.max((last[1] / before).sqrt());
            }
        }
        let ratio = ratio.min(LARGEST_RATIO);
        let beyond = last[0].max(last[1]) * ratio / (1.0 - ratio);
        for (j, c) in s.contacts.iter().enumerate() {
            out.work[self.layout.tails + j] = beyond * c.across;
        }
        h / ORDER as f64
    }
}
