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
//!
//! Where several contacts take part in a sequence, its rebounds shrink by another factor r. The sequence ends after `Δt r/(1 − r)`, with Δt
//! the last interval. Contacts whose impacts alternate with it end at the same time.

use super::Options;
use crate::{
    event::Accumulation,
    hybrid::{GuardId, GuardSet, HybridSystem, Instant},
};

/// Sequence of impacts of one guard.
#[derive(Clone, Copy, Debug, Default)]
struct Sequence {
    guard: u16,
    impacts: u32,
    /// Number of the latest impacts in a row without the influence of another contact.
    own: u32,
    fastest: f64,
    last: f64,
    /// Instants of the last impact, and of the one before it.
    at: Instant,
    before: Instant,
    /// Ratio of the last rebound speed to the one before, and the ratio before that.
    ratios: [f64; 2],
}

/// Motion after impacts.
pub(super) struct Flight<'a> {
    pub start: Instant,
    /// Guards watched.
    pub guards: &'a [GuardId],
    /// First three time derivatives of guard `i` at the start, if known.
    pub derivatives: &'a dyn Fn(usize) -> Option<[f64; 3]>,
    /// Rounding of the value of guard `i`, formed from the state alone.
    pub rounding: &'a dyn Fn(usize) -> f64,
    /// True if these numbers are estimates.
    pub is_estimate: bool,
}

/// Watches impact sequences.
#[derive(Clone, Debug, Default)]
pub(super) struct Chatter {
    sequences: Vec<Sequence>,
    /// Instant before which no sequence is summed, because another event comes first.
    blocked: Option<Instant>,
}

/// The expansion in ε is used only where its neglected square is below rounding.
const SMALL: f64 = 1e-8;
/// Largest share of a rebound that other contacts may have. The time summed is about 1e-10 of the first flight: 1e-13 is uncertain.
const OTHERS: f64 = 1e-3;
/// Largest relative change of the rebound ratio at which a sequence with several contacts is summed. It applies where flights are no higher
/// than the rounding of the gap.
const STEADY: f64 = 1e-5;
/// Rebound ratio from which on a sequence is over if its flights are that low: only rounding keeps it up. A rebound that grows by more than
/// the inverse begins another sequence.
pub(crate) const STALLED: f64 = 0.99;
/// Number of shrinking impacts in a row before a sequence counts as one.
const IN_A_ROW: u32 = 3;

impl Chatter {
    pub fn clear(&mut self) {
        self.sequences.clear();
    }

    /// Prevents summation up to `until`: impacts go on one by one.
    pub fn block(&mut self, until: Instant) {
        self.blocked = Some(until);
    }

