//! Words and what their sequence tells.

use flank::{
    Task,
    orbit::{
        Search,
        words::{Sequence, normal},
    },
};
use serde_json::json;

use super::open;

fn tokens(word: &str) -> Vec<String> {
    word.split_whitespace().map(String::from).collect()
}

#[test]
fn a_word_is_its_smallest_rotation() {
    assert_eq!(normal(&tokens("s0+ c1+ c0+")), tokens("c0+ s0+ c1+"));
    assert_eq!(normal(&tokens("c0+ s0- c0+ s0+")), tokens("c0+ s0+ c0+ s0-"));
    assert!(normal(&[]).is_empty());
}

#[test]
fn a_periodic_sequence_has_no_entropy() {
    let mut sequence = Sequence::default();
    (0..3000).for_each(|cycle| sequence.add(&tokens(["i0+", "i0+ i0+", ""][cycle % 3])));
    let told = sequence.statistics();
    // Blocks at the end of the sequence are one too few: a change of the order of one block in 3000.
    assert!(told.entropy <= 1.0 / 3000.0, "{told:?}");
    assert_eq!((told.different, told.cycles), (3, 3000));
    assert!((told.contacts_per_cycle - 1.0).abs() <= 1e-12);
}

/// Each word is known no better by those before it: ln 2 nats a cycle.
#[test]
fn a_fair_coin_has_the_entropy_of_two() {
    let (mut sequence, mut state, cycles) = (Sequence::default(), 1u64, 20_000);
    for _ in 0..cycles {
        // A generator of Knuth's; its highest bit.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sequence.add(&tokens(if state >> 63 == 1 { "c0+ s0+" } else { "" }));
    }
    let told = sequence.statistics();
    // Of 2^k blocks the estimate strays by √(2·2^k)/(2N), and has 2^k < N/10.
    let strays = (2.0 * f64::from(cycles) / 10.0).sqrt() / (2.0 * f64::from(cycles));
    assert!((told.entropy - std::f64::consts::LN_2).abs() <= 5.0 * strays, "{told:?}");
    assert!(told.memory >= 5);
}

/// Equal masses before equal walls that bounce to rest once a period, the forcing begun at a phase: the word of their orbit.
fn chattering(masses: usize, phase: f64) -> String {
    let unit = |scale: f64| -> Vec<Vec<f64>> {
        (0..masses).map(|i| (0..masses).map(|j| if i == j { scale } else { 0.0 }).collect()).collect()
    };
    let contact = |i: usize| {
        json!({
            "direction": unit(1.0)[i], "half_backlash_m": 0, "flanks": "drive", "law": { "kind": "rigid", "restitution": 0.4 },
        })
    };
    let simulation = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": unit(1.0), "damping_n_s_per_m": unit(0.1), "stiffness_n_per_m": unit(1.0),
            "load_harmonics": [
                { "vector_n": vec![1.0; masses], "frequency_rad_per_s": 0.3, "phase_rad": phase }
            ],
            "contacts": (0..masses).map(contact).collect::<Vec<_>>(),
        },
        "initial": { "q": vec![-0.5; masses], "v": vec![0.0; masses] },
        "run": { "cycles": 40 },
    }));
    let found = Search { period: Some(1), starts: 0 }.run(&simulation, Task::default()).unwrap();
    assert_eq!(found.orbits.len(), 1, "{phase}: {:?}", found.reason);
    assert_eq!(found.orbits[0].section.contacts, found.orbits[0].image.end.contacts);
    found.orbits[0].word()
}

/// A word does not depend on where its cycle begins, be it within a sequence of impacts that comes to rest; and contacts that bounce at one
/// time come to rest at one time.
#[test]
fn a_sequence_of_impacts_is_one_token_wherever_the_cycle_begins() {
    for i in 0..48 {
        let phase = std::f64::consts::TAU * f64::from(i) / 48.0;
        assert_eq!(chattering(1, phase), "l0+ z0+", "phase {phase}");
    }
    assert_eq!(chattering(2, 0.0), "[l0+ l1+] [z0+ z1+]");
}

/// A mass that strikes its back flank on its way to the drive flank, where it bounces to rest: only impacts of the last kind are its end.
#[test]
fn impacts_on_the_other_flank_stay_in_the_word() {
    let simulation = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1]], "damping_n_s_per_m": [[0.1]], "stiffness_n_per_m": [[0.05]], "load_n": [0.3],
            "load_harmonics": [{ "vector_n": [1.0], "frequency_rad_per_s": 0.3, "phase_rad": 0 }],
            "contacts": [{
                "direction": [1], "half_backlash_m": 1, "flanks": "both", "law": { "kind": "rigid", "restitution": 0.5 },
            }],
        },
        "initial": { "q": [0], "v": [0] },
        "run": { "cycles": 60 },
    }));
    let found = Search { period: Some(1), starts: 0 }.run(&simulation, Task::default()).unwrap();
    let word = found.orbits[0].word();
    assert!(word.contains("z0+") && word.contains("i0-") && !word.contains("i0+"), "{word}");
}
