//! The whole of a continuation: branches, level by level, with their special points.

use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    family::Family,
    follow::{Change, Trace, Vanishing, vanishing},
    locate::{Located, limit},
    node::{Direction, Node, Plane, Solver},
};
use crate::{
    gear::contact::Law,
    hybrid::Watch,
    orbit::{Search, Section, SectionMap},
    scene::Scene,
    simulation::{Parameter, SimulationError},
    task::{Progress, Task},
};

/// Points of a branch in one direction at most, and cycles in the orbits of a branch in one direction and of all branches.
const OF_BRANCH: usize = 600;
const CYCLES_OF_BRANCH: usize = 3000;
const CYCLES_OF_ALL: usize = 20_000;
/// Distances, in scales, at which a branch that begins at a special point is looked for.
const ASIDE: [f64; 4] = [0.01, 0.003, 0.03, 0.001];
/// Share of the largest singular value that leaves the direction alone that breaks a symmetry.
const SYMMETRIC: f64 = 1e-6;
/// Two special points nearer than this, in ranges, are one.
const SAME: f64 = 1e-8;
/// What a limit at the end of a branch is taken from: values that vanish from this size on, and orbits up to this many times as far as the
/// last one.
const FAR: f64 = 0.03;
const BEYOND: f64 = 1.1;
/// How far beyond a neighbour a graze between two is looked for, and where it may be: in steps, and in ranges.
const REACH: f64 = 1.5;
const SLACK: f64 = 1e-9;
/// Residual from which on a graze is looked for from both sides.
const WELL: f64 = 1e-12;
/// Largest residual of a point that counts as located, in scales and ranges.
const LOCATED: f64 = 1e-9;
/// Steps, in scales, in which the branch is looked for that another one is born from.
const PARENT: [f64; 4] = [3e-3, 1e-3, 1e-2, 3e-4];
/// Distance from a chord of a branch, in lengths of it, within which an orbit lies on the branch.
const NEIGHBOURS: f64 = 0.1;
/// Points before the end of a branch from which its limit is taken.
const TOWARDS: usize = 10;

/// What changes at a special point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The branch turns back: a multiplier is 1.
    Fold,
    /// A multiplier is −1.
    PeriodDoubling,
    /// A pair of multipliers is on the unit circle.
    Torus,
    /// A multiplier is 1, and the branch goes on: orbits of less symmetry begin.
    Symmetry,
    /// A flank is touched, or left, at which the force does not jump.
    GrazingSoft,
    /// The same where the damper of the contact makes the force jump, or where the force itself touches zero in contact.
    GrazingDamped,
    /// A rigid flank is touched.
    GrazingRigid,
    /// A rest begins to exist, or ends.
    Stick,
    /// Two events fall on one instant.
    Coincidence,
}

impl Kind {
    /// As files have it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Fold => "fold",
            Self::PeriodDoubling => "period-doubling",
            Self::Torus => "torus",
            Self::Symmetry => "symmetry",
            Self::GrazingSoft => "grazing-soft",
            Self::GrazingDamped => "grazing-damped",
            Self::GrazingRigid => "grazing-rigid",
            Self::Stick => "stick",
            Self::Coincidence => "coincidence",
        }
    }
}

/// An orbit of a branch.
#[derive(Clone, Debug)]
pub struct Point {
    /// Value of the parameter.
    pub value: f64,
    /// Period, cycles.
    pub period: u64,
    /// Word in normal form.
    pub word: String,
    /// All multipliers are inside the unit circle.
    pub is_stable: bool,
    /// The largest of them.
    pub multiplier: f64,
    /// Where it starts, at phase 0.
    pub section: Section,
    /// Distance between its ends, in scales.
    pub residual: f64,
}

/// A point at which the motion changes.
#[derive(Clone, Debug)]
pub struct Special {
    /// What changes.
    pub kind: Kind,
    /// Value of the parameter.
    pub value: f64,
    /// Period of the orbit, cycles.
    pub period: u64,
    /// Its word in normal form.
    pub word: String,
    /// What is left of the equations: the distance of the orbit's ends, in scales, or the change of the value by the last step, in ranges,
    /// whichever is larger.
    pub residual: f64,
    /// The critical multiplier; for kinds made by contact the largest.
    pub multiplier: Complex<f64>,
    /// On which branch.
    pub branch: usize,
    /// Which of its points it is; the one beside it where the branch is born on another one.
    pub point: usize,
}

