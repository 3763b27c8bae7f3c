//! Each cause of a wrong event that was found once, with a scene of its own and an answer from elsewhere.

use flank::{
    engine::{Engine, EngineError, Options, State},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, PowerLaw, Ratio, Release},
    },
    hybrid::{
        Clock, ContactMode, GuardId, GuardSet, HybridSystem, Instant, Jet, JetField, JetRequest, Jump, Mode,
        ModelError, VectorField,
    },
    integrate::Taylor,
    scene::Scene,
    system::{ContactSpec, Flanks, Spec, Structure, contact_mode},
    train::{WalledOscillator, Walls},
};
use nalgebra::DMatrix;

use super::support::{Course, Moving, Run, masses, modes, rigid, run, run_from, state, walled};

fn power(p: u32, q: u32) -> Law {
    Law::Power(PowerLaw { exponent: Ratio { p, q }, hysteresis: 0.0, speed_floor: 1e-9, initial_speed: 1.0 })
}

/// A free body between flanks at ±1 that move as `e = amplitude sin t`.
fn between(law: Law, amplitude: f64) -> Structure {
    walled(&WalledOscillator {
        motion: vec![Harmonic::sine(1.0, amplitude, 0.0)],
        ..WalledOscillator::new(1.0, Walls::Between { half_gap: 1.0 }, law, Stiffness::Constant(100.0))
    })
}

#[test]
fn an_error_at_phase_0_inside_the_gap_touches_nothing() {
    let linear = Law::KelvinVoigt(Linear { damping: 0.1 }, Release::Force);
    for law in [rigid(0.5), linear, power(3, 2), power(5, 4), power(6, 5)] {
        let run = run(&between(law, 0.9), &[0.0], &[0.0], 50.0);
        assert!(run.records.is_empty(), "{law:?}: {:?}", run.times());
    }
}

#[test]
fn the_first_contact_with_an_error_at_phase_0_is_where_it_reaches_the_gap() {
    // The body stands still, and the flank at −1 + 1.25 sin t comes to it.
    let exact = 0.8f64.asin();
    for law in [rigid(0.5), Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection), power(3, 2), power(10, 9)] {
        let run = run(&between(law, 1.25), &[0.0], &[0.0], 1.0);
        // The slope there is 0.75, and the value is known to a few units.
        assert!((run.times()[0] - exact).abs() <= 8.0 * f64::EPSILON, "{law:?}: {:?}", run.times());
    }
}

/// Pressed onto a stop by `1.2 + cos t + 0.3 cos(5t + 2)`, restitution 0.
fn pressed() -> Structure {
    let wave = |omega, amplitude, phase| Harmonic { omega, amplitude, phase };
    walled(&WalledOscillator {
        load: 1.2,
        load_harmonics: vec![wave(1.0, 1.0, 0.0), wave(5.0, 0.3, 2.0)],
        ..WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, rigid(0.0), Stiffness::Constant(0.0))
    })
}

#[test]
fn a_contact_at_rest_lets_go_where_its_force_first_falls_through_zero() {
    let force = |t: f64| 1.2 + t.cos() + 0.3 * (5.0 * t + 2.0).cos();
    // The first sign change on a fine grid, by bisection.
    let mut low = (1..).map(|i| f64::from(i) * 1e-4).find(|t| force(*t) < 0.0).unwrap() - 1e-4;
    let mut high = low + 1e-4;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if force(middle) > 0.0 { low = middle } else { high = middle }
    }
    let run = run(&pressed(), &[0.0], &[0.0], 6.0);
    let events = run.events();
    assert_eq!(modes(&events, 0)[0], ContactMode::Separated);
    assert!((run.times()[0] - low).abs() <= 1e-14, "{:?} {low}", run.times());
    // A wall is struck and left alone, without rest: one record, no second impact within rounding.
    for pair in run.times().windows(2) {
        assert!(pair[1] - pair[0] > 1e-6, "{:?}", run.times());
    }
}

