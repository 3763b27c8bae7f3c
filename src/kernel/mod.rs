//! Taylor recurrences of a structure with contacts.
//!
//! In the clock θ of the step, with `dt = h w(θ) dθ`,
//!
//! ```text
//! (k+1) q_{k+1} = h (w v)_k,   (k+1) v_{k+1} = h (w a)_k,   a = M⁻¹(f − C v − K q − Σ g_j F_j)
//! ```
//!
//! where `(w v)_k = Σ_i w_i v_{k−i}`. Plain time has `w = 1`. Near the start or the end of a contact
//! with a power law, where `pⁿ` has a branch point in plain time, the clock is a root of the time or of a penetration, and the
//! series run through it ([`StepClock`]).

mod bare;
mod bound;
mod clock;
mod clocked;
mod column;
mod compiled;
mod defect;
mod fold;
mod formed;
mod fours;
mod guards;
mod held;
mod lane;
mod lane_leap;
mod leap;
mod linear;
mod linear_mode;
mod lone;
mod low;
mod modulated;
mod motion;
mod nodes;
mod piece;
mod pressed;
mod propagator;
mod reach;
mod rows;
mod sizes;
mod start;
mod two;
mod unit;

pub(crate) use lane::{Lane, LaneEvent, LaneRecords};

use bound::Tail;
use clock::StepClock;
use formed::FEW_FREEDOMS;
use leap::MOST_LEAPS;
use motion::Motion;
use pressed::Pressed;

use crate::hybrid::{
    GuardId, GuardSet, Instant, Jet, JetField, JetRequest, Leap, LeapCounts, Power, Samples, StepQuantity,
};
use crate::system::{Elasticity, Force, Structure, Watch, Wave, dot, guard_id};
use crate::vectors::{Baseline, Path, Work};

/// Highest power of a step.
const ORDER: usize = 24;
/// Number of coefficients of a series.
const ROW: usize = ORDER + 1;
/// Number of series of a contact: rate, force of the law, penetration, its power, stiffness, hysteresis factor `1 + χ ṗ`.
const CONTACT_ROWS: usize = 6;
const RATE: usize = 0;
const FORCE: usize = 1;
const PENETRATION: usize = 2;
const POWER: usize = 3;
const STIFFNESS: usize = 4;
const FACTOR: usize = 5;

/// Number of contacts whose deflections are stored side by side.
const LANES: usize = 4;
/// Number of series of the clock: w, then y, y², … y^(q−1), then p², p³, p⁴.
const CLOCK_ROWS: usize = 1 + 16 + 4;

/// Ratio of a stretch to the terms of its difference below which it loses four bits or more when it is formed.
const SMALL_STRETCH: f64 = 1.0 / 16.0;

/// Offsets of the series in the working space.
#[derive(Debug)]
struct Layout {
    contacts: usize,
    deflections: usize,
    clock: usize,
    /// Stretches `δ − σ b` of the contacts at order zero, σ b the flank, m.
    stretches: usize,
    /// Sizes of the terms of each deflection at order zero, m.
    sizes: usize,
    /// Stretches `δ − σ b` at order zero of separated contacts from the flank that they have left, if known better than by the
    /// state; else NaN. Negative at the drive flank, positive at the back flank.
    gaps: usize,
    /// Contact that owns the clock, if the clock is a root of its penetration; else −1.
    owner: usize,
    /// Time since contacts with power laws started, s, if known; else NaN.
    since: usize,
    /// Orders of a linear mode, each a row: displacements and velocities, in whole blocks of four.
    orders: usize,
    stride: usize,
    /// Offset of the velocities in a row.
    velocities: usize,
    /// Oscillators of a linear mode: cosine and sine of each, order by order.
    waves: usize,
    len: usize,
}

