//! The guards of a mode as polynomials in the step's clock.

use super::{Expansion, FACTOR, FORCE, LANES, Layout, RATE, ROW, bound::Tail, rooted::Owner};
use crate::{
    gear::contact::{Law, Release},
    hybrid::{Guard, GuardId, Jet, Mode},
    train::{
        assemble::{Contact, MAX_CONTACTS, Structure},
        contact_mode::{ContactMode, Watch, contact_mode, guard_id, guard_of, watches},
    },
};

/// Rounding of a guard's value relative to the terms it is summed from: the sum itself, and what the state has
/// gathered since the last event, a few units in the last place for each of some ten steps.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// One rounding, relative to the eight that a size stands for.
const ONCE: f64 = 0.125;

impl Structure {
    /// Sizes of the terms of a guard's value, rate and acceleration: see [`JetField::term_sizes`](crate::hybrid::JetField::term_sizes).
    pub(super) fn guard_sizes(&self, mode: Mode, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        let (j, watch) = guard_of(id);
        let (c, layout) = (&self.contacts[j], Layout::new(self));
        // A force is rounded as what it is formed from: a spring's as its deflection, a multiplier as the accelerations that it balances.
        let force = |k: usize| match (&self.contacts[k], self.contacts[k].spec.law) {
            (c, Law::Bilateral(l) | Law::KelvinVoigt(l, _)) => {
                c.spec.stiffness.maximum() * self.deflection_size(c, x) + l.damping * self.rate_size(c, x)
            }
            (c, Law::Rigid(_)) => c.effective_mass() * self.acceleration_size(k, mode, x, |_| 0.0),
            (_, Law::Power(_)) => step.work[layout.of(k, FORCE)],
        };
        let (deflection, rate) = (self.deflection_size(c, x), self.rate_size(c, x));
        // Flanks are reached to the rounding of the deflection, once: the springs of the bodies feel it.
        let springs = |i: u32| self.rows[i as usize].iter().map(|(_, k, _)| k.abs()).sum::<f64>();
        let displaced: f64 = c.direction.iter().map(|(i, g)| g.abs() * springs(*i)).sum::<f64>() * deflection;
        let acceleration = self.acceleration_size(j, mode, x, force) + ONCE * displaced;
        match (watch, c.spec.law) {
            (Watch::Force, Law::Bilateral(l) | Law::KelvinVoigt(l, _)) => {
                let k = c.spec.stiffness.maximum();
                [k * deflection + l.damping * rate, k * rate + l.damping * acceleration, k * acceleration]
            }
            (Watch::Force, Law::Power(l)) => {
                let chi = c.latch.map_or(0.0, |i| l.hysteresis / x[i]);
                [1.0 + chi * rate, chi * acceleration, 0.0]
            }
            (Watch::Force, Law::Rigid(_)) => [c.effective_mass() * acceleration, 0.0, 0.0],
            // Where the force was zero last, the stretch is `c δ̇/k`.
            (_, Law::KelvinVoigt(l, Release::Force)) => {
                [deflection + l.damping * rate / c.spec.stiffness.maximum(), rate, acceleration]
            }
            _ => [deflection, rate, acceleration],
        }
    }

    /// What is watched on a contact in `state`, with the sign that makes it positive inside.
    pub(in crate::train) fn watched(&self, c: &Contact, state: ContactMode) -> &'static [(Watch, f64)] {
        match c.spec.law {
            Law::Bilateral(_) => &[],
            Law::KelvinVoigt(_, Release::Force) => match state {
                // The force reaches zero no later than the deflection does.
                ContactMode::Drive | ContactMode::Back => &[(Watch::Force, 1.0)],
                _ => watches(state, true, false, c.has_back()),
            },
            Law::KelvinVoigt(_, Release::Deflection) => watches(state, false, false, c.has_back()),
            Law::Power(_) => watches(state, c.latch.is_some(), false, c.has_back()),
            // Held on its flank by others.
            Law::Rigid(_) if state.side() != 0.0 && !state.is_closed() => &[],
            Law::Rigid(_) => watches(state, false, true, c.has_back()),
        }
    }
}

