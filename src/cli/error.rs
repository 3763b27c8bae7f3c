//! What can go wrong, and the exit code it has.

use std::{fmt, path::Path, process::ExitCode};

use flank::{
    accuracy::AccuracyError,
    output::OutputError,
    scene::SceneError,
    study::{StudyError, identify::IdentifyError},
    sweep::{Fault, GridError, SweepError},
};
use miette::Diagnostic;

/// An error of the command line.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum CliError {
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The identification cannot be done.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
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
    /// The study, or a single run, cannot be made, fails, or does not agree with its check.
    #[error("{0}")]
    Study(StudyError, #[help] Option<&'static str>),
    /// Methods that cannot be compared, all of them.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Methods(Vec<AccuracyError>),
    /// The comparison cannot be made.
    #[error(transparent)]
    Accuracy(#[from] AccuracyError),
    /// The energy ledger does not balance.
    #[error("the energy ledger of the run is open by {closure:e} of its throughput; rounding explains {rounding:e}")]
    #[diagnostic(help("the run is not to be trusted; please report the scene"))]
    Energy {
        /// Residual over throughput.
        closure: f64,
        /// What rounding explains.
        rounding: f64,
    },
    /// A measure of the run is not a number.
    #[error("{0} is beyond the range of double precision")]
    #[diagnostic(help("loads, speeds or masses of the scene are too large: state them in other units"))]
    Overflow(String),
    /// A file cannot be written.
    #[error("{0}: {1}")]
    File(String, std::io::Error),
}

impl From<StudyError> for CliError {
    fn from(error: StudyError) -> Self {
        let help = match &error {
            StudyError::Integrator(_) => Some("set run.integrator.method to \"auto\", or use a build that has it"),
            StudyError::Verify(_) => Some("please report the scene; events.jsonl holds the run up to there"),
            _ => None,
        };
        Self::Study(error, help)
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
            SweepError::Occupied(path) => return OutputError::Occupied(path.clone()).into(),
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
            SweepError::File { path, source } => Self::path(&path, source),
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
            Self::Overflow(_) | Self::Energy { .. } | Self::File(..) | Self::Accuracy(AccuracyError::Engine(_)) => 1,
            Self::Study(StudyError::Run(_) | StudyError::Verify(_), _) => 1,
            Self::Study(StudyError::Budget { .. } | StudyError::Overflow(_), _) => 1,
            _ => 2,
        };
        eprintln!("{:?}", miette::Report::new(self));
        ExitCode::from(code)
    }
}
