//! Kind of a motion, decided by numerical criteria.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use serde::{Deserialize, Serialize};

use super::{
    Approach, ApproachEnd, Drift, Orbit, SectionMap,
    approach::{BESIDE, NEAR, closing, return_distances},
    averages::means,
    mover::{Mover, Point},
    section::Section,
    unknowns::{ACCELERATES, Unknowns, distance},
};
use crate::{
    engine::{Engine, Observer, State},
    simulation::SimulationError,
    task::Task,
};

/// Kind of a motion after its transient.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum MotionKind {
    /// The motion is on a stable orbit.
    Periodic,
    /// The motion is on a torus: it never repeats, and its averages converge fast.
    QuasiPeriodic,
    /// Neighbours part, by an exponent that is above zero by more than three bands.
    Chaotic,
    /// The motion still settles, or escapes.
    Transient,
    /// None of the others within the cycles run.
    Undecided,
}

impl MotionKind {
    /// Returns its word in files.
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

/// Properties of a motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Its kind.
    pub kind: MotionKind,
    /// Period of a periodic motion, cycles.
    pub period: Option<u64>,
    /// Its word in normal form.
    pub word: Option<String>,
    /// Largest absolute value of a multiplier, without those that do not decide on stability.
    pub multiplier: Option<f64>,
    /// Largest exponent and its standard error, 1/s, if computed.
    pub exponent: Option<[f64; 2]>,
    /// Turns per cycle around the orbit that a torus encloses, in [0, ½], if that orbit was found.
    pub rotation: Option<f64>,
    /// Cycles run until this was known.
    pub cycles: u64,
    /// Distance between the ends of the orbit, in scales; without an orbit that of the last two sections.
    pub distance: f64,
    /// Reason for which it is of no other kind.
    pub reason: Option<String>,
}

/// Duration for which a motion without an orbit is watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchTime {
    /// Cycles of the first averages.
    pub cycles: u64,
    /// Maximum number of doublings of these cycles.
    pub doublings: u32,
    /// True if the transient is over: averages are taken from all cycles, not from their second half.
    pub is_settled: bool,
}

impl Default for WatchTime {
    fn default() -> Self {
        Self { cycles: 2000, doublings: 4, is_settled: false }
    }
}

/// Digits of a weighted average above which a motion is regular, and below which it may be chaotic (Sander and Meiss 2020; thresholds by
/// computation on a chaotic pair and a circle map).
pub(super) const REGULAR: f64 = 6.0;
const IRREGULAR: f64 = 4.0;
/// Spread of an observable, as a share of its mean, below which it counts as constant.
const STAYS: f64 = 1e-8;
/// Bands within which an exponent counts as zero.
pub(super) const BANDS: f64 = 3.0;
/// Growth of the state, relative to the largest state of the first cycles, that is an escape.
const ESCAPED: f64 = 1e6;
/// Factor of the distances of returns, in each of the last quarters of a run, below which the run still settles.
const CLOSING: f64 = 0.7;
/// Growth from quarter to quarter of the cycles that excludes a steady motion.
const GROWS: f64 = 1.2;
/// Bands above zero beyond which an exponent needs no other proof.
const CLEARLY: f64 = 10.0;
/// Exponent times period that rounding can produce from zero.
const ROUNDED: f64 = 1e-9;
/// Logarithm of the growth of rounding beyond which an orbit is undetermined.
pub(super) const DETERMINED: f64 = 32.0;
/// Logarithm of a growth below which neighbours have not parted: on a torus they part in proportion to time, some hundred times in as many
/// cycles, which looks like an exponent.
pub(super) const PARTED: f64 = 10.0;
/// Distance of two sections, in scales, below which a run rests on an orbit.
const STANDS: f64 = 1e-9;
/// Perturbation away from an unstable orbit, in sizes of the state.
const PUSHED: f64 = 1e-6;
/// Distance, in scales, below which a section has returned.
const CLOSES: f64 = 1e-6;
/// Longest return, cycles, to an unstable orbit beside which a motion may stay.
const SHORT: usize = 16;
/// Longest period searched for, cycles, once neighbours are known to approach each other.
const LONG: u32 = 64;

/// Reason of a motion that stays undecided, as its tangent is unknown.
pub(super) const UNRESOLVED: &str = "the derivative along a step of its motion cannot be resolved";

