//! What a scene does once its transient is gone, and how that changes with its numbers.
//!
//! [`Case`] is a scene ready to run. [`steady`](mod@steady) runs it until its motion is periodic and measures it;
//! [`record`](mod@record) keeps a stretch of motion for pictures. [`identify`](mod@identify) finds numbers of a scene from
//! what a train does. [`advise`] compares a scene with simpler models of itself.

pub mod advise;
mod case;
pub mod changes;
mod error;
pub mod figures;
pub mod identify;
mod kind;
mod listing;
#[cfg(feature = "plot")]
pub mod page;
pub mod plan;
pub mod published;
pub mod record;
pub mod steady;
pub mod threshold;
pub mod values;

pub use case::Case;
pub use error::StudyError;
pub use kind::Kind;
pub use listing::Listing;
