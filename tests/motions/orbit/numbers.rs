//! The derivative of whole cycles with numbers of a scene.

use flank::{Simulation, orbit::SectionMap, scene::Scene};
use serde_json::Value;

use super::{
    differences::{EVENTS, laws, two_scene},
    orbits::pair,
    scales, six_points,
};

/// `∂P/∂α` at the stable orbit of a pair: differences of a computation with 208 bits. (P1 of the reference orbits.)
#[test]
fn numbers_of_a_pair_have_their_derivatives() {
    let (load, error, omega) = (0.13, 0.08, 0.95);
    let simulation = pair(0.06, load, error, omega, 0.830_088_664_129_897, 0.094_868_988_394_483_02);
    let map = SectionMap::new(&simulation).unwrap();
    let pointers = [
        "/train/transmission_error/0/frequency",
        "/train/mean_load",
        "/train/damping_ratio",
        "/train/transmission_error/0/amplitude",
    ];
    let variations: Vec<_> = pointers.iter().map(|pointer| simulation.variation(pointer).unwrap()).collect();
    let image = map.image_by(&map.start().unwrap(), 1, &variations).unwrap();
    let expected = [
        [0.083_775_888_083_166_5, -0.543_013_123_943_003],
        [1.330_166_312_698_23, 1.082_010_580_962_89],
        [3.143_118_393_516_04, 1.221_590_957_363_29],
        [-2.578_165_906_142_86, 0.335_048_120_450_515],
    ];
    // `dx*/dα`.
    let expected_of_orbit = [
        [0.532_861_172_242_172, -0.313_043_094_490_577],
        [0.052_172_361_356_359_2, 0.958_036_808_559_297],
        [1.280_197_684_969_97, 1.448_100_002_275_07],
        [-2.208_671_785_580_37, -0.370_947_458_977_82],
    ];
    let orbit = map.solve(&map.start().unwrap(), 1, &map.drift()).unwrap();
    let of_orbit = map.orbit_by(&orbit, &variations).unwrap();
    for (l, pointer) in pointers.iter().enumerate() {
        for i in 0..2 {
            let off = [image.by_number[(i, l)] - expected[l][i], of_orbit[(i, l)] - expected_of_orbit[l][i]];
            // Fifteen digits are given; a rounding is amplified by some ten.
            assert!(off.iter().all(|off| off.abs() <= 2e-13), "{pointer} {i}: {off:?}");
        }
    }
}

/// `∂P/∂α` by central differences of six points, as good as the best of several steps makes them; the largest difference to the derivative,
/// relative to its largest entry in the scales of the motion.
pub fn disagreement(scene: &Value, pointer: &str, cycles: u64) -> Option<(f64, String)> {
    let open =
        |scene: &Value| Scene::from_value(scene.clone(), "test").map(|scene| Simulation::from_scene(scene).unwrap());
    let simulation = open(scene).unwrap();
    let map = SectionMap::new(&simulation).unwrap();
    let start = map.start().unwrap();
    let value = simulation.resolved().pointer(pointer)?.as_f64()?;
    let variations = [simulation.variation(pointer).unwrap()];
    let image = map.image_by(&start, cycles, &variations).unwrap_or_else(|error| panic!("{pointer}: {error}"));
    // The largest of differences passes over what is no number.
    assert!(image.by_number.iter().all(|entry| entry.is_finite()), "{pointer}");
    let scales = scales(&simulation, &image);
    let scale = |i: usize| scales[i];
    let dim = start.x.len();
    let size = (0..dim).map(|i| image.by_number[(i, 0)].abs() / scale(i)).fold(1e-2 / value.abs().max(1e-3), f64::max);
    let difference = |step: f64| -> Option<f64> {
        let sum = six_points(step, |off| {
            let mut other = simulation.resolved().clone();
            *other.pointer_mut(pointer).unwrap() = (value + off).into();
            let other = open(&other).ok()?;
            SectionMap::new(&other).unwrap().follow(&start, cycles).ok().map(|end| end.x)
        })?;
        let off = (0..dim).map(|i| (sum[i] - image.by_number[(i, 0)]).abs() / scale(i) / size);
        Some(off.fold(0.0, f64::max))
    };
    let length = if value != 0.0 {
        value.abs()
    } else if pointer.ends_with("_m") {
        1e-5
    } else {
        1.0
    };
    let best = [1e-2, 1e-3, 2e-4, 3e-5, 4e-6]
        .iter()
        .filter_map(|step| difference(step * length))
        .fold(f64::INFINITY, f64::min);
    // At the end of its range a number has no differences of both sides.
    (best.is_finite() || value != 0.0).then(|| (best, image.word.join(" ")))
}

/// Differences of doubles, extrapolated to the sixth order.
const ALLOWED: f64 = 1e-9;

