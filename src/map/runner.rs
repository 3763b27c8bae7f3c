//! Lane, with an engine for what it cannot decide: sections, images with their derivatives, orbits.

use std::ops::ControlFlow;

use crate::{
    engine::{Engine, JumpRecord, Observer, Outcome, State},
    gear::contact::Law,
    hybrid::{Instant, Mode, Watch},
    integrate::DenseStep,
    kernel::{Lane, LaneEvent, LaneRecords},
    orbit::{
        Section, SectionMap,
        approach::{BESIDE, CONTRACTS, DOUBLINGS, FOLLOWED, NEAR, PATIENCE},
        frame::rate_scale,
        newton::{CLOSED, MARGINAL, SAME},
        rest::{NEUTRAL, returns},
        words,
    },
    simulation::{Simulation, SimulationError},
    system::{Columns, ContactMode, Structure, contact_mode, guard_of},
    tangent::Tangent,
};

/// Maximum number of steps of Newton's method.
const STEPS: usize = 12;

pub(super) type Pair = [f64; 2];
type Square = [[f64; 2]; 2];

fn product(a: &Square, b: &Square) -> Square {
    let entry = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j];
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

/// Returns `|a − b|` in scales.
pub(super) fn apart(a: Pair, b: Pair, scales: Pair) -> f64 {
    libm::hypot((a[0] - b[0]) / scales[0], (a[1] - b[1]) / scales[1])
}

/// An orbit in two dimensions.
#[derive(Clone, Debug)]
pub(super) struct Closed {
    pub x: Pair,
    pub period: usize,
    /// Derivative over the period, in scales.
    derivative: Square,
    pub events: Vec<LaneEvent>,
    pub times: [f64; 5],
    pub residual: f64,
    scales: Pair,
}

impl Closed {
    /// Returns the absolute values of the multipliers, the larger one first.
    pub fn sizes(&self) -> Pair {
        let [[a, b], [c, d]] = self.derivative;
        let (half, determinant) = (0.5 * (a + d), a * d - b * c);
        let square = half * half - determinant;
        if square < 0.0 {
            return [determinant.sqrt(); 2];
        }
        let larger = half.abs() + square.sqrt();
        [larger, if larger > 0.0 { (determinant / larger).abs() } else { 0.0 }]
    }

    /// Returns `Σ (Jⁱ)ᵀ Jⁱ`: the measure of the distance that falls along the motion.
    fn attraction(&self) -> Square {
        let (mut sum, mut power) = ([[1.0, 0.0], [0.0, 1.0]], self.derivative);
        for _ in 0..DOUBLINGS {
            let transposed = [[power[0][0], power[1][0]], [power[0][1], power[1][1]]];
            let added = product(&transposed, &product(&sum, &power));
            sum.iter_mut().flatten().zip(added.iter().flatten()).for_each(|(s, a)| *s += a);
            power = product(&power, &power);
            if power.iter().flatten().all(|p| p.abs() <= f64::MIN_POSITIVE.sqrt()) {
                break;
            }
        }
        sum
    }

    /// Returns the measure of a state's distance, and its decrease in a period.
    fn off(&self, attraction: &Square, x: Pair) -> Pair {
        let y = [(x[0] - self.x[0]) / self.scales[0], (x[1] - self.x[1]) / self.scales[1]];
        let along = |row: &Pair| row[0] * y[0] + row[1] * y[1];
        [y[0] * along(&attraction[0]) + y[1] * along(&attraction[1]), y[0] * y[0] + y[1] * y[1]]
    }
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
    pub map: SectionMap<'s>,
    lane: Lane<'s>,
    engine: Option<Engine<'s>>,
}

/// Stop of a lane: a contact has come to rest, or the limit on events is reached.
pub(super) struct LaneStop;

impl<'s> Runner<'s> {
    /// Returns a runner for motions of `simulation` from starts at phase 0; `None` if a lane cannot run its train.
    pub fn new(simulation: &'s Simulation) -> Result<Option<Self>, SimulationError> {
        let Some(lane) = Lane::new(&simulation.structure) else { return Ok(None) };
        let map = SectionMap::new(simulation)?;
        let (clock, start) = (simulation.clock(), simulation.instants()[0]);
        let is_between = clock.between(clock.at(start.cycle, 0.0), start) > 0.0;
        let is_rigid = simulation.structure.contacts()[0].spec.law.is_rigid();
        let fits = !is_between && !is_rigid && !simulation.settings.verify;
        Ok(fits.then(|| Self { simulation, map, lane, engine: None }))
    }

