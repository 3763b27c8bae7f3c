//! Exponents against their sum rule, multipliers and numbers from elsewhere.

use flank::{
    Simulation, Task,
    orbit::{Averaging, Exponents, Lyapunov, Search},
};
use serde_json::json;

use super::open;

fn measured(simulation: &Simulation, asked: Lyapunov) -> Exponents {
    asked.run(simulation, Task::default()).unwrap()
}

fn chaotic() -> Simulation {
    open(json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": 0.06, "damping_in_gap": true, "mean_load": 0.12,
            "stiffness": 1, "transmission_error": [{ "amplitude": 0.25, "frequency": 1.5 }],
        },
        "initial": { "q": [0.816_789_580_596_225_6], "v": [-0.017_224_927_640_392_993] },
        "run": { "cycles": 20000 },
    }))
}

/// Over 1.2 million periods of a series code the exponents are 0.103926 and −0.223926, with a band of 1.15e-4; over the first ten
/// cycles from the start, with the unit matrix, two codes have these to all digits.
#[test]
fn exponents_of_a_chaotic_pair() {
    let simulation = chaotic();
    let e = measured(&simulation, Lyapunov { cycles: Some(20_000), finite: Some(10), ..Lyapunov::default() });
    let [first, second] = [e.exponents[0].unwrap(), e.exponents[1].unwrap()];
    let band = 3.0 * e.band[0].unwrap().hypot(1.15e-4);
    assert!((first - 0.103_925_557).abs() <= band, "{first} ± {band}");
    // The sum is −2ζ, whatever the motion: to the rounding of a logarithm for each of some four factors a cycle.
    assert!((first + second + 0.12).abs() <= 1e-14 && (e.sum_rule.unwrap() + 0.12).abs() <= 1e-11);
    let finite = e.finite.unwrap();
    for (e, expected) in finite.exponents.iter().zip([0.106_794_021_813_499_8, -0.226_794_021_813_499_8]) {
        // The motion amplifies a rounding by e^(0.107 T) over the ten cycles, T = 41.9: 88 times.
        assert!((e.unwrap() - expected).abs() <= 1e-13, "{e:?}");
    }
}

/// What was kept on the way, through a file, leads to the same exponents to the last bit; contacts may rest where it goes on.
#[test]
fn exponents_that_were_broken_off_go_on() {
    // A load presses the first of two masses on springs to its wall: it bounces to rest.
    let resting = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1, 0], [0, 1]], "damping_n_s_per_m": [[0.1, 0], [0, 0.1]],
            "stiffness_n_per_m": [[2, -1], [-1, 2]], "load_n": [2, 0],
            "load_harmonics": [{ "vector_n": [0.1, 0.3], "frequency_rad_per_s": 0.7, "phase_rad": 0 }],
            "contacts": [{
                "direction": [1, 0], "half_backlash_m": 0.1, "flanks": "drive", "law": { "kind": "rigid", "restitution": 0.6 },
            }],
        },
        "initial": { "q": [-0.3, 0.1], "v": [0, 0] },
        "run": { "cycles": 100 },
    }));
    for (simulation, without_saltation) in [(chaotic(), true), (resting, false)] {
        let asked = Lyapunov { cycles: Some(17_000), without_saltation, finite: Some(5) };
        let mut kept = Vec::new();
        let mut keep = |averaging: &Averaging| kept.push(serde_json::to_string(averaging).unwrap());
        let whole = asked.go_on(&simulation, None, &mut keep, Task::default()).unwrap();
        assert!(kept.len() == 2 && whole.finite.is_some());
        for text in kept {
            let earlier = serde_json::from_str(&text).unwrap();
            let rest = asked.go_on(&simulation, Some(earlier), &mut |_| (), Task::default()).unwrap();
            let text = |e: &Exponents| serde_json::to_string(e).unwrap();
            assert_eq!(text(&rest), text(&whole));
            assert_eq!(rest.course, whole.course);
        }
    }
}