impl Layout {
    fn new(s: &Structure) -> Self {
        let contacts = 2 * s.oscillators.len() * ROW;
        let clock = contacts + s.contacts.len() * CONTACT_ROWS * ROW;
        let deflections = clock + CLOCK_ROWS * ROW;
        let lanes = s.contacts.len().next_multiple_of(LANES);
        let stretches = deflections + ROW * lanes;
        let sizes = stretches + lanes;
        let gaps = sizes + lanes;
        let owner = gaps + s.contacts.len();
        let (orders, velocities) = (owner + 2, s.n.next_multiple_of(LANES));
        let stride = 2 * velocities;
        let waves = orders + ROW * stride;
        Self {
            contacts,
            deflections,
            clock,
            stretches,
            sizes,
            gaps,
            owner,
            since: owner + 1,
            orders,
            stride,
            velocities,
            waves,
            len: waves + 2 * ROW * s.oscillators.len(),
        }
    }

    /// Returns the offset of `cos ωt` of oscillator `i`; its sine follows in the next row.
    fn oscillator(i: usize) -> usize {
        2 * i * ROW
    }

    fn of(&self, j: usize, which: usize) -> usize {
        self.contacts + (j * CONTACT_ROWS + which) * ROW
    }

    /// Returns the offset of the deflection of contact `j` at order `k`.
    fn deflection(&self, j: usize, k: usize) -> usize {
        self.deflections + (j / LANES * ROW + k) * LANES + j % LANES
    }

    /// Returns the offset of `y^power`; that of `y⁰` holds the weight w of the clock.
    fn y(&self, power: usize) -> usize {
        self.clock + power * ROW
    }
}

/// Returns `(a b)_k`.
fn product(w: &[f64], a: usize, b: usize, k: usize) -> f64 {
    w[a..=a + k].iter().zip(w[b..=b + k].iter().rev()).fold(0.0, |s, (x, y)| s + x * y)
}

/// Returns `start + Σ waves` at order `k`.
fn waves(start: f64, waves: &[Wave], k: usize, work: &[f64]) -> f64 {
    waves.iter().fold(start, |sum, w| {
        let o = Layout::oscillator(w.index) + k;
        sum + w.cosine * work[o] + w.sine * work[o + ROW]
    })
}

/// Expansion: the motion, its start, and the scale of the clock.
struct Expansion<'a> {
    s: &'a Structure,
    motion: &'a Motion<'a>,
    request: &'a JetRequest<'a>,
    layout: &'a Layout,
    /// Span of `θ ∈ [0, 1]` in the clock of the step.
    h: f64,
    /// True if the rows of the state, and data formed from them, are not needed.
    is_bare: bool,
}

/// Expansion of a step, as work for a set of instructions.
struct Expand<'a> {
    motion: &'a Motion<'a>,
    request: &'a JetRequest<'a>,
    out: &'a mut Jet,
}

impl Work for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, path: P) {
        self.motion.expand(path, self.request, self.out);
    }
}

/// Leap, as work for a set of instructions.
struct LeapWork<'a> {
    motion: &'a Motion<'a>,
    request: &'a JetRequest<'a>,
    made: LeapCounts,
    /// True if an observer looks at steps.
    shown: bool,
    leap: &'a mut Leap,
}

impl Work for LeapWork<'_> {
    type Output = bool;

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> bool {
        let Self { motion, request, made, shown, leap } = self;
        (leap.is_series, leap.splits, leap.twins) = (false, 0, GuardSet::default());
        // No closure around code compiled for P: it would be a separate function.
        let propagator = motion.propagator(made).filter(|propagator| propagator.fold.holds(motion, request));
        if let Some(propagator) = propagator {
            let is_next = made.leaps < MOST_LEAPS && !made.by_series;
            if is_next && propagator.leap(path, motion, request, leap) {
                return true;
            }
            // Nearly all arcs of a train this small are leaps; steps decide the others.
            if motion.structure.n <= FEW_FREEDOMS {
                return false;
            }
        }
        match motion.pressed.get_or_init(|| Pressed::new(motion)) {
            Some(pressed) => made.leaps < MOST_LEAPS && pressed.leap(path, motion, request, leap),
            None => !shown && motion.bare(path, request, leap),
        }
    }
}

