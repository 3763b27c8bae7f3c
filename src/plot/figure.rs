use serde::{Deserialize, Serialize};

use crate::output::{csv_line, number};

/// Units by the endings of keys, longest endings first.
const UNITS: [(&str, &str); 16] = [
    ("_nm_per_rpm", "N m/(rev/min)"),
    ("_n_s_per_m", "N s/m"),
    ("_rad_per_s", "rad/s"),
    ("_n_per_m", "N/m"),
    ("_m_per_s", "m/s"),
    ("_kg_m2", "kg m²"),
    ("_rpm", "rev/min"),
    ("_deg", "deg"),
    ("_rad", "rad"),
    ("_kg", "kg"),
    ("_nm", "N m"),
    ("_pa", "Pa"),
    ("_hz", "Hz"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Figure: panels in rows, read from left to right. It contains all its numbers, so that its data files and its pictures agree.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figure {
    /// Name in file names and on the command line: lower-case words joined by `-`.
    pub id: String,
    /// Title.
    pub title: String,
    /// Description of the picture, and the scene; one paragraph.
    pub caption: String,
    /// Panels beside each other, ≥ 1.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// Ratio of the height of its panels to the usual one.
    #[cfg(feature = "plot")]
    pub(super) fn height(&self) -> f64 {
        self.panels.first().and_then(|panel| panel.height).unwrap_or(1.0)
    }

    /// Returns all numbers of the figure as CSV (RFC 4180), one point a row, each with the labels and units of its axes:
    ///
    /// `panel, panel_title, kind, name, x, x_label, x_unit, y, y_label, y_unit, value, value_unit`
    ///
    /// Panels are counted from 1; `kind` is `series`, `band`, `tile`, `cell`, `guide` or `note`. A cell of an image has its middle and a
    /// value. A band has two rows, its ends without y; a tile two, opposite corners. A vertical guide has an x only, a horizontal one a y
    /// only, a slanted one two rows. Floats are in their shortest exact form.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "panel,panel_title,kind,name,x,x_label,x_unit,y,y_label,y_unit,value,value_unit\r\n".to_owned();
        for (place, panel) in (1..).zip(&self.panels) {
            let place = i32::to_string(&place);
            let mut line = |[kind, name]: [&str; 2], [x, y, value]: [Option<f64>; 3], unit: &str| {
                let (across, up) = (&panel.x, &panel.y);
                let [x, y, value] = [x, y, value].map(|value| value.map(number).unwrap_or_default());
                let place =
                    [&place, &panel.title, kind, name, &x, &across.label, &across.unit, &y, &up.label, &up.unit];
                text += &(csv_line(place.into_iter().chain([value.as_str(), unit])) + "\r\n");
            };
            if let Some(Raster { unit, .. }) = &panel.raster {
                let cells = panel.raster.iter().flat_map(Raster::cells);
                cells.for_each(|[x, y, value]| line(["cell", ""], [Some(x), Some(y), Some(value)], unit));
            }
            let mut row = |kind: &str, name: &str, x, y| line([kind, name], [x, y, None], "");
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

    /// Returns the figure as JSON, with the names of [`Figure`]'s fields.
    #[must_use]
    pub fn json(&self) -> String {
        serde_json::to_string(self).map(|text| text + "\n").expect("a figure is plain data")
    }
}

/// One pair of axes with its contents, from back to front: tiles, bands, guides, series, notes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Panel {
    /// Title; may be empty.
    pub title: String,
    /// Abscissa.
    pub x: Axis,
    /// Ordinate.
    pub y: Axis,
    /// Ratio of the height to the usual one. All panels of a figure are as high as the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// True if one unit is equally long on x and y.
    pub equal_scales: bool,
    /// Curves and points.
    pub series: Vec<Series>,
    /// Shaded intervals of x.
    pub bands: Vec<Band>,
    /// Rectangles, filled.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tiles: Vec<Tile>,
    /// Cells of a map, as an image; under all other contents. Its numbers are data of the figure if it has values.
    #[serde(skip_serializing_if = "Raster::has_no_values")]
    pub raster: Option<Raster>,
    /// Straight lines across the panel.
    pub guides: Vec<Guide>,
    /// True if the names of upright guides stand above the panel, not on their lines.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub names_above: bool,
    /// Words in the panel.
    pub notes: Vec<Note>,
}

/// An axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Axis {
    /// Quantity on the axis.
    pub label: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// True for a logarithmic axis.
    pub logarithmic: bool,
    /// Ends; fitted to the series if not given.
    pub range: Option<[f64; 2]>,
    /// True if whole numbers are places in a row, not values: grid lines without ticks and numbers.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub places: bool,
}

impl Axis {
    /// Returns a linear axis fitted to its series.
    #[must_use]
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), ..Self::default() }
    }

    /// Returns a linear axis of the number of a scene at `pointer`: the words of the pointer, and the unit from its key or its place. For
    /// numbers that move together, `P1,P2`, it shows the first.
    #[must_use]
    pub fn of_number(pointer: &str, dimensionless: bool) -> Self {
        let first = pointer.split(',').next().unwrap_or_default();
        let keys: Vec<String> = first.split('/').skip(1).map(|key| key.replace("~1", "/").replace("~0", "~")).collect();
        if let [start, which, freedom] = &keys[..]
            && start == "initial"
        {
            let unit = if which == "q" { "m" } else { "m/s" };
            return Self::new(format!("{which} {freedom} at the start"), if dimensionless { "" } else { unit });
        }
        let (mut label, mut unit) = (String::new(), "");
        for key in keys.iter().skip(usize::from(keys.len() > 1)) {
            let of_key = UNITS.into_iter().find(|(end, _)| key.ends_with(end));
            let word = of_key.map_or(key.as_str(), |(end, _)| &key[..key.len() - end.len()]).replace('_', " ");
            let is_number = key.bytes().all(|byte| byte.is_ascii_digit());
            label += if label.is_empty() {
                ""
            } else if is_number {
                " "
            } else {
                ", "
            };
            label += &word;
            unit = of_key.map_or(unit, |(_, unit)| unit);
        }
        Self::new(if label.is_empty() { first } else { &label }, unit)
    }

    /// Returns the same axis from `low` to `high`.
    #[must_use]
    pub fn between(self, low: f64, high: f64) -> Self {
        Self { range: Some([low, high]), ..self }
    }
}

