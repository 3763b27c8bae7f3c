//! Flank simulates gear vibro-impact with exact events.
//!
//! A train is a hybrid automaton: in each contact state the motion is smooth and its Taylor series is known; the first
//! guard that falls through zero on a step is found with a certificate; the automaton jumps, and a new arc starts.
//!
//! ```
//! use flank::{
//!     engine::{Engine, Options, State},
//!     integrate::Taylor,
//!     scene::Scene,
//!     train::Structure,
//! };
//!
//! // A ball dropped from 1 m comes to rest after infinitely many bounces, at √(2h/g) (1 + e)/(1 − e).
//! let scene = r#"{
//!     "flank": 1,
//!     "train": {
//!         "kind": "wall", "mass_kg": 1, "load_n": -9.81,
//!         "wall": { "side": "below", "position_m": 0 },
//!         "law": { "kind": "rigid", "restitution": 0.8 }
//!     },
//!     "initial": { "q": [1] },
//!     "run": { "t_end_s": 5 }
//! }"#;
//! let built = Scene::from_json(scene, "ball")?.build()?;
//! let structure = Structure::new(built.spec)?;
//! let [from, _, end] = built.run.instants(structure.clock());
//! let start = structure.start(from, &built.q0, &built.v0)?;
//! let state = State { at: from, x: start.x, jump: start.jump };
//! let mut engine = Engine::new(&structure, Box::new(Taylor::default()), Options::default(), state);
//!
//! struct Rest(f64);
//! impl flank::engine::Observer for Rest {
//!     fn event(&mut self, record: &flank::event::EventRecord) -> std::ops::ControlFlow<()> {
//!         if record.accumulation.is_some() {
//!             self.0 = record.at.phase.value();
//!         }
//!         std::ops::ControlFlow::Continue(())
//!     }
//! }
//! let mut rest = Rest(0.0);
//! engine.run(end, &mut rest)?;
//! let exact = (2.0f64 / 9.81).sqrt() * 1.8 / 0.2;
//! assert!((rest.0 - exact).abs() < 1e-13 * exact);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Modules
//!
//! | module | what it holds |
//! |---|---|
//! | [`scene`] | JSON scenes: read, checked, built |
//! | [`train`] | pairs, planetary stages, walls, matrices; the [`Structure`](train::Structure) they assemble into |
//! | [`gear`] | one mesh: geometry, phases, stiffness, contact laws |
//! | [`hybrid`] | the vocabulary: modes, guards, flows, instants, [`HybridSystem`](hybrid::HybridSystem) |
//! | [`integrate`] | dense steps along a smooth arc: Taylor series, and diffsol's methods behind a feature |
//! | [`event`] | where the first guard falls on a step, and the record of it |
//! | [`engine`] | flow, first event, jump, again; observers, outcomes, accumulating impacts |
//! | [`analysis`] | measures taken during a run: contacts, energy, event rows, trajectories |
//! | [`accuracy`] | the engine and the baselines on one problem: errors against a truth that states its own, charts |
//! | [`baseline`] | fixed-step penalty codes, which know no events: what the engine is measured against |
//! | [`verify`] | a run checked arc by arc, by two other ways to the next event |
//! | [`sweep`] | the same work at every point of a grid, kept row by row |
//! | [`study`] | steady motions, their change with the numbers of a scene, identification of such numbers |
//! | [`plot`] | figures as data, and their pictures |
//! | [`output`] | folders that commands write into, and their manifests |
//! | [`poly`], [`linalg`] | first roots of polynomials; natural modes |
//!
//! The features are `cli` (the `flank` program), `diffsol` (integrators for stiff modes and users' own fields) and `plot`
//! (pictures; part of `cli`), all on by default; the library without them is pure series.
//!
//! # What it is not
//!
//! Not a multibody program: structures are linear, directions of contact constant, speeds given. Not a tooth contact
//! analysis: stiffness and error come in as numbers. No friction. No regularised contact: a penalty method knows no
//! events. It prints nothing and reads no clock; the same input gives the same numbers.
#![warn(missing_docs)]

pub mod accuracy;
pub mod analysis;
pub mod baseline;
pub mod engine;
pub mod event;
pub mod gear;
pub mod hybrid;
pub mod integrate;
pub mod linalg;
pub mod output;
pub mod plot;
pub mod poly;
pub mod scene;
pub mod study;
pub mod sweep;
pub mod train;
pub mod verify;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
