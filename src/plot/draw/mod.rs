//! Figures as SVG and PNG.

mod canvas;
mod frame;
pub(super) mod legend;
pub(super) mod palette;
pub(super) mod panel;
mod scale;
#[cfg(test)]
#[path = "../../../tests/unit/draw.rs"]
mod tests;
mod text;
mod words;

use std::sync::{Arc, OnceLock};

use krilla_svg::{SurfaceExt, SvgSettings};
use plotters::prelude::*;
use resvg::{
    tiny_skia::{Pixmap, Transform},
    usvg::{Options, Tree, fontdb::Database},
};

pub use self::palette::Theme;
use self::{
    canvas::{Anchor, Canvas, UNIT, rgb, sound},
    legend::Entry,
    panel::Sheet,
};
use crate::{
    output::{Folder, OutputError},
    plot::{Figure, Format, Panel, Print},
};

/// Room around the figure and between its panels, px.
const EDGE: f64 = 14.0;
const GAP: f64 = 12.0;
const TITLE: f64 = 15.0;
const LEGEND: f64 = 11.5;

/// Height of a line of text over its size.
const LEADING: f64 = 1.45;

impl Figure {
    /// Returns the figure as SVG for a screen: title, legend, panels. Equal figures give equal bytes.
    ///
    /// Values without a place on their axis (not finite, above 1e300, not positive on a logarithmic axis) are left out, and the panel gives
    /// their number.
    #[must_use]
    pub fn svg(&self, theme: Theme) -> String {
        self.printed(&Print::default(), theme)
    }

    /// Returns the figure as SVG in a given form.
    #[must_use]
    pub fn printed(&self, print: &Print, theme: Theme) -> String {
        let chosen = self.chosen(print);
        let page = Page::new(&chosen, print);
        let mut drawn = String::new();
        let (images, dots) = page.draw(&mut drawn, theme);
        // The backend's units become pixels; the rest of the root element is inherited by all shapes.
        let body = drawn.split_once('>').map_or("", |(_root, body)| body);
        // Images lie on the paper, which is the first element, and under all else.
        let (paper, body) = body.split_once("/>").unwrap_or(("", body));
        let body = body.trim_end().strip_suffix("</svg>").unwrap_or(body);
        let [width, height] = page.size;
        let length = |pixels: f64| match print.width_mm {
            // A picture of a given width has the same unit in both directions.
            Some(wanted) => format!("{:.3}mm", pixels * wanted / width),
            None => format!("{}", pixels * page.letters),
        };
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {} \
             {}\" stroke-linejoin=\"round\" stroke-linecap=\"round\">\n<title>{}</title>\n<desc>{}</desc>{paper}/>{images}{body}{dots}</svg>\n",
            length(width),
            length(height),
            width * UNIT,
            height * UNIT,
            escaped(&self.title),
            escaped(&self.caption),
        )
    }

    /// Returns the figure with the requested panels, at least one of them.
    fn chosen(&self, print: &Print) -> Self {
        let mut chosen = self.clone();
        if !print.has_titles {
            chosen.title.clear();
        }
        let wanted: Vec<Panel> = print.panels.iter().filter_map(|i| self.panels.get(i - 1).cloned()).collect();
        if !wanted.is_empty() {
            chosen.panels = wanted;
        }
        chosen
    }

    /// Returns the light picture of [`svg`](Self::svg) as PNG, `scale` pixels to one of the SVG's. The letters are those of a bundled font,
    /// DejaVu Sans: installed fonts are not needed.
    ///
    /// # Panics
    /// If `scale` is not in 0.01..=20.
    #[must_use]
    pub fn png(&self, scale: f64) -> Vec<u8> {
        raster(&self.svg(Theme::Light), scale)
    }

    /// Returns the figure as PDF in a given form: one page as large as the figure, letters as text. Equal figures give equal bytes.
    ///
    /// # Errors
    /// A text, if the page cannot be written.
    pub fn pdf(&self, print: &Print) -> Result<Vec<u8>, String> {
        let tree = tree(&self.printed(print, Theme::Light));
        // A pixel is 1/96 inch, a point 1/72.
        let [width, height] = [tree.size().width(), tree.size().height()].map(|pixels| 0.75 * pixels);
        let mut document = krilla::Document::new();
        let size = krilla::geom::Size::from_wh(width, height).ok_or("a page without a size")?;
        let settings = krilla::page::PageSettings::from_wh(width, height).ok_or("a page without a size")?;
        let mut page = document.start_page_with(settings);
        let mut surface = page.surface();
        surface.draw_svg(&tree, size, SvgSettings::default()).ok_or("a picture that has no PDF")?;
        surface.finish();
        page.finish();
        document.finish().map_err(|error| format!("{error:?}"))
    }

    /// Returns the names of the files that [`write`](Self::write) may write for the figure `id`.
    #[must_use]
    pub fn files(id: &str) -> [String; 5] {
        ["csv", "json", "svg", "pdf", "png"].map(|kind| format!("figures/{id}.{kind}"))
    }

    /// Writes data and pictures of the figure.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    pub fn write(&self, folder: &mut Folder, print: &Print) -> Result<(), OutputError> {
        let [csv, json, ..] = Self::files(&self.id);
        folder.bytes(&csv, self.csv())?;
        folder.bytes(&json, self.json())?;
        self.draw_into(folder, print)
    }

    /// Writes only pictures of the figure: its numbers are in a table of the command.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    pub fn draw_into(&self, folder: &mut Folder, print: &Print) -> Result<(), OutputError> {
        for format in &print.formats {
            let name = format!("figures/{}.{}", self.id, format.ending());
            match format {
                Format::Svg => folder.bytes(&name, self.printed(print, Theme::Light))?,
                Format::Png => {
                    // 300 pixels an inch on paper.
                    let scale = if print.width_mm.is_some() { 300.0 / 96.0 } else { 1.5 };
                    folder.bytes(&name, raster(&self.printed(print, Theme::Light), scale))?;
                }
                Format::Pdf => {
                    let pdf = self
                        .pdf(print)
                        .map_err(|why| OutputError::File(name.clone().into(), std::io::Error::other(why)))?;
                    folder.bytes(&name, pdf)?;
                }
            }
        }
        Ok(())
    }
}

