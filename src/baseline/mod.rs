//! Fixed-step penalty codes in the best usual form: the references against which Flank is measured.
//!
//! A baseline has the train, loads and contact laws of the engine, but no events, on purpose. The force is that of the law at the present
//! deflection, and a step crosses a flank without detecting it. Starts and ends of contact follow afterwards from sign changes between
//! samples.
//!
//! | file | content |
//! |---|---|
//! | `penalty` | the train without modes; impacts of rigid contacts at the ends of steps |
//! | `ramp` | sharp and smoothed `max(p, 0)` |
//! | `forcing` | terms that depend on time alone, on a grid of equal steps |
//! | `method`, `alpha` | the methods |
//! | `adaptive` | solvers that choose their steps, across the kinks |
//! | `drive` | the loop, and its observers |
//! | `crossing` | events from sign changes |

mod adaptive;
mod alpha;
mod crossing;
mod drive;
mod forcing;
mod method;
mod penalty;
mod ramp;

pub use alpha::Alpha;
pub use crossing::{Crossing, Crossings, Interpolation};
pub use drive::{Counters, Divergence, Grid, Sample, SampleObserver};
pub use method::Method;
pub use penalty::{Penalty, StepPoint, Touch};
pub use ramp::Ramp;