/// Style of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// A line through the points.
    #[default]
    Line,
    /// A thin line, for one of many.
    Hairline,
    /// A dashed line.
    Dashed,
    /// Points.
    Points,
    /// Points joined by a line.
    Joined,
    /// Open points, such as events on a curve.
    Marks,
    /// A vertical line from zero to each point, as for spectra.
    Stems,
}

/// Curve or set of points. All numbers are finite.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Series {
    /// Name in the legend; series of one name are one entry there. Empty for none.
    pub name: String,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates, as many as abscissae.
    pub y: Vec<f64>,
    /// Style.
    pub style: Style,
    /// Index of its colour in the palette, modulo its length.
    pub colour: usize,
}

impl Series {
    /// Returns a line of the given colour.
    #[must_use]
    pub fn line(name: impl Into<String>, colour: usize, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { name: name.into(), x, y, style: Style::Line, colour }
    }

    /// Returns the same series in another style.
    #[must_use]
    pub fn styled(self, style: Style) -> Self {
        Self { style, ..self }
    }
}

/// Shaded interval of x, such as the time in one contact mode.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Band {
    /// Its ends on x.
    pub x: [f64; 2],
    /// Name in the legend; bands of one name are one entry.
    pub name: String,
    /// Index of its shade.
    pub colour: usize,
}

/// A filled rectangle, such as a cell of a map.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tile {
    /// Its ends on x.
    pub x: [f64; 2],
    /// Its ends on y.
    pub y: [f64; 2],
    /// Name in the legend; tiles of one name are one entry.
    pub name: String,
    /// Index of its colour among those of tiles, modulo their number.
    pub colour: usize,
}

/// Red, green, blue.
pub type Colour = [u8; 3];

