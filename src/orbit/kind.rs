//! The kind of a motion, decided by measure.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    Approach, Approached, Drift, Orbit, SectionMap,
    exponents::means,
    frame::Frame,
    search::{distance, sizes},
    section::Section,
};
use crate::{
    engine::{Engine, Observer, Outcome},
    simulation::SimulationError,
    task::Task,
};

/// What a motion is in the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// On a stable orbit.
    Periodic,
    /// On a torus: it never comes back, and its averages converge fast.
    QuasiPeriodic,
    /// Neighbours part, by an exponent that is above zero by more than three bands.
    Chaotic,
    /// Still on its way, or leaving for ever.
    Transient,
    /// None of the others by the cycles run.
    Undecided,
}

impl Kind {
    /// As files have it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Periodic => "periodic",
            Self::QuasiPeriodic => "quasi-periodic",
            Self::Chaotic => "chaotic",
            Self::Transient => "transient",
            Self::Undecided => "undecided",
        }
    }
}

/// What is known of a motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Its kind.
    pub kind: Kind,
    /// Period of a periodic one, cycles.
    pub period: Option<u64>,
    /// Its word in normal form.
    pub word: Option<String>,
    /// The largest size of its multipliers, without those that say nothing of stability.
    pub multiplier: Option<f64>,
    /// The largest exponent and one standard error of it, 1/s, where it was computed.
    pub exponent: Option<[f64; 2]>,
    /// Turns per cycle around the orbit that a torus encloses, in [0, ½], where that orbit was found.
    pub rotation: Option<f64>,
    /// Cycles run until this was known.
    pub cycles: u64,
    /// Distance between the ends of the orbit, in scales; without one that of the last two sections.
    pub distance: f64,
    /// Why it is of no other kind.
    pub reason: Option<String>,
}

/// Cycles over which averages are taken first; they are doubled at most [`DOUBLED`] times.
const WINDOW: u64 = 2000;
const DOUBLED: u32 = 4;
/// Digits of a weighted average from which a motion is regular, and up to which it may be chaotic (Sander and Meiss 2020; thresholds by
/// computation on a chaotic pair and a circle map).
const REGULAR: f64 = 6.0;
const IRREGULAR: f64 = 4.0;
/// Bands within which an exponent counts as zero.
const BANDS: f64 = 3.0;
/// Growth of the state, in the largest state of the first cycles, that is an escape.
const ESCAPED: f64 = 1e6;
/// Share that is left of a distance at the end of the second half of a run that still decays.
const CLOSING: f64 = 0.5;
/// Bands above zero from which an exponent needs no other proof.
const CLEARLY: f64 = 10.0;
/// Exponent times period that rounding makes of zero.
const ROUNDED: f64 = 1e-9;
/// Logarithm of a growth of rounding up to which an orbit is known at all.
const DETERMINED: f64 = 32.0;
/// Distance of two sections, in scales, below which a run stands on an orbit.
const STANDS: f64 = 1e-9;
/// Push away from an unstable orbit, in sizes of the state.
const PUSHED: f64 = 1e-6;
/// Distance after which a section has come back.
const CLOSES: f64 = 1e-6;
/// Periods up to which an orbit is looked for once neighbours are known to come together.
const LONG: u32 = 64;

impl Motion {
    fn new(kind: Kind, approached: &Approached, reason: Option<String>) -> Self {
        let orbit = approached.orbit.as_ref();
        Self {
            kind,
            period: orbit.map(|orbit| orbit.period),
            word: orbit.map(Orbit::word),
            multiplier: orbit.map(Orbit::largest_multiplier),
            exponent: None,
            rotation: None,
            cycles: approached.cycles,
            distance: approached.distance,
            reason,
        }
    }

