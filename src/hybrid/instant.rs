//! Time as a pair: forcing cycle and phase.
//!
//! A double holds `t = 10⁹ T` only to about `10⁻⁷ T`; a phase in `[0, T)` is held to `10⁻¹⁶ T` at any
//! cycle. Roots are found, and forcing is evaluated, in the phase.

use std::ops::{Add, Mul, Sub};

/// A number as an unevaluated sum of two doubles, about 32 digits.
///
/// Only what time keeping needs: sums, differences and products (Dekker 1971, Knuth 1969). Ordered by `hi`, then `lo`.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Wide {
    /// Leading part: the double nearest to the number.
    pub hi: f64,
    /// Remainder, at most half a unit in the last place of `hi`.
    pub lo: f64,
}

/// An angle clearly below half a turn: it is what it is modulo a turn.
const HALF_TURN: f64 = 3.0;

/// `2²⁷ + 1`: what splits a double into halves.
const SPLIT: f64 = 134_217_729.0;

impl Wide {
    /// The exact sum of two doubles.
    #[must_use]
    pub fn sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        let bb = hi - a;
        Self { hi, lo: (a - (hi - bb)) + (b - bb) }
    }

    /// The exact product of two doubles.
    #[must_use]
    pub fn product(a: f64, b: f64) -> Self {
        let hi = a * b;
        if cfg!(any(target_feature = "fma", target_arch = "aarch64")) {
            return Self { hi, lo: a.mul_add(b, -hi) };
        }
        // Without the instruction a fused product is a call. Halves of 26 bits multiply exactly.
        let half = |x: f64| {
            let scaled = SPLIT * x;
            scaled - (scaled - x)
        };
        let (a_hi, b_hi) = (half(a), half(b));
        let (a_lo, b_lo) = (a - a_hi, b - b_hi);
        let lo = a_lo * b_lo - (((hi - a_hi * b_hi) - a_lo * b_hi) - a_hi * b_lo);
        // Above 1e300 the halves overflow.
        Self { hi, lo: if lo.is_finite() { lo } else { a.mul_add(b, -hi) } }
    }

    /// `a / b` to about 31 digits.
    #[must_use]
    pub fn quotient(a: Self, b: f64) -> Self {
        let q = a.hi / b;
        let r = a - Self::product(q, b);
        Self::sum(q, (r.hi + r.lo) / b)
    }

    /// Twice the circle constant.
    pub const TAU: Self = Self { hi: std::f64::consts::TAU, lo: 2.449_293_598_294_706_4e-16 };

    /// As the sum with a [`Wide`] number that is a double.
    #[must_use]
    #[inline]
    pub fn plus(self, b: f64) -> Self {
        let s = Self::sum(self.hi, b);
        Self::sum(s.hi, s.lo + self.lo)
    }

    /// The nearest double.
    #[must_use]
    pub fn value(self) -> f64 {
        self.hi + self.lo
    }
}

impl From<f64> for Wide {
    fn from(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }
}

impl Add for Wide {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let s = Self::sum(self.hi, o.hi);
        let t = Self::sum(self.lo, o.lo);
        let u = Self::sum(s.hi, s.lo + t.hi);
        Self::sum(u.hi, u.lo + t.lo)
    }
}

impl Sub for Wide {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + Self { hi: -o.hi, lo: -o.lo }
    }
}

impl Mul for Wide {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let p = Self::product(self.hi, o.hi);
        Self::sum(p.hi, self.hi * o.lo + (self.lo * o.hi + p.lo))
    }
}

impl Mul<f64> for Wide {
    type Output = Self;
    fn mul(self, b: f64) -> Self {
        let p = Self::product(self.hi, b);
        Self::sum(p.hi, self.lo * b + p.lo)
    }
}

/// A moment: forcing cycle `n`, and phase `τ` in `[0, T)`, s, with its rounding remainder.
///
/// Where a system has no period, `cycle` is 0 and the phase is the time itself. Of two moments as one
/// [`Clock`] makes them, with the phase in its range, the later one is the larger.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Instant {
    /// Forcing cycle `n`.
    pub cycle: i64,
    /// Phase `τ`, s.
    pub phase: Wide,
}

/// The base period of a system's forcing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    omega: f64,
    period: Wide,
}

impl Clock {
    /// A clock of base frequency `omega`, rad/s; `None` or a non-positive number for a system without a period.
    #[must_use]
    pub fn new(omega: Option<f64>) -> Self {
        match omega {
            Some(w) if w > 0.0 && w.is_finite() => Self { omega: w, period: Wide::quotient(Wide::TAU, w) },
            _ => Self::default(),
        }
    }

    /// Base frequency, rad/s; 0 without a period.
    #[must_use]
    pub fn omega(&self) -> f64 {
        self.omega
    }

    /// Base period `T = 2π/ω`, s.
    #[must_use]
    pub fn period(&self) -> Option<Wide> {
        (self.omega > 0.0).then_some(self.period)
    }

