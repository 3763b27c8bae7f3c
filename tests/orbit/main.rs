//! The derivative of the motion, orbits and exponents.
#![allow(clippy::unwrap_used)] // helpers of tests are not recognised as tests

mod differences;
mod exponents;
mod orbits;
