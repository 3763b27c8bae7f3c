//! Figures as data, and their pictures.
//!
//! A [`Figure`] holds the numbers that are drawn and how to draw them; nothing is computed here. Its data are always at
//! hand ([`Figure::csv`], [`Figure::json`]); pictures ([`svg`], [`png`]) and the page that collects them ([`Report`])
//! need the feature `plot`.

mod data;
mod figure;

#[cfg(feature = "plot")]
mod canvas;
#[cfg(feature = "plot")]
mod draw;
#[cfg(feature = "plot")]
mod frame;
#[cfg(feature = "plot")]
mod guide;
#[cfg(feature = "plot")]
mod legend;
#[cfg(feature = "plot")]
mod palette;
#[cfg(feature = "plot")]
mod panel;
#[cfg(feature = "plot")]
mod report;
#[cfg(feature = "plot")]
mod scale;
#[cfg(feature = "plot")]
mod text;

pub use figure::{Axis, Band, Figure, Guide, Note, Panel, Series, Style};
#[cfg(feature = "plot")]
pub use {
    draw::{png, svg},
    palette::Theme,
    report::{Cell, Item, Report, Section, Table, Verdict},
};
