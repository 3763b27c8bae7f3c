//! One arc of a run, and the sizes of its terms: rounding is a few units of them.

use super::{CheckPosition, TOLERANCE};
use crate::{
    event::EventRecord,
    hybrid::{GuardId, GuardSet, HybridSystem, Instant, VectorField},
};

/// Rounding of a guard in units of ε times its terms: a value below it counts as zero. Each earlier step adds two.
const ROUNDING: f64 = 32.0;
/// Number of terms of the exponential: the depth of couplings from a coordinate to a guard.
const COUPLINGS: usize = 6;
/// Duration of a touch relative to the time unit: the root of the relative error of a guard.
const TOUCH: f64 = 1e-7;
/// Relative change of a coordinate in a difference quotient; `SMALLEST` is for coordinates that are and stay zero.
const CHANGE: f64 = 1e-3;
const SMALLEST: f64 = 1e-9;

/// An arc of a run, with the end that the run reports.
pub(super) struct Arc<'a> {
    pub system: &'a dyn HybridSystem,
    pub lane: &'a CheckPosition,
    /// Duration of the arc, s.
    pub length: f64,
    /// Unit of the tolerance, s.
    pub unit: f64,
    pub guards: Vec<GuardId>,
    /// `|∂g/∂x_i|` at the start, `[guards · dim]`.
    gradients: Vec<f64>,
    /// `|∂f_i/∂x_k|` at the start, `[dim · dim]`.
    jacobian: Vec<f64>,
}

impl<'a> Arc<'a> {
    /// Returns the arc from the position of a check to `end`; `period` is its unit of time, s, or else its own length.
    pub fn new(system: &'a dyn HybridSystem, lane: &'a CheckPosition, end: Instant, period: Option<f64>) -> Self {
        let from = &lane.last;
        let length = system.clock().between(from.at, end);
        let unit = period.unwrap_or(length);
        let (dim, mode) = (from.x.len(), from.jump.mode.clone());
        let mut guards = Vec::new();
        system.guards(&mode, &mut guards);
        let (gradients, jacobian) = (vec![0.0; guards.len() * dim], vec![0.0; dim * dim]);
        let mut arc = Self { system, lane, length, unit, guards, gradients, jacobian };
        let (mut rate, mut column, mut direction) = (vec![0.0; dim], vec![0.0; dim], vec![0.0; dim]);
        arc.field().eval(&mode, from.at, 0.0, &from.x, &mut rate);
        let mut moved = from.x.clone();
        for i in 0..dim {
            direction[i] = 1.0;
            arc.field().jac_mul(&mode, from.at, 0.0, &from.x, &direction, &mut column);
            direction[i] = 0.0;
            column.iter().enumerate().for_each(|(k, c)| arc.jacobian[k * dim + i] = c.abs());
            let change = CHANGE * (from.x[i].abs() + unit * rate[i].abs());
            moved[i] += if change > 0.0 { change } else { SMALLEST };
            for g in 0..arc.guards.len() {
                let difference = arc.guard(g, 0.0, &moved) - arc.guard(g, 0.0, &from.x);
                arc.gradients[g * dim + i] = (difference / (moved[i] - from.x[i])).abs();
            }
            moved[i] = from.x[i];
        }
        arc
    }

