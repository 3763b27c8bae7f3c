//! Known times, the pair (cycle, phase), and runs in pieces: lines 15 to 18.

use std::f64::consts::PI;

use flank::{
    engine::{Options, State},
    gear::{
        Piece, Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::ContactMode::{Drive, Separated},
    system::{Structure, contact_mode},
    train::{KahramanSingh, WalledOscillator, Walls},
};
use proptest::prelude::*;

use super::support::{Log, Run, ball, engine, masses, modes, run, run_from, state, walled};

/// `x = −1 + t` up to the flank at 0, which it meets as the stiffness steps from 1 to 4.
fn step_at_contact() -> Structure {
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    let k = Stiffness::switched(vec![[1.0, 0.0]], [1.0, 4.0]);
    walled(&WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, k))
}

#[test]
fn l15_a_stiffness_step_goes_before_a_contact_at_the_same_instant() {
    let run = run(&step_at_contact(), &[-1.0], &[1.0], 4.0);
    let events = run.events();
    assert_eq!(modes(&events, 0), [Drive, Separated]);
    // An open contact has no stiffness that could step: the step is no event of its own.
    assert!(!events[0].switched && events[0].jumps == 1 && run.counters.switches == 0);
    assert_eq!(run.time(0), 1.0);
    // x = ½ sin 2(t − 1) with the new stiffness.
    assert!((run.time(1) - (1.0 + 0.5 * PI)).abs() <= 4.0 * f64::EPSILON * 3.0, "{}", run.time(1));
    assert!((run.records[1].x_plus[1] + 1.0).abs() <= 16.0 * f64::EPSILON);
}

#[test]
fn l15_a_stiffness_step_at_the_end_of_a_piece_of_a_run_is_not_lost() {
    let s = step_at_contact();
    let whole = run(&s, &[-1.0], &[1.0], 4.0);
    for fresh in [false, true] {
        let mut log = Log::default();
        let mut first = engine(&s, state(&s, &[-1.0], &[1.0]), Options::default());
        first.run(s.clock().instant(1.0), &mut log).unwrap();
        let end = s.clock().instant(4.0);
        if fresh {
            engine(&s, first.state().clone(), Options::default()).run(end, &mut log).unwrap();
        } else {
            first.run(end, &mut log).unwrap();
        }
        let last = log.records.last().unwrap();
        // A new engine writes down that it starts on a guard.
        assert_eq!(log.records.len() - usize::from(fresh), whole.records.len());
        assert!(!log.records[0].switched && log.records[0].jumps == 1, "the step and the contact are one instant");
        assert!((s.clock().time(last.at).value() - whole.time(1)).abs() <= 16.0 * f64::EPSILON, "{fresh}");
        assert_eq!(log.records.iter().filter(|r| !r.fired.is_empty()).count(), 2);
    }
}

/// A mass that flies from −1 at speed 1 meets the flank at t = 1 and leaves it half a period later, with the stiffness of then.
#[test]
fn l15_a_stiffness_that_steps_while_the_contact_is_open_is_the_new_one_when_it_closes() {
    for levels in [[1.0, 4.0], [4.0, 1.0]] {
        let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
        let k = Stiffness::switched(vec![[0.25, 0.0], [0.5, 0.0], [0.75, 0.0]], levels);
        let s = walled(&WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, k));
        let run = run(&s, &[-1.0], &[1.0], 6.0);
        // Three switches leave the second level, and none ends the arc.
        let end = 1.0 + PI / levels[1].sqrt();
        assert_eq!(modes(&run.events(), 0), [Drive, Separated]);
        assert!((run.time(1) - end).abs() <= 4.0 * f64::EPSILON * end, "{}", run.time(1));
        assert_eq!((run.counters.switches, run.counters.arcs), (0, 3));
    }
}

/// A contact that leaves and comes back finds the stiffness of its return, and a switch of the other contact that is closed all the
/// while ends the arc.
#[test]
fn l15_only_switches_of_contacts_that_act_end_an_arc() {
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    let switched = |time: f64| Stiffness::switched(vec![[time, 0.0]], [1.0, 9.0]);
    let mut s = masses(&[1.0, 1.0], &[0.0, 0.0], &[vec![1.0, 0.0], vec![0.0, 1.0]], law).spec().clone();
    (s.contacts[0].stiffness, s.contacts[1].stiffness) = (switched(0.5), switched(0.25));
    let s = Structure::new(s).unwrap();
    // The first flies until t = 1; the second starts in contact with speed 1 and turns with the stiffness of then.
    let run = run(&s, &[-1.0, 0.0], &[1.0, 1.0], 3.0);
    assert_eq!(run.counters.switches, 1);
    let closed = run.records.iter().find(|r| r.switched).unwrap();
    assert_eq!((run.clock.time(closed.at).value(), contact_mode(&closed.to, 1)), (0.25, Drive));
    let first: Vec<_> =
        run.events().into_iter().filter(|r| contact_mode(&r.from, 0) != contact_mode(&r.to, 0)).collect();
    let end = 1.0 + PI / 3.0;
    assert!((run.clock.time(first[1].at).value() - end).abs() <= 8.0 * f64::EPSILON * end);
}

fn gear() -> Structure {
    Structure::new(KahramanSingh::new(0.05, 0.1, 0.2, 0.7).assemble().unwrap()).unwrap()
}

