//! Events: their location (`locate`) and their records (`record`).

mod locate;
mod record;

pub use locate::{Located, Locator, Touch};
pub use record::{Accumulation, Conditioning, EventRecord};
