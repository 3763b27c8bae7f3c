//! Deflections, forces and accelerations at a point, and their use as a plain vector field.

use super::{
    assemble::{Contact, MAX_CONTACTS, Spring, Structure, dot},
    contact_mode::{ContactMode, contact_mode, piece},
    sticking::Sticking,
};
use crate::{
    gear::contact::Law,
    hybrid::{Instant, Mode, Rates, VectorField},
};

impl Structure {
    /// Transmission error of contact `j` and its first two derivatives, m, m/s, m/s².
    pub(super) fn error(&self, j: usize, at: Instant) -> (f64, f64, f64) {
        let c = &self.contacts[j];
        let (mut e, mut de, mut dde) = (c.spec.error_offset, 0.0, 0.0);
        for w in &c.error {
            let o = self.oscillators[w.index];
            let (sin, cos) = self.clock.angle(o.omega, o.order, at).sin_cos();
            let value = w.cosine * cos + w.sine * sin;
            e += value;
            de += o.omega * (w.sine * cos - w.cosine * sin);
            dde -= o.omega * o.omega * value;
        }
        (e, de, dde)
    }

    /// Deflection `δ = gᵀq − e`, m, and its rate, m/s, of contact `j`. `x` is the state, `[dim]`.
    #[must_use]
    pub fn deflection(&self, j: usize, at: Instant, x: &[f64]) -> (f64, f64) {
        let (e, de, _) = self.error(j, at);
        let g = &self.contacts[j].direction;
        (dot(g, x) - e, dot(g, &x[self.n..]) - de)
    }

    /// Stiffness of contact `j` and its rate of change, N/m, N/(m s).
    pub(super) fn stiffness(&self, j: usize, mode: Mode, at: Instant) -> (f64, f64) {
        match &self.contacts[j].spring {
            Spring::Constant(k) => (*k, 0.0),
            Spring::Waves(mean, waves) => waves.iter().fold((*mean, 0.0), |(k, dk), w| {
                let o = self.oscillators[w.index];
                let (sin, cos) = self.clock.angle(o.omega, o.order, at).sin_cos();
                (k + w.cosine * cos + w.sine * sin, dk + o.omega * (w.sine * cos - w.cosine * sin))
            }),
            Spring::Scheduled(s) => {
                let number = piece(mode, j);
                let (value, slope) = s.law(number);
                if slope == 0.0 { (value, 0.0) } else { (value + slope * s.elapsed(&self.clock, at, number), slope) }
            }
        }
    }

    /// What the law of contact `j` gives in `state`, along `g_j`, N, whether or not it is carried: in a
    /// detached state this is the pull that is not exerted. Zero for a rigid law.
    pub(super) fn law_force(&self, j: usize, mode: Mode, state: ContactMode, at: Instant, x: &[f64]) -> f64 {
        let (d, r) = self.deflection(j, at, x);
        let c = &self.contacts[j];
        let side = state.side();
        match c.spec.law {
            Law::Bilateral(l) => self.stiffness(j, mode, at).0 * d + l.damping * r,
            Law::KelvinVoigt(l, _) if side != 0.0 => {
                self.stiffness(j, mode, at).0 * (d - side * c.gap()) + l.damping * r
            }
            Law::Power(l) if side != 0.0 => {
                let p = (side * d - c.gap()).max(0.0);
                side * c.spec.stiffness.mean() * p.powf(l.exponent.value()) * self.factor(c, side * r, x)
            }
            _ => 0.0,
        }
    }

    /// `1 + χ ṗ` of a power law.
    pub(super) fn factor(&self, c: &Contact, rate: f64, x: &[f64]) -> f64 {
        match (c.spec.law, c.latch) {
            (Law::Power(l), Some(i)) => 1.0 + l.hysteresis / x[i] * rate,
            _ => 1.0,
        }
    }

