use rayon::prelude::*;
use serde::Serialize;

use super::{EngineMotion, LongRunRule};
use crate::{
    accuracy::{AccuracyError, Contender, Problem, Truth, Window},
    gear::Stiffness,
    simulation::{Simulation, SimulationError},
    system::{Spec, Structure, bonded_modes, equilibrium},
    task::Task,
    train::{Quantity, TrainError},
};

/// Input of a map: quantity, factors, steps, methods and rule.
#[derive(Clone, Debug)]
pub struct MapPlan {
    /// Quantity that is multiplied by the factors.
    pub over: Quantity,
    /// Factors, rising, > 0.
    pub factors: Vec<f64>,
    /// Steps per cycle, rising, ≥ 1.
    pub steps: Vec<u64>,
    /// Fixed-step contenders.
    pub methods: Vec<Contender>,
    /// Steps in common use, with their names; run where the factor is 1.
    pub references: Vec<Reference>,
    /// Rule by which motions are compared.
    pub rule: LongRunRule,
}

/// A step in common use.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Reference {
    /// Its name, such as `1e-6 s`.
    pub name: String,
    /// Steps a cycle, rounded up.
    pub steps_per_cycle: u64,
}

/// Outcome of the comparison of a fixed-step run with the engine's motion, worst last. The outcome of a cell is the worst one whose
/// rule holds:
///
/// | outcome | rule |
/// |---|---|
/// | blow-up | a number is not finite, or a coordinate or velocity exceeds [`BLOWN`](Self::BLOWN) times the engine's largest |
/// | energy growth | the motion does not settle, and its mean energy over the second half exceeds the engine's largest by 5 % |
/// | missed | fewer passages of flanks than the truth has in its window |
/// | spurious | more passages |
/// | displaced | as many, but some of them not within 2 % of a cycle of those of the truth, or in another order |
/// | attractor | the sequence is right, and the motion in the long run is another: see [`LongRunRule`] |
/// | right | the rest |
///
/// All energies are those of the sections, the starts of cycles: kinetic energy, supports and contact springs, sharp flanks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Outcome {
    /// Right sequence, right motion in the long run.
    Right,
    /// Right sequence, other period or other attractor.
    Attractor,
    /// Right number of events, some of them out of place.
    Displaced,
    /// More events than the reference has.
    Spurious,
    /// Fewer events than the reference has.
    Missed,
    /// The energy grows.
    Growth,
    /// The motion leaves every bound.
    BlowUp,
}

impl Outcome {
    /// Multiple of the engine's largest coordinate or velocity beyond which a motion has blown up.
    pub const BLOWN: f64 = 1e3;

    /// Returns the outcome in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Right => "right sequence and motion",
            Self::Attractor => "period or attractor changed",
            Self::Displaced => "wrong sequence: events out of place",
            Self::Spurious => "wrong sequence: spurious events",
            Self::Missed => "wrong sequence: missed events",
            Self::Growth => "energy growth",
            Self::BlowUp => "blow-up",
        }
    }

    /// Returns whether the events of the window are all found, in their places, and no others.
    #[must_use]
    pub fn has_right_sequence(self) -> bool {
        matches!(self, Self::Right | Self::Attractor)
    }
}

/// One run of one method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Cell {
    /// Steps a cycle.
    pub steps_per_cycle: u64,
    /// Outcome of the comparison with the engine's motion.
    pub outcome: Outcome,
    /// Events of the reference in the window without a partner.
    pub missed: usize,
    /// Events in the window that the reference does not have.
    pub spurious: usize,
    /// Period of the orbit it settled on, cycles.
    pub period: Option<u32>,
    /// Relative distance of its sections from the engine's, where they were compared.
    pub distance: Option<f64>,
    /// Cycles run.
    pub cycles: u64,
}

/// All runs with one factor.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct FactorRow {
    /// The factor.
    pub factor: f64,
    /// Error for which the row has no cells, in words, if any.
    pub error: Option<String>,
    /// Window in which sequences are compared.
    pub window: Option<Window>,
    /// Number of events in the window.
    pub events: usize,
    /// Error of the event times of the reference, periods.
    pub truth_error: f64,
    /// The engine's motion in the long run.
    pub own: Option<EngineMotion>,
    /// Highest natural frequency ω of the train with every contact closed at its largest stiffness, rad/s; of a power law
    /// that under the largest force in the window.
    pub omega_max: Option<f64>,
    /// For each method, fewest steps per cycle with `h ω_max` within its limit; none if it has no limit.
    pub limit_steps_per_cycle: Vec<Option<f64>>,
    /// Cells of each method, from few steps to many.
    pub cells: Vec<Vec<Cell>>,
    /// Cells of each method with steps in common use; empty where the factor is not 1.
    pub references: Vec<Vec<Cell>>,
}

impl FactorRow {
    /// Returns the outcome of the engine's run against the same run, cut into other steps.
    #[must_use]
    pub fn own_outcome(&self) -> Outcome {
        // A sequence that differs has an infinite error.
        if self.truth_error.is_finite() { Outcome::Right } else { Outcome::Displaced }
    }
}

