//! Special points: the orbit on a branch at which a function of it is zero.

use super::node::{Direction, Node, Plane, Solver};
use crate::orbit::Section;

/// Orbits solved for at most.
const MOST: usize = 40;
/// Bisections: to the resolution of doubles from a step of a branch.
const BISECTIONS: usize = 44;
/// Values used for an extrapolation.
const USED: usize = 7;
/// Share of the way to an expected limit that the next orbit takes.
const SHARE: f64 = 0.75;

/// A point that is located.
#[derive(Clone, Debug)]
pub struct Located {
    /// The value of the parameter.
    pub value: f64,
    /// The orbit there, or the last one before.
    pub node: Node,
    /// How far the value may be off.
    pub error: f64,
    /// Distance between the ends of the orbit, in scales; none of a limit.
    pub residual: f64,
}

/// The value of the polynomial through `points = (g, value)` at g = 0 (Neville).
pub fn at_zero(points: &[(f64, f64)]) -> f64 {
    let mut values: Vec<f64> = points.iter().map(|(_, value)| *value).collect();
    for width in 1..points.len() {
        for i in 0..points.len() - width {
            let (a, b) = (points[i].0, points[i + width].0);
            values[i] = (b * values[i] - a * values[i + 1]) / (b - a);
        }
    }
    values[0]
}

/// The state and value at `s` of the polynomial through some points of a branch.
fn extended(nodes: &[(f64, Node)], s: f64) -> Option<(Section, f64)> {
    if nodes.len() < 2 {
        return None;
    }
    let along = |of: &dyn Fn(&Node) -> f64| {
        at_zero(&nodes.iter().map(|(place, node)| (place - s, of(node))).collect::<Vec<_>>())
    };
    let (_, last) = &nodes[nodes.len() - 1];
    let x = (0..last.orbit.section.x.len()).map(|i| along(&|node| node.orbit.section.x[i])).collect();
    Some((Section { x, contacts: last.orbit.section.contacts.clone() }, along(&|node| node.value)))
}

/// The limit of the values of a sequence as g falls to zero, and the change by its last point.
pub fn limit(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let last = &points[points.len().saturating_sub(USED)..];
    if last.len() < 3 {
        return None;
    }
    // Of the orders the one that the last point changes least: rounding grows with the order.
    let orders = (2..last.len()).map(|order| {
        let end = last.len();
        let (now, before) = (at_zero(&last[end - order - 1..]), at_zero(&last[end - order - 1..end - 1]));
        (now, (now - before).abs())
    });
    orders.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(value, _)| value.is_finite())
}

