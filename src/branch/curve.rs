//! Curves of special points in the plane of the parameter and a second number.

use std::rc::Rc;

use serde::{Deserialize, Serialize};

use super::{
    family::Family,
    follow::{CLEAR, EventChange, GROWTH, LONGEST, SHORTEST},
    node::{Direction, Guess, Node, Place, Plane, Solver, Spot},
    run::Branch,
    special::{Special, SpecialKind, SpecialSource, ZeroCondition},
};
use crate::{
    orbit::{SectionMap, words::sorted},
    simulation::SimulationError,
    task::{Progress, Task},
};

/// Length of the first step, in scales of states and ranges of both numbers; the others are as on a branch.
const FIRST: f64 = 0.003;
/// Distances across the curve at which a point is searched for, in steps: of the first step, of unknown direction, and of the others.
const ASIDE_FIRST: [f64; 3] = [1.0, 4.0, 15.0];
const ASIDE: [f64; 3] = [0.3, 1.0, 3.0];
/// Distances of the orbit that a limit is taken from, relative to that of the last limit.
const FROM: [f64; 3] = [1.0, 4.0, 0.3];
/// Cosine of the turn that a step may make: 18°.
const TURN: f64 = 0.95;
/// Points of a curve in one direction at most.
const MOST: usize = 500;
/// Distance between a limit and the last orbit before it, in ranges.
const NEAR: f64 = 1e-6;
/// Distance, in ranges, from a chord of a curve within which a point with the same word lies on the curve.
const SAME: f64 = 3e-4;
/// Distance of the neighbour that defines the direction across the curve, in scales.
const BESIDE: f64 = 1e-3;
/// Steps of the search for a turning point of a curve.
const TURNS: usize = 12;
/// Length of three points below which a turn is ignored as rounding.
const NOISE: f64 = 1e-4;
/// Share of the length of three points to which the turning point is found, and within which both numbers turn at a cusp.
const TURNED: f64 = 1e-6;
const CUSP: f64 = 1e-3;
/// Least number of points of a closed curve.
const FEWEST: usize = 3;
/// End of a closed curve, in words.
const CLOSED: &str = "it comes back to its start";

/// Kinds of points of codimension two on a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Codimension {
    /// The curve has a cusp: both numbers turn at once.
    Cusp,
    /// The second number turns: two special points meet and vanish.
    Turn,
    /// The curve ends within the ranges.
    End,
}

impl Codimension {
    /// Returns its word in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Cusp => "cusp",
            Self::Turn => "turn",
            Self::End => "end",
        }
    }
}

/// A point of a curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CurvePoint {
    /// Value of the parameter.
    pub value: f64,
    /// Value of the second number.
    pub second: f64,
    /// Period of the orbit, cycles.
    pub period: u64,
    /// Its word in normal form.
    pub word: String,
    /// Residual, as of [`Special`].
    pub residual: f64,
    /// Uncertainty, as of [`Special`].
    pub uncertainty: f64,
    /// Kind of codimension two, if any.
    pub codimension_two: Option<Codimension>,
}

/// Special points of one kind along a second number.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Curve {
    /// Kind of the special points.
    pub kind: SpecialKind,
    /// Its points in order.
    pub points: Vec<CurvePoint>,
    /// Reasons for its two ends, in words, at the first point and at the last one.
    pub ends: [String; 2],
}

/// Foremost point of a curve that is followed.
#[derive(Clone)]
struct Head {
    node: Node,
    place: Place,
    /// Residual and uncertainty.
    quality: [f64; 2],
    sought: ZeroCondition,
    /// Point before; the curve is followed away from it.
    before: Spot,
    /// A neighbour on the side to which the special point is passed.
    beside: Spot,
    /// The orbit that a limit was taken from.
    from: Option<Spot>,
}

impl Head {
    /// Returns the directions along the curve and across it.
    fn directions(&self, ranges: [f64; 2]) -> (Direction, Direction) {
        let here = Spot::of(&self.node);
        let (along, _) = self.node.direction(&self.before, &here, ranges);
        let (aside, _) = self.node.direction(&here, &self.beside, ranges);
        let dot = along.dot(&aside);
        let across = Direction { y: &aside.y - &along.y * dot, p: aside.p - along.p * dot, s: aside.s - along.s * dot };
        (along, across.times(1.0 / across.length()))
    }

