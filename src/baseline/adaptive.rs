//! Solvers that choose their steps, across kinks and jumps, as `solve_ivp` without events does.

use std::{cell::RefCell, ops::ControlFlow};

use super::{
    Counters, Grid, Penalty, Sample, SampleObserver, StepPoint, Touch,
    forcing::{Forcing, Moment},
};
use crate::{
    hybrid::{Clock, FULL_PRECISION, GuardId, GuardSet, HybridSystem, Instant, Jump, Mode, ModelError, VectorField},
    integrate::{Arc, Choice, DenseStep, EarlierSteps, IntegrateError, build},
};

/// Penalty train as one smooth mode, although it has several: the solver has to adapt.
struct SmoothTrain<'p> {
    model: &'p Penalty,
    scratch: RefCell<Scratch>,
}

struct Scratch {
    forcing: Forcing,
    moment: Moment,
    force: Vec<f64>,
    touches: Vec<Touch>,
    evaluations: u64,
}

impl VectorField for SmoothTrain<'_> {
    fn eval(&self, _: &Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]) {
        let Scratch { forcing, moment, force, touches, evaluations } = &mut *self.scratch.borrow_mut();
        *evaluations += 1;
        forcing.at(self.model, self.model.clock.advance(base, t), moment);
        let (q, v) = x.split_at(self.model.n);
        let (dq, dv) = dx.split_at_mut(self.model.n);
        dq.copy_from_slice(v);
        self.model.forces(moment, q, v, touches, force);
        self.model.accelerations(moment, q, v, force.iter().copied(), dv);
    }

    fn jac_mul(&self, _: &Mode, base: Instant, t: f64, x: &[f64], y: &[f64], jv: &mut [f64]) {
        let Scratch { forcing, moment, touches, .. } = &mut *self.scratch.borrow_mut();
        forcing.at(self.model, self.model.clock.advance(base, t), moment);
        let n = self.model.n;
        let ((q, v), (q1, v1)) = (x.split_at(n), y.split_at(n));
        jv[..n].copy_from_slice(v1);
        for (a, row) in jv[n..].iter_mut().zip(&self.model.rows) {
            *a = row.iter().fold(0.0, |a, (j, k, c)| a - k * q1[*j as usize] - c * v1[*j as usize]);
        }
        for ((c, forced), touch) in self.model.contacts.iter().zip(&moment.contacts).zip(touches.iter()) {
            let at = c.deflection(forced, q, v);
            let (_, by_d, by_r) = self.model.law(c, forced.stiffness, at, touch.latch);
            let [d1, r1] =
                c.direction.iter().fold([0.0; 2], |[d, r], (i, g)| [d + g * q1[*i as usize], r + g * v1[*i as usize]]);
            let force = by_d * d1 + by_r * r1;
            c.push.iter().for_each(|(i, p)| jv[n + *i as usize] -= p * force);
        }
    }
}

impl HybridSystem for SmoothTrain<'_> {
    fn dim(&self) -> usize {
        2 * self.model.n
    }
    fn clock(&self) -> &Clock {
        &self.model.clock
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, _: &Mode, out: &mut Vec<GuardId>) {
        out.clear();
    }
    fn guard(&self, _: &Mode, _: GuardId, _: Instant, _: &[f64]) -> f64 {
        1.0
    }
    fn jump(&self, from: &Jump, _: &GuardSet, _: Instant, _: &mut [f64], _: &mut [f64]) -> Result<Jump, ModelError> {
        Ok(from.clone())
    }
    fn settle(&self, from: &Jump, _: &GuardSet, _: Instant, _: &mut [f64]) -> Result<Jump, ModelError> {
        Ok(from.clone())
    }
}

/// Samples in a solver's step.
const WITHIN: u32 = 4;

