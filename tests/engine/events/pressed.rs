//! Closed power laws that are passed at once: line 39.

use flank::{
    engine::{Engine, Options},
    event::EventRecord,
    gear::{
        Harmonic, Stiffness,
        contact::{Law, PowerLaw, Ratio, restitution},
    },
    integrate::{Integrator, Taylor},
    system::Structure,
    train::{WalledOscillator, Walls},
};
use proptest::prelude::*;

use super::{
    arcs::{ArcEnds, First, agreed},
    support::{engine, run, state, walled},
};

const EXPONENTS: [f64; 5] = [1.5, 10.0 / 9.0, 2.0, 2.5, 4.0 / 3.0];

fn power(exponent: f64, hysteresis: f64) -> Law {
    let exponent = Ratio::from_f64(exponent).unwrap();
    Law::Power(PowerLaw { exponent, hysteresis, speed_floor: 1e-9, initial_speed: 1.0 })
}

/// A unit mass below a wall at 0.1 that is not quite still: energy is not kept, and by so little that no double tells.
fn nearly_free(exponent: f64, hysteresis: f64, stiffness: f64) -> Structure {
    let load_harmonics = vec![Harmonic { omega: 1e-9, amplitude: 1e-200, phase: 0.0 }];
    let walls = Walls::Above { position: 0.1 };
    let law = power(exponent, hysteresis);
    walled(&WalledOscillator {
        load_harmonics,
        ..WalledOscillator::new(1.0, walls, law, Stiffness::Constant(stiffness))
    })
}

/// The first event after the start, and the steps up to it.
fn first(system: &Structure, integrator: Box<dyn Integrator>, q: f64, v: f64, end: f64) -> (Option<EventRecord>, u64) {
    let mut first = First(None);
    let mut engine = Engine::new(system, integrator, Options::default(), state(system, &[q], &[v]));
    engine.run(system.clock().instant(end), &mut first).unwrap();
    (first.0, engine.counters().steps)
}

/// A free contact of speed u lasts `2D/u ((n+1)/2)^(1/(n+1)) √π Γ(1 + 1/(n+1))/Γ(½ + 1/(n+1))` with `Dⁿ⁺¹ = m u²/K` if it is elastic, and
/// gives back what its hysteresis leaves: the energy integral knows that for every exponent.
#[test]
fn l39_free_contacts_obey_their_closed_forms() {
    for exponent in EXPONENTS {
        for speed in [1e-6, 0.3, 1.0, 20.0] {
            for hysteresis in [0.0, 0.1, 0.48, 0.8] {
                let system = nearly_free(exponent, hysteresis, 1e5);
                let (event, steps) = first(&system, Box::new(Taylor::default()), 0.1, speed, 1e9);
                let event = event.unwrap();
                // Of the decision at the start, of the contact, and of the flight whose start completes the record.
                assert!(steps <= 3, "{exponent} {speed} {hysteresis}: {steps} steps");
                let back = -event.x_minus[1] / speed;
                assert!((back - restitution(hysteresis)).abs() <= 4e-15, "{exponent} {speed} {hysteresis} {back}");
                assert!(!event.conditioning.estimated);
                assert!((event.conditioning.slope + event.x_minus[1].abs()).abs() <= 1e-15 * speed);
                let time = system.clock().time(event.at).value();
                // A bound counts the roundings of thousands of operations.
                let stated = event.conditioning.time / time;
                assert!((1e-14..1e-11).contains(&stated), "{exponent} {speed} {hysteresis} {stated:e}");
                if hysteresis == 0.0 {
                    let m = 1.0 / (exponent + 1.0);
                    let depth = (speed * speed / 1e5).powf(m);
                    let gammas = libm::tgamma(1.0 + m) / libm::tgamma(0.5 + m) * std::f64::consts::PI.sqrt();
                    let known = 2.0 * depth / speed * (0.5 * (exponent + 1.0)).powf(m) * gammas;
                    assert!((time / known - 1.0).abs() <= 4e-15, "{exponent} {speed} {time} {known}");
                }
            }
        }
    }
}

