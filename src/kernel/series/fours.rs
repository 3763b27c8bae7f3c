//! Series of four contacts side by side, and their products.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use crate::{
    gear::contact::PowerLaw,
    kernel::{LANES, ORDER, ROW},
    vectors::Path,
};

/// Kind of the action of a contact in a step.
#[derive(Clone, Copy, Debug, Default)]
pub enum ContactAction {
    /// No force and no guard.
    #[default]
    Nothing,
    /// A power law that is only watched.
    Watched,
    /// A closed power law, by the recurrence of a power of its penetration.
    Pressed,
    /// A closed power law that leaves together with the owner of the clock.
    AsOwner(PowerLaw),
    /// A closed power law with a recurrence of its own: the owner of the clock, one that starts, one that leaves unfelt.
    Alone(PowerLaw),
    /// A linear law of constant stiffness.
    Spring,
    /// Another law.
    Else,
}

impl ContactAction {
    /// Returns whether the contact is a closed power law.
    pub fn presses(&self) -> bool {
        matches!(self, Self::Pressed | Self::AsOwner(_) | Self::Alone(_))
    }
}

/// Series of four contacts side by side, and their constants.
#[derive(Clone, Copy, Debug)]
pub struct FourSeries {
    pub rate: [[f64; LANES]; ROW],
    pub penetration: [[f64; LANES]; ROW],
    /// Coefficients of `pⁿ`, the highest order first.
    pub backward: [[f64; LANES]; ROW],
    /// Products `l (n + 1) p_l`.
    pub raised: [[f64; LANES]; ROW],
    pub factor: [[f64; LANES]; ROW],
    /// Forces by the laws, carried or not.
    pub force: [[f64; LANES]; ROW],
    pub does: [ContactAction; LANES],
    /// True if some contact has a power law.
    pub has_power: bool,
    /// True if some contact has a power of its own.
    pub has_lone: bool,
    /// True if some contact has a linear law of constant stiffness.
    pub has_spring: bool,
    /// True if some contact has another law.
    pub has_other: bool,
    pub side: [f64; LANES],
    pub exponent: [f64; LANES],
    /// Penetration at the start of contacts that are [`ContactAction::Pressed`], else 1.
    pub start: [f64; LANES],
    /// Power pⁿ of this penetration, else 0.
    pub elastic: [f64; LANES],
    pub stiffness: [f64; LANES],
    pub chi: [f64; LANES],
    /// Stiffness and damping of linear laws of constant stiffness, and 1 if the force is carried; else 0.
    pub spring: [f64; LANES],
    pub damping: [f64; LANES],
    pub carried: [f64; LANES],
    /// `1/Contact::across`.
    pub per_across: [f64; LANES],
    /// `Contact::weight`.
    pub weight: [f64; LANES],
}

impl Default for FourSeries {
    fn default() -> Self {
        let (rows, zeros) = ([[0.0; LANES]; ROW], [0.0; LANES]);
        Self {
            rate: rows,
            penetration: rows,
            backward: rows,
            raised: rows,
            factor: rows,
            force: rows,
            does: [ContactAction::Nothing; LANES],
            has_power: false,
            has_lone: false,
            has_spring: false,
            has_other: false,
            side: [1.0; LANES],
            exponent: zeros,
            start: [1.0; LANES],
            elastic: zeros,
            stiffness: zeros,
            chi: zeros,
            spring: zeros,
            damping: zeros,
            carried: zeros,
            per_across: zeros,
            weight: zeros,
        }
    }
}

