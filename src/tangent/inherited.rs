//! Uncertainty of events from the amplified errors of the run before them.

use std::{cell::Cell, ops::ControlFlow};

use nalgebra::DMatrix;

use super::Tangent;
use crate::{
    engine::{JumpRecord, Observer, State},
    event::EventRecord,
    hybrid::{Columns, HybridSystem, Instant, Mode, VectorField},
    integrate::DenseStep,
    system::Structure,
};

/// Rounding of the state that a step adds, relative to its size.
const ROUNDED: f64 = 2.0 * f64::EPSILON;
/// Share of the size of the state used to difference a guard along a column.
const DIFFERENCE: f64 = 1e-6;

/// Errors of a run so far, as columns with spread `S Sᵀ`. Each step adds the rounding of the state. Each event adds the shift of the state
/// by the uncertainty of its own time. The tangent of the run amplifies them. They count as independent, and their squares add: an
/// estimate, no bound.
pub struct Inherited<'s> {
    structure: &'s Structure,
    /// Truncation of a step on request, relative to the state.
    left_out: f64,
    tangent: Tangent<'s>,
    /// Number of steps since errors were last added.
    steps: f64,
    /// Shift of the state per second of delay of the last instant.
    shift: Vec<f64>,
    /// Inherited uncertainty of the time of the open instant, s.
    time: Option<f64>,
    /// Inherited uncertainty of the instant closed last, s, for the writer of its record.
    told: &'s Cell<Option<f64>>,
}

impl<'s> Inherited<'s> {
    /// Starts from an exact `start`; steps leave out the share `left_out` of the rates on request. `told` receives each uncertainty.
    #[must_use]
    pub fn new(structure: &'s Structure, start: &State, left_out: f64, told: &'s Cell<Option<f64>>) -> Self {
        let dim = HybridSystem::dim(structure);
        let mut tangent = Tangent::of(structure, Columns { count: dim, values: vec![0.0; dim * dim] });
        tangent.start(start);
        Self { structure, left_out, tangent, steps: 0.0, shift: vec![0.0; dim], time: None, told }
    }

    /// Returns `√(Σ (h_x s_l)²)/|ḣ|` of a guard, for the columns s_l: the standard shift of its zero, s.
    fn moved(&self, jumped: &JumpRecord<'_>, id: crate::hybrid::GuardId) -> f64 {
        let (s, mode, x, dim) = (self.structure, &jumped.from.mode, jumped.x_minus, jumped.x_minus.len());
        let n = s.freedoms();
        let along = |direction: &dyn Fn(usize) -> f64, dt: f64| {
            // The difference is some millionth of the state, by the kind of component that changes most. A displacement can be zero at an
            // impact: its size is then that of the velocities over a radian.
            let size = |kind: std::ops::Range<usize>, of: &dyn Fn(usize) -> f64| {
                kind.fold(0.0, |m: f64, i| m.max(of(i).abs()))
            };
            let omega = s.clock().omega();
            let q = size(0..n, &|i| x[i]).max(size(n..2 * n, &|i| x[i]) / omega);
            // The difference in time is a small part of a radian of the forcing, for any speed of the state.
            let state = (size(0..n, direction) / q).max(size(n..2 * n, direction) / (q * omega));
            let share = state.max(omega * dt.abs());
            if share == 0.0 {
                return 0.0;
            }
            if !share.is_finite() {
                return f64::INFINITY;
            }
            let length = DIFFERENCE / share;
            let guard = |sign: f64| {
                let moved: Vec<f64> = (0..dim).map(|i| x[i] + sign * length * direction(i)).collect();
                s.guard(mode, id, s.clock().advance(jumped.at, sign * length * dt), &moved)
            };
            (guard(1.0) - guard(-1.0)) / (2.0 * length)
        };
        let mut field = vec![0.0; dim];
        s.eval(mode, jumped.at, 0.0, x, &mut field);
        let rate = along(&|i| field[i], 1.0);
        let columns = &self.tangent.columns;
        let squares: f64 = (0..columns.count).map(|l| along(&|i| columns.row(i)[l], 0.0).powi(2)).sum();
        squares.sqrt() / rate.abs()
    }

    /// Adds errors of the components, independent of each other and of the earlier errors.
    fn add(&mut self, mode: &Mode, errors: impl Fn(usize) -> f64, shift: f64) {
        let columns = &mut self.tangent.columns;
        let dim = columns.count;
        // [S, errors, shift] has the spread of the triangular factor of its transpose.
        let all = DMatrix::from_fn(2 * dim + 1, dim, |l, i| match l {
            l if l < dim => columns.row(i)[l],
            l if l < 2 * dim => {
                if l - dim == i {
                    errors(i)
                } else {
                    0.0
                }
            }
            _ => self.shift[i] * shift,
        });
        let triangle = all.qr().r();
        for i in 0..dim {
            for l in 0..dim {
                columns.values[i * dim + l] = triangle[(l, i)];
            }
        }
        self.tangent.restrain(mode);
        self.shift.fill(0.0);
        self.steps = 0.0;
    }
}

impl Observer for Inherited<'_> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.tangent.wants_steps(mode, until)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.steps += 1.0;
        self.tangent.leap(mode, time)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.steps += 1.0;
        self.tangent.step(mode, step, until)
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        let moved = jumped.fired.iter().map(|id| self.moved(jumped, id));
        // A shift beyond all numbers, or of a guard at zero speed, is unknown.
        let moved = moved.fold(0.0, |m: f64, moved| if moved.is_nan() { f64::INFINITY } else { m.max(moved) });
        self.time = Some(self.time.map_or(moved, |time| time.max(moved)));
        self.tangent.jump(jumped);
        // A jump later by dt shifts the state by `(f⁺ − R f⁻) dt`.
        let &JumpRecord { at, from, to, fired, x_minus, x_plus, settles } = jumped;
        let s = self.structure;
        let mut before = Columns { count: 1, values: vec![0.0; x_minus.len()] };
        s.eval(&from.mode, at, 0.0, x_minus, &mut before.values);
        s.saltate((from, to), (fired, settles, true), at, (x_minus, x_plus), &[], &mut before);
        let mut after = vec![0.0; x_plus.len()];
        s.eval(&to.mode, at, 0.0, x_plus, &mut after);
        self.shift.iter_mut().zip(after).zip(before.values).for_each(|((shift, a), b)| *shift += a - b);
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let is_known = |time: &f64| time.is_finite() && !self.tangent.is_unresolved;
        self.told.set(self.time.take().filter(is_known));
        let n = self.structure.freedoms();
        let largest = |range: std::ops::Range<usize>| record.x_plus[range].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let (q, v, steps) = (largest(0..n), largest(n..2 * n), self.steps + 1.0);
        // Rounding adds by squares; the truncation of steps may have one sign.
        let error = ROUNDED * steps.sqrt() + self.left_out * steps;
        let size = |i: usize| match i {
            i if i < n => q,
            i if i < 2 * n => v,
            i => record.x_plus[i].abs(),
        };
        let shift = if record.conditioning.time.is_finite() { record.conditioning.time } else { 0.0 };
        self.add(&record.to, |i| error * size(i), shift);
        ControlFlow::Continue(())
    }
}
