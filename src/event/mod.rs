//! Events: when a guard fires (`locate`), and what is written down about it (`record`).

mod locate;
mod record;

pub use locate::{Located, Locator, Touch};
pub use record::{Accumulation, Conditioning, EventRecord};
