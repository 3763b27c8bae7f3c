//! Lane: motion of a train of one degree of freedom with one contact, from event to event, without any output that is not requested.
//!
//! The results equal those of the engine with the same leaps, to the last bit. A lane makes no record and shows no step. If a leap is not
//! decided, if numbers do not agree, or if a contact comes to rest, the lane stops, and an engine continues.

use std::ops::ControlFlow;

use super::{
    Ways,
    formed::WORTH,
    lane_leap::{Bound, Derivatives},
    leap::MOST_LEAPS,
    linear_lane::LinearLane,
    propagator::MOST_INPUTS,
};
use crate::{
    gear::contact::Law,
    hybrid::{
        self, AGREED, GuardSet, HybridSystem, Instant, Jump, LaneHost, LaneLimits, LanePoint, Lap, LapEnd, LeapCounts,
        Mode, Rebound,
    },
    kernel::ROUNDING,
    system::{Columns, ContactMode, Spring, Structure, Watch, contact_mode, dot, guard_id},
    vectors::{Path, Work},
};

/// Steps of a lane between two instants that it passes to its host.
pub(super) const PASSED: u64 = 1024;
/// Maximum number of events of a cycle; more occur only if impacts come to rest.
const MOST_EVENTS: u64 = 256;
/// Maximum number of steps of a cycle; beyond, the engine continues with the budget of the run.
const MOST_STEPS: u64 = 1_000_000;
/// States of a contact.
const STATES: [ContactMode; 5] = [
    ContactMode::Separated,
    ContactMode::Drive,
    ContactMode::Back,
    ContactMode::DriveDetached,
    ContactMode::BackDetached,
];
/// Least distance of a bound, in spans, at which it does not affect a leap.
const FAR: f64 = 4.0;

/// Event of a lane: state of the contact before and after, and the guard that fell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LaneEvent {
    pub was: u8,
    pub is: u8,
    pub watch: u8,
}

impl LaneEvent {
    /// Returns the state of the contact before and after, and the guard.
    pub fn parts(self) -> (ContactMode, ContactMode, Watch) {
        let watch = [Watch::DriveFlank, Watch::BackFlank, Watch::Force][usize::from(self.watch)];
        (STATES[usize::from(self.was)], STATES[usize::from(self.is)], watch)
    }
}

/// Records of the motion in a lane.
#[derive(Clone, Debug, Default)]
pub(crate) struct LaneRecords {
    /// Time in each state of the contact, s, in the order of [`ContactMode`].
    pub times: [f64; 5],
    /// Events, if requested.
    pub events: Option<Vec<LaneEvent>>,
    /// Contacts gained and impacts, if requested: time since the start of the cycle, s, rate of the deflection before, m/s, and side of
    /// the flank, ±1.
    pub strikes: Option<Vec<[f64; 3]>>,
    /// Derivative with respect to the start, rows `(q, v)`, if requested.
    pub columns: Option<Columns>,
}

/// Mode that has occurred in the run, prepared for leaps.
pub struct LaneMode<'s> {
    /// Number of the contact in the mode.
    number: u16,
    state: ContactMode,
    pub ways: Ways<'s>,
    /// True if the exact flow of the mode may be used.
    pub is_exact: bool,
    /// Result of the fall of each guard, kept from the first time, if it depends on nothing else.
    edges: [Option<Edge>; 3],
}

/// Result of the fall of a guard.
#[derive(Clone, Copy)]
struct Edge {
    state: ContactMode,
    zeros: [bool; 3],
    /// Index of the mode after the fall, if no schedule affects it.
    mode: Option<usize>,
}

