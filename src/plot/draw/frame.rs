//! Rectangle in which curves are drawn.

use super::canvas::Pixel;

/// Edges of the rectangle, px.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub x0: f64,
    pub x1: f64,
    /// The upper edge.
    pub y0: f64,
    pub y1: f64,
}

impl Frame {
    pub fn holds(&self, [x, y]: Pixel) -> bool {
        // A tenth of a pixel for rounding.
        (self.x0 - 0.1..=self.x1 + 0.1).contains(&x) && (self.y0 - 0.1..=self.y1 + 0.1).contains(&y)
    }

    /// Returns the part of a segment inside (Liang and Barsky, 1984).
    pub fn clip(&self, [ax, ay]: Pixel, [bx, by]: Pixel) -> Option<[Pixel; 2]> {
        let (dx, dy) = (bx - ax, by - ay);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for (slope, room) in [(-dx, ax - self.x0), (dx, self.x1 - ax), (-dy, ay - self.y0), (dy, self.y1 - ay)] {
            if slope < 0.0 {
                from = from.max(room / slope);
            } else if slope > 0.0 {
                to = to.min(room / slope);
            } else if room < 0.0 {
                return None;
            }
        }
        (from <= to).then_some([[ax + from * dx, ay + from * dy], [ax + to * dx, ay + to * dy]])
    }

    /// Returns the pieces of a polyline inside.
    pub fn clipped(&self, line: &[Pixel]) -> Vec<Vec<Pixel>> {
        let mut pieces: Vec<Vec<Pixel>> = Vec::new();
        for ends in line.windows(2) {
            let Some([a, b]) = self.clip(ends[0], ends[1]) else { continue };
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&a) => piece.push(b),
                _ => pieces.push(vec![a, b]),
            }
        }
        pieces
    }
}
