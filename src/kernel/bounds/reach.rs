//! Length of a step while power laws are closed: as long as its defect allows.

use super::{
    bound::root_below,
    defect::{Defect, Largest},
};
use crate::{
    hybrid::Jet,
    kernel::{
        Expansion, ORDER, ROW,
        series::{clock::StepClock, fours::FourSeries},
    },
    poly::{FirstRoot, first_root},
    vectors::{Path, Work},
};

/// Usual ratio of the length of a step to its guess.
const GUESSED: f64 = 0.88;

/// Trial of the error of a step of a given length.
struct ErrorTrial<'a> {
    step: &'a Expansion<'a>,
    clock: &'a StepClock,
    theta: f64,
    largest: &'a Largest,
    fours: &'a [FourSeries],
    out: &'a Jet,
}

impl Work for ErrorTrial<'_> {
    type Output = (f64, Defect);

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> (f64, Defect) {
        self.step.defect(path, self.clock, self.theta, self.largest, self.fours, self.out)
    }
}

impl Expansion<'_> {
    /// Returns the length θ of the step and its error: the error of each quantity is at most the tolerance times its size.
    #[inline(always)]
    pub fn rooted_reach<P: Path>(&self, path: P, clock: &StepClock, out: &Jet) -> Option<(f64, Defect)> {
        let goal = self.request.tolerance;
        let room = &*self.room.borrow();
        let largest = self.largest(path, room, out);
        let trial = |theta| {
            self.s.instructions.run(ErrorTrial { step: self, clock, theta, largest: &largest, fours: &room.fours, out })
        };
        let (mut low, mut high): (Option<(f64, Defect)>, f64) = (None, f64::INFINITY);
        let row = ROW as f64;
        let guess = GUESSED * self.guess(clock, &largest);
        let (mut theta, mut order, mut before) = (guess, row, None);
        // The error is nearly a power of θ: a few trials suffice, and some more after a bad guess.
        for _ in 0..24 {
            let (share, defect) = trial(theta);
            if share <= goal {
                low = Some((theta, defect));
                if share >= 0.02 * goal || theta >= 1.0 {
                    break;
                }
            } else {
                high = theta;
            }
            if let Some((t, s)) = before
                && t != theta
            {
                let slope = libm::log(share / s) / libm::log(theta / t);
                order = if slope.is_finite() { slope.clamp(2.0, 4.0 * row) } else { order };
            }
            before = Some((theta, share));
            let next = theta * libm::pow(0.3 * goal / share, 1.0 / order).clamp(1e-6, 1e3);
            let lower = low.map_or(0.0, |(t, _)| t);
            theta = if next.is_finite() && lower < next && next < high {
                next.min(1.0)
            } else if lower > 0.0 && high.is_finite() {
                (lower * high).sqrt()
            } else {
                0.25 * theta
            };
            if theta <= lower * 1.05 {
                break;
            }
        }
        let (theta, defect) = low?;
        let cut = self.within_bound(theta, out);
        Some(if cut < theta { (cut, trial(cut).1) } else { (theta, defect) })
    }

    /// Guesses the length of the step by the root test: the coefficients of the last p + q orders (in a free contact only
    /// some of them are nonzero) reach the tolerance, relative to the largest of the first ones.
    #[inline(always)]
    fn guess(&self, clock: &StepClock, largest: &Largest) -> f64 {
        let size = |k: usize| largest.velocity[k].max(largest.felt[k]);
        let first: [f64; 17] = std::array::from_fn(|k| if k <= clock.root as usize { size(k) } else { 0.0 });
        let last: [f64; ROW] = std::array::from_fn(|k| if k > 0 && k + clock.window > ORDER { size(k) } else { 0.0 });
        let shrink = libm::pow(self.request.tolerance, 1.0 / ORDER as f64);
        let mut reach: f64 = 1.0;
        for _ in 0..4 {
            let allowed = first.iter().rev().fold((0.0, reach.powi(16)), |(m, t), a| (f64::max(m, a * t), t / reach)).0;
            let terms = last.iter().enumerate().filter(|(_, a)| **a > 0.0);
            let next = terms.fold(1.0, |m: f64, (k, a)| m.min(shrink * root_below(allowed / a, k)));
            let settled = (next - reach).abs() <= 0.1 * next;
            reach = next;
            if settled {
                break;
            }
        }
        reach
    }

    /// Limits `reach` to the bound in time.
    fn within_bound(&self, reach: f64, out: &Jet) -> f64 {
        let mut left = [0.0; ROW];
        left.iter_mut().zip(&out.time).for_each(|(l, t)| *l = -t);
        left[0] += self.request.span;
        match first_root(&left, reach, 0.0).root {
            FirstRoot::At(theta) => theta,
            FirstRoot::None => reach,
        }
    }
}
