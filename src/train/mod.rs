//! Gear trains: bodies and freedoms in, a linear structure with contacts out, and the automaton on top.
//!
//! Every train assembles into the same [`Spec`]; a [`Structure`] made from it is all the engine sees.

mod assemble;
mod automaton;
mod body;
mod check;
mod contact_mode;
mod energy;
mod error;
mod forces;
pub mod frame;
mod jet;
mod linear;
mod mesh;
mod pair;
pub mod planetary;
mod scaled;
mod schedule;
mod spec;
mod sticking;
mod symmetry;
mod twofold;
mod unilateral;
mod view;
mod wall;

pub use assemble::{Contact, MAX_CONTACTS, Structure};
pub use automaton::{Start, StartError};
pub use body::{Body, Damping, Support};
pub use check::AssembleError;
pub use contact_mode::{ContactMode, Watch, contact_mode, guard_id, guard_of, piece, with_contact};
pub use error::TrainError;
pub use linear::{Equilibrium, bonded_modes, bonded_stiffness, equilibrium, tangent_stiffness};
pub use mesh::{Mesh, mesh_damping};
pub use pair::{GearPair, KahramanSingh};
pub use planetary::{Freedoms, Load, Phasing, Planet, Planetary, StageGeometry, Teeth, Warning};
pub use scaled::Quantity;
pub use spec::{ContactSpec, Flanks, LoadHarmonic, Spec};
pub use view::damped_restitution;
pub use wall::{Walled, Walls};
