//! The kind of a motion, one scene or more of each.

use std::f64::consts::TAU;

use flank::{
    Task,
    orbit::{Motion, MotionKind},
    scene::Scene,
    study::steady::{Rule, steady},
};
use serde_json::{Value, json};

fn motion(scene: Value) -> Motion {
    steady(Scene::from_value(scene, "test").unwrap(), None, &Rule::default(), Task::default()).unwrap().motion
}

/// A mass on a spring of stiffness 1, before a wall at 0.
struct Wall {
    damping: f64,
    load: f64,
    force: [f64; 2],
    restitution: f64,
    start: [f64; 2],
}

impl Wall {
    fn motion(&self) -> Motion {
        motion(json!({
            "flank": 1,
            "train": {
                "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1, "damping_n_s_per_m": self.damping, "load_n": self.load,
                "load_harmonics": [{ "amplitude_n": self.force[0], "frequency_rad_per_s": self.force[1] }],
                "wall": { "side": "above", "position_m": 0 },
                "law": { "kind": "rigid", "restitution": self.restitution },
            },
            "initial": { "q": [self.start[0]], "v": [self.start[1]] },
            "run": { "cycles": 100 },
        }))
    }
}

/// A pair; its damping acts in the gap as well.
fn pair(damping: f64, load: f64, error: [f64; 2], start: [f64; 2]) -> Motion {
    motion(json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": damping, "damping_in_gap": true, "mean_load": load,
            "stiffness": 1, "transmission_error": [{ "amplitude": error[0], "frequency": error[1] }],
        },
        "initial": { "q": [start[0]], "v": [start[1]] },
        "run": { "cycles": 100 },
    }))
}

/// Without damping and before any impact, the free vibration stays: 1/φ turns a cycle beside the forced one, from 0 to ½: 1/φ².
#[test]
fn a_free_vibration_is_quasi_periodic() {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let free = Wall { damping: 0.0, load: -1.0, force: [0.1, golden], restitution: 0.8, start: [-0.9, 0.0] };
    let motion = free.motion();
    assert_eq!(motion.kind, MotionKind::QuasiPeriodic, "{motion:?}");
    // Weighted averages over 1000 cycles and more: what is left is rounding.
    assert!((motion.rotation.unwrap() - 1.0 / (golden * golden)).abs() <= 1e-12, "{motion:?}");
    assert_eq!(motion.period, None);
}

/// A published chaotic pair: its exponent is 0.0754 with saltation.
#[test]
fn a_positive_exponent_is_chaos() {
    let scene = Scene::from_file("examples/scenes/W1a-ch.json").unwrap();
    let motion = steady(scene, None, &Rule::default(), Task::default()).unwrap().motion;
    assert_eq!(motion.kind, MotionKind::Chaotic, "{motion:?}");
    let [exponent, band] = motion.exponent.unwrap();
    assert!((exponent - 0.0754).abs() <= 5.0 * band && exponent > 3.0 * band, "{motion:?}");
}

/// Rest takes all ranks: neighbours become one, and the motion has a period, here of ten cycles.
#[test]
fn rest_ends_in_a_long_period() {
    let rests = Wall {
        damping: 0.016_803_2,
        load: 0.110_484,
        force: [0.213_67, 2.518_19],
        restitution: 0.507_86,
        start: [-0.448_699, 0.008_614_95],
    };
    let motion = rests.motion();
    assert_eq!((motion.kind, motion.period), (MotionKind::Periodic, Some(10)), "{motion:?}");
    assert!(motion.word.as_ref().unwrap().contains('z') && motion.multiplier == Some(0.0), "{motion:?}");
}

/// Motions that settle after hundreds of cycles, to periods of four and sixteen.
#[test]
fn late_orbits_are_found() {
    let late = pair(0.006_180_69, 0.072_316_5, [0.189_187, 1.035_11], [1.450_1, -0.121_543]);
    assert_eq!((late.kind, late.period), (MotionKind::Periodic, Some(4)), "{late:?}");
    let late = Wall {
        damping: 0.012_492_6,
        load: 0.018_031_4,
        force: [0.515_152, 1.146_32],
        restitution: 0.664_627,
        start: [-0.497_965, -0.057_603_2],
    };
    let late = late.motion();
    assert_eq!((late.kind, late.period), (MotionKind::Periodic, Some(16)), "{late:?}");
}

/// A constant push without drag, or resonance without damping: no steady motion.
#[test]
fn motions_that_leave_are_transient() {
    let free = |load: f64, stiffness: f64, omega: f64| {
        motion(json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [[1.0]], "damping_n_s_per_m": [[0.0]], "stiffness_n_per_m": [[stiffness]],
                "load_n": [load], "load_harmonics": [{ "vector_n": [1.0], "frequency_rad_per_s": omega }],
                "contacts": [],
            },
            "initial": { "q": [0.0], "v": [0.0] },
            "run": { "cycles": 10, "period_s": TAU / omega },
        }))
    };
    let accelerates = free(0.3, 0.0, 1.0);
    assert_eq!(accelerates.kind, MotionKind::Transient);
    assert!(accelerates.reason.unwrap().contains("accelerates for ever"));
    // At resonance the amplitude grows by π a cycle: no exponent, and no averages.
    let grows = free(0.0, 1.0, 1.0);
    assert_eq!(grows.kind, MotionKind::Transient, "{grows:?}");
    assert!(grows.reason.unwrap().contains("still grows"));
}

/// Planets that move in phase: their motion is unstable against differences of the planets, and a run that starts on it leaves it.
#[test]
fn an_unstable_symmetric_orbit_is_left() {
    let mut scene: Value =
        serde_json::from_str(&std::fs::read_to_string("examples/scenes/reference-light.json").unwrap()).unwrap();
    scene["train"]["speed_rpm"] = json!(700.0);
    let motion = motion(scene);
    assert_eq!(motion.kind, MotionKind::Periodic, "{motion:?}");
    assert!(motion.multiplier.unwrap() < 1.0 && motion.cycles > 100, "{motion:?}");
}