/// Current point of a lane.
#[derive(Clone, Copy)]
pub struct LaneState {
    pub at: Instant,
    pub x: [f64; 2],
    /// Index of the mode in the list of modes.
    pub mode: usize,
    /// Guards of the contact that are exactly zero, by [`Watch`].
    pub zeros: [bool; 3],
    /// Guards that received an impulse.
    struck: [bool; 3],
    /// Displacement of the state onto guards, as in [`Jump`].
    projected: f64,
    /// Stretch kept as by [`JetField::carry`](hybrid::JetField::carry), m.
    pub carried: f64,
    /// Next known switching time of the mode.
    switch: Option<Instant>,
}

/// `cos ωt` and `sin ωt` of the oscillators at an instant.
type Waves = [[f64; 2]; MOST_INPUTS];

/// Lane of a train; the module comment describes it.
pub(crate) struct Lane<'s> {
    pub structure: &'s Structure,
    pub modes: Vec<LaneMode<'s>>,
    /// Index of the mode plus 1, by number of the contact; 0 for none.
    places: Vec<u16>,
    /// True if a jump changes the columns.
    salts: bool,
    is_rigid: bool,
    is_scheduled: bool,
    pub state: LaneState,
    pub waves: Waves,
}

/// Host without an integrator: every flow is exact, and no impact sequence ends.
struct NoHost;

impl LaneHost for NoHost {
    fn pass(&mut self, _: Instant) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn is_exact(&mut self, _: &Mode) -> bool {
        true
    }

    fn count(&mut self, _: &Mode, _: u64) -> u64 {
        0
    }

    fn meet(&mut self, _: hybrid::GuardId, _: f64) {}

    fn ends(&mut self, _: &Rebound) -> bool {
        false
    }
}

impl<'s> Lane<'s> {
    /// Returns a lane for motions of `structure`; `None` unless the train has one degree of freedom and one contact, with a linear law or
    /// a rigid one, under a forcing of one period.
    pub fn new(structure: &'s Structure) -> Option<Self> {
        let [c] = &structure.contacts[..] else { return None };
        let (salts, is_rigid) = match c.spec.law {
            Law::KelvinVoigt(law, _) => (law.damping > 0.0, false),
            Law::Rigid(_) => (true, true),
            _ => return None,
        };
        let is_periodic = structure.clock.period().is_some() && structure.has_whole_orders();
        let few = structure.n == 1 && structure.dim == 2 && structure.oscillators.len() <= MOST_INPUTS;
        let state = LaneState {
            at: Instant::default(),
            x: [0.0; 2],
            mode: 0,
            zeros: [false; 3],
            struck: [false; 3],
            projected: 0.0,
            carried: f64::NAN,
            switch: None,
        };
        (few && is_periodic && !structure.is_conservative).then(|| Self {
            structure,
            modes: Vec::new(),
            places: Vec::new(),
            salts,
            is_rigid,
            is_scheduled: matches!(c.spring, Spring::Scheduled(_)),
            state,
            waves: [[0.0; 2]; MOST_INPUTS],
        })
    }

    /// Places the lane at state `x` and instant `at`, in the mode and with the exact zeros of `jump`. Returns `false` if it cannot.
    pub fn place(&mut self, at: Instant, x: [f64; 2], jump: &Jump) -> bool {
        self.enter(at, x, jump, f64::NAN, &mut NoHost);
        jump.still.is_empty()
    }

    fn enter(&mut self, at: Instant, x: [f64; 2], jump: &Jump, carried: f64, host: &mut dyn LaneHost) {
        let of = |set: &GuardSet| [0, 1, 2].map(|watch| set.contains(hybrid::GuardId(watch)));
        let (zeros, struck) = (of(&jump.pinned), of(&jump.struck));
        let mode = self.meet(&jump.mode, host);
        self.state = LaneState { at, x, mode, zeros, struck, projected: jump.projected, carried, switch: None };
        self.look_ahead();
        self.turn();
    }

    /// Evaluates the oscillators at the current instant.
    #[inline(always)]
    fn turn(&mut self) {
        let (waves, at) = (&mut self.waves, self.state.at);
        self.structure.oscillate(at, |i, cosine, sine| waves[i] = [cosine, sine]);
    }