    /// Returns whether the train has damping.
    pub fn shrinks(&self) -> bool {
        let spec = self.simulation.structure.spec();
        spec.damping[(0, 0)] > 0.0 || matches!(spec.contacts[0].law, Law::KelvinVoigt(law, _) if law.damping > 0.0)
    }

    /// Starts at `state`.
    pub fn begin(&mut self, state: &State) {
        self.lane.place(state.at, [state.x[0], state.x[1]], &state.jump);
    }

    /// The mode.
    pub fn mode(&self) -> Mode {
        self.lane.jump().mode
    }

    /// The state.
    pub fn x(&self) -> Pair {
        self.lane.x()
    }

    /// Runs one cycle. The inner error if the lane stops.
    pub fn cycle(&mut self, records: &mut LaneRecords) -> Result<Result<(), LaneStop>, SimulationError> {
        if self.lane.cycle(records) {
            return Ok(Ok(()));
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
            return Ok(Err(LaneStop));
        }
        let State { at, x, jump } = engine.state();
        self.lane.place(*at, [x[0], x[1]], jump);
        Ok(Ok(()))
    }

    /// Returns the logarithm by which the recorded column has grown, as a row of exponents, and scales the column to length one.
    pub fn growth(&self, records: &mut LaneRecords) -> Option<[f64; 1]> {
        let values = &mut records.columns.as_mut()?.values;
        let norm = libm::hypot(values[0], values[1] / rate_scale(self.simulation));
        values.iter_mut().for_each(|value| *value /= norm);
        Some([libm::log(norm)])
    }

    /// Returns the scales of displacements and velocities, from some sections.
    pub fn scales(&self, sections: &[Pair]) -> Pair {
        let size = |i: usize| sections.iter().fold(0.0, |m: f64, x| m.max(x[i].abs()));
        let scales = self.map.scales(&[size(0), size(1)]);
        [scales[0], scales[1]]
    }

    /// Starts at a section; returns whether this succeeds.
    fn place(&mut self, x: Pair) -> bool {
        match self.map.state(&self.section(x)) {
            Ok(state) => {
                self.lane.place(state.at, [state.x[0], state.x[1]], &state.jump);
                true
            }
            Err(_) => false,
        }
    }

