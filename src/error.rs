//! The error of any work of the library.

use std::fmt;

#[cfg(feature = "import")]
use crate::import::ImportError;
use crate::{
    accuracy::AccuracyError,
    engine::EngineError,
    map::{BasinsError, PlaneError},
    output::{Fault, OutputError},
    scene::SceneError,
    simulation::SimulationError,
    study::{StudyError, identify::IdentifyError},
    sweep::{GridError, SweepError},
    system::{AssembleError, StartError},
    train::TrainError,
};

/// Error of any work of the library. The errors of its parts convert into it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The output folder cannot be written into.
    #[error("{0}")]
    Output(OutputError),
    /// The axes of a sweep cannot be used.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Arguments cannot be used.
    #[error("the arguments cannot be used{}", .0.iter().map(|fault| format!("\n{fault}")).collect::<String>())]
    Arguments(Vec<Fault>),
    /// The sweep cannot be stored in its folder.
    #[error("{0}")]
    Sweep(SweepError),
    /// A simulation cannot be made, fails, or contradicts itself.
    #[error("{0}")]
    Simulation(SimulationError),
    /// A study cannot be made.
    #[error("{0}")]
    Study(StudyError),
    /// Methods that cannot be compared, all of them.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Methods(Vec<AccuracyError>),
    /// The comparison cannot be made.
    #[error(transparent)]
    Accuracy(#[from] AccuracyError),
    /// A train cannot be made.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Numbers of a scene cannot be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A gearbox file gives no scene.
    #[cfg(feature = "import")]
    #[error("{0}: {1}")]
    Import(String, ImportError),
    /// A file cannot be read.
    #[error("{0} cannot be read: {1}")]
    Unread(String, std::io::Error),
    /// A file cannot be written.
    #[error("{0}: {1}")]
    File(String, std::io::Error),
}

impl From<SimulationError> for Error {
    fn from(error: SimulationError) -> Self {
        match error {
            SimulationError::Scene(error) => error.into(),
            SimulationError::Output(error) => error.into(),
            SimulationError::File(name, error) => Self::file(name, error),
            error => Self::Simulation(error),
        }
    }
}

impl From<AssembleError> for Error {
    fn from(error: AssembleError) -> Self {
        Self::Simulation(error.into())
    }
}

impl From<StartError> for Error {
    fn from(error: StartError) -> Self {
        Self::Simulation(error.into())
    }
}

impl From<EngineError> for Error {
    fn from(error: EngineError) -> Self {
        Self::Simulation(error.into())
    }
}

impl From<PlaneError> for Error {
    fn from(error: PlaneError) -> Self {
        match error {
            PlaneError::Grid(error) => error.into(),
            PlaneError::Simulation(error) => error.into(),
        }
    }
}

impl From<StudyError> for Error {
    fn from(error: StudyError) -> Self {
        if let StudyError::Simulation(error) = error { error.into() } else { Self::Study(error) }
    }
}

impl From<OutputError> for Error {
    fn from(error: OutputError) -> Self {
        if let OutputError::File(path, error) = error { Self::file(path.display(), error) } else { Self::Output(error) }
    }
}

impl From<SweepError> for Error {
    fn from(error: SweepError) -> Self {
        if let SweepError::Output(error) = error { error.into() } else { Self::Sweep(error) }
    }
}

impl From<BasinsError> for Error {
    fn from(error: BasinsError) -> Self {
        match error {
            BasinsError::Simulation(error) => error.into(),
            BasinsError::Sweep(error) => error.into(),
        }
    }
}

impl Error {
    /// Returns the error of a file that cannot be written.
    pub fn file(place: impl fmt::Display, error: std::io::Error) -> Self {
        Self::File(place.to_string(), error)
    }
}
