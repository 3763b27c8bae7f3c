//! Flank simulates gear vibro-impact with exact events.
//!
//! A train is a hybrid automaton. In each contact state the motion is smooth, with a known Taylor series. Flank finds the first guard that
//! falls through zero on a step, with a certificate; the automaton jumps, and a new arc starts.
//!
//! ```
//! // A ball dropped from 1 m comes to rest after infinitely many bounces, at √(2h/g) (1 + e)/(1 − e).
//! let ball = r#"{
//!     "flank": 1,
//!     "train": {
//!         "kind": "wall", "mass_kg": 1, "load_n": -9.81,
//!         "wall": { "side": "below", "position_m": 0 },
//!         "law": { "kind": "rigid", "restitution": 0.8 }
//!     },
//!     "initial": { "q": [1] },
//!     "run": { "t_end_s": 5 }
//! }"#;
//! let run = flank::Simulation::from_json(ball)?.run()?;
//! let rest = run.events.iter().find(|row| row.accumulation.is_some()).expect("the ball comes to rest");
//! let exact = (2.0f64 / 9.81).sqrt() * 1.8 / 0.2;
//! assert!((rest.seconds - exact).abs() < 1e-13 * exact);
//! # Ok::<(), flank::simulation::SimulationError>(())
//! ```
//!
//! # Modules
//!
//! | module | contents |
//! |---|---|
//! | [`simulation`] | the main interface: a [`Simulation`] is a scene, or a train built in Rust, ready to run |
//! | [`scene`] | JSON scenes: read, checked, built |
//! | [`train`] | bodies, pairs, planetary stages, walls: their assembly into a [`Spec`](system::Spec) |
//! | [`system`] | a linear structure with contacts: the automaton, jumps, impacts, energy |
//! | [`gear`] | one mesh: geometry, phases, stiffness, contact laws |
//! | [`hybrid`] | terms of the automaton: modes, guards, flows, instants, [`HybridSystem`](hybrid::HybridSystem) |
//! | [`integrate`] | dense steps along a smooth arc: Taylor series, and diffsol's methods behind a feature |
//! | [`event`] | the first guard that falls on a step, and its record |
//! | [`engine`] | repetition of flow, first event and jump; observers, outcomes, accumulating impacts |
//! | [`analysis`] | measures taken during a run: contacts, energy, event rows, trajectories |
//! | [`accuracy`] | the engine and fixed-step penalty codes on one problem: errors against a reference of stated error, charts |
//! | [`verify`] | check of a run arc by arc, by two independent methods for the next event |
//! | [`orbit`] | the derivative of the motion, periodic orbits, multipliers, exponents, words |
//! | [`branch`] | orbits followed along a parameter, special points located, curves of them |
//! | [`map`] | maps over two parameters, basins, diagrams |
//! | [`ensemble`] | many motions of one train in parallel, each with the same bits as alone |
//! | [`sweep`] | the same work at every point of a grid, stored row by row |
//! | [`study`] | steady motions, their dependence on parameters of a scene, identification of such parameters |
//!
//! The features are `cli` (the `flank` program), `diffsol` (integrators for stiff modes and user-defined fields), `import` (gearbox files)
//! and `plot` (pictures), the last two parts of `cli`, all on by default. Without them the library has only Taylor series and Radau steps.
//!
//! # What it is not
//!
//! Flank is no multibody program: structures are linear, directions of contact constant, speeds given. It is no tooth contact analysis:
//! stiffness and error are input. It has no friction, and no regularised contact, because a penalty method has no events. It prints nothing,
//! and no number depends on a clock; the same input gives the same numbers.
#![warn(missing_docs)]

pub mod accuracy;
pub mod analysis;
pub mod branch;
pub mod engine;
pub mod ensemble;
mod error;
pub mod event;
pub mod gear;
pub mod hybrid;
#[cfg(feature = "import")]
pub mod import;
pub mod integrate;
mod kernel;
pub mod map;
pub mod orbit;
pub mod scene;
pub mod simulation;
pub mod study;
pub mod sweep;
pub mod system;
pub mod tangent;
mod task;
pub mod train;
mod vectors;
pub mod verify;

// Public for the program and the tests, without a promise.
#[doc(hidden)]
pub mod baseline;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod linalg;
#[doc(hidden)]
pub mod output;
#[doc(hidden)]
pub mod plot;
#[doc(hidden)]
pub mod poly;

pub use error::Error;
/// Matrices and vectors of the public types.
pub use nalgebra;
pub use simulation::Simulation;
pub use task::{Progress, Task};
pub use vectors::Instructions;

/// Returns whether the old step rule is restored, without alarms, leaps and lanes. That rule misses forcing of a guard, so that a test can
/// show that `--verify` finds the error. Set by an environment variable, which builds without debug assertions ignore.
fn old_steps() -> bool {
    use std::sync::LazyLock;
    static ASKED: LazyLock<bool> = LazyLock::new(|| std::env::var_os("FLANK_OLD_STEPS").is_some());
    cfg!(debug_assertions) && *ASKED
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
