use super::Penalty;
use crate::{
    gear::{Harmonic, Stiffness},
    hybrid::{Clock, Instant},
};

/// One harmonic of a load, an error or a stiffness: index of its frequency, cosine and sine parts.
pub(super) type Wave = (usize, f64, f64);

/// Returns the wave of `h`, scaled; a new frequency is added to the list.
pub(super) fn wave(h: &Harmonic, scale: f64, frequencies: &mut Vec<f64>) -> Wave {
    let index = frequencies.iter().position(|f| *f == h.omega).unwrap_or_else(|| {
        frequencies.push(h.omega);
        frequencies.len() - 1
    });
    (index, scale * h.amplitude * libm::cos(h.phase), -scale * h.amplitude * libm::sin(h.phase))
}

/// Returns a stiffness at time `t`; `waves` are its harmonics.
fn stiffness(stiffness: &Stiffness, waves: &[Wave], t: f64, phasors: &[Phasor]) -> f64 {
    match stiffness {
        Stiffness::Harmonic { mean, .. } => mean + sum(waves, phasors),
        _ => stiffness.at(t),
    }
}

fn sum(waves: &[Wave], phasors: &[Phasor]) -> f64 {
    waves.iter().fold(0.0, |s, (i, c, d)| s + c * phasors[*i].cos + d * phasors[*i].sin)
}

/// One frequency of the forcing.
#[derive(Clone, Copy, Debug)]
struct Phasor {
    omega: f64,
    /// Order as a harmonic of the clock's frequency, if it is one.
    order: Option<u32>,
    cos: f64,
    sin: f64,
    /// Rotation of one step: cosine and sine of its angle.
    turn: (f64, f64),
}

/// Terms that depend on time alone, at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Moment {
    /// The contacts.
    pub contacts: Vec<ForcedContact>,
    /// Loads over M, m/s², `[n]`.
    pub load: Vec<f64>,
}

/// Terms of one contact that depend on time alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ForcedContact {
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Transmission error, m, and its rate, m/s.
    pub error: [f64; 2],
}

/// Forcing on a grid of equal strides.
///
/// Angles turn by complex rotation and are recomputed every [`FRESH`] steps, so a step needs no sine. Times are products of whole
/// numbers, never sums: a long run keeps its phase.
#[derive(Clone, Debug)]
pub(super) struct Forcing {
    clock: Clock,
    from: Instant,
    start: f64,
    step: f64,
    index: u64,
    /// Time of the cosines and sines, s.
    t: f64,
    phasors: Vec<Phasor>,
}

/// Strides between recomputed angles: the rounding of the rotations stays below 1e-14.
const FRESH: u64 = 32;

impl Forcing {
    pub fn new(model: &Penalty, from: Instant, step: f64) -> Self {
        let clock = model.clock;
        let order = |w: f64| {
            let h = (w / clock.omega()).round();
            (clock.omega() > 0.0 && (1.0..1e6).contains(&h) && (h * clock.omega() - w).abs() <= f64::EPSILON * w)
                .then_some(h as u32)
        };
        let phasor = |omega: &f64| {
            let (sin, cos) = libm::sincos(omega * step);
            Phasor { omega: *omega, order: order(*omega), cos: 1.0, sin: 0.0, turn: (cos, sin) }
        };
        let mut forcing = Self {
            clock,
            from,
            start: clock.time(from).value(),
            step,
            index: 0,
            t: 0.0,
            phasors: model.frequencies.iter().map(phasor).collect(),
        };
        forcing.turn_to(forcing.from);
        forcing
    }

    /// Sets the cosines and sines for any instant.
    fn turn_to(&mut self, at: Instant) {
        self.t = self.clock.time(at).value();
        for p in &mut self.phasors {
            (p.sin, p.cos) = self.clock.sincos(p.omega, p.order, at);
        }
    }

    /// Advances by one step, and computes the moment there.
    pub fn advance(&mut self, model: &Penalty, out: &mut Moment) {
        self.index += 1;
        if self.index.is_multiple_of(FRESH) {
            self.turn_to(self.clock.advance(self.from, self.index as f64 * self.step));
        } else {
            for Phasor { cos, sin, turn: (c, s), .. } in &mut self.phasors {
                (*cos, *sin) = (*cos * *c - *sin * *s, *sin * *c + *cos * *s);
            }
        }
        self.t = self.start + self.index as f64 * self.step;
        self.moment(model, out);
    }

    /// Computes the moment at any instant, off the grid.
    pub fn at(&mut self, model: &Penalty, at: Instant, out: &mut Moment) {
        self.turn_to(at);
        self.moment(model, out);
    }

    /// Computes the moment at the present instant.
    pub fn moment(&self, model: &Penalty, out: &mut Moment) {
        // Constant terms are in it from the start.
        for &j in &model.varying {
            let (c, forced) = (&model.contacts[j], &mut out.contacts[j]);
            forced.stiffness = stiffness(&c.stiffness, &c.stiffness_waves, self.t, &self.phasors);
            forced.error = [c.error_offset + sum(&c.error, &self.phasors), sum(&c.error_rate, &self.phasors)];
        }
        if model.load_waves.is_empty() && model.load_schedules.is_empty() {
            return;
        }
        out.load.copy_from_slice(&model.load);
        for (i, cosine, sine) in &model.load_waves {
            let Phasor { cos, sin, .. } = self.phasors[*i];
            out.load.iter_mut().zip(cosine.iter().zip(sine)).for_each(|(out, (c, s))| *out += c * cos + s * sin);
        }
        for (factor, accelerations) in &model.load_schedules {
            let factor = factor.at(self.t);
            out.load.iter_mut().zip(accelerations).for_each(|(out, a)| *out += factor * a);
        }
    }
}
