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

use super::{
    Elasticity, Expansion, Force, LANES, ORDER, ROW, defect::Defect, motion::ContactInMode, sizes::largest_of,
};
use crate::{
    hybrid::{FULL_PRECISION, Jet},
    system::{Contact, Oscillator, Sticking, Structure},
};

/// Largest ρ, which keeps `1/(1 − ρ)` below four.
const LARGEST_RATIO: f64 = 0.75;
/// Factor by which the truncation may exceed the requested one before the step is shortened.
const EXCESS: f64 = 2.0;
/// Truncation where rounding is kept, relative to the requested one: it has one sign, and ε in each of N periods is up to `ε N²/2`
/// in the end.
const FINER: f64 = 1e-5;
/// Least order whose remainders [`Amplitude::top`] bounds.
const LEAST_ORDER: i32 = 16;

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
pub(super) fn root_below(x: f64, k: usize) -> f64 {
    const ONE: i64 = 1023 << 52;
    let bits = (x.to_bits() as i64 - ONE) / k as i64 + ONE;
    f64::from_bits(bits as u64) * 0.94
}

/// Returns a bound on `Σ_{l≥m} zˡ/l!`, given its first term.
fn exponential_tail(z: f64, m: usize, first: f64) -> f64 {
    let ratio = z / (m + 1) as f64;
    first * if ratio < 0.5 { 1.0 / (1.0 - ratio) } else { libm::exp(z) }
}

/// Sums over the harmonics `a cos(ωt + φ)` of one row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Amplitude {
    /// Sum `Σ |a|`.
    pub sum: f64,
    /// `Σ |a| (ω/Ω)^16` with Ω the fastest frequency of loads and errors: the terms of order N ≥ 16 are at most `top (ΩH)ᴺ/N!`.
    pub top: f64,
}

impl Amplitude {
    fn add(&mut self, size: f64, oscillator: Oscillator, fastest: f64) {
        self.sum += size;
        self.top += size * (oscillator.omega / fastest).powi(LEAST_ORDER);
    }
}

/// Sums over the forcing of a structure.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Forcing {
    /// Fastest frequency Ω of loads and errors, rad/s.
    fastest: f64,
    /// Harmonic loads as weighted accelerations, `max_i √M_ii |a_i|`.
    load: Amplitude,
    /// Errors of each contact: e, ė, ë.
    pub errors: Vec<[Amplitude; 3]>,
    /// `min (1/ω) (Σ|e|/|e_ω|)^(1/25)` over all errors that are watched, s: the step on which each wave stays resolved.
    span: f64,
    /// Largest ë over [`Contact::across`].
    pub swing: f64,
    /// Row sums of the weighted `M⁻¹K` and `M⁻¹C` without contacts.
    rows: [Vec<f64>; 2],
    /// `‖M⁻¹K‖`, 1/s², and `‖M⁻¹C‖`, 1/s, without contacts.
    pub norms: [f64; 2],
}

impl Forcing {
    pub fn new(s: &Structure) -> Self {
        let oscillators = &s.oscillators;
        let errors = s.contacts.iter().flat_map(|c| &c.error).map(|w| w.index);
        let waves = s.load_waves.iter().map(|w| w.index).chain(errors);
        let fastest = waves.fold(0.0, |m: f64, i| m.max(oscillators[i].omega));
        let mut load = Amplitude::default();
        for w in &s.load_waves {
            load.add(w.size(&s.weights), oscillators[w.index], fastest);
        }
        let mut span = f64::INFINITY;
        let mut errors = Vec::with_capacity(s.contacts.len());
        for c in &s.contacts {
            let mut sums = [Amplitude::default(); 3];
            for w in &c.error {
                let (size, o) = (libm::hypot(w.cosine, w.sine), oscillators[w.index]);
                for (power, sum) in sums.iter_mut().enumerate() {
                    sum.add(size * o.omega.powi(power as i32), o, fastest);
                }
            }
            for w in c.error.iter().filter(|_| !c.spec.law.is_bilateral()) {
                let share = sums[0].sum / libm::hypot(w.cosine, w.sine);
                span = span.min(libm::pow(share, 1.0 / ROW as f64) / oscillators[w.index].omega);
            }
            errors.push(sums);
        }
        let w = &s.weights;
        let mut rows = [vec![0.0; s.n], vec![0.0; s.n]];
        for (i, row) in s.rows.iter().enumerate() {
            for (j, k, c) in row {
                let ratio = w[i] / w[*j as usize];
                rows[0][i] += k.abs() * ratio;
                rows[1][i] += c.abs() * ratio;
            }
        }
        let norms = [0, 1].map(|i: usize| rows[i].iter().copied().fold(0.0, f64::max));
        let swings = s.contacts.iter().zip(&errors).map(|(c, errors)| errors[2].sum / c.across);
        Self { fastest, load, span, swing: swings.fold(0.0, f64::max), rows, norms, errors }
    }
}

/// Bounds on the contributions of the truncated terms, anywhere on the step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tail {
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

