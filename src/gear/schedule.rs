//! Mesh stiffness in the clock of the mesh `τ = t/T + γ`, before a speed gives it a period.
//!
//! The tooth pair n is in contact while `−A ≤ τ + n ≤ R` (approach A and recess R in base pitches, τ = 0 at
//! pitch-point contact). Equal stiffness of every pair gives `k = k̄ · (number of pairs)/ε`, whose mean is
//! k̄ since the number of pairs has the mean ε = A + R.
//!
//! Helical teeth have an overlap ratio ε_β. Their stiffness is proportional to the length of the lines of contact. With `φ = τ + A +
//! ε_β/2`, in base pitches since the first contact of a pair, its line has the length `b/(ε_β cos β_b) · min(φ, ε, ε_β, ε + ε_β − φ)`. The
//! sum over all pairs has the mean `ε b/cos β_b`, and is constant where ε or ε_β is whole.

use std::f64::consts::PI;

use super::{Curve, MeshHarmonic, PathOfContact, Piece, Stiffness};

/// Function from the number of tooth pairs in contact to a stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Waveform {
    /// Spur pairs enter and leave at once: two levels. Helical pairs follow the length of their line of contact.
    Rectangular,
    /// Each entry and each exit is a straight ramp from `ramp` before to `ramp` after it.
    Trapezoidal {
        /// Half width of a ramp, fraction of the mesh period, `(0, ε/2]`.
        ramp: f64,
    },
    /// Truncated Fourier series of the rectangular wave.
    Fourier {
        /// Number of harmonics, ≥ 1.
        harmonics: u32,
    },
}

/// A mesh stiffness in the clock of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshStiffness {
    /// `k = k̄`, N/m (N/mⁿ for a power law).
    Constant(f64),
    /// `k = k̄ (1 + Σ a cos(2π h τ + φ))`.
    Harmonics {
        /// Mean k̄, N/m.
        mean: f64,
        /// Harmonics, relative to the mean.
        harmonics: Vec<MeshHarmonic>,
    },
    /// `k = high` while `frac(τ) < duty`, else `low`.
    Rectangular {
        /// Stiffness at the start of the period, N/m.
        high: f64,
        /// Stiffness in the rest of the period, N/m.
        low: f64,
        /// Fraction of the period at `high`, `(0, 1)`.
        duty: f64,
    },
    /// A measured curve, as straight lines between its points.
    Lines {
        /// The curve, N/m.
        curve: Curve,
        /// Number of mesh periods of the curve, ≥ 1: a table of one turn of a gear has as many as the gear has teeth.
        periods: u32,
    },
    /// From the number of tooth pairs in contact, `k = k̄ (1 − s) + s k̄ (pairs)/ε`.
    Pairs {
        /// Mean k̄, N/m.
        mean: f64,
        /// Path of contact.
        path: PathOfContact,
        /// Shape of entry and exit.
        waveform: Waveform,
        /// Modulation s, `[0, 1]`: 0 constant, 1 the full wave.
        modulation: f64,
    },
}

impl MeshStiffness {
    /// Mean stiffness k̄, N/m.
    #[must_use]
    pub fn mean(&self) -> f64 {
        match self {
            Self::Constant(mean) | Self::Harmonics { mean, .. } | Self::Pairs { mean, .. } => *mean,
            Self::Rectangular { high, low, duty } => high * duty + low * (1.0 - duty),
            Self::Lines { curve, .. } => curve.mean(),
        }
    }

