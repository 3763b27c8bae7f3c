//! Which event, in what order: B1 to B8.

use std::f64::consts::PI;

use flank::{
    analysis::{EventKind, Ledger},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{
        ContactMode::{Back, Drive, Separated},
        GuardSet, HybridSystem, Jump, ModelError, Watch,
    },
    system::{AssembleError, Structure, contact_mode, guard_id, set_contact},
    train::{WalledOscillator, Walls},
};
use proptest::prelude::*;

use crate::events::support::{Run, engine, masses, modes, rigid, run, state, walled};

fn spring(damping: f64) -> Law {
    Law::KelvinVoigt(Linear { damping }, Release::Deflection)
}

/// A driven hub and three planets on springs of their own, each behind a gap of its own.
fn stage(law: Law, starts: [f64; 3]) -> Run {
    let direction =
        |p: usize| (0..4).map(|k| if k == 0 { 1.0 } else { -f64::from(u8::from(k == p)) }).collect::<Vec<_>>();
    let mut spec =
        masses(&[2.0, 1.0, 1.0, 1.0], &[0.0; 4], &[direction(1), direction(2), direction(3)], law).spec().clone();
    for i in 0..4 {
        spec.stiffness[(i, i)] = 1.0;
        spec.damping[(i, i)] = 0.4;
    }
    spec.load_harmonics =
        vec![flank::system::LoadHarmonic { vector: vec![1.0, 0.0, 0.0, 0.0], omega: 0.8, phase: 0.0 }];
    let s = Structure::new(spec).unwrap();
    run(&s, &[-1.0, starts[0], starts[1], starts[2]], &[0.3, 0.0, 0.0, 0.0], 60.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// B2. Planets a few units in the last place apart: nothing is lost and nothing doubled, and as the motion is damped
    /// the end is that of equal planets to rounding.
    #[test]
    fn b2_planets_units_in_the_last_place_apart_all_strike(ulps in prop::array::uniform3(-3i32..=3)) {
        for law in [spring(0.3), rigid(0.5)] {
            let equal = stage(law, [0.25; 3]);
            let apart = stage(law, ulps.map(|n| 0.25 * (1.0 + f64::from(n) * f64::EPSILON)));
            prop_assert_eq!(apart.counters.fired, equal.counters.fired);
            let off = apart.state.x.iter().zip(&equal.state.x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            prop_assert!(off <= 1e-11, "{:e}", off);
        }
    }
}

/// Equal balls in a row, all touching but the first (and, from the other side, the last), which fly in with unit speed.
fn row(n: usize, e: f64) -> Structure {
    let pair = |i: usize| {
        (0..n)
            .map(|k| {
                if k == i {
                    1.0
                } else if k == i + 1 {
                    -1.0
                } else {
                    0.0
                }
            })
            .collect::<Vec<_>>()
    };
    masses(&vec![1.0; n], &vec![0.0; n], &(0..n - 1).map(pair).collect::<Vec<_>>(), rigid(e))
}

/// B3. Twenty-two elastic balls: the blow leaves at the other end, in twenty-one rounds of one instant.
#[test]
fn b3_a_blow_passes_through_the_longest_row_at_one_instant() {
    let n = 22;
    let mut q = vec![0.0; n];
    let mut v = vec![0.0; n];
    (q[0], v[0]) = (-1.0, 1.0);
    let run = run(&row(n, 1.0), &q, &v, 2.0);
    assert_eq!((run.times(), run.events()[0].jumps), (vec![1.0], 21));
    let expected: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == n - 1))).collect();
    assert_eq!(run.events()[0].x_plus[n..], expected);
}

/// B3. Two elastic balls hit a touching pair from both sides at once: speeds (1, 0, 0, −1) become (0, 1, −1, 0), the pair
/// meets, (0, −1, 1, 0), and passes it back: (−1, 0, 0, 1), in three rounds with two, one and two impacts.
#[test]
fn b3_two_blows_at_once_and_what_follows_are_one_record() {
    let run = run(&row(4, 1.0), &[-1.0, 0.0, 0.0, 1.0], &[1.0, 0.0, 0.0, -1.0], 2.0);
    assert_eq!((run.times(), run.events()[0].jumps, run.events()[0].fired.len()), (vec![1.0], 3, 3));
    assert_eq!(run.events()[0].x_plus[4..], [-1.0, 0.0, 0.0, 1.0]);
}

