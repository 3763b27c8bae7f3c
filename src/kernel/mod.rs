//! Taylor recurrences of a structure with contacts.
//!
//! In the clock θ of the step, with `dt = h w(θ) dθ`,
//!
//! ```text
//! (k+1) q_{k+1} = h (w v)_k,   (k+1) v_{k+1} = h (w a)_k,   a = M⁻¹(f − C v − K q − Σ g_j F_j)
//! ```
//!
//! where `(w v)_k = Σ_i w_i v_{k−i}`. Plain time has `w = 1`. Near the start or the end of a contact
//! with a power law, where `pⁿ` has a branch point in plain time, the clock is a root of the time or of a penetration, and the
//! series run through it ([`StepClock`](series::clock::StepClock)).

mod bounds;
mod mode;
mod series;
mod ways;

use std::cell::RefCell;

use mode::motion::Motion;
use series::clocked::Room;

use crate::{
    hybrid::{Four, JetRequest, LANES, ORDER, ROW, Series, StepRows},
    system::{Elasticity, Force, Structure, Watch, Wave, dot, guard_id},
};

/// Rounding of the value of a guard relative to the terms of its sum: that of the sum itself, and that which the state has
/// gathered since the last event, a few units in the last place for each of some ten steps.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Least distance of a fall from other falls and from the bound, in its widths or its errors: nearer ones are decided together.
const APART: f64 = 8.0;

/// Returns `(a b)_k`.
fn product(a: &Series, b: &Series, k: usize) -> f64 {
    a[..=k].iter().zip(b[..=k].iter().rev()).fold(0.0, |s, (x, y)| s + x * y)
}

/// Returns `start + Σ waves` at order `k`.
fn waves(start: f64, waves: &[Wave], k: usize, rows: &StepRows) -> f64 {
    waves.iter().fold(start, |sum, w| {
        let [cosine, sine] = &rows.oscillators[w.index];
        sum + w.cosine * cosine[k] + w.sine * sine[k]
    })
}

/// Expansion: the motion, its start, and the scale of the clock.
struct Expansion<'a> {
    s: &'a Structure,
    motion: &'a Motion<'a>,
    request: &'a JetRequest<'a>,
    /// Buffers for series of modes that are not linear.
    room: &'a RefCell<Room>,
    /// Span of `θ ∈ [0, 1]` in the clock of the step.
    h: f64,
    /// True if the rows of the state, and data formed from them, are not needed.
    is_bare: bool,
}

impl Expansion<'_> {
    #[inline(always)]
    fn pinned(&self, j: usize, watch: Watch) -> bool {
        self.request.pinned.contains(guard_id(j, watch))
    }

    fn is_still(&self, j: usize) -> bool {
        let still = self.request.still;
        !still.is_empty()
            && (still.contains(guard_id(j, Watch::DriveFlank)) || still.contains(guard_id(j, Watch::BackFlank)))
    }

    /// Returns the rate of deflection `j` at order `k`, from the velocities `v` of that order.
    fn rate(&self, j: usize, k: usize, v: &[f64], rows: &StepRows) -> f64 {
        let c = &self.s.contacts[j];
        if k == 0 && self.is_still(j) {
            return 0.0;
        }
        c.error_rate.iter().fold(dot(&c.direction, v), |r, w| {
            let [cosine, sine] = &rows.oscillators[w.index];
            r - w.cosine * cosine[k] - w.sine * sine[k]
        })
    }

    /// Returns `δ − σ b` of contact `j` at order `k`.
    fn stretch(&self, j: usize, k: usize, rows: &StepRows) -> f64 {
        if k == 0 { rows.stretch(j) } else { rows.deflection(j, k) }
    }
}
