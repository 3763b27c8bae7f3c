//! Known switching times of a stiffness: kept as instants, never root-found.

use crate::{
    gear::Stiffness,
    hybrid::{Clock, Instant, Wide},
};

/// A stiffness schedule with its switching instants.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Schedule {
    /// Repeats with the clock: piece starts as phases of the clock, the first piece's cycle offset 0 or −1.
    Locked { starts: Vec<Instant>, values: Vec<f64>, slopes: Vec<f64> },
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

impl Schedule {
    pub fn new(stiffness: &Stiffness, clock: &Clock) -> Self {
        match stiffness {
            Stiffness::Periodic { period, origin, pieces } => {
                let values = pieces.iter().map(|p| p.value).collect();
                let slopes = pieces.iter().map(|p| p.slope).collect();
                match clock.period() {
                    Some(t) if (t.hi - period).abs() <= 4.0 * f64::EPSILON * t.hi => {
                        let starts = pieces
                            .iter()
                            .map(|p| {
                                let phase = Wide::from(*origin) + t * p.start;
                                clock.advance(clock.instant(phase.hi), phase.lo)
                            })
                            .collect();
                        Self::Locked { starts, values, slopes }
                    }
                    _ => {
                        let starts = pieces.iter().map(|p| p.start).collect();
                        Self::Own { period: *period, origin: *origin, starts, values, slopes }
                    }
                }
            }
            Stiffness::Switched { times, levels } => {
                Self::Listed { times: times.iter().map(|t| clock.instant(*t)).collect(), levels: *levels }
            }
            Stiffness::Constant(k) => Self::Listed { times: Vec::new(), levels: [*k; 2] },
            Stiffness::Harmonic { mean, .. } => Self::Listed { times: Vec::new(), levels: [*mean; 2] },
        }
    }

    pub fn is_piecewise_constant(&self) -> bool {
        match self {
            Self::Locked { slopes, .. } | Self::Own { slopes, .. } => slopes.iter().all(|s| *s == 0.0),
            Self::Listed { .. } => true,
        }
    }

    /// The start of piece `i` in repetition `k`.
    fn start(&self, clock: &Clock, k: i64, i: usize) -> Instant {
        match self {
            Self::Locked { starts, .. } => Instant { cycle: starts[i].cycle + k, ..starts[i] },
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
            Self::Locked { starts, .. } => at.cycle - starts[0].cycle,
            Self::Own { period, origin, .. } => ((clock.time(at).hi - origin) / period).floor() as i64,
            Self::Listed { .. } => 0,
        }
    }

    /// Visits the piece starts around `at`: `(piece, start)` in rising order.
    fn around(&self, clock: &Clock, at: Instant, mut visit: impl FnMut(u32, Instant)) {
        match self {
            Self::Listed { times, .. } => {
                let i = times.partition_point(|t| !after(*t, at));
                for (j, time) in times.iter().enumerate().take(i + 2).skip(i.saturating_sub(1)) {
                    visit((j as u32 + 1) & 1, *time);
                }
            }
            Self::Locked { values, .. } | Self::Own { values, .. } => {
                let k = self.repetition(clock, at);
                for r in k - 1..=k + 1 {
                    for i in 0..values.len() {
                        visit(i as u32, self.start(clock, r, i));
                    }
                }
            }
        }
    }

    /// The piece in force right after `at`, and the time since it started, s.
    pub fn piece(&self, clock: &Clock, at: Instant) -> (u32, f64) {
        let late = tie(clock, at);
        let mut found = (0, 0.0);
        self.around(clock, at, |piece, start| {
            if !after(start, late) {
                found = (piece, clock.between(start, at));
            }
        });
        found
    }

    /// The time since piece `number` last started, s. Unlike [`piece`](Self::piece) it holds up to and at the piece's
    /// end, where the next one starts.
    pub fn elapsed(&self, clock: &Clock, at: Instant, number: u32) -> f64 {
        let late = tie(clock, at);
        let mut found = 0.0;
        self.around(clock, at, |piece, start| {
            if piece == number && !after(start, late) {
                found = clock.between(start, at);
            }
        });
        found
    }

    /// The next piece start strictly after `at`.
    pub fn next(&self, clock: &Clock, at: Instant) -> Option<Instant> {
        let late = tie(clock, at);
        let mut found: Option<Instant> = None;
        self.around(clock, at, |_, start| {
            if after(start, late) && found.is_none_or(|f| after(f, start)) {
                found = Some(start);
            }
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