/// A branch.
#[derive(Clone, Debug)]
pub struct Branch {
    /// 0 for that of the scene's orbit, one more for each doubling or breaking of symmetry at which it began.
    pub level: u32,
    /// Its points in order.
    pub points: Vec<Point>,
    /// Its special points, in order.
    pub specials: Vec<Special>,
    /// How it ends at its two ends, first point first.
    pub ends: [String; 2],
}

/// What is followed.
#[derive(Clone, Debug)]
pub struct Continuation {
    /// Period of the first orbit, cycles; that which `flank orbit` finds if it is not named.
    pub period: Option<u64>,
    /// Levels of branches that are followed beyond the first.
    pub doublings: u32,
}

impl Default for Continuation {
    fn default() -> Self {
        Self { period: None, doublings: 3 }
    }
}

/// Where a branch begins, and the special point that it comes from.
struct Begun {
    level: u32,
    node: Node,
    both: bool,
}

/// A special point with the orbit there.
struct Passed {
    special: Special,
    node: Node,
    /// Distance along the branch, for the order.
    place: f64,
    /// The branch is born there; the orbit is one of the branch that it is born from.
    is_birth: bool,
}

impl Continuation {
    /// Follows the orbit of `scene` along `parameter` between `ends`; `each` is told of every branch that is finished.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene has no orbit to start from, or the parameter no derivative.
    pub fn run(
        &self,
        scene: &Scene,
        parameter: Parameter,
        ends: [f64; 2],
        each: &mut dyn FnMut(&[Branch]) -> Result<(), SimulationError>,
        task: Task<'_>,
    ) -> Result<Vec<Branch>, SimulationError> {
        let family = Family::new(scene, parameter, ends)?;
        let value = family.parameter.value();
        let simulation = family.own()?;
        family.variation(&simulation, value)?;
        let found = Search { period: self.period, starts: 0 }.run(&simulation, task)?;
        let Some(orbit) = found.orbits.first() else {
            let reason = found.reason.unwrap_or_default();
            return Err(simulation.missing(format!("it has no orbit to start from: {reason}")));
        };
        let solver = Solver::new(&family, found.drift.clone());
        let start = solver.start(&simulation, value, orbit).map_err(|missed| simulation.missing(missed.reason))?;
        let mut branches: Vec<Branch> = Vec::new();
        let mut known: Vec<Special> = Vec::new();
        let mut waiting = std::collections::VecDeque::from([Begun { level: 0, node: start, both: true }]);
        let mut left = CYCLES_OF_ALL;
        while let Some(begun) = waiting.pop_front() {
            if task.is_cancelled() || left == 0 {
                break;
            }
            if solver.is_known(&begun.node, &branches) {
                continue;
            }
            let (branch, passed, count) = solver.branch(&begun, branches.len(), left, &known, task);
            left = left.saturating_sub(count);
            known.extend(branch.specials.iter().cloned());
            let parents = passed.iter().filter(|passed| passed.is_birth);
            waiting.extend(parents.map(|p| Begun { level: branch.level, node: p.node.clone(), both: true }));
            if branch.level < self.doublings {
                for passed in passed.iter().filter(|passed| !passed.is_birth) {
                    let begins = match passed.special.kind {
                        Kind::PeriodDoubling => solver.aside(&passed.node, -1.0),
                        Kind::Symmetry => solver.aside(&passed.node, 1.0),
                        _ => None,
                    };
                    waiting.extend(begins.map(|node| Begun { level: branch.level + 1, node, both: false }));
                }
            }
            branches.push(branch);
            each(&branches)?;
            task.report(Progress::Share(1.0 - waiting.len() as f64 / (waiting.len() + branches.len()) as f64));
        }
        Ok(branches)
    }
}

