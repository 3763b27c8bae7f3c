//! The forces of contacts at rest.

use crate::kernel::{Expansion, StepRows};
use crate::system::{Sticking, zeros};

impl Expansion<'_> {
    /// Forms the multipliers that hold the contacts at rest, `g·a = ë`, at order `k`, and adds their accelerations.
    ///
    /// The system is solved twice: the first solution leaves the rounding of the loads in `g·a`, which may be far above ë if a flank moves
    /// slowly and steps are long.
    pub fn hold(&self, held: &Sticking, k: usize, accelerations: &mut [f64], rows: &mut StepRows) {
        let s = self.s;
        let mut forces = zeros(held.contacts().len());
        for round in 0..2 {
            for (force, &j) in forces.iter_mut().zip(held.contacts()) {
                let c = &s.contacts[j];
                *force = c.direction.iter().fold(0.0, |sum, (i, g)| sum + g * accelerations[*i as usize]);
                for w in &c.error {
                    let [cosine, sine] = &rows.oscillators[w.index];
                    let omega = s.oscillators[w.index].omega;
                    *force += omega * omega * (w.cosine * cosine[k] + w.sine * sine[k]);
                }
            }
            held.solve(&mut forces);
            if s.is_symmetric(&self.motion.mode, self.request.x) {
                s.symmetry.restore_forces(held.contacts(), &mut forces);
            }
            for (force, &j) in forces.iter().zip(held.contacts()) {
                let row = &mut rows.contacts[j].force[k];
                *row = if round == 0 { *force } else { *row + force };
                for (i, p) in &s.contacts[j].push {
                    accelerations[*i as usize] -= p * force;
                }
            }
        }
    }
}
