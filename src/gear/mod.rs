//! One gear mesh: geometry, phase, stiffness, error, contact laws. The module is independent of trains and solvers.

pub mod contact;
mod curve;
pub mod geometry;
mod harmonic;
pub mod phase;
mod schedule;
mod stiffness;

pub use curve::{Curve, CurveShape, HarmonicSeries};
pub use geometry::{BasicRack, Gear, GeometryError, Material, MeshGeometry, MeshKind, PathOfContact};
pub use harmonic::{Harmonic, MeshHarmonic};
pub use schedule::{MeshStiffness, Waveform};
pub use stiffness::{Piece, Stiffness};
