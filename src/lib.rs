//! Flank simulates gear vibro-impact with exact events.
#![warn(missing_docs)]

pub mod analysis;
pub mod engine;
pub mod event;
pub mod gear;
pub mod hybrid;
pub mod integrate;
pub mod linalg;
pub mod poly;
pub mod scene;
pub mod train;
