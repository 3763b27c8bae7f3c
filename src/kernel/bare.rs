//! Step of a linear mode of which only the end is needed.
//!
//! Series, reach, rows and result equal those of the full step, bit for bit. Work that most steps do not need is omitted. A guard that
//! stays clear of zero by the sizes of its terms gets no row. The first of the others that falls is the event, if it falls alone. In all
//! other cases the step itself decides.

use smallvec::SmallVec;

use super::{
    Expansion, LANES, Motion, ORDER, ROW,
    bound::Tail,
    guards::{Powers, ROUNDING, powers},
    motion::ModeGuard,
};
use crate::{
    hybrid::{ARRIVED, GuardValue, Jet, JetRequest, Leap, Passage},
    poly::{self, Deflated, FirstRoot},
    system::Watch,
    vectors::Path,
};

/// Rounding of a sum of the terms of a series relative to their sizes.
const SUMMED: f64 = ROW as f64 * f64::EPSILON;
/// Widest fall that counts as decided, relative to the step: at full precision, in units of the truncation, and at most.
const SHARP: [f64; 3] = [1e-11, 1e5, 1e-2];
/// Least distance of a fall from all other candidates, in its widths or its errors.
const APART: f64 = 8.0;
/// Relative change of a slope over the width of a fall above which the fall is tangential.
const TANGENTIAL: f64 = 1e-3;

/// Numbers of the contacts, in fours.
type Fours = SmallVec<[[f64; LANES]; 4]>;

/// Guard that may reach zero by the sizes of its terms.
struct UndecidedGuard {
    /// Number of the guard in the mode.
    number: usize,
    tail: f64,
    rounding: f64,
    /// Rounding of the guard if nothing is carried on from the step before.
    afresh: f64,
}

impl UndecidedGuard {
    #[inline(always)]
    fn series<'a>(&self, jet: &'a Jet) -> Deflated<'a> {
        Deflated::new(&jet.guard_series[self.number * ROW..(self.number + 1) * ROW], self.tail, self.rounding)
    }
}

/// First fall of a guard on a step.
struct Fall {
    /// Index among the doubtful guards.
    place: usize,
    /// Value of the guard; derivatives are with respect to θ.
    value: f64,
    slope: f64,
    curvature: f64,
    error: f64,
    /// Uncertainty of the place, in θ.
    width: f64,
    zeros: usize,
}

impl Fall {
    /// Returns the fall of a guard at `theta`; `None` if it is tangential or wide.
    #[inline(always)]
    fn new(place: usize, series: &Deflated<'_>, theta: f64, truncation: f64) -> Option<Self> {
        let [value, slope, curvature] = poly::eval_with_derivatives(series.p, theta);
        let error = series.error_at(theta);
        let width = error / slope.abs();
        let [full, units, most] = SHARP;
        let sharp = full.max((units * truncation).min(most));
        let is_sharp = slope < 0.0 && width <= sharp && curvature.abs() * width <= TANGENTIAL * slope.abs();
        // θ^m p̃ and its slope.
        let m = series.order as i32;
        let power = theta.powi(m);
        let by_power = if m == 0 { 0.0 } else { f64::from(m) * theta.powi(m - 1) * value };
        is_sharp.then_some(Self {
            place,
            value: power * value,
            slope: by_power + power * slope,
            curvature: power * curvature.abs(),
            error: power * error,
            width,
            zeros: series.order,
        })
    }
}

