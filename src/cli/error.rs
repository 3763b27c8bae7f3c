//! What can go wrong, and the exit code it has.

use std::{fmt, path::Path, process::ExitCode};

use flank::{
    accuracy::AccuracyError,
    output::{Fault, OutputError},
    scene::SceneError,
    simulation::SimulationError,
    study::StudyError,
    sweep::{GridError, SweepError},
};
use miette::Diagnostic;

/// An error of the command line.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum CliError {
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The output folder cannot be written into.
    #[error("{0}")]
    #[diagnostic(help("{1}"))]
    Output(OutputError, &'static str),
    /// The axes of a sweep cannot be used.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Arguments cannot be used.
    #[error("the arguments cannot be used{}", .0.iter().map(|fault| format!("\n{fault}")).collect::<String>())]
    Arguments(Vec<Fault>),
    /// The sweep cannot be kept in its folder.
    #[error("{0}")]
    #[diagnostic(help("{1}"))]
    Sweep(SweepError, &'static str),
    /// A simulation cannot be made, fails, or contradicts itself.
    #[error("{0}")]
    Simulation(SimulationError, #[help] Option<&'static str>),
    /// A study cannot be made.
    #[error("{0}")]
    Study(StudyError),
    /// Methods that cannot be compared, all of them.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Methods(Vec<AccuracyError>),
    /// The comparison cannot be made.
    #[error(transparent)]
    Accuracy(#[from] AccuracyError),
    /// A file cannot be written.
    #[error("{0}: {1}")]
    File(String, std::io::Error),
}

impl From<SimulationError> for CliError {
    fn from(error: SimulationError) -> Self {
        let help = match &error {
            SimulationError::Integrator(_) => "set run.integrator.method to \"auto\", or use a build that has it",
            SimulationError::Verify(_) => "please report the scene; events.jsonl holds the run up to there",
            SimulationError::Energy { .. } => "the run is not to be trusted; please report the scene",
            SimulationError::Overflow(_) => {
                "loads, speeds or masses of the scene are too large: state them in other units"
            }
            _ => "",
        };
        match error {
            SimulationError::Scene(error) => error.into(),
            SimulationError::Output(error) => error.into(),
            SimulationError::File(name, error) => Self::file(name, error),
            error => Self::Simulation(error, Some(help).filter(|help| !help.is_empty())),
        }
    }
}

impl From<StudyError> for CliError {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Simulation(error) => error.into(),
            error => Self::Study(error),
        }
    }
}

impl From<OutputError> for CliError {
    fn from(error: OutputError) -> Self {
        let help = match &error {
            OutputError::Occupied(_) => "name another folder, or write --force to replace the files of an earlier run",
            OutputError::Input(_) => "name another folder, or move the scene out of this one",
            _ => "move it, or name another folder: --force replaces only what the manifest names",
        };
        match error {
            OutputError::File(path, source) => Self::path(&path, source),
            error => Self::Output(error, help),
        }
    }
}

impl From<SweepError> for CliError {
    fn from(error: SweepError) -> Self {
        let help = match &error {
            SweepError::Unfinished(_) => "write --resume to go on with it, or --force to begin anew",
            SweepError::InUse(_) => "wait for it, or name another folder with --out",
            SweepError::Mismatch { .. } => {
                "--resume wants the same scene, arguments and version; name another folder, or write --force to begin anew"
            }
            SweepError::Damaged { .. } => {
                "remove the line to have its row computed again, or write --force to begin anew"
            }
            _ => "ask for fewer threads with --threads",
        };
        match error {
            SweepError::Output(error) => error.into(),
            error => Self::Sweep(error, help),
        }
    }
}

impl CliError {
    /// A file that cannot be written.
    pub fn file(place: impl fmt::Display, error: std::io::Error) -> Self {
        Self::File(place.to_string(), error)
    }

    /// The same, for a path.
    pub fn path(path: &Path, error: std::io::Error) -> Self {
        Self::file(path.display(), error)
    }

    /// Writes the error to standard error and gives the exit code.
    pub fn report(self) -> ExitCode {
        let code = match self {
            Self::File(..) | Self::Accuracy(AccuracyError::Engine(_)) => 1,
            Self::Simulation(SimulationError::Run(_) | SimulationError::Verify(_), _) => 1,
            Self::Simulation(SimulationError::Energy { .. } | SimulationError::Overflow(_), _) => 1,
            Self::Study(StudyError::Budget { .. } | StudyError::Overflow(_)) => 1,
            _ => 2,
        };
        eprintln!("{:?}", miette::Report::new(self));
        ExitCode::from(code)
    }
}
