//! Longest span of a step, truncation of its series, and error of each row that is read from it.
//!
//! Norm of the state: `‖x‖ = max_i √M_ii max(Ω |q_i|, |q̇_i|)` with `Ω² = ‖A_q‖` of `q̈ = A_q q + A_v q̇ + f`.
//! Then `‖A x‖ ≤ L ‖x‖` with `L = Ω + ‖A_v‖`. The series `x_N` of a step of length H, cut after order N, leaves the defect
//! `d(θ) = ẋ_N − f(t, x_N)`, whose terms all have order N or more, so `‖d(θ)‖ ≤ D θᴺ`. The error obeys `ė = A e − d`, hence
//!
//! ```text
//! ‖x − x_N‖ ≤ T = D H/((N + 1)(1 − ρ)),   ρ = H L/(N + 1) < 1,   D = L ‖X_N‖ + Σ_{k≥N} |F_k| + Σ_{i≤N} |p_i| Σ_{l≥N−i} |k_l|
//! ```
//!
//! F is the forcing by harmonics, k the part of the stiffnesses that varies, p the penetrations. This is a proof: `docs/THEORY.md`
//! has the derivation.

use super::{defect::Defect, sizes::largest_of};
use crate::{
    hybrid::{FULL_PRECISION, Jet},
    kernel::{Elasticity, Expansion, Force, Four, ORDER, ROW},
    system::Contact,
    vectors::{Baseline, Path},
};

/// Largest ρ, which keeps `1/(1 − ρ)` below four.
const LARGEST_RATIO: f64 = 0.75;
/// Factor by which the truncation may exceed the requested one before the step is shortened.
const EXCESS: f64 = 2.0;
/// Truncation where rounding is kept, relative to the requested one: it has one sign, and ε in each of N periods is up to `ε N²/2`
/// in the end.
const FINER: f64 = 1e-5;
/// `1/k!`.
const INVERSE_FACTORIAL: [f64; ROW + 1] = {
    let mut f = [1.0; ROW + 1];
    let mut k = 1;
    while k <= ROW {
        f[k] = f[k - 1] / k as f64;
        k += 1;
    }
    f
};

/// Returns slightly less than `x^(1/k)` for `x > 0`, within 7 %: the exponent and the leading bits divided by k.
///
/// The bits of a double are a piecewise linear logarithm, with an error of at most 0.0861 in log₂, and twice that in the quotient.
pub fn root_below(x: f64, k: usize) -> f64 {
    const ONE: i64 = 1023 << 52;
    let bits = (x.to_bits() as i64 - ONE) / k as i64 + ONE;
    f64::from_bits(bits as u64) * 0.94
}

/// Returns a bound on `Σ_{l≥m} zˡ/l!`, given its first term.
fn exponential_tail(z: f64, m: usize, first: f64) -> f64 {
    let ratio = z / (m + 1) as f64;
    first * if ratio < 0.5 { 1.0 / (1.0 - ratio) } else { libm::exp(z) }
}

/// Bounds on the contributions of the truncated terms, anywhere on the step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tail {
    /// Contribution to the weighted velocities, `√M_ii |v_i|`.
    pub velocity: f64,
    /// Contribution to the weighted displacements, `√M_ii |q_i|`.
    pub displacement: f64,
    /// `zᴺ/N!` and `zᴺ⁺¹/(N+1)!` of the fastest load or error: truncation of a cosine after order N − 1 and N. Stiffness waves have a
    /// bound of their own ([`product_tail`](Expansion::product_tail)).
    pub waves: [f64; 2],
    /// `‖A_q‖`, `‖A_v‖` and the forcing's top amplitude, without the contacts at rest.
    pub free: [f64; 3],
    /// Bounds of a step in a root clock; `None` in plain time.
    pub rooted: Option<Defect>,
}

/// Returns the largest of the `row`, weighted, and of `largest`, lane by lane. The check of the whole step finds NaN.
#[inline(always)]
fn larger<P: Path>(path: P, row: &Four, weights: &Four, largest: P::Four) -> P::Four {
    path.larger(path.times(path.sizes(path.four(*row)), path.four(*weights)), largest)
}