    /// Returns whether the stiffness varies in time (and so needs a mesh period).
    #[must_use]
    pub fn varies(&self) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Harmonics { harmonics, .. } => !harmonics.is_empty(),
            Self::Rectangular { high, low, .. } => high != low,
            Self::Lines { curve, .. } => curve.values().iter().any(|value| *value != curve.values()[0]),
            Self::Pairs { modulation, .. } => *modulation != 0.0,
        }
    }

    /// Returns the first value out of its range: its name, the value, the range.
    #[must_use]
    pub fn fault(&self) -> Option<(&'static str, f64, &'static str)> {
        let mean = ("mean stiffness", self.mean(), self.mean() >= 0.0, ">= 0");
        let mut values = vec![mean];
        match self {
            Self::Constant(_) => {}
            Self::Harmonics { harmonics, .. } => {
                for h in harmonics {
                    values.push(("stiffness harmonic: order", h.order, h.order > 0.0, "> 0"));
                    values.push(("stiffness harmonic: amplitude", h.amplitude, true, "finite"));
                    values.push(("stiffness harmonic: phase", h.phase, true, "finite"));
                }
            }
            Self::Lines { curve, .. } => {
                values
                    .extend(curve.values().iter().map(|value| ("stiffness of a curve", *value, *value >= 0.0, ">= 0")));
            }
            Self::Rectangular { high, low, duty } => values.extend([
                ("high stiffness", *high, *high >= 0.0, ">= 0"),
                ("low stiffness", *low, *low >= 0.0, ">= 0"),
                ("duty", *duty, *duty > 0.0 && *duty < 1.0, "in (0, 1)"),
            ]),
            Self::Pairs { path, waveform, modulation, .. } => {
                let (ratio, total) = (path.contact_ratio(), path.contact_ratio() + path.overlap);
                values.extend([
                    ("approach", path.approach, path.approach >= 0.0, ">= 0"),
                    ("recess", path.recess, path.recess >= 0.0, ">= 0"),
                    ("overlap ratio", path.overlap, path.overlap >= 0.0, ">= 0"),
                    ("contact ratio", total, total >= 1.0, ">= 1, or the mesh would lose its teeth"),
                    ("modulation", *modulation, (0.0..=1.0).contains(modulation), "in [0, 1]"),
                ]);
                values.push(match waveform {
                    Waveform::Rectangular => mean,
                    Waveform::Trapezoidal { .. } if path.overlap > 0.0 => {
                        ("overlap ratio beside ramps", path.overlap, false, "0: helical pairs have ramps of their own")
                    }
                    Waveform::Trapezoidal { ramp } => (
                        "ramp",
                        *ramp,
                        *ramp > 0.0 && 2.0 * ramp <= ratio,
                        "above 0 and at most half the contact ratio",
                    ),
                    Waveform::Fourier { harmonics } => ("harmonics", f64::from(*harmonics), *harmonics > 0, ">= 1"),
                });
            }
        }
        values
            .into_iter()
            .find_map(|(name, value, ok, wanted)| (!ok || !value.is_finite()).then_some((name, value, wanted)))
    }

    /// The schedule in time for a mesh period T, s, > 0, and a mesh phase γ, periods.
    #[must_use]
    pub fn schedule(&self, period: f64, phase: f64) -> Stiffness {
        match self {
            _ if !self.varies() => Stiffness::Constant(self.mean()),
            Self::Constant(mean) => Stiffness::Constant(*mean),
            Self::Harmonics { mean, harmonics } => Stiffness::Harmonic {
                mean: *mean,
                harmonics: harmonics.iter().map(|h| h.cosine(period.recip(), phase)).collect(),
            },
            Self::Rectangular { high, low, duty } => {
                Stiffness::rectangular(*high, *low, period, *duty, past_origin(-phase) * period)
            }
            Self::Lines { curve, periods } => {
                let whole = f64::from(*periods);
                let origin = past_origin(-phase / whole) * whole * period;
                Stiffness::Periodic { period: whole * period, origin, pieces: curve.pieces(whole * period) }
            }
            Self::Pairs { mean, path, waveform, modulation } => {
                Stiffness::from_contact_ratio(*mean, *path, *waveform, *modulation, period, phase)
            }
        }
    }
}

