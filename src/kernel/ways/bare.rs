//! Step of a linear mode of which only the end is needed.
//!
//! Series, reach, rows and result equal those of the full step, bit for bit. Work that most steps do not need is omitted. A guard that
//! its terms cannot lower to zero gets no row. The first of the others that falls is the event, if it falls alone. In all
//! other cases the step itself decides.

use smallvec::SmallVec;

use super::Ways;
use crate::{
    hybrid::{AGREED, ARRIVED, GuardValue, Jet, JetRequest, Leap, Passage, are_finite},
    kernel::{
        APART, Expansion, Four, LANES, Motion, ROUNDING, ROW, StepRows,
        bounds::{
            bound::Tail,
            guards::{Powers, powers},
        },
        mode::motion::ModeGuard,
        series::carry::Fours,
    },
    poly::{self, Deflated, FirstRoot, FourRanges},
    system::Watch,
    vectors::Path,
};

/// Rounding of the sums of the terms of a series, of the powers and of the Bernstein basis in them, relative to the sizes of the terms.
const SUMMED: f64 = 2.0 * ROW as f64 * f64::EPSILON;
/// Widest fall that counts as decided, relative to the step: at full precision, in units of the truncation, and at most.
const SHARP: [f64; 3] = [1e-11, 1e5, 1e-2];
/// Relative change of a slope over the width of a fall above which the fall is tangential.
const TANGENTIAL: f64 = 1e-3;

/// Guards of position of four contacts at the start of a step.
#[derive(Clone, Copy, Default)]
struct FlankValues {
    /// Values at the drive and the back flank, m.
    values: [Four; 2],
    /// Sizes of the terms of these guards on the step, m.
    terms: [Four; 2],
    /// Bits of the guards that stay above zero: of the drive flanks, then of the back flanks.
    clear: u32,
    /// Rounding of the values, m.
    rounding: Four,
    /// Rounding of the values if nothing is carried on from the step before, m.
    afresh: Four,
    /// Truncation of the deflections, m.
    rest: Four,
}

/// Guard that its terms may lower to zero.
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
pub struct Fall {
    /// Index among the doubtful guards.
    place: usize,
    /// Value of the guard; derivatives are with respect to θ.
    value: f64,
    pub slope: f64,
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

/// An unobserved step: its guards and its end.
#[derive(Default)]
pub struct BareStep {
    positions: SmallVec<[FlankValues; 4]>,
    doubtful: SmallVec<[UndecidedGuard; 8]>,
    tail: Tail,
    /// End of the step in θ.
    pub limit: f64,
    /// The first fall, if any, and the doubtful guards that fall there: the first one and its twins.
    pub first: Option<Fall>,
    falls: SmallVec<[usize; 8]>,
    /// True if the step ends at the end of the requested span.
    pub is_bound: bool,
    /// Number of subdivisions spent on the guards.
    pub splits: u64,
}

/// Guards of position of four contacts at the end of a step.
#[derive(Clone, Copy, Default)]
pub struct FlankEnds {
    /// Values at the drive and the back flank, m.
    pub values: [Four; 2],
    /// Bound on their errors, with that of a value formed from the state, m.
    pub error: Four,
}

impl BareStep {
    /// Writes the guards of position at the end of the step, which has changed the deflections by `gained`.
    #[inline(always)]
    pub fn ends<P: Path>(&self, path: P, motion: &Motion, gained: &[Four], ends: &mut SmallVec<[FlankEnds; 4]>) {
        for ((of, flanks), gained) in self.positions.iter().zip(&motion.flanks).zip(gained) {
            let mut end = FlankEnds::default();
            for flank in [0, 1] {
                let along = path.times(path.four(flanks.along[flank]), path.four(*gained));
                end.values[flank] = path.numbers(path.plus(path.four(of.values[flank]), along));
            }
            end.error = path.numbers(path.plus(path.four(of.rest), path.four(of.afresh)));
            ends.push(end);
        }
    }

    /// Returns whether the guards of position at the start of the step agree with those at the end of the one before.
    #[inline(always)]
    pub fn agrees<P: Path>(&self, path: P, motion: &Motion, ends: &[FlankEnds]) -> bool {
        let mut apart = 0;
        for ((of, flanks), end) in self.positions.iter().zip(&motion.flanks).zip(ends) {
            let bound = path.times(path.all(AGREED), path.plus(path.four(end.error), path.four(of.afresh)));
            for flank in [0, 1] {
                let off = path.sizes(path.minus(path.four(of.values[flank]), path.four(end.values[flank])));
                let is_watched = path.above(path.sizes(path.four(flanks.along[flank])), path.all(0.0));
                // Comparisons with NaN are false.
                apart |= is_watched & !path.above(bound, off);
            }
        }
        apart == 0
    }

