//! Powers of series, coefficient by coefficient as their base becomes known.

use super::wide::{Wide, power, root, wide};

/// Coefficient k of a product.
pub fn product(a: &[Wide], b: &[Wide], k: usize) -> Wide {
    (0..=k).fold(wide(0.0), |s, i| s + a[i] * b[k - i])
}

/// Whole powers of one series, by products alone: right however small its first coefficient is.
pub struct Chain {
    /// `(m, a, b)`: power m is the product of entries a and b; entry 0 is the series itself.
    plan: Vec<(usize, usize, usize)>,
    pub series: Vec<Vec<Wide>>,
}

impl Chain {
    pub fn new(wanted: &[usize]) -> Self {
        let mut chain = Self { plan: vec![(1, 0, 0)], series: vec![Vec::new()] };
        wanted.iter().filter(|m| **m > 1).for_each(|m| {
            chain.reach(*m);
        });
        chain
    }

    fn find(&self, m: usize) -> Option<usize> {
        self.plan.iter().position(|(p, _, _)| *p == m)
    }

    fn reach(&mut self, m: usize) -> usize {
        if let Some(found) = self.find(m) {
            return found;
        }
        let (a, b) = if m.is_multiple_of(2) { (m / 2, m / 2) } else { (m - 1, 1) };
        let (a, b) = (self.reach(a), self.reach(b));
        self.plan.push((m, a, b));
        self.series.push(Vec::new());
        self.plan.len() - 1
    }

    /// The next coefficient of the series itself.
    pub fn push(&mut self, c: Wide) {
        let k = self.series[0].len();
        self.series[0].push(c);
        for i in 1..self.plan.len() {
            let (_, a, b) = self.plan[i];
            let next = product(&self.series[a], &self.series[b], k);
            self.series[i].push(next);
        }
    }

    /// Coefficient k of power m.
    pub fn get(&self, m: usize, k: usize) -> Wide {
        match m {
            0 => wide(if k == 0 { 1.0 } else { 0.0 }),
            _ => self.find(m).map_or(wide(0.0), |i| self.series[i][k]),
        }
    }
}

/// `x^(p/q)` of a series `x = s^m u`, `u₀ > 0`, m a multiple of q: `s^(mp/q) u^(p/q)`.
pub struct Root {
    pub p: usize,
    pub q: usize,
    /// Leading zeros m of the base.
    pub zeros: usize,
    pub series: Vec<Wide>,
}

impl Root {
    pub fn new(p: usize, q: usize, zeros: usize) -> Self {
        Self { p, q, zeros, series: Vec::new() }
    }

    /// The next coefficient; all of the base up to it is known.
    pub fn push(&mut self, base: &[Wide]) {
        let k = self.series.len();
        let shift = self.zeros * self.p / self.q;
        let next = if k < shift {
            wide(0.0)
        } else if k == shift {
            power(root(base[self.zeros], self.q), self.p)
        } else {
            let (k, u, f) = (k - shift, &base[self.zeros..], &self.series[shift..]);
            let (p, q) = (self.p as f64, self.q as f64);
            let sum = (1..=k).fold(wide(0.0), |s, i| s + wide(p * i as f64 - q * (k - i) as f64) * u[i] * f[k - i]);
            sum / (wide(q * k as f64) * u[0])
        };
        self.series.push(next);
    }
}
