//! One panel on a sheet.

use std::collections::BTreeSet;

use base64::prelude::{BASE64_STANDARD, Engine};
use plotters::prelude::*;
use resvg::tiny_skia::{ColorU8, Pixmap};

use crate::plot::{Guide, Panel, Raster, Series, Style};

use super::{
    canvas::{Anchor, Canvas, Pen, Pixel, UNIT, font, rgb, sound, units},
    frame::Frame,
    legend,
    palette::{Rgb, hex},
    scale::{Scale, axis_label, drawable},
    text,
    words::Ink,
};

pub(super) const SMALL: f64 = 10.5;
const LABEL: f64 = 11.5;
/// Height of the names above a panel, px.
const NAMES: f64 = 1.5 * SMALL;

/// Space between the edge of a cell and its frame, px, without the tick labels at the left.
const TOP: f64 = 10.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 40.0;
const LEFT: f64 = 34.0;

/// Width of the sample of a class.
const SWATCH: f64 = 14.0;

/// Returns the width of a class in a row of the legend, px.
fn class_width(name: &str) -> f64 {
    SWATCH + 5.0 + text::width(name, SMALL, false) + 14.0
}

/// Returns the classes of a raster in rows at most `room` wide, px.
fn class_rows(raster: &Raster, room: f64) -> Vec<Vec<(String, Rgb)>> {
    let mut rows: Vec<Vec<(String, Rgb)>> = Vec::new();
    let mut used = f64::INFINITY;
    for (name, [r, g, b]) in &raster.classes {
        let width = class_width(name);
        if used + width > room {
            rows.push(Vec::new());
            used = 0.0;
        }
        used += width;
        rows.last_mut().expect("one was just added").push((name.clone(), (*r, *g, *b)));
    }
    rows
}

/// Panel with its scales and its place.
pub(super) struct Sheet<'a> {
    pub(super) panel: &'a Panel,
    corner: Pixel,
    cell: [f64; 2],
    heading: Vec<String>,
    /// Legend of a raster: rows of classes.
    classes: Vec<Vec<(String, Rgb)>>,
    pub(super) x: Scale,
    pub(super) y: Scale,
    pub(super) frame: Frame,
}

/// Returns the scales of a panel, which include its series; stems stand on zero and leave room above for the names of guides.
pub(crate) fn scales(panel: &Panel) -> [Scale; 2] {
    let isolated = |series: &Series| matches!(series.style, Style::Points | Style::Joined | Style::Marks);
    let margin = if panel.equal_scales || panel.series.iter().any(isolated) { 0.03 } else { 0.0 };
    let ground = panel.series.iter().any(|series| series.style == Style::Stems).then_some(0.0);
    let letters = |guide: &Guide| if let Guide::Vertical { name, .. } = guide { name.chars().count() } else { 0 };
    let letters = panel.guides.iter().map(letters).max().filter(|_| ground.is_some()).unwrap_or(0);
    let above = if panel.raster.is_some() { 0.0 } else { 0.06 } + 0.025 * letters.min(12) as f64;
    let (series, tiles) = (|| panel.series.iter(), || panel.tiles.iter());
    let xs = series().flat_map(|series| &series.x).chain(tiles().flat_map(|tile| &tile.x));
    let ys = series().flat_map(|series| &series.y).chain(tiles().flat_map(|tile| &tile.y));
    let raster = panel.raster.iter();
    let (xs, ys) =
        (xs.chain(raster.clone().flat_map(|raster| &raster.x)), ys.chain(raster.flat_map(|raster| &raster.y)));
    let x = Scale::fit(&panel.x, xs.copied(), margin);
    let y = Scale::fit(&panel.y, ys.copied().chain(ground), above);
    [x, y]
}

