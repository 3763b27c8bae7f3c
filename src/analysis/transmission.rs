//! Mean, RMS value and harmonics of the dynamic transmission error.

use std::{f64::consts::TAU, ops::ControlFlow};

use serde::Serialize;

use super::{
    extent::Extent,
    piece::{Piece, Polynomial, measured_parts},
    quadrature::Quadrature,
    sum::Sum,
};
use crate::{
    engine::Observer,
    hybrid::{Clock, ContactView, HybridSystem, Instant, Mode, StepQuantity},
    integrate::DenseStep,
};

/// Gauss nodes on a part of a step.
const NODES: usize = 16;
/// Largest angle, rad, of the highest harmonic on a part: the rule of 16 nodes is exact to degree 31, and its error for `exp(i 16 θ)` is
/// `16³² (16!)⁴/(33 (32!)³)` = 1e-16. With a power of θ in a row the error is larger.
const LARGEST_ANGLE: f64 = 16.0;

/// Measures the dynamic transmission error `gᵀq = δ + e` of contacts: its mean, the RMS value of its fluctuation, and its harmonics
///
/// ```text
/// c_m = 2/T ∫ gᵀq exp(−i m Ω t) dt,    Ω = 2π/period of the forcing,
/// ```
///
/// by integration of the steps' own polynomials from event to event: nothing is sampled, so higher orders do not alias.
#[derive(Clone, Debug)]
pub struct TransmissionError<'s, S: ?Sized> {
    system: &'s S,
    clock: Clock,
    from: Option<Instant>,
    rule: Quadrature,
    piece: Piece,
    row: Polynomial,
    /// Cosines and sines of the harmonics at the nodes.
    waves: Vec<[[f64; NODES]; 2]>,
    time: Sum,
    tracks: Vec<Track>,
}

#[derive(Clone, Debug)]
struct Track {
    contact: usize,
    /// First value. All sums are of differences from it, so a large mean costs no digits.
    origin: Option<f64>,
    sum: Sum,
    squares: Sum,
    extent: Extent,
    harmonics: Vec<[f64; 2]>,
}

/// Dynamic transmission error of one contact over a measured time.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TransmissionReport {
    /// Name of the contact.
    pub name: String,
    /// Mean, m.
    pub mean: f64,
    /// RMS value of the difference from the mean, m.
    pub rms: f64,
    /// Difference of the largest and smallest values, m.
    pub peak_to_peak: f64,
    /// Harmonics, m = 1, 2, …; none unless the measured time is a whole number of cycles.
    pub harmonics: Option<Vec<TransmissionHarmonic>>,
}

/// Harmonic `a cos(m Ω t + φ)` of a dynamic transmission error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TransmissionHarmonic {
    /// Order m: multiple of the forcing frequency.
    pub order: u32,
    /// Amplitude a, m.
    pub amplitude: f64,
    /// Phase φ, rad.
    pub phase: f64,
}

impl<'s, S: HybridSystem + ContactView + ?Sized> TransmissionError<'s, S> {
    /// Measures `contacts` from `from` on (by default from the start), with the harmonics 1 to `harmonics` of the forcing; without
    /// harmonics if the forcing has no period.
    #[must_use]
    pub fn new(
        system: &'s S,
        contacts: impl IntoIterator<Item = usize>,
        harmonics: usize,
        from: Option<Instant>,
    ) -> Self {
        let clock = *system.clock();
        let harmonics = if clock.period().is_some() { harmonics } else { 0 };
        let track = |contact| Track {
            contact,
            origin: None,
            sum: Sum::default(),
            squares: Sum::default(),
            extent: Extent::default(),
            harmonics: vec![[0.0; 2]; harmonics],
        };
        Self {
            system,
            clock,
            from,
            rule: Quadrature::gauss(NODES),
            piece: Piece::new(clock, system.dim()),
            row: Polynomial::new(),
            waves: vec![[[0.0; NODES]; 2]; harmonics],
            time: Sum::default(),
            tracks: contacts.into_iter().map(track).collect(),
        }
    }

    /// Returns the measures so far, in the order of the given contacts; empty before the measured time begins.
    #[must_use]
    pub fn reports(&self) -> Vec<TransmissionReport> {
        let time = self.time.value();
        let cycles = self.clock.period().map_or(0.0, |period| time / period.value());
        // Lengths of arcs are rounded to the time.
        let is_whole = cycles > 0.5 && (cycles - cycles.round()).abs() <= 1e-9 * cycles;
        let report = |track: &Track| {
            let mean = track.sum.value() / time;
            let harmonic = |([c, s], order): (&[f64; 2], u32)| TransmissionHarmonic {
                order,
                amplitude: 2.0 / time * libm::hypot(*c, *s),
                phase: libm::atan2(-s, *c),
            };
            Some(TransmissionReport {
                name: self.system.contact_name(track.contact).to_owned(),
                mean: track.origin? + mean,
                rms: (track.squares.value() / time - mean * mean).max(0.0).sqrt(),
                peak_to_peak: track.extent.largest - track.extent.smallest,
                harmonics: is_whole.then(|| track.harmonics.iter().zip(1..).map(harmonic).collect()),
            })
        };
        self.tracks.iter().filter_map(report).collect()
    }

