//! Entries of a legend: one for each name of series or bands.

use crate::plot::{Panel, Style, Tile};

use super::{
    canvas::{Anchor, Canvas, Pen, Pixel},
    palette::Rgb,
    text,
};

/// Style of a name, with the index of its colour.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Symbol {
    Series(Style, usize),
    Band(usize),
    Tile(usize),
}

/// Name with all its styles.
#[derive(Clone)]
pub(crate) struct Entry<'a> {
    pub name: &'a str,
    pub looks: Vec<Symbol>,
}

/// Width of a sample, of the gap after it, and of the gap between entries, px.
const SAMPLE: f64 = 24.0;
const GAP: f64 = 6.0;
const SPACE: f64 = 30.0;

impl Entry<'_> {
    /// Returns whether it has the same kind of style as `look`.
    fn is_like(&self, look: &Symbol) -> bool {
        std::mem::discriminant(&self.looks[0]) == std::mem::discriminant(look)
    }

    fn width(&self, size: f64) -> f64 {
        self.looks.len() as f64 * (SAMPLE + GAP) + text::width(self.name, size, false)
    }
}

/// Returns the names of series, then those of bands, in the order in which they first appear; then those of tiles, in the order of their
/// colours.
pub(crate) fn entries(panels: &[Panel]) -> Vec<Entry<'_>> {
    let series = panels.iter().flat_map(|panel| &panel.series);
    let series = series.map(|series| (series.name.as_str(), Symbol::Series(series.style, series.colour)));
    let bands =
        panels.iter().flat_map(|panel| &panel.bands).map(|band| (band.name.as_str(), Symbol::Band(band.colour)));
    let mut tiles: Vec<&Tile> = panels.iter().flat_map(|panel| &panel.tiles).collect();
    tiles.sort_by_key(|tile| tile.colour);
    let tiles = tiles.into_iter().map(|tile| (tile.name.as_str(), Symbol::Tile(tile.colour)));
    let mut found: Vec<Entry<'_>> = Vec::new();
    for (name, look) in series.chain(bands).chain(tiles).filter(|(name, _)| !name.is_empty()) {
        match found.iter_mut().find(|entry| entry.name == name && entry.is_like(&look)) {
            None => found.push(Entry { name, looks: vec![look] }),
            Some(entry) if entry.looks.contains(&look) => {}
            Some(entry) => entry.looks.push(look),
        }
    }
    found
}

/// Returns the entries in rows at most `room` wide, px.
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
pub(super) fn draw(canvas: &Canvas<'_>, row: &[Entry<'_>], at: Pixel, size: f64) {
    let [mut x, y] = at;
    for entry in row {
        for look in &entry.looks {
            sample(canvas, *look, [x, y]);
            x += SAMPLE + GAP;
        }
        canvas.text(entry.name, [x, y], Anchor::Left, size, canvas.colours.ink, false);
        x += text::width(entry.name, size, false) + SPACE;
    }
}

fn sample(canvas: &Canvas<'_>, look: Symbol, [x, y]: Pixel) {
    let colours = canvas.colours;
    let filled = |colour, opacity| canvas.rectangle([x, y - 5.0], [x + SAMPLE, y + 5.0], colour, opacity);
    let (style, colour) = match look {
        Symbol::Band(number) => return filled(colours.band(number), 1.6 * colours.band_opacity),
        Symbol::Tile(number) => return filled(colours.tile(number), colours.tile_opacity),
        Symbol::Series(style, number) => (style, colours.series(number)),
    };
    if let Some(pen) = pen(style, colour) {
        canvas.line(&[[x, y], [x + SAMPLE, y]], pen);
    }
    let middle = x + SAMPLE / 2.0;
    match style {
        Style::Points | Style::Joined => canvas.dot([middle, y], 2.4, colour, false),
        Style::Marks => canvas.dot([middle, y], 3.4, colour, true),
        Style::Stems => {
            canvas.line(&[[middle, y + 5.0], [middle, y - 4.0]], Pen::solid(colour, 1.6));
            canvas.dot([middle, y - 4.0], 1.8, colour, false);
        }
        Style::Line | Style::Hairline | Style::Dashed => {}
    }
}

/// Returns the pen of a style that joins its points.
pub(super) fn pen(style: Style, colour: Rgb) -> Option<Pen> {
    match style {
        Style::Line | Style::Joined => Some(Pen::solid(colour, 1.5)),
        Style::Hairline => Some(Pen::solid(colour, 0.8)),
        Style::Dashed => Some(Pen { colour, width: 1.5, dash: Some([6.0, 4.0]) }),
        Style::Points | Style::Marks | Style::Stems => None,
    }
}
