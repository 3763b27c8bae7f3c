//! Forces of bearings.

use std::ops::ControlFlow;

use super::{
    extent::Extent,
    piece::{Piece, Polynomial, measured_parts},
    report::{BearingForce, BearingReport},
    sum::Sum,
    track::Spread,
};
use crate::{
    engine::Observer,
    hybrid::{Clock, HybridSystem, Instant, Mode, StepQuantity},
    integrate::DenseStep,
    poly::MAX_DEGREE,
    system::{Bearing, BearingSpring, Structure},
};

/// Measures the force of every bearing on its support, `k s + c ṡ` in each of its directions with the stretch `s = d·q`.
#[derive(Clone, Debug)]
pub struct Bearings<'s> {
    bearings: &'s [Bearing],
    clock: Clock,
    from: Option<Instant>,
    piece: Piece,
    /// Components of the state in the forces, and their rows.
    state: Vec<(usize, Polynomial)>,
    square: Polynomial,
    time: Sum,
    tracks: Vec<Track>,
}

#[derive(Clone, Debug)]
struct Track {
    directions: Vec<Direction>,
    /// Range of the square of the absolute force.
    square: Extent,
}

#[derive(Clone, Debug, Default)]
struct Direction {
    /// Components of the state, by their places among the stored ones, and the factors of the force.
    terms: Vec<(usize, f64)>,
    /// Force on a piece.
    row: Polynomial,
    spread: Spread,
    extent: Extent,
}

impl<'s> Bearings<'s> {
    /// Measures from `from` on, by default from the start.
    #[must_use]
    pub fn new(structure: &'s Structure, from: Option<Instant>) -> Self {
        let clock = *structure.clock();
        let bearings = &structure.spec().bearings[..];
        let mut state: Vec<(usize, Polynomial)> = Vec::new();
        let mut direction = |spring: &BearingSpring| {
            let n = spring.direction.len();
            let moved = spring.direction.iter().enumerate().filter(|(_, d)| **d != 0.0);
            let factors = moved.flat_map(|(i, d)| [(i, spring.stiffness * d), (n + i, spring.damping * d)]);
            let term = |(i, factor): (usize, f64)| {
                let place = state.iter().position(|(other, _)| *other == i).unwrap_or_else(|| {
                    state.push((i, Polynomial::new()));
                    state.len() - 1
                });
                (place, factor)
            };
            Direction {
                terms: factors.filter(|(_, factor)| *factor != 0.0).map(term).collect(),
                ..Direction::default()
            }
        };
        let track = |bearing: &Bearing| Track {
            directions: bearing.springs.iter().map(&mut direction).collect(),
            square: Extent::default(),
        };
        let tracks = bearings.iter().map(track).collect();
        Self {
            bearings,
            clock,
            from,
            piece: Piece::new(clock, structure.dim()),
            state,
            square: Polynomial::new(),
            time: Sum::default(),
            tracks,
        }
    }

    /// Returns the measures so far; empty before the measured time begins.
    #[must_use]
    pub fn reports(&self) -> Vec<BearingReport> {
        let time = self.time.value();
        if time <= 0.0 {
            return Vec::new();
        }
        let report = |(bearing, track): (&Bearing, &Track)| {
            let force = |(spring, direction): (&BearingSpring, &Direction)| BearingForce {
                direction: spring.name.to_owned(),
                mean: direction.spread.mean(time),
                deviation: direction.spread.deviation(time),
                min: direction.extent.smallest,
                max: direction.extent.largest,
            };
            let directions: Vec<BearingForce> = bearing.springs.iter().zip(&track.directions).map(force).collect();
            let size = |part: fn(&BearingForce) -> f64| {
                directions.iter().fold(0.0, |size, force| libm::hypot(size, part(force)))
            };
            BearingReport {
                name: bearing.name.clone(),
                force_mean: size(|force| force.mean),
                force_deviation: size(|force| force.deviation),
                force_max: track.square.largest.sqrt(),
                directions,
            }
        };
        self.bearings.iter().zip(&self.tracks).map(report).collect()
    }
}

impl Observer for Bearings<'_> {
    fn observed_from(&self) -> Instant {
        if self.tracks.is_empty() { Instant::LAST } else { self.from.unwrap_or(Instant::FIRST) }
    }

    fn step(&mut self, _: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let Self { piece, state, square, tracks, .. } = self;
        if tracks.is_empty() {
            return ControlFlow::Continue(());
        }
        for (low, high, is_measured) in measured_parts(&self.clock, self.from, step, until) {
            if !is_measured {
                continue;
            }
            piece.cut(step, low, high);
            self.time.add(piece.length);
            for (i, row) in &mut *state {
                piece.rows(step, [StepQuantity::State(*i)], [row], |_, x, _| [x[*i]]);
            }
            for track in &mut *tracks {
                // Bound of the square of the absolute force.
                let mut bound = 0.0;
                for Direction { terms, row, spread, extent } in &mut track.directions {
                    row.clear();
                    for (place, factor) in terms {
                        let part = &state[*place].1;
                        row.resize(row.len().max(part.len()), 0.0);
                        row.iter_mut().zip(part).for_each(|(sum, c)| *sum += *factor * c);
                    }
                    Extent::extend([extent], row);
                    spread.take(piece, row);
                    bound += row.iter().map(|c| c.abs()).sum::<f64>().powi(2);
                }
                if bound > track.square.largest {
                    square.clear();
                    for Direction { row, .. } in &track.directions {
                        square.resize(square.len().max(2 * row.len() - 1), 0.0);
                        for (i, a) in row.iter().enumerate() {
                            square[i..].iter_mut().zip(row).for_each(|(sum, b)| *sum += a * b);
                        }
                    }
                    // Products of such high orders are far below rounding: a series ends at the order of its terms.
                    square.truncate(MAX_DEGREE + 1);
                    Extent::extend([&mut track.square], square);
                }
            }
        }
        ControlFlow::Continue(())
    }
}
