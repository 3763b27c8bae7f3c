//! Ends of rests: points at which the load that holds a contact at rest is zero.

use std::cmp::Ordering;

use super::{
    follow::{EventChange, Vanishing, vanishing},
    locate::Located,
    node::{Node, Solver},
    special::{LocatedKind, REACH, SLACK, SpecialKind, ZeroCondition},
};
use crate::gear::contact::Law;

/// Factor of the change of the value by the last orbits: a part of it repeats with the number of impacts and is not extrapolated.
const PERIODIC: f64 = 16.0;
/// Largest share of a rest that the sum of its last impacts may take if its end is sought.
const SUMMED: f64 = 1e-6;
/// Bound of the power by which the parameter follows the load.
const POWER: f64 = 5.0 / 3.0;

impl Solver<'_> {
    /// Locates the end of a rest between two points, where the least load along it is zero. A rest that begins within the cycle can also
    /// end where the load is zero at the instant of coming to rest, after any number of impacts.
    pub(super) fn stick(&self, a: &Node, b: &Node) -> Option<LocatedKind> {
        let (low, high) = (a.value.min(b.value), a.value.max(b.value));
        let slack = SLACK * self.family.range();
        let is_between = |located: &Located| (low - slack..=high + slack).contains(&located.value);
        let mut found: Vec<LocatedKind> = Vec::new();
        for (here, there) in [(a, b), (b, a)] {
            let (row, length) = self.towards(here, there);
            let way = (row, REACH * length);
            let is_same = |node: &Node| EventChange::of(&here.course, &node.course) == EventChange::None;
            for (key, value) in vanishing(here) {
                let Vanishing::Low(j, watch, true) = key else { continue };
                if value > 0.0 && self.kind_of(here, j, watch, true) == SpecialKind::Stick {
                    let located = self.limit(here, &way, &|node| key.at(node).filter(|_| is_same(node)));
                    found.extend(located.map(|located| (SpecialKind::Stick, ZeroCondition::Limit(key), located)));
                }
            }
            let count = here.course.rests.len();
            let is_of = |contact: usize| there.course.letters.iter().any(|letter| letter.contact == contact);
            if count > there.course.rests.len() && here.course.weakest().is_some_and(|rest| is_of(rest.contact)) {
                let located = self.limit(here, &way, &|node| self.settling(node, count));
                found.extend(
                    located.map(|located| (SpecialKind::Stick, ZeroCondition::Rest, self.timed(here, located))),
                );
            }
        }
        found.retain(|(.., located)| is_between(located) && self.is_located(located));
        // The least load along a rest is smooth up to its end.
        let order = |found: &LocatedKind| (found.1 == ZeroCondition::Rest, found.2.error);
        found.into_iter().min_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(Ordering::Equal))
    }

    /// Adds the uncertainty of the instant of rest to the end of a rest, seen from the orbit `here`. Near the end the load is a multiple of
    /// the time that is left, and the parameter of a power of it.
    fn timed(&self, here: &Node, located: Located) -> Located {
        let way = (located.value - here.value).abs() / self.family.range();
        let share = here.course.weakest().map_or(0.0, |rest| rest.uncertainty / here.course.stay(rest));
        Located { residual: located.residual + POWER * way * share, error: PERIODIC * located.error, ..located }
    }

    /// Returns the least load at an instant of coming to rest, to the power by which the parameter follows it near zero. `None` without
    /// `count` rests, or if the sum of the last impacts takes too large a share of the rest: the load falls meanwhile.
    pub(super) fn settling(&self, node: &Node, count: usize) -> Option<f64> {
        let rest = node.course.weakest()?;
        if node.course.rests.len() != count || rest.load <= 0.0 || rest.remaining > SUMMED * node.course.stay(rest) {
            return None;
        }
        let train = self.family.train(node.place()).ok()?;
        let Law::Rigid(law) = train.structure.spec().contacts[rest.contact].law else { return None };
        Some(libm::pow(rest.load, settling_power(law.restitution.at(0.0))))
    }
}

/// Returns the power p of the load at which a contact comes to rest: V₀ − V is a multiple of that power where the load is almost zero.
///
/// Let the load fall to zero as the time τ that is left to it. A rebound of speed u has a flight rτ with `w = u/τ² = r/2 − r²/6`. The next
/// has `τ′ = (1 − r)τ` and `w′ = e(r/2 − r²/3)/(1 − r)²`. At the end of rests w′ = w for ever: impacts approach the instant without load. A
/// deviation from there grows by λ = dw′/dw, as τ shrinks: `V₀ − V ∝ τᵖ`, `p = ln λ/ln(1/(1 − r))`.
fn settling_power(e: f64) -> f64 {
    if e <= 0.0 {
        return 1.0;
    }
    let grows = |r: f64| e * (0.5 - r / 3.0) < (1.0 - r).powi(2) * (0.5 - r / 6.0);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..f64::MANTISSA_DIGITS {
        let r = 0.5 * (low + high);
        if grows(r) { low = r } else { high = r }
    }
    let (r, left) = (low, 1.0 - low);
    let next = e * (0.5 * r - r * r / 3.0) / (left * left);
    let growth = (e * (0.5 - r / 1.5) / (left * left) + 2.0 * next / left) / (0.5 - r / 3.0);
    -libm::log(growth) / libm::log(left)
}
