//! Map of a whole number of cycles, with its derivative.

use crate::{
    engine::{Engine, Observer, Outcome, State},
    gear::Stiffness,
    hybrid::{ContactView, Instant, Mode, Watch},
    simulation::{CancelObserver, Simulation, SimulationError},
    system::{ContactMode, Variation},
    tangent::zeros,
    task::Task,
};
use nalgebra::DMatrix;
use serde::{Deserialize, Deserializer, Serialize};

use super::{Corner, Tangent, words::WordObserver};

/// State at the start of a cycle, complete for the motion after it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Section {
    /// `(q, q̇, latched speeds)`, `[dim]`.
    pub x: Vec<f64>,
    /// Mode of each contact.
    pub contacts: Vec<ContactMode>,
}

impl AsRef<[f64]> for Section {
    fn as_ref(&self) -> &[f64] {
        &self.x
    }
}

/// Share of a period within which an event lies on phase 0: by rounding, it may be found twice, or not at all.
const EDGE: f64 = 1e-11;

/// Reads a number, which files store as `null` if it is not finite.
pub(super) fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// End of some cycles from a section, with its derivatives.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Image {
    /// Section after the cycles.
    pub end: Section,
    /// The section after each cycle; the last one is `end`.
    pub between: Vec<Section>,
    /// `∂end/∂start`, `[dim, dim]`.
    pub jacobian: DMatrix<f64>,
    /// `∂end/∂α` of each requested number, `[dim, count]`.
    pub by_number: DMatrix<f64>,
    /// Tokens of the events, as a word that repeats. If a sequence of impacts comes to rest at the start of the word, its impacts at the
    /// end of the word belong to that token.
    pub word: Vec<String>,
    /// True for each latched speed that was written.
    pub latched: Vec<bool>,
    /// Count of zero multipliers: the largest number, at one time, of ranks that contacts at rest take and of latched speeds of open
    /// contacts, written when those close.
    pub zeros: usize,
    /// Entries from which they are counted.
    pub(super) dead: Vec<(usize, Vec<bool>)>,
    /// `∫ div f dt + Σ ln |det|` of jumps; NaN where contacts rest or latch.
    #[serde(deserialize_with = "number")]
    pub volume: f64,
    /// Logarithm of the determinant of the derivative, from the volume and so without cancellation, for one degree of freedom and linear
    /// laws.
    #[serde(skip)]
    pub(super) log_determinant: Option<f64>,
    /// First place at which the map is only piecewise smooth: the derivative is that of neighbours whose impacts stay together.
    pub corner: Option<Corner>,
    /// True if an event lies on the instant of a section: by rounding, it may be counted twice, or its part of the derivative be missing.
    pub has_event_at_section: bool,
    /// Largest absolute value of each component at the starts of cycles and at events.
    pub sizes: Vec<f64>,
    /// Number of arcs and jumps, for an estimate of rounding.
    pub pieces: u64,
}

/// Engine of an earlier run of the same train, if any: the next run uses it again, as its modes are compiled.
pub(crate) type SpareEngine<'s> = Option<Engine<'s>>;

/// Map of states over whole cycles of the forcing, from phase 0 to phase 0.
#[derive(Clone, Copy, Debug)]
pub struct SectionMap<'a> {
    simulation: &'a Simulation,
    /// Cycle at which it starts.
    cycle: i64,
    /// Phase of the sections, as a share of a period, in [0, 1).
    phase: f64,
    /// Number of steps in a cycle, and index of the first: more than one step for multiple shooting only.
    steps: [u64; 2],
    /// Task whose cancellation ends a run.
    task: Option<Task<'a>>,
}

impl<'a> SectionMap<'a> {
    /// Returns the map of `simulation`.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] for a train without a forcing period.
    pub fn new(simulation: &'a Simulation) -> Result<Self, SimulationError> {
        if simulation.clock().period().is_none() {
            return Err(simulation.missing(
                "its forcing has no period, so that there is no section at whole cycles; give it a forcing with one, or take a section \
                 at an event, from the library: orbit::GuardMap",
            ));
        }
        let [start, ..] = simulation.instants();
        // After a start within a cycle the next phase 0 is the first section.
        let cycle = start.cycle + i64::from(start.phase.value() > 0.0);
        Ok(Self { simulation, cycle, phase: 0.0, steps: [1, 0], task: None })
    }

