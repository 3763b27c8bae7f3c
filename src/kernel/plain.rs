//! The recurrence in plain time, `w = 1`: everything but closed power laws.

use super::{Expansion, FACTOR, FORCE, Force, Layout, ORDER, RATE, ROW, motion::Part};
use crate::{
    hybrid::Jet,
    system::{Sticking, Watch, zeros},
};

impl Expansion<'_> {
    /// All coefficients in plain time.
    pub(super) fn plain(&self, out: &mut Jet) {
        let (s, layout, h) = (self.s, self.layout, self.h);
        let (n, dim) = (s.n, s.dim);
        let Jet { state, work, time, .. } = out;
        time.clear();
        self.ramps(work);
        let parts = &self.motion.parts;
        for k in 0..=ORDER {
            let (low, high) = state.split_at_mut((k + 1) * dim);
            let (q, v) = low[k * dim..k * dim + 2 * n].split_at(n);
            for (j, part) in parts.iter().enumerate() {
                let r = layout.of(j, RATE);
                let rate = self.rate(j, k, v, work);
                work[r + k] = rate;
                if k > 0 {
                    work[layout.deflection(j, k)] = h / k as f64 * work[r + k - 1];
                }
                self.part_force(j, part, k, rate, work);
                if k == 0 && self.pinned(j, Watch::Force) {
                    work[layout.of(j, FORCE)] = 0.0;
                }
            }
            let a = layout.accelerations + k * n;
            self.accelerations(k, q, v, work);
            for (j, part) in parts.iter().enumerate() {
                if part.carried_linear().is_some() {
                    let force = work[layout.of(j, FORCE) + k];
                    for (i, p) in &s.contacts[j].push {
                        work[a + *i as usize] -= p * force;
                    }
                }
            }
            if let Some(held) = &self.motion.held {
                self.hold(held, k, work);
            }
            if k == ORDER {
                break;
            }
            let step = h / (k + 1) as f64;
            let (q1, v1) = high[..2 * n].split_at_mut(n);
            q1.iter_mut().zip(v).for_each(|(q, v)| *q = step * v);
            v1.iter_mut().zip(&work[a..a + n]).for_each(|(v, a)| *v = step * a);
            for (i, o) in s.oscillators.iter().enumerate() {
                let c = Layout::oscillator(i) + k;
                let f = step * o.omega;
                (work[c + 1], work[c + 1 + ROW]) = (-f * work[c + ROW], f * work[c]);
            }
        }
    }

    /// The force of a contact at order `k`; of an open power law inside its flank's zone the factor `1 + χ ṗ`, which is watched.
    fn part_force(&self, j: usize, part: &Part, k: usize, rate: f64, work: &mut [f64]) {
        match part.force() {
            Some(Force::Linear { stiffness, damping }) => {
                work[self.layout.of(j, FORCE) + k] = self.linear_spring(j, stiffness, k, work) + damping * rate;
            }
            Some(force @ Force::Power { .. }) => {
                let chi = part.side * force.chi(self.request.x);
                work[self.layout.of(j, FACTOR) + k] = chi * rate + if k == 0 { 1.0 } else { 0.0 };
            }
            Some(Force::Held) | None => {}
        }
    }

    /// `a_k` without contacts.
    #[inline(always)]
    pub(super) fn accelerations(&self, k: usize, q: &[f64], v: &[f64], work: &mut [f64]) {
        let s = self.s;
        let (series, tail) = work.split_at_mut(self.layout.accelerations);
        let a = &mut tail[k * s.n..(k + 1) * s.n];
        let own = s.columns.by_q.iter().zip(&s.columns.by_v).zip(q.iter().zip(v));
        a.iter_mut().zip(own).for_each(|(a, ((by_q, by_v), (q, v)))| *a = by_q * q + by_v * v);
        for &(i, j, by_q, by_v) in &s.columns.couplings {
            a[i as usize] += by_q * q[j as usize] + by_v * v[j as usize];
        }
        if k == 0 {
            a.iter_mut().zip(&s.load).for_each(|(a, f)| *a += f);
        }
        for w in &s.load_waves {
            let o = Layout::oscillator(w.index) + k;
            let (cosine, sine) = (series[o], series[o + ROW]);
            for ((a, wc), ws) in a.iter_mut().zip(&w.cosine).zip(&w.sine) {
                *a += wc * cosine + ws * sine;
            }
        }
    }

    /// The multipliers that hold the resting contacts, `g·a = ë`, at order `k`.
    pub(super) fn hold(&self, held: &Sticking, k: usize, work: &mut [f64]) {
        let s = self.s;
        let a = self.layout.accelerations + k * s.n;
        let mut forces = zeros(held.contacts().len());
        for (force, &j) in forces.iter_mut().zip(held.contacts()) {
            let c = &s.contacts[j];
            *force = c.direction.iter().fold(0.0, |sum, (i, g)| sum + g * work[a + *i as usize]);
            for w in &c.error {
                let o = Layout::oscillator(w.index) + k;
                let omega = s.oscillators[w.index].omega;
                *force += omega * omega * (w.cosine * work[o] + w.sine * work[o + ROW]);
            }
        }
        held.solve(&mut forces);
        if s.is_symmetric(&self.motion.mode, self.request.x) {
            s.symmetry.restore_forces(held.contacts(), &mut forces);
        }
        for (force, &j) in forces.iter().zip(held.contacts()) {
            work[self.layout.of(j, FORCE) + k] = *force;
            for (i, p) in &s.contacts[j].push {
                work[a + *i as usize] -= p * force;
            }
        }
    }
}
