//! Taylor steps, and Radau steps where the motion shows no trace of the fast rates that bound Taylor's.

use std::{collections::BTreeSet, ops::ControlFlow};

use super::{
    Arc, DenseStep, IntegrateError, Integrator, Taylor,
    dense::{Pieces, Place},
    radau::{From, HIDDEN, RESOLVED, Radau},
};
use crate::hybrid::{Flow, Guard, GuardId, GuardSet, HybridSystem, Instant, Mode};

/// Taylor steps of an arc before the first trial; twice as many after each refusal.
const FIRST_TRIAL: u64 = 64;
/// Relative accuracy to which guards are interpolated on a Radau step: its own.
const RTOL: f64 = 1e-13;

/// Taylor steps that a Radau step must replace to be worth its linear algebra. Its matrices have the order 9 d for d
/// components, a Taylor step costs about as much as 100 d multiplications and more.
fn worth(dim: usize) -> f64 {
    3.0 * dim as f64 + (dim as f64).powi(3) / 8.0
}

/// The Taylor method, relieved in mid-arc by Radau IIA of order 17.
///
/// A stiff contact holds a Taylor step to some radians of its own frequency, even where all that frequency has died away.
/// After 64 steps of an arc a Radau step of many times their mean length is tried. It is taken if its polynomial
/// follows the motion to `2e-14` of the sizes that the system names ([`sizes`](HybridSystem::sizes)), and goes on as long
/// as its steps are long enough to be worth it. Motion that hides below that is stepped over; guards bear it as uncertainty.
#[derive(Debug)]
pub struct Relay {
    taylor: Taylor,
    radau: Radau,
    pieces: Pieces,
    x: Vec<f64>,
    sizes: Vec<f64>,
    ends: Vec<f64>,
    relieved: BTreeSet<Mode>,
}

impl Default for Relay {
    fn default() -> Self {
        Self {
            taylor: Taylor::default(),
            radau: Radau::default(),
            pieces: Pieces::new(),
            x: Vec::new(),
            sizes: Vec::new(),
            ends: Vec::new(),
            relieved: BTreeSet::new(),
        }
    }
}

/// A step whose guards are uncertain by what was stepped over before.
struct Blurred<'a> {
    step: &'a dyn DenseStep,
    blur: &'a [(GuardId, f64)],
}

impl Blurred<'_> {
    fn of(&self, i: usize) -> f64 {
        let id = self.step.guards()[i].id;
        self.blur.iter().find(|(guard, _)| *guard == id).map_or(0.0, |(_, blur)| *blur)
    }
}

impl DenseStep for Blurred<'_> {
    fn start(&self) -> Instant {
        self.step.start()
    }
    fn time(&self, theta: f64) -> f64 {
        self.step.time(theta)
    }
    fn rate(&self, theta: f64) -> f64 {
        self.step.rate(theta)
    }
    fn state(&self, theta: f64, x: &mut [f64]) {
        self.step.state(theta, x);
    }
    fn guards(&self) -> &[Guard] {
        self.step.guards()
    }
    fn guard(&self, i: usize) -> &[f64] {
        self.step.guard(i)
    }
    fn guard_error(&self, i: usize) -> (f64, f64) {
        let (tail, rounding) = self.step.guard_error(i);
        // In a clock of its own a guard may be a root; its uncertainty in time says it all.
        let is_plain = self.step.guard_in_time(i, 0.0).is_none();
        (tail + if is_plain { self.of(i) } else { 0.0 }, rounding)
    }
    fn plain_span(&self) -> Option<f64> {
        self.step.plain_span()
    }
    fn guard_in_time(&self, i: usize, theta: f64) -> Option<(f64, f64)> {
        self.step.guard_in_time(i, theta).map(|(rate, error)| (rate, error + self.of(i)))
    }
    fn guard_derivatives_in_time(&self, i: usize) -> Option<[f64; 3]> {
        self.step.guard_derivatives_in_time(i)
    }
}

/// What a Radau step is tried on.
#[derive(Clone, Copy)]
struct Trial<'a> {
    system: &'a dyn HybridSystem,
    mode: Mode,
    at: Instant,
    h: f64,
}

