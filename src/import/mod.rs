//! Gearboxes from files that other programs wrote.
//!
//! [`import`] reads a file of the exchange format REXS (versions 1.0 to 1.7; of later ones as far as its names are known), as XML,
//! JSON or zip, and makes a scene of it: cylindrical gears on shafts, spur and helical, planetary stages of one sun, one ring and
//! simple planets. Each number of the scene has an [`Origin`]: an attribute of the file, a rule, or a usual value.

mod bodies;
mod gearbox;
mod json;
mod ledger;
mod loads;
mod model;
mod pair;
mod quantity;
mod read;
mod stage;
mod teeth;
mod writer;
mod xml;

use serde_json::Value;

pub use self::{
    ledger::{Origin, Source},
    model::{Attribute, Component, LoadCase, Model, Relation, Value as Attributed},
    read::{LARGEST, read},
};
use crate::output::Fault;

/// Choices of an import.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Number of the load case; the first one if left out.
    pub load_case: Option<String>,
    /// Numbers of the scene that replace those of the file, by JSON pointer.
    pub set: Vec<(String, Value)>,
    /// Names or numbers of shafts that stand still.
    pub fix: Vec<String>,
    /// Asks for what the file does not have, in place of usual values.
    pub no_defaults: bool,
}

/// A scene made of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Import {
    /// The scene.
    pub scene: Value,
    /// Origins of its numbers, in the order of their making.
    pub origins: Vec<Origin>,
    /// Remarks on what was read and not used, or used with a doubt.
    pub notes: Vec<String>,
}

/// Cause for which no scene is made of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The bytes are no file of the format.
    #[error("the file cannot be read: {0}")]
    Unreadable(String),
    /// All that is missing or wrong.
    #[error("no scene can be made of the file{}", .0.iter().map(|fault| format!("\n{fault}")).collect::<String>())]
    Faults(Vec<Fault>),
}

/// Makes a scene of the bytes of a file.
///
/// # Errors
/// [`ImportError`]: bytes that cannot be read, or all that is missing or wrong in the gearbox.
pub fn import(bytes: &[u8], options: &Options) -> Result<Import, ImportError> {
    gearbox::scene(read(bytes)?, options)
}
