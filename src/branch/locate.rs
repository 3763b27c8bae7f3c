//! Special points: the orbit on a branch at which a function of it is zero.

use super::node::{Direction, Node, Plane, Solver};

/// Orbits solved for at most.
const MOST: usize = 40;
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
        let plane = Plane { from, row: row.clone(), target };
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
                return is_small.then(|| Located { value: node.value, error: if error.is_nan() { 0.0 } else { error }, node });
            }
            best = Some(node);
        }
        let node = best?;
        let is_small = f(&node).abs() <= 1e-6 * size;
        is_small.then(|| Located { value: node.value, error: (high.0 - low.0) * self.family.range(), node })
    }

    /// The limit of the branch from `a` towards `b` as `g`, positive at `a`, falls to zero; `g` is `None` where it is passed.
    pub fn limit(&self, a: &Node, b: &Node, g: &dyn Fn(&Node) -> Option<f64>) -> Option<Located> {
        let (row, length) = a.chord(b, self.family.range());
        let mut places: Vec<(f64, f64)> = vec![(g(a)?, 0.0)];
        let mut values: Vec<(f64, f64)> = vec![(places[0].0, a.value)];
        let mut last = a.clone();
        let mut high = length;
        let mut found: Option<(f64, f64)> = None;
        for _ in 0..MOST {
            let low = places[places.len() - 1].1;
            let expected = at_zero(&places[places.len().saturating_sub(4)..]);
            let s = if places.len() > 1 && expected > low {
                (low + SHARE * (expected - low)).min(0.5 * (low + high))
            } else {
                0.5 * (low + high)
            };
            if s - low <= 1e-14 * length {
                break;
            }
            match self.on(a, &row, s, s).and_then(|node| Some((g(&node)?, node))) {
                Some((value, node)) if value > 0.0 && value < places[places.len() - 1].0 => {
                    places.push((value, s));
                    values.push((value, node.value));
                    last = node;
                }
                _ => {
                    high = s;
                    continue;
                }
            }
            let scale = last.value.abs().max(1e-3 * self.family.range());
            if let Some((value, error)) = limit(&values) {
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
        let (value, error) = found?;
        Some(Located { value, error, node: last })
    }
}
