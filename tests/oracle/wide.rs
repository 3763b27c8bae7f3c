//! Thirty-two digits: pairs of doubles from the crate `twofloat`, with a division of full accuracy (the crate's own loses
//! half of the digits), and the functions that the oracle needs.

use std::ops::{Add, Div, Mul, Neg, Sub};

use twofloat::TwoFloat;

/// A number of 32 digits.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Wide(TwoFloat);

macro_rules! by_crate {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator for Wide {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self($operator::$method(self.0, other.0))
            }
        }
    )*};
}

by_crate!(Add add, Sub sub, Mul mul);

impl Neg for Wide {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Div for Wide {
    type Output = Self;
    /// Long division: three digits of 53 bits each.
    fn div(self, by: Self) -> Self {
        let first = self.hi() / by.hi();
        let rest = self.0 - by.0 * first;
        let second = rest.hi() / by.hi();
        let rest = rest - by.0 * second;
        Self(TwoFloat::new_add(first, second) + rest.hi() / by.hi())
    }
}

impl Wide {
    /// The double next to it, and what is left.
    pub fn hi(self) -> f64 {
        self.0.hi()
    }

    pub fn lo(self) -> f64 {
        self.0.lo()
    }
}

/// A double, exactly.
pub fn wide(x: f64) -> Wide {
    Wide(TwoFloat::from(x))
}

/// The double next to it.
pub fn near(x: Wide) -> f64 {
    x.hi()
}

/// Its size, as a double.
pub fn size(x: Wide) -> f64 {
    x.hi().abs()
}

/// π/2 in three doubles, to 48 digits (the third one is used to reduce large angles).
const QUARTER: [f64; 3] = [std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17, -1.497_384_904_859_17e-33];

/// `(sin x, cos x)`: reduction by quarter turns, then the Taylor series on `|r| ≤ π/4`.
pub fn sin_cos(x: Wide) -> (Wide, Wide) {
    let turns = (x.hi() / QUARTER[0]).round();
    let part = |i: usize| Wide(TwoFloat::new_mul(turns, QUARTER[i]));
    let r = x - part(0) - part(1) - wide(turns * QUARTER[2]);
    let square = r * r;
    let (mut sin, mut cos) = (r, wide(1.0));
    let (mut odd, mut even) = (r, wide(1.0));
    for k in 1..16 {
        let k = 2.0 * f64::from(k);
        even = -(even * square) / wide((k - 1.0) * k);
        odd = -(odd * square) / wide(k * (k + 1.0));
        cos = cos + even;
        sin = sin + odd;
    }
    match (turns as i64).rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// 2π: four times the angle at which the cosine is zero.
pub fn turn() -> Wide {
    let quarter = wide(QUARTER[0]);
    let (sin, cos) = sin_cos(quarter);
    (quarter + cos / sin) * wide(4.0)
}

/// `x^m` for a whole number m.
pub fn power(x: Wide, m: usize) -> Wide {
    (0..m).fold(wide(1.0), |p, _| p * x)
}

/// `x^(1/q)` for x > 0, by Newton's method from the double's root.
pub fn root(x: Wide, q: usize) -> Wide {
    let mut y = wide(x.hi().powf(1.0 / q as f64));
    for _ in 0..3 {
        let below = power(y, q - 1);
        y = y - (below * y - x) / (below * wide(q as f64));
    }
    y
}

/// `Σ c_k θ^k`.
pub fn horner(c: &[Wide], theta: Wide) -> Wide {
    c.iter().rev().fold(wide(0.0), |s, c| s * theta + *c)
}

/// In words, 28 digits after the first.
pub fn decimal(x: Wide) -> String {
    if x.hi() == 0.0 {
        return "0".into();
    }
    let place = x.hi().abs().log10().floor() as i32;
    let ten = power(wide(10.0), place.unsigned_abs() as usize);
    let mut rest = if place < 0 { x * ten } else { x / ten };
    let sign = if rest.hi() < 0.0 { "-" } else { "" };
    rest = if rest.hi() < 0.0 { -rest } else { rest };
    let mut digits = String::new();
    for i in 0..29 {
        let digit = rest.hi().floor() - f64::from(rest.hi().fract() == 0.0 && rest.lo() < 0.0);
        digits.push_str(&format!("{digit}"));
        if i == 0 {
            digits.push('.');
        }
        rest = (rest - wide(digit)) * wide(10.0);
    }
    format!("{sign}{digits}e{place}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The crate's digits, against numbers known to more.
    #[test]
    fn digits_hold() {
        let third = wide(1.0) / wide(3.0);
        assert!(size(third * wide(3.0) - wide(1.0)) < 1e-31);
        // sin 1 = 0.84147098480789650665250232163029899962…
        let (sin, cos) = sin_cos(wide(1.0));
        assert!(decimal(sin).starts_with("8.414709848078965066525023216"), "{}", decimal(sin));
        assert!(size(sin * sin + cos * cos - wide(1.0)) < 1e-31);
        // Addition of angles links large ones to small ones.
        for i in 1..200 {
            let x = wide(0.37) * wide(f64::from(i * i));
            let ((s1, c1), (s2, c2)) = (sin_cos(x), sin_cos(x + wide(0.61)));
            let (s, c) = sin_cos(wide(0.61));
            assert!(size(s2 - s1 * c - c1 * s) < 1e-28, "{i}");
            assert!(size(c2 - c1 * c + s1 * s) < 1e-28, "{i}");
        }
        assert!(size(power(root(wide(2.0), 7), 7) - wide(2.0)) < 1e-30);
    }
}
