//! Lane of a train of several degrees of freedom with linear laws: leaps and unobserved steps from event to event.
//!
//! The results equal those of the engine with the same leaps and steps, to the last bit. The lane stops, and an engine continues from the
//! start of the last arc, where a step has to decide itself, where an event is near a switch, and where numbers do not agree.

use std::collections::BTreeMap;

use smallvec::SmallVec;

use super::{
    Ways,
    bare::{BareStep, FlankEnds},
    formed::{FEW_FREEDOMS, propagates},
    leap::MOST_LEAPS,
};
use crate::{
    hybrid::{
        self, AGREED, FULL_PRECISION, GATHERED, GuardSet, GuardValue, HybridSystem, Instant, JetRequest, Jump,
        LaneHost, LaneLimits, LanePoint, LaneRecords, Lap, LapEnd, Leap, LeapCounts, MOST_MODES, Mode, PASSED,
        are_finite,
    },
    kernel::{
        Four, LANES,
        mode::{compiled::LARGEST, motion::ModeGuard},
        series::start::turn,
    },
    system::{Contact, PiecesInForce, Spring, Structure, Watch, contact_mode, guard_id, piece},
    vectors::{Path, Work},
};

/// Time from an event to a switch, relative to the step, below which the engine decides if the event waits for the switch.
const FROM_SWITCH: f64 = 0.02;
/// Factor on the largest permitted value of a guard. The engine decides too if the guard changes by less up to the switch. The factor covers
/// the rounding that several steps of an arc gather.
const UNCERTAIN: f64 = 10.0;

/// Mode that has occurred in the run.
struct RunMode<'s> {
    ways: Ways<'s>,
    /// True if unobserved steps cover the mode, and its exact flow may be used.
    is_simple: bool,
    /// Contacts whose stiffness switches.
    followed: Vec<usize>,
    /// Number of the last lap that met the mode.
    lap: u64,
    /// Number of arcs of the run in the mode, now and before that lap.
    arcs: [u64; 2],
}

/// Start of an arc.
#[derive(Default)]
struct ArcStart {
    at: Instant,
    x: Vec<f64>,
    jump: Jump,
    carried: Vec<f64>,
    /// Index of the mode.
    index: usize,
}

impl ArcStart {
    fn keep(&mut self, point: &LanePoint<'_>, index: usize) {
        (self.at, self.index) = (*point.at, index);
        self.x.clear();
        self.x.extend_from_slice(point.x);
        self.jump.clone_from(point.jump);
        self.carried.clone_from(point.carried);
    }

    fn put_back(&self, point: &mut LanePoint<'_>) {
        *point.at = self.at;
        point.x.copy_from_slice(&self.x);
        point.jump.clone_from(&self.jump);
        point.carried.clone_from(&self.carried);
    }
}

/// End of a leap or of a step.
struct SpanEnd {
    time: f64,
    /// Length of the span on which guards are known, s.
    length: f64,
    /// Size of the time derivative of the guards that fall, in units of the guards per second.
    slope: f64,
    is_bound: bool,
    /// True if the guards at its start agree with those at the end of the one before, and the state at its end is finite.
    agrees: bool,
}

/// Lane of a train; the module comment describes it.
pub struct LinearLane<'s> {
    structure: &'s Structure,
    modes: Vec<RunMode<'s>>,
    /// Indices of the modes.
    indices: BTreeMap<Mode, usize>,
    /// Start of the last arc of which something was decided.
    start: ArcStart,
    /// The last leap or step: state, kept stretches, and rows.
    leap: Leap,
    step: BareStep,
    /// Guards that fall at its end, and the largest value that one may have by the state.
    fired: SmallVec<[ModeGuard; 8]>,
    most: f64,
    /// Guards of position at its end, if the arc goes on.
    ends: SmallVec<[FlankEnds; 4]>,
    pieces: PiecesInForce,
    /// Largest rounding of the guards of each contact in the lap, if formed from the state, m.
    rounding: SmallVec<[Four; 4]>,
    /// Number of laps made.
    laps: u64,
    /// True if some mode may have a propagator, which depends on the number of arcs in the mode.
    counts: bool,
}

