use std::{
    io,
    path::{Path, PathBuf},
};

use super::MANIFEST;

/// Why a folder cannot be written into.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// It holds something.
    #[error("{0} is not empty")]
    Occupied(PathBuf),
    /// A file, folder or link that no manifest names has the name of an output.
    #[error("{0} is in the way: {MANIFEST} does not name it as a file of an earlier command")]
    Foreign(PathBuf),
    /// The manifest names the input of the command.
    #[error("{0} is read by this command and would be replaced")]
    Input(PathBuf),
    /// The manifest cannot be followed, and why.
    #[error("{0} cannot be followed: {1}")]
    Manifest(PathBuf, String),
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl OutputError {
    pub(super) fn file(path: &Path, source: io::Error) -> Self {
        Self::File { path: path.to_owned(), source }
    }
}
