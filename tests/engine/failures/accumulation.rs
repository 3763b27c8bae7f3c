//! Accumulation, sticking, cycling: C1 to C5.

use std::f64::consts::{FRAC_PI_2, PI};

use flank::{
    Task,
    analysis::{Contacts, Ledger},
    engine::{Options, Outcome},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::ContactMode::{Drive, DriveDetached, Separated},
    scene::Scene,
    study::steady::{Rule, steady},
    system::{Structure, contact_mode},
    train::{WalledOscillator, Walls},
};
use proptest::prelude::*;
use serde_json::json;

use crate::events::support::{Log, ball, engine, masses, modes, rigid, run, state, walled};

/// C1. Dropped from h = 10 m with g = 9.81 and e = 0.8: at rest after `√(2h/g) (1 + e)/(1 − e)` = 12.850588 s.
#[test]
fn c1_a_ball_dropped_from_ten_metres_is_at_rest_when_the_series_says() {
    let s = walled(&WalledOscillator {
        load: -9.81,
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.8), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[10.0], &[0.0], 1000.0);
    let exact = (20.0f64 / 9.81).sqrt() * 1.8 / 0.2;
    assert!((exact - 12.850_588).abs() < 1e-6);
    let rest = *run.times().last().unwrap();
    assert!((rest / exact - 1.0).abs() <= 1e-13, "{rest} {exact}");
    assert_eq!((&run.state.x[..], contact_mode(&run.state.jump.mode, 0)), (&[0.0, 0.0][..], Drive));
    // ln 10⁻¹⁰/ln 0.8 = 103.2 impacts, each one arc; a few more steps for the rest of 987 s.
    assert!(run.counters.events <= 106 && run.counters.steps <= 2 * 106, "{:?}", run.counters);
}

/// C1. From the floor with speed 1, e = ½: the rebound after impact k is 2⁻ᵏ, below 10⁻⁶ first at k = 20. Whoever sums
/// there has the same end, 4.
#[test]
fn c1_impacts_are_resolved_down_to_the_speed_asked_for() {
    let s = ball(0.5);
    let mut log = Log::default();
    let options = Options { chatter_speed: 1e-6, ..Options::default() };
    engine(&s, state(&s, &[0.0], &[1.0]), options).run(s.clock().instant(5.0), &mut log).unwrap();
    let last = log.records.last().unwrap();
    assert_eq!(last.accumulation.unwrap().resolved, 20);
    assert!((s.clock().time(last.at).value() - 4.0).abs() <= 16.0 * f64::EPSILON);
}

/// C1. A speed below which impacts may be summed is no leave to sum what does not shrink as the series says (PhysX issue 351, rapier issue
/// 114). Above a floor that moves by 0.05 cos 5t, with e = 0.9 and from one metre, 277 impacts in 40 digits end at the time below; the
/// rebounds near 2 m/s are far from e times the one before.
#[test]
fn c1_a_speed_below_which_impacts_may_be_summed_changes_no_end() {
    const EXACT: f64 = 8.146_592_328_645_091;
    let floor = Walls::Below { position: 0.0 };
    let motion = vec![Harmonic { omega: 5.0, amplitude: 0.05, phase: 0.0 }];
    let s = walled(&WalledOscillator {
        load: -9.81,
        motion,
        ..WalledOscillator::new(1.0, floor, rigid(0.9), Stiffness::Constant(0.0))
    });
    for chatter_speed in [0.0, 0.1, 2.0, 1e3] {
        let (mut log, options) = (Log::default(), Options { chatter_speed, ..Options::default() });
        engine(&s, state(&s, &[1.0], &[0.0]), options).run(s.clock().instant(8.2), &mut log).unwrap();
        let rest = log.records.iter().find(|r| r.accumulation.is_some()).unwrap();
        let off = (s.clock().time(rest.at).value() - EXACT).abs();
        // Each of 162 impacts resolved passes on the rounding of the one before.
        assert!(off <= 200.0 * f64::EPSILON * EXACT, "{chatter_speed}: {off:e}");
    }
}