/// B3. Three touching balls below e = 7 − 4√3 = 0.0718 collide infinitely often at one instant: relative speeds go through
/// `[[a² − e, a], [−ea, −e]]`, a = (1 + e)/2, whose eigenvalues are then real and below ¼, and end at zero. All three go on
/// with a third of the speed.
#[test]
fn b3_an_inelastic_collapse_at_one_instant_ends_in_rest() {
    for e in [0.01, 0.03, 0.05, 0.07] {
        let run = run(&row(3, e), &[-1.0, 0.0, 0.0], &[1.0, 0.0, 0.0], 2.0);
        assert_eq!(run.times()[0], 1.0, "{e}");
        for v in &run.state.x[3..] {
            assert!((v - 1.0 / 3.0).abs() <= 1e-14, "{e}: {:?}", run.state.x);
        }
    }
}

/// B4. The flank is reached a few units in the last place before, at and after the stiffness steps from 1 to 4: released at
/// `1 + π/2`, not at `1 + π`.
#[test]
fn b4_a_stiffness_step_next_to_the_contact_changes_nothing() {
    let k = Stiffness::switched(vec![[1.0, 0.0]], [1.0, 4.0]);
    let s = walled(&WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, spring(0.0), k));
    for ulps in -8..=8 {
        let run = run(&s, &[-1.0 - f64::from(ulps) * f64::EPSILON], &[1.0], 4.0);
        assert_eq!(
            modes(&run.events().iter().copied().filter(|r| !r.fired.is_empty()).collect::<Vec<_>>(), 0),
            [Drive, Separated],
            "{ulps}"
        );
        let end = *run.times().last().unwrap();
        assert!((end - (1.0 + 0.5 * PI)).abs() <= 32.0 * f64::EPSILON, "{ulps}: {end}");
        assert!((run.state.x[1] + 1.0).abs() <= 32.0 * f64::EPSILON, "{ulps}");
        // A contact that is open at the step has no switch.
        assert!(run.counters.switches <= u64::from(ulps < 0), "{ulps}");
    }
}

/// B5. A mesh at rest under a load f on stiffness 1 has p = f; where the stiffness steps to k, ½(k − 1)f² comes in.
#[test]
fn b5_a_stiffness_step_under_load_is_work_in_the_ledger() {
    for k in [4.0, 0.25] {
        let stiffness = Stiffness::switched(vec![[1.0, 0.0]], [1.0, k]);
        let s = walled(&WalledOscillator {
            load: 0.3,
            ..WalledOscillator::new(1.0, Walls::Above { position: 0.5 }, spring(0.1), stiffness)
        });
        let mut ledger = Ledger::new(&s);
        engine(&s, state(&s, &[0.8], &[0.0]), Default::default()).run(s.clock().instant(9.0), &mut ledger).unwrap();
        let b = ledger.balance();
        let exact = 0.5 * (k - 1.0) * 0.09;
        assert!((b.switches - exact).abs() <= 8.0 * f64::EPSILON * exact.abs(), "{k}: {} {exact}", b.switches);
        assert!(b.closure() <= 1e-14, "{b:?}");
    }
}

/// B6. No edge leads from one flank to the other: a back flank that fires in drive contact is an error with names.
#[test]
fn b6_from_one_flank_to_the_other_there_is_no_edge() {
    let s =
        walled(&WalledOscillator::new(1.0, Walls::Between { half_gap: 1e-3 }, spring(0.0), Stiffness::Constant(1.0)));
    let mut from = Jump::default();
    set_contact(&mut from.mode, 0, Drive);
    let mut fired = GuardSet::default();
    fired.insert(guard_id(0, Watch::BackFlank));
    let error = s.jump(&from, &fired, s.clock().instant(0.0), &mut [2e-3, -1.0], &mut [0.0; 2]).unwrap_err();
    assert!(
        matches!(&error, ModelError::NoEdge { element, mode, .. } if element == "walls" && mode == "drive"),
        "{error}"
    );
}

