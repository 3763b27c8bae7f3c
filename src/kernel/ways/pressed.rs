//! Motion under a single closed power law to its release or to the bound, piece by piece: `docs/EVENTS.md`, line 39.
//!
//! It covers trains of one degree of freedom with one contact. The series of the mode cover all special cases: a start at rest on the
//! flank, a force that falls through zero inside the zone, a release near the bound.

use smallvec::SmallVec;

use super::{
    nodes,
    piece::{Drive, EarlierPiece, Law, POWERS, Piece, PieceStart, lasting},
};
use crate::{
    hybrid::{GuardValue, JetRequest, Leap, Passage},
    kernel::{
        Motion, ROUNDING,
        series::start::{ContactStart, SpanStart},
    },
    system::{Force, Structure, Watch, Wave, guard_id},
    vectors::Path,
};

/// Maximum number of frequencies of loads and errors.
const FREQUENCIES: usize = 8;
/// Maximum number of pieces of a leap.
const PIECES: usize = 40;
/// Maximum number of trials of a piece, each at this share of the length before.
const TRIALS: usize = 4;
const SHORTER: f64 = 0.7;
/// Largest errors of a leap that counts as known: of its time relative to it, of y and v relative to their sizes.
const SHARP: f64 = 1e-11;
/// Least distance of a release from the bound, in its uncertainties.
const APART: f64 = 8.0;
/// Least distance of the factor `1 + χ ṗ` from zero, relative to its terms.
const PRESSED: f64 = 1e-6;
/// Maximum number of iterations of Newton's method.
const NEWTON: usize = 24;
/// Length of the last step of the iteration, relative to the piece: its square is below rounding.
const SETTLED: f64 = 1e-9;

/// Equation of motion of the penetration of the contact: `p̈ = A(t) − κ p − γ ṗ − k pⁿ (1 + χ ṗ)`.
#[derive(Debug)]
pub struct Pressed {
    law: Law,
    /// Constant part of A.
    mean: f64,
    /// Frequency, cosine and sine part of A for each oscillator.
    waves: SmallVec<[[f64; 3]; FREQUENCIES]>,
    /// Reciprocal `1/g` of the direction of the contact.
    along: f64,
}

impl Pressed {
    /// Returns the equation of the contact of `motion`; `None` if the motion is not of this kind.
    pub fn new(motion: &Motion) -> Option<Self> {
        let s = motion.structure;
        let ([c], [part], [row], 1) = (&s.contacts[..], &motion.parts[..], &s.rows[..], s.n) else { return None };
        let Some(Force::Power { law, stiffness, .. }) = part.force().filter(|_| part.is_pressed()) else { return None };
        let entry = |of: fn(&(u32, f64, f64)) -> f64| row.iter().map(of).sum::<f64>();
        let (spring, damping) = (entry(|e| e.1), entry(|e| e.2));
        let few = s.oscillators.len() <= FREQUENCIES && !s.is_conservative;
        let g = c.direction.first()?.1;
        let side = part.side;
        let mut waves: SmallVec<[[f64; 3]; FREQUENCIES]> = s.oscillators.iter().map(|o| [o.omega, 0.0, 0.0]).collect();
        for load in &s.load_waves {
            waves[load.index][1] += side * g * load.cosine[0];
            waves[load.index][2] += side * g * load.sine[0];
        }
        for e in &c.error {
            let [omega, cosine, sine] = &mut waves[e.index];
            let (w, inertia) = (*omega, *omega * *omega - spring);
            *cosine += side * (inertia * e.cosine - damping * w * e.sine);
            *sine += side * (inertia * e.sine + damping * w * e.cosine);
        }
        let mean = side * (g * s.load[0] - spring * c.spec.error_offset) - spring * c.gap();
        let exponent = [law.exponent.p, law.exponent.q];
        let law = Law {
            exponent,
            stiffness: stiffness * c.mobility,
            hysteresis: 0.0,
            spring,
            damping,
            is_held: spring != 0.0 || damping != 0.0,
            root: f64::from(law.exponent.q),
        };
        let is_usual = few && spring >= 0.0 && damping >= 0.0 && law.stiffness > 0.0 && g != 0.0;
        is_usual.then_some(Self { law, mean, waves, along: g.recip() })
    }

