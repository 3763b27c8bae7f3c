//! Special points of a branch: between two neighbours, and at its ends.

use std::{cmp::Ordering, rc::Rc};

use nalgebra::Complex;
use serde::{Deserialize, Serialize};

use super::{
    follow::{EventChange, Trace, Vanishing, vanishing},
    locate::{Located, limit},
    node::{Guess, Node, Plane, Seed, Solver, Spot},
};
use crate::{
    hybrid::Watch,
    orbit::{MARGINAL, Section},
    task::Task,
};

/// Singular value of the direction that breaks a symmetry, as a share of the largest one: below it, that direction is left alone.
const SYMMETRIC: f64 = 1e-6;
/// Distance beyond a neighbour to which a graze is searched for, in steps, and slack of its value, in ranges.
pub(super) const REACH: f64 = 1.5;
pub(super) const SLACK: f64 = 1e-9;
/// Kinds at which the derivative jumps.
const JUMPS: [SpecialKind; 3] = [SpecialKind::GrazingRigid, SpecialKind::GrazingDamped, SpecialKind::Stick];
/// Residual above which a graze, or a coincidence, is searched for from both sides.
const WELL: f64 = 1e-12;
/// Maximum number of stays and speeds that are tried as the vanishing value of a graze, the shortest first.
const CANDIDATES: usize = 3;
/// Limits at the end of a branch: least size of a vanishing value at the orbit from which the limit is taken, and longest way, relative to
/// that to the last orbit.
const FAR: f64 = 0.03;
const BEYOND: f64 = 1.1;
/// Largest uncertainty of a point that counts as located, in ranges.
pub(super) const LOCATED: f64 = 1e-9;
/// Steps, in scales, at which the branch is searched for from which another one is born.
const PARENT: [f64; 6] = [3e-3, 1e-3, 1e-2, 3e-4, 3e-5, 3e-6];
/// Points before the end of a branch from which its limit is taken.
const TOWARDS: usize = 10;

/// Kind of a special point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SpecialKind {
    /// Fold: the branch turns back at a multiplier of 1.
    Fold,
    /// Period doubling: a multiplier is −1.
    PeriodDoubling,
    /// Torus: a pair of multipliers is on the unit circle.
    Torus,
    /// Symmetry: orbits of less symmetry begin at a multiplier of 1, and the branch goes on.
    Symmetry,
    /// Soft graze: a flank is touched, or left, without a jump of the force.
    GrazingSoft,
    /// Damped graze: the damper of the contact makes the force jump, or the force itself touches zero in contact.
    GrazingDamped,
    /// Rigid graze: a rigid flank is touched.
    GrazingRigid,
    /// Stick: a rest begins to exist, or ends.
    Stick,
    /// Coincidence: two events fall on one instant.
    Coincidence,
}

impl SpecialKind {
    /// Returns its word in files.
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

    /// Returns the test function of the kinds that multipliers decide; `pair` is the index of a complex pair, the largest first.
    pub(super) fn test(self, node: &Node, pair: usize) -> f64 {
        match self {
            Self::Fold | Self::Symmetry => node.fold,
            Self::PeriodDoubling => node.flip,
            Self::Torus => node.pairs().get(pair).map_or(f64::NAN, |m| m.norm() - 1.0),
            _ => f64::NAN,
        }
    }
}

/// Point at which the motion changes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Special {
    /// Kind.
    pub kind: SpecialKind,
    /// Value of the parameter.
    pub value: f64,
    /// Period of the orbit, cycles.
    pub period: u64,
    /// Its word in normal form.
    pub word: String,
    /// Residual of the equations of the point over their slope in the parameter.
    pub residual: f64,
    /// Estimate of the error of the value.
    pub uncertainty: f64,
    /// The critical multiplier; for kinds made by contact the largest.
    pub multiplier: Complex<f64>,
    /// True if the parameter turns there: at a fold, and where a graze makes the branch turn.
    pub turns: bool,
    /// Index of the branch.
    pub branch: usize,
    /// Index of the point on the branch; that of its neighbour if the branch is born on another one.
    pub point: usize,
    /// Data to find the point again with another number changed.
    pub(super) trail: SpecialSource,
}

/// Data from which a special point was found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SpecialSource {
    /// Value that is zero there.
    pub sought: ZeroCondition,
    /// Orbit there, or the last one before.
    pub seed: Seed,
    /// Orbit from which a limit was taken.
    pub from: Option<Spot>,
}

/// Value that is zero at a special point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ZeroCondition {
    /// Function of its kind, on a branch that goes on.
    Root,
    /// Vanishing value, seen from the side on which it exists.
    Limit(Vanishing),
    /// Load at the instant at which a rest begins.
    Rest,
}

