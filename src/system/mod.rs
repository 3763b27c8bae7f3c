//! A linear structure with contacts as a hybrid automaton: actions in a mode, jumps, impacts, energy.
//!
//! Every train assembles into the same [`Spec`]; the engine sees only a [`Structure`] made from it. The kernel computes its smooth motion.

mod acting;
mod assemble;
mod automaton;
mod check;
mod columns;
mod common;
mod contact_mode;
mod energy;
mod forces;
mod passing;
mod rebound;
mod schedule;
mod spec;
mod statics;
mod sticking;
mod strike;
mod symmetry;
mod tangent;
mod together;
mod twofold;
mod unilateral;
mod variation;
mod view;

pub(crate) use acting::{ActiveContact, Elasticity, Force};
pub use assemble::{Contact, Structure};
pub(crate) use assemble::{LoadWave, Oscillator, PerContact, Sparse, Spring, Wave, dot, zeros};
pub use automaton::{Start, StartError};
pub use check::AssembleError;
pub(crate) use columns::{Block, FourColumns, VectorColumns};
pub(crate) use contact_mode::{ContactMode, Watch};
#[doc(hidden)]
pub use contact_mode::{contact_mode, guard_id, guard_of, piece, set_contact};
pub(crate) use schedule::PiecesInForce;
pub use spec::{BackFlank, Bearing, BearingSpring, ContactSpec, Flanks, LoadHarmonic, LoadSchedule, Spec};
pub use statics::{
    Equilibrium, EquilibriumError, bonded_modes, bonded_stiffness, equilibrium, pressed, quasi_static,
    tangent_stiffness,
};
pub(crate) use sticking::Sticking;
#[doc(hidden)]
pub use tangent::Saltation;
pub(crate) use tangent::{Eight, Gradient, LANES, Lanes};
pub(crate) use variation::Evaluation;
pub use variation::Variation;
