use std::path::PathBuf;

use crate::output::{Fault, OutputError};

/// Axes that make no grid, with all their faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the axes cannot be used{}", self.0.iter().map(|fault| format!("\n{fault}")).collect::<String>())]
pub struct GridError(
    /// All faults found, at least one.
    pub Vec<Fault>,
);

/// Error at the start or resumption of a sweep, or in its storage.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// A new sweep was requested in a folder that holds an unfinished one.
    #[error("{0} holds rows of a command that has not finished")]
    Unfinished(PathBuf),
    /// The folder holds files of another sweep.
    #[error("{path} holds other work{}", differences.iter().map(|d| format!("\n  {d}")).collect::<String>())]
    Mismatch {
        /// The folder.
        path: PathBuf,
        /// Differences, one entry each: name, stored value, present value.
        differences: Vec<String>,
    },
    /// The header of a file is not one of a command.
    #[error("{path} is damaged: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Fault of the file.
        reason: String,
    },
    /// Parts that cannot be merged, with all their faults.
    #[error("the parts cannot be merged{}", .0.iter().map(|fault| format!("\n  {fault}")).collect::<String>())]
    Parts(Vec<String>),
    /// The folder cannot be written into, or a file cannot be read or written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