/// Pressed with a unit force on unit stiffness, a mass swings about a penetration of one. With the energy ε at the flank it leaves at
/// the speed √2ε, and below that energy it comes as near to the flank as −ε and stays.
#[test]
fn l39_a_contact_that_hardly_opens_is_not_stepped_over() {
    for exponent in EXPONENTS {
        let sizes = (2..=40).map(|i| 10.0_f64.powf(-0.25 * f64::from(i)));
        for energy in sizes.flat_map(|size| [-size, size]) {
            let load_harmonics = vec![Harmonic { omega: 1e-9, amplitude: 1e-200, phase: 0.0 }];
            let (walls, law) = (Walls::Above { position: 0.0 }, power(exponent, 0.0));
            let unit = Stiffness::Constant(1.0);
            let system =
                walled(&WalledOscillator { load: 1.0, load_harmonics, ..WalledOscillator::new(1.0, walls, law, unit) });
            let speed = (2.0 * (1.0 - 1.0 / (exponent + 1.0) + energy)).sqrt();
            for v in [-speed, speed] {
                let (event, _) = first(&system, Box::new(Taylor::default()), 1.0, v, 9.0);
                let found = event.as_ref().map(|event| -event.x_minus[1]);
                match found {
                    // The speed is squared: ε is known to a few units of what it is a difference of.
                    Some(speed) => {
                        assert!((0.5 * speed * speed - energy).abs() <= 1e-14, "{exponent} {energy} {speed}")
                    }
                    None => assert!(energy < 0.0, "{exponent} {energy}"),
                }
            }
        }
    }
}

/// Everything that may act: loads, a moving wall, the body's own spring and damper.
#[derive(Clone, Copy, Debug)]
struct Numbers {
    exponent: usize,
    hysteresis: f64,
    stiffness: f64,
    load: f64,
    amplitude: f64,
    phase: f64,
    motion: f64,
    spring: f64,
    damping: f64,
    wall: usize,
}

impl Numbers {
    fn system(&self) -> Structure {
        let walls = [Walls::Above { position: 0.1 }, Walls::Below { position: -0.1 }, Walls::Between { half_gap: 0.1 }]
            [self.wall];
        let load_harmonics = vec![
            Harmonic { omega: 1.0, amplitude: self.amplitude, phase: self.phase },
            Harmonic { omega: 3.0, amplitude: 0.5 * self.amplitude, phase: 1.0 },
        ];
        let motion = vec![Harmonic { omega: 2.0, amplitude: self.motion, phase: 0.4 }];
        walled(&WalledOscillator {
            load: self.load,
            load_harmonics,
            motion,
            stiffness: self.spring,
            damping: self.damping,
            ..WalledOscillator::new(
                1.0,
                walls,
                power(EXPONENTS[self.exponent], self.hysteresis),
                Stiffness::Constant(self.stiffness),
            )
        })
    }
}

