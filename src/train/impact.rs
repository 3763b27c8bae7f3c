//! Impacts of rigid contacts: all that are closed at one instant are solved together.
//!
//! With impulses `P_j` along `g_j` (compressive on contact side σ: `σ P ≥ 0`),
//!
//! ```text
//! v⁺ = v⁻ − M⁻¹ Σ g_j P_j,     δ̇⁺ = −e δ̇⁻ where P ≠ 0,     σ δ̇⁺ ≤ −e σ δ̇⁻ and P = 0 elsewhere
//! ```
//!
//! a linear complementarity problem in the matrix `G M⁻¹ Gᵀ`. It is solved by principal pivoting with the
//! least-index rule (Murty 1974), finite for a positive definite matrix.

use super::{
    assemble::{MAX_CONTACTS, Structure, dot},
    contact_mode::{ContactMode, contact_mode},
    sticking::Sticking,
};
use crate::{
    gear::contact::Law,
    hybrid::{Instant, Mode, ModelError},
};

/// A contact taking part in an impact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Striker {
    pub contact: usize,
    /// +1 on the drive flank, −1 on the back flank.
    pub side: f64,
    /// Restitution to apply: zero to bring to rest.
    pub restitution: f64,
}

impl Structure {
    /// Speed at which contact `j` closes on `side`, m/s.
    pub(super) fn closing_speed(&self, j: usize, side: f64, at: Instant, x: &[f64]) -> f64 {
        side * self.deflection(j, at, x).1
    }

    /// A closing speed below this is rounding of the sum it is computed from.
    pub(super) fn speed_rounding(&self, j: usize, at: Instant, x: &[f64]) -> f64 {
        let c = &self.contacts[j];
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * x[self.n + *i as usize]).abs()).sum();
        8.0 * f64::EPSILON * (terms + self.error(j, at).1.abs())
    }

    /// Applies the impulses of `strikers` and of the contacts already at rest in `mode`.
    pub(super) fn strike(
        &self,
        mode: Mode,
        strikers: &[Striker],
        at: Instant,
        x: &mut [f64],
    ) -> Result<(), ModelError> {
        let mut all = [Striker { contact: 0, side: 0.0, restitution: 0.0 }; MAX_CONTACTS];
        let mut len = 0;
        let resting = (0..self.contacts.len())
            .filter(|j| matches!(self.contacts[*j].spec.law, Law::Rigid(_)) && contact_mode(mode, *j).is_closed())
            .filter(|j| strikers.iter().all(|s| s.contact != *j))
            .map(|j| Striker { contact: j, side: contact_mode(mode, j).side(), restitution: 0.0 });
        for s in strikers.iter().copied().chain(resting) {
            all[len] = s;
            len += 1;
        }
        let all = &all[..len];
        let mut before = [0.0; MAX_CONTACTS];
        for (b, s) in before.iter_mut().zip(all) {
            *b = self.deflection(s.contact, at, x).1;
        }
        let mut active = [false; MAX_CONTACTS];
        for (a, (s, b)) in active.iter_mut().zip(all.iter().zip(&before)) {
            *a = s.side * b > 0.0;
        }
        let limit = 1 << (len + 2).min(16);
        for _ in 0..limit {
            let impulses = self.impulses(all, &active, &before);
            match self.first_violation(all, &active, &before, &impulses) {
                Some(i) => active[i] = !active[i],
                None => {
                    for (s, p) in all.iter().zip(&impulses) {
                        for (i, w) in &self.contacts[s.contact].push {
                            x[self.n + *i as usize] -= w * p;
                        }
                    }
                    return Ok(());
                }
            }
        }
        let names: Vec<&str> = all.iter().map(|s| self.contacts[s.contact].spec.name.as_str()).collect();
        Err(ModelError::ImpactUnsolvable { elements: names.join(", "), iterations: limit })
    }

    /// Impulses that give every active contact its rebound.
    fn impulses(&self, all: &[Striker], active: &[bool], before: &[f64]) -> [f64; MAX_CONTACTS] {
        let (mut set, mut rhs, mut len) = ([0; MAX_CONTACTS], [0.0; MAX_CONTACTS], 0);
        for (i, s) in all.iter().enumerate().filter(|(i, _)| active[*i]) {
            set[len] = s.contact;
            rhs[len] = (1.0 + s.restitution) * before[i];
            len += 1;
        }
        Sticking::of(self, set, len).solve(&mut rhs);
        let mut impulses = [0.0; MAX_CONTACTS];
        let mut solved = rhs.iter();
        for (p, _) in impulses.iter_mut().zip(active).take(all.len()).filter(|(_, a)| **a) {
            *p = solved.next().copied().unwrap_or(0.0);
        }
        impulses
    }

    fn first_violation(&self, all: &[Striker], active: &[bool], before: &[f64], impulses: &[f64]) -> Option<usize> {
        let size = before.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
        let slack = 64.0 * f64::EPSILON * size;
        (0..all.len()).find(|&i| {
            let s = all[i];
            if active[i] {
                return s.side * impulses[i] * self.contacts[s.contact].mobility < -slack;
            }
            let change: f64 = all.iter().zip(impulses).map(|(o, p)| self.coupling(s.contact, o.contact) * p).sum();
            s.side * (before[i] - change) > -s.restitution * s.side * before[i] + slack
        })
    }

    /// The name of contact `j`.
    pub(super) fn name_of(&self, j: usize) -> &str {
        &self.contacts[j].spec.name
    }

    /// Moves the state onto `δ_j = target`, by the displacement of least kinetic size. Returns how far δ was off, m.
    pub(super) fn project(&self, j: usize, target: f64, at: Instant, x: &mut [f64]) -> f64 {
        let c = &self.contacts[j];
        let off = target - (dot(&c.direction, x) - self.error(j, at).0);
        for (i, p) in &c.push {
            x[*i as usize] += p / c.mobility * off;
        }
        off.abs()
    }

    /// The state a rigid contact is in while it rests on `side`.
    pub(super) fn resting(side: f64) -> ContactMode {
        if side > 0.0 { ContactMode::Drive } else { ContactMode::Back }
    }
}
