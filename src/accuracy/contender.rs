//! Ways to solve a problem, by name.

use std::{fmt, ops::ControlFlow};

use serde::Serialize;

use super::{AccuracyError, Problem, problem::Passages};
use crate::{
    analysis::Contacts,
    baseline::{
        Alpha, Counters, Crossing, Crossings, Grid, Interpolation, Method, Penalty, Ramp, Sample, SampleObserver,
    },
    engine::Engine,
    integrate::{Choice, IntegrateError},
    system::{ContactSpec, Structure},
};

/// Kinds of solvers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SolverKind {
    /// A fixed-step method.
    Fixed(Method),
    /// An adaptive solver without events.
    Adaptive(Choice),
    /// The engine, with one of its integrators.
    Engine(Choice),
}

/// A way to solve a problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Contender {
    /// Word that names it: see [`Contender::parse`].
    pub name: String,
    /// Solver.
    pub kind: SolverKind,
    /// Smoothing of the flanks, used by baselines alone.
    pub ramp: Ramp,
    /// Interpolation of crossings between samples, used by baselines alone.
    pub interpolation: Interpolation,
}

/// Resolution of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Setting {
    /// Steps per cycle of a fixed-step method.
    StepsPerCycle(u64),
    /// Relative tolerance.
    Tolerance(f64),
    /// Error that each arc may add to the time of an event, as a share of the cycle.
    EventTolerance(f64),
    /// Full precision, to round-off.
    RoundOff,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StepsPerCycle(n) => write!(f, "{n} steps"),
            Self::Tolerance(t) => write!(f, "tol {t:e}"),
            Self::EventTolerance(t) => write!(f, "event tol {t:e}"),
            Self::RoundOff => f.write_str("round-off"),
        }
    }
}

/// Results of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Performance {
    /// Passages of flanks.
    pub passages: Vec<Crossing>,
    /// Coordinates and velocities at the starts of cycles and at the end.
    pub sections: Vec<Vec<f64>>,
    /// Largest force of each contact, N.
    pub peak: Vec<f64>,
    /// Mechanical energy at the sections, J.
    pub energy: Vec<f64>,
    /// Work done; for the engine, the number of steps alone.
    pub work: Counters,
    /// Reason for a stop before the end, if it stopped early.
    pub stopped: Option<String>,
}

/// Event tolerances at which the engine is run, coarse to fine.
const EVENT_TOLERANCES: [f64; 4] = [1e-3, 1e-5, 1e-7, 1e-9];

const WORDS: &str = "rk4, newmark, hht[=ALPHA], generalized-alpha[=RHO], euler, verlet, tsit45, esdirk34, bdf, flank, \
                     flank-explicit, flank-sdirk, flank-bdf; after a baseline +cubic, +tanh=SIGMA, +sqrt=SIGMA, +poly=SIGMA";

