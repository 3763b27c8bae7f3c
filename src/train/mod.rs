//! Gear trains: bodies and freedoms in, a linear structure with contacts out, and the automaton on top.
//!
//! Every train assembles into the same [`Spec`]; none has code of its own beyond this module.

mod body;
mod error;
pub mod frame;
mod linear;
mod mesh;
mod pair;
pub mod planetary;
mod spec;
mod wall;

pub use body::{Body, Damping, Support};
pub use error::TrainError;
pub use linear::{Equilibrium, bonded_modes, bonded_stiffness, equilibrium};
pub use mesh::{Mesh, mesh_damping};
pub use pair::{GearPair, KahramanSingh};
pub use planetary::{Freedoms, Load, Phasing, Planet, Planetary, StageGeometry, Teeth, Warning};
pub use spec::{ContactSpec, Flanks, LoadHarmonic, Spec};
pub use wall::{Walled, Walls};
