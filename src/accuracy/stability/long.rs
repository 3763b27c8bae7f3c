//! Motions over many cycles: that of the engine, and that of a fixed-step method compared with it.

use std::{f64::consts::TAU, ops::ControlFlow};

use serde::Serialize;

use super::{Cell, Outcome};
use crate::{
    accuracy::{
        AccuracyError, Contender, Problem, SolverKind, Truth,
        problem::{Passages, time_apart},
        score::pairs,
    },
    analysis::Sections,
    baseline::{Crossing, Crossings, Grid, Penalty, Ramp, Sample, SampleObserver},
    task::Task,
};

/// Rule by which motions are compared.
///
/// A motion has settled on an orbit by the rule of [`Sections`], with its distances measured from
/// section to section; runs end there. In the long run a method has the engine's motion if
///
/// - the engine's motion is periodic: the method's has the same period, and its sections are within `apart` of the engine's
///   orbit, begun at any of its sections; one that has not settled must keep as near over its last eight sections;
/// - the engine's motion is irregular (it has not settled when the cycles are spent): the method's does not settle either, and
///   statistics agree: of each contact the fraction of time between its flanks (of a rigid one its impacts a cycle) over
///   the second half of the cycles, within `statistics` of the engine's, or within five standard errors of the difference,
///   taken from the scatter of ten parts of either, where that is more (five, for a map asks a thousand such questions). A
///   motion that never returns has no orbit to compare.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LongRunRule {
    /// Cycles in which the sequence of events is compared, at most; fewer where the motion amplifies errors.
    pub window: u64,
    /// Growth of errors in the window, at most: see [`Window`](crate::accuracy::Window).
    pub growth: f64,
    /// Cycles of a run, at most.
    pub cycles: u64,
    /// Relative distance from an orbit at which a motion has settled.
    pub settled: f64,
    /// Largest relative distance of two orbits that count as one.
    pub apart: f64,
    /// Relative difference of statistics that counts as none.
    pub statistics: f64,
}

impl Default for LongRunRule {
    fn default() -> Self {
        Self { window: 20, growth: 1e3, cycles: 100, settled: 1e-4, apart: 0.05, statistics: 0.1 }
    }
}

/// Longest period looked for, cycles.
const LONGEST: usize = 8;
/// Parts into which the second half of the cycles is divided for statistics.
const PARTS: u64 = 10;
/// Standard errors by which statistics may differ.
const ERRORS: f64 = 5.0;
/// Ratio to the engine's largest energy above which the mean energy of a method counts as grown.
const MADE: f64 = 1.05;

/// The engine's motion in the long run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EngineMotion {
    /// Period, cycles; none if no orbit was reached.
    pub period: Option<u32>,
    /// Cycles run.
    pub cycles: u64,
    /// Steps a cycle of the engine.
    pub steps_per_cycle: f64,
    /// For each contact, in each part of the second half: share of time apart; for a rigid contact, impacts per cycle.
    #[serde(skip)]
    parts: Vec<[f64; PARTS as usize]>,
    #[serde(skip)]
    sections: Option<Sections>,
    #[serde(skip)]
    sizes: [f64; 2],
    #[serde(skip)]
    energy: f64,
}

/// `period 2` or `not settled`.
impl std::fmt::Display for EngineMotion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.period {
            Some(period) => write!(f, "period {period}"),
            None => f.write_str("not settled"),
        }
    }
}

/// Sections of a motion, and its period once it has settled.
struct MotionSections {
    sections: Sections,
    period: Option<u32>,
}

impl MotionSections {
    fn new(problem: &Problem<'_>) -> Self {
        let sections = Sections::new(problem.structure().freedoms(), TAU / problem.period, LONGEST as u32);
        Self { sections, period: None }
    }

    fn take(&mut self, x: &[f64], rule: &LongRunRule) {
        let found = self.sections.take(x, rule.settled);
        self.period = self.period.or(found.map(|(period, _)| period));
    }
}

