//! Motion of a linear mode to its next event, by its propagator: `docs/EVENTS.md`, line 38.
//!
//! A guard is a value at the start plus a row. After an exact zero the row alone is searched. If the signs of the coefficients of all
//! guards are those of no zero or of one fall, the first fall is the event, unless another one or the bound is too near to decide which
//! comes first. In every other case the series of the mode decide.

use smallvec::SmallVec;

use super::propagator::{Component, MOST_INPUTS, MOST_TERMS, Propagator};
use crate::{
    hybrid::{GuardValue, JetRequest, Leap, Passage},
    kernel::{
        APART, LANES, Motion, ROUNDING,
        mode::motion::ModeGuard,
        series::start::{ContactStart, SpanStart, deflection_terms},
    },
    poly::{self, BernsteinBasis, MOST_FOURS, Numbers, Pattern, Row, Signed},
    system::{Elasticity, Force, Watch, Wave, dot},
    vectors::Path,
};

/// Number of contacts, and of guards, that need no allocation.
const FEW: usize = 8;
const MANY: usize = 16;
/// Maximum number of leaps of an arc. If it needs more, some rate is much faster than the motion, and series hold for longer.
pub const MOST_LEAPS: u32 = 4;
/// Widest fall that counts as decided, relative to the time to it.
const SHARP: f64 = 1e-11;
/// Shortest leap, in spans. Rounding and truncation of a row are relative to its size over the whole span; over shorter times it is less.
pub const SHORTEST: f64 = 1.0 / 256.0;
/// Factor on the place of a rise of coefficients at which a part of the span is tried: a guard rises later than they do. Measured.
const BEYOND: f64 = 1.5;
/// Factor on the error of a row by which values formed afresh at its ends may differ.
pub const AFRESH: f64 = 4.0;

/// Guard of a leap: its value at the start, the sign of the row of its contact in it, and the error of that row.
#[derive(Clone, Copy)]
struct GuardRow {
    start: f64,
    sign: f64,
    error: f64,
}

/// A guard on a span, `start + θ p(θ)`, or `θ p(θ)` if it starts at an exact zero.
pub struct Guard<'r, P: Path, const F: usize> {
    series: Signed<'r, P, F>,
    /// Error of the value at the start, and of the row.
    errors: [f64; 2],
    pub pattern: Pattern,
    /// Place returned by [`poly::pattern`], in spans.
    place: f64,
}

impl<'r, P: Path, const F: usize> Guard<'r, P, F> {
    #[inline(always)]
    pub fn new(path: P, start: f64, sign: f64, row: &'r Row<P, F>, errors: [f64; 2]) -> Self {
        let series = Signed { start, sign, row };
        let (pattern, place) = poly::pattern(path, &series, errors[0] + errors[1]);
        Self { series, errors, pattern, place }
    }

    /// Judges all guards on a part of the span from its start, and returns that part: the whole span, or the first of [`poly::PARTS`]
    /// on which no guard is unclear, else the shortest.
    #[inline(always)]
    pub fn sharpen(path: P, guards: &mut [Self]) -> f64 {
        let is_told = guards.iter().all(|guard| guard.pattern != Pattern::Unclear);
        if is_told { 1.0 } else { Self::shorten(path, guards) }
    }

    #[inline(always)]
    fn shorten(path: P, guards: &mut [Self]) -> f64 {
        // A part that extends far beyond a rise of the coefficients is usually unclear too, and is not tried.
        let unclear = guards.iter().filter(|guard| guard.pattern == Pattern::Unclear);
        let until = unclear.fold(1.0, |until: f64, guard| until.min(guard.place));
        let last = poly::PARTS.len() - 1;
        let mut number = poly::PARTS.iter().position(|part| *part < BEYOND * until).unwrap_or(last);
        loop {
            let (part, mut is_told) = (poly::PARTS[number], true);
            for guard in guards.iter_mut().filter(|guard| guard.pattern != Pattern::Clear) {
                let Signed { start, sign, row } = guard.series;
                let (row, rounding) = poly::restrict(path, row, number);
                let uncertainty = guard.errors[0] + part * guard.errors[1] + rounding;
                let (pattern, place) = poly::pattern(path, &Signed { start, sign, row: &row }, uncertainty);
                (guard.pattern, guard.place) = (pattern, part * place);
                is_told &= pattern != Pattern::Unclear;
            }
            if is_told || number == last {
                return part;
            }
            number += 1;
        }
    }

