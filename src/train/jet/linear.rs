//! Linear modes in plain time: the fast path.
//!
//! With every closed law linear, the mode is `q̈ = A_q q + A_v q̇ + f(t)` up to the contacts whose stiffness
//! is itself a series. The closed contacts are merged into the matrices, and the recurrence runs on
//! fixed-size columns that the compiler turns into vector instructions.

use super::{DEFLECTION, Expansion, FORCE, Layout, ORDER, PENETRATION, ROW, STIFFNESS, product};
use crate::{
    gear::contact::Law,
    hybrid::Jet,
    train::{
        assemble::{MAX_CONTACTS, Spring, dot},
        contact_mode::{Watch, contact_mode, piece},
    },
};

/// Largest number of freedoms with a kernel of its own.
pub(super) const LARGEST: usize = 24;

/// `1/(k + 1)`.
const STEP: [f64; ROW] = {
    let mut s = [1.0; ROW];
    let mut k = 0;
    while k < ROW {
        s[k] = 1.0 / (k + 1) as f64;
        k += 1;
    }
    s
};

/// `a b + c`, in one instruction where there is one.
#[inline(always)]
fn fused(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(target_feature = "fma") { a.mul_add(b, c) } else { a * b + c }
}

/// The linear law of a contact in a mode: `F = k (δ − offset) + c δ̇`.
#[derive(Clone, Copy)]
struct LinearPart {
    stiffness: f64,
    damping: f64,
    offset: f64,
    /// The force acts (else it is only watched).
    carried: bool,
    /// The stiffness is a series in `STIFFNESS`; `stiffness` is then zero.
    varying: bool,
    /// There is a law in this mode.
    present: bool,
}

/// `q̈ = A_q q + A_v q̇ + constant + forcing`, columns of the matrices in rows of the arrays.
struct Operator<const N: usize> {
    by_q: [[f64; N]; N],
    by_v: [[f64; N]; N],
    constant: [f64; N],
}