/// C1. A sum may be seconds ahead of the motion. It stands only if nothing else happens before: two balls side by side, released from 1 and
/// from 0.7 m with e = 0.9 and 0.8, have the ends that each has alone, in the order of time.
#[test]
fn c1_a_sum_waits_for_the_events_of_other_contacts() {
    let alone = |h: f64, e: f64| (2.0 * h / 9.81).sqrt() * (1.0 + e) / (1.0 - e);
    let mut spec = masses(&[1.0; 2], &[-9.81; 2], &[vec![-1.0, 0.0], vec![0.0, -1.0]], rigid(0.9)).spec().clone();
    spec.contacts[1].law = rigid(0.8);
    let s = Structure::new(spec).unwrap();
    let (mut log, options) = (Log::default(), Options { chatter_speed: 2.0, ..Options::default() });
    engine(&s, state(&s, &[1.0, 0.7], &[0.0; 2]), options).run(s.clock().instant(20.0), &mut log).unwrap();
    assert!(log.records.windows(2).all(|pair| pair[0].at <= pair[1].at));
    let ends: Vec<f64> =
        log.records.iter().filter(|r| r.accumulation.is_some()).map(|r| s.clock().time(r.at).value()).collect();
    let [short, long] = ends[..] else { panic!("{ends:?}") };
    assert!(
        (short / alone(0.7, 0.8) - 1.0).abs() <= 1e-13 && (long / alone(1.0, 0.9) - 1.0).abs() <= 1e-13,
        "{ends:?}"
    );
    // The last one is alone: it is summed at its speed, and not at 1e-10 of it.
    assert!(log.records.last().unwrap().accumulation.unwrap().remaining > 0.1);
}

/// C1. The accumulation point is 4. A run, or a piece of stiffness, that ends there or next to it gets past it.
#[test]
fn c1_an_accumulation_point_at_the_end_of_a_run_or_of_a_stiffness_piece_is_passed() {
    for end in [4.0f64.next_down(), 4.0, 4.0f64.next_up(), 4.0 - 1e-12, 4.0 + 1e-12] {
        let s = ball(0.5);
        let first = run(&s, &[0.0], &[1.0], end);
        assert!(first.counters.steps <= 400, "{end}: {:?}", first.counters);
        let second = crate::events::support::run_from(&s, first.state, s.clock().instant(30.0));
        assert_eq!(contact_mode(&second.state.jump.mode, 0), Drive, "{end}");
        assert!(second.state.x[0].abs() + second.state.x[1].abs() <= 1e-14, "{end}: {:?}", second.state.x);

        let mut spec = s.spec().clone();
        let mut watched = spec.contacts[0].clone();
        // A force that is none, whose switch ends an arc all the same.
        (watched.name, watched.law) = ("spring".into(), Law::Bilateral(Linear { damping: 0.0 }));
        watched.stiffness = Stiffness::switched(vec![[end, 0.0]], [1e-300, 2e-300]);
        spec.contacts.push(watched);
        let s = Structure::new(spec).unwrap();
        let run = run(&s, &[0.0], &[1.0], 30.0);
        assert_eq!((contact_mode(&run.state.jump.mode, 0), run.counters.switches), (Drive, 1), "{end}");
        assert!(run.state.x[0].abs() + run.state.x[1].abs() <= 1e-14, "{end}: {:?}", run.state.x);
    }
}

