//! One step: its clock, its length, and the guards on it.

use flank::hybrid::{ContactMode, Watch};

use super::{
    model::{Law, Model},
    rest::Rest,
    series::{Clock, Series, expand},
    state::{State, Status},
    wide::{Wide, horner, near, size, wide},
};

/// A guard's series with its zeros at the start divided out.
pub struct Guard {
    pub contact: usize,
    pub watch: Watch,
    pub c: Vec<Wide>,
    pub zeros: usize,
    /// Sum of the sizes of its terms at the start.
    pub size: f64,
}

pub fn is_rigid(m: &Model, j: usize) -> bool {
    matches!(m.contacts[j].law, Law::Rigid(_))
}

/// Rigid contacts at rest.
pub fn resting(m: &Model, s: &State) -> Vec<(usize, f64)> {
    let closed = |j: &usize| is_rigid(m, *j) && s.contacts[*j].mode.is_closed();
    (0..m.contacts.len()).filter(closed).map(|j| (j, s.contacts[j].side)).collect()
}

/// Bound on the rate of all that happens: forcing, and the structure with its closed contacts in a weighted norm.
pub fn rate(m: &Model, s: &State) -> f64 {
    let w = &m.weights;
    let (mut by_q, mut by_v) = (vec![0.0; m.n], vec![0.0; m.n]);
    for i in 0..m.n {
        for j in 0..m.n {
            by_q[i] += size(m.k[i][j]) * w[i] / w[j];
            by_v[i] += size(m.c[i][j]) * w[i] / w[j];
        }
    }
    for (j, c) in m.contacts.iter().enumerate().filter(|(j, _)| s.contacts[*j].mode.is_closed()) {
        let (k, d) = match c.law {
            Law::Bilateral(d) | Law::KelvinVoigt(d, _) => (c.spring.largest(), near(d)),
            Law::Power { p, q, d, .. } => {
                let n = p as f64 / q as f64;
                let (gap, speed, _, _) = s.gap(m, j, s.contacts[j].side);
                let (depth, k) = (near(-gap).max(0.0), c.spring.largest());
                // The deepest it will get by its speed alone, about.
                let mass = 1.0 / near(m.mobility[j][j]);
                let reach = (size(speed).powi(2) * mass * (n + 1.0) / (2.0 * k)).powf(1.0 / (n + 1.0));
                let deep = depth.max(reach.min(depth + reach));
                let chi = near(d) / near(s.latches[j]).max(f64::MIN_POSITIVE);
                (n * k * deep.powf(n - 1.0) * (1.0 + chi * size(speed)), k * deep.powf(n) * chi)
            }
            Law::Rigid(_) => continue,
        };
        let across: f64 = c.g.iter().zip(w).map(|(g, w)| size(*g) / w).sum();
        for i in 0..m.n {
            by_q[i] += k * size(c.push[i]) * w[i] * across;
            by_v[i] += d * size(c.push[i]) * w[i] * across;
        }
    }
    let largest = |x: &[f64]| x.iter().copied().fold(0.0, f64::max);
    // A contact at rest holds its bodies together: the projector has a norm of its own.
    let held = resting(m, s).len();
    let own = (largest(&by_q).sqrt() + largest(&by_v)) * (1.0 + held as f64).sqrt();
    m.omegas.iter().map(|o| near(*o)).fold(own, f64::max)
}

/// The clock of the next step.
pub fn clock(m: &Model, s: &State, rate: f64) -> Option<Clock> {
    let mut common = 1_usize;
    let mut nearest: Option<(f64, usize)> = None;
    for (j, c) in m.contacts.iter().enumerate() {
        let (Law::Power { q, .. }, status) = (&c.law, s.contacts[j]) else { continue };
        if !status.mode.is_closed() || *q == 1 {
            continue;
        }
        if status.zeros > 0 {
            common = lcm(common, *q);
        }
        let (gap, speed, _, _) = s.gap(m, j, status.side);
        let left = near(-gap) / size(speed).max(f64::MIN_POSITIVE);
        if nearest.is_none_or(|(n, _)| left < n) {
            nearest = Some((left, j));
        }
    }
    if common > 1 {
        return (common <= 24).then_some(Clock::Fraction(common));
    }
    match nearest {
        Some((left, j)) if left * rate < 0.5 => Some(Clock::Root(j)),
        _ => Some(Clock::Fraction(1)),
    }
}

fn lcm(a: usize, b: usize) -> usize {
    let gcd = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    a / gcd(a, b) * b
}

/// A step and how far its series holds.
pub struct Step {
    pub series: Series,
    pub end: f64,
}

/// Orders of a step whose right-hand side is linear, and of any other.
const ORDER: usize = 40;
const HIGH: usize = 72;