/// Returns the tree of a generated picture, read with the bundled font.
fn tree(svg: &str) -> Tree {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut fonts = Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_font_data(dejavu::sans::bold().to_vec());
        Arc::new(fonts)
    });
    let options = Options { fontdb: Arc::clone(fonts), ..Options::default() };
    Tree::from_str(svg, &options).expect("an SVG of our own is sound")
}

fn raster(svg: &str, scale: f64) -> Vec<u8> {
    assert!((0.01..=20.0).contains(&scale), "a picture of scale {scale}: 0.01 to 20 are possible");
    let tree = tree(svg);
    let pixels = |length: f32| (f64::from(length) * scale).round().max(1.0) as u32;
    let size = tree.size();
    let mut pixmap = Pixmap::new(pixels(size.width()), pixels(size.height())).expect("the size is not zero");
    resvg::render(&tree, Transform::from_scale(scale as f32, scale as f32), &mut pixmap.as_mut());
    pixmap.encode_png().expect("encoding into memory does not fail")
}

/// Least width of a panel beside another one, px.
const LEAST: f64 = 230.0;
/// Least height of a panel, px.
const LOWEST: f64 = 130.0;
/// Letters of the numbers at axes, px.
const NUMBERS: f64 = 11.0;

/// Layout of a page.
struct Page<'a> {
    figure: &'a Figure,
    /// Width and height, px.
    size: [f64; 2],
    title: Vec<String>,
    legend: Vec<Vec<Entry<'a>>>,
    /// Upper edge of the panels.
    top: f64,
    columns: usize,
    cell: [f64; 2],
    /// Ratio of the letter size to the usual one.
    letters: f64,
}

