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

    /// Writes the stretches to be kept after a step, which has changed the deflections by `added`: the rule of
    /// [`kept`](crate::kernel::mode::motion::ContactInMode::kept), four contacts side by side.
    #[inline(always)]
    pub fn keep<P: Path>(&self, path: P, step: &Jet, ends: bool, added: &[Four], carried: &mut Vec<f64>) {
        carried.clear();
        // While power laws are closed, the time of an event is too uncertain for a gap to be more accurate than the state.
        let is_lost = ends && step.is_estimate;
        let (zero, lost) = (path.all(0.0), path.all(f64::NAN));
        for (number, (flanks, added)) in self.flanks.iter().zip(added).enumerate() {
            let rows = &step.rows;
            let has_side = path.four(flanks.has_side);
            let gaps = if step.is_estimate { lost } else { path.four(rows.gaps[number]) };
            let start = path.where_above(has_side, zero, path.four(rows.stretches[number]), gaps);
            let stretch = path.plus(path.four(*added), start);
            let most = path.times(path.four(flanks.kept), path.four(rows.sizes[number]));
            // Comparisons with NaN are false.
            let kept = path.where_above(most, path.sizes(stretch), stretch, lost);
            carried.extend_from_slice(&path.numbers(if is_lost { lost } else { kept }));
        }
        carried.truncate(self.parts.len());
    }
}