fn reversing(half_gap: f64) -> Structure {
    // 1 kg between flanks of 4e8 N/m, ω₀ = 2e4, forced at half that by 100 N: δ = 100/(3e8) m.
    let wall = WalledOscillator {
        load_harmonics: vec![Harmonic { omega: 1e4, amplitude: 100.0, phase: 0.0 }],
        ..WalledOscillator::new(1.0, Walls::Between { half_gap }, spring(400.0), Stiffness::Constant(4e8))
    };
    walled(&wall)
}

/// B7. Without a gap the flanks coincide: refused with the word for what is meant.
#[test]
fn b7_two_flanks_without_a_gap_are_refused_with_a_remedy() {
    for half_backlash in [0.0, -1e-6] {
        let mut spec = reversing(1e-6).spec().clone();
        spec.contacts[0].half_backlash = half_backlash;
        let error = Structure::new(spec).unwrap_err();
        assert!(matches!(error, AssembleError::Contact { .. }) && error.to_string().contains("bilateral"), "{error}");
    }
}

/// B7. A gap of a picometre is a gap: each reversal of the force crosses it in two events, and the motion is the linear one
/// without backlash, `x = a cos(ωt + φ)`, to the size of the gap.
#[test]
fn b7_a_picometre_of_backlash_is_crossed_in_two_events_each_way() {
    let s = reversing(1e-12);
    let period = 2.0 * PI / 1e4;
    // Long enough for e^(−200 t).
    let run = run(&s, &[1e-7], &[0.0], 200.0 * period);
    let late: Vec<_> = run.events().into_iter().filter(|r| run.clock.time(r.at).value() > 190.0 * period).collect();
    assert_eq!(late.len(), 40);
    for four in modes(&late, 0).chunks(4) {
        assert!(four.iter().filter(|m| **m == Separated).count() == 2 && four.contains(&Drive) && four.contains(&Back));
    }
    // k − mω² = 3e8, cω = 4e6.
    let amplitude = 100.0 / 3e8f64.hypot(4e6);
    let (x, v) = (run.state.x[0], run.state.x[1] / 1e4);
    assert!((x.hypot(v) - amplitude).abs() <= 1e-10, "{:e}", x.hypot(v) - amplitude);
}

/// B7. One flank needs no gap: a wall at the rest position.
#[test]
fn b7_one_flank_without_a_gap_is_as_good_as_any() {
    let s = walled(&WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, spring(0.0), Stiffness::Constant(1.0)));
    let run = run(&s, &[-1.0], &[1.0], 6.0);
    assert!((run.times()[1] - run.times()[0] - PI).abs() <= 8.0 * f64::EPSILON, "{:?}", run.times());
    assert_eq!(contact_mode(&run.state.jump.mode, 0), Separated);
}

/// B3. Three rigid contacts let go within 1e-17 s, and rounding closes one again at a speed of 1e-18 m/s. When is uncertain up to the next
/// switch; the contacts that open before that do not wait.
#[test]
fn b3_an_event_of_uncertain_time_does_not_wait_for_a_switch() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/scenes/uncertain-before-a-switch.json");
    let run = flank::Simulation::from_file(file).unwrap().run().unwrap();
    let energy = &run.summary.energy;
    assert!(energy.closure().abs() <= 1e-12 * energy.throughput, "{energy:?}");
}

/// B1. Three equal planets between the flanks of sun and ring, all with e = 0: contacts hold each other, and of the impulses that do the
/// same some leave single planets out. Each planet has an impact wherever one of its like has.
#[test]
fn b1_equal_contacts_that_hold_each_other_all_have_the_impact() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/scenes/equal-planets-between-two-flanks.json");
    let run = flank::Simulation::from_file(file).unwrap().run().unwrap();
    let mut shared = 0;
    for event in &run.events {
        let impacts = |mesh: &str| {
            event.contacts.iter().filter(|c| c.name.starts_with(mesh) && c.kind == EventKind::Impact).count()
        };
        let (sun, ring) = (impacts("sun"), impacts("ring"));
        assert!([0, 3].contains(&sun) && [0, 3].contains(&ring), "{event:?}");
        shared += usize::from(sun > 0 && ring > 0);
    }
    assert_eq!(shared, 1);
}
