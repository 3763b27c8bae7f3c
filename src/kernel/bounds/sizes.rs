//! Sums of absolute coefficients, which bound the truncation of a product.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use crate::kernel::{LANES, ORDER, ROW};

/// Returns the largest of four sizes, none of them NaN, by comparisons that exist as vector instructions.
#[inline(always)]
pub fn largest_of(sizes: &[f64; LANES]) -> f64 {
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    larger(larger(sizes[0], sizes[1]), larger(sizes[2], sizes[3]))
}

/// Absolute coefficients of a series at the end of the step.
pub type Sizes = [f64; ROW];

/// Returns the sums of the last coefficients, the factors of those of another series in the terms of order `from` and more of the product.
#[inline(always)]
pub fn tails(a: &Sizes, from: usize) -> Sizes {
    let mut suffix = [0.0; ROW + 1];
    for k in (0..ROW).rev() {
        suffix[k] = suffix[k + 1] + a[k];
    }
    std::array::from_fn(|i| suffix[from.saturating_sub(i).min(ROW)])
}

/// Returns `Σ a_k b_k`, summed four side by side.
#[inline(always)]
pub fn paired(a: &Sizes, b: &Sizes) -> f64 {
    total(&std::array::from_fn(|k| a[k] * b[k]))
}

/// Returns the sum of the terms of `a b` of order `from` and more.
#[inline(always)]
pub fn beyond(a: &Sizes, b: &Sizes, from: usize) -> f64 {
    paired(a, &tails(b, from))
}

/// Returns the sum, formed four side by side.
#[inline(always)]
pub fn total(a: &Sizes) -> f64 {
    let (fours, rest) = a.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for four in fours {
        sums.iter_mut().zip(four).for_each(|(sum, a)| *sum += a);
    }
    sums.iter().chain(rest).sum()
}

/// Returns the sizes of the coefficients in `series`, which holds all orders, times the powers.
#[inline(always)]
pub fn sizes(series: &[f64], powers: &Sizes) -> Sizes {
    let mut sizes = [0.0; ROW];
    if let Some(series) = series.first_chunk::<ROW>() {
        for k in 0..ROW {
            sizes[k] = series[k].abs() * powers[k];
        }
    }
    sizes
}

/// Factor of a product, with its sum and its truncation.
pub struct Factor {
    pub sizes: Sizes,
    pub total: f64,
    pub missing: f64,
}

impl Factor {
    #[inline(always)]
    pub fn new(sizes: Sizes, missing: f64) -> Self {
        Self { sizes, total: total(&sizes), missing }
    }

    /// Returns the truncation of the product with `other`.
    #[inline(always)]
    pub fn product(&self, other: &Self) -> f64 {
        beyond(&self.sizes, &other.sizes, ORDER + 1) + self.missing * other.total + other.missing * self.total
    }
}
