//! Energy of a structure with contacts, and the powers that change it.
//!
//! With `E = ½ q̇ᵀM q̇ + ½ qᵀK q + Σ V_j` and the springs' `V = ½ k p²` (linear) or `K pⁿ⁺¹/(n+1)` (power law),
//!
//! ```text
//! Ė = f·q̇  −  Σ F ė  +  Σ ½ k̇ p²  −  q̇ᵀC q̇  −  Σ (F − V′) ṗ
//!     load    error     parametric    damping     contact
//! ```
//!
//! `(F − V′) ṗ` is `c ṗ²` for a linear damper and `K pⁿ χ ṗ²` for hysteresis. A contact that carries no force
//! stores nothing: what its spring holds when it lets go is dropped, and booked in the jump. K is taken to be symmetric.

use nalgebra::DMatrix;

use super::{
    assemble::{Contact, MAX_CONTACTS, Structure, dot},
    contact_mode::{ContactMode, contact_mode},
    sticking::Sticking,
};
use crate::{
    gear::contact::Law,
    hybrid::{ContactView, EnergyJump, Instant, Mode, PowerBalance, Powers, Transition},
};

/// `aᵀ S b`.
fn form(s: &DMatrix<f64>, a: &[f64], b: &[f64]) -> f64 {
    b.iter().zip(s.column_iter()).fold(0.0, |sum, (b, column)| {
        if *b == 0.0 {
            return sum;
        }
        sum + b * a.iter().zip(column.iter()).fold(0.0, |s, (a, c)| s + a * c)
    })
}

impl Structure {
    /// Stretch of the spring of contact `j` in `state`, m; `None` where it carries nothing.
    fn stretch(&self, c: &Contact, state: ContactMode, deflection: f64) -> Option<f64> {
        match c.spec.law {
            Law::Bilateral(_) => Some(deflection),
            Law::KelvinVoigt(..) if state.is_closed() => Some(state.side() * deflection - c.gap()),
            Law::Power(_) if state.is_closed() => Some((state.side() * deflection - c.gap()).max(0.0)),
            _ => None,
        }
    }

    /// Stored energy of contact `j`, J, in `state`, with the stiffness piece of `mode`.
    pub(super) fn stored_in(&self, j: usize, state: ContactMode, mode: Mode, at: Instant, x: &[f64]) -> f64 {
        let c = &self.contacts[j];
        let Some(p) = self.stretch(c, state, self.deflection(j, at, x).0) else { return 0.0 };
        match c.spec.law {
            Law::Power(l) => {
                let n = l.exponent.value();
                c.spec.stiffness.mean() * p.powf(n + 1.0) / (n + 1.0)
            }
            _ => 0.5 * self.stiffness(j, mode, at).0 * p * p,
        }
    }

    /// Powers of contact `j`, W: dissipation and parametric work.
    pub(super) fn contact_powers(&self, j: usize, mode: Mode, at: Instant, x: &[f64]) -> (f64, f64) {
        let c = &self.contacts[j];
        let state = contact_mode(mode, j);
        let (d, rate) = self.deflection(j, at, x);
        let Some(p) = self.stretch(c, state, d) else { return (0.0, 0.0) };
        match c.spec.law {
            Law::Bilateral(l) | Law::KelvinVoigt(l, _) => {
                (l.damping * rate * rate, 0.5 * self.stiffness(j, mode, at).1 * p * p)
            }
            Law::Power(l) => {
                let closing = state.side() * rate;
                let elastic = c.spec.stiffness.mean() * p.powf(l.exponent.value());
                (elastic * (self.factor(c, closing, x) - 1.0) * closing, 0.0)
            }
            Law::Rigid(_) => (0.0, 0.0),
        }
    }

    /// The force a compliant contact carries, N; zero for a rigid one.
    fn compliant_force(&self, j: usize, mode: Mode, at: Instant, x: &[f64]) -> f64 {
        let state = contact_mode(mode, j);
        if state.is_closed() { self.law_force(j, mode, state, at, x) } else { 0.0 }
    }

