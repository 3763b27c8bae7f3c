//! Sheet measured in pixels, on top of plotters' SVG backend.

use plotters::{
    coord::Shift,
    element::DashedPathElement,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{
    palette::{Colours, Rgb},
    text,
};

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Returns the result of drawing into a string, which does not fail.
pub(super) fn sound<T>(drawn: Result<T, DrawingAreaErrorKind<std::io::Error>>) -> T {
    drawn.expect("drawing into a string does not fail")
}

/// A point, px from the upper left corner.
pub(super) type Pixel = [f64; 2];

/// Drawing units per pixel: plotters counts in whole units, and ten of them make curves smooth.
pub(super) const UNIT: f64 = 10.0;

pub(super) fn units(px: f64) -> i32 {
    (px * UNIT).round() as i32
}

/// Point of a text that lies at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
    /// Text upwards, with its end here.
    UpEnd,
}

impl Anchor {
    /// Returns left, top, right and bottom of a line of text at a point, `along` px long and `across` px to either side.
    pub fn room(self, [x, y]: Pixel, along: f64, across: f64) -> [f64; 4] {
        match self {
            Self::Left => [x, y - across, x + along, y + across],
            Self::Middle => [x - along / 2.0, y - across, x + along / 2.0, y + across],
            Self::Right => [x - along, y - across, x, y + across],
            Self::UpEnd => [x - across, y, x + across, y + along],
        }
    }
}

/// Line style: colour, width (px), and the lengths of dashes and gaps.
#[derive(Clone, Copy)]
pub(super) struct Pen {
    pub colour: Rgb,
    pub width: f64,
    pub dash: Option<[f64; 2]>,
}

impl Pen {
    pub fn solid(colour: Rgb, width: f64) -> Self {
        Self { colour, width, dash: None }
    }

    fn style(self) -> ShapeStyle {
        rgb(self.colour).stroke_width(units(self.width).max(1) as u32)
    }
}

pub(super) fn rgb((r, g, b): Rgb) -> RGBColor {
    RGBColor(r, g, b)
}

/// Returns the text style of one size and colour.
pub(super) fn font(size: f64, colour: Rgb, bold: bool) -> TextStyle<'static> {
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    // The backend divides sizes by this.
    let font = FontDesc::new(FontFamily::Name(text::FAMILY), size * UNIT * 1.24, style);
    TextStyle { color: rgb(colour).to_backend_color(), ..TextStyle::from(font) }
}

/// Sheet of a drawing.
pub(super) struct Canvas<'a> {
    pub area: Area<'a>,
    pub colours: &'static Colours,
}

impl Canvas<'_> {
    pub fn line(&self, points: &[Pixel], pen: Pen) {
        let mut path: Vec<(i32, i32)> = points.iter().map(|[x, y]| (units(*x), units(*y))).collect();
        path.dedup();
        if path.len() < 2 {
            return;
        }
        sound(match pen.dash {
            None => self.area.draw(&PathElement::new(path, pen.style())),
            Some([dash, gap]) => self.area.draw(&DashedPathElement::new(path, units(dash), units(gap), pen.style())),
        });
    }

    /// Draws a disc, or a ring if it is `open`.
    pub fn dot(&self, [x, y]: Pixel, radius: f64, colour: Rgb, open: bool) {
        let style = if open { rgb(colour).stroke_width(units(1.4) as u32) } else { rgb(colour).filled() };
        sound(self.area.draw(&Circle::new((units(x), units(y)), units(radius), style)));
    }

    pub fn rectangle(&self, [x0, y0]: Pixel, [x1, y1]: Pixel, colour: Rgb, opacity: f64) {
        let corners = [(units(x0), units(y0)), (units(x1), units(y1))];
        sound(self.area.draw(&Rectangle::new(corners, rgb(colour).mix(opacity).filled())));
    }

    /// Draws a line of text; the point is at half its height.
    pub fn text(&self, words: &str, at: Pixel, anchor: Anchor, size: f64, colour: Rgb, bold: bool) {
        let words = text::clean(words);
        if words.trim().is_empty() {
            return;
        }
        let horizontal = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right | Anchor::UpEnd => HPos::Right,
        };
        let mut style = font(size, colour, bold).pos(Pos::new(horizontal, VPos::Center));
        if anchor == Anchor::UpEnd {
            style = style.transform(FontTransform::Rotate270);
        }
        sound(self.area.draw(&Text::new(words, (units(at[0]), units(at[1])), style)));
    }

    /// Draws a line of text on a patch of paper, which keeps it legible on top of curves.
    pub fn patched(&self, words: &str, at: Pixel, anchor: Anchor, size: f64, colour: Rgb) {
        if words.is_empty() {
            return;
        }
        let along = text::width(&text::clean(words), size, false);
        let (across, [dx, dy]) = if anchor == Anchor::UpEnd { (0.5, [0.0, 1.0]) } else { (0.6, [1.0, 0.0]) };
        let [left, top, right, bottom] = anchor.room(at, along, across * size);
        self.rectangle([left - dx, top - dy], [right + dx, bottom + dy], self.colours.paper, 0.8);
        self.text(words, at, anchor, size, colour, false);
    }
}
