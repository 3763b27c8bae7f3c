//! Many motions of one train, each with the bits of a separate run.
//!
//! A member is a start, with the work on its motion. Members share the compiled train, and those of one thread share its compiled motions,
//! whose series and propagators are pure functions of their modes. So the bits depend neither on neighbours nor on order nor on the number
//! of threads. Memory grows neither with the number of members nor with the length of their motions.
//!
//! ```
//! use flank::{Simulation, ensemble::Ensemble};
//!
//! let pair = Simulation::from_file("examples/scenes/kahraman-singh.json")?;
//! let (clock, ensemble) = (pair.clock(), Ensemble::new(&pair, 20));
//! let mut ends = Vec::new();
//! ensemble.run(
//!     |i| pair.start_at(&[0.1 * i as f64 - 1.0], &[0.0]),
//!     |_, engine| engine.run(clock.at(10, 0.0), &mut ()).map(|_| engine.state().x.clone()),
//!     |_, end| {
//!         ends.push(end?);
//!         Ok(())
//!     },
//! )?;
//! assert_eq!(ends.len(), 20);
//! # Ok::<(), flank::simulation::SimulationError>(())
//! ```

use std::{
    collections::BTreeMap,
    ops::Range,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};

use crate::{
    engine::{Engine, EngineError, State},
    simulation::{Simulation, SimulationError},
};

/// Least number of members that share an engine: forming the motions of a train costs as much as some hundred cycles of it.
const SHARE: usize = 64;

/// Does `work` for all `items` on the threads of the current pool, each `share` of them on one thread, with a context from `begin`. Passes
/// the results to `take`, in the order of the items. If `work` returns nothing it ends: no later item is taken.
///
/// # Errors
/// The first error of `take`; later items may have been worked on.
pub fn in_order<C, T: Send, E: Send>(
    items: Range<usize>,
    share: usize,
    begin: impl Fn() -> C + Sync,
    work: impl Fn(&mut C, usize) -> Option<T> + Sync,
    take: impl FnMut(usize, T) -> Result<(), E> + Send,
) -> Result<(), E> {
    let (claimed, ends) = (AtomicUsize::new(items.start), AtomicBool::new(false));
    // The next item for `take`, results that wait for items before them, the callback, and the first error.
    let desk = Mutex::new((items.start, BTreeMap::<usize, Vec<T>>::new(), take, None));
    rayon::broadcast(|_| {
        let mut context = begin();
        while !ends.load(Ordering::Relaxed) {
            let first = claimed.fetch_add(share, Ordering::Relaxed);
            if first >= items.end {
                break;
            }
            let wanted = first..items.end.min(first + share);
            let done: Vec<T> = wanted.clone().map_while(|i| work(&mut context, i)).collect();
            if done.len() < wanted.len() {
                ends.store(true, Ordering::Relaxed);
            }
            let mut desk = desk.lock().unwrap_or_else(PoisonError::into_inner);
            let (next, waiting, take, failed) = &mut *desk;
            waiting.insert(first, done);
            while let Some(done) = waiting.remove(next).filter(|_| failed.is_none()) {
                for item in done {
                    if let Err(error) = take(*next, item) {
                        *failed = Some(error);
                        ends.store(true, Ordering::Relaxed);
                        break;
                    }
                    *next += 1;
                }
            }
        }
    });
    desk.into_inner().unwrap_or_else(PoisonError::into_inner).3.map_or(Ok(()), Err)
}

/// Many motions of one train, run in parallel on the threads of the current pool.
#[derive(Clone, Copy, Debug)]
pub struct Ensemble<'a> {
    simulation: &'a Simulation,
    members: usize,
}

impl<'a> Ensemble<'a> {
    /// Creates an ensemble of `members` motions of the train of `simulation`, with its integrator and its limits.
    #[must_use]
    pub fn new(simulation: &'a Simulation, members: usize) -> Self {
        Self { simulation, members }
    }

    /// Runs all members: `start` returns the initial state of member `i`, `follow` advances an engine from it as far as needed and returns
    /// a result, and `take` receives the results in the order of the members.
    ///
    /// # Errors
    /// [`SimulationError::Integrator`], or the error of the first `start` or `take` that has one; members after it may have run.
    pub fn run<T: Send>(
        &self,
        start: impl Fn(usize) -> Result<State, SimulationError> + Sync,
        follow: impl Fn(usize, &mut Engine<'_>) -> Result<T, EngineError> + Sync,
        mut take: impl FnMut(usize, Result<T, EngineError>) -> Result<(), SimulationError> + Send,
    ) -> Result<(), SimulationError> {
        let member = |engine: &mut Option<Engine<'a>>, i: usize| {
            let state = start(i)?;
            let engine = match engine {
                Some(engine) => {
                    engine.restart(state);
                    engine
                }
                None => engine.insert(self.simulation.limited(state, self.simulation.settings.event_budget)?.0),
            };
            Ok(follow(i, engine))
        };
        let member = |engine: &mut _, i| Some(member(engine, i));
        in_order(0..self.members, SHARE, || None, member, |i, seen: Result<_, SimulationError>| take(i, seen?))
    }
}
