//! When a transient is over: the section decides, not a count of cycles.

use std::collections::VecDeque;

use crate::hybrid::{Clock, Instant};

/// Decay per cycle below which nothing is believed.
const FASTEST: f64 = 0.99;
/// Below this a distance is rounding, whatever its trend.
const ROUNDING: f64 = 1e-12;

/// Sections of a motion, the latest last, whoever computed it, and when it counts as periodic by them.
///
/// The state `x_n` at the start of each forcing cycle is compared with `x_{n−p}` for p = 1, 2, … With `d_n` their distance
/// and `r` its decay per cycle over the last four, but at least 0.99, the motion is still about `d_n r/(1 − r)` away from
/// an orbit of period p, if it approaches one. It counts as settled when that is at most the tolerance at `max(p, 3)` sections
/// in a row, unless a divisor q of p is still in question: one with `d_n` of period q below a thousand times the tolerance.
/// The floor under r stands for slower decay that hides behind a faster one: up to 1 % a cycle it is accounted for, slower
/// than that it cannot be told from rest.
///
/// Distances are relative: displacements to the largest displacement seen, velocities to the largest velocity or to the
/// forcing frequency times the largest displacement, latched speeds each to itself.
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

    /// Distance of two sections, relative as [`Sections`] says.
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

/// The start of the cycle `cycles` after the one that `at` lies in.
#[must_use]
pub fn cycles_later(clock: &Clock, at: Instant, cycles: u64) -> Instant {
    // OK to convert: nobody runs 2⁶³ cycles.
    clock.at(at.cycle + cycles as i64, 0.0)
}