impl Expansion<'_> {
    /// Returns the sizes of the terms that the step adds to each deflection.
    #[inline(always)]
    fn added<P: Path>(&self, path: P, work: &[f64], powers: &Powers) -> Fours {
        let mut all = Fours::new();
        for first in (0..self.s.contacts.len()).step_by(LANES) {
            let mut sizes = path.all(0.0);
            let rows = &work[self.layout.deflection(first, 1)..self.layout.deflection(first, ORDER) + LANES];
            for (row, power) in rows.as_chunks::<LANES>().0.iter().zip(&powers[1..]) {
                let term = path.times(path.four(*row), path.all(*power));
                sizes = path.plus(sizes, path.sizes(term));
            }
            all.push(path.numbers(sizes));
        }
        all
    }

    /// Returns the first three time derivatives of a guard of position at the start.
    fn derivatives(&self, watched: &ModeGuard, powers: &Powers, jet: &Jet) -> [f64; 3] {
        let h = jet.span * jet.reach;
        let term = |k: usize| watched.along() * jet.work[self.layout.deflection(watched.contact, k)] * powers[k];
        [term(1) / h, 2.0 * term(2) / (h * h), 6.0 * term(3) / (h * h * h)]
    }

    /// Writes the guards at the start of the step into `leap`. Returns those that are not clear of zero on it, with their rows.
    #[inline(always)]
    fn doubtful(&self, powers: &Powers, added: &[f64], tail: &Tail, leap: &mut Leap) -> SmallVec<[UndecidedGuard; 8]> {
        let (Leap { starts, jet, .. }, s) = (leap, self.s);
        starts.clear();
        starts.reserve(self.motion.guards.len());
        jet.guard_series.resize(3 * s.contacts.len() * ROW, 0.0);
        let mut doubtful = SmallVec::new();
        let (mut last, mut rest, mut stretch_size) = (usize::MAX, 0.0, 0.0);
        for (number, watched) in self.motion.guards.iter().enumerate() {
            let ModeGuard { id, contact: j, watch, .. } = *watched;
            let (c, size) = (&s.contacts[j], jet.work[self.layout.sizes + j]);
            if j != last {
                (last, rest) = (j, self.deflection_tail(j, tail));
                stretch_size = self.stretch_size(j, None, size, &jet.work);
            }
            let row = number * ROW..(number + 1) * ROW;
            let (tail, start, terms, [rounding, afresh], is_clear) = if watch == Watch::Force {
                let tail = self.force_tail(j, tail, jet);
                let row = &mut jet.guard_series[row];
                let rounded = self.force_row(watched, stretch_size, size, powers, &jet.work, row);
                (tail, row[0], poly::terms(row, 1.0), rounded, false)
            } else {
                let added = added[j];
                let mut start = self.position(watched, &jet.work);
                let (terms, rounding) = (start.abs() + added, ROUNDING * stretch_size);
                let is_clear = start - added > rest + rounding + SUMMED * terms && !self.is_released(j, watch);
                if !is_clear {
                    let row = &mut jet.guard_series[row];
                    self.position_row(watched, powers, &jet.work, row);
                    start = row[0];
                }
                (rest, start, terms, [rounding, ROUNDING * (size + added)], is_clear)
            };
            if !is_clear {
                doubtful.push(UndecidedGuard { number, tail, rounding, afresh });
            }
            // Impact sequences need them.
            let derivatives =
                if c.spec.law.is_rigid() { self.derivatives(watched, powers, jet) } else { [f64::NAN; 3] };
            starts.push(GuardValue { guard: id, value: start, error: afresh, terms, derivatives });
        }
        doubtful
    }

    /// Forms the guards at the end of the step, from the changes `gained` of the deflections.
    fn ends(
        &self,
        doubtful: &[UndecidedGuard],
        gained: &[f64],
        tail: &Tail,
        (jet, starts): (&Jet, &[GuardValue]),
        ends: &mut Vec<GuardValue>,
    ) {
        let mut doubtful = doubtful.iter().peekable();
        for (number, (watched, start)) in self.motion.guards.iter().zip(starts).enumerate() {
            let j = watched.contact;
            let (value, error) = match doubtful.next_if(|guard| guard.number == number) {
                Some(guard) => (jet.guard_series[number * ROW..(number + 1) * ROW].iter().sum(), guard.tail),
                None => (start.value + watched.along() * gained[j], self.deflection_tail(j, tail)),
            };
            ends.push(GuardValue { value, error, ..*start });
        }
    }

    /// Evaluates the state at `theta` as [`Jet::state_at`] does.
    #[inline(always)]
    fn state_at<P: Path>(&self, path: P, jet: &Jet, theta: f64, x: &mut Vec<f64>) {
        let orders = &jet.work[self.layout.orders..self.layout.orders + ROW * self.layout.stride];
        let s = theta * jet.reach;
        x.resize(self.request.x.len(), 0.0);
        x.copy_from_slice(self.request.x);
        match self.s.columns.blocks.len() {
            1 => self.horner::<P, 2>(path, orders, s, x),
            2 => self.horner::<P, 4>(path, orders, s, x),
            3 => self.horner::<P, 6>(path, orders, s, x),
            4 => self.horner::<P, 8>(path, orders, s, x),
            5 => self.horner::<P, 10>(path, orders, s, x),
            6 => self.horner::<P, 12>(path, orders, s, x),
            blocks => unreachable!("{blocks} blocks in a linear mode"),
        }
    }

    /// Writes the N fours of displacements and velocities at `s` into `x`.
    #[inline(always)]
    fn horner<P: Path, const N: usize>(&self, path: P, orders: &[f64], s: f64, x: &mut [f64]) {
        let (n, by) = (self.s.n, path.all(s));
        let mut sums = [path.all(0.0); N];
        for (k, fours) in orders.as_chunks::<LANES>().0.as_chunks::<N>().0.iter().enumerate().rev() {
            for i in 0..N {
                sums[i] = path.plus(sums[i], path.four(fours[i]));
                if k > 0 {
                    sums[i] = path.times(sums[i], by);
                }
            }
        }
        let sums = sums.map(|sum| path.numbers(sum));
        x[..n].copy_from_slice(&sums.as_flattened()[..n]);
        x[n..2 * n].copy_from_slice(&sums.as_flattened()[self.layout.velocities..][..n]);
    }
}

