//! A stretch of motion, kept for pictures and spectra.

use std::ops::ControlFlow;

use super::{StudyError, steady::until};
use crate::{
    analysis::{Grid, Sample, Trajectory, cycles_later},
    engine::{Engine, Observer},
    event::EventRecord,
    hybrid::{ContactMode, ContactView, Instant, Mode},
    simulation::Simulation,
    task::Task,
};

/// Samples of a motion at exact phases, and the contact modes between them.
pub(super) struct Recording {
    /// Forcing period, s; 0 without forcing.
    pub period: f64,
    pub per_cycle: u32,
    /// Time of the samples from the start of the recording, s.
    pub t: Vec<f64>,
    /// Displacements and velocities, one row for each of the `2n` states.
    pub x: Vec<Vec<f64>>,
    /// Deflection of each contact, m.
    pub deflection: Vec<Vec<f64>>,
    /// Force of each contact, N.
    pub force: Vec<Vec<f64>>,
    /// Spells of each contact in one mode, in order, without gaps.
    pub spells: Vec<Vec<ModeInterval>>,
}

impl Recording {
    /// Its first cycles, with the sample at their end.
    pub fn first(mut self, cycles: u64) -> Self {
        // OK to convert: a recording fits into memory.
        let samples = (cycles * u64::from(self.per_cycle)) as usize + 1;
        let end = cycles as f64 * self.period;
        self.t.truncate(samples);
        self.x.iter_mut().chain(&mut self.deflection).chain(&mut self.force).for_each(|row| row.truncate(samples));
        for spells in &mut self.spells {
            spells.retain(|spell| spell.from < end);
            spells.iter_mut().for_each(|spell| spell.to = spell.to.min(end));
        }
        self
    }
}

/// A contact in one mode; it began with an event, unless the recording did.
#[derive(Clone)]
pub(super) struct ModeInterval {
    pub mode: ContactMode,
    /// Time of its beginning, s from the start of the recording.
    pub from: f64,
    pub to: f64,
    /// Force at its beginning, N.
    pub force: f64,
    /// State of the train at its beginning, `(q, q̇, latched speeds)`.
    pub x: Vec<f64>,
}

/// Follows the modes of the contacts.
struct Modes<'c> {
    simulation: &'c Simulation,
    start: Instant,
    spells: Vec<Vec<ModeInterval>>,
}

impl Modes<'_> {
    fn turn(&mut self, at: Instant, mode: &Mode, x: &[f64]) {
        let structure = &self.simulation.structure;
        let t = self.simulation.clock().between(self.start, at);
        for (j, spells) in self.spells.iter_mut().enumerate() {
            let now = structure.contact_mode(j, mode);
            if spells.last().is_none_or(|spell| spell.mode != now) {
                if let Some(last) = spells.last_mut() {
                    last.to = t;
                }
                let force = structure.force(j, mode, at, x);
                spells.push(ModeInterval { mode: now, from: t, to: t, force, x: x.to_vec() });
            }
        }
    }
}

impl Observer for Modes<'_> {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.turn(record.at, &record.to, &record.x_plus);
        ControlFlow::Continue(())
    }
}

/// Runs `engine` on for `cycles` whole cycles and keeps `per_cycle` samples of each.
pub(super) fn record(
    simulation: &Simulation,
    engine: &mut Engine<'_>,
    cycles: u64,
    per_cycle: u32,
) -> Result<Recording, StudyError> {
    let end = cycles_later(simulation.clock(), engine.state().at, cycles);
    record_until(simulation, engine, end, Grid::Phases { per_cycle })
}

/// Runs `engine` on until `end` and keeps samples on `grid`.
pub(super) fn record_until(
    simulation: &Simulation,
    engine: &mut Engine<'_>,
    end: Instant,
    grid: Grid,
) -> Result<Recording, StudyError> {
    let (structure, clock) = (&simulation.structure, simulation.clock());
    let (n, count) = (structure.freedoms(), structure.contact_count());
    let from = engine.state().clone();
    let mut recording = Recording {
        period: simulation.period().unwrap_or_default(),
        per_cycle: if let Grid::Phases { per_cycle } = grid { per_cycle } else { 0 },
        t: Vec::new(),
        x: vec![Vec::new(); 2 * n],
        deflection: vec![Vec::new(); count],
        force: vec![Vec::new(); count],
        spells: Vec::new(),
    };
    let mut modes = Modes { simulation, start: from.at, spells: vec![Vec::new(); count] };
    modes.turn(from.at, &from.jump.mode, &from.x);
    let mut samples = Trajectory::new(structure, grid, from.at, |s: &Sample<'_>| {
        recording.t.push(clock.between(from.at, s.at));
        recording.x.iter_mut().zip(s.x).for_each(|(column, x)| column.push(*x));
        for j in 0..count {
            recording.deflection[j].push(structure.deflection(j, s.at, s.x).0);
            recording.force[j].push(structure.force(j, s.mode, s.at, s.x));
        }
        ControlFlow::Continue(())
    });
    until(engine, end, &mut (&mut modes, &mut samples), Task::default())?;
    let span = clock.between(from.at, end);
    modes.spells.iter_mut().filter_map(|spells| spells.last_mut()).for_each(|last| last.to = span);
    recording.spells = modes.spells;
    Ok(recording)
}
