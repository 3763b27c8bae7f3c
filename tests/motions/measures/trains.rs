//! The trains of these tests, and how they are run.

use flank::{
    engine::{Counters, Engine, Observer, Options, Outcome, State},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, PowerLaw, Ratio, Release, Rigid},
    },
    integrate::Taylor,
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure},
};
use nalgebra::DMatrix;

/// A contact of stiffness 1 beyond ±1, lost at the flank.
pub fn mesh(direction: &[f64]) -> ContactSpec {
    ContactSpec {
        name: "mesh".into(),
        direction: direction.to_vec(),
        error: Vec::new(),
        error_offset: 0.0,
        half_backlash: 1.0,
        flanks: Flanks::Both,
        stiffness: Stiffness::Constant(1.0),
        law: Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection),
        gap_damping: 0.0,
        back: None,
    }
}

/// One mass of 1 kg with a damper to ground, a constant load and one harmonic `(amplitude, frequency)`.
pub fn single(damping: f64, load: f64, harmonic: Option<(f64, f64)>, contacts: Vec<ContactSpec>) -> Spec {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    Spec {
        freedoms: vec!["x".into()],
        mass: one(1.0),
        damping: one(damping),
        stiffness: one(0.0),
        load: vec![load],
        load_harmonics: harmonic
            .map(|(a, omega)| LoadHarmonic { vector: vec![a], omega, phase: 0.0 })
            .into_iter()
            .collect(),
        contacts,
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    }
}

/// A case: train, initial displacements and velocities, end.
pub struct Case {
    pub spec: Spec,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub end: f64,
}

impl Case {
    fn one(spec: Spec, q: f64, v: f64, end: f64) -> Self {
        Self { spec, q: vec![q], v: vec![v], end }
    }
}

pub fn single_sided() -> Case {
    Case::one(single(0.1, 0.1, Some((0.081, 0.9)), vec![mesh(&[1.0])]), 1.1, 0.0, 200.0)
}

pub fn double_sided() -> Case {
    Case::one(single(0.1, 0.05, Some((0.6, 0.6)), vec![mesh(&[1.0])]), 0.9, 0.5, 200.0)
}

pub fn force_release() -> Case {
    let law = Law::KelvinVoigt(Linear { damping: 0.15 }, Release::Force);
    Case::one(single(0.0, 0.1, Some((0.25, 0.9)), vec![ContactSpec { law, ..mesh(&[1.0]) }]), 1.1, 0.0, 200.0)
}

pub fn rectangular() -> Case {
    let stiffness = Stiffness::rectangular(1.3, 0.7, 7.25, 0.6, 0.5);
    Case::one(single(0.08, 0.1, Some((0.12, 0.75)), vec![ContactSpec { stiffness, ..mesh(&[1.0]) }]), 1.1, 0.0, 200.0)
}

pub fn parametric() -> Case {
    let harmonics = vec![Harmonic { omega: 1.9, amplitude: 0.3, phase: 0.0 }];
    let stiffness = Stiffness::Harmonic { mean: 1.0, harmonics };
    Case::one(single(0.04, 0.15, None, vec![ContactSpec { stiffness, ..mesh(&[1.0]) }]), 1.3, 0.0, 200.0)
}

pub fn two_mass() -> Case {
    let contact = ContactSpec {
        half_backlash: 0.5,
        stiffness: Stiffness::Constant(4.0),
        law: Law::KelvinVoigt(Linear { damping: 0.05 }, Release::Deflection),
        ..mesh(&[1.0, -1.0])
    };
    let spec = Spec {
        freedoms: vec!["u_1".into(), "u_2".into()],
        mass: DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 2.0]),
        damping: DMatrix::from_row_slice(2, 2, &[0.02, 0.0, 0.0, 0.03]),
        stiffness: DMatrix::zeros(2, 2),
        load: vec![0.1, -0.1],
        load_harmonics: vec![LoadHarmonic { vector: vec![0.45, 0.0], omega: 1.2, phase: 0.0 }],
        contacts: vec![contact],
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    };
    Case { spec, q: vec![0.53, 0.0], v: vec![0.1, 0.0], end: 100.0 }
}

pub fn hertz_law(hysteresis: f64) -> Law {
    Law::Power(PowerLaw { exponent: Ratio { p: 3, q: 2 }, hysteresis, speed_floor: 1e-12, initial_speed: 1e-2 })
}

pub fn hertz_pair() -> Case {
    let contact = ContactSpec { stiffness: Stiffness::Constant(40.0), law: hertz_law(0.3825), ..mesh(&[1.0]) };
    Case::one(single(0.02, 0.1, Some((0.8, 0.9)), vec![contact]), 0.5, 0.2, 100.0)
}

pub fn rigid(restitution: f64, direction: f64, position: f64) -> ContactSpec {
    rigid_along(&[direction], restitution, position)
}

fn rigid_along(direction: &[f64], restitution: f64, position: f64) -> ContactSpec {
    ContactSpec {
        name: "wall".into(),
        half_backlash: position,
        flanks: Flanks::Drive,
        law: Law::Rigid(Rigid::constant(restitution)),
        ..mesh(direction)
    }
}