impl<'s> LinearLane<'s> {
    /// Returns a lane for motions of `structure`; `None` unless it has 4 to 24 degrees of freedom, losses, a period, and linear laws. The laws
    /// must release by deflection, and their stiffnesses must not have harmonics.
    pub fn new(structure: &'s Structure) -> Option<Self> {
        let knows = |c: &Contact| {
            c.spec.law.is_linear() && c.spec.law.release_damping().is_none() && !matches!(c.spring, Spring::Waves(..))
        };
        let fits = (FEW_FREEDOMS + 1..=LARGEST).contains(&structure.n)
            && structure.dim == 2 * structure.n
            && !structure.is_conservative;
        (structure.contacts.iter().all(knows) && fits && structure.clock.period().is_some()).then(|| Self {
            structure,
            modes: Vec::new(),
            indices: BTreeMap::new(),
            start: ArcStart::default(),
            leap: Leap::default(),
            step: BareStep::default(),
            fired: SmallVec::new(),
            most: 0.0,
            ends: SmallVec::new(),
            pieces: PiecesInForce::default(),
            rounding: SmallVec::new(),
            laps: 0,
            counts: propagates(structure),
        })
    }

    /// Returns the index of the mode of an arc that begins. A new mode is formed; `None` if there is no room for it.
    fn meet(&mut self, mode: &Mode, host: &mut dyn LaneHost) -> Option<usize> {
        let index = self.indices.get(mode).copied().or_else(|| self.form(mode, host))?;
        let met = &mut self.modes[index];
        if self.counts && met.lap != self.laps {
            (met.lap, met.arcs) = (self.laps, [host.count(mode, 0); 2]);
        }
        met.arcs[0] += 1;
        Some(index)
    }

    fn form(&mut self, mode: &Mode, host: &mut dyn LaneHost) -> Option<usize> {
        if self.modes.len() >= MOST_MODES {
            return None;
        }
        let (s, is_exact) = (self.structure, host.is_exact(mode));
        let ways = Ways::new(s, mode);
        let is_simple = is_exact && ways.is_bare() && !ways.motion.is_varying && ways.motion.watched_forces.is_empty();
        let followed = (0..s.contacts.len()).filter(|j| s.followed(mode, *j).is_some()).collect();
        self.modes.push(RunMode { ways, is_simple, followed, lap: 0, arcs: [0; 2] });
        self.indices.insert(mode.clone(), self.modes.len() - 1);
        Some(self.modes.len() - 1)
    }

    /// Reports the arcs and the roundings of the lap to the host.
    fn report(&self, host: &mut dyn LaneHost) {
        // A bilateral contact has no guard, and the terms of its deflection are no displacements.
        let has_guard = |j: &usize| !self.structure.contacts[*j].spec.law.is_bilateral();
        for j in (0..self.structure.contacts.len()).filter(has_guard) {
            let rounding = self.rounding.get(j / LANES).map_or(0.0, |four| four[j % LANES]);
            if rounding > 0.0 {
                [Watch::DriveFlank, Watch::BackFlank].iter().for_each(|watch| host.meet(guard_id(j, *watch), rounding));
            }
        }
        for met in self.modes.iter().filter(|met| met.lap == self.laps && met.arcs[0] > met.arcs[1]) {
            host.count(&met.ways.motion.mode, met.arcs[0] - met.arcs[1]);
        }
    }

    /// Makes leap number `count` of an arc by the propagator of its mode. Returns `None` if it cannot.
    #[inline(always)]
    fn by_propagator<P: Path>(
        &mut self,
        path: P,
        index: usize,
        request: &JetRequest<'_>,
        count: u32,
    ) -> Option<SpanEnd> {
        let RunMode { ways, arcs, .. } = &self.modes[index];
        let made = LeapCounts { here: arcs[0], ..LeapCounts::default() };
        let (motion, leap) = (&ways.motion, &mut self.leap);
        let propagator = ways.propagator(made).filter(|of| count < MOST_LEAPS && of.fold.holds(motion, request))?;
        leap.twins = GuardSet::default();
        if !propagator.leap(path, motion, request, leap) {
            return None;
        }
        let leap = &self.leap;
        let agrees = |(guard, start): (&ModeGuard, &GuardValue)| {
            let (four, lane) = (guard.contact / LANES, guard.contact % LANES);
            self.ends.get(four).is_none_or(|end| {
                let off = (start.value - end.values[guard.watch as usize][lane]).abs();
                off <= AGREED * (end.error[lane] + start.error)
            })
        };
        let agrees = motion.guards.iter().zip(&leap.starts).all(agrees);
        self.rounding.resize(motion.flanks.len(), [0.0; LANES]);
        for (guard, start) in motion.guards.iter().zip(&leap.starts) {
            let largest = &mut self.rounding[guard.contact / LANES][guard.contact % LANES];
            *largest = largest.max(start.error);
        }
        self.fired.clear();
        self.ends.clear();
        if let Some(passage) = leap.passage {
            let falls = |guard: &&ModeGuard| guard.id == passage.guard || leap.twins.contains(guard.id);
            self.fired.extend(motion.guards.iter().filter(falls).copied());
            let afresh = leap.starts.iter().find(|start| start.guard == passage.guard).map_or(0.0, |start| start.error);
            self.most = AGREED * passage.error + GATHERED * afresh;
        } else {
            self.ends.resize(motion.flanks.len(), FlankEnds::default());
            for ((guard, start), end) in motion.guards.iter().zip(&leap.starts).zip(&leap.ends) {
                let of = &mut self.ends[guard.contact / LANES];
                let lane = guard.contact % LANES;
                of.values[guard.watch as usize][lane] = end.value;
                of.error[lane] = of.error[lane].max(end.error + start.error);
            }
        }
        let slope = leap.passage.map_or(0.0, |passage| passage.slope.abs());
        Some(SpanEnd { time: leap.time, length: propagator.span, slope, is_bound: leap.is_bound, agrees })
    }

