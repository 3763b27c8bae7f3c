//! The published study of the reference set, number by number, beside what Flank finds.
//!
//! Source of every number here: "Nonlinear Vibroimpact Characteristics of a Planetary Gear Transmission System", figures
//! 5 to 13 and the text around them (the paper). Nothing is tuned to it: the presets were identified once (see
//! [`presets`](crate::train::planetary::presets)), and rows that were part of that fit say so.

mod contradictions;
mod floating;
mod heavy;
mod identified;
mod light;

pub use contradictions::contradictions;
pub use floating::{history, trajectories};
pub use heavy::{forces, harmonics, modes, waterfall};
pub use identified::identified;
pub use light::{apart_by_load, apart_by_speed, cycles, threshold};

use serde::Serialize;

/// What comes of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Within 5 % (of a number), or as stated (of a statement).
    Agrees,
    /// Within 15 %, or true in part.
    Partly,
    /// Neither.
    Deviates,
    /// The source contradicts itself, or kinematics, here.
    Contradiction,
}

impl Verdict {
    /// One word for tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Partly => "partly",
            Self::Deviates => "deviates",
            Self::Contradiction => "contradiction",
        }
    }
}

/// One row of the table "published, Flank, verdict".
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Figure of the paper.
    pub place: &'static str,
    /// What is compared.
    pub quantity: String,
    /// What was published.
    pub published: String,
    /// What Flank finds.
    pub found: String,
    /// What comes of it.
    pub verdict: Verdict,
    /// Whether it was part of the fit that gave the preset, and is no test of it.
    pub fitted: bool,
    /// What to know before quoting it; may be empty.
    pub note: String,
}

/// Share of the published number up to which a number agrees, and up to which it does in part.
const NEAR: [f64; 2] = [0.05, 0.15];

/// Two numbers.
fn numbers(place: &'static str, quantity: &str, (published, found): (f64, f64), unit: &str, note: &str) -> Comparison {
    let off = (found - published).abs() / published.abs();
    let verdict = match off {
        o if o <= NEAR[0] => Verdict::Agrees,
        o if o <= NEAR[1] => Verdict::Partly,
        _ => Verdict::Deviates,
    };
    let write = |value: f64, digits: usize| format!("{value:.digits$}{}{unit}", if unit.is_empty() { "" } else { " " });
    let digits = if found.abs() < 1.0 {
        3
    } else if found.abs() < 100.0 {
        2
    } else {
        1
    };
    let published = format!("{published}{}{unit}", if unit.is_empty() { "" } else { " " });
    statement(place, quantity, &published, write(found, digits), verdict).noting(note)
}

/// A statement, and what was found about it.
fn statement(place: &'static str, quantity: &str, published: &str, found: String, verdict: Verdict) -> Comparison {
    Comparison {
        place,
        quantity: quantity.to_owned(),
        published: published.to_owned(),
        found,
        verdict,
        fitted: false,
        note: String::new(),
    }
}

impl Comparison {
    /// The same row, part of the fit.
    #[must_use]
    fn fitted(self) -> Self {
        Self { fitted: true, ..self }
    }

    /// The same row with a note.
    #[must_use]
    fn noting(self, note: &str) -> Self {
        Self { note: note.to_owned(), ..self }
    }
}

/// A statement that holds or not.
fn holds(yes: bool) -> Verdict {
    if yes { Verdict::Agrees } else { Verdict::Deviates }
}

/// Coefficient of determination of the straight line through points, `1 − Σ(y − ŷ)²/Σ(y − ȳ)²`.
fn linearity(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sum = |a: &[f64], ma: f64, b: &[f64], mb: f64| a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>();
    let (xx, xy, yy) = (sum(x, mx, x, mx), sum(x, mx, y, my), sum(y, my, y, my));
    if xx * yy > 0.0 { xy * xy / (xx * yy) } else { 0.0 }
}

/// Whether a study has enough points to speak of a curve, and these among them. What was read off the paper at one place is
/// compared there, not between its neighbours.
fn has(xs: &[f64], wanted: &[f64]) -> bool {
    xs.len() >= 20 && wanted.iter().all(|x| xs.iter().any(|own| (own - x).abs() <= 1e-9 * x.abs().max(1.0)))
}

/// Value at `x` of a curve through points in rising order, linear between them.
fn at(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    match xs.iter().position(|v| *v >= x) {
        Some(0) => ys[0],
        Some(i) => ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1]),
        None => ys.last().copied().unwrap_or_default(),
    }
}

/// Where a curve is largest.
fn summit(xs: &[f64], ys: &[f64]) -> (f64, f64) {
    xs.iter().zip(ys).fold((0.0, f64::NEG_INFINITY), |best, (x, y)| if *y > best.1 { (*x, *y) } else { best })
}

/// Numbers joined by commas.
fn list(values: impl IntoIterator<Item = f64>, digits: usize) -> String {
    values.into_iter().map(|v| format!("{v:.digits$}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_linear() {
        let x = [1.0, 2.0, 4.0];
        assert!((linearity(&x, &[3.0, 5.0, 9.0]) - 1.0).abs() < 1e-15);
        assert!(linearity(&[-1.0, 0.0, 1.0], &[1.0, 0.0, 1.0]) < 1e-15);
        assert_eq!(at(&x, &[3.0, 5.0, 9.0], 3.0), 7.0);
    }

    #[test]
    fn verdicts_follow_their_rule() {
        for (found, verdict) in [(104.0, Verdict::Agrees), (86.0, Verdict::Partly), (84.0, Verdict::Deviates)] {
            assert_eq!(numbers("", "", (100.0, found), "N", "").verdict, verdict);
        }
    }
}
