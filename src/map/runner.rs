//! Lane, with an engine for what it cannot decide: cycles, and orbits by Newton's method in arrays of two.

use std::{collections::VecDeque, ops::ControlFlow};

use nalgebra::DMatrix;

use crate::{
    engine::{Engine, JumpRecord, Observer, Outcome, State},
    hybrid::{Instant, Mode, Watch},
    integrate::DenseStep,
    kernel::{Lane, LaneEvent, LaneRecords},
    orbit::{
        Approach, ApproachEnd, Drift, Image, NewtonFailure, Orbit, Section, SectionMap, Unknowns,
        frame::{column, rate_scale},
        mover::Mover,
        newton::{CLOSED, Options, SAME},
        unknowns::distance,
        words,
    },
    simulation::{Simulation, SimulationError},
    system::{Columns, ContactMode, Structure, contact_mode, guard_of},
    tangent::Tangent,
    task::Task,
};

/// Maximum number of steps of Newton's method.
const STEPS: usize = 12;
/// Length of a step, in scales, after which the method ends.
const SHORT: f64 = 1e-13;

type Pair = [f64; 2];

/// Cycles from a state, in two dimensions.
struct PlaneImage {
    x: Pair,
    /// Section after each cycle.
    ends: Vec<Section>,
    /// Derivative of the last state, rows of two.
    derivative: Vec<f64>,
    events: Vec<LaneEvent>,
    scales: Vec<f64>,
    /// Last state minus the first, in scales, and its length.
    off: Pair,
    residual: f64,
}

/// Observer of the engine where a lane has stopped.
struct RunnerObserver<'a, 's> {
    structure: &'s Structure,
    records: &'a mut LaneRecords,
    tangent: Option<Tangent<'s>>,
    /// True if a contact has come to rest.
    rests: bool,
}

impl RunnerObserver<'_, '_> {
    fn add(&mut self, mode: &Mode, time: f64) {
        self.records.times[contact_mode(mode, 0) as usize] += time;
    }
}

impl Observer for RunnerObserver<'_, '_> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.tangent.as_ref().is_some_and(|tangent| tangent.wants_steps(mode, until))
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.add(mode, time);
        self.tangent.as_mut().map_or(ControlFlow::Continue(()), |tangent| tangent.leap(mode, time))
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.add(mode, step.time(until));
        self.tangent.as_mut().map_or(ControlFlow::Continue(()), |tangent| tangent.step(mode, step, until))
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        let [was, is] = [jumped.from, jumped.to].map(|jump| contact_mode(&jump.mode, 0));
        self.rests |= jumped.settles || (is != ContactMode::Separated && !jumped.to.struck.is_empty());
        let rate = self.structure.deflection(0, jumped.at, jumped.x_minus).1;
        let watch = jumped.fired.iter().next().map_or(Watch::Force, |id| guard_of(id).1);
        if let Some(strikes) =
            self.records.strikes.as_mut().filter(|_| was == ContactMode::Separated && watch.side() != 0.0)
        {
            strikes.push([jumped.at.phase.value(), rate, watch.side()]);
        }
        if let Some(events) = &mut self.records.events {
            events.push(LaneEvent { was: was as u8, is: is as u8, watch: watch as u8 });
        }
        if let Some(tangent) = &mut self.tangent {
            tangent.jump(jumped);
        }
    }
}

/// Lane, with an engine for what it cannot decide.
pub(super) struct Runner<'s> {
    simulation: &'s Simulation,
    map: SectionMap<'s>,
    drift: Drift,
    lane: Lane<'s>,
    engine: Option<Engine<'s>>,
    /// Records of the cycles that are run.
    pub records: LaneRecords,
}

impl<'s> Runner<'s> {
    /// Returns a runner for motions of `simulation` from starts at phase 0; `None` if a lane cannot run its train.
    pub fn new(simulation: &'s Simulation) -> Result<Option<Self>, SimulationError> {
        let Some(lane) = Lane::new(&simulation.structure) else { return Ok(None) };
        let map = SectionMap::new(simulation)?;
        let (clock, start) = (simulation.clock(), simulation.instants()[0]);
        let is_between = clock.between(clock.at(start.cycle, 0.0), start) > 0.0;
        let is_rigid = simulation.structure.contacts()[0].spec.law.is_rigid();
        let fits = !is_between && !is_rigid && !simulation.settings.verify;
        // The contact holds the only freedom: nothing drifts.
        let (drift, records) = (Drift::default(), LaneRecords::default());
        Ok(fits.then(|| Self { simulation, map, drift, lane, engine: None, records }))
    }

