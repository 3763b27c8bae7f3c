//! Check by values: the motion by [`Collocation`], the guards by their values at points.

use std::array::from_fn;

use super::{
    FiringGuard, TOLERANCE, Verdict,
    arc::Arc,
    collocation::{Collocation, DEGREE, Nodal, RTOL, tail, value},
};

/// Maximum number of steps of an arc: a stiff arc would take more.
const STEPS: f64 = 4096.0;
/// Number of steps after which the rest of the arc is judged by the length of the last step.
const START: u64 = 64;
/// Number of points of a step at which a guard is tested, if its series does not prove it positive.
const POINTS: usize = 64;
/// Number of halvings of an interval: down to rounding.
const HALVINGS: usize = 60;
/// Length of the first step relative to the unit of time.
const FIRST: f64 = 1.0 / 64.0;

/// Compares an arc with the end that the run reports. Returns the number of steps too.
pub(super) fn check(arc: &Arc<'_>, collocation: &mut Collocation) -> (Verdict, u64) {
    let mut walk = Walk::new(arc, collocation, f64::INFINITY);
    let (verdict, most, steps) = (walk.verdict(), 0.5 * walk.longest, walk.steps);
    let Verdict::Differs(..) = verdict else { return (verdict, steps) };
    // A difference must persist with steps of half the length: the first steps may be inaccurate.
    let mut walk = Walk::new(arc, collocation, most);
    let again = walk.verdict();
    // Tests whether the run recorded this dip as a touch.
    let is_touch = |found: &[FiringGuard], late: f64| {
        let at = arc.system.clock().advance(arc.lane.last.at, arc.length - late);
        arc.is_touched(&arc.lane.touches, &found.iter().map(|(_, guard)| *guard).collect(), at)
    };
    match again {
        Verdict::Differs(found, late) if !is_touch(&found, late.unwrap_or(0.0)) => {
            (Verdict::Differs(found, late), steps + walk.steps)
        }
        _ => (Verdict::NotJudged, steps + walk.steps),
    }
}

/// State of the check along an arc.
struct Walk<'a> {
    arc: &'a Arc<'a>,
    collocation: &'a mut Collocation,
    t: f64,
    x: Vec<f64>,
    /// Largest size of the terms of each guard so far.
    sizes: Vec<f64>,
    steps: u64,
    /// Maximum length of a step, s.
    most: f64,
    /// Longest step so far, s.
    longest: f64,
}

impl<'a> Walk<'a> {
    fn new(arc: &'a Arc<'_>, collocation: &'a mut Collocation, most: f64) -> Self {
        let sizes = vec![0.0; arc.guards.len()];
        Self { arc, collocation, t: 0.0, x: arc.lane.last.x.clone(), sizes, steps: 0, most, longest: 0.0 }
    }

    /// Returns the error of a guard with terms of this size.
    fn error(&self, size: f64) -> f64 {
        RTOL * (self.steps + 3) as f64 * size
    }

    fn guards(&self) -> Vec<f64> {
        (0..self.sizes.len()).map(|g| self.arc.guard(g, self.t, &self.x)).collect()
    }

    fn verdict(&mut self) -> Verdict {
        self.compare().unwrap_or_else(|verdict| verdict)
    }

    fn compare(&mut self) -> Result<Verdict, Verdict> {
        let (arc, tolerance) = (self.arc, self.arc.tolerance());
        self.go(arc.length - tolerance, true)?;
        let Some(first) = arc.lane.pending.first() else { return Ok(Verdict::Same) };
        let before = self.guards();
        self.go(arc.length + tolerance, false)?;
        let after = self.guards();
        let (mut same, mut unclear, mut missing) = (false, false, None);
        for (g, guard) in arc.guards.iter().enumerate().filter(|(_, guard)| arc.fired().contains(**guard)) {
            let error = self.error(self.sizes[g]);
            if before[g] <= error || after[g].abs() <= error {
                unclear = true;
            } else if after[g] < 0.0 {
                same = true;
            } else {
                missing = missing.or(Some((arc.lane.last.jump.mode.clone(), *guard)));
            }
        }
        // Later jumps at the same instant, or after a switch, are no crossings of this arc.
        let all = arc.lane.pending.len() == 1 && first.jumps == 1;
        // A dip shorter than the uncertainty of the run lies between the two places.
        unclear |= arc.lane.pending.len() > 1 && tolerance > 2.0 * TOLERANCE * arc.unit;
        Ok(match missing {
            Some(guard) if !first.switched && (all || !same && !unclear) => {
                match self.go(arc.length + arc.unit, true) {
                    Err(Verdict::Differs(found, late)) if found == [guard] => Verdict::Differs(found, late),
                    _ => Verdict::Differs(Vec::new(), None),
                }
            }
            _ if unclear => Verdict::NotJudged,
            _ => Verdict::Same,
        })
    }

