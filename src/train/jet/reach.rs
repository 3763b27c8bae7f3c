//! How far a series in a root clock holds, and what it leaves out: estimates from its last terms.

use super::{
    Expansion, ORDER, ROW,
    bound::{Tail, root_below},
    rooted::Owner,
};
use crate::{
    hybrid::Jet,
    poly::{FirstRoot, first_root},
};

/// Largest ratio of successive terms the tail is summed with.
const LARGEST_RATIO: f64 = 0.75;

impl Expansion<'_> {
    /// Largest `θ ≤ 1` at which the series holds, and what it leaves out; `None` if the coefficients overflowed.
    ///
    /// Only every (p+q)-th term may be there, and the radius of convergence is finite: the root test over the last p+q terms
    /// gives the radius R, and `(reach/R)^N` is brought below the tolerance.
    pub(super) fn rooted_reach(&self, owner: Owner, out: &Jet) -> Option<(f64, Tail)> {
        const LAST: usize = ORDER - 1;
        let first = [0, 1, 2].map(|k| self.size(k, out));
        let window = ((owner.law.exponent.p + owner.root) as usize).min(LAST);
        let shrink = self.request.tolerance.powf(1.0 / LAST as f64);
        let mut last = [0.0; ORDER];
        for (a, k) in last[..window].iter_mut().zip(LAST + 1 - window..) {
            *a = self.size(k, out);
        }
        if !first.iter().chain(&last).all(|v| v.is_finite()) {
            return None;
        }
        let mut reach: f64 = 1.0;
        for _ in 0..4 {
            let allowed = first[0].max(first[1] * reach).max(first[2] * reach * reach);
            let mut next: f64 = 1.0;
            for (a, k) in last[..window].iter().zip(LAST + 1 - window..) {
                if *a > 0.0 {
                    next = next.min(shrink * root_below(allowed / a, k));
                }
            }
            let settled = (next - reach).abs() <= 0.1 * next;
            reach = next;
            if settled {
                break;
            }
        }
        let reach = self.within_bound(reach, out);
        Some((reach, self.rooted_tail(reach, out)))
    }

    /// In a root clock, not beyond the bound in time.
    fn within_bound(&self, reach: f64, out: &Jet) -> f64 {
        let mut left = [0.0; ROW];
        left.iter_mut().zip(&out.time).for_each(|(l, t)| *l = -t);
        left[0] += self.request.span;
        match first_root(&left, reach, 0.0).root {
            FirstRoot::At(theta) => theta,
            FirstRoot::None => reach,
        }
    }

    /// The ratio of the last terms stands for that of all to come.
    fn rooted_tail(&self, reach: f64, out: &Jet) -> Tail {
        let power = reach.powi(ORDER as i32 - 2);
        let [before, last, end] = [ORDER - 3, ORDER - 2, ORDER - 1].map(|k| self.size(k, out));
        let (before, last, end) = (before * power / reach, last * power, end * power * reach);
        let ratio = if before > 0.0 { (end / before).sqrt().min(LARGEST_RATIO) } else { LARGEST_RATIO };
        let velocity = last.max(end) * ratio / (1.0 - ratio);
        let displacement = velocity * self.h * reach / ORDER as f64;
        Tail { velocity, displacement, waves: [0.0; 2], free: [0.0; 3], is_estimate: true }
    }
}
