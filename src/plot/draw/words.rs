//! Guides, and words in the panel: placed without overlap of words and, if possible, of curves.

use std::collections::HashSet;

use crate::plot::Guide;

use super::{
    canvas::{Anchor, Canvas, Pen, Pixel},
    frame::Frame,
    panel::{SMALL, Sheet},
    text,
};

/// Places of curves, in cells of a few pixels.
#[derive(Default)]
pub(super) struct Ink(HashSet<(i32, i32)>);

impl Ink {
    const CELL: f64 = 3.0;

    fn cell(length: f64) -> i32 {
        (length / Self::CELL).floor() as i32
    }

    pub fn line(&mut self, points: &[Pixel]) {
        for ends in points.windows(2) {
            let ([ax, ay], [bx, by]) = (ends[0], ends[1]);
            let steps = (libm::hypot(bx - ax, by - ay) / Self::CELL).ceil();
            for i in 0..=steps as usize {
                let part = i as f64 / steps.max(1.0);
                self.0.insert((Self::cell(ax + part * (bx - ax)), Self::cell(ay + part * (by - ay))));
            }
        }
    }

    pub fn dot(&mut self, [x, y]: Pixel) {
        self.0.insert((Self::cell(x), Self::cell(y)));
    }

    /// Returns the number of cells with a curve in a rectangle.
    pub fn under(&self, [x0, y0, x1, y1]: [f64; 4]) -> usize {
        let columns = Self::cell(x0)..=Self::cell(x1);
        columns
            .flat_map(|x| (Self::cell(y0)..=Self::cell(y1)).map(move |y| (x, y)))
            .filter(|c| self.0.contains(c))
            .count()
    }
}

/// Words at a place.
struct Words<'a> {
    words: &'a str,
    at: Pixel,
    anchor: Anchor,
    /// True if curves below are allowed: the first such place that hides no other words is taken.
    firm: bool,
}

impl Words<'_> {
    /// Returns left, top, right and bottom.
    fn room(&self) -> [f64; 4] {
        self.anchor.room(self.at, text::width(self.words, SMALL, false), 0.65 * SMALL)
    }

    fn meets(&self, other: &Self) -> bool {
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (self.room(), other.room());
        a0 < b2 + 2.0 && b0 < a2 + 2.0 && a1 < b3 + 2.0 && b1 < a3 + 2.0
    }
}

