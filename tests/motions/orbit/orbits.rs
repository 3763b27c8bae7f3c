//! Orbits and multipliers against numbers from elsewhere, and rules that they must keep.

use flank::{
    Simulation, Task,
    orbit::{Search, SearchResult, SectionMap},
};
use serde_json::json;

use super::open;

fn found(simulation: &Simulation, search: Search) -> SearchResult {
    search.run(simulation, Task::default()).unwrap()
}

/// `x″ + 2ζx′ + f(x) = F_m + e Ω² cos Ωt`, flanks at ±1, damping everywhere.
pub fn pair(damping: f64, load: f64, error: f64, omega: f64, q: f64, v: f64) -> Simulation {
    open(json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": damping, "damping_in_gap": true,
            "mean_load": load, "stiffness": 1,
            "transmission_error": [{ "amplitude": error, "frequency": omega }],
        },
        "initial": { "q": [q], "v": [v] },
        "run": { "cycles": 200 },
    }))
}

/// `x″ + 2ζx′ + x = cos ωt` with a rigid wall at 0.
fn wall(damping: f64, restitution: f64, omega: f64, q: f64, v: f64) -> Simulation {
    open(json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1, "damping_n_s_per_m": 2.0 * damping,
            "load_harmonics": [{ "amplitude_n": 1.0, "frequency_rad_per_s": omega }],
            "wall": { "side": "above", "position_m": 0 },
            "law": { "kind": "rigid", "restitution": restitution },
        },
        "initial": { "q": [q], "v": [v] },
        "run": { "cycles": 200 },
    }))
}

/// The stable orbit of a pair: Taylor series in 48 and 125 digits, saltation, and differences to 40 digits. (P1 of the reference orbits.)
#[test]
fn a_stable_orbit_of_a_pair_has_its_multipliers() {
    let simulation = pair(0.06, 0.13, 0.08, 0.95, 0.83, 0.095);
    let orbit = &found(&simulation, Search::default()).orbits[0];
    assert_eq!((orbit.period, orbit.word().as_str(), orbit.is_stable), (1, "c0+ s0+", true));
    let expected = [0.830_088_664_129_897, 0.094_868_988_394_483_02];
    for (x, expected) in orbit.section.x.iter().zip(expected) {
        assert!((x - expected).abs() <= 4e-15, "{x}");
    }
    let m = orbit.multipliers[0];
    assert!((m.re + 0.045_446_901_492_586_36).abs() <= 1e-14 && (m.im - 0.670_908_969_880_905_7).abs() <= 1e-14, "{m}");
    // The volume shrinks by the damping alone.
    let determinant = (-0.12 * simulation.period().unwrap()).exp();
    // Each entry, at most 1.4, is right to some roundings.
    assert!((orbit.image.jacobian.determinant() - determinant).abs() <= 4e-15);
}

/// A wall without damping: `|μ|² = ε²` at every frequency; the pair of multipliers is from Newton's method in closed form.
#[test]
fn multipliers_of_an_impact_have_the_volume_of_its_restitution() {
    let simulation = wall(0.0, 0.8, 2.4, -0.9, 0.1);
    let orbits = found(&simulation, Search { period: Some(1), starts: 40 }).orbits;
    let orbit = orbits.iter().find(|orbit| orbit.word() == "i0+").unwrap();
    let m = orbit.multipliers[0];
    assert!((m.re - 0.176_267_869_858_833).abs() <= 1e-12 && (m.im - 0.780_339_437_716_325).abs() <= 1e-12, "{m}");
    assert!((m.norm_sqr() - 0.64).abs() <= 1e-14);
}

/// Published orbits of a pair with a soft contact: the period of the search is the smallest one, whatever is asked for.
#[test]
fn a_multiple_of_a_period_is_no_period() {
    let simulation = pair(0.06, 0.13, 0.08, 0.95, 0.83, 0.095);
    let orbit = &found(&simulation, Search { period: Some(4), starts: 0 }).orbits[0];
    assert_eq!(orbit.period, 1);
}

/// A body that two springs hold against each other but nothing holds in place drifts: its multipliers are ones, and are left out.
#[test]
fn a_drifting_train_has_its_orbit_all_the_same() {
    let scene = |drag: f64| {
        open(json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [[1.0, 0.0], [0.0, 2.0]],
                "damping_n_s_per_m": [[0.1 + drag, -0.1], [-0.1, 0.1]],
                "load_n": [0.2, -0.2],
                "load_harmonics": [{ "vector_n": [0.1, -0.1], "frequency_rad_per_s": 1.3, "phase_rad": 0 }],
                "contacts": [{
                    "direction": [1.0, -1.0], "half_backlash_m": 1, "stiffness": 1.0,
                    "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.0 },
                }],
            },
            "initial": { "q": [1.2, 0.0], "v": [0.0, 0.0] },
            "run": { "cycles": 400 },
        }))
    };
    for (drag, ones) in [(0.0, 2), (0.05, 1)] {
        let simulation = scene(drag);
        let search = found(&simulation, Search::default());
        assert_eq!(search.drift.directions.len(), 1);
        assert_eq!(search.drift.is_free[0], drag == 0.0);
        let orbit = &search.orbits[0];
        assert_eq!((orbit.neutral, orbit.is_stable), (ones, true), "{:?}", orbit.multipliers);
        let map = SectionMap::new(&simulation).unwrap();
        let end = map.follow(&orbit.section, orbit.period).unwrap();
        let relative = |x: &[f64]| x[0] - x[1];
        assert!((relative(&end.x) - relative(&orbit.section.x)).abs() <= 1e-13);
    }
}

