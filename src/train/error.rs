//! Errors in the assembly of a train.

use std::fmt;

use thiserror::Error;

use crate::{gear::GeometryError, system::EquilibriumError};

/// Error in the assembly of a train.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A value outside its range.
    #[error("{name} is {value}; it must be {wanted}")]
    Value {
        /// Name of the value.
        name: String,
        /// The value.
        value: f64,
        /// Permitted range.
        wanted: &'static str,
    },
    /// An unknown degree of freedom, or one named twice.
    #[error("no freedom `{name}` to keep; the train has {}", known.join(", "))]
    Freedom {
        /// Requested name.
        name: String,
        /// Known names.
        known: Vec<String>,
    },
    /// The in-phase reduction was requested for planets that are not alike.
    #[error(
        "the in-phase reduction needs alike planets, equally spaced, with equal mesh phases; planet {planet} differs"
    )]
    NotInPhase {
        /// Number of the first planet that differs from planet 1, from 1.
        planet: usize,
    },
    /// Fewer or more phases than planets.
    #[error("{got} mesh phases for {planets} planets")]
    Phases {
        /// Number of planets.
        planets: usize,
        /// Number of phases given.
        got: usize,
    },
    /// Something varies with the mesh frequency, which is zero.
    #[error("{what} varies with the mesh frequency, but the speed is zero")]
    Standing {
        /// The varying quantity.
        what: String,
    },
    /// There is no state of rest.
    #[error(transparent)]
    Equilibrium(#[from] EquilibriumError),
    /// Gears that cannot mesh.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// Returns an error with the permitted range unless `ok`. The name is formatted only in that case.
pub(super) fn check(name: impl fmt::Display, value: f64, ok: bool, wanted: &'static str) -> Result<(), TrainError> {
    if ok && value.is_finite() { Ok(()) } else { Err(TrainError::Value { name: name.to_string(), value, wanted }) }
}
