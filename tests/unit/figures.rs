//! What figures count on curves. A module of `study::figures`, whose parts are its own.

use super::{
    centres::{PER_CYCLE, residual},
    maxima,
};

#[test]
fn leaves_of_a_rose() {
    let n = 4096;
    let radius = |i: i32| 1.0 + 0.2 * (12.0 * std::f64::consts::TAU * f64::from(i) / f64::from(n)).cos();
    assert_eq!(maxima(&(0..n).map(radius).collect::<Vec<_>>()), 12);
}

#[test]
fn a_motion_of_period_one_has_no_residual() {
    let x: Vec<f64> = (0..4 * PER_CYCLE).map(|i| f64::from(i % PER_CYCLE)).collect();
    assert_eq!(residual(&x), 0.0);
}
