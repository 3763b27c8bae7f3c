//! `flank scene show`.

use std::path::PathBuf;

use super::{CliError, print, session};

/// What to do with a scene.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Print a scene with every default written out
    Show {
        /// Scene file; the reference scene if left out
        scene: Option<PathBuf>,
    },
}

/// Executes a `scene` command.
pub fn execute(command: &Command) -> Result<(), CliError> {
    let Command::Show { scene } = command;
    print(&format!("{:#}\n", session::read(scene.as_deref())?.resolved()))
}
