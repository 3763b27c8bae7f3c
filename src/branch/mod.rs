//! Branches of periodic orbits along a number of a scene, and the points at which the motion changes.
//!
//! A [`Continuation`] starts from the orbit at the scene's own value and goes both ways, by steps of arc length (Keller 1977), through
//! folds and along unstable parts. Each step is solved with the exact derivative of the period by state and number. Between two points of a
//! branch the tests of [`SpecialKind`] say what has been passed; it is then located as the orbit at which its test is zero.

mod behind;
mod course;
mod curve;
mod family;
mod follow;
mod locate;
mod node;
mod rest;
mod run;
mod special;

pub use curve::{Codimension, Curve, CurvePoint, curves};
pub use family::Family;
pub use run::{Branch, BranchPoint, BranchProgress, Continuation};
pub use special::{Special, SpecialKind};
