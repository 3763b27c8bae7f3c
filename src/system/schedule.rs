//! Known switching times of a stiffness, stored as instants without a root search.

use std::collections::HashMap;

use crate::{
    gear::{Piece, Stiffness},
    hybrid::{Clock, Instant, Wide},
};

/// A stiffness schedule with its switching instants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Schedule {
    /// Repeats with the clock, every `cycles` cycles. The starts of the pieces are phases of the clock, for all repetitions that fit; the
    /// cycle offset of the first start is 0 or −1.
    Locked { cycles: i64, starts: Vec<Instant>, values: Vec<f64>, slopes: Vec<f64> },
    /// Repeats with an independent period.
    Own { period: f64, origin: f64, starts: Vec<f64>, values: Vec<f64>, slopes: Vec<f64> },
    /// Switches at listed times to the pieces of these `numbers`, one more than times.
    Listed { times: Vec<Instant>, numbers: Vec<u32>, values: Vec<f64>, slopes: Vec<f64> },
}

/// Relative difference of two known times below which they are one instant, in units in the last place of the phase.
const TIE: f64 = 8.0 * f64::EPSILON;

/// Returns the cycles of a clock and the repetitions in them, if the period is a whole fraction or a multiple of that of the clock, to
/// rounding. Such a schedule has the same phases in every cycle; any other uses time.
fn ratio(clock: f64, period: f64) -> Option<(i64, i64)> {
    let (fraction, multiple) = ((clock / period).round(), (period / clock).round());
    let is = |n: f64, part: f64, whole: f64| {
        (1.0..=MOST).contains(&n) && (n * part - whole).abs() <= 4.0 * f64::EPSILON * whole
    };
    if is(fraction, period, clock) {
        Some((1, fraction as i64))
    } else {
        is(multiple, clock, period).then_some((multiple as i64, 1))
    }
}

/// Largest number of periods of a clock in a common cycle.
const MOST: f64 = super::common::MOST as f64;

impl Schedule {
    pub fn new(stiffness: &Stiffness, clock: &Clock) -> Self {
        match stiffness {
            Stiffness::Periodic { period, origin, pieces } => {
                let values = pieces.iter().map(|p| p.value).collect();
                let slopes = pieces.iter().map(|p| p.slope).collect();
                match clock.period().and_then(|t| Some((t, ratio(t.hi, *period)?))) {
                    Some((t, (cycles, repetitions))) => {
                        let scale = cycles as f64 / repetitions as f64;
                        let start = |r: i64, p: &Piece| {
                            let phase = Wide::from(*origin) + t * ((r as f64 + p.start) * scale);
                            clock.advance(clock.instant(phase.hi), phase.lo)
                        };
                        let starts = (0..repetitions).flat_map(|r| pieces.iter().map(move |p| start(r, p))).collect();
                        Self::Locked { cycles, starts, values, slopes }
                    }
                    _ => {
                        let starts = pieces.iter().map(|p| p.start).collect();
                        Self::Own { period: *period, origin: *origin, starts, values, slopes }
                    }
                }
            }
            Stiffness::Listed { times, values, slopes } => {
                let instant = |[time, rest]: &[f64; 2]| clock.advance(clock.instant(*time), *rest);
                Self::listed(times.iter().map(instant).collect(), values, slopes)
            }
            Stiffness::Constant(value) | Stiffness::Harmonic { mean: value, .. } => {
                Self::listed(Vec::new(), &[*value], &[0.0])
            }
        }
    }

    /// Returns a schedule of pieces between listed times. Pieces with the same value and no slope are one piece.
    fn listed(times: Vec<Instant>, of: &[f64], rates: &[f64]) -> Self {
        let (mut numbers, mut values, mut slopes) = (Vec::new(), Vec::new(), Vec::new());
        let mut known = HashMap::new();
        for (value, slope) in of.iter().zip(rates) {
            let next = values.len() as u32;
            let number = if *slope == 0.0 { *known.entry(value.to_bits()).or_insert(next) } else { next };
            if number == next {
                values.push(*value);
                slopes.push(*slope);
            }
            numbers.push(number);
        }
        Self::Listed { times, numbers, values, slopes }
    }

    /// Returns the number of piece starts in one repetition.
    fn starts(&self) -> usize {
        match self {
            Self::Locked { starts, .. } => starts.len(),
            Self::Own { starts, .. } => starts.len(),
            Self::Listed { times, .. } => times.len(),
        }
    }