/// Returns the reason for which a motion is transient.
fn still_closing(cycles: u64) -> String {
    format!("its sections still come nearer to each other after {cycles} cycles")
}

impl Motion {
    fn new(kind: MotionKind, approached: &ApproachEnd, reason: Option<String>) -> Self {
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

    /// Returns the kind from the approach alone: periodic, transient or undecided.
    #[must_use]
    pub fn of(approached: &ApproachEnd) -> Self {
        let kind = match &approached.orbit {
            Some(_) => MotionKind::Periodic,
            None if approached.closing <= CLOSING => MotionKind::Transient,
            None => MotionKind::Undecided,
        };
        let reason = match kind {
            MotionKind::Transient => Some(still_closing(approached.cycles)),
            MotionKind::Undecided => Some(approached.reason.clone().unwrap_or_else(|| {
                format!("no section of {} cycles came back near enough to another one", approached.cycles)
            })),
            _ => None,
        };
        Self::new(kind, approached, reason)
    }
}

/// Returns the weighted average of `values`: smooth weights converge faster than any power on a torus (Das, Saiki, Sander and Yorke 2017).
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

/// Returns the number of digits in which the weighted averages of both halves agree.
fn digits(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
    let (first, second) = values.split_at(values.len() / 2);
    let off = (weighted(first) - weighted(second)).abs();
    // A constant observable changes by rounding alone.
    let spread = spread.max(STAYS * mean.abs()).max(f64::MIN_POSITIVE);
    -libm::log10((off / spread).max(f64::EPSILON))
}

/// Further cycles of a motion, with the growth of a difference and observables.
pub(super) struct MotionCycles {
    /// Logarithms of the growth of the difference, a row for each cycle.
    pub rows: Vec<[f64; 1]>,
    /// True for each cycle in which rest has taken a rank of the difference.
    lost: Vec<bool>,
    pub points: Vec<Point>,
    observables: [Vec<f64>; 4],
    is_settled: bool,
}

/// Figures of the watched cycles; of their second half if a transient may be left in the first.
#[derive(Clone, Copy)]
pub(super) struct Figures {
    /// Digits to which averages agree.
    pub digits: f64,
    /// Largest exponent and its band, 1/s; −∞ if rest has merged neighbours.
    pub exponent: f64,
    pub band: f64,
    /// Logarithm of the growth of a difference in a cycle.
    pub growth: f64,
    /// Logarithm of the growth over all watched cycles.
    pub whole: f64,
}

impl Figures {
    /// Returns the figures from the logarithms of growth, a row for each cycle, and from observables.
    pub fn new<'a>(rows: &[impl AsRef<[f64]>], observables: impl Iterator<Item = &'a [f64]>, period: f64) -> Self {
        let (exponents, bands) = means(rows, period);
        let growth = exponents[0].max(0.0) * period;
        let digits = observables.map(digits).fold(f64::INFINITY, f64::min);
        Self { digits, exponent: exponents[0], band: bands[0], growth, whole: growth * rows.len() as f64 }
    }

    /// Returns the reason for which they leave the kind open; `tried` is the reason against an orbit.
    pub fn reason(self, cycles: u64, tried: Option<String>) -> String {
        let Self { digits, exponent, band, .. } = self;
        let tried = tried.map_or_else(String::new, |tried| format!("; {tried}"));
        format!(
            "{cycles} cycles: averages agree to {digits:.1} digits, the largest exponent is {exponent:.3e} with a band of {band:.1e}{tried}"
        )
    }

    /// Returns whether the exponent is not clearly above zero.
    pub fn is_low(self) -> bool {
        self.exponent <= CLEARLY * self.band
    }

    /// Returns whether neighbours part: the exponent is above zero by more than its bands.
    pub fn parts(self) -> bool {
        self.exponent > BANDS * self.band
    }

    fn is_zero(self, period: f64) -> bool {
        self.exponent.abs() <= (BANDS * self.band).max(ROUNDED / period)
    }

    pub fn is_regular(self, period: f64) -> bool {
        self.digits >= REGULAR && self.is_zero(period)
    }

    pub fn is_chaotic(self, period: f64, is_last: bool) -> bool {
        let Self { digits, exponent, band, .. } = self;
        let is_clear = is_last && exponent > CLEARLY * band && digits < REGULAR + 2.0;
        self.parts() && self.whole > PARTED && !self.is_zero(period) && (digits <= IRREGULAR || is_clear)
    }
}