/// Samples of a power, as work for a set of instructions.
struct Sample<'a> {
    motion: &'a Motion<'a>,
    step: &'a Jet,
    what: Power,
    thetas: &'a Samples,
    values: &'a mut Samples,
}

impl Work for Sample<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, _: P) {
        *self.values = self.motion.sampled::<P>(self.step, self.what, self.thetas);
    }
}

/// Series of a quantity, as work for a set of instructions.
struct Show<'a> {
    motion: &'a Motion<'a>,
    step: &'a Jet,
    what: StepQuantity,
    series: &'a mut Vec<f64>,
}

impl Work for Show<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, _: P) {
        self.series.clear();
        self.motion.shown(self.step, self.what, self.series);
    }
}

impl JetField for Motion<'_> {
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet) {
        self.structure.instructions.run(Expand { motion: self, request, out });
    }

    fn leap(&self, request: &JetRequest<'_>, made: LeapCounts, shown: bool, leap: &mut Leap) -> bool {
        self.structure.instructions.run(LeapWork { motion: self, request, made, shown, leap })
    }

    fn term_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        self.guard_sizes(id, step, x)
    }

    fn show(&self, step: &Jet, what: StepQuantity, series: &mut Vec<f64>) -> bool {
        self.structure.instructions.run(Show { motion: self, step, what, series });
        true
    }

    fn sample(&self, step: &Jet, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        self.structure.instructions.run(Sample { motion: self, step, what, thetas, values });
        true
    }

    fn restore(&self, at: Instant, x: &mut [f64]) {
        if self.held.is_some() {
            self.structure.rest(&self.mode, at, x);
        }
    }

    /// Keeps the stretch `δ − σ b` of closed contacts, and of separated ones from the flank that they have left. It is a small difference
    /// of displacements. If it were formed afresh at every step, the rounding of a penetration times the contact force would add
    /// energy, and a gap would lose the digits that decide when it closes. A stretch that is not small is not kept (NaN): the
    /// state is then as accurate, and cannot drift apart from it. The last number is the time since contacts with power laws started.
    fn carry(&self, step: &Jet, theta: f64, ends: bool, carried: &mut Vec<f64>) {
        let gained = self.gained(Baseline, step, theta);
        self.keep(step, ends, gained.as_flattened(), carried);
        carried.push(step.work[self.layout.since] + step.time_at(theta));
    }
}

impl Motion<'_> {
    /// Writes the stretches to be kept after a step, which has changed the deflections by `added`.
    #[inline(always)]
    fn keep(&self, step: &Jet, ends: bool, added: &[f64], carried: &mut Vec<f64>) {
        let layout = &self.layout;
        carried.clear();
        // While power laws are closed, the time of an event is too uncertain for a gap to be more accurate than the state.
        let is_lost = ends && step.is_estimate;
        carried.extend(self.parts.iter().enumerate().map(|(j, part)| {
            let is_closed = part.state.side() != 0.0;
            let start = step.work[if is_closed { layout.stretches } else { layout.gaps } + j];
            if is_lost || start.is_nan() || part.is_bilateral() || !is_closed && step.is_estimate {
                return f64::NAN;
            }
            let stretch = added[j] + start;
            if stretch.abs() < SMALL_STRETCH * step.work[layout.sizes + j] { stretch } else { f64::NAN }
        }));
    }
}

