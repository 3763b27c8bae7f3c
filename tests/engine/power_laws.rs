//! Power laws: every exponent, mixed and weak touches, the bound on a step's error, derivatives in time.

use std::ops::ControlFlow;

use flank::{
    engine::{Engine, Observer, Options, State},
    event::EventRecord,
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, PowerLaw, Ratio, Release, damped_restitution},
    },
    hybrid::{ContactMode, GuardSet, HybridSystem, Instant, Jet, JetRequest, Mode, Watch},
    integrate::{Arc, Choice, Integrator, Tableau, Taylor, build},
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure, equilibrium, guard_id, set_contact},
};
use nalgebra::DMatrix;

/// Numbers without rhyme, the same in every run.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    fn decades(&mut self, a: f64, b: f64) -> f64 {
        10f64.powf(self.between(a, b))
    }
}

const EXPONENTS: [(u32, u32); 11] =
    [(3, 2), (4, 3), (10, 9), (6, 5), (17, 16), (16, 15), (9, 7), (5, 2), (2, 1), (5, 1), (79, 16)];

fn power((p, q): (u32, u32), hysteresis: f64) -> Law {
    Law::Power(PowerLaw { exponent: Ratio { p, q }, hysteresis, speed_floor: 1e-300, initial_speed: 1.0 })
}

fn contact(name: &str, direction: Vec<f64>, stiffness: f64, law: Law) -> ContactSpec {
    ContactSpec {
        name: name.to_owned(),
        direction,
        error: vec![],
        error_offset: 0.0,
        half_backlash: 0.0,
        flanks: Flanks::Drive,
        stiffness: Stiffness::Constant(stiffness),
        law,
        gap_damping: 0.0,
        back: None,
    }
}

fn bodies(masses: &[f64], contacts: Vec<ContactSpec>) -> Spec {
    let n = masses.len();
    Spec {
        freedoms: (0..n).map(|i| format!("x{i}")).collect(),
        mass: DMatrix::from_diagonal(&masses.to_vec().into()),
        damping: DMatrix::zeros(n, n),
        stiffness: DMatrix::zeros(n, n),
        load: vec![0.0; n],
        load_harmonics: vec![],
        contacts,
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    }
}

#[derive(Default)]
struct Log(Vec<EventRecord>);

impl Observer for Log {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.0.push(record.clone());
        ControlFlow::Continue(())
    }
}

/// The records, without the start's, and the state at the end.
fn run(structure: &Structure, q: &[f64], v: &[f64], end: f64) -> (Vec<EventRecord>, Vec<f64>) {
    let start = structure.start(Instant::default(), q, v).unwrap();
    let state = State { at: Instant::default(), x: start.x, jump: start.jump };
    let mut engine = Engine::new(structure, Box::new(Taylor::default()), Options::default(), state);
    let mut log = Log::default();
    engine.run(structure.clock().instant(end), &mut log).unwrap();
    log.0.retain(|r| !r.start);
    (log.0, engine.state().x.clone())
}

/// Lanczos (g = 7).
fn gamma(x: f64) -> f64 {
    const C: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let (x, t) = (x - 1.0, x + 6.5);
    let sum = (1..9).fold(C[0], |s, i| s + C[i] / (x + i as f64));
    std::f64::consts::TAU.sqrt() * t.powf(x + 0.5) * (-t).exp() * sum
}

/// A ball strikes a power law: it leaves with the speed it came with, after the time the energy integral gives.
#[test]
fn touches_of_any_strength() {
    for (p, q) in EXPONENTS {
        let n = f64::from(p) / f64::from(q);
        for speed in [1.0, 1e-3, 1e-6, 1e-12, 1e-18] {
            let (m, k) = (0.7, 3.0e4);
            let s = Structure::new(bodies(&[m], vec![contact("wall", vec![1.0], k, power((p, q), 0.0))])).unwrap();
            let depth = ((n + 1.0) * m * speed * speed / (2.0 * k)).powf(1.0 / (n + 1.0));
            let e = 1.0 / (n + 1.0);
            let wanted = 2.0 * depth / speed * std::f64::consts::PI.sqrt() * gamma(1.0 + e) / gamma(0.5 + e);
            let (events, x) = run(&s, &[0.0], &[speed], 1.5 * wanted);
            assert_eq!(events.len(), 1, "{p}/{q} at {speed:e}");
            let t = s.clock().time(events[0].at).value();
            assert!((t / wanted - 1.0).abs() < 1e-13, "{p}/{q} at {speed:e}: {t:e} for {wanted:e}");
            assert!((x[1] / speed + 1.0).abs() < 1e-14, "{p}/{q} at {speed:e}: {:e}", x[1] / speed + 1.0);
        }
    }
}

