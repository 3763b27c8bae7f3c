//! The guards of a mode as polynomials in the step's clock.

use super::{
    Expansion, FACTOR, FORCE, Force, LANES, Motion, RATE, ROW, bound::Tail, clock::StepClock, motion::Watched,
};
use crate::{
    hybrid::{GuardId, Jet},
    system::{Acting, ContactMode, Watch, guard_id, guard_of, zeros},
};

/// Rounding of a guard's value relative to the terms it is summed from: the sum itself, and what the state has
/// gathered since the last event, a few units in the last place for each of some ten steps.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// One rounding, relative to the eight that a size stands for.
const ONCE: f64 = 0.125;

/// `Σ |c|`, four side by side.
#[inline(always)]
fn size_of(series: &[f64]) -> f64 {
    let (fours, rest) = series.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for four in fours {
        sums.iter_mut().zip(four).for_each(|(sum, c)| *sum += c.abs());
    }
    sums.iter().chain(rest).fold(0.0, |sum, c| sum + c.abs())
}

impl Motion<'_> {
    /// Sizes of the terms of a guard's value, rate and acceleration: see [`JetField::term_sizes`](crate::hybrid::JetField::term_sizes).
    pub(super) fn guard_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        let (j, watch) = guard_of(id);
        let s = self.structure;
        // A force is rounded as what it is formed from: a spring's as its deflection, a multiplier as the accelerations that it balances.
        let force = |a: &Acting| match (a.force, &s.contacts[a.contact]) {
            (Force::Linear { damping, .. }, c) => c.stiffest * s.deflection_size(c, x) + damping * s.rate_size(c, x),
            (Force::Held, c) => c.effective_mass() * s.acceleration_size(a.contact, &self.mode, x, |_| 0.0),
            // It is just leaving.
            (Force::Power { .. }, _) if !step.is_estimate => 0.0,
            (Force::Power { .. }, _) => step.work[self.layout.of(a.contact, FORCE)],
        };
        let c = &s.contacts[j];
        let (deflection, rate) = (s.deflection_size(c, x), s.rate_size(c, x));
        // Flanks are reached to the rounding of the deflection, once: the springs of the bodies feel it.
        let springs = |i: u32| s.rows[i as usize].iter().map(|(_, k, _)| k.abs()).sum::<f64>();
        let displaced: f64 = c.direction.iter().map(|(i, g)| g.abs() * springs(*i)).sum::<f64>() * deflection;
        let acceleration = s.acceleration_size(j, &self.mode, x, force) + ONCE * displaced;
        let k = c.stiffest;
        match (watch, self.parts[j].force()) {
            (Watch::Force, Some(Force::Linear { damping, .. })) => {
                [k * deflection + damping * rate, k * rate + damping * acceleration, k * acceleration]
            }
            (Watch::Force, Some(power @ Force::Power { .. })) => {
                let chi = power.chi(x);
                [1.0 + chi * rate, chi * acceleration, 0.0]
            }
            (Watch::Force, _) => [c.effective_mass() * acceleration, 0.0, 0.0],
            // Where the force was zero last, the stretch is `c δ̇/k`.
            _ => [deflection + c.release_damping().map_or(0.0, |damping| damping * rate / k), rate, acceleration],
        }
    }
}

