//! End of a transient: found by the sections of the motion, not by a count of cycles.

use std::collections::VecDeque;

use crate::hybrid::{Clock, Instant};

/// Least decay factor per cycle that is assumed, however fast distances decay.
const FASTEST: f64 = 0.99;
/// Distance below which a difference is rounding, whatever its trend.
const ROUNDING: f64 = 1e-12;

/// Sections of a motion, the latest last, and the criterion by which the motion counts as periodic.
///
/// The state `x_n` at the start of each forcing cycle is compared with `x_{n−p}` for p = 1, 2, … With `d_n` their distance and `r` its
/// decay per cycle over the last four, but at least 0.99, the motion is still about `d_n r/(1 − r)` away from an orbit of period p, if it
/// approaches one. It counts as settled when that is at most the tolerance at `max(p, 3)` successive sections. A divisor q of p with `d_n`
/// of period q below a thousand times the tolerance delays this. The lower bound of r covers slower decay that a faster one hides: up to 1
/// % a cycle. Still slower decay cannot be distinguished from rest.
///
/// Distances are relative: displacements to the largest displacement so far, velocities to the largest velocity or to the forcing frequency
/// times the largest displacement, each latched speed to itself.
#[derive(Clone, Debug)]
pub struct Sections {
    displacements: usize,
    velocities: usize,
    /// Forcing frequency, rad/s.
    omega: f64,
    states: VecDeque<Vec<f64>>,
    scale: [f64; 2],
    /// Latest distances for each period, and the number of successive sections near enough to an orbit.
    near: Vec<(VecDeque<f64>, usize)>,
}

/// Cycles over which decay is computed.
const DECAY: usize = 4;
/// Distance, in tolerances, below which a shorter period is in question.
const DOUBT: f64 = 1e3;

impl Sections {
    /// Returns an empty list of sections of a motion of `freedoms` displacements, forced at ω, rad/s, for orbits of up to `periods` cycles.
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

    /// Returns the distance of two sections, relative as in [`Sections`].
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

    /// Returns the latest distance of sections `p` apart.
    fn latest(&self, p: usize) -> f64 {
        self.near[p - 1].0.back().copied().unwrap_or(f64::INFINITY)
    }

    /// Returns the last `count` sections, or fewer if there are not so many; at most the longest period.
    pub fn last(&self, count: usize) -> impl Iterator<Item = &[f64]> {
        self.states.iter().skip(self.states.len().saturating_sub(count)).map(Vec::as_slice)
    }

    /// Adds a section `(q, q̇, latched)`; returns the period of its orbit and the estimated distance from it, once they are known.
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

/// Returns the start of the cycle `cycles` after that of `at`.
#[must_use]
pub fn cycles_later(clock: &Clock, at: Instant, cycles: u64) -> Instant {
    // Exact: no run has 2⁶³ cycles.
    clock.at(at.cycle + cycles as i64, 0.0)
}
