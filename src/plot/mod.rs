//! Figures as data, and their pictures.
//!
//! A [`Figure`] holds the numbers that are drawn and how to draw them; nothing is computed here.

mod figure;

pub use figure::{Axis, Band, Figure, Guide, Note, Panel, Series, Style};
