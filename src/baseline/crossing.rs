//! Events as users of fixed-step codes detect them: sign changes between samples.

use std::ops::ControlFlow;

use super::{Penalty, Sample, SampleObserver};
use crate::gear::contact::Law;

/// Crossing of a flank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Time after the start, s.
    pub t: f64,
    /// Index of the contact.
    pub contact: usize,
    /// True on the back flank, `δ = −b`; false on the drive flank, `δ = b`.
    pub back: bool,
    /// True if the crossing leads into contact; false if out of it.
    pub closing: bool,
}

/// Interpolation that locates a crossing between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// On the straight line between the deflections.
    #[default]
    Linear,
    /// On the cubic through the deflections and their rates.
    Cubic,
}

impl Interpolation {
    /// Returns the place in `[0, 1]` where the distance from the flank is zero, between values `g` of opposite signs with the slopes
    /// `s`, per step.
    fn place(self, g: [f64; 2], s: [f64; 2]) -> f64 {
        let straight = g[0] / (g[0] - g[1]);
        if self == Self::Linear {
            return straight;
        }
        let cubic = |u: f64| {
            let w = 1.0 - u;
            ((1.0 + 2.0 * u) * g[0] + u * s[0]) * w * w + ((3.0 - 2.0 * u) * g[1] - w * s[1]) * u * u
        };
        let (mut low, mut high) = (0.0, 1.0);
        // To the last bit of [0, 1].
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (cubic(middle) > 0.0) == (g[0] > 0.0) { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

/// Observer that collects the crossings of all flanks of contacts that can open.
///
/// A rigid contact gives its strikes only: it is found beyond a flank once, and mirrored at once.
#[derive(Clone, Debug)]
pub struct Crossings {
    /// Crossings in the order of the samples between which they lie.
    pub found: Vec<Crossing>,
    interpolation: Interpolation,
    /// Watched flanks: `(contact, half backlash, back, rigid)`.
    flanks: Vec<(usize, f64, bool, bool)>,
    before: Vec<[f64; 2]>,
    t: f64,
}

impl Crossings {
    /// Returns the observer of the flanks of `model`.
    #[must_use]
    pub fn new(model: &Penalty, interpolation: Interpolation) -> Self {
        let mut flanks = Vec::new();
        for (j, c) in model.contacts.iter().enumerate().filter(|(_, c)| !matches!(c.law, Law::Bilateral(_))) {
            let backs = if c.has_back { &[false, true][..] } else { &[false] };
            flanks.extend(backs.iter().map(|back| (j, c.half_backlash, *back, c.is_rigid())));
        }
        Self { found: Vec::new(), interpolation, flanks, before: Vec::new(), t: 0.0 }
    }
}

impl SampleObserver for Crossings {
    fn sample(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        let now = &sample.point.contacts;
        if self.before.is_empty() {
            self.before = now.iter().map(|touch| touch.deflection).collect();
            return ControlFlow::Continue(());
        }
        let h = sample.t - self.t;
        for &(contact, b, back, rigid) in &self.flanks {
            let side = if back { -1.0 } else { 1.0 };
            let ([d0, r0], [d1, r1]) = (self.before[contact], now[contact].deflection);
            let g = [side * d0 - b, side * d1 - b];
            if rigid {
                if let Some(strike) = now[contact].strike.filter(|s| s.side == side) {
                    let t = self.t + h * strike.place;
                    self.found.push(Crossing { t, contact, back, closing: true });
                }
            } else if (g[0] > 0.0) != (g[1] > 0.0) && !(g[0] == 0.0 && self.t == 0.0) {
                // (A start on the flank is no crossing.)
                let u = self.interpolation.place(g, [side * r0 * h, side * r1 * h]);
                self.found.push(Crossing { t: self.t + h * u, contact, back, closing: g[1] > 0.0 });
            }
        }
        for (before, touch) in self.before.iter_mut().zip(now) {
            *before = touch.deflection;
        }
        self.t = sample.t;
        ControlFlow::Continue(())
    }
}
