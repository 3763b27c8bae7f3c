//! `flank schema`.

use super::{CliError, print};

/// Prints the JSON Schema of scenes.
pub fn execute() -> Result<(), CliError> {
    print(&format!("{:#}\n", flank::scene::schema()))
}