impl Expansion<'_> {
    /// All coefficients of a linear mode; `false` if the mode is not linear or has too many freedoms.
    pub(super) fn linear(&self, out: &mut Jet) -> bool {
        let mut parts =
            [LinearPart { stiffness: 0.0, damping: 0.0, offset: 0.0, carried: false, varying: false, present: false };
                MAX_CONTACTS];
        let parts = &mut parts[..self.s.contacts.len()];
        for (j, part) in parts.iter_mut().enumerate() {
            match self.linear_part(j, &mut out.work) {
                Some(p) => *part = p,
                None => return false,
            }
        }
        macro_rules! kernels {
            ($($n:literal)*) => {
                match self.s.n {
                    $($n => self.recurrence::<$n>(parts, out),)*
                    _ => return false,
                }
            };
        }
        kernels!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24);
        true
    }

    /// The law of contact `j` in the mode; `None` if it is not linear. A varying stiffness is written as a series
    /// where it does not follow an oscillator.
    fn linear_part(&self, j: usize, work: &mut [f64]) -> Option<LinearPart> {
        let c = &self.s.contacts[j];
        let mode = contact_mode(self.request.mode, j);
        let open =
            LinearPart { stiffness: 0.0, damping: 0.0, offset: 0.0, carried: false, varying: false, present: false };
        let part = match c.spec.law {
            Law::Bilateral(l) => LinearPart { damping: l.damping, carried: true, present: true, ..open },
            Law::KelvinVoigt(l, _) if mode.side() != 0.0 => LinearPart {
                damping: l.damping,
                offset: mode.side() * c.gap(),
                carried: mode.is_closed(),
                present: true,
                ..open
            },
            Law::Power(_) | Law::Rigid(_) if mode.side() != 0.0 => return None,
            _ => return Some(open),
        };
        Some(match &c.spring {
            Spring::Constant(k) => LinearPart { stiffness: *k, ..part },
            Spring::Waves(..) => LinearPart { varying: true, ..part },
            Spring::Scheduled(schedule) => {
                let (value, slope) = schedule.law(piece(self.request.mode, j));
                if slope == 0.0 {
                    LinearPart { stiffness: value, ..part }
                } else {
                    let s = self.layout.of(j, STIFFNESS);
                    work[s..s + ROW].fill(0.0);
                    work[s] = value + slope * schedule.piece(&self.s.clock, self.request.at).1;
                    work[s + 1] = slope * self.h;
                    LinearPart { varying: true, ..part }
                }
            }
        })
    }

    /// Merges the constant-stiffness contacts that carry force into the mode's matrices and forcing.
    fn operator<const N: usize>(&self, parts: &[LinearPart], work: &mut [f64]) -> Operator<N> {
        let s = self.s;
        let mut op = Operator { by_q: [[0.0; N]; N], by_v: [[0.0; N]; N], constant: [0.0; N] };
        op.constant.copy_from_slice(&s.load);
        for (i, row) in s.rows.iter().enumerate() {
            for (j, k, c) in row {
                op.by_q[*j as usize][i] = -k;
                op.by_v[*j as usize][i] = -c;
            }
        }
        let forcing = self.layout.forcing;
        work[forcing..forcing + 2 * s.oscillators.len() * N].fill(0.0);
        for w in &s.load_waves {
            let at = forcing + 2 * w.index * N;
            work[at..at + N].iter_mut().zip(&w.cosine).for_each(|(f, a)| *f += a);
            work[at + N..at + 2 * N].iter_mut().zip(&w.sine).for_each(|(f, a)| *f += a);
        }
        for (c, part) in s.contacts.iter().zip(parts).filter(|(_, p)| p.carried && !p.varying) {
            let rest = part.stiffness * (part.offset + c.spec.error_offset);
            for (i, p) in &c.push {
                let i = *i as usize;
                for (j, g) in &c.direction {
                    op.by_q[*j as usize][i] -= p * part.stiffness * g;
                    op.by_v[*j as usize][i] -= p * part.damping * g;
                }
                op.constant[i] += p * rest;
                for (e, de) in c.error.iter().zip(&c.error_rate) {
                    let at = forcing + 2 * e.index * N + i;
                    work[at] += p * (part.stiffness * e.cosine + part.damping * de.cosine);
                    work[at + N] += p * (part.stiffness * e.sine + part.damping * de.sine);
                }
            }
        }
        op
    }

    fn recurrence<const N: usize>(&self, parts: &[LinearPart], out: &mut Jet) {
        let (s, layout, h) = (self.s, &self.layout, self.h);
        let Jet { state, work, time, .. } = out;
        time.clear();
        let op = self.operator::<N>(parts, work);
        let varying = parts.iter().any(|p| p.varying && p.carried);
        let (mut q, mut v) = ([0.0; N], [0.0; N]);
        q.copy_from_slice(&state[..N]);
        v.copy_from_slice(&state[N..2 * N]);
        let mut a = op.constant;
        for k in 0..=ORDER {
            if k > 0 {
                let row = &mut state[k * s.dim..k * s.dim + 2 * N];
                row[..N].copy_from_slice(&q);
                row[N..].copy_from_slice(&v);
                if k == ORDER {
                    break;
                }
                a = [0.0; N];
            }
            for j in 0..N {
                for i in 0..N {
                    a[i] = fused(op.by_q[j][i], q[j], fused(op.by_v[j][i], v[j], a[i]));
                }
            }
            let step = h * STEP[k];
            for (i, o) in s.oscillators.iter().enumerate() {
                let c = Layout::oscillator(i) + k;
                let (cosine, sine) = (work[c], work[c + ROW]);
                let f = step * o.omega;
                (work[c + 1], work[c + 1 + ROW]) = (-f * sine, f * cosine);
                let at = layout.forcing + 2 * i * N;
                let (by_cosine, by_sine) = work[at..at + 2 * N].split_at(N);
                for i in 0..N {
                    a[i] = fused(by_cosine[i], cosine, fused(by_sine[i], sine, a[i]));
                }
            }
            if varying {
                self.varying_forces(parts, k, &q, &v, &mut a, work);
            }
            for i in 0..N {
                (q[i], v[i]) = (step * v[i], step * a[i]);
            }
        }
        self.deflections(parts, state, work);
    }

    /// Adds the forces of contacts whose stiffness is a series, at order `k`.
    fn varying_forces(&self, parts: &[LinearPart], k: usize, q: &[f64], v: &[f64], a: &mut [f64], work: &mut [f64]) {
        for (j, part) in parts.iter().enumerate().filter(|(_, p)| p.varying && p.carried) {
            let c = &self.s.contacts[j];
            let (s, p) = (self.layout.of(j, STIFFNESS), self.layout.of(j, PENETRATION));
            self.stiffness_wave(j, k, work);
            let rate = self.rate(j, k, v, work);
            work[p + k] =
                if k == 0 { work[self.layout.of(j, DEFLECTION)] - part.offset } else { self.deflection(j, k, q, work) };
            let force = product(work, s, p, k) + part.damping * rate;
            c.push.iter().for_each(|(i, p)| a[*i as usize] -= p * force);
        }
    }

    /// `k(t)` at order `k` where it follows oscillators.
    fn stiffness_wave(&self, j: usize, k: usize, work: &mut [f64]) {
        if let Spring::Waves(mean, waves) = &self.s.contacts[j].spring {
            let start = if k == 0 { *mean } else { 0.0 };
            work[self.layout.of(j, STIFFNESS) + k] = waves.iter().fold(start, |sum, w| {
                let o = Layout::oscillator(w.index) + k;
                sum + w.cosine * work[o] + w.sine * work[o + ROW]
            });
        }
    }

    /// Deflection of contact `j` at order `k > 0`, from the displacements of that order.
    fn deflection(&self, j: usize, k: usize, q: &[f64], work: &[f64]) -> f64 {
        let c = &self.s.contacts[j];
        c.error.iter().fold(dot(&c.direction, q), |d, w| {
            let o = Layout::oscillator(w.index) + k;
            d - w.cosine * work[o] - w.sine * work[o + ROW]
        })
    }

    /// The deflections of all contacts, and the forces where a force is watched.
    fn deflections(&self, parts: &[LinearPart], state: &[f64], work: &mut [f64]) {
        let dim = self.s.dim;
        for (j, part) in parts.iter().enumerate() {
            let d = self.layout.of(j, DEFLECTION);
            for k in 1..=ORDER {
                work[d + k] = self.deflection(j, k, &state[k * dim..], work);
            }
            if self.is_still(j) {
                work[d + 1] = 0.0;
            }
            let watched = part.present
                && self
                    .s
                    .watched(&self.s.contacts[j], contact_mode(self.request.mode, j))
                    .iter()
                    .any(|(w, _)| *w == Watch::Force);
            if watched {
                self.watched_force(j, part, work);
            }
        }
    }

    /// `F = k (δ − offset) + c δ̇` as a series, with `(δ̇)_k = (k+1) δ_{k+1}/h`.
    fn watched_force(&self, j: usize, part: &LinearPart, work: &mut [f64]) {
        let (d, f, s, p) = (
            self.layout.of(j, DEFLECTION),
            self.layout.of(j, FORCE),
            self.layout.of(j, STIFFNESS),
            self.layout.of(j, PENETRATION),
        );
        for k in 0..=ORDER {
            let rate = if k < ORDER { work[d + k + 1] * (k + 1) as f64 / self.h } else { 0.0 };
            let stretch = work[d + k] - if k == 0 { part.offset } else { 0.0 };
            let spring = if part.varying {
                self.stiffness_wave(j, k, work);
                work[p + k] = stretch;
                product(work, s, p, k)
            } else {
                part.stiffness * stretch
            };
            work[f + k] = spring + part.damping * rate;
        }
    }
}
