//! Figures as data, and their pictures.
//!
//! A [`Figure`] holds the numbers of a drawing and its style, without any computation. Its data are always available, as [`Figure::csv`]
//! and [`Figure::json`]. Pictures (`Figure::svg`, `Figure::png`) and the page that collects them (`Report`) need the feature `plot`.

#[cfg(feature = "plot")]
mod animation;
#[cfg(feature = "plot")]
mod draw;
mod figure;
#[cfg(feature = "plot")]
mod print;
#[cfg(feature = "plot")]
mod report;

#[cfg(feature = "plot")]
pub use animation::{AnimatedContact, AnimatedGear, Animation};
#[cfg(feature = "plot")]
pub use draw::Theme;
pub use figure::{Axis, Band, Colour, Figure, Guide, Note, Panel, Raster, SEQUENCE, Series, Style, Tile, Verdict};
#[cfg(feature = "plot")]
pub use print::{Format, Print};
#[cfg(feature = "plot")]
pub use report::{Item, Report, Section, Table, TableCell};
