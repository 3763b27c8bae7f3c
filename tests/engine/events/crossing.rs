//! Finding the first crossing: lines 5 to 10.

use flank::{
    gear::Stiffness,
    hybrid::ContactMode::{Back, Drive, Separated},
    system::{Structure, contact_mode},
    train::{WalledOscillator, Walls},
};

use super::support::{Course, ghost, modes, run, walled};

/// `ẍ = −1` (with mass one) below a flank that is only watched, at `position`.
fn thrown(position: f64) -> Structure {
    walled(&WalledOscillator {
        load: -1.0,
        ..WalledOscillator::new(1.0, Walls::Above { position }, ghost(), Stiffness::Constant(0.0))
    })
}

#[test]
fn l5_both_crossings_within_one_step_are_found() {
    // x = t − t²/2 through ½ − ε at 1 ∓ √(2ε). The speed there is √(2ε), and the guard is known to 2·4ε₀ of its
    // size 1, with ε₀ the rounding unit: so much over the speed is the error allowed.
    for exponent in 1..=12 {
        let depth = 10f64.powi(-exponent);
        let run = run(&thrown(0.5 - depth), &[0.0], &[1.0], 2.0);
        let half = (2.0 * depth).sqrt();
        let times = run.times();
        assert_eq!(modes(&run.events(), 0), [Drive, Separated], "{depth:e}");
        for (found, exact) in times.iter().zip([1.0 - half, 1.0 + half]) {
            assert!((found - exact).abs() <= 8.0 * f64::EPSILON * (1.0 + 1.0 / half), "{depth:e}: {found} {exact}");
        }
        assert!(run.counters.steps <= 3, "one step for each arc");
    }
}

#[test]
fn l5_all_of_twenty_crossings_are_found_however_short() {
    for exponent in 1..=11 {
        let depth = 10f64.powi(-exponent);
        let s = walled(&WalledOscillator {
            stiffness: 1.0,
            ..WalledOscillator::new(1.0, Walls::Above { position: 1.0 - depth }, ghost(), Stiffness::Constant(0.0))
        });
        let run = run(&s, &[0.0], &[1.0], 20.0 * std::f64::consts::PI);
        assert_eq!(run.events().len(), 20, "{depth:e}");
    }
}

#[test]
fn l6_a_miss_by_a_million_millionth_is_a_miss() {
    for miss in [1e-1, 1e-6, 1e-9, 1e-12] {
        let run = run(&thrown(0.5 + miss), &[0.0], &[1.0], 2.0);
        assert_eq!((run.records.len(), run.counters.grazes), (0, 0), "{miss:e}");
    }
}

#[test]
fn l6_an_exact_tangency_is_a_graze_and_changes_nothing() {
    // The top falls into the middle of the step, where the isolation splits, or somewhere else.
    for (end, push) in [(2.0, 1.0), (3.0, 1.0), (2.5, 1.0), (2.7, 1.1), (3.1, 0.7), (1.9, 1.3)] {
        let run = run(&thrown(0.5 * push * push), &[0.0], &[push], end);
        assert_eq!((run.records.len(), run.counters.grazes), (1, 1), "{end} {push}");
        let touch = &run.records[0];
        assert!(touch.graze && touch.from == touch.to && !touch.fired.is_empty());
        // A touch is known to the root of twice the guard's uncertainty, 32 ε of terms that sum to at most 2.
        assert!((run.time(0) - push).abs() <= (128.0 * f64::EPSILON).sqrt(), "{}", run.time(0));
        assert_eq!(contact_mode(&touch.to, 0), Separated);
    }
}

#[test]
fn l7_a_crossing_of_third_order_is_one_crossing() {
    // (1 − t)³ is known to 8 ε₀ and so is 1 to the cube root of that.
    let run = Course::new(&[1.0, -3.0, 3.0, -1.0]).run(2.5);
    assert_eq!(run.events().len(), 1);
    assert_eq!((run.records[0].from.get(0), run.records[0].to.get(0)), (0, 1));
    assert!((run.times()[0] - 1.0).abs() <= (16.0 * f64::EPSILON).cbrt());
}

#[test]
fn l7_each_mode_watches_its_own_direction() {
    // (t − 0.5)(t − 0.6): in at the first, out at the second root.
    let run = Course::with_roots(1.0, &[0.5, 0.6]).run(1.0);
    let to: Vec<u16> = run.events().iter().map(|r| r.to.get(0)).collect();
    assert_eq!(to, [1, 0]);
    for (found, exact) in run.times().iter().zip([0.5, 0.6]) {
        assert!((found - exact).abs() <= 16.0 * f64::EPSILON / 0.1);
    }
}