#[test]
fn l16_a_thousand_million_cycles_later_the_phases_are_the_same_to_the_last_bit() {
    let mut spec = KahramanSingh::new(0.05, 0.1, 0.2, 0.7).assemble().unwrap();
    let period = 2.0 * PI / 0.7;
    for stiffness in [Stiffness::Constant(1.0), Stiffness::rectangular(1.3, 0.8, period, 0.4, 0.3)] {
        spec.contacts[0].stiffness = stiffness;
        let s = Structure::new(spec.clone()).unwrap();
        let later = |cycle: i64| {
            let at = s.clock().at(cycle, 0.0);
            let start = s.start(at, &[0.2], &[0.5]).unwrap();
            run_from(&s, State { at, x: start.x, jump: start.jump }, s.clock().at(cycle + 40, 0.0))
        };
        let (now, late) = (later(0), later(1_000_000_000));
        assert!(now.events().len() > 40);
        assert_eq!(now.records.len(), late.records.len());
        for (a, b) in now.records.iter().zip(&late.records) {
            assert_eq!((a.at.cycle, a.at.phase), (b.at.cycle - 1_000_000_000, b.at.phase));
            assert_eq!(
                (&a.x_minus, &a.x_plus, a.fired.clone(), a.to.clone()),
                (&b.x_minus, &b.x_plus, b.fired.clone(), b.to.clone())
            );
        }
        assert_eq!(now.state.x, late.state.x);
    }
}

#[test]
fn l17_an_event_at_the_end_of_a_run_belongs_to_it_once() {
    let s = ball(0.5);
    // Impacts of the unit throw at 2, 3, 3.5.
    let whole = run(&s, &[0.0], &[1.0], 3.25);
    for end in [2.0, 2.5, 3.0] {
        let mut log = Log::default();
        let mut first = engine(&s, state(&s, &[0.0], &[1.0]), Options::default());
        first.run(s.clock().instant(end), &mut log).unwrap();
        let so_far = log.records.iter().filter(|r| !r.start).count();
        assert_eq!(so_far, if end < 3.0 { 1 } else { 2 }, "{end}");
        engine(&s, first.state().clone(), Options::default()).run(s.clock().instant(3.25), &mut log).unwrap();
        let both: Vec<f64> = log.records.iter().filter(|r| !r.start).map(|r| s.clock().time(r.at).value()).collect();
        assert_eq!(both.len(), 2, "{end}");
        assert!(both.iter().zip(whole.times()).all(|(a, b)| (a - b).abs() <= 8.0 * f64::EPSILON), "{both:?}");
    }
}

fn pieces(s: &Structure, from: State, ends: &[f64]) -> Run {
    let (mut records, mut at) = (Vec::new(), from);
    let mut counters = flank::engine::Counters::default();
    for end in ends {
        let part = run_from(s, at, s.clock().instant(*end));
        records.extend(part.records);
        (at, counters) = (part.state, part.counters);
    }
    Run { records, state: at, counters, clock: *s.clock() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn l17_a_run_in_pieces_has_the_events_of_the_whole(splits in prop::collection::vec(0.0f64..40.0, 1..6)) {
        let s = gear();
        let mut ends = splits.clone();
        ends.sort_by(f64::total_cmp);
        ends.push(40.0);
        ends.retain(|end| *end > 0.0);
        let from = state(&s, &[0.2], &[0.5]);
        let whole = run_from(&s, from.clone(), s.clock().instant(40.0));
        let parts = pieces(&s, from, &ends);
        prop_assert_eq!(whole.events().len(), parts.events().len());
        for (a, b) in whole.events().iter().zip(parts.events()) {
            prop_assert_eq!((a.fired.clone(), a.from.clone(), a.to.clone()), (b.fired.clone(), b.from.clone(), b.to.clone()));
            // Each step and each cut rounds; the motion grows none of it by more than a hundred over this run.
            let off = s.clock().between(a.at, b.at).abs();
            prop_assert!(off <= 1e-12, "{:e}", off);
        }
    }
}

#[test]
fn l17_a_cut_exactly_at_an_event_neither_loses_nor_doubles_it() {
    let s = gear();
    let from = state(&s, &[0.2], &[0.5]);
    let whole = run_from(&s, from.clone(), s.clock().instant(40.0));
    for cut in whole.times() {
        for end in [cut, cut.next_down(), cut.next_up()] {
            let parts = pieces(&s, from.clone(), &[end, 40.0]);
            assert_eq!(parts.events().len(), whole.events().len(), "{end}");
        }
    }
}

#[test]
fn l18_a_start_at_a_stiffness_step_is_in_the_new_piece() {
    let s = step_at_contact();
    let at = s.clock().instant(1.0);
    let start = s.start(at, &[0.0], &[1.0]).unwrap();
    let run = run_from(&s, State { at, x: start.x, jump: start.jump }, s.clock().instant(4.0));
    assert_eq!(contact_mode(&run.records[0].to, 0), Drive);
    assert!((run.time(1) - (1.0 + 0.5 * PI)).abs() <= 4.0 * f64::EPSILON * 3.0);
    assert_eq!(run.counters.switches, 0);
}

/// A stiffness of 8192 equal pieces is a constant one; more are refused.
#[test]
fn l15_a_periodic_stiffness_has_up_to_8192_pieces() {
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    let of = |count: usize| {
        let piece = |i: usize| Piece { start: i as f64 / count as f64, value: 2.0, slope: 0.0 };
        let pieces = (0..count).map(piece).collect();
        let k = Stiffness::Periodic { period: 1.0, origin: 0.0, pieces };
        WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, k).assemble()
    };
    let s = Structure::new(of(8192).unwrap()).unwrap();
    let run = run(&s, &[0.0], &[1.0], 3.0);
    let end = PI / 2.0f64.sqrt();
    // Each of the 18,198 switches in the contact ends an arc, and each arc rounds the time that is left.
    assert_eq!(run.counters.switches, 18_198);
    assert!((run.times().last().unwrap() - end).abs() <= 18_198.0 * f64::EPSILON * end, "{:?}", run.times());
    assert!(Structure::new(of(8193).unwrap()).unwrap_err().to_string().contains("1 to 8192 pieces"));
}
