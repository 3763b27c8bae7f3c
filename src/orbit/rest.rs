//! Rest in a gap: a motion in which nothing happens, and from which neighbours neither come nearer nor part.

use nalgebra::Complex;

use super::{Orbit, Section, SectionMap, unknowns::Unknowns};
use crate::simulation::{Simulation, SimulationError};

/// Roundings of the gap or the state that a cycle without events may add.
const ROUNDINGS: f64 = 64.0;
/// Growth in a cycle of a multiplier that counts as one: two equal ones are known to the root of a rounding.
pub(crate) const NEUTRAL: f64 = 1e-6;

/// Whether a cycle from `x` ends there, to the rounding that `cycles` before it may have added up to: a velocity that nothing damps keeps
/// it. After 200 cycles a motion without events is some 10¹¹ cycles away from a flank then.
pub(crate) fn returns(simulation: &Simulation, x: &[f64], end: &[f64], cycles: u64) -> bool {
    let (n, omega) = (simulation.structure.freedoms(), simulation.clock().omega());
    let backlashes = simulation.structure.spec().contacts.iter().map(|c| c.half_backlash);
    let positions = x[..n].iter().map(|q| q.abs()).chain(x[n..2 * n].iter().map(|v| v.abs() / omega));
    let rounding = ROUNDINGS * f64::EPSILON * (cycles + 1) as f64;
    let reach = rounding * backlashes.chain(positions).fold(0.0, f64::max);
    let off = |i: usize| (end[i] - x[i]).abs();
    (0..n).all(|i| off(i) <= reach && off(n + i) <= reach * omega)
}

/// Whether a multiplier is one, to rounding.
fn is_one(m: &Complex<f64>) -> bool {
    (m - Complex::new(1.0, 0.0)).norm() <= NEUTRAL
}

impl Orbit {
    /// Whether it belongs to a family of rests: nothing happens along it, and all multipliers are one.
    pub(super) fn is_rest(&self) -> bool {
        self.image.word.is_empty() && self.multipliers.len() > self.neutral && self.multipliers.iter().all(is_one)
    }

    /// Writes one for a multiplier that is one but for rounding.
    pub(super) fn round_ones(&mut self) {
        self.multipliers.iter_mut().filter(|m| is_one(m)).for_each(|m| *m = Complex::new(1.0, 0.0));
    }
}

impl SectionMap<'_> {
    /// The orbit of one cycle through `section`, if a train rests there in its gaps: no contact does anything, and no multiplier is off the
    /// unit circle. Newton's method finds none, because orbits lie in families there. `cycles` were run before.
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