impl EngineMotion {
    /// Runs the engine on `problem` over the cycles of the rule, or until the motion has settled. `None` once cancelled.
    pub(super) fn find(
        problem: &Problem<'_>,
        truth: &Truth,
        rule: &LongRunRule,
        task: Task<'_>,
    ) -> Result<Option<Self>, AccuracyError> {
        let n = problem.structure().freedoms();
        let model = Penalty::new(problem.structure(), Ramp::Sharp);
        let mut passages = Passages::new(problem);
        let mut section = MotionSections::new(problem);
        let mut engine = problem.engine(problem.start.clone(), None)?;
        let mut own = Self::default();
        for k in 0..=rule.cycles {
            let at = problem.section(k);
            engine.run(at, &mut passages)?;
            let x = &engine.state().x[..2 * n];
            passages.measure(x);
            own.energy = own.energy.max(model.energy(&model.point(at, &x[..n], &x[n..])));
            section.take(x, rule);
            own.cycles = k;
            if task.is_cancelled() {
                return Ok(None);
            }
            if section.period.is_some() {
                break;
            }
        }
        own.period = section.period;
        own.steps_per_cycle = engine.counters().steps as f64 / own.cycles as f64;
        own.sizes = [0, 1].map(|i| truth.sizes[i].max(passages.sizes[i]));
        own.parts = parts(&model, &passages.found, &truth.closed, problem.period, rule.cycles);
        own.sections = Some(section.sections);
        Ok(Some(own))
    }

