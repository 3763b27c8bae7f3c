//! Taylor steps, and Radau steps where the motion shows no trace of the fast rates that limit Taylor steps.

use std::{collections::BTreeSet, ops::ControlFlow};

use super::{
    Arc, DenseStep, IntegrateError, Integrator, Taylor,
    dense::{Pieces, StepPosition},
    radau::{From, HIDDEN, RESOLVED, Radau},
};
use crate::{
    hybrid::{FULL_PRECISION, GuardSet, HybridSystem, Instant, Mode},
    poly::CHEBYSHEV,
};

/// Number of Taylor steps of an arc before the first trial; doubled after each refusal.
const FIRST_TRIAL: u64 = 64;
/// Relative accuracy of the interpolation of guards on a Radau step, equal to that of the step.
const RTOL: f64 = 1e-13;

/// Returns the number of Taylor steps that a Radau step must replace to be worth its linear algebra. Its matrices have the order 9 d for d
/// components; a Taylor step costs about 100 d multiplications or more.
fn worth(dim: usize) -> f64 {
    3.0 * dim as f64 + (dim as f64).powi(3) / 8.0
}

/// The Taylor method, relieved within an arc by Radau IIA of order 17.
///
/// A stiff contact limits a Taylor step to some radians of its own frequency, even after that frequency has died away. After 64 steps of an
/// arc a Radau step of many times their mean length is tried. It is accepted if its polynomial follows the motion to `2e-14` of the
/// [`sizes`](HybridSystem::sizes). Radau continues while its steps are long enough. Motion below that is stepped over, and counts in the
/// uncertainty of guards.
#[derive(Debug, Default)]
pub struct Relay {
    taylor: Taylor,
    radau: Radau,
    pieces: Pieces,
    x: Vec<f64>,
    /// State at the start of a part integrated by Taylor steps, `[dim]`.
    leg_start: Vec<f64>,
    /// Amplitude of each component that Radau steps may have hidden, `[dim]`.
    unsure: Vec<f64>,
    sizes: Vec<f64>,
    ends: Vec<f64>,
    relieved: BTreeSet<Mode>,
}

/// An accepted Radau step.
#[derive(Clone, Copy)]
struct RadauStep {
    at: Instant,
    h: f64,
    /// Ratio of its last coefficient to the permitted one.
    share: f64,
    /// Fastest rate that it may have stepped over, 1/s.
    rate: f64,
}

/// Place of a trial step.
struct TrialStep<'a> {
    system: &'a dyn HybridSystem,
    arc: &'a Arc<'a>,
    at: Instant,
    shortest: f64,
}

impl TrialStep<'_> {
    /// Returns the longest accepted step from `x` up to `h`, with the state at its end in `end`. `sizes` becomes the smaller of the sizes
    /// at both ends.
    fn longest(
        &self,
        radau: &mut Radau,
        mut h: f64,
        x: &[f64],
        sizes: &mut [f64],
        end: &mut [f64],
    ) -> Option<RadauStep> {
        let left = self.system.clock().between(self.at, self.arc.bound);
        loop {
            h = h.min(left);
            if h < self.shortest && h < left {
                return None;
            }
            let (share, rate) = self.attempt(radau, h, x, sizes, end).unwrap_or((f64::INFINITY, 0.0));
            if share <= 1.0 {
                return Some(RadauStep { at: self.at, h, share, rate });
            }
            h *= next(share);
        }
    }

    fn attempt(&self, radau: &mut Radau, h: f64, x: &[f64], sizes: &mut [f64], end: &mut [f64]) -> Option<(f64, f64)> {
        let (system, mode) = (self.system, self.arc.mode);
        let field = system.field();
        let rate = system.sizes(mode, self.at, x, sizes)?;
        let share = radau.attempt(From { field, mode, at: self.at, x }, h, sizes)?;
        end.copy_from_slice(x);
        radau.advance(end);
        let mut later = vec![0.0; x.len()];
        system.sizes(mode, system.clock().advance(self.at, h), end, &mut later)?;
        let mut shrunk: f64 = 1.0;
        for (size, later) in sizes.iter_mut().zip(&later) {
            shrunk = shrunk.max(*size / later);
            *size = size.min(*later);
        }
        Some((share * shrunk, rate))
    }
}