impl<'a> Sheet<'a> {
    /// Returns a panel in a cell; its frame starts `left` and `top` px from the edges, or farther if its words need it.
    pub fn new(panel: &'a Panel, corner: Pixel, cell: [f64; 2], [left, top]: [f64; 2]) -> Self {
        let [mut x, mut y] = scales(panel);
        let heading = text::wrapped(&text::clean(&panel.title), LABEL, true, cell[0] - LEFT - 2.0 * RIGHT);
        let names = if panel.names_above { NAMES } else { 0.0 };
        let classes = panel.raster.as_ref().map_or_else(Vec::new, |raster| class_rows(raster, cell[0] - 2.0 * RIGHT));
        let legend = classes.len() as f64 * 1.4 * SMALL;
        let top = top.max(TOP + heading.len() as f64 * 1.4 * LABEL + legend + names);
        let height = cell[1] - top - BOTTOM;
        y = y.ticked((height / 42.0) as usize);
        let label_width = |(_, label): (f64, String)| text::width(&label, SMALL, false);
        let left = left.max(LEFT + y.labels().into_iter().map(label_width).fold(0.0, f64::max));
        let width = cell[0] - left - RIGHT;
        if panel.equal_scales && !x.logarithmic && !y.logarithmic {
            let stretch = (x.high - x.low) / width / ((y.high - y.low) / height);
            if stretch > 1.0 {
                y = y.stretched(stretch)
            } else {
                x = x.stretched(1.0 / stretch)
            }
            y = y.ticked((height / 42.0) as usize);
        }
        x = x.ticked((width / 60.0) as usize);
        let frame = Frame {
            x0: corner[0] + left,
            x1: corner[0] + left + width,
            y0: corner[1] + top,
            y1: corner[1] + top + height,
        };
        Self { panel, corner, cell, heading, classes, x, y, frame }
    }

    /// Returns the distances from the left and upper edges of the cell to the frame, px.
    pub fn rooms(&self) -> [f64; 2] {
        [self.frame.x0 - self.corner[0], self.frame.y0 - self.corner[1]]
    }

    /// Returns the place of a point on the sheet.
    fn at(&self, x: f64, y: f64) -> Pixel {
        let Frame { x0, x1, y0, y1 } = self.frame;
        [x0 + self.x.place(x) * (x1 - x0), y1 - self.y.place(y) * (y1 - y0)]
    }

    /// Returns the place of a point on the sheet, if it has one.
    pub(super) fn checked(&self, x: f64, y: f64) -> Option<Pixel> {
        (drawable(x, self.x.logarithmic) && drawable(y, self.y.logarithmic)).then(|| self.at(x, y))
    }

    /// Returns the raster as an element of an SVG, in the units of the canvas.
    pub fn image(&self) -> Option<String> {
        let raster = self.panel.raster.as_ref()?;
        let rows = raster.points.len() / raster.columns.max(1);
        let mut pixmap = Pixmap::new(u32::try_from(raster.columns).ok()?, u32::try_from(rows).ok()?)?;
        for (pixel, class) in pixmap.pixels_mut().iter_mut().zip(&raster.points) {
            let [r, g, b] = raster.classes.get(usize::from(*class)).map_or([255; 3], |(_, colour)| *colour);
            *pixel = ColorU8::from_rgba(r, g, b, 255).premultiply();
        }
        let png = BASE64_STANDARD.encode(pixmap.encode_png().ok()?);
        let [a, b] = [self.checked(raster.x[0], raster.y[1])?, self.checked(raster.x[1], raster.y[0])?];
        let [x, y, width, height] = [a[0], a[1], b[0] - a[0], b[1] - a[1]].map(|px| px * UNIT);
        Some(format!(
            "\n<image x=\"{x:.0}\" y=\"{y:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{png}\"/>"
        ))
    }

