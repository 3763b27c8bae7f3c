//! A structure seen through its contacts.

use super::{
    assemble::{Structure, dot},
    contact_mode::{contact_mode, guard_of},
};
use crate::{
    gear::contact::{Law, Release, restitution},
    hybrid::{ContactMode, ContactView, GuardId, Instant, Mode, Transition, Watch},
};

/// Restitution of a free impact on a spring and damper with damping ratio ζ.
///
/// Release at `p = 0` for ζ < 1: `exp(−πζ/√(1−ζ²))`. Release at `F = 0`: `exp(−ζφ/√(1−ζ²))` with
/// `φ = 2 arccos ζ` (and its continuation `2 arcosh ζ` beyond ζ = 1). ζ ≥ 0.
#[must_use]
pub fn damped_restitution(zeta: f64, release: Release) -> f64 {
    let root = (1.0 - zeta * zeta).abs().sqrt();
    match release {
        Release::Deflection if zeta >= 1.0 => 0.0,
        Release::Deflection => libm::exp(-std::f64::consts::PI * zeta / root),
        Release::Force if zeta < 1.0 => libm::exp(-zeta * 2.0 * libm::acos(zeta) / root),
        Release::Force if zeta == 1.0 => libm::exp(-2.0f64),
        Release::Force => libm::exp(-zeta * 2.0 * libm::acosh(zeta) / root),
    }
}

impl ContactView for Structure {
    fn contact_count(&self) -> usize {
        self.contacts.len()
    }

    fn contact_name(&self, j: usize) -> &str {
        &self.contacts[j].spec.name
    }

    fn contact_mode(&self, j: usize, mode: &Mode) -> ContactMode {
        contact_mode(mode, j)
    }

    fn watch(&self, id: GuardId) -> (usize, Watch) {
        guard_of(id)
    }

    fn is_rigid(&self, j: usize) -> bool {
        self.contacts[j].spec.law.is_rigid()
    }

    fn half_backlash(&self, j: usize) -> f64 {
        self.contacts[j].gap()
    }

    fn free_restitution(&self, j: usize, speed: f64) -> Option<f64> {
        let c = &self.contacts[j];
        match c.spec.law {
            Law::Rigid(l) => Some(l.restitution.at(speed)),
            Law::Power(l) => Some(restitution(l.hysteresis)),
            Law::KelvinVoigt(l, release) => {
                let critical = 2.0 * (c.spec.stiffness.mean() * c.effective_mass()).sqrt();
                Some(damped_restitution(l.damping / critical, release))
            }
            Law::Bilateral(_) => None,
        }
    }

    fn deflection(&self, j: usize, at: Instant, x: &[f64]) -> (f64, f64) {
        self.deflection(j, at, x)
    }

    fn transmission(&self, j: usize, x: &[f64]) -> f64 {
        dot(&self.contacts[j].direction, x)
    }

    fn force(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        self.carried_by(j, mode, at, x)
    }

    fn stored(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        self.stored_in(self.acting(mode, j), at, x)
    }

    fn dissipation(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        self.contact_powers(self.acting(mode, j), at, x).0
    }

    fn impulses(&self, transition: &Transition<'_>, out: &mut [f64]) {
        self.impulses_of(transition, out);
    }
}
