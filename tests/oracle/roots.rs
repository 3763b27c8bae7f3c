//! The first root of a polynomial on `[0, end]`: exclusion and monotony by the sizes of coefficients about midpoints,
//! halving in between; the root itself by bisection and Newton's method in 32 digits.

use super::wide::{Wide, horner, near, size, wide};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum First {
    None,
    At(Wide),
    /// It comes nearer to zero than can be told, and turns back.
    Touch(f64),
}

/// Coefficients about `x`.
fn shifted(c: &[Wide], x: f64) -> Vec<Wide> {
    let mut s = c.to_vec();
    for i in 0..s.len() {
        for k in (i..s.len() - 1).rev() {
            s[k] = s[k] + s[k + 1] * wide(x);
        }
    }
    s
}

fn tail(c: &[Wide], r: f64, from: usize) -> f64 {
    c.iter().enumerate().skip(from).rev().fold(0.0, |s, (_, c)| s * r + size(*c)) * r.powi(from as i32)
}

/// Slack for the rounding of sums of doubles.
const SAFE: f64 = 1.0 + 1e-12;

/// The first root. A turn within `doubt` of zero is a touch.
pub fn first(c: &[Wide], end: f64, doubt: f64) -> First {
    if c.first().is_none_or(|c| near(*c) <= 0.0) {
        return First::At(wide(0.0));
    }
    if near(c[0]) > tail(c, end, 1) * SAFE {
        return First::None;
    }
    search(c, 0.0, end, doubt, 0)
}

fn search(c: &[Wide], a: f64, b: f64, doubt: f64, depth: u32) -> First {
    let (middle, r) = (0.5 * (a + b), 0.5 * (b - a));
    let s = shifted(c, middle);
    if size(s[0]) > tail(&s, r, 1) * SAFE {
        // The sign in the whole interval; a negative one would have shown as a root before.
        return if near(s[0]) > 0.0 { First::None } else { First::At(wide(a)) };
    }
    let slope: Vec<Wide> = s.iter().enumerate().skip(1).map(|(k, c)| *c * wide(k as f64)).collect();
    if size(slope[0]) > tail(&slope, r, 1) * SAFE {
        return if near(horner(c, wide(b))) > 0.0 { First::None } else { First::At(polish(c, a, b)) };
    }
    // Neither sign nor slope is certain, and all of the interval lies within the doubt; or the halves are as small as doubles.
    if size(s[0]) + tail(&s, r, 1) <= doubt || depth > 46 {
        return First::Touch(middle);
    }
    match search(c, a, middle, doubt, depth + 1) {
        First::None => search(c, middle, b, doubt, depth + 1),
        found => found,
    }
}

/// The root of a monotone piece that is positive at `a` and not at `b`.
fn polish(c: &[Wide], a: f64, b: f64) -> Wide {
    let slope: Vec<Wide> = c.iter().enumerate().skip(1).map(|(k, c)| *c * wide(k as f64)).collect();
    let (mut low, mut high) = (wide(a), wide(b));
    let mut x = (low + high) * wide(0.5);
    for _ in 0..200 {
        let value = horner(c, x);
        if near(value) > 0.0 {
            low = x
        } else {
            high = x
        }
        let mut next = x - value / horner(&slope, x);
        if !(next > low && next < high) {
            next = (low + high) * wide(0.5);
        }
        let moved = size(next - x);
        x = next;
        if moved <= 1e-31 * size(x) {
            break;
        }
    }
    x
}
