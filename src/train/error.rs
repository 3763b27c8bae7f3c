//! Why a train cannot be assembled.

use std::fmt;

use thiserror::Error;

use crate::{gear::GeometryError, system::EquilibriumError};

/// Why a train cannot be assembled.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TrainError {
    /// A value outside its range.
    #[error("{name} is {value}; it must be {wanted}")]
    Value {
        /// What it is called.
        name: String,
        /// What it was.
        value: f64,
        /// The range.
        wanted: &'static str,
    },
    /// A freedom the train does not have, or one named twice.
    #[error("no freedom `{name}` to keep; the train has {}", known.join(", "))]
    Freedom {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// The in-phase reduction asked for planets that are not alike.
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
        /// Planets.
        planets: usize,
        /// Phases given.
        got: usize,
    },
    /// Something varies with the mesh frequency, which is zero.
    #[error("{what} varies with the mesh frequency, but the speed is zero")]
    Standing {
        /// What varies.
        what: String,
    },
    /// There is no state of rest.
    #[error(transparent)]
    Equilibrium(#[from] EquilibriumError),
    /// Gears that cannot mesh.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// `value` if `ok`, else the error that says what it should have been. The name is written only there.
pub(super) fn check(name: impl fmt::Display, value: f64, ok: bool, wanted: &'static str) -> Result<(), TrainError> {
    if ok && value.is_finite() { Ok(()) } else { Err(TrainError::Value { name: name.to_string(), value, wanted }) }
}
