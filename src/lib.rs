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
//! # Ok::<(), flank::Error>(())
//! ```
//!
//! # By task
//!
//! [`prelude`] has the names of the first three rows.
//!
//! | task | interface |
//! |---|---|
//! | run a scene, read its events and measures | [`Simulation`], [`simulation::Job`], [`simulation::RunRecord`] |
//! | read, check and change scenes | [`scene::Scene`]; files of other programs: `import` |
//! | follow progress, cancel, handle errors | [`Task`], [`Progress`], [`Error`] |
//! | many starts of one train | [`ensemble::Ensemble`] |
//! | steady motions over a grid of numbers | [`study::SteadySweep`], stored by [`sweep`] |
//! | kinds of motion over two numbers, basins, diagrams | [`map`] |
//! | periodic orbits, multipliers, exponents | [`orbit::Search`], [`orbit::SectionMap`], [`orbit::Lyapunov`] |
//! | orbits along a number, and where they change | [`branch::Continuation`] |
//! | loads below which contact is lost | [`study::rattle`] |
//! | numbers of a scene from measurements, simpler models | [`study::identify`](mod@study::identify), [`study::fit`], [`study::advise`](mod@study::advise) |
//! | errors and times of fixed-step codes | [`accuracy`] |
//! | check of a run by two independent methods | [`verify`] |
//! | trains built in Rust | [`train`] for gears, [`system::Spec`] for matrices with contacts, [`gear`] for one mesh |
//! | measures of one's own during a run | [`engine::Observer`], with those of [`analysis`] as examples |
//! | control of each arc and event | [`engine`], [`event`], [`integrate`], and the terms in [`hybrid`] |
//!
//! Public types may gain fields and variants in any version unless they are made to be written by users, such as those of [`train`].
//! nalgebra, whose matrices they hold, is re-exported as [`nalgebra`].
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
#[doc(no_inline)]
pub use nalgebra;
pub use simulation::Simulation;
pub use task::{Progress, Task};
pub use vectors::Instructions;

/// Names for a run of a scene.
pub mod prelude {
    #[doc(no_inline)]
    pub use crate::{
        Error, Progress, Simulation, Task,
        analysis::{ContactEvent, ContactReport, EventKind, EventRow},
        engine::Observer,
        ensemble::Ensemble,
        scene::Scene,
        simulation::{EndKind, Job, RunRecord, Summary},
    };
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
