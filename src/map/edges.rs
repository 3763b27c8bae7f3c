//! Measures of basins and of their boundary, row by row of the plane.

use serde::Serialize;

use super::tally::shown_steps;

/// Strips of rows; one at a time is left out for standard errors (the jackknife of Quenouille and Tukey).
const STRIPS: usize = 10;
/// Starts of a box along each axis (Daza, Wagemakers, Georgeot, Guéry-Odelin and Sanjuán 2016).
const BOX: usize = 5;
/// Least number of uncertain starts for which a distance counts; distances go up to an eighth of the axis.
const LEAST: u64 = 50;
/// Least number of distances of a fit. It takes the smaller half of them: far apart two starts differ by chance, and `f` bends.
const FITTED: usize = 3;

/// Number and its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Measured {
    /// Number.
    pub value: f64,
    /// One standard error, from leaving out one of ten strips of the plane at a time; for an exponent including the bend of its fit.
    pub standard_error: f64,
}

/// Share of the starts that end in one way.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Fraction {
    /// Number of the attractor, or the word of another end.
    pub attractor: String,
    /// Their share.
    pub fraction: f64,
    /// One standard error of it, from strips.
    pub standard_error: f64,
}

/// Measures of basins.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Figures {
    /// Number of starts.
    pub starts: usize,
    /// Shares of the attractors in the order of their numbers, then of starts with an open end and of those that failed.
    pub fractions: Vec<Fraction>,
    /// Uncertainty exponent a. For small h, the share of starts with another end at distance h along the second axis is `f(h) ~ hᵃ`
    /// (McDonald, Grebogi, Ott and Yorke 1985). None if fewer than three distances have enough such starts.
    pub uncertainty_exponent: Option<Measured>,
    /// Dimension of the boundary, `2 − a`.
    pub boundary_dimension: Option<Measured>,
    /// Values `f(h)`, with h in steps of the second axis, of the starts with neighbours on both sides at each of these distances.
    pub uncertain: Vec<(usize, f64)>,
    /// Basin entropy: mean of `−Σ p ln p` over boxes of 5 × 5 starts without failures, p the shares of ends in a box (Daza et al. 2016).
    pub basin_entropy: Option<Measured>,
    /// Boundary entropy: the mean over the boxes with more than one end. Above ln 2 the boundary is fractal.
    pub boundary_entropy: Option<Measured>,
    /// True if the boundary entropy is above ln 2 by three standard errors: this suffices for a fractal boundary.
    pub is_fractal_by_entropy: bool,
}

/// Sums over one strip of rows.
#[derive(Clone, Debug, Default)]
struct Strip {
    counts: Vec<u64>,
    /// For each distance the number of starts with another end there, and of all.
    uncertain: Vec<[u64; 2]>,
    /// Sums of entropy and numbers of boxes: of all, and of those with more than one end.
    boxes: [(f64, u64); 2],
}

/// Counts from the rows.
#[derive(Clone, Debug)]
pub struct Boundary {
    counts: [usize; 2],
    attractors: usize,
    strips: Vec<Strip>,
    /// Ends of the last rows, at most those of a row of boxes.
    rows: Vec<Vec<u32>>,
    row: usize,
    steps: [usize; 2],
    /// End and cycles of the starts that a picture shows, the second axis fastest.
    shown: Vec<(u32, Option<u64>)>,
}

impl Boundary {
    pub(super) fn new(counts: [usize; 2], attractors: usize) -> Self {
        let distances = (0..).map(|j| 1usize << j).take_while(|h| 8 * h <= counts[1]).count();
        let strip = Strip { counts: vec![0; attractors + 2], uncertain: vec![[0; 2]; distances], ..Strip::default() };
        let steps = shown_steps(counts);
        Self {
            counts,
            attractors,
            strips: vec![strip; STRIPS],
            rows: vec![Vec::new()],
            row: 0,
            steps,
            shown: Vec::new(),
        }
    }

