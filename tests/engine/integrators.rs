//! One suite for every integrator: events, dense steps, convergence, stiffness.

use std::ops::ControlFlow;

use flank::{
    engine::{Counters, Engine, Observer, Options, Outcome, State},
    event::EventRecord,
    hybrid::{Clock, GuardId, GuardSet, HybridSystem, Instant, Jump, Mode, ModelError, Rates, VectorField},
    integrate::{Choice, DenseStep, IntegrateError, Integrator, build, reason},
    system::Structure,
    train::KahramanSingh,
};

/// A run's events, and its dense steps checked as they come.
struct Watch<'s> {
    system: &'s dyn HybridSystem,
    events: Vec<(Instant, GuardSet, Mode)>,
    /// Where the last step was left, and the state there, until an event changes it.
    last: Option<(Instant, Vec<f64>)>,
    seed: u64,
    /// Largest difference of a guard's polynomial from the guard, over what the step owns to.
    worst: f64,
}

impl<'s> Watch<'s> {
    fn new(system: &'s dyn HybridSystem) -> Self {
        Self { system, events: Vec::new(), last: None, seed: 1, worst: 0.0 }
    }

    fn times(&self) -> Vec<f64> {
        self.events.iter().map(|e| self.system.clock().time(e.0).value()).collect()
    }

    fn sequence(&self) -> Vec<(GuardSet, Mode)> {
        self.events.iter().map(|e| (e.1.clone(), e.2.clone())).collect()
    }

    /// Leaves of each chatter only its end: how many of its last, tiny impacts are resolved is rounding.
    fn without_chatter(&mut self) {
        let times = self.times();
        let moment = 1.6e-4 * self.system.clock().period().map_or(1.0, |t| t.value());
        let mut i = 0;
        self.events.retain(|_| {
            i += 1;
            i == times.len() || times[i] - times[i - 1] > moment
        });
    }

    fn random(&mut self) -> f64 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl Observer for Watch<'_> {
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let clock = *self.system.clock();
        let mut x = vec![0.0; self.system.dim()];
        step.state(0.0, &mut x);
        if let Some((at, y)) = &self.last {
            let gap = clock.between(*at, step.start());
            let late = clock.time(step.start()).value().abs() + step.time(1.0);
            assert!(gap.abs() <= 4.0 * f64::EPSILON * late, "steps join in time: {gap:e}");
            let mut across = vec![0.0; x.len()];
            step.state(1.0, &mut across);
            let scale: f64 = x.iter().chain(&across).fold(0.0, |m, v| v.abs().max(m));
            for (a, b) in x.iter().zip(y) {
                assert!((a - b).abs() <= 1e-13 * (a.abs() + b.abs() + scale), "steps join in state: {a} {b}");
            }
        }
        let mut before = 0.0;
        let mut thetas: Vec<f64> = (0..4).map(|_| self.random() * until).collect();
        thetas.sort_by(f64::total_cmp);
        for theta in thetas {
            let t = step.time(theta);
            assert!(t >= before, "time is monotone");
            before = t;
            step.state(theta, &mut x);
            let at = clock.advance(step.start(), t);
            if step.plain_span().is_none() {
                continue; // A guard of a root clock is a root itself.
            }
            for (i, guard) in step.guards().iter().enumerate() {
                let value = flank::poly::eval(step.guard(i), theta);
                let wanted = self.system.guard(mode, *guard, at, &x);
                let (tail, rounding) = step.guard_error(i);
                let own = tail + rounding + 64.0 * f64::EPSILON * (wanted.abs() + 1.0);
                self.worst = self.worst.max((value - wanted).abs() / own);
            }
        }
        step.state(until, &mut x);
        self.last = Some((clock.advance(step.start(), step.time(until)), x));
        ControlFlow::Continue(())
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if let Some((at, x)) = self.last.take() {
            // The end of the last step is the state the event begins with.
            if record.accumulation.is_none() && !record.graze && !record.start {
                assert!(self.system.clock().between(at, record.at).abs() <= 1e-12, "the arc ends at the event");
                let scale: f64 = x.iter().map(|v| v.abs()).fold(1e-3, f64::max);
                assert!(x.iter().zip(&record.x_minus).all(|(a, b)| (a - b).abs() <= 1e-12 * scale));
            }
        }
        if !record.fired.is_empty() && !record.start && !record.graze {
            self.events.push((record.at, record.fired.clone(), record.to.clone()));
        }
        ControlFlow::Continue(())
    }
}

