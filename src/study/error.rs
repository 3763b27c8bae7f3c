use super::identify::IdentifyError;
use crate::{
    engine::EngineError,
    integrate::IntegrateError,
    scene::SceneError,
    train::{AssembleError, StartError, TrainError},
    verify::Difference,
};

/// Why a study cannot be carried out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The identification cannot be done.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The train cannot be assembled.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// The train has no such property.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// The run cannot start.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The integrator cannot be had.
    #[error(transparent)]
    Integrator(#[from] IntegrateError),
    /// The run failed.
    #[error("the run failed {0}")]
    Run(#[from] EngineError),
    /// The run does not agree with its check.
    #[error("the run is wrong or not certain: {0}")]
    Verify(#[from] Difference),
    /// The run was stopped by the event budget of its scene.
    #[error("the event budget of the scene (/run/event_budget) was spent in cycle {cycle}")]
    Budget {
        /// Where.
        cycle: i64,
    },
    /// A measure needs what the scene does not have.
    #[error("{name}: {missing}")]
    Missing {
        /// The scene.
        name: String,
        /// What is missing, and the remedy.
        missing: String,
    },
    /// A measure left the range of double precision.
    #[error("{0} is not a finite number: loads, speeds or masses of the scene are too large")]
    Overflow(String),
    /// The user broke off.
    #[error("interrupted")]
    Interrupted,
}

impl StudyError {
    /// The error of a study that needs more than the scene called `name` has.
    pub(super) fn missing(name: &str, missing: impl Into<String>) -> Self {
        Self::Missing { name: name.to_owned(), missing: missing.into() }
    }
}
