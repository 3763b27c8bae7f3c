//! Sweeps: the same work at every point of a grid, stored row by row.
//!
//! A [`Grid`] is one or two [`Axis`] of numbers. A [`Plan`] sets the order of its points, and those that start from the end of a neighbour.
//! [`run()`] visits them on several threads. A [`Journal`] stores each row as it finishes and becomes the final files when none is missing.
//! The caller defines a row, the data passed to a neighbour, and the work at a point.
//!
//! The final files depend on the plan and the work alone: neither on the number of threads nor on the number of interruptions.
//!
//! ```
//! use flank::{Task, sweep::{Begin, Ending, Grid, Journal, Plan, RowWork, Seeding, run}};
//!
//! // Where Newton's method for x² = a ends, each time started from the root before.
//! let newton = |cell: &RowWork, seed: Option<&f64>| -> Result<(f64, f64), String> {
//!     let x = (0..60).fold(*seed.unwrap_or(&1.0), |x, _| (x + cell.values[0] / x) / 2.0);
//!     Ok((x, x))
//! };
//! let plan = Plan::new(Grid::parse(&["/a=1:9:9"])?, Seeding::Up);
//! let folder = tempfile::tempdir()?;
//!
//! let mut journal = Journal::open(folder.path(), Begin::New, plan.header(), &plan)?.expect("a new sweep is open");
//! assert_eq!(run(&plan, &mut journal, newton, Task::default())?, Ending::Complete);
//! journal.finish(&plan, &["root"], |root| vec![root.to_string()], |_| Ok(()))?;
//!
//! let table = std::fs::read_to_string(folder.path().join("sweep.csv"))?;
//! assert_eq!(table.lines().last(), Some("9.0,up,3,"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod files;
mod grid;
mod journal;
mod plan;
mod records;
mod run;
mod share;
mod source;

pub use error::{GridError, SweepError};
pub use files::Tally;
pub use grid::{Axis, Grid};
pub use journal::{Begin, Journal};
pub(crate) use journal::{Outcome, SWEEP};
pub use plan::{Plan, RowWork, Seeding, SweepDirection};
pub(crate) use records::Write;
pub use records::{CommandFiles, Records, Rows};
pub use run::{Ending, run};
pub use share::Share;
pub use source::same;