    /// Returns the guards whose impact sequences end after the impacts `fired`, with the time and the error of their sum.
    ///
    /// A sequence ends when the rebound speed has fallen far enough and ε is small.
    pub fn ends(
        &mut self,
        system: &dyn HybridSystem,
        flight: &Flight<'_>,
        fired: &GuardSet,
        options: &Options,
    ) -> Option<(GuardSet, Accumulation)> {
        self.blocked = self.blocked.filter(|until| flight.start < *until);
        let mut ending = GuardSet::default();
        let mut end = Accumulation { resolved: 0, remaining: 0.0, uncertainty: 0.0 };
        for (i, guard) in flight.guards.iter().enumerate() {
            if !fired.contains(*guard) {
                continue;
            }
            let Some(e) = system.restitution(*guard).filter(|e| *e < 1.0) else { continue };
            let Some([u, falling, j]) = (flight.derivatives)(i) else { continue };
            let a = -falling;
            let epsilon = j * u / (a * a);
            // On estimated steps the rebound speed is too inaccurate for this test.
            let others = if flight.is_estimate { f64::INFINITY } else { OTHERS * e };
            let now = flight.start;
            let sequence = self.record(*guard, now, u, e, others);
            if sequence.own < IN_A_ROW && sequence.impacts <= IN_A_ROW {
                continue;
            }
            let interval = || system.clock().between(sequence.before, now);
            // Above the speed from which e is constant, the last rebounds do not predict the next ones.
            let is_last = u <= options.chatter_fraction * sequence.fastest && u < system.steady_speed(*guard);
            // The height of a flight is `u²/2A`.
            let is_flat = u * u <= 2.0 * a.abs() * (flight.rounding)(i);
            let [ratio, before] = sequence.ratios;
            // Remaining time and its uncertainty, from the difference of the last ratio and the ratio that is summed.
            let sum = if sequence.own >= IN_A_ROW {
                let is_slow = is_last || u <= options.chatter_speed;
                let is_small = is_slow && a > 0.0 && epsilon.abs() <= SMALL * (1.0 - e);
                let remaining = 2.0 * u / (a * (1.0 - e)) * (1.0 + 2.0 * epsilon / (3.0 * (1.0 - e)));
                is_small.then(|| (remaining, remaining * (ratio / e - 1.0).abs() / (1.0 - e)))
            } else if ratio >= STALLED {
                is_flat.then(|| (0.0, interval()))
            } else {
                let change = (ratio - before).abs();
                // The ratio of a faster sequence is not known to rounding, so `chatter_speed` does not end such a sequence.
                let is_joint = is_last || is_flat && change <= STEADY * ratio;
                let per_share = || interval() / (1.0 - ratio);
                is_joint.then(|| (per_share() * ratio, per_share() * change / (1.0 - ratio)))
            };
            let Some((remaining, uncertainty)) = sum.filter(|_| self.blocked.is_none()) else { continue };
            ending.insert(*guard);
            if remaining >= end.remaining {
                (end.remaining, end.uncertainty) = (remaining, uncertainty + f64::EPSILON * remaining);
            }
            end.resolved = end.resolved.max(sequence.impacts);
            if sequence.own < IN_A_ROW {
                let watched = |id: GuardId| flight.guards.contains(&id);
                self.alternating(system, now, &sequence)
                    .iter()
                    .filter(|id| watched(*id))
                    .for_each(|id| ending.insert(id));
            }
        }
        (!ending.is_empty()).then_some((ending, end))
    }

    /// Returns the guards with an impact between the last two of `sequence`, at `now`: their sequences end with it.
    fn alternating(&self, system: &dyn HybridSystem, now: Instant, sequence: &Sequence) -> GuardSet {
        let mut set = GuardSet::default();
        let interval = system.clock().between(sequence.before, now);
        let is_between = |s: &&Sequence| s.impacts >= IN_A_ROW && system.clock().between(s.at, now) < interval;
        self.sequences.iter().filter(is_between).for_each(|s| set.insert(GuardId(s.guard)));
        set
    }

    /// Adds an impact with rebound `speed`. No other contact has influenced it if the speed is e times the last one to within the share
    /// `others`.
    fn record(&mut self, guard: GuardId, at: Instant, speed: f64, e: f64, others: f64) -> Sequence {
        let i = self.sequences.iter().position(|s| s.guard == guard.0).unwrap_or_else(|| {
            self.sequences.push(Sequence { guard: guard.0, ..Sequence::default() });
            self.sequences.len() - 1
        });
        let s = &mut self.sequences[i];
        let ratio = speed / s.last;
        *s = if s.impacts == 0 || ratio >= 1.0 / STALLED {
            Sequence { guard: guard.0, impacts: 1, own: 1, fastest: speed, last: speed, at, ..Sequence::default() }
        } else {
            let is_own = (speed - e * s.last).abs() <= others * s.last;
            Sequence {
                impacts: s.impacts + 1,
                own: if is_own { s.own + 1 } else { 1 },
                before: s.at,
                ratios: [ratio, s.ratios[0]],
                last: speed,
                at,
                ..*s
            }
        };
        *s
    }
}