/// Tries a step from `x`; its last coefficient over what is allowed, and the fastest rate that it may have stepped over.
/// `sizes` becomes the smaller ones of the step's ends.
fn attempt(radau: &mut Radau, t: Trial<'_>, x: &[f64], sizes: &mut Vec<f64>, end: &mut Vec<f64>) -> Option<(f64, f64)> {
    let (Flow::Jet(_, field) | Flow::Smooth(field)) = t.system.flow();
    sizes.resize(x.len(), 0.0);
    let rate = t.system.sizes(t.mode, t.at, x, sizes)?;
    let share = radau.attempt(From { field, mode: t.mode, at: t.at, x }, t.h, sizes)?;
    end.clear();
    end.extend_from_slice(x);
    radau.advance(end);
    let mut later = vec![0.0; x.len()];
    t.system.sizes(t.mode, t.system.clock().advance(t.at, t.h), end, &mut later)?;
    let mut shrunk: f64 = 1.0;
    for (size, later) in sizes.iter_mut().zip(&later) {
        if later < size {
            shrunk = shrunk.max(*size / later);
            *size = *later;
        }
    }
    Some((share * shrunk, rate))
}

impl Integrator for Relay {
    fn name(&self) -> &'static str {
        "taylor"
    }

    fn order(&self) -> Option<u32> {
        None
    }

    fn chosen(&self) -> Vec<(Mode, &'static str)> {
        self.relieved.iter().map(|mode| (*mode, "taylor and radau")).collect()
    }

    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError> {
        let Self { taylor, radau, pieces, x, sizes, ends, relieved } = self;
        let clock = *system.clock();
        let worth = worth(arc.x.len());
        x.clear();
        x.extend_from_slice(arc.x);
        let (mut at, mut pinned, mut still) = (arc.at, arc.pinned, arc.still);
        let (mut due, mut blur) = (FIRST_TRIAL.max(worth as u64), Vec::new());
        let mut unsure: Vec<f64> = Vec::new();
        loop {
            let (mut steps, mut elapsed, mut first, mut ended) = (0, 0.0, None, false);
            let from = x.clone();
            let leg = Arc { at, x: &from, pinned, still, ..*arc };
            taylor.integrate_arc(system, &leg, end, &mut |step| {
                let step = Blurred { step, blur: &blur };
                if visit(&step).is_break() {
                    ended = true;
                    return ControlFlow::Break(());
                }
                steps += 1;
                elapsed += step.time(1.0);
                if steps >= due {
                    due *= 2;
                    let (at, h) = (clock.advance(step.start(), step.time(1.0)), 4.0 * worth * elapsed / steps as f64);
                    if h <= clock.between(at, arc.bound) {
                        step.state(1.0, x);
                        let found = attempt(radau, Trial { system, mode: arc.mode, at, h }, x, sizes, ends);
                        first = found.filter(|(share, _)| *share <= 1.0).map(|(share, rate)| (at, h, share, rate));
                    }
                }
                if first.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })?;
            let Some((start, mut h, mut share, mut rate)) = first.filter(|_| !ended) else { return Ok(()) };
            relieved.insert(arc.mode);
            let shortest = worth * elapsed / steps as f64;
            at = start;
            unsure.resize(x.len(), 0.0);
            loop {
                let left = clock.between(at, arc.bound);
                // Adiabatic: a free oscillation that nobody follows has an amplitude as 1/√rate.
                unsure.iter_mut().zip(&*sizes).for_each(|(u, s)| *u = u.max(HIDDEN * RESOLVED * s));
                let leg = Arc { at, x, pinned: GuardSet::EMPTY, still: GuardSet::EMPTY, ..*arc };
                let to = (h < left).then_some(h);
                let place = Place { system, arc: &leg, rtol: RTOL, from: 0.0, to, unsure: &unsure };
                pieces.begin(&place);
                let powers = pieces.powers();
                radau.write(x, |k, l| powers[k][l], &mut pieces.step);
                if !pieces.visit(&place, |step| visit(step).is_continue()) {
                    return Ok(());
                }
                x.copy_from_slice(ends);
                if h >= left {
                    end.copy_from_slice(x);
                    return Ok(());
                }
                at = clock.advance(at, h);
                let next = loop {
                    // The last coefficient is as h⁹; a tenth less for safety, and no leap.
                    h *= (0.9 * share.max(1e-9).powf(-1.0 / 9.0)).clamp(0.3, 2.0);
                    let left = clock.between(at, arc.bound);
                    h = if h > left { left } else { h };
                    if h < shortest && h < left {
                        break None;
                    }
                    match attempt(radau, Trial { system, mode: arc.mode, at, h }, x, sizes, ends) {
                        Some((s, r)) if s <= 1.0 => break Some((s, r)),
                        Some((s, _)) => share = s,
                        None => share = f64::INFINITY,
                    }
                };
                let Some((s, r)) = next else { break };
                unsure.iter_mut().for_each(|u| *u *= (rate / r).sqrt().max(1.0));
                (share, rate) = (s, r);
            }
            blur = pieces.blurs(system, arc.mode, at, x, &unsure);
            (pinned, still) = (GuardSet::EMPTY, GuardSet::EMPTY);
            due = due.max(FIRST_TRIAL);
        }
    }
}
