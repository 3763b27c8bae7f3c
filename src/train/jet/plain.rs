//! The recurrence in plain time, `w = 1`: everything but closed power laws.

use super::{Expansion, FACTOR, FORCE, Layout, ORDER, PENETRATION, RATE, ROW, STIFFNESS, product};
use crate::{
    gear::contact::Law,
    hybrid::Jet,
    train::{
        assemble::{MAX_CONTACTS, Spring},
        contact_mode::{Watch, contact_mode, piece},
        sticking::Sticking,
    },
};

/// What a contact does in a mode.
#[derive(Clone, Copy)]
enum Part {
    /// No force, nothing to watch but the deflection.
    Open,
    /// `F = k (δ − σ b) + c δ̇` with k constant.
    Linear { stiffness: f64, damping: f64, carried: bool },
    /// The same with k a series.
    Varying { damping: f64, carried: bool },
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
        let mut parts = [Part::Open; MAX_CONTACTS];
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
                if let Part::Linear { carried: true, .. } | Part::Varying { carried: true, .. } = part {
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
        let mode = contact_mode(self.request.mode, j);
        let (damping, carried) = match c.spec.law {
            Law::Bilateral(l) => (l.damping, true),
            Law::KelvinVoigt(l, _) if mode.side() != 0.0 => (l.damping, mode.is_closed()),
            Law::Power(l) if mode.side() != 0.0 => {
                return Part::Factor { chi: c.latch.map_or(0.0, |i| mode.side() * l.hysteresis / self.request.x[i]) };
            }
            _ => return Part::Open,
        };
        let constant = |stiffness| Part::Linear { stiffness, damping, carried };
        match &c.spring {
            Spring::Constant(k) => constant(*k),
            Spring::Waves(..) => Part::Varying { damping, carried },
            Spring::Scheduled(schedule) => {
                let (value, slope) = schedule.law(piece(self.request.mode, j));
                if slope == 0.0 {
                    return constant(value);
                }
                let s = self.layout.of(j, STIFFNESS);
                work[s..s + ROW].fill(0.0);
                work[s] = value + slope * schedule.piece(&self.s.clock, self.request.at).1;
                work[s + 1] = slope * self.h;
                Part::Varying { damping, carried }
            }
        }
    }

    /// The force (or the factor) of a contact at order `k`.
    fn part_force(&self, j: usize, part: &Part, k: usize, rate: f64, work: &mut [f64]) {
        let layout = &self.layout;
        match *part {
            Part::Open => {}
            Part::Linear { stiffness, damping, .. } => {
                work[layout.of(j, FORCE) + k] = stiffness * self.stretch(j, k, work) + damping * rate;
            }
            Part::Varying { damping, .. } => {
                let (s, p) = (layout.of(j, STIFFNESS), layout.of(j, PENETRATION));
                if let Spring::Waves(mean, waves) = &self.s.contacts[j].spring {
                    let start = if k == 0 { *mean } else { 0.0 };
                    work[s + k] = waves.iter().fold(start, |sum, w| {
                        let o = Layout::oscillator(w.index) + k;
                        sum + w.cosine * work[o] + w.sine * work[o + ROW]
                    });
                }
                work[p + k] = self.stretch(j, k, work);
                work[layout.of(j, FORCE) + k] = product(work, s, p, k) + damping * rate;
            }
            Part::Factor { chi } => {
                work[layout.of(j, FACTOR) + k] = chi * rate + if k == 0 { 1.0 } else { 0.0 };
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