    /// Returns start number `i` of repetition `k`.
    #[inline]
    fn start(&self, clock: &Clock, k: i64, i: usize) -> Instant {
        match self {
            Self::Locked { cycles, starts, .. } => Instant { cycle: starts[i].cycle + k * cycles, ..starts[i] },
            Self::Own { period, origin, starts, .. } => {
                let t = Wide::product(*period, k as f64) + Wide::product(*period, starts[i]) + (*origin).into();
                clock.advance(clock.instant(t.hi), t.lo)
            }
            Self::Listed { times, .. } => times[i],
        }
    }

    /// Returns the repetition that contains `at`, or a neighbour of it.
    fn repetition(&self, clock: &Clock, at: Instant) -> i64 {
        match self {
            // The usual case is one cycle, and a division is slow.
            Self::Locked { cycles: 1, starts, .. } => at.cycle - starts[0].cycle,
            Self::Locked { cycles, starts, .. } => (at.cycle - starts[0].cycle).div_euclid(*cycles),
            Self::Own { period, origin, .. } => ((clock.time(at).hi - origin) / period).floor() as i64,
            Self::Listed { .. } => 0,
        }
    }

    /// Returns repetition and index of the last start not after `late`; for listed times the number of times not after it.
    #[inline]
    fn last(&self, clock: &Clock, late: Instant) -> (i64, usize) {
        let most = match self {
            Self::Listed { times, .. } => return (0, times.partition_point(|t| *t <= late)),
            Self::Locked { .. } => self.repetition(clock, late),
            // The quotient is rounded, up too.
            Self::Own { .. } => self.repetition(clock, late) + 1,
        };
        let is_past = |k: i64, i: usize| self.start(clock, k, i) <= late;
        let k = (most - 1..=most).rev().find(|k| is_past(*k, 0)).unwrap_or(most - 2);
        // Number of starts after the first one that are not after `late`: few in a repetition, or thousands.
        let [mut past, mut after] = [0, self.starts()];
        while after - past > 1 {
            let middle = past.midpoint(after);
            *if is_past(k, middle) { &mut past } else { &mut after } = middle;
        }
        (k, past)
    }

    /// Returns the last start of piece `number` that is not after `late`, in the form of [`last`](Self::last).
    #[inline]
    fn last_of(&self, clock: &Clock, late: Instant, number: u32) -> (i64, usize) {
        let (mut k, mut i) = self.last(clock, late);
        match self {
            Self::Listed { numbers, .. } => i = numbers[..=i].iter().rposition(|own| *own == number).unwrap_or(0),
            Self::Locked { values, .. } | Self::Own { values, .. } => {
                let count = values.len();
                // The pieces of one repetition are consecutive.
                for _ in 1..count {
                    if (i % count) as u32 == number {
                        break;
                    }
                    (k, i) = if i > 0 { (k, i - 1) } else { (k - 1, self.starts() - 1) };
                }
            }
        }
        (k, i)
    }

    /// Returns the instant of a start given by `last`; the first piece of listed times has none.
    #[inline]
    fn start_of(&self, clock: &Clock, (k, i): (i64, usize)) -> Option<Instant> {
        match self {
            Self::Listed { times, .. } => times.get(i.checked_sub(1)?).copied(),
            _ => Some(self.start(clock, k, i)),
        }
    }

    /// Returns the piece in force right after `at`, and the time since its start, s.
    pub fn piece(&self, clock: &Clock, at: Instant) -> (u32, f64) {
        let (k, i) = self.last(clock, late(clock, at));
        let number = match self {
            Self::Listed { numbers, .. } => numbers[i],
            Self::Locked { values, .. } | Self::Own { values, .. } => (i % values.len()) as u32,
        };
        (number, self.start_of(clock, (k, i)).map_or(0.0, |start| clock.between(start, at)))
    }

    /// Returns the time since piece `number` last started, s. Unlike [`piece`](Self::piece) it is valid up to and at the end of the piece,
    /// where the next one starts.
    pub fn elapsed(&self, clock: &Clock, at: Instant, number: u32) -> f64 {
        let last = self.last_of(clock, late(clock, at), number);
        self.start_of(clock, last).map_or(0.0, |start| clock.between(start, at))
    }

