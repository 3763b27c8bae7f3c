//! Motion from start of cycle to start of cycle, by an engine.

use std::collections::VecDeque;

use smallvec::SmallVec;

use super::{
    Approach, ApproachEnd, Drift, Section, SectionMap, frame::Frame, section::SpareEngine, words::WordObserver,
};
use crate::{
    engine::{Engine, Observer},
    simulation::SimulationError,
    task::Task,
};

/// State at the start of a cycle; that of a pair needs no memory of its own.
pub(super) type Point = SmallVec<[f64; 4]>;

/// Motion that an engine runs from start of cycle to start of cycle, with an observer.
pub(super) struct Mover<'e, 's> {
    pub map: SectionMap<'s>,
    pub drift: &'e Drift,
    engine: &'e mut Engine<'s>,
    observer: &'e mut dyn Observer,
    frame: Option<Frame<'e>>,
    /// Engine of the runs of Newton's method.
    pub spare: SpareEngine<'s>,
}

impl<'e, 's: 'e> Mover<'e, 's> {
    pub fn new(
        map: SectionMap<'s>,
        drift: &'e Drift,
        engine: &'e mut Engine<'s>,
        observer: &'e mut dyn Observer,
    ) -> Self {
        Self { map, drift, engine, observer, frame: None, spare: None }
    }

    /// Returns the present state.
    pub fn point(&self) -> Point {
        Point::from_slice(&self.engine.state().x)
    }

    /// Returns the present section.
    pub fn section(&self) -> Section {
        self.map.section(self.engine.state())
    }

    /// Runs one cycle. Returns `false` if the run is interrupted.
    pub fn cycle(&mut self) -> Result<bool, SimulationError> {
        match &mut self.frame {
            Some(frame) => self.map.cycle(self.engine, &mut (frame, &mut *self.observer)),
            None => self.map.cycle(self.engine, self.observer),
        }
    }

    /// Runs some cycles, adds their ends to `points`, and returns the tokens of a motion that repeats. `None` if the run is interrupted.
    pub fn spell(&mut self, cycles: u64, points: &mut VecDeque<Point>) -> Result<Option<Vec<String>>, SimulationError> {
        let mut words = WordObserver::new(&self.map.simulation().structure, &self.point());
        for _ in 0..cycles {
            if !self.map.cycle(self.engine, &mut (&mut *self.observer, &mut words))? {
                return Ok(None);
            }
            points.push_back(self.point());
        }
        Ok(Some(words.into_word()))
    }

    /// Returns the result of an approach from the present section, and goes back to it.
    pub fn aside(&mut self, approach: Approach, task: Task<'_>) -> Result<Option<ApproachEnd>, SimulationError> {
        let mut other = self.map.simulation().engine(self.engine.state().clone())?;
        let nobody = &mut ();
        let mut mover = Mover::new(self.map, self.drift, &mut other, nobody);
        mover.spare = self.spare.take();
        let found = approach.along(&mut mover, task);
        self.spare = mover.spare;
        found
    }

    /// Begins to carry a small difference to a neighbour along.
    pub fn carry(&mut self) {
        let mut frame = Frame::single(self.map.simulation(), self.drift);
        frame.start(self.engine.state());
        self.frame = Some(frame);
    }

    /// Returns the logarithm by which the difference has grown since the last call; NaN if a part of the motion could not be resolved. Also
    /// returns whether rest has taken its rank.
    pub fn growth(&mut self) -> (f64, bool) {
        let Some(frame) = &mut self.frame else { return (f64::NAN, true) };
        let (log, is_lost) = (frame.take()[0], frame.has_lost());
        (if frame.is_unresolved() { f64::NAN } else { log }, is_lost)
    }
}