impl Penalty {
    /// Runs an adaptive solver with relative tolerance `rtol` over `grid`. It samples its dense output at the points of the grid, and at
    /// four places of each step, the last at the end.
    ///
    /// # Errors
    /// [`IntegrateError`] if the solver fails, as it may at jumps of the force, or is not part of this build.
    ///
    /// # Panics
    /// If the train has a rigid contact: there is no force to integrate.
    pub fn adaptive(
        &self,
        solver: Choice,
        rtol: f64,
        grid: &Grid,
        (q, v): (&[f64], &[f64]),
        watch: &mut dyn SampleObserver,
    ) -> Result<Counters, IntegrateError> {
        assert!(!self.rigid().contains(&true), "a rigid contact has no force to integrate");
        let mut point = self.point(grid.from, q, v);
        let through = SmoothTrain {
            model: self,
            scratch: RefCell::new(Scratch {
                forcing: Forcing::new(self, grid.from, grid.step),
                moment: self.moment(),
                force: vec![0.0; self.contacts()],
                touches: point.contacts.clone(),
                evaluations: 0,
            }),
        };
        let mut flow = watch.sample(&Sample { number: Some(0), t: 0.0, point: &point });
        let mut counters = Counters::default();
        let start: Vec<f64> = q.iter().chain(v).copied().collect();
        let bound = self.clock.advance(grid.from, grid.steps as f64 * grid.step);
        let (mode, none) = (Mode::default(), GuardSet::default());
        let arc = Arc {
            mode: &mode,
            motion: None,
            at: grid.from,
            x: &start,
            low: &[],
            carried: &[],
            pinned: &none,
            still: &none,
            bound,
            tolerance: FULL_PRECISION,
            before: EarlierSteps::default(),
        };
        let mut integrator = build(solver, rtol, &through)?;
        let (mut x, mut next) = (start.clone(), 1);
        if flow.is_continue() {
            integrator.integrate_arc(&through, &arc, &mut start.clone(), &mut [], &mut |step: &dyn DenseStep| {
                counters.steps += 1;
                let from = self.clock.between(grid.from, step.start());
                let to = from + step.time(1.0);
                let mut sample = |number: Option<u64>, t: f64, x: &mut Vec<f64>| {
                    step.state(((t - from) / (to - from)).clamp(0.0, 1.0), x);
                    point.q.copy_from_slice(&x[..self.n]);
                    point.v.copy_from_slice(&x[self.n..]);
                    through.look(self.clock.advance(grid.from, t), &mut point);
                    flow = watch.sample(&Sample { number, t, point: &point });
                    flow
                };
                // Within the step at equal distances, at the points of the grid, and at its end.
                for i in 1..=WITHIN {
                    let t = from + (to - from) * f64::from(i) / f64::from(WITHIN);
                    while next <= grid.steps && next as f64 * grid.step <= t {
                        sample(Some(next), next as f64 * grid.step, &mut x)?;
                        next += 1;
                    }
                    sample(None, t, &mut x)?;
                }
                step.state(1.0, &mut x);
                through.latch(step.start(), step.time(1.0), &x);
                ControlFlow::Continue(())
            })?;
        }
        counters.evaluations = through.scratch.borrow().evaluations;
        Ok(counters)
    }
}

impl SmoothTrain<'_> {
    /// Computes deflections and forces at a sample.
    fn look(&self, at: Instant, point: &mut StepPoint) {
        let scratch = &mut *self.scratch.borrow_mut();
        scratch.forcing.at(self.model, at, &mut point.moment);
        // The latch of a step is decided at its end, not at samples within it.
        point.contacts.iter_mut().zip(&scratch.touches).for_each(|(touch, known)| touch.latch = known.latch);
        self.model.find_touched(point);
        self.model.arrive(point);
    }

    /// Latches approach speeds at the end of a step that entered contact.
    fn latch(&self, from: Instant, dt: f64, x: &[f64]) {
        let Scratch { forcing, moment, touches, .. } = &mut *self.scratch.borrow_mut();
        forcing.at(self.model, self.model.clock.advance(from, dt), moment);
        let (q, v) = x.split_at(self.model.n);
        for ((c, forced), touch) in self.model.contacts.iter().zip(&moment.contacts).zip(touches) {
            let [d, r] = c.deflection(forced, q, v);
            c.latch(c.penetration(d), r, touch);
        }
    }
}
