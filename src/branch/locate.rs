//! Location of special points: orbits on a branch at which a function is zero.

use super::node::{Direction, Guess, Node, Place, Plane, Solver, Spot};
use crate::orbit::Section;

/// Maximum number of orbits solved for.
const MOST: usize = 40;
/// Halvings of a step that is too long for the function of a special point.
const HALVINGS: usize = 8;
/// Values used for an extrapolation.
const USED: usize = 7;
/// Share of the way to an expected limit at which the next orbit is taken.
const SHARE: f64 = 0.75;
/// Parts of a step between a root and the nearest of the orbits that confirm it.
const APART: [f64; 3] = [64.0, 1024.0, 16384.0];
/// Factors of the error of a value: of the difference of two values for one point, and of the rounding of the range. Both are measured:
/// points with known values, and the scatter of points found from several ranges, use up to a fourth of them.
const SAFETY: f64 = 32.0;
const ROUNDINGS: f64 = 1024.0;
/// Share of the way to the limit at which the last orbit is taken.
const CLOSE: f64 = 1.0 - 1e-6;

/// A point that is located.
#[derive(Clone, Debug)]
pub struct Located {
    /// The value of the parameter.
    pub value: f64,
    /// The value of the second number.
    pub second: f64,
    /// Orbit there, or the last one before.
    pub node: Node,
    /// Orbit from which a limit was taken.
    pub from: Option<Spot>,
    /// Difference of the values between two ways to find them, in ranges.
    pub error: f64,
    /// Residual of the equations over their slope in the parameter, in ranges.
    pub residual: f64,
    /// Start of the orbit; for a limit from the polynomial through the orbits before it.
    pub section: Section,
}

impl Located {
    /// Returns the location at a node. `defect` is the residual of a function over its slope, in ranges.
    fn of(node: Node, error: f64, defect: f64) -> Self {
        let (residual, section) = (defect.max(node.closure()), node.orbit.section.clone());
        Self { value: node.value, second: node.second, from: None, error, residual, section, node }
    }

    /// Returns a bound on the error of the value, in ranges of length `range`.
    pub fn uncertainty(&self, range: f64) -> f64 {
        let rounding = ROUNDINGS * f64::EPSILON * (self.value.abs() / range).max(1.0);
        SAFETY * self.error + self.residual + rounding
    }
}

/// Returns the value at g = 0 of the polynomial through `points = (g, value)` (Neville).
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

/// Returns the guess at `s` from the polynomial through some points of a branch.
fn extended(nodes: &[(f64, Node)], s: f64) -> Option<Guess> {
    if nodes.len() < 2 {
        return None;
    }
    let along = |of: &dyn Fn(&Node) -> f64| {
        at_zero(&nodes.iter().map(|(place, node)| (place - s, of(node))).collect::<Vec<_>>())
    };
    let (_, last) = &nodes[nodes.len() - 1];
    let mut guess = last.at();
    (0..guess.section.x.len()).for_each(|i| guess.section.x[i] = along(&|node| node.orbit.section.x[i]));
    guess.place = [along(&|node| node.value), along(&|node| node.second)];
    Some(guess)
}

/// Returns the guess at a share of the way from `a` to `b`, of direction `row`, from the cubic with the tangents of both.
fn between(a: &Node, b: &Node, (row, length): (&Direction, f64), ranges: [f64; 2], share: f64) -> Guess {
    // Changes of the state and of the numbers along the whole way, with the tangent of a node.
    let slope = |node: &Node| {
        let (change, along) = (node.unknowns.lifted(&node.tangent.y), row.dot(&a.tangent_of(node)));
        let [p, s] = [node.tangent.p * ranges[0], node.tangent.s * ranges[1]];
        (change * (length / along), [p * length / along, s * length / along])
    };
    let (t, u) = (share, 1.0 - share);
    let cubic = |from: f64, to: f64, out: f64, into: f64| {
        u * u * (1.0 + 2.0 * t) * from + t * t * (3.0 - 2.0 * t) * to + t * u * (u * out - t * into)
    };
    let (mut guess, (out, of_a), (into, of_b)) = (a.at(), slope(a), slope(b));
    (0..out.len()).for_each(|i| {
        let (from, to) = (a.orbit.section.x[i], b.orbit.section.x[i]);
        guess.section.x[i] = cubic(from, to, out[i], into[i]);
    });
    (0..2).for_each(|i| guess.place[i] = cubic(a.place()[i], b.place()[i], of_a[i], of_b[i]));
    guess
}