#[test]
fn a_strike_without_restitution_and_without_pressure_is_one_impact() {
    // Thrown against a stop and pulled back: struck at the root of t − t²/4 = ½, and at once on its way back.
    let s = walled(&WalledOscillator {
        load: -0.5,
        ..WalledOscillator::new(1.0, Walls::Above { position: 0.5 }, rigid(0.0), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[0.0], &[1.0], 3.0);
    assert_eq!(modes(&run.events(), 0), [ContactMode::Separated]);
    assert_eq!(run.events()[0].jumps, 1);
    assert!((run.times()[0] - (2.0 - 2f64.sqrt())).abs() <= 4.0 * f64::EPSILON);
}

#[test]
fn an_impact_elsewhere_does_not_tear_off_a_body_at_rest() {
    let directions = [vec![1.0, 0.0], vec![0.0, 1.0]];
    // Without any coupling, and coupled by a spring that keeps pressing.
    for spring in [0.0, 0.1] {
        let mut spec = masses(&[1.0, 1.0], &[1.0, 0.5], &directions, rigid(0.7)).spec().clone();
        spec.stiffness = DMatrix::from_row_slice(2, 2, &[spring, -spring, -spring, spring]);
        let s = Structure::new(spec).unwrap();
        let run = run(&s, &[0.0, -0.3], &[0.0, 0.1], 4.0);
        assert!(run.counters.events > 2, "{spring}: {}", run.counters.events);
        assert!(run.records.iter().all(|r| contact_mode(&r.to, 0) == ContactMode::Drive), "{spring}");
    }
}

#[test]
fn impacts_accumulate_beside_a_closed_power_law() {
    let mut spec = masses(&[1.0, 1.0], &[1.0, 1.0], &[vec![1.0, 0.0], vec![0.0, 1.0]], rigid(0.5)).spec().clone();
    spec.contacts[1].law = power(3, 2);
    spec.contacts[1].stiffness = Stiffness::Constant(50.0);
    let s = Structure::new(spec).unwrap();
    // From the stop with speed −u: flights of 2u eᵏ, so that the end is at 2u/(1 − e).
    let run = run(&s, &[0.0, 0.01], &[-0.5, 0.0], 3.0);
    let end = run.records.iter().find(|r| r.accumulation.is_some()).unwrap();
    assert!((run.clock.time(end.at).value() - 2.0).abs() <= 1e-12);
    assert_eq!(contact_mode(&run.state.jump.mode, 0), ContactMode::Drive);
}

#[test]
fn two_exponents_in_one_train_are_two_contacts() {
    // Uncoupled, each has the events it has alone.
    let alone = |law| {
        let s = masses(&[1.0], &[0.3], &[vec![1.0]], law);
        run(&s, &[-0.2], &[0.5], 6.0).times()
    };
    for (a, b) in [(power(3, 2), power(4, 3)), (power(10, 9), power(2, 1))] {
        let mut spec = masses(&[1.0, 1.0], &[0.3, 0.3], &[vec![1.0, 0.0], vec![0.0, 1.0]], a).spec().clone();
        spec.contacts[1].law = b;
        let both = run(&Structure::new(spec).unwrap(), &[-0.2, -0.2], &[0.5, 0.5], 6.0);
        for (j, law) in [a, b].into_iter().enumerate() {
            let of = |r: &&flank::event::EventRecord| contact_mode(&r.from, j) != contact_mode(&r.to, j);
            let times: Vec<f64> = both.records.iter().filter(of).map(|r| both.clock.time(r.at).value()).collect();
            let expected = alone(law);
            assert_eq!(times.len(), expected.len());
            for (t, e) in times.iter().zip(&expected) {
                assert!((t - e).abs() <= 1e-12, "{law:?}: {times:?} {expected:?}");
            }
        }
    }
}

#[test]
fn what_holds_at_the_start_is_one_record() {
    // Inside a flank whose force pulls: detached from the start.
    let law = Law::KelvinVoigt(Linear { damping: 0.5 }, Release::Force);
    let s = walled(&WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, Stiffness::Constant(4.0)));
    let run = run(&s, &[0.1], &[-1.5], 1.0);
    let zero: Vec<_> = run.records.iter().filter(|r| run.clock.time(r.at).value() == 0.0).collect();
    assert_eq!(zero.len(), 1);
    assert!(zero[0].start && contact_mode(&zero[0].to, 0) == ContactMode::DriveDetached);
    // Off all guards there is nothing to say.
    let free = super::support::run(&s, &[-0.1], &[0.0], 1.0);
    assert!(free.records.is_empty());
}

/// A rigid torsional stage with three planets in phase, from rest.
fn stage(restitution: f64, seed: u64) -> Structure {
    let error = 1.0e-5 + 1e-7 * seed as f64;
    let scene = format!(
        r#"{{ "flank": 1, "train": {{
            "kind": "planetary", "freedoms": "torsional", "speed_rpm": 600, "load": {{ "output_torque_nm": 2 }},
            "teeth": {{ "sun": 30, "planet": 30, "ring": 90 }}, "planets": 3,
            "sun_pressure_angle_rad": 0.35, "ring_pressure_angle_rad": 0.35,
            "phases": {{ "sun": [0, 0, 0], "ring": [0.3, 0.3, 0.3] }},
            "sun": {{ "mass_kg": 1, "rotary_mass_kg": 0.8, "radius_m": 0.04, "rotation": {{ "stiffness_n_per_m": 1e6, "damping_ratio": 0.05 }} }},
            "planet": {{ "mass_kg": 1, "rotary_mass_kg": 0.7, "radius_m": 0.04 }},
            "ring": {{ "mass_kg": 4, "rotary_mass_kg": 3, "radius_m": 0.12, "rotation": {{ "stiffness_n_per_m": 3e7, "damping_ratio": 0.05 }} }},
            "carrier": {{ "mass_kg": 5, "rotary_mass_kg": 6, "radius_m": 0.09, "rotation": {{ "stiffness_n_per_m": 9e8, "damping_ratio": 0.05 }} }},
            "sun_mesh": {{ "law": {{ "kind": "rigid", "restitution": {restitution} }}, "half_backlash_m": 2e-5,
                          "error": [{{ "order": 1, "amplitude_m": {error} }}] }},
            "ring_mesh": {{ "law": {{ "kind": "rigid", "restitution": {restitution} }}, "half_backlash_m": 2e-5,
                           "error": [{{ "order": 1, "amplitude_m": 1.1e-5 }}] }} }},
            "initial": "rest", "run": {{ "t_end_s": 0.05 }} }}"#
    );
    Structure::new(Scene::from_json(&scene, "stage").unwrap().build().unwrap().spec).unwrap()
}

