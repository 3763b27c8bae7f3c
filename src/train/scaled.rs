//! A train with scaled contacts: one quantity of every contact is multiplied.

use serde::Serialize;

use crate::system::{ContactSpec, Spec};

/// Quantity of every contact that is multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Stiffness k, at every instant of its schedule. The damping c of linear laws follows as the root of the factor, which keeps the
    /// damping ratio. The hysteresis coefficient of power laws defines a restitution and is not changed.
    Stiffness,
    /// Damping c of linear laws, hysteresis coefficient D of power laws.
    Damping,
    /// Backlash b; of a wall, its distance from the origin.
    Backlash,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 3] = [Self::Stiffness, Self::Damping, Self::Backlash];

    /// `stiffness`, `damping` or `backlash`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::Backlash => "backlash",
        }
    }
}

impl Spec {
    /// Returns the train with `quantity` of every contact multiplied by `factor` ≥ 0. Supports, masses, loads and errors are not changed;
    /// rigid contacts have a backlash alone.
    #[must_use]
    pub fn scaled(&self, quantity: Quantity, factor: f64) -> Self {
        let mut spec = self.clone();
        for contact in &mut spec.contacts {
            match quantity {
                Quantity::Stiffness => {
                    contact.schedules_mut().for_each(|schedule| *schedule = schedule.scaled(factor));
                    if contact.law.is_linear() {
                        contact.law.loss_mut().into_iter().for_each(|damping| *damping *= factor.sqrt());
                    }
                }
                Quantity::Damping => {
                    contact.law.loss_mut().into_iter().for_each(|loss| *loss *= factor);
                }
                Quantity::Backlash => contact.half_backlash *= factor,
            }
        }
        spec
    }

    /// Returns whether `quantity` is non-zero in any contact, so that a factor on it changes the train.
    #[must_use]
    pub fn has(&self, quantity: Quantity) -> bool {
        self.contacts.iter().any(|contact: &ContactSpec| match quantity {
            Quantity::Stiffness => !contact.law.is_rigid() && contact.stiffness.maximum() > 0.0,
            Quantity::Damping => contact.law.loss().is_some_and(|loss| loss > 0.0),
            Quantity::Backlash => contact.half_backlash != 0.0,
        })
    }
}
