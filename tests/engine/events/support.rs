//! Small systems with known answers, and a log.

use std::ops::ControlFlow;

use flank::{
    engine::{Counters, Engine, EngineError, Observer, Options, Outcome, State},
    event::EventRecord,
    gear::{
        Stiffness,
        contact::{Law, Linear, Release, Rigid},
    },
    hybrid::{
        Clock, ContactMode, GuardId, GuardSet, HybridSystem, Instant, Jet, JetField, JetRequest, Jump, Mode,
        ModelError, VectorField,
    },
    integrate::Taylor,
    system::{ContactSpec, Flanks, Spec, Structure, contact_mode},
    train::{WalledOscillator, Walls},
};
use nalgebra::DMatrix;

/// All records, until `stop_after` of them.
#[derive(Default)]
pub struct Log {
    pub records: Vec<EventRecord>,
    pub stop_after: Option<usize>,
}

impl Observer for Log {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.records.push(record.clone());
        if self.stop_after.is_some_and(|n| self.records.len() >= n) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}

/// What a run left behind.
pub struct Run {
    pub records: Vec<EventRecord>,
    pub state: State,
    pub counters: Counters,
    pub clock: Clock,
}

impl Run {
    /// Records of a changed mode or state: no decision at the start, no touch.
    pub fn events(&self) -> Vec<&EventRecord> {
        self.records.iter().filter(|r| !r.graze && !r.start && (r.switched || !r.fired.is_empty())).collect()
    }

    /// Their times.
    pub fn times(&self) -> Vec<f64> {
        self.events().iter().map(|r| self.clock.time(r.at).value()).collect()
    }

    pub fn time(&self, i: usize) -> f64 {
        self.clock.time(self.records[i].at).value()
    }
}

pub fn engine(system: &dyn HybridSystem, state: State, options: Options) -> Engine<'_> {
    Engine::new(system, Box::new(Taylor::default()), options, state)
}

pub fn attempt(system: &dyn HybridSystem, state: State, end: Instant) -> (Result<Outcome, EngineError>, Run) {
    let mut log = Log::default();
    let mut engine = engine(system, state, Options::default());
    let outcome = engine.run(end, &mut log);
    let run = Run {
        records: log.records,
        state: engine.state().clone(),
        counters: engine.counters(),
        clock: *system.clock(),
    };
    (outcome, run)
}

pub fn run_from(system: &dyn HybridSystem, state: State, end: Instant) -> Run {
    let (outcome, run) = attempt(system, state, end);
    assert_eq!(outcome, Ok(Outcome::ReachedEnd));
    run
}

pub fn state(s: &Structure, q: &[f64], v: &[f64]) -> State {
    let at = s.clock().instant(0.0);
    let start = s.start(at, q, v).unwrap();
    State { at, x: start.x, jump: start.jump }
}

/// From displacements `q` and velocities `v` at t = 0 to `end`, s.
pub fn run(s: &Structure, q: &[f64], v: &[f64], end: f64) -> Run {
    run_from(s, state(s, q, v), s.clock().instant(end))
}

pub fn modes(records: &[&EventRecord], j: usize) -> Vec<ContactMode> {
    records.iter().map(|r| contact_mode(&r.to, j)).collect()
}

pub fn walled(walled: &WalledOscillator) -> Structure {
    Structure::new(walled.assemble().unwrap()).unwrap()
}

/// A law without force: a flank that is only watched.
pub fn ghost() -> Law {
    Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection)
}

pub fn rigid(restitution: f64) -> Law {
    Law::Rigid(Rigid::constant(restitution))
}

/// Unit mass above a rigid floor at 0 under unit gravity.
pub fn ball(restitution: f64) -> Structure {
    walled(&WalledOscillator {
        load: -1.0,
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(restitution), Stiffness::Constant(0.0))
    })
}

/// One-flank contacts `directions` at zero gap between free masses under constant loads.
pub fn masses(masses: &[f64], load: &[f64], directions: &[Vec<f64>], law: Law) -> Structure {
    let n = masses.len();
    let contacts = directions
        .iter()
        .enumerate()
        .map(|(j, direction)| ContactSpec {
            name: format!("contact {j}"),
            direction: direction.clone(),
            error: Vec::new(),
            error_offset: 0.0,
            half_backlash: 0.0,
            flanks: Flanks::Drive,
            stiffness: Stiffness::Constant(1.0),
            law,
            gap_damping: 0.0,
            back: None,
        })
        .collect();
    Structure::new(Spec {
        freedoms: (0..n).map(|i| format!("x_{i}")).collect(),
        mass: DMatrix::from_diagonal(&masses.to_vec().into()),
        damping: DMatrix::zeros(n, n),
        stiffness: DMatrix::zeros(n, n),
        load: load.to_vec(),
        load_harmonics: Vec::new(),
        contacts,
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    })
    .unwrap()
}