fn stages() -> impl Iterator<Item = (Structure, Run)> {
    [0.0, 0.3, 0.8].into_iter().flat_map(|e| (0..4).map(move |seed| (e, seed))).map(|(e, seed)| {
        let s = stage(e, seed);
        let run = run(&s, &[0.0; 6], &[0.0; 6], 0.05);
        (s, run)
    })
}

#[test]
fn planets_in_phase_stay_equal_bit_for_bit() {
    for (_, run) in stages() {
        assert!(run.counters.events > 10);
        for r in &run.records {
            for of in [1, 7] {
                assert!(r.x_plus[of] == r.x_plus[of + 1] && r.x_plus[of] == r.x_plus[of + 2], "{r:?}");
            }
        }
    }
}

#[test]
fn strikes_do_not_add_energy() {
    use flank::hybrid::PowerBalance;
    for (s, run) in stages() {
        for r in run.events() {
            let change = s.energy_jump(&r.transition());
            let size = s.energy(&r.from, r.at, &r.x_minus);
            // Rounding of an energy: some units for each of six degrees of freedom.
            assert!(change.impact >= -64.0 * f64::EPSILON * size, "{change:?}");
        }
    }
}

#[test]
fn an_open_contact_on_a_weak_direction_costs_nothing() {
    // Two masses tied by a nearly singular mass matrix; the contact that would be stiff on the weak direction stays open.
    let contact = |direction: Vec<f64>, gap, law| ContactSpec {
        name: format!("{direction:?}"),
        direction,
        error: Vec::new(),
        error_offset: 0.0,
        half_backlash: gap,
        flanks: Flanks::Drive,
        stiffness: Stiffness::Constant(1.0),
        law,
        gap_damping: 0.0,
        back: None,
    };
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    let spec = Spec {
        freedoms: vec!["a".into(), "b".into()],
        mass: DMatrix::from_row_slice(2, 2, &[1.0, 1.0 - 1e-10, 1.0 - 1e-10, 1.0]),
        damping: DMatrix::zeros(2, 2),
        stiffness: DMatrix::zeros(2, 2),
        load: vec![0.1, 0.1],
        load_harmonics: Vec::new(),
        contacts: vec![contact(vec![1.0, 1.0], 0.5, law), contact(vec![1.0, -1.0], 1e3, law)],
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    };
    let run = run(&Structure::new(spec).unwrap(), &[0.0, 0.0], &[1.0, 1.0], 20.0);
    assert!(run.counters.events > 1, "{:?}", run.times());
    assert!(run.counters.steps < 200, "{}", run.counters.steps);
}

