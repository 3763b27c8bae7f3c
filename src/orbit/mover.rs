//! Ways to run a motion from start of cycle to start of cycle.

use std::collections::VecDeque;

use super::{
    Approach, ApproachEnd, Drift, NewtonFailure, Orbit, Section, SectionMap, frame::Frame, newton::Options,
    words::WordObserver,
};
use crate::{
    engine::{Engine, Observer, Outcome},
    simulation::SimulationError,
    task::Task,
};

/// Motion that is run from start of cycle to start of cycle, by an engine or by a lane.
pub(crate) trait Mover<'s> {
    /// State at the start of a cycle.
    type Point: Clone + AsRef<[f64]>;

    /// Returns the map of its sections, and the drift of its train.
    fn map(&self) -> (SectionMap<'s>, &Drift);

    /// Returns the present state.
    fn point(&self) -> Self::Point;

    /// Returns the present section.
    fn section(&self) -> Section;

    /// Runs one cycle. Returns `false` if the run is interrupted.
    fn cycle(&mut self) -> Result<bool, SimulationError>;

    /// Runs some cycles, adds their ends to `points`, and returns the tokens of a motion that repeats. `None` if the run is interrupted.
    fn spell(
        &mut self,
        cycles: u64,
        points: &mut VecDeque<Self::Point>,
    ) -> Result<Option<Vec<String>>, SimulationError>;

    /// Returns the orbit of `period` cycles near the present section, by Newton's method.
    fn solve(&mut self, period: u64, options: Options<'_>) -> Result<Orbit, NewtonFailure>;

    /// Returns the result of an approach from the present section, and goes back to it.
    fn aside(&mut self, approach: Approach, task: Task<'_>) -> Result<Option<ApproachEnd>, SimulationError>;

    /// Begins to carry a small difference to a neighbour along.
    fn carry(&mut self);

    /// Returns the logarithm by which the difference has grown since the last call; NaN if a part of the motion could not be resolved. Also
    /// returns whether rest has taken its rank.
    fn growth(&mut self) -> (f64, bool);
}

/// Motion that an engine runs, with an observer.
pub(crate) struct EngineMover<'e, 's> {
    map: SectionMap<'s>,
    drift: &'e Drift,
    engine: &'e mut Engine<'s>,
    observer: &'e mut dyn Observer,
    frame: Option<Frame<'e>>,
}

impl<'e, 's: 'e> EngineMover<'e, 's> {
    pub fn new(
        map: SectionMap<'s>,
        drift: &'e Drift,
        engine: &'e mut Engine<'s>,
        observer: &'e mut dyn Observer,
    ) -> Self {
        Self { map, drift, engine, observer, frame: None }
    }
}

impl<'s> Mover<'s> for EngineMover<'_, 's> {
    type Point = Vec<f64>;

    fn map(&self) -> (SectionMap<'s>, &Drift) {
        (self.map, self.drift)
    }

    fn point(&self) -> Vec<f64> {
        self.engine.state().x.clone()
    }

    fn section(&self) -> Section {
        self.map.section(self.engine.state())
    }

    fn cycle(&mut self) -> Result<bool, SimulationError> {
        let at = self.map.simulation().clock().at(self.engine.state().at.cycle + 1, 0.0);
        let outcome = match &mut self.frame {
            Some(frame) => self.engine.run(at, &mut (frame, &mut *self.observer))?,
            None => self.engine.run(at, self.observer)?,
        };
        Ok(outcome == Outcome::ReachedEnd)
    }

    fn spell(&mut self, cycles: u64, points: &mut VecDeque<Vec<f64>>) -> Result<Option<Vec<String>>, SimulationError> {
        let mut words = WordObserver::new(&self.map.simulation().structure, &self.engine.state().x);
        for _ in 0..cycles {
            let mut observer = (&mut *self.observer, &mut words);
            if !EngineMover::new(self.map, self.drift, self.engine, &mut observer).cycle()? {
                return Ok(None);
            }
            points.push_back(self.point());
        }
        Ok(Some(words.repeating()))
    }

    fn solve(&mut self, period: u64, options: Options<'_>) -> Result<Orbit, NewtonFailure> {
        self.map.newton((vec![self.section()], period), self.drift, options)
    }

    fn aside(&mut self, approach: Approach, task: Task<'_>) -> Result<Option<ApproachEnd>, SimulationError> {
        let mut other = self.map.simulation().engine(self.engine.state().clone())?;
        approach.along(&mut EngineMover::new(self.map, self.drift, &mut other, &mut ()), task)
    }

    fn carry(&mut self) {
        let mut frame = Frame::single(self.map.simulation(), self.drift);
        frame.start(self.engine.state());
        self.frame = Some(frame);
    }

    fn growth(&mut self) -> (f64, bool) {
        let Some(frame) = &mut self.frame else { return (f64::NAN, true) };
        let (log, is_lost) = (frame.take()[0], frame.has_lost());
        (if frame.is_unresolved() { f64::NAN } else { log }, is_lost)
    }
}