impl Contender {
    /// Parses the word of a contender: a method, followed for baselines by options with `+`.
    ///
    /// | word | method |
    /// |---|---|
    /// | `rk4`, `euler`, `verlet` | Runge–Kutta, semi-implicit Euler, velocity Verlet, fixed steps |
    /// | `newmark`, `hht=0.1`, `generalized-alpha=0.8` | average acceleration; α in `[0, 1/3]`; spectral radius ρ in `[0, 1]` |
    /// | `tsit45`, `esdirk34`, `bdf` | adaptive solvers without events (feature `diffsol`) |
    /// | `flank`, `flank-explicit`, `flank-sdirk`, `flank-bdf` | the engine: as the scene says, or with another integrator |
    /// | `+tanh=σ`, `+sqrt=σ`, `+poly=σ` | the flank smoothed over 1/σ, σ in 1/m: [`Ramp`] |
    /// | `+cubic` | crossings on cubics instead of straight lines |
    ///
    /// # Errors
    /// [`AccuracyError::Word`].
    pub fn parse(word: &str) -> Result<Self, AccuracyError> {
        let fault = |problem: String| AccuracyError::Word { word: word.to_owned(), problem };
        let number = |text: &str, low: f64, high: f64| match text.parse::<f64>() {
            Ok(x) if (low..=high).contains(&x) => Ok(x),
            _ => Err(fault(format!("{text} is not a number from {low} to {high}"))),
        };
        let mut parts = word.split('+');
        let base = parts.next().unwrap_or_default();
        let (base, value) = base.split_once('=').map_or((base, None), |(b, v)| (b, Some(v)));
        let kind = match base {
            "rk4" => SolverKind::Fixed(Method::Rk4),
            "newmark" => SolverKind::Fixed(Method::Alpha(Alpha::NEWMARK)),
            "hht" => SolverKind::Fixed(Method::Alpha(Alpha::hht(number(value.unwrap_or("0.1"), 0.0, 1.0 / 3.0)?))),
            "generalized-alpha" => {
                SolverKind::Fixed(Method::Alpha(Alpha::generalised(number(value.unwrap_or("0.8"), 0.0, 1.0)?)))
            }
            "euler" => SolverKind::Fixed(Method::SemiImplicitEuler),
            "verlet" => SolverKind::Fixed(Method::Verlet),
            "tsit45" => SolverKind::Adaptive(Choice::Explicit),
            "esdirk34" => SolverKind::Adaptive(Choice::Sdirk),
            "bdf" => SolverKind::Adaptive(Choice::Bdf),
            "flank" => SolverKind::Engine(Choice::Auto),
            "flank-explicit" => SolverKind::Engine(Choice::Explicit),
            "flank-sdirk" => SolverKind::Engine(Choice::Sdirk),
            "flank-bdf" => SolverKind::Engine(Choice::Bdf),
            _ => return Err(fault(format!("known methods: {WORDS}"))),
        };
        if value.is_some() && !matches!(base, "hht" | "generalized-alpha") {
            return Err(fault(format!("{base} takes no number")));
        }
        let (mut ramp, mut interpolation) = (Ramp::Sharp, Interpolation::Linear);
        for part in parts {
            if matches!(kind, SolverKind::Engine(_)) {
                return Err(fault(
                    "the engine's flanks are sharp and its events exact: nothing can be added".to_owned(),
                ));
            }
            let sigma = |text: &str| {
                let sigma = text.parse().ok().filter(|sigma: &f64| *sigma > 0.0 && sigma.is_finite());
                sigma.ok_or_else(|| fault(format!("the sharpness {text} is not a number above 0, in 1/m")))
            };
            match part.split_once('=') {
                None if part == "cubic" => interpolation = Interpolation::Cubic,
                Some(("tanh", s)) => ramp = Ramp::Tanh(sigma(s)?),
                Some(("sqrt", s)) => ramp = Ramp::SquareRoot(sigma(s)?),
                Some(("poly", s)) => ramp = Ramp::Polynomial(sigma(s)?),
                _ => return Err(fault(format!("+{part} is not known; known are +cubic, +tanh=, +sqrt=, +poly="))),
            }
        }
        Ok(Self { name: word.to_owned(), kind, ramp, interpolation })
    }

    /// Returns whether it can solve a train: adaptive solvers need the feature `diffsol`, and exclude rigid contacts.
    #[must_use]
    pub fn applies_to(&self, structure: &Structure) -> bool {
        let is_rigid = |c: &ContactSpec| c.law.is_rigid();
        match self.kind {
            SolverKind::Adaptive(_) => cfg!(feature = "diffsol") && !structure.spec().contacts.iter().any(is_rigid),
            SolverKind::Engine(Choice::Explicit | Choice::Sdirk | Choice::Bdf) => cfg!(feature = "diffsol"),
            _ => true,
        }
    }

    /// Returns the largest `h ω` at which a fixed-step method is stable: see [`Method::stability_limit`].
    pub(super) fn stability_limit(&self) -> Option<f64> {
        if let SolverKind::Fixed(method) = self.kind { method.stability_limit() } else { None }
    }

    /// Settings from coarse to fine, with at most `most` steps over `cycles`.
    pub(super) fn settings(&self, cycles: u64, most: u64) -> Vec<Setting> {
        match self.kind {
            // Numbers of steps that no stiffness step of a round duty falls on.
            SolverKind::Fixed(_) => (0..36)
                .map(|i| [47, 101, 223][i % 3] * 10u64.pow((i / 3) as u32))
                .map(|n| if n > 1000 { n + 1 } else { n })
                .take_while(|n| n.saturating_mul(cycles) <= most)
                .map(Setting::StepsPerCycle)
                .collect(),
            SolverKind::Engine(Choice::Auto | Choice::Taylor) => {
                EVENT_TOLERANCES.map(Setting::EventTolerance).into_iter().chain([Setting::RoundOff]).collect()
            }
            SolverKind::Adaptive(_) | SolverKind::Engine(_) => {
                (1..=6).map(|i| Setting::Tolerance(10f64.powi(-2 * i))).collect()
            }
        }
    }

    /// Solves `problem` over `cycles` and records everything that is scored.
    ///
    /// # Errors
    /// [`AccuracyError`] if the engine fails; a baseline that breaks down says so in its [`Performance`].
    pub fn perform(&self, problem: &Problem<'_>, cycles: u64, setting: Setting) -> Result<Performance, AccuracyError> {
        if let SolverKind::Engine(choice) = self.kind {
            return engine(problem, cycles, choice, setting);
        }
        let model = Penalty::new(problem.structure(), self.ramp);
        let mut crossings = Crossings::new(&model, self.interpolation);
        let (per_cycle, peak) = (self.per_cycle(setting), vec![0.0; model.contacts()]);
        let mut record = Record { model: &model, per_cycle, sections: Vec::new(), energy: Vec::new(), peak };
        let done = self.drive(&model, problem, cycles, setting, &mut (&mut crossings, &mut record));
        let (work, stopped) = done.map_or_else(|(work, why)| (work, Some(why)), |work| (work, None));
        let Record { sections, peak, energy, .. } = record;
        let mut passages = crossings.found;
        passages.sort_by(|a, b| a.t.total_cmp(&b.t));
        Ok(Performance { passages, sections, peak, energy, work, stopped })
    }