/// Every integrator of this build that needs no series.
fn solvers() -> Vec<Choice> {
    if cfg!(feature = "diffsol") { vec![Choice::Bdf, Choice::Sdirk, Choice::Explicit] } else { vec![] }
}

fn run<'s>(
    system: &'s dyn HybridSystem,
    integrator: Box<dyn Integrator>,
    state: State,
    end: f64,
) -> (Watch<'s>, State, Counters) {
    let mut watch = Watch::new(system);
    let mut engine = Engine::new(system, integrator, Options::default(), state);
    let outcome = engine.run(system.clock().instant(end), &mut watch).unwrap();
    assert_eq!(outcome, Outcome::ReachedEnd);
    (watch, engine.state().clone(), engine.counters())
}

/// What the error of an event time may be: a method of order p that holds its error *per step* to rtol has a global
/// error of rtol^(p/(p+1)); the factor holds the growth of errors through the events of these runs.
fn allowed(choice: Choice, rtol: f64, growth: f64) -> f64 {
    growth * rtol.powf(if choice == Choice::Explicit { 5.0 / 6.0 } else { 3.0 / 4.0 })
}

fn with(choice: Choice, rtol: f64, system: &dyn HybridSystem) -> Box<dyn Integrator> {
    build(choice, rtol, system).unwrap()
}

/// A user's own system: a ball on a floor in a viscous medium, `ḧ = −g − c ḣ`, restitution e; state `(h, ḣ)`.
struct Ball {
    clock: Clock,
    gravity: f64,
    drag: f64,
    restitution: f64,
}

const FLOOR: GuardId = GuardId(0);

impl Ball {
    fn new(restitution: f64) -> Self {
        Self { clock: Clock::new(None), gravity: 9.81, drag: 0.3, restitution }
    }

    fn state(h: f64, v: f64) -> State {
        State { at: Instant::default(), x: vec![h, v], jump: Jump::default() }
    }

    /// Height and speed after `t`, in closed form.
    fn fly(&self, h: f64, v: f64, t: f64) -> (f64, f64) {
        let (terminal, decay) = (self.gravity / self.drag, (-self.drag * t).exp());
        let gained = -(-self.drag * t).exp_m1() / self.drag;
        (h + (v + terminal) * gained - terminal * t, (v + terminal) * decay - terminal)
    }

    /// Times of the first `n` impacts.
    fn impacts(&self, mut h: f64, mut v: f64, n: usize) -> Vec<f64> {
        let mut t = 0.0;
        (0..n)
            .map(|_| {
                // From the top on the height falls and is concave: Newton's method from beyond converges.
                let mut s = (v + (v * v + 2.0 * self.gravity * h).sqrt()) / self.gravity * 1.5;
                for _ in 0..60 {
                    let (height, speed) = self.fly(h, v, s);
                    s -= height / speed;
                }
                t += s;
                (h, v) = (0.0, -self.restitution * self.fly(h, v, s).1);
                t
            })
            .collect()
    }
}

impl VectorField for Ball {
    fn eval(&self, _: &Mode, _: Instant, _: f64, x: &[f64], dx: &mut [f64]) {
        dx[0] = x[1];
        dx[1] = -self.gravity - self.drag * x[1];
    }
    fn jac_mul(&self, _: &Mode, _: Instant, _: f64, _: &[f64], v: &[f64], jv: &mut [f64]) {
        jv[0] = v[1];
        jv[1] = -self.drag * v[1];
    }
}

impl HybridSystem for Ball {
    fn dim(&self) -> usize {
        2
    }
    fn clock(&self) -> &Clock {
        &self.clock
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, _: &Mode, out: &mut Vec<GuardId>) {
        out.clear();
        out.push(FLOOR);
    }
    fn guard(&self, _: &Mode, _: GuardId, _: Instant, x: &[f64]) -> f64 {
        x[0]
    }
    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        _: Instant,
        x: &mut [f64],
        _: &mut [f64],
    ) -> Result<Jump, ModelError> {
        let projected = x[0].abs();
        (x[0], x[1]) = (0.0, -self.restitution * x[1]);
        Ok(Jump { mode: from.mode.clone(), pinned: fired.clone(), projected, ..Jump::default() })
    }
    fn restitution(&self, _: GuardId) -> Option<f64> {
        Some(self.restitution)
    }
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        self.jump(from, fired, at, x, &mut [])
    }
}