    /// The force contact `j` carries, N.
    pub(super) fn carried_by(&self, j: usize, mode: Mode, at: Instant, x: &[f64]) -> f64 {
        if !contact_mode(mode, j).is_closed() {
            return 0.0;
        }
        if matches!(self.contacts[j].spec.law, Law::Rigid(_)) {
            let mut forces = [0.0; MAX_CONTACTS];
            self.carried(mode, at, x, &mut forces);
            return forces[j];
        }
        self.compliant_force(j, mode, at, x)
    }

    /// All contact forces, N, into `forces` `[contacts]`: as [`dynamics`](Self::dynamics), without its scratch.
    fn carried(&self, mode: Mode, at: Instant, x: &[f64], forces: &mut [f64]) {
        for (j, f) in forces.iter_mut().enumerate().take(self.contacts.len()) {
            *f = self.compliant_force(j, mode, at, x);
        }
        let Some(held) = Sticking::new(self, mode) else { return };
        let mut pull = [0.0; MAX_CONTACTS];
        for (pull, &j) in pull.iter_mut().zip(held.contacts()) {
            let free: f64 =
                self.contacts[j].direction.iter().map(|(i, g)| g * self.acceleration(*i as usize, at, x, forces)).sum();
            *pull = free - self.error(j, at).2;
        }
        held.solve(&mut pull);
        for (pull, &j) in pull.iter().zip(held.contacts()) {
            forces[j] = *pull;
        }
    }

    /// Acceleration of freedom `i` under `forces`, m/s².
    fn acceleration(&self, i: usize, at: Instant, x: &[f64], forces: &[f64]) -> f64 {
        let mut a =
            self.rows[i].iter().fold(self.load[i], |a, (j, k, c)| a - k * x[*j as usize] - c * x[self.n + *j as usize]);
        for w in &self.load_waves {
            let o = self.oscillators[w.index];
            let (sin, cos) = self.clock.angle(o.omega, o.order, at).sin_cos();
            a += w.cosine[i] * cos + w.sine[i] * sin;
        }
        for (c, f) in self.contacts.iter().zip(forces).filter(|(_, f)| **f != 0.0) {
            a -= c.push.iter().find(|(r, _)| *r as usize == i).map_or(0.0, |(_, p)| p * f);
        }
        a
    }

    /// `½ q̇ᵀM q̇`, J.
    fn kinetic(&self, x: &[f64]) -> f64 {
        let v = &x[self.n..2 * self.n];
        0.5 * form(&self.spec.mass, v, v)
    }

    /// The impulses of a jump, N s along each direction, into `out` `[contacts]`: what changed the rates of the
    /// rigid contacts that fired or rest, `G M⁻¹Gᵀ P = δ̇⁻ − δ̇⁺`.
    pub(super) fn impulses_of(&self, t: &Transition<'_>, out: &mut [f64]) {
        out[..self.contacts.len()].fill(0.0);
        let (mut set, mut rhs, mut len) = ([0; MAX_CONTACTS], [0.0; MAX_CONTACTS], 0);
        for (j, c) in self.contacts.iter().enumerate() {
            let struck = t.fired.iter().any(|id| {
                let (k, watch) = self.watch(id);
                k == j && watch.side() != 0.0
            });
            let involved = struck || contact_mode(t.from, j).is_closed() || contact_mode(t.to, j).is_closed();
            if matches!(c.spec.law, Law::Rigid(_)) && involved {
                set[len] = j;
                rhs[len] = dot(&c.direction, &t.x_minus[self.n..]) - dot(&c.direction, &t.x_plus[self.n..]);
                len += 1;
            }
        }
        if rhs[..len].iter().all(|r| *r == 0.0) {
            return;
        }
        Sticking::of(self, set[..len].iter().copied()).solve(&mut rhs);
        for (p, j) in rhs.iter().zip(&set[..len]) {
            out[*j] = *p;
        }
    }
}