/// A user's own system: one state that follows a polynomial in time, `x = Σ c_k tᵏ`.
///
/// In mode 0 the guard is `x`, in mode 1 it is `−x`; a jump goes to the other mode (or stays, in a `trap`).
pub struct Course {
    pub clock: Clock,
    pub c: Vec<f64>,
    /// Every jump leads where the guard fires again.
    pub trap: bool,
    /// A known time that no switch gets past.
    pub stop: Option<Instant>,
}

impl Course {
    pub fn new(c: &[f64]) -> Self {
        Self { clock: Clock::new(None), c: c.to_vec(), trap: false, stop: None }
    }

    /// The polynomial with these roots and this leading coefficient.
    pub fn with_roots(lead: f64, roots: &[f64]) -> Self {
        Self::new(&product(lead, roots))
    }

    pub fn start(&self) -> State {
        State { at: Instant::default(), x: vec![self.c[0]], jump: Jump::default() }
    }

    pub fn run(&self, end: f64) -> Run {
        run_from(self, self.start(), self.clock.instant(end))
    }
}

/// Coefficients of `lead Π (t − r)`.
pub fn product(lead: f64, roots: &[f64]) -> Vec<f64> {
    roots.iter().fold(vec![lead], |p, r| {
        let mut next = vec![0.0; p.len() + 1];
        for (k, c) in p.iter().enumerate() {
            next[k] -= r * c;
            next[k + 1] += c;
        }
        next
    })
}

/// A system in a mode.
pub struct Moving<'a, S>(pub &'a S, pub Mode);

impl JetField for Moving<'_, Course> {
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet) {
        let Self(course, mode) = self;
        let (n, t) = (course.c.len() - 1, request.at.phase.value());
        (out.order, out.dim, out.span, out.reach) = (n, 1, request.span, 1.0);
        out.time.clear();
        out.state.clone_from(&course.c);
        for i in 0..n {
            for k in (i..n).rev() {
                out.state[k] += t * out.state[k + 1];
            }
        }
        let mut power = 1.0;
        for c in &mut out.state {
            *c *= power;
            power *= request.span;
        }
        let sign = if mode.get(0) == 1 && !course.trap { -1.0 } else { 1.0 };
        course.guards(mode, &mut out.guards);
        out.guard_series = out.state.iter().map(|c| sign * c).collect();
        if !request.pinned.is_empty() {
            out.guard_series[0] = 0.0;
        }
        // At the far end, where the terms are largest.
        let size = course.c.iter().rev().fold(0.0, |s, c| s * (t.abs() + request.span) + c.abs());
        out.remainder = vec![0.0];
        out.rounding = vec![4.0 * f64::EPSILON * size];
    }
}

impl VectorField for Course {
    fn eval(&self, _: &Mode, base: Instant, t: f64, _: &[f64], dx: &mut [f64]) {
        dx[0] = flank::poly::eval_with_slope(&self.c, base.phase.value() + t).1;
    }
    fn jac_mul(&self, _: &Mode, _: Instant, _: f64, _: &[f64], _: &[f64], jv: &mut [f64]) {
        jv[0] = 0.0;
    }
}

impl HybridSystem for Course {
    fn dim(&self) -> usize {
        1
    }
    fn clock(&self) -> &Clock {
        &self.clock
    }
    fn motion<'a>(&'a self, mode: &Mode) -> Option<Box<dyn JetField + 'a>> {
        Some(Box::new(Moving(self, mode.clone())))
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, _: &Mode, out: &mut Vec<GuardId>) {
        out.clear();
        out.push(GuardId(0));
    }
    fn guard(&self, mode: &Mode, _: GuardId, _: Instant, x: &[f64]) -> f64 {
        if mode.get(0) == 1 && !self.trap { -x[0] } else { x[0] }
    }
    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        _: Instant,
        _: &mut [f64],
        _: &mut [f64],
    ) -> Result<Jump, ModelError> {
        Ok(Jump { mode: Mode::default().with(0, 1 - from.mode.get(0)), pinned: fired.clone(), ..Jump::default() })
    }
    fn next_switch(&self, _: &Mode, _: Instant) -> Option<Instant> {
        self.stop
    }
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        self.jump(from, fired, at, x, &mut [])
    }
}
