use crate::{
    gear::{Stiffness, contact::Law},
    system::{Spec, bonded_modes},
};

/// Highest natural frequency with every contact closed at its largest stiffness, rad/s; of a power law the tangent under the
/// force given, of a rigid contact none. A step h of a method that is stable for `h ω ≤ limit` must stay below `limit/ω_max`. `None` if the structure has no natural modes.
#[must_use]
pub fn highest_frequency(spec: &Spec, forces: &[f64]) -> Option<f64> {
    let mut closed = spec.clone();
    for (contact, force) in closed.contacts.iter_mut().zip(forces) {
        let k = contact.stiffness.maximum();
        contact.stiffness = Stiffness::Constant(match contact.law {
            Law::Power(law) => {
                let n = law.exponent.value();
                n * k.powf(n.recip()) * force.powf(1.0 - n.recip())
            }
            Law::Rigid(_) => 0.0,
            Law::KelvinVoigt(..) | Law::Bilateral(_) => k,
        });
    }
    bonded_modes(&closed).ok()?.omega.last().copied()
}
