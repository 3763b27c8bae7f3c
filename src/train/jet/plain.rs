//! The recurrence in plain time, `w = 1`: everything but closed power laws.

use super::{Expansion, FACTOR, FORCE, Layout, ORDER, RATE, ROW, linear::LinearPart};
use crate::{
    gear::contact::Law,
    hybrid::Jet,
    train::{
        assemble::MAX_CONTACTS,
        contact_mode::{Watch, contact_mode},
        sticking::Sticking,
    },
};

/// What a contact does in a mode.
#[derive(Clone, Copy)]
enum Part {
    /// A linear law, or nothing but the deflection to watch.
    Linear(LinearPart),
    /// An open power law inside the flank's zone: its factor `1 + χ ṗ` is watched.
    Factor { chi: f64 },
}

impl Expansion<'_> {
    /// All coefficients in plain time.
    pub(super) fn plain(&self, out: &mut Jet) {
        let (s, layout, h) = (self.s, &self.layout, self.h);
        let (n, dim) = (s.n, s.dim);
        let Jet { state, work, time, .. } = out;
        time.clear();
        let mut parts = [Part::Linear(LinearPart::default()); MAX_CONTACTS];
        let parts = &mut parts[..s.contacts.len()];
        for (j, part) in parts.iter_mut().enumerate() {
            *part = self.part(j, work);
        }
        let held = Sticking::new(s, self.request.mode);
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
                if let Part::Linear(LinearPart { carried: true, .. }) = part {
                    let force = work[layout.of(j, FORCE) + k];
                    for (i, p) in &s.contacts[j].push {
                        work[a + *i as usize] -= p * force;
                    }
                }
            }
            if let Some(held) = &held {
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

    /// What contact `j` does in the mode; a stiffness that varies along a ramp is written as a series.
    fn part(&self, j: usize, work: &mut [f64]) -> Part {
        let c = &self.s.contacts[j];
        match (self.linear_part(j, work), c.spec.law) {
            (None, Law::Power(l)) => {
                let side = contact_mode(self.request.mode, j).side();
                Part::Factor { chi: c.latch.map_or(0.0, |i| side * l.hysteresis / self.request.x[i]) }
            }
            (part, _) => Part::Linear(part.unwrap_or_default()),
        }
    }

    /// The force (or the factor) of a contact at order `k`.
    fn part_force(&self, j: usize, part: &Part, k: usize, rate: f64, work: &mut [f64]) {
        match part {
            Part::Linear(part) if part.present => {
                work[self.layout.of(j, FORCE) + k] = self.linear_spring(j, part, k, work) + part.damping * rate;
            }
            Part::Linear(_) => {}
            Part::Factor { chi } => {
                work[self.layout.of(j, FACTOR) + k] = chi * rate + if k == 0 { 1.0 } else { 0.0 };
            }
        }
    }

    /// `a_k` without contacts.
    pub(super) fn accelerations(&self, k: usize, q: &[f64], v: &[f64], work: &mut [f64]) {
        let s = self.s;
        let (series, tail) = work.split_at_mut(self.layout.accelerations);
        let a = &mut tail[k * s.n..(k + 1) * s.n];
        for (a, row) in a.iter_mut().zip(&s.rows) {
            *a = row.iter().fold(0.0, |sum, (j, k, c)| sum - k * q[*j as usize] - c * v[*j as usize]);
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
        let mut forces = [0.0; MAX_CONTACTS];
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
        if s.is_symmetric(self.request.mode, self.request.x) {
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