fn error(found: &[f64], exact: &[f64]) -> f64 {
    assert!(found.len() >= exact.len(), "{} events of {}", found.len(), exact.len());
    found.iter().zip(exact).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

#[test]
fn a_users_own_ball_bounces_in_time() {
    let ball = Ball::new(0.8);
    let exact = ball.impacts(1.0, 0.5, 13);
    let (end, exact) = (0.5 * (exact[11] + exact[12]), &exact[..12]);
    for choice in solvers() {
        for rtol in [1e-4, 1e-6, 1e-8, 1e-10] {
            let (watch, _, counters) = run(&ball, with(choice, rtol, &ball), Ball::state(1.0, 0.5), end);
            let off = error(&watch.times(), exact);
            println!("{choice} {rtol:e}: {off:.1e} s, {} steps", counters.steps);
            assert!(off <= allowed(choice, rtol, 2.0), "{choice} {rtol:e}: {off:e}");
            assert!(watch.worst <= 1.0, "{choice}: guard polynomial {}", watch.worst);
            assert_eq!(watch.events.len(), 12);
        }
    }
}

#[test]
fn the_length_of_the_run_does_not_matter() {
    let ball = Ball::new(0.8);
    let exact = ball.impacts(1.0, 0.5, 12);
    for choice in solvers() {
        let mut watch = Watch::new(&ball);
        let options = Options { max_events: 12, ..Options::default() };
        let mut engine = Engine::new(&ball, with(choice, 1e-8, &ball), options, Ball::state(1.0, 0.5));
        assert_eq!(engine.run(ball.clock.instant(1e6), &mut watch), Ok(Outcome::EventBudgetSpent));
        let off = error(&watch.times(), &exact[..watch.events.len()]);
        println!("{choice}, a million seconds allowed: {off:.1e} s, {} steps", engine.counters().steps);
        assert!(watch.events.len() >= 11 && off <= allowed(choice, 1e-8, 2.0), "{choice}: {off:e}");
    }
}

fn gear() -> KahramanSingh {
    KahramanSingh::new(0.05, 0.1, 0.2, 0.7)
}

fn start(s: &Structure, q: &[f64], v: &[f64]) -> State {
    let at = s.clock().instant(0.0);
    let start = s.start(at, q, v).unwrap();
    State { at, x: start.x, jump: start.jump }
}

fn compare(name: &str, s: &Structure, from: &State, end: f64, rtols: &[f64], growth: f64) {
    let (mut taylor, _, steps) = run(s, with(Choice::Taylor, 0.0, s), from.clone(), end);
    taylor.without_chatter();
    assert!(taylor.worst <= 1.0, "{name}: taylor's guard polynomial {}", taylor.worst);
    println!("{name} taylor: {} events, {} steps", taylor.events.len(), steps.steps);
    assert!(taylor.events.len() >= 4, "{name}");
    for choice in solvers() {
        for &rtol in rtols {
            let (mut watch, _, counters) = run(s, with(choice, rtol, s), from.clone(), end);
            watch.without_chatter();
            assert_eq!(watch.sequence(), taylor.sequence(), "{name} {choice} {rtol:e}");
            let off = error(&watch.times(), &taylor.times());
            println!("{name} {choice} {rtol:e}: {off:.1e}, {} steps, worst {:.2}", counters.steps, watch.worst);
            assert!(off <= allowed(choice, rtol, growth), "{name} {choice} {rtol:e}: {off:e}");
            assert!(watch.worst <= 1.0, "{name} {choice}: guard polynomial {}", watch.worst);
        }
    }
}

mod gears {
    use super::*;
    use flank::{
        gear::{
            Harmonic, Piece, Stiffness,
            contact::{Law, Linear, PowerLaw, Ratio, Release, Rigid},
        },
        train::{WalledOscillator, Walls},
    };

    const RTOLS: [f64; 3] = [1e-6, 1e-8, 1e-10];

    fn pair(stiffness: Option<Stiffness>) -> Structure {
        let mut spec = gear().assemble().unwrap();
        if let Some(k) = stiffness {
            spec.contacts[0].stiffness = k;
        }
        Structure::new(spec).unwrap()
    }

    #[test]
    fn a_gear_pair_with_backlash_agrees() {
        let s = pair(None);
        compare("pair", &s, &start(&s, &[0.2], &[0.5]), 60.0, &RTOLS, 50.0);
    }

    #[test]
    fn stiffness_may_vary_smoothly() {
        let s = pair(Some(Stiffness::Harmonic {
            mean: 1.0,
            harmonics: vec![Harmonic { omega: 0.7, amplitude: 0.3, phase: 0.4 }],
        }));
        compare("harmonic stiffness", &s, &start(&s, &[0.2], &[0.5]), 60.0, &RTOLS, 50.0);
    }

    #[test]
    fn stiffness_may_jump_and_ramp() {
        let t = std::f64::consts::TAU / 0.7;
        let s = pair(Some(Stiffness::rectangular(1.3, 0.8, t, 0.4, 0.3)));
        compare("rectangular stiffness", &s, &start(&s, &[0.2], &[0.5]), 60.0, &RTOLS, 50.0);
        let ramp = 0.5 / (0.1 * t);
        let pieces = vec![
            Piece { start: 0.0, value: 0.8, slope: ramp },
            Piece { start: 0.1, value: 1.3, slope: 0.0 },
            Piece { start: 0.5, value: 1.3, slope: -ramp },
            Piece { start: 0.6, value: 0.8, slope: 0.0 },
        ];
        let s = pair(Some(Stiffness::Periodic { period: t, origin: 0.3, pieces }));
        compare("trapezoidal stiffness", &s, &start(&s, &[0.2], &[0.5]), 60.0, &RTOLS, 200.0);
    }

    #[test]
    fn release_by_force_agrees() {
        let mut spec = gear().assemble().unwrap();
        spec.damping[(0, 0)] = 0.02;
        spec.contacts[0].law = Law::KelvinVoigt(Linear { damping: 0.1 }, Release::Force);
        let s = Structure::new(spec).unwrap();
        compare("release by force", &s, &start(&s, &[0.2], &[0.5]), 60.0, &RTOLS, 50.0);
    }

    #[test]
    fn hertz_contacts_with_hysteresis_agree() {
        let law = Law::Power(PowerLaw {
            exponent: Ratio { p: 3, q: 2 },
            hysteresis: 0.3,
            speed_floor: 1e-9,
            initial_speed: 1e-2,
        });
        let walled = WalledOscillator {
            damping: 0.02,
            load: 0.1,
            load_harmonics: vec![Harmonic { omega: 0.9, amplitude: 0.4, phase: 0.0 }],
            ..WalledOscillator::new(1.0, Walls::Between { half_gap: 1.0 }, law, Stiffness::Constant(5.0))
        };
        let s = Structure::new(walled.assemble().unwrap()).unwrap();
        compare("hertz", &s, &start(&s, &[0.0], &[0.3]), 40.0, &RTOLS, 50.0);
    }

    #[test]
    fn rigid_impacts_come_to_rest_and_let_go() {
        let law = Law::Rigid(Rigid::constant(0.4));
        let walled = WalledOscillator {
            load: -1.0,
            motion: vec![Harmonic { omega: 1.0, amplitude: 1.6, phase: 0.0 }],
            ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, law, Stiffness::Constant(0.0))
        };
        let s = Structure::new(walled.assemble().unwrap()).unwrap();
        compare("rigid", &s, &start(&s, &[1.8], &[0.0]), 20.0, &RTOLS, 50.0);
    }

    /// Six freedoms in SI units: micrometres, radians per second by the ten thousand, newtons by the hundred.
    #[test]
    fn real_gears_in_real_units_agree() {
        use flank::{
            gear::{MeshHarmonic, MeshStiffness},
            system::Flanks,
            train::{Body, GearPair, Mesh, Support, mesh_damping},
        };
        let body = Body { translation: Support::ratio(5e8, 0.05), ..Body::new(1.0, 2.0e-3, 0.05) };
        let damping = mesh_damping(2e8, 0.06, [body.rotary_mass, body.rotary_mass]);
        let mut mesh = Mesh::new(
            Law::KelvinVoigt(Linear { damping }, Release::Deflection),
            MeshStiffness::Harmonics {
                mean: 2e8,
                harmonics: vec![MeshHarmonic { order: 1.0, amplitude: 0.2, phase: 0.3 }],
            },
        );
        mesh.half_backlash = 40e-6;
        mesh.flanks = Flanks::Both;
        mesh.error = vec![MeshHarmonic { order: 1.0, amplitude: 8e-6, phase: 0.0 }];
        let pair = GearPair {
            driving_teeth: 30,
            driving: body,
            driven: body,
            pressure_angle: 20.0f64.to_radians(),
            base_helix: 0.0,
            mesh,
            rpm: 6000.0,
            torque: 3.0,
        };
        let s = Structure::new(pair.translational().unwrap()).unwrap();
        let period = s.clock().period().unwrap().value();
        let q: Vec<f64> = s.contacts()[0].spec.direction.iter().map(|g| 20e-6 * g).collect();
        let from = start(&s, &q, &[0.0; 6]);
        compare("real gears", &s, &from, 12.0 * period, &RTOLS, 50.0 * period);
    }

    /// An overdamped contact under a slow load: decay at 10⁵ 1/s, motion at 10 1/s.
    #[cfg(feature = "diffsol")]
    fn overdamped() -> Structure {
        let law = Law::KelvinVoigt(Linear { damping: 1e5 }, Release::Deflection);
        let walled = WalledOscillator {
            load: 10.0,
            load_harmonics: vec![Harmonic { omega: 10.0, amplitude: 8.0, phase: 0.0 }],
            ..WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, Stiffness::Constant(1e6))
        };
        Structure::new(walled.assemble().unwrap()).unwrap()
    }

    #[test]
    #[cfg(feature = "diffsol")]
    fn backward_differences_step_over_a_stiff_contact() {
        let s = overdamped();
        let from = start(&s, &[1e-5], &[0.0]);
        let end = 0.6;
        let steps = |choice| {
            let (_, state, counters) = run(&s, with(choice, 1e-5, &s), from.clone(), end);
            println!("overdamped {choice}: {} steps, q = {:e}", counters.steps, state.x[0]);
            (counters.steps, state.x[0])
        };
        let (explicit, q) = steps(Choice::Explicit);
        let (bdf, q_bdf) = steps(Choice::Bdf);
        let (sdirk, q_sdirk) = steps(Choice::Sdirk);
        let (_, q_taylor) = steps(Choice::Taylor);
        assert!(50 * bdf < explicit && 50 * sdirk < explicit, "{bdf} {sdirk} {explicit}");
        for q in [q, q_bdf, q_sdirk] {
            assert!((q - q_taylor).abs() <= 1e-3 * q_taylor.abs(), "{q} {q_taylor}");
        }
    }

    #[test]
    #[cfg(feature = "diffsol")]
    fn auto_gives_stiff_modes_to_backward_differences_and_says_so() {
        let s = overdamped();
        let integrator = build(Choice::Auto, 1e-5, &s).unwrap();
        let reason = reason(Choice::Auto, 1e-5, &s);
        assert!(reason.starts_with("auto: taylor"), "{reason}");
        // Thrown up from the contact, and back into it.
        let mut engine = Engine::new(&s, integrator, Options::default(), start(&s, &[-1e-3], &[-0.1]));
        engine.run(s.clock().instant(0.5), &mut ()).unwrap();
        let chosen = engine.integrator().chosen();
        println!("{chosen:?}");
        assert_eq!(chosen.iter().map(|c| c.1).collect::<Vec<_>>(), ["taylor", "bdf"]);
        let s = pair(None);
        let mut engine = Engine::new(&s, with(Choice::Auto, 1e-6, &s), Options::default(), start(&s, &[0.2], &[0.5]));
        engine.run(s.clock().instant(60.0), &mut ()).unwrap();
        assert!(engine.integrator().chosen().iter().all(|c| c.1 == "taylor"));
    }
}

