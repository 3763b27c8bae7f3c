//! Fixed-step penalty codes, written as their best practitioners would: what Flank is measured against.
//!
//! A baseline sees the same train, the same loads and the same contact laws as the engine, and knows no events, on
//! purpose: the force is whatever the law gives at the deflection of the moment, a step runs across a flank without
//! noticing, and contact starts and ends are read off afterwards from sign changes between samples.
//!
//! | file | what it holds |
//! |---|---|
//! | `penalty` | the train without modes; impacts of rigid contacts at the ends of steps |
//! | `ramp` | sharp and smoothed `max(p, 0)` |
//! | `forcing` | what depends on time alone, on a grid of equal steps |
//! | `method`, `alpha` | the methods |
//! | `adaptive` | solvers that choose their steps, straight through the kinks |
//! | `drive` | the loop, and what it can be asked to watch |
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
pub use drive::{Counters, Diverged, Grid, Sample, Watch};
pub use method::Method;
pub use penalty::{Penalty, Point, Touch};
pub use ramp::Ramp;