    /// Returns cosine and sine of the fundamental at the nodes of the piece. In plain time the nodes are symmetric about its middle.
    fn fundamental(&self, step: &dyn DenseStep, low: f64, high: f64) -> [[f64; NODES]; 2] {
        let [mut cosines, mut sines] = [[0.0; NODES]; 2];
        let Some(period) = self.clock.period() else { return [cosines, sines] };
        let omega = TAU / period.value();
        let phase = |theta: f64| omega * (step.start().phase.value() + step.time(theta));
        if step.plain_span().is_some() {
            let (sin, cos) = libm::sincos(phase(low + 0.5 * (high - low)));
            for (i, node) in self.rule.nodes.iter().enumerate().take(NODES / 2) {
                let (s, c) = libm::sincos(omega * self.piece.length * (0.5 - node));
                let j = NODES - 1 - i;
                (cosines[i], sines[i]) = (cos * c + sin * s, sin * c - cos * s);
                (cosines[j], sines[j]) = (cos * c - sin * s, sin * c + cos * s);
            }
        } else {
            for (i, node) in self.rule.nodes.iter().enumerate() {
                (sines[i], cosines[i]) = libm::sincos(phase(low + (high - low) * node));
            }
        }
        [cosines, sines]
    }

    fn part(&mut self, step: &dyn DenseStep, low: f64, high: f64) {
        self.piece.cut(step, low, high);
        self.time.add(self.piece.length);
        let fundamental = self.fundamental(step, low, high);
        let mut wave = fundamental;
        for (m, waves) in self.waves.iter_mut().enumerate() {
            if m > 0 {
                let [cosines, sines] = &mut wave;
                for i in 0..NODES {
                    let (c, s) = (cosines[i], sines[i]);
                    cosines[i] = c * fundamental[0][i] - s * fundamental[1][i];
                    sines[i] = s * fundamental[0][i] + c * fundamental[1][i];
                }
            }
            *waves = wave;
        }
        let Self { system, rule, piece, row, waves, tracks, .. } = self;
        let mut weights = [0.0; NODES];
        piece.values(&rule.nodes, piece.rate(), &mut weights);
        weights.iter_mut().zip(&rule.weights).for_each(|(rate, weight)| *rate *= weight);
        for Track { contact, origin, sum, squares, extent, harmonics } in tracks {
            let j = *contact;
            piece.rows(step, [StepQuantity::Transmission(j)], [row], |_, x, _| [system.transmission(j, x)]);
            Extent::extend([&mut *extent], row);
            let mut values = [0.0; NODES];
            let start = *origin.get_or_insert(row.first().copied().unwrap_or(0.0));
            if let Some(first) = row.first_mut() {
                *first -= start;
            }
            piece.values(&rule.nodes, row, &mut values);
            let mut square = 0.0;
            let mut total = 0.0;
            for (value, weight) in values.iter_mut().zip(&weights) {
                square += weight * *value * *value;
                *value *= weight;
                total += *value;
            }
            sum.add(total);
            squares.add(square);
            for (harmonic, waves) in harmonics.iter_mut().zip(&*waves) {
                for (part, wave) in harmonic.iter_mut().zip(waves) {
                    *part += wave.iter().zip(&values).fold(0.0, |sum, (wave, value)| sum + wave * value);
                }
            }
        }
    }
}

impl<S: HybridSystem + ContactView + ?Sized> Observer for TransmissionError<'_, S> {
    fn observed_from(&self) -> Instant {
        self.from.unwrap_or(Instant::FIRST)
    }

    fn step(&mut self, _: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        for (low, high, is_measured) in measured_parts(&self.clock, self.from, step, until) {
            if !is_measured {
                continue;
            }
            let cycles = self.clock.period().map_or(0.0, |p| (step.time(high) - step.time(low)) / p.value());
            let parts = (TAU * cycles * self.waves.len() as f64 / LARGEST_ANGLE).ceil().max(1.0);
            let end = |i: f64| if i == parts { high } else { low + (high - low) * i / parts };
            // Exact: a step has fewer cycles than 2⁵³.
            (0..parts as u64).for_each(|i| self.part(step, end(i as f64), end((i + 1) as f64)));
        }
        ControlFlow::Continue(())
    }
}
