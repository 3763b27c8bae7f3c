//! Checks of a run's numbers against each other. A run that fails one ends: a wrong answer is worse than none.
//!
//! The bound of a guard's row is a claim about its values. Wherever a value is known twice, the claim is tested:
//!
//! - between two steps: the row's value at the end of one, and the value that the next one forms from the state;
//! - at the end of a run: the row's value there, and the guard of the state;
//! - at an event: the row's value there, and the guard of the state;
//! - at an event: how far the state is moved onto the flanks;
//! - at the start of an arc: a guard that cannot jump is not negative.
//!
//! Each limit is the bound times a factor that covers the rounding of the comparison itself. Rows whose bound is an estimate make no
//! claim and are not tested.

use super::EngineError;
use crate::{
    event::Located,
    hybrid::{AGREED, GATHERED, GuardId, GuardSet, GuardValue, HybridSystem, Instant, Leap, Mode, Passage},
    integrate::DenseStep,
    poly,
};

/// Rounding of a polynomial relative to the sum of its terms: twice the unit roundoff for each of 25 terms, and the conversion.
const TERMS: f64 = 1e-14;
/// Factor on the bound by which a state may be moved onto a flank. The distance to the flank is a difference of displacements. These have
/// gathered rounding over many arcs since they were last moved onto it.
const MOVED: f64 = 10.0;

/// Largest rounding and kind of one guard.
#[derive(Clone, Copy, Debug)]
struct GuardRounding {
    /// Largest rounding so far, in units of the guard; below zero before the first value.
    rounding: f64,
    /// True if no jump changes the value of the guard.
    is_continuous: bool,
}

/// Values kept from step to step.
#[derive(Clone, Debug)]
pub(super) struct Alarm {
    /// All guards up to the highest number seen, indexed by number.
    met: Vec<GuardRounding>,
    /// Largest rounding of a guard of position, the scale of displacements; below zero before the first value.
    length: f64,
    /// Guard, value and error of each row at the end of the last step of the arc.
    ends: Vec<(GuardId, f64, f64)>,
    /// The mode of that step.
    mode: Mode,
    /// Depth below zero of the guard of an event that waits for a switch, in units of the guard.
    waited: f64,
    /// Largest permitted move of the state at the current event, in units of the guards.
    move_limit: f64,
}

impl Default for Alarm {
    fn default() -> Self {
        Self { met: Vec::new(), length: -1.0, ends: Vec::new(), mode: Mode::default(), waited: 0.0, move_limit: 0.0 }
    }
}

fn raise(
    system: &dyn HybridSystem,
    at: Instant,
    id: GuardId,
    what: &'static str,
    amount: f64,
    limit: f64,
) -> EngineError {
    EngineError::Alarm { t: system.clock().time(at).value(), guard: system.guard_in_words(id), what, amount, limit }
}

/// Returns the limit if `amount` is above it. The expensive part `added` is computed only where `bound` does not decide.
fn exceeded(amount: f64, bound: f64, added: impl FnOnce(f64) -> f64) -> Option<f64> {
    (amount > AGREED * bound).then(|| AGREED * added(bound)).filter(|limit| amount > *limit)
}

impl Alarm {
    /// Forgets the last step: a jump starts another motion.
    pub fn jumped(&mut self) {
        self.ends.clear();
    }

    /// Forgets the last step and the waiting event: the motion has gone on unobserved.
    pub fn go_past(&mut self) {
        self.ends.clear();
        self.waited = 0.0;
    }

    /// Tests the start of a step against the end of the last one; `first` in an arc, where a switch may have changed forces.
    pub fn start(&mut self, system: &dyn HybridSystem, step: &dyn DenseStep, first: bool) -> Result<(), EngineError> {
        let tests = !step.is_estimate() && !self.ends.is_empty();
        for (i, guard) in step.guards().iter().enumerate() {
            self.meet(system, *guard, step.guard_rounding(i));
            if tests {
                let row = step.guard(i);
                let start = (i, *guard, row[0]);
                self.start_of(system, step.start(), start, first, || TERMS * poly::terms(row, 1.0))?;
            }
        }
        self.started(first);
        Ok(())
    }

