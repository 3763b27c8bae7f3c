//! Rule of [`CellRule::decide`] for trains of one degree of freedom, by a lane: states and derivatives in arrays of fixed size.
//!
//! It is the rule of [`Approach`](crate::orbit::Approach) and [`decide`](crate::orbit::decide()), with their numbers. `tests/motions/map.rs`
//! compares both on the same cells.

use super::{
    cell::{Cell, CellRule, Impacts, LONGEST, average},
    runner::{Closed, LaneStop, Pair, Runner, apart},
};
use crate::{
    engine::State,
    kernel::LaneRecords,
    orbit::{
        Motion, MotionKind, Section,
        approach::{FIRST, GROWTH, closing, return_distances},
        frame::column,
        kind::{CLOSES, CLOSING, Figures, LONG, still_closing},
    },
    simulation::{Simulation, SimulationError},
    system::ContactMode,
    task::Task,
};

/// Number of searches for a long period after the last cycle, each [`LONG`] cycles later.
const LATER: usize = 4;

impl Runner<'_> {
    fn cell(&self, motion: Motion, x: Pair, times: [f64; 5], exponent: Option<f64>, averages: Vec<[f64; 2]>) -> Cell {
        let [separated, drive, back, drive_detached, back_detached] = times;
        let total: f64 = times.iter().sum();
        // A rigid contact has no time on a flank that it strikes: its impacts are in the word alone.
        let met = [separated > 0.0, drive + drive_detached > 0.0, back + back_detached > 0.0];
        Cell {
            impacts: Impacts::of(met),
            apart: vec![separated / total],
            exponent,
            section: self.section(x),
            averages,
            motion,
        }
    }
}

impl CellRule {
    /// Returns the result of [`decide`](Self::decide) by a lane; `None` if the train or its motion has none.
    pub(super) fn decide_in_lane(
        &self,
        simulation: &Simulation,
        start: &State,
        task: Task<'_>,
    ) -> Result<Option<Cell>, SimulationError> {
        let Some(mut runner) = Runner::new(simulation)? else { return Ok(None) };
        runner.begin(start);
        let (mut sections, mut unstable) = (vec![runner.x()], Vec::new());
        let mut next = FIRST.min(self.transient_cycles);
        let periodic = |runner: &Runner<'_>, orbit: &Closed, cycles: usize| {
            let [larger, _] = orbit.sizes();
            let motion = Motion {
                kind: MotionKind::Periodic,
                period: Some(orbit.period as u64),
                word: Some(runner.word(&orbit.events)),
                multiplier: Some(larger),
                exponent: None,
                rotation: None,
                cycles: cycles as u64,
                distance: orbit.residual,
                reason: None,
            };
            let time: f64 = orbit.times.iter().sum();
            let exponent = Some(libm::log(larger) / time).filter(|exponent| exponent.is_finite());
            runner.cell(motion, orbit.x, orbit.times, exponent, Vec::new())
        };
        let mut quiet = LaneRecords::default();
        while (sections.len() as u64) <= self.transient_cycles {
            if runner.cycle(&mut quiet)?.is_err() || task.is_cancelled() {
                return Ok(None);
            }
            sections.push(runner.x());
            let cycles = sections.len() as u64 - 1;
            if cycles < next {
                continue;
            }
            next = (cycles + 1).max((cycles as f64 * GROWTH) as u64).min(self.transient_cycles);
            match runner.candidate(&mut sections, LONGEST as usize, &mut unstable)? {
                Ok(Some(orbit)) => return Ok(Some(periodic(&runner, &orbit, sections.len() - 1))),
                Ok(None) => {}
                Err(LaneStop) => return Ok(None),
            }
        }
        let period = simulation.period()?;
        let mut records = LaneRecords { columns: Some(column(simulation)), ..LaneRecords::default() };
        let dropped = sections.len();
        let mut rows = Vec::with_capacity(self.further_cycles as usize);
        let mut figures = None;
        for half in [false, true] {
            while rows.len() as u64 != if half { self.further_cycles } else { self.further_cycles / 2 } {
                if runner.cycle(&mut records)?.is_err() || task.is_cancelled() {
                    return Ok(None);
                }
                sections.push(runner.x());
                rows.extend(runner.growth(&mut records));
            }
            let observables = [0, 1].map(|i| sections[dropped..].iter().map(|x| x[i]).collect::<Vec<f64>>());
            let now = Figures::new(&rows, observables.iter().map(Vec::as_slice), period);
            figures = Some((now, observables.iter().map(|values| average(values)).collect::<Vec<_>>()));
            if now.is_chaotic(period, false) && !now.is_low() {
                break;
            }
        }
        let Some((figures, averages)) = figures else { return Ok(None) };
        let watched = &sections[dropped..];
        let (mut tried, last) = (None, watched[watched.len() - 1]);
        let scales = runner.scales(watched);
        let longest = watched.len() / 4;
        let closes = (1..=longest).any(|k| apart(watched[watched.len() - 1 - k], last, scales) <= CLOSES);
        let times = records.times;
        if closes || figures.is_low() {
            unstable.clear();
            for _ in 0..LATER {
                match runner.candidate(&mut sections, (LONG as usize).max(longest), &mut unstable)? {
                    Ok(Some(orbit)) => return Ok(Some(periodic(&runner, &orbit, sections.len() - 1))),
                    Ok(None) => {}
                    Err(LaneStop) => return Ok(None),
                }
                for _ in 0..LONG {
                    if runner.cycle(&mut quiet)?.is_err() {
                        return Ok(None);
                    }
                    sections.push(runner.x());
                }
            }
            tried = Some("no orbit that it approaches was found".to_owned());
        }
        let cycles = sections.len() as u64 - 1;
        // With damping areas shrink from cycle to cycle; the area inside a torus of two dimensions does not.
        let shrinks = runner.shrinks();
        let (kind, reason) = if figures.is_regular(period) && !shrinks {
            (MotionKind::QuasiPeriodic, None)
        } else if figures.is_chaotic(period, true) {
            (MotionKind::Chaotic, None)
        } else {
            let all: Vec<Section> = sections[dropped..]
                .iter()
                .map(|x| Section { x: x.to_vec(), contacts: vec![ContactMode::Separated] })
                .collect();
            if !figures.parts()
                && closing(return_distances(&runner.map, &all, LONG as usize, &runner.map.drift())) <= CLOSING
            {
                (MotionKind::Transient, Some(still_closing(cycles)))
            } else {
                (MotionKind::Undecided, Some(figures.reason(cycles, tried)))
            }
        };
        let exponent = Some([figures.exponent, figures.band]).filter(|e| e.iter().all(|e| e.is_finite()));
        let motion = Motion {
            kind,
            period: None,
            word: None,
            multiplier: None,
            exponent,
            rotation: None,
            cycles,
            distance: apart(sections[sections.len() - 2], sections[sections.len() - 1], scales),
            reason,
        };
        Ok(Some(runner.cell(motion, runner.x(), times, exponent.map(|[exponent, _]| exponent), averages)))
    }
}