/// `x″ + 2.5 x′ + x` has the exponents −½ and −2. Columns that have turned to them stay there, also where a run begins anew: one that
/// started as a unit matrix again would add some 1e-5 to the mean.
#[test]
fn columns_keep_their_directions_where_a_run_begins_anew() {
    let overdamped = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1]], "damping_n_s_per_m": [[2.5]], "stiffness_n_per_m": [[1]],
            "load_harmonics": [{ "vector_n": [0.1], "frequency_rad_per_s": 3.0, "phase_rad": 0 }],
            "contacts": [{ "direction": [1], "half_backlash_m": 5, "stiffness": 1, "law": { "kind": "kelvin-voigt" } }],
        },
        "initial": { "q": [0.1], "v": [0] },
        "run": { "cycles": 100 },
    }));
    let found = Lyapunov { cycles: Some(9000), ..Lyapunov::default() }.run(&overdamped, Task::default()).unwrap();
    for (exponent, expected) in found.exponents.iter().zip([-0.5, -2.0]) {
        // A mean of 9000 sums, each rounded.
        assert!((exponent.unwrap() - expected).abs() <= 1e-12, "{exponent:?}");
    }
}

/// A load holds the first of two masses to its flank: the speed of its only gain is latched for ever. Columns turn to what follows from that,
/// which has nothing of the second mass, coupled by 1e-10; averages of columns that are not turned back would be off by `2 ln 1e-10/(N T)`, 0.04.
/// Of the second mass alone the two exponents have the sum −0.1.
#[test]
fn a_speed_that_is_latched_once_leaves_no_trace_in_exponents() {
    let scene = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1, 0], [0, 1]], "damping_n_s_per_m": [[0.4, 0], [0, 0.1]],
            "stiffness_n_per_m": [[1, 1e-10], [1e-10, 3]], "load_n": [5, 0],
            "load_harmonics": [{ "vector_n": [0.2, 0.3], "frequency_rad_per_s": 1.0, "phase_rad": 0 }],
            "contacts": [{
                "direction": [1, 0], "half_backlash_m": 0.2, "flanks": "drive", "stiffness": 20,
                "law": {
                    "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0.3,
                    "speed_floor_m_per_s": 1e-6, "initial_speed_m_per_s": 1e-2,
                },
            }],
        },
        "initial": { "q": [0, 0], "v": [0, 0] },
        "run": { "cycles": 100 },
    }));
    let found = Lyapunov { cycles: Some(200), ..Lyapunov::default() }.run(&scene, Task::default()).unwrap();
    let sum: f64 = found.exponents.iter().flatten().take(2).sum();
    assert!((sum + 0.1).abs() <= 1e-4, "{:?}", found.exponents);
}

/// Where the limit on events ends the run, whole cycles alone are averaged, and the reason is told.
#[test]
fn an_unfinished_cycle_counts_for_nothing() {
    let mut scene = chaotic().resolved().clone();
    scene["run"]["event_budget"] = json!(6000);
    let found = Lyapunov { cycles: Some(5000), ..Lyapunov::default() }.run(&open(scene), Task::default()).unwrap();
    assert!(!found.is_whole && found.reason.as_ref().unwrap().contains("limit on events"), "{:?}", found.reason);
    let rule = -2.0 * 0.06;
    assert!(found.cycles > 10 && found.cycles < 5000, "{}", found.cycles);
    assert!((found.sum.unwrap() - rule).abs() <= 1e-12, "{:?} {}", found.sum, found.cycles);
}

