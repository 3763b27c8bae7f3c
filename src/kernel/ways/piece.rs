//! Piece of the motion under one closed power law, by collocation in its root clock.
//!
//! With penetration `p = y^q`, `dt = q y^(q−1) ds` and the piece `s = hθ`,
//!
//! ```text
//! dy/ds = v,   dt/ds = w,   dv/ds = f = w (A(t) − κ y^q − γ v − k y^P (1 + χ v)),   w = q y^(q−1)
//! ```
//!
//! f is a polynomial F of degree S − 1, by its values at S nodes, v and y are its integrals, t that of the interpolant of w. Picard
//! iteration brings F to f at the nodes. The rest is bounded, see `docs/THEORY.md`, section 10.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler unrolls

use super::nodes::{
    END, Ellipse, Fours, LANES, LEBESGUE, Nodes, ROUNDED, SUMMED, Values, antiderivative, coefficient, dot, fours,
    numbers, sizes, total, value,
};
use crate::vectors::Path;

/// Number of powers of time in the series of the drive of the contact.
pub const POWERS: usize = 16;
/// Longest piece, in radians of the fastest drive: the truncation of the series of the drive is below 2e-17 of the amplitude.
const SLOW: f64 = 0.6;
/// Largest permitted truncation of the series, relative to the amplitude.
pub const CUT: f64 = 2e-17;
/// Factor on the longest duration of a piece that continues at its first speed.
const LASTING: f64 = 1.1;
/// Number of sweeps after which the iteration has failed.
const SWEEPS: usize = 28;
/// Ratio by which F must settle between two sweeps of the time, which affects F through the drive alone.
const LATE: f64 = 1e-4;
/// Change of F, relative to its largest value, that is rounding.
const SETTLED: f64 = 16.0 * f64::EPSILON;
/// Half a unit in the last place.
const UNIT: f64 = 0.5 * f64::EPSILON;
/// Bound on the sum of the sizes of the factors of an integral, that of its ends included.
const SIZE: f64 = 2.5;
/// Number of coefficients of F that predict the next piece.
const CONTINUED: usize = 14;
/// Length of a piece times the rate of its motion: at the end of its ellipse, and at its start.
const LENGTHS: [f64; 2] = [1.7, 1.2];
/// Reach of the ellipse of a piece beyond it, in lengths; more for forces that rise more steeply.
const AROUND: [f64; 2] = [0.85, 0.03];
/// Factor on `y/−v`, at which y is zero at the first speed, for the length of a piece that may end the contact.
const BEYOND: f64 = 1.02;
/// Share of this length from which on a piece is extended to it.
const NEARLY: f64 = 0.7;
/// Share by which bounds on the motion are widened for its error.
const TUBE: f64 = 1e-6;
/// Defect of a piece, times its length and relative to the speed, below which a shorter one gains nothing.
const GOAL: f64 = 3e-14;

/// Parameters of a closed contact.
#[derive(Clone, Copy, Debug)]
pub struct Law {
    /// Numerator and denominator of the exponent.
    pub exponent: [u32; 2],
    /// `k`: the force over the effective mass of the contact is `k pⁿ (1 + χ ṗ)`.
    pub stiffness: f64,
    /// χ.
    pub hysteresis: f64,
    /// κ.
    pub spring: f64,
    /// γ.
    pub damping: f64,
    /// True if the body has a spring or a damper of its own.
    pub is_held: bool,
    /// q, as a real number.
    pub root: f64,
}

/// Drive of the contact, from the start of a piece on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Drive {
    /// Taylor coefficients of A, up to the number `len`.
    pub series: [f64; POWERS],
    pub len: usize,
    /// Sums of the sizes of all terms of A and of its rate.
    pub sizes: [f64; 2],
    /// Fastest frequency, rad/s.
    pub fastest: f64,
    /// Duration for which the series hold, s: their truncation is below [`CUT`] of the sizes.
    pub lasts: f64,
}

/// Coefficients of F on a piece, and the length of the piece.
#[derive(Clone, Copy, Debug)]
pub struct EarlierPiece {
    pub f: Values,
    pub h: f64,
}

/// Start of a piece.
#[derive(Clone, Copy, Debug)]
pub struct PieceStart {
    pub y: f64,
    pub v: f64,
    /// Bounds on the errors of y, of v and of the time so far.
    pub errors: [f64; 3],
}