/// C1. Not a demonstration only: `x″ + x = cos ωt` on a rigid floor at 0 with e = 0.8 chatters to rest again and again at
/// ω = 2.7 (every sixth period, beside a motion that never does) and, in chaos and rarely, at 2.9. At rest the floor's force is −cos ωt,
/// and it lets go at the phase 3π/2 each time.
#[test]
fn c1_a_forced_impact_oscillator_chatters_to_rest_and_lets_go_on_time() {
    let starts = [0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65].map(|start| (2.9, start));
    let mut rare = 0;
    for (omega, start) in [(2.7, 0.1)].into_iter().chain(starts) {
        let s = walled(&WalledOscillator {
            stiffness: 1.0,
            load_harmonics: vec![Harmonic { omega, amplitude: 1.0, phase: 0.0 }],
            ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.8), Stiffness::Constant(0.0))
        });
        let mut log = Log::default();
        let mut ledger = Ledger::new(&s);
        let mut engine = engine(&s, state(&s, &[start], &[0.0]), Options::default());
        engine.run(s.clock().at(500, 0.0), &mut (&mut log, &mut ledger)).unwrap();
        let rests = engine.counters().accumulations;
        let releases: Vec<f64> = log
            .records
            .iter()
            .filter(|r| contact_mode(&r.from, 0) == Drive && contact_mode(&r.to, 0) == Separated)
            .map(|r| omega * r.at.phase.value())
            .collect();
        assert!((rests > 0 || omega > 2.8) && releases.len() as u64 == rests, "{omega}: {rests} {}", releases.len());
        rare += if omega > 2.8 { rests } else { 0 };
        assert!(releases.iter().all(|phase| (phase - 1.5 * PI).abs() <= 16.0 * f64::EPSILON), "{omega}");
        assert!(ledger.balance().closure() <= 1e-12, "{omega}: {:?}", ledger.balance());
    }
    assert!(rare > 0);
}

/// C2. Under `x″ = −cos t` a ball with e = ½ and a small throw chatters to rest before π/2 and is let go exactly there,
/// where the multiplier cos t falls through zero; after that `x = cos t + t − π/2`.
#[test]
fn c2_chatter_to_rest_and_release_when_the_load_reverses() {
    let s = walled(&WalledOscillator {
        load_harmonics: vec![Harmonic { omega: 1.0, amplitude: -1.0, phase: 0.0 }],
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.5), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[0.0], &[0.2], 3.0);
    let events = run.events();
    assert_eq!(run.counters.accumulations, 1);
    let (rest, release) = (events[events.len() - 2], events[events.len() - 1]);
    assert!(rest.accumulation.is_some() && run.clock.time(rest.at).value() < 1.0);
    assert_eq!(contact_mode(&release.to, 0), Separated);
    assert!((run.clock.time(release.at).value() - FRAC_PI_2).abs() <= 2.0 * f64::EPSILON);
    assert!((run.state.x[0] - (3f64.cos() + 3.0 - FRAC_PI_2)).abs() <= 16.0 * f64::EPSILON, "{:?}", run.state.x);
}

/// C3. At rest on a flank under a load of 10⁻¹⁸: one decision, and contact for ever; the penetration is far below the
/// rounding of the position, and is not made of it. Without damping it touches zero once a turn, and does not cross.
#[test]
fn c3_the_smallest_load_on_a_flank_is_one_contact_and_not_thousands() {
    for (damping, most) in [(0.1, 1), (0.0, 40)] {
        let law = Law::KelvinVoigt(Linear { damping }, Release::Deflection);
        let s = walled(&WalledOscillator {
            load: 1e-18,
            ..WalledOscillator::new(1.0, Walls::Between { half_gap: 1.0 }, law, Stiffness::Constant(1.0))
        });
        let run = run(&s, &[1.0], &[0.0], 100.0);
        assert!(run.records.len() <= most, "damping {damping}: {} records", run.records.len());
        assert_eq!(contact_mode(&run.records[0].to, 0), Drive);
        assert!((run.state.x[0] - 1.0).abs() <= 2.0 * f64::EPSILON && run.state.x[1].abs() <= 1e-15);
    }
}

fn damped(c: f64, k: f64, load: f64, gap: f64, release: Release) -> Structure {
    let law = Law::KelvinVoigt(Linear { damping: c }, release);
    walled(&WalledOscillator {
        load,
        ..WalledOscillator::new(1.0, Walls::Above { position: gap }, law, Stiffness::Constant(k))
    })
}

