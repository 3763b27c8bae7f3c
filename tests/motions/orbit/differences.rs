//! The derivative of whole cycles against extrapolated differences of runs.

use flank::{
    Simulation,
    orbit::{Section, SectionMap},
};
use serde_json::{Value, json};

use super::{numbers, open, scales, six_points};

/// Differences of doubles, extrapolated to the sixth order: their rounding is some 1e-16 over the best step, about 1e-5 to 1e-6.
const ALLOWED: f64 = 1e-9;

/// `∂P/∂x_i` by differences.
fn difference(map: &SectionMap<'_>, start: &Section, cycles: u64, i: usize, step: f64) -> Option<Vec<f64>> {
    six_points(step, |off| {
        let mut x = start.x.clone();
        x[i] += off;
        map.follow(&Section { x, contacts: start.contacts.clone() }, cycles).ok().map(|end| end.x)
    })
}

/// The largest difference of the derivative of `cycles` cycles after `before` ones to extrapolated differences of runs, relative to its
/// largest entry, in the scales of the motion.
pub fn disagreement(simulation: &Simulation, before: u64, cycles: u64) -> (f64, String) {
    let map = SectionMap::new(simulation).unwrap();
    let mut start = map.start().unwrap();
    if before > 0 {
        start = map.follow(&start, before).unwrap();
    }
    let image = map.image(&start, cycles).unwrap();
    // The largest of differences passes over what is no number.
    assert!(image.jacobian.iter().all(|entry| entry.is_finite()));
    let scales = scales(simulation, &image);
    let scale = |i: usize| scales[i];
    let dim = start.x.len();
    let mut worst = 0.0f64;
    let largest = (0..dim)
        .flat_map(|r| (0..dim).map(move |c| (r, c)))
        .map(|(r, c)| (image.jacobian[(r, c)] * scale(c) / scale(r)).abs())
        .fold(0.0, f64::max);
    for i in 0..dim {
        // Of several steps that one whose differences are best, as words may change.
        let best = [1e-3, 2e-4, 3e-5, 4e-6, 5e-7]
            .iter()
            .filter_map(|step| difference(&map, &start, cycles, i, step * scale(i)))
            .map(|column| {
                (0..dim)
                    .map(|r| (column[r] - image.jacobian[(r, i)]).abs() * scale(i) / scale(r) / largest)
                    .fold(0.0, f64::max)
            })
            .fold(f64::INFINITY, f64::min);
        worst = worst.max(best);
    }
    (worst, image.word.join(" "))
}

#[test]
fn the_derivative_is_that_of_the_motion_on_every_example() {
    let mut failed = Vec::new();
    for (scene, before, cycles) in [
        ("W1a-ss", 5, 2),
        ("W1a-ds", 5, 2),
        ("W1b-ds", 5, 2),
        ("W1c-ds", 5, 2),
        ("W2b", 2, 1),
        ("W3", 1, 1),
        ("W3-sym", 1, 1),
        ("W4", 1, 1),
        ("W5b-p", 5, 2),
        ("kahraman-singh", 5, 2),
        ("spur-pair", 2, 1),
        ("reference-heavy", 1, 1),
        ("reference-light", 1, 1),
    ] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let (worst, word) = disagreement(&simulation, before, cycles);
        println!("{scene:18} {worst:9.1e}  {}", &word[..word.len().min(70)]);
        if worst > ALLOWED {
            failed.push(scene);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// The kinds of events that the scenes below go through.
pub const EVENTS: &str = "acilrsxz";

/// Two masses, the first driven and between flanks, coupled by a spring.
fn two(contacts: &Value, omega: f64, error: f64, q: [f64; 2]) -> Simulation {
    open(two_scene(contacts, omega, error, q))
}

/// The same as a scene.
pub fn two_scene(contacts: &Value, omega: f64, error: f64, q: [f64; 2]) -> Value {
    let mut contacts = contacts.clone();
    for contact in contacts.as_array_mut().unwrap() {
        if error != 0.0 {
            contact["error"] = json!([{ "amplitude_m": error, "frequency_rad_per_s": if omega < 0.5 { 8.0 * omega } else { omega }, "phase_rad": 0.4 }]);
        }
    }
    json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1.0, 0.1], [0.1, 1.5]],
            "damping_n_s_per_m": [[0.08, -0.03], [-0.03, 0.05]],
            "stiffness_n_per_m": [[0.6, -0.4], [-0.4, 0.5]],
            "load_n": [0.25, 0.05],
            "load_harmonics": [{ "vector_n": [0.9, 0.1], "frequency_rad_per_s": omega, "phase_rad": 0.3 }],
            "contacts": contacts,
        },
        "initial": { "q": q, "v": [0.0, 0.0] },
        "run": { "cycles": 10, "period_s": std::f64::consts::TAU / omega },
    })
}

