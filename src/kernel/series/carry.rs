//! Stretches that are kept from one step to the next.

use smallvec::SmallVec;

use crate::{
    hybrid::Jet,
    kernel::{Four, mode::motion::Motion},
    vectors::Path,
};

/// Numbers of the contacts, in fours.
pub type Fours = SmallVec<[Four; 4]>;

impl Motion<'_> {
    /// Returns the changes of all deflections from the start of a step to `theta`.
    #[inline(always)]
    pub fn gained<P: Path>(&self, path: P, step: &Jet, theta: f64) -> Fours {
        let mut all = Fours::new();
        let s = path.all(theta * step.reach);
        for deflections in &step.rows.deflections {
            let mut sum = path.all(0.0);
            for row in deflections[1..].iter().rev() {
                sum = path.times(path.plus(sum, path.four(*row)), s);
            }
            all.push(path.numbers(sum));
        }
        all
    }

    /// Writes the stretches to be kept after a step, which has changed the deflections by `added`.
    #[inline(always)]
    pub fn keep(&self, step: &Jet, ends: bool, added: &[f64], carried: &mut Vec<f64>) {
        carried.clear();
        // While power laws are closed, the time of an event is too uncertain for a gap to be more accurate than the state.
        let is_lost = ends && step.is_estimate;
        carried.extend(self.parts.iter().enumerate().map(|(j, part)| {
            let is_closed = part.state.side() != 0.0;
            let start = if is_closed { step.rows.stretch(j) } else { step.rows.gap(j) };
            if is_lost || start.is_nan() || !is_closed && step.is_estimate {
                return f64::NAN;
            }
            part.kept(added[j] + start, step.rows.size(j))
        }));
    }
}