/// C4. Unit mass and stiffness, ζ = 0.1, struck with speed 1: no force after `2 arccos ζ/√(1 − ζ²)` = 2.956075, 0.148816
/// inside the flank, with −0.744079; out of it 2ζ later. Two guards, two events, and none more.
#[test]
fn c4_a_damped_contact_is_released_inside_its_zone_and_leaves_it_once() {
    let run = run(&damped(0.2, 1.0, 0.0, 0.0, Release::Force), &[0.0], &[1.0], 20.0);
    assert_eq!(modes(&run.events(), 0), [DriveDetached, Separated]);
    let release = run.events()[0];
    for (found, exact) in [(run.times()[0], 2.956_075), (release.x_plus[0], 0.148_816), (release.x_plus[1], -0.744_079)]
    {
        assert!((found - exact).abs() <= 5e-7, "{found} {exact}");
    }
    assert!((run.times()[1] - run.times()[0] - 0.2).abs() <= 16.0 * f64::EPSILON);
}

/// C4. The same under a load that presses again within those 2ζ, for many damping ratios and loads: every contact that is
/// released is separated or in contact again, in turn, and the ledger closes.
#[test]
fn c4_a_load_that_presses_again_while_the_flank_is_still_entered_makes_no_endless_events() {
    for zeta in [0.1, 0.5, 1.0, 3.0, 30.0] {
        for load in [1e-9, 1e-3, 0.3, 3.0] {
            let s = damped(2.0 * zeta, 1.0, load, 0.0, Release::Force);
            let mut log = Log::default();
            let mut ledger = Ledger::new(&s);
            let mut engine = engine(&s, state(&s, &[0.0], &[1.0]), Options { max_events: 500, ..Options::default() });
            let outcome = engine.run(s.clock().instant(50.0), &mut (&mut log, &mut ledger));
            assert_eq!(outcome, Ok(Outcome::ReachedEnd), "{zeta} {load}");
            assert!(ledger.balance().closure() <= 1e-12, "{zeta} {load}: {:?}", ledger.balance());
        }
    }
}

/// C4. As stiff as anyone might write it, k = 10¹⁸ and c = 10¹⁰ (ζ = 5): released at the closed form of the overdamped
/// impact, `2 arcosh ζ/(ω √(ζ² − 1))` after it began, and in contact again when a load presses.
#[test]
fn c4_an_extremely_stiff_damped_contact_neither_dies_nor_repeats_itself() {
    for (gap, load) in
        [(0.0, 0.0), (1.0, 0.0), (1e-4, 0.0), (0.0, 1.0), (1e-4, 1.0), (1.0, 1.0), (1.0, 1e3), (1.0, 1e-6)]
    {
        let s = damped(1e10, 1e18, load, gap, Release::Force);
        let mut log = Log::default();
        let mut engine = engine(&s, state(&s, &[gap], &[1.0]), Options { max_events: 500, ..Options::default() });
        let outcome = engine.run(s.clock().instant(2e-6), &mut log);
        assert_eq!(outcome, Ok(Outcome::ReachedEnd), "gap {gap}, load {load}");
        let events: Vec<_> = log.records.iter().filter(|r| !r.start).collect();
        let release = s.clock().time(events[0].at).value();
        let exact = 2.0 * 5f64.acosh() / (1e9 * 24f64.sqrt());
        // Penetrations are some 10⁻¹⁰, and positions known to ε₀ of the gap.
        assert!(
            load > 0.0 || (release / exact - 1.0).abs() <= 1e-12 + 1e-5 * gap,
            "gap {gap}, load {load}: {release:e} {exact:e}"
        );
    }
}