    /// By what a run has approached alone: periodic, transient or undecided.
    #[must_use]
    pub fn of(approached: &Approached) -> Self {
        let kind = match &approached.orbit {
            Some(_) => Kind::Periodic,
            None if approached.closing <= CLOSING => Kind::Transient,
            None => Kind::Undecided,
        };
        let reason = match kind {
            Kind::Transient => {
                Some(format!("its sections still come nearer to each other after {} cycles", approached.cycles))
            }
            Kind::Undecided => Some(approached.reason.clone().unwrap_or_else(|| {
                format!("no section of {} cycles came back near enough to another one", approached.cycles)
            })),
            _ => None,
        };
        Self::new(kind, approached, reason)
    }
}

/// The weighted average of `values`: smooth weights make it converge faster than any power on a torus (Das, Saiki, Sander and Yorke 2017).
fn weighted(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let weight = |m: usize| {
        let s = (m as f64 + 0.5) / count;
        libm::exp(-1.0 / (s * (1.0 - s)))
    };
    let (sum, weights) = values.iter().enumerate().fold((0.0, 0.0), |(sum, weights), (m, value)| {
        let w = weight(m);
        (sum + w * value, weights + w)
    });
    sum / weights
}

/// Digits that the weighted averages of both halves have in common.
fn digits(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
    let (first, second) = values.split_at(values.len() / 2);
    let off = (weighted(first) - weighted(second)).abs();
    if off <= f64::EPSILON * mean.abs().max(spread) { -libm::log10(f64::EPSILON) } else { -libm::log10(off / spread) }
}

/// A motion that is being decided.
pub struct Decision<'m, 'e, 's> {
    /// The map of its cycles.
    pub map: &'m SectionMap<'s>,
    /// The run, at the start of a cycle.
    pub engine: &'e mut Engine<'s>,
}

