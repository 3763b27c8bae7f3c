//! Figures as data, and their pictures.
//!
//! A [`Figure`] holds the numbers that are drawn and how to draw them; nothing is computed here. Its data are always at
//! hand, as [`Figure::csv`] and [`Figure::json`]; pictures (`svg`, `png`) and the page that collects them (`Report`)
//! need the feature `plot`.

mod data;
#[cfg(feature = "plot")]
mod draw;
mod figure;
#[cfg(feature = "plot")]
mod files;
#[cfg(feature = "plot")]
mod report;

#[cfg(feature = "plot")]
pub use draw::{Theme, png, svg};
pub use figure::{Axis, Band, Figure, Guide, Note, Panel, Series, Style, Tile, Verdict};
#[cfg(feature = "plot")]
pub use files::{REPORT, figure_files, write_figure};
#[cfg(feature = "plot")]
pub use report::{Cell, Item, Report, Section, Table};
