//! Quadrature and inversion of the clock on one dense step.

use crate::integrate::DenseStep;

/// Nodes on `[0, 1]` and their weights.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quadrature {
    pub nodes: Vec<f64>,
    pub weights: Vec<f64>,
}

impl Quadrature {
    /// Gauss–Legendre: exact to degree `2n − 1`.
    pub fn gauss(n: usize) -> Self {
        let (mut nodes, mut weights) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for i in 0..n {
            // Tricomi's estimate of the root, then Newton on P_n by its recurrence.
            let mut x = -libm::cos(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5));
            let mut slope = 1.0;
            for _ in 0..8 {
                let (mut low, mut high) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (low, high) = (high, ((2.0 * k - 1.0) * x * high - (k - 1.0) * low) / k);
                }
                slope = n as f64 * (x * high - low) / (x * x - 1.0);
                x -= high / slope;
            }
            nodes.push(0.5 * (1.0 + x));
            weights.push(1.0 / ((1.0 - x * x) * slope * slope));
        }
        Self { nodes, weights }
    }
}

/// Returns the `θ` in `[0, until]` at which `elapsed` seconds of the step have passed; outside, the nearer end.
pub(super) fn theta_at(step: &dyn DenseStep, elapsed: f64, until: f64) -> f64 {
    if elapsed <= 0.0 {
        return 0.0;
    }
    if let Some(h) = step.plain_span() {
        return (elapsed / h).min(until);
    }
    let (mut low, mut high) = (0.0, until);
    if elapsed >= step.time(until) {
        return until;
    }
    let mut theta = 0.5 * until;
    for _ in 0..200 {
        let off = step.time(theta) - elapsed;
        if off > 0.0 {
            high = theta
        } else {
            low = theta
        }
        let newton = theta - off / step.rate(theta);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - theta).abs() <= f64::EPSILON * theta || high - low <= f64::EPSILON * high {
            return next;
        }
        theta = next;
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_integrates_powers() {
        let rule = Quadrature::gauss(16);
        for d in 0..=31 {
            let sum: f64 = rule.nodes.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(d)).sum();
            assert!((sum * f64::from(d + 1) - 1.0).abs() < 1e-14, "{d}: {sum}");
        }
    }
}