    pub fn field(&self) -> &'a dyn VectorField {
        self.system.field()
    }

    /// Returns the value of guard `g` at `x`, `t` s after the start.
    pub fn guard(&self, g: usize, t: f64, x: &[f64]) -> f64 {
        let at = self.system.clock().advance(self.lane.last.at, t);
        self.system.guard(&self.lane.last.jump.mode, self.guards[g], at, x)
    }

    pub fn fired(&self) -> GuardSet {
        self.lane.pending.iter().fold(GuardSet::default(), |set, record| &set | &record.fired)
    }

    /// Returns the largest difference of instants that the check by values counts as one, s, with the uncertainty stated by the run.
    pub fn tolerance(&self) -> f64 {
        let stated = self.lane.pending.iter().fold(0.0, |m: f64, record| m.max(record.conditioning.time));
        TOLERANCE * self.unit + self.resolution() + stated
    }

    /// Returns whether one of `touches` is of a guard in `set` and covers `at`: it cannot be distinguished from a dip.
    pub fn is_touched<'r>(
        &self,
        touches: impl IntoIterator<Item = &'r EventRecord>,
        set: &GuardSet,
        at: Instant,
    ) -> bool {
        let half = |touch: &EventRecord| TOUCH * self.unit + 2.0 * touch.conditioning.time;
        let holds = |touch: &EventRecord| self.system.clock().between(at, touch.at).abs() <= half(touch);
        touches.into_iter().any(|touch| holds(touch) && !(&touch.fired & set).is_empty())
    }

    /// Returns whether each guard in `set` passes zero within a time `margin` of `record`, s, to first order.
    pub fn is_close(&self, set: &GuardSet, record: &EventRecord, margin: f64) -> bool {
        let mut rate = vec![0.0; record.x_minus.len()];
        self.field().eval(&self.lane.last.jump.mode, record.at, 0.0, &record.x_minus, &mut rate);
        let at = |t: f64| record.x_minus.iter().zip(&rate).map(|(x, f)| x + t * f).collect::<Vec<f64>>();
        let [before, after] = [-margin, margin].map(at);
        let passes = |g: usize| self.guard(g, self.length, &before) * self.guard(g, self.length, &after) <= 0.0;
        set.iter().all(|id| self.guards.iter().position(|own| *own == id).is_some_and(passes))
    }

    /// Returns the rounding of the two instants that bound the arc, s.
    fn resolution(&self) -> f64 {
        8.0 * f64::EPSILON * f64::EPSILON * self.system.clock().time(self.lane.last.at).hi.abs()
    }

    /// Returns the size of the terms of guard `g` at `x`, where `x` moves with rate `f` for a time `h`.
    pub fn size(&self, g: usize, (x, f): (&[f64], &[f64]), h: f64) -> f64 {
        let gradient = &self.gradients[g * x.len()..];
        gradient.iter().zip(x.iter().zip(f)).map(|(d, (x, f))| d * (x.abs() + h * f.abs())).sum()
    }

    /// Returns the effect of an error of each coordinate on the guards within a time `h`, relative to their `sizes`: `Σ_g |∂g/∂x|
    /// exp(h|J|)/size`. The sizes of the coordinates themselves may be zero by symmetry.
    pub fn weights(&self, sizes: &[f64], h: f64) -> Vec<f64> {
        let dim = self.lane.last.x.len();
        let mut at_once = vec![0.0; dim];
        for (gradient, size) in self.gradients.chunks_exact(dim).zip(sizes).filter(|(_, size)| **size > 0.0) {
            at_once.iter_mut().zip(gradient).for_each(|(w, d)| *w += d / size);
        }
        (1..=COUPLINGS).rev().fold(at_once.clone(), |weights, k| {
            let mut sum = at_once.clone();
            for (row, w) in self.jacobian.chunks_exact(dim).zip(weights) {
                sum.iter_mut().zip(row).for_each(|(s, j)| *s += w * j * h / k as f64);
            }
            sum
        })
    }

    /// Returns the uncertainty of the time of `record` after `steps` steps of the arc, s.
    ///
    /// The record has the error of its own step. Earlier steps leave the rounding of the state, of the terms of the guard, and of their
    /// rates until the end of the arc. This is divided by the slope of the guard. If the slope vanishes, half the curvature times unit²
    /// replaces the size of the terms.
    pub fn uncertainty(&self, record: &EventRecord, steps: u64) -> f64 {
        let mut rate = vec![0.0; self.lane.last.x.len()];
        self.field().eval(&self.lane.last.jump.mode, record.at, 0.0, &record.x_minus, &mut rate);
        let fired = (0..self.guards.len()).filter(|g| record.fired.contains(self.guards[*g]));
        let size = fired.fold(0.0, |m: f64, g| m.max(self.size(g, (&record.x_minus, &rate), self.length)));
        let relative = (ROUNDING + 2.0 * steps as f64) * f64::EPSILON;
        let by_slope = if size > 0.0 { relative * size / record.conditioning.slope.abs() } else { 0.0 };
        let by_state = by_slope.min(2.0 * relative.sqrt() * self.unit);
        record.conditioning.time + by_state + 2.0 * f64::EPSILON * self.length + self.resolution()
    }
}