#[test]
fn event_times_converge_with_the_tolerance() {
    // Forced, with contacts: nothing is a polynomial. (The ball's free flight nearly is: its errors are bounded above.)
    let s = Structure::new(gear().assemble().unwrap()).unwrap();
    let from = start(&s, &[0.2], &[0.5]);
    let (taylor, ..) = run(&s, with(Choice::Taylor, 0.0, &s), from.clone(), 30.0);
    for choice in solvers() {
        let off = |rtol| error(&run(&s, with(choice, rtol, &s), from.clone(), 30.0).0.times(), &taylor.times());
        let (rough, fine) = (off(1e-4), off(1e-10));
        let order = (rough / fine).log10() / 6.0;
        println!("{choice}: {rough:.1e} at 1e-4, {fine:.1e} at 1e-10: error ~ rtol^{order:.2}");
        assert!(order >= 0.7, "{choice}: rtol^{order:.2}");
    }
}

/// `q̈ = 2`, a guard `depth`-deep under zero around the lowest point: crossed twice within a moment.
struct Dip {
    ball: Ball,
    depth: f64,
}

impl VectorField for Dip {
    fn eval(&self, _: &Mode, _: Instant, _: f64, x: &[f64], dx: &mut [f64]) {
        (dx[0], dx[1]) = (x[1], 2.0);
    }
    fn jac_mul(&self, _: &Mode, _: Instant, _: f64, _: &[f64], v: &[f64], jv: &mut [f64]) {
        (jv[0], jv[1]) = (v[1], 0.0);
    }
}

