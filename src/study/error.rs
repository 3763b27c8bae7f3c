use super::identify::IdentifyError;
use crate::{simulation::SimulationError, train::TrainError};

/// Error of a study.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A simulation cannot be made or run, or lacks data for a figure.
    #[error(transparent)]
    Simulation(SimulationError),
    /// The identification cannot be done.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The train has no such property.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// The run was stopped by the event budget of its scene.
    #[error("the event budget of the scene (/run/event_budget) was spent in cycle {cycle}")]
    Budget {
        /// Cycle in which it was spent.
        cycle: i64,
    },
    /// A measure left the range of double precision.
    #[error("{0} is not a finite number: loads, speeds or masses of the scene are too large")]
    Overflow(String),
    /// A claim or a table of one cannot be read or evaluated.
    #[error("a claim cannot be evaluated: {0}")]
    Claim(String),
    /// A study file cannot be used.
    #[error("the study cannot be used: {0}")]
    File(String),
    /// The user interrupted the work.
    #[error("interrupted")]
    Interrupted,
}

impl<E: Into<SimulationError>> From<E> for StudyError {
    fn from(error: E) -> Self {
        Self::Simulation(error.into())
    }
}

impl StudyError {
    /// Returns the error of a study that the scene `name` cannot serve.
    pub(super) fn missing(name: &str, missing: impl Into<String>) -> Self {
        SimulationError::missing(name, missing).into()
    }
}
