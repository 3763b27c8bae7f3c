//! Continuation: branches, level by level, with their special points.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    family::Family,
    follow::{EventChange, Trace},
    node::{Direction, Guess, Node, Plane, Seed, Solver},
    special::{Special, SpecialKind, SpecialOrbit},
};
use crate::{
    orbit::{Search, Section, SectionMap},
    simulation::{Simulation, SimulationError},
    task::{Progress, Task},
};

/// Maximum number of points of a branch in one direction.
const OF_BRANCH: usize = 600;
/// Approximate limits of cycles that are run with their derivative: for the points of a branch in one direction, for the special ones among
/// them, and for all branches.
const WORK_OF_POINTS: u64 = 15_000;
const WORK_OF_SPECIALS: u64 = 15_000;
const WORK_OF_ALL: u64 = 60_000;
/// Distances, in scales, at which a branch that begins at a special point is searched for.
const ASIDE: [f64; 6] = [0.01, 0.003, 1e-3, 3e-4, 1e-4, 3e-5];
/// Distance in ranges below which two special points are one.
const SAME: f64 = 1e-8;
/// Distance from a chord of a branch, in lengths of it, within which an orbit lies on the branch.
const NEIGHBOURS: f64 = 0.1;

/// An orbit of a branch.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BranchPoint {
    /// Value of the parameter.
    pub value: f64,
    /// Period, cycles.
    pub period: u64,
    /// Word in normal form.
    pub word: String,
    /// True if all multipliers are inside the unit circle.
    pub is_stable: bool,
    /// Largest absolute value of a multiplier.
    pub multiplier: f64,
    /// Start of the orbit, at phase 0.
    pub section: Section,
    /// Distance between its ends, in scales.
    pub residual: f64,
}

/// A branch.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Branch {
    /// Level: 0 for the branch of the scene's orbit, one more for each doubling or breaking of symmetry at which it began.
    pub level: u32,
    /// Its points in order.
    pub points: Vec<BranchPoint>,
    /// Its special points, in order.
    pub specials: Vec<Special>,
    /// Reasons for its two ends, in words, at the first point and at the last one.
    pub ends: [String; 2],
    /// Special points that were passed and could not be located, in words.
    pub unlocated: Vec<String>,
}

/// Branches followed so far, and the state from which a continuation resumes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BranchProgress {
    /// The branches.
    pub branches: Vec<Branch>,
    /// Branches that were not followed yet, in order.
    waiting: VecDeque<BranchStart>,
    /// Cycles that may still be run.
    left: u64,
    /// Count of waiting branches that differ from all followed ones; only the limit of work, or an interrupt, leaves them out.
    pub left_out: usize,
}

/// Settings of a continuation.
#[derive(Clone, Debug)]
pub struct Continuation {
    /// Period of the first orbit, cycles; if absent, that of the orbit which `flank orbit` finds.
    pub period: Option<u64>,
    /// Levels of branches that are followed beyond the first.
    pub doublings: u32,
}

impl Default for Continuation {
    fn default() -> Self {
        Self { period: None, doublings: 3 }
    }
}

/// Start of a branch, and the special point at which it begins.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct BranchStart {
    level: u32,
    seed: Seed,
    both: bool,
    /// Value and period of the special point at which it begins.
    origin: Option<(f64, u64)>,
}

