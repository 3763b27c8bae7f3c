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
    /// Identifier of the load case; the first one if left out.
    pub load_case: Option<String>,
    /// Numbers of the scene that replace those of the file, by JSON pointer.
    pub set: Vec<(String, Value)>,
    /// Names or identifiers of shafts that stand still.
    pub fix: Vec<String>,
    /// True to report values that the file does not have as faults, in place of usual values.
    pub no_defaults: bool,
}

/// A scene made of a file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Import {
    /// The scene.
    pub scene: Value,
    /// Origins of the numbers of the scene, in the order in which they were written.
    pub origins: Vec<Origin>,
    /// Remarks on data that were read and not used, or used with a doubt.
    pub notes: Vec<String>,
}

/// Reason why no scene can be made of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The bytes are no file of the format.
    #[error("the file cannot be read: {0}")]
    Unreadable(String),
    /// All missing or wrong data of the gearbox.
    #[error("no scene can be made of the file{}", .0.iter().map(|fault| format!("\n{fault}")).collect::<String>())]
    Faults(Vec<Fault>),
}

/// Makes a scene of the bytes of a file.
///
/// # Errors
/// [`ImportError`]: bytes that cannot be read, or all missing or wrong data of the gearbox.
pub fn import(bytes: &[u8], options: &Options) -> Result<Import, ImportError> {
    gearbox::scene(read(bytes)?, options)
}
