//! Map from one event of a kind to the next: a section at a guard, for trains with and without a forcing period.

use std::ops::ControlFlow;

use nalgebra::{DMatrix, DVector};

use super::{
    Corner, Tangent,
    words::{WordObserver, letters},
};
use crate::{
    engine::{JumpRecord, Observer, Outcome, State},
    event::EventRecord,
    hybrid::{GuardId, Instant, Mode, VectorField, Watch},
    integrate::DenseStep,
    simulation::{Simulation, SimulationError},
    system::{Evaluation, Structure, Variation},
};

/// Kinds of tokens whose event is a touch or loss of a flank, and those whose event is a zero of the force.
const AT_FLANK: [char; 4] = ['c', 's', 'x', 'i'];
const BY_FORCE: [char; 2] = ['r', 'a'];

/// Map of states from one event to the next of the same kind, contact and side, both taken right after the event.
#[derive(Clone, Debug)]
pub struct GuardMap<'a> {
    simulation: &'a Simulation,
    token: String,
    guard: GuardId,
}

/// Next event of the kind, with the derivatives of its state and time.
///
/// The start is held on its section: only the part of a change along the section has a meaning.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Crossing {
    /// State right after the event.
    pub end: State,
    /// Time from the start to the event, s.
    pub time: f64,
    /// `∂x_end/∂x_start`, `[dim, dim]`.
    pub jacobian: DMatrix<f64>,
    /// `∂time/∂x_start`, `[dim]`.
    pub time_by: DVector<f64>,
    /// `∂x_end/∂t_start` and `∂time/∂t_start`, the state at the start held: zero if neither forcing nor stiffness changes with time.
    pub by_instant: (DVector<f64>, f64),
    /// `∂x_end/∂α` of each requested number, `[dim, count]`, and `∂time/∂α`, `[count]`, per unit of the number in the scene. If α changes
    /// the forcing's frequency, time is its phase, in seconds of the unchanged train.
    pub by_number: (DMatrix<f64>, DVector<f64>),
    /// Tokens of the events as a word; the last one holds the event.
    pub word: Vec<String>,
    /// First place at which the map is only piecewise smooth: the derivative is that of neighbours whose impacts stay together.
    pub corner: Option<Corner>,
}

impl<'a> GuardMap<'a> {
    /// Returns the map between events with `token`, as in words: `c0+` if contact 0 closes on the drive flank, `i1-` if contact 1 strikes
    /// its back flank. Kinds are `c`, `s`, `x`, `i`, `r`, `a`.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] if the train cannot have such an event.
    pub fn new(simulation: &'a Simulation, token: &str) -> Result<Self, SimulationError> {
        let contacts = simulation.structure.contacts().len();
        let read = || {
            let (kind, rest) = (token.chars().next()?, token.get(1..)?);
            let (number, side) = rest.split_at_checked(rest.len().checked_sub(1)?)?;
            let contact = number.parse::<usize>().ok().filter(|contact| *contact < contacts)?;
            let flank = match side {
                "+" => Watch::DriveFlank,
                "-" => Watch::BackFlank,
                _ => return None,
            };
            let is_flank = AT_FLANK.contains(&kind);
            let watch = if is_flank { flank } else { Watch::Force };
            (is_flank || BY_FORCE.contains(&kind))
                .then(|| simulation.structure.guard_of_contact(contact, flank.side(), watch))
        };
        let guard = read().ok_or_else(|| {
            simulation.missing(format!(
                "it has no section {token:?}; a section is one of the letters c, s, x, i, r, a, the number of a contact from 0 to \
                 {}, and its side, + or -: c0+",
                contacts.saturating_sub(1)
            ))
        })?;
        Ok(Self { simulation, token: token.to_owned(), guard })
    }

    /// Returns the state at the first such event from the start of the scene.
    ///
    /// # Errors
    /// Errors of [`image`](Self::image).
    pub fn first(&self) -> Result<State, SimulationError> {
        Ok(self.run(self.simulation.start()?, &[])?.0)
    }

    /// Returns the next such event from `start`, and the derivative.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails, or if there is no such event within the time of the scene's run.
    pub fn image(&self, start: &State) -> Result<Crossing, SimulationError> {
        self.image_by(start, &[])
    }