impl Expansion<'_> {
    /// Returns the weighted size of the rates at order `k`, those of the contacts included.
    #[inline(always)]
    fn size<P: Path>(&self, path: P, k: usize, out: &Jet) -> f64 {
        // (δ̇)_k = (k+1) δ_{k+1}/h in plain time; in a root clock the same up to the weight, which is of order one.
        let per_time = (k + 1) as f64 / self.h;
        let mut largest = path.all(0.0);
        for (deflections, columns) in out.rows.deflections.iter().zip(&self.s.columns.fours) {
            largest = larger(path, &deflections[k + 1], &columns.weights, largest);
        }
        self.state_size(path, k, 1, out).max(largest_of(&path.numbers(largest)) * per_time)
    }

    /// Returns the weighted size of the velocities at order `k`.
    #[inline(always)]
    fn velocity_size(&self, k: usize, out: &Jet) -> f64 {
        self.state_size(Baseline, k, 1, out)
    }

    /// Returns the weighted size of a part of the state at order `k`: displacements (0) or velocities (1).
    #[inline(always)]
    fn state_size<P: Path>(&self, path: P, k: usize, part: usize, out: &Jet) -> f64 {
        let s = self.s;
        if !self.motion.is_linear {
            let part = &out.state[k * s.dim + part * s.n..][..s.n];
            return part.iter().zip(&s.weights).fold(0.0, |m: f64, (x, w)| m.max(x.abs() * w));
        }
        let mut largest = path.all(0.0);
        let blocks = &s.columns.blocks;
        for (row, block) in out.rows.orders[(2 * k + part) * blocks.len()..].iter().zip(blocks) {
            largest = larger(path, row, &block.weights, largest);
        }
        largest_of(&path.numbers(largest))
    }

    /// Returns the largest `θ ≤ 1` up to which the series hold to the tolerance in plain time, and their truncation there; `None` if the
    /// coefficients overflowed.
    #[inline(always)]
    pub fn plain_reach<P: Path>(&self, path: P, out: &Jet) -> Option<(f64, Tail)> {
        let flow = &self.motion.growth;
        let tolerance = self.request.tolerance * if out.low.is_empty() { 1.0 } else { FINER };
        let first = [self.size(path, 0, out), self.size(path, 1, out), self.size(path, 2, out)];
        let velocity = self.state_size(path, ORDER, 1, out);
        let last = velocity.max(self.state_size(path, ORDER, 0, out) * flow.norms[0].sqrt());
        let growth = flow.norms[0].sqrt() + flow.norms[1];
        let fastest = self.motion.forcing.fastest;
        let steps = (ORDER + 1) as f64;
        // Terms of order N and N + 1 at reach one; forcing below the smallest double does not count.
        let order = ORDER as i32;
        let wave = flow.forcing.top * (fastest * self.h).powi(order) * INVERSE_FACTORIAL[ORDER];
        let scale = (growth * last + wave) * self.h / steps;
        if !first.iter().all(|v| v.is_finite()) || !scale.is_finite() {
            return None;
        }
        let allowed = |r: f64| {
            let forced = flow.forcing.sum * self.h * r;
            tolerance * first[0].max(first[1] * r).max(first[2] * r * r).max(forced)
        };
        // Errors stay resolved to the tolerance of their own size, zᴺ⁺¹/(N+1)! ≤ tolerance, and so do stiffnesses that a force is
        // watched or carried by.
        let resolved = root_below(tolerance / INVERSE_FACTORIAL[ORDER + 1], ORDER + 1) / self.h;
        let waves = resolved * self.motion.forcing.span.min(flow.swing.recip());
        let proven = LARGEST_RATIO * steps / (self.h * growth.max(fastest));
        let most = waves.min(proven).min(1.0);
        let mut reach = most;
        for _ in 0..4 {
            if scale <= 0.0 {
                break;
            }
            let room = 1.0 - reach * self.h * growth / steps;
            let next = root_below(allowed(reach) * room / scale, ORDER + 1).min(most);
            let settled = (next - reach).abs() <= 0.1 * next;
            reach = next;
            if settled {
                break;
            }
        }
        let mut tail = self.tail(growth, [velocity, last], reach, out);
        for _ in 0..4 {
            let excess = tail.velocity / allowed(reach);
            if excess.is_nan() || excess <= EXCESS {
                break;
            }
            reach *= root_below(1.0 / excess, ORDER + 1);
            tail = self.tail(growth, [velocity, last], reach, out);
        }
        Some((reach, tail))
    }

    #[inline(always)]
    fn tail(&self, growth: f64, [last_velocity, last]: [f64; 2], reach: f64, out: &Jet) -> Tail {
        let flow = &self.motion.growth;
        let h = self.h * reach;
        let steps = (ORDER + 1) as f64;
        let z = self.motion.forcing.fastest * h;
        let wave = z.powi(ORDER as i32) * INVERSE_FACTORIAL[ORDER];
        let last = last * reach.powi(ORDER as i32);
        let varying = self.varying_tail(ORDER, reach, out);
        let defect = growth * last + flow.forcing.top * exponential_tail(z, ORDER, wave) + flow.projection * varying;
        let velocity = defect * h / steps / (1.0 - growth * h / steps);
        let displacement = h / steps * (last_velocity * reach.powi(ORDER as i32) + velocity);
        Tail { velocity, displacement, waves: [wave, wave * z / steps], free: flow.free, rooted: None }
    }

    /// Returns a bound on the weighted accelerations by the varying parts of all stiffnesses in orders `from` and more.
    fn varying_tail(&self, from: usize, reach: f64, out: &Jet) -> f64 {
        if !self.motion.is_varying {
            return 0.0;
        }
        let carried = self.motion.parts.iter().zip(&self.s.contacts).enumerate();
        let carried = carried.filter(|(_, (part, _))| part.carried_linear().is_some());
        carried.map(|(j, (_, c))| c.push_norm * self.product_tail(j, from, reach, out)).sum()
    }

    /// Returns a bound on the terms of order `from` and more of `k(t) p` of contact `j` by the varying part of k.
    fn product_tail(&self, j: usize, from: usize, reach: f64, out: &Jet) -> f64 {
        let (c, h) = (&self.s.contacts[j], self.h * reach);
        let slope = match self.motion.parts[j].force() {
            Some(Force::Linear { stiffness: Elasticity::Ramp { slope, .. }, .. }) => (slope * h).abs(),
            Some(Force::Linear { stiffness: Elasticity::Waves, .. }) => 0.0,
            _ => return 0.0,
        };
        let z = c.swing.1 * h;
        let mut terms = [1.0; ORDER + 3];
        for m in 1..=from + 1 {
            terms[m] = terms[m - 1] * z / m as f64;
        }
        // Terms k_l with l ≥ m multiply the penetration at order `from − m`.
        let mut varied = c.swing.0 * exponential_tail(z, from + 1, terms[from + 1]);
        let (mut sum, mut power) = (0.0, 1.0);
        let stretches = (0..=ORDER).map(|k| self.stretch(j, k, &out.rows));
        for (stretch, term) in stretches.zip(terms[..=from].iter().rev()) {
            varied += c.swing.0 * term;
            sum += stretch.abs() * power * varied;
            power *= reach;
        }
        // A slope is the term k₁, which multiplies orders `from − 1` and more.
        let last = |k: usize| self.stretch(j, k, &out.rows).abs() * reach.powi(k as i32);
        sum + if slope == 0.0 { 0.0 } else { slope * (from - 1..=ORDER).map(last).sum::<f64>() }
    }

    /// Returns the tail plus the truncation of earlier steps of the arc: an error of the velocities displaces the bodies during the step
    /// too. At full precision this is less than the rounding, and does not count.
    pub fn with_left_out(&self, mut tail: Tail, out: &mut Jet) -> Tail {
        out.left_out = [0.0; 2];
        let [moved, speed] = self.request.left_out;
        if self.request.tolerance > FULL_PRECISION || speed > 0.0 {
            let moved = moved + speed * out.time_at(1.0);
            let (stretch, rate) = match &mut tail.rooted {
                Some(defect) => {
                    defect.acceleration += defect.felt[0] * moved + defect.felt[1] * speed;
                    (&mut defect.stretch, &mut defect.rate)
                }
                None => (&mut tail.displacement, &mut tail.velocity),
            };
            *stretch += moved;
            *rate += speed;
            out.left_out = [*stretch, *rate];
        }
        tail
    }

    /// Returns the contribution of the tail to the deflection of contact `j`, m.
    #[inline(always)]
    pub fn deflection_tail(&self, j: usize, tail: &Tail) -> f64 {
        if let Some(defect) = &tail.rooted {
            return defect.of_deflection(&self.s.contacts[j]);
        }
        self.s.contacts[j].across * tail.displacement + self.motion.forcing.errors[j][0].top * tail.waves[1]
    }

    /// Returns the contribution of the tail to the rate of contact `j`, m/s; order N of the rate is missing too.
    pub fn rate_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        if let Some(defect) = &tail.rooted {
            // At the time of the step itself.
            return defect.rate * self.s.contacts[j].across + defect.time * self.motion.forcing.errors[j][2].sum;
        }
        let last = self.velocity_size(ORDER, out) * out.reach.powi(ORDER as i32);
        self.s.contacts[j].across * (last + tail.velocity) + self.motion.forcing.errors[j][1].top * tail.waves[0]
    }

    /// Returns the contribution of the tail to the force `k δ + c δ̇` of contact `j` with a linear law, N.
    pub fn linear_force_tail(&self, j: usize, damping: f64, tail: &Tail, out: &Jet) -> f64 {
        let c: &Contact = &self.s.contacts[j];
        let varying = match tail.rooted {
            Some(_) => self.rooted_product_tail(j, out),
            None => self.product_tail(j, ORDER + 1, out.reach, out),
        };
        c.stiffest * self.deflection_tail(j, tail) + damping * self.rate_tail(j, tail, out) + varying
    }

    /// Returns the contribution of the tail to the force that holds contact `j` at rest, N: `|W⁻¹|` times tails of free accelerations.
    pub fn held_force_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        if let Some(defect) = &tail.rooted {
            return defect.of_force(self.s, &self.s.contacts[j]);
        }
        let Some(held) = &self.motion.held else { return 0.0 };
        let forcing = &self.motion.forcing;
        let varying = self.varying_tail(ORDER + 1, out.reach, out);
        let free = |k: usize| {
            let state = tail.free[0] * tail.displacement
                + tail.free[1] * tail.velocity
                + tail.free[2] * tail.waves[1]
                + varying;
            self.s.contacts[k].across * state + forcing.errors[k][2].top * tail.waves[1]
        };
        let contacts = held.contacts();
        let Some(row) = contacts.iter().position(|k| *k == j) else { return 0.0 };
        let column = held.inverse_column(row);
        contacts.iter().zip(&column).map(|(k, w)| w.abs() * free(*k)).sum()
    }
}