impl Decision<'_, '_, '_> {
    /// Decides what has approached no orbit, by some thousand further cycles: their weighted averages and the largest exponent. `None` if
    /// the run is broken off.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn run(
        &mut self,
        approached: &Approached,
        observer: &mut dyn Observer,
        task: Task<'_>,
    ) -> Result<Option<(Motion, Option<Orbit>)>, SimulationError> {
        let (map, engine) = (self.map, &mut *self.engine);
        let (simulation, drift) = (map.simulation(), map.drift());
        let (clock, period) = (simulation.clock(), simulation.period()?);
        let mut motion = Motion::of(approached);
        if drift.accelerates(simulation) {
            let reason = "the train as a whole has no drag, and a constant load pushes it: it accelerates for ever";
            let left =
                Motion { kind: Kind::Transient, reason: Some(reason.to_owned()), period: None, word: None, ..motion };
            return Ok(Some((left, None)));
        }
        if approached.orbit.is_some() {
            return Ok(Some((motion, None)));
        }
        if approached.distance <= STANDS && !simulation.settings.verify {
            // A run can stay on an unstable orbit for ever, where a symmetry keeps it there: the smallest difference shows where it goes.
            let mut section = map.section(engine.state());
            let size = |range: std::ops::Range<usize>| section.x[range].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let n = simulation.structure.freedoms();
            let sizes = [size(0..n), size(n..2 * n)];
            for (i, x) in section.x[..2 * n].iter_mut().enumerate() {
                *x += PUSHED * sizes[usize::from(i >= n)] * ((i as f64 + 2.0).sqrt().fract() - 0.5);
            }
            if let Ok(state) = map.state(&section) {
                *engine = simulation.engine(state)?;
                let again = Approach { most_cycles: approached.cycles.max(1), ..Approach::default() };
                let Some(found) = again.run(map, engine, observer, task)? else { return Ok(None) };
                let cycles = approached.cycles + found.cycles;
                motion = Motion { cycles, ..Motion::of(&found) };
                if found.orbit.is_some() {
                    return Ok(Some((motion, found.orbit)));
                }
            }
        }
        let scale = if simulation.dimensionless { 1.0 } else { clock.omega() };
        let mut frame = Frame::single(simulation, &drift, scale);
        frame.start(engine.state());
        let largest = |x: &[f64]| x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let first = largest(&engine.state().x).max(f64::MIN_POSITIVE);
        let (mut rows, mut states) = (Vec::new(), Vec::new());
        let mut observables = [Vec::new(), Vec::new()];
        let mut figures = (f64::NAN, 0.0, 0.0);
        for doubled in 0..=DOUBLED {
            while (rows.len() as u64) < WINDOW << doubled {
                let at = clock.at(engine.state().at.cycle + 1, 0.0);
                if engine.run(at, &mut (&mut frame, &mut *observer))? != Outcome::ReachedEnd || task.is_cancelled() {
                    return Ok(None);
                }
                motion.cycles += 1;
                rows.push(frame.take());
                let x = &engine.state().x;
                if largest(x) > ESCAPED * first {
                    let reason = format!("its state has grown {ESCAPED:e} times: it escapes");
                    return Ok(Some((Motion { kind: Kind::Transient, reason: Some(reason), ..motion }, None)));
                }
                let section = map.section(engine.state());
                map.observe(&section, &mut observables);
                states.push(section);
            }
            if frame.is_unresolved() {
                motion.reason = Some("the derivative along a step of its motion cannot be resolved".to_owned());
                break;
            }
            // The second half alone: what is left of a transient is in the first.
            let half = rows.len() / 2;
            let (exponents, bands) = means(&rows[half..], period);
            let (mut exponent, band) = (exponents[0], bands[0]);
            let growth = exponent.max(0.0) * period;
            if frame.lost[0] {
                // Rest has taken the column: neighbours become one.
                exponent = f64::NEG_INFINITY;
            }
            let digits = observables.iter().map(|values| digits(&values[half..])).fold(f64::INFINITY, f64::min);
            figures = (digits, exponent, band);
            motion.exponent = Some([exponent, band]).filter(|e| e.iter().all(|e| e.is_finite()));
            let is_zero = exponent.abs() <= (BANDS * band).max(ROUNDED / period);
            let is_regular = digits >= REGULAR && is_zero;
            let is_last = doubled == DOUBLED;
            let is_chaotic = exponent > BANDS * band && !is_zero && digits <= IRREGULAR
                || is_last && exponent > CLEARLY * band && digits < REGULAR + 2.0;
            // A section that comes back, however late, and an exponent that is not clearly above zero: is there an orbit after all?
            let closes = closes(map, &states, &drift);
            if closes.is_some_and(|cycles| growth * cycles as f64 > DETERMINED) {
                // Rest makes it come back, at some time; rounding on the way decides when.
                (motion.kind, motion.exponent) = (Kind::Undecided, None);
                motion.reason = Some("it comes to rest again and again, and amplifies rounding too much in between to have a period in doubles".to_owned());
                return Ok(Some((motion, None)));
            }
            if closes.is_some() || exponent <= CLEARLY * band {
                let longest_period = closes.unwrap_or(1).max(LONG as usize) as u32;
                let long =
                    Approach { longest_period, most_cycles: u64::from(4 * longest_period), ..Approach::default() };
                // By a run of its own, so that the averages have no gap.
                let mut other = simulation.engine(engine.state().clone())?;
                let Some(found) = long.run(map, &mut other, &mut (), task)? else { return Ok(None) };
                if found.orbit.is_some() {
                    motion.cycles += found.cycles;
                    let (exponent, cycles) = (motion.exponent, motion.cycles);
                    return Ok(Some((Motion { exponent, cycles, ..Motion::of(&found) }, found.orbit)));
                }
                if found.reason.is_some() {
                    motion.reason = found.reason;
                }
            }
            if is_regular {
                motion.rotation = rotation(map, &states, &drift);
                return Ok(Some((Motion { kind: Kind::QuasiPeriodic, reason: None, ..motion }, None)));
            }
            if is_chaotic {
                return Ok(Some((Motion { kind: Kind::Chaotic, reason: None, ..motion }, None)));
            }
        }
        if motion.kind == Kind::Undecided {
            let (digits, exponent, band) = figures;
            let reason = motion.reason.take().unwrap_or_default();
            motion.reason = Some(format!(
                "{} cycles: averages agree to {digits:.1} digits, the largest exponent is {exponent:.3e} with a band of {band:.1e}; {reason}",
                motion.cycles
            ));
        }
        Ok(Some((motion, None)))
    }
}