    /// Runs a fixed-step contender over the same cycles and judges it. `None` once cancelled.
    ///
    /// # Panics
    /// If the contender has no fixed step.
    pub(super) fn judge(
        &self,
        (problem, truth): (&Problem<'_>, &Truth),
        contender: &Contender,
        per_cycle: u64,
        rule: &LongRunRule,
        task: Task<'_>,
    ) -> Option<Cell> {
        let SolverKind::Fixed(method) = contender.kind else { panic!("{} has no fixed step", contender.name) };
        let model = Penalty::new(problem.structure(), contender.ramp);
        let grid = Grid {
            from: problem.start.at,
            step: problem.period / per_cycle as f64,
            steps: per_cycle * rule.cycles.max(truth.window.cycles),
        };
        let watcher = Watcher {
            model: &model,
            rule,
            per_cycle,
            bounds: self.sizes.map(|size| Outcome::BLOWN * size),
            window: truth.window.cycles,
            section: MotionSections::new(problem),
            energy: Vec::new(),
            blown: false,
            task,
        };
        let mut watch = (watcher, Crossings::new(&model, contender.interpolation));
        let diverged = model.drive(method, &grid, problem.coordinates(), &mut watch).is_err();
        if task.is_cancelled() {
            return None;
        }
        let (run, mut found) = (watch.0, watch.1.found);
        found.sort_by(|a, b| a.t.total_cmp(&b.t));
        let (_, missed, spurious) =
            pairs(&truth.passages, &found, problem.period, truth.window.cycles as f64 * problem.period);
        let period = run.section.period;
        let mut judged = Cell {
            steps_per_cycle: per_cycle,
            outcome: Outcome::Right,
            missed,
            spurious,
            period,
            distance: None,
            cycles: (run.energy.len() as u64).saturating_sub(1),
        };
        let half = &run.energy[run.energy.len() / 2..];
        let mean = half.iter().sum::<f64>() / half.len() as f64;
        judged.outcome = if diverged || run.blown {
            Outcome::BlowUp
        } else if period.is_none() && mean > MADE * self.energy {
            Outcome::Growth
        } else if missed > spurious {
            Outcome::Missed
        } else if spurious > missed {
            Outcome::Spurious
        } else if missed > 0 {
            Outcome::Displaced
        } else {
            judged.distance = self.distance(&run.section);
            let parts = || parts(&model, &found, &truth.closed, problem.period, rule.cycles);
            let same = match (self.period, period) {
                (Some(own), Some(other)) if own != other => false,
                (Some(_), _) => judged.distance.is_some_and(|distance| distance <= rule.apart),
                (None, Some(_)) => false,
                (None, None) => self.agrees(&parts(), rule),
            };
            if same { Outcome::Right } else { Outcome::Attractor }
        };
        Some(judged)
    }

    /// Returns the distance of the sections of another motion from the orbit of this one, if it has one.
    fn distance(&self, other: &MotionSections) -> Option<f64> {
        let own = self.sections.as_ref()?;
        let orbit: Vec<&[f64]> = own.last(self.period? as usize).collect();
        let theirs: Vec<&[f64]> = other.sections.last(other.period.map_or(LONGEST, |p| p as usize)).collect();
        let farthest = |shift: usize| {
            let distance = |(i, x): (usize, &&[f64])| own.distance(x, orbit[(i + shift) % orbit.len()]);
            theirs.iter().enumerate().map(distance).fold(0.0, f64::max)
        };
        (0..orbit.len()).map(farthest).reduce(f64::min)
    }

    /// Returns whether the statistics of another irregular motion agree with those of this one.
    fn agrees(&self, other: &[[f64; PARTS as usize]], rule: &LongRunRule) -> bool {
        let mean = |parts: &[f64; PARTS as usize]| parts.iter().sum::<f64>() / PARTS as f64;
        // Squared error of the mean of the parts.
        let error = |parts: &[f64; PARTS as usize]| {
            let mean = mean(parts);
            parts.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (PARTS * (PARTS - 1)) as f64
        };
        self.parts.iter().zip(other).all(|(own, other)| {
            let allowed = (rule.statistics * mean(own)).max(ERRORS * (error(own) + error(other)).sqrt());
            (mean(own) - mean(other)).abs() <= allowed
        })
    }
}

/// Returns, for each contact and each part of the second half of `cycles`, the share of time apart; for a rigid one, impacts per cycle.
fn parts(model: &Penalty, found: &[Crossing], closed: &[bool], period: f64, cycles: u64) -> Vec<[f64; PARTS as usize]> {
    let end = |part: u64| period * 0.5 * cycles as f64 * (1.0 + part as f64 / PARTS as f64);
    let rigid = model.rigid();
    let apart: Vec<Vec<f64>> = (0..=PARTS).map(|part| time_apart(found, closed, &rigid, end(part))).collect();
    let of = |j: usize, part: u64| {
        let (from, to) = (end(part), end(part + 1));
        if rigid[j] {
            let strikes = found.iter().filter(|c| c.contact == j && c.closing && c.t > from && c.t <= to).count();
            return strikes as f64 * period / (to - from);
        }
        (apart[part as usize + 1][j] - apart[part as usize][j]) / (to - from)
    };
    (0..model.contacts()).map(|j| std::array::from_fn(|part| of(j, part as u64))).collect()
}

/// Observer of a fixed-step run: records its sections, and stops a motion that leaves the bounds.
struct Watcher<'a> {
    model: &'a Penalty,
    rule: &'a LongRunRule,
    per_cycle: u64,
    bounds: [f64; 2],
    window: u64,
    section: MotionSections,
    energy: Vec<f64>,
    blown: bool,
    task: Task<'a>,
}

impl SampleObserver for Watcher<'_> {
    fn sample(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        let point = sample.point;
        let beyond = |x: &[f64], bound: f64| x.iter().any(|x| x.abs() > bound);
        if beyond(&point.q, self.bounds[0]) || beyond(&point.v, self.bounds[1]) {
            self.blown = true;
            return ControlFlow::Break(());
        }
        let Some(number) = sample.number.filter(|number| number.is_multiple_of(self.per_cycle)) else {
            return ControlFlow::Continue(());
        };
        self.energy.push(self.model.energy(point));
        let x: Vec<f64> = point.q.iter().chain(&point.v).copied().collect();
        if self.section.period.is_none() {
            self.section.take(&x, self.rule);
        }
        // The window may be longer than the transient.
        let over = self.section.period.is_some() && number / self.per_cycle >= self.window;
        if over || self.task.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