    /// Returns the drive of the contact without the series of A.
    fn drive(&self) -> Drive {
        let sizes = self.waves.iter().fold([self.mean.abs(), 0.0], |[a, rate], [omega, cosine, sine]| {
            let size = libm::hypot(*cosine, *sine);
            [a + size, rate + omega * size]
        });
        let moving = self.waves.iter().filter(|[_, cosine, sine]| *cosine != 0.0 || *sine != 0.0);
        let fastest = moving.fold(0.0, |m: f64, [omega, ..]| m.max(*omega));
        Drive { sizes, fastest, ..Drive::default() }
    }

    /// Forms the series of A for a piece of at most `lasts` seconds; the oscillators are at `phases`.
    fn expand(&self, drive: &mut Drive, phases: &[[f64; 2]], lasts: f64) {
        drive.len = lasting(drive.fastest * lasts);
        drive.lasts = lasts;
        drive.series = [0.0; POWERS];
        drive.series[0] = self.mean;
        for ([omega, a, b], [cosine, sine]) in self.waves.iter().zip(phases) {
            // Value and rate over ω; the next two are their negatives.
            let mut turn = [a * cosine + b * sine, b * cosine - a * sine];
            let mut factor = 1.0;
            for (k, c) in drive.series[..drive.len].iter_mut().enumerate() {
                *c += factor * turn[0];
                factor *= omega / (k + 1) as f64;
                turn = [turn[1], -turn[0]];
            }
        }
    }

    /// Advances the oscillators by `time` seconds.
    fn turn(&self, phases: &mut [[f64; 2]], time: f64) {
        for ([omega, ..], [cosine, sine]) in self.waves.iter().zip(phases) {
            let (s, c) = libm::sincos(omega * time);
            (*cosine, *sine) = (*cosine * c - *sine * s, *sine * c + *cosine * s);
        }
    }
}

/// Motion under a closed law in progress.
struct PressedMotion {
    law: Law,
    /// Longest duration, s.
    span: f64,
    /// Time elapsed so far, s.
    time: f64,
    at: PieceStart,
    /// Size of the speed.
    scale: f64,
    /// Largest y and v so far.
    most: [f64; 2],
}

/// End of a leap.
struct PressedEnd {
    y: f64,
    v: f64,
    /// Time from the start of the leap, s.
    time: f64,
    errors: [f64; 3],
    falls: bool,
    is_bound: bool,
}

/// Returns the place where `value` is `wanted`, by Newton's method from `theta`; `None` if it does not settle.
fn solve(mut theta: f64, wanted: f64, value: impl Fn(f64) -> f64, rate: impl Fn(f64) -> f64) -> Option<f64> {
    for _ in 0..NEWTON {
        let by = (value(theta) - wanted) / rate(theta);
        theta = (theta - by).clamp(0.0, 1.0);
        if by.abs() <= SETTLED {
            return Some(theta);
        }
    }
    None
}

impl PressedMotion {
    fn new(law: Law, at: PieceStart, span: f64) -> Self {
        let n = f64::from(law.exponent[0]) / law.root;
        let stored = 2.0 * law.stiffness / (n + 1.0) * law.penetration(at.y) * law.elastic(at.y);
        let scale = (at.v * at.v + stored).sqrt();
        Self { law, span, time: 0.0, at, scale, most: [at.y, at.v.abs()] }
    }

    /// Returns the next piece; `None` if its signs do not decide its events.
    #[inline(always)]
    fn piece<P: Path>(
        &mut self,
        path: P,
        pressed: &Pressed,
        drive: &mut Drive,
        phases: &[[f64; 2]],
        before: Option<&EarlierPiece>,
    ) -> Option<Piece> {
        let Self { law, at, scale, .. } = self;
        let mut h = law.length(drive, at);
        for _ in 0..TRIALS {
            pressed.expand(drive, phases, law.lasts(at, h));
            let piece = Piece::new(path, law, drive, at, h, before, *scale);
            if let Some(piece) = piece.filter(Piece::is_told) {
                let [[_, high], [slowest, fastest]] = piece.range;
                let speed = fastest.abs().max(slowest.abs());
                let is_pressed = 1.0 + law.hysteresis * slowest > PRESSED * (1.0 + law.hysteresis * speed);
                self.most = [self.most[0].max(high), self.most[1].max(speed)];
                return is_pressed.then_some(piece);
            }
            h *= SHORTER;
        }
        None
    }