/// Each kind of number, across each kind of event.
#[test]
fn derivatives_with_numbers_cross_every_kind_of_event() {
    let pointers = [
        "/load_n/0",
        "/load_harmonics/0/vector_n/0",
        "/load_harmonics/0/phase_rad",
        "/mass_kg/1/1",
        "/damping_n_s_per_m/0/0",
        "/stiffness_n_per_m/1/1",
        "/contacts/0/direction/1",
        "/contacts/0/half_backlash_m",
        "/contacts/0/stiffness",
        "/contacts/0/stiffness/mean",
        "/contacts/0/stiffness/harmonics/0/amplitude",
        "/contacts/0/stiffness/harmonics/0/phase_rad",
        "/contacts/0/stiffness/high",
        "/contacts/0/stiffness/duty",
        "/contacts/0/stiffness/origin_s",
        "/contacts/0/error/0/amplitude_m",
        "/contacts/0/error/0/phase_rad",
        "/contacts/0/law/damping_n_s_per_m",
        "/contacts/0/law/restitution",
        "/contacts/0/law/hysteresis_coefficient",
        "/contacts/1/stiffness",
        "/contacts/1/half_backlash_m",
    ];
    let (mut kinds, mut failed, mut checked) = (std::collections::BTreeSet::new(), Vec::new(), 0);
    for (name, contacts) in laws() {
        for (omega, error, q) in [
            (0.6, 0.0, [0.1, 0.2]),
            (0.9, 0.0, [-0.2, 0.1]),
            (0.35, 0.0, [0.0, 0.0]),
            (0.4, 0.04, [0.6, 0.0]),
            (1.4, 0.05, [0.2, 0.0]),
        ] {
            if omega == 0.4 && contacts[0]["law"]["kind"] == "rigid" {
                // It would start inside the flank.
                continue;
            }
            let scene = two_scene(&contacts, omega, error, q);
            for pointer in pointers {
                let pointer = format!("/train{pointer}");
                // What comes to rest by a restitution of zero has no neighbour with another one.
                if pointer.ends_with("restitution") && name == "lands and is released" {
                    continue;
                }
                // Nor has a contact without hysteresis, which latches no speed.
                if pointer.ends_with("hysteresis_coefficient") && name == "Hertz" {
                    continue;
                }
                let Some((worst, word)) = disagreement(&scene, &pointer, 1) else { continue };
                kinds.extend(word.split([' ', '[', ']']).filter_map(|token| token.chars().next()));
                checked += 1;
                if worst.is_nan() || worst > ALLOWED {
                    println!("{name:24} {omega} {pointer} {worst:9.1e}  {}", &word[..word.len().min(80)]);
                    failed.push(format!("{name} at {omega}, {pointer}: {worst:e}"));
                }
            }
        }
    }
    // Pairs of a contact and a number that it has.
    assert_eq!(checked, 775);
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!(kinds.into_iter().collect::<String>(), EVENTS);
}

/// Every number of the train of a shipped scene either has its derivative or says why it has none.
#[test]
fn numbers_of_trains_have_their_derivatives() {
    fn pointers(value: &Value, at: &str, all: &mut Vec<String>) {
        match value {
            Value::Object(object) => {
                object.iter().for_each(|(key, value)| pointers(value, &format!("{at}/{key}"), all))
            }
            Value::Array(items) => {
                items.iter().enumerate().for_each(|(i, value)| pointers(value, &format!("{at}/{i}"), all))
            }
            Value::Number(_) => all.push(at.to_owned()),
            _ => {}
        }
    }
    let (mut failed, mut count) = (Vec::new(), Vec::new());
    for name in ["spur-pair", "kahraman-singh", "W1b-ds", "W5b-p", "reference-heavy"] {
        let (mut checked, mut refused) = (0, 0);
        let simulation = Simulation::from_file(format!("examples/scenes/{name}.json")).unwrap();
        let mut all = Vec::new();
        pointers(&simulation.resolved()["train"], "/train", &mut all);
        for pointer in all {
            match simulation.variation(&pointer) {
                Ok(_) => {
                    let Some((worst, _)) = disagreement(simulation.resolved(), &pointer, 1) else { continue };
                    checked += 1;
                    if worst.is_nan() || worst > ALLOWED {
                        failed.push(format!("{name} {pointer}: {worst:e}"));
                    }
                }
                Err(error) => {
                    refused += 1;
                    let reasons = [
                        "whole number",
                        "nothing of the train depends",
                        "alone changes the frequency",
                        "changes its shape",
                        // Spur gears without a face width have no helical neighbours.
                        "allowed: a number from 0 to 60",
                    ];
                    let text = error.to_string();
                    assert!(reasons.iter().any(|reason| text.contains(reason)), "{name} {pointer}: {text}");
                }
            }
        }
        count.push((name, checked, refused));
    }
    // Derivatives and refusals of each scene.
    assert_eq!(
        count,
        [
            ("spur-pair", 25, 6),
            ("kahraman-singh", 7, 0),
            ("W1b-ds", 8, 2),
            ("W5b-p", 9, 0),
            ("reference-heavy", 51, 23)
        ]
    );
    assert!(failed.is_empty(), "{failed:#?}");
}

/// Numbers that have no derivative are refused, each with its reason.
#[test]
fn numbers_without_a_derivative_are_refused() {
    let refused = |scene: &str, pointer: &str, reason: &str| {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let text = simulation.variation(pointer).err().unwrap().to_string();
        assert!(text.contains(reason) && text.contains(pointer), "{text}");
    };
    refused("spur-pair", "/train/teeth/0", "no number at");
    refused("reference-heavy", "/train/teeth/sun", "whole number");
    refused("reference-heavy", "/train/sun_mesh/error/0/order", "alone changes the frequency");
    refused("W5b-p", "/run/cycles", "whole number");
    // A dissipation that is zero latches no speed: with more of it the state has another component.
    let (_, hertz) = laws().into_iter().find(|(name, _)| *name == "Hertz").unwrap();
    let simulation = super::open(two_scene(&hertz, 0.6, 0.0, [0.1, 0.2]));
    let text = simulation.variation("/train/contacts/0/law/hysteresis_coefficient").err().unwrap().to_string();
    assert!(text.contains("changes its shape"), "{text}");
    // Numbers of the run and of the start are no numbers of the train.
    let text = simulation.variation("/initial/q/0").err().unwrap().to_string();
    assert!(text.contains("nothing of the train depends"), "{text}");
}
