//! Accuracy against work: the engine and the fixed-step baselines on the same problem, measured by the same rule.
//!
//! A [`Truth`] is the engine's own solution with a bound on its error that was measured, not assumed, over a window that ends
//! before the motion amplifies errors. A [`Contender`] is any way of solving the problem; its [`Score`] says how far it is
//! from the truth and what work it did. Nothing here reads a clock: a
//! [`WorkPrecision`] is given one.

mod contender;
mod error;
mod order;
mod problem;
mod score;
pub mod stability;
mod truth;
mod work_precision;
#[cfg(feature = "plot")]
mod work_precision_page;

pub use contender::{Contender, Performance, Setting, SolverKind};
pub use error::AccuracyError;
pub use order::{Order, Roughness, reached};
pub use problem::Problem;
pub use score::Score;
pub use truth::{Truth, Window};
pub use work_precision::{ContenderRun, ContenderSummary, RunTime, WorkPrecision, median};
