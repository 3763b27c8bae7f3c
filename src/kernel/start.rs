//! Start of a step: order zero of the oscillators and of the deflections, from the state, the exact zeros and the step before.

use super::{Expansion, LANES, Layout, ORDER, ROW, compiled::Four, guards::ROUNDING, waves};
use crate::{
    hybrid::Jet,
    system::{ContactMode, FourColumns, Watch, dot},
    vectors::Path,
};

/// Returns `gᵀq` of four contacts and the size of the terms of each deflection, with the bits of `dot` and `Structure::deflection_size`:
/// a column of zeros adds ±0. Columns are dense, which is cheaper than lists for few degrees of freedom.
#[inline(always)]
pub(super) fn deflection_terms<P: Path>(path: P, four: &FourColumns, x: &[f64]) -> [Four; 2] {
    let [mut sum, mut size] = [path.all(0.0); 2];
    for (direction, x) in four.directions.iter().zip(x) {
        let term = path.times(path.four(*direction), path.all(*x));
        (sum, size) = (path.plus(sum, term), path.plus(size, path.sizes(term)));
    }
    for of in four.sizes {
        size = path.plus(size, path.four(of));
    }
    [path.numbers(sum), path.numbers(size)]
}

impl Expansion<'_> {
    /// Forms order zero of the state, the oscillators and the deflections.
    #[inline(always)]
    pub(super) fn start<P: Path>(&self, path: P, out: &mut Jet) {
        let (s, layout, dim) = (self.s, self.layout, self.s.dim);
        out.low.clear();
        if !self.is_bare {
            out.state[..dim].copy_from_slice(self.request.x);
            if dim > 2 * s.n {
                for k in 1..=ORDER {
                    out.state[k * dim + 2 * s.n..(k + 1) * dim].fill(0.0);
                }
            }
        }
        let work = &mut out.work;
        s.oscillate(self.request.at, |i, cosine, sine| {
            work[Layout::oscillator(i)] = cosine;
            work[Layout::oscillator(i) + ROW] = sine;
        });
        self.begin_deflections(path, work);
        let (has_zeros, keeps_low) = (!self.request.pinned.is_empty(), self.keeps_low());
        for (j, c) in s.contacts.iter().enumerate() {
            let is_zero = |watch: Watch| has_zeros && self.pinned(j, watch);
            let (on_drive, on_back) = (is_zero(Watch::DriveFlank), is_zero(Watch::BackFlank));
            work[layout.deflection(j, 0)] = if on_drive {
                c.gap()
            } else if on_back {
                -c.gap()
            } else if keeps_low {
                s.deflection_in_two(j, self.request.at, self.request.x, self.request.low).value()
            } else {
                work[layout.deflection(j, 0)] - waves(c.spec.error_offset, &c.error, 0, work)
            };
            let part = &self.motion.parts[j];
            let (side, is_open) = (part.side, part.state == ContactMode::Separated);
            let on_flank = on_drive || on_back;
            let carried = self.request.carried.get(j).copied().filter(|stretch| !stretch.is_nan() && !keeps_low);
            work[layout.gaps + j] = match carried {
                _ if on_flank => 0.0,
                Some(gap) if is_open => gap,
                _ => f64::NAN,
            };
            work[layout.stretches + j] = match carried.filter(|_| !is_open && !on_flank) {
                _ if is_zero(Watch::Force) => self.forceless(j, side, work),
                Some(stretch) => stretch,
                _ if keeps_low => self.stretch_in_two(j, side).value(),
                _ => work[layout.deflection(j, 0)] - side * c.offset(),
            };
        }
    }

    /// Writes `gᵀq` of each contact in the place of its deflection, and the size of its terms.
    #[inline(always)]
    fn begin_deflections<P: Path>(&self, path: P, work: &mut [f64]) {
        let (s, layout, x) = (self.s, self.layout, self.request.x);
        if !self.motion.is_linear {
            for (j, c) in s.contacts.iter().enumerate() {
                work[layout.deflection(j, 0)] = dot(&c.direction, x);
                work[layout.sizes + j] = s.deflection_size(c, x);
            }
            return;
        }
        for (number, four) in s.columns.fours.iter().enumerate() {
            let ([sum, size], first) = (deflection_terms(path, four, x), LANES * number);
            work[layout.deflection(first, 0)..][..LANES].copy_from_slice(&sum);
            work[layout.sizes + first..][..LANES].copy_from_slice(&size);
        }
    }

    /// Returns the gap of separated contact `j` to the flank of `watch`, m, if it is known better than by the state.
    #[inline(always)]
    pub(super) fn gap(&self, j: usize, watch: Watch, work: &[f64]) -> Option<f64> {
        let (c, gap) = (&self.s.contacts[j], -watch.side() * work[self.layout.gaps + j]);
        // Of two flanks, the gap belongs to the one that agrees with the state.
        let from_state = c.gap() - watch.side() * work[self.layout.deflection(j, 0)];
        let agrees = !c.has_back() || (gap - from_state).abs() < c.gap();
        (agrees && gap != 0.0 && !gap.is_nan()).then_some(gap)
    }

    /// Returns `δ − σ b` where the force of contact `j` is exactly zero: `−c δ̇/k` under a linear law. Taken from the state it would
    /// have the rounding of the displacements, and times k that can exceed all other terms: the force would pull in the closed
    /// contact and press in the mode without it, so that the modes alternate. With damping, a difference larger than this
    /// rounding comes from the rounded time of the event, and the state is right.
    fn forceless(&self, j: usize, side: f64, work: &[f64]) -> f64 {
        let (c, request) = (&self.s.contacts[j], self.request);
        let stretch = work[self.layout.deflection(j, 0)] - side * c.offset();
        let rounding = ROUNDING * work[self.layout.sizes + j];
        self.motion.forceless(j, request.at, stretch, rounding, || self.rate(j, 0, &request.x[self.s.n..], work))
    }
}

#[cfg(test)]
#[path = "../../tests/unit/start.rs"]
mod tests;
