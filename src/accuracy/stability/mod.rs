//! Where a fixed-step method gives the right motion: the plane of its step and a factor on what all contacts have.
//!
//! Every cell of a [`Map`] is one run of one method, judged against the engine's motion of the same changed train by the
//! rules at [`Outcome`]. The engine's own row lies on the same plane, and beside it the step at which the linear train with
//! every mesh closed would become unstable. Results do not depend on the number of threads.

mod figure;
mod limit;
mod long;
mod map;
mod outcome;
mod page;

pub use figure::figure;
pub use limit::highest_frequency;
pub use long::{Own, Rule};
pub use map::{Cell, Map, Plan, Reference, Row, cycle_length, map};
pub use outcome::Outcome;
