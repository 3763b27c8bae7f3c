//! Rebound of the only contact of a train, by Newton's rule alone.

use super::{
    assemble::Structure,
    contact_mode::{ContactMode, Watch, contact_mode, guard_of},
    unilateral::rounding,
};
use crate::{
    gear::contact::{Law, Rigid},
    hybrid::{GuardId, GuardSet, Instant, Jump},
};

impl Structure {
    /// Returns the law of the impacts of guard `id`; `None` if it is no flank of a rigid contact.
    pub(super) fn rebound_law(&self, id: GuardId) -> Option<&Rigid> {
        match (guard_of(id), &self.contacts.get(guard_of(id).0)?.spec.law) {
            ((_, Watch::DriveFlank | Watch::BackFlank), Law::Rigid(law)) => Some(law),
            _ => None,
        }
    }

    /// Makes the impact of `fired` as the rebound of the only contact of the train; `None` if it is more than that.
    pub(super) fn rebound_of(
        &self,
        from: &Jump,
        fired: &GuardSet,
        settles: bool,
        at: Instant,
        x: &mut [f64],
    ) -> Option<(GuardId, f64)> {
        let id = fired.iter().next().filter(|_| fired.len() == 1 && self.contacts.len() == 1)?;
        let is_open = contact_mode(&from.mode, 0) == ContactMode::Separated;
        if settles || !is_open || !from.still.is_empty() {
            return None;
        }
        Some((id, self.rebound_alone(guard_of(id).1, at, x)?))
    }

    /// Makes the rebound of the only contact of a train, open before, from the flank of `watch`. Returns the error of its deflection, m;
    /// `None` if the rebound may be lost in rounding.
    pub(crate) fn rebound_alone(&self, watch: Watch, at: Instant, x: &mut [f64]) -> Option<f64> {
        let (side, c) = (watch.side(), &self.contacts[0]);
        let Law::Rigid(law) = &c.spec.law else { return None };
        let speed = side * self.deflection(0, at, x).1;
        let restitution = law.restitution.at(speed);
        let change = (1.0 + restitution) * speed;
        let error = self.speed_rounding(0, at, x);
        if restitution * speed <= error || change <= error + rounding(1) * change {
            return None;
        }
        let projected = self.project(std::iter::once((0, side)), at, |j| self.error(j, at).0, x, &mut []);
        let impulse = change / self.coupling(0, 0);
        for (i, p) in &c.push {
            x[self.n + *i as usize] -= p * side * impulse;
        }
        Some(projected)
    }
}