    /// Makes a step. Returns `None` if it has to decide itself.
    #[inline(always)]
    fn by_series<P: Path>(&mut self, path: P, index: usize, request: &JetRequest<'_>) -> Option<SpanEnd> {
        let (ways, Leap { jet, x, carried, .. }, step) = (&self.modes[index].ways, &mut self.leap, &mut self.step);
        let motion = &ways.motion;
        let formed = ways.bare_step(path, request, jet, step)?;
        let gained = formed.finish(path, step, jet, (x, carried));
        let (step, jet) = (&self.step, &self.leap.jet);
        let agrees = step.agrees(path, motion, &self.ends) && are_finite(&self.leap.x);
        step.largest_rounding(path, &mut self.rounding);
        self.fired.clear();
        self.ends.clear();
        if step.first.is_some() {
            self.fired.extend(step.fired(motion).copied());
            let [error, afresh] = step.errors();
            self.most = AGREED * error + GATHERED * afresh;
        } else {
            step.ends(path, motion, &gained, &mut self.ends);
        }
        let (time, length) = (jet.time_at(step.limit), jet.time_at(1.0));
        let slope = step.first.as_ref().map_or(0.0, |fall| fall.slope.abs() / length);
        Some(SpanEnd { time, length, slope, is_bound: step.is_bound, agrees })
    }

    /// Makes the jump of the guards that fall. Returns `false` if it is not decided here.
    #[inline(always)]
    fn fire(&mut self, point: &mut LanePoint<'_>) -> bool {
        let Self { structure: s, leap, fired: guards, most, pieces, .. } = self;
        let at = *point.at;
        let fired: GuardSet = guards.iter().map(|guard| guard.id).collect();
        // The rule of `Structure::jump` for flanks of compliant contacts.
        let rows = &mut leap.jet.rows;
        rows.fit(s.n, s.contacts.len(), s.oscillators.len());
        turn(s, at, rows);
        let error = |j: usize| {
            let c = &s.contacts[j];
            c.error.iter().fold(c.spec.error_offset, |sum, w| {
                let [cosine, sine] = &rows.oscillators[w.index];
                sum + (w.cosine * cosine[0] + w.sine * sine[0])
            })
        };
        let equal = s.equal(point.x);
        let flanks = guards.iter().map(|guard| (guard.contact, guard.watch.side()));
        let projected = s.project(flanks, at, error, point.x, &mut []);
        if projected > *most {
            return false;
        }
        s.restore_equal(&equal, point.x, &mut []);
        pieces.move_to(&s.clock, s.schedules(), at);
        for guard in guards.iter() {
            let (j, mode) = (guard.contact, &mut point.jump.mode);
            let Some(next) = contact_mode(mode, j).after(guard.watch) else { return false };
            s.enter_piece(mode, j, next, |_| pieces.number(j));
        }
        (point.jump.pinned, point.jump.projected) = (fired, projected);
        (point.jump.still, point.jump.struck) = Default::default();
        true
    }
}