    fn point(&self) -> CurvePoint {
        let Self { node, place: [value, second], quality: [residual, uncertainty], .. } = self;
        let (period, word) = (node.orbit.period, node.orbit.word());
        CurvePoint {
            value: *value,
            second: *second,
            period,
            word,
            residual: *residual,
            uncertainty: *uncertainty,
            codimension_two: None,
        }
    }
}

/// Returns the curves of special points of `kind` that start on `branches` of `family`, which has a second number; those in `earlier` are
/// kept and not followed again. Calls `each` after every curve that is finished.
///
/// # Errors
/// [`SimulationError`] if the scene's own train cannot be built, or what `each` returns.
pub fn curves(
    family: &Family,
    kind: SpecialKind,
    branches: &[Branch],
    earlier: Vec<Curve>,
    each: &mut dyn FnMut(&[Curve]) -> Result<(), SimulationError>,
    task: Task<'_>,
) -> Result<Vec<Curve>, SimulationError> {
    let own = family.own()?;
    let solver = Solver::new(family, SectionMap::new(&own)?.drift()).of_kind(kind);
    let starts: Vec<&Special> = branches.iter().flat_map(|b| &b.specials).filter(|s| s.kind == kind).collect();
    let mut all = earlier;
    for (i, special) in starts.iter().enumerate() {
        if task.is_cancelled() {
            break;
        }
        if all.iter().any(|curve| solver.is_on(curve, special)) {
            continue;
        }
        if let Some(curve) = solver.curve(special, task) {
            all.push(curve);
            if !task.is_cancelled() {
                each(&all)?;
            }
        }
        task.report(Progress::Share((i + 1) as f64 / starts.len() as f64));
    }
    Ok(all)
}