impl HybridSystem for Dip {
    fn dim(&self) -> usize {
        2
    }
    fn clock(&self) -> &Clock {
        &self.ball.clock
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, mode: &Mode, out: &mut Vec<GuardId>) {
        self.ball.guards(mode, out);
    }
    fn guard(&self, mode: &Mode, _: GuardId, _: Instant, x: &[f64]) -> f64 {
        if mode.get(0) == 0 { x[0] } else { -x[0] }
    }
    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        _: Instant,
        x: &mut [f64],
        _: &mut [f64],
    ) -> Result<Jump, ModelError> {
        x[0] = 0.0;
        Ok(Jump { mode: Mode::default().with(0, 1 - from.mode.get(0)), pinned: fired.clone(), ..Jump::default() })
    }
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        self.jump(from, fired, at, x, &mut [])
    }
    fn rates(&self, _: &Mode) -> Option<Rates> {
        None
    }
}

#[test]
fn two_crossings_within_one_step_are_found() {
    // q = (t − 5)² − depth: the whole flight is exact for the explicit and the implicit Runge–Kutta method.
    for choice in solvers() {
        for width in [0.89, 0.28, 0.089, 9e-4, 9e-5] {
            let depth = 0.25 * width * width;
            let dip = Dip { ball: Ball::new(0.5), depth };
            let from = State { at: Instant::default(), x: vec![25.0 - dip.depth, -10.0], jump: Jump::default() };
            let (watch, _, counters) = run(&dip, with(choice, 1e-10, &dip), from, 10.0);
            println!("{choice} {width:e}: {:?}, {} steps", watch.times(), counters.steps);
            let lost = choice == Choice::Bdf && width < 1e-3;
            if lost && watch.events.is_empty() {
                continue; // Shallower than the error the method owns to.
            }
            assert_eq!(watch.events.len(), 2, "{choice} {width:e}");
            let off = error(&watch.times(), &[5.0 - 0.5 * width, 5.0 + 0.5 * width]);
            assert!(off <= if choice == Choice::Bdf { 1e-9 } else { 1e-12 } / width, "{choice} {width:e}");
        }
    }
}

