//! Planetary stages: mesh forces at rest and under their errors, against independently computed numbers.

use std::f64::consts::TAU;

use crate::presets::{lin_parker, reference_heavy, reference_light};
use approx::assert_relative_eq;
use flank::gear::MeshHarmonic;
use flank::gear::contact::Law;
use flank::system::{ContactSpec, EquilibriumError, Spec, bonded_stiffness, equilibrium};
use flank::train::{Freedoms, Phasing, Planetary, Support, Teeth};
use nalgebra::{Complex, DMatrix, DVector};

#[test]
fn static_forces() {
    let mean = |torque: f64, change: &dyn Fn(&mut Planetary)| {
        let mut stage = reference_heavy(500.0, torque).unwrap();
        change(&mut stage);
        let full = equilibrium(&stage.assemble(&Freedoms::Full).unwrap()).unwrap().forces;
        let reduced = equilibrium(&stage.assemble(&Freedoms::InPhase).unwrap()).unwrap().forces;
        for (force, kind) in full.iter().zip([0, 0, 0, 1, 1, 1]) {
            assert_relative_eq!(*force, reduced[kind], max_relative = 1.0e-9);
        }
        reduced
    };
    let near = |forces: &[f64], want: f64, tolerance: f64| {
        forces.iter().for_each(|f| assert!((f - want).abs() <= tolerance, "{f} against {want} N"));
    };
    near(&mean(500.0, &|_| ()), 773.25, 0.006);
    let springs = |sun: f64, carrier: f64| {
        move |stage: &mut Planetary| {
            stage.sun.rotation.stiffness = sun;
            stage.carrier.rotation.stiffness = carrier;
        }
    };
    near(&mean(500.0, &springs(1.2e7, 5.0e8)), 853.1, 0.06);
    near(&mean(500.0, &springs(2.4e7, 2.5e8)), 791.6, 0.06);
    near(&mean(500.0, &springs(2.4e7, 1.0e10)), 751.9, 0.06);
    near(&mean(500.0, &springs(4.8e7, 5.0e8)), 669.6, 0.06);
    // Determinate: T_in/(3 r_b), and with both springs gone a free motion without load.
    for (sun, carrier) in [(0.0, 5.0e8), (2.4e7, 0.0), (0.0, 0.0)] {
        near(&mean(500.0, &springs(sun, carrier)), 968.01, 0.006);
        near(&mean(400.0, &springs(sun, carrier)), 774.41, 0.006);
    }
    // The planets' drag is the difference of the two mesh forces.
    let forces = mean(500.0, &|stage| stage.load.planet_drag = 24.0);
    assert_relative_eq!(forces[0] - forces[1], 24.0, max_relative = 1.0e-9);
}

/// Complex amplitudes of the contact forces of a linear train at each error harmonic, from
/// `(K + iωC − ω²M) Q = Σ g (k + iωc) E` and `F = (k + iωc)(gᵀQ − E)`; contact by contact, harmonic by harmonic.
fn forced(spec: &Spec) -> Vec<Vec<Complex<f64>>> {
    let n = spec.freedoms.len();
    let damping_of = |law: &Law| match law {
        Law::Bilateral(linear) => linear.damping,
        _ => panic!("not linear"),
    };
    let stiffness = bonded_stiffness(spec, None);
    let mut damping = spec.damping.clone();
    for contact in &spec.contacts {
        let g = DVector::from_column_slice(&contact.direction);
        damping += damping_of(&contact.law) * (&g * g.transpose());
    }
    let harmonics = spec.contacts[0].error.len();
    let mut forces = vec![Vec::new(); spec.contacts.len()];
    for h in 0..harmonics {
        let omega = spec.contacts[0].error[h].omega;
        let dynamic = DMatrix::from_fn(n, n, |i, j| {
            Complex::new(stiffness[(i, j)] - omega * omega * spec.mass[(i, j)], omega * damping[(i, j)])
        });
        let mesh = |c: &ContactSpec| Complex::new(c.stiffness.mean(), omega * damping_of(&c.law));
        let error = |c: &ContactSpec| Complex::from_polar(c.error[h].amplitude, c.error[h].phase);
        let mut load = DVector::from_element(n, Complex::new(0.0, 0.0));
        for c in &spec.contacts {
            (0..n).for_each(|i| load[i] += mesh(c) * error(c) * c.direction[i]);
        }
        let q = dynamic.lu().solve(&load).expect("damped");
        for (c, list) in spec.contacts.iter().zip(&mut forces) {
            let deflection: Complex<f64> = (0..n).map(|i| q[i] * c.direction[i]).sum();
            list.push(mesh(c) * (deflection - error(c)));
        }
    }
    forces
}

