//! Any number of excitation frequencies.

use flank::{scene::Scene, system::Structure};
use serde_json::json;

use super::support::run;

/// A mass between two flanks under an error of `harmonics` frequencies, and `idle` masses that nothing moves.
fn train(harmonics: usize, idle: usize) -> Structure {
    let n = 1 + idle;
    let of_first = |value: f64| (0..n).map(|i| if i == 0 { value } else { 0.0 }).collect::<Vec<_>>();
    let error: Vec<_> = (1..=harmonics)
        .map(|h| {
            let h = h as f64;
            json!({ "amplitude_m": 0.2 / h.powi(2), "frequency_rad_per_s": 0.6 * h, "phase_rad": 0.7 * h })
        })
        .collect();
    let law = json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.1 });
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": vec![1.0; n], "load_n": of_first(0.1),
            "contacts": [{ "direction": of_first(1.0), "half_backlash_m": 1, "stiffness": 1, "error": error, "law": law }],
        },
        "initial": { "q": of_first(1.1) },
        "run": { "t_end_s": 1 },
    });
    Structure::new(Scene::from_value(scene, "train").unwrap().build().unwrap().spec).unwrap()
}

/// With more than 24 freedoms the recurrence on fixed columns gives way to the one for any size: both say the same.
#[test]
fn both_recurrences_give_the_same_events() {
    for harmonics in [15, 16, 17, 40, 100] {
        let [few, many] = [0, 24].map(|idle| {
            let (mut q, v) = (vec![0.0; 1 + idle], vec![0.0; 1 + idle]);
            q[0] = 1.1;
            run(&train(harmonics, idle), &q, &v, 40.0)
        });
        let (a, b) = (few.events(), many.events());
        assert!(a.len() > 2 && a.len() == b.len(), "{harmonics}: {} and {} events", a.len(), b.len());
        for (x, y) in a.iter().zip(&b) {
            assert_eq!((x.from.clone(), x.to.clone()), (y.from.clone(), y.to.clone()));
        }
        for i in 0..a.len() {
            // Rounding, and what a few impacts make of it.
            let off = (few.time(i) - many.time(i)).abs();
            assert!(off < 1e-11, "{harmonics}: event {i} off by {off:e}");
        }
    }
}