fn drawn() -> impl Strategy<Value = Numbers> {
    let numbers = (
        0..EXPONENTS.len(),
        0.0..0.8,
        0.0..8.0,
        -1.5..1.5,
        0.0..1.0,
        0.0..6.3,
        0.0..0.02,
        0.0..3.0,
        0.0..0.5,
        0..3usize,
    );
    numbers.prop_map(|(exponent, hysteresis, stiffness, load, amplitude, phase, motion, spring, damping, wall)| {
        Numbers {
            exponent,
            hysteresis,
            stiffness: 10.0_f64.powf(stiffness),
            load,
            amplitude,
            phase,
            motion,
            spring,
            damping,
            wall,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Release, or detachment, as the series of another order and step rule have it, within the uncertainties that both state. The run may
    /// start inside the zone or far from it.
    #[test]
    fn l39_contacts_end_where_series_end(d in drawn(), q in -0.2..0.2, v in -2.0..2.0) {
        let system = d.system();
        let (a, _) = first(&system, Box::new(Taylor::default()), q, v, 12.0);
        let (b, _) = first(&system, Box::new(Taylor::varied()), q, v, 12.0);
        if let Some((a, b)) = agreed(&system, a, b)? {
            // The contact's frequency is not above √k times what a depth of ½ makes of it.
            let size = 1.0 + d.stiffness.sqrt();
            prop_assert!((a.x_minus[1] - b.x_minus[1]).abs() <= 1e-13 * size, "{:?} {:?}", a.x_minus, b.x_minus);
        }
    }

    /// The same from one contact start: what the leap is made for.
    #[test]
    fn l39_strikes_end_where_series_end(d in drawn(), v in 0.05..3.0_f64) {
        let system = d.system();
        // Onto the flank as it is at the start, wherever the wall moves.
        let wall = d.motion * libm::cos(0.4);
        let (q, v) = if d.wall == 1 { (wall - 0.1, -v) } else { (wall + 0.1, v) };
        let (a, steps) = first(&system, Box::new(Taylor::default()), q, v, 3.0);
        let (b, others) = first(&system, Box::new(Taylor::varied()), q, v, 3.0);
        if agreed(&system, a, b)?.is_some() {
            prop_assert!(steps <= others, "{} {}", steps, others);
        }
    }
}

fn bouncing(exponent: f64, hysteresis: f64, position: f64) -> Structure {
    let load_harmonics = vec![Harmonic { omega: 3.0, amplitude: 0.5, phase: -4.05 }];
    let walls = Walls::Below { position };
    let law = power(exponent, hysteresis);
    walled(&WalledOscillator {
        load: -1.0,
        load_harmonics,
        ..WalledOscillator::new(1.0, walls, law, Stiffness::Constant(1e7))
    })
}

#[test]
fn l39_a_short_contact_is_one_step() {
    for exponent in EXPONENTS {
        let run = run(&bouncing(exponent, 0.2, 0.0), &[0.4], &[0.0], 20.0);
        assert!(run.counters.events > 15, "{exponent} {:?}", run.counters);
        // A flight may take two spans.
        assert!(2 * run.counters.steps <= 3 * run.counters.arcs + 4, "{exponent} {:?}", run.counters);
    }
}

#[test]
fn l39_an_observer_of_steps_changes_no_bit_of_the_motion() {
    for exponent in EXPONENTS {
        let system = bouncing(exponent, 0.2, 0.0);
        let plain = run(&system, &[0.4], &[0.0], 20.0);
        let mut shown = ArcEnds::of(3);
        let mut engine = engine(&system, state(&system, &[0.4], &[0.0]), Options::default());
        engine.run(system.clock().instant(20.0), &mut shown).unwrap();
        assert_eq!(shown.records, plain.records, "{exponent}");
        assert_eq!(engine.state(), &plain.state);
        // Speeds are of order one. At the release acceleration is small, but the time by which the series end is a rounded one.
        assert!(shown.worst <= 1e-13, "{exponent} {:e}", shown.worst);
    }
}

/// Where a run is cut inside a contact changes the way, and the motion by rounding alone: that of a penetration of 1e-4 which is carried on,
/// not that of the displacement of 1000, which would move the release by some 1e-13.
#[test]
fn l39_a_run_that_ends_in_a_contact_goes_on_from_there() {
    for exponent in EXPONENTS {
        let system = bouncing(exponent, 0.2, 1000.0);
        let whole = run(&system, &[1000.4], &[0.0], 3.0);
        let (strike, release) = (whole.time(0), whole.time(1));
        for share in [0.01, 0.3, 0.5, 0.8, 0.99] {
            let cut = strike + share * (release - strike);
            let mut log = super::support::Log::default();
            let mut engine = engine(&system, state(&system, &[1000.4], &[0.0]), Options::default());
            for end in [cut, 3.0] {
                engine.run(system.clock().instant(end), &mut log).unwrap();
            }
            assert_eq!(log.records.len(), whole.records.len(), "{exponent} {share}");
            let off = (system.clock().time(log.records[1].at).value() - release).abs();
            // Series carry nothing on in a root clock; they decide right after the start of a contact and right before its end.
            let allowed = if (0.3..0.9).contains(&share) { 2e-15 } else { 1e-12 };
            assert!(off <= allowed, "{exponent} {share} {off:e}");
        }
    }
}
