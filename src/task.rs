//! Cancellation and progress of long work.

use std::{
    fmt,
    ops::ControlFlow,
    sync::atomic::{AtomicBool, Ordering},
};

/// Progress of work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// One more unit is done: a scene of a study, a row of a sweep, a run of a map, an orbit of a branch.
    Unit,
    /// This share of a run is done, in [0, 1].
    Share(f64),
}

/// A handle on long work: a flag that cancels it and a callback that receives its progress.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    cancelled: &'a AtomicBool,
    progress: &'a (dyn Fn(Progress) + Sync),
}

impl<'a> Task<'a> {
    /// Returns a task that ends soon after `cancelled` is set and reports to `progress`, from any thread.
    #[must_use]
    pub fn new(cancelled: &'a AtomicBool, progress: &'a (dyn Fn(Progress) + Sync)) -> Self {
        Self { cancelled, progress }
    }

    /// Returns the same task without reports of its progress.
    #[must_use]
    pub fn silent(self) -> Self {
        Self { progress: &|_| (), ..self }
    }

    /// Returns whether the work was cancelled.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Breaks once the work was cancelled.
    pub fn flow(&self) -> ControlFlow<()> {
        if self.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Reports that one more unit is done.
    pub fn advance(&self) {
        self.report(Progress::Unit);
    }

    /// Reports progress.
    pub fn report(&self, progress: Progress) {
        (self.progress)(progress);
    }
}

/// Work without cancellation or reports.
impl Default for Task<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self::new(&NEVER, &|_| ())
    }
}

impl fmt::Debug for Task<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Task").field("cancelled", self.cancelled).finish_non_exhaustive()
    }
}
