//! Ways from a state to the next event: leaps by a propagator or by pieces of a contact, steps by series.

mod bare;
mod column;
mod formed;
mod lane;
mod lane_leap;
mod leap;
mod linear_lane;
mod modulated;
mod nodes;
mod piece;
mod pressed;
mod propagator;
mod step;
mod two;
mod unit;

use std::{
    cell::{OnceCell, RefCell},
    rc::Rc,
};

use formed::FEW_FREEDOMS;
use leap::MOST_LEAPS;
use pressed::Pressed;
use propagator::Propagator;

use crate::{
    hybrid::{
        GuardId, GuardSet, Instant, Jet, JetField, JetRequest, Leap, LeapCounts, Mode, Power, Samples, StepQuantity,
    },
    kernel::{mode::motion::Motion, series::clocked::Room},
    system::Structure,
    vectors::{Baseline, Path, Work},
};

/// Motion of a mode, with its propagators and buffers.
#[derive(Debug)]
pub struct Ways<'s> {
    pub motion: Motion<'s>,
    /// Formed at the first request.
    propagator: OnceCell<Option<Rc<Propagator>>>,
    /// Formed at the first request.
    pressed: OnceCell<Option<Pressed>>,
    /// Buffers for series of modes that are not linear.
    room: RefCell<Room>,
}

impl<'s> Ways<'s> {
    pub fn new(structure: &'s Structure, mode: &Mode) -> Self {
        Self {
            motion: Motion::new(structure, mode),
            propagator: OnceCell::new(),
            pressed: OnceCell::new(),
            room: RefCell::default(),
        }
    }
}

impl Structure {
    /// Returns the compiled motion in `mode`.
    pub(crate) fn compile(&self, mode: &Mode) -> Box<dyn JetField + '_> {
        Box::new(Ways::new(self, mode))
    }
}

/// Expansion of a step, as work for a set of instructions.
struct Expand<'a> {
    ways: &'a Ways<'a>,
    request: &'a JetRequest<'a>,
    out: &'a mut Jet,
}

impl Work for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, path: P) {
        self.ways.expand(path, self.request, self.out);
    }
}

/// Leap, as work for a set of instructions.
struct LeapWork<'a> {
    ways: &'a Ways<'a>,
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
        let Self { ways, request, made, shown, leap } = self;
        let motion = &ways.motion;
        (leap.is_series, leap.splits, leap.twins) = (false, 0, GuardSet::default());
        // No closure around code compiled for P: it would be a separate function.
        let propagator = ways.propagator(made).filter(|propagator| propagator.fold.holds(motion, request));
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
        match ways.pressed.get_or_init(|| Pressed::new(motion)) {
            Some(pressed) => made.leaps < MOST_LEAPS && pressed.leap(path, motion, request, leap),
            None => !shown && ways.bare(path, request, leap),
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

impl JetField for Ways<'_> {
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet) {
        self.motion.structure.instructions.run(Expand { ways: self, request, out });
    }

    fn leap(&self, request: &JetRequest<'_>, made: LeapCounts, shown: bool, leap: &mut Leap) -> bool {
        self.motion.structure.instructions.run(LeapWork { ways: self, request, made, shown, leap })
    }

    fn term_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        self.motion.guard_sizes(id, step, x)
    }

    fn show(&self, step: &Jet, what: StepQuantity, series: &mut Vec<f64>) -> bool {
        self.motion.structure.instructions.run(Show { motion: &self.motion, step, what, series });
        true
    }

    fn sample(&self, step: &Jet, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        self.motion.structure.instructions.run(Sample { motion: &self.motion, step, what, thetas, values });
        true
    }

    fn restore(&self, at: Instant, x: &mut [f64]) {
        if self.motion.held.is_some() {
            self.motion.structure.rest(&self.motion.mode, at, x);
        }
    }

    /// Keeps the stretch `δ − σ b` of closed contacts, and of separated ones from the flank that they have left. It is a small difference
    /// of displacements. If it were formed afresh at every step, the rounding of a penetration times the contact force would add
    /// energy, and a gap would lose the digits that decide when it closes. A stretch that is not small is not kept (NaN): the
    /// state is then as accurate, and cannot drift apart from it. The last number is the time since contacts with power laws started.
    fn carry(&self, step: &Jet, theta: f64, ends: bool, carried: &mut Vec<f64>) {
        let gained = self.motion.gained(Baseline, step, theta);
        self.motion.keep(Baseline, step, ends, &gained, carried);
        carried.push(step.rows.since + step.time_at(theta));
    }
}
