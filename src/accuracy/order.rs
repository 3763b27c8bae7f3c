//! Observed order of a fixed-step method, and the reason for a difference from its order on smooth problems.

use serde::Serialize;

use super::{Contender, SolverKind};
use crate::{
    baseline::{Interpolation, Ramp},
    gear::Stiffness,
    system::{ContactSpec, Structure},
};

/// Roughness of the right-hand side of a train where a fixed step crosses an event, roughest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Roughness {
    /// Velocities jump: rigid impacts.
    Impact,
    /// The force jumps: damping that acts in contact alone, a stiffness step under load.
    Jump,
    /// The law keeps the approach speed, which is found at the end of a step.
    Latch,
    /// The force has a kink: a spring with backlash.
    Kink,
    /// The force is continuously differentiable: a power law beyond 1 without hysteresis.
    Smooth,
    /// No contact can be lost.
    Closed,
}

impl Roughness {
    /// Returns the largest roughness among the contacts of a train.
    #[must_use]
    pub fn of(structure: &Structure) -> Self {
        let jumps = |before: f64, after: f64| (after - before).abs() > 1e-9 * after.abs();
        let has_steps = |schedule: &Stiffness| match schedule {
            Stiffness::Periodic { pieces, period, .. } => (0..pieces.len()).any(|i| {
                let (p, next) = (pieces[i], pieces[(i + 1) % pieces.len()]);
                let width = if i + 1 < pieces.len() { next.start - p.start } else { 1.0 + next.start - p.start };
                jumps(p.value + p.slope * width * period, next.value)
            }),
            Stiffness::Listed { times, values, slopes } => (0..times.len()).any(|i| {
                let width = if i > 0 { times[i][0] - times[i - 1][0] } else { 0.0 };
                jumps(values[i] + slopes[i] * width, values[i + 1])
            }),
            _ => false,
        };
        let of_loads = structure.spec().load_schedules.iter().any(|l| has_steps(&l.factor));
        let contacts = structure.spec().contacts.iter().map(|c| {
            let steps = of_loads || has_steps(&c.stiffness);
            match c.law.power() {
                _ if c.law.is_rigid() => Self::Impact,
                // Released by force, the force of a damper is still not zero where contact begins.
                _ if steps || c.law.jump_damping() > 0.0 => Self::Jump,
                _ if c.law.is_bilateral() => Self::Closed,
                Some(l) if l.hysteresis > 0.0 => Self::Latch,
                Some(l) if l.exponent.value() > 1.0 => Self::Smooth,
                _ => Self::Kink,
            }
        });
        contacts.min().unwrap_or(Self::Closed)
    }

    /// Returns the highest order of event times that is possible with steps across such places, and the reason in words.
    fn limit(self, structure: &Structure) -> (f64, &'static str) {
        match self {
            Self::Impact => (1.0, "velocities jump at impacts, which are found at the ends of steps"),
            Self::Jump => (1.0, "the force jumps inside steps"),
            Self::Latch => (1.0, "the approach speed that hysteresis keeps is found at the end of a step"),
            Self::Kink => (2.0, "the force has a kink inside steps"),
            Self::Closed => (f64::INFINITY, ""),
            Self::Smooth => {
                let exponent = |c: &ContactSpec| c.law.power().map_or(f64::INFINITY, |l| l.exponent.value());
                let lowest = structure.spec().contacts.iter().map(exponent).fold(f64::INFINITY, f64::min);
                // A step that straddles a start is wrong by its length times the force it missed, h · hⁿ.
                (1.0 + lowest, "the force of a power law is smooth to its exponent n and no further")
            }
        }
    }
}

/// Order observed on the finest steps, order expected, and the reason for a difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Order {
    /// Slope of `log error` against `log step`, fitted to the finest five runs that are right and above rounding; absent for
    /// fewer than four.
    pub observed: Option<f64>,
    /// Order of the method on smooth problems.
    pub smooth: u32,
    /// Order expected for the train, at most that on smooth problems.
    pub expected: f64,
    /// Reason for a lower order, in words; empty if there is none.
    pub reason: String,
}