    /// Adds the next row of the table.
    pub(super) fn add(&mut self, row: &str) {
        let mut fields = row.split(',').skip(2);
        let end = match fields.next().unwrap_or_default() {
            "failed" => self.attractors + 1,
            word => word.parse().unwrap_or(self.attractors),
        };
        let cycles = fields.next().and_then(|word| word.parse().ok());
        let Some(line) = self.rows.last_mut() else { return };
        let at = line.len();
        line.push(end as u32);
        if self.row.is_multiple_of(self.steps[0]) && at.is_multiple_of(self.steps[1]) {
            self.shown.push((end as u32, cycles));
        }
        let failed = self.attractors + 1;
        let strip = &mut self.strips[self.row * STRIPS / self.counts[0]];
        strip.counts[end] += 1;
        if at + 1 < self.counts[1] {
            return;
        }
        let widest = (1usize << strip.uncertain.len()) / 2;
        for (j, [uncertain, all]) in strip.uncertain.iter_mut().enumerate() {
            let h = 1 << j;
            // Starts with a neighbour on both sides at every distance: none of the three has failed.
            for three in (widest..line.len() - widest).map(|i| [line[i - h], line[i], line[i + h]]) {
                if three.iter().all(|end| *end as usize != failed) {
                    *all += 1;
                    *uncertain += u64::from(three[0] != three[1] || three[2] != three[1]);
                }
            }
        }
        self.row += 1;
        if self.rows.len() == BOX {
            for first in (0..self.counts[1] + 1 - BOX.min(self.counts[1] + 1)).step_by(BOX) {
                let mut ends: Vec<u32> = self.rows.iter().flat_map(|row| &row[first..first + BOX]).copied().collect();
                ends.sort_unstable();
                if ends.last().is_some_and(|end| *end as usize == failed) {
                    continue;
                }
                let shares = ends.chunk_by(|a, b| a == b).map(|same| same.len() as f64 / (BOX * BOX) as f64);
                let entropy = shares.map(|p| -p * libm::log(p)).sum::<f64>();
                for (sum, boxes) in &mut strip.boxes[..1 + usize::from(entropy > 0.0)] {
                    *sum += entropy;
                    *boxes += 1;
                }
            }
            self.rows.clear();
        }
        self.rows.push(Vec::with_capacity(self.counts[1]));
    }

