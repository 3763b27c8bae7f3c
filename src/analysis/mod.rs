//! Measures during a run: energy ledger, contacts, sampled trajectories, event descriptions.
//!
//! All are [`Observer`](crate::engine::Observer)s, and use a system only through the traits of [`hybrid`](crate::hybrid).

mod bearings;
mod contacts;
mod episode;
mod events;
mod extent;
mod ledger;
mod piece;
mod quadrature;
mod report;
mod settle;
mod spectrum;
mod sum;
mod track;
mod trajectory;
mod transmission;

pub use bearings::Bearings;
pub use contacts::Contacts;
pub use episode::{Episode, Moment, Separation};
pub use events::{ContactEvent, EventKind, EventLog, EventRow};
pub use ledger::{Balance, Ledger};
pub(crate) use quadrature::Quadrature;
pub use report::{BearingForce, BearingReport, ContactReport, Statistics, of_train};
pub use settle::{Sections, cycles_later};
pub use spectrum::{Spectrum, Window};
pub use sum::Sum;
pub use trajectory::{Grid, Sample, Trajectory};
pub use transmission::{TransmissionError, TransmissionHarmonic, TransmissionReport};
