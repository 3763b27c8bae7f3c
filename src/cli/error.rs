//! Errors of the command line, and their exit codes.

use std::{fmt, io::IsTerminal as _};

use crate::{
    Error, accuracy::AccuracyError, output::OutputError, simulation::SimulationError, study::StudyError,
    sweep::SweepError,
};
use miette::{Diagnostic, MietteHandlerOpts, ReportHandler};

/// Error with its help, as miette shows it.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
struct Helped(Error);

impl Diagnostic for Helped {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = match &self.0 {
            Error::Output(OutputError::Occupied(_)) => {
                "name another folder, or write --force to replace the files of an earlier run"
            }
            Error::Output(OutputError::InUse(_)) => "wait for it, or name another folder with --out",
            Error::Output(OutputError::NoFolder(_)) => "name another folder with --out",
            Error::Output(OutputError::Input(_)) => "name another folder, or move the scene out of this one",
            Error::Output(_) => "move it, or name another folder: --force replaces only what the manifest names",
            Error::Sweep(SweepError::Unfinished(_)) => "write --resume to go on with it, or --force to begin anew",
            Error::Sweep(SweepError::Mismatch { .. }) => {
                "--resume wants the same scene, arguments and version; name another folder, or write --force to begin anew"
            }
            Error::Sweep(SweepError::Damaged { .. }) => "name another folder, or write --force to begin anew",
            Error::Sweep(SweepError::Parts(_)) => {
                "name the folders of all parts, each once; compute what is missing with --resume"
            }
            Error::Sweep(_) => "ask for fewer threads with --threads",
            Error::Simulation(SimulationError::Integrator(_)) => {
                "set run.integrator.method to \"auto\", or use a build that has it"
            }
            Error::Simulation(SimulationError::Verify(_)) => {
                "please report the scene; events.jsonl holds the run up to there"
            }
            Error::Simulation(SimulationError::Energy { .. }) => {
                "the run is not to be trusted; please report the scene"
            }
            Error::Simulation(SimulationError::Overflow(_)) => {
                "loads, speeds or masses of the scene are too large: state them in other units"
            }
            _ => return None,
        };
        Some(Box::new(help))
    }
}

impl Error {
    /// Writes the error to standard error and returns the exit code.
    pub(super) fn report(self) -> u8 {
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
        super::tell(&format!("{:?}", miette::Report::new(Helped(self))));
        code
    }
}