impl hybrid::Lane for LinearLane<'_> {
    fn makes(&self, records: &LaneRecords<'_>) -> bool {
        records.is_empty()
    }

    fn run(
        &mut self,
        mut point: LanePoint<'_>,
        limits: LaneLimits,
        _: LaneRecords<'_>,
        host: &mut dyn LaneHost,
    ) -> Lap {
        let (s, mode) = (self.structure, &point.jump.mode);
        self.ends.clear();
        self.rounding.clear();
        self.pieces.begin(&s.clock, s.schedules(), *point.at);
        // A start at a switch that its mode has not passed.
        let is_late = |j: usize| s.followed(mode, j).is_some() && piece(mode, j) != self.pieces.number(j);
        if (0..s.contacts.len()).any(is_late) {
            return Lap::default();
        }
        self.laps += 1;
        if self.modes.len() >= MOST_MODES {
            self.modes.clear();
            self.indices.clear();
        }
        let lap = s.instructions.run(LinearRun { lane: self, point: &mut point, limits, host });
        self.report(host);
        lap
    }
}

/// Run of a lane up to a bound, as work for a set of instructions.
struct LinearRun<'a, 'p, 's> {
    lane: &'a mut LinearLane<'s>,
    point: &'a mut LanePoint<'p>,
    limits: LaneLimits,
    host: &'a mut dyn LaneHost,
}

impl Work for LinearRun<'_, '_, '_> {
    type Output = Lap;

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> Lap {
        let Self { lane, point, limits: LaneLimits { bound, observed, events, steps }, host } = self;
        let (s, clock) = (lane.structure, lane.structure.clock);
        // Work done, and that up to the start of the last arc of which something was decided.
        let (mut lap, mut done) = (Lap::default(), Lap::default());
        'arcs: loop {
            let Some(index) = lane.meet(&point.jump.mode, host) else { break 'arcs };
            lane.pieces.move_to(&clock, s.schedules(), *point.at);
            let switch = lane.pieces.first_end(&lane.modes[index].followed).filter(|switch| *switch <= bound);
            let until = switch.unwrap_or(bound);
            let (mut count, mut by_series) = (0, false);
            loop {
                let (at, span) = (*point.at, clock.between(*point.at, until));
                let is_spent = lap.steps >= steps || count == 0 && lap.events >= events;
                let request = JetRequest {
                    at,
                    x: point.x,
                    low: &[],
                    pinned: &point.jump.pinned,
                    still: GuardSet::none(),
                    carried: point.carried,
                    span,
                    tolerance: FULL_PRECISION,
                    left_out: [0.0; 2],
                };
                let mut end = None;
                if lane.modes[index].is_simple && !is_spent && !clock.is_no_time(at, span) {
                    if !by_series {
                        end = lane.by_propagator(path, index, &request, count);
                    }
                    if end.is_none() {
                        by_series = true;
                        end = lane.by_series(path, index, &request);
                    }
                }
                let falls = !lane.fired.is_empty();
                let is_clear = |end: &SpanEnd| {
                    let left = span - end.time;
                    let is_near = left <= FROM_SWITCH * end.length || left * end.slope <= UNCERTAIN * lane.most;
                    let is_near = falls && switch.is_some() && is_near;
                    end.agrees && !is_near && clock.is_progress(at, end.time, span)
                };
                let Some(SpanEnd { time, is_bound, .. }) = end.filter(is_clear) else {
                    lane.modes[index].arcs[0] -= u64::from(count == 0);
                    break 'arcs;
                };
                if count == 0 {
                    lap.closes = true;
                    done = lap;
                    lane.start.keep(point, index);
                    lap.arcs += 1;
                }
                count += 1;
                lap.steps += 1;
                if by_series {
                    lap.splits += lane.step.splits;
                }
                *point.at = if is_bound { until } else { clock.advance(at, time) };
                // The start of the arc is never undone.
                if *point.at >= observed || lap.steps % PASSED == 0 && host.pass(lane.start.at).is_break() {
                    break 'arcs;
                }
                point.x.copy_from_slice(&lane.leap.x);
                std::mem::swap(point.carried, &mut lane.leap.carried);
                point.jump.pinned = GuardSet::default();
                if falls {
                    (lap.events, lap.fired) = (lap.events + 1, lap.fired + lane.fired.len() as u64);
                    if !lane.fire(point) {
                        break 'arcs;
                    }
                    continue 'arcs;
                }
                if is_bound && switch.is_some() {
                    point.jump.mode = s.switched(&point.jump.mode, *point.at);
                    lap.switches += 1;
                    continue 'arcs;
                }
                if is_bound {
                    return Lap { end: LapEnd::Bound, ..lap };
                }
            }
        }
        if done.closes {
            lane.start.put_back(point);
            lane.modes[lane.start.index].arcs[0] -= 1;
        }
        done
    }
}