    /// Finds the next known switching time. Without a schedule it stays `None`, and is not written.
    #[inline(always)]
    fn look_ahead(&mut self) {
        if self.is_scheduled {
            self.state.switch = self.structure.next_switch(&self.mode(), self.state.at);
        }
    }

    /// Returns the index of the mode of a mode, which is formed if it is new.
    fn meet(&mut self, mode: &Mode, host: &mut dyn LaneHost) -> usize {
        let number = mode.get(0);
        match self.places.get(usize::from(number)) {
            Some(place @ 1..) => return usize::from(place - 1),
            Some(_) => {}
            None => self.places.resize(usize::from(number) + 1, 0),
        }
        let ways = Ways::new(self.structure, mode);
        let (state, is_exact) = (contact_mode(mode, 0), host.is_exact(mode));
        self.modes.push(LaneMode { number, state, ways, is_exact, edges: [None; 3] });
        self.places[usize::from(number)] = self.modes.len() as u16;
        self.modes.len() - 1
    }

    /// Returns the current instant.
    pub fn at(&self) -> Instant {
        self.state.at
    }

    /// Returns the state `[q, v]`.
    pub fn x(&self) -> [f64; 2] {
        self.state.x
    }

    fn mode(&self) -> Mode {
        let mut mode = Mode::default();
        mode.set(0, self.modes[self.state.mode].number);
        mode
    }

    /// Returns mode and exact zeros.
    pub fn jump(&self) -> Jump {
        let LaneState { zeros, struck, projected, .. } = self.state;
        let set = |of: [bool; 3]| (0..3).filter(|i| of[usize::from(*i)]).map(hybrid::GuardId).collect();
        Jump { mode: self.mode(), pinned: set(zeros), still: GuardSet::default(), struck: set(struck), projected }
    }

    /// Runs to the start of the next cycle. Returns `false` if it cannot decide an event, and stays before it.
    pub fn cycle(&mut self, records: &mut LaneRecords) -> bool {
        let bound = self.structure.clock.at(self.state.at.cycle + 1, 0.0);
        let run = LaneRun {
            lane: self,
            limits: LaneLimits { bound, observed: Instant::LAST, events: MOST_EVENTS, steps: MOST_STEPS },
            records,
            host: &mut NoHost,
            arcs: WORTH,
            impact: None,
            returns: false,
        };
        run.lane.structure.instructions.run(run).end == LapEnd::Bound
    }

    /// Returns the record of a fall of `watch` at the current point, if it is a strike.
    #[inline(always)]
    fn strike(&self, watch: Watch) -> Option<[f64; 3]> {
        let LaneState { at, x, mode, .. } = &self.state;
        let strikes = self.modes[*mode].state == ContactMode::Separated && watch.side() != 0.0;
        strikes.then(|| [at.phase.value(), self.structure.deflection(0, *at, x).1, watch.side()])
    }