/// Norms and amplitudes of the smooth flow of a mode.
#[derive(Debug)]
pub(super) struct Growth {
    /// `‖A_q‖`, 1/s², and `‖A_v‖`, 1/s.
    norms: [f64; 2],
    /// Harmonic forcing as a weighted acceleration.
    forcing: Amplitude,
    /// Norms and the forcing's top without the contacts at rest.
    free: [f64; 3],
    /// Norm of the projection by contacts at rest; 1 without.
    projection: f64,
    /// Fastest frequency of a stiffness by which a force is carried or watched, rad/s.
    swing: f64,
}

impl Growth {
    /// Forms the norms of the structure, the linear contacts that carry force and the projection by the contacts at rest.
    pub fn new(s: &Structure, forcing: &Forcing, parts: &[ContactInMode], held: Option<&Sticking>) -> Self {
        let [mut by_q, mut by_v] = forcing.rows.clone();
        let (mut total, mut swing) = (forcing.load, 0.0);
        for (j, (part, c)) in parts.iter().zip(&s.contacts).enumerate() {
            if part.acting.is_some() {
                swing = f64::max(swing, c.swing.1);
            }
            let Some((_, damping)) = part.carried_linear() else { continue };
            let stiffness = c.stiffest;
            for (i, p) in &c.push {
                let push = p.abs() * s.weights[*i as usize];
                by_q[*i as usize] += stiffness * push * c.across;
                by_v[*i as usize] += damping * push * c.across;
            }
            let [e, rate, _] = forcing.errors[j];
            total.sum += c.push_norm * (stiffness * e.sum + damping * rate.sum);
            total.top += c.push_norm * (stiffness * e.top + damping * rate.top);
        }
        let largest = |r: &[f64]| r.iter().copied().fold(0.0, f64::max);
        let mut norms = [largest(&by_q), largest(&by_v)];
        let free = [norms[0], norms[1], total.top];
        let mut projection = 1.0;
        if let Some(held) = held {
            projection = 1.0 + project_norms(s, held, |k, norm| norm * s.contacts[k].across);
            norms = norms.map(|n| n * projection);
            total.sum = total.sum * projection + project_norms(s, held, |k, norm| norm * forcing.errors[k][2].sum);
            total.top = total.top * projection + project_norms(s, held, |k, norm| norm * forcing.errors[k][2].top);
        }
        Self { norms, forcing: total, free, projection, swing }
    }
}

impl Growth {
    /// Returns Ω, 1/s.
    pub fn frequency(&self) -> f64 {
        self.norms[0].sqrt()
    }

    /// Returns L, 1/s.
    pub fn rate(&self) -> f64 {
        self.frequency() + self.norms[1]
    }
}

/// Keeps the largest weighted sizes, lane by lane.
#[inline(always)]
fn keep_largest(largest: &mut [f64; LANES], row: &[f64], weights: &[f64; LANES]) {
    for l in 0..LANES {
        let size = row[l].abs() * weights[l];
        // This comparison exists as a vector instruction. The check of the whole step finds NaN.
        largest[l] = if size > largest[l] { size } else { largest[l] };
    }
}

/// Sums `term` over the contacts at rest. `norm` is the weighted acceleration by the multipliers for a unit of
/// the free acceleration of contact `k`, `max_i Σ_j √M_ii |M⁻¹g_j|_i |W⁻¹|_jk`.
fn project_norms(s: &Structure, held: &Sticking, term: impl Fn(usize, f64) -> f64) -> f64 {
    let contacts = held.contacts();
    (0..contacts.len())
        .map(|k| {
            let column = held.inverse_column(k);
            let norm = contacts.iter().zip(&column).map(|(&j, w)| s.contacts[j].push_norm * w.abs()).sum();
            term(contacts[k], norm)
        })
        .sum()
}

