use std::ops::ControlFlow;

use crate::{
    baseline::Crossing,
    engine::{Engine, Observer, Options, State},
    event::EventRecord,
    hybrid::{Clock, ContactView, Instant, Watch},
    integrate::{Choice, IntegrateError, build},
    scene::Duration,
    simulation::{Simulation, SimulationError},
    system::Structure,
};

/// Initial value problem: a simulation over whole cycles, without the limits of its run.
#[derive(Clone, Debug)]
pub struct Problem<'s> {
    /// The train and the integrator of the engine.
    pub simulation: &'s Simulation,
    /// State at the start.
    pub start: State,
    /// Length of a cycle T, s: the unit of times and the distance of sections.
    pub period: f64,
    /// Cycles, ≥ 1.
    pub cycles: u64,
}

/// Maximum number of cycles of a problem for which no number is given.
const CYCLES: u64 = 50;

impl<'s> Problem<'s> {
    /// The simulation from its start over `cycles`; over those of its run, but not more than 50, if none are given. A run
    /// without a period is one cycle.
    ///
    /// # Errors
    /// [`SimulationError`] if the run cannot start, or if a mesh has its own back flank: fixed-step codes take one error for both flanks.
    pub fn new(simulation: &'s Simulation, cycles: Option<u64>) -> Result<Self, SimulationError> {
        if let Some(contact) = simulation.structure.spec().contacts.iter().find(|contact| contact.back.is_some()) {
            return Err(simulation.missing(format!(
                "{} has a back flank of its own, which the codes to compare with do not have; remove back_flank and thickness_error",
                contact.name
            )));
        }
        let (run, clock) = (&simulation.settings, simulation.clock());
        let [at, _, end] = simulation.instants();
        let span = clock.between(at, end);
        let period = run.period.or_else(|| clock.period().map(|t| t.value())).unwrap_or(span);
        let all = match run.duration {
            Duration::Cycles(n) => n,
            // OK to convert: whole cycles within the run.
            Duration::Until(_) => ((span / period * (1.0 + 1e-12)).floor() as u64).max(1),
        };
        let start = simulation.structure.start(at, &simulation.q0, &simulation.v0)?;
        let start = State { at, x: start.x, jump: start.jump };
        Ok(Self { simulation, start, period, cycles: cycles.unwrap_or(all.min(CYCLES)) })
    }

    pub(super) fn structure(&self) -> &'s Structure {
        &self.simulation.structure
    }

    /// Coordinates and velocities at the start, `[n]` each.
    pub(super) fn coordinates(&self) -> (&[f64], &[f64]) {
        let n = self.structure().freedoms();
        (&self.start.x[..n], &self.start.x[n..2 * n])
    }

    /// An engine at `start` at full precision, with another integrator and its tolerance if one is named.
    pub(super) fn engine(&self, start: State, other: Option<(Choice, f64)>) -> Result<Engine<'s>, IntegrateError> {
        self.engine_within(0.0, start, other)
    }

    /// Returns an engine as [`engine`](Self::engine) does, with an error of event times: see [`Options::event_tolerance`].
    pub(super) fn engine_within(
        &self,
        event_tolerance: f64,
        start: State,
        other: Option<(Choice, f64)>,
    ) -> Result<Engine<'s>, IntegrateError> {
        let run = &self.simulation.settings;
        let (choice, tolerance) = other.unwrap_or((run.method, run.tolerance));
        let integrator = build(choice, tolerance, self.structure())?;
        let options = Options { event_tolerance, period: Some(self.period), ..Options::default() };
        Ok(Engine::new(self.structure(), integrator, options, start))
    }

    /// Returns the start of cycle `k`, counted from the start of the problem; exact on a clock of the same period.
    pub(super) fn section(&self, k: u64) -> Instant {
        let clock = self.clock();
        let own = clock.period().filter(|t| (t.value() - self.period).abs() <= 1e-14 * self.period);
        match own {
            // OK to convert: comparisons run over a few cycles.
            Some(_) => Instant { cycle: self.start.at.cycle + k as i64, ..self.start.at },
            None => clock.advance(self.start.at, k as f64 * self.period),
        }
    }

    pub(super) fn clock(&self) -> &'s Clock {
        self.structure().clock()
    }
}

/// Passages of flanks, as [`baseline::Crossings`](crate::baseline::Crossings) records them; for a rigid contact, its impacts.
#[derive(Clone, Debug)]
pub(super) struct Passages<'p> {
    problem: &'p Problem<'p>,
    pub found: Vec<Crossing>,
    /// Uncertainty of the time of each passage, s.
    pub uncertainty: Vec<f64>,
    /// Largest coordinate and largest velocity at events.
    pub sizes: [f64; 2],
}

impl<'p> Passages<'p> {
    pub fn new(problem: &'p Problem<'p>) -> Self {
        Self { problem, found: Vec::new(), uncertainty: Vec::new(), sizes: [0.0; 2] }
    }

    pub fn measure(&mut self, x: &[f64]) {
        let n = self.problem.structure().freedoms();
        let most = |x: &[f64]| x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        self.sizes = [self.sizes[0].max(most(&x[..n])), self.sizes[1].max(most(&x[n..2 * n]))];
    }
}

impl Observer for Passages<'_> {
    fn wants_steps(&self, _: &crate::hybrid::Mode, _: crate::hybrid::Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.graze || record.start || record.accumulation.is_some() {
            return ControlFlow::Continue(());
        }
        self.measure(&record.x_minus);
        let structure = self.problem.structure();
        let t = structure.clock().between(self.problem.start.at, record.at);
        for (contact, watch) in record.fired.iter().map(|id| structure.watch(id)) {
            if watch == Watch::Force {
                continue;
            }
            let back = watch == Watch::BackFlank;
            let rate = ContactView::deflection(structure, contact, watch.side(), record.at, &record.x_minus).1;
            let closing = (rate > 0.0) != back;
            self.found.push(Crossing { t, contact, back, closing });
            self.uncertainty.push(record.conditioning.time);
        }
        ControlFlow::Continue(())
    }
}

/// Returns the time that each contact is between its flanks up to `end`, s, from its passages. A rigid contact, whose impacts have
/// no duration, keeps its state at the start throughout.
pub(super) fn time_apart(passages: &[Crossing], closed_at_start: &[bool], rigid: &[bool], end: f64) -> Vec<f64> {
    let mut open_since: Vec<Option<f64>> = closed_at_start.iter().map(|c| (!c).then_some(0.0)).collect();
    let mut apart = vec![0.0; closed_at_start.len()];
    for passage in passages.iter().filter(|p| p.t <= end && !rigid[p.contact]) {
        match open_since[passage.contact].take() {
            Some(since) if passage.closing => apart[passage.contact] += passage.t - since,
            // Closed twice or opened twice: a passage of the other flank in between was missed.
            _ if passage.closing => {}
            _ => open_since[passage.contact] = Some(passage.t),
        }
    }
    for (apart, since) in apart.iter_mut().zip(open_since) {
        *apart += since.map_or(0.0, |since| end - since);
    }
    apart
}
