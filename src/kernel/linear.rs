//! Linear modes in plain time: the fast path.
//!
//! With every closed law linear, the mode is `q̈ = A_q q + A_v q̇ + f(t)` up to the contacts whose stiffness
//! is itself a series. The forces of closed contacts are formed from their deflections, and the recurrence runs on
//! fixed-size columns that the compiler turns into vector instructions.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use super::{Expansion, FORCE, LANES, Layout, ORDER, PENETRATION, ROW, STIFFNESS, motion::Part, product, waves};
use crate::{
    hybrid::Jet,
    system::{Elasticity, Force, Spring, Watch},
    vectors::{Path, fused},
};

/// The laws of four contacts, as `F = stiffness · (δ − σ b) + damping · δ̇`; zero where none is carried.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Four {
    stiffness: [f64; LANES],
    damping: [f64; LANES],
    closed: [bool; LANES],
    /// Any of them carries force.
    carried: bool,
}

impl Four {
    /// The contacts of a mode whose stiffness is constant, four at a time.
    pub fn all(parts: &[Part]) -> Box<[Self]> {
        let four = |parts: &[Part]| {
            let mut four = Self::default();
            for (l, part) in parts.iter().enumerate() {
                if let Some((Elasticity::Constant(k), damping)) = part.carried_linear() {
                    (four.stiffness[l], four.damping[l]) = (k, damping);
                    (four.closed[l], four.carried) = (true, true);
                }
            }
            four
        };
        parts.chunks(LANES).map(four).collect()
    }
}

/// Degrees of freedom of the largest structure that the fast path is compiled for.
pub(super) const LARGEST: usize = 24;