impl Expansion<'_> {
    /// Returns the weighted size of the rates at order `k`, those of the contacts included.
    #[inline(always)]
    pub(super) fn size(&self, k: usize, out: &Jet) -> f64 {
        // (δ̇)_k = (k+1) δ_{k+1}/h in plain time; in a root clock the same up to the weight, which is of order one.
        let per_time = (k + 1) as f64 / self.h;
        let mut largest = [0.0; LANES];
        for (chunk, columns) in self.s.columns.fours.iter().enumerate() {
            let row = &out.work[self.layout.deflection(LANES * chunk, k + 1)..];
            keep_largest(&mut largest, row, &columns.weights);
        }
        self.velocity_size(k, out).max(largest_of(&largest) * per_time)
    }

    /// Returns the weighted size of the velocities at order `k`.
    #[inline(always)]
    pub(super) fn velocity_size(&self, k: usize, out: &Jet) -> f64 {
        self.state_size(k, self.layout.velocities, self.s.n, out)
    }

    /// Returns the size of a part of the state, which starts at `in_order` in an order of a linear mode, else at `in_state` in a row.
    #[inline(always)]
    fn state_size(&self, k: usize, in_order: usize, in_state: usize, out: &Jet) -> f64 {
        let s = self.s;
        if !self.motion.is_linear {
            let part = &out.state[k * s.dim + in_state..k * s.dim + in_state + s.n];
            return part.iter().zip(&s.weights).fold(0.0, |m: f64, (x, w)| m.max(x.abs() * w));
        }
        let mut largest = [0.0; LANES];
        let row = &out.work[self.layout.orders + k * self.layout.stride + in_order..];
        for (row, block) in row.as_chunks::<LANES>().0.iter().zip(&s.columns.blocks) {
            keep_largest(&mut largest, row, &block.weights);
        }
        largest_of(&largest)
    }

    /// Returns the largest `θ ≤ 1` up to which the series hold to the tolerance in plain time, and their truncation there; `None` if the
    /// coefficients overflowed.
    #[inline(always)]
    pub(super) fn plain_reach(&self, out: &Jet) -> Option<(f64, Tail)> {
        let flow = &self.motion.growth;
        let tolerance = self.request.tolerance * if out.low.is_empty() { 1.0 } else { FINER };
        let first = [self.size(0, out), self.size(1, out), self.size(2, out)];
        let last = self.last_size(out);
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
        let mut tail = self.tail(growth, last, reach, out);
        for _ in 0..4 {
            let excess = tail.velocity / allowed(reach);
            if excess.is_nan() || excess <= EXCESS {
                break;
            }
            reach *= root_below(1.0 / excess, ORDER + 1);
            tail = self.tail(growth, last, reach, out);
        }
        Some((reach, tail))
    }

    /// Returns `‖x_N‖`.
    #[inline(always)]
    fn last_size(&self, out: &Jet) -> f64 {
        let displacement = self.state_size(ORDER, 0, 0, out);
        self.velocity_size(ORDER, out).max(displacement * self.motion.growth.norms[0].sqrt())
    }

    #[inline(always)]
    fn tail(&self, growth: f64, last: f64, reach: f64, out: &Jet) -> Tail {
        let flow = &self.motion.growth;
        let h = self.h * reach;
        let steps = (ORDER + 1) as f64;
        let z = self.motion.forcing.fastest * h;
        let wave = z.powi(ORDER as i32) * INVERSE_FACTORIAL[ORDER];
        let last = last * reach.powi(ORDER as i32);
        let varying = self.varying_tail(ORDER, reach, out);
        let defect = growth * last + flow.forcing.top * exponential_tail(z, ORDER, wave) + flow.projection * varying;
        let velocity = defect * h / steps / (1.0 - growth * h / steps);
        let displacement = h / steps * (self.velocity_size(ORDER, out) * reach.powi(ORDER as i32) + velocity);
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
        let rows = out.work[self.layout.deflection(j, 1)..].iter().step_by(LANES);
        let stretches = std::iter::once(&out.work[self.layout.stretches + j]).chain(rows);
        for (stretch, term) in stretches.zip(terms[..=from].iter().rev()).take(ORDER + 1) {
            varied += c.swing.0 * term;
            sum += stretch.abs() * power * varied;
            power *= reach;
        }
        // A slope is the term k₁, which multiplies orders `from − 1` and more.
        let last = |k: usize| self.stretch(j, k, &out.work).abs() * reach.powi(k as i32);
        sum + if slope == 0.0 { 0.0 } else { slope * (from - 1..=ORDER).map(last).sum::<f64>() }
    }

    /// Returns the tail plus the truncation of earlier steps of the arc: an error of the velocities displaces the bodies during the step
    /// too. At full precision this is less than the rounding, and does not count.
    pub(super) fn with_left_out(&self, mut tail: Tail, out: &mut Jet) -> Tail {
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
    pub(super) fn deflection_tail(&self, j: usize, tail: &Tail) -> f64 {
        if let Some(defect) = &tail.rooted {
            return defect.of_deflection(&self.s.contacts[j]);
        }
        self.s.contacts[j].across * tail.displacement + self.motion.forcing.errors[j][0].top * tail.waves[1]
    }

    /// Returns the contribution of the tail to the rate of contact `j`, m/s; order N of the rate is missing too.
    pub(super) fn rate_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
        if let Some(defect) = &tail.rooted {
            // At the time of the step itself.
            return defect.rate * self.s.contacts[j].across + defect.time * self.motion.forcing.errors[j][2].sum;
        }
        let last = self.velocity_size(ORDER, out) * out.reach.powi(ORDER as i32);
        self.s.contacts[j].across * (last + tail.velocity) + self.motion.forcing.errors[j][1].top * tail.waves[0]
    }

    /// Returns the contribution of the tail to the force `k δ + c δ̇` of contact `j` with a linear law, N.
    pub(super) fn linear_force_tail(&self, j: usize, damping: f64, tail: &Tail, out: &Jet) -> f64 {
        let c: &Contact = &self.s.contacts[j];
        let varying = match tail.rooted {
            Some(_) => self.rooted_product_tail(j, out),
            None => self.product_tail(j, ORDER + 1, out.reach, out),
        };
        c.stiffest * self.deflection_tail(j, tail) + damping * self.rate_tail(j, tail, out) + varying
    }

    /// Returns the contribution of the tail to the force that holds contact `j` at rest, N: `|W⁻¹|` times tails of free accelerations.
    pub(super) fn held_force_tail(&self, j: usize, tail: &Tail, out: &Jet) -> f64 {
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
