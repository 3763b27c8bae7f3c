//! The first root of single polynomials: lines 5 and 6.

use flank::poly::{FirstRoot, Isolation, first_root};

fn root(p: &[f64]) -> Isolation {
    first_root(p, 1.0, 1e-16)
}

#[test]
fn a_dip_of_one_part_in_a_million_million_is_found() {
    // (x − ½)² − 10⁻¹²: roots ½ ∓ 10⁻⁶.
    let FirstRoot::At(x) = root(&[0.25 - 1e-12, -1.0, 1.0]).root else { panic!() };
    assert!((x - (0.5 - 1e-6)).abs() < 1e-10, "{x}");
    assert_eq!(root(&[0.25 + 1e-12, -1.0, 1.0]).root, FirstRoot::None);
}

#[test]
fn an_exact_touch_is_not_a_crossing() {
    let found = root(&[0.25, -1.0, 1.0]);
    assert_eq!(found.root, FirstRoot::None);
    assert!((found.touch.unwrap() - 0.5).abs() < 1e-7);
}

#[test]
fn a_triple_root_is_one_crossing() {
    // (½ − x)³
    let FirstRoot::At(x) = root(&[0.125, -0.75, 1.5, -1.0]).root else { panic!() };
    assert!((x - 0.5).abs() < 1e-4);
}

#[test]
fn signs_are_compared_as_signs_at_any_scale() {
    // Powers of two change no bit of a coefficient.
    for scale in [-660, 0, 660].map(|power| 2f64.powi(power)) {
        let p: Vec<f64> = [0.2, -1.0, 0.3].iter().map(|c| c * scale).collect();
        let at = first_root(&p, 1.0, 1e-16 * scale).root;
        assert_eq!(at, root(&[0.2, -1.0, 0.3]).root);
    }
}

#[test]
fn the_first_of_many_roots_is_returned() {
    // Π (x − r), r = 0.1, 0.2, …, 0.9 with sign so that it starts positive.
    let mut p = vec![-1.0];
    for r in 1..=9 {
        let mut q = vec![0.0; p.len() + 1];
        for (k, c) in p.iter().enumerate() {
            q[k + 1] += c;
            q[k] -= c * f64::from(r) / 10.0;
        }
        p = q;
    }
    let FirstRoot::At(x) = root(&p).root else { panic!() };
    assert!((x - 0.1).abs() < 1e-12);
    let FirstRoot::At(y) = first_root(&p[..], 0.05 + 0.05 * (1.0 + 1e-9), 1e-18).root else { panic!() };
    assert!((y - 0.1).abs() < 1e-12);
    assert_eq!(first_root(&p, 0.0999, 1e-18).root, FirstRoot::None);
}

#[test]
fn a_polynomial_outside_from_the_start_has_its_root_at_zero() {
    assert_eq!(root(&[0.0, -1.0]).root, FirstRoot::At(0.0));
    assert_eq!(root(&[0.0, 1.0, -4.0]).root, FirstRoot::At(0.25));
    assert_eq!(root(&[0.0, 0.0, 0.0]).root, FirstRoot::None);
}
