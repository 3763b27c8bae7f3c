//! Range of the values of a quantity.

use crate::poly;

/// Largest and smallest value so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub largest: f64,
    pub smallest: f64,
}

impl Default for Extent {
    fn default() -> Self {
        Self { largest: f64::NEG_INFINITY, smallest: f64::INFINITY }
    }
}

impl Extent {
    /// Includes `[largest, smallest]` values.
    pub fn take(&mut self, [largest, smallest]: [f64; 2]) {
        (self.largest, self.smallest) = (self.largest.max(largest), self.smallest.min(smallest));
    }

    fn holds(&self, [largest, smallest]: [f64; 2]) -> bool {
        largest <= self.largest && smallest >= self.smallest
    }

    /// Includes the values of a polynomial on `[0, 1]` in each of `extents`; an empty one is zero.
    pub fn extend<const N: usize>(extents: [&mut Self; N], p: &[f64]) {
        let bounds = poly::bounds(p);
        if !extents.iter().all(|extent| extent.holds(bounds)) {
            let values = poly::extremes(p);
            extents.into_iter().for_each(|extent| extent.take(values));
        }
    }

    /// Returns the largest value of `side` times the quantity, on the side of the sign of `side`.
    pub fn peak(&self, side: f64) -> f64 {
        if side < 0.0 { -self.smallest } else { self.largest }
    }
}