/// C4. A drop of the stiffness takes the force of an overdamped contact below zero at once: it is released there, flies free
/// until `k p + c ṗ` has come back to zero from below, and never pulls. (k = 1, then 0.1; c = 46; load ½.)
#[test]
fn c4_a_contact_released_by_a_drop_of_stiffness_does_not_pull() {
    let law = Law::KelvinVoigt(Linear { damping: 46.0 }, Release::Force);
    let k = Stiffness::switched(vec![[1e-3, 0.0]], [1.0, 0.1]);
    let s =
        walled(&WalledOscillator { load: 0.5, ..WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, k) });
    let (mut log, mut contacts) = (Log::default(), Contacts::new(&s, None));
    let mut engine = engine(&s, state(&s, &[50.0], &[-1.0]), Options::default());
    engine.run(s.clock().instant(5.0), &mut (&mut log, &mut contacts)).unwrap();
    let [drop, again] = &log.records[..] else { panic!("{:?}", log.records) };
    assert!(drop.switched && contact_mode(&drop.to, 0) == DriveDetached && contact_mode(&again.to, 0) == Drive);
    let (p, v) = (drop.x_plus[0], drop.x_plus[1]);
    // 0.1 (p + v t + t²/4) + 46 (v + t/2) = 0.
    let (a, b, c) = (0.025, 0.1 * v + 23.0, 0.1 * p + 46.0 * v);
    let exact = -2.0 * c / (b + (b * b - 4.0 * a * c).sqrt());
    let flight = s.clock().between(drop.at, again.at);
    assert!((flight - exact).abs() <= 64.0 * f64::EPSILON * exact, "{flight} {exact}");
    // The sum of k p and c ṗ, some 5 each, is rounded.
    assert!(contacts.report(0).force_min.unwrap() >= -32.0 * f64::EPSILON, "{:?}", contacts.report(0).force_min);
}

/// C4. A spring without damper whose flank lies at the origin: where the force falls through zero the displacement is what
/// rounding left of larger terms, and has nothing to be compared with. It is zero because the force fell through it. Contact
/// and release take turns, over many cycles.
#[test]
fn c4_a_force_that_falls_through_zero_at_the_origin_is_let_go_once() {
    for (stiffness, omega) in [(100.0, 1.7), (1e4, 1.7), (37.0, 0.9), (1e6, 2.3)] {
        let s = walled(&WalledOscillator {
            stiffness: 1.0,
            damping: 0.1,
            load_harmonics: vec![Harmonic { omega, amplitude: 1.0, phase: 0.0 }],
            ..WalledOscillator::new(
                1.0,
                Walls::Above { position: 0.0 },
                Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Force),
                Stiffness::Constant(stiffness),
            )
        });
        let cycles = 400;
        // Far more than there can be; the budget ends what would not end.
        let options = Options { max_events: 20 * cycles as u64, ..Options::default() };
        let mut log = Log::default();
        let mut engine = engine(&s, state(&s, &[-0.5], &[1.0]), options);
        let outcome = engine.run(s.clock().at(cycles, 0.0), &mut log).unwrap();
        assert_eq!(outcome, Outcome::ReachedEnd, "{stiffness} {omega}");
        // Each of them a change of mode, in turn.
        let modes = modes(&log.records.iter().filter(|r| !r.graze).collect::<Vec<_>>(), 0);
        assert!(modes.len() > cycles as usize / 2, "{stiffness} {omega}: {}", modes.len());
        for (k, pair) in modes.chunks(2).enumerate() {
            assert!(
                pair[0] == Drive && pair.get(1).is_none_or(|m| *m == Separated),
                "{stiffness} {omega} {k}: {pair:?}"
            );
        }
    }
}

/// C4. Impacts that nobody sums (e = ½, a fraction that is never reached) come ever faster, until the clock, with its 32 digits,
/// no longer tells one from the next: then they are jumps at one instant. Once its speed is below 2e-16 of the first the ball is at rest.
#[test]
fn c4_impacts_that_time_cannot_tell_apart_are_jumps_at_one_instant() {
    let s = ball(0.5);
    let options = Options { chatter_fraction: f64::MIN_POSITIVE, ..Options::default() };
    let mut engine = engine(&s, state(&s, &[0.0], &[1.1]), options);
    let mut log = Log::default();
    engine.run(s.clock().instant(5.0), &mut log).unwrap();
    // Flights of 2.2·2⁻ᵏ up to t = 4.4.
    let last = log.records.last().unwrap();
    let t = s.clock().time(last.at).value();
    assert!((t - 4.4).abs() <= 16.0 * f64::EPSILON, "{t}");
    assert!(contact_mode(&last.to, 0).is_closed() && last.accumulation.is_none());
    // By k = 53 they are below the first double of the time, and by 106 below the second.
    assert!((53..=53 + 64 + 64).contains(&engine.counters().events), "{}", engine.counters().events);
}

