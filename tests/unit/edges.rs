//! Measures of boundaries that are known.

#![allow(clippy::unwrap_used)]

use std::f64::consts::LN_2;

use super::{Boundary, Figures};

/// The measures of a plane of starts with these ends.
fn figures(count: usize, attractors: usize, end: impl Fn(usize, usize) -> usize) -> Figures {
    let mut boundary = Boundary::new([count, count], attractors);
    for i in 0..count {
        for j in 0..count {
            boundary.add(&format!("0.5,0.25,{},12,", end(i, j)));
        }
    }
    boundary.figures()
}

/// The digit 1 in the first digits of `x` in base three: a gap of the Cantor set.
fn first_gap(mut x: f64, digits: usize) -> Option<usize> {
    (0..digits).find(|_| {
        x *= 3.0;
        let digit = x.floor();
        x -= digit;
        digit == 1.0
    })
}

#[test]
fn a_straight_boundary_has_dimension_one() {
    // One end on each side of a line across the rows: exactly 2h starts of a row are within h of it, of those that are 64 from the ends.
    let figures = figures(512, 2, |i, j| usize::from(8 * j > 1400 + i));
    let a = figures.uncertainty_exponent.unwrap();
    assert!((a.value - 1.0).abs() < 1e-12, "{a:?}");
    assert!((figures.boundary_dimension.unwrap().value - 1.0).abs() < 1e-12);
    for (h, f) in figures.uncertain {
        assert!((f - 2.0 * h as f64 / 384.0).abs() < 1e-12, "{h}: {f}");
    }
    assert!(!figures.is_fractal_by_entropy);
}

#[test]
fn a_cantor_set_of_lines_has_its_dimension() {
    // Gaps of even and odd order end differently: the boundary is the Cantor set times a line, of dimension 1 + ln 2/ln 3.
    let count = 3usize.pow(7);
    let figures = figures(count, 2, |_, j| first_gap((j as f64 + 0.5) / count as f64, 7).unwrap_or(7) % 2);
    let d = figures.boundary_dimension.unwrap();
    let expected = 1.0 + libm::log(2.0) / libm::log(3.0);
    // Distances in powers of two meet gaps in powers of three: the slope wavers.
    assert!((d.value - expected).abs() < d.standard_error && d.standard_error < 0.3, "{d:?}, {expected}");
}

#[test]
fn entropies_of_known_boxes() {
    // Boxes of 5 × 5 in which 10 starts end in one way and 15 in the other.
    let mixed = figures(100, 2, |i, _| usize::from(i % 5 < 2));
    let entropy = -(0.4 * libm::log(0.4) + 0.6 * libm::log(0.6));
    assert!((mixed.basin_entropy.unwrap().value - entropy).abs() < 1e-12);
    assert!((mixed.boundary_entropy.unwrap().value - entropy).abs() < 1e-12);
    assert!(entropy < LN_2 && !mixed.is_fractal_by_entropy);
    // Five ends in equal shares: ln 5 is above ln 2.
    let many = figures(100, 5, |i, _| i % 5);
    assert!((many.boundary_entropy.unwrap().value - libm::log(5.0)).abs() < 1e-12);
    assert!(many.is_fractal_by_entropy);
    // One end only.
    let single = figures(100, 1, |_, _| 0);
    assert_eq!(single.basin_entropy.unwrap().value, 0.0);
    assert_eq!((single.boundary_entropy, single.uncertainty_exponent), (None, None));
}

#[test]
fn an_entropy_of_one_strip_has_no_error_and_is_not_given() {
    // Nine rows: the only row of boxes ends in one of the ten strips.
    let few = figures(9, 2, |i, _| usize::from(i % 5 < 2));
    assert_eq!((few.basin_entropy, few.boundary_entropy), (None, None));
    let two = figures(10, 2, |i, _| usize::from(i % 5 < 2));
    assert!(two.basin_entropy.is_some() && two.boundary_entropy.is_some());
}

#[test]
fn shares_add_up_and_open_ends_are_an_end_of_their_own() {
    let mut boundary = Boundary::new([10, 10], 2);
    for i in 0..100 {
        let end = ["0", "1", "undecided", "failed"][i % 4];
        boundary.add(&format!("0,0,{end},,"));
    }
    let figures = boundary.figures();
    let shares: Vec<(String, f64)> = figures.fractions.iter().map(|f| (f.attractor.clone(), f.fraction)).collect();
    let expected = ["0", "1", "open", "failed"].map(|name| (name.to_owned(), 0.25));
    assert_eq!(shares, expected);
}

#[test]
fn bands_of_a_smooth_boundary_bend_the_fit() {
    // Seven bands right of a quarter, each half as wide as the one before: dimension one, which a coarse grid sees late.
    let band = |count: usize, j: usize| (count / (j.saturating_sub(count / 4) + 1)).ilog2().min(6);
    let end = |count: usize| move |_: usize, j: usize| band(count, j) as usize % 2;
    let [coarse, fine] = [128, 2048].map(|count| figures(count, 2, end(count)).uncertainty_exponent.unwrap());
    for a in [coarse, fine] {
        assert!((a.value - 1.0).abs() < 2.0 * a.standard_error, "{a:?}");
    }
    assert!(coarse.standard_error > 0.1 && fine.standard_error < 1e-9, "{coarse:?} {fine:?}");
}
