//! Errors of the command line, and their exit codes.

use std::{fmt, io::IsTerminal as _, process::ExitCode};

use flank::{
    accuracy::AccuracyError,
    import::ImportError,
    map::PlaneError,
    output::{Fault, OutputError},
    scene::SceneError,
    simulation::SimulationError,
    study::StudyError,
    sweep::{GridError, SweepError},
};
use miette::{Diagnostic, MietteHandlerOpts, ReportHandler};

/// An error of the command line.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
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
    /// A gearbox file gives no scene.
    #[error("{0}: {1}")]
    Import(String, ImportError),
    /// A file cannot be read.
    #[error("{0} cannot be read: {1}")]
    Unread(String, std::io::Error),
    /// A file cannot be written.
    #[error("{0}: {1}")]
    File(String, std::io::Error),
}

impl Diagnostic for CliError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = match self {
            Self::Output(OutputError::Occupied(_)) => {
                "name another folder, or write --force to replace the files of an earlier run"
            }
            Self::Output(OutputError::InUse(_)) => "wait for it, or name another folder with --out",
            Self::Output(OutputError::NoFolder(_)) => "name another folder with --out",
            Self::Output(OutputError::Input(_)) => "name another folder, or move the scene out of this one",
            Self::Output(_) => "move it, or name another folder: --force replaces only what the manifest names",
            Self::Sweep(SweepError::Unfinished(_)) => "write --resume to go on with it, or --force to begin anew",
            Self::Sweep(SweepError::Mismatch { .. }) => {
                "--resume wants the same scene, arguments and version; name another folder, or write --force to begin anew"
            }
            Self::Sweep(SweepError::Damaged { .. }) => "name another folder, or write --force to begin anew",
            Self::Sweep(SweepError::Parts(_)) => {
                "name the folders of all parts, each once; compute what is missing with --resume"
            }
            Self::Sweep(_) => "ask for fewer threads with --threads",
            Self::Simulation(SimulationError::Integrator(_)) => {
                "set run.integrator.method to \"auto\", or use a build that has it"
            }
            Self::Simulation(SimulationError::Verify(_)) => {
                "please report the scene; events.jsonl holds the run up to there"
            }
            Self::Simulation(SimulationError::Energy { .. }) => "the run is not to be trusted; please report the scene",
            Self::Simulation(SimulationError::Overflow(_)) => {
                "loads, speeds or masses of the scene are too large: state them in other units"
            }
            _ => return None,
        };
        Some(Box::new(help))
    }
}

impl From<SimulationError> for CliError {
    fn from(error: SimulationError) -> Self {
        match error {
            SimulationError::Scene(error) => error.into(),
            SimulationError::Output(error) => error.into(),
            SimulationError::File(name, error) => Self::file(name, error),
            error => Self::Simulation(error),
        }
    }
}

impl From<PlaneError> for CliError {
    fn from(error: PlaneError) -> Self {
        match error {
            PlaneError::Grid(error) => error.into(),
            PlaneError::Simulation(error) => error.into(),
            error => {
                Self::Arguments(vec![flank::output::Fault::new("the axes", error.to_string(), "two axes of a scene")])
            }
        }
    }
}

impl From<StudyError> for CliError {
    fn from(error: StudyError) -> Self {
        if let StudyError::Simulation(error) = error { error.into() } else { Self::Study(error) }
    }
}

impl From<OutputError> for CliError {
    fn from(error: OutputError) -> Self {
        if let OutputError::File(path, error) = error { Self::file(path.display(), error) } else { Self::Output(error) }
    }
}

impl From<SweepError> for CliError {
    fn from(error: SweepError) -> Self {
        if let SweepError::Output(error) = error { error.into() } else { Self::Sweep(error) }
    }
}

impl CliError {
    /// Returns the error of a file that cannot be written.
    pub fn file(place: impl fmt::Display, error: std::io::Error) -> Self {
        Self::File(place.to_string(), error)
    }

    /// Writes the error to standard error and returns the exit code.
    pub fn report(self) -> ExitCode {
        let code = match self {
            // Those of sysexits.h: EX_CANTCREAT and EX_IOERR.
            Self::Output(OutputError::InUse(_)) => 73,
            Self::File(..) => 74,
            Self::Accuracy(AccuracyError::Engine(_)) => 1,
            Self::Simulation(SimulationError::Run(_) | SimulationError::Verify(_)) => 1,
            Self::Simulation(SimulationError::Energy { .. } | SimulationError::Overflow(_)) => 1,
            Self::Study(StudyError::Budget { .. }) => 4,
            Self::Study(StudyError::Overflow(_)) => 1,
            _ => 2,
        };
        // A file or a pipe receives whole lines, which can be searched.
        let wrapped = std::io::stderr().is_terminal();
        let handler =
            move |_: &_| -> Box<dyn ReportHandler> { Box::new(MietteHandlerOpts::new().wrap_lines(wrapped).build()) };
        let _ = miette::set_hook(Box::new(handler));
        super::tell(&format!("{:?}", miette::Report::new(self)));
        ExitCode::from(code)
    }
}
