//! Rest in a gap: a motion without events, whose neighbours neither approach it nor part from it.

use nalgebra::Complex;

use super::{Orbit, Section, SectionMap, unknowns::Unknowns};
use crate::simulation::{Simulation, SimulationError};

/// Roundings of the gap or the state that a cycle without events may add up to.
const ROUNDINGS: f64 = 64.0;
/// Distance from 1 within which a multiplier is one: two equal ones are known to the root of a rounding.
pub(crate) const NEUTRAL: f64 = 1e-6;

/// Returns whether a cycle from `x` ends at `x`, within the rounding of `cycles` cycles before it: an undamped velocity keeps that
/// rounding. After 200 cycles without events the motion is then some 10¹¹ cycles away from a flank.
pub(super) fn returns(simulation: &Simulation, x: &[f64], end: &[f64], cycles: u64) -> bool {
    let (n, omega) = (simulation.structure.freedoms(), simulation.clock().omega());
    let backlashes = simulation.structure.spec().contacts.iter().map(|c| c.half_backlash);
    let positions = x[..n].iter().map(|q| q.abs()).chain(x[n..2 * n].iter().map(|v| v.abs() / omega));
    let rounding = ROUNDINGS * f64::EPSILON * (cycles + 1) as f64;
    let reach = rounding * backlashes.chain(positions).fold(0.0, f64::max);
    let off = |i: usize| (end[i] - x[i]).abs();
    (0..n).all(|i| off(i) <= reach && off(n + i) <= reach * omega)
}

/// Returns whether a multiplier is one, within rounding.
fn is_one(m: &Complex<f64>) -> bool {
    (m - Complex::new(1.0, 0.0)).norm() <= NEUTRAL
}

impl Orbit {
    /// Returns whether it belongs to a family of rests: no events, and all multipliers are one.
    pub(super) fn is_rest(&self) -> bool {
        self.image.word.is_empty() && self.multipliers.len() > self.neutral && self.multipliers.iter().all(is_one)
    }

    /// Sets multipliers that are one within rounding to one.
    pub(super) fn round_ones(&mut self) {
        self.multipliers.iter_mut().filter(|m| is_one(m)).for_each(|m| *m = Complex::new(1.0, 0.0));
    }
}

impl SectionMap<'_> {
    /// Returns the orbit of one cycle through `section`, if a train rests there in its gaps: no events, and no multiplier off the unit
    /// circle. Newton's method finds none, because such orbits lie in families. `cycles` cycles were run before.
    ///
    /// # Errors
    /// [`SimulationError`] if the cycle fails.
    pub(crate) fn rest(&self, section: Section, cycles: u64) -> Result<Option<Orbit>, SimulationError> {
        let (image, drift) = (self.image(&section, 1)?, self.drift());
        let is_at_rest = drift.directions.is_empty()
            && image.word.is_empty()
            && returns(self.simulation(), &section.x, &image.end.x, cycles);
        if !is_at_rest {
            return Ok(None);
        }
        let unknowns = Unknowns::new(self, &image, &drift);
        let residual = unknowns.between(&section.x, &image.end.x).norm();
        let derivative = unknowns.reduced(&image.jacobian);
        let mut orbit = Orbit::of(section, image, (&unknowns, &[derivative]), residual, f64::INFINITY);
        orbit.round_ones();
        Ok(Some(orbit).filter(|orbit| (orbit.largest_multiplier() - 1.0).abs() <= NEUTRAL))
    }
}
