use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::Grid;

/// Start of the points of a sweep: fresh, or at the end of a neighbour along the last axis. The two directions differ where branches
/// coexist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Seeding {
    /// Each point as the scene says
    Fresh,
    /// Each from the one before it
    Up,
    /// Each from the one after it
    Down,
    /// Up and down, two rows a point
    Both,
}

/// Direction in which a row was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SweepDirection {
    /// No direction: the row starts fresh.
    Fresh,
    /// Along the last axis, from its first value to its last.
    Up,
    /// Along the last axis, from its last value to its first.
    Down,
}

/// Work of one row.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RowWork {
    /// Index of the row in grid order, from 0.
    pub row: usize,
    /// Value on every axis.
    pub values: Vec<f64>,
    /// Direction in which the row is reached.
    pub direction: SweepDirection,
}

/// Rows of a sweep and the chains in which they are computed.
///
/// Rows are in grid order; with [`Seeding::Both`] each point has two, up before down. In a chain each row starts from the end of the one
/// before; the first starts fresh. Rows are otherwise independent.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    grid: Grid,
    seeding: Seeding,
}

impl Plan {
    /// Returns the plan that visits `grid` by `seeding`.
    #[must_use]
    pub fn new(grid: Grid, seeding: Seeding) -> Self {
        Self { grid, seeding }
    }

    /// Returns the grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Returns the part of the header that identifies the sweep, for the caller to extend: axes and seeding.
    #[must_use]
    pub fn header(&self) -> Map<String, Value> {
        let mut header = Map::new();
        header.insert("axes".to_owned(), json!(self.grid.axes()));
        header.insert("seeding".to_owned(), json!(self.seeding));
        header
    }

    fn ways(&self) -> &'static [SweepDirection] {
        match self.seeding {
            Seeding::Fresh => &[SweepDirection::Fresh],
            Seeding::Up => &[SweepDirection::Up],
            Seeding::Down => &[SweepDirection::Down],
            Seeding::Both => &[SweepDirection::Up, SweepDirection::Down],
        }
    }

    /// Returns the number of rows; one at least.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.grid.points() * self.ways().len()
    }

    /// Returns row number `row`, below [`rows`](Self::rows).
    #[must_use]
    pub fn cell(&self, row: usize) -> RowWork {
        let (point, way) = (row / self.ways().len(), row % self.ways().len());
        RowWork { row, values: self.grid.values(point), direction: self.ways()[way] }
    }

    /// Returns the number of chains.
    #[must_use]
    pub fn chains(&self) -> usize {
        match self.seeding {
            Seeding::Fresh => self.rows(),
            _ => self.rows() / self.grid.line(),
        }
    }

    /// Returns the chain of row number `row`.
    #[must_use]
    pub fn chain_of(&self, row: usize) -> usize {
        let ways = self.ways().len();
        match self.seeding {
            Seeding::Fresh => row,
            _ => row / ways / self.grid.line() * ways + row % ways,
        }
    }

    /// Returns the rows of chain number `chain`, in their order.
    pub fn chain(&self, chain: usize) -> impl Iterator<Item = usize> + use<> {
        let (ways, length) = (self.ways(), self.rows() / self.chains());
        let (first, way) = (chain / ways.len() * length, chain % ways.len());
        (0..length).map(move |i| {
            let point = first + if ways[way] == SweepDirection::Down { length - 1 - i } else { i };
            point * ways.len() + way
        })
    }
}
