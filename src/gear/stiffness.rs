//! Mesh stiffness in time, k(t), N/m (N/mⁿ for a power law).

use super::Harmonic;

/// One piece of a periodic schedule: from `start` on, `k(t) = value + slope · (t − t_start)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Start of the piece, fraction of the period after the origin, `[0, 1)`.
    pub start: f64,
    /// Stiffness at the start, N/m.
    pub value: f64,
    /// Rate of change, N/(m s).
    pub slope: f64,
}

/// A stiffness schedule.
#[derive(Clone, Debug, PartialEq)]
pub enum Stiffness {
    /// `k(t) = k`.
    Constant(f64),
    /// `k(t) = mean · (1 + Σ a cos(ω t + φ))`, at least one harmonic.
    Harmonic {
        /// Mean stiffness.
        mean: f64,
        /// Harmonics, amplitudes relative to the mean.
        harmonics: Vec<Harmonic>,
    },
    /// Repeating pieces: rectangular (slopes zero) or trapezoidal. At most 8192 pieces; their starts are known switching times.
    Periodic {
        /// Period, s.
        period: f64,
        /// Time at which the first period starts, s.
        origin: f64,
        /// Pieces in rising order of their starts; the last one extends to the first of the next period.
        pieces: Vec<Piece>,
    },
    /// Pieces between listed times, once.
    Listed {
        /// Switching times, s, strictly rising. Each is a double and the remainder to the time, at most half a unit in the last place of
        /// the double.
        times: Vec<[f64; 2]>,
        /// Value before the first time, and at each time.
        values: Vec<f64>,
        /// Slopes, 1/s of the values; zero before the first time and after the last one.
        slopes: Vec<f64>,
    },
}

impl Stiffness {
    /// Returns the largest size of the values (a bound, attained for piecewise schedules).
    #[must_use]
    pub fn maximum(&self) -> f64 {
        match self {
            Self::Constant(k) => k.abs(),
            Self::Harmonic { mean, harmonics } => {
                mean.abs() * (1.0 + harmonics.iter().map(|h| h.amplitude.abs()).sum::<f64>())
            }
            Self::Periodic { period, pieces, .. } => (0..pieces.len())
                .map(|i| {
                    let p = pieces[i];
                    let end = pieces.get(i + 1).map_or(1.0 + pieces[0].start, |q| q.start);
                    p.value.abs().max((p.value + p.slope * (end - p.start) * period).abs())
                })
                .fold(0.0, f64::max),
            Self::Listed { times, values, slopes } => (0..values.len())
                .map(|i| {
                    let width = if i == 0 || i == times.len() { 0.0 } else { times[i][0] - times[i - 1][0] };
                    values[i].abs().max((values[i] + slopes[i] * width).abs())
                })
                .fold(0.0, f64::max),
        }
    }

    /// Value at time `t`, s.
    #[must_use]
    pub fn at(&self, t: f64) -> f64 {
        match self {
            Self::Constant(k) => *k,
            Self::Harmonic { mean, harmonics } => {
                let wave = |h: &Harmonic| h.amplitude * libm::cos(h.omega * t + h.phase);
                mean * (1.0 + harmonics.iter().map(wave).sum::<f64>())
            }
            Self::Periodic { period, origin, pieces } => {
                let turn = ((t - origin) / period).rem_euclid(1.0);
                // Before the first piece, the last piece of the previous period continues.
                let piece = pieces.iter().rev().find(|piece| piece.start <= turn).or(pieces.last());
                piece.map_or(0.0, |piece| piece.value + piece.slope * (turn - piece.start).rem_euclid(1.0) * period)
            }
            Self::Listed { times, values, slopes } => {
                let piece = times.partition_point(|[at, _]| *at <= t);
                values[piece] + if piece == 0 { 0.0 } else { slopes[piece] * (t - times[piece - 1][0]) }
            }
        }
    }

    /// Time average over a period; for listed times the middle between the least and the largest value.
    #[must_use]
    pub fn mean(&self) -> f64 {
        match self {
            Self::Constant(k) => *k,
            Self::Harmonic { mean, .. } => *mean,
            Self::Periodic { period, pieces, .. } => (0..pieces.len())
                .map(|i| {
                    let p = pieces[i];
                    let width = pieces.get(i + 1).map_or(1.0 + pieces[0].start, |q| q.start) - p.start;
                    width * (p.value + 0.5 * p.slope * width * period)
                })
                .sum(),
            Self::Listed { values, .. } => {
                let of = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).unwrap_or_default();
                0.5 * (of(f64::min) + of(f64::max))
            }
        }
    }

    /// Rectangular schedule: `high` while `frac((t − origin)/period) < duty`, else `low`.
    #[must_use]
    pub fn rectangular(high: f64, low: f64, period: f64, duty: f64, origin: f64) -> Self {
        Self::Periodic {
            period,
            origin,
            pieces: vec![Piece { start: 0.0, value: high, slope: 0.0 }, Piece { start: duty, value: low, slope: 0.0 }],
        }
    }

    /// Starts at `levels[0]` and alternates between the two levels at the listed times.
    #[must_use]
    pub fn switched(times: Vec<[f64; 2]>, levels: [f64; 2]) -> Self {
        let values: Vec<f64> = (0..=times.len()).map(|i| levels[i % 2]).collect();
        Self::Listed { times, slopes: vec![0.0; values.len()], values }
    }

    /// Returns the schedule with every stiffness multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Constant(k) => Self::Constant(factor * k),
            Self::Harmonic { mean, harmonics } => Self::Harmonic { mean: factor * mean, harmonics: harmonics.clone() },
            Self::Periodic { period, origin, pieces } => {
                let scaled = |p: &Piece| Piece { value: factor * p.value, slope: factor * p.slope, ..*p };
                Self::Periodic { period: *period, origin: *origin, pieces: pieces.iter().map(scaled).collect() }
            }
            Self::Listed { times, values, slopes } => {
                let scaled = |of: &[f64]| of.iter().map(|value| factor * value).collect();
                Self::Listed { times: times.clone(), values: scaled(values), slopes: scaled(slopes) }
            }
        }
    }
}