/// After how many cycles the last section of a run came back, of at most a quarter of them.
fn closes(map: &SectionMap<'_>, states: &[Section], drift: &Drift) -> Option<usize> {
    let (last, before) = states.split_last()?;
    let scales = sizes(map, &states[states.len() / 2..]);
    (1..=states.len() / 4).find(|k| distance(map, &before[before.len() - k], last, &scales, drift) <= CLOSES)
}

impl SectionMap<'_> {
    /// Two smooth functions of the state: sums over the contacts of deflections, and of their rates.
    fn observe(&self, section: &Section, values: &mut [Vec<f64>; 2]) {
        let simulation = self.simulation();
        let (structure, at) = (&simulation.structure, simulation.clock().at(0, 0.0));
        let sums = (0..structure.contacts().len()).fold([0.0; 2], |sums, j| {
            let (d, rate) = structure.deflection(j, at, &section.x);
            let weight = (j as f64 + 2.0).sqrt();
            [sums[0] + weight * d, sums[1] + weight * rate]
        });
        values.iter_mut().zip(sums).for_each(|(values, sum)| values.push(sum));
    }
}

/// Turns per cycle around the orbit of one cycle that the motion encloses: the weighted average of the increments of the angle in the plane
/// of its largest pair of complex multipliers.
fn rotation(map: &SectionMap<'_>, states: &[Section], drift: &Drift) -> Option<f64> {
    let dim = states.first()?.x.len();
    let middle = (0..dim).map(|i| weighted(&states.iter().map(|s| s.x[i]).collect::<Vec<_>>())).collect();
    let start = Section { x: middle, contacts: states[0].contacts.clone() };
    let orbit = map.solve(&start, 1, drift).ok()?;
    let pair = orbit.multipliers.iter().find(|m| m.im > 0.0)?;
    let (_, basis, scales) = map.closure(&orbit.section, &orbit.image, drift);
    let scaled = DMatrix::from_fn(dim, dim, |i, j| orbit.image.jacobian[(i, j)] * scales[j] / scales[i]);
    let reduced = basis.transpose() * scaled * &basis;
    // A row u with u J = μ u: the last singular vector of Jᵀ − μ.
    let shifted =
        reduced.transpose().map(|v| Complex::new(v, 0.0)) - DMatrix::identity(reduced.nrows(), reduced.ncols()) * *pair;
    let vectors = shifted.svd(false, true).v_t?;
    let row = vectors.row(vectors.nrows() - 1).map(|v| v.conj());
    let place = |section: &Section| {
        let off = DVector::from_fn(dim, |i, _| (section.x[i] - orbit.section.x[i]) / scales[i]);
        let off = basis.transpose() * off;
        row.iter().zip(off.iter()).map(|(u, y)| u * *y).sum::<Complex<f64>>()
    };
    let mean = pair.arg();
    let angle = |pair_of: &[Complex<f64>]| {
        let off = (pair_of[1] / pair_of[0]).arg() - mean;
        mean + off - TAU * (off / TAU).round()
    };
    let places: Vec<Complex<f64>> = states.iter().map(place).collect();
    let turns = weighted(&places.windows(2).map(angle).collect::<Vec<_>>()) / TAU;
    let turns = turns.rem_euclid(1.0);
    Some(turns.min(1.0 - turns)).filter(|turns| turns.is_finite())
}
