use std::ops::ControlFlow;

use crate::{event::EventRecord, hybrid::Mode, integrate::DenseStep};

/// Watches a run. Every method may break it off; the run then ends with an outcome, not an error.
pub trait Observer {
    /// Whether it looks at steps. Where it does not, the run does not form those that it can do without. The motion is the same, bit for
    /// bit.
    fn wants_steps(&self) -> bool {
        true
    }

    /// Whether it looks at events. Where it does not, the run does not write their records.
    fn wants_events(&self) -> bool {
        true
    }

    /// A piece of smooth motion: the step, valid on `[0, until]`.
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let _ = (mode, step, until);
        ControlFlow::Continue(())
    }

    /// An instant at which something changed (or was touched, or decided at the start).
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let _ = record;
        ControlFlow::Continue(())
    }
}

/// Watches nothing.
impl Observer for () {
    fn wants_steps(&self) -> bool {
        false
    }

    fn wants_events(&self) -> bool {
        false
    }
}

/// Both watch; either may break off.
impl<A: Observer, B: Observer> Observer for (A, B) {
    fn wants_steps(&self) -> bool {
        self.0.wants_steps() || self.1.wants_steps()
    }

    fn wants_events(&self) -> bool {
        self.0.wants_events() || self.1.wants_events()
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
    fn wants_steps(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_steps)
    }

    fn wants_events(&self) -> bool {
        self.as_ref().is_some_and(Observer::wants_events)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.step(mode, step, until))
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.event(record))
    }
}

impl<T: Observer + ?Sized> Observer for &mut T {
    fn wants_steps(&self) -> bool {
        (**self).wants_steps()
    }

    fn wants_events(&self) -> bool {
        (**self).wants_events()
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        (**self).step(mode, step, until)
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        (**self).event(record)
    }
}