    /// Contact forces along each `g_j`, N, into `forces`, and accelerations, m/s², into `a` `[n]`.
    pub fn dynamics(&self, mode: Mode, at: Instant, x: &[f64], forces: &mut [f64], a: &mut [f64]) {
        a.copy_from_slice(&self.load);
        self.load_waves.iter().for_each(|w| {
            let o = self.oscillators[w.index];
            let (sin, cos) = self.clock.angle(o.omega, o.order, at).sin_cos();
            a.iter_mut().zip(w.cosine.iter().zip(&w.sine)).for_each(|(a, (wc, ws))| *a += wc * cos + ws * sin);
        });
        let (q, v) = (&x[..self.n], &x[self.n..2 * self.n]);
        for (i, a) in a.iter_mut().enumerate() {
            *a = self.rows[i].iter().fold(*a, |a, (j, k, c)| a - k * q[*j as usize] - c * v[*j as usize]);
        }
        for (j, c) in self.contacts.iter().enumerate() {
            let state = contact_mode(mode, j);
            let carries = state.is_closed() || matches!(c.spec.law, Law::Bilateral(_));
            forces[j] = if carries { self.law_force(j, mode, state, at, x) } else { 0.0 };
            c.push.iter().for_each(|(i, p)| a[*i as usize] -= p * forces[j]);
        }
        self.hold_at_rest(mode, |j| self.error(j, at).2, forces, a);
    }

    /// Forces `wanted` accelerations on the contacts at rest, along each `g_j`, onto `a`, and gives the forces that it takes.
    fn hold_at_rest(&self, mode: Mode, wanted: impl Fn(usize) -> f64, forces: &mut [f64], a: &mut [f64]) {
        let Some(held) = Sticking::new(self, mode) else { return };
        let mut f = [0.0; MAX_CONTACTS];
        for (f, &j) in f.iter_mut().zip(held.contacts()) {
            *f = dot(&self.contacts[j].direction, a) - wanted(j);
        }
        held.solve(&mut f);
        for (f, &j) in f.iter().zip(held.contacts()) {
            forces[j] = *f;
            self.contacts[j].push.iter().for_each(|(i, p)| a[*i as usize] -= p * f);
        }
    }