/// Piece of the motion.
#[derive(Clone, Debug)]
pub struct Piece {
    pub h: f64,
    /// Chebyshev coefficients of F, and of y, v and the time since the start of the piece.
    pub f: Values,
    pub y: Values,
    pub v: Values,
    pub t: Values,
    /// Chebyshev coefficients of w.
    w: Values,
    /// Values of y, v and the time at the end.
    pub end: [f64; 3],
    /// Smallest and largest value of y and of v.
    pub range: [[f64; 2]; 2],
    /// Bounds on the errors of y, v and the time, on the whole piece where y is not negative.
    pub errors: [f64; 3],
}

#[inline(always)]
fn power(mut y: f64, mut n: u32) -> f64 {
    let mut product = 1.0;
    while n > 0 {
        product = if n % 2 == 1 { product * y } else { product };
        y *= y;
        n /= 2;
    }
    product
}

/// Exponents are small: products one by one are as short as squares.
#[inline(always)]
fn powers<P: Path>(path: P, y: &Fours<P>, n: u32) -> Fours<P> {
    let mut product = *y;
    if n == 0 {
        return [path.all(1.0); LANES / 4];
    }
    for _ in 1..n {
        for i in 0..LANES / 4 {
            product[i] = path.times(product[i], y[i]);
        }
    }
    product
}

impl Law {
    /// Returns w and f.
    #[inline(always)]
    fn forces<P: Path>(&self, path: P, drive: &[f64], [y, v, t]: [&Fours<P>; 3]) -> [Fours<P>; 2] {
        let mut w = powers(path, y, self.exponent[1] - 1);
        let force = powers(path, y, self.exponent[0]);
        let mut a = [path.all(drive[drive.len() - 1]); LANES / 4];
        for c in drive[..drive.len() - 1].iter().rev() {
            let c = path.all(*c);
            for i in 0..LANES / 4 {
                a[i] = path.fused(a[i], t[i], c);
            }
        }
        if self.is_held {
            let [spring, damping] = [path.all(-self.spring), path.all(-self.damping)];
            for i in 0..LANES / 4 {
                a[i] = path.fused(spring, path.times(w[i], y[i]), path.fused(damping, v[i], a[i]));
            }
        }
        let [root, stiffness] = [path.all(self.root), path.all(-self.stiffness)];
        let [one, chi] = [path.all(1.0), path.all(self.hysteresis)];
        for i in 0..LANES / 4 {
            w[i] = path.times(w[i], root);
            let factor = path.fused(chi, v[i], one);
            a[i] = path.times(w[i], path.fused(path.times(stiffness, force[i]), factor, a[i]));
        }
        [w, a]
    }

    /// Returns a bound on w, and on the sum of the sizes of the terms of f over w, for sizes of y, v and A.
    #[inline(always)]
    pub fn most(&self, y: f64, v: f64, a: f64) -> [f64; 2] {
        let [p, q] = self.exponent;
        let force = self.stiffness * power(y, p) * (1.0 + self.hysteresis * v);
        [self.root * power(y, q - 1), a + self.spring * power(y, q) + self.damping * v + force]
    }

    /// Returns the part of `−∂f/∂y` that is not negative while y and the force are not; `factor` is `1 + χ v`. Rest: `∂²p/∂y² (A + γ v)`.
    #[inline(always)]
    fn stiffening(&self, y: f64, factor: f64) -> f64 {
        let ([p, q], root) = (self.exponent, self.root);
        let own = self.stiffness * root * f64::from(p + q - 1) * power(y, p + q - 2) * factor;
        if self.spring == 0.0 { own } else { own + self.spring * root * (2.0 * root - 1.0) * power(y, 2 * q - 2) }
    }

    /// Returns `∂²p/∂y²`.
    #[inline(always)]
    fn curvature(&self, y: f64) -> f64 {
        let q = self.root;
        if self.exponent[1] < 2 { 0.0 } else { q * (q - 1.0) * power(y, self.exponent[1] - 2) }
    }

    /// Returns `p = y^q`.
    pub fn penetration(&self, y: f64) -> f64 {
        power(y, self.exponent[1])
    }

    /// Returns `y^P = pⁿ`.
    pub fn elastic(&self, y: f64) -> f64 {
        power(y, self.exponent[0])
    }

    /// Returns `p̈` at a penetration of `y^q`.
    pub fn acceleration(&self, y: f64, v: f64, a: f64) -> f64 {
        let [p, q] = self.exponent;
        a - self.spring * power(y, q) - self.damping * v - self.stiffness * power(y, p) * (1.0 + self.hysteresis * v)
    }