    /// Advances to `end`; with `watch`, until a guard is below zero by more than its error.
    fn go(&mut self, end: f64, watch: bool) -> Result<(), Verdict> {
        let arc = self.arc;
        let mut next = FIRST * arc.unit;
        while self.t < end {
            let h = next.min(self.most).min(end - self.t);
            self.steps += 1;
            let rest = if self.steps > START { (end - self.t) / h } else { 0.0 };
            if self.steps as f64 + rest > STEPS {
                return Err(Verdict::NotJudged);
            }
            let mut sizes = self.sizes.clone();
            let mut error = self.collocation.step(arc, (self.t, h), &self.x, &mut sizes);
            let mut falls = Vec::new();
            for (g, size) in sizes.iter_mut().enumerate() {
                if error.is_nan() || error > 1.0 {
                    break;
                }
                let nodes = &self.collocation;
                let values: Nodal = from_fn(|j| arc.guard(g, self.t + h * nodes.nodes[j], nodes.at(j).0));
                *size = values.iter().fold(*size, |m, v| m.max(v.abs()));
                let (series, known) = (nodes.series(&values), self.error(*size));
                error = error.max(if known > 0.0 { tail(&series) / known } else { 0.0 });
                falls.extend(fall(&series, known).filter(|_| watch).map(|theta| (theta, g)));
            }
            if error.is_nan() || error > 1.0 {
                // This covers NaN as well.
                next = h * libm::pow(error.min(f64::MAX), -1.0 / 3.0).clamp(0.1, 0.5);
                continue;
            }
            if let Some((theta, g)) = falls.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
                let late = arc.length - self.t - h * theta;
                return Err(Verdict::Differs(vec![(arc.lane.last.jump.mode.clone(), arc.guards[g])], Some(late)));
            }
            self.t = if h >= end - self.t { end } else { self.t + h };
            (self.sizes, self.longest) = (sizes, self.longest.max(h));
            self.x.copy_from_slice(self.collocation.at(DEGREE).0);
            next = h * libm::pow(0.5 / error, 1.0 / DEGREE as f64).min(2.5);
        }
        Ok(())
    }
}

/// Returns the place at which a guard with this series first falls through zero, if it then falls below `−error`.
fn fall(series: &Nodal, error: f64) -> Option<f64> {
    if series[0] - series[1..].iter().fold(0.0, |sum, c| sum + c.abs()) > -error {
        return None;
    }
    let at = |i: usize| i.min(POINTS) as f64 / POINTS as f64;
    let g = |i: usize| value(series, at(i));
    let mut high = (0..=POINTS).find_map(|i| {
        let (mut low, mut high) = (at(i.saturating_sub(1)), at(i + 1));
        if g(i) >= -error && g(i) <= value(series, low).min(value(series, high)) {
            // A minimum between points, by thirds.
            for _ in 0..HALVINGS {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if value(series, a) < value(series, b) { high = b } else { low = a }
            }
        } else {
            low = at(i);
        }
        (value(series, low) < -error).then_some(low)
    })?;
    let mut low = (0..=POINTS).rev().map(at).find(|theta| *theta < high && value(series, *theta) > 0.0).unwrap_or(0.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if value(series, middle) > 0.0 { low = middle } else { high = middle }
    }
    Some(high)
}