    /// Size of the terms whose sum is a deflection, m: its rounding error is a few units of this.
    pub(super) fn deflection_size(&self, c: &Contact, x: &[f64]) -> f64 {
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * x[*i as usize]).abs()).sum();
        terms + c.gap().abs() + c.error.iter().map(|w| w.cosine.abs() + w.sine.abs()).sum::<f64>()
    }

    /// Size of the terms whose sum is a deflection rate, m/s.
    pub(super) fn rate_size(&self, c: &Contact, x: &[f64]) -> f64 {
        let v = &x[self.n..];
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * v[*i as usize]).abs()).sum();
        terms + c.error_rate.iter().map(|w| w.cosine.abs() + w.sine.abs()).sum::<f64>()
    }

    /// Size of the terms whose sum is the acceleration of contact `j`, m/s²: its rounding error is a few units of
    /// this. `force` gives the force of any contact that carries one, N.
    pub(super) fn acceleration_size(&self, j: usize, mode: Mode, x: &[f64], force: impl Fn(usize) -> f64) -> f64 {
        let (q, v) = (&x[..self.n], &x[self.n..2 * self.n]);
        let free: f64 = self.contacts[j]
            .direction
            .iter()
            .map(|(i, g)| {
                let i = *i as usize;
                let waves: f64 = self.load_waves.iter().map(|w| w.cosine[i].abs() + w.sine[i].abs()).sum();
                let structure: f64 =
                    self.rows[i].iter().map(|(c, k, d)| (k * q[*c as usize]).abs() + (d * v[*c as usize]).abs()).sum();
                g.abs() * (self.load[i].abs() + waves + structure)
            })
            .sum();
        let carries =
            |k: &usize| contact_mode(mode, *k).is_closed() || matches!(self.contacts[*k].spec.law, Law::Bilateral(_));
        let contacts: f64 =
            (0..self.contacts.len()).filter(carries).map(|k| (self.coupling(j, k) * force(k)).abs()).sum();
        let flank: f64 = self.contacts[j]
            .error
            .iter()
            .map(|w| self.oscillators[w.index].omega.powi(2) * (w.cosine.abs() + w.sine.abs()))
            .sum();
        free + contacts + flank
    }

    /// Own rates of the elements of a mode, each alone on the mass it feels: freedoms on their supports, closed linear
    /// contacts on their effective masses. (A power law sets its own time scale and is never stiff by itself.)
    pub(super) fn own_rates(&self, mode: Mode) -> Rates {
        let mut rates = Rates::default();
        let mut meet = |square: f64, damping: f64| {
            let omega = square.max(0.0).sqrt();
            // x″ + d x′ + ω² x: from half the critical damping, d = ω, on, the fast root decays at about d.
            if damping >= omega {
                rates.damped = rates.damped.max(damping);
            } else {
                rates.oscillating = rates.oscillating.max(omega);
            }
        };
        for (by_q, by_v) in self.columns.by_q.iter().zip(&self.columns.by_v) {
            meet(-by_q, -by_v);
        }
        for (j, c) in self.contacts.iter().enumerate() {
            if let Some(l) = c.carried_linear(contact_mode(mode, j)) {
                meet(c.spec.stiffness.maximum() * c.mobility, l.damping * c.mobility);
            }
        }
        rates
    }

    /// The fastest rate of the closed power laws, `max(√(μ dF/dp), μ χ K pⁿ)` with `μ = gᵀM⁻¹g`, and the sizes of the state:
    /// the displacement `M⁻¹g p/μ` that takes the penetration away, of the least such contact, but at least a twentieth of
    /// the displacement itself, whose rounding counts; for velocities the rate times that.
    pub(super) fn pressed_sizes(&self, mode: Mode, at: Instant, x: &[f64], sizes: &mut [f64]) -> Option<f64> {
        let (n, mut fastest) = (self.n, 0.0);
        sizes.fill(f64::INFINITY);
        for (j, c) in self.contacts.iter().enumerate() {
            let (Law::Power(l), state) = (c.spec.law, contact_mode(mode, j)) else { continue };
            if !state.is_closed() {
                continue;
            }
            let (d, rate) = self.deflection(j, at, x);
            let p = state.side() * d - c.gap();
            if p <= 0.0 {
                return None;
            }
            let force = c.spec.stiffness.mean() * p.powf(l.exponent.value());
            let tangent = l.exponent.value() * force / p * self.factor(c, state.side() * rate, x).max(0.0);
            let damped = c.latch.map_or(0.0, |i| l.hysteresis / x[i]) * force * c.mobility;
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

    /// `g_iᵀ M⁻¹ g_j`, 1/kg.
    pub(super) fn coupling(&self, i: usize, j: usize) -> f64 {
        self.contacts[i]
            .direction
            .iter()
            .map(|(row, g)| g * self.contacts[j].push.iter().find(|(r, _)| r == row).map_or(0.0, |(_, p)| *p))
            .sum()
    }
}

impl VectorField for Structure {
    fn eval(&self, mode: Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]) {
        let mut forces = [0.0; MAX_CONTACTS];
        let (dq, rest) = dx.split_at_mut(self.n);
        let (dv, latches) = rest.split_at_mut(self.n);
        dq.copy_from_slice(&x[self.n..2 * self.n]);
        latches.fill(0.0);
        self.dynamics(mode, self.clock.advance(base, t), x, &mut forces, dv);
    }

    fn jac_mul(&self, mode: Mode, base: Instant, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) {
        let at = self.clock.advance(base, t);
        let n = self.n;
        let (q1, v1) = (&v[..n], &v[n..2 * n]);
        jv[..n].copy_from_slice(v1);
        jv[2 * n..].fill(0.0);
        for i in 0..n {
            jv[n + i] = self.rows[i].iter().fold(0.0, |a, (j, k, c)| a - k * q1[*j as usize] - c * v1[*j as usize]);
        }
        for (j, c) in self.contacts.iter().enumerate() {
            let state = contact_mode(mode, j);
            let (d1, r1) = (dot(&c.direction, q1), dot(&c.direction, v1));
            let df = match c.spec.law {
                Law::Bilateral(l) => self.stiffness(j, mode, at).0 * d1 + l.damping * r1,
                Law::KelvinVoigt(l, _) if state.is_closed() => self.stiffness(j, mode, at).0 * d1 + l.damping * r1,
                Law::Power(l) if state.is_closed() => {
                    let (d, r) = self.deflection(j, at, x);
                    let (side, k, n) = (state.side(), c.spec.stiffness.mean(), l.exponent.value());
                    let p = (side * d - c.gap()).max(0.0);
                    let by_p = k * n * p.powf(n - 1.0) * self.factor(c, side * r, x);
                    let (by_rate, by_latch) = c.latch.map_or((0.0, 0.0), |i| {
                        let chi = l.hysteresis / x[i];
                        let force = k * p.powf(n);
                        (force * chi, -side * force * chi / x[i] * side * r * v[i])
                    });
                    by_p * d1 + by_rate * r1 + by_latch
                }
                _ => 0.0,
            };
            c.push.iter().for_each(|(i, p)| jv[n + *i as usize] -= p * df);
        }
        self.hold_at_rest(mode, |_| 0.0, &mut [0.0; MAX_CONTACTS], &mut jv[n..2 * n]);
    }
}