impl Expansion<'_> {
    /// All coefficients of a linear mode.
    #[inline(always)]
    pub(super) fn linear<P: Path>(&self, out: &mut Jet) {
        self.ramps(&mut out.work);
        macro_rules! kernels {
            ($($n:literal)*) => {
                match self.s.n {
                    $($n => self.recurrence::<P, $n>(out),)*
                    n => unreachable!("{n} degrees of freedom, more than {LARGEST}"),
                }
            };
        }
        kernels!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24);
        if self.keeps_low() {
            let carried = self.motion.parts.iter().map(Part::carried_linear).enumerate();
            let constant = |(j, law)| match law {
                Some((Elasticity::Constant(k), _)) => Some((j, k)),
                _ => None,
            };
            self.low(carried.filter_map(constant).collect(), out);
        }
    }

    /// Writes the stiffnesses that rise along a ramp as series, in plain time.
    pub(super) fn ramps(&self, work: &mut [f64]) {
        for (j, part) in self.motion.parts.iter().enumerate() {
            if let Some(Force::Linear { stiffness: ramp @ Elasticity::Ramp { slope, .. }, .. }) = part.force() {
                let s = self.layout.of(j, STIFFNESS);
                work[s..s + ROW].fill(0.0);
                work[s] = self.s.stiffness_at(j, ramp, self.request.at).0;
                work[s + 1] = slope * self.h;
            }
        }
    }

    /// `k (δ − σ b)` of contact `j` at order `k`.
    pub(super) fn linear_spring(&self, j: usize, stiffness: Elasticity, k: usize, work: &mut [f64]) -> f64 {
        let stretch = self.stretch(j, k, work);
        if let Elasticity::Constant(stiffness) = stiffness {
            return stiffness * stretch;
        }
        let (s, p) = (self.layout.of(j, STIFFNESS), self.layout.of(j, PENETRATION));
        if let Spring::Waves(mean, stiffness) = &self.s.contacts[j].spring {
            work[s + k] = waves(if k == 0 { *mean } else { 0.0 }, stiffness, k, work);
        }
        work[p + k] = stretch;
        product(work, s, p, k)
    }

    #[inline(always)]
    fn recurrence<P: Path, const N: usize>(&self, out: &mut Jet) {
        let (s, h) = (self.s, self.h);
        let Jet { state, work, time, .. } = out;
        time.clear();
        let varying = self.motion.is_varying;
        let fours = &self.motion.fours;
        let column = |m: &[f64]| -> [f64; N] { std::array::from_fn(|i| m[i]) };
        let (by_q, by_v) = (column(&s.columns.by_q), column(&s.columns.by_v));
        let (mut q, mut v) = (column(&self.request.x[..N]), column(&self.request.x[N..2 * N]));
        let mut a = column(&s.load);
        let (work, waves) = work.split_at_mut(self.layout.waves);
        let (waves, _) = waves.as_chunks_mut::<2>();
        for (i, w) in waves.iter_mut().enumerate() {
            *w = [work[Layout::oscillator(i)], work[Layout::oscillator(i) + ROW]];
        }
        let mut rows = state.chunks_exact_mut(s.dim);
        for k in 0..=ORDER {
            if let Some(row) = rows.next()
                && k > 0
            {
                row[..N].copy_from_slice(&q);
                row[N..2 * N].copy_from_slice(&v);
                a = [0.0; N];
            }
            if k == ORDER {
                break;
            }
            let step = h / (k + 1) as f64;
            self.contacts::<P, N>(fours, k, step, waves, &v, &mut a, work);
            for i in 0..N {
                a[i] = fused::<P>(by_q[i], q[i], fused::<P>(by_v[i], v[i], a[i]));
            }
            for &(i, j, by_q, by_v) in &s.columns.couplings {
                a[i as usize] += by_q * q[j as usize] + by_v * v[j as usize];
            }
            for w in &s.load_waves {
                let [cos, sin] = waves[w.index];
                if let (Some(cosine), Some(sine)) = (w.cosine.first_chunk::<N>(), w.sine.first_chunk::<N>()) {
                    for i in 0..N {
                        a[i] = fused::<P>(cosine[i], cos, fused::<P>(sine[i], sin, a[i]));
                    }
                }
            }
            if varying {
                self.varying_forces(k, &v, &mut a, work);
            }
            for (i, (w, o)) in waves.iter_mut().zip(&s.oscillators).enumerate() {
                let f = step * o.omega;
                *w = [-f * w[1], f * w[0]];
                if varying {
                    let at = Layout::oscillator(i) + k + 1;
                    [work[at], work[at + ROW]] = *w;
                }
            }
            for i in 0..N {
                q[i] = step * v[i];
            }
            for i in 0..N {
                v[i] = step * a[i];
            }
        }
        self.watched_forces(work);
    }

    /// The accelerations by the contact forces at order `k`, and the deflections of the next order, four contacts at a time.
    ///
    /// A deflection is the integral of its rate, `(k + 1) δ_{k+1} = h δ̇_k`, and is formed before it is multiplied by the stiffness:
    /// where the train has turned far, a difference of displacements is exact and one of forces would not be.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // the variables of the recurrence
    fn contacts<P: Path, const N: usize>(
        &self,
        fours: &[Four],
        k: usize,
        step: f64,
        waves: &[[f64; 2]],
        v: &[f64; N],
        a: &mut [f64; N],
        work: &mut [f64],
    ) {
        let s = self.s;
        for (chunk, (four, columns)) in fours.iter().zip(&s.columns.fours).enumerate() {
            let Some(directions) = columns.directions.first_chunk::<N>() else { return };
            let mut r = [0.0; LANES];
            for i in 0..N {
                for l in 0..LANES {
                    r[l] = fused::<P>(directions[i][l], v[i], r[l]);
                }
            }
            for (index, cosine, sine) in &columns.rates {
                let [cos, sin] = waves[*index];
                for l in 0..LANES {
                    r[l] -= fused::<P>(cosine[l], cos, sine[l] * sin);
                }
            }
            if k == 0 && !self.request.still.is_empty() {
                let still = (0..LANES).filter(|l| self.is_still(LANES * chunk + l));
                still.for_each(|l| r[l] = 0.0);
            }
            let at = self.layout.deflection(LANES * chunk, k);
            let Some(orders) = work[at..].first_chunk_mut::<{ 2 * LANES }>() else { return };
            for l in 0..LANES {
                orders[LANES + l] = step * r[l];
            }
            if !four.carried {
                continue;
            }
            let mut d: [f64; LANES] = std::array::from_fn(|l| orders[l]);
            if let (0, Some(stretch)) = (k, work[self.layout.stretches + LANES * chunk..].first_chunk()) {
                d = *stretch;
            }
            let mut force = [0.0; LANES];
            for l in 0..LANES {
                force[l] = fused::<P>(four.stiffness[l], d[l], four.damping[l] * r[l]);
            }
            if k == 0 && !self.request.pinned.is_empty() {
                let zero = (0..LANES).filter(|l| self.pinned(LANES * chunk + l, Watch::Force));
                zero.for_each(|l| force[l] = 0.0);
            }
            for l in 0..LANES {
                if four.closed[l]
                    && let Some(push) = columns.pushes[l].first_chunk::<N>()
                {
                    for i in 0..N {
                        a[i] = fused::<P>(-push[i], force[l], a[i]);
                    }
                }
            }
        }
    }

    /// Adds the forces of contacts whose stiffness is a series, at order `k`.
    fn varying_forces(&self, k: usize, v: &[f64], a: &mut [f64], work: &mut [f64]) {
        for (j, part) in self.motion.parts.iter().enumerate() {
            let Some((stiffness, damping)) = part.carried_linear() else { continue };
            if stiffness.varies() {
                let force = self.linear_spring(j, stiffness, k, work) + damping * self.rate(j, k, v, work);
                self.s.contacts[j].push.iter().for_each(|(i, p)| a[*i as usize] -= p * force);
            }
        }
    }

    /// The forces where a force is watched.
    fn watched_forces(&self, work: &mut [f64]) {
        for guard in self.motion.guards.iter().filter(|guard| guard.watch == Watch::Force) {
            if let Some(Force::Linear { stiffness, damping }) = self.motion.parts[guard.contact].force() {
                self.watched_force(guard.contact, stiffness, damping, work);
            }
        }
    }

    /// `F = k (δ − σ b) + c δ̇` as a series, with `(δ̇)_k = (k+1) δ_{k+1}/h`.
    fn watched_force(&self, j: usize, stiffness: Elasticity, damping: f64, work: &mut [f64]) {
        let d = |k: usize| self.layout.deflection(j, k);
        for k in 0..=ORDER {
            let rate = if k < ORDER { work[d(k + 1)] * (k + 1) as f64 / self.h } else { 0.0 };
            work[self.layout.of(j, FORCE) + k] = self.linear_spring(j, stiffness, k, work) + damping * rate;
        }
    }
}