    /// Checks that each cycle has the forcing of the one before.
    ///
    /// # Errors
    /// [`SimulationError::Missing`], naming what does not repeat.
    pub fn repeats(&self) -> Result<(), SimulationError> {
        let (clock, structure) = (self.simulation.clock(), &self.simulation.structure);
        let begins = clock.time(self.at(0)).value();
        let spec = structure.spec();
        let of_contacts =
            spec.contacts.iter().flat_map(|c| c.schedules().map(|k| (k, format!("the stiffness of {}", c.name))));
        let of_loads = spec.load_schedules.iter().enumerate().map(|(i, l)| (&l.factor, format!("load {}", i + 1)));
        let switched = of_contacts.chain(of_loads).find_map(|(schedule, name)| match schedule {
            Stiffness::Listed { times, .. } => {
                let last = times.last().map(|time| time[0]).filter(|time| *time > begins)?;
                Some(format!(
                    "{name} changes at {last} s, and no cycle repeats before; start the run later (/run/start_cycle)"
                ))
            }
            _ => None,
        });
        let fault = match structure.common_cycle() {
            Err(fault) => Some(fault),
            Ok(1) if structure.has_whole_orders() => switched,
            Ok(periods) => Some(format!(
                "its forcing repeats after {periods} periods of its clock only; make that its cycle (Simulation::in_common_cycles)"
            )),
        };
        fault.map_or(Ok(()), |fault| Err(self.simulation.missing(fault)))
    }

    /// Returns the same map between sections at a share `phase` of the period, in [0, 1).
    #[must_use]
    pub fn at_phase(self, phase: f64) -> Self {
        Self { phase, ..self }
    }

    /// Returns the same map, whose runs end with an error soon after `task` is cancelled.
    #[must_use]
    pub fn with_task(self, task: Task<'a>) -> Self {
        Self { task: Some(task), ..self }
    }

    /// Returns the same map between sections that are `cycles` cycles later.
    #[must_use]
    pub(crate) fn later(self, cycles: u64) -> Self {
        Self { cycle: self.cycle + cycles as i64, ..self }
    }

    /// Returns the same map in steps of one period of the scene's clock, if a cycle has several: `cycles` then counts steps.
    pub(super) fn divided(self) -> Self {
        Self { steps: [self.simulation.periods_per_cycle(), 0], ..self }
    }

    /// Returns the same map from step number `step` of its cycle on.
    pub(super) fn at_step(self, step: usize) -> Self {
        let [steps, _] = self.steps;
        Self { steps: [steps, step as u64 % steps], ..self }
    }

    /// Returns the number of steps in a cycle.
    pub(super) fn steps(&self) -> usize {
        self.steps[0] as usize
    }

    /// Returns whether the train has one degree of freedom and linear laws.
    pub(super) fn is_linear_pair(&self) -> bool {
        let spec = self.simulation.structure.spec();
        spec.freedoms.len() == 1 && spec.contacts.iter().all(|c| c.law.is_linear())
    }

    /// Returns the phase of the sections, as a share of the period.
    #[must_use]
    pub fn phase(&self) -> f64 {
        self.phase
    }

