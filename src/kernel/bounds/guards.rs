//! The guards of a mode as polynomials in the step's clock.

use super::bound::Tail;
use crate::{
    hybrid::{GuardId, Jet},
    kernel::{
        Expansion, Force, LANES, Motion, ROUNDING, ROW, StepRows, mode::motion::ModeGuard, series::clock::StepClock,
    },
    system::{ActiveContact, ContactMode, Watch, guard_id, guard_of, zeros},
};

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
    pub fn guard_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        let (j, watch) = guard_of(id);
        let s = self.structure;
        // The rounding of a force is that of its terms: the deflection of a spring, the accelerations balanced by a multiplier.
        let force = |a: &ActiveContact| match (a.force, &s.contacts[a.contact]) {
            (Force::Linear { damping, .. }, c) => c.stiffest * s.deflection_size(c, x) + damping * s.rate_size(c, x),
            (Force::Held, c) => c.effective_mass() * s.acceleration_size(a.contact, std::iter::empty(), x, |_| 0.0),
            // The contact leaves at this instant.
            (Force::Power { .. }, _) if !step.is_estimate => 0.0,
            (Force::Power { .. }, _) => step.rows.contacts[a.contact].force[0],
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
            _ => [
                deflection + c.spec.law.release_damping().map_or(0.0, |damping| damping * rate / k),
                rate,
                acceleration,
            ],
        }
    }
}

/// Powers of the reach, in whole vectors of four.
pub type Powers = [f64; ROW + 3];