    /// Draws the panel. Returns dots, as elements of an SVG, if they are too many for separate elements.
    pub fn draw(&self, canvas: &Canvas<'_>) -> String {
        self.tiles(canvas);
        self.bands(canvas);
        self.axes(canvas);
        self.guides(canvas);
        let mut ink = Ink::default();
        let mut left_out = 0;
        let mut dots = String::new();
        for series in &self.panel.series {
            left_out += self.series(canvas, series, &mut ink, &mut dots);
        }
        let remark = match left_out {
            0 => String::new(),
            1 => "1 point has no place on these axes".to_owned(),
            _ => format!("{left_out} points have no place on these axes"),
        };
        self.words(canvas, &remark, &ink);
        dots
    }

    /// Draws grid, frame, ticks, labels, heading.
    fn axes(&self, canvas: &Canvas<'_>) {
        let Frame { x0, x1, y0, y1 } = self.frame;
        let colours = canvas.colours;
        let [x, y] = self.corner;
        let [width, height] = self.cell;
        let cell = canvas.area.clone().shrink((units(x), units(y)), (units(width), units(height)));
        let mut builder = ChartBuilder::on(&cell);
        builder
            .margin_top(units(y0 - y))
            .margin_right(units(x + width - x1))
            .x_label_area_size(units(y + height - y1))
            .y_label_area_size(units(x0 - x));
        let mut chart = sound(builder.build_cartesian_2d(self.x.clone(), self.y.clone()));
        let x_label = axis_label(&self.panel.x, self.x.exponent);
        let y_label = axis_label(&self.panel.y, self.y.exponent);
        let size = text::fitted(&x_label, LABEL, width).min(text::fitted(&y_label, LABEL, height));
        let mut mesh = chart.configure_mesh();
        mesh.bold_line_style(rgb(colours.grid).stroke_width(units(0.8) as u32))
            .axis_style(rgb(colours.muted).stroke_width(units(0.8) as u32))
            .set_all_tick_mark_size(units(3.5))
            .set_tick_mark_size(LabelAreaPosition::Left, units(if self.panel.y.places { 0.0 } else { 3.5 }))
            .label_style(font(SMALL, colours.ink, false))
            .axis_desc_style(font(size, colours.ink, false))
            .x_desc(text::clean(&x_label))
            .y_desc(text::clean(&y_label));
        if self.panel.raster.is_some() {
            // Grid lines would cover cells.
            mesh.disable_mesh();
        }
        sound(mesh.draw());
        let mut names = if self.panel.names_above { NAMES } else { 0.0 };
        for (line, row) in self.classes.iter().enumerate() {
            let mut at = [x + RIGHT, y0 - (self.classes.len() - line) as f64 * 1.4 * SMALL + 0.4 * SMALL];
            for (name, colour) in row {
                // With a rim: a class may have the colour of the page.
                canvas.rectangle([at[0], at[1] - 4.5], [at[0] + SWATCH, at[1] + 4.5], colours.muted, 1.0);
                canvas.rectangle([at[0] + 0.7, at[1] - 3.8], [at[0] + SWATCH - 0.7, at[1] + 3.8], *colour, 1.0);
                canvas.text(name, [at[0] + SWATCH + 5.0, at[1]], Anchor::Left, SMALL, colours.ink, false);
                at[0] += class_width(name);
            }
        }
        names += self.classes.len() as f64 * 1.4 * SMALL;
        for (line, words) in self.heading.iter().enumerate() {
            let at = [x0, y0 - names - (self.heading.len() - line) as f64 * 1.4 * LABEL + 0.4 * LABEL];
            canvas.text(words, at, Anchor::Left, LABEL, colours.ink, true);
        }
    }

    fn tiles(&self, canvas: &Canvas<'_>) {
        for tile in &self.panel.tiles {
            let corners = [self.checked(tile.x[0], tile.y[0]), self.checked(tile.x[1], tile.y[1])];
            let [Some(a), Some(b)] = corners else { continue };
            let inside = |ends: [f64; 2], [low, high]: [f64; 2]| ends.map(|end| end.clamp(low, high));
            let [left, right] = inside([a[0].min(b[0]), a[0].max(b[0])], [self.frame.x0, self.frame.x1]);
            let [top, bottom] = inside([a[1].min(b[1]), a[1].max(b[1])], [self.frame.y0, self.frame.y1]);
            if left < right && top < bottom {
                let colours = canvas.colours;
                canvas.rectangle([left, top], [right, bottom], colours.tile(tile.colour), colours.tile_opacity);
            }
        }
    }