/// Hysteresis: the exact restitution, `D (1 + e) = ln((1 + D)/(1 − e D))`, at any speed.
#[test]
fn hysteresis_of_any_strength() {
    for (i, (p, q)) in EXPONENTS.into_iter().enumerate() {
        let d = 0.1 + 0.1 * i as f64;
        let s = Structure::new(bodies(&[0.7], vec![contact("wall", vec![1.0], 3.0e4, power((p, q), d))])).unwrap();
        for speed in [1.0, 1e-12] {
            // The contact starts after a flight: the approach speed is latched there.
            let (_, x) = run(&s, &[-speed], &[speed], 1e10);
            let e = -x[1] / speed;
            let off = d * (1.0 + e) - ((1.0 + d) / (1.0 - e * d)).ln();
            assert!(off.abs() < 1e-13, "{p}/{q} at {speed:e}: e = {e}, off by {off:e}");
        }
    }
}

/// Two contacts of different roots that start at one instant, each on a body of its own: as if alone. Both on one body:
/// energy is kept.
#[test]
fn roots_mixed_at_one_instant() {
    for (a, b) in [((3, 2), (4, 3)), ((16, 15), (17, 16)), ((6, 5), (5, 1)), ((10, 9), (3, 2)), ((2, 1), (79, 16))] {
        let speed = 0.3;
        let alone = |law, k: f64| {
            let s = Structure::new(bodies(&[0.7], vec![contact("wall", vec![1.0], k, power(law, 0.2))])).unwrap();
            let (events, x) = run(&s, &[0.0], &[speed], 10.0);
            (s.clock().time(events[0].at).value(), x[1])
        };
        let contacts =
            vec![contact("a", vec![1.0, 0.0], 3e4, power(a, 0.2)), contact("b", vec![0.0, 1.0], 1e3, power(b, 0.2))];
        let s = Structure::new(bodies(&[0.7, 0.7], contacts)).unwrap();
        let (events, x) = run(&s, &[0.0, 0.0], &[speed, speed], 10.0);
        let mut wanted = [alone(a, 3e4), alone(b, 1e3)];
        for (x, (_, v)) in x[2..4].iter().zip(&wanted) {
            assert!((x / v - 1.0).abs() < 1e-13, "{a:?} {b:?}: {x} for {v}");
        }
        wanted.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(events.len(), 2);
        for (event, (t, _)) in events.iter().zip(wanted) {
            assert!((s.clock().time(event.at).value() / t - 1.0).abs() < 1e-13, "{a:?} {b:?}");
        }
        let both = vec![contact("a", vec![1.0], 3e4, power(a, 0.0)), contact("b", vec![1.0], 1e3, power(b, 0.0))];
        let (events, x) = run(&Structure::new(bodies(&[0.7], both)).unwrap(), &[0.0], &[speed], 10.0);
        assert_eq!(events.len(), 1, "both let go at one instant");
        assert!((x[1] / speed + 1.0).abs() < 1e-14, "{a:?} {b:?}: {:e}", x[1] / speed + 1.0);
    }
}