    /// Tests the start of a leap as [`start`](Self::start) does; `gathered` is the rounding of a guard from the last leap of the arc.
    pub fn start_leap(
        &mut self,
        system: &dyn HybridSystem,
        at: Instant,
        leap: &Leap,
        first: bool,
        gathered: impl Fn(GuardId) -> f64,
    ) -> Result<(), EngineError> {
        let tests = !self.ends.is_empty();
        for (i, GuardValue { guard, value, error, terms, .. }) in leap.starts.iter().enumerate() {
            self.meet(system, *guard, *error);
            if tests {
                self.start_of(system, at, (i, *guard, *value), first, || TERMS * terms + gathered(*guard))?;
            }
        }
        self.started(first);
        Ok(())
    }

    fn started(&mut self, first: bool) {
        self.ends.clear();
        if !first {
            self.waited = 0.0;
        }
    }

    /// Records the `rounding` of a guard at the start of a step.
    #[inline]
    pub fn meet(&mut self, system: &dyn HybridSystem, guard: GuardId, rounding: f64) {
        let slot = usize::from(guard.0);
        while self.met.len() <= slot {
            let id = GuardId(self.met.len() as u16);
            self.met.push(GuardRounding { rounding: -1.0, is_continuous: system.is_continuous(id) });
        }
        let met = &mut self.met[slot];
        if rounding > met.rounding {
            met.rounding = rounding;
            if met.is_continuous && rounding > self.length {
                self.length = rounding;
            }
        }
    }

    /// Returns the largest rounding of a guard of position; `None` if there is no such guard.
    fn length(&self) -> Option<f64> {
        Some(self.length).filter(|length| *length >= 0.0)
    }

    /// Returns the largest rounding of a recorded guard, in its units.
    fn largest_rounding(&self, guard: GuardId) -> f64 {
        self.met[usize::from(guard.0)].rounding
    }

    /// Tests one guard, given by its row, id and value, at the start of a step; `added` is the expensive part of its error.
    fn start_of(
        &self,
        system: &dyn HybridSystem,
        at: Instant,
        (i, guard, value): (usize, GuardId, f64),
        first: bool,
        added: impl FnOnce() -> f64,
    ) -> Result<(), EngineError> {
        let GuardRounding { rounding, is_continuous } = self.met[usize::from(guard.0)];
        if first && !is_continuous {
            return Ok(());
        }
        // The guards are usually those of the last step.
        let same = self.ends.get(i).filter(|end| end.0 == guard);
        let Some((_, end, error)) = same.or_else(|| self.ends.iter().find(|end| end.0 == guard)) else { return Ok(()) };
        let amount = (value - end).abs();
        let Some(limit) = exceeded(amount, error + rounding, |bound| bound + added()) else { return Ok(()) };
        Err(raise(system, at, guard, "the end of a step differs from the start of the next", amount, limit))
    }

    /// Records the end of a leap after which the arc goes on.
    pub fn end_leap(&mut self, mode: &Mode, leap: &Leap) {
        self.mode = mode.clone();
        for GuardValue { guard, value, error, terms, .. } in leap.ends.iter().copied() {
            let error = error + self.largest_rounding(guard) + TERMS * terms;
            self.ends.push((guard, value, error));
        }
    }

    /// Adds the gathered rounding of each guard to its error at the end of the last leap.
    pub fn gather(&mut self, gathered: impl Fn(GuardId) -> f64) {
        self.ends.iter_mut().for_each(|(guard, _, error)| *error += gathered(*guard));
    }

    /// Tests the event at the end of a leap against the state there.
    pub fn event_leap(
        &mut self,
        system: &dyn HybridSystem,
        mode: &Mode,
        passage: &Passage,
        gathered: f64,
        (at, x): (Instant, &[f64]),
    ) -> Result<(), EngineError> {
        let rounding = self.largest_rounding(passage.guard);
        let limit = MOVED * passage.error + GATHERED * rounding + self.waited;
        self.move_limit = self.length().map_or(f64::INFINITY, |length| (GATHERED * length).max(limit));
        let amount = (passage.residual - system.guard(mode, passage.guard, at, x)).abs();
        let limit = AGREED * (passage.error + rounding + gathered);
        if amount > limit {
            let what = "the series and the state differ at an event";
            return Err(raise(system, at, passage.guard, what, amount, limit));
        }
        Ok(())
    }