    /// The instant at time `t`, s.
    #[must_use]
    pub fn instant(&self, t: f64) -> Instant {
        self.normalised(Instant { cycle: 0, phase: t.into() })
    }

    /// The instant at `phase` of cycle `cycle`.
    #[must_use]
    pub fn at(&self, cycle: i64, phase: f64) -> Instant {
        self.normalised(Instant { cycle, phase: phase.into() })
    }

    /// The instant `dt` seconds later (earlier if negative).
    #[must_use]
    pub fn advance(&self, at: Instant, dt: impl Into<Wide>) -> Instant {
        self.normalised(Instant { cycle: at.cycle, phase: at.phase + dt.into() })
    }

    /// As [`advance`](Self::advance), by a double, in place.
    #[inline]
    pub fn pass(&self, at: &mut Instant, dt: f64) {
        at.phase = at.phase.plus(dt);
        if !self.is_normal(at.phase) {
            *at = self.carried(*at);
        }
    }

    /// As [`between`](Self::between), to a few units in the last place of the times.
    #[must_use]
    #[inline]
    pub fn roughly(&self, earlier: Instant, later: Instant) -> f64 {
        (later.cycle - earlier.cycle) as f64 * self.period.hi + (later.phase.hi - earlier.phase.hi)
    }

    #[inline]
    fn normalised(&self, at: Instant) -> Instant {
        if self.is_normal(at.phase) { at } else { self.carried(at) }
    }

    /// Whether a phase is in [0, T) as it is, and clear of both ends. Most often it is.
    #[inline]
    fn is_normal(&self, phase: Wide) -> bool {
        phase.hi > 0.0 && phase.hi < self.period.hi * (1.0 - f64::EPSILON)
    }

    /// Puts a phase that has left [0, T), or is at its ends, into it.
    fn carried(&self, mut at: Instant) -> Instant {
        if self.omega > 0.0 {
            let t = self.period;
            let turns = (at.phase.hi / t.hi).floor();
            if turns != 0.0 {
                // One turn is the usual case, and a product by one is the period itself.
                at.phase = at.phase - if turns == 1.0 { t } else { t * turns };
                at.cycle += turns as i64;
            }
            // The floor of a rounded quotient can be one off: put the phase into [0, T).
            if at.phase.hi < 0.0 || (at.phase.hi == 0.0 && at.phase.lo < 0.0) {
                at.phase = at.phase + t;
                at.cycle -= 1;
            }
            let over = at.phase - t;
            if over.hi > 0.0 || (over.hi == 0.0 && over.lo >= 0.0) {
                at.phase = over;
                at.cycle += 1;
            }
        }
        at
    }

    /// Time `t = n T + τ`, s, to 32 digits.
    #[must_use]
    pub fn time(&self, at: Instant) -> Wide {
        if at.cycle == 0 {
            return at.phase;
        }
        // OK to convert: cycles beyond 2⁵³ would need more than 10⁷ years of mesh cycles.
        self.period * at.cycle as f64 + at.phase
    }

    /// `later − earlier`, s, rounded once.
    #[must_use]
    pub fn between(&self, earlier: Instant, later: Instant) -> f64 {
        let phases = later.phase - earlier.phase;
        match later.cycle - earlier.cycle {
            0 => phases.value(),
            // A product by one is the period itself, and a run to the end of its cycle asks for nothing else.
            1 => (self.period + phases).value(),
            cycles => (self.period * cycles as f64 + phases).value(),
        }
    }

    /// The angle `ω t` modulo a turn for an oscillator of frequency `omega`, rad.
    ///
    /// `order` is `Some(h)` where `ω = h ω₀`: the cycle number then drops out, and the angle depends on the phase alone.
    #[must_use]
    pub fn angle(&self, omega: f64, order: Option<u32>, at: Instant) -> f64 {
        if order.is_some() || at.cycle == 0 && at.phase.hi.abs() * omega < 64.0 {
            let a = at.phase * omega;
            if a.hi.abs() < HALF_TURN {
                return a.value();
            }
            let turns = (a.hi / Wide::TAU.hi).round();
            return if turns == 0.0 { a.value() } else { (a - Wide::TAU * turns).value() };
        }
        let a = self.time(at) * omega;
        let turns = (a.hi / Wide::TAU.hi).round();
        (a - Wide::TAU * turns).value()
    }

    /// Sine and cosine of [`angle`](Self::angle). In the period of an oscillator of the clock the part of the angle beyond a double turns
    /// them, and no turn is taken off.
    #[must_use]
    #[inline]
    pub fn sincos(&self, omega: f64, order: Option<u32>, at: Instant) -> (f64, f64) {
        if order.is_none() {
            return libm::sincos(self.angle(omega, order, at));
        }
        let angle = at.phase * omega;
        let (sine, cosine) = libm::sincos(angle.hi);
        (sine + angle.lo * cosine, cosine - angle.lo * sine)
    }
}
