//! The guards of a mode as polynomials in the step's clock.

use super::{
    Expansion, FACTOR, FORCE, Force, LANES, Motion, RATE, ROW, bound::Tail, clock::StepClock, motion::ModeGuard,
};
use crate::{
    hybrid::{GuardId, Jet},
    system::{ActiveContact, ContactMode, Watch, guard_id, guard_of, zeros},
};

/// Rounding of the value of a guard relative to the terms of its sum: that of the sum itself, and that which the state has
/// gathered since the last event, a few units in the last place for each of some ten steps.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// One rounding, relative to the eight that a size includes.
const ONCE: f64 = 0.125;

/// Returns `Σ |c|`, summed four side by side.
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
    /// Returns the term sizes of value, rate, acceleration of a guard: see [`JetField::term_sizes`](crate::hybrid::JetField::term_sizes).
    pub(super) fn guard_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        let (j, watch) = guard_of(id);
        let s = self.structure;
        // The rounding of a force is that of its terms: the deflection of a spring, the accelerations balanced by a multiplier.
        let force = |a: &ActiveContact| match (a.force, &s.contacts[a.contact]) {
            (Force::Linear { damping, .. }, c) => c.stiffest * s.deflection_size(c, x) + damping * s.rate_size(c, x),
            (Force::Held, c) => c.effective_mass() * s.acceleration_size(a.contact, std::iter::empty(), x, |_| 0.0),
            // The contact leaves at this instant.
            (Force::Power { .. }, _) if !step.is_estimate => 0.0,
            (Force::Power { .. }, _) => step.work[self.layout.of(a.contact, FORCE)],
        };
        let c = &s.contacts[j];
        let (deflection, rate) = (s.deflection_size(c, x), s.rate_size(c, x));
        // A flank is reached to the rounding of the deflection, once: it changes the springs of the bodies.
        let displaced: f64 =
            c.direction.iter().map(|(i, g)| g.abs() * s.pulls[*i as usize][1]).sum::<f64>() * deflection;
        let acceleration = s.acceleration_size(j, self.carrying(), x, force) + ONCE * displaced;
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

/// Powers of the reach, in whole vectors of four.
pub(super) type Powers = [f64; ROW + 3];

/// Returns the powers `reachᵏ`.
#[inline(always)]
pub(super) fn powers(reach: f64) -> Powers {
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
    powers
}

