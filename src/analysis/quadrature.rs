//! Quadrature and inversion of the clock on one dense step.

use crate::integrate::DenseStep;

/// Nodes on `[0, 1]` and their weights.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rule {
    pub nodes: Vec<f64>,
    pub weights: Vec<f64>,
}

impl Rule {
    /// Gauss–Legendre: exact to degree `2n − 1`.
    pub fn gauss(n: usize) -> Self {
        let (mut nodes, mut weights) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for i in 0..n {
            // Tricomi's estimate of the root, then Newton on P_n by its recurrence.
            let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
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

    /// Clenshaw–Curtis on `n + 1` nodes, `n` even; both ends are nodes.
    pub fn clenshaw_curtis(n: usize) -> Self {
        let angle = |i: usize| std::f64::consts::PI * i as f64 / n as f64;
        // (1 − cos)/2 = sin² of half the angle: no cancellation at the start.
        let nodes = (0..=n).map(|i| (0.5 * angle(i)).sin().powi(2)).collect();
        let weights = (0..=n)
            .map(|i| {
                let ends = if i == 0 || i == n { 1.0 } else { 2.0 };
                let sum: f64 = (1..=n / 2)
                    .map(|k| {
                        let b = if 2 * k == n { 1.0 } else { 2.0 };
                        b / (4.0 * (k * k) as f64 - 1.0) * (2.0 * k as f64 * angle(i)).cos()
                    })
                    .sum();
                0.5 * ends / n as f64 * (1.0 - sum)
            })
            .collect();
        Self { nodes, weights }
    }
}

/// The `θ` in `[0, until]` at which `elapsed` seconds of the step have passed; the nearer end outside.
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
    fn both_rules_integrate_powers() {
        for (rule, degree) in [(Rule::gauss(16), 31), (Rule::clenshaw_curtis(20), 20)] {
            for d in 0..=degree {
                let sum: f64 = rule.nodes.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(d)).sum();
                assert!((sum * f64::from(d + 1) - 1.0).abs() < 1e-14, "{d}: {sum}");
            }
        }
    }
}