    /// Starts at `state`.
    pub fn begin(&mut self, state: &State) {
        self.lane.place(state.at, [state.x[0], state.x[1]], &state.jump);
    }

    /// Runs some cycles and returns what they record; `None` if the lane stops. The runner's own records stay. Calls `each` after every
    /// cycle.
    fn recorded(
        &mut self,
        cycles: u64,
        records: LaneRecords,
        mut each: impl FnMut(&Self),
    ) -> Result<Option<LaneRecords>, SimulationError> {
        let (own, mut goes_on) = (std::mem::replace(&mut self.records, records), Ok(true));
        for _ in 0..cycles {
            goes_on = self.cycle();
            if !matches!(goes_on, Ok(true)) {
                break;
            }
            each(self);
        }
        let records = std::mem::replace(&mut self.records, own);
        Ok(goes_on?.then_some(records))
    }

    /// Returns the times in each state of the contact over some cycles from a section.
    pub fn times(&mut self, section: &Section, cycles: u64) -> Result<Option<[f64; 5]>, SimulationError> {
        let state = self.map.state(section)?;
        self.begin(&state);
        Ok(self.recorded(cycles, LaneRecords::default(), |_| ())?.map(|records| records.times))
    }

    /// Returns `period` cycles from `x`, with their derivative; `None` if the lane stops.
    fn image(&mut self, x: Pair, period: u64) -> Result<Option<PlaneImage>, SimulationError> {
        let state = self.map.state(&Section { x: x.to_vec(), ..self.section() })?;
        self.begin(&state);
        let records =
            LaneRecords { columns: Some(Columns::unit(2)), events: Some(Vec::new()), ..LaneRecords::default() };
        let mut ends = Vec::with_capacity(period as usize);
        let records = self.recorded(period, records, |lane| ends.push(lane.section()))?;
        let Some(LaneRecords { columns: Some(columns), events: Some(events), .. }) = records else { return Ok(None) };
        let size = |i: usize| ends.iter().fold(x[i].abs(), |m, end: &Section| m.max(end.x[i].abs()));
        let scales = self.map.scales(&[size(0), size(1)]);
        let end = self.point();
        let off = [(end[0] - x[0]) / scales[0], (end[1] - x[1]) / scales[1]];
        let residual = libm::hypot(off[0], off[1]);
        Ok(Some(PlaneImage { x, ends, derivative: columns.values, events, scales, off, residual }))
    }

    /// Returns the cycles of an orbit of `period` cycles near `x`, by Newton's method; `None` if it does not converge.
    fn closed(&mut self, x: Pair, period: u64, patience: usize) -> Result<Option<PlaneImage>, SimulationError> {
        let Some(mut now) = self.image(x, period)? else { return Ok(None) };
        let first = now.residual;
        for step in 0..STEPS {
            if step == patience && now.residual > 0.5 * first || !now.residual.is_finite() {
                return Ok(None);
            }
            let PlaneImage { x, scales, off, .. } = &now;
            let (a, d) = (now.derivative[0] - 1.0, now.derivative[3] - 1.0);
            let (b, c) = (now.derivative[1] * scales[1] / scales[0], now.derivative[2] * scales[0] / scales[1]);
            let determinant = a * d - b * c;
            let change = [(b * off[1] - d * off[0]) / determinant, (c * off[0] - a * off[1]) / determinant];
            let next = [x[0] + scales[0] * change[0], x[1] + scales[1] * change[1]];
            let length = libm::hypot(change[0], change[1]);
            let better = if length <= SHORT || !length.is_finite() {
                None
            } else {
                self.image(next, period)?.filter(|next| next.residual < now.residual)
            };
            match better {
                Some(better) => now = better,
                None if now.residual <= CLOSED => break,
                None => return Ok(None),
            }
        }
        let apart = |k: &u64| distance(&self.map, &now.x, &now.ends[*k as usize - 1], &now.scales, &self.drift);
        match (1..period).filter(|k| period.is_multiple_of(*k)).find(|k| apart(k) <= SAME) {
            _ if now.residual > CLOSED => Ok(None),
            Some(shorter) => self.closed(now.x, shorter, STEPS),
            None => Ok(Some(now)),
        }
    }

