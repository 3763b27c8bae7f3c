//! Conservative motion in two doubles.
//!
//! Such motion never forgets an error. If its period depends on the energy, a bias of ε in every period grows to `ε N²/2` periods after N
//! of them. 10⁴ periods within 1e-11 of one need 2e-18: less than the rounding of a double. The state is then `x + low`, and events act on
//! it with 32 digits.

use super::{
    assemble::{PerContact, Structure, zeros},
    contact_mode::{Watch, contact_mode, guard_of},
    spec::Spec,
};
use crate::{
    gear::{Harmonic, Stiffness},
    hybrid::{GuardId, Instant, Mode, Wide, normalise},
};

/// Returns whether all motion of a train keeps its energy: no forcing but constant loads, no loss, constant stiffnesses.
pub(crate) fn conserves(spec: &Spec) -> bool {
    let still = |waves: &[Harmonic]| waves.iter().all(|h| h.amplitude == 0.0);
    // A gyroscopic matrix is skew and does no work.
    let c = &spec.damping;
    c.iter().zip(c.transpose().iter()).all(|(a, b)| *a == -b)
        && spec.load_harmonics.iter().all(|l| l.vector.iter().all(|f| *f == 0.0))
        && spec.load_schedules.is_empty()
        && spec.contacts.iter().all(|c| {
            let is_still = c.errors().all(|error| still(error));
            c.law.is_lossless()
                && c.gap_damping == 0.0
                && is_still
                && c.schedules().all(|k| matches!(k, Stiffness::Constant(_)))
        })
}

/// `Σ row_i (x_i + low_i)`.
fn dot_in_two(row: &[(u32, f64)], x: &[f64], low: &[f64]) -> Wide {
    row.iter().fold(Wide::default(), |sum, (i, g)| {
        let product = Wide::product(*g, x[*i as usize]);
        sum + Wide { lo: g * low[*i as usize] + product.lo, ..product }
    })
}

impl Structure {
    /// Returns the deflection of contact `j` in the state `x + low`, m.
    pub(crate) fn deflection_in_two(&self, j: usize, at: Instant, x: &[f64], low: &[f64]) -> Wide {
        dot_in_two(&self.contacts[j].direction, x, low) - self.error(j, at).0.into()
    }

    /// Returns the rate of the deflection of contact `j` in the state `x + low`, m/s.
    fn rate_in_two(&self, j: usize, at: Instant, x: &[f64], low: &[f64]) -> Wide {
        dot_in_two(&self.contacts[j].direction, &x[self.n..], &low[self.n..]) - self.error(j, at).1.into()
    }

    /// Returns the rates of `contacts`, m/s; empty if the low part is not kept.
    pub(crate) fn rates_in_two(
        &self,
        contacts: impl Iterator<Item = usize>,
        at: Instant,
        x: &[f64],
        low: &[f64],
    ) -> PerContact<Wide> {
        contacts.filter(|_| !low.is_empty()).map(|j| self.rate_in_two(j, at, x, low)).collect()
    }

    /// Corrects the low part so that the contacts in `wanted` have these rates, which they have up to rounding.
    pub(crate) fn refine(&self, wanted: impl Iterator<Item = (usize, Wide)>, at: Instant, x: &[f64], low: &mut [f64]) {
        let (mut contacts, mut by) = (PerContact::<usize>::new(), PerContact::<f64>::new());
        for (j, rate) in wanted {
            by.push((rate - self.rate_in_two(j, at, x, low)).value());
            contacts.push(j);
        }
        if !contacts.is_empty() {
            self.shift(contacts.iter().copied(), &by, &mut low[self.n..2 * self.n]);
        }
    }

    /// Moves `x + low` along the flow onto a flank; see [`meet`](crate::hybrid::HybridSystem::meet). Without damping a force falls through
    /// zero on the flank as well.
    pub(crate) fn meet_guard(
        &self,
        mode: &Mode,
        id: GuardId,
        at: Instant,
        most: f64,
        x: &mut [f64],
        low: &mut [f64],
    ) -> f64 {
        let (j, watch) = guard_of(id);
        let c = &self.contacts[j];
        let is_multiplier = watch == Watch::Force && c.spec.law.is_rigid();
        if !self.is_conservative || is_multiplier {
            return 0.0;
        }
        let side = if watch == Watch::Force { contact_mode(mode, j).side() } else { watch.side() };
        let off = self.deflection_in_two(j, at, x, low) - (side * c.gap()).into();
        let by = -off.value() / self.rate_in_two(j, at, x, low).value();
        if by.is_nan() || by.abs() > most {
            return 0.0;
        }
        let (mut forces, mut a) = (zeros(self.contacts.len()), vec![0.0; self.n]);
        self.dynamics(mode, at, x, &mut forces, &mut a);
        for (low, rate) in low.iter_mut().zip(x[self.n..2 * self.n].iter().chain(&a)) {
            *low += by * rate;
        }
        normalise(x, low);
        by
    }
}
