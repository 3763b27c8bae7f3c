//! Seeded random numbers (SplitMix64), rounded to four digits so that scenes read well.

use serde_json::{Value, json};

pub struct Random(u64);

impl Random {
    /// Scene number `index` of a class.
    pub fn new(seed: u64, class: &str, index: usize) -> Self {
        let class = class.bytes().fold(0_u64, |h, b| h.wrapping_mul(131).wrapping_add(u64::from(b)));
        let mut r =
            Self(seed ^ class.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (index as u64).wrapping_mul(0xd134_2543_de82_ef95));
        r.next();
        r
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `[0, 1)`.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// Evenly in a range.
    pub fn of(&mut self, low: f64, high: f64) -> f64 {
        round(low + (high - low) * self.unit())
    }

    /// Evenly in the logarithm.
    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        round(low * (high / low).powf(self.unit()))
    }

    /// A phase: a sine's or a cosine's as often as any.
    pub fn phase(&mut self) -> f64 {
        match self.below(4) {
            0 => 0.0,
            1 => std::f64::consts::FRAC_PI_2,
            _ => self.of(0.0, std::f64::consts::TAU),
        }
    }

    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }
}

/// To four digits.
pub fn round(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

pub fn scene(train: Value, initial: Value, end: f64) -> Value {
    json!({ "flank": 1, "train": train, "initial": initial, "run": { "t_end_s": round(end) } })
}