impl MotionCycles {
    pub fn new(mover: &mut Mover<'_, '_>, is_settled: bool) -> Self {
        mover.carry();
        let observables = [const { Vec::new() }; 4];
        Self { rows: Vec::new(), lost: Vec::new(), points: Vec::new(), observables, is_settled }
    }

    /// Runs one further cycle and returns whether it ended.
    pub fn cycle(&mut self, mover: &mut Mover<'_, '_>) -> Result<bool, SimulationError> {
        if !mover.cycle()? {
            return Ok(false);
        }
        let (growth, is_lost) = mover.growth();
        self.rows.push([growth]);
        self.lost.push(is_lost);
        let point = mover.point();
        mover.map.observe(&point, &mut self.observables);
        self.points.push(point);
        Ok(true)
    }

    /// Returns whether a part of the motion could not be resolved.
    pub fn is_unresolved(&self) -> bool {
        self.rows.iter().any(|[growth]| growth.is_nan())
    }

    pub fn figures(&self, period: f64) -> Figures {
        let half = if self.is_settled { 0 } else { self.rows.len() / 2 };
        let figures = Figures::new(&self.rows[half..], self.observables.iter().map(|values| &values[half..]), period);
        let is_lost = self.lost[half..].contains(&true);
        Figures { exponent: if is_lost { f64::NEG_INFINITY } else { figures.exponent }, ..figures }
    }

    /// Returns whether the motion grows from quarter to quarter of the cycles.
    fn grows(&self) -> bool {
        let quarter = self.points.len() / 4;
        self.observables.iter().any(|values| {
            let sizes = [1, 2, 3].map(|k| largest(&values[k * quarter..(k + 1) * quarter]));
            sizes.windows(2).all(|pair| pair[1] > GROWS * pair[0])
        })
    }

    /// Returns whether it is still beside an orbit from which neighbours part. Leaving a symmetry may take thousands of cycles.
    fn leaves(&self, map: &SectionMap<'_>, drift: &Drift) -> bool {
        let returns = return_distances(map, &self.points, SHORT, drift);
        returns.is_some_and(|[a, b, c]| c <= BESIDE || c <= NEAR && b > GROWS * a && c > GROWS * b)
    }

    /// Returns the number of cycles after which the last section returned, at most a quarter of all.
    fn closes(&self, map: &SectionMap<'_>, drift: &Drift) -> Option<usize> {
        let (last, before) = self.points.split_last()?;
        let scales = map.scales_of(&self.points[self.points.len() / 2..]);
        let apart = |k: &usize| distance(map, &before[before.len() - k], last, &scales, drift);
        (1..=self.points.len() / 4).find(|k| apart(k) <= CLOSES)
    }
}

/// Returns the largest absolute value of a component.
fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// Returns a state beside that of `engine`, in no symmetry of the train. A symmetry can keep a run on an unstable orbit for ever, and the
/// smallest difference makes it leave.
fn pushed(map: &SectionMap<'_>, engine: &Engine<'_>) -> Result<State, SimulationError> {
    let mut section = map.section(engine.state());
    let n = map.simulation().structure.freedoms();
    let sizes = [largest(&section.x[..n]), largest(&section.x[n..2 * n])];
    for (i, x) in section.x[..2 * n].iter_mut().enumerate() {
        *x += PUSHED * sizes[usize::from(i >= n)] * ((i as f64 + 2.0).sqrt().fract() - 0.5);
    }
    map.state(&section)
}