    /// Makes the jump of the guard of `watch` at the current point, its value known to `error`. Returns `false` if it is not decided here.
    #[inline(always)]
    fn fire(&mut self, watch: Watch, error: f64, records: &mut LaneRecords, host: &mut dyn LaneHost) -> bool {
        let (s, mode, at) = (self.structure, self.state.mode, self.state.at);
        let (c, side) = (&s.contacts[0], watch.side());
        let salts = self.salts && records.columns.is_some();
        let mut off = 0.0;
        if side != 0.0 {
            // As in `Structure::project`.
            let mut displaced = c.spec.error_offset;
            for w in &c.error {
                displaced += w.cosine * self.waves[w.index][0] + w.sine * self.waves[w.index][1];
            }
            off = side * c.gap() - (dot(&c.direction, &self.state.x) - displaced);
            if off.abs() > AGREED * (error + ROUNDING * s.deflection_size(c, &self.state.x)) {
                return false;
            }
        }
        if !salts && let Some(Edge { state, zeros, mode }) = self.modes[mode].edges[watch as usize] {
            let struck = self.is_rigid && side != 0.0;
            s.shift(std::iter::once(0), &[off], &mut self.state.x[..1]);
            self.state.projected = off.abs();
            self.state.struck = [false; 3];
            if struck {
                let Some(projected) = s.rebound_alone(watch, at, &mut self.state.x) else { return false };
                self.state.projected = projected.max(off.abs());
                self.state.struck = zeros;
            }
            let mode = mode.unwrap_or_else(|| {
                let mut mode = self.mode();
                s.enter(&mut mode, 0, state, at);
                self.meet(&mode, host)
            });
            (self.state.mode, self.state.zeros) = (mode, zeros);
            self.look_ahead();
            return true;
        }
        let fired = GuardSet::from_iter([guard_id(0, watch)]);
        let from = Jump { pinned: fired.clone(), ..self.jump() };
        let before = self.state.x;
        let mut x = before;
        let Ok(jump) = s.jump(&from, &fired, at, &mut x, &mut []) else { return false };
        if let Some(columns) = records.columns.as_mut().filter(|_| salts) {
            s.saltate((&from, &jump), (&fired, false, false), at, (&before, &x), &[], columns);
        }
        self.enter(at, x, &jump, f64::NAN, host);
        // A rebound leaves a rigid contact open; what else may follow an impact is decided each time.
        if !self.is_rigid || side != 0.0 && self.state.mode == mode && jump.still.is_empty() {
            let (state, zeros) = (self.modes[self.state.mode].state, self.state.zeros);
            let to = Some(self.state.mode).filter(|_| !self.is_scheduled || state == ContactMode::Separated);
            self.modes[mode].edges[watch as usize] = Some(Edge { state, zeros, mode: to });
        }
        jump.still.is_empty()
    }
}

impl hybrid::Lane for Lane<'_> {
    fn run(&mut self, point: LanePoint<'_>, limits: LaneLimits, host: &mut dyn LaneHost) -> Lap {
        let LanePoint { at, x, jump, carried, arcs, impact } = point;
        self.enter(*at, [x[0], x[1]], jump, carried.first().copied().unwrap_or(f64::NAN), host);
        let records = &mut LaneRecords::default();
        let run = LaneRun { lane: self, limits, records, host, arcs, impact, returns: true };
        let lap = run.lane.structure.instructions.run(run);
        if lap != Lap::default() {
            (*at, *jump) = (self.state.at, self.jump());
            x.copy_from_slice(&self.state.x);
            carried.clear();
            carried.push(self.state.carried);
        }
        lap
    }
}

impl Structure {
    /// Returns a lane for motions without observers, if the train has one.
    pub(crate) fn silent(&self) -> Option<Box<dyn hybrid::Lane + '_>> {
        if let Some(lane) = Lane::new(self) {
            return Some(Box::new(lane));
        }
        Some(Box::new(LinearLane::new(self)?))
    }
}

/// Run of a lane up to a bound, as work for a set of instructions.
struct LaneRun<'a, 's> {
    lane: &'a mut Lane<'s>,
    limits: LaneLimits,
    records: &'a mut LaneRecords,
    host: &'a mut dyn LaneHost,
    /// Number of arcs that the run has made.
    arcs: u64,
    /// Guard of an impact at the start, if any.
    impact: Option<hybrid::GuardId>,
    /// True if an undecided run returns to the start of the last arc of which something was decided.
    returns: bool,
}