    /// Solves `problem` over `cycles`, records events alone, as a user would, and returns their number. Costs are timed on this function.
    ///
    /// # Errors
    /// As [`perform`](Self::perform).
    pub fn solve(&self, problem: &Problem<'_>, cycles: u64, setting: Setting) -> Result<usize, AccuracyError> {
        if let SolverKind::Engine(choice) = self.kind {
            let mut passages = Passages::new(problem);
            let mut engine = within(problem, choice, setting)?;
            engine.run(problem.section(cycles), &mut passages)?;
            return Ok(passages.found.len());
        }
        let model = Penalty::new(problem.structure(), self.ramp);
        let mut crossings = Crossings::new(&model, self.interpolation);
        // A run that breaks down counts with the crossings found until then.
        let _ = self.drive(&model, problem, cycles, setting, &mut crossings);
        Ok(crossings.found.len())
    }

    /// Returns the grid points per cycle. An adaptive solver has one, the start of the cycle, and is also sampled at its own steps.
    fn per_cycle(&self, setting: Setting) -> u64 {
        if let Setting::StepsPerCycle(n) = setting { n } else { 1 }
    }

    fn drive(
        &self,
        model: &Penalty,
        problem: &Problem<'_>,
        cycles: u64,
        setting: Setting,
        watch: &mut impl SampleObserver,
    ) -> Result<Counters, (Counters, String)> {
        let per_cycle = self.per_cycle(setting);
        let step = problem.period / per_cycle as f64;
        let grid = Grid { from: problem.start.at, step, steps: per_cycle * cycles };
        let start = problem.coordinates();
        match (self.kind, setting) {
            (SolverKind::Fixed(method), _) => {
                model.drive(method, &grid, start, watch).map_err(|diverged| (diverged.counters, diverged.to_string()))
            }
            (SolverKind::Adaptive(solver), Setting::Tolerance(rtol)) => model
                .adaptive(solver, rtol, &grid, start, watch)
                .map_err(|error| (Counters::default(), error.to_string())),
            _ => Err((Counters::default(), "an adaptive solver needs a tolerance".to_owned())),
        }
    }
}

/// Returns the engine with a setting.
fn within<'s>(problem: &Problem<'s>, choice: Choice, setting: Setting) -> Result<Engine<'s>, IntegrateError> {
    let (event_tolerance, other) = match setting {
        Setting::Tolerance(tolerance) => (0.0, Some((choice, tolerance))),
        Setting::EventTolerance(tolerance) => (tolerance, None),
        _ => (0.0, None),
    };
    problem.engine_within(event_tolerance, problem.start.clone(), other)
}

fn engine(problem: &Problem<'_>, cycles: u64, choice: Choice, setting: Setting) -> Result<Performance, AccuracyError> {
    let n = problem.structure().freedoms();
    let model = Penalty::new(problem.structure(), Ramp::Sharp);
    let mut watch = (Passages::new(problem), Contacts::new(problem.structure(), None).keep(0));
    let mut engine = within(problem, choice, setting)?;
    let mut run = Performance::default();
    for k in 0..=cycles {
        let at = problem.section(k);
        // The first section is the start itself.
        if k > 0
            && let Err(error) = engine.run(at, &mut watch)
        {
            run.stopped = Some(error.to_string());
            break;
        }
        let x = &engine.state().x;
        run.energy.push(model.energy(&model.point(at, &x[..n], &x[n..2 * n])));
        run.sections.push(x[..2 * n].to_vec());
    }
    run.peak = (0..model.contacts()).map(|j| watch.1.report(j).force_abs_max).collect();
    run.passages = watch.0.found;
    run.work.steps = engine.counters().steps;
    Ok(run)
}

/// Sections and largest forces of a baseline.
struct Record<'m> {
    model: &'m Penalty,
    per_cycle: u64,
    sections: Vec<Vec<f64>>,
    energy: Vec<f64>,
    peak: Vec<f64>,
}

impl SampleObserver for Record<'_> {
    fn sample(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        for (peak, touch) in self.peak.iter_mut().zip(&sample.point.contacts) {
            *peak = peak.max(touch.force.abs());
        }
        if sample.number.is_some_and(|number| number.is_multiple_of(self.per_cycle)) {
            self.sections.push(sample.point.q.iter().chain(&sample.point.v).copied().collect());
            self.energy.push(self.model.energy(sample.point));
        }
        ControlFlow::Continue(())
    }
}
