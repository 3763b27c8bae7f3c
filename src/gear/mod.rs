//! One gear mesh: geometry, phase, stiffness, error, contact laws. Knows nothing of trains or solvers.

pub mod contact;
mod harmonic;
mod stiffness;

pub use harmonic::Harmonic;
pub use stiffness::{Piece, Stiffness};