/// A field that blows up: `ẋ = x²`, and is no number beyond `x = 10⁶`.
struct Blowup(Ball);

impl VectorField for Blowup {
    fn eval(&self, _: &Mode, _: Instant, _: f64, x: &[f64], dx: &mut [f64]) {
        dx[0] = if x[0] < 1e6 { x[0] * x[0] } else { f64::NAN };
        dx[1] = 0.0;
    }
    fn jac_mul(&self, _: &Mode, _: Instant, _: f64, x: &[f64], v: &[f64], jv: &mut [f64]) {
        jv[0] = if x[0] < 1e6 { 2.0 * x[0] * v[0] } else { f64::NAN };
        jv[1] = 0.0;
    }
}

impl HybridSystem for Blowup {
    fn dim(&self) -> usize {
        2
    }
    fn clock(&self) -> &Clock {
        &self.0.clock
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, _: &Mode, out: &mut Vec<GuardId>) {
        out.clear();
    }
    fn guard(&self, _: &Mode, _: GuardId, _: Instant, _: &[f64]) -> f64 {
        1.0
    }
    fn jump(&self, from: &Jump, _: &GuardSet, _: Instant, _: &mut [f64], _: &mut [f64]) -> Result<Jump, ModelError> {
        Ok(Jump { mode: from.mode.clone(), ..Jump::default() })
    }
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        self.jump(from, fired, at, x, &mut [])
    }
}

