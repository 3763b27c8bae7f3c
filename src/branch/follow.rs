//! Following of a branch in one direction.

use serde::{Deserialize, Serialize};

use super::{
    course::Course,
    family::Family,
    node::{Guess, Node, Plane, Solver},
};
use crate::{hybrid::Watch, orbit::words::Letter, task::Task};

/// Lengths of steps, in scales of states and ranges of the parameter: the first, the longest, and the one below which a branch ends.
const FIRST: f64 = 0.01;
pub const LONGEST: f64 = 0.03;
pub const SHORTEST: f64 = 1e-7;
/// Factor after a step that was solved in [`EASY`] Newton steps.
pub const GROWTH: f64 = 1.3;
const EASY: usize = 4;
/// Lengths of steps across a place where the derivative is unbounded, and the distance of the point behind it, in such lengths.
const LEAPS: [f64; 5] = [1e-5, 1e-4, 3e-4, 1e-3, 3e-3];
const NEAR: f64 = 3.0;
/// Cosine of the turn of the tangent that a step may make: 14°.
const TURN: f64 = 0.97;
/// Length of a step below which several changes at once are accepted.
const SEVERAL: f64 = 1e-4;
/// Points behind a corner that may lie off the branch.
const LOST: usize = 5;
/// Length of a step below which the branch may have a corner where its word changes.
const CORNER: f64 = 1e-6;
/// Events, in alphabetic order, that appear at one graze, and those that disappear.
const SINGLE: [(&str, &str); 7] =
    [("i", ""), ("cs", ""), ("crx", ""), ("acrx", ""), ("ar", ""), ("lz", ""), ("cx", "a")];
/// Longest time between events of one instant, cycles.
const TOGETHER: f64 = 1e-9;
/// Cycles that events may move along a step, per length of the step.
const MOVES: f64 = 10.0;
/// Share of a tangent along the parameter below which a fold may be so near that the sense of the tangent is unclear.
const TURNS: f64 = 1e-3;
/// Least time between events and the section, where possible, cycles.
pub const CLEAR: f64 = 0.02;

/// Difference between the events of two neighbours.
#[derive(Clone, Debug, PartialEq)]
pub enum EventChange {
    /// No difference.
    None,
    /// Two events have changed places: index of the later one in the course of the first neighbour.
    Swapped(usize),
    /// One neighbour has more events, of one contact or of equal ones: index of the contact, and true if it is the second neighbour.
    Gained(usize, bool),
    /// Any other difference.
    Other,
}

/// Part of a branch that was followed in one direction.
pub struct Trace {
    /// Points after the start.
    pub nodes: Vec<Node>,
    /// Start of the step to each point: the point before, with the section of this one.
    pub before: Vec<Node>,
    /// Reason for its end, in words.
    pub end: String,
    /// True if it came back to its start.
    pub is_closed: bool,
    /// True if it ended inside the range, as no further orbit was found.
    pub stalls: bool,
    /// Neighbours between which it is born on another branch: behind it lie the same orbits, begun elsewhere.
    pub born: Option<(Node, Node)>,
}

/// Returns the groups of letters of one instant, in order of time.
fn groups(course: &Course) -> Vec<Vec<&str>> {
    let mut groups: Vec<Vec<&str>> = Vec::new();
    for (i, Letter { token, .. }) in course.letters.iter().enumerate() {
        match groups.last_mut() {
            Some(last) if course.times[i] - course.times[i - 1] <= TOGETHER => last.push(token),
            _ => groups.push(vec![token]),
        }
    }
    groups.iter_mut().for_each(|group| group.sort_unstable());
    groups
}

/// Returns the tokens of `a` that `b` does not have.
fn surplus<'a>(a: &[&'a str], b: &[&str]) -> Vec<&'a str> {
    let mut left = b.to_vec();
    let mut is_more = |token: &&str| match left.iter().position(|other| other == token) {
        Some(i) => {
            left.swap_remove(i);
            false
        }
        None => true,
    };
    a.iter().filter(|token| is_more(token)).copied().collect()
}

