use std::ops::ControlFlow;

use crate::{
    event::EventRecord,
    hybrid::{GuardSet, Instant, Jump, Mode},
    integrate::DenseStep,
};

/// One jump at an instant, which may have several.
#[derive(Clone, Copy, Debug)]
pub struct Jumped<'a> {
    /// When.
    pub at: Instant,
    /// Mode and exact zeros before it.
    pub from: &'a Jump,
    /// And after it.
    pub to: &'a Jump,
    /// The guards that fire, or whose contacts are brought to rest.
    pub fired: &'a GuardSet,
    /// State before, `[dim]`.
    pub x_minus: &'a [f64],
    /// State after, `[dim]`.
    pub x_plus: &'a [f64],
    /// It brings contacts to rest: the end of an impact sequence, of which this is the last impact that was resolved.
    pub settles: bool,
}

/// Watches a run. Every method may break it off; the run then ends with an outcome, not an error.
pub trait Observer {
    /// Whether it looks at steps in `mode`. Where it does not, the run does not form those that it can do without, and hands on a
    /// [`leap`](Self::leap) in their place. The motion is the same, bit for bit.
    fn wants_steps(&self, mode: &Mode) -> bool {
        let _ = mode;
        true
    }

    /// Whether it looks at events. Where it does not, the run does not write their records.
    fn wants_events(&self) -> bool {
        true
    }

    /// Whether it looks at anything at all. Where it does not, a run may go from event to event without telling of them.
    fn wants_anything(&self) -> bool {
        true
    }

    /// A piece of smooth motion: the step, valid on `[0, until]`.
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let _ = (mode, step, until);
        ControlFlow::Continue(())
    }

    /// A piece of smooth motion of `time` seconds whose steps were not wanted.
    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        let _ = (mode, time);
        ControlFlow::Continue(())
    }

    /// Whether it looks at single jumps.
    fn wants_jumps(&self) -> bool {
        false
    }

    /// A jump. The instant's record follows when it is closed.
    fn jump(&mut self, jumped: &Jumped<'_>) {
        let _ = jumped;
    }

    /// An instant at which something changed (or was touched, or decided at the start).
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let _ = record;
        ControlFlow::Continue(())
    }
}

/// Watches nothing.
impl Observer for () {
    fn wants_steps(&self, _: &Mode) -> bool {
        false
    }

    fn wants_events(&self) -> bool {
        false
    }

    fn wants_anything(&self) -> bool {
        false
    }
}

/// Both watch; either may break off.
impl<A: Observer, B: Observer> Observer for (A, B) {
    fn wants_steps(&self, mode: &Mode) -> bool {
        self.0.wants_steps(mode) || self.1.wants_steps(mode)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        let first = self.0.leap(mode, time);
        self.1.leap(mode, time)?;
        first
    }

    fn wants_jumps(&self) -> bool {
        self.0.wants_jumps() || self.1.wants_jumps()
    }

    fn jump(&mut self, jumped: &Jumped<'_>) {
        self.0.jump(jumped);
        self.1.jump(jumped);
    }

    fn wants_events(&self) -> bool {
        self.0.wants_events() || self.1.wants_events()
    }

    fn wants_anything(&self) -> bool {
        self.0.wants_anything() || self.1.wants_anything()
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

/// Watches, or not.
impl<T: Observer> Observer for Option<T> {
    fn wants_steps(&self, mode: &Mode) -> bool {
        self.as_ref().is_some_and(|observer| observer.wants_steps(mode))
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.leap(mode, time))
    }

    fn wants_jumps(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_jumps)
    }

    fn jump(&mut self, jumped: &Jumped<'_>) {
        self.iter_mut().for_each(|observer| observer.jump(jumped));
    }

    fn wants_events(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_events)
    }

    fn wants_anything(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_anything)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.step(mode, step, until))
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.event(record))
    }
}

impl<T: Observer + ?Sized> Observer for &mut T {
    fn wants_steps(&self, mode: &Mode) -> bool {
        (**self).wants_steps(mode)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        (**self).leap(mode, time)
    }

    fn wants_jumps(&self) -> bool {
        (**self).wants_jumps()
    }

    fn jump(&mut self, jumped: &Jumped<'_>) {
        (**self).jump(jumped);
    }

    fn wants_events(&self) -> bool {
        (**self).wants_events()
    }

    fn wants_anything(&self) -> bool {
        (**self).wants_anything()
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        (**self).step(mode, step, until)
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        (**self).event(record)
    }
}
