//! Impacts against a direct count from the log, force and transmission error against closed forms.

use flank::{
    Simulation, Task,
    scene::Scene,
    study::steady::{Rule, steady},
};
use serde_json::{Value, json};

fn pair(changes: &[(&str, Value)]) -> Scene {
    let mut scene = json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": 0.02, "damping_in_gap": true, "mean_load": 0.1,
            "transmission_error": [{ "amplitude": 0.2, "frequency": 1.1 }]
        },
        "initial": { "q": [1.1] }, "run": { "cycles": 400, "transient_cycles": 100 }
    });
    for (pointer, value) in changes {
        *scene.pointer_mut(pointer).unwrap() = value.clone();
    }
    Scene::from_json(&scene.to_string(), "pair").unwrap()
}

/// Counts and order statistics are those of the log, to the last bit; sums to rounding.
#[test]
fn impacts_are_those_of_the_log() {
    // Chaos with both flanks, by both releases: by force a contact can close again inside its zone.
    for release in ["force", "deflection"] {
        let mut scene = pair(&[]).given().clone();
        scene["train"]["release"] = json!(release);
        scene["train"]["damping_in_gap"] = json!(false);
        let scene = Scene::from_json(&scene.to_string(), "pair").unwrap();
        let record = Simulation::from_scene(scene).unwrap().run().unwrap();
        let (mut speeds, mut flanks) = (Vec::new(), [0; 2]);
        for contact in record.events.iter().filter(|event| event.n >= 100).flat_map(|event| &event.contacts) {
            let approach = contact.approach.filter(|v| *v > 0.0 && contact.from == "separated");
            if let (Some(approach), "drive" | "back") = (approach, contact.to) {
                speeds.push(approach);
                flanks[usize::from(contact.to == "back")] += 1;
            }
        }
        speeds.sort_by(f64::total_cmp);
        let (n, impacts) = (speeds.len(), record.contacts[0].impacts);
        assert!(flanks[0] > 100 && flanks[1] > 10, "{flanks:?}");
        assert_eq!([impacts.drive, impacts.back], flanks);
        assert_eq!(impacts.speed_max, speeds.last().copied());
        for (percent, found) in [(50, impacts.speed_50), (95, impacts.speed_95), (99, impacts.speed_99)] {
            assert_eq!(found, Some(speeds[(percent * n).div_ceil(100) - 1]), "{percent} %");
        }
        let near = |found: Option<f64>, exact: f64| assert!((found.unwrap() - exact).abs() <= 1e-14 * exact);
        near(impacts.speed_mean, speeds.iter().sum::<f64>() / n as f64);
        near(impacts.speed_rms, (speeds.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt());
        near(Some(impacts.per_second), n as f64 / record.contacts[0].time);
        near(impacts.per_cycle, n as f64 / 300.0);
        near(Some(record.contacts[0].energy_loss_rate), record.contacts[0].energy_lost / record.contacts[0].time);
    }
}

/// Without loss of contact the motion is linear. RMS values are amplitudes over √2.
#[test]
fn force_and_transmission_error_of_a_linear_motion() {
    for omega in [0.5, 1.6, 2.5] {
        let (zeta, load, error): (f64, f64, f64) = (0.05, 0.1, 0.05);
        let scene = pair(&[
            ("/train/damping_ratio", json!(zeta)),
            ("/train/transmission_error/0", json!({ "amplitude": error, "frequency": omega })),
        ]);
        let found = steady(scene, None, &Rule::default(), Task::default()).unwrap();
        let contact = &found.contacts[0];
        assert_eq!(contact.report.impacts.per_cycle, Some(0.0), "no impacts at {omega}");
        // x'' + 2ζx' + x = F_m + F_a Ω² cos Ωt, in complex amplitudes.
        let (re, im) = (1.0 - omega * omega, 2.0 * zeta * omega);
        let size = error * omega * omega / (re * re + im * im);
        let (x, y) = (size * re, -size * im);
        // This train has the deflection as its coordinate: gᵀq is x.
        let transmission = (x * x + y * y).sqrt();
        let near = |found: f64, exact: f64, name: &str| {
            assert!((found - exact).abs() <= 1e-9 * exact, "{name} at {omega}: {found} for {exact}");
        };
        near(contact.transmission_rms, transmission / 2f64.sqrt(), "rms");
        near(contact.transmission_peak_to_peak, 2.0 * transmission, "peak to peak");
        // The damper acts in the gap too, so the contact has the force of its spring.
        let force = transmission;
        near(contact.report.force_deviation.unwrap(), force / 2f64.sqrt(), "force");
        near(contact.report.force_mean, load, "mean force");
    }
}