impl Expansion<'_> {
    /// Writes the guards of the mode and their errors.
    pub(super) fn guards(&self, owner: Option<Owner>, tail: &Tail, out: &mut Jet) {
        let reach = out.reach;
        let mut force_tails = [0.0; MAX_CONTACTS];
        for (j, c) in self.s.contacts.iter().enumerate() {
            let watched = self.s.watched(c, contact_mode(self.request.mode, j));
            if watched.iter().any(|(watch, _)| *watch == Watch::Force) {
                force_tails[j] = self.force_tail(j, tail, out);
            }
        }
        let Jet { guards, guard_series, guard_rates, guard_errors, remainder, rounding, afresh, work, .. } = out;
        guards.clear();
        remainder.clear();
        rounding.clear();
        afresh.clear();
        guard_errors.clear();
        guard_series.resize(3 * self.s.contacts.len() * ROW, 0.0);
        let mut powers = [1.0; ROW + 3];
        powers[1] = reach;
        powers[2] = reach * reach;
        powers[3] = powers[2] * reach;
        let fourth = powers[2] * powers[2];
        for k in (4..ROW).step_by(4) {
            for l in k..k + 4 {
                powers[l] = powers[l - 4] * fourth;
            }
        }
        for (j, c) in self.s.contacts.iter().enumerate() {
            let state = contact_mode(self.request.mode, j);
            for &(watch, sign) in self.s.watched(c, state) {
                let id = guard_id(j, watch);
                let row = guards.len() * ROW;
                let series = &mut guard_series[row..row + ROW];
                let (error, size) = match watch {
                    Watch::Force => (force_tails[j], self.force_guard(j, owner, sign, work, series)),
                    _ if owner.is_some_and(|o| o.contact == j && o.root > 1) => {
                        let y = self.layout.y(1);
                        series.copy_from_slice(&work[y..y + ROW]);
                        // Afresh from the state, a penetration within its rounding is none.
                        let stretch = work[self.layout.stretches + j].abs();
                        if self.request.carried.get(j).is_none_or(|carried| carried.is_nan())
                            && stretch <= ROUNDING * self.s.deflection_size(c, self.request.x)
                        {
                            series[0] = 0.0;
                        }
                        (tail.rooted.map_or(0.0, |d| d.root), 0.0)
                    }
                    _ => {
                        let along = if watch == Watch::DriveFlank { -sign } else { sign };
                        let deflections = work[self.layout.deflection(j, 0)..].iter().step_by(LANES);
                        series.iter_mut().zip(deflections).for_each(|(s, d)| *s = along * d);
                        series[0] = match state.side() {
                            0.0 => self.gap(j, watch, work).unwrap_or(series[0] + sign * c.gap()),
                            side => side * work[self.layout.stretches + j],
                        };
                        (self.deflection_tail(j, tail), self.stretch_size(j, owner, work))
                    }
                };
                series.iter_mut().zip(&powers).for_each(|(s, p)| *s *= p);
                let added = series[1..].iter().fold(0.0, |sum, s| sum + s.abs());
                self.write_zeros(j, watch, state, series);
                if let Some(d) = tail.rooted {
                    guard_rates.resize(guard_series.len(), 0.0);
                    let sign = match (state.side(), watch) {
                        (0.0, Watch::DriveFlank) => -1.0,
                        (0.0, _) => 1.0,
                        (side, _) => side,
                    };
                    let r = self.layout.of(j, RATE);
                    let rates = guard_rates[row..row + ROW].iter_mut().zip(work[r..r + ROW].iter().zip(&powers));
                    rates.for_each(|(g, (r, p))| *g = sign * r * p);
                    // What the clock leaves out moves the guard at its rate.
                    let late = d.time * work[r..r + ROW].iter().zip(&powers).map(|(r, p)| (r * p).abs()).sum::<f64>();
                    let error =
                        ROUNDING * self.s.deflection_size(c, self.request.x) + self.deflection_tail(j, tail) + late;
                    guard_errors.push(if watch == Watch::Force { -1.0 } else { error });
                }
                remainder.push(error);
                rounding.push(ROUNDING * size);
                afresh.push(match (watch, c.spec.law) {
                    (Watch::Force, Law::KelvinVoigt(..)) => {
                        let deflection = self.s.deflection_size(c, self.request.x);
                        ROUNDING * (size + c.spec.stiffness.maximum() * deflection)
                    }
                    (Watch::Force, _) => ROUNDING * size,
                    _ => ROUNDING * (self.s.deflection_size(c, self.request.x) + added),
                });
                guards.push(Guard { id });
            }
        }
    }

    /// What the truncated terms add to the force of a contact (of a power law: to its factor `1 + χ ṗ`).
    fn force_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        let c = &self.s.contacts[j];
        match c.spec.law {
            Law::Power(l) => c.latch.map_or(0.0, |i| l.hysteresis / self.request.x[i]) * self.rate_tail(j, tail, out),
            Law::Rigid(_) => self.held_force_tail(j, tail, out),
            Law::Bilateral(l) | Law::KelvinVoigt(l, _) => self.linear_force_tail(j, l.damping, tail, out),
        }
    }

    /// What is exactly zero by construction is written so.
    fn write_zeros(&self, j: usize, watch: Watch, state: ContactMode, series: &mut [f64]) {
        if self.request.pinned.is_empty() {
            return;
        }
        let force = self.pinned(j, Watch::Force);
        if watch == Watch::Force && force {
            series[0] = 0.0;
        }
        if force && state == ContactMode::Separated && self.request.still.contains(guard_id(j, watch)) {
            // Released from rest: value, rate and acceleration of the gap are all zero.
            series[..3].fill(0.0);
        }
    }

    /// The force of a contact (of a power law: its factor `1 + χ ṗ`) as a guard, and the size of its terms.
    fn force_guard(&self, j: usize, owner: Option<Owner>, sign: f64, work: &[f64], series: &mut [f64]) -> f64 {
        let (c, state) = (&self.s.contacts[j], contact_mode(self.request.mode, j));
        let (which, sign) =
            if matches!(c.spec.law, Law::Power(_)) { (FACTOR, sign) } else { (FORCE, sign * state.side()) };
        let f = self.layout.of(j, which);
        series.iter_mut().zip(&work[f..f + ROW]).for_each(|(s, f)| *s = sign * f);
        match c.spec.law {
            Law::Power(l) => {
                let chi = c.latch.map_or(0.0, |i| l.hysteresis / self.request.x[i]);
                1.0 + chi * self.s.rate_size(c, self.request.x)
            }
            Law::Rigid(_) => {
                let force = |k| work[self.layout.of(k, FORCE)];
                c.effective_mass() * self.s.acceleration_size(j, self.request.mode, self.request.x, force)
            }
            Law::Bilateral(l) | Law::KelvinVoigt(l, _) => {
                let k = c.spec.stiffness.maximum();
                k * self.stretch_size(j, owner, work) + l.damping * self.s.rate_size(c, self.request.x)
            }
        }
    }

    /// Size of the terms a stretch is the sum of: taken from the state those of the deflection; where it is known better,
    /// carried on from the last step or given by an exact zero, only itself.
    fn stretch_size(&self, j: usize, owner: Option<Owner>, work: &[f64]) -> f64 {
        let c = &self.s.contacts[j];
        let carried = self.request.carried.get(j).is_some_and(|stretch| !stretch.is_nan());
        let given = contact_mode(self.request.mode, j).side() != 0.0
            && [Watch::DriveFlank, Watch::BackFlank, Watch::Force].iter().any(|w| self.pinned(j, *w));
        let gap = contact_mode(self.request.mode, j) == ContactMode::Separated && carried;
        if gap {
            work[self.layout.gaps + j].abs()
        } else if owner.is_none() && (carried || given) {
            work[self.layout.stretches + j].abs()
        } else {
            self.s.deflection_size(c, self.request.x)
        }
    }
}
