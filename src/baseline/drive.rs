//! Loop of a fixed-step code.

use std::ops::ControlFlow;

use serde::Serialize;

use super::{Method, Penalty, StepPoint, forcing::Forcing};
use crate::hybrid::Instant;

/// Equal steps from an instant on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Start of the first step.
    pub from: Instant,
    /// Length of a step h, s, > 0.
    pub step: f64,
    /// Number of steps.
    pub steps: u64,
}

/// Work done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Number of steps.
    pub steps: u64,
    /// Evaluations of all contact forces, those of Newton's iterations included.
    pub evaluations: u64,
    /// Newton iterations.
    pub iterations: u64,
    /// Matrices factorised.
    pub factorisations: u64,
    /// Steps whose Newton iteration did not converge.
    pub unconverged: u64,
}

/// Solution that became infinite or NaN.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the solution stops being finite at t = {t} s, after {} steps", counters.steps)]
pub struct Divergence {
    /// Time after the start at which the solution stops being finite, s.
    pub t: f64,
    /// Work done until then.
    pub counters: Counters,
}

/// End of a step (or the start of the run, number 0).
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Index of the grid point; none at an adaptive solver's steps between grid points.
    pub number: Option<u64>,
    /// Time since the start, s: `number · h` on the grid.
    pub t: f64,
    /// State, deflections and forces there.
    pub point: &'a StepPoint,
}

/// Observer of a fixed-step run from sample to sample.
pub trait SampleObserver {
    /// Takes one sample; may interrupt the run.
    fn sample(&mut self, sample: &Sample<'_>) -> ControlFlow<()>;
}

impl<A: SampleObserver, B: SampleObserver> SampleObserver for (A, B) {
    fn sample(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        self.0.sample(sample)?;
        self.1.sample(sample)
    }
}

impl<T: SampleObserver + ?Sized> SampleObserver for &mut T {
    fn sample(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        (**self).sample(sample)
    }
}

/// A fixed-step method: from the point at the start of a step to coordinates and velocities at its end.
pub(super) trait Stepper {
    /// Returns the strides of the forcing in a step: 2 if its middle is used.
    fn strides(&self) -> u32 {
        1
    }
    /// Does one step of length h. Leaves `point.moment` at the end of the step.
    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut StepPoint, h: f64, counters: &mut Counters);
}

impl Penalty {
    /// Runs `method` on `grid` from `q`, `v`, `[n]` each.
    ///
    /// # Errors
    /// [`Divergence`] as soon as a coordinate or a velocity is not finite.
    pub fn drive(
        &self,
        method: Method,
        grid: &Grid,
        (q, v): (&[f64], &[f64]),
        watch: &mut (impl SampleObserver + ?Sized),
    ) -> Result<Counters, Divergence> {
        let mut point = self.point(grid.from, q, v);
        let mut stepper = method.stepper(self, grid.step);
        let mut forcing = Forcing::new(self, grid.from, grid.step / f64::from(stepper.strides()));
        let mut counters = Counters::default();
        let mut flow = watch.sample(&Sample { number: Some(0), t: 0.0, point: &point });
        while flow.is_continue() && counters.steps < grid.steps {
            stepper.step(self, &mut forcing, &mut point, grid.step, &mut counters);
            counters.steps += 1;
            counters.evaluations += 1;
            self.arrive(&mut point);
            let t = counters.steps as f64 * grid.step;
            // A finite number times zero is zero.
            let zero = point.q.iter().chain(&point.v).fold(0.0, |s, x| s + x * 0.0);
            if zero != 0.0 {
                return Err(Divergence { t, counters });
            }
            flow = watch.sample(&Sample { number: Some(counters.steps), t, point: &point });
        }
        Ok(counters)
    }
}