impl Structure {
    /// Energies whose rounding the ledger shows beside that of its `throughput` E, J: the work of the loads on free masses in one step of
    /// `step` seconds, and `√(E k ℓ²)` of the contacts. A penetration is rounded by ε of the flank's distance ℓ, and a motion of
    /// amplitude a, `E = k a²`, does the work `ε k ℓ a` on that.
    #[must_use]
    pub fn rounded_energy(&self, step: f64, throughput: f64) -> f64 {
        let of_loads = (0..self.n).map(|i| {
            let waves: f64 = self.spec.load_harmonics.iter().map(|load| load.vector[i].abs()).sum();
            ((self.spec.load[i].abs() + waves) * step).powi(2) / self.spec.mass[(i, i)]
        });
        let of_flanks = self.contacts.iter().map(|c| {
            let distance = c.gap().abs()
                + c.spec.error_offset.abs()
                + c.error.iter().map(|w| w.cosine.abs() + w.sine.abs()).sum::<f64>();
            let power = if let Law::Power(l) = c.spec.law { l.exponent.value() + 1.0 } else { 2.0 };
            c.spec.stiffness.maximum() * distance.powf(power)
        });
        of_loads.sum::<f64>() + (throughput * of_flanks.sum::<f64>()).sqrt()
    }
}

impl PowerBalance for Structure {
    fn energy(&self, mode: Mode, at: Instant, x: &[f64]) -> f64 {
        let q = &x[..self.n];
        let contacts: f64 =
            (0..self.contacts.len()).map(|j| self.stored_in(j, contact_mode(mode, j), mode, at, x)).sum();
        self.kinetic(x) + 0.5 * form(&self.spec.stiffness, q, q) + contacts
    }

    fn powers(&self, mode: Mode, at: Instant, x: &[f64]) -> Powers {
        let v = &x[self.n..2 * self.n];
        let along = |f: &[f64]| f.iter().zip(v).fold(0.0, |s, (f, v)| s + f * v);
        let mut powers =
            Powers { load: along(&self.spec.load), damping: form(&self.spec.damping, v, v), ..Powers::default() };
        for (load, wave) in self.spec.load_harmonics.iter().zip(&self.load_waves) {
            let o = self.oscillators[wave.index];
            powers.load += (self.clock.angle(o.omega, o.order, at) + load.phase).cos() * along(&load.vector);
        }
        let mut forces = [0.0; MAX_CONTACTS];
        self.carried(mode, at, x, &mut forces);
        for (j, c) in self.contacts.iter().enumerate() {
            let (lost, parametric) = self.contact_powers(j, mode, at, x);
            powers.contact += lost;
            powers.parametric += parametric;
            if forces[j] != 0.0 && !c.error.is_empty() {
                powers.error -= forces[j] * self.error(j, at).1;
            }
        }
        powers
    }

    fn energy_jump(&self, t: &Transition<'_>) -> EnergyJump {
        let mut jump = EnergyJump::default();
        for j in 0..self.contacts.len() {
            let (before, after) = (contact_mode(t.from, j), contact_mode(t.to, j));
            let old = self.stored_in(j, before, t.from, t.at, t.x_minus);
            let switched = self.stored_in(j, before, t.to, t.at, t.x_minus);
            let new = self.stored_in(j, after, t.to, t.at, t.x_minus);
            jump.parametric += switched - old;
            jump.release += switched - new;
        }
        let mut impulses = [0.0; MAX_CONTACTS];
        self.impulses_of(t, &mut impulses);
        for (j, p) in impulses.iter().enumerate().take(self.contacts.len()).filter(|(_, p)| **p != 0.0) {
            jump.error -= p * self.error(j, t.at).1;
        }
        let kinetic = self.kinetic(t.x_plus) - self.kinetic(t.x_minus);
        jump.impact = jump.error - kinetic;
        jump.projection = self.energy(t.to, t.at, t.x_plus) - self.energy(t.to, t.at, t.x_minus) - kinetic;
        jump
    }
}