    /// Returns the event as [`image`](Self::image), with the derivative by numbers of the train according to `variations`; `start` is held.
    ///
    /// # Errors
    /// Errors of [`image`](Self::image).
    pub fn image_by(&self, start: &State, variations: &[Variation]) -> Result<Crossing, SimulationError> {
        let structure = &self.simulation.structure;
        let (end, watcher, earlier) = self.run(start.clone(), variations)?;
        let Watcher { tangent, mut words, .. } = watcher;
        let dim = end.x.len();
        let rates = |state: &State| {
            let mut rates = DVector::zeros(dim);
            structure.eval(&state.jump.mode, state.at, 0.0, &state.x, rates.as_mut_slice());
            rates
        };
        let after = rates(&end);
        let [time_by, time_by_number] = earlier.map(|earlier| -DVector::from_vec(earlier));
        let moved = |values: &[f64], time_by: &DVector<f64>| {
            DMatrix::from_row_slice(dim, time_by.len(), values) + &after * time_by.transpose()
        };
        let jacobian = moved(&tangent.columns.values, &time_by);
        let by_number = moved(&tangent.by_number().values, &time_by_number);
        // A state that meets the event later was behind at the start.
        let before = rates(start);
        Ok(Crossing {
            time: self.simulation.clock().between(start.at, end.at),
            by_instant: (-(&jacobian * &before), -time_by.dot(&before) - 1.0),
            jacobian,
            time_by,
            by_number: (by_number, time_by_number),
            word: words.take(),
            corner: tangent.corner,
            end,
        })
    }

    /// Runs to the next event; also returns how much earlier neighbours reach it, by the start and by numbers.
    fn run<'b>(
        &'b self,
        start: State,
        variations: &'b [Variation],
    ) -> Result<(State, Watcher<'b>, [Vec<f64>; 2]), SimulationError> {
        let (simulation, structure) = (self.simulation, &self.simulation.structure);
        let [from, _, to] = simulation.instants();
        let clock = simulation.clock();
        let end = clock.advance(start.at, clock.between(from, to));
        let mut tangent = Tangent::new(structure).with(variations);
        tangent.start(&start);
        let words = WordObserver::new(structure, &start.x);
        let mut watcher = Watcher { map: self, structure, variations, tangent, words, met: None };
        let mut engine = simulation.engine(start)?;
        if engine.run(end, &mut watcher)? == Outcome::EventBudgetSpent {
            return Err(simulation.missing("its run stops before the section; raise its limit on events"));
        }
        if watcher.tangent.is_unresolved {
            return Err(simulation.missing("the derivative along a step of its motion cannot be resolved"));
        }
        let Some(earlier) = watcher.met.take() else {
            let time = clock.between(from, to);
            return Err(simulation.missing(format!(
                "it does not reach the section {} within {time} s, the time of its run; let it run longer, or take another section",
                self.token
            )));
        };
        let still = || {
            simulation.missing(format!(
                "its section {} is met at rest, or by a switch or another impact: it has no derivative",
                self.token
            ))
        };
        Ok((engine.state().clone(), watcher, earlier.ok_or_else(still)?))
    }
}

/// Observer that carries the derivative up to the event.
struct Watcher<'b> {
    map: &'b GuardMap<'b>,
    structure: &'b Structure,
    variations: &'b [Variation],
    tangent: Tangent<'b>,
    words: WordObserver<'b>,
    /// After the event: how much earlier neighbours reach it, by the start and by numbers, if known.
    met: Option<Option<[Vec<f64>; 2]>>,
}

impl Observer for Watcher<'_> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.tangent.wants_steps(mode, until)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.tangent.leap(mode, time)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.tangent.step(mode, step, until)
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        if self.met.is_none() && letters(self.structure, jumped).any(|(_, token)| token == self.map.token) {
            let earlier = |variations, columns| {
                let by = Evaluation { variations, at: jumped.at, x: jumped.x_minus };
                self.structure.earlier(&jumped.from.mode, self.map.guard, by, columns)
            };
            // Events from a switch or another contact's impact occur at their times, not at that of this guard.
            let falls = jumped.fired.contains(self.map.guard);
            let by_start = earlier(&[], &self.tangent.columns).filter(|_| falls);
            let by_number = earlier(self.variations, self.tangent.by_number());
            self.met = Some(by_start.zip(by_number).map(|(start, number)| [start, number]));
        }
        self.tangent.jump(jumped);
        self.words.jump(jumped);
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let _ = self.words.event(record);
        if record.start {
            // A decision about the first mode, and no event.
            self.met = None;
        }
        if self.met.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