#[test]
fn l8_the_size_of_a_guard_does_not_matter() {
    let roots = [0.3, 0.7, 0.71];
    let plain = Course::with_roots(-1.0, &roots).run(1.0).times();
    assert_eq!(plain.len(), 3);
    for power in [-664, 664] {
        assert_eq!(Course::with_roots(-(2f64.powi(power)), &roots).run(1.0).times(), plain);
    }
    for scale in [1e-200, 1e200] {
        let scaled = Course::with_roots(-scale, &roots).run(1.0).times();
        assert!(scaled.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 16.0 * f64::EPSILON / 0.01), "{scaled:?}");
        assert_eq!(scaled.len(), 3);
    }
}

#[test]
fn l8_the_size_of_a_train_does_not_matter() {
    let times = |scale: f64| {
        let s = walled(&WalledOscillator {
            load: -scale,
            ..WalledOscillator::new(1.0, Walls::Above { position: 0.499 * scale }, ghost(), Stiffness::Constant(0.0))
        });
        run(&s, &[0.0], &[scale], 2.0).times()
    };
    let plain = times(1.0);
    assert_eq!(plain.len(), 2);
    for scale in [1e-200, 1e200] {
        let scaled = times(scale);
        assert_eq!(scaled.len(), 2);
        assert!(scaled.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 16.0 * f64::EPSILON / 0.04), "{scaled:?}");
    }
}

#[test]
fn l9_a_gap_crossed_within_one_step_is_two_events() {
    let s = walled(&WalledOscillator::new(1.0, Walls::Between { half_gap: 1e-3 }, ghost(), Stiffness::Constant(0.0)));
    let run = run(&s, &[2e-3], &[-1.0], 1e-2);
    assert_eq!(modes(&run.events(), 0), [Separated, Back]);
    assert_eq!(contact_mode(&run.records[0].from, 0), Drive);
    let times = run.times();
    assert!((times[1] - times[0] - 2e-3).abs() <= 8.0 * f64::EPSILON * 4e-3, "{times:?}");
}

#[test]
fn l10_the_uncertainty_of_an_event_grows_towards_the_graze() {
    let mut before = 0.0;
    for exponent in [1, 4, 8, 12] {
        let depth = 10f64.powi(-exponent);
        let run = run(&thrown(0.5 - depth), &[0.0], &[1.0], 2.0);
        let speed = (2.0 * depth).sqrt();
        for (record, time) in run.events().iter().zip(run.times()) {
            let c = record.conditioning;
            assert!((c.slope.abs() - speed).abs() <= 1e-3 * speed, "{depth:e}: {c:?}");
            assert!(c.residual.abs() <= 8.0 * f64::EPSILON, "{depth:e}: {c:?}");
            // It covers the error, but for the representation of the time itself. (The second crossing inherits the
            // error of the first: the uncertainty is that of one arc.)
            let off = (time - (1.0 - speed)).abs();
            assert!(time > 1.0 || off <= c.time + 4.0 * f64::EPSILON, "{depth:e}: {c:?} {off:e}");
            // Terms of size 1: 32 ε for the value of the row, as much for the arc, 8 ε for what the series adds, 12 ε for rate and
            // acceleration.
            assert!(c.time <= (32.0 + 32.0 + 8.0 + 12.0) * f64::EPSILON / speed, "{depth:e}: {c:?}");
        }
        assert!(run.events()[0].conditioning.time > before);
        before = run.events()[0].conditioning.time;
    }
}

#[test]
fn l10_the_state_is_put_onto_the_guard_and_by_how_much_is_on_record() {
    let spec = flank::train::KahramanSingh::new(0.05, 0.1, 0.2, 0.7).assemble().unwrap();
    let s = flank::system::Structure::new(spec).unwrap();
    let run = run(&s, &[0.2], &[0.5], 60.0);
    assert!(run.events().len() > 10);
    for record in run.events() {
        // A few units of rounding of the gap, 1.
        assert!(record.projected <= 8.0 * f64::EPSILON, "{:e}", record.projected);
        assert_eq!(record.x_plus[0].abs(), 1.0);
        assert!(record.x_minus[1] == record.x_plus[1]);
    }
}