    /// Raises `largest` to the rounding of the guards of position, if formed from the state.
    #[inline(always)]
    pub fn largest_rounding<P: Path>(&self, path: P, largest: &mut SmallVec<[Four; 4]>) {
        largest.resize(self.positions.len(), [0.0; LANES]);
        for (largest, of) in largest.iter_mut().zip(&self.positions) {
            *largest = path.numbers(path.larger(path.four(of.afresh), path.four(*largest)));
        }
    }

    /// Iterates over the guards that fall at the end of the step.
    pub fn fired<'a>(&'a self, motion: &'a Motion) -> impl Iterator<Item = &'a ModeGuard> + Clone {
        self.falls.iter().map(|place| &motion.guards[self.doubtful[*place].number])
    }

    /// Returns the error of the fall, and that of a value formed from the state.
    pub fn errors(&self) -> [f64; 2] {
        self.first.as_ref().map_or([0.0; 2], |fall| [fall.error, self.doubtful[fall.place].afresh])
    }

    fn clear(&mut self) {
        self.doubtful.clear();
        self.falls.clear();
        (self.first, self.splits) = (None, 0);
    }
}

impl Expansion<'_> {
    /// Returns the first three time derivatives of a guard of position at the start.
    fn derivatives(&self, watched: &ModeGuard, powers: &Powers, jet: &Jet) -> [f64; 3] {
        let h = jet.span * jet.reach;
        let term = |k: usize| watched.along() * jet.rows.deflection(watched.contact, k) * powers[k];
        [term(1) / h, 2.0 * term(2) / (h * h), 6.0 * term(3) / (h * h * h)]
    }

    /// Writes the guards of position of four contacts at the start of the step into `values`. A guard is clear if no sum of the terms of its deflection
    /// lowers it to zero.
    #[inline(always)]
    fn positions<P: Path>(
        &self,
        path: P,
        number: usize,
        (powers, tail): (&Powers, &Tail),
        rows: &StepRows,
        values: &mut FlankValues,
    ) {
        let flanks = &self.motion.flanks[number];
        let zero = path.all(0.0);
        let FourRanges { range: [least, most], sizes: added } =
            FourRanges::new(path, &rows.deflections[number], powers);
        let (gap, near, known) = (path.four(flanks.gap), path.four(flanks.near), path.four(rows.gaps[number]));
        let (stretch, deflection) = (path.four(rows.stretches[number]), path.four(rows.deflections[number][0]));
        let position = path.where_above(path.four(flanks.has_side), zero, stretch, deflection);
        let rest = path.plus(
            path.times(path.four(flanks.across), path.all(tail.displacement)),
            path.times(path.four(flanks.top), path.all(tail.waves[1])),
        );
        let rounding = path.times(path.all(ROUNDING), path.four(rows.terms[number]));
        let bound = path.plus(rest, rounding);
        let afresh = path.times(path.all(ROUNDING), path.plus(path.four(rows.sizes[number]), added));
        values.clear = 0;
        (values.rounding, values.afresh) = (path.numbers(rounding), path.numbers(afresh));
        values.rest = path.numbers(rest);
        for (flank, along) in flanks.along.iter().enumerate() {
            let along = path.four(*along);
            let by_state = path.plus(path.times(along, position), gap);
            // Of two flanks, the gap belongs to the one that agrees with the state. A gap of zero is not exact.
            let known = path.times(along, known);
            let apart = path.sizes(path.minus(known, by_state));
            let agreed = path.where_above(near, apart, known, by_state);
            let value = path.where_above(path.sizes(known), zero, agreed, by_state);
            let terms = path.plus(path.sizes(value), added);
            let lowest = path.plus(value, path.where_above(along, zero, least, path.minus(zero, most)));
            let margin = path.plus(bound, path.times(path.all(SUMMED), terms));
            values.clear |= path.above(lowest, margin) << (LANES * flank);
            (values.values[flank], values.terms[flank]) = (path.numbers(value), path.numbers(terms));
        }
    }

