//! Maps and basins: kinds of the motion in every cell over two numbers of a scene, or from every start in a plane of starts.
//!
//! The row of each cell depends only on the cell, so neighbours, order, threads and interruptions change no byte. Memory does not grow with
//! the number of cells.

mod attractor;
mod basins;
mod cell;
mod diagram;
mod edges;
mod kinds;
mod picture;
mod plane;
mod sweep_figure;
mod tally;
mod walk;

pub use attractor::Attractor;
pub use basins::{BasinResult, Basins, BasinsError};
pub use cell::{Cell, CellRule, Impacts};
pub use diagram::{BranchLine, Diagram, DiagramRows, Points, Sampling, Seed};
pub use edges::{Boundary, Figures, Fraction, Measured};
pub use kinds::KindMap;
pub use picture::{basins_figure, diagram_figure, figure};
pub use plane::{MOST_CELLS, Plane, PlaneError};
pub use sweep_figure::sweep_figure;
pub use tally::{Class, PictureCell, Tally};
pub use walk::{Record, Strike};