/// The map of every method over one quantity.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Map {
    /// Quantity that is multiplied.
    pub over: Quantity,
    /// Words of the methods.
    pub methods: Vec<String>,
    /// Largest `h ω` of each on an undamped oscillation; none if any is stable.
    pub limits: Vec<Option<f64>>,
    /// Length of a cycle, s.
    pub period_s: f64,
    /// Steps a cycle.
    pub steps_per_cycle: Vec<u64>,
    /// Steps in common use.
    pub references: Vec<Reference>,
    /// Rule by which motions were compared.
    pub rule: LongRunRule,
    /// Rows, one for each factor.
    pub rows: Vec<FactorRow>,
}

impl Map {
    /// Length of the cycles that a map counts in, s.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] without a period.
    pub fn cycle_length(simulation: &Simulation) -> Result<f64, SimulationError> {
        simulation.settings.period.ok_or_else(|| {
            simulation.missing("it has no cycles to compare; give it a forcing with a period, or a period of its run")
        })
    }

    /// Computes the map; `task` is advanced after every cell. `None` once it is cancelled.
    ///
    /// A factor for which the engine has no answer (no equilibrium to start from, a motion that amplifies errors within its
    /// first cycle) gets a row without cells that says why.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] without a period.
    ///
    /// # Panics
    /// If a contender has no fixed step.
    pub fn make(simulation: &Simulation, plan: &MapPlan, task: Task<'_>) -> Result<Option<Self>, SimulationError> {
        let period_s = Self::cycle_length(simulation)?;
        let row = |factor: &f64| {
            let mut row = FactorRow { factor: *factor, ..FactorRow::default() };
            match fill(&mut row, simulation, period_s, plan, task) {
                Ok(complete) => complete.then_some(row),
                Err(error) => {
                    Some(FactorRow { factor: *factor, error: Some(error.to_string()), ..FactorRow::default() })
                }
            }
        };
        let rows: Option<Vec<FactorRow>> = plan.factors.par_iter().map(row).collect();
        Ok(rows.map(|rows| Self {
            over: plan.over,
            methods: plan.methods.iter().map(|method| method.name.clone()).collect(),
            limits: plan.methods.iter().map(Contender::stability_limit).collect(),
            period_s,
            steps_per_cycle: plan.steps.clone(),
            references: plan.references.clone(),
            rule: plan.rule,
            rows,
        }))
    }

    /// Returns the fewest steps per cycle on the map from which on the outcomes of `method` all satisfy `holds`; none if that of the
    /// most steps does not.
    #[must_use]
    pub fn fewest(&self, method: usize, row: &FactorRow, holds: impl Fn(Outcome) -> bool) -> Option<u64> {
        let cells = row.cells.get(method)?;
        cells.iter().rev().take_while(|cell| holds(cell.outcome)).last().map(|cell| cell.steps_per_cycle)
    }
}

/// Fills a row; false once cancelled.
fn fill(
    row: &mut FactorRow,
    simulation: &Simulation,
    period: f64,
    plan: &MapPlan,
    task: Task<'_>,
) -> Result<bool, AccuracyError> {
    let rule = &plan.rule;
    let mut changed = simulation.clone();
    let spec = simulation.structure.spec().scaled(plan.over, row.factor);
    if simulation.is_static {
        (changed.q0, changed.v0) =
            (equilibrium(&spec).map_err(TrainError::from)?.position, vec![0.0; spec.freedoms.len()]);
    }
    changed.structure = Structure::new(spec)?;
    let problem = Problem::new(&changed, Some(rule.window.min(rule.cycles)))?;
    let truth = Truth::quick(&problem, rule.growth)?;
    let Some(own) = EngineMotion::find(&problem, &truth, rule, task)? else { return Ok(false) };
    row.window = Some(truth.window);
    row.events = truth.passages.len();
    row.truth_error = truth.error;
    row.omega_max = highest_frequency(problem.structure().spec(), &truth.peak);
    let steps = |limit: f64| row.omega_max.map(|omega| omega * period / limit);
    row.limit_steps_per_cycle = plan.methods.iter().map(|method| method.stability_limit().and_then(steps)).collect();
    let references: Vec<u64> = plan.references.iter().map(|reference| reference.steps_per_cycle).collect();
    for method in &plan.methods {
        let cell = |steps: &u64| {
            let judged = own.judge((&problem, &truth), method, *steps, rule, task)?;
            task.advance();
            Some(judged)
        };
        let Some(cells) = plan.steps.iter().map(cell).collect() else { return Ok(false) };
        row.cells.push(cells);
        // OK to compare: 1 is put among the factors as such.
        let used: &[u64] = if row.factor == 1.0 { &references } else { &[] };
        let Some(cells) = used.iter().map(cell).collect() else { return Ok(false) };
        row.references.push(cells);
    }
    row.own = Some(own);
    Ok(true)
}

/// Highest natural frequency with every contact closed at its largest stiffness, rad/s; of a power law the tangent under the
/// force given, of a rigid contact none. A step h of a method that is stable for `h ω ≤ limit` must stay below
/// `limit/ω_max`. `None` if the structure has no natural modes.
pub(in crate::accuracy) fn highest_frequency(spec: &Spec, forces: &[f64]) -> Option<f64> {
    let mut closed = spec.clone();
    for (contact, force) in closed.contacts.iter_mut().zip(forces) {
        let k = contact.stiffness.maximum();
        contact.stiffness = Stiffness::Constant(contact.law.slope(k, *force));
    }
    bonded_modes(&closed).ok()?.omega.last().copied()
}