    /// Returns the tokens of events.
    fn tokens(events: &[LaneEvent]) -> Vec<String> {
        let token = |passed: &LaneEvent| {
            let (was, is, watch) = passed.parts();
            words::token(0, was, is, false).unwrap_or_else(|| words::write_token('i', 0, watch.side()))
        };
        events.iter().map(token).collect()
    }

    /// Returns an orbit with its multipliers.
    fn orbit(&self, PlaneImage { x, ends, derivative, events, residual, .. }: PlaneImage) -> Orbit {
        let section = Section { x: x.to_vec(), ..self.section() };
        let image = Image::of_cycles(&x, ends, DMatrix::from_row_slice(2, 2, &derivative), Self::tokens(&events));
        let unknowns = Unknowns::new(&self.map, &image, &self.drift);
        let factor = unknowns.reduced(&image.jacobian);
        Orbit::of(section, image, (&unknowns, &[factor]), residual, f64::NAN)
    }
}

impl<'s> Mover<'s> for Runner<'s> {
    type Point = Pair;

    fn map(&self) -> (SectionMap<'s>, &Drift) {
        (self.map, &self.drift)
    }

    fn point(&self) -> Pair {
        self.lane.x()
    }

    fn section(&self) -> Section {
        Section { x: self.point().to_vec(), contacts: vec![contact_mode(&self.lane.jump().mode, 0)] }
    }

    /// Runs one cycle. Returns `false` also where a contact comes to rest.
    fn cycle(&mut self) -> Result<bool, SimulationError> {
        let records = &mut self.records;
        if self.lane.cycle(records) {
            return Ok(true);
        }
        let structure = &self.simulation.structure;
        let state = State { at: self.lane.at(), x: self.lane.x().to_vec(), jump: self.lane.jump() };
        let end = structure.clock().at(state.at.cycle + 1, 0.0);
        let tangent = records.columns.take().map(|columns| Tangent::of(structure, columns));
        let engine = match &mut self.engine {
            Some(engine) => {
                engine.restart(self.simulation.integrator()?.0, state);
                engine
            }
            none => none.insert(self.simulation.engine(state)?),
        };
        let mut observer = RunnerObserver { structure, records, tangent, rests: false };
        let outcome = engine.run(end, &mut observer)?;
        let RunnerObserver { tangent, rests, .. } = observer;
        let is_resolved = tangent.as_ref().is_none_or(|tangent| !tangent.is_unresolved);
        records.columns = tangent.map(|tangent| tangent.columns);
        if outcome != Outcome::ReachedEnd || rests || !is_resolved {
            return Ok(false);
        }
        let State { at, x, jump } = engine.state();
        self.lane.place(*at, [x[0], x[1]], jump);
        Ok(true)
    }

    fn spell(&mut self, cycles: u64, points: &mut VecDeque<Pair>) -> Result<Option<Vec<String>>, SimulationError> {
        let records = LaneRecords { events: Some(Vec::new()), ..LaneRecords::default() };
        let records = self.recorded(cycles, records, |lane| points.push_back(lane.point()))?;
        Ok(records.map(|records| Self::tokens(&records.events.unwrap_or_default())))
    }

    fn solve(&mut self, period: u64, options: Options<'_>) -> Result<Orbit, NewtonFailure> {
        let (at, x, jump) = (self.lane.at(), self.point(), self.lane.jump());
        let closed = self.closed(x, period, options.patience.unwrap_or(STEPS));
        let orbit = closed.map(|closed| closed.map(|closed| self.orbit(closed)));
        self.lane.place(at, x, &jump);
        orbit?.ok_or_else(|| NewtonFailure {
            residual: f64::INFINITY,
            reason: "Newton's method does not converge from here".to_owned(),
        })
    }

    fn aside(&mut self, approach: Approach, task: Task<'_>) -> Result<Option<ApproachEnd>, SimulationError> {
        let (at, x, jump) = (self.lane.at(), self.point(), self.lane.jump());
        let own = std::mem::take(&mut self.records);
        let found = approach.along(self, task);
        self.records = own;
        self.lane.place(at, x, &jump);
        found
    }

    fn carry(&mut self) {
        self.records = LaneRecords { columns: Some(column(self.simulation)), ..LaneRecords::default() };
    }

    fn growth(&mut self) -> (f64, bool) {
        let Some(columns) = &mut self.records.columns else { return (f64::NAN, true) };
        let norm = libm::hypot(columns.values[0], columns.values[1] / rate_scale(self.simulation));
        columns.values.iter_mut().for_each(|value| *value /= norm);
        (libm::log(norm), false)
    }
}
