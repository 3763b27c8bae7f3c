//! Energy of a structure with contacts, and the powers that change it.
//!
//! With `E = ½ q̇ᵀM q̇ + ½ qᵀK q + Σ V_j` and the springs' `V = ½ k p²` (linear) or `K pⁿ⁺¹/(n+1)` (power law),
//!
//! ```text
//! Ė = f·q̇  −  Σ F ė  +  Σ ½ k̇ p²  −  q̇ᵀC q̇  −  Σ (F − V′) ṗ
//!     load    error     parametric    damping     contact
//! ```
//!
//! `(F − V′) ṗ` is `c ṗ²` for a linear damper and `K pⁿ χ ṗ²` for hysteresis. A contact without force stores no energy: the energy of its
//! spring at release is lost, and counted in the jump. K is taken to be symmetric.

use super::{
    assemble::{PerContact, Sparse, Structure, dot, zeros},
    contact_mode::{contact_mode, guard_of},
    sticking::Sticking,
};
use crate::hybrid::{EnergyJump, HybridSystem, Instant, Mode, PowerBalance, Powers, Transition};

/// Returns `aᵀ S b` from the columns of S.
fn form(columns: &[Sparse], a: &[f64], b: &[f64]) -> f64 {
    b.iter().zip(columns).fold(0.0, |sum, (b, column)| if *b == 0.0 { sum } else { sum + b * dot(column, a) })
}

impl Structure {
    /// Returns the force that contact `j` carries, N.
    pub(crate) fn carried_by(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        match self.acting(mode, j).filter(|a| a.is_carried) {
            None => 0.0,
            Some(a) if a.is_held() => {
                let mut forces = zeros(self.contacts.len());
                self.carried(mode, at, x, &mut forces);
                forces[j]
            }
            Some(a) => self.law_force(&a, at, x),
        }
    }

    /// Writes all contact forces, N, into `forces` `[contacts]`, as [`dynamics`](Self::dynamics) does, without its scratch.
    fn carried(&self, mode: &Mode, at: Instant, x: &[f64], forces: &mut [f64]) {
        forces[..self.contacts.len()].fill(0.0);
        for acting in self.carrying(mode) {
            forces[acting.contact] = self.law_force(&acting, at, x);
        }
        let Some(held) = Sticking::new(self, mode) else { return };
        let mut pull = zeros(held.contacts().len());
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

    /// Returns the acceleration of degree of freedom `i` under `forces`, m/s².
    fn acceleration(&self, i: usize, at: Instant, x: &[f64], forces: &[f64]) -> f64 {
        let mut a =
            self.rows[i].iter().fold(self.load[i], |a, (j, k, c)| a - k * x[*j as usize] - c * x[self.n + *j as usize]);
        for w in &self.load_waves {
            let o = self.oscillators[w.index];
            let (sin, cos) = self.clock.sincos(o.omega, o.order, at);
            a += w.cosine[i] * cos + w.sine[i] * sin;
        }
        for (c, f) in self.contacts.iter().zip(forces).filter(|(_, f)| **f != 0.0) {
            a -= c.push.iter().find(|(r, _)| *r as usize == i).map_or(0.0, |(_, p)| p * f);
        }
        a
    }

    /// Returns `½ q̇ᵀM q̇`, J.
    fn kinetic(&self, x: &[f64]) -> f64 {
        let v = &x[self.n..2 * self.n];
        0.5 * form(&self.forms[0], v, v)
    }

    /// Returns `½ qᵀK q` plus the energy of the springs, J.
    fn potential(&self, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        let q = &x[..self.n];
        let contacts = self.carrying(mode).filter(|acting| !self.is_load(acting.contact));
        let contacts: f64 = contacts.map(|acting| self.stored_in(Some(acting), at, x)).sum();
        0.5 * form(&self.forms[2], q, q) + contacts
    }

    /// Writes the impulses of a jump, N s along each direction, into `out` `[flanks]`. They changed the rates of the rigid contacts that
    /// fired or rest: `G M⁻¹Gᵀ P = δ̇⁻ − δ̇⁺`.
    pub(crate) fn impulses_of(&self, t: &Transition<'_>, out: &mut [f64]) {
        out.fill(0.0);
        let (mut set, mut rhs) = (PerContact::<usize>::new(), PerContact::<f64>::new());
        for (j, c) in self.contacts.iter().enumerate() {
            let struck = t.fired.iter().map(guard_of).any(|(k, watch)| k == j && watch.side() != 0.0);
            let involved = struck || contact_mode(t.from, j).is_closed() || contact_mode(t.to, j).is_closed();
            if c.spec.law.is_rigid() && involved {
                set.push(j);
                rhs.push(dot(&c.direction, &t.x_minus[self.n..]) - dot(&c.direction, &t.x_plus[self.n..]));
            }
        }
        if rhs.iter().all(|r| *r == 0.0) {
            return;
        }
        Sticking::of(self, set.iter().copied()).solve(&mut rhs);
        for (p, j) in rhs.iter().zip(&set) {
            out[*j] = *p;
        }
    }
}

impl Structure {
    /// Returns the energy, J, whose rounding the ledger shows beside that of its `throughput` E. It is the work of the loads on free masses
    /// in one step of `step` seconds, plus `√(E k ℓ²)` of the contacts. A penetration is rounded by ε of the distance ℓ of the flank; a
    /// motion of amplitude a, `E = k a²`, does the work `ε k ℓ a` on that.
    #[must_use]
    pub fn rounded_energy(&self, step: f64, throughput: f64) -> f64 {
        let of_loads = (0..self.n).map(|i| (self.largest_load(i) * step).powi(2) / self.spec.mass[(i, i)]);
        of_loads.sum::<f64>() + self.rounded_stretches(throughput)
    }