    /// Returns the end of the motion on this piece; `None` if it is not decided.
    fn end(&self, piece: &Piece) -> Option<PressedEnd> {
        let w = |y: f64| self.law.most(y, 0.0, 0.0)[0];
        let y_at = |theta: f64| nodes::value(&piece.y, theta);
        let here = |theta: f64| {
            let [y, v, t] = piece.at(theta);
            let [e_y, e_v, e_t] = piece.errors;
            (y[0], v[0], self.time + t[0], [e_y + y[1], e_v + v[1], e_t + t[1]])
        };
        if piece.end[0] < 0.0 {
            let [y, v, _] = piece.end;
            let rate = |theta: f64| piece.h * nodes::value(&piece.v, theta);
            let (y, v, t, [e_y, e_v, e_t]) = here(solve(1.0 - y / (piece.h * v), 0.0, y_at, rate)?);
            // Uncertainty of y at its zero, and the corresponding time.
            let off = e_y + y.abs();
            let errors = [e_y, e_v, e_t + w(off) * off / -v];
            let width = APART * errors[2];
            if t + width < self.span {
                return self.known(PressedEnd { y: 0.0, v, time: t, errors, falls: true, is_bound: false });
            }
            if t - width < self.span {
                return None;
            }
        }
        // The clock stands still at a start with y = 0.
        let wanted = self.span - self.time;
        if self.at.y == 0.0 || wanted <= 0.0 {
            return None;
        }
        let t_at = |theta: f64| nodes::value(&piece.t, theta);
        let theta = solve((wanted / piece.end[2]).min(1.0), wanted, t_at, |theta| piece.h * w(y_at(theta)))?;
        let (y, v, _, errors) = here(theta);
        self.known(PressedEnd { y, v, time: self.span, errors, falls: false, is_bound: true }).filter(|_| y > 0.0)
    }

    /// Returns the end if its errors are small.
    fn known(&self, end: PressedEnd) -> Option<PressedEnd> {
        let [e_y, e_v, e_t] = end.errors;
        (e_y <= SHARP * self.most[0] && e_v <= SHARP * self.scale && e_t <= SHARP * end.time).then_some(end)
    }
}

impl Pressed {
    /// Advances `way`, the oscillators at `phases`, up to the release or to the bound. Returns `None` if that is not decided.
    #[inline(always)]
    fn pass<P: Path>(&self, path: P, way: &mut PressedMotion, phases: &mut [[f64; 2]]) -> Option<PressedEnd> {
        let mut drive = self.drive();
        let mut before: Option<EarlierPiece> = None;
        for _ in 0..PIECES {
            let piece = way.piece(path, self, &mut drive, phases, before.as_ref())?;
            let [y, v, t] = piece.end;
            if y < 0.0 || way.time + t >= way.span {
                return way.end(&piece);
            }
            self.turn(phases, t);
            way.time += t;
            way.at = PieceStart { y, v, errors: piece.errors };
            before = Some(EarlierPiece { f: piece.f, h: piece.h });
        }
        let PieceStart { y, v, errors } = way.at;
        way.known(PressedEnd { y, v, time: way.time, errors, falls: false, is_bound: false })
    }

