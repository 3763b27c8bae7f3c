//! Lane: motion of a train of one degree of freedom with one contact, from event to event, without any output that is not requested.
//!
//! The results equal those of the engine with the same leaps, to the last bit. A lane shows no step, and makes only the records that are
//! requested. If a leap is not decided, if numbers do not agree, or if a contact comes to rest, the lane stops, and an engine continues.

use super::{
    Ways,
    lane_leap::{Bound, Derivatives},
    leap::MOST_LEAPS,
    linear_lane::LinearLane,
    propagator::MOST_INPUTS,
};
use crate::{
    gear::contact::Law,
    hybrid::{
        self, AGREED, GuardSet, HybridSystem, Instant, Jump, LaneEvent, LaneHost, LaneLimits, LanePoint, LaneRecords,
        LaneTangent, Lap, LapEnd, LeapCounts, Mode, PASSED, Rebound,
    },
    kernel::ROUNDING,
    system::{
        ContactMode, PiecesInForce, Spring, Structure, Watch, Wave, contact_mode, dot, guard_id, guard_of, piece,
    },
    vectors::{Path, Work},
};

/// Most values of a derivative that a lane advances: two columns.
const MOST_VALUES: usize = 4;
/// Least distance of a bound, in spans, at which it does not affect a leap.
const FAR: f64 = 4.0;

/// Values of the records at the start of an arc, to which an undecided run returns.
#[derive(Clone, Copy, Default)]
struct ArcStart {
    times: [f64; 5],
    columns: [f64; MOST_VALUES],
    volume: f64,
    events: usize,
}

impl ArcStart {
    fn of(records: &LaneRecords<'_>) -> Self {
        let mut columns = [0.0; MOST_VALUES];
        let mut volume = 0.0;
        if let Some(tangent) = &records.tangent {
            columns.iter_mut().zip(&tangent.columns.values).for_each(|(kept, value)| *kept = *value);
            volume = *tangent.volume;
        }
        let times = records.times.as_ref().map_or([0.0; 5], |times| times[0]);
        Self { times, columns, volume, events: records.events.as_ref().map_or(0, |events| events.len()) }
    }

    fn restore(&self, records: &mut LaneRecords<'_>) {
        if let Some(tangent) = &mut records.tangent {
            tangent.columns.values.iter_mut().zip(&self.columns).for_each(|(value, kept)| *value = *kept);
            *tangent.volume = self.volume;
        }
        if let Some(times) = &mut records.times {
            times[0] = self.times;
        }
        if let Some(events) = &mut records.events {
            events.truncate(self.events);
        }
    }
}

/// Mode that has occurred in the run, prepared for leaps.
pub struct LaneMode<'s> {
    /// Number of the contact in the mode.
    number: u16,
    state: ContactMode,
    pub ways: Ways<'s>,
    /// True if the exact flow of the mode may be used.
    pub is_exact: bool,
    /// True if the stiffness follows the schedule.
    is_followed: bool,
    /// `tr f_x`, 1/s.
    divergence: f64,
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
    is_rigid: bool,
    is_scheduled: bool,
    /// Piece of the schedule in force, if there is one.
    pieces: PiecesInForce,
    pub state: LaneState,
    pub waves: Waves,
}

