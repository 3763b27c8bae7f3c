//! What happens at one instant: lines 11 to 14.

use std::f64::consts::PI;

use flank::{
    engine::EngineError,
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{
        ContactMode::{Drive, DriveDetached, Separated},
        GuardId, GuardSet, Mode, Watch,
    },
    system::{Structure, contact_mode, guard_id},
    train::{WalledOscillator, Walls},
};

use super::support::{Course, attempt, masses, modes, rigid, run, walled};

fn unit(n: usize, i: usize) -> Vec<f64> {
    (0..n).map(|k| f64::from(u8::from(k == i))).collect()
}

fn compliant() -> Law {
    Law::KelvinVoigt(Linear { damping: 0.1 }, Release::Deflection)
}

/// `n` equal masses, each pushed against its own flank.
fn copies(n: usize, law: Law) -> Structure {
    let directions: Vec<_> = (0..n).map(|i| unit(n, i)).collect();
    masses(&vec![1.0; n], &vec![0.3; n], &directions, law)
}

#[test]
fn l11_equal_contacts_that_meet_together_are_one_record() {
    for law in [compliant(), rigid(0.7)] {
        let one = run(&copies(1, law), &[-1.0], &[0.2], 12.0);
        for n in [2, 3, 5, 8] {
            let many = run(&copies(n, law), &vec![-1.0; n], &vec![0.2; n], 12.0);
            assert_eq!(many.events().len(), one.events().len());
            for (i, (a, b)) in many.events().iter().zip(one.events()).enumerate() {
                assert_eq!(a.fired.len(), n);
                assert!(a.x_plus[..n].iter().all(|x| *x == a.x_plus[0]));
                // One mass alone may leap where many take steps: each event rounds once more.
                let rounding = 8.0 * (i + 1) as f64 * f64::EPSILON;
                assert!(
                    (a.x_plus[0] - b.x_plus[0]).abs() <= rounding
                        && (many.times()[i] - one.times()[i]).abs() <= 12.0 * rounding
                );
            }
        }
    }
}

#[test]
fn l11_contacts_one_unit_in_the_last_place_apart_all_fire() {
    for law in [compliant(), rigid(0.7)] {
        let plain = run(&copies(3, law), &[-1.0; 3], &[0.2; 3], 12.0);
        let q = [-1.0, -1.0 - f64::EPSILON, -1.0 + 0.5 * f64::EPSILON];
        let apart = run(&copies(3, law), &q, &[0.2; 3], 12.0);
        assert_eq!(apart.counters.fired, plain.counters.fired);
        assert!(apart.counters.events >= plain.counters.events);
        // A unit in the last place of the start, carried through seven flights.
        let off = apart.state.x.iter().zip(&plain.state.x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off <= 1e3 * f64::EPSILON, "{off:e}");
    }
}

/// A hub and three planets with springs to the hub's stops.
fn star(order: [usize; 3], law: Law) -> Structure {
    let directions: Vec<_> = order
        .iter()
        .map(|p| (0..4).map(|k| [-1.0, 1.0][usize::from(k == 0)] * f64::from(u8::from(k == 0 || k == p + 1))).collect())
        .collect();
    masses(&[2.0, 1.0, 1.0, 1.0], &[0.5, -0.1, -0.1, -0.1], &directions, law)
}

#[test]
fn l12_the_order_of_contacts_and_planets_does_not_matter() {
    for (law, end) in [(compliant(), 9.0), (rigid(0.6), 2.6)] {
        for q in [[0.2, 0.2, 0.2], [0.2, 0.2, 0.35]] {
            let plain = run(&star([0, 1, 2], law), &[0.0, q[0], q[1], q[2]], &[0.0; 4], end);
            assert!(plain.events().len() >= 2);
            // Other numbers for the contacts.
            for order in [[2, 0, 1], [1, 0, 2], [2, 1, 0]] {
                let other = run(&star(order, law), &[0.0, q[0], q[1], q[2]], &[0.0; 4], end);
                assert_eq!(other.events().len(), plain.events().len(), "{order:?}");
                for (a, b) in other.events().iter().zip(plain.events()) {
                    for (j, p) in order.iter().enumerate() {
                        assert_eq!(contact_mode(&a.to, j), contact_mode(&b.to, *p));
                    }
                    assert_eq!(a.fired.len(), b.fired.len());
                }
                close(&other.times(), &plain.times());
                close(&other.state.x, &plain.state.x);
            }
            // Other numbers for the planets.
            let other = run(&star([0, 1, 2], law), &[0.0, q[2], q[0], q[1]], &[0.0; 4], end);
            close(&other.times(), &plain.times());
            let x = &other.state.x;
            close(&[x[0], x[2], x[3], x[1], x[4], x[6], x[7], x[5]], &plain.state.x);
        }
    }
}

/// The sums run in another order: rounding, carried through a few flights.
fn close(a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 256.0 * f64::EPSILON * (1.0 + b.abs())), "{a:?} {b:?}");
}

/// Three balls in a row, the second and the third touching.
fn cradle(restitution: f64) -> super::support::Run {
    let s = masses(&[1.0; 3], &[0.0; 3], &[vec![1.0, -1.0, 0.0], vec![0.0, 1.0, -1.0]], rigid(restitution));
    run(&s, &[-1.0, 0.0, 0.0], &[1.0, 0.0, 0.0], 2.0)
}