/// A course whose guard, where the engine asks for it, lies beside the series by `off`.
struct Liar {
    course: Course,
    off: f64,
}

impl JetField for Moving<'_, Liar> {
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet) {
        Moving(&self.0.course, self.1.clone()).jet(request, out);
        out.is_estimate = false;
    }
}

impl VectorField for Liar {
    fn eval(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]) {
        self.course.eval(mode, base, t, x, dx);
    }
    fn jac_mul(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) {
        self.course.jac_mul(mode, base, t, x, v, jv);
    }
}

impl HybridSystem for Liar {
    fn dim(&self) -> usize {
        1
    }
    fn clock(&self) -> &Clock {
        &self.course.clock
    }
    fn motion<'a>(&'a self, mode: &Mode) -> Option<Box<dyn JetField + 'a>> {
        Some(Box::new(Moving(self, mode.clone())))
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, mode: &Mode, out: &mut Vec<GuardId>) {
        self.course.guards(mode, out);
    }
    fn guard(&self, mode: &Mode, id: GuardId, at: Instant, x: &[f64]) -> f64 {
        self.course.guard(mode, id, at, x) + self.off
    }
    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        at: Instant,
        x: &mut [f64],
        low: &mut [f64],
    ) -> Result<Jump, ModelError> {
        self.course.jump(from, fired, at, x, low)
    }
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        self.course.settle(from, fired, at, x)
    }
}

#[test]
fn a_guard_that_contradicts_its_series_ends_the_run() {
    for (off, roots) in [(1e-9, vec![0.5]), (1e-9, vec![3.0]), (0.0, vec![0.5])] {
        let liar = Liar { course: Course::with_roots(-1.0, &roots), off };
        let start: State = liar.course.start();
        let mut engine = Engine::new(&liar, Box::new(Taylor::default()), Options::default(), start);
        let ended = engine.run(liar.course.clock.instant(1.0), &mut ());
        let alarm = matches!(ended, Err(EngineError::Alarm { .. }));
        assert_eq!(alarm, off > 0.0, "{ended:?}");
    }
}

#[test]
fn steps_cut_anywhere_have_the_same_events() {
    // Whole, and in 37 pieces: only the ends of steps differ.
    let s = between(rigid(0.7), 1.25);
    let whole = run(&s, &[0.0], &[0.0], 20.0);
    let mut at = state(&s, &[0.0], &[0.0]);
    let mut times = Vec::new();
    for piece in 1..=37 {
        let part = run_from(&s, at, s.clock().instant(20.0 * f64::from(piece) / 37.0));
        times.extend(part.times());
        at = part.state;
    }
    assert_eq!(times.len(), whole.times().len());
    for (a, b) in times.iter().zip(whole.times()) {
        assert!((a - b).abs() <= 1e-12, "{a} {b}");
    }
}