/// Rattle between two rigid flanks at ±1.
pub fn rattle() -> Case {
    Case::one(single(0.1, 0.05, Some((1.2, 1.1)), vec![rigid(0.7, 1.0, 1.0), rigid(0.7, -1.0, 1.0)]), 0.0, 0.3, 60.0)
}

/// A ball on a table `0.3 cos(6.5 t + 0.2)`: chatter, rest, release, again and again.
pub fn chatter() -> Case {
    let error = vec![Harmonic { amplitude: -0.3, omega: 6.5, phase: 0.2 }];
    let contact = ContactSpec { error, ..rigid(0.4, -1.0, 0.0) };
    Case::one(single(0.0, -9.81, None, vec![contact]), 0.5, 0.0, 6.0)
}

/// A central body strikes three alike ones across alike gaps, always at the same instant.
pub fn three_at_once() -> Case {
    let diagonal = |d: &[f64]| DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(d));
    let toward = |i: usize| (0..4).map(|k| if k == 0 { 1.0 } else { -f64::from(u8::from(k == i)) }).collect::<Vec<_>>();
    let contacts = (1..4).map(|i| rigid_along(&toward(i), 0.7, 0.25)).collect();
    let spec = Spec {
        freedoms: ["x", "x_1", "x_2", "x_3"].map(String::from).to_vec(),
        mass: diagonal(&[2.0, 0.5, 0.5, 0.5]),
        damping: DMatrix::zeros(4, 4),
        stiffness: diagonal(&[1.0, 4.0, 4.0, 4.0]),
        load: vec![0.0; 4],
        load_harmonics: vec![LoadHarmonic { vector: vec![0.7, 0.0, 0.0, 0.0], omega: 1.3, phase: 0.4 }],
        contacts,
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    };
    Case { spec, q: vec![0.0; 4], v: vec![1.0, 0.0, 0.0, 0.0], end: 20.0 }
}

/// Starts in contact with a low latched speed and is then pulled off: hysteresis would pull back.
pub fn pulled() -> Case {
    let contact = ContactSpec { stiffness: Stiffness::Constant(40.0), law: hertz_law(0.7), ..mesh(&[1.0]) };
    Case::one(single(0.0, 0.0, Some((0.8, 0.9)), vec![contact]), 1.05, 0.0, 30.0)
}

/// Torsional stage: sun, ring, carrier and three planets, six meshes with errors (kg, µm, ms, N).
pub fn planetary() -> Case {
    let carrier = -24.6f64.to_radians().cos();
    let mut contacts = Vec::new();
    for ring in [false, true] {
        for planet in 0..3 {
            let mut direction = vec![0.0; 6];
            direction[usize::from(ring)] = 1.0;
            direction[2] = carrier;
            direction[3 + planet] = if ring { -1.0 } else { 1.0 };
            let phase = std::f64::consts::TAU * planet as f64 / 3.0 + if ring { 0.5 } else { 0.0 };
            contacts.push(ContactSpec {
                error: vec![Harmonic { amplitude: if ring { -0.3 } else { -0.4 }, omega: 8.0, phase }],
                half_backlash: 5.0,
                stiffness: Stiffness::Constant(500.0),
                law: Law::KelvinVoigt(Linear { damping: 0.3 }, Release::Deflection),
                ..mesh(&direction)
            });
        }
    }
    let diagonal = |d: &[f64]| DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(d));
    let mass = [0.39, 3.0, 8.27, 0.61, 0.61, 0.61];
    let spec = Spec {
        freedoms: ["u_s", "u_r", "u_c", "u_1", "u_2", "u_3"].map(String::from).to_vec(),
        mass: diagonal(&mass),
        damping: diagonal(&mass.map(|m| 0.05 * m)),
        stiffness: diagonal(&[2.0, 1000.0, 3.0, 0.0, 0.0, 0.0]),
        load: vec![20.0, 0.0, -10.0, 0.0, 0.0, 0.0],
        load_harmonics: vec![LoadHarmonic { vector: vec![15.0, 0.0, 0.0, 0.0, 0.0, 0.0], omega: 0.5, phase: 0.0 }],
        contacts,
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    };
    Case { spec, q: vec![6.0, 0.0, 0.0, 0.5, 0.4, 0.6], v: vec![0.0; 6], end: 12.0 }
}

pub fn run(structure: &Structure, case: &Case, observer: &mut dyn Observer) -> (State, Counters) {
    let at = structure.clock().instant(0.0);
    let start = structure.start(at, &case.q, &case.v).unwrap();
    let state = State { at, x: start.x, jump: start.jump };
    let mut engine = Engine::new(structure, Box::new(Taylor::default()), Options::default(), state);
    let outcome = engine.run(structure.clock().instant(case.end), observer).unwrap();
    assert_eq!(outcome, Outcome::ReachedEnd);
    (engine.state().clone(), engine.counters())
}
