//! Instants: cycles and phases that do not lose digits.

use flank::hybrid::{Clock, Wide};

#[test]
fn two_pi_is_right_to_thirty_two_digits() {
    // 2π = 6.283185307179586476925286766559…; the tail after the leading double.
    assert_eq!(Wide::TAU.hi, std::f64::consts::TAU);
    assert_eq!(Wide::TAU.lo, 2.0 * 1.224_646_799_147_353_2e-16);
}

#[test]
fn a_phase_does_not_depend_on_the_cycle() {
    let clock = Clock::new(Some(0.9));
    let (mut a, mut b) = (clock.at(0, 1.25), clock.at(1_000_000_000, 1.25));
    for k in 0..10_000 {
        let h = 0.37 + 1e-3 * f64::from(k % 7);
        a = clock.advance(a, h);
        b = clock.advance(b, h);
        assert_eq!(a.phase, b.phase);
    }
    assert_eq!(b.cycle - a.cycle, 1_000_000_000);
}

#[test]
fn time_is_the_sum_of_steps_to_round_off_of_one_step() {
    let clock = Clock::new(Some(0.9));
    let mut at = clock.instant(0.0);
    for _ in 0..1_000_000 {
        at = clock.advance(at, 0.125);
    }
    assert_eq!(clock.time(at).value(), 125_000.0);
}

#[test]
fn the_later_of_two_instants_is_the_larger() {
    for clock in [Clock::new(Some(0.9)), Clock::new(None)] {
        let period = clock.period().map_or(7.0, Wide::value);
        let steps = [0.0, 1e-30, 1e-17, 0.25, period - 1e-15, period, period + 1e-17, 5.5 * period];
        let instants = steps.map(|step| clock.advance(clock.instant(2.0), step));
        for a in instants {
            for b in instants {
                let later = clock.between(a, b);
                assert_eq!((a < b, a == b, a > b), (later > 0.0, later == 0.0, later < 0.0), "{a:?} {b:?}");
            }
        }
    }
}
