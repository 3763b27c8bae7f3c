use std::ops::ControlFlow;

use crate::{
    event::EventRecord,
    hybrid::{GuardSet, Instant, Jump, LaneRecords, Mode},
    integrate::DenseStep,
};

/// One jump at an instant, which may have several.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct JumpRecord<'a> {
    /// Instant of the jump.
    pub at: Instant,
    /// Mode and exact zeros before it.
    pub from: &'a Jump,
    /// Mode and exact zeros after it.
    pub to: &'a Jump,
    /// The guards that fire, or whose contacts are brought to rest.
    pub fired: &'a GuardSet,
    /// State before, `[dim]`.
    pub x_minus: &'a [f64],
    /// State after, `[dim]`.
    pub x_plus: &'a [f64],
    /// True if the jump brings contacts to rest: it ends an impact sequence, and this is the last impact resolved.
    pub settles: bool,
}

/// Watches a run. Every method that returns a [`ControlFlow`] may stop it; the run then ends with an outcome, not an error.
pub trait Observer {
    /// Returns whether the observer looks at steps in `mode` that end at `until`, by default from [`observed_from`](Self::observed_from) on. If not,
    /// the run omits the steps that it can, and passes a [`leap`](Self::leap) in their place. The motion is the same, bit for bit. Steps that the run
    /// does not omit are passed in any case. An observer that wants steps up to an instant wants those up to later ones too, as long as it receives
    /// nothing.
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        let _ = mode;
        until >= self.observed_from()
    }

    /// Returns whether the observer looks at events. If not, the run does not fill in their records.
    fn wants_events(&self) -> bool {
        true
    }

    /// Returns the instant from which the observer looks at something, [`Instant::LAST`] if at nothing at all. A run need not report arcs
    /// that end before it; it passes instants to [`skip`](Self::skip) in their place.
    fn observed_from(&self) -> Instant {
        Instant::FIRST
    }

    /// Returns the records that suffice in place of calls; `None` if the calls are needed. A run that can make them omits the calls, except
    /// [`skip`](Self::skip).
    #[doc(hidden)]
    fn records(&mut self) -> Option<LaneRecords<'_>> {
        (self.observed_from() == Instant::LAST).then(LaneRecords::default)
    }

    /// Receives an instant that the run has reached without reports. The record of an instant before may still follow.
    fn skip(&mut self, at: Instant) -> ControlFlow<()> {
        let _ = at;
        ControlFlow::Continue(())
    }

    /// Receives a piece of smooth motion: the step, valid on `[0, until]`.
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let _ = (mode, step, until);
        ControlFlow::Continue(())
    }

    /// Receives a piece of smooth motion of `time` seconds whose steps were not wanted.
    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        let _ = (mode, time);
        ControlFlow::Continue(())
    }

    /// Returns whether the observer looks at single jumps.
    fn wants_jumps(&self) -> bool {
        false
    }

    /// Receives a jump. The record of the instant follows when it is closed.
    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        let _ = jumped;
    }

    /// Receives the record of an instant with a change, a touch, or a decision at the start.
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let _ = record;
        ControlFlow::Continue(())
    }
}

/// Watches nothing.
impl Observer for () {
    fn wants_events(&self) -> bool {
        false
    }

    fn observed_from(&self) -> Instant {
        Instant::LAST
    }
}

/// Passes everything to both observers; either may stop the run.
impl<A: Observer, B: Observer> Observer for (A, B) {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.0.wants_steps(mode, until) || self.1.wants_steps(mode, until)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        let first = self.0.leap(mode, time);
        self.1.leap(mode, time)?;
        first
    }

    fn wants_jumps(&self) -> bool {
        self.0.wants_jumps() || self.1.wants_jumps()
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.0.jump(jumped);
        self.1.jump(jumped);
    }

    fn wants_events(&self) -> bool {
        self.0.wants_events() || self.1.wants_events()
    }

    fn observed_from(&self) -> Instant {
        let (first, second) = (self.0.observed_from(), self.1.observed_from());
        if second < first { second } else { first }
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        self.0.records()?.and(self.1.records()?)
    }

    fn skip(&mut self, at: Instant) -> ControlFlow<()> {
        let first = self.0.skip(at);
        self.1.skip(at)?;
        first
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let first = self.0.step(mode, step, until);
        self.1.step(mode, step, until)?;
        first
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let first = self.0.event(record);
        self.1.event(record)?;
        first
    }
}

/// Passes everything to the observer, if there is one.
impl<T: Observer> Observer for Option<T> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.as_ref().is_some_and(|observer| observer.wants_steps(mode, until))
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.leap(mode, time))
    }

    fn wants_jumps(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_jumps)
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.iter_mut().for_each(|observer| observer.jump(jumped));
    }

    fn wants_events(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_events)
    }

    fn observed_from(&self) -> Instant {
        self.as_ref().map_or(Instant::LAST, Observer::observed_from)
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        self.as_mut().map_or_else(|| Some(LaneRecords::default()), Observer::records)
    }

    fn skip(&mut self, at: Instant) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.skip(at))
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.step(mode, step, until))
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.event(record))
    }
}

impl<T: Observer + ?Sized> Observer for &mut T {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        (**self).wants_steps(mode, until)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        (**self).leap(mode, time)
    }

    fn wants_jumps(&self) -> bool {
        (**self).wants_jumps()
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        (**self).jump(jumped);
    }

    fn wants_events(&self) -> bool {
        (**self).wants_events()
    }

    fn observed_from(&self) -> Instant {
        (**self).observed_from()
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        (**self).records()
    }

    fn skip(&mut self, at: Instant) -> ControlFlow<()> {
        (**self).skip(at)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        (**self).step(mode, step, until)
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        (**self).event(record)
    }
}
