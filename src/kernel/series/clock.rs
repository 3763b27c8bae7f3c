//! Clock of a step while power laws are closed, and the contacts that leave together in it.

use crate::{
    gear::contact::PowerLaw,
    kernel::{Expansion, Force, Motion, ROUNDING, ROW, StepRows, product},
};

/// The clock of a step while power laws are closed, `dt = h w(θ) dθ`.
///
/// - Plain time, `w = 1`, where no contact is near its boundary.
/// - The root s of the time since contacts started, `t = s^root`, `w = root s^(root−1)`: a penetration that starts is `s^root β(s)`, and
///   its power is a series in s. The clock is a polynomial, so that products with it are short, and it is exact.
/// - The root y of the penetration of its owner, `p = y^root`, `w = root y^(root−1)`: it passes through the end of a contact.
#[derive(Clone, Copy, Debug)]
pub struct StepClock {
    /// Contact of whose penetration the clock is a root.
    pub owner: Option<usize>,
    /// Order of the root; 1 in plain time.
    pub root: u32,
    /// Value of the root s at the start of the step, without an owner.
    pub start: f64,
    /// Number of successive orders of which at least one has a term, if only the contact acts.
    pub window: usize,
    /// Longest duration of a step, s.
    pub span: f64,
    /// Time since contacts started, s; NaN if unknown.
    pub since: f64,
}

impl StepClock {
    /// Plain time, where no power law is closed.
    pub const TIME: Self = Self { owner: None, root: 1, start: 0.0, window: 2, span: f64::INFINITY, since: f64::NAN };

    /// Returns whether the clock is plain time.
    pub fn is_plain(&self) -> bool {
        self.root == 1
    }

    /// Returns whether the clock is a root of the penetration of contact `j`.
    pub fn is_root_of(&self, j: usize) -> bool {
        self.owner == Some(j) && self.root > 1
    }

    /// Returns the number of terms of the weight `w`.
    pub fn terms(&self) -> usize {
        if self.owner.is_some() && self.root > 1 { ROW } else { self.root as usize }
    }
}

/// Largest root of time. A series of order 24 in it has 24/root powers of time; above 6 the root of a penetration takes fewer steps.
const MOST: u32 = 6;

/// Returns the least common multiple of two roots, in which contacts of both start as series, or the larger root if it is above [`MOST`].
fn common(a: u32, b: u32) -> u32 {
    let least = (a..=MOST).step_by(a as usize).find(|m| m.is_multiple_of(b));
    least.unwrap_or(a.max(b))
}

/// Distance of a contact to its boundary, in usual spans, below which it is near.
const NEAR: f64 = 1.5;
/// Time since the start of a contact, in usual spans, from which it is no longer near.
const STARTED: f64 = 6.0;
/// Largest ratio of the time since a start to that to the nearest boundary at which the start counts as near. The start itself is at
/// `p/ṗ`, slightly less than the time since then.
const BEHIND: f64 = 2.0;
/// Relative difference of the times to their boundaries below which contacts are equally near.
const EQUAL: f64 = 1e-6;
/// Truncation of a power of the penetrations of contacts that leave together, relative to it: a tenth of that of a step.
const TOGETHER: f64 = 1e-17;
/// Length of a usual span, in radians of the stiffest mode by its bound.
const RADIANS: f64 = 2.5;
/// Length to which the clock of a step is scaled, in usual spans.
const LONGEST: f64 = 4.0;

impl Motion<'_> {
    /// Returns whether contact `j` leaves together with the `owner` of a root clock, which has a lower number: planets in phase do. In the
    /// root of one penetration alone, another one has a branch point beside its end. `p_jⁿ = pⁿ + n pⁿ⁻¹ d + …` with `d = p_j − p` has
    /// none, and the rest is at most `(4 d)ⁿ`. `x` is the state at the start of the step.
    pub fn goes_with(&self, owner: Option<usize>, j: usize, x: &[f64], rows: &StepRows) -> bool {
        let Some(i) = owner.filter(|i| *i < j) else { return false };
        let s = self.structure;
        let law = |j: usize| match self.parts[j].force() {
            Some(Force::Power { law, .. }) if self.parts[j].is_pressed() => Some(law.exponent),
            _ => None,
        };
        let (part, c) = (|j: usize| &self.parts[j], |j: usize| &s.contacts[j]);
        let [p, other] = [i, j].map(|j| part(j).side * rows.stretch(j));
        let [rate, other_rate] = [i, j].map(|j| part(j).side * rows.contacts[j].rate[0]);
        let size = s.deflection_size(c(i), x).max(s.deflection_size(c(j), x));
        let rate_size = s.rate_size(c(i), x).max(s.rate_size(c(j), x));
        let Some(exponent) = law(i).filter(|exponent| exponent.p < 2 * exponent.q && law(j) == Some(*exponent)) else {
            return false;
        };
        let share = 0.25 * libm::pow(TOGETHER, exponent.value().recip());
        (p - other).abs() <= share * p + ROUNDING * size
            && (rate - other_rate).abs() <= share * rate.abs() + ROUNDING * rate_size
    }
}