    /// Writes the guards of the step into `step`, and the rows of those that are not clear of zero on it into `jet`.
    #[inline(always)]
    fn doubtful<P: Path>(&self, path: P, powers: &Powers, tail: &Tail, jet: &mut Jet, step: &mut BareStep) {
        let guards = &self.motion.guards;
        jet.guard_series.resize(3 * self.s.contacts.len() * ROW, 0.0);
        step.positions.resize(jet.rows.deflections.len(), FlankValues::default());
        for (number, values) in step.positions.iter_mut().enumerate() {
            self.positions(path, number, (powers, tail), &jet.rows, values);
        }
        let still = !self.request.still.is_empty();
        for (number, watched) in guards.iter().enumerate() {
            let (j, watch) = (watched.contact, watched.watch);
            let (of, lane) = (&step.positions[j / LANES], j % LANES);
            let row = number * ROW..(number + 1) * ROW;
            if watch == Watch::Force {
                let tail = self.force_tail(j, tail, jet);
                let (row, [terms, size]) =
                    (&mut jet.guard_series[row], [jet.rows.terms[j / LANES][lane], jet.rows.size(j)]);
                let [rounding, afresh] = self.force_row(watched, terms, size, powers, &jet.rows, row);
                step.doubtful.push(UndecidedGuard { number, tail, rounding, afresh });
            } else if of.clear >> (LANES * (watch as usize) + lane) & 1 == 0 || still && self.is_released(j, watch) {
                self.position_row(watched, powers, &jet.rows, &mut jet.guard_series[row]);
                let (tail, rounding, afresh) = (of.rest[lane], of.rounding[lane], of.afresh[lane]);
                step.doubtful.push(UndecidedGuard { number, tail, rounding, afresh });
            }
        }
    }

    /// Writes the guards at the start of the step into `starts`.
    fn starts(&self, step: &BareStep, powers: &Powers, jet: &Jet, starts: &mut Vec<GuardValue>) {
        let mut doubtful = step.doubtful.iter().peekable();
        starts.clear();
        starts.extend(self.motion.guards.iter().enumerate().map(|(number, watched)| {
            let &ModeGuard { id, contact: j, watch, .. } = watched;
            let (of, flank, lane) = (&step.positions[j / LANES], watch as usize & 1, j % LANES);
            let (mut value, mut terms, mut error) = (of.values[flank][lane], of.terms[flank][lane], of.afresh[lane]);
            if let Some(guard) = doubtful.next_if(|guard| guard.number == number) {
                let row = &jet.guard_series[number * ROW..(number + 1) * ROW];
                value = row[0];
                if watch == Watch::Force {
                    (error, terms) = (guard.afresh, poly::terms(row, 1.0));
                }
            }
            // Impact sequences need them.
            let is_rigid = self.s.contacts[j].spec.law.is_rigid();
            let derivatives = if is_rigid { self.derivatives(watched, powers, jet) } else { [f64::NAN; 3] };
            GuardValue { guard: id, value, error, terms, derivatives }
        }));
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

    /// Writes state and carried values at the end of the step. Returns the changes of the deflections.
    #[inline(always)]
    pub fn finish<P: Path>(
        &self,
        path: P,
        step: &BareStep,
        jet: &Jet,
        (x, carried): (&mut Vec<f64>, &mut Vec<f64>),
    ) -> Fours {
        self.state_at(path, jet, step.limit, x);
        let gained = self.motion.gained(path, jet, step.limit);
        self.motion.keep(path, jet, step.first.is_some(), &gained, carried);
        carried.push(f64::NAN);
        gained
    }

    /// Evaluates the state at `theta` as [`Jet::state_at`] does.
    #[inline(always)]
    fn state_at<P: Path>(&self, path: P, jet: &Jet, theta: f64, x: &mut Vec<f64>) {
        let orders = &jet.rows.orders;
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
    fn horner<P: Path, const N: usize>(&self, path: P, orders: &[Four], s: f64, x: &mut [f64]) {
        let (n, by) = (self.s.n, path.all(s));
        let mut sums = [path.all(0.0); N];
        for (k, fours) in orders.as_chunks::<N>().0.iter().enumerate().rev() {
            for i in 0..N {
                sums[i] = path.plus(sums[i], path.four(fours[i]));
                if k > 0 {
                    sums[i] = path.times(sums[i], by);
                }
            }
        }
        let sums = sums.map(|sum| path.numbers(sum));
        x[..n].copy_from_slice(&sums.as_flattened()[..n]);
        x[n..2 * n].copy_from_slice(&sums.as_flattened()[LANES * N / 2..][..n]);
    }
}

impl Ways<'_> {
    /// Returns whether unobserved steps cover the mode.
    pub fn is_bare(&self) -> bool {
        let motion = &self.motion;
        motion.is_linear && motion.held.is_none() && !motion.structure.is_conservative
    }

    /// Forms the step from `request` and finds its first fall. Returns `None` where the step itself has to decide.
    #[inline(always)]
    pub(super) fn bare_step<'a, P: Path>(
        &'a self,
        path: P,
        request: &'a JetRequest<'a>,
        jet: &mut Jet,
        step: &mut BareStep,
    ) -> Option<Expansion<'a>> {
        let motion = &self.motion;
        step.clear();
        let (e, _, tail) = self.series(path, request, true, jet)?;
        let powers = powers(jet.reach);
        e.doubtful(path, &powers, &tail, jet, step);
        step.tail = tail;
        step.limit = 1.0;
        let mut rows: SmallVec<[Deflated<'_>; 8]> = SmallVec::new();
        for guard in &step.doubtful {
            rows.push(guard.series(jet));
        }
        // Guards of equal contacts are equal, and fall together.
        let is_twin = |fall: &Option<Fall>, place: usize| {
            fall.as_ref().is_some_and(|fall| fall.place == place || rows[fall.place].is_twin(&rows[place]))
        };
        for (place, series) in rows.iter().enumerate() {
            // The coefficients of a guard of position have been tested, except after an exact zero.
            let is_tested = series.order == 0 && motion.guards[step.doubtful[place].number].watch != Watch::Force;
            let is_clear = !is_tested && poly::certainly_positive(series.p, series.error);
            if is_clear || is_twin(&step.first, place) {
                continue;
            }
            let found = poly::first_root_on(path, series.p, step.limit, series.error);
            step.splits += u64::from(found.splits);
            match found.root {
                _ if found.touch.is_some() => return None,
                FirstRoot::None => {}
                FirstRoot::At(theta) => {
                    let fall = Fall::new(place, series, theta, request.tolerance);
                    if theta <= 0.0 || fall.is_none() {
                        return None;
                    }
                    (step.limit, step.first) = (theta, fall);
                }
            }
        }
        step.is_bound = step.first.is_none() && jet.time_at(1.0) >= request.span * (1.0 - ARRIVED);
        let width = step.first.as_ref().map_or(0.0, |fall| fall.width);
        // No other guard falls with it or is near: an event judges nearness by the value itself, exact zeros included.
        let mut is_alone = true;
        if step.first.is_some() || step.is_bound {
            for (place, (series, guard)) in rows.iter().zip(&step.doubtful).enumerate() {
                if is_twin(&step.first, place) {
                    step.falls.push(place);
                    continue;
                }
                let [value, slope, _] = poly::eval_with_derivatives(series.p, step.limit);
                let is_off = value > APART * (series.error + slope.abs() * width)
                    && value * step.limit.powi(series.order as i32) > guard.afresh;
                is_alone &= is_off;
            }
        }
        (is_alone && (step.first.is_none() || step.limit + APART * width < 1.0)).then_some(e)
    }

