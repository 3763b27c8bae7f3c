//! Linear algebra on top of nalgebra.

mod inverse;
mod modes;

pub(crate) use inverse::Inverse;
pub use modes::{EigenError, Modes, multiplicities, natural_modes};