    /// Returns the energy, J, that rounding shows for held bodies, beside that of the `throughput` E. It is the work of the loads on the
    /// rounded displacements `reach`, m, plus that of the contacts as in [`rounded_energy`](Self::rounded_energy).
    #[must_use]
    pub fn held_energy(&self, reach: &[f64], throughput: f64) -> f64 {
        let of_loads = reach[..self.n].iter().enumerate().map(|(i, reach)| self.largest_load(i) * reach);
        of_loads.sum::<f64>() + self.rounded_stretches(throughput)
    }

    /// Returns the largest load on degree of freedom `i`, N.
    fn largest_load(&self, i: usize) -> f64 {
        let waves: f64 = self.spec.load_harmonics.iter().map(|load| load.vector[i].abs()).sum();
        let schedules = self.spec.load_schedules.iter().map(|load| (load.factor.maximum() * load.vector[i]).abs());
        self.spec.load[i].abs() + waves + schedules.sum::<f64>()
    }

    /// Returns `√(E Σ k ℓ²)`, J: a stretch is rounded by ε of the distance ℓ of the flank.
    fn rounded_stretches(&self, throughput: f64) -> f64 {
        let of_flanks = self.contacts[..self.flanks()].iter().map(|c| {
            let distance = c.gap().abs()
                + c.spec.error_offset.abs()
                + c.error.iter().map(|w| w.cosine.abs() + w.sine.abs()).sum::<f64>();
            let power = if let Some(l) = c.spec.law.power() { l.exponent.value() + 1.0 } else { 2.0 };
            c.stiffest * libm::pow(distance, power)
        });
        (throughput * of_flanks.sum::<f64>()).sqrt()
    }
}

impl PowerBalance for Structure {
    fn energy(&self, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        self.kinetic(x) + self.potential(mode, at, x)
    }

    fn powers(&self, mode: &Mode, at: Instant, x: &[f64]) -> Powers {
        let v = &x[self.n..2 * self.n];
        let along = |f: &[f64]| f.iter().zip(v).fold(0.0, |s, (f, v)| s + f * v);
        let mut powers =
            Powers { load: along(&self.spec.load), damping: form(&self.forms[1], v, v), ..Powers::default() };
        for (load, wave) in self.spec.load_harmonics.iter().zip(&self.load_waves) {
            let o = self.oscillators[wave.index];
            powers.load += libm::cos(self.clock.angle(o.omega, o.order, at) + load.phase) * along(&load.vector);
        }
        let mut forces = zeros(self.contacts.len());
        self.carried(mode, at, x, &mut forces);
        for (load, factor) in self.spec.load_schedules.iter().zip(&forces[self.flanks()..]) {
            powers.load += factor * along(&load.vector);
        }
        for (j, c) in self.contacts[..self.flanks()].iter().enumerate() {
            let (lost, parametric) = self.contact_powers(self.acting(mode, j), at, x);
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
        let switched = self.switched(t.from, t.at);
        for j in 0..self.flanks() {
            let stored = |mode| self.stored_in(self.acting(mode, j), t.at, t.x_minus);
            let (old, switched, new) = (stored(t.from), stored(&switched), stored(t.to));
            jump.parametric += switched - old;
            jump.release += switched - new;
        }
        let mut impulses = zeros(self.flanks());
        self.impulses_of(t, &mut impulses);
        for (j, p) in impulses.iter().enumerate().filter(|(_, p)| **p != 0.0) {
            jump.error -= p * self.error(j, t.at).1;
        }
        if t.x_plus[..self.n] != t.x_minus[..self.n] {
            jump.projection = self.potential(t.to, t.at, t.x_plus) - self.potential(t.to, t.at, t.x_minus);
        }
        if t.x_plus[self.n..] != t.x_minus[self.n..] {
            jump.impact = jump.error + self.kinetic(t.x_minus) - self.kinetic(t.x_plus);
        }
        jump
    }
}
