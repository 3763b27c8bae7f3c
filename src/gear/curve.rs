//! A periodic curve given by points: straight lines or a series of harmonics through them.
//!
//! Places are fractions x of the period. A series is `y = c₀ + Σ_k a_k cos(2πk x + φ_k)`, with `a_k e^{iφ_k} = 2 c_k`. Equally spaced
//! points have the coefficients of the discrete Fourier transform. Those of other points are the exact integrals `c_k = ∫ y e^{−2πikx} dx`
//! of the lines, or of the periodic cubic spline, through them. A function whose derivative of order m jumps by J at the places x has `c_k
//! = Σ J e^{−2πikx} / (2πik)^{m+1}`.

use std::f64::consts::TAU;

use rustfft::{FftPlanner, num_complex::Complex};

use super::{MeshHarmonic, Piece};

/// Size of a harmonic relative to the largest one, below which it is rounding.
const ROUNDING: f64 = 1e-12;
/// Number of harmonics without a choice of the user.
const USUAL: usize = 512;
/// Relative difference of distances of places that count as equal.
const EVEN: f64 = 1e-9;

/// Points of a curve over its period.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    places: Vec<f64>,
    values: Vec<f64>,
}

/// Functions through points that are not equally far apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveShape {
    /// Straight lines.
    Lines,
    /// The periodic cubic spline, which has two continuous derivatives.
    Spline,
}

/// A series of harmonics for a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicSeries {
    /// Mean c₀.
    pub mean: f64,
    /// Harmonics as cosines; orders count in periods of the curve.
    pub harmonics: Vec<MeshHarmonic>,
    /// Largest and root mean square distance of the series from the points.
    pub residual: [f64; 2],
}

impl Curve {
    /// A curve through `values` at `places`.
    ///
    /// # Panics
    /// If there are fewer than two points, or the places do not rise within `[0, 1)`.
    #[must_use]
    pub fn new(places: Vec<f64>, values: Vec<f64>) -> Self {
        assert!(places.len() == values.len() && places.len() > 1, "points of a curve");
        assert!(places[0] >= 0.0 && places[places.len() - 1] < 1.0 && places.is_sorted_by(|a, b| a < b), "places");
        Self { places, values }
    }