impl Expansion<'_> {
    /// Returns the clock of the step; `None` if all closed power laws leave at this instant.
    pub fn step_clock(&self, rows: &StepRows) -> Option<StepClock> {
        let (s, motion, request) = (self.s, self.motion, self.request);
        let mut nearest: Option<(f64, usize, PowerLaw)> = None;
        // Common root of the contacts that start here, with the first of them, and the root of all that have a root of time.
        let (mut starting, mut root, mut stiffness) = (None, 1, motion.growth.frequency().powi(2));
        for (j, part) in motion.parts.iter().enumerate().filter(|(_, part)| part.is_pressed()) {
            let Some(Force::Power { law, stiffness: k, .. }) = part.force() else { continue };
            let p = (part.side * rows.stretch(j)).max(0.0);
            let rate = part.side * self.rate(j, 0, &request.x[s.n..], rows);
            if p <= 0.0 && rate < 0.0 {
                // The contact leaves at this very instant; its clock would run backwards.
                continue;
            }
            // A penetration within its rounding counts as nearest, whatever the rate.
            let c = &s.contacts[j];
            let time = match p {
                _ if p <= 0.0 => 0.0,
                _ if p <= ROUNDING * rows.size(j) => f64::MIN_POSITIVE,
                _ => p / rate.abs(),
            };
            if p <= 0.0 && rate > 0.0 {
                let (together, first) = starting.unwrap_or((1, (j, law)));
                starting = Some((common(together, law.exponent.q), first));
            }
            root = if law.exponent.q <= MOST { root.max(law.exponent.q) } else { root };
            if p > 0.0 {
                stiffness += c.push_norm * c.across * k * law.exponent.value() * law.exponent.power(p) / p;
            }
            // Of equally near contacts, the first one.
            if nearest.is_none_or(|(t, ..)| time < (1.0 - EQUAL) * t) {
                nearest = Some((time, j, law));
            }
        }
        let (time, contact, law) = nearest?;
        let usual = RADIANS / stiffness.sqrt();
        let span = LONGEST * usual;
        let since =
            if starting.is_some() { 0.0 } else { request.carried.get(motion.parts.len()).copied().unwrap_or(f64::NAN) };
        let plain = StepClock { span, since, ..StepClock::TIME };
        let window = (law.exponent.p + root) as usize;
        if time == 0.0 {
            // With neither penetration nor speed a root clock stands still, and `p ~ t²` has its root already.
            let (owner, root, law) = match starting {
                Some((root, (first, law))) if root > MOST => (Some(first), law.exponent.q, law),
                Some((root, (_, law))) => (None, root, law),
                None => (None, 1, law),
            };
            return Some(StepClock { owner, root, window: (law.exponent.p + root) as usize, ..plain });
        }
        if root > 1 && since < STARTED * usual && since <= BEHIND * time {
            return Some(StepClock { root, start: libm::pow(since, f64::from(root).recip()), window, ..plain });
        }
        let owner = (time < NEAR * usual).then_some(contact);
        Some(if owner.is_some() { StepClock { owner, root: law.exponent.q, window, ..plain } } else { plain })
    }

    /// Returns a first guess of the span of the clock: it reaches the bound in time, or is longer than any step.
    pub fn clock_span(&self, clock: &StepClock, rows: &StepRows) -> f64 {
        let span = self.request.span.min(clock.span);
        let q = f64::from(clock.root);
        match clock.owner {
            _ if clock.is_plain() => span,
            Some(owner) => {
                let p = (self.motion.parts[owner].side * rows.stretch(owner)).max(0.0);
                let rate = self.rate(owner, 0, &self.request.x[self.s.n..], rows);
                // From the boundary: p = ṗ t and t = ṗ^(q−1) s^q. From inside: dt = q y^(q−1) ds.
                let from_boundary = libm::pow(span / libm::pow(rate.abs(), q - 1.0), 1.0 / q);
                let from_inside = span / (q * libm::pow(p, (q - 1.0) / q));
                from_boundary.min(from_inside).min(1e30)
            }
            None if clock.start == 0.0 => libm::pow(span, 1.0 / q),
            None => clock.start * libm::expm1(libm::log1p(span / libm::pow(clock.start, q)) / q),
        }
    }

    /// Writes the weight of a clock that depends on no contact, and y at the start of a clock that does.
    pub fn begin_clock(&self, clock: &StepClock, rows: &mut StepRows) {
        let q = clock.root as usize;
        if let Some(owner) = clock.owner.filter(|_| q > 1) {
            let p = (self.motion.parts[owner].side * rows.stretch(owner)).max(0.0);
            rows.clock.y_mut(1)[0] = libm::pow(p, 1.0 / f64::from(clock.root));
            return;
        }
        let weight = &mut rows.clock.weight;
        weight.fill(0.0);
        // q (s + hθ)^(q−1).
        let mut binomial = q as f64;
        for (i, w) in weight[..q].iter_mut().enumerate() {
            *w = binomial * clock.start.powi((q - 1 - i) as i32) * self.h.powi(i as i32);
            binomial *= (q - 1 - i) as f64 / (i + 1) as f64;
        }
    }

    /// Forms `y`, its powers and `w = q y^(q−1)` at order `k`, from the `rate` of the owner at the order before.
    pub fn clock_series(&self, owner: usize, root: u32, rate: f64, k: usize, rows: &mut StepRows) {
        let (clock, q) = (&mut rows.clock, root as usize);
        if k > 0 {
            clock.y_mut(1)[k] = self.h / k as f64 * self.motion.parts[owner].side * rate;
        }
        for m in 2..q {
            clock.y_mut(m)[k] = product(clock.y(m - 1), clock.y(1), k);
        }
        clock.weight[k] = q as f64 * clock.y(q - 1)[k];
    }
}