/// Returns whether a closed contact opens to the gap at once: its force first touches zero and the contact is regained in its zone. A graze
/// of an open contact has the same events, but the contact stays closed for a short time, not open.
fn skips(a: &Course, b: &Course) -> bool {
    let more = surplus(&b.tokens(), &a.tokens());
    let (rich, more) = if more.is_empty() { (a, surplus(&a.tokens(), &b.tokens())) } else { (b, more) };
    let mut kinds: Vec<char> = more.iter().filter_map(|token| token.chars().next()).collect();
    kinds.sort_unstable();
    let Some(contact) = rich.letters.iter().find(|l| more.contains(&l.token.as_str())).map(|l| l.contact) else {
        return false;
    };
    kinds == ['c', 'r', 'x'] && rich.shortest(contact, 'x', 'c') < rich.shortest(contact, 'c', 'r')
}

impl EventChange {
    /// Returns whether two lists of tokens are equal, in any order.
    pub fn is_none(a: &[&str], b: &[&str]) -> bool {
        surplus(a, b).is_empty() && surplus(b, a).is_empty()
    }

    /// Returns the change from `a` to `b`.
    pub fn of(a: &Course, b: &Course) -> Self {
        let (more, less) = (surplus(&b.tokens(), &a.tokens()), surplus(&a.tokens(), &b.tokens()));
        match (more.is_empty(), less.is_empty()) {
            (true, true) => {
                let (of_a, of_b) = (groups(a), groups(b));
                let is_turned = of_a.len() == of_b.len()
                    && (0..of_a.len().max(1)).any(|k| of_a[k..].iter().chain(&of_a[..k]).eq(of_b.iter()));
                if is_turned { Self::None } else { Self::swapped(a, b) }
            }
            _ => Self::gained(&more, &less),
        }
    }

    /// Returns the change if one course has `more` tokens and lacks `less`.
    fn gained(more: &[&str], less: &[&str]) -> Self {
        // By contact and side: both sides of a symmetric orbit may change at once, and equal contacts.
        let kinds = |tokens: &[&str], place: &str| {
            let mut kinds: Vec<char> =
                tokens.iter().filter(|token| &token[1..] == place).filter_map(|token| token.chars().next()).collect();
            kinds.sort_unstable();
            kinds.into_iter().collect::<String>()
        };
        let places: Vec<&str> = more.iter().chain(less).map(|token| &token[1..]).collect();
        let first = (kinds(more, places[0]), kinds(less, places[0]));
        let is_single = SINGLE.contains(&(first.0.as_str(), first.1.as_str()));
        let is_reverse = SINGLE.contains(&(first.1.as_str(), first.0.as_str()));
        let is_alike = places.iter().all(|place| (kinds(more, place), kinds(less, place)) == first);
        let contact = places[0][..places[0].len() - 1].parse().unwrap_or(0);
        if is_alike && (is_single || is_reverse) { Self::Gained(contact, is_single) } else { Self::Other }
    }

    /// Returns the change of two neighbouring events of different contacts that have the other order in `b`.
    fn swapped(a: &Course, b: &Course) -> Self {
        let count = a.letters.len();
        let pairs = (1..count).filter(|i| a.letters[i - 1].contact != a.letters[*i].contact);
        let swapped = pairs.filter(|i| {
            let (first, second) = (&a.letters[i - 1].token, &a.letters[*i].token);
            a.times[*i] - a.times[i - 1] > TOGETHER
                && b.letters.windows(2).any(|pair| pair[0].token == *second && pair[1].token == *first)
        });
        let gap = |i: &usize| a.times[*i] - a.times[i - 1];
        let nearest = swapped.min_by(|i, j| gap(i).total_cmp(&gap(j)));
        nearest.map_or(Self::Other, Self::Swapped)
    }
}

