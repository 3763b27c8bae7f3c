//! The check by values: the motion by [`Collocation`], the guards by their values at points.

use super::{
    Seen, Verdict,
    collocation::{Collocation, DEGREE, RTOL, value},
    sizes::{Norm, Sizes, Terms, field},
};
use crate::{
    engine::State,
    event::EventRecord,
    hybrid::{GuardId, HybridSystem},
};

/// Steps an arc may take: a stiff one would take more.
const STEPS: u64 = 4096;
/// Steps after which the rest of the arc is judged by the length of the last one.
const START: u64 = 64;
/// Points of a step at which a guard is looked at that its series does not show to be positive.
const POINTS: usize = 64;
/// Halvings of an interval: down to rounding.
const HALVINGS: usize = 60;
/// The first step as a part of the period.
const FIRST: f64 = 1.0 / 64.0;

/// The check by values.
pub(super) struct Points {
    collocation: Collocation,
    pub steps: u64,
    /// No step may be longer, s.
    most: f64,
    /// The longest step taken since this was zero, s.
    longest: f64,
}

/// A walk along an arc: where it is, and what it met.
struct Walk<'a> {
    norm: Norm<'a>,
    from: &'a State,
    t: f64,
    x: Vec<f64>,
    h: f64,
    /// Error of each guard so far.
    errors: Vec<f64>,
    steps: u64,
}

impl<'a> Walk<'a> {
    fn new(from: &'a State, terms: &'a Terms, h: f64) -> Self {
        let errors = vec![0.0; terms.guards.len()];
        Self { norm: Norm::new(terms, from.x.len()), from, t: 0.0, x: from.x.clone(), h, errors, steps: 0 }
    }
}

/// Why a walk ended before its end.
enum Stop {
    /// It would take too many steps.
    Long,
    /// Guard `g` fell below zero, s after the start.
    Fell(usize, f64),
}

impl Points {
    pub fn new(dim: usize) -> Self {
        Self { collocation: Collocation::new(dim), steps: 0, most: f64::INFINITY, longest: 0.0 }
    }

    /// Compares the arc from `from` with what the run says of its end: the records of `pending`, or nothing until `pending`
    /// is empty and `end` s have passed. `unit` is the period.
    pub fn check(
        &mut self,
        system: &dyn HybridSystem,
        sizes: &mut Sizes,
        from: &State,
        pending: &[EventRecord],
        (end, unit): (f64, f64),
    ) -> Verdict {
        let terms = sizes.of(system, from, unit);
        self.longest = 0.0;
        let verdict = self.once(system, terms, from, pending, (end, unit));
        let Verdict::Differs(..) = verdict else { return verdict };
        // A difference has to stand with steps of half the length: the method may have erred itself.
        self.most = 0.5 * self.longest;
        let again = self.once(system, terms, from, pending, (end, unit));
        self.most = f64::INFINITY;
        if matches!(again, Verdict::Differs(..)) { again } else { Verdict::NotJudged }
    }

    fn once(
        &mut self,
        system: &dyn HybridSystem,
        terms: &Terms,
        from: &State,
        pending: &[EventRecord],
        (end, unit): (f64, f64),
    ) -> Verdict {
        let tolerance = super::TOLERANCE * unit + super::resolution(system, from.at);
        let mut walk = Walk::new(from, terms, (FIRST * unit).min(end));
        match self.walk(system, &mut walk, end - tolerance, true) {
            Err(Stop::Long) => return Verdict::NotJudged,
            Err(Stop::Fell(g, t)) => return Verdict::Differs(vec![Seen::new(from, terms.guards[g].id)], Some(end - t)),
            Ok(()) => {}
        }
        let Some(first) = pending.first() else { return Verdict::Same };
        let guard =
            |id: GuardId, t: f64, x: &[f64]| system.guard(from.jump.mode, id, system.clock().advance(from.at, t), x);
        let before: Vec<f64> = terms.guards.iter().map(|g| guard(g.id, walk.t, &walk.x)).collect();
        walk.h = end + tolerance - walk.t;
        if self.walk(system, &mut walk, end + tolerance, false).is_err() {
            return Verdict::NotJudged;
        }
        let fired = pending.iter().fold(0, |set, record| set | record.fired.0);
        let (mut same, mut unclear, mut missing) = (0, 0, None);
        for (g, (id, a)) in terms.guards.iter().map(|guard| guard.id).zip(before).enumerate() {
            if fired >> id.0 & 1 == 0 {
                continue;
            }
            let (b, error) = (guard(id, walk.t, &walk.x), walk.errors[g]);
            if a <= error || a - b <= 2.0 * error && b <= error || b.abs() <= error {
                unclear += 1;
            } else if b < 0.0 {
                same += 1;
            } else {
                missing = missing.or(Some(g));
            }
        }
        // What follows at the same instant, or after a switch, is no crossing of this arc.
        let all = pending.len() == 1 && first.jumps == 1 && !first.switched;
        match missing {
            Some(g) if all || same + unclear == 0 && !first.switched => {
                walk.h = FIRST * unit;
                let late = match self.walk(system, &mut walk, end + unit, true) {
                    Err(Stop::Fell(other, t)) if other == g => Some(end - t),
                    _ => None,
                };
                let found = late.map_or_else(Vec::new, |_| vec![Seen::new(from, terms.guards[g].id)]);
                Verdict::Differs(found, late)
            }
            _ if unclear > 0 => Verdict::NotJudged,
            _ => Verdict::Same,
        }
    }

