//! Widths of words in the bundled font, DejaVu Sans.

use std::sync::OnceLock;

use ttf_parser::Face;

/// Font family of an SVG: the bundled font, then similar ones.
pub(super) const FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";

/// Returns the width of a line of text, in the unit of `size`.
pub(super) fn width(text: &str, size: f64, bold: bool) -> f64 {
    static FACES: OnceLock<[Face<'static>; 2]> = OnceLock::new();
    let faces = FACES.get_or_init(|| {
        [dejavu::sans::regular(), dejavu::sans::bold()]
            .map(|bytes| Face::parse(bytes, 0).expect("the bundled font is sound"))
    });
    let face = &faces[usize::from(bold)];
    let advance = |c| face.glyph_index(c).and_then(|glyph| face.glyph_hor_advance(glyph)).unwrap_or(1229);
    let units: f64 = text.chars().map(|c| f64::from(advance(c))).sum();
    units / f64::from(face.units_per_em()) * size
}

/// Returns the largest size up to `size`, and no smaller than 8, at which the text is at most `room` wide.
pub(super) fn fitted(text: &str, size: f64, room: f64) -> f64 {
    let needed = width(text, size, false);
    if needed > room { (size * room / needed).max(8.0) } else { size }
}

/// Returns lines at most `room` wide, broken between words.
pub(super) fn wrapped(text: &str, size: f64, bold: bool, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            // A single sign, such as %, stays with the word before it.
            Some(line)
                if !word.contains(char::is_alphanumeric) || width(&format!("{line} {word}"), size, bold) <= room =>
            {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Returns one line without control characters, which XML excludes.
pub(super) fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