impl Solver<'_> {
    /// Returns the cosine of the angle between the tangents of two points.
    fn turn(&self, a: &Node, b: &Node) -> f64 {
        let tangent = a.tangent_of(b);
        tangent.dot(&a.tangent) / tangent.length()
    }

    /// Returns the point after a step of length `h` along the tangent.
    fn step(&self, from: &Node, h: f64) -> Option<Node> {
        let plane = Plane::through(from, &from.tangent, h);
        self.at(from.guess(&from.tangent, self.family.ranges(), h), Some(&plane), 1.0).ok()
    }

    /// Drops the last points of a branch if they left it at a corner.
    fn take_back(&self, trace: &mut Trace) {
        let Some(last) = trace.nodes.last() else { return };
        let is_same = |node: &&Node| EventChange::of(&last.course, &node.course) == EventChange::None;
        let count = trace.nodes.iter().rev().take_while(is_same).count();
        let Some(before) = trace.nodes.len().checked_sub(count + 1).map(|i| &trace.nodes[i]) else { return };
        let is_near = before.phase == last.phase && before.chord(last, self.family.ranges()).1 <= SEVERAL;
        if count <= LOST && is_near {
            let kept = trace.nodes.len() - count;
            trace.nodes.truncate(kept);
            trace.before.truncate(kept);
        }
    }

    /// Returns the next point behind a place with an unbounded derivative, such as a rigid graze: with other events, and near.
    fn leap(&self, from: &Node) -> Option<(Node, f64)> {
        LEAPS.iter().find_map(|length| {
            let node = self.step(from, *length)?;
            let (_, apart) = from.chord(&node, self.family.ranges());
            let is_other = EventChange::of(&from.course, &node.course) != EventChange::None;
            let goes_on = self.family.contains(node.value) && node.tangent.p * from.tangent.p > 0.0;
            (is_other && goes_on && apart <= NEAR * length).then_some((node, *length))
        })
    }

    /// Returns whether the next point is a neighbour: it follows without a jump and with at most one change.
    fn follows(&self, a: &Node, b: &Node, h: f64) -> bool {
        let change = EventChange::of(&a.course, &b.course);
        let (_, length) = a.chord(b, self.family.ranges());
        if length > 1.2 * h && length > 2.0 * SHORTEST || b.has_shorter_period() {
            return false;
        }
        if self.turn(a, b) < TURN && (change == EventChange::None || h > CORNER) {
            return false;
        }
        let (before, after) = (a.unstable(), b.unstable());
        let changed: usize = before.iter().zip(&after).map(|(a, b)| a.abs_diff(*b)).sum();
        let is_one = changed <= 1 || changed == 2 && before[2].abs_diff(after[2]) == 2;
        h <= SEVERAL
            || is_one
                && !skips(&a.course, &b.course)
                && change != EventChange::Other
                && (changed == 0 || change == EventChange::None)
    }

    /// Follows a branch from `start` along its tangent, up to `most` points, and until `last` cycles are run with their derivative.
    pub fn follow(&self, start: &Node, most: usize, last: u64, task: Task<'_>) -> Trace {
        let Family { from, to, .. } = *self.family;
        let range = self.family.range();
        let mut trace = Trace {
            nodes: Vec::new(),
            before: Vec::new(),
            end: String::new(),
            is_closed: false,
            stalls: false,
            born: None,
        };
        let (mut here, mut h) = (start.clone(), FIRST);
        loop {
            if task.is_cancelled() {
                trace.end = "it is interrupted".to_owned();
                return trace;
            }
            if trace.nodes.len() >= most {
                trace.end = format!("{most} points are computed; take a shorter range");
                return trace;
            }
            if self.spent.get() >= last {
                trace.end = "the limit of work is reached; take a shorter range".to_owned();
                return trace;
            }
            task.advance();
            let ahead = here.value + h * here.tangent.p * range;
            let end = if ahead >= to {
                Some(to)
            } else if ahead <= from {
                Some(from)
            } else {
                None
            };
            let next = match end {
                Some(end) => {
                    let distance = (end - here.value) / (here.tangent.p * range);
                    if distance <= 1e-12 {
                        trace.end = "the end of the range".to_owned();
                        return trace;
                    }
                    let guess = here.guess(&here.tangent, self.family.ranges(), distance);
                    let place = [end, here.second];
                    self.at(Guess { place, ..guess }, None, here.tangent.p.signum()).ok()
                }
                None => self.step(&here, h),
            };
            let reach = end.map_or(h, |end| (end - here.value) / (here.tangent.p * range));
            let inside = |node: &Node| end.is_some() || self.family.contains(node.value);
            let next = next.filter(|node| inside(node) && self.follows(&here, node, reach.max(SHORTEST)));
            let Some(node) = next else {
                h = 0.5 * reach.min(h);
                if h < SHORTEST {
                    if let Some((node, length)) = self.leap(&here) {
                        trace.before.push(here);
                        trace.nodes.push(node.clone());
                        (here, h) = (node, length);
                        continue;
                    }
                    trace.stalls = true;
                    self.take_back(&mut trace);
                    let last = trace.nodes.last().map_or(here.value, |node| node.value);
                    trace.end = format!("no orbit is found beyond {last}");
                    return trace;
                }
                continue;
            };
            // The parameter turns, and no multiplier passes 1.
            if here.tangent.p * node.tangent.p < 0.0 && here.fold * node.fold > 0.0 && end.is_none() {
                trace.end = "the orbit that it is born from".to_owned();
                trace.born = Some((here, node));
                return trace;
            }
            let is_easy = node.steps <= EASY;
            trace.before.push(here.clone());
            trace.nodes.push(node.clone());
            if end.is_some() {
                trace.end = "the end of the range".to_owned();
                return trace;
            }
            if self.is_back(start, &here, &node, h) {
                (trace.is_closed, trace.end) = (true, "it comes back to its start".to_owned());
                return trace;
            }
            if is_easy {
                h = (GROWTH * h).min(LONGEST);
            }
            here = node;
            // Away from a fold the sense of the tangent is that of the parameter.
            if here.course.clearance() < CLEAR.min(MOVES * h)
                && here.tangent.p.abs() > TURNS
                && let Ok(turned) = self.turned(&here)
                && turned.course.clearance() > 1.5 * here.course.clearance()
            {
                here = turned;
            }
        }
    }

    /// Returns whether the step from `a` to `b` passes `start`, in its direction.
    fn is_back(&self, start: &Node, a: &Node, b: &Node, h: f64) -> bool {
        let range = self.family.range();
        let between = (a.value - start.value) * (b.value - start.value) <= 0.0;
        if !between || a.phase != start.phase || a.value == start.value {
            return false;
        }
        let off = start.unknowns.between(&start.orbit.section.x, &b.orbit.section.x).norm();
        libm::hypot(off, (b.value - start.value) / range) <= 1.5 * h && b.tangent.p * start.tangent.p > 0.0
    }
}