impl<'s> Lane<'s> {
    /// Returns a lane for motions of `structure`; `None` unless the train has one degree of freedom and one contact, with a linear law or
    /// a rigid one, under a forcing of one period.
    pub fn new(structure: &'s Structure) -> Option<Self> {
        let [c] = &structure.contacts[..] else { return None };
        let is_rigid = c.spec.law.is_rigid();
        if !is_rigid && !matches!(c.spec.law, Law::KelvinVoigt(..)) {
            return None;
        }
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
            is_rigid,
            is_scheduled: matches!(c.spring, Spring::Scheduled(_)),
            pieces: PiecesInForce::default(),
            state,
            waves: [[0.0; 2]; MOST_INPUTS],
        })
    }

    fn enter(&mut self, at: Instant, x: [f64; 2], jump: &Jump, carried: f64, host: &mut dyn LaneHost) {
        let of = |set: &GuardSet| [0, 1, 2].map(|watch| set.contains(hybrid::GuardId(watch)));
        let (zeros, struck) = (of(&jump.pinned), of(&jump.struck));
        let mode = self.meet(&jump.mode, host);
        self.state = LaneState { at, x, mode, zeros, struck, projected: jump.projected, carried, switch: None };
        self.move_pieces();
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
            self.state.switch =
                if self.modes[self.state.mode].is_followed { self.pieces.first_end(&[0]) } else { None };
        }
    }

    /// Finds the piece of the schedule that is in force.
    #[inline(always)]
    fn move_pieces(&mut self) {
        if self.is_scheduled {
            self.pieces.move_to(&self.structure.clock, self.structure.schedules(), self.state.at);
        }
    }

    /// Returns the index of the mode in which the contact has `state`, and follows the piece in force.
    #[inline(always)]
    fn mode_of(&mut self, state: ContactMode, host: &mut dyn LaneHost) -> usize {
        let mut mode = Mode::default();
        self.structure.enter_piece(&mut mode, 0, state, |_| self.pieces.number(0));
        self.meet(&mode, host)
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
        let s = self.structure;
        let divergence = s.divergence(&s.gradient(mode, s.clock.instant(0.0), &self.state.x));
        let is_followed = s.followed(mode, 0).is_some();
        self.modes.push(LaneMode { number, state, ways, is_exact, is_followed, divergence, edges: [None; 3] });
        self.places[usize::from(number)] = self.modes.len() as u16;
        self.modes.len() - 1
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

    /// Returns the rate of the deflection at the current point.
    #[inline(always)]
    fn rate(&self) -> f64 {
        let c = &self.structure.contacts[0];
        let wave = |sum: f64, w: &Wave| sum + w.cosine * self.waves[w.index][0] + w.sine * self.waves[w.index][1];
        dot(&c.direction, &self.state.x[1..]) - c.error_rate.iter().fold(0.0, wave)
    }

    /// Adds the jump that the fall of `watch` made at the current point to `records`. The mode was `was` before it, with this rate of the
    /// deflection and this state.
    #[inline(always)]
    fn record(&self, watch: Watch, was: usize, (rate, x): (f64, [f64; 2]), records: &mut LaneRecords<'_>) {
        let [was, is] = [was, self.state.mode].map(|mode| self.modes[mode].state);
        if let Some(tangent) = records.tangent.as_mut().filter(|_| watch != Watch::Force) {
            self.structure.shear(0, (was, is), &[0.0; 2][..tangent.columns.count], tangent.columns);
        }
        if let Some(sizes) = &mut records.sizes {
            for x in [x, self.state.x] {
                sizes.iter_mut().zip(x).for_each(|(size, x)| *size = size.max(x.abs()));
            }
        }
        if let Some(events) = &mut records.events {
            events.push(LaneEvent { at: self.state.at, contact: 0, was, is, rate });
        }
    }

    /// Makes the jump of the guard of `watch` at the current point, its value known to `error`. Returns `false` if it is not decided here.
    #[inline(always)]
    fn fire(&mut self, watch: Watch, error: f64, host: &mut dyn LaneHost) -> bool {
        let (s, mode, at) = (self.structure, self.state.mode, self.state.at);
        let (c, side) = (&s.contacts[0], watch.side());
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
        if let Some(Edge { state, zeros, mode }) = self.modes[mode].edges[watch as usize] {
            let struck = self.is_rigid && side != 0.0;
            s.shift(std::iter::once(0), &[off], &mut self.state.x[..1]);
            self.state.projected = off.abs();
            self.state.struck = [false; 3];
            if struck {
                let Some(projected) = s.rebound_alone(watch, at, &mut self.state.x) else { return false };
                self.state.projected = projected.max(off.abs());
                self.state.struck = zeros;
            }
            self.move_pieces();
            self.state.mode = mode.unwrap_or_else(|| self.mode_of(state, host));
            self.state.zeros = zeros;
            self.look_ahead();
            return true;
        }
        let fired = GuardSet::from_iter([guard_id(0, watch)]);
        let from = Jump { pinned: fired.clone(), ..self.jump() };
        let mut x = self.state.x;
        let Ok(jump) = s.jump(&from, &fired, at, &mut x, &mut []) else { return false };
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
    fn makes(&self, records: &LaneRecords<'_>) -> bool {
        let few = |tangent: &LaneTangent<'_>| tangent.columns.values.len() <= MOST_VALUES;
        !self.is_rigid && records.tangent.as_ref().is_none_or(few)
    }

    fn run(
        &mut self,
        point: LanePoint<'_>,
        limits: LaneLimits,
        records: LaneRecords<'_>,
        host: &mut dyn LaneHost,
    ) -> Lap {
        let LanePoint { at, x, jump, carried, arcs, impact } = point;
        if self.is_scheduled {
            let s = self.structure;
            self.pieces.begin(&s.clock, s.schedules(), *at);
            // A start at a switch that its mode has not passed.
            if s.followed(&jump.mode, 0).is_some() && piece(&jump.mode, 0) != self.pieces.number(0) {
                return Lap::default();
            }
        }
        self.enter(*at, [x[0], x[1]], jump, carried.first().copied().unwrap_or(f64::NAN), host);
        let run = LaneRun { lane: self, limits, records, host, arcs, impact };
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
    /// Returns a lane for motions without calls to an observer, if the train has one.
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
    records: LaneRecords<'a>,
    host: &'a mut dyn LaneHost,
    /// Number of arcs that the run has made.
    arcs: u64,
    /// Guard of an impact at the start, if any.
    impact: Option<hybrid::GuardId>,
}

impl Work for LaneRun<'_, '_> {
    type Output = Lap;

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> Lap {
        let Self { lane, limits, mut records, host, arcs, mut impact } = self;
        let keeps = !records.is_empty();
        let clock = lane.structure.clock;
        let LaneLimits { bound, observed, events, steps } = limits;
        let (mut lap, mut next) = (Lap::default(), ArcStart::default());
        // Start of the last arc of which something was decided, and the work done up to it. An undecided run returns to it.
        let (mut last, mut done, mut kept) = (lane.state, Lap::default(), ArcStart::of(&records));
        let mut rebound: Derivatives = ([f64::NAN; 3], f64::NAN);
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
                let after = impact.as_ref().map(|guard| (guard_of(*guard).1, &mut rebound));
                if leaps == 0 && keeps {
                    next = ArcStart::of(&records);
                }
                let columns = records.tangent.as_mut().map(|tangent| &mut *tangent.columns);
                let Some(leap) = lane.leap(path, propagator, bound_by, after, columns) else { break 'arcs };
                if leaps == 0 {
                    if let Some(guard) = impact.take() {
                        let ((derivatives, rounding), until) = (rebound, switch.unwrap_or(bound));
                        if host.ends(&Rebound { at, guard, derivatives, rounding, until }) {
                            return Lap { arcs: lap.arcs + 1, steps: lap.steps + 1, end: LapEnd::Sequence, ..lap };
                        }
                    }
                    lap.closes = true;
                    (last, done) = (lane.state, lap);
                    if keeps {
                        kept = next;
                    }
                    lap.arcs += 1;
                }
                (lap.steps, leaps) = (lap.steps + 1, leaps + 1);
                let was = lane.state.mode;
                if let Some(times) = &mut records.times {
                    times[0][lane.modes[was].state as usize] += leap.time;
                }
                if let Some(tangent) = &mut records.tangent {
                    *tangent.volume += lane.modes[was].divergence * leap.time;
                }
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
                    let rate = if records.events.is_some() { lane.rate() } else { f64::NAN };
                    if !lane.fire(watch, error, host) {
                        break 'arcs;
                    }
                    if keeps {
                        lane.record(watch, was, (rate, leap.x), &mut records);
                    }
                    (lap.events, lap.fired) = (lap.events + 1, lap.fired + 1);
                    impact = lane.is_rigid.then_some(guard_id(0, watch)).filter(|_| watch != Watch::Force);
                    continue 'arcs;
                }
                if leap.is_bound && switch.is_some() {
                    lane.move_pieces();
                    lane.state.mode = lane.mode_of(lane.modes[was].state, host);
                    lane.look_ahead();
                    lap.switches += 1;
                    continue 'arcs;
                }
                if leap.is_bound {
                    return Lap { end: LapEnd::Bound, ..lap };
                }
            }
        }
        lane.state = last;
        lane.turn();
        if keeps {
            kept.restore(&mut records);
        }
        done
    }
}