    /// Returns the simulation.
    #[must_use]
    pub fn simulation(&self) -> &'a Simulation {
        self.simulation
    }

    /// Returns whether `at` is at the phase of a section.
    fn is_section(&self, at: Instant) -> bool {
        let clock = self.simulation.clock();
        let off = clock.between(self.at(0), Instant { cycle: self.at(0).cycle, ..at });
        let part = clock.period().map_or(f64::NAN, |period| off / period.value() * self.steps[0] as f64);
        (part - part.round()).abs() <= EDGE
    }

    /// Returns the instant of a section.
    pub(crate) fn at(&self, cycles: u64) -> Instant {
        let clock = self.simulation.clock();
        let period = clock.period().map_or(0.0, |period| period.value());
        let [steps, first] = self.steps;
        let (whole, rest) = ((first + cycles) / steps, (first + cycles) % steps);
        clock.at(self.cycle + whole as i64, (self.phase + rest as f64 / steps as f64) * period)
    }

    /// Returns an engine at `state`.
    pub(crate) fn engine<'e>(
        &self,
        spare: &'e mut SpareEngine<'a>,
        state: State,
    ) -> Result<&'e mut Engine<'a>, SimulationError> {
        Ok(match spare {
            Some(engine) => {
                engine.restart(state);
                engine
            }
            none => none.insert(self.simulation.engine(state)?),
        })
    }

    /// Returns the section at which the scene starts.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn start(&self) -> Result<Section, SimulationError> {
        let start = self.simulation.start()?;
        if start.at == self.at(0) {
            return Ok(self.section(&start));
        }
        self.end(&mut None, start, self.at(0))
    }

    /// Returns the section at `end` of the run from `state`.
    fn end(&self, spare: &mut SpareEngine<'a>, state: State, end: Instant) -> Result<Section, SimulationError> {
        let engine = self.engine(spare, state)?;
        self.advance(engine, end, &mut ())?;
        Ok(self.section(engine.state()))
    }

    /// Runs `engine` to the start of the next cycle, regardless of the task. Returns `false` if the run is interrupted.
    pub(crate) fn cycle(&self, engine: &mut Engine<'_>, observer: &mut dyn Observer) -> Result<bool, SimulationError> {
        let end = self.simulation.clock().at(engine.state().at.cycle + 1, 0.0);
        Ok(engine.run(end, observer)? == Outcome::ReachedEnd)
    }

    /// Runs to `end`. An error if the limit on events is reached before: there is no section then.
    pub(super) fn advance(
        &self,
        engine: &mut Engine<'_>,
        end: Instant,
        observer: &mut dyn Observer,
    ) -> Result<(), SimulationError> {
        let outcome = match self.task {
            Some(task) => engine.run(end, &mut (observer, CancelObserver { task }))?,
            None => engine.run(end, observer)?,
        };
        match outcome {
            Outcome::EventBudgetSpent => {
                Err(self.simulation.missing("its run stops within a cycle; raise its limit on events"))
            }
            Outcome::StoppedByObserver if self.task.is_some_and(|task| task.is_cancelled()) => {
                Err(self.simulation.missing("its run was cancelled"))
            }
            Outcome::StoppedByObserver | Outcome::ReachedEnd => Ok(()),
        }
    }

    /// Returns the section of a state.
    #[must_use]
    pub fn section(&self, state: &State) -> Section {
        Section { x: state.x.clone(), contacts: self.contacts(&state.jump.mode) }
    }

    fn contacts(&self, mode: &Mode) -> Vec<ContactMode> {
        let structure = &self.simulation.structure;
        (0..structure.contact_count()).map(|j| structure.contact_mode(j, mode)).collect()
    }

    /// Returns the state at a section.
    ///
    /// # Errors
    /// [`SimulationError::Start`].
    pub fn state(&self, section: &Section) -> Result<State, SimulationError> {
        let (at, structure) = (self.at(0), &self.simulation.structure);
        // Contacts at rest stay at rest, regardless of the rounding of gap and rate.
        let rests = |j: &usize| section.contacts[*j].is_closed() && structure.contacts()[*j].spec.law.is_rigid();
        let mut resting = Mode::default();
        (0..section.contacts.len())
            .filter(rests)
            .for_each(|j| structure.set_contact(&mut resting, j, section.contacts[j]));
        let mut x = section.x.clone();
        structure.rest(&resting, at, &mut x);
        let mut start = structure.resume(at, &x, &section.contacts)?;
        for j in (0..section.contacts.len()).filter(rests) {
            structure.set_contact(&mut start.jump.mode, j, section.contacts[j]);
            for watch in [Watch::DriveFlank, Watch::BackFlank] {
                let guard = structure.guard_of_contact(j, watch.side(), watch);
                start.jump.pinned.remove(guard);
                start.jump.still.remove(guard);
            }
        }
        Ok(State { at, x: start.x, jump: start.jump })
    }

    /// Returns the section after `cycles` cycles, without the derivative.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn follow(&self, section: &Section, cycles: u64) -> Result<Section, SimulationError> {
        self.follow_by(&mut None, section, cycles)
    }

    /// Returns the section as [`follow`](Self::follow), with a `spare` engine.
    pub(super) fn follow_by(
        &self,
        spare: &mut SpareEngine<'a>,
        section: &Section,
        cycles: u64,
    ) -> Result<Section, SimulationError> {
        self.end(spare, self.state(section)?, self.at(cycles))
    }

    /// Runs `cycles` cycles from a section, with an `observer`.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn watch(&self, section: &Section, cycles: u64, observer: &mut dyn Observer) -> Result<(), SimulationError> {
        let mut engine = self.simulation.engine(self.state(section)?)?;
        self.advance(&mut engine, self.at(cycles), observer)
    }

    /// Returns the next section of `other`, of the same train, after a section: the section itself if both have one phase.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn lead(&self, section: &Section, other: &SectionMap<'_>) -> Result<Section, SimulationError> {
        if self.phase == other.phase {
            return Ok(section.clone());
        }
        self.end(&mut None, self.state(section)?, other.at(u64::from(other.phase < self.phase)))
    }

    /// Returns the section after `cycles` cycles, and the derivative.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn image(&self, section: &Section, cycles: u64) -> Result<Image, SimulationError> {
        self.image_by(section, cycles, &[])
    }

    /// Returns the image as [`image`](Self::image), with the derivative by numbers of the train according to `variations`; `section` is held.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn image_by(&self, section: &Section, cycles: u64, variations: &[Variation]) -> Result<Image, SimulationError> {
        let mut words = WordObserver::new(&self.simulation.structure, &section.x);
        let image = self.image_with(&mut None, (section, cycles), variations, &mut words)?;
        Ok(Image { word: words.into_word(), ..image })
    }

    /// Returns the image as [`image_by`](Self::image_by), with a `spare` engine; `words` has observed the
    /// events before, and receives those of the image.
    pub(super) fn image_with(
        &self,
        spare: &mut SpareEngine<'a>,
        (section, cycles): (&Section, u64),
        variations: &[Variation],
        words: &mut WordObserver<'_>,
    ) -> Result<Image, SimulationError> {
        let state = self.state(section)?;
        let mut tangent = Tangent::new(&self.simulation.structure).with(variations);
        tangent.start(&state);
        words.meet(&state.x);
        let engine = self.engine(spare, state)?;
        let mut between = Vec::with_capacity(cycles as usize);
        for cycle in 1..=cycles {
            self.advance(engine, self.at(cycle), &mut (&mut tangent, &mut *words))?;
            if tangent.is_unresolved {
                return Err(self.simulation.missing("the derivative along a step of its motion cannot be resolved"));
            }
            between.push(self.section(engine.state()));
            words.meet(&engine.state().x);
        }
        words.close();
        let counters = engine.counters();
        let dim = engine.state().x.len();
        Ok(Image {
            end: self.section(engine.state()),
            between,
            jacobian: DMatrix::from_row_slice(dim, dim, &tangent.columns.values),
            by_number: DMatrix::from_row_slice(dim, variations.len(), &tangent.by_number().values),
            word: Vec::new(),
            zeros: zeros(&tangent.dead, &tangent.latched),
            dead: tangent.dead,
            latched: tangent.latched,
            volume: tangent.volume,
            log_determinant: self.is_linear_pair().then_some(tangent.volume),
            corner: tangent.corner,
            has_event_at_section: words.letters.iter().any(|letter| self.is_section(letter.at)),
            sizes: words.sizes.clone(),
            pieces: counters.steps + counters.events,
        })
    }
}