/// Returns the least values and times of a point that fall to zero where its word ends: of each guard, of each stay between two events of
/// one contact, and the speed of each impact.
pub fn vanishing(node: &Node) -> Vec<(Vanishing, f64)> {
    let Course { letters, times, lows, .. } = &node.course;
    let mut all: Vec<(Vanishing, f64)> = Vec::new();
    for low in lows {
        let key = Vanishing::Low(low.contact, low.watch, low.is_closed);
        match all.iter_mut().find(|(other, _)| *other == key) {
            Some((_, value)) => *value = value.min(low.value),
            None => all.push((key, low.value)),
        }
    }
    let period = node.orbit.period as f64;
    for (i, letter) in letters.iter().enumerate() {
        if letter.token.starts_with('i') {
            all.push((Vanishing::Speed(i), letter.rate.abs()));
        }
        let of_contact = |k: &usize| letters[*k % letters.len()].contact == letter.contact;
        let next = (i + 1..i + letters.len()).find(of_contact);
        if let Some(k) = next.filter(|k| *k != i) {
            let later = times[k % letters.len()] + if k >= letters.len() { period } else { 0.0 };
            all.push((Vanishing::Stay(i), later - times[i]));
        }
    }
    for i in 1..letters.len() {
        if letters[i].contact != letters[i - 1].contact && times[i] - times[i - 1] > TOGETHER {
            all.push((Vanishing::Between(i), times[i] - times[i - 1]));
        }
    }
    all
}

/// Values that can vanish along a branch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Vanishing {
    /// Least value of a guard of a contact, closed or not.
    Low(usize, Watch, bool),
    /// Speed of an impact, by its place in the course.
    Speed(usize),
    /// Time to the next event of the contact.
    Stay(usize),
    /// Time between an event and the one before it, of another contact.
    Between(usize),
}

impl Vanishing {
    /// Returns the key with the places of its events in another course.
    pub fn moved(self, to: &dyn Fn(usize) -> Option<usize>) -> Option<Self> {
        Some(match self {
            Self::Low(..) => self,
            Self::Speed(i) => Self::Speed(to(i)?),
            Self::Stay(i) => Self::Stay(to(i)?),
            Self::Between(i) => Self::Between(to(i)?),
        })
    }

    /// Returns its value at a point.
    pub fn at(self, node: &Node) -> Option<f64> {
        vanishing(node).into_iter().find(|(key, _)| *key == self).map(|(_, value)| value)
    }
}