    /// Returns the number of points.
    #[must_use]
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// Values at its points.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The curve with `factor` times the values.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { places: self.places.clone(), values: self.values.iter().map(|value| factor * value).collect() }
    }

    /// Mean of the straight lines through the points.
    #[must_use]
    pub fn mean(&self) -> f64 {
        (0..self.count()).map(|i| self.width(i) * 0.5 * (self.values[i] + self.values[self.next(i)])).sum()
    }

    /// Straight lines through the points, for a period in s. Consecutive constant lines of one value are merged.
    #[must_use]
    pub fn pieces(&self, period: f64) -> Vec<Piece> {
        let slope = |i: usize| (self.values[self.next(i)] - self.values[i]) / (self.width(i) * period);
        let piece = |i: usize| Piece { start: self.places[i], value: self.values[i], slope: slope(i) };
        let mut pieces: Vec<Piece> = (0..self.count()).map(piece).collect();
        pieces.dedup_by(|next, last| next.slope == 0.0 && last.slope == 0.0 && next.value == last.value);
        pieces
    }

    /// Series of the first `most` harmonics; without `most`, as many as the points determine.
    #[must_use]
    pub fn series(&self, most: Option<usize>, through: CurveShape) -> HarmonicSeries {
        let (n, largest) = (self.count(), self.count() / 2);
        let most = most.unwrap_or(USUAL).min(largest.max(1));
        let coefficients = if self.is_even() { self.transform(most) } else { self.integrals(most, through) };
        let (mean, rest) = (coefficients[0].re, &coefficients[1..]);
        let is_middle = |k: usize| n % 2 == 0 && k == largest && self.is_even();
        let amplitude = |k: usize, c: &Complex<f64>| {
            if is_middle(k) { libm::hypot(c.re, c.im) } else { 2.0 * libm::hypot(c.re, c.im) }
        };
        let rows = (1..).zip(rest).map(|(k, c)| MeshHarmonic {
            order: k as f64,
            amplitude: amplitude(k, c),
            phase: libm::atan2(c.im, c.re),
        });
        let mut harmonics: Vec<MeshHarmonic> = rows.collect();
        let peak = harmonics.iter().map(|h| h.amplitude).fold(0.0, f64::max);
        harmonics.retain(|h| h.amplitude > ROUNDING * peak.max(mean.abs()));
        let mean = if mean.abs() > ROUNDING * peak { mean } else { 0.0 };
        let at = |x: f64| harmonics.iter().fold(mean, |y, h| y + h.amplitude * libm::cos(TAU * h.order * x + h.phase));
        let gaps = self.places.iter().zip(&self.values).map(|(x, y)| (at(*x) - y).abs());
        let [most, squares] = gaps.fold([0.0_f64, 0.0], |[most, sum], gap| [most.max(gap), sum + gap * gap]);
        HarmonicSeries { mean, harmonics, residual: [most, (squares / n as f64).sqrt()] }
    }

    fn next(&self, i: usize) -> usize {
        (i + 1) % self.count()
    }

    /// Distance of point `i` to the next one.
    fn width(&self, i: usize) -> f64 {
        match self.places.get(i + 1) {
            Some(next) => next - self.places[i],
            None => 1.0 + self.places[0] - self.places[i],
        }
    }

    fn is_even(&self) -> bool {
        let width = 1.0 / self.count() as f64;
        self.places.iter().zip(0..).all(|(x, i)| (x - self.places[0] - width * f64::from(i)).abs() <= EVEN * width)
    }

    /// Coefficients up to order `most` of points that are equally far apart.
    fn transform(&self, most: usize) -> Vec<Complex<f64>> {
        let n = self.count();
        let mut line: Vec<Complex<f64>> = self.values.iter().map(|y| Complex::new(*y, 0.0)).collect();
        FftPlanner::new().plan_fft_forward(n).process(&mut line);
        let first = |k: usize| turned(-TAU * k as f64 * self.places[0]);
        (0..=most).map(|k| line[k % n] * first(k) / n as f64).collect()
    }

    /// Coefficients up to order `most` of a function through points anywhere.
    fn integrals(&self, most: usize, through: CurveShape) -> Vec<Complex<f64>> {
        let n = self.count();
        let rise = |of: &[f64], i: usize| (of[self.next(i)] - of[i]) / self.width(i);
        let (jumps_of, power, mean) = match through {
            CurveShape::Lines => (self.values.clone(), 2, self.mean()),
            CurveShape::Spline => {
                let curvature = self.curvature();
                let bow = |i: usize| self.width(i).powi(3) * (curvature[i] + curvature[self.next(i)]) / 24.0;
                let mean = self.mean() - (0..n).map(bow).sum::<f64>();
                (curvature, 4, mean)
            }
        };
        let jumps: Vec<f64> = (0..n).map(|i| rise(&jumps_of, i) - rise(&jumps_of, (i + n - 1) % n)).collect();
        let coefficient = |k: usize| {
            let omega = TAU * k as f64;
            let sum: Complex<f64> = self.places.iter().zip(&jumps).map(|(x, jump)| turned(-omega * x) * *jump).sum();
            // i² = −1 and i⁴ = 1.
            if power == 2 { -sum / omega.powi(2) } else { sum / omega.powi(4) }
        };
        std::iter::once(Complex::new(mean, 0.0)).chain((1..=most).map(coefficient)).collect()
    }

    /// Second derivatives of the periodic cubic spline at the points: with widths h and values y,
    /// `h_{i−1} M_{i−1} + 2 (h_{i−1} + h_i) M_i + h_i M_{i+1} = 6 (Δy_i/h_i − Δy_{i−1}/h_{i−1})`.
    fn curvature(&self) -> Vec<f64> {
        let n = self.count();
        let rise = |i: usize| (self.values[self.next(i)] - self.values[i]) / self.width(i);
        let right: Vec<f64> = (0..n).map(|i| 6.0 * (rise(i) - rise((i + n - 1) % n))).collect();
        let (before, after) = (|i: usize| self.width((i + n - 1) % n), |i: usize| self.width(i));
        if n == 2 {
            // Both neighbours of a point are the same point, and the curvatures are opposite.
            let m = right[0] / (before(0) + after(0));
            return vec![m, -m];
        }
        // Corners of the matrix as one more column, after Sherman and Morrison.
        let corner = before(0);
        let gamma = -2.0 * (before(0) + after(0));
        let mut diagonal: Vec<f64> = (0..n).map(|i| 2.0 * (before(i) + after(i))).collect();
        diagonal[0] -= gamma;
        diagonal[n - 1] -= corner * corner / gamma;
        let mut columns = [right, vec![0.0; n]];
        (columns[1][0], columns[1][n - 1]) = (gamma, corner);
        for i in 1..n {
            let factor = before(i) / diagonal[i - 1];
            diagonal[i] -= factor * after(i - 1);
            columns.iter_mut().for_each(|column| column[i] -= factor * column[i - 1]);
        }
        for column in &mut columns {
            column[n - 1] /= diagonal[n - 1];
            (0..n - 1).rev().for_each(|i| column[i] = (column[i] - after(i) * column[i + 1]) / diagonal[i]);
        }
        let [solution, other] = columns;
        let along = |column: &[f64]| column[0] + corner / gamma * column[n - 1];
        let share = along(&solution) / (1.0 + along(&other));
        solution.iter().zip(&other).map(|(x, z)| x - share * z).collect()
    }
}

/// `e^{i angle}`.
fn turned(angle: f64) -> Complex<f64> {
    let (sin, cos) = libm::sincos(angle);
    Complex::new(cos, sin)
}

#[cfg(test)]
#[path = "../../tests/unit/curve.rs"]
mod tests;
