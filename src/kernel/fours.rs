//! Series of four contacts side by side, and their products.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use super::{LANES, ROW};
use crate::{
    gear::contact::PowerLaw,
    vectors::{Path, fused},
};

/// What a contact does in a root clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Does {
    /// Neither force nor guard.
    #[default]
    Nothing,
    /// A power law that is only watched.
    Watched,
    /// A closed power law, by the recurrence of a power of its penetration.
    Pressed,
    /// A closed power law that leaves together with the owner of the clock.
    AsOwner(PowerLaw),
    /// A closed power law that has a way of its own: the owner of the clock, one that starts, one that leaves unfelt.
    Alone(PowerLaw),
    /// Another law.
    Else,
}

impl Does {
    /// It is a closed power law.
    pub fn presses(&self) -> bool {
        matches!(self, Self::Pressed | Self::AsOwner(_) | Self::Alone(_))
    }
}

/// Series of four contacts side by side, and their numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct FourSeries {
    pub rate: [[f64; LANES]; ROW],
    pub penetration: [[f64; LANES]; ROW],
    pub power: [[f64; LANES]; ROW],
    pub factor: [[f64; LANES]; ROW],
    /// Forces carried.
    pub force: [[f64; LANES]; ROW],
    pub does: [Does; LANES],
    pub side: [f64; LANES],
    pub exponent: [f64; LANES],
    /// Penetrations at the start; 1 for those that do without.
    pub start: [f64; LANES],
    pub stiffness: [f64; LANES],
    pub chi: [f64; LANES],
    /// `1/Contact::across` and `Contact::weight`.
    pub per_across: [f64; LANES],
    pub weight: [f64; LANES],
}

impl Default for FourSeries {
    fn default() -> Self {
        let (rows, zeros) = ([[0.0; LANES]; ROW], [0.0; LANES]);
        Self {
            rate: rows,
            penetration: rows,
            power: rows,
            factor: rows,
            force: rows,
            does: [Does::Nothing; LANES],
            side: [1.0; LANES],
            exponent: zeros,
            start: [1.0; LANES],
            stiffness: zeros,
            chi: zeros,
            per_across: zeros,
            weight: zeros,
        }
    }
}

impl FourSeries {
    /// `pⁿ` at order `k`, of those that are pressed: `k p_0 u_k = Σ (l (n + 1) − k) p_l u_{k−l}`.
    #[inline(always)]
    pub fn powers<P: Path>(&self, k: usize) -> [f64; LANES] {
        let mut powers = [0.0; LANES];
        if k == 0 {
            let pressed =
                self.does.iter().zip(&mut powers).enumerate().filter(|(_, (does, _))| matches!(does, Does::Pressed));
            pressed.for_each(|(l, (_, power))| *power = libm::pow(self.start[l], self.exponent[l]));
            return powers;
        }
        let mut l = 0.0;
        for (p, u) in self.penetration[1..=k].iter().zip(self.power[..k].iter().rev()) {
            l += 1.0;
            for i in 0..LANES {
                let weight = fused::<P>(l, self.exponent[i] + 1.0, -(k as f64));
                powers[i] = fused::<P>(weight * p[i], u[i], powers[i]);
            }
        }
        for i in 0..LANES {
            powers[i] /= k as f64 * self.start[i];
        }
        powers
    }
}

/// Sums of the sizes of four contacts' series at the end of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// The penetration at the start, and the sums of all terms.
    pub start: [f64; LANES],
    pub penetration: [f64; LANES],
    pub factor: [f64; LANES],
    /// Of the terms of order N + 1 and more of penetration times power, and of power times factor.
    pub shortened: [f64; LANES],
    pub product: [f64; LANES],
}

impl FourSeries {
    /// The sums, with the `powers` of the step's length.
    #[inline(always)]
    pub fn sums<P: Path>(&self, powers: &[f64; ROW]) -> Sums {
        let size = |series: &[[f64; LANES]; ROW]| -> [[f64; LANES]; ROW] {
            std::array::from_fn(|k| std::array::from_fn(|l| series[k][l].abs() * powers[k]))
        };
        let sum = |sizes: &[[f64; LANES]; ROW]| {
            sizes.iter().fold([0.0; LANES], |sum, size| std::array::from_fn(|l| sum[l] + size[l]))
        };
        let (p, u, f) = (size(&self.penetration), size(&self.power), size(&self.factor));
        let (mut shortened, mut product) = ([0.0; LANES], [0.0; LANES]);
        // `Σ_{i+j>N} a_i b_j`, the last of b summed on the way.
        let (mut last_power, mut last_factor) = ([0.0; LANES], [0.0; LANES]);
        for i in 1..ROW {
            for l in 0..LANES {
                last_power[l] += u[ROW - i][l];
                last_factor[l] += f[ROW - i][l];
                shortened[l] = fused::<P>(p[i][l], last_power[l], shortened[l]);
                product[l] = fused::<P>(u[i][l], last_factor[l], product[l]);
            }
        }
        Sums { start: p[0], penetration: sum(&p), factor: sum(&f), shortened, product }
    }
}

/// `Σ w_i rows_{k−i}` into `out`, whose length the rows have; they begin `stride` apart. Sixteen columns at a time stay in registers.
#[inline(always)]
pub(super) fn convolve<P: Path>(weights: &[f64], rows: &[f64], stride: usize, out: &mut [f64]) {
    let mut at = 0;
    while at < out.len() {
        let left = out.len() - at;
        let (rows, out) = (&rows[at..], &mut out[at..]);
        at += match left {
            16.. => columns::<P, 16>(weights, rows, stride, out),
            8.. => columns::<P, 8>(weights, rows, stride, out),
            4.. => columns::<P, 4>(weights, rows, stride, out),
            _ => columns::<P, 1>(weights, rows, stride, out),
        };
    }
}

/// The first `W` columns.
#[inline(always)]
fn columns<P: Path, const W: usize>(weights: &[f64], rows: &[f64], stride: usize, out: &mut [f64]) -> usize {
    let mut sums = [0.0; W];
    let last = weights.len() - 1;
    for (i, w) in weights.iter().enumerate() {
        if let Some(row) = rows[(last - i) * stride..].first_chunk::<W>() {
            for c in 0..W {
                sums[c] = fused::<P>(*w, row[c], sums[c]);
            }
        }
    }
    out[..W].copy_from_slice(&sums);
    W
}

/// `Σ w_i rows_{k−i}`.
#[inline(always)]
pub(super) fn lanes<P: Path>(weights: &[f64], rows: &[[f64; LANES]]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    for (w, row) in weights.iter().zip(rows.iter().rev()) {
        for l in 0..LANES {
            sums[l] = fused::<P>(*w, row[l], sums[l]);
        }
    }
    sums
}

/// `Σ a_i b_{k−i}`.
#[inline(always)]
pub(super) fn convolved<P: Path>(a: &[[f64; LANES]], b: &[[f64; LANES]]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b.iter().rev()) {
        for l in 0..LANES {
            sums[l] = fused::<P>(a[l], b[l], sums[l]);
        }
    }
    sums
}
