//! The isolation of the first root, on random polynomials with known roots: lines 5 and 6.

use flank::poly::{FirstRoot, eval, first_root};
use proptest::prelude::*;

use super::support::product;

/// `Π (x − r) Π ((x − c)² + d²)`, signed to start positive, scaled to a largest coefficient of one.
fn polynomial(roots: &[f64], pairs: &[(f64, f64)]) -> Vec<f64> {
    let mut p = product(1.0, roots);
    for (c, d) in pairs {
        let mut next = vec![0.0; p.len() + 2];
        for (k, a) in p.iter().enumerate() {
            next[k] += a * (c * c + d * d);
            next[k + 1] -= 2.0 * c * a;
            next[k + 2] += a;
        }
        p = next;
    }
    let size = p.iter().fold(0.0f64, |m, c| m.max(c.abs())).copysign(p[0]);
    p.iter().map(|c| c / size).collect()
}

/// A bound on the rounding of a value, coefficients included.
fn rounding(p: &[f64]) -> f64 {
    4.0 * p.len() as f64 * f64::EPSILON * p.iter().map(|c| c.abs()).sum::<f64>()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn l5_the_first_of_the_known_roots_is_found(
        roots in prop::collection::vec(0.02f64..1.5, 1..7),
        pairs in prop::collection::vec((-0.5f64..1.5, 0.1f64..1.0), 0..3),
    ) {
        let mut sorted = roots.clone();
        sorted.sort_by(f64::total_cmp);
        prop_assume!(sorted.windows(2).all(|w| w[1] - w[0] > 1e-2) && (sorted[0] - 1.0).abs() > 1e-6);
        let p = polynomial(&sorted, &pairs);
        let found = first_root(&p, 1.0, rounding(&p));
        if sorted[0] < 1.0 {
            let FirstRoot::At(x) = found.root else { panic!("no root, expected {}", sorted[0]) };
            // To first order the root moves by the value's error over the slope.
            let slope = flank::poly::eval_with_slope(&p, sorted[0]).1.abs();
            prop_assert!((x - sorted[0]).abs() <= 4.0 * rounding(&p) / slope, "{x} {}", sorted[0]);
        } else {
            prop_assert_eq!(found.root, FirstRoot::None);
        }
    }

    #[test]
    fn l5_no_root_is_reported_where_samples_with_a_margin_show_none(
        mut c in prop::collection::vec(-1.0f64..1.0, 2..30), first in 0.2f64..1.2,
    ) {
        c[0] = first * c[1..].iter().map(|c| c.abs()).sum::<f64>();
        // Between samples h apart the value changes by at most h/2 times the largest slope, Σ k |c_k|.
        let (n, bound) = (4000, c.iter().enumerate().map(|(k, c)| k as f64 * c.abs()).sum::<f64>());
        let lowest = (0..=n).map(|i| eval(&c, f64::from(i) / f64::from(n))).fold(f64::INFINITY, f64::min);
        prop_assume!(lowest > 0.5 * bound / f64::from(n) + rounding(&c));
        let found = first_root(&c, 1.0, rounding(&c));
        prop_assert_eq!((found.root, found.touch), (FirstRoot::None, None));
    }

    #[test]
    fn l5_what_is_reported_is_a_fall_through_zero_with_nothing_below_before_it(
        mut c in prop::collection::vec(-1.0f64..1.0, 2..30), limit in 0.1f64..1.0,
    ) {
        c[0] = c[0].abs();
        let (error, first) = (rounding(&c), c[0]);
        prop_assume!(first > error);
        match first_root(&c, limit, error).root {
            FirstRoot::None => {
                prop_assert!((0..=500).all(|i| eval(&c, limit * f64::from(i) / 500.0) >= -2.0 * error));
            }
            FirstRoot::At(x) => {
                prop_assert!(x > 0.0 && x <= limit);
                let slope = flank::poly::eval_with_slope(&c, x).1;
                prop_assert!(eval(&c, x).abs() <= 2.0 * error + 4.0 * f64::EPSILON * slope.abs());
                prop_assert!((0..=500).all(|i| eval(&c, x * f64::from(i) / 500.0) >= -2.0 * error));
            }
        }
    }

    #[test]
    fn l6_a_dip_within_the_uncertainty_is_a_touch_and_a_deeper_one_a_crossing(
        at in 0.05f64..0.95, rise in 0.2f64..2.0, exponent in -14i32..-6, side in prop::bool::ANY,
    ) {
        // rise (x − at)² − dip, the uncertainty a quarter of the dip or four times it. The coefficients are rounded,
        // which moves the lowest value by no more than `rounding`.
        let uncertainty = 10f64.powi(exponent);
        let dip = if side { 4.0 * uncertainty } else { 0.25 * uncertainty };
        let p = [rise * at * at - dip, -2.0 * rise * at, rise];
        prop_assume!(p[0] > 2.0 * uncertainty && rise * (1.0 - at).powi(2) > dip + 2.0 * uncertainty);
        prop_assume!(rounding(&p) < 0.1 * uncertainty);
        let found = first_root(&p, 1.0, uncertainty);
        let width = (dip / rise).sqrt();
        if side {
            let FirstRoot::At(x) = found.root else { panic!("lost a dip of {dip:e}") };
            prop_assert!((x - (at - width)).abs() <= rounding(&p) / (rise * width));
        } else {
            prop_assert_eq!(found.root, FirstRoot::None);
            let touch = found.touch.expect("a touch");
            prop_assert!((touch - at).abs() <= 2.0 * ((dip + uncertainty) / rise).sqrt());
        }
    }
}

#[test]
fn l6_a_dip_within_the_uncertainty_is_a_touch_where_the_interval_is_split_too() {
    let found = first_root(&[0.25 - 1e-17, -1.0, 1.0 - 1e-15], 1.0, 1e-14);
    assert_eq!(found.root, FirstRoot::None);
    assert!(found.touch.is_some());
    // What stays below, however little, has crossed.
    assert!(matches!(first_root(&[1e-3, -1e-3 - 1e-18], 1.0, 1e-14).root, FirstRoot::At(_)));
}
