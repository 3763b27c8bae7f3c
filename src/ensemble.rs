//! Many motions of one train, each with the bits that it has alone.
//!
//! A member is a start, and what is asked of its motion. Members share the compiled train, and those that one thread takes share its
//! compiled motions, whose series and propagators are pure functions of their modes. So neither neighbours nor order nor the number of
//! threads change a bit, and memory does not grow with the number of members or with the length of their motions.
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

use rayon::prelude::*;

use crate::{
    engine::{Engine, EngineError, State},
    simulation::{Simulation, SimulationError},
};

/// Members that are in memory at once.
const BLOCK: usize = 8192;
/// Members that share an engine at least: forming the motions of a train costs as much as some hundred cycles of it.
const SHARE: usize = 64;

/// Many motions of one train, run in parallel on the threads of the pool it is called in.
#[derive(Clone, Copy, Debug)]
pub struct Ensemble<'a> {
    simulation: &'a Simulation,
    members: usize,
}

impl<'a> Ensemble<'a> {
    /// As many `members` of the train of `simulation`, with its integrator and its limits.
    #[must_use]
    pub fn new(simulation: &'a Simulation, members: usize) -> Self {
        Self { simulation, members }
    }

    /// Runs all members: `start` gives where member `i` starts, `follow` takes an engine there as far as it likes and says what it
    /// has seen, and `take` is handed that, in the order of the members.
    ///
    /// # Errors
    /// [`SimulationError::Integrator`], or the error of the first `start` or `take` that has one; members after it may have run.
    pub fn run<T: Send>(
        &self,
        start: impl Fn(usize) -> Result<State, SimulationError> + Sync,
        follow: impl Fn(usize, &mut Engine<'_>) -> Result<T, EngineError> + Sync,
        mut take: impl FnMut(usize, Result<T, EngineError>) -> Result<(), SimulationError>,
    ) -> Result<(), SimulationError> {
        let member = |engine: &mut Option<Engine<'a>>, i: usize| {
            let state = start(i)?;
            let engine = match engine {
                Some(engine) => {
                    engine.restart(self.simulation.integrator()?.0, state);
                    engine
                }
                None => engine.insert(self.simulation.engine(state)?),
            };
            Ok(follow(i, engine))
        };
        for first in (0..self.members).step_by(BLOCK) {
            let block = first..self.members.min(first + BLOCK);
            let seen = block.clone().into_par_iter().with_min_len(SHARE).map_init(|| None, member);
            let seen: Vec<Result<_, SimulationError>> = seen.collect();
            block.zip(seen).try_for_each(|(i, seen)| take(i, seen?))?;
        }
        Ok(())
    }
}