pub fn contact(law: Value, stiffness: Value, flanks: &str) -> Value {
    let mut contact = json!({ "direction": [1.0, -0.3], "half_backlash_m": 0.5, "stiffness": stiffness, "flanks": flanks, "law": law });
    if law["kind"] == "rigid" {
        contact.as_object_mut().unwrap().remove("stiffness");
    }
    contact
}

/// Contacts of every law, release and kind of stiffness.
pub fn laws() -> Vec<(&'static str, Value)> {
    let kelvin = |damping: f64, release: &str| json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": damping, "release": release });
    let power = |exponent: &str, hysteresis: f64| {
        json!({
            "kind": "power", "exponent": exponent, "hysteresis_coefficient": hysteresis,
            "speed_floor_m_per_s": 1e-6, "initial_speed_m_per_s": 1e-2,
        })
    };
    let rigid = |restitution: f64| json!({ "kind": "rigid", "restitution": restitution });
    let harmonic = json!({ "kind": "harmonic", "mean": 6.0, "harmonics": [{ "amplitude": 0.3, "frequency_rad_per_s": 2.2, "phase_rad": 0.2 }] });
    let rectangle = json!({ "kind": "rectangular", "high": 8.0, "low": 4.0, "duty": 0.6, "period_s": 2.8559933214452666, "origin_s": 0.1 });
    vec![
        ("damped, by deflection", json!([contact(kelvin(0.7, "deflection"), json!(6.0), "both")])),
        ("damped, by force", json!([contact(kelvin(0.7, "force"), json!(6.0), "both")])),
        ("overdamped, by force", json!([contact(kelvin(9.0, "force"), json!(3.0), "both")])),
        ("stiff, overdamped, by force", json!([contact(kelvin(12.0, "force"), json!(30.0), "both")])),
        ("harmonic, damped", json!([contact(kelvin(0.4, "force"), harmonic, "both")])),
        ("rectangular, damped", json!([contact(kelvin(0.4, "deflection"), rectangle, "drive")])),
        ("Hertz", json!([contact(power("3/2", 0.0), json!(9.0), "both")])),
        ("Hertz, hysteresis", json!([contact(power("3/2", 0.6), json!(9.0), "both")])),
        ("10/9, hysteresis", json!([contact(power("10/9", 0.5), json!(9.0), "drive")])),
        ("square, hysteresis", json!([contact(power("2", 1.2), json!(9.0), "both")])),
        ("rigid", json!([contact(rigid(0.6), Value::Null, "both")])),
        (
            "two laws",
            json!([
                contact(kelvin(0.5, "deflection"), json!(5.0), "drive"),
                { "direction": [0.2, 1.0], "half_backlash_m": 0.3, "flanks": "both", "stiffness": 7.0, "law": power("3/2", 0.4) },
            ]),
        ),
        (
            "rigid and soft",
            json!([
                contact(rigid(0.7), Value::Null, "drive"),
                { "direction": [0.1, 1.0], "half_backlash_m": 0.2, "flanks": "both", "stiffness": 4.0, "law": kelvin(0.3, "force") },
            ]),
        ),
        ("lands and is released", json!([contact(rigid(0.0), Value::Null, "drive")])),
        ("bounces to rest", json!([contact(rigid(0.3), Value::Null, "drive")])),
    ]
}

