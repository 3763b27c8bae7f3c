//! Words and what their sequence tells.

use flank::orbit::words::{Sequence, normal};

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