/// A body at rest over a phase has lost its memory: all multipliers are exact zeros.
#[test]
fn rest_makes_multipliers_zero() {
    let simulation = Simulation::from_file("examples/scenes/W5c.json").unwrap();
    let orbit = &found(&simulation, Search::default()).orbits[0];
    assert_eq!((orbit.period, orbit.word().as_str()), (1, "l0+ z0+"));
    assert!(orbit.multipliers.iter().all(|m| m.norm() == 0.0));
}

/// A latched speed that a contact writes anew is forgotten: one multiplier is an exact zero.
#[test]
fn a_latched_speed_is_forgotten() {
    let simulation = Simulation::from_file("examples/scenes/W2b.json").unwrap();
    let orbit = &found(&simulation, Search::default()).orbits[0];
    assert_eq!(orbit.multipliers.len(), 3);
    assert_eq!(orbit.multipliers.iter().filter(|m| m.norm() == 0.0).count(), 1);
}

#[test]
fn a_train_without_a_period_has_no_section() {
    let simulation = Simulation::from_file("examples/scenes/ball-on-wall.json").unwrap();
    let error = Search::default().run(&simulation, Task::default()).unwrap_err().to_string();
    assert!(error.contains("period"), "{error}");
}

/// Contacts remember more than q and v at phase 0: the speed that they have latched, or that they have let go inside the zone of a flank.
/// A scene that starts on the orbit has to say it.
#[test]
fn an_orbit_that_is_cut_in_contact_goes_on_from_its_scene() {
    let hysteresis = json!({ "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0.5, "speed_floor_m_per_s": 1e-6, "initial_speed_m_per_s": 0.5 });
    let by_force = json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 8.0, "release": "force" });
    let scene = |phase: f64, law: &serde_json::Value, initial: &serde_json::Value| {
        json!({
            "flank": 1,
            "train": {
                "kind": "wall", "mass_kg": 1, "damping_n_s_per_m": 0.1, "load_n": 1.0,
                "load_harmonics": [{ "amplitude_n": 1.5, "frequency_rad_per_s": 3.0, "phase_rad": phase }],
                "wall": { "side": "above", "position_m": 0 }, "contact_stiffness": 40, "law": law,
            },
            "initial": initial,
            "run": { "cycles": 400 },
        })
    };
    for (law, memory) in [(hysteresis, "latched"), (by_force, "detached")] {
        let mut checked = 0;
        for phase in (0..32).map(|i| f64::from(i) * 0.2) {
            let simulation = open(scene(phase, &law, &json!("rest")));
            let search = found(&simulation, Search::default());
            let orbit = &search.orbits[0];
            let initial = search.report(&simulation)["orbits"][0]["initial"].clone();
            if initial[memory].is_null() {
                continue;
            }
            let again = open(scene(phase, &law, &initial));
            let map = SectionMap::new(&again).unwrap();
            let start = map.start().unwrap();
            assert_eq!(start.x, orbit.section.x);
            assert_eq!(start.contacts, orbit.section.contacts);
            let end = map.follow(&start, orbit.period).unwrap();
            for (a, b) in end.x.iter().zip(&start.x) {
                assert!((a - b).abs() <= 1e-12, "{a} {b}");
            }
            checked += 1;
        }
        // The mass is in contact over a part of the period.
        assert!((1..32).contains(&checked), "{memory}: {checked}");
    }
}

