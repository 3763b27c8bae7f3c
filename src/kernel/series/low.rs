//! Rounding of the lowest coefficients of a linear mode.
//!
//! Taken as exact numbers, the coefficients of the fast path fulfil their recurrence up to a residual, which is formed in two
//! doubles and divided by `k + 1`. Beyond the orders kept, the terms are so small that their rounding does not affect the state.

use crate::{
    hybrid::{FULL_PRECISION, Jet, Wide},
    kernel::{
        Expansion, Force, Watch,
        mode::{compiled::LARGEST, motion::ContactInMode},
    },
    system::PerContact,
};

/// Orders above zero whose rounding is kept. A step truncated at 1e-21 is 1.5 rad, its term of order 11 is 2e-6 of the first, and
/// the rounding of that 2e-22.
const KEPT: usize = 10;

/// Returns `(h y − next/inverse) · inverse`, for a product close to `next`.
fn residual(h: f64, y: Wide, k: f64, next: f64, inverse: f64) -> f64 {
    let (is, was) = (Wide::product(h, y.hi), Wide::product(k, next));
    ((is.hi - was.hi) + (h * y.lo + (is.lo - was.lo))) * inverse
}

impl Expansion<'_> {
    /// Returns whether the state has a low part: not while a power law is closed, as small penetrations are carried instead, and not if
    /// more than rounding is left out.
    pub fn keeps_low(&self) -> bool {
        let is_power = |part: &ContactInMode| matches!(part.force(), Some(Force::Power { .. }));
        let is_full = self.request.tolerance <= FULL_PRECISION;
        is_full && self.s.is_conservative && !self.request.low.is_empty() && !self.motion.parts.iter().any(is_power)
    }

    /// Returns `δ − σ b` of contact `j` at the start, m, by the state unless it is exactly zero.
    pub fn stretch_in_two(&self, j: usize, side: f64) -> Wide {
        if [Watch::DriveFlank, Watch::BackFlank, Watch::Force].iter().any(|w| self.pinned(j, *w)) {
            return Wide::default();
        }
        let deflection = self.s.deflection_in_two(j, self.request.at, self.request.x, self.request.low);
        deflection - (side * self.s.contacts[j].offset()).into()
    }

    /// Forms the low parts of the lowest orders; `closed` holds the contacts that carry force and their stiffnesses.
    pub fn low(&self, closed: PerContact<(usize, f64)>, out: &mut Jet) {
        let (s, h, n, dim) = (self.s, self.h, self.s.n, self.s.dim);
        let Jet { state, low, .. } = out;
        low.resize((KEPT + 1) * dim, 0.0);
        low[..dim].copy_from_slice(self.request.low);
        for k in 0..KEPT {
            let (x, next) = state[k * dim..(k + 2) * dim].split_at(dim);
            let (now, later) = low[k * dim..(k + 2) * dim].split_at_mut(dim);
            let value = |i: usize| Wide { hi: x[i], lo: now[i] };
            let mut a = [Wide::default(); LARGEST];
            for (i, a) in a[..n].iter_mut().enumerate() {
                let load = if k == 0 { s.load[i] } else { 0.0 };
                *a = s.rows[i].iter().fold(load.into(), |a, (j, by_q, by_v)| {
                    let j = *j as usize;
                    let a = a + value(j) * -by_q;
                    if *by_v == 0.0 { a } else { a + value(n + j) * -by_v }
                });
            }
            for &(j, stiffness) in &closed {
                let c = &s.contacts[j];
                let stretch = if k == 0 {
                    self.stretch_in_two(j, self.motion.parts[j].side)
                } else {
                    c.direction.iter().fold(Wide::default(), |d, (i, g)| d + value(*i as usize) * *g)
                };
                let force = stretch * stiffness;
                c.push.iter().for_each(|(i, p)| a[*i as usize] = a[*i as usize] - force * *p);
            }
            let (k, inverse) = ((k + 1) as f64, 1.0 / (k + 1) as f64);
            for i in 0..n {
                later[i] = residual(h, value(n + i), k, next[i], inverse);
                later[n + i] = residual(h, a[i], k, next[n + i], inverse);
            }
        }
    }
}
