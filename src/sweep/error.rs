use std::path::PathBuf;

use crate::output::{Fault, OutputError};

/// Axes that make no grid, with everything that is wrong with them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the axes cannot be used{}", self.0.iter().map(|fault| format!("\n{fault}")).collect::<String>())]
pub struct GridError(
    /// All faults found, at least one.
    pub Vec<Fault>,
);

/// Why a sweep cannot start, go on or be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// A new sweep was asked for in a folder that holds an unfinished one.
    #[error("{0} holds rows of a command that has not finished")]
    Unfinished(PathBuf),
    /// What lies in the folder belongs to another sweep.
    #[error("{path} holds other work{}", differences.iter().map(|d| format!("\n  {d}")).collect::<String>())]
    Mismatch {
        /// The folder.
        path: PathBuf,
        /// What differs, one entry each: name, what it was, what it is now.
        differences: Vec<String>,
    },
    /// The header of a file is not what a command wrote.
    #[error("{path} is damaged: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Parts that cannot be merged, and all that is wrong with them.
    #[error("the parts cannot be merged{}", .0.iter().map(|fault| format!("\n  {fault}")).collect::<String>())]
    Parts(Vec<String>),
    /// The folder cannot be written into, or a file cannot be read or written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