impl Solver<'_> {
    /// Returns whether a special point of a branch lies on a known curve.
    fn is_on(&self, curve: &Curve, special: &Special) -> bool {
        let (ranges, place) = (self.family.ranges(), [special.value, self.family.own_place()[1]]);
        // Where two events coincide both orders of them are words of the curve.
        let is_alike =
            |point: &CurvePoint| point.period == special.period && sorted([&point.word]) == sorted([&special.word]);
        let passes = |pair: &[CurvePoint]| {
            let [a, b] = pair else { return false };
            let share = (place[1] - a.second) / (b.second - a.second);
            let off = a.value + share * (b.value - a.value) - place[0];
            (0.0..=1.0).contains(&share) && (is_alike(a) || is_alike(b)) && off.abs() <= SAME * ranges[0]
        };
        curve.points.windows(2).any(passes)
    }

    /// Returns the curve through a special point, followed in both directions.
    fn curve(&self, special: &Special, task: Task<'_>) -> Option<Curve> {
        let ranges = self.family.ranges();
        let SpecialSource { sought, seed, from } = &special.trail;
        let node = self.within(Plane::of_number(&seed.guess, 1)).grown(seed).ok()?;
        let beside = Spot::at(node.guess(&node.tangent, ranges, BESIDE));
        let head = |sense: f64| {
            let mut before = Spot::of(&node);
            before.place[1] -= sense * ranges[1];
            let (place, quality) = ([special.value, node.second], [special.residual, special.uncertainty]);
            let (beside, from) = (beside.clone(), from.clone());
            Head { node: node.clone(), place, quality, sought: *sought, before, beside, from }
        };
        let (mut ahead, end, after) = self.advance(&head(1.0), special.kind, task);
        let (mut points, mut ends) = (Vec::new(), [end.clone(), end.clone()]);
        let mut turns = None;
        if end != CLOSED {
            let (behind, other, before) = self.advance(&head(-1.0), special.kind, task);
            (points, ends[0]) = (behind, other);
            points.reverse();
            let three = before.as_ref().zip(after.as_ref());
            turns = three.and_then(|(before, after)| self.extreme([before, &head(1.0), after], special.kind));
        }
        points.push(head(1.0).point());
        if let Some((is_before, point)) = turns {
            points.insert(points.len() - usize::from(is_before), point);
        }
        points.append(&mut ahead);
        Some(Curve { kind: special.kind, points, ends })
    }

    /// Returns the solver with all points on a plane.
    fn within(&self, slice: Plane) -> Self {
        Self { slice: Some(slice), drift: self.drift.clone(), spent: Rc::clone(&self.spent), ..*self }
    }

    /// Follows a curve from a point on; returns its points, the reason for its end, and the first of them.
    fn advance(&self, start: &Head, kind: SpecialKind, task: Task<'_>) -> (Vec<CurvePoint>, String, Option<Head>) {
        let ranges = self.family.ranges();
        let (mut points, mut first): (Vec<CurvePoint>, Option<Head>) = (Vec::new(), None);
        let (mut head, mut h) = (start.clone(), FIRST);
        let mut last: Option<Head> = None;
        loop {
            if task.is_cancelled() {
                return (points, "it is interrupted".to_owned(), first);
            }
            if points.len() >= MOST {
                return (points, format!("{MOST} points are computed; take shorter ranges"), first);
            }
            task.advance();
            let (along, _) = head.directions(ranges);
            let asides = if points.is_empty() { ASIDE_FIRST } else { ASIDE }.map(|aside| aside * h);
            let slice = Plane::through(&head.node, &along, h);
            let next = self.across(&head, kind, slice, head.node.guess(&along, ranges, h), asides).filter(|next| {
                let (chord, length) = head.node.direction(&next.before, &Spot::of(&next.node), ranges);
                points.is_empty() || length <= 2.0 * h && chord.dot(&along) >= TURN
            });
            let Some(next) = next else {
                h *= 0.5;
                if h < SHORTEST {
                    if let Some(point) = points.last_mut() {
                        point.codimension_two = Some(Codimension::End);
                    }
                    return (points, "no such orbit is found beyond".to_owned(), first);
                }
                continue;
            };
            if !self.family.holds(next.place) {
                points.extend(self.at_border(&head, &next, kind, asides).map(|head| head.point()));
                return (points, "the end of the range".to_owned(), first);
            }
            let turns = last.as_ref().and_then(|last| self.extreme([last, &head, &next], kind));
            if let Some((is_before, point)) = turns {
                points.insert(points.len() - usize::from(is_before), point);
            }
            points.push(next.point());
            first.get_or_insert_with(|| next.clone());
            if points.len() > FEWEST && self.is_between(start, &head, &next) {
                return (points, CLOSED.to_owned(), first);
            }
            h = (GROWTH * h).min(LONGEST);
            last = Some(std::mem::replace(&mut head, next));
            if head.node.course.clearance() < CLEAR {
                let phase = head.node.course.quiet(head.node.phase);
                if let Some(led) = self.led(&head, kind, phase) {
                    head = led;
                    last = last.and_then(|last| self.led(&last, kind, phase));
                }
            }
        }
    }

    /// Returns the special point on a slice, searched for across the curve on both sides of a guess.
    fn across(&self, from: &Head, kind: SpecialKind, slice: Plane, guess: Guess, asides: [f64; 3]) -> Option<Head> {
        let ranges = self.family.ranges();
        let (_, across) = from.directions(ranges);
        let here = Spot::of(&from.node);
        let (way, length) = from.node.direction(&here, &Spot::at(guess.clone()), ranges);
        let offset = length * way.dot(&across);
        let solver = self.within(slice);
        // A limit is taken from an orbit beside that of the last point; any other point lies between two orbits across the curve.
        let back = from.from.as_ref().map(|spot| from.node.direction(&here, spot, ranges));
        let back = back.map(|(way, length)| (way.dot(&across).abs() * length, way)).filter(|(aside, _)| *aside > 0.0);
        let asides = back.as_ref().map_or(asides, |(aside, _)| FROM.map(|share| share * aside.max(asides[0])));
        let at = |aside: f64| {
            let (way, far) = match &back {
                Some((_, way)) => (way, -aside / way.dot(&across).abs()),
                None => (&across, aside),
            };
            let guess = from.node.moved(guess.clone(), way, ranges, far);
            solver.at(guess, Some(&Plane::through(&from.node, &across, offset + aside)), 1.0).ok()
        };
        let located = asides.into_iter().find_map(|aside| {
            let a = at(-aside)?;
            let other = || at(aside);
            match from.sought {
                ZeroCondition::Root => {
                    let b = other()?;
                    let test = |node: &Node| kind.test(node, from.node.pair_on_circle());
                    let is_passed = test(&a) * test(&b) < 0.0;
                    if is_passed { solver.root(&a, &b, &test) } else { None }
                }
                ZeroCondition::Limit(key) => {
                    let is_same = |node: &Node| EventChange::of(&from.node.course, &node.course) == EventChange::None;
                    let way = (a.tangent.clone(), 3.0 * aside);
                    solver.limit(&a, &way, &|node| key.at(node).filter(|_| is_same(node)))
                }
                ZeroCondition::Rest => {
                    let way = (a.tangent.clone(), 3.0 * aside);
                    solver.limit(&a, &way, &|node| solver.settling(node, from.node.course.rests.len()))
                }
            }
            .filter(|located| {
                solver.is_located(located) && (located.value - located.node.value).abs() <= NEAR * ranges[0]
            })
        })?;
        let quality = [located.residual, located.uncertainty(ranges[0])].map(|part| part * ranges[0]);
        let (node, place) = (located.node, [located.value, located.second]);
        let beside = Spot::at(node.guess(&node.tangent, ranges, BESIDE));
        Some(Head { before: here, beside, place, quality, sought: from.sought, from: located.from, node })
    }

    /// Returns the point at which a curve leaves the ranges, between two of its points.
    fn at_border(&self, from: &Head, to: &Head, kind: SpecialKind, asides: [f64; 3]) -> Option<Head> {
        let (inside, outside) = (from.place, to.place);
        let borders = self.family.borders();
        let share = |i: usize| {
            let border = if outside[i] > inside[i] { borders[i][1] } else { borders[i][0] };
            ((border - inside[i]) / (outside[i] - inside[i]), border)
        };
        // A point on the border does not pass it.
        let passed = (0..2).map(|i| (i, share(i))).filter(|(_, (share, _))| *share > 0.0 && *share <= 1.0);
        let (i, (share, border)) = passed.min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        let (chord, length) = from.node.chord(&to.node, self.family.ranges());
        let mut guess = from.node.guess(&chord, self.family.ranges(), share * length);
        guess.place[i] = border;
        let slice = Plane::of_number(&guess, i);
        let mut head = self.across(from, kind, slice, guess, asides)?;
        head.place[i] = border;
        Some(head).filter(|head| self.family.holds(head.place))
    }

    /// Returns the point at which the second number is extreme, if that lies between the first and the last of three points; and whether it
    /// lies before the second of them.
    fn extreme(&self, [first, middle, last]: [&Head; 3], kind: SpecialKind) -> Option<(bool, CurvePoint)> {
        let rises = |a: &Head, b: &Head, i: usize| b.place[i] > a.place[i];
        let ranges = self.family.ranges();
        let (chord, length) = first.node.chord(&last.node, ranges);
        // Near an end, steps as short as rounding go back and forth.
        if rises(first, middle, 1) == rises(middle, last, 1) || length < NOISE {
            return None;
        }
        let (way, part) = first.node.chord(&middle.node, ranges);
        let mut known = vec![(0.0, first.clone()), (part * way.dot(&chord), middle.clone()), (length, last.clone())];
        // A parabola through the three points about the best one.
        let vertex = |known: &[(f64, Head)], i: usize| {
            let [(a, fa), (b, fb), (c, fc)] = [0, 1, 2].map(|k| (known[k].0, known[k].1.place[i]));
            let (left, right) = ((fb - fa) / (b - a), (fc - fb) / (c - b));
            0.5 * (a + b) - 0.5 * left * (c - a) / (right - left)
        };
        for _ in 0..TURNS {
            let t = vertex(&known, 1);
            let nearest = known.iter().map(|(place, _)| (place - t).abs()).fold(f64::INFINITY, f64::min);
            if nearest <= TURNED * length || !(known[0].0..=known[2].0).contains(&t) {
                break;
            }
            let slice = Plane::through(&first.node, &chord, t);
            let guess = first.node.guess(&chord, ranges, t);
            let Some(head) = self.across(first, kind, slice, guess, ASIDE.map(|aside| aside * length)) else { break };
            known.push((t, head));
            known.sort_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()));
            known.truncate(3);
            known.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let t = vertex(&known, 1);
        let is_cusp = (vertex(&known, 0) - t).abs() <= CUSP * length;
        let (_, head) = known.into_iter().min_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()))?;
        let codimension_two = Some(if is_cusp { Codimension::Cusp } else { Codimension::Turn });
        Some((t < part * way.dot(&chord), CurvePoint { codimension_two, ..head.point() }))
    }

    /// Returns whether a curve passes its start between two points.
    fn is_between(&self, start: &Head, a: &Head, b: &Head) -> bool {
        let ranges = self.family.ranges();
        let [at, from, to] = [start, a, b].map(|head| [head.place[0] / ranges[0], head.place[1] / ranges[1]]);
        let (way, off) = ([to[0] - from[0], to[1] - from[1]], [at[0] - from[0], at[1] - from[1]]);
        let squared = way[0] * way[0] + way[1] * way[1];
        let share = (way[0] * off[0] + way[1] * off[1]) / squared;
        let aside = (way[0] * off[1] - way[1] * off[0]).abs() / squared;
        let is_near = || {
            let (_, length) = start.node.direction(&Spot::of(&a.node), &Spot::of(&b.node), ranges);
            let (_, apart) = start.node.direction(&Spot::of(&a.node), &Spot::of(&start.node), ranges);
            a.node.phase != start.node.phase || apart <= 1.5 * length
        };
        (0.0..=1.0).contains(&share) && aside <= 0.1 && is_near()
    }

    /// Returns the same point with its section at another phase.
    fn led(&self, head: &Head, kind: SpecialKind, phase: f64) -> Option<Head> {
        let ranges = self.family.ranges();
        let lead = |spot: &Spot| {
            let simulation = self.family.train(spot.place).ok()?;
            let map = SectionMap::new(&simulation).ok()?.at_phase(head.node.phase);
            Some(Spot { section: map.lead(&spot.section, &map.at_phase(phase)).ok()?, place: spot.place })
        };
        // The neighbour has to be an orbit.
        let (along, across) = head.directions(ranges);
        let solver = self.within(Plane::through(&head.node, &along, 0.0));
        let plane = Plane::through(&head.node, &across, BESIDE);
        let beside = solver.at(head.node.guess(&across, ranges, BESIDE), Some(&plane), 1.0).ok()?;
        let (here, before, beside) = (lead(&Spot::of(&head.node))?, lead(&head.before)?, lead(&Spot::of(&beside))?);
        let (along, _) = head.node.direction(&before, &here, ranges);
        let (across, _) = head.node.direction(&here, &beside, ranges);
        let shift = head.node.shift + u64::from(phase < head.node.phase);
        let guess = Guess { section: here.section, phase, shift, by: None, ..head.node.at() };
        let plane =
            |direction: &Direction| Plane { x: guess.section.x.clone(), ..Plane::through(&head.node, direction, 0.0) };
        let solver = self.within(plane(&along)).of_kind(kind);
        let node = solver.at(guess.clone(), Some(&plane(&across)), 1.0).ok()?;
        // The events of the sought value have other places in the new course.
        let period = node.orbit.period as f64;
        let moved = |i: usize| {
            let at = (head.node.course.times[i] - (phase - head.node.phase).rem_euclid(1.0)).rem_euclid(period);
            let off = |k: usize| {
                let off = (node.course.times[k] - at).abs();
                off.min(period - off)
            };
            let same = |k: &usize| node.course.letters[*k].token == head.node.course.letters[i].token;
            (0..node.course.times.len()).filter(same).min_by(|a, b| off(*a).total_cmp(&off(*b)))
        };
        let sought = match head.sought {
            ZeroCondition::Limit(key) => ZeroCondition::Limit(key.moved(&moved)?),
            other => other,
        };
        let from = head.from.as_ref().and_then(lead);
        Some(Head { node, before, beside, sought, from, ..head.clone() })
    }
}