impl Solver<'_> {
    /// A point as others see it.
    fn point(&self, node: &Node) -> Option<Point> {
        let simulation = self.family.at(node.value).ok()?;
        let map = SectionMap::new(&simulation).ok()?;
        let section = map.at_phase(node.phase).lead(&node.orbit.section, &map).ok()?;
        Some(Point {
            value: node.value,
            period: node.orbit.period,
            word: node.orbit.word(),
            is_stable: node.orbit.is_stable,
            multiplier: node.orbit.largest_multiplier(),
            section,
            residual: node.orbit.residual,
        })
    }

    /// Whether the orbit of a node lies on one of the branches.
    fn is_known(&self, node: &Node, branches: &[Branch]) -> bool {
        let Some(point) = self.point(node) else { return false };
        let Ok(simulation) = self.family.at(node.value) else { return false };
        let Ok(map) = SectionMap::new(&simulation) else { return false };
        // The same orbit may begin in any of its cycles.
        let mut sections = vec![point.section];
        for _ in 1..point.period {
            let Ok(next) = map.follow(&sections[sections.len() - 1], 1) else { return false };
            sections.push(next);
        }
        let scales = map.scales(&node.orbit.image.sizes);
        let apart = |a: &Section, b: &[f64]| {
            let squares = a.x.iter().zip(b).zip(&scales).map(|((a, b), scale)| ((a - b) / scale).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let on = |pair: &[Point]| {
            let [a, b] = pair else { return false };
            let share = (node.value - a.value) / (b.value - a.value);
            if a.period != point.period || !(0.0..=1.0).contains(&share) {
                return false;
            }
            let between: Vec<f64> =
                a.section.x.iter().zip(&b.section.x).map(|(a, b)| a + share * (b - a)).collect();
            let length = apart(&a.section, &b.section.x);
            sections.iter().any(|section| apart(section, &between) <= NEIGHBOURS * length)
        };
        branches.iter().any(|branch| branch.points.windows(2).any(on))
    }

    /// The branch through a node.
    fn branch(
        &self,
        begun: &Begun,
        number: usize,
        left: usize,
        known: &[Special],
        task: Task<'_>,
    ) -> (Branch, Vec<Passed>, usize) {
        let start = &begun.node;
        let period = start.orbit.period as usize;
        let most = OF_BRANCH.min(CYCLES_OF_BRANCH.min(left).div_ceil(period));
        let ahead = self.follow(start, most, task);
        let mut behind = None;
        if begun.both && !ahead.is_closed {
            let mut back = start.clone();
            back.tangent = Direction { y: -&start.tangent.y, p: -start.tangent.p };
            behind = Some(self.follow(&back, most, task));
        }
        let mut passed = self.specials(&ahead, 1.0);
        let mut ends = ["its start".to_owned(), ahead.end.clone()];
        let numbered = |trace: &Trace, sign: f64| -> Vec<(f64, Point)> {
            let nodes = trace.nodes.iter().enumerate();
            nodes.filter_map(|(i, node)| Some((sign * (i + 1) as f64, self.point(node)?))).collect()
        };
        let mut points = numbered(&ahead, 1.0);
        points.extend(self.point(start).map(|point| (0.0, point)));
        if let Some(behind) = &behind {
            passed.extend(self.specials(behind, -1.0));
            points.extend(numbered(behind, -1.0));
            ends[0].clone_from(&behind.end);
        }
        passed.sort_by(|a, b| a.place.total_cmp(&b.place));
        let range = self.family.range();
        let mut seen: Vec<Special> = known.to_vec();
        passed.retain_mut(|passed| {
            passed.special.branch = number;
            let own = &passed.special;
            let is_known = seen.iter().any(|other| {
                other.kind == own.kind && other.period == own.period && (other.value - own.value).abs() <= SAME * range
            });
            if !is_known {
                seen.push(own.clone());
            }
            !is_known
        });
        // The special orbits are points of the branch too.
        for passed in passed.iter().filter(|passed| !passed.is_birth) {
            points.extend(self.point(&passed.node).map(|point| (passed.place, Point { value: passed.special.value, ..point })));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        for passed in &mut passed {
            passed.special.point = points.iter().position(|(place, _)| *place >= passed.place).unwrap_or(points.len() - 1);
        }
        let count = points.len() * period;
        let points = points.into_iter().map(|(_, point)| point).collect();
        let specials = passed.iter().map(|passed| passed.special.clone()).collect();
        (Branch { level: begun.level, points, specials, ends }, passed, count)
    }

    /// The special points of a branch in one direction.
    fn specials(&self, trace: &Trace, sign: f64) -> Vec<Passed> {
        let mut all = Vec::new();
        for (i, (a, b)) in trace.before.iter().zip(&trace.nodes).enumerate() {
            let place = |node: &Node| {
                let (_, length) = a.chord(b, self.family.range());
                let (_, part) = a.chord(node, self.family.range());
                sign * (i as f64 + (part / length).clamp(1e-9, 1.0 - 1e-9))
            };
            let mut take = |kind: Kind, located: Option<Located>, multiplier: Option<Complex<f64>>| {
                let Some(located) = located.filter(|located| located.error <= LOCATED * self.family.range()) else {
                    return;
                };
                let largest = located.node.orbit.telling().first().copied();
                let multiplier = multiplier.or(largest).unwrap_or_default();
                all.push(Passed { special: self.special(kind, &located, multiplier), place: place(&located.node), node: located.node, is_birth: false });
            };
            let change = Change::of(&a.course, &b.course);
            let (before, after) = (a.unstable(), b.unstable());
            if a.fold * b.fold < 0.0 {
                if a.tangent.p * b.tangent.p < 0.0 {
                    let located = self.root(a, b, &|node| node.fold);
                    let multiplier = located.as_ref().map(|l| nearest(&l.node, Complex::new(1.0, 0.0)));
                    take(Kind::Fold, located, multiplier);
                } else {
                    let symmetric = Solver { neutral: SYMMETRIC, drift: self.drift.clone(), ..*self };
                    let located = symmetric.root(a, b, &|node| node.fold);
                    let multiplier = located.as_ref().map(|l| nearest(&l.node, Complex::new(1.0, 0.0)));
                    take(Kind::Symmetry, located, multiplier);
                }
            }
            if a.flip * b.flip < 0.0 {
                let located = self.root(a, b, &|node| node.flip);
                let multiplier = located.as_ref().map(|l| nearest(&l.node, Complex::new(-1.0, 0.0)));
                take(Kind::PeriodDoubling, located, multiplier);
            }
            if before[2] != after[2] && before[..2] == after[..2] {
                let located = self.root(a, b, &|node| on_circle(node).map_or(f64::NAN, |m| m.norm() - 1.0));
                let multiplier = located.as_ref().and_then(|l| on_circle(&l.node));
                take(Kind::Torus, located, multiplier);
            }
            match change {
                Change::None => {}
                Change::Other => {
                    if let Some((kind, located)) = self.stick(a, b) {
                        take(kind, Some(located), None);
                    }
                }
                Change::Swapped(_, second) => {
                    let is_same = |node: &Node| Change::of(&a.course, &node.course) == Change::None;
                    let time = |node: &Node| Vanishing::Between(second).at(node).filter(|_| is_same(node));
                    take(Kind::Coincidence, self.limit(a, b, 1.0, &time), None);
                }
                Change::Gained(contact, is_second) => {
                    let (free, other) = if is_second { (a, b) } else { (b, a) };
                    if let Some((kind, located)) = self.graze(free, other, contact) {
                        take(kind, Some(located), None);
                    }
                }
            }
        }
        if trace.stalls {
            let end = self.end(trace, sign);
            all.extend(end.filter(|passed| passed.special.residual <= LOCATED));
        }
        if let Some((a, b)) = &trace.born {
            all.extend(self.birth(a, b).map(|passed| Passed { place: sign * trace.nodes.len() as f64, ..passed }));
        }
        all
    }

    /// The orbit that a branch is born from between two neighbours that are the same orbit, begun elsewhere: one of half the period, at a
    /// doubling, or a more symmetric one.
    fn birth(&self, a: &Node, b: &Node) -> Option<Passed> {
        let range = self.family.range();
        let (row, length) = a.chord(b, range);
        // The parameter is a parabola of the way.
        let at = a.tangent.p / (a.tangent.p - b.tangent.p);
        let (section, _) = a.guess(&row, range, at * length);
        let turn = a.value + 0.5 * at * length * a.tangent.p * range;
        let symmetric = Solver { neutral: SYMMETRIC, drift: self.drift.clone(), ..*self };
        let halves = a.orbit.period.is_multiple_of(2);
        let periods = [(a.orbit.period / 2, true), (a.orbit.period, false)];
        periods.into_iter().filter(|(_, is_half)| halves || !is_half).find_map(|(period, is_half)| {
            PARENT.iter().find_map(|step| {
                // Beyond the turn there is the other one alone.
                let beyond = turn + step * a.tangent.p.signum() * range;
                let first = symmetric.at((section.clone(), beyond), period, a.phase, None, -a.tangent.p.signum()).ok()?;
                let (_, apart) = a.chord(&first, range);
                if apart > 10.0 * (length + step) {
                    return None;
                }
                let reach = 2.0 * step / first.tangent.p.abs().max(1e-3);
                let plane = Plane { from: &first, row: first.tangent.clone(), target: reach, goes_on: true };
                let guess = first.guess(&first.tangent, range, reach);
                let second = symmetric.at(guess, period, a.phase, Some(&plane), 1.0).ok()?;
                let test = |node: &Node| if is_half { node.flip } else { node.fold };
                if test(&first) * test(&second) > 0.0 || first.has_shorter_period() {
                    return None;
                }
                let located = symmetric.root(&first, &second, &test)?;
                let (kind, place) = if is_half { (Kind::PeriodDoubling, -1.0) } else { (Kind::Symmetry, 1.0) };
                let multiplier = nearest(&located.node, Complex::new(place, 0.0));
                let special = self.special(kind, &located, multiplier);
                Some(Passed { special, node: first, place: 0.0, is_birth: true })
            })
        })
    }

    fn special(&self, kind: Kind, located: &Located, multiplier: Complex<f64>) -> Special {
        let node = &located.node;
        Special {
            kind,
            value: located.value,
            period: node.orbit.period,
            word: node.orbit.word(),
            residual: located.residual.max(located.error / self.family.range()),
            multiplier,
            branch: 0,
            point: 0,
        }
    }

    /// Which kind a graze is, by the law of the contact.
    fn kind_of(&self, node: &Node, contact: usize, watch: Watch, is_closed: bool) -> Kind {
        let law = self.family.at(node.value).ok().map(|s| s.structure.spec().contacts[contact].law);
        match law {
            Some(Law::Rigid(_)) if is_closed => Kind::Stick,
            Some(Law::Rigid(_)) => Kind::GrazingRigid,
            Some(Law::KelvinVoigt(l, _)) if l.damping > 0.0 => Kind::GrazingDamped,
            _ if watch == Watch::Force => Kind::GrazingDamped,
            _ => Kind::GrazingSoft,
        }
    }

    /// The graze between a point and one with more events of `contact`.
    fn graze(&self, free: &Node, other: &Node, contact: usize) -> Option<(Kind, Located)> {
        let is_same = |node: &Node| Change::of(&free.course, &node.course) == Change::None;
        let mut found: Vec<(Kind, Located)> = Vec::new();
        // Without the events: the least values of the contact's guards.
        for (key, value) in vanishing(free) {
            let Vanishing::Low(j, watch, is_closed) = key else { continue };
            if j == contact && value > 0.0 {
                let located = self.limit(free, other, REACH, &|node| key.at(node).filter(|_| is_same(node)));
                found.extend(located.map(|located| (self.kind_of(free, j, watch, is_closed), located)));
            }
        }
        let range = self.family.range();
        let (low, high) = (free.value.min(other.value), free.value.max(other.value));
        // A step can pass a fold as well.
        let slack = (high - low).max(SLACK * range);
        let is_between = |located: &Located| (low - slack..=high + slack).contains(&located.value);
        found.retain(|(_, located)| is_between(located));
        if found.iter().all(|(_, located)| located.error > WELL * range) {
            // With them: what vanishes there first.
            let is_same = |node: &Node| Change::of(&other.course, &node.course) == Change::None;
            let of_contact = |i: usize| other.course.letters[i].contact == contact;
            let mut all = vanishing(other);
            all.retain(|(key, _)| matches!(key, Vanishing::Speed(i) | Vanishing::Stay(i) if of_contact(*i)));
            all.sort_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((key, _)) = all.first() {
                let located = self.limit(other, free, REACH, &|node| key.at(node).filter(|_| is_same(node)));
                found.extend(located.filter(is_between).map(|located| (self.kind_of_events(other, *key), located)));
            }
        }
        found.into_iter().min_by(|a, b| a.1.error.total_cmp(&b.1.error))
    }

    /// The end of a rest between two points of which one has more rests. A sequence of impacts whose number grows without end leads to it:
    /// the time that is left of the rest is no smooth function of the parameter there.
    fn stick(&self, a: &Node, b: &Node) -> Option<(Kind, Located)> {
        let rests = |node: &Node| node.course.letters.iter().filter(|letter| letter.token.starts_with('z')).count();
        let (rest, other) = match rests(a).cmp(&rests(b)) {
            std::cmp::Ordering::Less => (b, a),
            std::cmp::Ordering::Greater => (a, b),
            std::cmp::Ordering::Equal => return None,
        };
        // How many impacts stand before a rest may change on the way.
        let located = self.edge(rest, other, &|node| rests(node) == rests(rest))?;
        Some((Kind::Stick, located))
    }

    fn kind_of_events(&self, node: &Node, key: Vanishing) -> Kind {
        let (Vanishing::Speed(i) | Vanishing::Stay(i)) = key else { return Kind::Coincidence };
        let letter = &node.course.letters[i];
        let rests = letter.token.starts_with(['z', 'l']);
        let watch = if letter.token.starts_with(['r', 'a']) { Watch::Force } else { Watch::DriveFlank };
        self.kind_of(node, letter.contact, watch, rests)
    }

    /// What ends a branch: of all that can vanish the one that does so at the end.
    fn end(&self, trace: &Trace, sign: f64) -> Option<Passed> {
        let last = trace.nodes.last()?;
        let same: Vec<&Node> = trace
            .nodes
            .iter()
            .rev()
            .take_while(|node| node.phase == last.phase && Change::of(&last.course, &node.course) == Change::None)
            .collect();
        let range = self.family.range();
        let found = vanishing(last).into_iter().filter_map(|(key, value)| {
            let mut points: Vec<(f64, f64)> =
                same.iter().take(TOWARDS).rev().filter_map(|node| Some((key.at(node)?, node.value))).collect();
            points.dedup_by(|a, b| a.0 == b.0);
            if points.windows(2).any(|pair| pair[1].0 >= pair[0].0) || value <= 0.0 {
                return None;
            }
            let (limit, error) = limit(&points)?;
            let is_near = (limit - last.value).abs() <= 1e-3 * range;
            is_near.then_some((key, limit, error))
        });
        let (key, value, error) = found.min_by(|a, b| (a.1 - last.value).abs().total_cmp(&(b.1 - last.value).abs()))?;
        let kind = match key {
            Vanishing::Low(j, watch, is_closed) => self.kind_of(last, j, watch, is_closed),
            _ => self.kind_of_events(last, key),
        };
        // From a point that is far enough for the orbits between to be well determined.
        let far = same.iter().find(|node| key.at(node).is_some_and(|g| g >= FAR)).copied();
        let far = far.or(same.last().copied())?;
        let is_same = |node: &Node| Change::of(&last.course, &node.course) == Change::None;
        let closer = self.limit(far, last, BEYOND, &|node| key.at(node).filter(|_| is_same(node)));
        let closer = closer.filter(|located| located.error < error && (located.value - value).abs() <= 1e-6 * range);
        let located = closer.unwrap_or_else(|| Located { value, error, residual: 0.0, node: last.clone() });
        let multiplier = last.orbit.telling().first().copied().unwrap_or_default();
        let place = sign * trace.nodes.len() as f64;
        Some(Passed { special: self.special(kind, &located, multiplier), node: located.node, place, is_birth: false })
    }

    /// A point of the branch that begins at a node with the multiplier `at`, −1 or 1.
    fn aside(&self, node: &Node, at: f64) -> Option<Node> {
        let reduced = node.unknowns.reduced(&node.orbit.image.jacobian);
        let count = reduced.nrows();
        let svd = (reduced - DMatrix::identity(count, count) * at).svd(false, true);
        let vectors = svd.v_t?;
        let w: DVector<f64> = vectors.row(count - 1).transpose();
        let row = Direction { y: w, p: 0.0 };
        let period = if at < 0.0 { 2 * node.orbit.period } else { node.orbit.period };
        ASIDE.iter().find_map(|distance| {
            let plane = Plane { from: node, row: row.clone(), target: *distance, goes_on: true };
            let guess = node.guess(&row, self.family.range(), *distance);
            let found = self.at(guess, period, node.phase, Some(&plane), 1.0).ok()?;
            let (_, length) = node.chord(&found, self.family.range());
            (length <= 10.0 * distance && !found.has_shorter_period()).then_some(found)
        })
    }
}

/// The multiplier nearest to `place`.
fn nearest(node: &Node, place: Complex<f64>) -> Complex<f64> {
    let off = |m: &Complex<f64>| (m - place).norm();
    node.multipliers().into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_default()
}

/// The complex multiplier nearest to the unit circle.
fn on_circle(node: &Node) -> Option<Complex<f64>> {
    let off = |m: &Complex<f64>| (m.norm() - 1.0).abs();
    node.multipliers().into_iter().filter(|m| m.im > 0.0).min_by(|a, b| off(a).total_cmp(&off(b)))
}