impl Motion<'_> {
    /// Returns the changes of all deflections from the start of a step to `theta`.
    #[inline(always)]
    pub(super) fn gained<P: Path>(&self, path: P, step: &Jet, theta: f64) -> Fours {
        let mut all = Fours::new();
        let s = path.all(theta * step.reach);
        for first in (0..self.parts.len()).step_by(LANES) {
            let rows = &step.work[self.layout.deflection(first, 1)..self.layout.deflection(first, ORDER) + LANES];
            let mut sum = path.all(0.0);
            for row in rows.as_chunks::<LANES>().0.iter().rev() {
                sum = path.times(path.plus(sum, path.four(*row)), s);
            }
            all.push(path.numbers(sum));
        }
        all
    }

    /// Computes the end of the step from `request` into `leap`. Returns `false` where the step itself has to decide.
    #[inline(always)]
    pub(super) fn bare<P: Path>(&self, path: P, request: &JetRequest<'_>, leap: &mut Leap) -> bool {
        let s = self.structure;
        if !self.is_linear || self.held.is_some() || s.is_conservative {
            return false;
        }
        let Some((e, _, tail)) = self.series(path, request, true, &mut leap.jet) else { return false };
        let reach = leap.jet.reach;
        let powers = powers(reach);
        let added = e.added(path, &leap.jet.work, &powers);
        let doubtful = e.doubtful(&powers, added.as_flattened(), &tail, leap);
        let jet = &leap.jet;
        let rows: SmallVec<[Deflated<'_>; 8]> = doubtful.iter().map(|guard| guard.series(jet)).collect();
        // Guards of equal contacts are equal, and fall together.
        let is_twin = |fall: &Option<Fall>, series: &Deflated<'_>| {
            fall.as_ref().is_some_and(|fall| rows[fall.place].is_twin(series))
        };
        let (mut limit, mut first) = (1.0, None);
        for (place, series) in rows.iter().enumerate() {
            if is_twin(&first, series) {
                continue;
            }
            let found = poly::first_root_on(path, series.p, limit, series.error);
            leap.splits += u64::from(found.splits);
            match found.root {
                _ if found.touch.is_some() => return false,
                FirstRoot::None => {}
                FirstRoot::At(theta) => {
                    let fall = Fall::new(place, series, theta, request.tolerance);
                    if theta <= 0.0 || fall.is_none() {
                        return false;
                    }
                    (limit, first) = (theta, fall);
                }
            }
        }
        leap.is_bound = first.is_none() && jet.time_at(1.0) >= request.span * (1.0 - ARRIVED);
        // No other guard, and no end of the arc, may coincide with the first fall.
        let width = first.as_ref().map_or(0.0, |fall| fall.width);
        // No other guard falls with it or is near: an event judges nearness by the value itself, exact zeros included.
        let mut is_alone = true;
        if first.is_some() || leap.is_bound {
            for (series, guard) in rows.iter().zip(&doubtful) {
                let [value, slope, _] = poly::eval_with_derivatives(series.p, limit);
                let is_off = value > APART * (series.error + slope.abs() * width)
                    && value * limit.powi(series.order as i32) > guard.afresh;
                is_alone &= is_off || is_twin(&first, series);
            }
        }
        if !is_alone || first.is_some() && limit + APART * width >= 1.0 {
            return false;
        }
        let id = |place: usize| self.guards[doubtful[place].number].id;
        leap.twins = (0..rows.len()).filter(|place| is_twin(&first, &rows[*place])).map(id).collect();
        leap.time = jet.time_at(limit);
        leap.passage = first.map(|fall| {
            let h = jet.span * reach;
            let Fall { place, value, slope, curvature, error, zeros, .. } = fall;
            let (slope, curvature) = (slope / h, curvature / (h * h));
            Passage { guard: id(place), residual: value, slope, error, curvature, zeros }
        });
        e.state_at(path, jet, limit, &mut leap.x);
        if leap.x.iter().any(|x| !x.is_finite()) {
            return false;
        }
        let gained = self.gained(path, jet, limit);
        let gained = gained.as_flattened();
        self.keep(jet, leap.passage.is_some(), gained, &mut leap.carried);
        leap.carried.push(f64::NAN);
        leap.sizes.resize(request.x.len(), 0.0);
        for (size, x) in leap.sizes.iter_mut().zip(request.x) {
            *size = x.abs();
        }
        leap.ends.clear();
        if leap.passage.is_none() {
            e.ends(&doubtful, gained, &tail, (jet, &leap.starts), &mut leap.ends);
        }
        leap.is_series = true;
        true
    }
}