/// Colours from little to much, dark on light.
pub const SEQUENCE: [Colour; 8] = [
    [0xff, 0xff, 0xd9],
    [0xed, 0xf8, 0xb1],
    [0xc7, 0xe9, 0xb4],
    [0x7f, 0xcd, 0xbb],
    [0x41, 0xb6, 0xc4],
    [0x1d, 0x91, 0xc0],
    [0x22, 0x5e, 0xa8],
    [0x0c, 0x2c, 0x84],
];

/// Image of cells in classes, with its own legend. Without values, the table that it is drawn from has its numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Raster {
    /// Its ends on x.
    pub x: [f64; 2],
    /// Its ends on y.
    pub y: [f64; 2],
    /// Number of cells in a row.
    pub columns: usize,
    /// Class of each cell, row by row from the top.
    #[serde(skip)]
    pub points: Vec<u8>,
    /// Names of classes and their colours.
    #[serde(skip)]
    pub classes: Vec<(String, Colour)>,
    /// Value of each cell that has one, in the order of `points`; may be empty.
    pub values: Vec<Option<f64>>,
    /// Unit of the values.
    pub unit: String,
}

impl Raster {
    /// Returns an image in eight classes of width `step`: the highest contains `largest`, the lowest all smaller and missing values.
    #[must_use]
    pub fn of_levels(self, (largest, step): (f64, f64), unit: &str) -> Self {
        let count = SEQUENCE.len();
        let low = (libm::floor(largest / step) - (count - 1) as f64) * step;
        // Exact: below the number of classes.
        let class = |value: f64| libm::floor((value - low) / step).clamp(0.0, (count - 1) as f64) as u8;
        let name = |i: usize| match (i, low + i as f64 * step) {
            (0, from) => format!("below {}", from + step),
            (_, from) => format!("{from} to {}", from + step),
        };
        // The class below all others has the colour of the paper.
        let colour = |i: usize| if i == 0 { [0xff; 3] } else { SEQUENCE[i] };
        Self {
            points: self.values.iter().map(|value| value.map_or(0, class)).collect(),
            classes: (0..count).map(|i| (name(i), colour(i))).collect(),
            unit: unit.to_owned(),
            ..self
        }
    }

    /// Returns the middles and values of its cells.
    fn cells(&self) -> impl Iterator<Item = [f64; 3]> {
        let rows = self.values.len() / self.columns.max(1);
        self.values.iter().enumerate().filter_map(move |(i, value)| {
            let [column, row] = [i % self.columns, i / self.columns].map(|place| place as f64 + 0.5);
            let x = self.x[0] + column / self.columns as f64 * (self.x[1] - self.x[0]);
            let y = self.y[1] - row / rows as f64 * (self.y[1] - self.y[0]);
            Some([x, y, (*value)?])
        })
    }

    fn has_no_values(raster: &Option<Self>) -> bool {
        raster.as_ref().is_none_or(|raster| raster.values.is_empty())
    }
}

/// Thin straight line with a name: a natural frequency, an order, a threshold, a published value.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Guide {
    /// A vertical line at one x, over the whole height.
    Vertical {
        /// Abscissa.
        x: f64,
        /// Name.
        name: String,
    },
    /// A horizontal line at one y, over the whole width.
    Horizontal {
        /// Ordinate.
        y: f64,
        /// Name.
        name: String,
    },
    /// A straight line from one point to another.
    Slanted {
        /// One end, `[x, y]`.
        from: [f64; 2],
        /// The other end, `[x, y]`; the name is written here.
        to: [f64; 2],
        /// Name.
        name: String,
    },
}

/// Verdict on a number or a statement beside a published one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Within 5 % (of a number), or as stated (of a statement).
    Agrees,
    /// Within 15 %, or true in part.
    Partly,
    /// Neither within 15 % nor true in part.
    Deviates,
    /// The source contradicts itself, or kinematics, here.
    Contradiction,
}

/// Words at a point.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Note {
    /// Point `[x, y]`.
    pub at: [f64; 2],
    /// The words.
    pub text: String,
}