impl Expansion<'_> {
    /// Writes the guards of the mode and their errors.
    #[inline(always)]
    pub(super) fn guards(&self, clock: Option<&StepClock>, tail: &Tail, out: &mut Jet) {
        let reach = out.reach;
        let mut force_tails = zeros(self.s.contacts.len());
        for guard in self.motion.guards.iter().filter(|guard| guard.watch == Watch::Force) {
            force_tails[guard.contact] = self.force_tail(guard.contact, tail, out);
        }
        let Jet { guards, guard_series, guard_rates, guard_errors, remainder, rounding, afresh, work, .. } = out;
        guards.clear();
        remainder.clear();
        rounding.clear();
        afresh.clear();
        guard_errors.clear();
        guard_series.resize(3 * self.s.contacts.len() * ROW, 0.0);
        let is_plain = clock.is_none_or(StepClock::is_plain);
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
        for &Watched { id, contact: j, watch, sign } in &self.motion.guards {
            let (c, part) = (&self.s.contacts[j], &self.motion.parts[j]);
            let deflection_size = self.s.deflection_size(c, self.request.x);
            let stretch_size = self.stretch_size(j, clock, deflection_size, work);
            let row = guards.len() * ROW;
            let series = &mut guard_series[row..row + ROW];
            let (error, size) = match watch {
                Watch::Force => (force_tails[j], self.force_guard(j, stretch_size, sign, work, series)),
                _ if clock.is_some_and(|clock| clock.is_root_of(j)) => {
                    let y = self.layout.y(1);
                    series.copy_from_slice(&work[y..y + ROW]);
                    // Afresh from the state, a penetration within its rounding is none.
                    let stretch = work[self.layout.stretches + j].abs();
                    if self.request.carried.get(j).is_none_or(|carried| carried.is_nan())
                        && stretch <= ROUNDING * deflection_size
                    {
                        series[0] = 0.0;
                    }
                    (tail.rooted.map_or(0.0, |d| d.root), 0.0)
                }
                _ => {
                    let along = if watch == Watch::DriveFlank { -sign } else { sign };
                    let deflections = work[self.layout.deflection(j, 0)..].iter().step_by(LANES);
                    series.iter_mut().zip(deflections).for_each(|(s, d)| *s = along * d);
                    series[0] = match part.side {
                        0.0 => self.gap(j, watch, work).unwrap_or(series[0] + sign * c.gap()),
                        side => side * work[self.layout.stretches + j],
                    };
                    (self.deflection_tail(j, tail), stretch_size)
                }
            };
            series.iter_mut().zip(&powers).for_each(|(s, p)| *s *= p);
            let added = size_of(&series[1..]);
            self.write_zeros(j, watch, part.state, series);
            if let Some(d) = tail.rooted.filter(|_| !is_plain) {
                guard_rates.resize(guard_series.len(), 0.0);
                let sign = match (part.side, watch) {
                    (0.0, Watch::DriveFlank) => -1.0,
                    (0.0, _) => 1.0,
                    (side, _) => side,
                };
                let r = self.layout.of(j, RATE);
                let rates = guard_rates[row..row + ROW].iter_mut().zip(work[r..r + ROW].iter().zip(&powers));
                rates.for_each(|(g, (r, p))| *g = sign * r * p);
                // What the clock leaves out moves the guard at its rate.
                let late = d.time * work[r..r + ROW].iter().zip(&powers).map(|(r, p)| (r * p).abs()).sum::<f64>();
                let error = ROUNDING * deflection_size + self.deflection_tail(j, tail) + late;
                guard_errors.push(if watch == Watch::Force { -1.0 } else { error });
            }
            remainder.push(error);
            rounding.push(ROUNDING * size);
            afresh.push(match (watch, part.force()) {
                // A root is as well known as its power.
                _ if watch != Watch::Force && clock.is_some_and(|clock| clock.is_root_of(j)) => {
                    let root = clock.map_or(1, |clock| clock.root);
                    libm::pow(ROUNDING * (deflection_size + added.powi(root as i32)), f64::from(root).recip())
                }
                (Watch::Force, Some(Force::Linear { .. })) => ROUNDING * (size + c.stiffest * deflection_size),
                (Watch::Force, _) => ROUNDING * size,
                _ => ROUNDING * (deflection_size + added),
            });
            guards.push(id);
        }
    }

    /// What the truncated terms add to the force of a contact (of a power law: to its factor `1 + χ ṗ`).
    fn force_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        match self.motion.parts[j].force() {
            Some(power @ Force::Power { .. }) => power.chi(self.request.x) * self.rate_tail(j, tail, out),
            Some(Force::Linear { damping, .. }) => self.linear_force_tail(j, damping, tail, out),
            Some(Force::Held) | None => self.held_force_tail(j, tail, out),
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

    /// The force of a contact (of a power law: its factor `1 + χ ṗ`) as a guard, and the size of its terms; `stretch` is that of the stretch.
    fn force_guard(&self, j: usize, stretch: f64, sign: f64, work: &[f64], series: &mut [f64]) -> f64 {
        let (c, part, x) = (&self.s.contacts[j], &self.motion.parts[j], self.request.x);
        let (which, sign, size) = match part.force() {
            Some(power @ Force::Power { .. }) => (FACTOR, sign, 1.0 + power.chi(x) * self.s.rate_size(c, x)),
            Some(Force::Linear { damping, .. }) => {
                (FORCE, sign * part.side, c.stiffest * stretch + damping * self.s.rate_size(c, x))
            }
            Some(Force::Held) | None => {
                let force = |a: &Acting| work[self.layout.of(a.contact, FORCE)];
                let size = c.effective_mass() * self.s.acceleration_size(j, &self.motion.mode, x, force);
                (FORCE, sign * part.side, size)
            }
        };
        let f = self.layout.of(j, which);
        series.iter_mut().zip(&work[f..f + ROW]).for_each(|(s, f)| *s = sign * f);
        size
    }

    /// Size of the terms a stretch is the sum of: taken from the state those of the deflection; where it is known better,
    /// carried on from the last step or given by an exact zero, only itself.
    fn stretch_size(&self, j: usize, clock: Option<&StepClock>, size: f64, work: &[f64]) -> f64 {
        let carried = self.request.carried.get(j).is_some_and(|stretch| !stretch.is_nan());
        let state = self.motion.parts[j].state;
        let given = state.side() != 0.0
            && [Watch::DriveFlank, Watch::BackFlank, Watch::Force].iter().any(|w| self.pinned(j, *w));
        let gap = state == ContactMode::Separated && carried;
        if gap {
            work[self.layout.gaps + j].abs()
        } else if clock.is_none() && (carried || given) {
            work[self.layout.stretches + j].abs()
        } else {
            size
        }
    }
}
