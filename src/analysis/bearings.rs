//! Forces of bearings.

use std::ops::ControlFlow;

use super::{
    extent::Extent,
    piece::{Piece, Row, measured_parts},
    report::{BearingForce, BearingReport},
    sum::Sum,
    track::Spread,
};
use crate::{
    engine::Observer,
    hybrid::{Clock, HybridSystem, Instant, Mode},
    integrate::DenseStep,
    system::{Bearing, BearingSpring, Structure},
};

/// Measures the force of every bearing, `k s + c ṡ` in each of its directions with the stretch `s = d·q`: of the body on what carries it.
#[derive(Clone, Debug)]
pub struct Bearings<'s> {
    bearings: &'s [Bearing],
    clock: Clock,
    from: Option<Instant>,
    piece: Piece,
    row: Row,
    square: Row,
    time: Sum,
    tracks: Vec<Track>,
}

#[derive(Clone, Debug)]
struct Track {
    directions: Vec<(Spread, Extent)>,
    /// Of the square of the size.
    square: Extent,
}

impl<'s> Bearings<'s> {
    /// Measures from `from` on; from the start, if none.
    #[must_use]
    pub fn new(structure: &'s Structure, from: Option<Instant>) -> Self {
        let clock = *structure.clock();
        let bearings = &structure.spec().bearings[..];
        let track = |bearing: &Bearing| Track {
            directions: vec![Default::default(); bearing.springs.len()],
            square: Extent::default(),
        };
        Self {
            bearings,
            clock,
            from,
            piece: Piece::new(clock, structure.dim()),
            row: Row::new(),
            square: Row::new(),
            time: Sum::default(),
            tracks: bearings.iter().map(track).collect(),
        }
    }

    /// The measures so far; empty before the measured time begins.
    #[must_use]
    pub fn reports(&self) -> Vec<BearingReport> {
        let time = self.time.value();
        if time <= 0.0 {
            return Vec::new();
        }
        let report = |(bearing, track): (&Bearing, &Track)| {
            let force = |(spring, (spread, extent)): (&BearingSpring, &(Spread, Extent))| BearingForce {
                direction: spring.name.to_owned(),
                mean: spread.mean(time),
                deviation: spread.deviation(time),
                min: extent.smallest,
                max: extent.largest,
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
    fn step(&mut self, _: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let Self { bearings, piece, row, square, tracks, .. } = self;
        if bearings.is_empty() {
            return ControlFlow::Continue(());
        }
        for (low, high, is_measured) in measured_parts(&self.clock, self.from, step, until) {
            if !is_measured {
                continue;
            }
            piece.cut(step, low, high);
            self.time.add(piece.length);
            for (bearing, track) in bearings.iter().zip(&mut *tracks) {
                square.clear();
                for (spring, (spread, extent)) in bearing.springs.iter().zip(&mut track.directions) {
                    piece.interpolate(step, [&mut *row], |_, x, _| [spring.force(x)]);
                    Extent::extend([extent], row);
                    spread.take(piece, row);
                    square.resize(2 * row.len() - 1, 0.0);
                    for (i, a) in row.iter().enumerate() {
                        row.iter().enumerate().for_each(|(j, b)| square[i + j] += a * b);
                    }
                }
                Extent::extend([&mut track.square], square);
            }
        }
        ControlFlow::Continue(())
    }
}
