//! Map of the steps at which a fixed-step method gives the right motion, over the step and a factor on a quantity of all contacts.
//!
//! Every cell of a [`Map`] is one run of one method, judged against the engine's motion of the same changed train by the
//! rules at [`Outcome`]. The engine's own row lies on the same plane, and beside it the step at which the linear train with
//! every mesh closed would become unstable. Results do not depend on the number of threads.

mod figure;
mod long;
mod map;
mod page;

pub use long::{EngineMotion, LongRunRule};
pub(super) use map::highest_frequency;
pub use map::{Cell, FactorRow, Map, MapPlan, Outcome, Reference};