    /// Returns the fall of the guard on the first `part` of the span, if any.
    #[inline(always)]
    fn fall(&self, path: P, index: usize, part: f64) -> Option<Fall> {
        let (theta, [value, slope]) = poly::fall(path, &self.series, self.place, part)?;
        let error = self.errors[0] + theta * self.errors[1];
        let [value, slope] =
            if self.series.start == 0.0 { [theta * value, value + theta * slope] } else { [value, slope] };
        Some(Fall { index, theta, value, slope, error })
    }
}

/// Fall of a guard through zero: value, slope with respect to θ, and error of the value.
#[derive(Clone, Copy)]
pub struct Fall {
    pub index: usize,
    theta: f64,
    value: f64,
    slope: f64,
    pub error: f64,
}

impl Fall {
    fn width(&self) -> f64 {
        self.error / self.slope.abs()
    }
}

/// Returns the first fall on the first `part` of a span before the `bound`, and the end of the leap; `None` if that is not decided.
#[inline(always)]
pub fn first_fall<P: Path, const F: usize>(
    path: P,
    guards: &[Guard<'_, P, F>],
    part: f64,
    bound: f64,
) -> Option<(Option<Fall>, f64)> {
    let (mut first, mut later): (Option<Fall>, f64) = (None, f64::INFINITY);
    let earliest = |fall: &Fall| fall.theta - APART * fall.width();
    for (i, guard) in guards.iter().enumerate() {
        let fall = match guard.pattern {
            Pattern::Clear => continue,
            Pattern::Unclear => return None,
            Pattern::Falls => guard.fall(path, i, part),
        };
        let fall = fall.filter(|fall| fall.slope < 0.0 && fall.width() <= SHARP * fall.theta)?;
        match &mut first {
            Some(first) if fall.theta >= first.theta => later = later.min(earliest(&fall)),
            first => {
                later = first.as_ref().map_or(later, |other| later.min(earliest(other)));
                *first = Some(fall);
            }
        }
    }
    let limit = part.min(bound);
    match first.filter(|fall| earliest(fall) <= limit) {
        None if later <= limit => None,
        None => Some((None, limit)),
        // A fall at the instant of another one, of the bound or of the end of the part is not decided here.
        Some(fall) if fall.theta + APART * fall.width() >= later.min(limit) => None,
        Some(fall) => Some((Some(fall), fall.theta)),
    }
}

impl Propagator {
    /// Returns the first three time derivatives of `θ Σ d_i B_i` at the start.
    pub fn derivatives<const F: usize>(&self, d: &Numbers<F>) -> [f64; 3] {
        let (n, rate, d) = ((4 * F - 1) as f64, self.span.recip(), d[0]);
        let [first, second] = [d[1] - d[0], d[2] - 2.0 * d[1] + d[0]];
        [d[0] * rate, 2.0 * n * first * rate * rate, 3.0 * n * (n - 1.0) * second * rate * rate * rate]
    }

    /// Returns the value of a guard at the start, the sign of its row, and the error of the value.
    #[inline(always)]
    pub fn guard(
        &self,
        motion: &Motion,
        given: &SpanStart<'_>,
        watched: &ModeGuard,
        start: &ContactStart,
        rate: f64,
    ) -> [f64; 3] {
        let ModeGuard { contact: j, watch, sign, .. } = *watched;
        let (s, part) = (motion.structure, &motion.parts[j]);
        let c = &s.contacts[j];
        if watch == Watch::Force {
            let Some(Force::Linear { stiffness, damping }) = part.force() else { return [f64::NAN; 3] };
            let k = match stiffness {
                Elasticity::Constant(k) => k,
                varying => s.stiffness_at(j, varying, given.at).0,
            };
            let along = sign * part.side;
            if given.is_zero(watch) {
                return [0.0, along, 0.0];
            }
            let error = k * start.error + ROUNDING * damping * s.rate_size(c, given.x);
            return [along * (k * start.stretch + damping * rate), along, error];
        }
        let along = if watch == Watch::DriveFlank { -sign } else { sign };
        if part.side != 0.0 {
            return [part.side * start.stretch, along, start.error];
        }
        if given.is_zero(watch) {
            return [0.0, along, 0.0];
        }
        let by_state = c.gap() + along * start.deflection;
        // Of the two flanks, the known distance belongs to the nearer one.
        let known = along * start.stretch;
        let is_known = (known - by_state).abs() < c.gap() || !c.has_back();
        if is_known && known != 0.0 && !known.is_nan() {
            [known, along, start.error]
        } else {
            [by_state, along, ROUNDING * given.size]
        }
    }

    /// Advances from `request` to the first event, the bound or the end of the span. Returns `false` if the signs do not decide.
    #[inline(always)]
    pub fn leap<P: Path>(&self, path: P, motion: &Motion, request: &JetRequest<'_>, leap: &mut Leap) -> bool {
        match self.fours {
            5 => self.leap_by::<P, 5>(path, motion, request, leap),
            _ => self.leap_by::<P, MOST_FOURS>(path, motion, request, leap),
        }
    }

    #[inline(always)]
    fn leap_by<P: Path, const F: usize>(
        &self,
        path: P,
        motion: &Motion,
        request: &JetRequest<'_>,
        leap: &mut Leap,
    ) -> bool {
        let s = motion.structure;
        let (n, x) = (s.n, request.x);
        let mut oscillators = [[0.0; 2]; MOST_INPUTS];
        s.oscillate(request.at, |i, cosine, sine| oscillators[i] = [cosine, sine]);
        let wave = |w: &[Wave]| {
            w.iter().fold(0.0, |sum, w| sum + w.cosine * oscillators[w.index][0] + w.sine * oscillators[w.index][1])
        };
        let rate = |j: usize| dot(&s.contacts[j].direction, &x[n..]) - wave(&s.contacts[j].error_rate);
        let mut starts: SmallVec<[(SpanStart<'_>, ContactStart); FEW]> = SmallVec::new();
        let mut stretches: SmallVec<[f64; FEW]> = SmallVec::new();
        let [mut sums, mut sizes] = [[0.0; LANES]; 2];
        for (j, c) in s.contacts.iter().enumerate() {
            if j % LANES == 0 {
                [sums, sizes] = deflection_terms(path, &s.columns.fours[j / LANES], x);
            }
            let first = self.fold.contacts[j];
            if first < j {
                let equal = starts[first];
                stretches.push(equal.1.stretch);
                starts.push(equal);
                continue;
            }
            let deflection = sums[j % LANES] - (c.spec.error_offset + wave(&c.error));
            let given = SpanStart::new(request, j, sizes[j % LANES]);
            let start = ContactStart::new(motion, &given, j, deflection, || rate(j));
            stretches.push(start.stretch);
            starts.push((given, start));
        }
        let mut z: SmallVec<[f64; MOST_TERMS]> = SmallVec::new();
        self.weigh(path, motion, (request.at, x), (&stretches, &oscillators), &mut z);
        let mut rows: SmallVec<[(Row<P, F>, f64); FEW]> = SmallVec::new();
        for line in &self.rows {
            rows.push((line.columns.combine(path, &z), line.error(&z)));
        }
        // All guards, and those that are not clear of zero, with their numbers.
        let mut lines: SmallVec<[GuardRow; MANY]> = SmallVec::new();
        let mut guards: SmallVec<[Guard<'_, P, F>; FEW]> = SmallVec::new();
        let mut numbers: SmallVec<[usize; FEW]> = SmallVec::new();
        for (number, (watched, row)) in motion.guards.iter().zip(&self.guards).enumerate() {
            let first = self.firsts[number];
            if first < number {
                let equal = lines[first];
                lines.push(equal);
                continue;
            }
            let (j, (row, error)) = (watched.contact, &rows[*row]);
            let rate = if watched.watch == Watch::Force { rate(j) } else { 0.0 };
            let [start, sign, rounding] = self.guard(motion, &starts[j].0, watched, &starts[j].1, rate);
            // A zero by chance is not exact.
            if start == 0.0 && rounding > 0.0 {
                return false;
            }
            let error = *error;
            lines.push(GuardRow { start, sign, error });
            if poly::stays_above(path, start, row, 2.0 * (rounding + error)) {
                continue;
            }
            let guard = Guard::new(path, start, sign, row, [rounding, error]);
            if guard.pattern != Pattern::Clear {
                numbers.push(number);
                guards.push(guard);
            }
        }
        let part = Guard::sharpen(path, &mut guards);
        let bound = request.span / self.span;
        let decided = first_fall(path, &guards, part, bound).filter(|(_, end)| *end >= SHORTEST);
        let Some((fall, end)) = decided else { return false };
        leap.is_bound = fall.is_none() && bound <= part;
        leap.passage = fall.map(|fall| Passage {
            // After an exact zero, the error is complete.
            zeros: if guards[fall.index].series.start == 0.0 { 3 } else { 0 },
            curvature: 0.0,
            guard: motion.guards[numbers[fall.index]].id,
            residual: fall.value,
            slope: fall.slope / self.span,
            error: fall.error,
        });
        if let Some(fall) = fall.filter(|_| self.fold.is_folded) {
            let first = numbers[fall.index];
            let equal = motion.guards.iter().zip(&self.firsts).filter(|(_, other)| **other == first);
            leap.twins = equal.map(|(watched, _)| watched.id).collect();
        }
        leap.time = end * self.span;
        let place: BernsteinBasis<P, F> = BernsteinBasis::new(path, end);
        let weight = end * place.weight();
        let added = |row: &Row<P, F>| weight * place.value(path, row);
        leap.x.clear();
        leap.sizes.clear();
        for (x, component) in x.iter().zip(&self.state) {
            let own;
            let row = match component {
                Component::Own(columns) => {
                    own = columns.combine(path, &z);
                    &own
                }
                Component::Row(row) => &rows[*row].0,
                Component::Same(other) => {
                    let [equal, size] = [leap.x[*other], leap.sizes[*other]];
                    leap.x.push(equal);
                    leap.sizes.push(size);
                    continue;
                }
            };
            leap.sizes.push(poly::largest(path, *x, row, end));
            leap.x.push(*x + added(row));
        }
        leap.x.extend_from_slice(&x[self.state.len()..]);
        leap.sizes.extend(x[self.state.len()..].iter().map(|x| x.abs()));
        leap.starts.clear();
        for ((watched, line), row) in motion.guards.iter().zip(&lines).zip(&self.guards) {
            let (j, (given, _)) = (watched.contact, &starts[watched.contact]);
            let c = &s.contacts[j];
            let size = match motion.parts[j].force() {
                Some(Force::Linear { damping, .. }) if watched.watch == Watch::Force => {
                    c.stiffest * given.size + damping * s.rate_size(c, x)
                }
                _ => given.size,
            };
            // Error of a value from the state alone: its growth over the span counts too.
            let error = ROUNDING * size + AFRESH * line.error;
            // Impact sequences need them.
            let derivatives = if c.spec.law.is_rigid() {
                self.derivatives(&poly::numbers(path, &rows[*row].0)).map(|d| line.sign * d)
            } else {
                [f64::NAN; 3]
            };
            leap.starts.push(GuardValue {
                guard: watched.id,
                value: line.start,
                error,
                terms: line.start.abs(),
                derivatives,
            });
        }
        leap.ends.clear();
        leap.carried.clear();
        if fall.is_some() && starts.len() == 1 {
            return true;
        }
        let mut gained: SmallVec<[f64; FEW]> = SmallVec::new();
        for (row, _) in &rows {
            gained.push(added(row));
        }
        if let Some(fall) = fall {
            // A contact within its rounding of a flank, such as one that has just left it, is near, and may take part in the event.
            let first = numbers[fall.index];
            for (number, (line, row)) in lines.iter().zip(&self.guards).enumerate() {
                let is_near = line.start + line.sign * gained[*row] <= leap.starts[number].error;
                if is_near && self.firsts[number] != first {
                    return false;
                }
            }
        }
        for (j, (_, start)) in starts.iter().enumerate() {
            if j % LANES == 0 {
                [_, sizes] = deflection_terms(path, &s.columns.fours[j / LANES], &leap.x);
            }
            let stretch = start.stretch + gained[self.deflections[j]];
            leap.carried.push(motion.parts[j].kept(stretch, sizes[j % LANES]));
        }
        if fall.is_none() {
            for ((watched, line), row) in motion.guards.iter().zip(&lines).zip(&self.guards) {
                let added = line.sign * gained[*row];
                let (value, terms) = (line.start + added, line.start.abs() + added.abs());
                let (guard, error) = (watched.id, line.error);
                leap.ends.push(GuardValue { guard, value, error, terms, ..GuardValue::default() });
            }
        }
        true
    }
}