    /// Returns the start of piece `number` that is nearest to `at`.
    pub fn start_near(&self, clock: &Clock, at: Instant, number: u32) -> Option<Instant> {
        let starts: Vec<Instant> = match self {
            Self::Listed { times, numbers, .. } => {
                let starts = times.iter().zip(&numbers[1..]);
                starts.filter(|(_, own)| **own == number).map(|(time, _)| *time).collect()
            }
            Self::Locked { values, .. } | Self::Own { values, .. } => {
                let (k, i) = self.last_of(clock, at, number);
                let (next, all) = (i + values.len(), self.starts());
                vec![self.start(clock, k, i), self.start(clock, k + (next / all) as i64, next % all)]
            }
        };
        let far = |start: Instant| (clock.between(start, at).abs(), start);
        starts.into_iter().map(far).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, start)| start)
    }

    /// Returns the end of piece `number`. `late` is the result of [`late()`] for the present instant; the end is before it if the
    /// piece is over.
    pub fn end(&self, clock: &Clock, late: Instant, number: u32) -> Option<Instant> {
        let (k, i) = self.last_of(clock, late, number);
        match self {
            Self::Listed { times, .. } => times.get(i).copied(),
            _ if i + 1 < self.starts() => Some(self.start(clock, k, i + 1)),
            _ => Some(self.start(clock, k + 1, 0)),
        }
    }

    /// Returns the value at the start and the slope of a piece.
    pub fn law(&self, piece: u32) -> (f64, f64) {
        match self {
            Self::Locked { values, slopes, .. }
            | Self::Own { values, slopes, .. }
            | Self::Listed { values, slopes, .. } => (values[piece as usize], slopes[piece as usize]),
        }
    }
}

/// The pieces of all schedules of a train that are in force at an instant, and their ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct PiecesInForce {
    /// Number and end of the piece of each contact; zero and `None` without a schedule.
    pieces: Vec<(u32, Option<Instant>)>,
    /// First of the ends.
    first: Option<Instant>,
}

/// Time to the first end of a piece, relative to the period, above which no tie can be near.
const CLEAR: f64 = 1e-12;

impl PiecesInForce {
    /// Begins at the instant `at`, which may be earlier.
    pub fn begin<'a>(&mut self, clock: &Clock, schedules: impl Iterator<Item = Option<&'a Schedule>>, at: Instant) {
        self.pieces.clear();
        self.move_to(clock, schedules, at);
    }

    /// Moves on to the instant `at`, no earlier than the last one. Each contact has its schedule, if any.
    #[inline]
    pub fn move_to<'a>(&mut self, clock: &Clock, schedules: impl Iterator<Item = Option<&'a Schedule>>, at: Instant) {
        let is_known = !self.pieces.is_empty();
        let period = clock.period().map_or(0.0, |t| t.hi);
        if is_known && self.first.is_none_or(|first| clock.roughly(at, first) > CLEAR * period.max(at.phase.hi.abs())) {
            return;
        }
        let late = late(clock, at);
        for (j, schedule) in schedules.enumerate() {
            if !is_known {
                self.pieces.push((0, None));
            }
            let (number, end) = &mut self.pieces[j];
            let Some(schedule) = schedule else { continue };
            if !is_known || end.is_some_and(|end| end <= late) {
                *number = schedule.piece(clock, at).0;
                *end = schedule.end(clock, late, *number);
            }
        }
        self.first = self.pieces.iter().filter_map(|(_, end)| *end).reduce(|a, b| if b < a { b } else { a });
    }

    /// Returns the number of the piece of contact `j`.
    pub fn number(&self, j: usize) -> u32 {
        self.pieces[j].0
    }

    /// Returns the first end of the pieces of `contacts`.
    #[inline]
    pub fn first_end(&self, contacts: &[usize]) -> Option<Instant> {
        let ends = contacts.iter().filter_map(|j| self.pieces[*j].1);
        ends.reduce(|first, end| if end < first { end } else { first })
    }
}

/// Returns the last instant that cannot be distinguished from `at`.
pub(super) fn late(clock: &Clock, at: Instant) -> Instant {
    clock.advance(at, TIE * at.phase.hi.abs().max(clock.period().map_or(0.0, |t| t.hi)))
}

#[cfg(test)]
#[path = "../../tests/unit/schedule.rs"]
mod tests;