/// Decides on a motion that has `approached` no orbit, from further cycles of `engine`, which is at the start of a cycle: from their
/// weighted averages and the largest exponent. `None` if the run is interrupted.
///
/// # Errors
/// [`SimulationError`] if the run fails.
pub fn decide<'s>(
    map: &SectionMap<'s>,
    engine: &mut Engine<'s>,
    approached: &ApproachEnd,
    watching: WatchTime,
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<Option<(Motion, Option<Orbit>)>, SimulationError> {
    let (simulation, drift) = (map.simulation(), map.drift());
    let mut motion = Motion::of(approached);
    let ends =
        |motion: Motion, kind: MotionKind, reason: Option<String>| Ok(Some((Motion { kind, reason, ..motion }, None)));
    if drift.accelerates(simulation) {
        let left = Motion { period: None, word: None, multiplier: None, ..motion };
        return ends(left, MotionKind::Transient, Some(ACCELERATES.to_owned()));
    }
    if approached.orbit.is_some() {
        return Ok(Some((motion, None)));
    }
    // Equal planets with equal starts stay equal until rounding parts them late: exponents before would be those of another motion.
    let may_be_symmetric = simulation.structure.freedoms() > 1;
    if (approached.distance <= STANDS || may_be_symmetric)
        && !simulation.settings.verify
        && let Ok(state) = pushed(map, engine)
    {
        *engine = simulation.engine(state)?;
        let again = Approach { most_cycles: approached.cycles.max(1), ..Approach::default() };
        let quiet: &mut dyn Observer = if watching.is_settled { &mut () } else { &mut *observer };
        let Some(found) = again.run(map, engine, quiet, task)? else { return Ok(None) };
        let cycles = approached.cycles + found.cycles;
        motion = Motion { cycles, ..Motion::of(&found) };
        if found.orbit.is_some() {
            return Ok(Some((motion, found.orbit)));
        }
    }
    kind_of(&mut Mover::new(*map, &drift, engine, observer), motion, watching, task)
}

/// Decides on a motion without a known orbit from further cycles.
fn kind_of(
    mover: &mut Mover<'_, '_>,
    mut motion: Motion,
    watching: WatchTime,
    task: Task<'_>,
) -> Result<Option<(Motion, Option<Orbit>)>, SimulationError> {
    let (map, drift) = (mover.map, mover.drift);
    let period = map.simulation().period()?;
    let ends =
        |motion: Motion, kind: MotionKind, reason: Option<String>| Ok(Some((Motion { kind, reason, ..motion }, None)));
    let first = largest(&mover.point()).max(f64::MIN_POSITIVE);
    let mut watched = MotionCycles::new(mover, watching.is_settled);
    let mut tried = None;
    for doubled in 0..=watching.doublings {
        while (watched.rows.len() as u64) < watching.cycles << doubled {
            if !watched.cycle(mover)? || task.is_cancelled() {
                return Ok(None);
            }
            motion.cycles += 1;
            if largest(&mover.point()) > ESCAPED * first {
                let reason = format!("its state has grown {ESCAPED:e} times: it escapes");
                return ends(motion, MotionKind::Transient, Some(reason));
            }
        }
        if watched.is_unresolved() {
            return ends(motion, MotionKind::Undecided, Some(UNRESOLVED.to_owned()));
        }
        let figures = watched.figures(period);
        motion.exponent = Some([figures.exponent, figures.band]).filter(|e| e.iter().all(|e| e.is_finite()));
        // A section that returns, however late, and an exponent not clearly above zero: search for an orbit again.
        let closes = watched.closes(&map, drift);
        if closes.is_some_and(|cycles| figures.growth * cycles as f64 > DETERMINED) {
            // Rest makes the section return; rounding before it decides when.
            let reason = "it comes to rest again and again, and amplifies rounding too much in between to have a period in doubles";
            return ends(Motion { exponent: None, ..motion }, MotionKind::Undecided, Some(reason.to_owned()));
        }
        if closes.is_some() || figures.is_low() {
            let longest_period = closes.unwrap_or(1).max(LONG as usize) as u32;
            let long = Approach { longest_period, most_cycles: u64::from(4 * longest_period), ..Approach::default() };
            // A separate run, so that the averages have no gap.
            let Some(found) = mover.aside(long, task)? else { return Ok(None) };
            if found.orbit.is_some() {
                let (exponent, cycles) = (motion.exponent, motion.cycles + found.cycles);
                return Ok(Some((Motion { exponent, cycles, ..Motion::of(&found) }, found.orbit)));
            }
            tried = found.reason.or(tried);
        }
        if figures.is_regular(period) && !map.shrinks() {
            motion.rotation = rotation(mover, &watched.points);
            return ends(motion, MotionKind::QuasiPeriodic, None);
        }
        let is_last = doubled == watching.doublings;
        if figures.is_chaotic(period, is_last) && (is_last || !watching.is_settled || !figures.is_low()) {
            if watched.leaves(&map, drift) {
                let reason = format!("it still leaves an unstable orbit after {} cycles", motion.cycles);
                return ends(Motion { exponent: None, ..motion }, MotionKind::Transient, Some(reason));
            }
            return ends(motion, MotionKind::Chaotic, None);
        }
    }
    let (cycles, figures) = (motion.cycles, watched.figures(period));
    // If neighbours part, sections approach each other by chance alone.
    if !figures.parts() && closing(return_distances(&map, &watched.points, LONG as usize, drift)) <= CLOSING {
        return ends(motion, MotionKind::Transient, Some(still_closing(cycles)));
    }
    if watched.grows() {
        return ends(motion, MotionKind::Transient, Some(format!("its vibration still grows after {cycles} cycles")));
    }
    let reason = figures.reason(cycles, tried);
    ends(motion, MotionKind::Undecided, Some(reason))
}

