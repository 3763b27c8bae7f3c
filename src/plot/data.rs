use super::{Figure, figure::Guide};
use crate::output::{csv_line, number};

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
        for (place, panel) in (1..).zip(&self.panels) {
            let place = i32::to_string(&place);
            let mut row = |kind: &str, name: &str, x: Option<f64>, y: Option<f64>| {
                let (across, up) = (&panel.x, &panel.y);
                let [x, y] = [x, y].map(|value| value.map(number).unwrap_or_default());
                let fields =
                    [&place, &panel.title, kind, name, &x, &across.label, &across.unit, &y, &up.label, &up.unit];
                text += &(csv_line(fields) + "\r\n");
            };
            for series in &panel.series {
                series.x.iter().zip(&series.y).for_each(|(x, y)| row("series", &series.name, Some(*x), Some(*y)));
            }
            for band in &panel.bands {
                band.x.iter().for_each(|x| row("band", &band.name, Some(*x), None));
            }
            for tile in &panel.tiles {
                tile.x.iter().zip(&tile.y).for_each(|(x, y)| row("tile", &tile.name, Some(*x), Some(*y)));
            }
            for guide in &panel.guides {
                match guide {
                    Guide::Vertical { x, name } => row("guide", name, Some(*x), None),
                    Guide::Horizontal { y, name } => row("guide", name, None, Some(*y)),
                    Guide::Slanted { from, to, name } => {
                        [from, to].iter().for_each(|[x, y]| row("guide", name, Some(*x), Some(*y)));
                    }
                }
            }
            panel.notes.iter().for_each(|note| row("note", &note.text, Some(note.at[0]), Some(note.at[1])));
        }
        text
    }

    /// The figure as JSON, with the names of [`Figure`]'s fields.
    #[must_use]
    pub fn json(&self) -> String {
        serde_json::to_string(self).map(|text| text + "\n").expect("a figure is plain data")
    }
}