impl Expansion<'_> {
    /// Writes the guards of the mode and their errors.
    #[inline(always)]
    pub(super) fn guards(&self, clock: Option<&StepClock>, tail: &Tail, out: &mut Jet) {
        let mut force_tails = zeros(self.s.contacts.len());
        for guard in self.motion.guards.iter().filter(|guard| guard.watch == Watch::Force) {
            force_tails[guard.contact] = self.force_tail(guard.contact, tail, out);
        }
        let Jet { reach, guards, guard_series, guard_rates, guard_errors, remainder, rounding, afresh, work, .. } = out;
        guards.clear();
        remainder.clear();
        rounding.clear();
        afresh.clear();
        guard_errors.clear();
        guard_series.resize(3 * self.s.contacts.len() * ROW, 0.0);
        let is_plain = clock.is_none_or(StepClock::is_plain);
        let powers = powers(*reach);
        for watched in &self.motion.guards {
            let &ModeGuard { id, contact: j, watch, .. } = watched;
            let part = &self.motion.parts[j];
            let deflection_size = work[self.layout.sizes + j];
            let stretch_size = self.stretch_size(j, clock, deflection_size, work);
            let row = guards.len() * ROW;
            let series = &mut guard_series[row..row + ROW];
            let root = clock.filter(|clock| watch != Watch::Force && clock.is_root_of(j)).map(|clock| clock.root);
            let error = match root {
                _ if watch == Watch::Force => {
                    let [rounded, from_state] =
                        self.force_row(watched, stretch_size, deflection_size, &powers, work, series);
                    rounding.push(rounded);
                    afresh.push(from_state);
                    force_tails[j]
                }
                Some(root) => {
                    self.root_row(j, deflection_size, &powers, work, series);
                    rounding.push(0.0);
                    // The error of a root follows from that of its power.
                    let power = deflection_size + size_of(&series[1..]).powi(root as i32);
                    afresh.push(libm::pow(ROUNDING * power, f64::from(root).recip()));
                    tail.rooted.map_or(0.0, |d| d.root)
                }
                None => {
                    self.position_row(watched, &powers, work, series);
                    rounding.push(ROUNDING * stretch_size);
                    afresh.push(ROUNDING * (deflection_size + size_of(&series[1..])));
                    self.deflection_tail(j, tail)
                }
            };
            remainder.push(error);
            guards.push(id);
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
                // The truncation of the clock moves the guard at its rate.
                let late = d.time * work[r..r + ROW].iter().zip(&powers).map(|(r, p)| (r * p).abs()).sum::<f64>();
                let error = ROUNDING * deflection_size + self.deflection_tail(j, tail) + late;
                guard_errors.push(if watch == Watch::Force { -1.0 } else { error });
            }
        }
    }

    /// Returns the value of a guard of position at the start.
    #[inline(always)]
    pub(super) fn position(&self, watched: &ModeGuard, work: &[f64]) -> f64 {
        let &ModeGuard { contact: j, watch, sign, .. } = watched;
        match self.motion.parts[j].side {
            0.0 => match self.gap(j, watch, work) {
                Some(gap) => gap,
                None => watched.along() * work[self.layout.deflection(j, 0)] + sign * self.s.contacts[j].gap(),
            },
            side => side * work[self.layout.stretches + j],
        }
    }

    /// Writes a guard of position as a series in θ.
    #[inline(always)]
    pub(super) fn position_row(&self, watched: &ModeGuard, powers: &Powers, work: &[f64], series: &mut [f64]) {
        let (along, j) = (watched.along(), watched.contact);
        let first = self.layout.deflection(j - j % LANES, 0);
        let deflections = work[first..first + ROW * LANES].as_chunks::<LANES>().0;
        for ((s, four), p) in series.iter_mut().zip(deflections).zip(powers) {
            *s = along * four[j % LANES] * p;
        }
        series[0] = self.position(watched, work);
        if self.is_released(watched.contact, watched.watch) {
            series[..3].fill(0.0);
        }
    }

    /// Writes the force of a contact, or its factor, as a series in θ. Returns its rounding, and that of a value formed from the state
    /// alone. `stretch` and `deflection` are the sizes of their terms.
    #[inline(always)]
    pub(super) fn force_row(
        &self,
        watched: &ModeGuard,
        stretch: f64,
        deflection: f64,
        powers: &Powers,
        work: &[f64],
        series: &mut [f64],
    ) -> [f64; 2] {
        let j = watched.contact;
        let size = self.force_guard(j, stretch, watched.sign, work, series);
        series.iter_mut().zip(powers).for_each(|(s, p)| *s *= p);
        if self.pinned(j, Watch::Force) {
            series[0] = 0.0;
        }
        let from_state = match self.motion.parts[j].force() {
            Some(Force::Linear { .. }) => size + self.s.contacts[j].stiffest * deflection,
            _ => size,
        };
        [ROUNDING * size, ROUNDING * from_state]
    }

    /// Writes the root of a penetration as a series in θ.
    #[inline(always)]
    fn root_row(&self, j: usize, deflection: f64, powers: &Powers, work: &[f64], series: &mut [f64]) {
        let y = self.layout.y(1);
        series.iter_mut().zip(&work[y..y + ROW]).zip(powers).for_each(|((s, y), p)| *s = y * p);
        // If formed afresh from the state, a penetration within its rounding is zero.
        let stretch = work[self.layout.stretches + j].abs();
        if self.request.carried.get(j).is_none_or(|carried| carried.is_nan()) && stretch <= ROUNDING * deflection {
            series[0] = 0.0;
        }
    }

    /// Returns the contribution of the truncated terms to the force of a contact (of a power law: to its factor `1 + χ ṗ`).
    pub(super) fn force_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        match self.motion.parts[j].force() {
            Some(power @ Force::Power { .. }) => power.chi(self.request.x) * self.rate_tail(j, tail, out),
            Some(Force::Linear { damping, .. }) => self.linear_force_tail(j, damping, tail, out),
            Some(Force::Held) | None => self.held_force_tail(j, tail, out),
        }
    }

    /// Returns whether the contact is released from rest: value, rate and acceleration of the gap are exactly zero.
    #[inline(always)]
    pub(super) fn is_released(&self, j: usize, watch: Watch) -> bool {
        !self.request.still.is_empty()
            && self.motion.parts[j].state == ContactMode::Separated
            && self.pinned(j, Watch::Force)
            && self.request.still.contains(guard_id(j, watch))
    }

    /// Writes the force of a contact (or the factor `1 + χ ṗ` of a power law) as a guard. Returns the size of its terms, from `stretch`.
    fn force_guard(&self, j: usize, stretch: f64, sign: f64, work: &[f64], series: &mut [f64]) -> f64 {
        let (c, part, x) = (&self.s.contacts[j], &self.motion.parts[j], self.request.x);
        let (which, sign, size) = match part.force() {
            Some(power @ Force::Power { .. }) => (FACTOR, sign, 1.0 + power.chi(x) * self.s.rate_size(c, x)),
            Some(Force::Linear { damping, .. }) => {
                (FORCE, sign * part.side, c.stiffest * stretch + damping * self.s.rate_size(c, x))
            }
            Some(Force::Held) | None => {
                let force = |a: &ActiveContact| work[self.layout.of(a.contact, FORCE)];
                let size = c.effective_mass() * self.s.acceleration_size(j, self.motion.carrying(), x, force);
                (FORCE, sign * part.side, size)
            }
        };
        let f = self.layout.of(j, which);
        series.iter_mut().zip(&work[f..f + ROW]).for_each(|(s, f)| *s = sign * f);
        size
    }

    /// Returns the size of the terms whose sum is a stretch: those of the deflection if it comes from the state. A stretch that is
    /// known better, carried from the last step or given by an exact zero, is the only term.
    #[inline(always)]
    pub(super) fn stretch_size(&self, j: usize, clock: Option<&StepClock>, size: f64, work: &[f64]) -> f64 {
        let carried = self.request.carried.get(j).is_some_and(|stretch| !stretch.is_nan());
        let state = self.motion.parts[j].state;
        let given = state.side() != 0.0
            && !self.request.pinned.is_empty()
            && [Watch::DriveFlank, Watch::BackFlank, Watch::Force].iter().any(|w| self.pinned(j, *w));
        let gap = work[self.layout.gaps + j].abs();
        // A gap that is zero by chance is not exact, and is taken from the state.
        if state == ContactMode::Separated && carried && gap != 0.0 {
            gap
        } else if clock.is_none() && (carried || given) {
            work[self.layout.stretches + j].abs()
        } else {
            size
        }
    }
}