impl Motion<'_> {
    #[inline(always)]
    fn expand<P: Path>(&self, path: P, request: &JetRequest<'_>, out: &mut Jet) {
        match self.series(path, request, false, out) {
            Some((e, clock, tail)) => {
                out.is_estimate = clock.is_some();
                e.guards(clock.as_ref(), &tail, out);
            }
            None => out.reach = f64::NAN,
        }
    }

    /// Forms the series of the state and their reach; `None` if they cannot be formed.
    #[inline(always)]
    fn series<'a, P: Path>(
        &'a self,
        path: P,
        request: &'a JetRequest<'a>,
        is_bare: bool,
        out: &mut Jet,
    ) -> Option<(Expansion<'a>, Option<StepClock>, Tail)> {
        let (s, layout) = (self.structure, &self.layout);
        out.dim = s.dim;
        if !is_bare {
            out.state.resize(ROW * s.dim, 0.0);
        }
        out.work.resize(layout.len, 0.0);
        out.order = ORDER;
        let mut e = Expansion { s, motion: self, request, layout, h: request.span, is_bare };
        e.start(path, out);
        // A bare step is linear: the other recurrence is not compiled for it.
        let clock = if !is_bare && self.is_pressed { e.step_clock(&out.work) } else { None };
        if let Some(clock) = &clock {
            e.h = e.clock_span(clock, &out.work);
        }
        let owner = clock.and_then(|clock| clock.owner.filter(|_| !clock.is_plain()));
        out.work[layout.owner] = owner.map_or(-1.0, |owner| owner as f64);
        out.work[layout.since] = clock.map_or(f64::NAN, |clock| clock.since);
        loop {
            out.low.clear();
            match &clock {
                None if is_bare || self.is_linear => e.linear(out),
                clock => e.in_clock(path, clock.as_ref(), out),
            }
            out.span = e.h;
            let reach = match &clock {
                None => e.plain_reach(out),
                Some(clock) => {
                    let rooted = e.rooted_reach(path, clock, out);
                    rooted.map(|(reach, defect)| (reach, Tail { rooted: Some(defect), ..Tail::default() }))
                }
            };
            if let Some((reach, tail)) = reach.filter(|(reach, _)| *reach > 0.0) {
                out.reach = reach;
                let tail = e.with_left_out(tail, out);
                return Some((e, clock, tail));
            }
            // The scale was so large that the last coefficients overflowed.
            e.h *= 1e-6;
            if e.h < f64::MIN_POSITIVE {
                return None;
            }
        }
    }

    /// Returns `δ − σ b` of contact `j` where its force is exactly zero; the state gives `stretch` to within `rounding`.
    fn forceless(&self, j: usize, at: Instant, stretch: f64, rounding: f64, rate: impl FnOnce() -> f64) -> f64 {
        let Some(Force::Linear { stiffness, damping }) = self.parts[j].force() else { return stretch };
        let k = self.structure.stiffness_at(j, stiffness, at).0;
        if k <= 0.0 {
            return stretch;
        }
        let forceless = -damping * rate() / k;
        if damping == 0.0 || (forceless - stretch).abs() <= rounding { forceless } else { stretch }
    }
}

impl Expansion<'_> {
    #[inline(always)]
    fn pinned(&self, j: usize, watch: Watch) -> bool {
        self.request.pinned.contains(guard_id(j, watch))
    }

    fn is_still(&self, j: usize) -> bool {
        let still = self.request.still;
        !still.is_empty()
            && (still.contains(guard_id(j, Watch::DriveFlank)) || still.contains(guard_id(j, Watch::BackFlank)))
    }

    /// Returns the rate of deflection `j` at order `k`, from the velocities `v` of that order.
    fn rate(&self, j: usize, k: usize, v: &[f64], work: &[f64]) -> f64 {
        let c = &self.s.contacts[j];
        if k == 0 && self.is_still(j) {
            return 0.0;
        }
        c.error_rate.iter().fold(dot(&c.direction, v), |r, w| {
            let o = Layout::oscillator(w.index);
            r - w.cosine * work[o + k] - w.sine * work[o + ROW + k]
        })
    }

    /// Returns `δ − σ b` of contact `j` at order `k`.
    fn stretch(&self, j: usize, k: usize, work: &[f64]) -> f64 {
        if k == 0 { work[self.layout.stretches + j] } else { work[self.layout.deflection(j, k)] }
    }
}