#[test]
fn l13_an_impact_passed_on_along_a_row_is_one_record() {
    let run = cradle(1.0);
    assert_eq!(run.times(), [1.0]);
    let record = run.events()[0];
    assert_eq!((record.jumps, record.fired.len()), (2, 2));
    assert_eq!(record.x_plus[3..], [0.0, 0.0, 1.0]);
    // Restitution 0.8: (1, 0, 0) → (0.1, 0.9, 0) → (0.1, 0.09, 0.81) → (0.091, 0.099, 0.81).
    let run = cradle(0.8);
    assert_eq!(run.events().len(), 1);
    assert_eq!(run.events()[0].jumps, 3);
    for (v, exact) in run.events()[0].x_plus[3..].iter().zip([0.091, 0.099, 0.81]) {
        assert!((v - exact).abs() <= 4.0 * f64::EPSILON, "{v} {exact}");
    }
}

#[test]
fn l13_a_run_that_ends_at_an_impact_has_all_that_follows_from_it() {
    let s = masses(&[1.0; 3], &[0.0; 3], &[vec![1.0, -1.0, 0.0], vec![0.0, 1.0, -1.0]], rigid(1.0));
    let first = run(&s, &[-1.0, 0.0, 0.0], &[1.0, 0.0, 0.0], 1.0);
    assert_eq!((first.times(), first.events()[0].jumps), (vec![1.0], 2));
    assert_eq!(first.state.x, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let second = super::support::run_from(&s, first.state, s.clock().instant(2.0));
    assert_eq!((second.events().len(), &second.state.x[2..3]), (0, &[1.0][..]));
}

#[test]
fn l13_a_stiffness_drop_lets_go_at_the_same_instant() {
    let s = walled(&WalledOscillator::new(
        1.0,
        Walls::Between { half_gap: 1.0 },
        Law::KelvinVoigt(Linear { damping: 0.5 }, Release::Force),
        Stiffness::switched(vec![[0.01, 0.0]], [1.0, 0.1]),
    ));
    let run = run(&s, &[1.1], &[-0.1], 0.02);
    assert_eq!(run.times(), [0.01]);
    let record = run.events()[0];
    assert!(record.switched && record.jumps == 1);
    assert_eq!((contact_mode(&record.from, 0), contact_mode(&record.to, 0)), (Drive, DriveDetached));
}

#[test]
fn l14_jumps_that_never_come_to_rest_are_an_error_that_lists_the_cycle() {
    let course = Course { trap: true, ..Course::new(&[1.0, -1.0]) };
    let (outcome, run) = attempt(&course, course.start(), course.clock.instant(3.0));
    let Err(EngineError::Cycle { t, rounds, cycle }) = outcome else { panic!("{outcome:?}") };
    assert_eq!((t, rounds, cycle), (1.0, 64, vec!["mode 0x0".to_owned(), "mode 0x1".to_owned()]));
    assert!(run.records.is_empty());
}

/// Contact j of 60 closes at t = j + 1 and opens half a period later; the last two are one. Guards above 127 and contacts above 15
/// lie beyond the words that shorter trains need.
#[test]
fn l11_sixty_contacts_close_and_open_each_at_its_time() {
    let n = 60;
    let place = |j: usize| -(j.min(n - 2) as f64) - 1.0;
    let directions: Vec<_> = (0..n).map(|j| unit(n, j)).collect();
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    let s = masses(&vec![1.0; n], &vec![0.0; n], &directions, law);
    let q: Vec<f64> = (0..n).map(place).collect();
    let run = run(&s, &q, &vec![1.0; n], 70.0);
    for j in 0..n {
        let of: Vec<_> =
            run.events().into_iter().filter(|r| r.fired.contains(guard_id(j, Watch::DriveFlank))).collect();
        assert_eq!(modes(&of, j), [Drive, Separated], "{j}");
        for (record, time) in of.iter().zip([-place(j), PI - place(j)]) {
            let t = run.clock.time(record.at).value();
            // Time, place and the root are each rounded to the size of the time.
            assert!((t - time).abs() <= 4.0 * f64::EPSILON * time, "{j}: {t}");
            assert_eq!(record.fired.len(), 1 + usize::from(j >= n - 2), "{j}");
        }
    }
    assert_eq!(run.counters.events, 2 * (n as u64 - 1));
}

#[test]
fn sets_of_guards_and_modes_have_no_end() {
    let set = |ids: &[u16]| ids.iter().map(|id| GuardId(*id)).collect::<GuardSet>();
    let ids = |set: &GuardSet| set.iter().map(|id| id.0).collect::<Vec<_>>();
    let (a, b) = (set(&[300, 0, 127, 128]), set(&[128, 5]));
    assert_eq!((ids(&a), a.len()), (vec![0, 127, 128, 300], 4));
    assert_eq!(
        (ids(&(&a | &b)), ids(&(&a & &b)), ids(&(&a - &b))),
        (vec![0, 5, 127, 128, 300], vec![128], vec![0, 127, 300])
    );
    assert!(a.contains(GuardId(300)) && !a.contains(GuardId(299)) && !b.contains(GuardId(1000)));
    // What was taken out leaves no trace.
    let mut rest = a.clone();
    rest.remove(GuardId(128));
    rest.remove(GuardId(300));
    assert_eq!(rest, set(&[127, 0]));
    assert!((&a - &a).is_empty() && &a - &a == *GuardSet::none());

    let mode = |element: usize, number: u16| Mode::default().with(element, number);
    assert_eq!((mode(40, 7).get(40), mode(40, 7).get(41), mode(3, 7).get(40)), (7, 0, 0));
    assert_eq!(mode(40, 7).with(40, 0), Mode::default());
    assert!(
        mode(15, 9) < mode(16, 1) && mode(16, 9) < mode(40, 1) && mode(0, 1) < mode(1, 1) && mode(40, 1) < mode(40, 2)
    );
    assert_eq!(
        (mode(1, 1).to_string(), mode(17, 1).to_string()),
        ("0x100".into(), format!("0x0100{}", "0".repeat(32)))
    );
}