/// Two bodies that strike equal walls one after the other, `d` apart: each leaves as it does alone, and that they leave nearly together
/// costs few steps, whether the difference is rounding, is small, or is large enough to resolve.
#[test]
fn contacts_that_leave_nearly_together_cost_few_steps() {
    let (speed, stiffness, end) = (0.3, 3e4, 0.1);
    for exponent in [(3, 2), (4, 3), (17, 16)] {
        let wall = |name: &str, direction| contact(name, direction, stiffness, power(exponent, 0.2));
        let moved = |spec, q: &[f64]| {
            let s = Structure::new(spec).unwrap();
            let start = s.start(s.clock().instant(0.0), q, &vec![speed; q.len()]).unwrap();
            let state = State { at: s.clock().instant(0.0), x: start.x, jump: start.jump };
            let mut engine = Engine::new(&s, Box::new(Taylor::default()), Options::default(), state);
            engine.run(s.clock().instant(end), &mut ()).unwrap();
            (engine.counters().steps, engine.state().x.clone())
        };
        let (_, alone) = moved(bodies(&[0.7], vec![wall("a", vec![1.0])]), &[0.0]);
        for d in [0.0, 1e-18, 1e-15, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-7] {
            let walls = vec![wall("a", vec![1.0, 0.0]), wall("b", vec![0.0, 1.0])];
            let (both, x) = moved(bodies(&[0.7, 0.7], walls), &[0.0, -d]);
            // 33 and 95 are met at most; where differences are neither shared nor resolved, it is more than a hundred.
            assert!(both <= if d == 0.0 { 40 } else { 100 }, "{exponent:?}, {d:e} m apart: {both} steps");
            for (v, v_alone) in x[2..4].iter().zip([alone[1]; 2]) {
                assert!((v / v_alone - 1.0).abs() < 1e-13, "{exponent:?}, {d:e}: {v} for {v_alone}");
            }
        }
    }
}

/// Neither penetration nor speed, and a load that presses: energy is kept from the first instant on.
#[test]
fn starts_from_rest_on_the_flank() {
    for (p, q) in EXPONENTS {
        let n = f64::from(p) / f64::from(q);
        let (m, k, f) = (0.7, 3e4, 20.0);
        let mut spec = bodies(&[m], vec![contact("wall", vec![1.0], k, power((p, q), 0.0))]);
        spec.load = vec![f];
        let s = Structure::new(spec).unwrap();
        let deepest = (f * (n + 1.0) / k).powf(1.0 / n);
        let (events, x) = run(&s, &[0.0], &[0.0], 0.3 * (2.0 * m * deepest / f).sqrt());
        assert_eq!(events.len(), 0, "{p}/{q}");
        let balance = 0.5 * m * x[1] * x[1] + k * x[0].powf(n + 1.0) / (n + 1.0) - f * x[0];
        assert!(x[0] > 0.0 && balance.abs() < 1e-14 * f * x[0], "{p}/{q}: {balance:e}");
    }
}

/// A train with power laws, a linear contact, loads and errors, in a mode with all of them closed.
fn random_train(random: &mut Random) -> (Structure, Mode, Vec<f64>) {
    let n = 1 + (random.unit() * 3.0) as usize;
    let masses: Vec<f64> = (0..n).map(|_| random.decades(-1.0, 1.0)).collect();
    let mut contacts = Vec::new();
    let mut mode = Mode::default();
    let count = 1 + (random.unit() * 3.0) as usize;
    for j in 0..count {
        let direction: Vec<f64> = (0..n).map(|_| random.between(-1.0, 1.0)).collect();
        let exponent = EXPONENTS[(random.unit() * EXPONENTS.len() as f64) as usize];
        let law = if j > 0 && random.unit() < 0.3 {
            Law::KelvinVoigt(Linear { damping: random.between(0.0, 0.5) }, Release::Force)
        } else {
            power(exponent, if random.unit() < 0.5 { 0.0 } else { random.between(0.1, 1.0) })
        };
        let mut c = contact(&format!("c{j}"), direction, random.decades(-1.0, 1.0), law);
        c.error = vec![Harmonic { omega: 1.3, amplitude: random.between(0.0, 0.1), phase: random.between(0.0, 6.0) }];
        contacts.push(c);
        set_contact(&mut mode, j, ContactMode::Drive);
    }
    let mut spec = bodies(&masses, contacts);
    spec.load_harmonics =
        vec![LoadHarmonic { vector: (0..n).map(|_| random.between(-1.0, 1.0)).collect(), omega: 1.3, phase: 0.4 }];
    for i in 0..n {
        spec.stiffness[(i, i)] = random.between(0.0, 2.0);
        spec.damping[(i, i)] = random.between(0.0, 0.2);
    }
    spec.omega = Some(1.3);
    let s = Structure::new(spec).unwrap();
    let mut x: Vec<f64> = (0..2 * n).map(|_| random.between(-1.0, 1.0)).collect();
    x.resize(HybridSystem::dim(&s), 0.7);
    (s, mode, x)
}