    /// Returns the section after `period` cycles from `x`, with its derivative in scales.
    fn image(&mut self, x: Pair, period: usize, scales: Pair) -> Result<Option<(Closed, Vec<Pair>)>, SimulationError> {
        if !self.place(x) {
            return Ok(None);
        }
        let mut records =
            LaneRecords { columns: Some(Columns::unit(2)), events: Some(Vec::new()), ..LaneRecords::default() };
        let mut between = Vec::with_capacity(period);
        for _ in 0..period {
            if self.cycle(&mut records)?.is_err() {
                return Ok(None);
            }
            between.push(self.lane.x());
        }
        let values = records.columns.map_or_else(Vec::new, |columns| columns.values);
        let entry = |i: usize, j: usize| values[2 * i + j] * scales[j] / scales[i];
        let derivative = [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]];
        let residual = apart(x, self.lane.x(), scales);
        let (events, times) = (records.events.unwrap_or_default(), records.times);
        Ok(Some((Closed { x, period, derivative, events, times, residual, scales }, between)))
    }

    /// Returns the orbit of `period` cycles near `x`, by Newton's method.
    fn solve(&mut self, x: Pair, period: usize, scales: Pair) -> Result<Option<Closed>, SimulationError> {
        let Some(mut now) = self.image(x, period, scales)? else { return Ok(None) };
        let first = now.0.residual;
        for step in 0..STEPS {
            let (closed, between) = &now;
            if step == PATIENCE && closed.residual > 0.5 * first || !closed.residual.is_finite() {
                return Ok(None);
            }
            let end = between[period - 1];
            let [[a, b], [c, d]] = closed.derivative;
            let (a, d) = (a - 1.0, d - 1.0);
            let determinant = a * d - b * c;
            let off = [(end[0] - closed.x[0]) / scales[0], (end[1] - closed.x[1]) / scales[1]];
            let change = [(b * off[1] - d * off[0]) / determinant, (c * off[0] - a * off[1]) / determinant];
            let next = [closed.x[0] + scales[0] * change[0], closed.x[1] + scales[1] * change[1]];
            let is_small = libm::hypot(change[0], change[1]) <= 1e-13;
            let better = if is_small || !change[0].is_finite() || !change[1].is_finite() {
                None
            } else {
                self.image(next, period, scales)?.filter(|next| next.0.residual < closed.residual)
            };
            match better {
                Some(better) => now = better,
                None if now.0.residual <= CLOSED => break,
                None => return Ok(None),
            }
        }
        let (closed, between) = now;
        if closed.residual > CLOSED {
            return Ok(None);
        }
        let shorter =
            (1..period).find(|k| period.is_multiple_of(*k) && apart(closed.x, between[k - 1], scales) <= SAME);
        match shorter {
            Some(shorter) => self.solve(closed.x, shorter, scales),
            None => Ok(Some(closed)),
        }
    }

    /// Returns a stable orbit near the last of `sections` that the motion follows. The lane is at that section before and after, or further
    /// along the motion. Sections run meanwhile are added.
    pub fn candidate(
        &mut self,
        sections: &mut Vec<Pair>,
        longest: usize,
        unstable: &mut Vec<Pair>,
    ) -> Result<Result<Option<Closed>, LaneStop>, SimulationError> {
        let kept = sections.len().min(101);
        let scales = self.scales(&sections[sections.len() - kept..]);
        let last = sections.len() - 1;
        let here = sections[last];
        if unstable.iter().any(|known| apart(*known, here, scales) <= BESIDE) {
            return Ok(Ok(None));
        }
        let near = (1..=last.min(longest))
            .map(|k| (apart(sections[last - k], here, scales), k))
            .filter(|(apart, _)| *apart <= NEAR)
            .min_by(|a, b| (a.0 * a.1 as f64).total_cmp(&(b.0 * b.1 as f64)));
        let Some((_, period)) = near else { return Ok(Ok(None)) };
        let (at, jump) = (self.lane.at(), self.lane.jump().clone());
        if returns(self.simulation, &sections[last - 1], &here, last as u64) {
            let cycle = self.image(here, 1, scales)?;
            self.lane.place(at, here, &jump);
            let one = 1.0 - MARGINAL..=1.0 + NEUTRAL;
            if let Some((cycle, ends)) = cycle
                && cycle.events.is_empty()
                && one.contains(&cycle.sizes()[0])
                && returns(self.simulation, &here, &ends[0], last as u64)
            {
                // Its multiplier is set to one, without rounding.
                return Ok(Ok(Some(Closed { derivative: [[1.0, 0.0], [0.0, 1.0]], ..cycle })));
            }
        }
        let solved = self.solve(here, period, scales)?;
        self.lane.place(at, here, &jump);
        let Some(orbit) = solved else { return Ok(Ok(None)) };
        let sizes = orbit.sizes();
        if sizes[0] >= 1.0 || sizes.iter().any(|size| (size - 1.0).abs() <= MARGINAL) {
            unstable.push(orbit.x);
            return Ok(Ok(None));
        }
        let attraction = orbit.attraction();
        let mut word = orbit.events.clone();
        word.sort_unstable();
        let mut before = orbit.off(&attraction, here);
        for _ in 0..FOLLOWED {
            let mut records = LaneRecords { events: Some(Vec::new()), ..LaneRecords::default() };
            for _ in 0..orbit.period {
                if self.cycle(&mut records)?.is_err() {
                    return Ok(Err(LaneStop));
                }
                sections.push(self.lane.x());
            }
            let now = orbit.off(&attraction, self.lane.x());
            let mut events = records.events.unwrap_or_default();
            events.sort_unstable();
            let is_there = now[1].sqrt() <= 1e-9;
            if events != word || !(is_there || now[0] <= before[0] - CONTRACTS * before[1]) {
                return Ok(Ok(None));
            }
            before = now;
        }
        Ok(Ok(Some(orbit)))
    }

    /// Returns the word of some events in normal form.
    pub fn word(&self, events: &[LaneEvent]) -> String {
        let token = |passed: &LaneEvent| {
            let (was, is, watch) = passed.parts();
            words::token(0, was, is, false).unwrap_or_else(|| words::write_token('i', 0, watch.side()))
        };
        words::text(&words::normal(&events.iter().map(token).collect::<Vec<_>>()))
    }

    /// Returns a section of the motion.
    pub fn section(&self, x: Pair) -> Section {
        Section { x: x.to_vec(), contacts: vec![contact_mode(&self.lane.jump().mode, 0)] }
    }
}