/// Multiple of the error of the reference below which errors are not resolved.
const RESOLVED: f64 = 10.0;

impl Order {
    /// The order of event times of a fixed-step contender, from its runs `(steps a cycle, error)` with the right sequence of
    /// events, coarse to fine; `error` is the truth's own. `None` for others.
    #[must_use]
    pub fn of(contender: &Contender, structure: &Structure, runs: &[(u64, f64)], error: f64) -> Option<Self> {
        let SolverKind::Fixed(method) = contender.kind else { return None };
        let runs: Vec<_> = runs.iter().copied().filter(|(_, e)| *e > RESOLVED * error).collect();
        let observed = slope(&runs);
        let smooth = method.order();
        let (mut reasons, mut expected) = (Vec::new(), f64::from(smooth));
        if contender.ramp == Ramp::Sharp {
            let (limit, why) = Roughness::of(structure).limit(structure);
            if limit < f64::from(smooth) {
                expected = limit;
                reasons.push(format!("{why} (order {limit})"));
            }
        } else {
            let narrow = structure.spec().contacts.iter().map(|c| c.half_backlash).fold(f64::INFINITY, f64::min);
            let mut why = format!("the smoothed flank is {:.2e} m off, whatever the step", contender.ramp.bias());
            if let Some(sharp) = contender.ramp.sharpness().filter(|s| narrow > 0.0 && s * narrow < 50.0) {
                why += &format!("; over 1/σ = {:.2e} m, wide beside a half backlash of {narrow:.2e} m", 1.0 / sharp);
            }
            reasons.push(why);
        }
        if contender.interpolation == Interpolation::Linear && smooth > 2 {
            expected = expected.min(2.0);
            reasons.push("straight lines between samples (order 2)".to_owned());
        }
        Some(Self { observed, smooth, expected, reason: reasons.join("; ") })
    }
}

/// Number of runs to which an order is fitted: the place of a flank within a step scatters single errors by a factor of a few.
const FITTED: usize = 5;

fn slope(runs: &[(u64, f64)]) -> Option<f64> {
    let finest = &runs[runs.len().saturating_sub(FITTED)..];
    if finest.len() + 1 < FITTED {
        return None;
    }
    let points: Vec<(f64, f64)> = finest.iter().map(|(n, e)| (libm::log(*n as f64), libm::log(*e))).collect();
    let count = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (xx, xy) = points.iter().fold((0.0, 0.0), |(xx, xy), p| {
        let d = p.0 - x;
        (xx + d * d, xy + d * (p.1 - y))
    });
    Some(-xy / xx)
}

/// Returns the cost at which a contender's error falls below `target`, from its runs `(error, cost)`, coarse to fine; a run whose
/// sequence of events is wrong has no error. The cost is that of the first of the finest runs that all stay below, or lies between it and
/// the run before, on the straight line through their logarithms, if that run is right too. The second value is true if the target was
/// reached; if not, the cost of the finest run, if it is right, is extrapolated by `order`.
#[must_use]
pub fn reached(runs: &[(Option<f64>, f64)], target: f64, order: Option<f64>) -> Option<(f64, bool)> {
    let below = runs.iter().rev().take_while(|(e, _)| e.is_some_and(|e| e <= target)).count();
    let first = runs.len() - below;
    if below == 0 {
        let (error, cost) = runs.last().and_then(|(e, cost)| Some(((*e)?, *cost)))?;
        // An order near zero is a plateau: no step helps.
        let order = order.filter(|p| *p > 0.5)?;
        return Some((cost * libm::pow(error / target, order.recip()), false));
    }
    let (Some(e1), c1) = runs[first] else { return None };
    Some(match first.checked_sub(1).map(|i| runs[i]) {
        Some((Some(e0), c0)) if e1 > 0.0 => {
            let slope = libm::log(c1 / c0) / libm::log(e1 / e0);
            (libm::exp(libm::log(c1) + slope * libm::log(target / e1)), true)
        }
        _ => (c1, true),
    })
}