    /// Computes the end of the step from `request` into `leap`. Returns `false` where the step itself has to decide.
    #[inline(always)]
    pub fn bare<P: Path>(&self, path: P, request: &JetRequest<'_>, leap: &mut Leap) -> bool {
        let (motion, step) = (&self.motion, &mut BareStep::default());
        if !self.is_bare() {
            return false;
        }
        let formed = self.bare_step(path, request, &mut leap.jet, step);
        leap.splits += step.splits;
        let Some(e) = formed else { return false };
        let Leap { jet, starts, ends, .. } = leap;
        let id = |place: usize| motion.guards[step.doubtful[place].number].id;
        leap.twins = step.falls.iter().map(|place| id(*place)).collect();
        (leap.time, leap.is_bound) = (jet.time_at(step.limit), step.is_bound);
        leap.passage = step.first.as_ref().map(|fall| {
            let h = jet.span * jet.reach;
            let &Fall { place, value, slope, curvature, error, zeros, .. } = fall;
            let (slope, curvature) = (slope / h, curvature / (h * h));
            Passage { guard: id(place), residual: value, slope, error, curvature, zeros }
        });
        e.starts(step, &powers(jet.reach), jet, starts);
        let gained = e.finish(path, step, jet, (&mut leap.x, &mut leap.carried));
        if !are_finite(&leap.x) {
            return false;
        }
        leap.sizes.resize(request.x.len(), 0.0);
        for (size, x) in leap.sizes.iter_mut().zip(request.x) {
            *size = x.abs();
        }
        ends.clear();
        if step.first.is_none() {
            e.ends(&step.doubtful, gained.as_flattened(), &step.tail, (jet, starts), ends);
        }
        leap.is_series = true;
        true
    }
}