impl Work for LaneRun<'_, '_> {
    type Output = Lap;

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> Lap {
        let Self { lane, limits, records, host, arcs, mut impact, returns } = self;
        let (s, clock) = (lane.structure, lane.structure.clock);
        let LaneLimits { bound, observed, events, steps } = limits;
        let mut lap = Lap::default();
        // Start of the last arc of which something was decided, and the work done up to it.
        let (mut last, mut done) = (lane.state, Lap::default());
        let mut rebound: Derivatives = [([f64::NAN; 3], f64::NAN); 2];
        'arcs: loop {
            let mut leaps = 0;
            loop {
                let at = lane.state.at;
                let switch = lane.state.switch.filter(|switch| *switch <= bound);
                let LaneMode { ways, is_exact, .. } = &lane.modes[lane.state.mode];
                let made = LeapCounts { arcs: arcs + lap.arcs, ..LeapCounts::default() };
                let Some(propagator) = ways.propagator(made).filter(|_| *is_exact) else { break 'arcs };
                // Far from the bound, a rough distance suffices.
                let mut span = clock.roughly(at, switch.unwrap_or(bound));
                if span < FAR * propagator.span {
                    span = clock.between(at, switch.unwrap_or(bound));
                }
                if span <= 0.0 && switch.is_none() {
                    return Lap { end: LapEnd::Bound, ..lap };
                }
                if span <= 0.0 || leaps == MOST_LEAPS || lap.steps >= steps || leaps == 0 && lap.events == events {
                    break 'arcs;
                }
                let bound_by = Bound { span, is_switch: switch.is_some() };
                let after = impact.is_some().then_some(&mut rebound);
                let leap = lane.leap(path, propagator, bound_by, after, records.columns.as_mut());
                let Some(leap) = leap else { break 'arcs };
                if leaps == 0 {
                    if let Some(guard) = impact.take() {
                        let (derivatives, rounding) = rebound[usize::from(guard.0)];
                        let left = clock.between(at, switch.unwrap_or(bound));
                        if host.ends(&Rebound { at, guard, derivatives, rounding, left }) {
                            return Lap { arcs: lap.arcs + 1, steps: lap.steps + 1, end: LapEnd::Sequence, ..lap };
                        }
                    }
                    lap.closes = true;
                    (last, done) = (lane.state, lap);
                    lap.arcs += 1;
                }
                (lap.steps, leaps) = (lap.steps + 1, leaps + 1);
                let was = lane.modes[lane.state.mode].state;
                records.times[was as usize] += leap.time;
                let state = &mut lane.state;
                if leap.is_bound {
                    state.at = switch.unwrap_or(bound);
                } else {
                    clock.pass(&mut state.at, leap.time);
                }
                // The start of the arc is never undone.
                if state.at >= observed || lap.steps % PASSED == 0 && host.pass(last.at).is_break() {
                    break 'arcs;
                }
                (state.x, state.zeros, state.carried) = (leap.x, [false; 3], leap.carried);
                lane.turn();
                if let Some((number, error)) = leap.falls {
                    let watch = lane.modes[lane.state.mode].ways.motion.guards[number].watch;
                    let strike = records.strikes.as_ref().and_then(|_| lane.strike(watch));
                    if !lane.fire(watch, error, records, host) {
                        break 'arcs;
                    }
                    if let Some(strikes) = &mut records.strikes {
                        strikes.extend(strike);
                    }
                    (lap.events, lap.fired) = (lap.events + 1, lap.fired + 1);
                    impact = lane.is_rigid.then_some(guard_id(0, watch)).filter(|_| watch != Watch::Force);
                    if let Some(events) = &mut records.events {
                        let is = lane.modes[lane.state.mode].state;
                        events.push(LaneEvent { was: was as u8, is: is as u8, watch: watch as u8 });
                    }
                    continue 'arcs;
                }
                if leap.is_bound && switch.is_some() {
                    let mode = s.switched(&lane.mode(), lane.state.at);
                    lane.state.mode = lane.meet(&mode, host);
                    lane.look_ahead();
                    lap.switches += 1;
                    continue 'arcs;
                }
                if leap.is_bound {
                    return Lap { end: LapEnd::Bound, ..lap };
                }
            }
        }
        if returns {
            lane.state = last;
            lane.turn();
            lap = done;
        }
        lap
    }
}
