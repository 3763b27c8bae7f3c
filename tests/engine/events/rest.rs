//! Rigid contacts: impacts, accumulation, rest and release: lines 19 to 24.

use std::{
    f64::consts::{FRAC_PI_2, PI},
    ops::ControlFlow,
};

use flank::{
    engine::{Observer, Options},
    gear::{Harmonic, Stiffness},
    hybrid::{
        ContactMode::{Drive, Separated},
        Mode,
    },
    integrate::DenseStep,
    system::{Structure, contact_mode},
    train::{WalledOscillator, Walls},
};

use super::support::{ball, engine, masses, modes, rigid, run, state, walled};

#[test]
fn l19_three_impacts_at_one_instant_are_solved_together() {
    // A hub of mass 1 with speed 1 meets three resting masses of 1: J = (1 + e)/4 on each.
    let hub = |i: usize| {
        (0..4)
            .map(|k| {
                if k == 0 {
                    1.0
                } else if k == i {
                    -1.0
                } else {
                    0.0
                }
            })
            .collect::<Vec<_>>()
    };
    for e in [0.0, 0.3, 1.0] {
        let s = masses(&[1.0; 4], &[0.0; 4], &[hub(1), hub(2), hub(3)], rigid(e));
        let run = run(&s, &[-1.0, 0.0, 0.0, 0.0], &[1.0, 0.0, 0.0, 0.0], 2.0);
        assert_eq!(run.times(), [1.0]);
        let (record, j) = (run.events()[0], (1.0 + e) / 4.0);
        assert_eq!((record.fired.len(), record.jumps), (3, 1));
        for (v, exact) in record.x_plus[4..].iter().zip([1.0 - 3.0 * j, j, j, j]) {
            assert!((v - exact).abs() <= 4.0 * f64::EPSILON, "{e}: {v} {exact}");
        }
    }
}

#[test]
fn l20_accumulation_ends_where_the_closed_form_says() {
    for e in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95] {
        let exact = 2.0 / (1.0 - e);
        let run = run(&ball(e), &[0.0], &[1.0], exact + 1.0);
        let events = run.events();
        let last = *events.last().unwrap();
        let sum = last.accumulation.unwrap();
        let time = *run.times().last().unwrap();
        assert!((time - exact).abs() <= 1e-12 * exact, "{e}: {:e}", time / exact - 1.0);
        assert_eq!((contact_mode(&last.to, 0), run.counters.accumulations), (Drive, 1));
        // One impact after the other until the speed is 10⁻¹⁰ of the first rebound's.
        assert_eq!(sum.resolved as usize, events.len() - 1);
        let expected = 1.0 + (1e-10f64.ln() / f64::ln(e)).ceil();
        assert!((f64::from(sum.resolved) - expected).abs() <= 1.0, "{e}: {sum:?} {expected}");
        assert_eq!(run.state.x, [0.0, 0.0]);
        assert!(contact_mode(&run.state.jump.mode, 0) == Drive);
    }
}

#[test]
fn l20_accumulation_under_a_load_that_changes_is_summed_to_the_next_order() {
    // ẍ = −1 − ½ sin t: how early the sum is taken must not matter. Summed at a fraction f of the first speed, what is
    // left out is of order (J u/A²)², at most (½ f)², of the remaining time.
    let s = walled(&WalledOscillator {
        load: -1.0,
        load_harmonics: vec![Harmonic::sine(1.0, -0.5, 0.0)],
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.6), Stiffness::Constant(0.0))
    });
    let end = |fraction| {
        let options = flank::engine::Options { chatter_fraction: fraction, ..Default::default() };
        let mut log = super::support::Log::default();
        let mut engine = super::support::engine(&s, super::support::state(&s, &[0.0], &[1.0]), options);
        engine.run(s.clock().instant(6.0), &mut log).unwrap();
        let last = log.records.iter().find(|r| r.accumulation.is_some()).unwrap();
        s.clock().time(last.at).value()
    };
    let fine = end(1e-12);
    for fraction in [1e-8, 1e-9, 1e-10] {
        assert!((end(fraction) - fine).abs() <= 64.0 * f64::EPSILON * fine, "{fraction:e} {:e}", end(fraction) - fine);
    }
}

#[test]
fn l21_a_contact_at_rest_lets_go_when_its_multiplier_falls_through_zero() {
    // ẍ = −cos t on a floor.
    let s = walled(&WalledOscillator {
        load_harmonics: vec![Harmonic { omega: 1.0, amplitude: -1.0, phase: 0.0 }],
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.5), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[0.0], &[0.0], 3.0);
    assert_eq!(contact_mode(&run.records[0].to, 0), Drive);
    assert_eq!(modes(&run.events(), 0), [Separated]);
    assert!((run.times()[0] - FRAC_PI_2).abs() <= 2.0 * f64::EPSILON, "{:e}", run.times()[0] - FRAC_PI_2);
    // Then x = cos t + t − π/2.
    let (x, v) = (3f64.cos() + 3.0 - FRAC_PI_2, 1.0 - 3f64.sin());
    assert!((run.state.x[0] - x).abs() <= 1e-15 * 8.0 && (run.state.x[1] - v).abs() <= 1e-15 * 8.0);
}

