//! Flank simulates gear vibro-impact with exact events.
#![warn(missing_docs)]

pub mod gear;
pub mod hybrid;
pub mod linalg;
pub mod scene;
pub mod train;