    /// Goes on to `end`; with `watch`, until a guard is below zero by more than its error.
    fn walk(&mut self, system: &dyn HybridSystem, walk: &mut Walk<'_>, end: f64, watch: bool) -> Result<(), Stop> {
        let mode = walk.from.jump.mode;
        while walk.t < end {
            let h = walk.h.min(self.most).min(end - walk.t);
            self.steps += 1;
            walk.steps += 1;
            let wanted = if walk.steps > START { (end - walk.t) / h } else { 0.0 };
            if walk.steps as f64 + wanted > STEPS as f64 {
                return Err(Stop::Long);
            }
            let place = (walk.from.at, walk.t, h);
            let (mut error, sizes) = self.collocation.step(field(system), mode, place, &walk.x, &mut walk.norm);
            let guards = &walk.norm.terms.guards;
            let mut series = Vec::with_capacity(guards.len());
            if error <= 1.0 {
                let c = &self.collocation;
                for (g, guard) in guards.iter().enumerate() {
                    let at = |j: usize| system.clock().advance(walk.from.at, walk.t + h * c.nodes[j]);
                    let values: [f64; DEGREE + 1] =
                        std::array::from_fn(|j| system.guard(mode, guard.id, at(j), c.state(j)));
                    walk.norm.sizes[g] = values.iter().fold(sizes[g], |m: f64, v| m.max(v.abs()));
                    walk.errors[g] = RTOL * (walk.steps + 3) as f64 * walk.norm.sizes[g];
                    let p = c.series(|j| values[j]);
                    if walk.errors[g] > 0.0 {
                        error = error.max((p[DEGREE].abs() + p[DEGREE - 1].abs()) / walk.errors[g]);
                    }
                    series.push(p);
                }
            }
            if error.is_nan() || error > 1.0 {
                // Also where it is not a number.
                walk.h = h * error.min(f64::MAX).powf(-1.0 / 3.0).clamp(0.1, 0.5);
                if walk.t + walk.h <= walk.t {
                    return Err(Stop::Long);
                }
                continue;
            }
            if watch {
                let falls = |(g, p): (usize, &[f64; DEGREE + 1])| fall(p, walk.errors[g]).map(|theta| (g, theta));
                let first = series.iter().enumerate().filter_map(falls).min_by(|a, b| a.1.total_cmp(&b.1));
                if let Some((g, theta)) = first {
                    return Err(Stop::Fell(g, walk.t + h * theta));
                }
            }
            walk.t = if h >= end - walk.t { end } else { walk.t + h };
            self.longest = self.longest.max(h);
            walk.x.copy_from_slice(self.collocation.state(DEGREE));
            let growth = (0.5 / error.max(1e-20)).powf(1.0 / DEGREE as f64).clamp(0.2, 2.5);
            walk.h = h * growth;
        }
        Ok(())
    }
}

/// Where a guard with the series `p` first falls through zero, if it then falls below `−error`.
fn fall(p: &[f64; DEGREE + 1], error: f64) -> Option<f64> {
    if p[0] - p[1..].iter().fold(0.0, |sum, c| sum + c.abs()) > -error {
        return None;
    }
    let at = |i: usize| i as f64 / POINTS as f64;
    let values: [f64; POINTS + 1] = std::array::from_fn(|i| value(p, at(i)));
    let mut below = None;
    for i in 0..=POINTS {
        if values[i] < -error {
            below = Some(at(i));
        } else if i > 0 && i < POINTS && values[i] <= values[i - 1].min(values[i + 1]) {
            // A minimum between points, by thirds.
            let (mut low, mut high) = (at(i - 1), at(i + 1));
            for _ in 0..HALVINGS {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if value(p, a) < value(p, b) { high = b } else { low = a }
            }
            below = (value(p, low) < -error).then_some(low);
        }
        if below.is_some() {
            break;
        }
    }
    let mut high = below?;
    let mut low = (0..=POINTS).rev().map(at).find(|theta| *theta < high && value(p, *theta) > 0.0).unwrap_or(0.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if value(p, middle) > 0.0 { low = middle } else { high = middle }
    }
    Some(high)
}