impl Continuation {
    /// Follows the orbit of a scene along the parameter of `family`, or resumes `earlier` work of the same kind. Calls `each` after every
    /// finished branch. An interrupted branch is returned without a call of `each`: later work begins it again.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene has no orbit to start from, or what `each` returns.
    pub fn run(
        &self,
        family: &Family,
        earlier: Option<BranchProgress>,
        each: &mut dyn FnMut(&BranchProgress) -> Result<(), SimulationError>,
        task: Task<'_>,
    ) -> Result<BranchProgress, SimulationError> {
        let simulation = family.own()?;
        let solver = Solver::new(family, SectionMap::new(&simulation)?.drift());
        let mut all = match earlier {
            Some(earlier) => earlier,
            None => self.first(&solver, &simulation, task)?,
        };
        let mut known: Vec<Special> = all.branches.iter().flat_map(|branch| branch.specials.clone()).collect();
        while !task.is_cancelled() && all.left > 0 {
            let Some(begun) = all.waiting.pop_front() else { break };
            // Resumed and uninterrupted work give the same bytes: both begin from the seed.
            let node = match solver.grown(&begun.seed) {
                Ok(node) if !solver.is_known(&node, &all.branches) => node,
                _ => continue,
            };
            let before = solver.spent.get();
            let (branch, passed, births) = solver.branch(&begun, &node, all.branches.len(), all.left, &known, task);
            if task.is_cancelled() {
                all.waiting.push_front(begun);
                all.branches.push(branch);
                break;
            }
            // A branch that ends where another one is to begin is that one, from its other end.
            let is_born = |(value, period): (f64, u64)| {
                births.iter().any(|(v, p)| *p == period && (v - value).abs() <= SAME * family.range())
            };
            all.waiting.retain(|begun| !begun.origin.is_some_and(is_born));
            known.extend(branch.specials.iter().cloned());
            let begins = |level: u32, node: &Node, both: bool, origin: Option<(f64, u64)>| BranchStart {
                level,
                seed: node.seed(&node.tangent),
                both,
                origin,
            };
            let parents = passed.iter().filter(|passed| passed.is_birth).map(|passed| &passed.node);
            for node in parents.chain(passed.iter().filter_map(|passed| passed.behind.as_ref())) {
                // Order by level.
                let place = all.waiting.iter().position(|other| other.level > branch.level);
                all.waiting.insert(place.unwrap_or(all.waiting.len()), begins(branch.level, node, true, None));
            }
            if branch.level < self.doublings {
                for passed in passed.iter().filter(|passed| !passed.is_birth) {
                    let aside = match passed.special.kind {
                        SpecialKind::PeriodDoubling => solver.aside(&passed.node, -1.0),
                        SpecialKind::Symmetry => solver.aside(&passed.node, 1.0),
                        _ => None,
                    };
                    let origin = Some((passed.special.value, passed.special.period));
                    all.waiting.extend(aside.map(|node| begins(branch.level + 1, &node, false, origin)));
                }
            }
            all.left = all.left.saturating_sub(solver.spent.get() - before);
            all.branches.push(branch);
            let (done, to_do) = (all.branches.len() as f64, all.waiting.len() as f64);
            task.report(Progress::Share(done / (done + to_do)));
            each(&all)?;
        }
        if task.is_cancelled() {
            return Ok(all);
        }
        let is_new =
            |begun: &&BranchStart| solver.grown(&begun.seed).is_ok_and(|node| !solver.is_known(&node, &all.branches));
        all.left_out = all.waiting.iter().filter(is_new).count();
        Ok(all)
    }

    /// Returns the work before the first branch.
    fn first(
        &self,
        solver: &Solver<'_>,
        simulation: &Simulation,
        task: Task<'_>,
    ) -> Result<BranchProgress, SimulationError> {
        let found = Search { period: self.period, starts: 0 }.run(simulation, task)?;
        let Some(orbit) = found.orbits.first() else {
            let reason = found.reason.unwrap_or_default();
            return Err(simulation.missing(format!("it has no orbit to start from: {reason}")));
        };
        let value = solver.family.parameter.value();
        let start = solver.start(simulation, value, orbit).map_err(|missed| simulation.missing(missed.reason))?;
        let begun = BranchStart { level: 0, seed: start.seed(&start.tangent), both: true, origin: None };
        Ok(BranchProgress { branches: Vec::new(), waiting: VecDeque::from([begun]), left: WORK_OF_ALL, left_out: 0 })
    }
}

