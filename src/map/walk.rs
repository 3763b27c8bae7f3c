//! Motion from start of cycle to start of cycle, by a lane if one can run the train, else by an engine.

use serde::{Deserialize, Serialize};

use super::runner::Runner;
use crate::{
    engine::{Engine, Outcome, State},
    hybrid::ContactView,
    kernel::LaneRecords,
    orbit::{
        SectionMap,
        averages::means,
        frame::{Frame, column},
        mover::Mover,
        words::{WordObserver, is_gained},
    },
    simulation::{Simulation, SimulationError},
    system::ContactMode,
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

/// Walk along a motion, by a lane or an engine.
pub(super) struct Walk<'s> {
    simulation: &'s Simulation,
    runner: Option<Runner<'s>>,
    engine: Option<Engine<'s>>,
    x: Vec<f64>,
}

impl<'s> Walk<'s> {
    pub fn new(simulation: &'s Simulation) -> Result<Self, SimulationError> {
        Ok(Self { simulation, runner: Runner::new(simulation)?, engine: None, x: Vec::new() })
    }

    /// Starts at `state`; within a cycle, runs to the start of the next one. Returns whether it is reached.
    pub fn begin(&mut self, state: State) -> Result<bool, SimulationError> {
        self.x.clone_from(&state.x);
        if let Some(runner) = &mut self.runner {
            runner.begin(&state);
            return Ok(true);
        }
        let clock = self.simulation.clock();
        let is_within = clock.between(clock.at(state.at.cycle, 0.0), state.at) > 0.0;
        match &mut self.engine {
            Some(engine) => engine.restart(self.simulation.integrator()?.0, state),
            none => *none = Some(self.simulation.engine(state)?),
        }
        if is_within { self.cycle() } else { Ok(true) }
    }

    /// Runs one cycle; returns `false` if the limit on events is reached.
    pub fn cycle(&mut self) -> Result<bool, SimulationError> {
        if let Some(runner) = &mut self.runner {
            let goes_on = runner.cycle()?;
            self.x.copy_from_slice(&runner.point());
            return Ok(goes_on);
        }
        let Some(engine) = &mut self.engine else { return Ok(false) };
        let end = self.simulation.clock().at(engine.state().at.cycle + 1, 0.0);
        let outcome = engine.run(end, &mut ())?;
        self.x.clone_from(&engine.state().x);
        Ok(outcome == Outcome::ReachedEnd)
    }

    /// Runs and records some cycles; `None` if the limit on events is reached.
    pub fn record(&mut self, cycles: u64) -> Result<Option<Record>, SimulationError> {
        let (simulation, mut record, mut rows) = (self.simulation, Record::default(), Vec::new());
        let (clock, period) = (simulation.clock(), simulation.period()?);
        if let Some(runner) = &mut self.runner {
            runner.records =
                LaneRecords { columns: Some(column(simulation)), strikes: Some(Vec::new()), ..LaneRecords::default() };
            for cycle in 0..cycles {
                if !runner.cycle()? {
                    return Ok(None);
                }
                record.points.push(runner.point().to_vec());
                let strikes = runner.records.strikes.iter_mut().flat_map(|strikes| strikes.drain(..));
                record.strikes.extend(strikes.map(|[time, rate, side]| {
                    let (phase, speed) = (time / period, side * rate);
                    Strike { cycle, contact: 0, side, phase, speed }
                }));
                rows.push(vec![runner.growth().0]);
            }
            runner.records = LaneRecords::default();
            self.x.copy_from_slice(&runner.point());
        } else {
            let Some(engine) = &mut self.engine else { return Ok(None) };
            let (drift, structure) = (SectionMap::new(simulation)?.drift(), &simulation.structure);
            let mut frame = Frame::single(simulation, &drift);
            frame.start(engine.state());
            let mut words = WordObserver::new(structure, &engine.state().x);
            for cycle in 0..cycles {
                let end = clock.at(engine.state().at.cycle + 1, 0.0);
                if engine.run(end, &mut (&mut frame, &mut words))? != Outcome::ReachedEnd {
                    return Ok(None);
                }
                record.points.push(engine.state().x.clone());
                // Letters are gathered as their instant is closed.
                words.tokens();
                let gained = words.letters.iter().filter(|letter| is_gained(&letter.token));
                record.strikes.extend(gained.map(|letter| {
                    let side = if letter.token.ends_with('+') { 1.0 } else { -1.0 };
                    let (phase, speed) = (letter.at.phase.value() / period, side * letter.rate);
                    Strike { cycle, contact: letter.contact, side, phase, speed }
                }));
                words.take();
                rows.push(frame.take());
            }
            if frame.is_unresolved() || frame.lost[0] {
                rows.clear();
            }
            self.x.clone_from(&engine.state().x);
        }
        if !rows.is_empty() {
            let (exponent, band) = means(&rows, period);
            record.exponent = Some([exponent[0], band[0]]).filter(|e| e.iter().all(|e| e.is_finite()));
        }
        Ok(Some(record))
    }

    /// Returns the mode of each contact.
    pub fn contacts(&self) -> Vec<ContactMode> {
        let structure = &self.simulation.structure;
        let mode = |engine: &Engine<'_>| {
            (0..structure.contact_count()).map(|j| structure.contact_mode(j, &engine.state().jump.mode)).collect()
        };
        match &self.runner {
            Some(runner) => runner.section().contacts,
            None => self.engine.as_ref().map(mode).unwrap_or_default(),
        }
    }

    /// Returns the state.
    pub fn x(&self) -> &[f64] {
        &self.x
    }
}