/// Returns the factor for the length of the next step: the last coefficient is as h⁹, with a tenth of margin, and at most doubling.
fn next(share: f64) -> f64 {
    (0.9 * libm::pow(share.max(1e-9), -1.0 / 9.0)).clamp(0.3, 2.0)
}

impl Integrator for Relay {
    fn name(&self) -> &'static str {
        "taylor"
    }

    /// Returns true: Radau relieves only power laws, and a power law with an exact leap needs no relief.
    fn is_exact(&mut self, _: &dyn HybridSystem, _: &Mode, _: f64) -> bool {
        true
    }

    fn restart(&mut self) {
        self.relieved.clear();
    }

    fn chosen(&self) -> Vec<(Mode, &'static str)> {
        self.relieved.iter().map(|mode| (mode.clone(), "taylor and radau")).collect()
    }

    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        low: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError> {
        let Self { taylor, radau, pieces, x, leg_start, unsure, sizes, ends, relieved } = self;
        let clock = *system.clock();
        let worth = worth(arc.x.len());
        x.clear();
        x.extend_from_slice(arc.x);
        [&mut *sizes, &mut *ends].into_iter().for_each(|v| v.resize(arc.x.len(), 0.0));
        let (mut at, mut pinned, mut still) = (arc.at, arc.pinned, arc.still);
        let (mut own, mut carried) = (arc.low, arc.carried);
        let mut due = FIRST_TRIAL.max(worth as u64);
        taylor.blur.clear();
        unsure.clear();
        unsure.resize(arc.x.len(), 0.0);
        let mut before = arc.before;
        loop {
            let (mut steps, mut elapsed, mut taken, mut ended) = (0, 0.0, None, false);
            leg_start.clone_from(x);
            let leg = Arc { at, x: leg_start, low: own, carried, pinned, still, before, ..*arc };
            taylor.integrate_arc(system, &leg, end, low, &mut |step| {
                if visit(step).is_break() {
                    ended = true;
                    return ControlFlow::Break(());
                }
                steps += 1;
                elapsed += step.time(1.0);
                if steps >= due {
                    due *= 2;
                    let shortest = worth * elapsed / steps as f64;
                    let trial = TrialStep { system, arc, at: clock.advance(step.start(), step.time(1.0)), shortest };
                    step.state(1.0, x);
                    if shortest < clock.between(trial.at, arc.bound) {
                        taken = trial.longest(radau, 4.0 * shortest, x, sizes, ends);
                    }
                }
                if taken.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })?;
            let Some(mut step) = taken.filter(|_| !ended) else { return Ok(()) };
            relieved.insert(arc.mode.clone());
            before.left_out = taylor.left_out;
            (own, carried) = (&[], &[]);
            low.fill(0.0);
            let shortest = worth * elapsed / steps as f64;
            loop {
                let left = clock.between(step.at, arc.bound);
                // The hidden part includes the truncation of the Taylor steps on request.
                let hidden = HIDDEN * RESOLVED + 2.0 * (arc.tolerance - FULL_PRECISION);
                unsure.iter_mut().zip(&*sizes).for_each(|(u, s)| *u = u.max(hidden * s));
                let leg = Arc { at: step.at, x, low: own, pinned: GuardSet::none(), still: GuardSet::none(), ..*arc };
                let to = (step.h < left).then_some(step.h);
                let place = StepPosition { system, arc: &leg, rtol: RTOL, from: 0.0, to, unsure };
                pieces.begin(&place);
                radau.write(x, |k, l| CHEBYSHEV.powers[k][l], &mut pieces.step);
                if !pieces.visit(&place, |step| visit(step).is_continue()) {
                    return Ok(());
                }
                x.copy_from_slice(ends);
                if to.is_none() {
                    end.copy_from_slice(x);
                    return Ok(());
                }
                at = clock.advance(step.at, step.h);
                let trial = TrialStep { system, arc, at, shortest };
                let Some(longest) = trial.longest(radau, step.h * next(step.share), x, sizes, ends) else { break };
                // Adiabatic: a free oscillation that is not followed has an amplitude as 1/√rate.
                unsure.iter_mut().for_each(|u| *u *= (step.rate / longest.rate).sqrt().max(1.0));
                step = longest;
            }
            taylor.blur = pieces.blurs(system, arc.mode, at, x, unsure);
            (pinned, still) = (GuardSet::none(), GuardSet::none());
        }
    }
}