impl SectionMap<'_> {
    /// Returns whether areas shrink from cycle to cycle in a plane of sections. The area inside a torus does not, so there is none.
    fn shrinks(&self) -> bool {
        let spec = self.simulation().structure.spec();
        let is_plane = spec.freedoms.len() == 1 && spec.contacts.len() == 1;
        is_plane && (spec.damping[(0, 0)] > 0.0 || spec.contacts[0].law.jump_damping() > 0.0)
    }

    /// Smooth functions of the state that no drift changes: sums of deflections, of spring forces, and of the rates of both.
    fn observe(&self, x: &[f64], values: &mut [Vec<f64>; 4]) {
        let simulation = self.simulation();
        let (structure, at) = (&simulation.structure, simulation.clock().at(0, 0.0));
        let weight = |j: usize| (j as f64 + 2.0).sqrt();
        let mut sums = [0.0; 4];
        for j in 0..structure.contacts().len() {
            let (d, rate) = structure.deflection(j, at, x);
            sums[0] += weight(j) * d;
            sums[1] += weight(j) * rate;
        }
        let stiffness = &structure.spec().stiffness;
        let n = stiffness.nrows();
        for (i, row) in stiffness.row_iter().enumerate() {
            for j in 0..n {
                sums[2] += weight(i) * row[j] * x[j];
                sums[3] += weight(i) * row[j] * x[n + j];
            }
        }
        values.iter_mut().zip(sums).for_each(|(values, sum)| values.push(sum));
    }
}

/// Returns the turns per cycle around the orbit of one cycle that the motion encloses. They are the weighted average of the increments of
/// the angle in the plane of its largest pair of complex multipliers.
fn rotation(mover: &Mover<'_, '_>, points: &[Point]) -> Option<f64> {
    let (map, drift, Section { x, contacts }) = (mover.map, mover.drift, mover.section());
    let middle = |i: usize| weighted(&points.iter().map(|x| x[i]).collect::<Vec<_>>());
    let start = Section { x: (0..x.len()).map(middle).collect(), contacts };
    let orbit = map.solve(&start, 1, drift).ok()?;
    let pair = orbit.multipliers.iter().find(|m| m.im > 0.0)?;
    let unknowns = Unknowns::new(&map, &orbit.image, drift);
    let reduced = unknowns.reduced(&orbit.image.jacobian);
    // A row u with u J = μ u: the last singular vector of Jᵀ − μ.
    let shifted =
        reduced.transpose().map(|v| Complex::new(v, 0.0)) - DMatrix::identity(reduced.nrows(), reduced.ncols()) * *pair;
    let vectors = shifted.svd(false, true).v_t?;
    let row = vectors.row(vectors.nrows() - 1).map(|v| v.conj());
    let place = |x: &Point| {
        let off = unknowns.between(&orbit.section.x, x);
        row.iter().zip(off.iter()).map(|(u, y)| u * *y).sum::<Complex<f64>>()
    };
    let mean = pair.arg();
    let angle = |pair_of: &[Complex<f64>]| {
        let off = (pair_of[1] / pair_of[0]).arg() - mean;
        mean + off - TAU * (off / TAU).round()
    };
    let places: Vec<Complex<f64>> = points.iter().map(place).collect();
    let turns = weighted(&places.windows(2).map(angle).collect::<Vec<_>>()) / TAU;
    let turns = turns.rem_euclid(1.0);
    Some(turns.min(1.0 - turns)).filter(|turns| turns.is_finite())
}