    /// Returns a bound on the error of `y^q` by the error `e` of y.
    pub fn penetration_error(&self, y: f64, e: f64) -> f64 {
        self.root * power(y.abs() + e, self.exponent[1] - 1) * e
    }

    /// Returns the longest duration of a piece of length `h`, s, unless it is driven faster than it starts.
    pub fn lasts(&self, start: &PieceStart, h: f64) -> f64 {
        LASTING * h * self.most(start.y + h * start.v.max(0.0), 0.0, 0.0)[0]
    }

    /// Returns the length of a piece from `start`, such that its rate λ, the root of `−∂f/∂y`, changes little on it and around it.
    pub fn length(&self, drive: &Drive, start: &PieceStart) -> f64 {
        let PieceStart { y, v, .. } = *start;
        let [p, q] = self.exponent;
        let m = p + q - 2;
        let factor = 1.0 + self.hysteresis * v.max(0.0);
        let rate = |y: f64| self.stiffening(y, factor) + self.curvature(y) * drive.sizes[0];
        let [far, near] = LENGTHS.map(|c| c * c);
        let around = AROUND[0] + AROUND[1] * f64::from(m);
        let reach = around * v.abs() + if v > 0.0 { v } else { 0.0 };
        let mut h = (near / rate(y)).sqrt();
        if h * reach > y {
            h = h.min(libm::pow(far / self.stiffening(reach, factor), 1.0 / f64::from(m + 2)));
        }
        // From above, Newton's method descends to the root of a convex function.
        for _ in 0..8 {
            let end = y + h * reach;
            let square = rate(end);
            let by = (h * h * square - far) / (h * square * (2.0 + h * reach * f64::from(m) / end));
            if by.is_nan() || by * f64::from(m + 2) <= 0.2 * h {
                break;
            }
            h -= by;
        }
        if v < 0.0 && h >= NEARLY * BEYOND * y / -v {
            h = BEYOND * y / -v;
        }
        // The clock runs fastest where y is largest.
        if drive.fastest > 0.0 {
            h = h.min(h * SLOW / (drive.fastest * self.lasts(start, h)));
        }
        h
    }
}

/// Returns the number of terms that a series needs over `angle` radians of its fastest frequency.
pub fn lasting(angle: f64) -> usize {
    let (mut len, mut term) = (1, angle);
    while term > CUT && len < POWERS {
        len += 1;
        term *= angle / len as f64;
    }
    len
}

/// Evaluates a polynomial by its first coefficients at `1 + ratio·2θ`.
#[inline(always)]
fn continued<P: Path>(path: P, f: &Values, ratio: f64, theta: &Values) -> Fours<P> {
    let (two, by) = (path.all(2.0), path.all(4.0 * ratio));
    let mut twice = fours(path, theta);
    let mut b = [path.all(coefficient(f, CONTINUED - 1)); LANES / 4];
    let mut before = [path.all(0.0); LANES / 4];
    for i in 0..LANES / 4 {
        twice[i] = path.plus(two, path.times(by, twice[i]));
    }
    for k in (1..CONTINUED - 1).rev() {
        let c = path.all(coefficient(f, k));
        for i in 0..LANES / 4 {
            let next = path.fused(twice[i], b[i], path.minus(c, before[i]));
            (before[i], b[i]) = (b[i], next);
        }
    }
    let (half, c) = (path.all(0.5), path.all(f[0]));
    for i in 0..LANES / 4 {
        b[i] = path.fused(path.times(half, twice[i]), b[i], path.minus(c, before[i]));
    }
    b
}

impl Piece {
    /// Returns whether it is known that y is positive, or that it falls once and stays negative.
    pub fn is_told(&self) -> bool {
        let [[low, _], [slowest, fastest]] = self.range;
        let end = self.end[0];
        slowest > 0.0 || (low > 0.0 && end > 0.0) || (fastest < 0.0 && end.abs() > self.errors[0])
    }