/// The next step, in plain time no longer than `span`; `None` if no clock serves it.
pub fn step(m: &Model, s: &State, span: f64) -> Option<Step> {
    let rate = rate(m, s);
    let clock = clock(m, s, rate)?;
    let is_power = |j: &usize| matches!(m.contacts[*j].law, Law::Power { .. }) && s.contacts[*j].mode.is_closed();
    let powers: Vec<usize> = (0..m.contacts.len()).filter(is_power).collect();
    // 2.2^41/41! = 3e-36: nothing is left of a linear motion.
    let reach = if powers.is_empty() { 2.2 } else { 1.0 };
    let h = match clock {
        Clock::Fraction(_) => (reach / rate.max(f64::MIN_POSITIVE)).min(2.0 * span),
        Clock::Root(j) => {
            // To y = 0 and a little beyond, if the speed stays.
            let Law::Power { q, .. } = m.contacts[j].law else { return None };
            let (gap, speed, _, _) = s.gap(m, j, s.contacts[j].side);
            let y = near(-gap).powf(1.0 / q as f64);
            let widest = (near(-gap) + size(speed) * reach / rate).powf(1.0 / q as f64);
            1.5 * widest.max(y) / size(speed).max(near(-gap) * rate)
        }
    };
    let order = if powers.is_empty() { ORDER } else { HIGH };
    let series = expand(m, s, clock, h, order, &mut Rest::hold(resting(m, s).into_iter()));
    let mut rows: Vec<&[Wide]> = series.v.iter().map(Vec::as_slice).collect();
    rows.extend(series.q.iter().map(Vec::as_slice));
    rows.extend(powers.iter().map(|j| series.depth[*j].as_slice()));
    rows.extend(resting(m, s).iter().map(|(j, _)| series.force[*j].as_slice()));
    let mut end = 1.0;
    // Series in roots have wide gaps; the others may lack every second order.
    let from = if powers.is_empty() { order - 3 } else { order / 2 };
    while !rows.iter().all(|row| holds(row, end, from)) && end > 1e-12 {
        end *= 0.85;
    }
    Some(Step { series, end })
}

/// Whether the coefficients of a row, of order `from` and above, fall fast enough for 1e-32 of its size at `end`.
fn holds(row: &[Wide], end: f64, from: usize) -> bool {
    let order = row.len() - 1;
    let mut scale = 1.0;
    let terms: Vec<f64> = row
        .iter()
        .map(|c| {
            let term = size(*c) * scale;
            scale *= end;
            term
        })
        .collect();
    let whole = terms.iter().copied().fold(0.0, f64::max);
    terms.iter().enumerate().skip(from).all(|(k, t)| *t <= whole * (-73.0 * k as f64 / order as f64).exp())
}

/// Guards of a contact in a mode.
fn watches(m: &Model, j: usize, status: Status) -> Vec<Watch> {
    let c = &m.contacts[j];
    let flank = if status.side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank };
    match (&c.law, status.mode) {
        (Law::Bilateral(_), _) => vec![],
        (_, ContactMode::Separated) if c.both => vec![Watch::DriveFlank, Watch::BackFlank],
        (_, ContactMode::Separated) => vec![Watch::DriveFlank],
        (Law::Rigid(_), _) => vec![Watch::Force],
        (Law::KelvinVoigt(_, true), _) => vec![flank, Watch::Force],
        (Law::Power { d, .. }, _) if *d != wide(0.0) => vec![flank, Watch::Force],
        _ => vec![flank],
    }
}

/// All guards of a mode on a series.
pub fn guards(m: &Model, s: &State, series: &Series) -> Vec<Guard> {
    let steps = if let Clock::Fraction(q) = series.clock { q } else { 1 };
    let mut out = Vec::new();
    for (j, status) in s.contacts.iter().enumerate() {
        for watch in watches(m, j, *status) {
            let inside = status.mode != ContactMode::Separated;
            let (c, zeros) = match watch {
                Watch::Force => {
                    let sign = wide(if status.mode.is_closed() { 1.0 } else { -1.0 });
                    let c: Vec<Wide> = series.force[j].iter().map(|f| sign * *f).collect();
                    let zeros = if is_rigid(m, j) { status.zeros.max(2) - 2 } else { usize::from(status.force_zero) };
                    (c, zeros * steps)
                }
                _ if inside => (series.depth[j].clone(), status.zeros * steps),
                flank => {
                    let c = (0..series.q[0].len()).map(|k| series.gap(m, j, flank.side(), k)).collect();
                    (c, if flank.side() == status.side { status.zeros * steps } else { 0 })
                }
            };
            let size = if watch == Watch::Force { series.force_size(m, j, 0) } else { series.gap_size(m, j, 0) };
            out.push(Guard { contact: j, watch, c: c[zeros.min(c.len() - 1)..].to_vec(), zeros, size });
        }
    }
    out
}

impl Step {
    /// The state at θ, with nothing known to be zero.
    pub fn at(&self, s: &State, theta: Wide) -> State {
        let value = |x: &Vec<Vec<Wide>>| x.iter().map(|c| horner(c, theta)).collect();
        State {
            t: s.t + horner(&self.series.time, theta),
            q: value(&self.series.q),
            v: value(&self.series.v),
            latches: s.latches.clone(),
            contacts: s.contacts.iter().map(|c| Status { zeros: 0, force_zero: false, opens: false, ..*c }).collect(),
        }
    }

    /// θ at which the time since the start is `dt`; at most the end of the step.
    pub fn theta(&self, dt: Wide) -> Option<Wide> {
        if horner(&self.series.time, wide(self.end)) <= dt {
            return None;
        }
        let (mut low, mut high) = (wide(0.0), wide(self.end));
        let mut x = match self.series.clock {
            Clock::Fraction(1) => return Some(dt / self.series.h),
            _ => wide(0.5 * self.end),
        };
        for _ in 0..300 {
            let off = horner(&self.series.time, x) - dt;
            if near(off) > 0.0 {
                high = x
            } else {
                low = x
            }
            let slope =
                self.series.time.iter().enumerate().skip(1).map(|(k, c)| *c * wide(k as f64)).collect::<Vec<_>>();
            let mut next = x - off / horner(&slope, x);
            if !(next > low && next < high) {
                next = (low + high) * wide(0.5);
            }
            let moved = size(next - x);
            x = next;
            if moved <= 1e-31 {
                break;
            }
        }
        Some(x)
    }
}