/// The error of a step, made large by a loose tolerance and seen against many short steps, and what the step says of it:
/// deflection and rate of every contact at the step's end.
#[test]
fn the_defect_bounds_the_error() {
    let mut random = Random(3);
    let mut ratios = Vec::new();
    for _ in 0..3000 {
        let (s, mode, mut x) = random_train(&mut random);
        let at = s.clock().instant(random.between(0.0, 4.0));
        // One contact starts here or is so deep, the others are pressed.
        let n = s.freedoms();
        let (d, _) = s.deflection(0, at, &x);
        let g = s.contacts()[0].spec.direction.clone();
        let depth = if random.unit() < 0.3 { 0.0 } else { random.decades(-6.0, 0.0) };
        let square: f64 = g.iter().map(|g| g * g).sum();
        x.iter_mut().zip(&g).for_each(|(x, g)| *x += g * (depth - d) / square);
        let rate = s.deflection(0, at, &x).1;
        if depth == 0.0 && rate < 0.0 {
            x[n..2 * n].iter_mut().for_each(|v| *v = -*v);
        }
        if s.deflection(0, at, &x).1 < 0.0 && depth == 0.0
            || (1..s.contacts().len()).any(|j| s.deflection(j, at, &x).0 <= 0.02)
        {
            continue;
        }
        let mut pinned = GuardSet::default();
        if depth == 0.0 {
            pinned.insert(guard_id(0, Watch::DriveFlank));
        }
        let tolerance = random.decades(-9.0, -4.0);
        let request = JetRequest {
            at,
            x: &x,
            low: &[],
            carried: &[],
            pinned: &pinned,
            still: GuardSet::none(),
            span: random.decades(-2.0, 1.0),
            tolerance,
            left_out: [0.0; 2],
        };
        let mut jet = Jet::default();
        let motion = s.motion(&mode).unwrap();
        motion.jet(&request, &mut jet);
        assert!(jet.reach > 0.0);
        let elapsed = jet.time_at(1.0);
        // Not beyond the end of the contact.
        if elapsed <= 0.0 || (0..=64).any(|i| jet.rate_at(f64::from(i) / 64.0) < 0.0) {
            continue;
        }
        let mut y = vec![0.0; x.len()];
        jet.state_at(1.0, &mut y);
        let mut truth = vec![0.0; x.len()];
        let end = s.clock().advance(at, elapsed);
        let arc = Arc {
            mode: &mode,
            motion: Some(&*motion),
            at,
            x: &x,
            low: &[],
            carried: &[],
            pinned: &pinned,
            still: GuardSet::none(),
            bound: end,
            tolerance: flank::hybrid::FULL_PRECISION,
            before: flank::integrate::EarlierSteps::default(),
        };

        let outcome = Taylor::default().integrate_arc(&s, &arc, &mut truth, &mut [], &mut |step| {
            let leaves = (0..step.guards().len()).any(|i| step.guard(i).iter().sum::<f64>() <= 0.0);
            if leaves { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        outcome.unwrap();
        if truth.iter().all(|x| *x == 0.0) {
            continue; // Some contact ends: nothing is claimed beyond.
        }
        for (i, guard) in jet.guards.iter().enumerate() {
            let j = usize::from(guard.0) / 3;
            let Some((_, bound)) = jet.guard_in_time(i, 1.0) else { continue };
            let error = (s.deflection(j, end, &y).0 - s.deflection(j, end, &truth).0).abs();
            assert!(
                error <= bound,
                "{:?}: {error:e} above {bound:e}, tolerance {tolerance:e}",
                s.contacts()[j].spec.law
            );
            if error > 1e-13 {
                ratios.push(bound / error);
            }
        }
    }
    assert!(ratios.len() > 500, "{}", ratios.len());
    ratios.sort_by(f64::total_cmp);
    let at = |p: f64| ratios[(p * (ratios.len() - 1) as f64) as usize];
    assert!(at(0.5) < 1e3);
}

/// The order conditions of Radau IIA: quadrature to degree 16, stages to degree 8; the weights are positive.
#[test]
fn radau_by_its_order_conditions() {
    let t = Tableau::default();
    let s = t.nodes.len();
    for k in 1..=2 * s - 1 {
        let sum: f64 = (0..s).map(|j| t.weights[(s - 1, j)] * t.nodes[j].powi(k as i32 - 1)).sum();
        assert!((sum * k as f64 - 1.0).abs() < 4e-15, "B({k}): {:e}", sum * k as f64 - 1.0);
    }
    for k in 1..=s {
        for i in 0..s {
            let sum: f64 = (0..s).map(|j| t.weights[(i, j)] * t.nodes[j].powi(k as i32 - 1)).sum();
            let wanted = t.nodes[i].powi(k as i32) / k as f64;
            assert!((sum - wanted).abs() < 1e-15, "C({k}) at {i}: {:e}", sum - wanted);
        }
    }
    assert!((0..s).all(|j| t.weights[(s - 1, j)] > 0.0));
}

/// A mass pressed on a power law by a load that varies slowly.
fn pressed(exponent: (u32, u32), hysteresis: f64, ratio: f64, swing: f64, off: f64) -> (Structure, Vec<f64>) {
    let (m, f, n) = (0.3, 500.0, f64::from(exponent.0) / f64::from(exponent.1));
    // λ² = n F/(p m), with K from p.
    let omega = 1.0;
    let p = n * f / (m * (ratio * omega) * (ratio * omega));
    let mut law = power(exponent, hysteresis);
    if let Law::Power(l) = &mut law {
        l.initial_speed = 1e-3;
    }
    let mut spec = bodies(&[m], vec![contact("wall", vec![1.0], f / p.powf(n), law)]);
    spec.load = vec![f];
    spec.load_harmonics = vec![LoadHarmonic { vector: vec![swing * f], omega, phase: std::f64::consts::FRAC_PI_2 }];
    (Structure::new(spec).unwrap(), vec![p * (1.0 + off)])
}

/// Stiff power laws: the choice made in mid-arc gives what the Taylor method gives, in far fewer steps.
#[test]
fn stiff_power_laws_are_relieved() {
    let mut random = Random(11);
    let cases = [
        ((3, 2), 1e3, 0.4),
        ((3, 2), 4.5e4, 0.4),
        ((3, 2), 5e3, 1.3),
        ((10, 9), 2e3, 0.6),
        ((5, 2), 2e3, 1.2),
        ((6, 5), 3e3, 1.05),
    ];
    for (exponent, ratio, swing) in cases {
        for hysteresis in [0.0, 1.0] {
            // A free oscillation that hysteresis damps, or none to speak of.
            let off = if hysteresis == 0.0 { 0.0 } else { random.decades(-5.5, -3.6) };
            // χ = D/v₀: a damping ratio from 0.03 to 32 of the first oscillation.
            let chi = random.decades(-1.5, 1.5) * 2.0 * 0.3 * ratio / 500.0;
            let (s, q) = pressed(exponent, hysteresis * chi * 1e-3, ratio, swing, off);
            let end = if ratio > 1e4 { 0.5 } else { 5.0 };
            let run = |choice| {
                let start = s.start(Instant::default(), &q, &[0.0]).unwrap();
                let state = State { at: Instant::default(), x: start.x, jump: start.jump };
                let mut engine = Engine::new(&s, build(choice, 1e-13, &s).unwrap(), Options::default(), state);
                let mut log = Log::default();
                engine.run(s.clock().instant(end), &mut log).unwrap();
                log.0.retain(|r| !r.start);
                let times: Vec<_> = log.0.iter().map(|r| s.clock().time(r.at).value()).collect();
                (times, engine.state().x.clone(), engine.counters().steps)
            };
            let (auto, taylor) = (run(Choice::Auto), run(Choice::Taylor));
            let off_t = auto.0.iter().zip(&taylor.0).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
            let what = format!("{exponent:?}, λ/ω {ratio:e}, swing {swing}, hysteresis {hysteresis}");
            assert_eq!(auto.0.len(), taylor.0.len(), "{what}");
            assert!(off_t < 1e-13, "{what}: times off by {off_t:e}");
            // Flights and strikes amplify what is left; before them the states agree to rounding.
            let off = [(auto.1[0] - taylor.1[0]).abs(), (auto.1[1] - taylor.1[1]).abs()];
            let same = off[0] < 1e-14 * q[0] && off[1] < 1e-14 * q[0] * ratio;
            assert!(same || !auto.0.is_empty(), "{what}: {off:?}");
            assert!(
                if hysteresis == 0.0 { auto.2 == taylor.2 } else { 2 * auto.2 < taylor.2 },
                "{what}: steps {} {}",
                auto.2,
                taylor.2
            );
        }
    }
}

/// "Static" means the same for every law: with no load a contact lies on its flank, under a load it carries it.
#[test]
fn static_on_the_flank() {
    for law in [Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Force), power((3, 2), 0.0), power((5, 1), 0.3)] {
        for load in [0.0, 20.0, -20.0] {
            let mut c = contact("mesh", vec![1.0], 3e4, law);
            (c.half_backlash, c.flanks, c.error_offset) = (2e-5, Flanks::Both, 1e-6);
            let mut spec = bodies(&[0.7], vec![c]);
            spec.load = vec![load];
            let rest = equilibrium(&spec).unwrap();
            assert!((rest.forces[0] - load).abs() <= 1e-12 * load.abs() + 1e-15, "{law:?}: {:?}", rest.forces);
            let n = if let Law::Power(l) = law { l.exponent.value() } else { 1.0 };
            let wanted = 2.1e-5 + load.signum() * if load == 0.0 { 0.0 } else { (20.0f64 / 3e4).powf(1.0 / n) };
            assert!((rest.position[0] - wanted).abs() < 1e-14 * (1.0 + wanted.abs()), "{law:?} under {load}");
        }
    }
}

/// In any clock a step tells rate, acceleration and jerk in time: those of differences of the accelerations.
#[test]
fn guards_have_derivatives_in_time() {
    // A ball beside a power law that owns the clock; its gap has the derivatives of a harmonic load.
    for (p, q) in EXPONENTS.into_iter().filter(|(_, q)| *q <= 12) {
        for depth in [0.0, 1e-3] {
            let contacts = vec![
                contact("soft", vec![1.0, 0.0], 3e4, power((p, q), 0.2)),
                contact("ball", vec![0.0, 1.0], 3e4, Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Force)),
            ];
            let mut spec = bodies(&[0.7, 0.5], contacts);
            (spec.load, spec.omega) = (vec![0.0, -2.0], Some(2.0));
            spec.load_harmonics = vec![LoadHarmonic { vector: vec![0.0, 1.0], omega: 2.0, phase: -1.0 }];
            let s = Structure::new(spec).unwrap();
            let mut mode = Mode::default();
            set_contact(&mut mode, 0, ContactMode::Drive);
            let mut pinned = GuardSet::default();
            if depth == 0.0 {
                pinned.insert(guard_id(0, Watch::DriveFlank));
            }
            let x = [depth, -0.1, 0.3, 0.7, 0.4];
            let motion = s.motion(&mode).unwrap();
            let arc = Arc {
                mode: &mode,
                motion: Some(&*motion),
                at: Instant::default(),
                x: &x,
                low: &[],
                carried: &[],
                pinned: &pinned,
                still: GuardSet::none(),
                bound: s.clock().instant(1e-2),
                tolerance: flank::hybrid::FULL_PRECISION,
                before: flank::integrate::EarlierSteps::default(),
            };
            let mut found = None;
            let mut visit = |step: &dyn flank::integrate::DenseStep| {
                let ball = step.guards().iter().position(|g| *g == guard_id(1, Watch::DriveFlank)).unwrap();
                assert!(step.plain_span().is_none() || q == 1);
                found = step.guard_derivatives_in_time(ball);
                ControlFlow::Break(())
            };
            Taylor::default().integrate_arc(&s, &arc, &mut [0.0; 5], &mut [], &mut visit).unwrap();
            let wanted = [-0.7, -(-2.0 + (-1.0f64).cos()) / 0.5, 2.0 * (-1.0f64).sin() / 0.5];
            for (found, wanted) in found.unwrap().iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-11, "{p}/{q} at {depth}: {found} for {wanted}");
            }
        }
    }
}