/// The train of a scene, run to its end.
fn run_scene(scene: serde_json::Value, look: impl FnOnce(&Structure, &Log, flank::engine::Counters)) {
    let built = Scene::from_value(scene, "row").unwrap().build().unwrap();
    let s = Structure::new(built.spec).unwrap();
    let mut log = Log::default();
    let options = Options { max_events: 5000, ..Options::default() };
    let mut engine = engine(&s, state(&s, &built.q0, &built.v0), options);
    let outcome = engine.run(built.run.instants(s.clock())[2], &mut log).unwrap();
    assert_eq!(outcome, Outcome::ReachedEnd);
    look(&s, &log, engine.counters());
}

/// C1. Two bodies that a load presses against each other and a wall: their impacts alternate, and end at rest together. The time of the
/// rest is from a simulation in quadruple precision.
#[test]
fn c1_two_contacts_that_share_a_body_come_to_rest_together() {
    let scene = json!({"flank": 1, "train": {"kind": "matrices", "mass_kg": [2.0, 1.0], "load_n": [1.436, 1.535], "contacts": [
        {"name": "bodies", "direction": [1, -1], "half_backlash_m": 0.125, "law": {"kind": "rigid", "restitution": 0.2}, "flanks": "drive"},
        {"name": "wall", "direction": [0, 1], "half_backlash_m": 0.0, "law": {"kind": "rigid", "restitution": 0.8}, "flanks": "drive"}]},
        "initial": {"q": [0.0, 0.0], "v": [0.0, 1.29]}, "run": {"t_end_s": 6.0}});
    run_scene(scene, |s, log, counters| {
        let last = log.records.last().unwrap();
        assert!(contact_mode(&last.to, 0).is_closed() && contact_mode(&last.to, 1).is_closed());
        // Ten digits are known.
        assert!((s.clock().time(last.at).value() - 1.3546550538).abs() <= 1e-10);
        assert!(counters.events < 100, "{counters:?}");
    });
}

/// C4. Three bodies in a row, one at rest on a wall, pass a blow to and fro: more than a hundred rounds of one
/// instant, each weaker than the last by a factor of 0.8.
#[test]
fn c4_a_blow_that_is_passed_to_and_fro_dies_away() {
    let contact = |name: &str, direction: [f64; 3], amplitude: f64, phase: f64| {
        json!({"name": name, "direction": direction, "half_backlash_m": 0.5, "law": {"kind": "rigid", "restitution": 0.133},
            "error": [{"amplitude_m": amplitude, "frequency_rad_per_s": 1.0, "phase_rad": phase}]})
    };
    let scene = json!({"flank": 1, "train": {"kind": "matrices", "base_frequency_rad_per_s": 1.0, "mass_kg": [0.8585, 0.7252, 1.981],
        "contacts": [contact("wall", [1.0, 0.0, 0.0], 0.0559, FRAC_PI_2), contact("first", [-1.0, 1.0, 0.0], 0.2638, 0.0),
            contact("second", [0.0, -1.0, 1.0], 0.08471, 1.5 * PI)],
        "load_n": [0.5196, 0.0, 0.0],
        "load_harmonics": [{"frequency_rad_per_s": 1.0, "phase_rad": 1.5 * PI, "vector_n": [0.2289, 0.5886, 0.5733]}]},
        "initial": "rest", "run": {"t_end_s": 30.0}});
    run_scene(scene, |_, log, _| assert!(log.records.iter().any(|r| (100..1000).contains(&r.jumps))));
}

