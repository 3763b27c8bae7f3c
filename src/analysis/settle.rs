//! When a transient is over: the section decides, not a count of cycles.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::Window;
use crate::{
    engine::{Engine, EngineError, Observer, Outcome},
    hybrid::{Clock, Instant},
    task::Task,
};

/// When a motion counts as periodic.
///
/// The state `x_n` at the start of each forcing cycle is compared with `x_{n−p}` for p = 1, 2, … With `d_n` their distance
/// and `r` its decay per cycle over the last four, but at least 0.99, the motion is still about `d_n r/(1 − r)` away from
/// an orbit of period p, if it approaches one. It counts as settled when that is at most `tolerance` at `max(p, 3)` sections
/// in a row, unless a divisor q of p is still in question: one with `d_n` of period q below a thousand times the tolerance.
/// The floor under r stands for slower decay that hides behind a faster one: up to 1 % a cycle it is accounted for, slower
/// than that it cannot be told from rest.
///
/// Distances are relative: displacements to the largest displacement seen, velocities to the largest velocity or to the
/// forcing frequency times the largest displacement, latched speeds each to itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settling {
    /// Largest relative distance from the orbit, > 0.
    pub tolerance: f64,
    /// Longest period looked for, forcing cycles, ≥ 1.
    pub longest_period: u32,
    /// Cycles after which the motion counts as irregular (or too slow to settle).
    pub most_cycles: u64,
}

impl Default for Settling {
    fn default() -> Self {
        Self { tolerance: 1e-9, longest_period: 8, most_cycles: 400 }
    }
}

/// How a motion was found to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    /// Period in forcing cycles; none if no orbit was approached.
    pub period: Option<u32>,
    /// Cycles run until this was known.
    pub cycles: u64,
    /// Estimated relative distance from the orbit; the distance of the last two sections if there is none.
    pub distance: f64,
    /// Without a period: the sections were still closing up when the cycles were spent, so that the motion is a long
    /// transient rather than an irregular one.
    pub decaying: bool,
}

impl Settled {
    /// `periodic`, `settling` (a transient that outlasts the cycles allowed) or `irregular`.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self { period: Some(_), .. } => "periodic",
            Self { decaying: true, .. } => "settling",
            _ => "irregular",
        }
    }

    /// The window that spectra of this motion want, taken over whole cycles (and periods).
    #[must_use]
    pub fn window(&self) -> Window {
        if self.period.is_some() { Window::Rectangular } else { Window::Hann }
    }
}

/// Decay per cycle below which nothing is believed.
const FASTEST: f64 = 0.99;
/// Motions whose sections close up by this factor over the second half of the cycles allowed are decaying.
const CLOSING: f64 = 0.5;

/// Below this a distance is rounding, whatever its trend.
const ROUNDING: f64 = 1e-12;

/// Sections of a motion, the latest last, whoever computed it: the rule of [`Settling`] at work.
#[derive(Clone, Debug)]
pub struct Sections {
    displacements: usize,
    velocities: usize,
    /// Forcing frequency, rad/s.
    omega: f64,
    states: VecDeque<Vec<f64>>,
    scale: [f64; 2],
    /// For each period: its latest distances, and sections in a row near enough to an orbit.
    near: Vec<(VecDeque<f64>, usize)>,
}

/// Cycles over which decay is taken.
const DECAY: usize = 4;
/// A shorter period is in question while its distance is below this many tolerances.
const DOUBT: f64 = 1e3;

impl Sections {
    /// No sections yet of a motion of `freedoms` displacements, forced at ω, rad/s, with orbits of up to `periods` looked for.
    #[must_use]
    pub fn new(freedoms: usize, omega: f64, periods: u32) -> Self {
        Self {
            displacements: freedoms,
            velocities: 2 * freedoms,
            omega,
            states: VecDeque::new(),
            scale: [f64::MIN_POSITIVE; 2],
            near: vec![(VecDeque::new(), 0); periods as usize],
        }
    }

