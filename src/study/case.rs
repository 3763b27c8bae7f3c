use super::StudyError;
use crate::{
    engine::{Engine, Options, State},
    gear::contact::Law,
    hybrid::{Clock, Instant, Wide},
    integrate::build,
    scene::{Built, Scene},
    train::{Structure, bonded_modes},
    verify::Verifier,
};

/// A scene ready to run.
#[derive(Debug)]
pub struct Case {
    /// Its name in messages.
    pub name: String,
    /// What it builds.
    pub built: Built,
    /// Its train.
    pub structure: Structure,
}

impl Case {
    /// Builds the train of `scene`.
    ///
    /// # Errors
    /// [`StudyError::Scene`] or [`StudyError::Assemble`].
    pub fn new(scene: &Scene) -> Result<Self, StudyError> {
        Self::of(scene.name(), scene.build()?)
    }

    /// Assembles what a scene has built, or something made from that.
    ///
    /// # Errors
    /// [`StudyError::Assemble`].
    pub fn of(name: &str, built: Built) -> Result<Self, StudyError> {
        let structure = Structure::new(built.spec.clone())?;
        Ok(Self { name: name.to_owned(), built, structure })
    }

    /// The forcing clock.
    #[must_use]
    pub fn clock(&self) -> &Clock {
        self.structure.clock()
    }

    /// The forcing period T, s.
    ///
    /// # Errors
    /// [`StudyError::Missing`] without one.
    pub fn period(&self) -> Result<f64, StudyError> {
        self.clock().period().map(Wide::value).ok_or_else(|| {
            self.missing(
                "its forcing has no period, so that there are no cycles to compare; give it a forcing with one",
            )
        })
    }

    /// The error of a study that needs more than the scene has.
    #[must_use]
    pub fn missing(&self, missing: impl Into<String>) -> StudyError {
        StudyError::missing(&self.name, missing)
    }

    /// Where the scene starts.
    ///
    /// # Errors
    /// [`StudyError::Start`].
    pub fn start(&self) -> Result<State, StudyError> {
        let at = self.built.run.instants(self.clock())[0];
        let start = self.structure.start(at, &self.built.q0, &self.built.v0)?;
        Ok(State { at, x: start.x, jump: start.jump })
    }

    /// An engine at `state`, with the integrator and the limits of the scene.
    ///
    /// # Errors
    /// [`StudyError::Integrator`].
    pub fn engine(&self, state: State) -> Result<Engine<'_>, StudyError> {
        Ok(self.limited(state, self.built.run.event_budget)?.0)
    }

    /// The same with another limit on events, and why it has the integrator it has.
    ///
    /// # Errors
    /// [`StudyError::Integrator`].
    pub fn limited(&self, state: State, max_events: u64) -> Result<(Engine<'_>, String), StudyError> {
        let run = &self.built.run;
        let (integrator, why) = build(run.method, run.tolerance, &self.structure)?;
        let options = Options { max_events, chatter_speed: run.chatter_speed.unwrap_or(0.0), ..Options::default() };
        Ok((Engine::new(&self.structure, integrator, options, state), why))
    }

    /// What checks a run of the scene from `state`.
    #[must_use]
    pub fn verifier(&self, state: &State) -> Verifier<'_, Structure> {
        Verifier::new(&self.structure, state, self.unit(), self.built.run.method)
    }

    /// The time, s, that the accuracy of a check is a part of: the forcing period, else that of the highest natural frequency
    /// with all linear contacts closed. Rigid contacts and power laws have no frequency of their own; a train with nothing
    /// else has no such time.
    fn unit(&self) -> Option<f64> {
        let natural = || {
            let mut spec = self.structure.spec().clone();
            spec.contacts.retain(|c| matches!(c.law, Law::Bilateral(_) | Law::KelvinVoigt(..)));
            let highest = bonded_modes(&spec).ok()?.omega.last().copied().filter(|omega| *omega > 0.0)?;
            Some(std::f64::consts::TAU / highest)
        };
        self.clock().period().map(Wide::value).or_else(natural)
    }

    /// Number of the freedom named `name`.
    ///
    /// # Errors
    /// [`StudyError::Missing`].
    pub fn freedom(&self, name: &str) -> Result<usize, StudyError> {
        let freedoms = &self.structure.spec().freedoms;
        freedoms
            .iter()
            .position(|freedom| freedom == name)
            .ok_or_else(|| self.missing(format!("it has no freedom {name}; it has {}", freedoms.join(", "))))
    }

    /// `at`, moved to the start of its cycle: where a seed of another case is taken up.
    pub(super) fn cycle_start(&self, at: Instant) -> Instant {
        self.clock().at(at.cycle, 0.0)
    }
}