/// C4. A flank with e = 0 that touches without load does not carry a blow with rebound: it is struck in turn. Ball 1 strikes ball 2
/// alone, `v = (0.25, 0.75, 0)`, and ball 2 takes ball 3 along. With e = 0 everywhere both strike together.
#[test]
fn c4_a_flank_that_only_touches_is_struck_in_turn() {
    for (first, after) in [(0.5, [0.25, 0.375, 0.375]), (0.0, [1.0 / 3.0; 3])] {
        let contact = |name: &str, direction: [i32; 3], gap: f64, restitution: f64| {
            json!({"name": name, "direction": direction, "half_backlash_m": gap, "law": {"kind": "rigid", "restitution": restitution},
                "flanks": "drive"})
        };
        let row = json!({"flank": 1, "train": {"kind": "matrices", "mass_kg": [1.0, 1.0, 1.0],
            "contacts": [contact("a", [1, -1, 0], 0.125, first), contact("b", [0, 1, -1], 0.0, 0.0)]},
            "initial": {"q": [0.0, 0.0, 0.0], "v": [1.0, 0.0, 0.0]}, "run": {"t_end_s": 0.2}});
        run_scene(row, |_, log, _| {
            let last = log.records.last().unwrap();
            for (v, after) in last.x_plus[3..].iter().zip(after) {
                assert!((v - after).abs() <= 4.0 * f64::EPSILON, "{first}: {:?}", last.x_plus);
            }
        });
    }
}

/// C4. Two equal bodies with e = 0 between them fly side by side against a wall with e; a load draws the front one away from the other.
/// It is thrown back onto the other, takes `(1 − e)/2` of the speed with it to the wall again, and so on at one instant: both stay at
/// the wall. The gap between them may be zero, or be smaller than rounding, or have opened since the last blow.
#[test]
fn c4_blows_between_a_dead_and_a_lively_flank_end_in_rest() {
    for restitution in [0.9, 0.5, 0.05] {
        for (gap, load) in [(0.0, 1e-12), (1e-16, 1e-9), (0.0, 1e-3), (1e-9, 1e-3)] {
            let scene = json!({"flank": 1, "train": {"kind": "matrices", "mass_kg": [1.0, 1.0], "load_n": [0.0, load], "contacts": [
                {"name": "between", "direction": [1, -1], "half_backlash_m": 0.0, "flanks": "drive",
                    "law": {"kind": "rigid", "restitution": 0.0}},
                {"name": "wall", "direction": [0, 1], "half_backlash_m": 0.5, "flanks": "drive",
                    "law": {"kind": "rigid", "restitution": restitution}}]},
                "initial": {"q": [0.0, gap], "v": [1.0, 1.0]}, "run": {"t_end_s": 2.0}});
            run_scene(scene, |_, log, counters| {
                let last = log.records.last().unwrap();
                // A speed lost in the rounding of the first.
                assert!(
                    last.x_plus[2..].iter().all(|v| v.abs() <= 1e-15),
                    "{restitution} {gap} {load}: {:?}",
                    last.x_plus
                );
                assert!(counters.events < 100, "{counters:?}");
            });
        }
    }
}

