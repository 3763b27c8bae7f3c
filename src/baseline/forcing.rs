use super::Penalty;
use crate::{
    gear::{Harmonic, Piece, Stiffness},
    hybrid::{Clock, Instant},
};

/// One harmonic of a load, an error or a stiffness: number of its frequency, cosine and sine parts.
pub(super) type Wave = (usize, f64, f64);

/// A contact's stiffness as a function of time.
#[derive(Clone, Debug)]
pub(super) enum Spring {
    Constant(f64),
    Waves(f64, Vec<Wave>),
    Periodic { period: f64, origin: f64, pieces: Vec<Piece> },
    Switched { times: Vec<f64>, levels: [f64; 2] },
}

impl Spring {
    pub fn new(stiffness: &Stiffness, frequencies: &mut Vec<f64>) -> Self {
        match stiffness {
            Stiffness::Constant(k) => Self::Constant(*k),
            Stiffness::Harmonic { mean, harmonics } => {
                Self::Waves(*mean, harmonics.iter().map(|h| wave(h, *mean, frequencies)).collect())
            }
            Stiffness::Periodic { period, origin, pieces } => {
                Self::Periodic { period: *period, origin: *origin, pieces: pieces.clone() }
            }
            Stiffness::Switched { times, levels } => Self::Switched { times: times.clone(), levels: *levels },
        }
    }

    fn at(&self, t: f64, cosines: &[f64], sines: &[f64]) -> f64 {
        match self {
            Self::Constant(k) => *k,
            Self::Waves(mean, waves) => mean + sum(waves, cosines, sines),
            Self::Periodic { period, origin, pieces } => {
                let turns = (t - origin) / period;
                let u = turns - turns.floor();
                let i = pieces.iter().rposition(|p| p.start <= u);
                let piece = &pieces[i.unwrap_or(pieces.len() - 1)];
                let elapsed = u - piece.start + if i.is_none() { 1.0 } else { 0.0 };
                piece.value + piece.slope * elapsed * period
            }
            Self::Switched { times, levels } => levels[times.partition_point(|s| *s <= t) & 1],
        }
    }
}

/// The wave of `h`, scaled; its frequency is added to the list where it is new.
pub(super) fn wave(h: &Harmonic, scale: f64, frequencies: &mut Vec<f64>) -> Wave {
    let index = frequencies.iter().position(|f| *f == h.omega).unwrap_or_else(|| {
        frequencies.push(h.omega);
        frequencies.len() - 1
    });
    (index, scale * h.amplitude * h.phase.cos(), -scale * h.amplitude * h.phase.sin())
}

fn sum(waves: &[Wave], cosines: &[f64], sines: &[f64]) -> f64 {
    waves.iter().fold(0.0, |s, (i, c, d)| s + c * cosines[*i] + d * sines[*i])
}

/// What depends on time alone, at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Moment {
    /// The contacts.
    pub contacts: Vec<Forced>,
    /// Loads over M, m/s², `[n]`.
    pub load: Vec<f64>,
}

/// What depends on time alone at one contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Forced {
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Transmission error, m, and its rate, m/s.
    pub error: [f64; 2],
}

/// The forcing on a grid of equal strides.
///
/// Angles turn by complex rotation and are put right every [`FRESH`] strides, so a step costs no sine. Times are
/// products of whole numbers, never sums: a long run keeps its phase.
#[derive(Clone, Debug)]
pub(super) struct Forcing {
    clock: Clock,
    from: Instant,
    start: f64,
    stride: f64,
    index: u64,
    /// Time of the cosines and sines, s.
    t: f64,
    /// Frequency, and its number as a harmonic of the clock's.
    frequencies: Vec<(f64, Option<u32>)>,
    turns: Vec<(f64, f64)>,
    cosines: Vec<f64>,
    sines: Vec<f64>,
}

/// Strides between fresh angles: the rotations' rounding stays below 1e-14.
const FRESH: u64 = 32;

impl Forcing {
    pub fn new(model: &Penalty, from: Instant, stride: f64) -> Self {
        let clock = model.clock;
        let order = |w: f64| {
            let h = (w / clock.omega()).round();
            (clock.omega() > 0.0 && (1.0..1e6).contains(&h) && (h * clock.omega() - w).abs() <= f64::EPSILON * w)
                .then_some(h as u32)
        };
        let frequencies: Vec<_> = model.frequencies.iter().map(|w| (*w, order(*w))).collect();
        let turns = model.frequencies.iter().map(|w| (w * stride).sin_cos()).map(|(s, c)| (c, s)).collect();
        let count = frequencies.len();
        let mut forcing = Self {
            clock,
            from,
            start: clock.time(from).value(),
            stride,
            index: 0,
            t: 0.0,
            frequencies,
            turns,
            cosines: vec![0.0; count],
            sines: vec![0.0; count],
        };
        forcing.stand(forcing.from);
        forcing
    }

    /// Cosines and sines at any instant.
    fn stand(&mut self, at: Instant) {
        self.t = self.clock.time(at).value();
        for (i, (omega, order)) in self.frequencies.iter().enumerate() {
            (self.sines[i], self.cosines[i]) = self.clock.angle(*omega, *order, at).sin_cos();
        }
    }

    /// One stride on; the moment there.
    pub fn advance(&mut self, model: &Penalty, out: &mut Moment) {
        self.index += 1;
        if self.index.is_multiple_of(FRESH) {
            self.stand(self.clock.advance(self.from, self.index as f64 * self.stride));
        } else {
            for ((c, s), (turn_c, turn_s)) in self.cosines.iter_mut().zip(&mut self.sines).zip(&self.turns) {
                (*c, *s) = (*c * turn_c - *s * turn_s, *s * turn_c + *c * turn_s);
            }
        }
        self.t = self.start + self.index as f64 * self.stride;
        self.moment(model, out);
    }

    /// The moment at any instant, off the grid.
    #[cfg(feature = "diffsol")]
    pub fn at(&mut self, model: &Penalty, at: Instant, out: &mut Moment) {
        self.stand(at);
        self.moment(model, out);
    }

    /// The moment it stands at.
    pub fn moment(&self, model: &Penalty, out: &mut Moment) {
        let t = self.t;
        let (cosines, sines) = (&self.cosines[..], &self.sines[..]);
        for (c, forced) in model.contacts.iter().zip(&mut out.contacts) {
            forced.stiffness = c.spring.at(t, cosines, sines);
            forced.error = [c.error_offset + sum(&c.error, cosines, sines), sum(&c.error_rate, cosines, sines)];
        }
        // The constant part is in there from the start, and stays where there are no waves.
        for (number, (i, cosine, sine)) in model.load_waves.iter().enumerate() {
            let before = |k: usize, out: &[f64]| if number == 0 { model.load[k] } else { out[k] };
            for k in 0..model.n {
                out.load[k] = before(k, &out.load) + cosine[k] * cosines[*i] + sine[k] * sines[*i];
            }
        }
    }
}
