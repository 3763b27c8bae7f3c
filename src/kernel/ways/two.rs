//! Numbers of two doubles, four side by side, in which propagators are formed. Operations, and their bits, are those of [`Wide`].

use crate::{hybrid::Wide, vectors::Path};

/// Four numbers of two doubles each.
pub struct Two<P: Path> {
    pub hi: P::Four,
    pub lo: P::Four,
}

impl<P: Path> Clone for Two<P> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<P: Path> Copy for Two<P> {}

/// Returns the exact sum.
#[inline(always)]
pub fn sum<P: Path>(path: P, a: P::Four, b: P::Four) -> Two<P> {
    let hi = path.plus(a, b);
    let bb = path.minus(hi, a);
    let lo = path.plus(path.minus(a, path.minus(hi, bb)), path.minus(b, bb));
    Two { hi, lo }
}

/// Returns the exact product.
#[inline(always)]
pub fn product<P: Path>(path: P, a: P::Four, b: P::Four) -> Two<P> {
    let hi = path.times(a, b);
    if P::IS_FUSED {
        return Two { hi, lo: path.fused(a, b, path.minus(path.all(-0.0), hi)) };
    }
    let (a, b, mut lo) = (path.numbers(a), path.numbers(b), [0.0; 4]);
    for l in 0..4 {
        lo[l] = Wide::product(a[l], b[l]).lo;
    }
    Two { hi, lo: path.four(lo) }
}

impl<P: Path> Two<P> {
    #[inline(always)]
    pub fn zero(path: P) -> Self {
        Self { hi: path.all(0.0), lo: path.all(0.0) }
    }

    #[inline(always)]
    pub fn plus(self, path: P, o: Self) -> Self {
        let (s, t) = (sum(path, self.hi, o.hi), sum(path, self.lo, o.lo));
        let u = sum(path, s.hi, path.plus(s.lo, t.hi));
        sum(path, u.hi, path.plus(u.lo, t.lo))
    }

    #[inline(always)]
    pub fn minus(self, path: P, o: Self) -> Self {
        let zero = path.all(-0.0);
        self.plus(path, Self { hi: path.minus(zero, o.hi), lo: path.minus(zero, o.lo) })
    }

    #[inline(always)]
    pub fn times(self, path: P, by: f64) -> Self {
        let by = path.all(by);
        let p = product(path, self.hi, by);
        sum(path, p.hi, path.plus(path.times(self.lo, by), p.lo))
    }

    #[inline(always)]
    pub fn by(self, path: P, factor: Wide) -> Self {
        let (hi, lo) = (path.all(factor.hi), path.all(factor.lo));
        let p = product(path, self.hi, hi);
        sum(path, p.hi, path.plus(path.times(self.hi, lo), path.plus(path.times(self.lo, hi), p.lo)))
    }

    /// Returns the numbers with `value` in `lane`.
    #[inline(always)]
    pub fn with(self, path: P, lane: usize, value: Wide) -> Self {
        let (mut hi, mut lo) = (path.numbers(self.hi), path.numbers(self.lo));
        (hi[lane], lo[lane]) = (value.hi, value.lo);
        Self { hi: path.four(hi), lo: path.four(lo) }
    }

    #[inline(always)]
    pub fn numbers(self, path: P) -> [Wide; 4] {
        let (hi, lo) = (path.numbers(self.hi), path.numbers(self.lo));
        std::array::from_fn(|l| Wide { hi: hi[l], lo: lo[l] })
    }
}