/// Kind, vanishing value and location of a special point.
pub(super) type LocatedKind = (SpecialKind, ZeroCondition, Located);

/// Special point with the orbit there.
pub struct SpecialOrbit {
    /// Special point.
    pub special: Special,
    /// Orbit, or the last one before.
    pub node: Node,
    /// Start of the orbit; for a limit by extrapolation.
    pub section: Section,
    /// Orbit behind the rigid graze at which the branch ends.
    pub behind: Option<Node>,
    /// Distance along the branch, for the order.
    pub place: f64,
    /// True if the branch is born there; the orbit is then one of the branch that it is born from.
    pub is_birth: bool,
}

impl Solver<'_> {
    /// Returns the special points of a branch in one direction. Also returns, in words, those that could not be located, or not until
    /// `last` cycles were run with their derivative.
    pub fn specials(&self, trace: &Trace, sign: f64, last: u64, task: Task<'_>) -> (Vec<SpecialOrbit>, Vec<String>) {
        let (mut all, mut unlocated) = (Vec::new(), Vec::new());
        for (i, (a, b)) in trace.before.iter().zip(&trace.nodes).enumerate() {
            if task.is_cancelled() {
                break;
            }
            if self.spent.get() >= last {
                let end = trace.nodes.last().map_or(b.value, |node| node.value);
                unlocated.push(format!("anything from {} to {end}, by the limit of work", a.value));
                break;
            }
            let place = |node: &Node| {
                let (_, length) = a.chord(b, self.family.ranges());
                let (_, part) = a.chord(node, self.family.ranges());
                sign * (i as f64 + (part / length).clamp(1e-9, 1.0 - 1e-9))
            };
            let all_found = self.between(a, b);
            let is_fold = |found: &(&str, Option<LocatedKind>)| found.0 == SpecialKind::Fold.word();
            let turns = a.tangent.p * b.tangent.p < 0.0 && !all_found.iter().any(is_fold);
            for (what, found) in all_found {
                let Some((kind, sought, located)) = found.filter(|(.., located)| self.is_located(located)) else {
                    unlocated.push(format!("{what} between {} and {}", a.value, b.value));
                    continue;
                };
                let (mut special, place) = (self.special(kind, sought, &located), place(&located.node));
                special.turns |= turns && JUMPS.contains(&kind);
                let Located { node, section, .. } = located;
                all.push(SpecialOrbit { special, place, node, section, behind: None, is_birth: false });
            }
        }
        if self.spent.get() >= last || task.is_cancelled() {
            return (all, unlocated);
        }
        let is_known = |passed: &SpecialOrbit| passed.special.uncertainty <= LOCATED * self.family.range();
        if trace.stalls {
            match self.end(trace, sign).filter(is_known) {
                Some(passed) => all.push(passed),
                None => {
                    unlocated.extend(trace.nodes.last().map(|last| format!("end of the branch near {}", last.value)))
                }
            }
        }
        if let Some((a, b)) = &trace.born {
            match self.birth(a, b).filter(is_known) {
                Some(passed) => all.push(SpecialOrbit { place: sign * trace.nodes.len() as f64, ..passed }),
                None => unlocated.push(format!("birth of the branch between {} and {}", a.value, b.value)),
            }
        }
        (all, unlocated)
    }

    /// Returns the special points between two neighbours: each in words, with its location if that was found.
    fn between(&self, a: &Node, b: &Node) -> Vec<(&'static str, Option<LocatedKind>)> {
        let by_contact = match EventChange::of(&a.course, &b.course) {
            EventChange::None => None,
            EventChange::Other => Some(("change of several events", self.stick(a, b))),
            EventChange::Swapped(second) => Some(("coincidence", self.coincidence(a, b, second))),
            EventChange::Gained(contact, is_second) => {
                let (free, other) = if is_second { (a, b) } else { (b, a) };
                Some(("graze", self.graze(free, other, contact)))
            }
        };
        // Where the derivative jumps, a multiplier can pass a value without taking it.
        let jumps = by_contact.iter().filter_map(|(_, found)| found.as_ref()).any(|(kind, ..)| JUMPS.contains(kind));
        let (before, after) = (a.unstable(), b.unstable());
        let of_fold = if a.tangent.p * b.tangent.p < 0.0 { SpecialKind::Fold } else { SpecialKind::Symmetry };
        let is_passed = [
            (of_fold, a.fold * b.fold < 0.0),
            (SpecialKind::PeriodDoubling, a.flip * b.flip < 0.0),
            (SpecialKind::Torus, before[2] != after[2] && before[..2] == after[..2]),
        ];
        // Index of the last of the pairs that are outside on one side and inside on the other.
        let pair = (before[2].max(after[2]) / 2).saturating_sub(1);
        // A pair that damping does not move stays on the circle, on either side of it by rounding.
        let moves = |kind: SpecialKind| {
            kind != SpecialKind::Torus || kind.test(a, pair).abs().max(kind.test(b, pair).abs()) > MARGINAL
        };
        let by_multipliers =
            is_passed.into_iter().filter(|(kind, is_passed)| *is_passed && moves(*kind)).map(|(kind, _)| {
                let is_symmetric = kind == SpecialKind::Symmetry;
                let solver = Self { is_symmetric, ..self.of_kind(kind) };
                let test = |node: &Node| kind.test(node, pair);
                let located = if jumps { solver.root(a, b, &test) } else { solver.refined(self, a, b, &test) };
                let located = located.filter(|located| self.is_located(located));
                (kind.word(), located.map(|located| (kind, ZeroCondition::Root, located)))
            });
        by_multipliers.filter(|(_, found)| found.is_some() || !jumps).chain(by_contact).collect()
    }

    /// Returns the orbit from which a branch is born, between two neighbours that are the same orbit begun elsewhere. That orbit has half
    /// the period, at a doubling, or more symmetry.
    fn birth(&self, a: &Node, b: &Node) -> Option<SpecialOrbit> {
        let range = self.family.range();
        let (row, length) = a.chord(b, self.family.ranges());
        // The parameter is a parabola along the chord.
        let at = a.tangent.p / (a.tangent.p - b.tangent.p);
        let guess = a.guess(&row, self.family.ranges(), at * length);
        let turn = a.value + 0.5 * at * length * a.tangent.p * range;
        let symmetric = self.of_kind(SpecialKind::Symmetry);
        let halves = a.orbit.period.is_multiple_of(2);
        let periods = [(a.orbit.period / 2, true), (a.orbit.period, false)];
        periods.into_iter().filter(|(_, is_half)| halves || !is_half).find_map(|(period, is_half)| {
            PARENT.iter().find_map(|step| {
                // Beyond the turn only the other branch exists.
                let beyond = turn + step * a.tangent.p.signum() * range;
                let guess = Guess { place: [beyond, a.second], period, ..guess.clone() };
                let first = symmetric.at(guess, None, -a.tangent.p.signum()).ok()?;
                let (_, apart) = a.chord(&first, self.family.ranges());
                if apart > 10.0 * (length + step) {
                    return None;
                }
                let reach = 2.0 * step / first.tangent.p.abs().max(1e-3);
                let plane = Plane::through(&first, &first.tangent, reach);
                let guess = first.guess(&first.tangent, self.family.ranges(), reach);
                let second = symmetric.at(guess, Some(&plane), 1.0).ok()?;
                let kind = if is_half { SpecialKind::PeriodDoubling } else { SpecialKind::Symmetry };
                let test = |node: &Node| kind.test(node, 0);
                if test(&first) * test(&second) > 0.0 || first.has_shorter_period() {
                    return None;
                }
                let solver = Self { is_symmetric: !is_half, ..self.of_kind(kind) };
                let located = solver.root(&first, &second, &test)?;
                let special = self.special(kind, ZeroCondition::Root, &located);
                let section = first.orbit.section.clone();
                Some(SpecialOrbit { special, node: first, section, behind: None, place: 0.0, is_birth: true })
            })
        })
    }

    /// Returns whether the uncertainty of a point is small enough.
    pub(super) fn is_located(&self, located: &Located) -> bool {
        located.uncertainty(self.family.range()) <= LOCATED
    }

    /// Returns the same solver, on symmetric branches with a cutoff that leaves the breaking direction alone.
    pub fn of_kind(&self, kind: SpecialKind) -> Self {
        let neutral = if kind == SpecialKind::Symmetry { SYMMETRIC } else { self.neutral };
        Self { neutral, drift: self.drift.clone(), slice: self.slice.clone(), spent: Rc::clone(&self.spent), ..*self }
    }

    fn special(&self, kind: SpecialKind, sought: ZeroCondition, located: &Located) -> Special {
        let node = &located.node;
        let multiplier = match kind {
            SpecialKind::Fold | SpecialKind::Symmetry => nearest(node, Complex::new(1.0, 0.0)),
            SpecialKind::PeriodDoubling => nearest(node, Complex::new(-1.0, 0.0)),
            SpecialKind::Torus => on_circle(node).unwrap_or_default(),
            _ => node.orbit.telling().first().copied().unwrap_or_default(),
        };
        Special {
            kind,
            value: located.value,
            period: node.orbit.period,
            word: node.orbit.word(),
            residual: located.residual * self.family.range(),
            uncertainty: located.uncertainty(self.family.range()) * self.family.range(),
            multiplier,
            turns: kind == SpecialKind::Fold,
            branch: 0,
            point: 0,
            trail: SpecialSource { sought, seed: node.seed(&node.tangent), from: located.from.clone() },
        }
    }

    /// Returns the kind of a graze, by the law of the contact.
    pub(super) fn kind_of(&self, node: &Node, contact: usize, watch: Watch, is_closed: bool) -> SpecialKind {
        let law = self.family.train(node.place()).ok().map(|s| s.structure.spec().contacts[contact].law);
        match law {
            Some(law) if law.is_rigid() && is_closed => SpecialKind::Stick,
            Some(law) if law.is_rigid() => SpecialKind::GrazingRigid,
            Some(law) if law.jump_damping() > 0.0 => SpecialKind::GrazingDamped,
            _ if watch == Watch::Force => SpecialKind::GrazingDamped,
            _ => SpecialKind::GrazingSoft,
        }
    }

    /// Locates the instant at which an event and the one before it, of another contact, meet. It is sought from the side of `a`, where it
    /// is number `second`, else from that of `b`.
    fn coincidence(&self, a: &Node, b: &Node, second: usize) -> Option<LocatedKind> {
        let from = |here: &Node, there: &Node, second: usize| {
            let key = Vanishing::Between(second);
            let is_same = |node: &Node| EventChange::of(&here.course, &node.course) == EventChange::None;
            let time = |node: &Node| key.at(node).filter(|_| is_same(node));
            let (row, length) = self.towards(here, there);
            let located = self.limit(here, &(row, REACH * length), &time)?;
            Some((SpecialKind::Coincidence, ZeroCondition::Limit(key), located))
        };
        let is_well = |found: &LocatedKind| found.2.error <= WELL;
        let first = from(a, b, second);
        if first.as_ref().is_some_and(is_well) {
            return first;
        }
        let other = match EventChange::of(&b.course, &a.course) {
            EventChange::Swapped(second) => from(b, a, second),
            _ => None,
        };
        first.into_iter().chain(other).min_by(|a, b| a.2.error.total_cmp(&b.2.error))
    }

    /// Returns the graze between a point and one with more events of `contact`.
    fn graze(&self, free: &Node, other: &Node, contact: usize) -> Option<LocatedKind> {
        let is_same = |node: &Node| EventChange::of(&free.course, &node.course) == EventChange::None;
        let mut found: Vec<LocatedKind> = Vec::new();
        let reach = |a: &Node, b: &Node| {
            let (row, length) = self.towards(a, b);
            (row, REACH * length)
        };
        // Without the events: the least values of the contact's guards.
        for (key, value) in vanishing(free) {
            let Vanishing::Low(j, watch, is_closed) = key else { continue };
            if j == contact && value > 0.0 {
                let located = self.limit(free, &reach(free, other), &|node| key.at(node).filter(|_| is_same(node)));
                found.extend(
                    located
                        .map(|located| (self.kind_of(free, j, watch, is_closed), ZeroCondition::Limit(key), located)),
                );
            }
        }
        let range = self.family.range();
        let (low, high) = (free.value.min(other.value), free.value.max(other.value));
        // A step can pass a fold as well.
        let slack = (high - low).max(SLACK * range);
        let is_between = |located: &Located| (low - slack..=high + slack).contains(&located.value);
        found.retain(|(.., located)| is_between(located));
        if found.iter().all(|(.., located)| located.error > WELL) {
            // With the events: the first of their vanishing values.
            let is_same = |node: &Node| EventChange::of(&other.course, &node.course) == EventChange::None;
            let of_contact = |i: usize| other.course.letters[i].contact == contact;
            let mut all = vanishing(other);
            all.retain(|(key, _)| matches!(key, Vanishing::Speed(i) | Vanishing::Stay(i) if of_contact(*i)));
            all.sort_by(|a, b| a.1.total_cmp(&b.1));
            for (key, _) in all.iter().take(CANDIDATES) {
                let located = self.limit(other, &reach(other, free), &|node| key.at(node).filter(|_| is_same(node)));
                let kind = self.kind_of_events(other, *key);
                found.extend(located.filter(is_between).map(|located| (kind, ZeroCondition::Limit(*key), located)));
            }
        }
        // At a rigid graze only the motion without the impact is smooth.
        let is_singular = |found: &LocatedKind| {
            found.0 == SpecialKind::GrazingRigid && !matches!(found.1, ZeroCondition::Limit(Vanishing::Low(..)))
        };
        let order = |found: &LocatedKind| (!self.is_located(&found.2), is_singular(found), found.2.error);
        let by_order = |a: &LocatedKind, b: &LocatedKind| order(a).partial_cmp(&order(b)).unwrap_or(Ordering::Equal);
        let mut best = found.into_iter().min_by(by_order)?;
        if best.0 == SpecialKind::GrazingRigid
            && best.2.error > WELL
            && let Some(behind) = self.look_behind(&best.2)
        {
            self.refine_from_behind(&mut best.2, &behind, contact);
        }
        Some(best)
    }

    fn kind_of_events(&self, node: &Node, key: Vanishing) -> SpecialKind {
        let (Vanishing::Speed(i) | Vanishing::Stay(i)) = key else { return SpecialKind::Coincidence };
        let letter = &node.course.letters[i];
        let rests = letter.token.starts_with(['z', 'l']);
        let watch = if letter.token.starts_with(['r', 'a']) { Watch::Force } else { Watch::DriveFlank };
        self.kind_of(node, letter.contact, watch, rests)
    }

    /// Returns the end of a branch: of all values that can vanish, the one that does so at the end.
    fn end(&self, trace: &Trace, sign: f64) -> Option<SpecialOrbit> {
        let last = trace.nodes.last()?;
        let same: Vec<&Node> = trace
            .nodes
            .iter()
            .rev()
            .take_while(|node| {
                node.phase == last.phase && EventChange::of(&last.course, &node.course) == EventChange::None
            })
            .collect();
        let range = self.family.range();
        let found = vanishing(last).into_iter().filter_map(|(key, value)| {
            let mut points: Vec<(f64, f64)> =
                same.iter().take(TOWARDS).rev().filter_map(|node| Some((key.at(node)?, node.value))).collect();
            points.dedup_by(|a, b| a.0 == b.0);
            if points.windows(2).any(|pair| pair[1].0 >= pair[0].0) || value <= 0.0 {
                return None;
            }
            let (limit, error) = limit(&points).map(|(limit, error)| (limit, error / range))?;
            let is_near = (limit - last.value).abs() <= 1e-3 * range;
            is_near.then_some((key, limit, error))
        });
        let (key, value, error) = found.min_by(|a, b| (a.1 - last.value).abs().total_cmp(&(b.1 - last.value).abs()))?;
        let kind = match key {
            Vanishing::Low(j, watch, is_closed) => self.kind_of(last, j, watch, is_closed),
            _ => self.kind_of_events(last, key),
        };
        // From a point far enough for the orbits between to be well determined.
        let far = same.iter().find(|node| key.at(node).is_some_and(|g| g >= FAR)).copied();
        let far = far.or(same.last().copied())?;
        let is_same = |node: &Node| EventChange::of(&last.course, &node.course) == EventChange::None;
        let (row, length) = self.towards(far, last);
        let closer = self.limit(far, &(row, BEYOND * length), &|node| key.at(node).filter(|_| is_same(node)));
        let closer = closer.filter(|located| located.error < error && (located.value - value).abs() <= 1e-6 * range);
        let (second, from, section) = (last.second, Some(Spot::of(far)), last.orbit.section.clone());
        let outermost = || Located { value, second, from, error, residual: error, section, node: last.clone() };
        let mut located = closer.unwrap_or_else(outermost);
        let contact = match key {
            Vanishing::Low(j, ..) => j,
            Vanishing::Speed(i) | Vanishing::Stay(i) | Vanishing::Between(i) => last.course.letters[i].contact,
        };
        let behind = if kind == SpecialKind::GrazingRigid { self.look_behind(&located) } else { None };
        let smooth = behind.as_ref().and_then(|behind| self.refine_from_behind(&mut located, behind, contact));
        let place = sign * trace.nodes.len() as f64;
        let mut special = self.special(kind, ZeroCondition::Limit(key), &located);
        special.trail = smooth.unwrap_or(special.trail);
        let Located { node, section, .. } = located;
        Some(SpecialOrbit { special, node, section, behind, place, is_birth: false })
    }
}

/// Returns the multiplier nearest to `place`.
fn nearest(node: &Node, place: Complex<f64>) -> Complex<f64> {
    let off = |m: &Complex<f64>| (m - place).norm();
    node.multipliers().into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_default()
}

/// Returns the complex multiplier nearest to the unit circle.
fn on_circle(node: &Node) -> Option<Complex<f64>> {
    node.pairs().get(node.pair_on_circle()).copied()
}
