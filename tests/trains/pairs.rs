//! Gear pairs, walls and frames.

use std::f64::consts::TAU;

use approx::assert_relative_eq;
use flank::gear::contact::{Law, Rigid};
use flank::gear::{Harmonic, MeshStiffness, Stiffness};
use flank::system::{Flanks, Spec};
use flank::system::{bonded_modes, equilibrium};
use flank::train::{Body, GearPair, KahramanSingh, Mesh, Support, TrainError, WalledOscillator, Walls, frame};

#[test]
fn kahraman_singh() {
    let mut pair = KahramanSingh::new(0.05, 0.1, 0.2, 0.7);
    let spec = pair.assemble().unwrap();
    assert_eq!((spec.damping[(0, 0)], spec.contacts[0].half_backlash), (0.1, 1.0));
    assert_relative_eq!(spec.load_harmonics[0].vector[0], 0.2 * 0.49, max_relative = 1.0e-15);
    pair.damping_in_gap = false;
    pair.stiffness = MeshStiffness::Rectangular { high: 1.2, low: 0.7, duty: 0.6 };
    let spec = pair.assemble().unwrap();
    assert_eq!(spec.damping[(0, 0)], 0.0);
    assert!(matches!(spec.contacts[0].law, Law::KelvinVoigt(linear, _) if linear.damping == 0.1));
    assert_relative_eq!(spec.contacts[0].stiffness.mean(), 1.0, max_relative = 1.0e-15);
    pair.omega = 0.0;
    assert!(matches!(pair.assemble(), Err(TrainError::Value { .. })));
}

/// Two rotors on a spring: one free motion and `ω² = k (1/m₁ + 1/m₂)`; on stiff bearings the six freedoms agree.
#[test]
fn gear_pair() {
    let gear = Body::new(1.0, 2.0e-3, 0.05);
    let mesh = Mesh::bilateral(1.0e8, 0.05, [gear.rotary_mass, gear.rotary_mass]);
    let pair = GearPair {
        driving_teeth: 30,
        driving: gear,
        driven: gear,
        pressure_angle: 20.0f64.to_radians(),
        base_helix: 0.0,
        mesh,
        rpm: 1000.0,
        torque: 10.0,
    };
    let spec = pair.torsional().unwrap();
    let modes = bonded_modes(&spec).unwrap();
    assert_eq!(modes.omega[0], 0.0);
    assert_relative_eq!(modes.omega[1], (2.0e8 / 0.8f64).sqrt(), max_relative = 1.0e-12);
    assert_relative_eq!(spec.omega.unwrap(), TAU * 500.0, max_relative = 1.0e-15);
    assert_relative_eq!(equilibrium(&spec).unwrap().forces[0], 200.0, max_relative = 1.0e-12);
    let stiff = Body { translation: Support::ratio(1.0e13, 0.01), ..gear };
    let pair = GearPair { driving: stiff, driven: stiff, ..pair };
    let six = pair.translational().unwrap();
    // Each bearing lies in series with the mesh: 1/k + 2/k_b. The bodies' own motion on them is another 1e-10.
    let series = modes.omega[1] / (1.0 + 2.0e-5f64).sqrt();
    assert_relative_eq!(bonded_modes(&six).unwrap().omega[1], series, max_relative = 1.0e-9);
    // The mesh force on gear 1 pushes along the line of action: a unit vector.
    let g = &six.contacts[0].direction;
    assert_relative_eq!(g[0].hypot(g[1]), 1.0, max_relative = 1.0e-15);
    assert_relative_eq!(equilibrium(&six).unwrap().forces[0], 200.0, max_relative = 1.0e-9);
}

#[test]
fn walls() {
    let law = Law::Rigid(Rigid::constant(0.8));
    let gap = |spec: &Spec, x: f64, t: f64| {
        let c = &spec.contacts[0];
        let e: f64 = c.error.iter().map(|h| h.amplitude * (h.omega * t + h.phase).cos()).sum();
        c.direction[0] * x - e - c.half_backlash
    };
    let motion = vec![Harmonic { omega: 2.0, amplitude: 0.3, phase: 0.1 }];
    let build = |walls| WalledOscillator {
        motion: motion.clone(),
        ..WalledOscillator::new(1.0, walls, law, Stiffness::Constant(0.0))
    };
    let w = 0.3 * (2.0f64 * 0.7 + 0.1).cos();
    let above = build(Walls::Above { position: 0.5 }).assemble().unwrap();
    let below = build(Walls::Below { position: 0.5 }).assemble().unwrap();
    assert_relative_eq!(gap(&above, 0.9, 0.7), 0.9 - 0.5 - w, max_relative = 1.0e-14);
    assert_relative_eq!(gap(&below, 0.9, 0.7), 0.5 + w - 0.9, max_relative = 1.0e-14);
    let both = build(Walls::Between { half_gap: 0.5 }).assemble().unwrap();
    assert_eq!(both.contacts[0].flanks, Flanks::Both);
}

#[test]
fn frames() {
    let there = frame::to_fixed([1.0, 2.0], 0.3);
    let back = frame::to_fixed(there, -0.3);
    assert_relative_eq!(back[0], 1.0, max_relative = 1.0e-15);
    assert_relative_eq!(there[0], 0.3f64.cos() - 2.0 * 0.3f64.sin(), max_relative = 1.0e-15);
}
