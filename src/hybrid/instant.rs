//! Time as a pair: forcing cycle and phase.
//!
//! A double holds `t = 10⁹ T` only to about `10⁻⁷ T`; a phase in `[0, T)` is held to `10⁻¹⁶ T` at any
//! cycle. Roots are found, and forcing is evaluated, in the phase.

use std::ops::{Add, Mul, Sub};

/// A number as an unevaluated sum of two doubles, about 32 digits.
///
/// It has only the sums, differences and products that time keeping needs (Dekker 1971, Knuth 1969). Ordered by `hi`, then `lo`.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Wide {
    /// Leading part: the double nearest to the number.
    pub hi: f64,
    /// Remainder, at most half a unit in the last place of `hi`.
    pub lo: f64,
}

/// Bound of an angle clearly below half a turn, rad: such an angle needs no reduction.
const HALF_TURN: f64 = 3.0;

/// `2²⁷ + 1`: factor that splits a double into halves.
const SPLIT: f64 = 134_217_729.0;

impl Wide {
    /// Returns the exact sum of two doubles.
    #[must_use]
    pub fn sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        let bb = hi - a;
        Self { hi, lo: (a - (hi - bb)) + (b - bb) }
    }

    /// Returns the exact product of two doubles.
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

    /// Returns `a / b` to about 31 digits.
    #[must_use]
    pub fn quotient(a: Self, b: f64) -> Self {
        let q = a.hi / b;
        let r = a - Self::product(q, b);
        Self::sum(q, (r.hi + r.lo) / b)
    }

    /// Twice the circle constant.
    pub const TAU: Self = Self { hi: std::f64::consts::TAU, lo: 2.449_293_598_294_706_4e-16 };

    /// Returns the sum with a double.
    #[must_use]
    #[inline]
    pub fn plus(self, b: f64) -> Self {
        let s = Self::sum(self.hi, b);
        Self::sum(s.hi, s.lo + self.lo)
    }

    /// Returns the nearest double.
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

/// Instant of time: forcing cycle `n`, and phase `τ` in `[0, T)`, s, with its rounding remainder.
///
/// Without a period, `cycle` is 0 and the phase is the time itself. Of two instants from one [`Clock`], with the phase in its range, the
/// later one is the larger.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Instant {
    /// Forcing cycle `n`.
    pub cycle: i64,
    /// Phase `τ`, s.
    pub phase: Wide,
}

impl Instant {
    /// Instant before all others.
    pub const FIRST: Self = Self { cycle: i64::MIN, phase: Wide { hi: 0.0, lo: 0.0 } };
    /// Instant after all others.
    pub const LAST: Self = Self { cycle: i64::MAX, phase: Wide { hi: 0.0, lo: 0.0 } };
}

/// Rounding of an instant relative to the time since the start.
const RESOLUTION: f64 = 4.0 * f64::EPSILON * f64::EPSILON;

/// The base period of a system's forcing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    omega: f64,
    period: Wide,
}

impl Clock {
    /// Returns a clock of base frequency `omega`, rad/s; `None` or a non-positive number for a system without a period.
    #[must_use]
    pub fn new(omega: Option<f64>) -> Self {
        match omega {
            Some(w) if w > 0.0 && w.is_finite() => Self { omega: w, period: Wide::quotient(Wide::TAU, w) },
            _ => Self::default(),
        }
    }

    /// Returns the base frequency, rad/s; 0 without a period.
    #[must_use]
    pub fn omega(&self) -> f64 {
        self.omega
    }

    /// Returns the base period `T = 2π/ω`, s.
    #[must_use]
    pub fn period(&self) -> Option<Wide> {
        (self.omega > 0.0).then_some(self.period)
    }

    /// Returns the instant at time `t`, s.
    #[must_use]
    pub fn instant(&self, t: f64) -> Instant {
        self.normalised(Instant { cycle: 0, phase: t.into() })
    }

    /// Returns the instant at `phase`, s, of cycle `cycle`.
    #[must_use]
    pub fn at(&self, cycle: i64, phase: f64) -> Instant {
        self.normalised(Instant { cycle, phase: phase.into() })
    }

    /// Returns the instant `dt` seconds later (earlier if negative).
    #[must_use]
    pub fn advance(&self, at: Instant, dt: impl Into<Wide>) -> Instant {
        self.normalised(Instant { cycle: at.cycle, phase: at.phase + dt.into() })
    }

    /// Advances `at` in place by a double, as [`advance`](Self::advance).
    #[inline]
    pub fn pass(&self, at: &mut Instant, dt: f64) {
        at.phase = at.phase.plus(dt);
        if !self.is_normal(at.phase) {
            *at = self.carried(*at);
        }
    }

    /// Returns `later − earlier`, s, as [`between`](Self::between), to a few units in the last place of the times.
    #[must_use]
    #[inline]
    pub fn roughly(&self, earlier: Instant, later: Instant) -> f64 {
        (later.cycle - earlier.cycle) as f64 * self.period.hi + (later.phase.hi - earlier.phase.hi)
    }

    #[inline]
    fn normalised(&self, at: Instant) -> Instant {
        if self.is_normal(at.phase) { at } else { self.carried(at) }
    }

    /// Returns whether a phase is in [0, T) and clear of both ends, or exactly zero, the usual cases.
    #[inline]
    fn is_normal(&self, phase: Wide) -> bool {
        phase.hi > 0.0 && phase.hi < self.period.hi * (1.0 - f64::EPSILON) || phase == Wide::default()
    }

    /// Moves a phase outside [0, T), or at its ends, into the range.
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

    /// Returns the time `t = n T + τ`, s, to 32 digits.
    #[must_use]
    pub fn time(&self, at: Instant) -> Wide {
        if at.cycle == 0 {
            return at.phase;
        }
        // OK to convert: cycles beyond 2⁵³ would need more than 10⁷ years of mesh cycles.
        self.period * at.cycle as f64 + at.phase
    }

    /// Returns `later − earlier`, s, rounded once.
    #[must_use]
    pub fn between(&self, earlier: Instant, later: Instant) -> f64 {
        let phases = later.phase - earlier.phase;
        match later.cycle - earlier.cycle {
            0 => phases.value(),
            // A product by one is the period itself, and runs to the end of a cycle need no other case.
            1 => (self.period + phases).value(),
            cycles => (self.period * cycles as f64 + phases).value(),
        }
    }

    /// Returns the resolution of an instant, s: instants are pairs of doubles.
    fn resolution(&self, at: Instant) -> f64 {
        RESOLUTION * self.roughly(Instant::default(), at).abs()
    }

    /// Returns whether the rest of an arc, `span` s from `at` on, is within a few roundings of its instants, and counts as no time.
    pub(crate) fn is_no_time(&self, at: Instant, span: f64) -> bool {
        span <= 4.0 * self.resolution(at)
    }

    /// Returns whether `time` s from `at` on is progress on the remaining `span`.
    pub(crate) fn is_progress(&self, at: Instant, time: f64, span: f64) -> bool {
        time > self.resolution(at).max(RESOLUTION * span) || time >= span
    }

    /// Returns the angle `ω t` modulo a turn for an oscillator of frequency `omega`, rad.
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

    /// Returns sine and cosine of [`angle`](Self::angle). For an oscillator with the period of the clock, no turn is subtracted. The part
    /// of the angle below the rounding of a double turns sine and cosine.
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