/// Every law, release and kind of stiffness, with flanks that move and that do not; the words say which events the derivative crossed.
#[test]
fn the_derivative_crosses_every_kind_of_event() {
    let cases = laws();
    let (mut kinds, mut failed) = (std::collections::BTreeSet::new(), Vec::new());
    for (name, contacts) in &cases {
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
            let simulation = two(contacts, omega, error, q);
            let (worst, word) = disagreement(&simulation, 0, 1);
            kinds.extend(word.split([' ', '[', ']']).filter_map(|token| token.chars().next()));
            println!("{name:24} {omega} {worst:9.1e}  {}", &word[..word.len().min(80)]);
            if worst > ALLOWED {
                failed.push(format!("{name} at {omega}: {worst:e}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!(kinds.into_iter().collect::<String>(), EVENTS);
}

/// Whole exponents: a section may stand at any penetration, however small. (The volume does not tell: a wrong stiffness keeps it.)
#[test]
fn powers_with_whole_exponents_start_at_any_penetration() {
    for exponent in ["2", "3", "5"] {
        for penetration in [1e-1, 1e-2, 1e-3, 1e-5, 1e-8] {
            let simulation = open(json!({
                "flank": 1,
                "train": {
                    "kind": "matrices", "mass_kg": [[1]], "damping_n_s_per_m": [[0.1]], "stiffness_n_per_m": [[1]],
                    "load_harmonics": [{ "vector_n": [0.5], "frequency_rad_per_s": 1.0, "phase_rad": 0 }],
                    "contacts": [{
                        "direction": [1], "half_backlash_m": 0.2, "flanks": "drive", "stiffness": 20,
                        "law": { "kind": "power", "exponent": exponent, "hysteresis_coefficient": 0 },
                    }],
                },
                "initial": { "q": [0.2 + penetration], "v": [0.4] },
                "run": { "cycles": 5 },
            }));
            let (worst, word) = disagreement(&simulation, 0, 1);
            assert!(worst <= ALLOWED, "{exponent} {penetration}: {worst:e}, {word}");
        }
    }
}

/// Two equal masses that strike their walls at one instant. Impacts commute where neither changes the speed or the acceleration of the
/// other contact: the map is smooth, whatever spring couples the masses. Coupled by their inertia or by a damper, their order decides:
/// a corner.
#[test]
fn impacts_at_one_instant_commute_or_are_a_corner() {
    for (inertia, damper, is_corner) in [(0.0, 0.0, false), (0.3, 0.0, true), (0.0, 0.05, true)] {
        let contact = |direction: [i32; 2], restitution: f64| json!({ "direction": direction, "half_backlash_m": 0.4, "flanks": "drive", "law": { "kind": "rigid", "restitution": restitution } });
        let scene = json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [[1, inertia], [inertia, 1]],
                "damping_n_s_per_m": [[0.1, -damper], [-damper, 0.1]], "stiffness_n_per_m": [[1.3, -0.3], [-0.3, 1.3]],
                "load_harmonics": [{ "vector_n": [1, 1], "frequency_rad_per_s": 1.2, "phase_rad": 0 }],
                "contacts": [contact([1, 0], 0.5), contact([0, 1], 0.8)],
            },
            "initial": { "q": [0.1, 0.1], "v": [0.4, 0.4] },
            "run": { "cycles": 5 },
        });
        let simulation = open(scene.clone());
        let map = SectionMap::new(&simulation).unwrap();
        let start = map.start().unwrap();
        let image = map.image(&start, 1).unwrap();
        assert_eq!(image.word[0], "[i0+ i1+]", "{:?}", image.word);
        assert_eq!(image.corner.as_ref().map(|corner| &corner.contacts[..]), is_corner.then_some(&[0, 1][..]));
        if let Some(corner) = image.corner {
            assert!((0.0..simulation.period().unwrap()).contains(&corner.phase));
        } else {
            // The second derivative has a jump here: differences are as good as their smallest step.
            const STEP: f64 = 5e-7;
            let (worst, _) = disagreement(&simulation, 0, 1);
            assert!(worst <= STEP, "{worst:e}");
            for pointer in [
                "contacts/1/law/restitution",
                "contacts/0/half_backlash_m",
                "mass_kg/0/0",
                "load_harmonics/0/phase_rad",
            ] {
                let (worst, _) = numbers::disagreement(&scene, &format!("/train/{pointer}"), 1).unwrap();
                assert!(worst <= STEP, "{pointer}: {worst:e}");
            }
        }
    }
}

/// What an impact or a damper does to other contacts at the same instant: it takes their force away, pulls a body off its rest, pushes against
/// a body that rests, or comes as a speed is latched. Each scene starts a little before it.
#[test]
fn forces_that_jump_take_others_along() {
    let soft = |gap: f64, release: &str| {
        json!({
            "direction": [1], "half_backlash_m": gap, "flanks": "drive", "stiffness": 5,
            "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 6, "release": release },
        })
    };
    let wall = |direction: Value, gap: f64, restitution: f64| json!({ "direction": direction, "half_backlash_m": gap, "flanks": "drive", "law": { "kind": "rigid", "restitution": restitution } });
    let mesh = |direction: Value, gap: f64, damping: f64| {
        json!({
            "direction": direction, "half_backlash_m": gap, "flanks": "drive", "stiffness": 30,
            "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": damping, "release": "deflection" },
        })
    };
    let hertz = json!({
        "direction": [1], "half_backlash_m": 0.1, "flanks": "drive", "stiffness": 30,
        "law": { "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0.4, "speed_floor_m_per_s": 1e-6, "initial_speed_m_per_s": 0.1 },
    });
    let one = |contacts: Value| {
        json!({
            "kind": "matrices", "mass_kg": [[1]], "stiffness_n_per_m": [[1]], "damping_n_s_per_m": [[0.2]],
            "load_harmonics": [{ "vector_n": [8], "frequency_rad_per_s": 1, "phase_rad": 0 }], "contacts": contacts,
        })
    };
    let two = |load: f64, contacts: Value| {
        json!({
            "kind": "matrices", "mass_kg": [[1, 0], [0, 1.5]], "stiffness_n_per_m": [[0.5, 0], [0, 1]],
            "damping_n_s_per_m": [[0.1, 0], [0, 0.2]], "load_n": [load, 0],
            "load_harmonics": [{ "vector_n": [0, 3], "frequency_rad_per_s": 1.3, "phase_rad": 0 }], "contacts": contacts,
        })
    };
    for (train, q, expected) in [
        (one(json!([soft(0.1, "force"), wall(json!([1]), 0.4, 0.6)])), json!([-0.5]), "[i1+ r0+]"),
        (
            two(2.0, json!([wall(json!([1, 0]), 0.1, 0.3), mesh(json!([1, -1]), 0.6, 8.0)])),
            json!([0.1, 0.1]),
            "[c1+ l0+]",
        ),
        (two(80.0, json!([wall(json!([1, 0]), 0.1, 0.5), mesh(json!([-1, 1]), 0.2, 10.0)])), json!([0.1, -0.5]), "c1+"),
        (one(json!([soft(0.1, "deflection"), hertz])), json!([-0.5]), "[c0+ c1+]"),
    ] {
        let simulation = open(json!({
            "flank": 1, "train": train, "initial": { "q": q, "v": vec![0.0; q.as_array().unwrap().len()] }, "run": { "cycles": 5 },
        }));
        let map = SectionMap::new(&simulation).unwrap();
        let section = map.start().unwrap();
        let image = map.image(&section, 1).unwrap();
        assert!(image.word.iter().any(|token| token == expected), "{:?}", image.word);
        assert!(image.corner.is_none());
        // A body that rests is moved by nothing: its columns are zero, and it is not moved for differences.
        let rests: Vec<bool> = (0..section.x.len()).map(|i| section.x.len() == 4 && i % 2 == 0).collect();
        let scales = scales(&simulation, &image);
        let largest = image.jacobian.amax();
        for i in (0..section.x.len()).filter(|i| !rests[*i]) {
            let best = [1e-4, 2e-5, 3e-6, 4e-7]
                .iter()
                .filter_map(|step| difference(&map, &section, 1, i, step * scales[i]))
                .map(|column| (0..column.len()).map(|r| (column[r] - image.jacobian[(r, i)]).abs()).fold(0.0, f64::max))
                .fold(f64::INFINITY, f64::min);
            assert!(best <= 100.0 * ALLOWED * largest, "{expected} {i}: {best:e} of {largest:e}");
        }
    }
}

/// A strongly damped contact: its slow rate `2k/(c + √(c² − 4k))` beside the fast one, some c.
#[test]
fn slow_rates_keep_their_digits_beside_fast_ones() {
    for (k, c, omega) in [(1e4f64, 1e5f64, 1.0), (1e6, 1e8, 0.01), (1e3, 1e10, 0.3)] {
        let simulation = open(json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [[1]], "damping_n_s_per_m": [[c]], "stiffness_n_per_m": [[k]],
                "load_harmonics": [{ "vector_n": [1], "frequency_rad_per_s": omega, "phase_rad": 0 }],
                "contacts": [{ "direction": [1], "half_backlash_m": 1e3, "flanks": "drive", "stiffness": 1, "law": { "kind": "kelvin-voigt" } }],
            },
            "initial": { "q": [0], "v": [0] },
            "run": { "cycles": 5 },
        }));
        let map = SectionMap::new(&simulation).unwrap();
        let image = map.image(&map.start().unwrap(), 1).unwrap();
        let root = (c * c - 4.0 * k).sqrt();
        let (slow, fast): (f64, f64) = (-2.0 * k / (c + root), -0.5 * (c + root));
        // `∂q/∂q = (s_f e^{s_s T} − s_s e^{s_f T})/(s_f − s_s)`; the fast exponential is zero.
        let exact = fast / (fast - slow) * (slow * simulation.period().unwrap()).exp();
        // Each of 64 doublings at most rounds some terms of the slow rate.
        assert!(
            (image.jacobian[(0, 0)] / exact - 1.0).abs()
                <= 256.0 * f64::EPSILON * (1.0 - slow * simulation.period().unwrap()),
            "{k} {c}: {}",
            image.jacobian[(0, 0)] / exact - 1.0
        );
    }
}