    /// Advances from `request` to the release, to the bound or as far as pieces reach. Returns `false` if the series have to decide.
    #[inline(always)]
    pub fn leap<P: Path>(&self, path: P, motion: &Motion, request: &JetRequest<'_>, leap: &mut Leap) -> bool {
        let (s, x) = (motion.structure, request.x);
        let (c, part) = (&s.contacts[0], &motion.parts[0]);
        let side = part.side;
        let flank = guard_id(0, if side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank });
        let is_on_flank = request.pinned.contains(flank);
        if request.pinned.contains(guard_id(0, Watch::Force)) {
            return false;
        }
        let mut phases: SmallVec<[[f64; 2]; FREQUENCIES]> = SmallVec::new();
        s.oscillate(request.at, |_, cosine, sine| phases.push([cosine, sine]));
        let [e, de] = errors(s, &phases);
        let [deflection, rate] = [x[0] / self.along - e, x[1] / self.along - de];
        let size = s.deflection_size(c, x);
        let start = ContactStart::new(motion, &SpanStart::new(request, 0, size), 0, deflection, || rate);
        let (p, error, v) = (side * start.stretch, start.error, side * rate);
        if !is_on_flank && p <= error || is_on_flank && v <= 0.0 {
            return false;
        }
        let y = if is_on_flank { 0.0 } else { libm::pow(p, self.law.root.recip()) };
        let Some(chi) = part.force().map(|force| force.chi(x)) else { return false };
        let law = Law { hysteresis: chi, ..self.law };
        // The error of the penetration follows from that of its root, plus rounding.
        let w = law.most(y, 0.0, 0.0)[0];
        let off = if is_on_flank { 0.0 } else { error / w + 2.0 * f64::EPSILON * y };
        let a =
            self.waves.iter().zip(&phases).fold(self.mean, |a, ([_, c, s], [cosine, sine])| a + c * cosine + s * sine);
        let first = law.acceleration(y, v, a);
        let mut way = PressedMotion::new(law, PieceStart { y, v, errors: [off, 0.0, 0.0] }, request.span);
        let mut turned = phases.clone();
        let Some(end) = self.pass(path, &mut way, &mut turned) else { return false };
        self.turn(&mut phases, end.time);
        let [e1, de1] = errors(s, &phases);
        let [depth, deepest] = [end.y, way.most[0]].map(|y| law.penetration(y));
        leap.x.clear();
        leap.x.extend_from_slice(x);
        leap.x[0] = (side * (depth + c.gap()) + e1) * self.along;
        leap.x[1] = (side * end.v + de1) * self.along;
        leap.sizes.clear();
        leap.sizes.extend(leap.x.iter().zip(x).map(|(a, b)| a.abs().max(b.abs())));
        leap.sizes[0] = leap.sizes[0].max((deepest + c.gap() + c.error_sizes[0]) * self.along.abs());
        leap.sizes[1] = leap.sizes[1].max((way.most[1] + c.error_sizes[1]) * self.along.abs());
        leap.time = end.time;
        leap.is_bound = end.is_bound;
        leap.passage = end.falls.then(|| Passage {
            zeros: if is_on_flank { 3 } else { 0 },
            curvature: 0.0,
            guard: flank,
            residual: 0.0,
            slope: end.v,
            error: end.errors[2] * end.v.abs(),
        });
        let rate_size = s.rate_size(c, x);
        let known = |watch: Watch, p: f64, v: f64, errors: [f64; 2], rates: [f64; 2]| {
            let of_force = watch == Watch::Force;
            let (value, error) = if of_force { (1.0 + chi * v, errors[1]) } else { (p, errors[0]) };
            // Only rigid flanks need the third derivative.
            let derivatives = if of_force { [chi * rates[1], 0.0, 0.0] } else { [rates[0], rates[1], 0.0] };
            GuardValue { guard: guard_id(0, watch), value, error, terms: value.abs(), derivatives }
        };
        leap.starts.clear();
        let errors = [ROUNDING * size, ROUNDING * (1.0 + chi * rate_size)];
        leap.starts.extend(motion.guards.iter().map(|g| known(g.watch, p, v, errors, [v, first])));
        leap.ends.clear();
        leap.carried.clear();
        if !end.falls {
            let errors = [law.penetration_error(end.y, end.errors[0]), chi * end.errors[1]];
            leap.ends.extend(motion.guards.iter().map(|g| known(g.watch, depth, end.v, errors, [0.0; 2])));
            leap.carried.push(part.kept(side * depth, s.deflection_size(c, &leap.x)));
        }
        true
    }
}

/// Returns the error of the contact and its rate, with the oscillators at `phases`.
fn errors(s: &Structure, phases: &[[f64; 2]]) -> [f64; 2] {
    let c = &s.contacts[0];
    let sum = |waves: &[Wave]| {
        waves.iter().fold(0.0, |sum, w| sum + w.cosine * phases[w.index][0] + w.sine * phases[w.index][1])
    };
    [c.spec.error_offset + sum(&c.error), sum(&c.error_rate)]
}