#[test]
fn l21_accumulation_rest_and_release_follow_each_other() {
    // Gravity 1 and a floor that moves as 1.2 cos t from a throw that comes to rest on it: the floor's acceleration is
    // −1.2 cos t, and it drops away faster than the mass can fall where 1.2 cos t > 1.
    let s = walled(&WalledOscillator {
        load: -1.0,
        motion: vec![Harmonic { omega: 1.0, amplitude: 1.2, phase: 0.0 }],
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.2), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[1.2], &[0.0], 40.0 * PI);
    let rests = run.events().iter().filter(|r| r.accumulation.is_some()).count();
    let releases: Vec<f64> = run
        .events()
        .iter()
        .filter(|r| contact_mode(&r.from, 0) == Drive && contact_mode(&r.to, 0) == Separated)
        .map(|r| run.clock.time(r.at).value())
        .collect();
    assert_eq!((rests, releases.len()), (20, 20));
    for (k, t) in releases.iter().enumerate() {
        let exact = 2.0 * PI * (k as f64 + 1.0) - (1.0f64 / 1.2).acos();
        assert!((t - exact).abs() <= 8.0 * f64::EPSILON * exact, "{k}: {:e}", t - exact);
    }
}

#[test]
fn l21_a_body_at_rest_goes_with_a_flank_that_moves_slowly() {
    // The floor's acceleration is 1e-24 of gravity, below the rounding of the load; a step takes 1e12 s.
    let omega = 1e-12;
    let s = walled(&WalledOscillator {
        load: -1.0,
        motion: vec![Harmonic { omega, amplitude: 1.2, phase: 0.0 }],
        ..WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, rigid(0.5), Stiffness::Constant(0.0))
    });
    let mut watch = Deepest { s: &s, distance: 0.0 };
    let mut engine = engine(&s, state(&s, &[1.2], &[0.0]), Options::default());
    engine.run(s.clock().instant(4.0 * PI / omega), &mut watch).unwrap();
    assert_eq!(contact_mode(&engine.state().jump.mode, 0), Drive);
    // A row of 25 terms, each rounded.
    assert!(watch.distance <= 1.2 * 64.0 * f64::EPSILON, "{:e}", watch.distance);
}

/// The largest distance from the first flank, on eight points of each step.
struct Deepest<'s> {
    s: &'s Structure,
    distance: f64,
}

impl Observer for Deepest<'_> {
    fn step(&mut self, _: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let mut x = vec![0.0; 2];
        for i in 0..=8 {
            let theta = until * f64::from(i) / 8.0;
            step.state(theta, &mut x);
            let at = self.s.clock().advance(step.start(), step.time(theta));
            self.distance = self.distance.max(self.s.deflection(0, at, &x).0.abs());
        }
        ControlFlow::Continue(())
    }
}

#[test]
fn l22_without_restitution_the_first_impact_is_the_last() {
    let run = run(&ball(0.0), &[0.5], &[0.0], 3.0);
    assert_eq!((run.times(), modes(&run.events(), 0)), (vec![1.0], vec![Drive]));
    assert_eq!(run.state.x, [0.0, 0.0]);
}

/// A mass on a floor at 0 and a second one above it.
fn stacked(e: f64, load: [f64; 2], above: [f64; 2]) -> flank::system::Structure {
    masses(&[1.0, 1.0], &load, &[vec![-1.0, 0.0], above.to_vec()], rigid(e))
}

#[test]
fn l23_a_resting_contact_passes_a_blow_on() {
    // The upper mass falls by ½ onto the resting one, with speed 1: the floor holds, the rebound is as from the floor.
    let s = stacked(0.5, [-1.0, -1.0], [1.0, -1.0]);
    let run = run(&s, &[0.0, 0.5], &[0.0, 0.0], 1.5);
    assert_eq!((contact_mode(&run.records[0].to, 0), run.times()), (Drive, vec![1.0]));
    let record = run.events()[0];
    assert_eq!(record.x_plus, [0.0, 0.0, 0.0, 0.5]);
    assert_eq!((contact_mode(&record.to, 0), contact_mode(&record.to, 1)), (Drive, Separated));
}

#[test]
fn l23_a_resting_contact_torn_off_by_a_blow_is_separated() {
    // The second mass flies off and takes the first along by a stop: x₁ − x₀ ≤ 0 closes at t = 1 with speed 1. With
    // e = ½ the relative speed turns to ½: v = (¾, ¼), and the first mass leaves the floor.
    let s = stacked(0.5, [-1.0, 0.0], [-1.0, 1.0]);
    let run = run(&s, &[0.0, -1.0], &[0.0, 1.0], 1.25);
    let record = run.events()[0];
    // A root is rounded, and so is its place in time.
    assert!((run.times()[0] - 1.0).abs() <= f64::EPSILON);
    assert_eq!((record.x_plus[2], record.x_plus[3]), (0.75, 0.25));
    assert_eq!((contact_mode(&record.from, 0), contact_mode(&record.to, 0)), (Drive, Separated));
    // It falls back with gravity 1.
    assert!((run.state.x[2] - 0.5).abs() <= 4.0 * f64::EPSILON, "{:?}", run.state.x);
}

#[test]
fn l24_a_release_is_not_followed_by_an_impact_of_rounding() {
    // A pendulum of two resting contacts that let go in turn, for a thousand periods: as many releases as rests.
    let s = walled(&WalledOscillator {
        load_harmonics: vec![Harmonic { omega: 1.0, amplitude: 1.0, phase: 0.3 }],
        ..WalledOscillator::new(1.0, Walls::Between { half_gap: 0.5 }, rigid(0.0), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[0.0], &[0.0], 2000.0 * PI);
    let events = run.events();
    let closed = events.iter().filter(|r| contact_mode(&r.to, 0) != Separated).count();
    assert!(
        closed >= 1999 && events.len() - closed >= 1999 && events.len() <= 2 * 2001,
        "{closed} of {}",
        events.len()
    );
    assert!(events.windows(2).all(|w| run.clock.between(w[0].at, w[1].at) > 0.1));
}
