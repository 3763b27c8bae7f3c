//! Infinitely many impacts in finite time: recognised, summed, ended at rest.
//!
//! After an impact the gap is `p(t) = u t − A t²/2 + J t³/6 + …`. With restitution e the next impacts follow at
//! times and speeds that shrink like eᵏ, and for `ε = J u/A² → 0` their sum is
//!
//! ```text
//! t_∞ = 2u / (A (1 − e)) · (1 + 2ε / (3(1 − e)) + O(ε²))
//! ```
//!
//! (both orders of ε from the flight equation: the k-th flight is `(2u_k/A_k)(1 + 2ε_k/3)`, with
//! `u_{k+1} = e u_k (1 − 2ε_k/3)` and `A_{k+1} = A_k (1 − 2ε_k)`).

use super::Options;
use crate::{
    event::Accumulation,
    hybrid::{GuardId, GuardSet, HybridSystem},
    integrate::DenseStep,
};

/// Impacts of one guard in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Sequence {
    guard: u16,
    impacts: u32,
    /// Of these the last in which no other contact had a part.
    own: u32,
    fastest: f64,
    last: f64,
}

/// Watches impact sequences.
#[derive(Clone, Debug, Default)]
pub(super) struct Chatter {
    sequences: Vec<Sequence>,
}

/// The expansion in ε is used only where its neglected square is below rounding.
const SMALL: f64 = 1e-8;
/// Largest share of a rebound that other contacts may have. The time summed is about 1e-10 of the first flight: 1e-13 is uncertain.
const OTHERS: f64 = 1e-3;
/// Impacts that must have shrunk in a row before a sequence counts as one.
const IN_A_ROW: u32 = 3;

impl Chatter {
    pub fn clear(&mut self) {
        self.sequences.clear();
    }

    /// Called on the first step after the impacts `fired`: which of them end here, and when.
    ///
    /// A sequence ends when the rebound speed has fallen far enough and ε is small.
    pub fn ends(
        &mut self,
        system: &dyn HybridSystem,
        step: &dyn DenseStep,
        fired: GuardSet,
        options: &Options,
    ) -> Option<(GuardSet, Accumulation)> {
        let mut ending = GuardSet::EMPTY;
        let mut end = Accumulation { resolved: 0, remaining: 0.0 };
        for (i, guard) in step.guards().iter().enumerate() {
            if !fired.contains(guard.id) {
                continue;
            }
            let Some(e) = system.restitution(guard.id).filter(|e| *e < 1.0) else { continue };
            let Some([u, falling, j]) = step.guard_derivatives_in_time(i) else { continue };
            let a = -falling;
            let epsilon = j * u / (a * a);
            // On estimated steps a rebound is not known well enough to test this.
            let others = if step.is_estimate() { f64::INFINITY } else { OTHERS * e };
            let sequence = self.record(guard.id, u, e, others);
            let slow = u <= options.chatter_fraction * sequence.fastest || u <= options.chatter_speed;
            let small = slow && sequence.own >= IN_A_ROW;
            if small && a > 0.0 && epsilon.abs() <= SMALL * (1.0 - e) {
                ending.insert(guard.id);
                let remaining = 2.0 * u / (a * (1.0 - e)) * (1.0 + 2.0 * epsilon / (3.0 * (1.0 - e)));
                end.remaining = end.remaining.max(remaining);
                end.resolved = end.resolved.max(sequence.impacts);
            }
        }
        (!ending.is_empty()).then_some((ending, end))
    }

    /// A rebound belongs to the sequence if it is e times the last: other contacts have not had a part in it.
    fn record(&mut self, guard: GuardId, speed: f64, e: f64, others: f64) -> Sequence {
        let i = self.sequences.iter().position(|s| s.guard == guard.0).unwrap_or_else(|| {
            self.sequences.push(Sequence { guard: guard.0, ..Sequence::default() });
            self.sequences.len() - 1
        });
        let s = &mut self.sequences[i];
        *s = if s.impacts == 0 || speed >= s.last {
            Sequence { guard: guard.0, impacts: 1, own: 1, fastest: speed, last: speed }
        } else {
            let is_own = (speed - e * s.last).abs() <= others * s.last;
            Sequence { impacts: s.impacts + 1, own: if is_own { s.own + 1 } else { 1 }, last: speed, ..*s }
        };
        *s
    }
}