    /// Distance of two sections, relative as [`Settling`] says.
    #[must_use]
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).enumerate().fold(0.0, |most, (i, (a, b))| {
            let scale = match i {
                _ if i < self.displacements => self.scale[0],
                _ if i < self.velocities => self.scale[1],
                _ => a.abs().max(b.abs()).max(f64::MIN_POSITIVE),
            };
            f64::max(most, (a - b).abs() / scale)
        })
    }

    /// Latest distance of sections `p` apart.
    fn latest(&self, p: usize) -> f64 {
        self.near[p - 1].0.back().copied().unwrap_or(f64::INFINITY)
    }

    /// Smallest of the latest distances.
    fn nearest(&self) -> f64 {
        (1..=self.near.len()).map(|p| self.latest(p)).fold(f64::INFINITY, f64::min)
    }

    /// The last `count` sections, or fewer where there are not so many; at most the longest period.
    pub fn last(&self, count: usize) -> impl Iterator<Item = &[f64]> {
        self.states.iter().skip(self.states.len().saturating_sub(count)).map(Vec::as_slice)
    }

    /// Takes a section `(q, q̇, latched)`; gives the period of the orbit it lies on and the estimated distance from it, once
    /// they are known.
    pub fn take(&mut self, x: &[f64], tolerance: f64) -> Option<(u32, f64)> {
        let largest = |part: &[f64], best: f64| part.iter().fold(best, |m, v| m.max(v.abs()));
        self.scale[0] = largest(&x[..self.displacements], self.scale[0]);
        let speed = self.omega * self.scale[0];
        self.scale[1] = largest(&x[self.displacements..self.velocities], self.scale[1]).max(speed);
        let mut found = None;
        for p in 1..=self.near.len() {
            let Some(earlier) = self.states.len().checked_sub(p).map(|i| &self.states[i]) else { break };
            let distance = self.distance(x, earlier);
            let doubtful = (1..p).any(|q| p.is_multiple_of(q) && self.latest(q) < DOUBT * tolerance);
            let (distances, row) = &mut self.near[p - 1];
            let left = match (distance, distances.front()) {
                (d, _) if d <= ROUNDING => d,
                (d, Some(&first)) if distances.len() == DECAY && d < first => {
                    let ratio = libm::pow(d / first, 1.0 / DECAY as f64).max(FASTEST);
                    d * ratio / (1.0 - ratio)
                }
                _ => f64::INFINITY,
            };
            *row = if left <= tolerance { *row + 1 } else { 0 };
            if found.is_none() && !doubtful && *row >= p.max(3) {
                found = Some((p as u32, left));
            }
            if distances.len() == DECAY {
                distances.pop_front();
            }
            distances.push_back(distance);
        }
        if self.states.len() == self.near.len() {
            self.states.pop_front();
        }
        self.states.push_back(x.to_vec());
        found
    }
}

/// Runs `engine` from the start of cycle to the start of cycle until its motion is periodic, by the rule given, or until
/// the cycles allowed are spent. `freedoms` is the number n of displacements: the state is `(q, q̇, latched)`.
///
/// Returns `None` if the run was broken off: by `task`, by the observer or by the engine's own event budget.
///
/// # Errors
/// [`EngineError`] of the run.
pub fn settle(
    engine: &mut Engine<'_>,
    clock: &Clock,
    freedoms: usize,
    rule: &Settling,
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<Option<Settled>, EngineError> {
    let mut sections = Sections::new(freedoms, clock.omega(), rule.longest_period.max(1));
    let first = engine.state().at;
    // A start within a cycle first completes it.
    let mut next = if clock.between(clock.at(first.cycle, 0.0), first) > 0.0 { first.cycle + 1 } else { first.cycle };
    let mut halfway = f64::INFINITY;
    let mut settled = Settled { distance: f64::INFINITY, ..Settled::default() };
    loop {
        if engine.run(clock.at(next, 0.0), observer)? != Outcome::ReachedEnd || task.is_cancelled() {
            return Ok(None);
        }
        if let Some((period, distance)) = sections.take(&engine.state().x, rule.tolerance) {
            return Ok(Some(Settled { period: Some(period), distance, ..settled }));
        }
        settled.distance = sections.latest(1);
        if settled.cycles == rule.most_cycles / 2 {
            halfway = sections.nearest();
        }
        if settled.cycles >= rule.most_cycles {
            settled.decaying = sections.nearest() <= CLOSING * halfway;
            return Ok(Some(settled));
        }
        settled.cycles += 1;
        next += 1;
    }
}

/// The start of the cycle `cycles` after the one that `at` lies in.
#[must_use]
pub fn cycles_later(clock: &Clock, at: Instant, cycles: u64) -> Instant {
    // OK to convert: nobody runs 2⁶³ cycles.
    clock.at(at.cycle + cycles as i64, 0.0)
}
