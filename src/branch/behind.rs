//! Search behind a rigid graze: for the orbit without the impact, or with it, on either side of the value.

use super::{
    follow::{EventChange, Vanishing, vanishing},
    locate::Located,
    node::{Guess, Node, Solver},
    special::{SpecialSource, ZeroCondition},
};

/// Steps, in ranges, at which orbits behind a rigid graze are searched for; largest distance of such an orbit.
const BEHIND: [f64; 4] = [1e-4, 1e-3, 1e-5, 1e-2];
const NEARBY: f64 = 0.1;
/// Largest difference of two values for one graze: in ranges, and in errors of the first one.
const SAME: f64 = 1e-6;
const ERRORS: f64 = 10.0;

impl Solver<'_> {
    /// Locates a rigid graze from the orbit `behind` it, and takes that value if it agrees and has a smaller error. Orbits with the impact
    /// are badly conditioned close to the graze: an impact of speed v has a derivative of size 1/v. Returns the trail of the graze along
    /// the orbits without the impact.
    pub fn refine_from_behind(&self, near: &mut Located, behind: &Node, contact: usize) -> Option<SpecialSource> {
        let (own, range) = (near.value, self.family.range());
        let is_same = |node: &Node| EventChange::of(&behind.course, &node.course) == EventChange::None;
        let back = (own - behind.value).signum() * behind.tangent.p.signum();
        let length = 2.0 * (own - behind.value).abs() / (range * behind.tangent.p.abs());
        let way = (behind.tangent.times(back), length);
        let lows = vanishing(behind).into_iter().filter_map(|(key, value)| match key {
            Vanishing::Low(j, ..) if j == contact && value > 0.0 => Some(key),
            _ => None,
        });
        let limits = lows
            .filter_map(|key| Some((key, self.limit(behind, &way, &|node| key.at(node).filter(|_| is_same(node)))?)));
        let alike = SAME.max(ERRORS * near.error) * range;
        let limits = limits.filter(|(_, located)| (located.value - own).abs() <= alike);
        let (key, best) = limits.min_by(|a, b| a.1.error.total_cmp(&b.1.error))?;
        if best.error < near.error {
            (near.value, near.second, near.error, near.residual) = (best.value, best.second, best.error, best.residual);
        }
        Some(SpecialSource {
            sought: ZeroCondition::Limit(key),
            seed: best.node.seed(&best.node.tangent),
            from: best.from,
        })
    }

    /// Searches both sides of a rigid graze for an orbit with the other events.
    pub fn look_behind(&self, near: &Located) -> Option<Node> {
        let (range, second) = (self.family.range(), near.second);
        let sides = BEHIND.iter().flat_map(|step| [*step, -step]);
        sides.map(|step| near.value + step * range).filter(|value| self.family.contains(*value)).find_map(|value| {
            let guess = Guess { section: near.section.clone(), place: [value, second], by: None, ..near.node.at() };
            let node = self.at(guess, None, 1.0).ok()?;
            let is_other = matches!(EventChange::of(&near.node.course, &node.course), EventChange::Gained(..));
            let is_near = near.node.chord(&node, self.family.ranges()).1 <= NEARBY;
            (is_other && is_near && !node.has_shorter_period()).then_some(node)
        })
    }
}
