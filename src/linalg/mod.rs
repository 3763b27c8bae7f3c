//! Linear algebra on top of nalgebra.

mod modes;

pub use modes::{EigenError, Modes, multiplicities, natural_modes};