/// Returns the powers `reachᵏ`.
#[inline(always)]
pub fn powers(reach: f64) -> Powers {
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
    pub fn guards(&self, clock: Option<&StepClock>, tail: &Tail, out: &mut Jet) {
        let mut force_tails = zeros(self.s.contacts.len());
        for guard in self.motion.guards.iter().filter(|guard| guard.watch == Watch::Force) {
            force_tails[guard.contact] = self.force_tail(guard.contact, tail, out);
        }
        let Jet { reach, guards, guard_series, guard_rates, guard_errors, remainder, rounding, afresh, rows, .. } = out;
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
            let deflection_size = rows.size(j);
            let stretch_size = self.stretch_size(j, clock, deflection_size, rows);
            let row = guards.len() * ROW;
            let series = &mut guard_series[row..row + ROW];
            let root = clock.filter(|clock| watch != Watch::Force && clock.is_root_of(j)).map(|clock| clock.root);
            let error = match root {
                _ if watch == Watch::Force => {
                    let [rounded, from_state] =
                        self.force_row(watched, stretch_size, deflection_size, &powers, rows, series);
                    rounding.push(rounded);
                    afresh.push(from_state);
                    force_tails[j]
                }
                Some(root) => {
                    self.root_row(j, deflection_size, &powers, rows, series);
                    rounding.push(0.0);
                    // The error of a root follows from that of its power.
                    let power = deflection_size + size_of(&series[1..]).powi(root as i32);
                    afresh.push(libm::pow(ROUNDING * power, f64::from(root).recip()));
                    tail.rooted.map_or(0.0, |d| d.root)
                }
                None => {
                    self.position_row(watched, &powers, rows, series);
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
                let rate = &rows.contacts[j].rate;
                let rates = guard_rates[row..row + ROW].iter_mut().zip(rate.iter().zip(&powers));
                rates.for_each(|(g, (r, p))| *g = sign * r * p);
                // The truncation of the clock moves the guard at its rate.
                let late = d.time * rate.iter().zip(&powers).map(|(r, p)| (r * p).abs()).sum::<f64>();
                let error = ROUNDING * deflection_size + self.deflection_tail(j, tail) + late;
                guard_errors.push(if watch == Watch::Force { -1.0 } else { error });
            }
        }
    }

    /// Returns the value of a guard of position at the start.
    #[inline(always)]
    pub fn position(&self, watched: &ModeGuard, rows: &StepRows) -> f64 {
        let &ModeGuard { contact: j, watch, sign, .. } = watched;
        match self.motion.parts[j].side {
            0.0 => match self.gap(j, watch, rows) {
                Some(gap) => gap,
                None => watched.along() * rows.deflection(j, 0) + sign * self.s.contacts[j].gap(),
            },
            side => side * rows.stretch(j),
        }
    }

    /// Writes a guard of position as a series in θ.
    #[inline(always)]
    pub fn position_row(&self, watched: &ModeGuard, powers: &Powers, rows: &StepRows, series: &mut [f64]) {
        let (along, j) = (watched.along(), watched.contact);
        let deflections = &rows.deflections[j / LANES];
        for ((s, four), p) in series.iter_mut().zip(deflections).zip(powers) {
            *s = along * four[j % LANES] * p;
        }
        series[0] = self.position(watched, rows);
        if self.is_released(watched.contact, watched.watch) {
            series[..3].fill(0.0);
        }
    }

    /// Writes the force of a contact, or its factor, as a series in θ. Returns its rounding, and that of a value formed from the state
    /// alone. `stretch` and `deflection` are the sizes of their terms.
    #[inline(always)]
    pub fn force_row(
        &self,
        watched: &ModeGuard,
        stretch: f64,
        deflection: f64,
        powers: &Powers,
        rows: &StepRows,
        series: &mut [f64],
    ) -> [f64; 2] {
        let j = watched.contact;
        let size = self.force_guard(j, stretch, watched.sign, rows, series);
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
    fn root_row(&self, j: usize, deflection: f64, powers: &Powers, rows: &StepRows, series: &mut [f64]) {
        series.iter_mut().zip(rows.clock.y(1)).zip(powers).for_each(|((s, y), p)| *s = y * p);
        // If formed afresh from the state, a penetration within its rounding is zero.
        let stretch = rows.stretch(j).abs();
        if self.request.carried.get(j).is_none_or(|carried| carried.is_nan()) && stretch <= ROUNDING * deflection {
            series[0] = 0.0;
        }
    }

    /// Returns the contribution of the truncated terms to the force of a contact (of a power law: to its factor `1 + χ ṗ`).
    pub fn force_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        match self.motion.parts[j].force() {
            Some(power @ Force::Power { .. }) => power.chi(self.request.x) * self.rate_tail(j, tail, out),
            Some(Force::Linear { damping, .. }) => self.linear_force_tail(j, damping, tail, out),
            Some(Force::Held) | None => self.held_force_tail(j, tail, out),
        }
    }

    /// Returns whether the contact is released from rest: value, rate and acceleration of the gap are exactly zero.
    #[inline(always)]
    pub fn is_released(&self, j: usize, watch: Watch) -> bool {
        !self.request.still.is_empty()
            && self.motion.parts[j].state == ContactMode::Separated
            && self.pinned(j, Watch::Force)
            && self.request.still.contains(guard_id(j, watch))
    }

    /// Writes the force of a contact (or the factor `1 + χ ṗ` of a power law) as a guard. Returns the size of its terms, from `stretch`.
    fn force_guard(&self, j: usize, stretch: f64, sign: f64, rows: &StepRows, series: &mut [f64]) -> f64 {
        let (c, part, x) = (&self.s.contacts[j], &self.motion.parts[j], self.request.x);
        let contact = &rows.contacts[j];
        let (row, sign, size) = match part.force() {
            Some(power @ Force::Power { .. }) => (&contact.factor, sign, 1.0 + power.chi(x) * self.s.rate_size(c, x)),
            Some(Force::Linear { damping, .. }) => {
                (&contact.force, sign * part.side, c.stiffest * stretch + damping * self.s.rate_size(c, x))
            }
            Some(Force::Held) | None => {
                let force = |a: &ActiveContact| rows.contacts[a.contact].force[0];
                let size = c.effective_mass() * self.s.acceleration_size(j, self.motion.carrying(), x, force);
                (&contact.force, sign * part.side, size)
            }
        };
        series.iter_mut().zip(row).for_each(|(s, f)| *s = sign * f);
        size
    }

    /// Returns the size of the terms whose sum is a stretch: those of the deflection if it comes from the state. A stretch that is
    /// known better, carried from the last step or given by an exact zero, is the only term.
    #[inline(always)]
    pub fn stretch_size(&self, j: usize, clock: Option<&StepClock>, size: f64, rows: &StepRows) -> f64 {
        let carried = self.request.carried.get(j).is_some_and(|stretch| !stretch.is_nan());
        let state = self.motion.parts[j].state;
        let is_closed = state.side() != 0.0;
        let is_exact = || {
            !self.request.pinned.is_empty()
                && [Watch::DriveFlank, Watch::BackFlank, Watch::Force].iter().any(|w| self.pinned(j, *w))
        };
        // A gap that is zero by chance is not exact, and is taken from the state.
        if state == ContactMode::Separated && carried && rows.gap(j).abs() > 0.0 {
            rows.gap(j).abs()
        } else if clock.is_none() && (is_closed && carried || (is_closed || carried) && is_exact()) {
            rows.stretch(j).abs()
        } else {
            size
        }
    }
}