impl<'a> Page<'a> {
    fn new(figure: &'a Figure, print: &Print) -> Self {
        // A pixel is 1/96 inch, a point 1/72. The sheet is drawn with the usual letters, and then scaled.
        let letters = print.font_pt.map_or(1.0, |points| points * 96.0 / 72.0 / NUMBERS);
        let pixels = |mm: f64| mm / 25.4 * 96.0 / letters;
        let columns = figure.columns.clamp(1, figure.panels.len().max(1));
        let wanted = print.width_mm.map(pixels);
        // OK to convert: panels are few.
        let columns = wanted.map_or(columns, |width| columns.min((width / LEAST) as usize).max(1));
        let rows = figure.panels.len().div_ceil(columns);
        let width: f64 = wanted.unwrap_or(match columns {
            1 => 820.0,
            2 => 1000.0,
            _ => 310.0 * columns as f64,
        });
        let room = width - 2.0 * EDGE;
        let title = text::wrapped(&text::clean(&figure.title), TITLE, true, room);
        let legend = legend::rows(&figure.panels, LEGEND, room);
        let title_height = title.len() as f64 * TITLE * LEADING;
        let legend_height = if legend.is_empty() { 0.0 } else { legend.len() as f64 * LEGEND * LEADING + 4.0 };
        let top = EDGE + title_height + legend_height;
        let across = (room - GAP * (columns - 1) as f64) / columns as f64;
        let has_images = figure.panels.iter().any(|panel| panel.raster.is_some());
        let high = match (figure.panels.iter().any(|panel| panel.equal_scales), rows, columns) {
            _ if has_images => 0.68 * across,
            (true, _, 1) => across.min(620.0),
            (true, ..) => across,
            (_, 1, 1) if wanted.is_none() => 460.0,
            (_, _, 1) if wanted.is_none() => 280.0,
            _ => (0.68 * across).max(if wanted.is_none() { 230.0 } else { 0.0 }),
        } * figure.height();
        let high = high.max(LOWEST);
        let high = print.height_mm.map(pixels).map_or(high, |height| {
            ((height - top - EDGE + GAP) / rows.max(1) as f64 - GAP).max(0.3 * across.min(LEAST))
        });
        let size = [width, top + rows as f64 * (high + GAP) - GAP + EDGE];
        Self { figure, size: size.map(f64::round), title, legend, top, columns, cell: [across, high], letters }
    }

    /// Draws into an SVG; returns the images behind it, and the dots on it.
    fn draw(&self, into: &mut String, theme: Theme) -> (String, String) {
        let [width, height] = self.size.map(|length| (length * UNIT) as u32);
        let colours = theme.colours();
        let canvas = Canvas { area: SVGBackend::with_string(into, (width, height)).into_drawing_area(), colours };
        sound(canvas.area.fill(&rgb(colours.paper)));
        let mut y = EDGE + TITLE * LEADING / 2.0;
        for line in &self.title {
            canvas.text(line, [EDGE, y], Anchor::Left, TITLE, colours.ink, true);
            y += TITLE * LEADING;
        }
        y += (LEGEND - TITLE) * LEADING / 2.0;
        for row in &self.legend {
            legend::draw(&canvas, row, [EDGE, y], LEGEND);
            y += LEGEND * LEADING;
        }
        // Frames have the same x below each other, and the same y beside each other.
        let (mut images, mut dots) = (String::new(), String::new());
        let panels = 0..self.figure.panels.len();
        let rooms: Vec<[f64; 2]> = panels.clone().map(|i| self.sheet(i, [0.0; 2]).rooms()).collect();
        for i in panels.clone() {
            let largest = |part: usize, same: &dyn Fn(usize) -> bool| {
                panels.clone().filter(|other| same(*other)).map(|other| rooms[other][part]).fold(0.0, f64::max)
            };
            let left = largest(0, &|other| other % self.columns == i % self.columns);
            let top = largest(1, &|other| other / self.columns == i / self.columns);
            let sheet = self.sheet(i, [left, top]);
            dots += &sheet.draw(&canvas);
            images.extend(sheet.image());
        }
        sound(canvas.area.present());
        (images, dots)
    }

    fn sheet(&self, i: usize, rooms: [f64; 2]) -> Sheet<'a> {
        let (row, column) = ((i / self.columns) as f64, (i % self.columns) as f64);
        let [across, high] = self.cell;
        let corner = [EDGE + column * (across + GAP), self.top + row * (high + GAP)];
        Sheet::new(&self.figure.panels[i], corner, self.cell, rooms)
    }
}

/// Returns text escaped for an XML element.
pub(super) fn escaped(words: &str) -> String {
    text::clean(words).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
