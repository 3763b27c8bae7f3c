//! Extremes and integrals of polynomials on `[0, 1]`.

use flank::poly::{dot, eval, extremes, moments, shift};

/// `∫₀¹ p q dx`.
fn integral_of(p: &[f64], q: &[f64]) -> f64 {
    let mut all = [0.0; 41];
    moments(p, &mut all);
    dot(&all, q)
}
use proptest::prelude::*;

#[test]
fn extremes_are_found_wherever_they_lie() {
    for k in 0..2000 {
        let at = (f64::from(k) + 0.5) / 2000.0;
        // 2 − 3 (x − a)² + 0.4 (x − a)³, highest at a.
        let mut p = [2.0, 0.0, -3.0, 0.4];
        shift(&mut p, -at, 1.0);
        let [largest, smallest] = extremes(&p);
        let ends = eval(&p, 0.0).min(eval(&p, 1.0));
        assert!((largest - 2.0).abs() < 4e-15 && smallest == ends, "{at}: {largest} {smallest}");
    }
}

#[test]
fn flat_and_short_polynomials_have_extremes() {
    assert_eq!(extremes(&[]), [0.0; 2]);
    assert_eq!(extremes(&[3.0]), [3.0; 2]);
    assert_eq!(extremes(&[3.0, 0.0, 0.0]), [3.0; 2]);
    assert_eq!(extremes(&[1.0, 2.0]), [3.0, 1.0]);
    // A triple root of the derivative: (x − ½)⁴.
    let mut p = [0.0, 0.0, 0.0, 0.0, 1.0];
    shift(&mut p, -0.5, 1.0);
    let [largest, smallest] = extremes(&p);
    assert!((largest - 0.0625).abs() < 1e-16 && smallest.abs() < 1e-15, "{smallest:e}");
}

/// Chebyshev polynomials swing between −1 and 1, `n` times.
#[test]
fn many_equal_extremes_are_found() {
    let (mut before, mut now): (Vec<f64>, Vec<f64>) = (vec![1.0], vec![-1.0, 2.0]);
    for n in 2..=12 {
        let mut next = vec![0.0; n + 1];
        for (k, c) in now.iter().enumerate() {
            next[k] -= 2.0 * c;
            next[k + 1] += 4.0 * c;
        }
        before.iter().enumerate().for_each(|(k, c)| next[k] -= c);
        (before, now) = (now, next);
        let size: f64 = now.iter().map(|c| c.abs()).sum();
        for value in extremes(&now) {
            assert!((value.abs() - 1.0).abs() <= 8.0 * f64::EPSILON * size, "{n}: {value}");
        }
    }
}

proptest! {
    /// Never below a sample; never beyond one by more than a parabola through a spacing allows.
    #[test]
    fn extremes_enclose_all_samples_closely(p in prop::collection::vec(-1.0f64..1.0, 1..26)) {
        let [largest, smallest] = extremes(&p);
        let size: f64 = p.iter().map(|c| c.abs()).sum();
        let curvature: f64 = p.iter().enumerate().map(|(k, c)| (k * k) as f64 * c.abs()).sum();
        let samples: Vec<f64> = (0..=4000).map(|i| eval(&p, f64::from(i) / 4000.0)).collect();
        let [high, low] = [samples.iter().copied().fold(f64::MIN, f64::max), samples.iter().copied().fold(f64::MAX, f64::min)];
        let (rounding, between) = (8.0 * f64::EPSILON * size, curvature / 8.0 / 4000f64.powi(2));
        prop_assert!(largest >= high - rounding && largest <= high + between + rounding, "{largest} {high}");
        prop_assert!(smallest <= low + rounding && smallest >= low - between - rounding, "{smallest} {low}");
    }

    #[test]
    fn integrals_of_products_are_exact(i in 0usize..25, j in 0usize..25, c in -2.0f64..2.0) {
        let (mut p, mut q) = (vec![0.0; 25], vec![0.0; 25]);
        (p[i], q[j]) = (c, 3.0);
        prop_assert!((integral_of(&p, &q) - 3.0 * c / (i + j + 1) as f64).abs() <= 4.0 * f64::EPSILON);
    }

    #[test]
    fn a_shifted_polynomial_has_the_values_of_the_piece(
        p in prop::collection::vec(-1.0f64..1.0, 1..26), low in 0.0f64..0.5, width in 0.0f64..0.5, x in 0.0f64..1.0,
    ) {
        let mut piece = p.clone();
        shift(&mut piece, low, width);
        // Every coefficient is a sum of positive multiples of those of p, at most 2ⁿ of each.
        let size: f64 = p.iter().enumerate().map(|(k, c)| (low + width).powi(k as i32) * c.abs()).sum();
        prop_assert!((eval(&piece, x) - eval(&p, low + width * x)).abs() <= 256.0 * f64::EPSILON * size);
    }
}