impl Solver<'_> {
    /// Returns a point for output.
    fn point(&self, node: &Node) -> Option<BranchPoint> {
        self.point_at(node, &node.orbit.section, node.value)
    }

    /// Returns a point for output, with another section and value than those of the node.
    fn point_at(&self, node: &Node, section: &Section, value: f64) -> Option<BranchPoint> {
        let simulation = self.family.train([value, node.second]).ok()?;
        let map = SectionMap::new(&simulation).ok()?;
        let section = map.at_phase(node.phase).lead(section, &map).ok()?;
        // An orbit of several cycles begins with the same one all along a branch.
        let period = node.orbit.period;
        let section = match (period - node.shift % period) % period {
            0 => section,
            cycles => map.follow(&section, cycles).ok()?,
        };
        Some(BranchPoint {
            value,
            period: node.orbit.period,
            word: node.orbit.word(),
            is_stable: node.orbit.is_stable,
            multiplier: node.orbit.largest_multiplier(),
            section,
            residual: node.orbit.residual,
        })
    }

    /// Returns whether the orbit of a node lies on one of the branches.
    fn is_known(&self, node: &Node, branches: &[Branch]) -> bool {
        let Some(point) = self.point(node) else { return false };
        let Ok(simulation) = self.family.train(node.place()) else { return false };
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
        let on = |pair: &[BranchPoint]| {
            let [a, b] = pair else { return false };
            let share = (node.value - a.value) / (b.value - a.value);
            if a.period != point.period || !(0.0..=1.0).contains(&share) {
                return false;
            }
            let between: Vec<f64> = a.section.x.iter().zip(&b.section.x).map(|(a, b)| a + share * (b - a)).collect();
            let length = apart(&a.section, &b.section.x);
            sections.iter().any(|section| apart(section, &between) <= NEIGHBOURS * length)
        };
        branches.iter().any(|branch| branch.points.windows(2).any(on))
    }

    /// Returns the branch through a node, its special points, and the values and periods of the orbits that it is born from.
    fn branch(
        &self,
        begun: &BranchStart,
        start: &Node,
        number: usize,
        left: u64,
        known: &[Special],
        task: Task<'_>,
    ) -> (Branch, Vec<SpecialOrbit>, Vec<(f64, u64)>) {
        let end = self.spent.get() + left;
        let until = |work: u64| end.min(self.spent.get() + work);
        let ahead = self.follow(start, OF_BRANCH, until(WORK_OF_POINTS), task);
        let mut behind = None;
        if begun.both && !ahead.is_closed {
            let mut back = start.clone();
            back.tangent = start.tangent.times(-1.0);
            behind = Some(self.follow(&back, OF_BRANCH, until(WORK_OF_POINTS), task));
        }
        let (mut passed, mut unlocated) = self.specials(&ahead, 1.0, until(WORK_OF_SPECIALS), task);
        let ended = |trace: &Trace, passed: &[SpecialOrbit]| match passed.iter().find(|passed| passed.behind.is_some())
        {
            Some(passed) => {
                format!("a rigid graze at {}; the motion with the other events is followed too", passed.special.value)
            }
            None => trace.end.clone(),
        };
        let mut ends = ["its start".to_owned(), ended(&ahead, &passed)];
        let numbered = |trace: &Trace, sign: f64| -> Vec<(f64, BranchPoint)> {
            let nodes = trace.nodes.iter().enumerate();
            nodes.filter_map(|(i, node)| Some((sign * (i + 1) as f64, self.point(node)?))).collect()
        };
        let mut points = numbered(&ahead, 1.0);
        points.extend(self.point(start).map(|point| (0.0, point)));
        if let Some(behind) = &behind {
            let (others, further) = self.specials(behind, -1.0, until(WORK_OF_SPECIALS), task);
            ends[0] = ended(behind, &others);
            passed.extend(others);
            unlocated.extend(further);
            points.extend(numbered(behind, -1.0));
        }
        passed.sort_by(|a, b| a.place.total_cmp(&b.place));
        let births = passed.iter().filter(|p| p.is_birth).map(|p| (p.special.value, p.special.period)).collect();
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
            let point = self.point_at(&passed.node, &passed.section, passed.special.value);
            points.extend(point.map(|point| (passed.place, point)));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        for passed in &mut passed {
            passed.special.point =
                points.iter().position(|(place, _)| *place >= passed.place).unwrap_or(points.len() - 1);
        }
        let points = points.into_iter().map(|(_, point)| point).collect();
        let specials = passed.iter().map(|passed| passed.special.clone()).collect();
        (Branch { level: begun.level, points, specials, ends, unlocated }, passed, births)
    }

    /// Returns a point of the branch that begins at a node with the multiplier `at`, −1 or 1.
    fn aside(&self, node: &Node, at: f64) -> Option<Node> {
        let reduced = node.unknowns.reduced(&node.orbit.image.jacobian);
        let count = reduced.nrows();
        let svd = (reduced - DMatrix::identity(count, count) * at).svd(false, true);
        let vectors = svd.v_t?;
        let w: DVector<f64> = vectors.row(count - 1).transpose();
        let row = Direction { y: w, p: 0.0, s: 0.0 };
        let period = if at < 0.0 { 2 * node.orbit.period } else { node.orbit.period };
        // Near its start, the branch has the events of its first orbit, and no instability beyond that of the critical multiplier.
        let (mut events, parent) = (node.course.tokens(), node.unstable());
        if at < 0.0 {
            events = [events.clone(), events].concat();
        }
        let is_near = |found: &Node| {
            let (unstable, own) = (found.unstable(), found.unstable().iter().sum::<usize>());
            let all = parent.iter().sum::<usize>();
            // Over twice the period multipliers are squares.
            let negative = if at < 0.0 { 0 } else { parent[1] };
            let is_same = EventChange::is_none(&events, &found.course.tokens());
            is_same && unstable[1] == negative && own <= all + 1 && all <= own + 1
        };
        let find = |distance: &f64| {
            let plane = Plane::through(node, &row, *distance);
            let guess = node.guess(&row, self.family.ranges(), *distance);
            let found = self.at(Guess { period, ..guess }, Some(&plane), 1.0).ok()?;
            let (_, length) = node.chord(&found, self.family.ranges());
            (length <= 10.0 * distance && !found.has_shorter_period()).then_some(found)
        };
        let found: Vec<Node> = ASIDE.iter().filter_map(find).collect();
        found.iter().find(|found| is_near(found)).or(found.first()).cloned()
    }
}
