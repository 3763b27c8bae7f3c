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
    /// The same as the owner of the clock.
    AsOwner,
    /// A closed power law that has a way of its own: the owner of the clock, one that starts with it, one that leaves unfelt.
    Alone(PowerLaw),
    /// Another law.
    Else,
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
        for (l, p) in self.penetration[..=k].iter().enumerate().skip(1) {
            let u = &self.power[k - l];
            for i in 0..LANES {
                let weight = fused::<P>(l as f64, self.exponent[i] + 1.0, -(k as f64));
                powers[i] = fused::<P>(weight * p[i], u[i], powers[i]);
            }
        }
        for i in 0..LANES {
            powers[i] /= k as f64 * self.start[i];
        }
        powers
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