/// C4. Three walls hold a body of two degrees of freedom in a corner. The third direction lies between the other two, so the body lets
/// go of the second wall exactly when the load `0.2 + cos t` towards it changes sign, however the walls share the load.
#[test]
fn c4_redundant_walls_let_go_when_no_sharing_of_the_load_holds() {
    let wall = |name: &str, direction: [i32; 2]| json!({"name": name, "direction": direction, "half_backlash_m": 0.0, "flanks": "drive", "law": {"kind": "rigid", "restitution": 0.3}});
    let (first, second, third) = (wall("first", [1, 0]), wall("second", [0, 1]), wall("third", [1, 2]));
    for walls in [[&first, &second, &third], [&third, &first, &second], [&second, &third, &first]] {
        let scene = json!({"flank": 1, "train": {"kind": "matrices", "base_frequency_rad_per_s": 1.0, "mass_kg": [1.0, 1.7],
            "load_n": [1.0, 0.2], "contacts": walls, "load_harmonics": [
                {"vector_n": [0.0, 1.0], "frequency_rad_per_s": 1.0}, {"vector_n": [0.9, 0.0], "frequency_rad_per_s": 3.0, "phase_rad": 0.4}]},
            "initial": "rest", "run": {"t_end_s": 6.0}});
        run_scene(scene, |s, log, _| {
            let parted =
                log.records.iter().find(|r| (0..3).any(|j| !r.start && contact_mode(&r.to, j).side() == 0.0)).unwrap();
            assert!((s.clock().time(parted.at).value() - f64::acos(-0.2)).abs() <= 1e-14);
            let still = &log.records.last().unwrap().x_plus;
            assert!(still.iter().all(|x| x.abs() <= f64::EPSILON), "{still:?}");
        });
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// C4. Contacts of any stiffness, damping, gap and load, struck or pressed, forced, with stiffness steps: no cascade
    /// without end at one instant, no thousands of events, no pull.
    #[test]
    fn c4_no_contact_released_by_force_goes_round_in_circles(
        stiffness in 0.0f64..18.0, damping in -2.0f64..1.5, gap in prop::sample::select(vec![0.0, 1e-4, 1.0]),
        load in prop::option::of(-9.0f64..6.0), speed in prop::option::of(-9.0f64..2.0),
        force in prop::option::of(-6.0f64..6.0), frequency in -3.0f64..0.5, drop in prop::option::of(-2.0f64..0.0),
    ) {
        let power = |exponent: Option<f64>| exponent.map_or(0.0, |e| 10f64.powf(e));
        let (k, zeta) = (10f64.powf(stiffness), 10f64.powf(damping));
        let omega = k.sqrt() * 10f64.powf(frequency);
        let law = Law::KelvinVoigt(Linear { damping: 2.0 * zeta * k.sqrt() }, Release::Force);
        let schedule = drop.map_or(Stiffness::Constant(k), |low| {
            Stiffness::rectangular(k, k * 10f64.powf(low), 2.0 * PI / omega, 0.4, 0.01 / omega)
        });
        let s = walled(&WalledOscillator {
            load: power(load),
            load_harmonics: vec![Harmonic { omega, amplitude: power(force), phase: 0.3 }],
            ..WalledOscillator::new(1.0, Walls::Above { position: gap }, law, schedule)
        });
        let mut engine = engine(&s, state(&s, &[gap], &[power(speed)]), Options { max_events: 4000, ..Options::default() });
        let end = s.clock().instant(20.0 * (1.0 + zeta) / k.sqrt());
        prop_assert_eq!(engine.run(end, &mut ()), Ok(Outcome::ReachedEnd));
    }
}

/// C5. Damping in the gap or not, and when a contact lets go, decide where the impacting motion ends on the way down
/// (ζ = 0.05, F_m = 0.1, F_a = 0.05): at Ω = 0.708 with damping everywhere; with damping in contact only at 0.586 if contacts
/// end at the flank, and at 0.5805 if they never pull.
#[test]
fn c5_damping_in_the_gap_decides_where_the_impacts_end() {
    for (everywhere, release, end) in [(true, "force", 0.708), (false, "deflection", 0.586), (false, "force", 0.5805)] {
        let (ground, contact) = if everywhere { (0.1, 0.0) } else { (0.0, 0.1) };
        let (mut seed, mut last) = (None, f64::INFINITY);
        for i in 0..120 {
            let omega = 0.8 - 0.002 * f64::from(i);
            let scene = json!({
                "flank": 1,
                "train": {
                    "kind": "matrices", "mass_kg": [1], "damping_n_s_per_m": [ground], "load_n": [0.1],
                    "load_harmonics": [{ "vector_n": [0.05 * omega * omega], "frequency_rad_per_s": omega }],
                    "contacts": [{
                        "direction": [1], "half_backlash_m": 1, "stiffness": 1,
                        "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": contact, "release": release }
                    }]
                },
                "initial": { "q": [0.8] }, "run": { "cycles": 1 }
            });
            let scene = Scene::from_value(scene, "pair").unwrap();
            let rule = Rule { measured_cycles: 1, irregular_cycles: 4, ..Rule::default() };
            let found = steady(&scene, seed.as_ref(), &rule, Task::default()).unwrap();
            if found.contacts[0].report.separations == 0 {
                break;
            }
            last = omega;
            seed = Some(found.end);
        }
        // The step of the sweep.
        assert!((last - end).abs() <= 0.002 + 1e-9, "{everywhere} {release}: {last}");
    }
}
