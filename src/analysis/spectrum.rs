//! Amplitude spectra of evenly spaced samples.

use std::f64::consts::TAU;

use rustfft::{FftPlanner, num_complex::Complex};
use serde::Serialize;

/// Window function that weights the samples before the transform.
///
/// Amplitudes are divided by the window's mean, so that a line on a bin has its amplitude with every window. Over whole periods, sampled at
/// exact phases, `Rectangular` has no leakage; the others are for motions without a period. Coefficients: Harris, Proc. IEEE 66 (1978) 51;
/// flat top: Heinzel, Rüdiger & Schilling (2002), HFT70.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Window {
    /// No weighting: narrow lines, without side lobes if the samples cover whole periods.
    #[default]
    Rectangular,
    /// Lines two bins wide; a line between bins is up to 15 % too low.
    Hann,
    /// Four bins wide, side lobes below −92 dB, for weak lines beside strong ones.
    BlackmanHarris,
    /// Amplitudes exact to 0.1 % at any frequency; the widest lines.
    FlatTop,
}

impl Window {
    /// Returns the coefficients `c_k` of `w_i = Σ (−1)^k c_k cos(2π k i/n)`.
    fn coefficients(self) -> &'static [f64] {
        match self {
            Self::Rectangular => &[1.0],
            Self::Hann => &[0.5, 0.5],
            Self::BlackmanHarris => &[0.358_75, 0.488_29, 0.141_28, 0.011_68],
            Self::FlatTop => &[1.0, 1.907_96, 1.073_49, 0.181_99],
        }
    }

    /// Returns the number of bins on either side of a line on a bin that the window fills too.
    #[must_use]
    pub fn skirt(self) -> usize {
        self.coefficients().len() - 1
    }

    /// Returns the weight of sample `i` of `n`.
    #[must_use]
    pub fn weight(self, i: usize, n: usize) -> f64 {
        let turn = TAU * i as f64 / n as f64;
        let signs = [1.0, -1.0, 1.0, -1.0];
        self.coefficients().iter().zip(signs).enumerate().map(|(k, (c, s))| s * c * libm::cos(k as f64 * turn)).sum()
    }
}

/// One-sided amplitude spectrum: `x_i ≈ a_0 + Σ a_k cos(2π k i/n + φ_k)`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Spectrum {
    /// Distance of the bins, Hz (or orders, with samples per cycle).
    pub resolution: f64,
    /// Amplitudes `a_k`, k = 0 … n/2, in the samples' unit; `a_0` is the mean with its sign.
    pub amplitude: Vec<f64>,
    /// Phases `φ_k`, rad.
    pub phase: Vec<f64>,
    /// The window.
    pub window: Window,
}

impl Spectrum {
    /// Returns the spectrum of samples at `rate` samples a second (or a cycle). Empty samples give an empty spectrum.
    #[must_use]
    pub fn new(samples: &[f64], rate: f64, window: Window) -> Self {
        let n = samples.len();
        if n == 0 {
            return Self { resolution: rate, amplitude: Vec::new(), phase: Vec::new(), window };
        }
        let gain = window.coefficients()[0];
        // A windowed mean would leak into the lines beside it.
        let mean = samples.iter().sum::<f64>() / n as f64;
        let mut bins: Vec<Complex<f64>> = samples
            .iter()
            .enumerate()
            .map(|(i, x)| Complex::new((x - mean) * window.weight(i, n) / (gain * n as f64), 0.0))
            .collect();
        FftPlanner::new().plan_fft_forward(n).process(&mut bins);
        let half = n / 2;
        let single = |k: usize| if 2 * k == n { 1.0 } else { 2.0 };
        let mut amplitude: Vec<f64> = bins[..=half].iter().enumerate().map(|(k, b)| single(k) * b.norm()).collect();
        let mut phase: Vec<f64> = bins[..=half].iter().map(|b| b.arg()).collect();
        (amplitude[0], phase[0]) = (mean, 0.0);
        Self { resolution: rate / n as f64, amplitude, phase, window }
    }

    /// Returns the frequencies of the bins.
    #[must_use]
    pub fn frequencies(&self) -> Vec<f64> {
        (0..self.amplitude.len()).map(|k| k as f64 * self.resolution).collect()
    }

    /// Returns the amplitude at the bin nearest to `frequency`; 0 beyond the last one.
    #[must_use]
    pub fn at(&self, frequency: f64) -> f64 {
        let bin = (frequency / self.resolution).round();
        if bin >= 0.0 && bin < self.amplitude.len() as f64 { self.amplitude[bin as usize] } else { 0.0 }
    }

    /// Returns the bins whose amplitude is a maximum of at least `share` of the largest (without the mean), strongest first.
    #[must_use]
    pub fn lines(&self, share: f64) -> Vec<(f64, f64)> {
        let a = &self.amplitude;
        let floor = share * a.iter().skip(1).fold(0.0, |m: f64, v| m.max(*v));
        let is_peak = |k: usize| {
            a[k] >= floor && a[k] > 0.0 && (k == 1 || a[k] > a[k - 1]) && (k + 1 == a.len() || a[k] >= a[k + 1])
        };
        let mut found: Vec<(f64, f64)> =
            (1..a.len()).filter(|&k| is_peak(k)).map(|k| (k as f64 * self.resolution, a[k])).collect();
        found.sort_by(|l, r| r.1.total_cmp(&l.1));
        found
    }
}
