//! Restrictions of rows, and falls.

use super::*;
use crate::{
    hybrid::Wide,
    vectors::{Baseline, Instructions, Work},
};

#[test]
fn shares_of_parts_are_binomials() {
    for (number, shares) in ON_PARTS.iter().enumerate() {
        let cells = 2u128 << number;
        for i in 0..MOST {
            let (mut binomial, mut off) = (1, 0.0);
            for j in 0..=i {
                let exact: u128 = binomial * (cells - 1).pow((i - j) as u32);
                // Powers of two are exact, and so is a whole number above 2⁵³ that is a double.
                let own = (shares[j][i] * (cells as f64).powi(i as i32)) as u128;
                off += own.abs_diff(exact) as f64 / (cells as f64).powi(i as i32);
                binomial = binomial * (i - j) as u128 / (j + 1) as u128;
            }
            assert!(off <= 0.6 * f64::EPSILON, "{number} {i}: {off:e}");
        }
    }
}

/// Restriction of a row of numbers to a part, with its bound.
struct Restricted<const F: usize>(Numbers<F>, usize);

impl<const F: usize> Work for Restricted<F> {
    type Output = (Numbers<F>, f64);

    fn on<P: Path>(self, path: P) -> Self::Output {
        let (row, rounding) = restrict(path, &fours(path, &self.0), self.1);
        (numbers(path, &row), rounding)
    }
}

fn stays_within_the_bound<const F: usize>() {
    let row: Numbers<F> = std::array::from_fn(|i| std::array::from_fn(|l| libm::sin((1 + i * i + 7 * l) as f64)));
    for number in 0..PARTS.len() {
        let both = [Baseline.run(Restricted(row, number)), Instructions::best().run(Restricted(row, number))];
        for (own, rounding) in both {
            for (i, own) in own.as_flattened().iter().enumerate() {
                let term = |j: usize| Wide::product(row.as_flattened()[j], ON_PARTS[number][j][i]);
                let exact = (0..=i).fold(Wide::default(), |sum, j| sum + term(j)) * PARTS[number];
                let off = (exact - (*own).into()).value().abs();
                assert!(off <= rounding, "{F} {number} {i}: {off:e} of {rounding:e}");
            }
        }
    }
}

/// Fall of `s + t p` near a guess.
struct Fallen<const F: usize>(f64, Numbers<F>, f64);

impl<const F: usize> Work for Fallen<F> {
    type Output = (f64, [f64; 2]);

    fn on<P: Path>(self, path: P) -> Self::Output {
        let Self(start, row, guess) = self;
        let of = Signed { start, sign: -1.0, row: &fours(path, &row) };
        fall(path, &of, guess, 1.0).expect("a fall")
    }
}

/// Returns value and slope of `Σ b_i B_i(t)` by the scheme of de Casteljau.
fn at(b: &[f64], t: f64) -> [Wide; 2] {
    let mut b: Vec<Wide> = b.iter().map(|b| (*b).into()).collect();
    let degree = (b.len() - 1) as f64;
    while b.len() > 2 {
        b = b.windows(2).map(|pair| pair[0] + (pair[1] - pair[0]) * t).collect();
    }
    [b[0] + (b[1] - b[0]) * t, (b[1] - b[0]) * degree]
}

/// Coefficients that fall once, near each place of the interval, with a rough guess.
fn falls_are_zeros<const F: usize>(is_whole: bool) {
    let count = 4 * F + usize::from(is_whole);
    for number in 0..400 {
        let (place, wave) =
            ((f64::from(number) + 0.5) / 400.0, |i: usize| 0.3 * libm::sin((number + 3 * i as i32).into()));
        let falls = |i: usize| place - i as f64 / (count - 1) as f64;
        let b: Vec<f64> = (0..count).map(|i| falls(i) * (1.0 + wave(i))).collect();
        // The function is `s + t p`, here with the sign of p turned.
        let row: Numbers<F> = std::array::from_fn(|i| {
            std::array::from_fn(|l| {
                let i = 4 * i + l;
                let whole = (b[0] - b[(i + 1).min(count - 1)]) * (count - 1) as f64 / (i + 1) as f64;
                if is_whole { whole } else { -b[i] }
            })
        });
        let start = if is_whole { b[0] } else { 0.0 };
        let near = [place, 0.5 + 0.9 * (place - 0.5)];
        // Any guess leads to a fall that is not at the other end.
        let guesses = near.into_iter().chain([0.0, 0.5, 1.0].into_iter().filter(|_| number > 1));
        for guess in guesses {
            let work = || Fallen(start, row, guess);
            for (t, [value, slope]) in [Baseline.run(work()), Instructions::best().run(work())] {
                let [exact, rate] = at(&b, t).map(|of| of.value());
                // One rounding for each coefficient at most, all below 1.3, and one of the place.
                let most = 1.3 * count as f64 * f64::EPSILON;
                assert!(exact.abs() <= most && value.abs() <= most, "{F} {place}: {exact:e} {value:e}");
                // The slope is extrapolated over the last step, of 1e-6 at most: by the square of the degree times that.
                assert!((slope - rate).abs() <= 1e-9 * rate.abs(), "{F} {place}: {slope} {rate}");
            }
        }
    }
}

#[test]
fn falls_are_zeros_with_their_slopes() {
    for is_whole in [false, true] {
        falls_are_zeros::<5>(is_whole);
        falls_are_zeros::<MOST_FOURS>(is_whole);
    }
}

#[test]
fn rows_on_parts_are_within_their_bounds() {
    stays_within_the_bound::<5>();
    stays_within_the_bound::<MOST_FOURS>();
}
