//! Samples of the dense output at exact phases or at fixed intervals.

use std::ops::ControlFlow;

use super::quadrature::theta_at;
use crate::{
    engine::{Observer, State},
    hybrid::{Clock, HybridSystem, Instant, Mode, Wide},
    integrate::DenseStep,
};

/// Grid of the samples in time.
#[derive(Clone, Debug, PartialEq)]
pub enum Grid {
    /// `per_cycle` samples per forcing cycle, at phases `i T/per_cycle`. Each phase is computed from its index, so all cycles have the same
    /// phases to the last bit.
    Phases {
        /// Samples per cycle, > 0.
        per_cycle: u32,
    },
    /// Every `interval` seconds from the first instant on: `t₀ + i · interval`, from the index too.
    Interval {
        /// Interval, s, > 0.
        interval: f64,
    },
    /// These times, s, in rising order. The rounded time of an event gives the state after the event.
    Times(Vec<f64>),
}

/// One sample. At an event it is the state after it.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Index of the sample, from 0.
    pub index: u64,
    /// Instant of the sample.
    pub at: Instant,
    /// Time, s, rounded to a double.
    pub t: f64,
    /// Mode.
    pub mode: &'a Mode,
    /// State, `[dim]`.
    pub x: &'a [f64],
}

/// Passes samples to a callback. Call [`finish`](Self::finish) after the run for a sample exactly at its end.
pub struct Trajectory<F> {
    clock: Clock,
    grid: Grid,
    origin: Instant,
    number: i64,
    emitted: u64,
    x: Vec<f64>,
    row: F,
}

impl<F: FnMut(&Sample<'_>) -> ControlFlow<()>> Trajectory<F> {
    /// Returns samples from `from` on; earlier times of a list give none. Without a period a [`Grid::Phases`] has no phases and gives none.
    #[must_use]
    pub fn new(system: &dyn HybridSystem, grid: Grid, from: Instant, row: F) -> Self {
        let clock = *system.clock();
        let x = vec![0.0; system.dim()];
        let mut trajectory = Self { clock, grid, origin: from, number: 0, emitted: 0, x, row };
        if let Grid::Times(times) = &trajectory.grid {
            let start = clock.time(from).value();
            // Exact: a list in memory is shorter.
            trajectory.number = times.partition_point(|t| *t < start) as i64;
        }
        if let (&Grid::Phases { per_cycle }, Some(period)) = (&trajectory.grid, clock.period()) {
            let estimate = (from.phase.hi / period.hi * f64::from(per_cycle)).floor() as i64;
            trajectory.number = from.cycle * i64::from(per_cycle) + estimate - 1;
            while trajectory.due().is_some_and(|at| clock.between(from, at) < 0.0) {
                trajectory.number += 1;
            }
        }
        trajectory
    }

    /// Returns the instant of the next sample; `None` for a grid without samples.
    #[must_use]
    pub fn due(&self) -> Option<Instant> {
        match &self.grid {
            Grid::Phases { per_cycle } => {
                let per_cycle = i64::from(*per_cycle.max(&1));
                let (cycle, i) = (self.number.div_euclid(per_cycle), self.number.rem_euclid(per_cycle));
                let phase = Wide::quotient(self.clock.period()? * i as f64, per_cycle as f64);
                Some(Instant { cycle, phase })
            }
            &Grid::Interval { interval } => {
                if interval.is_nan() || interval <= 0.0 {
                    return None;
                }
                let offset = Wide::product(interval, self.number as f64);
                Some(self.clock.advance(self.clock.advance(self.origin, offset.hi), offset.lo))
            }
            Grid::Times(times) => times.get(self.number as usize).map(|t| self.clock.instant(*t)),
        }
    }

    fn emit(&mut self, at: Instant, mode: &Mode) -> ControlFlow<()> {
        let sample = Sample { index: self.emitted, at, t: self.clock.time(at).value(), mode, x: &self.x };
        self.emitted += 1;
        self.number += 1;
        (self.row)(&sample)
    }

    /// Adds the sample at the end of a run, if one is due there.
    pub fn finish(&mut self, state: &State) -> ControlFlow<()> {
        let is_reached = |samples: &Self, at: &Instant| match &samples.grid {
            Grid::Times(times) => times[samples.number as usize] <= samples.clock.time(state.at).value(),
            _ => samples.clock.between(*at, state.at) >= 0.0,
        };
        while let Some(at) = self.due().filter(|at| is_reached(self, at)) {
            self.x.copy_from_slice(&state.x);
            self.emit(at, &state.jump.mode)?;
        }
        ControlFlow::Continue(())
    }
}

impl<F: FnMut(&Sample<'_>) -> ControlFlow<()>> Observer for Trajectory<F> {
    fn observed_from(&self) -> Instant {
        self.due().unwrap_or(Instant::LAST)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let span = step.time(until);
        // A sample exactly at the end has the state after an event there.
        while let Some(at) = self.due() {
            let elapsed = self.clock.between(step.start(), at);
            let is_later = match &self.grid {
                // A time is a double: that of an event, rounded, gives the state after it too.
                Grid::Times(times) => {
                    times[self.number as usize] >= self.clock.time(self.clock.advance(step.start(), span)).value()
                }
                _ => elapsed >= span,
            };
            if is_later {
                break;
            }
            let theta = theta_at(step, elapsed.max(0.0), until);
            step.state(theta, &mut self.x);
            self.emit(at, mode)?;
        }
        ControlFlow::Continue(())
    }
}