/// Impacts against a wall amplify a rounding of the start by 6.5e12 over 60 periods: the finite-time exponents say how far they are known.
/// `ln σ_max/t` is 0.2270042318035 over t = 130 by a computation with 110 digits.
#[test]
fn finite_time_exponents_state_their_error() {
    let wall = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [1.0], "stiffness_n_per_m": [1.0],
            "load_harmonics": [{ "vector_n": [1.0], "frequency_rad_per_s": 2.9, "phase_rad": 0.0 }],
            "contacts": [{
                "direction": [1.0], "half_backlash_m": 0.0, "flanks": "drive", "law": { "kind": "rigid", "restitution": 0.8 },
            }],
        },
        "initial": { "q": [-0.2], "v": [0.1] },
        "run": { "cycles": 60 },
    }));
    let of = |cycles| {
        let asked = Lyapunov { cycles: Some(1), finite: Some(cycles), ..Lyapunov::default() };
        measured(&wall, asked).finite.unwrap()
    };
    let (short, long) = (of(10), of(60));
    let [early, late] = [&short, &long].map(|finite| finite.errors[0].unwrap());
    // Ten periods amplify little; sixty amplify the rounding of some hundred impacts to a tenth of the state: one digit or two are left.
    assert!(early < 1e-12 && late > 1e-8 && late < 1e-1, "{early:e} {late:e}");
    let time = 60.0 * std::f64::consts::TAU / 2.9;
    // The largest factor of the unit matrix is between the length of its first column and σ_max.
    let (first, largest) = (3_649_885_042_081.333f64.hypot(2_556_741_732_534.168), 6_545_866_659_363.77f64);
    let exponent = long.exponents[0].unwrap();
    assert!((exponent - first.ln() / time).abs() <= 2.0 * late, "{exponent} {} {late:e}", first.ln() / time);
    assert!(exponent <= largest.ln() / time + late);
}

/// A periodic motion has the exponents `ln |μ|/T` of its multipliers.
#[test]
fn exponents_of_an_orbit_are_those_of_its_multipliers() {
    for (scene, cycles) in [("kahraman-singh", 200), ("W5b-p", 200), ("W2b", 200), ("W1c-ds", 200)] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let orbit = &Search::default().run(&simulation, Task::default()).unwrap().orbits[0];
        let e = measured(&simulation, Lyapunov { cycles: Some(cycles), ..Lyapunov::default() });
        let time = orbit.period as f64 * simulation.period().unwrap();
        let expected: f64 = orbit.multipliers.iter().filter(|m| m.norm() > 0.0).map(|m| m.norm().ln() / time).sum();
        assert!((e.sum.unwrap() - expected).abs() <= 1e-10 * expected.abs(), "{scene}: {:?} {expected}", e.sum);
        let nulls = e.exponents.iter().filter(|e| e.is_none()).count();
        assert_eq!(nulls, orbit.multipliers.iter().filter(|m| m.norm() == 0.0).count(), "{scene}");
        // A complex pair turns: each of its exponents is a mean over a turn.
        let largest = orbit.largest_multiplier().ln() / time;
        assert!((e.exponents[0].unwrap() - largest).abs() <= 0.02 * largest.abs(), "{scene}");
    }
}

/// A rigid wall without damping: the sum is `2 ln ε` an impact; without the change of impact times the sign of the largest exponent is wrong.
#[test]
fn leaving_saltation_out_changes_the_sign() {
    let simulation = open(json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1,
            "load_harmonics": [{ "amplitude_n": 1.0, "frequency_rad_per_s": 2.8 }],
            "wall": { "side": "above", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 },
        },
        "initial": { "q": [-0.2], "v": [0.1] },
        "run": { "cycles": 20000 },
    }));
    let e = measured(&simulation, Lyapunov { cycles: Some(20_000), without_saltation: true, finite: None });
    let first = e.exponents[0].unwrap();
    // Published elsewhere as 0.1421(5) and 0.1415(5).
    assert!((first - 0.1418).abs() <= 3.0 * e.band[0].unwrap().hypot(5e-4), "{first}");
    assert!((e.sum.unwrap() - e.sum_rule.unwrap()).abs() <= 1e-12);
    // With diag(1, −ε) at an impact: −0.050.
    let bare = e.without_saltation.unwrap().exponents[0].unwrap();
    assert!((bare + 0.050).abs() <= 0.004, "{bare}");
}

/// Rest takes ranks: their exponents are −∞.
#[test]
fn rest_has_no_finite_exponent() {
    let simulation = Simulation::from_file("examples/scenes/W5c.json").unwrap();
    let e = measured(&simulation, Lyapunov { cycles: Some(50), ..Lyapunov::default() });
    assert_eq!(e.exponents, [None, None]);
    assert_eq!(e.sum_rule, None);
}