/// Regression values of the heavy-load case: they fix every damper, error phase and inertia at once.
#[test]
fn heavy_load_in_the_frequency_domain() {
    let stage = reference_heavy(500.0, 500.0).unwrap();
    for freedoms in [Freedoms::InPhase, Freedoms::Full] {
        let forces = forced(&stage.assemble(&freedoms).unwrap());
        let last = forces.len() - 1;
        let tables = [([34.62, 29.14, 70.95, 61.77], 168.02), ([47.77, 41.42, 41.63, 41.26], 117.93)];
        for (force, (harmonics, half_range)) in [&forces[0], &forces[last]].into_iter().zip(tables) {
            for (got, want) in force.iter().zip(harmonics) {
                assert!((got.norm() - want).abs() <= 0.02, "{} against {want} N", got.norm());
            }
            let at = |i: u32| -> f64 {
                let turn = TAU * f64::from(i) / 20_000.0;
                (1..).zip(force).map(|(h, f)| (f * Complex::from_polar(1.0, turn * f64::from(h))).re).sum()
            };
            let (low, high) = (0..20_000).map(at).fold((f64::MAX, f64::MIN), |(a, b), f| (a.min(f), b.max(f)));
            assert!((0.5 * (high - low) - half_range).abs() <= 0.1, "{} {half_range}", 0.5 * (high - low));
        }
    }
    // First harmonic against speed, printed to 0.1 N.
    for (rpm, sun, ring) in [
        (500.0, 34.6, 47.8),
        (1000.0, 14.4, 125.5),
        (1400.0, 65.6, 87.3),
        (1600.0, 101.0, 87.2),
        (2000.0, 195.2, 125.4),
        (2400.0, 252.9, 114.5),
        (3000.0, 262.8, 188.4),
    ] {
        let forces = forced(&reference_heavy(rpm, 500.0).unwrap().assemble(&Freedoms::InPhase).unwrap());
        for (force, want) in forces.iter().zip([sun, ring]) {
            assert!((force[0].norm() - want).abs() <= 0.06, "{rpm} rpm: {} against {want} N", force[0].norm());
        }
    }
}

/// With sequential sun meshes an assemblable, equally spaced set sorts its harmonics: harmonic l drives rotation only if
/// `l Z_s mod N = 0`, and translation of the central bodies only if it is 1 or N − 1 (Parker 2000).
#[test]
fn phasing_sorts_the_modes() {
    let mut stage = lin_parker(4);
    // (Z_s + Z_r)/4 = 36, and Z_s mod 4 = 1: harmonics 1 and 3 translate, 2 moves planets alone, 4 turns.
    stage.teeth = Teeth { sun: 41, planet: 31, ring: 103 };
    stage.rpm = 1000.0;
    for planet in &mut stage.planets {
        for mesh in [&mut planet.sun_mesh, &mut planet.ring_mesh] {
            mesh.error = [1.0, 2.0, 3.0, 4.0].map(|order| MeshHarmonic { order, amplitude: 1e-6, phase: 0.3 }).to_vec();
        }
    }
    let stage = stage.phased(&Phasing::Teeth).unwrap();
    assert!(stage.warnings().is_empty(), "{:?}", stage.warnings());
    let spec = stage.assemble(&Freedoms::FullCarrier).unwrap();
    let forces = forced(&spec);
    let net = |row: usize, h: usize| -> Complex<f64> {
        spec.contacts.iter().zip(&forces).map(|(c, f)| f[h] * c.direction[row]).sum()
    };
    let scale = forces[0][0].norm();
    for (h, turns, translates) in [(0, false, true), (1, false, false), (2, false, true), (3, true, false)] {
        assert_eq!(net(2, h).norm() > 1e-9 * scale, turns, "torque, harmonic {}", h + 1);
        assert_eq!(net(0, h).norm() > 1e-9 * scale, translates, "force, harmonic {}", h + 1);
    }
}

#[test]
fn a_load_on_a_free_motion_has_no_equilibrium() {
    let mut stage = lin_parker(3);
    stage.load.output_torque = 100.0;
    stage.load.planet_drag = 1.0;
    let spec = stage.assemble(&Freedoms::Full).unwrap();
    assert!(matches!(equilibrium(&spec), Err(EquilibriumError::Unbalanced { .. })));
}

/// Hertz contacts in the in-phase reduction, without springs to ground: `F = T_in/(3 r_b)` whatever their stiffness.
#[test]
fn hertz_contacts_at_rest() {
    let mut stage = reference_light(500.0, 100.0).unwrap();
    let forces = |stage: &Planetary| equilibrium(&stage.assemble(&Freedoms::InPhase).unwrap()).unwrap().forces;
    // With the springs, the mesh carries less; the two meshes of a planet carry the same.
    let sprung = forces(&stage);
    stage.sun.rotation = Support::FREE;
    let want = stage.input_torque() / (3.0 * stage.sun.radius);
    for force in forces(&stage) {
        assert_relative_eq!(force, want, max_relative = 1.0e-9);
    }
    assert!(sprung[0] < want && sprung[0] > 0.0);
    assert_relative_eq!(sprung[0], sprung[1], max_relative = 1.0e-9);
}

/// Every load and speed of the light-load figures has its equilibrium, in the stage and in its reduction alike.
#[test]
fn hertz_contacts_at_rest_over_the_load_range() {
    for rpm in [50.0, 500.0, 2000.0] {
        for torque in [0.0, 20.0, 500.0] {
            let stage = reference_light(rpm, torque).unwrap();
            let reduced = equilibrium(&stage.assemble(&Freedoms::InPhase).unwrap()).unwrap().forces;
            let full = equilibrium(&stage.assemble(&Freedoms::Full).unwrap()).unwrap().forces;
            for (force, kind) in full.iter().zip([0, 0, 0, 1, 1, 1]) {
                assert_relative_eq!(*force, reduced[kind], max_relative = 1.0e-8);
            }
        }
    }
}