    /// Returns the piece of length `h` from `start`, after the piece `before`. `None` if the iteration does not settle, or the defect is
    /// large against the speed `scale`.
    #[inline(always)]
    pub fn new<P: Path>(
        path: P,
        law: &Law,
        drive: &Drive,
        start: &PieceStart,
        h: f64,
        before: Option<&EarlierPiece>,
        scale: f64,
    ) -> Option<Self> {
        let nodes = Nodes::table();
        let mut values = Sweep::new(path, start, h);
        if let Some(before) = before {
            values.f = continued(path, &before.f, h / before.h, &nodes.theta);
        }
        [values.v, values.y] = nodes.integrals(path, &values.f, h, [start.y, start.v]);
        let residual = values.settle(path, nodes, law, drive, start)?;
        let Sweep { f, w, y, v, t, .. } = &values;
        let [coefficients, clock] = nodes.coefficients(path, f, w);
        let velocity = antiderivative(&coefficients, h, start.v);
        let root = antiderivative(&velocity, h, start.y);
        let time = antiderivative(&clock, h, 0.0);
        let end = [numbers(path, y)[END], numbers(path, v)[END], numbers(path, t)[END]];
        let errors = [0.0; 3];
        let mut piece =
            Self { h, f: coefficients, y: root, v: velocity, t: time, w: clock, end, range: [[0.0; 2]; 2], errors };
        piece.ranges(path, start, scale);
        let rest = Rest { residual, apart: nodes.differences(path, [&coefficients, &clock], [f, w]) };
        piece.bound(path, nodes, (law, drive), start, &rest, scale)?;
        Some(piece)
    }

    /// Bounds y and v: a Chebyshev sum is between its first coefficient minus and plus the sizes of all others.
    #[inline(always)]
    fn ranges<P: Path>(&mut self, path: P, start: &PieceStart, scale: f64) {
        let [of_y, of_v] = [(&self.y, total(path, &self.y)), (&self.v, total(path, &self.v))].map(|(a, total)| {
            let around = ROUNDED * total - a[0].abs();
            [a[0] - around, a[0] + around]
        });
        let [low, high] = of_v;
        let v = [low - TUBE * scale, high + TUBE * scale];
        let y = if v[0] > 0.0 {
            [start.y, self.end[0]]
        } else if v[1] < 0.0 {
            [self.end[0], start.y]
        } else {
            of_y
        };
        let tube = TUBE * y[1];
        self.range = [[y[0] - tube, y[1] + tube], v];
    }

    /// Bounds the errors, from those at the start.
    #[inline(always)]
    fn bound<P: Path>(
        &mut self,
        path: P,
        nodes: &Nodes,
        (law, drive): (&Law, &Drive),
        start: &PieceStart,
        rest: &Rest,
        scale: f64,
    ) -> Option<()> {
        let h = self.h;
        // Difference of the polynomials of the coefficients from those of the values.
        let [f, w] = [total(path, &self.f), total(path, &self.w)];
        let apart = [LEBESGUE * (rest.apart[0] + SUMMED * f), LEBESGUE * (rest.apart[1] + SUMMED * w)];
        let [[low, high], [slowest, fastest]] = self.range;
        let (speed, time) = (fastest.max(-slowest), self.end[2]);
        let [w, terms] = law.most(high, speed, drive.sizes[0]);
        let (most_f, most_w) = (w * terms, w);
        // Rounding of sums over the nodes.
        let [ty, tv, tt] = [
            h * h * (SIZE * SUMMED * most_f + apart[0]) + 4.0 * UNIT * (high + h * speed),
            h * (SIZE * SUMMED * most_f + apart[0]) + 4.0 * UNIT * speed,
            h * (SIZE * SUMMED * most_w + apart[1]),
        ];
        let turn = law.curvature(high);
        let forced = turn * (drive.sizes[0] + law.damping * speed);
        let softest = law.stiffening(low.max(0.0), (1.0 + law.hysteresis * slowest).max(0.0)) - forced;
        let stiffest = law.stiffening(high, 1.0 + law.hysteresis * fastest) + forced;
        let [p, q] = law.exponent;
        let by_rate = law.damping + law.stiffness * law.hysteresis * power(high, p);
        let evaluated = UNIT * f64::from(p + q + 8) * w * terms;
        let felt = stiffest * ty + w * (by_rate * tv + drive.sizes[1] * tt);
        let [truncated, late] = self.truncated(path, nodes, law, drive, evaluated);
        let defect = truncated + apart[0] + LEBESGUE * (rest.residual + evaluated + felt) + w * CUT * drive.sizes[0];
        let late = late + apart[1] + LEBESGUE * (UNIT * f64::from(q + 2) * w + turn * ty);
        // In the norm √(mean e_y² + e_v²) the motion between two errors grows by the spread of −∂f/∂y alone.
        let mean = (0.5 * (stiffest + softest)).max(0.5 * stiffest);
        let (spread, root) = ((stiffest - mean).max(mean - softest), mean.sqrt());
        // eᶻ is at most (1 + z/2)/(1 − z/2).
        let half = 0.25 * h * spread / root;
        let growth = 1.001 * (1.0 + half) / (1.0 - half);
        let [y0, v0, t0] = start.errors;
        let by_time = w * drive.sizes[1];
        let share = growth * h * h * by_time * turn / root;
        let norm = (mean * y0 * y0 + v0 * v0).sqrt() + h * (defect + by_time * (t0 + h * late));
        let norm = growth * norm / (1.0 - share);
        let e_y = (norm / root).min(y0 + h * norm);
        let e_t = t0 + h * (turn * e_y + late);
        self.errors = [e_y + ty, norm + tv, e_t + tt + 2.0 * UNIT * time];
        let is_small = h * truncated <= GOAL * scale;
        let is_known = is_small
            && half < 0.5
            && low >= -high
            && share < 0.5
            && e_y + ty <= TUBE * high
            && norm + tv <= TUBE * scale
            && time <= drive.lasts;
        is_known.then_some(())
    }