/// Two contacts that latch speeds and are never open at one time: only one of the speeds is dead at any time, and only one multiplier is
/// exactly zero. The product of the others is 1.3241e-9 by differences of runs.
#[test]
fn latched_speeds_that_overlap_are_not_all_forgotten() {
    let contact = |direction: [i32; 2]| {
        json!({
            "direction": direction, "half_backlash_m": 0, "flanks": "drive", "stiffness": 12,
            "law": {
                "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0.6,
                "speed_floor_m_per_s": 1e-6, "initial_speed_m_per_s": 0.5,
            },
        })
    };
    let simulation = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1, 0], [0, 1.3]], "damping_n_s_per_m": [[0.05, 0], [0, 0.05]],
            "stiffness_n_per_m": [[1, -1], [-1, 1]], "load_n": [1, 1.1],
            "load_harmonics": [{ "vector_n": [1.4, -1.4], "frequency_rad_per_s": 1.2, "phase_rad": 0 }],
            "contacts": [contact([1, 0]), contact([0, 1])],
        },
        "initial": { "q": [0.05, 0.05], "v": [0, 0] },
        "run": { "cycles": 200 },
    }));
    let orbit = &found(&simulation, Search { period: Some(1), starts: 0 }).orbits[0];
    assert_eq!(orbit.word(), "c0+ s1+ c1+ s0+");
    let sizes: Vec<f64> = orbit.multipliers.iter().map(|m| m.norm()).collect();
    let zeros = sizes.iter().filter(|size| **size == 0.0).count();
    let product: f64 = sizes.iter().filter(|size| **size > 0.0).product();
    assert!(zeros == 1 && (product / 1.3241e-9 - 1.0).abs() <= 1e-4, "{:?}", orbit.multipliers);
}

/// A contact is gained at phase 0, to the last digits: the orbit says so.
#[test]
fn an_event_at_phase_0_is_told() {
    let at = |phase: f64| {
        let simulation = open(json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [[1]], "stiffness_n_per_m": [[0.3]], "damping_n_s_per_m": [[0.1]],
                "load_harmonics": [
                    { "vector_n": [1], "frequency_rad_per_s": 1, "phase_rad": 1.291_847_734_445_352_3 + phase }
                ],
                "contacts": [{
                    "direction": [1], "half_backlash_m": 0, "flanks": "drive", "stiffness": 20,
                    "error": [{ "amplitude_m": 0.06, "frequency_rad_per_s": 1, "phase_rad": 1.991_847_734_445_352_2 + phase }],
                    "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 2, "release": "deflection" },
                }],
            },
            "initial": { "q": [-0.062_635_041_423_558_72], "v": [3.811_604_638_867_492_2] },
            "run": { "cycles": 300 },
        }));
        let found = found(&simulation, Search { period: Some(1), starts: 0 });
        found.orbits[0].image.has_event_at_section
    };
    assert!(at(0.0) && !at(1e-6));
}

/// A bead in a shaken box without gravity (de Souza, Caldas and Viana 2009) rests anywhere in the gap: one family, neither stable nor
/// unstable.
#[test]
fn a_family_of_rests_is_one_orbit() {
    let simulation = open(json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1, "wall": { "side": "both", "half_gap_m": 1 },
            "wall_motion": [{ "amplitude_m": 0.5, "frequency_rad_per_s": 1 }], "law": { "kind": "rigid", "restitution": 0.8 },
        },
        "initial": { "q": [0], "v": [0.6] },
        "run": { "cycles": 400, "transient_cycles": 300 },
    }));
    let orbits = found(&simulation, Search { period: None, starts: 60 }).orbits;
    let resting: Vec<_> = orbits.iter().filter(|orbit| orbit.image.word.is_empty()).collect();
    let [rest] = resting[..] else { panic!("{} rests", resting.len()) };
    assert_eq!(rest.stability().0, "marginal");
    assert!(rest.multipliers.iter().all(|m| (m.re, m.im) == (1.0, 0.0)));
}

/// Further starts find the other orbits of the pair of Kahraman and Singh, the unstable one too.
#[test]
fn further_starts_find_other_orbits_of_a_pair() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/kahraman-singh.json");
    let simulation = Simulation::from_file(path).unwrap();
    let orbits = found(&simulation, Search { period: None, starts: 30 }).orbits;
    for known in [(1, true), (1, false), (2, true)] {
        assert!(orbits.iter().any(|orbit| (orbit.period, orbit.is_stable) == known), "{known:?}: {orbits:?}");
    }
}

/// In contact a pair of stiffness 1 and damping ratio ζ has the multipliers `exp(λT)` with `λ = −ζ ± √(ζ² − 1)`. Over a slow cycle their
/// squares are below the range of numbers.
#[test]
fn multipliers_keep_their_size_however_strong_the_damping() {
    for (damping, frequency) in [(1.2, 0.0131), (1.2, 0.02), (1.05, 0.02)] {
        let simulation = pair(damping, 0.2, 0.1 / (frequency * frequency), frequency, 1.1, 0.0);
        let orbit = &found(&simulation, Search::default()).orbits[0];
        let (period, root) = (std::f64::consts::TAU / frequency, f64::sqrt(damping * damping - 1.0));
        for (multiplier, rate) in orbit.multipliers.iter().zip([root - damping, -root - damping]) {
            // A multiplier below the least number is zero.
            let exact = rate * period;
            let is_right = if exact < -745.0 {
                multiplier.norm() == 0.0
            } else {
                (libm::log(multiplier.re) - exact).abs() < 1e-9 * exact.abs()
            };
            assert!(is_right, "{damping} {frequency}: {multiplier} and not exp({exact})");
        }
    }
}
