//! Deflections, forces and accelerations in a state, and the vector field built from them.

use super::{
    acting::{ActiveContact, Force},
    assemble::{Contact, Structure, dot, zeros},
    sticking::Sticking,
};
use crate::hybrid::{Instant, Mode, Rates, VectorField};

impl Structure {
    /// Returns the transmission error of contact `j` and its first two derivatives, m, m/s, m/s².
    pub(crate) fn error(&self, j: usize, at: Instant) -> (f64, f64, f64) {
        let c = &self.contacts[j];
        let (mut e, mut de, mut dde) = (c.spec.error_offset, 0.0, 0.0);
        for w in &c.error {
            let o = self.oscillators[w.index];
            let (sin, cos) = self.clock.sincos(o.omega, o.order, at);
            let value = w.cosine * cos + w.sine * sin;
            e += value;
            de += o.omega * (w.sine * cos - w.cosine * sin);
            dde -= o.omega * o.omega * value;
        }
        (e, de, dde)
    }

    /// Returns the deflection `δ = gᵀq − e`, m, and its rate, m/s, of contact `j`. `x` is the state, `[dim]`.
    #[must_use]
    pub fn deflection(&self, j: usize, at: Instant, x: &[f64]) -> (f64, f64) {
        let (e, de, _) = self.error(j, at);
        let g = &self.contacts[j].direction;
        (dot(g, x) - e, dot(g, &x[self.n..]) - de)
    }

    /// Writes the contact forces along each `g_j`, N, into `forces`, and accelerations, m/s², into `a` `[n]`.
    pub fn dynamics(&self, mode: &Mode, at: Instant, x: &[f64], forces: &mut [f64], a: &mut [f64]) {
        forces[..self.contacts.len()].fill(0.0);
        self.carrying(mode).for_each(|acting| forces[acting.contact] = self.law_force(&acting, at, x));
        self.accelerate(mode, at, x, forces, a);
    }

    /// Writes accelerations, m/s², into `a` `[n]`, under the `forces` of laws, N; adds the forces of contacts at rest to `forces`.
    pub(crate) fn accelerate(&self, mode: &Mode, at: Instant, x: &[f64], forces: &mut [f64], a: &mut [f64]) {
        a.copy_from_slice(&self.load);
        self.load_waves.iter().for_each(|w| {
            let o = self.oscillators[w.index];
            let (sin, cos) = self.clock.sincos(o.omega, o.order, at);
            a.iter_mut().zip(w.cosine.iter().zip(&w.sine)).for_each(|(a, (wc, ws))| *a += wc * cos + ws * sin);
        });
        let (q, v) = (&x[..self.n], &x[self.n..2 * self.n]);
        for (i, a) in a.iter_mut().enumerate() {
            *a = self.rows[i].iter().fold(*a, |a, (j, k, c)| a - k * q[*j as usize] - c * v[*j as usize]);
        }
        for acting in self.carrying(mode) {
            let force = forces[acting.contact];
            self.contacts[acting.contact].push.iter().for_each(|(i, p)| a[*i as usize] -= p * force);
        }
        self.hold_at_rest(mode, |j| self.error(j, at).2, forces, a);
    }

    /// Adds to `a` the accelerations that give contacts at rest the `wanted` ones along `g_j`, and writes the necessary forces.
    fn hold_at_rest(&self, mode: &Mode, wanted: impl Fn(usize) -> f64, forces: &mut [f64], a: &mut [f64]) {
        let Some(held) = Sticking::new(self, mode) else { return };
        let mut f = zeros(held.contacts().len());
        for (f, &j) in f.iter_mut().zip(held.contacts()) {
            *f = dot(&self.contacts[j].direction, a) - wanted(j);
        }
        held.solve(&mut f);
        for (f, &j) in f.iter().zip(held.contacts()) {
            forces[j] = *f;
            self.contacts[j].push.iter().for_each(|(i, p)| a[*i as usize] -= p * f);
        }
    }

