//! The files of a figure.

use super::{Figure, Theme, png, svg};
use crate::output::{Folder, OutputError};

/// Name of the page that collects the figures of a command.
pub const REPORT: &str = "report.html";

/// Names of the files that [`write_figure`] writes for the figure `id`.
#[must_use]
pub fn figure_files(id: &str) -> [String; 4] {
    ["csv", "json", "svg", "png"].map(|kind| format!("figures/{id}.{kind}"))
}

/// Writes data and pictures of a figure.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write_figure(folder: &mut Folder, figure: &Figure) -> Result<(), OutputError> {
    let [csv, json, picture, raster] = figure_files(&figure.id);
    folder.bytes(&csv, figure.csv().as_bytes())?;
    folder.bytes(&json, figure.json().as_bytes())?;
    folder.bytes(&picture, svg(figure, Theme::Light).as_bytes())?;
    folder.bytes(&raster, &png(figure, 1.5))
}
