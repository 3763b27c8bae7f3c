//! Trains with one quantity of every contact multiplied.

use flank::{
    gear::{
        Harmonic, Piece, Stiffness,
        contact::{Law, Linear, PowerLaw, Ratio, Release, Rigid},
    },
    system::{ContactSpec, Flanks, Spec},
    train::Quantity,
};
use nalgebra::DMatrix;

fn spec(contacts: Vec<(Stiffness, Law)>) -> Spec {
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let contact = |(stiffness, law)| ContactSpec {
        name: "mesh".into(),
        direction: vec![1.0],
        error: Vec::new(),
        error_offset: 0.25,
        half_backlash: 3.0,
        flanks: Flanks::Both,
        stiffness,
        law,
        gap_damping: 0.0,
        back: None,
    };
    Spec {
        freedoms: vec!["x".into()],
        mass: one(1.0),
        damping: one(0.5),
        stiffness: one(7.0),
        load: vec![1.0],
        load_harmonics: Vec::new(),
        contacts: contacts.into_iter().map(contact).collect(),
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    }
}

fn all() -> Spec {
    let linear = Linear { damping: 5.0 };
    let power = PowerLaw { exponent: Ratio { p: 3, q: 2 }, hysteresis: 0.5, speed_floor: 1e-6, initial_speed: 1.0 };
    let harmonics = vec![Harmonic { omega: 2.0, amplitude: 0.5, phase: 0.0 }];
    let pieces = vec![Piece { start: 0.0, value: 8.0, slope: -2.0 }, Piece { start: 0.5, value: 4.0, slope: 2.0 }];
    spec(vec![
        (Stiffness::Constant(10.0), Law::KelvinVoigt(linear, Release::Force)),
        (Stiffness::Harmonic { mean: 6.0, harmonics }, Law::Bilateral(linear)),
        (Stiffness::Periodic { period: 1.0, origin: 0.0, pieces }, Law::Power(power)),
        (Stiffness::switched(vec![[1.0, 0.0]], [3.0, 2.0]), Law::KelvinVoigt(linear, Release::Deflection)),
        (Stiffness::Constant(0.0), Law::Rigid(Rigid::constant(0.5))),
    ])
}

#[test]
fn every_schedule_is_scaled_and_the_damping_ratio_stays() {
    // Powers of two: nothing is rounded.
    let (before, after) = (all(), all().scaled(Quantity::Stiffness, 4.0));
    for (a, b) in before.contacts.iter().zip(&after.contacts) {
        assert_eq!(4.0 * a.stiffness.maximum(), b.stiffness.maximum());
        assert_eq!(4.0 * a.stiffness.mean(), b.stiffness.mean());
        assert_eq!((a.half_backlash, a.error_offset), (b.half_backlash, b.error_offset));
        if let (Law::Bilateral(a) | Law::KelvinVoigt(a, _), Law::Bilateral(b) | Law::KelvinVoigt(b, _)) = (a.law, b.law)
        {
            assert_eq!(2.0 * a.damping, b.damping);
        } else {
            assert_eq!(a.law, b.law);
        }
    }
    assert_eq!((&before.mass, &before.damping, &before.stiffness), (&after.mass, &after.damping, &after.stiffness));
}

#[test]
fn damping_and_backlash_are_scaled_alone() {
    let damped = all().scaled(Quantity::Damping, 4.0);
    let damping = |contact: &ContactSpec| match contact.law {
        Law::Bilateral(linear) | Law::KelvinVoigt(linear, _) => Some(linear.damping),
        Law::Power(power) => Some(power.hysteresis),
        Law::Rigid(_) => None,
    };
    let numbers: Vec<f64> = damped.contacts.iter().filter_map(damping).collect();
    assert_eq!(numbers, [20.0, 20.0, 2.0, 20.0]);
    assert_eq!(damped.scaled(Quantity::Damping, 0.25), all());
    let wide = all().scaled(Quantity::Backlash, 2.0);
    assert!(wide.contacts.iter().all(|c| c.half_backlash == 6.0));
    assert_eq!(wide.scaled(Quantity::Backlash, 0.5), all());
}

#[test]
fn what_a_train_lacks_is_told() {
    let elastic = spec(vec![(Stiffness::Constant(1.0), Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Force))]);
    assert_eq!(Quantity::ALL.map(|quantity| elastic.has(quantity)), [true, false, true]);
    let rigid = spec(vec![(Stiffness::Constant(1.0), Law::Rigid(Rigid::constant(0.5)))]);
    assert_eq!(Quantity::ALL.map(|quantity| rigid.has(quantity)), [false, false, true]);
}