/// Long spans of fast rates: tables of many doublings, against the closed form of a damped oscillator, `q̈ + 2ζω q̇ + ω² q = 0`.
#[test]
fn a_span_of_thousands_of_radians_is_exact() {
    let (omega, zeta) = (3000.0f64, 1e-4);
    let simulation = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1]], "damping_n_s_per_m": [[2.0 * zeta * omega]], "stiffness_n_per_m": [[omega * omega]],
            "load_harmonics": [{ "vector_n": [1], "frequency_rad_per_s": 1, "phase_rad": 0 }],
            "contacts": [{ "direction": [1], "half_backlash_m": 1, "flanks": "drive", "stiffness": 1, "law": { "kind": "kelvin-voigt" } }],
        },
        "initial": { "q": [0], "v": [0] },
        "run": { "cycles": 5 },
    }));
    let map = SectionMap::new(&simulation).unwrap();
    let image = map.image(&map.start().unwrap(), 1).unwrap();
    let (t, decay, turning) = (simulation.period().unwrap(), zeta * omega, omega * (1.0 - zeta * zeta).sqrt());
    let (sine, cosine) = (turning * t).sin_cos();
    let size = (-decay * t).exp();
    let exact = [
        [cosine + decay / turning * sine, sine / turning],
        [-omega * omega / turning * sine, cosine - decay / turning * sine],
    ];
    // The angle, some 2e4, is known to its rounding, and each of 2¹³ spans adds one.
    let allowed = size * (turning * t) * f64::EPSILON;
    for (i, row) in exact.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let scale = if i == j {
                1.0
            } else if i == 0 {
                omega
            } else {
                1.0 / omega
            };
            let off = (image.jacobian[(i, j)] - size * entry).abs() * scale;
            assert!(off <= allowed, "{i} {j}: {off:e} of {allowed:e}");
        }
    }
}