    /// Returns the size of the terms of a deflection, m: its rounding error is a few units of this.
    pub(crate) fn deflection_size(&self, c: &Contact, x: &[f64]) -> f64 {
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * x[*i as usize]).abs()).sum();
        terms + c.gap().abs() + c.error_sizes[0]
    }

    /// Returns the size of the terms of a deflection rate, m/s.
    pub(crate) fn rate_size(&self, c: &Contact, x: &[f64]) -> f64 {
        let v = &x[self.n..];
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * v[*i as usize]).abs()).sum();
        terms + c.error_sizes[1]
    }

    /// Returns the size of the terms of the acceleration of contact `j`, m/s²: its rounding error is a few units of this. `force` gives the
    /// force of any contact of those `carrying` one, N.
    pub(crate) fn acceleration_size(
        &self,
        j: usize,
        carrying: impl Iterator<Item = ActiveContact>,
        x: &[f64],
        force: impl Fn(&ActiveContact) -> f64,
    ) -> f64 {
        let (q, v) = (&x[..self.n], &x[self.n..2 * self.n]);
        let free: f64 = self.contacts[j]
            .direction
            .iter()
            .map(|(i, g)| {
                let i = *i as usize;
                let structure: f64 =
                    self.rows[i].iter().map(|(c, k, d)| (k * q[*c as usize]).abs() + (d * v[*c as usize]).abs()).sum();
                g.abs() * (self.pulls[i][0] + structure)
            })
            .sum();
        let contacts: f64 = carrying.map(|k| (self.coupling(j, k.contact) * force(&k)).abs()).sum();
        free + contacts + self.contacts[j].error_sizes[2]
    }

    /// Returns the natural rates of the elements of a mode, each with its effective mass: degrees of freedom on their supports, and closed
    /// linear contacts. (A power law sets its own time scale and is never stiff by itself.)
    pub(crate) fn own_rates(&self, mode: &Mode) -> Rates {
        let mut rates = Rates::default();
        let mut meet = |square: f64, damping: f64| {
            let omega = square.max(0.0).sqrt();
            // x″ + d x′ + ω² x: for at least half the critical damping, d ≥ ω, the fast root decays at about d.
            if damping >= omega {
                rates.damped = rates.damped.max(damping);
            } else {
                rates.oscillating = rates.oscillating.max(omega);
            }
        };
        // Zero beyond the last degree of freedom, which changes no maximum.
        for block in &self.columns.blocks {
            block.by_q.iter().zip(block.by_v).for_each(|(by_q, by_v)| meet(-by_q, -by_v));
        }
        for acting in self.carrying(mode) {
            let c = &self.contacts[acting.contact];
            if let Some(damping) = acting.force.damping() {
                meet(c.stiffest * c.mobility, damping * c.mobility);
            }
        }
        rates
    }

    /// Returns the fastest rate of the closed power laws, `max(√(μ dF/dp), μ χ K pⁿ)` with `μ = gᵀM⁻¹g`, and writes the sizes of the state.
    /// A displacement size is `M⁻¹g p/μ`, which removes the penetration, of the least such contact. It is at least a twentieth of the
    /// displacement itself, whose rounding counts. A velocity size is that times the rate.
    pub(crate) fn pressed_sizes(&self, mode: &Mode, at: Instant, x: &[f64], sizes: &mut [f64]) -> Option<f64> {
        let (n, mut fastest) = (self.n, 0.0);
        sizes.fill(f64::INFINITY);
        for acting in self.carrying(mode) {
            let Force::Power { law, stiffness, .. } = acting.force else { continue };
            let c = &self.contacts[acting.contact];
            let (d, rate) = self.deflection(acting.contact, at, x);
            let p = acting.side * d - c.gap();
            if p <= 0.0 {
                return None;
            }
            let force = stiffness * libm::pow(p, law.exponent.value());
            let tangent = law.exponent.value() * force / p * self.factor(&acting, rate, x).max(0.0);
            let damped = acting.force.chi(x) * force * c.mobility;
            fastest = (tangent * c.mobility).sqrt().max(damped).max(fastest);
            c.push.iter().for_each(|(i, push)| {
                let size = &mut sizes[*i as usize];
                *size = size.min((p * push / c.mobility).abs());
            });
        }
        if fastest == 0.0 {
            return None;
        }
        let largest = x[..n].iter().fold(f64::MIN_POSITIVE, |m: f64, q| m.max(q.abs()));
        for i in 0..n {
            let pressed = if sizes[i].is_finite() { sizes[i] } else { largest };
            sizes[i] = pressed.max(0.05 * x[i].abs());
            sizes[n + i] = fastest * sizes[i];
        }
        // Latched speeds do not change.
        sizes[2 * n..].iter_mut().zip(&x[2 * n..]).for_each(|(s, x)| *s = *x);
        Some(fastest)
    }

    /// Returns `g_iᵀ M⁻¹ g_j`, 1/kg.
    pub(crate) fn coupling(&self, i: usize, j: usize) -> f64 {
        self.contacts[i].couplings[j]
    }
}

impl VectorField for Structure {
    fn eval(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]) {
        let mut forces = zeros(self.contacts.len());
        let (dq, rest) = dx.split_at_mut(self.n);
        let (dv, latches) = rest.split_at_mut(self.n);
        dq.copy_from_slice(&x[self.n..2 * self.n]);
        latches.fill(0.0);
        self.dynamics(mode, self.clock.advance(base, t), x, &mut forces, dv);
    }

    fn jac_mul(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) {
        let at = self.clock.advance(base, t);
        let n = self.n;
        let (q1, v1) = (&v[..n], &v[n..2 * n]);
        jv[..n].copy_from_slice(v1);
        jv[2 * n..].fill(0.0);
        for i in 0..n {
            jv[n + i] = self.rows[i].iter().fold(0.0, |a, (j, k, c)| a - k * q1[*j as usize] - c * v1[*j as usize]);
        }
        for acting in self.carrying(mode) {
            let c = &self.contacts[acting.contact];
            let df = self.force_change(&acting, at, x, [dot(&c.direction, q1), dot(&c.direction, v1)], v);
            c.push.iter().for_each(|(i, p)| jv[n + *i as usize] -= p * df);
        }
        self.hold_at_rest(mode, |_| 0.0, &mut zeros(self.contacts.len()), &mut jv[n..2 * n]);
    }
}
