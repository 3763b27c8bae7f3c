//! Ratios of whole numbers.

use super::*;

#[test]
fn every_ratio_of_small_whole_numbers_is_found() {
    for q in 1..=400u64 {
        for p in (1..=3 * q).filter(|p| gcd(*p, q) == 1) {
            let x = p as f64 / q as f64;
            for near in [x, x.next_up().next_up(), x.next_down().next_down()] {
                assert_eq!(Ratio::of(near, OF_ORDERS), Some(Ratio { p, q }), "{p}/{q}");
            }
        }
    }
}

#[test]
fn ratios_with_large_terms_are_found_and_others_are_none() {
    for (p, q) in [(1, 10_000), (9999, 10_000), (10_007, 9973), (250_001, 10_000), (1, 7)] {
        assert_eq!(Ratio::of(p as f64 / q as f64, OF_ORDERS), Some(Ratio { p, q }));
    }
    for x in [2f64.sqrt(), 1.0 / 10_001.0, std::f64::consts::PI, 0.02 * (1.0 + 1e-14)] {
        assert_eq!(Ratio::of(x, OF_ORDERS), None, "{x}");
    }
}

#[test]
fn phases_after_many_cycles_are_exact() {
    assert_eq!(Ratio { p: 3, q: 7 }.left_after(7_000_000_000_000_001), 3.0 / 7.0);
    assert_eq!(Ratio { p: 1, q: 50 }.left_after(50), 0.0);
}