    /// Tests the end of the last step against the state at the end of a run.
    pub fn finish(&mut self, system: &dyn HybridSystem, at: Instant, x: &[f64]) -> Result<(), EngineError> {
        let ends = std::mem::take(&mut self.ends);
        for &(id, value, error) in &ends {
            let amount = (system.guard(&self.mode, id, at, x) - value).abs();
            let limit = AGREED * (error + self.largest_rounding(id) + TERMS * value.abs());
            if amount > limit {
                return Err(raise(system, at, id, "the series and the state differ at the end", amount, limit));
            }
        }
        Ok(())
    }

    /// Records that an event waits for a switch at the end of `step`: the uncertainty of its time covers the switch.
    pub fn wait(&mut self, step: &dyn DenseStep, located: &Located) {
        let beyond = |(i, guard): (usize, &GuardId)| {
            if located.fired.contains(*guard) { -step.guard(i).iter().sum::<f64>() } else { 0.0 }
        };
        self.waited = step.guards().iter().enumerate().map(beyond).fold(0.0, f64::max);
    }

    /// Records the end of a step without an event. With `closes` it is the last of the run, and the state is tested next.
    pub fn end(&mut self, mode: &Mode, step: &dyn DenseStep, closes: bool) {
        self.mode = mode.clone();
        if step.is_estimate() {
            return;
        }
        for (i, guard) in step.guards().iter().enumerate() {
            let (tail, _) = step.guard_error(i);
            let gathered = if closes { step.gathered(i, 1.0, 0) } else { 0.0 };
            let error = tail + self.largest_rounding(*guard) + gathered;
            self.ends.push((*guard, step.guard(i).iter().sum(), error));
        }
    }

    /// Tests an event against the state there: `at` and `x` as the step gives them, before the jump.
    pub fn event(
        &mut self,
        system: &dyn HybridSystem,
        mode: &Mode,
        step: &dyn DenseStep,
        located: &Located,
        (at, x): (Instant, &[f64]),
    ) -> Result<(), EngineError> {
        self.move_limit = f64::INFINITY;
        if step.is_estimate() {
            return Ok(());
        }
        self.move_limit = self.length().map_or(f64::INFINITY, |length| GATHERED * length);
        for (i, guard) in step.guards().iter().enumerate() {
            let (id, row) = (*guard, step.guard(i));
            let (tail, _) = step.guard_error(i);
            let rounding = self.largest_rounding(id);
            let limit = |tail: f64| MOVED * tail + GATHERED * rounding + self.waited;
            let fires = located.fired.contains(id);
            if (fires || located.near.contains(id)) && system.is_continuous(id) {
                let known = step.guard_in_time(i, located.theta).map_or(tail, |(_, error)| error);
                self.move_limit = self.move_limit.max(limit(known));
                if located.theta == 0.0 && fires && row[0] < -limit(tail) {
                    let what = "the arc starts beyond a guard that cannot jump";
                    return Err(raise(system, at, id, what, -row[0], limit(tail)));
                }
            }
        }
        let mut agreed = Ok(());
        let mut compare = |i: usize, value: f64| {
            let (id, row) = (step.guards()[i], step.guard(i));
            let amount = (poly::eval(row, located.theta) - value).abs();
            // The rounding of the state itself: a flank may be far from the start of the step.
            let added = |bound| bound + step.gathered(i, located.theta, 0) + TERMS * poly::terms(row, located.theta);
            let bound = step.guard_error(i).0 + self.largest_rounding(id);
            if let Some(limit) = exceeded(amount, bound, added)
                && agreed.is_ok()
            {
                agreed = Err(raise(system, at, id, "the series and the state differ at an event", amount, limit));
            }
        };
        if located.theta > 0.0 {
            system.guard_values(mode, step.guards(), (at, x), &mut compare);
        }
        agreed
    }

    /// Tests the displacement by which a jump at `at` moved the state onto the flanks of `fired`.
    pub fn moved(
        &self,
        system: &dyn HybridSystem,
        at: Instant,
        fired: &GuardSet,
        amount: f64,
    ) -> Result<(), EngineError> {
        let Some(id) = fired.iter().next().filter(|_| amount > self.move_limit) else { return Ok(()) };
        Err(raise(system, at, id, "the state is moved further than the bound allows", amount, self.move_limit))
    }
}
