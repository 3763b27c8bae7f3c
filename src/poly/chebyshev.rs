//! Interpolation on `[0, 1]` at Chebyshev points.

use std::sync::LazyLock;

/// Highest degree of an interpolant.
pub const DEGREE: usize = 16;
/// Number of coefficients of an interpolant.
const ROW: usize = DEGREE + 1;

/// Chebyshev points and the map from values there to coefficients of powers.
#[derive(Debug)]
pub(crate) struct Chebyshev {
    /// `T_k(2θ − 1)` in powers of θ.
    pub powers: [[f64; ROW]; ROW],
    /// `cos(π i/DEGREE)`.
    cosine: [f64; 2 * DEGREE],
}

/// The shared table.
pub(crate) static CHEBYSHEV: LazyLock<Chebyshev> = LazyLock::new(Chebyshev::new);

impl Chebyshev {
    fn new() -> Self {
        let mut powers = [[0.0; ROW]; ROW];
        powers[0][0] = 1.0;
        powers[1][0] = -1.0;
        powers[1][1] = 2.0;
        for k in 2..ROW {
            for m in 0..=k {
                let shifted = if m > 0 { 4.0 * powers[k - 1][m - 1] } else { 0.0 };
                powers[k][m] = shifted - 2.0 * powers[k - 1][m] - powers[k - 2][m];
            }
        }
        let cosine = std::array::from_fn(|i| libm::cos(std::f64::consts::PI * i as f64 / DEGREE as f64));
        Self { powers, cosine }
    }

    /// Returns the `i`-th of `n + 1` points, rising from 0 to 1.
    pub fn point(i: usize, n: usize) -> f64 {
        if i == n {
            return 1.0;
        }
        libm::sin(std::f64::consts::FRAC_PI_2 * i as f64 / n as f64).powi(2)
    }

    /// Computes Chebyshev coefficients from the `n + 1` values at the points, `n` a divisor of [`DEGREE`].
    pub fn coefficients(&self, values: &[f64], out: &mut [f64]) {
        let n = values.len() - 1;
        let stride = DEGREE / n;
        for (k, c) in out[..=n].iter_mut().enumerate() {
            let mut sum = 0.5 * (values[0] + if k % 2 == 0 { values[n] } else { -values[n] });
            for (i, f) in values.iter().enumerate().take(n).skip(1) {
                sum += f * self.cosine[stride * i * k % (2 * DEGREE)];
            }
            let sign = if k % 2 == 0 { 2.0 } else { -2.0 };
            *c = sign * sum / n as f64;
        }
        out[0] *= 0.5;
        out[n] *= 0.5;
    }

    /// Computes powers of θ, `[DEGREE + 1]`, from Chebyshev coefficients, the last first: the smallest are added before the others.
    pub fn to_powers(&self, coefficients: &[f64], series: &mut [f64]) {
        series.fill(0.0);
        for (c, powers) in coefficients.iter().zip(&self.powers).rev() {
            series.iter_mut().zip(powers).for_each(|(s, p)| *s += c * p);
        }
    }
}
