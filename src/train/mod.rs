//! Gear trains: bodies and degrees of freedom in, the [`Spec`](crate::system::Spec) of a structure with contacts out.

mod assembly;
mod body;
mod drawing;
mod error;
pub mod frame;
pub mod gearbox;
mod imposed;
mod mesh;
mod pair;
pub mod planetary;
mod scaled;
mod wall;

pub use body::{Body, Damping, Support};
pub use drawing::{Drawing, GearDrawing};
pub use error::TrainError;
pub use mesh::{Mesh, MeshBack, mesh_damping};
pub use pair::{GearPair, KahramanSingh};
pub use planetary::{Freedoms, Load, Phasing, Planet, Planetary, StageGeometry, Teeth, Warning};
pub use scaled::Quantity;
pub use wall::{WalledOscillator, Walls};