/// The same in a column of masses with backlash, pressed on the ground and on each other, soft springs beside.
#[test]
fn stiff_columns_are_relieved() {
    let mut random = Random(5);
    let (mut relieved, mut events) = (0, 0);
    for case in 0..24 {
        let n = 2 + case % 3;
        let (omega, ratio) = (1.0, random.decades(3.2, 4.2));
        let masses: Vec<f64> = (0..n).map(|_| random.between(0.2, 0.5)).collect();
        let swing = if case % 4 == 0 { 1.04 } else { random.between(0.1, 0.8) };
        let mut contacts = Vec::new();
        let mut q = vec![0.0; n];
        for j in 0..n {
            let exponent = [(3, 2), (10, 9), (4, 3)][(random.unit() * 3.0) as usize];
            let e = f64::from(exponent.0) / f64::from(exponent.1);
            let force = 500.0 * (n - j) as f64;
            let p = e * force / (0.3 * (ratio * omega).powi(2));
            let chi = random.between(0.3, 3.0) * 0.3 * ratio / force;
            let mut law = power(exponent, chi * 1e-3);
            if let Law::Power(l) = &mut law {
                l.initial_speed = 1e-3;
            }
            let mut direction = vec![0.0; n];
            direction[j] = 1.0;
            if j > 0 {
                direction[j - 1] = -1.0;
            }
            let mut c = contact(&format!("c{j}"), direction, force / p.powf(e), law);
            c.half_backlash = 1e-5;
            q[j] = p + 1e-5 + if j > 0 { q[j - 1] } else { 0.0 };
            contacts.push(c);
        }
        let mut spec = bodies(&masses, contacts);
        spec.load = vec![500.0; n];
        spec.stiffness[(0, 0)] = 10.0;
        let load = LoadHarmonic { vector: vec![swing * 500.0; n], omega, phase: std::f64::consts::FRAC_PI_2 };
        spec.load_harmonics = vec![load];
        let s = Structure::new(spec).unwrap();
        let run = |choice| {
            let start = s.start(Instant::default(), &q, &vec![0.0; n]).unwrap();
            let state = State { at: Instant::default(), x: start.x, jump: start.jump };
            let mut engine = Engine::new(&s, build(choice, 1e-13, &s).unwrap(), Options::default(), state);
            let mut log = Log::default();
            engine.run(s.clock().instant(5.0), &mut log).unwrap();
            log.0.retain(|r| !r.start);
            log.0.truncate(12);
            let times: Vec<_> =
                log.0.iter().map(|r| (s.clock().time(r.at).value(), r.fired.clone(), r.conditioning.time)).collect();
            (times, engine.state().x.clone(), engine.counters().steps)
        };
        let (auto, taylor) = (run(Choice::Auto), run(Choice::Taylor));
        relieved += u32::from(auto.2 < taylor.2);
        events += auto.0.len();
        for (a, b) in auto.0.iter().zip(&taylor.0).take(2) {
            assert!((a.0 - b.0).abs() <= 1e-11 && a.1 == b.1, "case {case}: {a:?} {b:?}");
        }
        if auto.0.is_empty() {
            assert!(taylor.0.is_empty());
            let off = auto.1[..n].iter().zip(&taylor.1).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
            assert!(off < 1e-13 * q[0], "case {case}: {off:e}");
        }
    }
    assert!(relieved >= 20 && events > 0, "{relieved} relieved, {events} events");
}

#[test]
fn damped_impacts_return_their_closed_forms() {
    // Independent: integrated contact equations, six digits.
    for (zeta, geometric, no_tension) in [(0.05, 0.854_468, 0.858_758), (0.5, 0.163_034, 0.298_436)] {
        assert!((damped_restitution(zeta, Release::Deflection) - geometric).abs() < 1e-6);
        assert!((damped_restitution(zeta, Release::Force) - no_tension).abs() < 1e-6);
    }
    assert!((damped_restitution(1.0 + 1e-9, Release::Force) - (-2.0f64).exp()).abs() < 1e-6);
}