    /// Returns the starts along each axis that a picture shows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [0, 1].map(|i| self.counts[i].div_ceil(self.steps[i]))
    }

    /// Returns end (an attractor's number, then open, then failed) and cycles of these starts, the second axis fastest.
    #[must_use]
    pub fn shown(&self) -> &[(u32, Option<u64>)] {
        &self.shown
    }

    /// Returns the sum of the strips but one.
    fn without(&self, left_out: Option<usize>) -> Strip {
        let mut sum = Strip {
            counts: vec![0; self.attractors + 2],
            uncertain: vec![[0; 2]; self.strips[0].uncertain.len()],
            ..Strip::default()
        };
        for (_, strip) in self.strips.iter().enumerate().filter(|(i, _)| Some(*i) != left_out) {
            sum.counts.iter_mut().zip(&strip.counts).for_each(|(sum, count)| *sum += count);
            for (sum, strip) in sum.uncertain.iter_mut().zip(&strip.uncertain) {
                sum.iter_mut().zip(strip).for_each(|(sum, count)| *sum += count);
            }
            for (sum, strip) in sum.boxes.iter_mut().zip(&strip.boxes) {
                *sum = (sum.0 + strip.0, sum.1 + strip.1);
            }
        }
        sum
    }

    /// Returns a number of all strips, and its standard error.
    fn measured(&self, number: impl Fn(&Strip) -> Option<f64>) -> Option<Measured> {
        let value = number(&self.without(None))?;
        let parts: Vec<f64> = (0..STRIPS).filter_map(|strip| number(&self.without(Some(strip)))).collect();
        let mean = parts.iter().sum::<f64>() / parts.len() as f64;
        let spread = parts.iter().map(|part| (part - mean).powi(2)).sum::<f64>();
        let standard_error = (spread * (parts.len() as f64 - 1.0) / parts.len() as f64).sqrt();
        standard_error.is_finite().then_some(Measured { value, standard_error })
    }

    /// Returns the measures.
    #[must_use]
    pub(super) fn figures(&self) -> Figures {
        let starts: u64 = self.without(None).counts.iter().sum();
        let name = |i: usize| match i - self.attractors.min(i) {
            0 if i < self.attractors => i.to_string(),
            0 => "open".to_owned(),
            _ => "failed".to_owned(),
        };
        let fractions = (0..self.attractors + 2).map(|i| {
            let share = |strip: &Strip| Some(strip.counts[i] as f64 / strip.counts.iter().sum::<u64>() as f64);
            let Measured { value, standard_error } =
                self.measured(share).unwrap_or(Measured { value: 0.0, standard_error: 0.0 });
            Fraction { attractor: name(i), fraction: value, standard_error }
        });
        let bend = bend(&self.without(None));
        let exponent =
            self.measured(slope).map(|a| Measured { standard_error: libm::hypot(a.standard_error, bend), ..a });
        let mean = |of: usize| {
            move |strip: &Strip| (strip.boxes[of].1 > 0).then(|| strip.boxes[of].0 / strip.boxes[of].1 as f64)
        };
        // The error of one strip alone is unknown.
        let entropy = |of: usize| {
            let strips = self.strips.iter().filter(|strip| strip.boxes[of].1 > 0).count();
            self.measured(mean(of)).filter(|_| strips > 1)
        };
        let boundary_entropy = entropy(1);
        let all = self.without(None);
        let uncertain = all.uncertain.iter().enumerate().filter(|(_, [_, all])| *all > 0);
        Figures {
            starts: starts as usize,
            fractions: fractions.collect(),
            uncertainty_exponent: exponent,
            boundary_dimension: exponent.map(|a| Measured { value: 2.0 - a.value, ..a }),
            uncertain: uncertain.map(|(j, [some, all])| (1 << j, *some as f64 / *all as f64)).collect(),
            basin_entropy: entropy(0),
            boundary_entropy,
            is_fractal_by_entropy: boundary_entropy
                .is_some_and(|s| s.value - 3.0 * s.standard_error > std::f64::consts::LN_2),
        }
    }
}

/// Returns `[ln h, ln f]` of the distances that are fitted.
fn fitted(strip: &Strip) -> Vec<[f64; 2]> {
    let counted = strip.uncertain.iter().enumerate().filter(|(_, [some, all])| *some >= LEAST && some < all);
    let mut points: Vec<[f64; 2]> = counted
        .map(|(j, [some, all])| [j as f64 * std::f64::consts::LN_2, libm::log(*some as f64 / *all as f64)])
        .collect();
    points.truncate(points.len().div_ceil(2).max(FITTED));
    points
}

/// Returns the slope of `ln f` over `ln h` by least squares.
fn slope(strip: &Strip) -> Option<f64> {
    let points = fitted(strip);
    if points.len() < FITTED {
        return None;
    }
    let mean = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
    let [xy, xx] = points
        .iter()
        .fold([0.0; 2], |[xy, xx], [x, y]| [xy + (x - mean[0]) * (y - mean[1]), xx + (x - mean[0]).powi(2)]);
    Some(xy / xx)
}

/// Returns the change of the slope from the first to the last two distances of the fit.
fn bend(strip: &Strip) -> f64 {
    let slopes: Vec<f64> =
        fitted(strip).windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).collect();
    slopes.first().zip(slopes.last()).map_or(0.0, |(first, last)| (last - first).abs())
}

#[cfg(test)]
#[path = "../../tests/unit/edges.rs"]
mod tests;
