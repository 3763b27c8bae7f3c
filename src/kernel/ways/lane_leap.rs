//! Leap of a lane: [`Propagator::leap`](crate::kernel::ways::propagator::Propagator::leap) for one degree of freedom with one contact.

use smallvec::SmallVec;

use super::{
    lane::Lane,
    leap::{AFRESH, Guard, SHORTEST, first_fall},
    propagator::{Component, Input, MOST_ANGLES, MOST_TERMS, Propagator, SHORT},
};
use crate::{
    hybrid::Columns,
    kernel::{
        ROUNDING,
        series::start::{ContactStart, SpanStart},
    },
    poly::{self, BernsteinBasis, Pattern, Row},
    system::{Watch, Wave, dot},
    vectors::Path,
};

/// Least time between an event and a switch after it, relative to the leap: nearer ones may be one instant.
const BEFORE_SWITCH: f64 = 1e-9;

/// Number of fours of a column.
const FOURS: usize = SHORT.fours;

/// Bound of a leap.
#[derive(Clone, Copy)]
pub struct Bound {
    /// Time to the bound, s.
    pub span: f64,
    /// True if the bound is a known switching time.
    pub is_switch: bool,
}

/// Result of a leap.
pub struct LeapEnd {
    /// Duration, s.
    pub time: f64,
    pub x: [f64; 2],
    /// Index of the guard that falls at the end, and bound on the error of its value there.
    pub falls: Option<(usize, f64)>,
    pub is_bound: bool,
    pub carried: f64,
}

/// First three derivatives of the guard of an impact after it, and rounding of its value.
pub type Derivatives = ([f64; 3], f64);

impl Lane<'_> {
    /// Makes a leap from the current point as [`Propagator::leap`], without the data that only an engine needs. After an impact of a guard,
    /// `rebound` receives its derivatives.
    #[inline(always)]
    pub fn leap<P: Path>(
        &self,
        path: P,
        by: &Propagator,
        to: Bound,
        rebound: Option<(Watch, &mut Derivatives)>,
        columns: Option<&mut Columns>,
    ) -> Option<LeapEnd> {
        let Self { structure: s, modes, state, waves: oscillators, .. } = self;
        let motion = &modes[state.mode].ways.motion;
        let (x, c) = (&state.x[..], &s.contacts[0]);
        let size = s.deflection_size(c, x);
        let given = SpanStart { at: state.at, x, size, zeros: state.zeros, carried: state.carried };
        let wave = |w: &[Wave]| {
            w.iter().fold(0.0, |sum, w| sum + w.cosine * oscillators[w.index][0] + w.sine * oscillators[w.index][1])
        };
        let rate = || dot(&c.direction, &x[1..]) - wave(&c.error_rate);
        let by_state = dot(&c.direction, x) - (c.spec.error_offset + wave(&c.error));
        let start = ContactStart::new(motion, &given, 0, by_state, rate);
        let mut z: SmallVec<[f64; MOST_TERMS]> = SmallVec::new();
        by.weigh(path, motion, (state.at, x), (&[start.stretch], oscillators), &mut z);
        let z = &z[..];
        let deflection: (Row<P, FOURS>, f64) = (by.rows[0].columns.combine(path, z), by.rows[0].error(z));
        let mut force: Option<(Row<P, FOURS>, f64)> = None;
        if let Some(row) = by.rows.get(1) {
            force = Some((row.columns.combine(path, z), row.error(z)));
        }
        // Guards that are not clear of zero, and their numbers.
        let mut guards: SmallVec<[Guard<'_, P, FOURS>; 2]> = SmallVec::new();
        let mut numbers = [0; 3];
        for (number, (watched, row)) in motion.guards.iter().zip(&by.guards).enumerate() {
            let (row, error) = force.as_ref().filter(|_| *row > 0).unwrap_or(&deflection);
            let rate = if watched.watch == Watch::Force { rate() } else { 0.0 };
            let [start, sign, rounding] = by.guard(motion, &given, watched, &start, rate);
            // A zero by chance is not exact.
            if start == 0.0 && rounding > 0.0 {
                return None;
            }
            let guard = Guard::new(path, start, sign, row, [rounding, *error]);
            if guard.pattern != Pattern::Clear {
                numbers[guards.len()] = number;
                guards.push(guard);
            }
        }
        if let Some((watch, rebound)) = rebound {
            rebound.1 = ROUNDING * size + AFRESH * deflection.1;
            for watched in motion.guards.iter().filter(|watched| watched.watch == watch) {
                rebound.0 = by.derivatives(&poly::numbers(path, &deflection.0)).map(|d| watched.along() * d);
            }
        }
        let part = Guard::sharpen(path, &mut guards);
        let bound = to.span / by.span;
        let (fall, end) = first_fall(path, &guards, part, bound).filter(|(_, end)| *end >= SHORTEST)?;
        let time = end * by.span;
        if to.is_switch && fall.is_some() && to.span - time <= BEFORE_SWITCH * time {
            return None;
        }
        let place: BernsteinBasis<P, FOURS> = BernsteinBasis::new(path, end);
        let weight = end * place.weight();
        let added = |row: &Row<P, FOURS>| weight * place.value(path, row);
        let mut after = [0.0; 2];
        for ((after, x), columns) in after.iter_mut().zip(x).zip(&by.state) {
            *after = *x
                + match columns {
                    Component::Row(0) => added(&deflection.0),
                    Component::Row(row) => added(&by.rows[*row].columns.combine(path, z)),
                    Component::Own(columns) => added(&columns.combine(path, z)),
                    Component::Same(_) => return None,
                };
        }
        if let Some(columns) = columns {
            // The derivative of the leap, `∂x(end)/∂x(start)`.
            let mut angles = [0.0; MOST_ANGLES];
            by.angles(path, motion, state.at, &mut angles);
            let mut flow = [[1.0, 0.0], [0.0, 1.0]];
            for (flow, columns) in flow.iter_mut().zip(&by.state) {
                let columns = match columns {
                    Component::Own(columns) => columns,
                    Component::Row(row) => &by.rows[*row].columns,
                    Component::Same(_) => return None,
                };
                for (term, column) in columns.iter::<FOURS>() {
                    let (input, _) = by.inputs.iter().find(|(_, end)| term < *end)?;
                    let added = |row: &Row<P, FOURS>| angles[by.waves[term]] * added(row);
                    match *input {
                        Input::Displacement(_) => flow[0] += added(&poly::fours(path, column)),
                        Input::Stretch(_) => flow[0] += dot(&c.direction, &[1.0]) * added(&poly::fours(path, column)),
                        Input::Velocity(_) => flow[1] += added(&poly::fours(path, column)),
                        Input::Load | Input::Forcing | Input::Cosine(_) | Input::Sine(_) => {}
                    }
                }
            }
            let count = columns.count;
            for l in 0..count {
                let [q, v] = [columns.values[l], columns.values[count + l]];
                columns.values[l] = flow[0][0] * q + flow[0][1] * v;
                columns.values[count + l] = flow[1][0] * q + flow[1][1] * v;
            }
        }
        let mut carried = f64::NAN;
        if fall.is_none() && !start.stretch.is_nan() {
            let stretch = start.stretch + added(&deflection.0);
            carried = motion.parts[0].kept(stretch, s.deflection_size(c, &after));
        }
        Some(LeapEnd {
            time,
            x: after,
            falls: fall.map(|fall| (numbers[fall.index], fall.error)),
            is_bound: fall.is_none() && bound <= part,
            carried,
        })
    }
}