impl Solver<'_> {
    fn on(&self, from: &Node, row: &Direction, target: f64, guess: f64) -> Option<Node> {
        let plane = Plane { from, row: row.clone(), target, goes_on: false };
        let guess = from.guess(row, self.family.range(), guess);
        self.at(guess, from.orbit.period, from.phase, Some(&plane), 1.0).ok()
    }

    /// The orbit between two neighbours on a branch at which `f`, of opposite signs at both, is zero. `None` where it jumps.
    pub fn root(&self, a: &Node, b: &Node, f: &dyn Fn(&Node) -> f64) -> Option<Located> {
        let (row, length) = a.chord(b, self.family.range());
        let (mut low, mut high) = ((0.0, f(a)), (length, f(b)));
        let size = low.1.abs().max(high.1.abs());
        let (mut best, mut before): (Option<Node>, f64) = (None, f64::NAN);
        let mut kept = 0;
        for step in 0..MOST {
            // The method of Illinois; a bisection at times.
            let secant = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let s = if step % 8 == 7 || !(secant > low.0 && secant < high.0) { 0.5 * (low.0 + high.0) } else { secant };
            let node = self.on(a, &row, s, s)?;
            let value = f(&node);
            if value * low.1 > 0.0 {
                low = (s, value);
                if kept == 1 {
                    high.1 *= 0.5;
                }
                kept = 1;
            } else {
                high = (s, value);
                if kept == -1 {
                    low.1 *= 0.5;
                }
                kept = -1;
            }
            let error = (node.value - before).abs();
            before = node.value;
            let is_small = value.abs() <= 1e-6 * size;
            let is_last = value == 0.0 || error <= 4.0 * f64::EPSILON * node.value.abs() && is_small;
            if is_last || (high.0 - low.0) <= 1e-15 * length {
                let error = if error.is_nan() { 0.0 } else { error };
                return is_small.then_some(Located { value: node.value, error, residual: node.orbit.residual, node });
            }
            best = Some(node);
        }
        let node = best?;
        let is_small = f(&node).abs() <= 1e-6 * size;
        let error = (high.0 - low.0) * self.family.range();
        is_small.then_some(Located { value: node.value, error, residual: node.orbit.residual, node })
    }

    /// The limit of the branch from `a` towards `b`, and up to `reach` times as far, as `g`, positive at `a`, falls to zero; `g` is `None`
    /// where it is passed.
    pub fn limit(&self, a: &Node, b: &Node, reach: f64, g: &dyn Fn(&Node) -> Option<f64>) -> Option<Located> {
        // Along the tangent: at a rigid graze the branch has a corner.
        let (chord, length) = a.chord(b, self.family.range());
        let sense = (a.tangent.y.dot(&chord.y) + a.tangent.p * chord.p).signum();
        let row = Direction { y: &a.tangent.y * sense, p: a.tangent.p * sense };
        let length = reach * length;
        let mut places: Vec<(f64, f64)> = vec![(g(a)?, 0.0)];
        let mut values: Vec<(f64, f64)> = vec![(places[0].0, a.value)];
        let mut last = a.clone();
        let mut nodes = vec![(0.0, a.clone())];
        // Where it seems to be passed, and where the last orbit was not found. From better guesses neither need be so.
        let (mut high, mut failed) = (length, f64::INFINITY);
        let (mut found, mut before): (Option<(f64, f64)>, f64) = (None, f64::INFINITY);
        for _ in 0..MOST {
            let low = places[places.len() - 1].1;
            let expected = at_zero(&places[places.len().saturating_sub(4)..]);
            let middle = 0.5 * (low + high);
            let s = match places.len() {
                // By several points the place is known; the first ones may have led to another orbit.
                3.. if expected > low && expected <= length && failed.is_infinite() => low + SHARE * (expected - low),
                2.. if expected > low => (low + SHARE * (expected - low)).min(middle),
                _ => middle,
            };
            let s = s.min(0.5 * (low + failed));
            if s - low <= 1e-14 * length {
                break;
            }
            let plane = Plane { from: a, row: row.clone(), target: s, goes_on: false };
            let guess = extended(&nodes[nodes.len().saturating_sub(4)..], s)
                .unwrap_or_else(|| a.guess(&row, self.family.range(), s));
            let Ok(node) = self.at(guess, a.orbit.period, a.phase, Some(&plane), 1.0) else {
                failed = s;
                continue;
            };
            match g(&node).map(|value| (value, node)) {
                Some((value, node)) if value > 0.0 && value < places[places.len() - 1].0 => {
                    failed = f64::INFINITY;
                    places.push((value, s));
                    values.push((value, node.value));
                    nodes.push((s, node.clone()));
                    last = node;
                }
                _ => {
                    (high, failed) = (high.min(s), s);
                    continue;
                }
            }
            let scale = last.value.abs().max(1e-3 * self.family.range());
            if let Some((value, error)) = limit(&values) {
                // Two in turn have to agree.
                let error = error.max((value - before).abs());
                before = value;
                if found.is_none_or(|(_, least)| error < least) {
                    found = Some((value, error));
                }
                if error <= 4.0 * f64::EPSILON * scale {
                    break;
                }
            }
            if places[places.len() - 1].0 <= 1e-12 * places[0].0 {
                break;
            }
        }
        let (value, error) = found.filter(|(_, error)| error.is_finite())?;
        Some(Located { value, error, residual: 0.0, node: last })
    }

    /// The last orbit on the way from `a` to `b` for which `is_same` holds, by bisection.
    pub fn edge(&self, a: &Node, b: &Node, is_same: &dyn Fn(&Node) -> bool) -> Option<Located> {
        let (row, length) = a.chord(b, self.family.range());
        let (mut low, mut high) = (0.0, length);
        let mut nodes = vec![(0.0, a.clone())];
        for _ in 0..BISECTIONS {
            let s = 0.5 * (low + high);
            let plane = Plane { from: a, row: row.clone(), target: s, goes_on: false };
            let guess = extended(&nodes[nodes.len().saturating_sub(3)..], s)
                .unwrap_or_else(|| a.guess(&row, self.family.range(), s));
            match self.at(guess, a.orbit.period, a.phase, Some(&plane), 1.0).ok().filter(|node| is_same(node)) {
                Some(node) => {
                    low = s;
                    nodes.push((s, node));
                }
                None => high = s,
            }
        }
        let (_, node) = nodes.pop()?;
        let error = (high - low) * self.family.range();
        Some(Located { value: node.value, error, residual: node.orbit.residual, node })
    }
}