impl Stiffness {
    /// Schedule of a mesh from its path of contact: `k = k̄ (1 − s) + s k̄ (pairs)/ε`, mean exactly k̄.
    ///
    /// `mean` k̄, N/m, > 0; `modulation` s, `[0, 1]`; `period` T, s, > 0; `phase` γ, periods, any.
    /// Rectangular levels are `k̄ m/ε` and `k̄ (m + 1)/ε` with m the whole part of ε; the series is
    /// `k̄ [1 + 2s Σ_l sin(πlε)/(πlε) cos 2πl(τ − (R − A)/2)]`, each term times `sin(πlε_β)/(πlε_β)` for helical teeth.
    #[must_use]
    pub fn from_contact_ratio(
        mean: f64,
        path: PathOfContact,
        waveform: Waveform,
        modulation: f64,
        period: f64,
        phase: f64,
    ) -> Self {
        let ratio = path.contact_ratio();
        let level = |pairs: f64| mean * (1.0 - modulation + modulation * pairs / ratio);
        match waveform {
            Waveform::Fourier { harmonics } => Self::Harmonic {
                mean,
                harmonics: (1..=harmonics)
                    .map(|l| {
                        let argument = PI * f64::from(l) * ratio;
                        let across = PI * f64::from(l) * path.overlap;
                        let lines = if path.overlap == 0.0 { 1.0 } else { libm::sin(across) / across };
                        MeshHarmonic {
                            order: f64::from(l),
                            amplitude: 2.0 * modulation * libm::sin(argument) / argument * lines,
                            phase: -PI * f64::from(l) * (path.recess - path.approach),
                        }
                        .cosine(period.recip(), phase)
                    })
                    .collect(),
            },
            Waveform::Rectangular => {
                let (whole, duty) = (ratio.floor(), ratio.fract());
                if duty == 0.0 || modulation == 0.0 || path.overlap > 0.0 && path.overlap.fract() == 0.0 {
                    return Self::Constant(mean);
                }
                if path.overlap > 0.0 {
                    // The line grows over the shorter of the two ratios, and the areas of all lines sum to the longer one.
                    let (ratio, half) = (ratio.max(path.overlap), 0.5 * ratio.min(path.overlap));
                    let first = -path.approach - 0.5 * path.overlap;
                    let level = |lines: f64| mean * (1.0 - modulation + modulation * lines / ratio);
                    return trapezoid(first, ratio, half, period, phase, level);
                }
                // The highest count starts as a pair enters, at τ = −A.
                let origin = past_origin(-path.approach - phase) * period;
                Self::rectangular(level(whole + 1.0), level(whole), period, duty, origin)
            }
            Waveform::Trapezoidal { ramp } => {
                if modulation == 0.0 {
                    return Self::Constant(mean);
                }
                trapezoid(-path.approach - ramp, ratio, ramp, period, phase, level)
            }
        }
    }
}

/// Shifts the origin `x`, periods, into `(−1, 0]`, so that a run that starts at t = 0 is inside the first period.
fn past_origin(x: f64) -> f64 {
    let fraction = x.rem_euclid(1.0);
    if fraction == 0.0 { 0.0 } else { fraction - 1.0 }
}

/// The sum of every pair's trapezoid: straight between the ends of the four ramps, folded into one period.
///
/// A pair begins at `first`, periods; it rises and falls over `2 ramp` and lasts `ratio` from middle to middle of its ramps.
fn trapezoid(first: f64, ratio: f64, ramp: f64, period: f64, phase: f64, level: impl Fn(f64) -> f64) -> Stiffness {
    let span = ratio + 2.0 * ramp;
    let mut corners = [0.0, 2.0 * ramp, ratio, span].map(|corner: f64| corner.rem_euclid(1.0));
    corners.sort_by(f64::total_cmp);
    let mut corners = corners.to_vec();
    corners.dedup_by(|a, b| (*a - *b).abs() < 1.0e-12);
    let pairs = |corner: f64| {
        // Position along the path of the latest pair to enter; the ones before it are whole pitches ahead.
        (0..=span.ceil() as u32)
            .map(|n| {
                let x = corner + f64::from(n);
                (x / (2.0 * ramp)).min((span - x) / (2.0 * ramp)).clamp(0.0, 1.0)
            })
            .sum::<f64>()
    };
    let pieces = (0..corners.len())
        .filter_map(|i| {
            let end = corners.get(i + 1).copied().unwrap_or(1.0);
            let width = end - corners[i];
            let (value, next) = (level(pairs(corners[i])), level(pairs(end.rem_euclid(1.0))));
            (width > 0.0).then(|| Piece { start: corners[i], value, slope: (next - value) / (width * period) })
        })
        .collect();
    Stiffness::Periodic { period, origin: past_origin(first - phase) * period, pieces }
}
