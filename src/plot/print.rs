//! Pictures for paper: formats, size, letters.

use crate::output::Fault;

/// Format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Format {
    /// Scalable Vector Graphics.
    Svg,
    /// Portable Document Format, one page as large as the picture.
    Pdf,
    /// Portable Network Graphics: 300 pixels an inch at a given size, else 1.5 for a pixel of the SVG.
    Png,
}

impl Format {
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }
}

/// Form in which figures are printed.
#[derive(Clone, Debug, PartialEq)]
pub struct Print {
    /// Formats.
    pub formats: Vec<Format>,
    /// Width, mm; by default the width for a screen.
    pub width_mm: Option<f64>,
    /// Height, mm; by default the height of the panels at this width.
    pub height_mm: Option<f64>,
    /// Size of the numbers at the axes, points; names are a little larger.
    pub font_pt: Option<f64>,
    /// True if the title of the figure stands above it.
    pub has_titles: bool,
    /// Panels, counted from 1; all if empty.
    pub panels: Vec<usize>,
}

impl Default for Print {
    fn default() -> Self {
        Self {
            formats: vec![Format::Svg, Format::Png],
            width_mm: None,
            height_mm: None,
            font_pt: None,
            has_titles: true,
            panels: Vec::new(),
        }
    }
}

/// Allowed sides, mm, and sizes of letters, points, of a picture.
const SIDES: [f64; 2] = [40.0, 1000.0];
const LETTERS: [f64; 2] = [4.0, 36.0];

impl Print {
    /// Sets a size: `85mm`, or width and height `120x80mm`.
    ///
    /// # Errors
    /// A text without a size, or a size outside the limits.
    pub fn sized(mut self, text: &str) -> Result<Self, Fault> {
        let [low, high] = SIDES;
        let numbers =
            text.trim().trim_end_matches("mm").split('x').map(|side| side.trim_end_matches("mm").parse::<f64>());
        match numbers.collect::<Result<Vec<f64>, _>>().as_deref() {
            Ok(sides @ ([_] | [_, _])) if sides.iter().all(|side| (low..=high).contains(side)) => {
                (self.width_mm, self.height_mm) = (Some(sides[0]), sides.get(1).copied());
                Ok(self)
            }
            _ => Err(Fault::new("--size", format!("{text:?}"), format!("85mm, 178mm or WxH, {low} to {high} mm"))
                .remedy("write a width, or width and height, in mm")),
        }
    }

    /// Sets a size of letters, points.
    ///
    /// # Errors
    /// A size outside the limits.
    pub fn lettered(mut self, points: f64) -> Result<Self, Fault> {
        let [low, high] = LETTERS;
        if (low..=high).contains(&points) {
            self.font_pt = Some(points);
            return Ok(self);
        }
        let fault = Fault::new("--font-size", points.to_string(), format!("{low} to {high} points"));
        Err(fault.remedy("write a number in this range"))
    }
}