impl Sheet<'_> {
    /// Returns the two ends of a guide inside the frame, if any part is inside.
    fn guide_ends(&self, guide: &Guide) -> Option<[Pixel; 2]> {
        let Frame { x0, x1, y0, y1 } = self.frame;
        let ends = match guide {
            Guide::Vertical { x, .. } => {
                let [x, _] = self.checked(*x, self.y.low)?;
                [[x, y1], [x, y0]]
            }
            Guide::Horizontal { y, .. } => {
                let [_, y] = self.checked(self.x.low, *y)?;
                [[x0, y], [x1, y]]
            }
            Guide::Slanted { from, to, .. } => [self.checked(from[0], from[1])?, self.checked(to[0], to[1])?],
        };
        self.frame.clip(ends[0], ends[1])
    }

    pub(super) fn guides(&self, canvas: &Canvas<'_>) {
        for guide in &self.panel.guides {
            if let Some(ends) = self.guide_ends(guide) {
                let pen = match guide {
                    Guide::Slanted { .. } => Pen::solid(canvas.colours.muted, 0.6),
                    _ => Pen { colour: canvas.colours.muted, width: 0.9, dash: Some([4.0, 3.0]) },
                };
                canvas.line(&ends, pen);
            }
        }
    }

    /// Draws the remark, the notes, and the names of the guides, on them and near their ends. A name without room on its guide is left out,
    /// not printed over another.
    pub(super) fn words(&self, canvas: &Canvas<'_>, remark: &str, ink: &Ink) {
        let (ink_colour, muted) = (canvas.colours.ink, canvas.colours.muted);
        let corner = [self.frame.x1 - 4.0, self.frame.y1 - 9.0];
        let mut all = vec![(muted, vec![Words { words: remark, at: corner, anchor: Anchor::Right, firm: true }])];
        for note in &self.panel.notes {
            let at = self.checked(note.at[0], note.at[1]).filter(|at| self.frame.holds(*at));
            all.extend(at.map(|at| (ink_colour, self.beside(&note.text, at))));
        }
        self.names_above(canvas);
        let above = |guide: &&Guide| self.panel.names_above && matches!(guide, Guide::Vertical { .. });
        for guide in self.panel.guides.iter().filter(|guide| !above(guide)) {
            all.extend(self.guide_ends(guide).map(|ends| (muted, self.along(guide, ends))));
        }
        let mut written: Vec<Words<'_>> = Vec::new();
        for (colour, places) in all {
            let free = places.into_iter().filter(|place| !written.iter().any(|other| place.meets(other)));
            if let Some(best) = free.min_by_key(|place| if place.firm { 0 } else { ink.under(place.room()) }) {
                canvas.patched(best.words, best.at, best.anchor, SMALL, colour);
                written.push(best);
            }
        }
    }

    /// Draws the names of upright guides in a row above the frame, if the panel places them there.
    fn names_above(&self, canvas: &Canvas<'_>) {
        if !self.panel.names_above {
            return;
        }
        let mut named: Vec<(&str, f64)> = Vec::new();
        for guide in &self.panel.guides {
            if let (Guide::Vertical { name, .. }, Some([foot, _])) = (guide, self.guide_ends(guide)) {
                named.push((name, foot[0]));
            }
        }
        named.sort_by(|a, b| a.1.total_cmp(&b.1));
        let widths: Vec<[f64; 2]> = named.iter().map(|(name, x)| [*x, text::width(name, SMALL, false)]).collect();
        let (room, y) = ([self.frame.x0, self.frame.x1], self.frame.y0 - 0.75 * SMALL);
        for ((name, _), x) in named.iter().zip(side_by_side(&widths, room)) {
            if let Some(x) = x {
                canvas.text(name, [x, y], Anchor::Middle, SMALL, canvas.colours.muted, false);
            }
        }
    }

    /// Returns places around a point, best first.
    fn beside<'n>(&self, words: &'n str, [x, y]: Pixel) -> Vec<Words<'n>> {
        let Frame { x0, x1, y0, y1 } = self.frame;
        let length = text::width(words, SMALL, false);
        let mut places = Vec::new();
        for rows in [-1.0, 1.0, -2.5, 2.5, -4.0, 4.0] {
            let y = (y + 0.9 * SMALL * rows).clamp(y0 + 0.75 * SMALL, y1 - 0.75 * SMALL);
            let right = Words { words, at: [x + 6.0, y], anchor: Anchor::Left, firm: false };
            let left = Words { words, at: [x - 6.0, y], anchor: Anchor::Right, firm: false };
            places.extend((x + 6.0 + length < x1).then_some(right));
            places.extend((x - 6.0 - length > x0).then_some(left));
        }
        places
    }

    /// Returns places along a guide, best first.
    fn along<'g>(&self, guide: &'g Guide, [[ax, ay], [bx, by]]: [Pixel; 2]) -> Vec<Words<'g>> {
        let Frame { x0, x1, y0, y1 } = self.frame;
        let (Guide::Vertical { name, .. } | Guide::Horizontal { name, .. } | Guide::Slanted { name, .. }) = guide;
        let length = text::width(name, SMALL, false);
        match guide {
            Guide::Vertical { .. } => {
                let steps = ((y1 - y0 - length) / 8.0).max(0.0) as usize;
                let x = bx.clamp(x0 + 0.6 * SMALL, x1 - 0.6 * SMALL);
                let place =
                    |i| Words { words: name, at: [x, y0 + 2.0 + 8.0 * i as f64], anchor: Anchor::UpEnd, firm: false };
                (0..=steps).map(place).collect()
            }
            Guide::Horizontal { .. } => {
                let y = if by - 1.2 * SMALL > y0 { by - 0.75 * SMALL } else { by + 0.75 * SMALL };
                let steps = ((x1 - x0 - length) / 12.0).max(0.0) as usize;
                let place =
                    |i| Words { words: name, at: [x1 - 5.0 - 12.0 * i as f64, y], anchor: Anchor::Right, firm: false };
                (0..=steps).map(place).collect()
            }
            Guide::Slanted { .. } => {
                let (low, high) = (x0 + length / 2.0 + 3.0, x1 - length / 2.0 - 3.0);
                let place = |i| {
                    // Beyond the end first, then on the line.
                    let part = 1.0 - f64::from(i) / 12.0;
                    let (x, y) = (ax + part * (bx - ax), ay + part * (by - ay));
                    let y = if i == 0 { y - 0.9 * SMALL * (ay - by).signum() } else { y };
                    let at = [x.min(high).max(low), y.clamp(y0 + 0.75 * SMALL, y1 - 0.75 * SMALL)];
                    Words { words: name, at, anchor: Anchor::Middle, firm: true }
                };
                (0..6).map(place).collect()
            }
        }
    }
}

/// Returns middles of words of `[middle, width]`, rising, moved no farther than necessary for distances in `room`; none for those without
/// room.
pub(super) fn side_by_side(words: &[[f64; 2]], [low, high]: [f64; 2]) -> Vec<Option<f64>> {
    const SPACE: f64 = 6.0;
    let mut lefts = Vec::new();
    let mut free = low;
    for [middle, width] in words {
        let left = (middle - width / 2.0).max(free);
        lefts.push(left);
        free = left + width + SPACE;
    }
    let mut end = high;
    for (left, [_, width]) in lefts.iter_mut().zip(words).rev() {
        *left = left.min(end - width);
        end = *left - SPACE;
    }
    lefts.iter().zip(words).map(|(left, [_, width])| (*left >= low - 0.1).then_some(left + width / 2.0)).collect()
}
