use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::Grid;

/// Where the points of a sweep start: fresh, or at the end of a neighbour along the last axis. Coexisting branches show where
/// the two directions differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
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

/// How a row was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Alone.
    Fresh,
    /// Along the last axis, from its first value to its last.
    Up,
    /// From its last value to its first.
    Down,
}

/// What is done for one row.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Number of the row in grid order, from 0.
    pub row: usize,
    /// Value on every axis.
    pub values: Vec<f64>,
    /// How the row is reached.
    pub direction: Direction,
}

/// The rows of a sweep and the chains they are computed in.
///
/// Rows are in grid order; with [`Seeding::Both`] each point has two, up before down. A chain is a list of rows of which
/// each starts from the end of the one before; its first starts fresh. There are no other ties between rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    grid: Grid,
    seeding: Seeding,
}

impl Plan {
    /// Visits `grid` as `seeding` says.
    #[must_use]
    pub fn new(grid: Grid, seeding: Seeding) -> Self {
        Self { grid, seeding }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// What the files of the sweep are known by, besides what the caller adds: axes and seeding.
    #[must_use]
    pub fn header(&self) -> Map<String, Value> {
        let mut header = Map::new();
        header.insert("axes".to_owned(), json!(self.grid.axes()));
        header.insert("seeding".to_owned(), json!(self.seeding));
        header
    }

    fn ways(&self) -> &'static [Direction] {
        match self.seeding {
            Seeding::Fresh => &[Direction::Fresh],
            Seeding::Up => &[Direction::Up],
            Seeding::Down => &[Direction::Down],
            Seeding::Both => &[Direction::Up, Direction::Down],
        }
    }

    /// How many rows; one at least.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.grid.points() * self.ways().len()
    }

    /// Row number `row`, below [`rows`](Self::rows).
    #[must_use]
    pub fn cell(&self, row: usize) -> Cell {
        let (point, way) = (row / self.ways().len(), row % self.ways().len());
        Cell { row, values: self.grid.values(point), direction: self.ways()[way] }
    }

    /// How many chains.
    #[must_use]
    pub fn chains(&self) -> usize {
        match self.seeding {
            Seeding::Fresh => self.rows(),
            _ => self.rows() / self.grid.line(),
        }
    }

    /// Number of the chain of row number `row`.
    #[must_use]
    pub fn chain_of(&self, row: usize) -> usize {
        let ways = self.ways().len();
        match self.seeding {
            Seeding::Fresh => row,
            _ => row / ways / self.grid.line() * ways + row % ways,
        }
    }

    /// The rows of chain number `chain`, in their order.
    pub fn chain(&self, chain: usize) -> impl Iterator<Item = usize> + use<> {
        let (ways, length) = (self.ways(), self.rows() / self.chains());
        let (first, way) = (chain / ways.len() * length, chain % ways.len());
        (0..length).map(move |i| {
            let point = first + if ways[way] == Direction::Down { length - 1 - i } else { i };
            point * ways.len() + way
        })
    }
}