    fn bands(&self, canvas: &Canvas<'_>) {
        let colours = canvas.colours;
        for band in &self.panel.bands {
            let ends = band.x.map(|x| drawable(x, self.x.logarithmic).then(|| self.at(x, self.y.low)[0]));
            let [Some(from), Some(to)] = ends else { continue };
            let (from, to) = (from.max(self.frame.x0), to.min(self.frame.x1));
            if from < to {
                let corners = [[from, self.frame.y0], [to, self.frame.y1]];
                canvas.rectangle(corners[0], corners[1], colours.band(band.colour), colours.band_opacity);
            }
        }
    }

    /// Draws a series and returns how many of its points have no place.
    fn series(&self, canvas: &Canvas<'_>, series: &Series, ink: &mut Ink, dots: &mut String) -> usize {
        let colour = canvas.colours.series(series.colour);
        let pairs = series.x.iter().copied().zip(series.y.iter().copied());
        let points: Vec<Option<Pixel>> = pairs.map(|(x, y)| self.checked(x, y)).collect();
        let mut lines = Vec::new();
        let mut pen = legend::pen(series.style, colour);
        if pen.is_some() {
            for run in points.split(Option::is_none) {
                lines.extend(self.frame.clipped(&run.iter().flatten().copied().collect::<Vec<_>>()));
            }
        } else if series.style == Style::Stems {
            pen = Some(Pen::solid(colour, 1.4));
            let foot = if self.y.logarithmic { self.frame.y1 } else { self.at(self.x.low, 0.0)[1] };
            lines.extend(points.iter().flatten().flat_map(|point| self.frame.clipped(&[[point[0], foot], *point])));
        }
        // So many points overlap; thinner lines keep them visible.
        if let Some(pen) = pen.as_mut().filter(|_| series.style == Style::Hairline && points.len() > 3000) {
            pen.width = 0.5;
        }
        for line in &lines {
            ink.line(line);
            pen.into_iter().for_each(|pen| canvas.line(line, pen));
        }
        let inside: Vec<Pixel> = points.iter().flatten().copied().filter(|point| self.frame.holds(*point)).collect();
        let many = inside.len() > 300;
        let radius = match series.style {
            Style::Points | Style::Joined => Some(if many { 1.2 } else { 2.4 }),
            Style::Marks => Some(if many { 2.0 } else { 3.4 }),
            Style::Stems => (inside.len() <= 80).then_some(1.9),
            Style::Line | Style::Hairline | Style::Dashed => None,
        };
        if let Some(radius) = radius {
            inside.iter().for_each(|point| ink.dot(*point));
            if many && series.style != Style::Marks {
                *dots += &path_of_dots(&inside, radius, colour);
            } else {
                inside.into_iter().for_each(|point| canvas.dot(point, radius, colour, series.style == Style::Marks));
            }
        }
        points.iter().filter(|point| point.is_none()).count()
    }
}

/// Returns dots as one path of round points; those on the same half of a pixel are one.
fn path_of_dots(points: &[Pixel], radius: f64, colour: Rgb) -> String {
    let step = 0.5 * UNIT;
    let places = points.iter().map(|point| point.map(|px| ((px * UNIT / step).round() * step) as i32));
    let places: BTreeSet<[i32; 2]> = places.collect();
    let path: String = places.into_iter().map(|[x, y]| format!("M{x} {y}h0")).collect();
    let width = 2.0 * radius * UNIT;
    format!(
        "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linecap=\"round\"/>\n",
        hex(colour)
    )
}
