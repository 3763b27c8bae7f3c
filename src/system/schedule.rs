//! Known switching times of a stiffness: kept as instants, never root-found.

use crate::{
    gear::{Piece, Stiffness},
    hybrid::{Clock, Instant, Wide},
};

/// A stiffness schedule with its switching instants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Schedule {
    /// Repeats with the clock, every so many `cycles`: the starts of the pieces in them as phases of the clock, of as many
    /// repetitions as fit, the first one's cycle offset 0 or −1.
    Locked { cycles: i64, starts: Vec<Instant>, values: Vec<f64>, slopes: Vec<f64> },
    /// Repeats with a period of its own.
    Own { period: f64, origin: f64, starts: Vec<f64>, values: Vec<f64>, slopes: Vec<f64> },
    /// Alternates at listed times.
    Listed { times: Vec<Instant>, levels: [f64; 2] },
}

/// Order of instants.
fn after(a: Instant, b: Instant) -> bool {
    (a.cycle, a.phase.hi, a.phase.lo) > (b.cycle, b.phase.hi, b.phase.lo)
}

/// Two known times this close (relative to the phase, in units in the last place) are one instant.
const TIE: f64 = 8.0 * f64::EPSILON;

/// Cycles of a clock, and repetitions in them, of a period that is a whole fraction of the clock's or a multiple of it, to
/// rounding. Such a schedule keeps its phases in every cycle; any other goes by time.
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

/// The largest such number looked for.
const MOST: f64 = 64.0;

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
            Stiffness::Switched { times, levels } => {
                let instant = |[time, rest]: &[f64; 2]| clock.advance(clock.instant(*time), *rest);
                Self::Listed { times: times.iter().map(instant).collect(), levels: *levels }
            }
            Stiffness::Constant(k) => Self::Listed { times: Vec::new(), levels: [*k; 2] },
            Stiffness::Harmonic { mean, .. } => Self::Listed { times: Vec::new(), levels: [*mean; 2] },
        }
    }

    /// Piece starts in one repetition.
    fn starts(&self) -> usize {
        match self {
            Self::Locked { starts, .. } => starts.len(),
            Self::Own { starts, .. } => starts.len(),
            Self::Listed { times, .. } => times.len(),
        }
    }

    /// Start number `i` of repetition `k`.
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

    /// The repetition that contains `at`, or a neighbour of it.
    fn repetition(&self, clock: &Clock, at: Instant) -> i64 {
        match self {
            // Most often one, and a division takes its time.
            Self::Locked { cycles: 1, starts, .. } => at.cycle - starts[0].cycle,
            Self::Locked { cycles, starts, .. } => (at.cycle - starts[0].cycle).div_euclid(*cycles),
            Self::Own { period, origin, .. } => ((clock.time(at).hi - origin) / period).floor() as i64,
            Self::Listed { .. } => 0,
        }
    }

    /// Visits the piece starts around `at`: `(piece, start)` in rising order, as long as `visit` goes on.
    fn around(&self, clock: &Clock, at: Instant, mut visit: impl FnMut(u32, Instant) -> bool) {
        match self {
            Self::Listed { times, .. } => {
                let i = times.partition_point(|t| !after(*t, at));
                let near = times.iter().enumerate().take(i + 2).skip(i.saturating_sub(1));
                near.take_while(|(j, time)| visit((*j as u32 + 1) & 1, **time)).for_each(drop);
            }
            Self::Locked { values, .. } | Self::Own { values, .. } => {
                let (k, starts) = (self.repetition(clock, at), self.starts());
                for r in k - 1..=k + 1 {
                    for i in 0..starts {
                        if !visit((i % values.len()) as u32, self.start(clock, r, i)) {
                            return;
                        }
                    }
                }
            }
        }
    }

    /// The piece in force right after `at`, and the time since it started, s.
    pub fn piece(&self, clock: &Clock, at: Instant) -> (u32, f64) {
        let late = tie(clock, at);
        let mut found = (0, None);
        self.around(clock, at, |piece, start| {
            let is_past = !after(start, late);
            if is_past {
                found = (piece, Some(start));
            }
            is_past
        });
        (found.0, found.1.map_or(0.0, |start| clock.between(start, at)))
    }

    /// The time since piece `number` last started, s. Unlike [`piece`](Self::piece) it holds up to and at the piece's
    /// end, where the next one starts.
    pub fn elapsed(&self, clock: &Clock, at: Instant, number: u32) -> f64 {
        let late = tie(clock, at);
        let mut found = 0.0;
        self.around(clock, at, |piece, start| {
            let is_past = !after(start, late);
            if piece == number && is_past {
                found = clock.between(start, at);
            }
            is_past
        });
        found
    }

    /// The start of piece `number` that is nearest to `at`.
    pub fn start_near(&self, clock: &Clock, at: Instant, number: u32) -> Option<Instant> {
        let mut found: Option<(f64, Instant)> = None;
        self.around(clock, at, |piece, start| {
            let off = clock.between(start, at).abs();
            if piece == number && found.is_none_or(|(least, _)| off < least) {
                found = Some((off, start));
            }
            true
        });
        found.map(|(_, start)| start)
    }

    /// The end of piece `number`, in force at `at`. It is before `at` if the piece is over.
    pub fn end(&self, clock: &Clock, at: Instant, number: u32) -> Option<Instant> {
        let late = tie(clock, at);
        let mut found = None;
        self.around(clock, at, |piece, start| {
            let is_past = !after(start, late);
            if piece == number && is_past {
                found = None;
            } else if found.is_none() {
                found = Some(start);
            }
            is_past
        });
        found
    }

    /// Value at the start and slope of a piece.
    pub fn law(&self, piece: u32) -> (f64, f64) {
        match self {
            Self::Locked { values, slopes, .. } | Self::Own { values, slopes, .. } => {
                (values[piece as usize], slopes[piece as usize])
            }
            Self::Listed { levels, .. } => (levels[piece as usize], 0.0),
        }
    }
}

fn tie(clock: &Clock, at: Instant) -> Instant {
    clock.advance(at, TIE * at.phase.hi.abs().max(clock.period().map_or(0.0, |t| t.hi)))
}