impl FourSeries {
    /// Returns `pⁿ` of pressed contacts at order `k`, and the terms of `pⁿ (1 + χ ṗ)` without that of this order of pⁿ:
    /// `k p_0 u_k = Σ (l (n + 1) − k) p_l u_{k−l}` and `Σ f_l u_{k−l}`, l from 1 on.
    #[inline(always)]
    pub fn powers<P: Path>(&mut self, path: P, k: usize) -> [P::Four; 2] {
        let zero = path.all(0.0);
        if k == 0 {
            return [path.four(self.elastic), zero];
        }
        let order = path.all(k as f64);
        let raised = path.times(order, path.plus(path.four(self.exponent), path.all(1.0)));
        self.raised[k] = path.numbers(path.times(raised, path.four(self.penetration[k])));
        let (mut raised, mut plain, mut product) = (zero, zero, zero);
        // In pairs, which saves a fifth of the instructions.
        let [(r, last_r), (p, last_p), (f, last_f)] =
            [&self.raised, &self.penetration, &self.factor].map(|series| series[1..=k].as_chunks::<2>());
        let (u, last_u) = self.backward[ROW - k..].as_chunks::<2>();
        for (((r, p), f), u) in r.iter().zip(p).zip(f).zip(u) {
            for i in 0..2 {
                let u = path.four(u[i]);
                raised = path.fused(path.four(r[i]), u, raised);
                plain = path.fused(path.four(p[i]), u, plain);
                product = path.fused(path.four(f[i]), u, product);
            }
        }
        for (((r, p), f), u) in last_r.iter().zip(last_p).zip(last_f).zip(last_u) {
            let u = path.four(*u);
            raised = path.fused(path.four(*r), u, raised);
            plain = path.fused(path.four(*p), u, plain);
            product = path.fused(path.four(*f), u, product);
        }
        let power = path.fused(path.minus(path.all(-0.0), order), plain, raised);
        [path.over(power, path.times(order, path.four(self.start))), product]
    }

    /// Returns the coefficients of `pⁿ` of order `k`.
    pub fn power(&mut self, k: usize) -> &mut [f64; LANES] {
        &mut self.backward[ORDER - k]
    }
}

/// Sums of the sizes of the series of four contacts at the end of a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct FourSums {
    /// Penetration at the start.
    pub start: [f64; LANES],
    /// Sum of all terms of the penetration.
    pub penetration: [f64; LANES],
    /// Sum of all terms of the factor.
    pub factor: [f64; LANES],
    /// Sums of the terms of order N + 1 and more of penetration times power.
    pub shortened: [f64; LANES],
    /// Sums of the terms of order N + 1 and more of power times factor.
    pub product: [f64; LANES],
}

impl FourSeries {
    /// Returns the sums, with the `powers` of the length of the step.
    #[inline(always)]
    pub fn sums<P: Path>(&self, path: P, powers: &[f64; ROW]) -> FourSums {
        let start = path.sizes(path.four(self.penetration[0]));
        let mut penetration = start;
        // `Σ_{i+j>N} a_i b_j`, the last of b summed on the way.
        let [mut shortened, mut product, mut last_power, mut last_factor] = [path.all(0.0); 4];
        for i in 1..ROW {
            let (power, last) = (path.all(powers[i]), path.all(powers[ROW - i]));
            let p = path.times(path.sizes(path.four(self.penetration[i])), power);
            let u = path.times(path.sizes(path.four(self.backward[ORDER - i])), power);
            last_power = path.fused(path.sizes(path.four(self.backward[i - 1])), last, last_power);
            last_factor = path.fused(path.sizes(path.four(self.factor[ROW - i])), last, last_factor);
            penetration = path.plus(penetration, p);
            shortened = path.fused(p, last_power, shortened);
            product = path.fused(u, last_factor, product);
        }
        let factor = path.plus(path.sizes(path.four(self.factor[0])), last_factor);
        FourSums {
            start: path.numbers(start),
            penetration: path.numbers(penetration),
            factor: path.numbers(factor),
            shortened: path.numbers(shortened),
            product: path.numbers(product),
        }
    }
}

/// Returns `Σ w_i rows_{k−i}`; row k is at `at`, and the others precede it, `stride` apart.
#[inline(always)]
pub fn convolved<P: Path, const B: usize>(
    path: P,
    weights: &[f64],
    rows: &[[[f64; LANES]; B]],
    stride: usize,
    mut at: usize,
) -> [[f64; LANES]; B] {
    let mut sums = [path.all(0.0); B];
    for w in weights {
        let Some(row) = rows.get(at) else { break };
        for b in 0..B {
            sums[b] = path.fused(path.all(*w), path.four(row[b]), sums[b]);
        }
        at = at.wrapping_sub(stride);
    }
    let mut all = [[0.0; LANES]; B];
    for b in 0..B {
        all[b] = path.numbers(sums[b]);
    }
    all
}