    /// Returns the truncations of the interpolants of f and w.
    #[inline(always)]
    fn truncated<P: Path>(&self, path: P, nodes: &Nodes, law: &Law, drive: &Drive, small: f64) -> [f64; 2] {
        let [y, v, t] = [sizes(path, &self.y), sizes(path, &self.v), sizes(path, &self.t)];
        let mut best = [f64::INFINITY; 2];
        for Ellipse { powers, share } in &nodes.ellipses {
            let powers = fours(path, powers);
            let (y, v) = (dot(path, &y, &powers), dot(path, &v, &powers));
            let t = if drive.len > 1 { dot(path, &t, &powers) } else { 0.0 };
            let a = drive.series[..drive.len].iter().rev().fold(0.0, |sum, a| sum * t + a.abs());
            let [w, terms] = law.most(y, v, a);
            if share * w * terms < best[0] {
                best = [share * w * terms, if law.exponent[1] < 2 { 0.0 } else { share * w }];
            }
            if best[0] <= small {
                break;
            }
        }
        best
    }

    /// Returns y, v and the time at `θ`, each with its rounding.
    pub fn at(&self, theta: f64) -> [[f64; 2]; 3] {
        [&self.y, &self.v, &self.t].map(|row| {
            let rounded = (0..LANES).fold(0.0, |sum, k| sum + (k + 2) as f64 * coefficient(row, k).abs());
            [value(row, theta), 4.0 * UNIT * rounded]
        })
    }
}

/// Residuals of a piece at its nodes.
struct Rest {
    /// Bound on the difference between F and f.
    residual: f64,
    /// Bounds on the differences of F and w from the polynomials of their coefficients.
    apart: [f64; 2],
}

/// Values at the nodes while they are iterated.
struct Sweep<P: Path> {
    h: f64,
    f: Fours<P>,
    w: Fours<P>,
    y: Fours<P>,
    v: Fours<P>,
    t: Fours<P>,
}

impl<P: Path> Sweep<P> {
    #[inline(always)]
    fn new(path: P, start: &PieceStart, h: f64) -> Self {
        let zero = [path.all(0.0); LANES / 4];
        let [y, v] = [[path.all(start.y); LANES / 4], [path.all(start.v); LANES / 4]];
        Self { h, f: zero, w: zero, y, v, t: zero }
    }

    /// Iterates until F is f at the nodes, up to rounding. Returns the largest remaining difference.
    #[inline(always)]
    fn settle(&mut self, path: P, nodes: &Nodes, law: &Law, drive: &Drive, start: &PieceStart) -> Option<f64> {
        let series = &drive.series[..drive.len];
        let mut is_timed = drive.len == 1;
        let mut late = LATE * LATE;
        for _ in 0..SWEEPS {
            let [w, next] = law.forces(path, series, [&self.y, &self.v, &self.t]);
            self.w = w;
            let mut change = next;
            for i in 0..LANES / 4 {
                change[i] = path.minus(next[i], self.f[i]);
            }
            let [residual, size] = [dot(path, &change, &change), dot(path, &next, &next)];
            if residual <= SETTLED * SETTLED * size {
                let is_last = is_timed;
                self.t = nodes.integral(path, &self.w, self.h, 0.0);
                if is_last {
                    return Some(residual.sqrt());
                }
                // One more sweep with the time that belongs to y.
                is_timed = true;
                continue;
            }
            if residual.is_nan() {
                return None;
            }
            self.f = next;
            [self.v, self.y] = nodes.integrals(path, &self.f, self.h, [start.y, start.v]);
            is_timed = drive.len == 1;
            if !is_timed && residual <= late * size {
                self.t = nodes.integral(path, &self.w, self.h, 0.0);
                late *= LATE * LATE;
            }
        }
        None
    }
}
