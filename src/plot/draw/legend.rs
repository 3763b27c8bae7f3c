//! The entries of a legend: one for each name of a series or a band.

use crate::plot::{Band, Panel, Series, Style};

use super::{
    canvas::{Anchor, Canvas, Drawn, Pen, Point},
    palette::Rgb,
    text,
};

/// What an entry shows.
#[derive(Clone, Copy)]
pub(crate) enum Entry<'a> {
    Series(&'a Series),
    Band(&'a Band),
}

/// Width of the sample, of the gap after it, and of the gap between entries, px.
const SAMPLE: f64 = 24.0;
const GAP: f64 = 6.0;
const SPACE: f64 = 18.0;

impl<'a> Entry<'a> {
    pub fn name(&self) -> &'a str {
        match self {
            Self::Series(series) => &series.name,
            Self::Band(band) => &band.name,
        }
    }

    fn width(&self, size: f64) -> f64 {
        SAMPLE + GAP + text::width(self.name(), size, false)
    }
}

/// Every name once, as it first looks: series, then bands.
pub(crate) fn entries(panels: &[Panel]) -> Vec<Entry<'_>> {
    let series = panels.iter().flat_map(|panel| &panel.series).map(Entry::Series);
    let bands = panels.iter().flat_map(|panel| &panel.bands).map(Entry::Band);
    let mut found: Vec<Entry<'_>> = Vec::new();
    for entry in series.chain(bands) {
        let same_kind = |other: &Entry<'_>| matches!(other, Entry::Band(_)) == matches!(entry, Entry::Band(_));
        if !entry.name().is_empty() && !found.iter().any(|other| other.name() == entry.name() && same_kind(other)) {
            found.push(entry);
        }
    }
    found
}

/// The entries in rows at most `room` wide.
pub(super) fn rows(panels: &[Panel], size: f64, room: f64) -> Vec<Vec<Entry<'_>>> {
    let mut rows: Vec<Vec<Entry<'_>>> = Vec::new();
    let mut used = f64::INFINITY;
    for entry in entries(panels) {
        let width = entry.width(size) + SPACE;
        if used + width > room + SPACE {
            rows.push(Vec::new());
            used = 0.0;
        }
        used += width;
        rows.last_mut().expect("one was just added").push(entry);
    }
    rows
}

/// Draws a row; `at` is its left end at half height.
pub(super) fn draw(canvas: &Canvas<'_>, row: &[Entry<'_>], at: Point, size: f64) -> Drawn {
    let [mut x, y] = at;
    for entry in row {
        let end = x + SAMPLE;
        match entry {
            Entry::Band(band) => {
                let shades = &canvas.colours.bands;
                let colour = shades[band.colour % shades.len()];
                canvas.rectangle([x, y - 5.0], [end, y + 5.0], colour, 1.6 * canvas.colours.band_opacity)?;
            }
            Entry::Series(series) => sample(canvas, series, [x, y], end)?,
        }
        canvas.text(entry.name(), [end + GAP, y], Anchor::Left, size, canvas.colours.ink, false)?;
        x += entry.width(size) + SPACE;
    }
    Ok(())
}

fn sample(canvas: &Canvas<'_>, series: &Series, [x, y]: Point, end: f64) -> Drawn {
    let colour = canvas.colours.series[series.colour % canvas.colours.series.len()];
    if let Some(pen) = pen(series.style, colour) {
        canvas.line(&[[x, y], [end, y]], pen)?;
    }
    let middle = [f64::midpoint(x, end), y];
    match series.style {
        Style::Points | Style::Joined => canvas.dot(middle, 2.4, colour, false),
        Style::Marks => canvas.dot(middle, 3.4, colour, true),
        Style::Stems => {
            canvas.line(&[[middle[0], y + 5.0], [middle[0], y - 4.0]], Pen::solid(colour, 1.6))?;
            canvas.dot([middle[0], y - 4.0], 1.8, colour, false)
        }
        Style::Line | Style::Hairline | Style::Dashed => Ok(()),
    }
}

/// The pen of a style that joins its points.
pub(super) fn pen(style: Style, colour: Rgb) -> Option<Pen> {
    match style {
        Style::Line | Style::Joined => Some(Pen::solid(colour, 1.5)),
        Style::Hairline => Some(Pen::solid(colour, 0.8)),
        Style::Dashed => Some(Pen { colour, width: 1.5, dash: Some([6.0, 4.0]) }),
        Style::Points | Style::Marks | Style::Stems => None,
    }
}
