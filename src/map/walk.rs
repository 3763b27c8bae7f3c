//! Motions from start of cycle to start of cycle, and their records.

use serde::{Deserialize, Serialize};

use crate::{
    engine::{Engine, State},
    orbit::{
        Section, SectionMap,
        averages::means,
        frame::Frame,
        words::{WordObserver, is_gained},
    },
    simulation::{Simulation, SimulationError},
};

/// Contact gained, or impact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Strike {
    /// Cycle of the record, from 0.
    pub cycle: u64,
    /// Index of the contact.
    pub contact: usize,
    /// +1 on the drive flank, −1 on the back flank.
    pub side: f64,
    /// Time since the start of the cycle, as a share of the period.
    pub phase: f64,
    /// Speed of approach, m/s.
    pub speed: f64,
}

/// Some cycles of a motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Record {
    /// State at the end of each cycle.
    pub points: Vec<Vec<f64>>,
    /// Contacts gained and impacts.
    pub strikes: Vec<Strike>,
    /// Largest exponent over these cycles and its standard error, 1/s; none if contacts rest.
    pub exponent: Option<[f64; 2]>,
}

/// Walk along motions of a train.
pub(super) struct Walk<'s> {
    map: SectionMap<'s>,
    engine: Option<Engine<'s>>,
}

impl<'s> Walk<'s> {
    pub fn new(simulation: &'s Simulation) -> Result<Self, SimulationError> {
        Ok(Self { map: SectionMap::new(simulation)?, engine: None })
    }

    /// Starts at `state`; within a cycle, runs to the start of the next one. Returns whether it is reached.
    pub fn begin(&mut self, state: State) -> Result<bool, SimulationError> {
        let is_within = state.at.phase.value() > 0.0;
        self.map.engine(&mut self.engine, state)?;
        if is_within { self.cycle() } else { Ok(true) }
    }

    /// Runs one cycle; returns `false` if the limit on events is reached.
    pub fn cycle(&mut self) -> Result<bool, SimulationError> {
        self.engine.as_mut().map_or(Ok(false), |engine| self.map.cycle(engine, &mut ()))
    }

    /// Runs and records some cycles; `None` if the limit on events is reached.
    pub fn record(&mut self, cycles: u64) -> Result<Option<Record>, SimulationError> {
        let (simulation, Some(engine)) = (self.map.simulation(), &mut self.engine) else { return Ok(None) };
        let (mut record, mut rows) = (Record::default(), Vec::new());
        let (drift, period) = (self.map.drift(), simulation.period()?);
        let mut frame = Frame::single(simulation, &drift);
        frame.start(engine.state());
        let mut words = WordObserver::new(&simulation.structure, &engine.state().x);
        for cycle in 0..cycles {
            if !self.map.cycle(engine, &mut (&mut frame, &mut words))? {
                return Ok(None);
            }
            record.points.push(engine.state().x.clone());
            // Letters are gathered as their instant is closed.
            words.close();
            let gained = words.letters.iter().filter(|letter| is_gained(&letter.token));
            record.strikes.extend(gained.map(|letter| {
                let side = if letter.token.ends_with('+') { 1.0 } else { -1.0 };
                let (phase, speed) = (letter.at.phase.value() / period, side * letter.rate);
                Strike { cycle, contact: letter.contact, side, phase, speed }
            }));
            words.take();
            rows.push(frame.take());
        }
        if !rows.is_empty() && !frame.is_unresolved() && !frame.lost[0] {
            let (exponent, band) = means(&rows, period);
            record.exponent = Some([exponent[0], band[0]]).filter(|e| e.iter().all(|e| e.is_finite()));
        }
        Ok(Some(record))
    }

    /// Returns the section, the mode of each contact included.
    pub fn section(&self) -> Section {
        self.engine.as_ref().map_or_else(Section::default, |engine| self.map.section(engine.state()))
    }

    /// Returns the state.
    pub fn x(&self) -> &[f64] {
        self.engine.as_ref().map_or(&[], |engine| &engine.state().x)
    }
}