#[test]
fn a_solution_that_ends_is_an_error_not_a_number() {
    let system = Blowup(Ball::new(0.5));
    for choice in solvers() {
        let mut engine = Engine::new(&system, with(choice, 1e-6, &system), Options::default(), Ball::state(1.0, 0.0));
        let failed = engine.run(system.clock().instant(2.0), &mut ()).err();
        println!("{choice}: {}", failed.as_ref().map_or_else(String::new, ToString::to_string));
        assert!(failed.is_some(), "{choice}");
    }
}

#[test]
fn slivers_of_arcs_and_late_times_are_as_good_as_any() {
    let s = Structure::new(gear().assemble().unwrap()).unwrap();
    let clock = *s.clock();
    for choice in solvers() {
        let mut integrator = with(choice, 1e-8, &s);
        let from = start(&s, &[0.2], &[0.5]);
        let motion = s.motion(&from.jump.mode);
        let mut end = vec![0.0; 2];
        for span in [1e-300, 1e-100, 1e-18, 1e-13, 1e-9] {
            let arc = flank::integrate::Arc {
                mode: &from.jump.mode,
                motion: motion.as_deref(),
                at: from.at,
                x: &from.x,
                low: &[],
                carried: &[],
                pinned: &GuardSet::default(),
                still: &GuardSet::default(),
                bound: clock.advance(from.at, span),
                tolerance: flank::hybrid::FULL_PRECISION,
                before: flank::integrate::EarlierSteps::default(),
            };
            let mut visits = 0;
            let done = integrator.integrate_arc(&s, &arc, &mut end, &mut [], &mut |step| {
                visits += 1;
                assert!(step.time(1.0) <= span * (1.0 + 1e-12));
                ControlFlow::Continue(())
            });
            assert_eq!(done, Ok(()), "{choice} {span:e}");
            assert!((end[0] - 0.2 - 0.5 * span).abs() <= 1e-15, "{choice} {span:e}");
            assert!(visits > 0);
        }
        // The same run a thousand million cycles later.
        let later = |cycle: i64| {
            let at = clock.at(cycle, 0.0);
            let start = s.start(at, &[0.2], &[0.5]).unwrap();
            let mut watch = Watch::new(&s);
            let state = State { at, x: start.x, jump: start.jump };
            let mut engine = Engine::new(&s, with(choice, 1e-8, &s), Options::default(), state);
            engine.run(clock.at(cycle + 3, 0.0), &mut watch).unwrap();
            watch.events.iter().map(|e| (e.0.cycle - cycle, e.0.phase.hi)).collect::<Vec<_>>()
        };
        let (now, late) = (later(0), later(1_000_000_000));
        assert!(now.len() >= 4);
        assert_eq!(now.len(), late.len());
        assert!(now.iter().zip(&late).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() <= 1e-13), "{choice}");
    }
}

#[test]
fn what_cannot_be_built_is_said() {
    let ball = Ball::new(0.8);
    assert_eq!(build(Choice::Taylor, 1e-6, &ball).err(), Some(IntegrateError::NoJet));
    let auto = build(Choice::Auto, 1e-6, &ball);
    let bdf = build(Choice::Bdf, 1e-6, &ball);
    if cfg!(feature = "diffsol") {
        assert!(auto.is_ok() && reason(Choice::Auto, 1e-6, &ball).starts_with("auto: explicit"));
        assert_eq!(bdf.unwrap().name(), "bdf");
    } else {
        assert_eq!(auto.err(), Some(IntegrateError::NotBuilt { method: "explicit" }));
        assert_eq!(bdf.err(), Some(IntegrateError::NotBuilt { method: "bdf" }));
    }
}
