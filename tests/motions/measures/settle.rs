//! When a transient is over.

use flank::analysis::Sections;

const TOLERANCE: f64 = 1e-9;

/// Sections of a linear map `x ← a + ρ^n`, repeated with a period.
fn settles(x: impl Fn(u32) -> f64) -> Option<(u32, u32, f64)> {
    let mut sections = Sections::new(1, 1.0, 8);
    (0..2000).find_map(|n| sections.take(&[x(n), 1.0], TOLERANCE).map(|(p, left)| (n, p, left)))
}

#[test]
fn slow_decay_is_not_taken_for_rest() {
    for rho in [0.3f64, 0.9, 0.99] {
        let (n, period, _) = settles(|n| 1.0 + 0.1 * rho.powi(n as i32)).unwrap();
        assert_eq!(period, 1);
        // The true distance is within the tolerance, up to the change of scale (1.1 for 1).
        assert!(0.1 * rho.powi(n as i32) <= 1.2 * TOLERANCE / rho, "{rho}: {n}");
    }
}

#[test]
fn slow_decay_behind_a_fast_one_is_accounted_for() {
    for (size, rho) in [(1e-6, 0.99f64), (1e-4, 0.98), (1e-8, 0.95)] {
        let motion = |n: u32| 1.0 + 0.1 * 0.5f64.powi(n as i32) + size * rho.powi(n as i32);
        let (n, ..) = settles(motion).unwrap();
        assert!(size * rho.powi(n as i32) <= 1.2 * TOLERANCE / rho, "{size} {rho}: {n}");
    }
}

#[test]
fn a_train_at_rest_has_settled() {
    // Displacements stand, velocities are rounding.
    let mut sections = Sections::new(1, 100.0, 8);
    let found = (0..50).find_map(|n| sections.take(&[1e-5, 1e-17 * f64::from(n % 7)], 1e-9));
    assert_eq!(found.map(|(period, _)| period), Some(1));
}

#[test]
fn the_smallest_period_is_found() {
    for p in 1..=8u32 {
        let orbit = |n: u32| f64::from(n % p) + 1.0 + 0.5f64.powi(n as i32);
        assert_eq!(settles(orbit).unwrap().1, p);
    }
}

#[test]
fn an_irregular_motion_never_settles() {
    let golden = 0.618_033_988_749_894_9;
    assert_eq!(settles(|n| (f64::from(n) * golden).fract() + 1.0), None);
}
