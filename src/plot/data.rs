use std::fmt::Write;

use super::{
    Figure,
    figure::{Guide, Panel},
};

/// The columns of [`Figure::csv`].
const COLUMNS: &str = "panel,panel_title,kind,name,x,x_label,x_unit,y,y_label,y_unit";

impl Figure {
    /// All numbers of the figure as CSV (RFC 4180), one point a row, each with the labels and units of its axes:
    ///
    /// `panel, panel_title, kind, name, x, x_label, x_unit, y, y_label, y_unit`
    ///
    /// Panels are counted from 1; `kind` is `series`, `band`, `tile`, `guide` or `note`. A band has two rows, its ends on x, and
    /// no y; a tile two, opposite corners; a vertical guide has an x only, a horizontal one a y only, a slanted one two rows. Floats are as short as
    /// they can be without loss.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = format!("{COLUMNS}\r\n");
        for (number, panel) in self.panels.iter().enumerate() {
            Rows { text: &mut text, number: number + 1, panel }.write();
        }
        text
    }

    /// The figure as JSON, with the names of [`Figure`]'s fields.
    #[must_use]
    pub fn json(&self) -> String {
        serde_json::to_string(self).map(|text| text + "\n").expect("a figure is plain data")
    }
}

/// The rows of one panel.
struct Rows<'a> {
    text: &'a mut String,
    number: usize,
    panel: &'a Panel,
}

impl Rows<'_> {
    fn write(&mut self) {
        let panel = self.panel;
        for series in &panel.series {
            for (x, y) in series.x.iter().zip(&series.y) {
                self.row("series", &series.name, Some(*x), Some(*y));
            }
        }
        for band in &panel.bands {
            for x in band.x {
                self.row("band", &band.name, Some(x), None);
            }
        }
        for tile in &panel.tiles {
            for (x, y) in tile.x.iter().zip(&tile.y) {
                self.row("tile", &tile.name, Some(*x), Some(*y));
            }
        }
        for guide in &panel.guides {
            match guide {
                Guide::Vertical { x, name } => self.row("guide", name, Some(*x), None),
                Guide::Horizontal { y, name } => self.row("guide", name, None, Some(*y)),
                Guide::Slanted { from, to, name } => {
                    for [x, y] in [from, to] {
                        self.row("guide", name, Some(*x), Some(*y));
                    }
                }
            }
        }
        for note in &panel.notes {
            self.row("note", &note.text, Some(note.at[0]), Some(note.at[1]));
        }
    }

    fn row(&mut self, kind: &str, name: &str, x: Option<f64>, y: Option<f64>) {
        let panel = self.panel;
        let title = quoted(&panel.title);
        write!(self.text, "{},{title},{kind},{}", self.number, quoted(name)).expect("a string grows");
        for (value, axis) in [(x, &panel.x), (y, &panel.y)] {
            let value = value.map(|value| format!("{value:?}")).unwrap_or_default();
            write!(self.text, ",{value},{},{}", quoted(&axis.label), quoted(&axis.unit)).expect("a string grows");
        }
        self.text.push_str("\r\n");
    }
}

/// A field, in quotes where it needs them.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}