/// Returns the limit of the values of a sequence as g falls to zero, and its change by the last point.
pub fn limit(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let last = &points[points.len().saturating_sub(USED)..];
    if last.len() < 3 {
        return None;
    }
    // The order whose value the last point changes least: rounding grows with the order.
    let orders = (2..last.len()).map(|order| {
        let end = last.len();
        let (now, before) = (at_zero(&last[end - order - 1..]), at_zero(&last[end - order - 1..end - 1]));
        (now, (now - before).abs())
    });
    orders.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(value, _)| value.is_finite())
}

impl Solver<'_> {
    /// Returns the orbit at a distance from a node along a direction, without a tangent.
    fn on(&self, from: &Node, row: &Direction, distance: f64, guess: Option<Guess>) -> Option<Node> {
        let plane = Plane { goes_on: false, ..Plane::through(from, row, distance) };
        let guess = guess.unwrap_or_else(|| from.guess(row, self.family.ranges(), distance));
        self.at(guess, Some(&plane), 1.0).ok()
    }

    /// Returns the orbit between two neighbours at which `f`, of opposite signs at both, is zero. `None` if `f` jumps.
    pub fn root(&self, a: &Node, b: &Node, f: &dyn Fn(&Node) -> f64) -> Option<Located> {
        let (row, length) = a.chord(b, self.family.ranges());
        let (mut low, mut high) = ((0.0, f(a)), (length, f(b)));
        let size = low.1.abs().max(high.1.abs());
        let ranges = self.family.ranges();
        let far = |place: Place, from: Place| {
            libm::fmax((place[0] - from[0]).abs() / ranges[0], (place[1] - from[1]).abs() / ranges[1])
        };
        let mut before: Place = [f64::NAN; 2];
        let mut kept = 0;
        for step in 0..MOST {
            // The method of Illinois; a bisection at times.
            let secant = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let s = if step % 8 == 7 || !(secant > low.0 && secant < high.0) { 0.5 * (low.0 + high.0) } else { secant };
            let node = self.on(a, &row, s, Some(between(a, b, (&row, length), self.family.ranges(), s / length)))?;
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
            let error = far(node.place(), before);
            before = node.place();
            let is_small = value.abs() <= 1e-6 * size;
            let is_last = value == 0.0 || error <= 4.0 * f64::EPSILON * far(node.place(), [0.0; 2]) && is_small;
            if is_last || (high.0 - low.0) <= 1e-15 * length {
                if !is_small {
                    return None;
                }
                let again = |parts: &f64| self.again(a, (&row, s), length / parts, f, &node);
                let (error, defect) = APART.iter().filter_map(again).min_by(|a, b| a.0.total_cmp(&b.0))?;
                return Some(Located::of(node, error, defect));
            }
        }
        None
    }

    /// Returns the difference, in ranges, between the root at distance `s` along `row` and that of a polynomial through orbits at `s` ± `h`
    /// and `s` ± 2 `h`. Also returns the residual of `f` at the root over its slope.
    fn again(
        &self,
        a: &Node,
        (row, s): (&Direction, f64),
        h: f64,
        f: &dyn Fn(&Node) -> f64,
        root: &Node,
    ) -> Option<(f64, f64)> {
        let ranges = self.family.ranges();
        let mut points: Vec<(f64, Place)> = Vec::new();
        for k in [-2.0, -1.0, 1.0, 2.0] {
            let guess = root.guess(row, ranges, k * h);
            let node = self.on(a, row, s + k * h, Some(guess))?;
            points.push((f(&node), node.place()));
        }
        // Places as functions of f.
        let off = |i: usize| {
            let at = at_zero(&points.iter().map(|(f, place)| (*f, place[i])).collect::<Vec<_>>());
            (at - root.place()[i]).abs() / ranges[i]
        };
        let error = libm::fmax(off(0), off(1));
        let ((low, from), (high, to)) = (points[1], points[2]);
        let defect = f(root).abs() * ((to[0] - from[0]) / (high - low)).abs() / ranges[0];
        (error + defect).is_finite().then_some((error, defect))
    }

    /// Returns the root as [`root`](Self::root) does; if that fails, halves the step by `orbits`, the solver of the branch.
    pub fn refined(&self, orbits: &Self, a: &Node, b: &Node, f: &dyn Fn(&Node) -> f64) -> Option<Located> {
        let (mut a, mut b) = (a.clone(), b.clone());
        for _ in 0..HALVINGS {
            if let Some(found) = self.root(&a, &b, f) {
                return Some(found);
            }
            let middle = orbits.middle(&a, &b)?;
            if f(&middle) * f(&a) > 0.0 { a = middle } else { b = middle }
        }
        None
    }

    /// Returns the orbit half way between two neighbours of a branch.
    fn middle(&self, a: &Node, b: &Node) -> Option<Node> {
        let (row, length) = a.chord(b, self.family.ranges());
        let guess = between(a, b, (&row, length), self.family.ranges(), 0.5);
        let middle = self.at(guess, Some(&Plane::through(a, &row, 0.5 * length)), 1.0).ok()?;
        (a.chord(&middle, self.family.ranges()).1 <= length).then_some(middle)
    }

    /// Returns the direction from `a` towards `b`, and the distance: along the tangent, as a rigid graze makes a corner of the branch.
    pub fn towards(&self, a: &Node, b: &Node) -> (Direction, f64) {
        let (chord, length) = a.chord(b, self.family.ranges());
        (a.tangent.times(a.tangent.dot(&chord).signum()), length)
    }

    /// Returns the limit of the branch from `a` along `row`, up to a distance `length`, as `g`, positive at `a`, falls to zero. `g` is
    /// `None` behind the limit.
    pub fn limit(
        &self,
        a: &Node,
        (row, length): &(Direction, f64),
        g: &dyn Fn(&Node) -> Option<f64>,
    ) -> Option<Located> {
        let (length, ranges) = (*length, self.family.ranges());
        let mut places: Vec<(f64, f64)> = vec![(g(a)?, 0.0)];
        let mut values: [Vec<(f64, f64)>; 2] = [vec![(places[0].0, a.value)], vec![(places[0].0, a.second)]];
        let mut last = a.clone();
        let mut nodes = vec![(0.0, a.clone())];
        // Places at which the limit seems passed, and at which no orbit was found. Better guesses may correct both.
        let (mut high, mut failed) = (length, f64::INFINITY);
        let (mut found, mut before): (Option<(Place, f64)>, Place) = (None, [f64::INFINITY; 2]);
        for _ in 0..MOST {
            let low = places[places.len() - 1].1;
            let expected = at_zero(&places[places.len().saturating_sub(4)..]);
            let middle = 0.5 * (low + high);
            let s = match places.len() {
                // Several points determine the place; the first ones may have led to another orbit.
                3.. if expected > low && expected <= length && failed.is_infinite() => low + SHARE * (expected - low),
                2.. if expected > low => (low + SHARE * (expected - low)).min(middle),
                _ => middle,
            };
            let s = s.min(0.5 * (low + failed));
            if s - low <= 1e-14 * length {
                break;
            }
            let Some(node) = self.on(a, row, s, extended(&nodes[nodes.len().saturating_sub(4)..], s)) else {
                failed = s;
                continue;
            };
            match g(&node).map(|value| (value, node)) {
                Some((value, node)) if value > 0.0 && value < places[places.len() - 1].0 => {
                    failed = f64::INFINITY;
                    places.push((value, s));
                    values[0].push((value, node.value));
                    values[1].push((value, node.second));
                    nodes.push((s, node.clone()));
                    last = node;
                }
                _ => {
                    (high, failed) = (high.min(s), s);
                    continue;
                }
            }
            let scale = (last.value.abs() / ranges[0]).max(1e-3);
            if let (Some((value, off)), Some((second, aside))) = (limit(&values[0]), limit(&values[1])) {
                // Two successive values have to agree.
                let off = off.max((value - before[0]).abs()) / ranges[0];
                let error = off.max(aside.max((second - before[1]).abs()) / ranges[1]);
                before = [value, second];
                if found.is_none_or(|(_, least)| error < least) {
                    found = Some((before, error));
                }
                if error <= 4.0 * f64::EPSILON * scale {
                    break;
                }
            }
            if places[places.len() - 1].0 <= 1e-12 * places[0].0 {
                break;
            }
        }
        let ([value, second], error) = found.filter(|(_, error)| error.is_finite())?;
        let (low, expected) = (places[places.len() - 1].1, at_zero(&places[places.len().saturating_sub(USED)..]));
        let section = extended(&nodes[nodes.len().saturating_sub(USED)..], expected)?.section;
        // The last orbit is returned too: one as near the limit as possible.
        let s = low + CLOSE * (expected - low);
        if s > low
            && let Some(node) = self.on(a, row, s, extended(&nodes[nodes.len().saturating_sub(USED)..], s))
            && g(&node).is_some_and(|value| value > 0.0 && value < places[places.len() - 1].0)
        {
            last = node;
        }
        let residual = a.closure().max(error);
        Some(Located { value, second, from: Some(Spot::of(a)), error, residual, section, node: last })
    }
}
