//! Guides and their names.

use crate::plot::Guide;

use super::{
    canvas::{Anchor, Canvas, Drawn, Pen, Point},
    frame::Frame,
    panel::{SMALL, Sheet},
    text,
};

/// A name on the sheet, and the room it takes there: left, top, right, bottom.
struct Name<'a> {
    words: &'a str,
    at: Point,
    anchor: Anchor,
}

impl Name<'_> {
    fn room(&self) -> [f64; 4] {
        let (along, across) = (text::width(self.words, SMALL, false), 0.65 * SMALL);
        let [x, y] = self.at;
        match self.anchor {
            Anchor::Left => [x, y - across, x + along, y + across],
            Anchor::Middle => [x - along / 2.0, y - across, x + along / 2.0, y + across],
            Anchor::Right => [x - along, y - across, x, y + across],
            Anchor::UpEnd => [x - across, y, x + across, y + along],
        }
    }

    fn meets(&self, other: &Self) -> bool {
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (self.room(), other.room());
        a0 < b2 + 2.0 && b0 < a2 + 2.0 && a1 < b3 + 2.0 && b1 < a3 + 2.0
    }
}

impl Sheet<'_> {
    /// The two ends of a guide inside the frame, if any of it is.
    fn guide_ends(&self, guide: &Guide) -> Option<[Point; 2]> {
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

    pub(super) fn guides(&self, canvas: &Canvas<'_>) -> Drawn {
        for guide in &self.panel.guides {
            if let Some(ends) = self.guide_ends(guide) {
                let pen = match guide {
                    Guide::Slanted { .. } => Pen::solid(canvas.colours.muted, 0.6),
                    _ => Pen { colour: canvas.colours.muted, width: 0.9, dash: Some([4.0, 3.0]) },
                };
                canvas.line(&ends, pen)?;
            }
        }
        Ok(())
    }

    /// Names lie on their guides, near the end. One that would meet another moves along its guide; the name of a guide
    /// too short for that is left out, not printed over the other.
    pub(super) fn guide_names(&self, canvas: &Canvas<'_>) -> Drawn {
        let mut written: Vec<Name<'_>> = Vec::new();
        for guide in &self.panel.guides {
            let Some([from, to]) = self.guide_ends(guide) else { continue };
            let places = self.places(guide, from, to);
            let free = |name: &Name<'_>| !written.iter().any(|other| name.meets(other));
            if let Some(name) = places.into_iter().find(free) {
                canvas.patched(name.words, name.at, name.anchor, SMALL, canvas.colours.muted)?;
                written.push(name);
            }
        }
        Ok(())
    }

    /// Where a guide's name can stand, best first.
    fn places<'g>(&self, guide: &'g Guide, [ax, ay]: Point, [bx, by]: Point) -> Vec<Name<'g>> {
        let Frame { x0, x1, y0, y1 } = self.frame;
        match guide {
            Guide::Vertical { name, .. } => {
                let length = text::width(name, SMALL, false);
                let steps = ((y1 - y0 - length) / 8.0).max(0.0) as usize;
                let x = bx.clamp(x0 + 0.6 * SMALL, x1 - 0.6 * SMALL);
                let place = |i| Name { words: name, at: [x, y0 + 2.0 + 8.0 * i as f64], anchor: Anchor::UpEnd };
                (0..=steps).map(place).collect()
            }
            Guide::Horizontal { name, .. } => {
                let above = if by - 1.2 * SMALL > y0 { by - 0.75 * SMALL } else { by + 0.75 * SMALL };
                let length = text::width(name, SMALL, false);
                let steps = ((x1 - x0 - length) / 12.0).max(0.0) as usize;
                let place = |i| Name { words: name, at: [x1 - 5.0 - 12.0 * i as f64, above], anchor: Anchor::Right };
                (0..=steps).map(place).collect()
            }
            Guide::Slanted { name, .. } => {
                let half = text::width(name, SMALL, false) / 2.0;
                let place = |i| {
                    // Beyond the end if there is room, else on the line.
                    let part = 1.0 - f64::from(i) / 12.0;
                    let (x, y) = (ax + part * (bx - ax), ay + part * (by - ay));
                    let x = x.clamp(x0 + half + 3.0, (x1 - half - 3.0).max(x0 + half + 3.0));
                    let y = if i == 0 { y - 0.9 * SMALL * (ay - by).signum() } else { y };
                    Name { words: name, at: [x, y.clamp(y0 + 0.75 * SMALL, y1 - 0.75 * SMALL)], anchor: Anchor::Middle }
                };
                (0..10).map(place).collect()
            }
        }
    }
}
