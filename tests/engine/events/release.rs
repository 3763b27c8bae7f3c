//! Release by force, and laws that latch: lines 25 to 27.

use std::f64::consts::PI;

use flank::{
    gear::{
        Stiffness,
        contact::{Law, Linear, PowerLaw, Ratio, Release},
    },
    hybrid::ContactMode::{Drive, DriveDetached, Separated},
    train::{WalledOscillator, Walls},
};

use super::support::{modes, run, walled};
use flank::system::contact_mode;

fn damped(damping: f64, load: f64) -> flank::system::Structure {
    let law = Law::KelvinVoigt(Linear { damping }, Release::Force);
    walled(&WalledOscillator {
        load,
        ..WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, Stiffness::Constant(1.0))
    })
}

#[test]
fn l25_a_contact_released_by_force_leaves_the_zone_twice_the_damping_ratio_later() {
    for zeta in [0.01f64, 0.1, 0.3] {
        let run = run(&damped(2.0 * zeta, 0.0), &[0.0], &[1.0], 6.0);
        assert_eq!(modes(&run.events(), 0), [DriveDetached, Separated]);
        let wave = (1.0 - zeta * zeta).sqrt();
        let exact = (PI - (2.0 * zeta * wave).atan2(1.0 - 2.0 * zeta * zeta)) / wave;
        let times = run.times();
        assert!((times[0] - exact).abs() <= 16.0 * f64::EPSILON * exact, "{zeta}: {:e}", times[0] - exact);
        // k p + c ṗ = 0 there, and the flight back is free: p/|ṗ| = c/k = 2ζ/ω. Speed and penetration are known to a
        // few units, the speed is at least e^(−πζ)/2.
        assert!((times[1] - times[0] - 2.0 * zeta).abs() <= 64.0 * f64::EPSILON, "{zeta}");
    }
}

#[test]
fn l25_an_undamped_contact_without_stiffness_opens_on_its_flank() {
    // p = sin t − (1 − cos t) until 1, where the stiffness drops to zero and the mass is free: −t²/2 from there.
    for levels in [[1.0, 0.0], [1.0, 1e-9]] {
        for release in [Release::Force, Release::Deflection] {
            let law = Law::KelvinVoigt(Linear { damping: 0.0 }, release);
            let stiffness = Stiffness::switched(vec![[1.0, 0.0]], levels);
            let wall = Walls::Above { position: 0.0 };
            let run = run(
                &walled(&WalledOscillator { load: -1.0, ..WalledOscillator::new(1.0, wall, law, stiffness) }),
                &[0.0],
                &[1.0],
                6.0,
            );
            let events: Vec<_> = run.events().into_iter().filter(|r| r.from != r.to && !r.fired.is_empty()).collect();
            assert_eq!(modes(&events, 0), [Separated]);
            let (p, v) = (1f64.sin() + 1f64.cos() - 1.0, 1f64.cos() - 1f64.sin());
            // The weak spring adds an acceleration of 1e-9 p, and p < 0.4, over less than 0.7 s.
            let (exact, weak) = (1.0 + v + (v * v + 2.0 * p).sqrt(), 1e-9 * f64::from(levels[1] > 0.0));
            let time = run.clock.time(events[0].at).value();
            assert!((time - exact).abs() <= 8.0 * f64::EPSILON + weak, "{levels:?} {release:?}: {:e}", time - exact);
        }
    }
}

#[test]
fn l26_a_load_that_presses_again_closes_the_contact_inside_the_zone() {
    // k = c = f = 1 from p = 1.5 with speed −1.5, where the force is zero and falling:
    // detached, F = −t/2 + t²/2 returns at t = 1, with p = ½ > 0.
    let run = run(&damped(1.0, 1.0), &[1.5], &[-1.5], 1.5);
    assert!(run.records[0].start && contact_mode(&run.records[0].to, 0) == DriveDetached);
    assert_eq!(modes(&run.events(), 0)[..1], [Drive]);
    assert!((run.times()[0] - 1.0).abs() <= 16.0 * f64::EPSILON, "{:?}", run.times());
    assert!((run.events()[0].x_plus[0] - 0.5).abs() <= 16.0 * f64::EPSILON);
}

#[test]
fn l27_the_latched_speed_is_the_approach_speed_or_its_floor() {
    for (speed, latched) in [(0.5, 0.5), (1e-3, 1e-3), (1e-9, 1e-6)] {
        latch(speed, latched);
    }
}

#[test]
fn l27_a_slow_press_onto_a_power_law_latches_the_floor() {
    latch(0.0, 1e-6);
}

fn latch(speed: f64, latched: f64) {
    let law = Law::Power(PowerLaw {
        exponent: Ratio { p: 3, q: 2 },
        hysteresis: 0.3,
        speed_floor: 1e-6,
        initial_speed: 1e-2,
    });
    let s = walled(&WalledOscillator {
        load: 0.1,
        ..WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, law, Stiffness::Constant(5.0))
    });
    let run = run(&s, &[0.0], &[speed], 1.0);
    assert_eq!(run.records[0].x_minus[2], 1e-2, "the speed before the first contact");
    assert_eq!(run.records[0].x_plus[2], latched);
    assert_eq!(run.state.x[2], latched, "it stays for the whole contact");
}
