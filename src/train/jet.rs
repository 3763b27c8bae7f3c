//! Taylor recurrences of a structure with contacts.
//!
//! In the step's clock θ, with `dt = h w(θ) dθ`,
//!
//! ```text
//! (k+1) q_{k+1} = h (w v)_k,   (k+1) v_{k+1} = h (w a)_k,   a = M⁻¹(f − C v − K q − Σ g_j F_j)
//! ```
//!
//! where `(w v)_k = Σ_i w_i v_{k−i}`. Plain time has `w = 1`. While a power law is in contact the clock
//! belongs to the contact nearest to its boundary: with penetration `p = y^q` and `w = q y^(q−1)`,
//! `dy/dθ = h ṗ`, and everything is a polynomial in y again. The series then runs through the start and the end of
//! a contact, where in plain time `pⁿ` has a branch point.

use super::{
    assemble::{Contact, MAX_CONTACTS, Spring, Structure, dot},
    contact_mode::{ContactMode, Watch, contact_mode, guard_id, piece, watches},
    sticking::Sticking,
};
use crate::{
    gear::contact::{Law, PowerLaw, Release},
    hybrid::{Crossing, Guard, Jet, JetField, JetRequest, Role},
    poly::{FirstRoot, first_root},
};

/// Highest power of a step.
pub(super) const ORDER: usize = 24;
/// Room for one series.
const ROW: usize = ORDER + 1;
/// Series of one contact: deflection, rate, the law's force, the force carried, penetration, its power,
/// stiffness, hysteresis factor.
const CONTACT_ROWS: usize = 8;
const DEFLECTION: usize = 0;
const RATE: usize = 1;
const FORCE: usize = 2;
const PENETRATION: usize = 3;
const POWER: usize = 4;
const STIFFNESS: usize = 5;
const FACTOR: usize = 6;
const CARRIED: usize = 7;
/// Room for the clock: w, then y, y², … y^(q−1), then p², p³, p⁴.
const CLOCK_ROWS: usize = 1 + 16 + 4;

/// The contact that owns the clock.
#[derive(Clone, Copy)]
struct Owner {
    contact: usize,
    law: PowerLaw,
}

/// Where the series lie in the working space.
struct Layout {
    oscillators: usize,
    contacts: usize,
    clock: usize,
    /// Accelerations of all orders, `n` each.
    accelerations: usize,
    /// Bound on what the truncated tail adds to each contact's rate.
    tails: usize,
    len: usize,
}

impl Layout {
    fn new(s: &Structure) -> Self {
        let oscillators = 0;
        let contacts = oscillators + 2 * s.oscillators.len() * ROW;
        let clock = contacts + s.contacts.len() * CONTACT_ROWS * ROW;
        let accelerations = clock + CLOCK_ROWS * ROW;
        let tails = accelerations + ROW * s.n;
        Self { oscillators, contacts, clock, accelerations, tails, len: tails + s.contacts.len() }
    }

    fn of(&self, j: usize, which: usize) -> usize {
        self.contacts + (j * CONTACT_ROWS + which) * ROW
    }

    fn y(&self, power: usize) -> usize {
        self.clock + power * ROW
    }
}

/// `(a b)_k`.
fn product(w: &[f64], a: usize, b: usize, k: usize) -> f64 {
    w[a..=a + k].iter().zip(w[b..=b + k].iter().rev()).fold(0.0, |s, (x, y)| x.mul_add(*y, s))
}

impl JetField for Structure {
    fn dim(&self) -> usize {
        self.dim
    }

    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet) {
        let layout = Layout::new(self);
        prepare(self, out, layout.len);
        let owner = self.owner(request);
        let mut scale = owner.map_or(request.span, |o| self.root_scale(request, o));
        loop {
            self.expand(request, &layout, owner, scale, out);
            self.bound_reach(request, &layout, owner, scale, out);
            if out.reach.is_finite() && out.reach > 0.0 {
                break;
            }
            // The scale overshot so far that the last coefficients overflowed.
            scale *= 1e-6;
            if scale < f64::MIN_POSITIVE {
                out.reach = f64::NAN;
                break;
            }
        }
        self.write_guards(request, &layout, owner, scale, out);
    }
}

fn prepare(s: &Structure, out: &mut Jet, work: usize) {
    out.order = ORDER;
    out.dim = s.dim;
    out.stride = ROW;
    out.state.resize((ORDER + 1) * s.dim, 0.0);
    out.work.resize(work, 0.0);
}

impl Structure {
    /// Who owns the clock: among closed power-law contacts the one that could reach its boundary first.
    fn owner(&self, request: &JetRequest<'_>) -> Option<Owner> {
        let mut nearest = f64::INFINITY;
        let mut owner = None;
        for (j, c) in self.contacts.iter().enumerate() {
            let Law::Power(law) = c.spec.law else { continue };
            let state = contact_mode(request.mode, j);
            if !state.is_closed() {
                continue;
            }
            let (p, rate) = self.penetration(j, state, request);
            let time = if p <= 0.0 { 0.0 } else { p / rate.abs() };
            if owner.is_none() || time < nearest {
                nearest = time;
                owner = Some(Owner { contact: j, law });
            }
        }
        owner
    }

    fn penetration(&self, j: usize, state: ContactMode, request: &JetRequest<'_>) -> (f64, f64) {
        let (deflection, rate) = self.deflection(j, request.at, request.x);
        let flank = if state.side() > 0.0 { Watch::DriveFlank } else { Watch::BackFlank };
        let p = if request.pinned.contains(guard_id(j, flank)) {
            0.0
        } else {
            (state.side() * deflection - self.contacts[j].gap()).max(0.0)
        };
        (p, state.side() * rate)
    }

    /// A first guess of the clock's span that reaches the bound in time.
    fn root_scale(&self, request: &JetRequest<'_>, owner: Owner) -> f64 {
        let state = contact_mode(request.mode, owner.contact);
        let (p, rate) = self.penetration(owner.contact, state, request);
        let q = f64::from(owner.law.exponent.q);
        // From the boundary: p = ṗ t and t = ṗ^(q−1) s^q. From inside: dt = q y^(q−1) ds.
        let from_boundary = (request.span / rate.abs().powf(q - 1.0)).powf(1.0 / q);
        let from_inside = request.span / (q * p.powf((q - 1.0) / q));
        from_boundary.min(from_inside).min(1e30)
    }

    /// All coefficients, to order [`ORDER`].
    fn expand(&self, request: &JetRequest<'_>, layout: &Layout, owner: Option<Owner>, h: f64, out: &mut Jet) {
        let (n, dim) = (self.n, self.dim);
        let Jet { state, work, time, .. } = out;
        state[..dim].copy_from_slice(request.x);
        for k in 1..=ORDER {
            state[k * dim + 2 * n..(k + 1) * dim].fill(0.0);
        }
        time.clear();
        if owner.is_some() {
            time.resize(ORDER + 1, 0.0);
        }
        self.start_series(request, layout, owner, work);
        let held = Sticking::new(self, request.mode);
        for k in 0..=ORDER {
            let (low, high) = state.split_at_mut((k + 1) * dim);
            let row = &low[k * dim..];
            self.contact_series(request, layout, owner, h, k, &row[n..2 * n], work);
            self.accelerations(layout, k, &row[..n], &row[n..2 * n], work);
            if let Some(held) = &held {
                self.hold(layout, held, k, work);
            }
            if k == ORDER {
                break;
            }
            let next = h / (k + 1) as f64;
            let (q1, v1) = high[..2 * n].split_at_mut(n);
            let a = |k: usize| layout.accelerations + k * n..layout.accelerations + (k + 1) * n;
            if owner.is_none() {
                q1.iter_mut().zip(&row[n..2 * n]).for_each(|(q, v)| *q = next * v);
                v1.iter_mut().zip(&work[a(k)]).for_each(|(v, a)| *v = next * a);
            } else {
                q1.fill(0.0);
                v1.fill(0.0);
                for i in 0..=k {
                    let w = next * work[layout.clock + i];
                    let v = &low[(k - i) * dim + n..(k - i) * dim + 2 * n];
                    q1.iter_mut().zip(v).for_each(|(q, v)| *q += w * v);
                    v1.iter_mut().zip(&work[a(k - i)]).for_each(|(v, a)| *v += w * a);
                }
                time[k + 1] = next * work[layout.clock + k];
            }
            self.oscillator_series(layout, owner, h, k, work);
        }
    }

    /// Order zero of oscillators, deflections, stiffnesses and of the clock.
    fn start_series(&self, request: &JetRequest<'_>, layout: &Layout, owner: Option<Owner>, work: &mut [f64]) {
        self.oscillate(request.at, |i, c, s| {
            work[layout.oscillators + 2 * i * ROW] = c;
            work[layout.oscillators + (2 * i + 1) * ROW] = s;
        });
        for (j, c) in self.contacts.iter().enumerate() {
            let mut e = c.spec.error_offset;
            for w in &c.error {
                e += w.cosine * work[layout.oscillators + 2 * w.index * ROW]
                    + w.sine * work[layout.oscillators + (2 * w.index + 1) * ROW];
            }
            work[layout.of(j, DEFLECTION)] = if request.pinned.contains(guard_id(j, Watch::DriveFlank)) {
                c.gap()
            } else if request.pinned.contains(guard_id(j, Watch::BackFlank)) {
                -c.gap()
            } else {
                dot(&c.direction, request.x) - e
            };
        }
        if let Some(owner) = owner {
            let state = contact_mode(request.mode, owner.contact);
            let p = self.penetration(owner.contact, state, request).0;
            work[layout.y(1)] = p.powf(1.0 / f64::from(owner.law.exponent.q));
        }
    }

    /// Deflection, rate and (compliant) force of every contact at order `k`; the clock's weight too.
    #[allow(clippy::too_many_arguments)] // the arguments are the recurrence's own variables
    fn contact_series(
        &self,
        request: &JetRequest<'_>,
        layout: &Layout,
        owner: Option<Owner>,
        h: f64,
        k: usize,
        v: &[f64],
        work: &mut [f64],
    ) {
        for (j, c) in self.contacts.iter().enumerate() {
            let mut rate = dot(&c.direction, v);
            for w in &c.error {
                let o = &self.oscillators[w.index];
                let cos = work[layout.oscillators + 2 * w.index * ROW + k];
                let sin = work[layout.oscillators + (2 * w.index + 1) * ROW + k];
                rate -= o.omega * (w.sine * cos - w.cosine * sin);
            }
            let (d, r) = (layout.of(j, DEFLECTION), layout.of(j, RATE));
            if k == 0 && self.is_still(request, j) {
                rate = 0.0;
            }
            work[r + k] = rate;
            if k > 0 {
                let flow = if owner.is_some() { product(work, layout.clock, r, k - 1) } else { work[r + k - 1] };
                work[d + k] = h / k as f64 * flow;
            }
        }
        if let Some(owner) = owner {
            self.clock_series(request, layout, owner, h, k, work);
        }
        for j in 0..self.contacts.len() {
            self.force_series(request, layout, owner, h, j, k, work);
        }
    }

    fn is_still(&self, request: &JetRequest<'_>, j: usize) -> bool {
        request.still.contains(guard_id(j, Watch::DriveFlank)) || request.still.contains(guard_id(j, Watch::BackFlank))
    }

    /// `y`, its powers and `w = q y^(q−1)` at order `k`.
    fn clock_series(
        &self,
        request: &JetRequest<'_>,
        layout: &Layout,
        owner: Owner,
        h: f64,
        k: usize,
        work: &mut [f64],
    ) {
        let side = contact_mode(request.mode, owner.contact).side();
        let q = owner.law.exponent.q as usize;
        if k > 0 {
            work[layout.y(1) + k] = h / k as f64 * side * work[layout.of(owner.contact, RATE) + k - 1];
        }
        for m in 2..q {
            work[layout.y(m) + k] = product(work, layout.y(m - 1), layout.y(1), k);
        }
        work[layout.clock + k] = match q {
            1 => f64::from(u8::from(k == 0)),
            _ => q as f64 * work[layout.y(q - 1) + k],
        };
    }

    /// The force `F_j` along `g_j` at order `k`, zero where the contact carries none.
    #[allow(clippy::too_many_arguments)]
    fn force_series(
        &self,
        request: &JetRequest<'_>,
        layout: &Layout,
        owner: Option<Owner>,
        h: f64,
        j: usize,
        k: usize,
        work: &mut [f64],
    ) {
        let c = &self.contacts[j];
        let state = contact_mode(request.mode, j);
        let (d, r, f) = (layout.of(j, DEFLECTION), layout.of(j, RATE), layout.of(j, FORCE));
        let side = state.side();
        let force = match c.spec.law {
            Law::Rigid(_) => 0.0,
            Law::Bilateral(l) => {
                self.spring_series(request, layout, owner, h, j, k, work, 0.0) + l.damping * work[r + k]
            }
            Law::KelvinVoigt(l, _) if side != 0.0 => {
                self.spring_series(request, layout, owner, h, j, k, work, side * c.gap()) + l.damping * work[r + k]
            }
            Law::Power(l) if side != 0.0 => {
                work[layout.of(j, PENETRATION) + k] = side * work[d + k] - if k == 0 { c.gap() } else { 0.0 };
                let chi = c.latch.map_or(0.0, |i| l.hysteresis / request.x[i]);
                work[layout.of(j, FACTOR) + k] = chi * side * work[r + k] + f64::from(u8::from(k == 0));
                if state.is_closed() {
                    self.power_series(layout, owner, j, l, k, work);
                    let product = if chi == 0.0 {
                        work[layout.of(j, POWER) + k]
                    } else {
                        product(work, layout.of(j, POWER), layout.of(j, FACTOR), k)
                    };
                    side * c.spec.stiffness.mean() * product
                } else {
                    0.0
                }
            }
            _ => 0.0,
        };
        work[f + k] = force;
        let carries = state.is_closed() || matches!(c.spec.law, Law::Bilateral(_));
        work[layout.of(j, CARRIED) + k] = if carries { force } else { 0.0 };
    }

    /// `k(t) (δ − offset)` at order `k`.
    #[allow(clippy::too_many_arguments)]
    fn spring_series(
        &self,
        request: &JetRequest<'_>,
        layout: &Layout,
        owner: Option<Owner>,
        h: f64,
        j: usize,
        k: usize,
        work: &mut [f64],
        offset: f64,
    ) -> f64 {
        let (d, s, p) = (layout.of(j, DEFLECTION), layout.of(j, STIFFNESS), layout.of(j, PENETRATION));
        let stretch = if k == 0 { work[d] - offset } else { work[d + k] };
        let stiffness = match &self.contacts[j].spring {
            Spring::Constant(value) => return value * stretch,
            Spring::Scheduled(schedule) => {
                let number = piece(request.mode, j);
                let (value, slope) = schedule.law(number);
                if slope == 0.0 {
                    return value * stretch;
                }
                if k == 0 {
                    value + slope * schedule.piece(&self.clock, request.at).1
                } else {
                    // The elapsed time in the step's clock, times the slope.
                    let weight = if owner.is_some() { work[layout.clock + k - 1] } else { f64::from(u8::from(k == 1)) };
                    slope * h / k as f64 * weight
                }
            }
            Spring::Waves(mean, waves) => waves.iter().fold(if k == 0 { *mean } else { 0.0 }, |sum, w| {
                sum + w.cosine * work[layout.oscillators + 2 * w.index * ROW + k]
                    + w.sine * work[layout.oscillators + (2 * w.index + 1) * ROW + k]
            }),
        };
        work[s + k] = stiffness;
        work[p + k] = stretch;
        product(work, s, p, k)
    }

    /// `pⁿ` at order `k`.
    fn power_series(&self, layout: &Layout, owner: Option<Owner>, j: usize, law: PowerLaw, k: usize, work: &mut [f64]) {
        let (p, u) = (layout.of(j, PENETRATION), layout.of(j, POWER));
        let exponent = law.exponent;
        if owner.is_some_and(|o| o.contact == j) {
            // n = a + r/q: pⁿ = p^a y^r, products only.
            let (a, r) = ((exponent.p / exponent.q) as usize, (exponent.p % exponent.q) as usize);
            let mut series = p;
            for m in 2..=a {
                let next = layout.y(16 + m - 1);
                work[next + k] = product(work, series, p, k);
                series = next;
            }
            work[u + k] = match (a, r) {
                (0, r) => work[layout.y(r) + k],
                (_, 0) => work[series + k],
                (_, r) => product(work, series, layout.y(r), k),
            };
            return;
        }
        // Another contact's clock. If this one starts at the same instant, p = θ^m β with m the owner's q,
        // and pⁿ = θ^(mn) βⁿ; βⁿ by the recurrence of a power of a series.
        let n = exponent.value();
        let m = if work[p] == 0.0 { owner.map_or(0, |o| o.law.exponent.q as usize) } else { 0 };
        let shift = (m as f64 * n).round() as usize;
        if k < shift || work[p + m] == 0.0 {
            work[u + k] = 0.0;
            return;
        }
        let i = k - shift;
        work[u + k] = if i == 0 {
            work[p + m].max(0.0).powf(n)
        } else {
            let sum: f64 = (1..=i).map(|l| (l as f64 * (n + 1.0) - i as f64) * work[p + m + l] * work[u + k - l]).sum();
            sum / (i as f64 * work[p + m])
        };
    }

    /// `a_k` without the multipliers of resting contacts.
    fn accelerations(&self, layout: &Layout, k: usize, q: &[f64], v: &[f64], work: &mut [f64]) {
        let (series, tail) = work.split_at_mut(layout.accelerations);
        let a = &mut tail[k * self.n..(k + 1) * self.n];
        if k == 0 {
            a.copy_from_slice(&self.load);
        } else {
            a.fill(0.0);
        }
        for w in &self.load_waves {
            let c = series[layout.oscillators + 2 * w.index * ROW + k];
            let s = series[layout.oscillators + (2 * w.index + 1) * ROW + k];
            for ((a, wc), ws) in a.iter_mut().zip(&w.cosine).zip(&w.sine) {
                *a += wc * c + ws * s;
            }
        }
        for (i, a) in a.iter_mut().enumerate() {
            *a -= dot(&self.stiffness_rows[i], q) + dot(&self.damping_rows[i], v);
        }
        for (j, c) in self.contacts.iter().enumerate() {
            let f = series[layout.of(j, CARRIED) + k];
            if f != 0.0 {
                for (i, p) in &c.push {
                    a[*i as usize] -= p * f;
                }
            }
        }
    }

    /// The multipliers that hold the resting contacts, `g·a = ë`, at order `k`.
    fn hold(&self, layout: &Layout, held: &Sticking, k: usize, work: &mut [f64]) {
        let a = layout.accelerations + k * self.n;
        let mut forces = [0.0; MAX_CONTACTS];
        for (force, &j) in forces.iter_mut().zip(held.contacts()) {
            let c = &self.contacts[j];
            *force = dot(&c.direction, &work[a..]);
            for w in &c.error {
                let o = self.oscillators[w.index].omega;
                let cos = work[layout.oscillators + 2 * w.index * ROW + k];
                let sin = work[layout.oscillators + (2 * w.index + 1) * ROW + k];
                *force += o * o * (w.cosine * cos + w.sine * sin);
            }
        }
        held.solve(&mut forces);
        for (force, &j) in forces.iter().zip(held.contacts()) {
            work[layout.of(j, FORCE) + k] = *force;
            for (i, p) in &self.contacts[j].push {
                work[a + *i as usize] -= p * force;
            }
        }
    }

    /// `cos ωt`, `sin ωt` at order `k + 1`.
    fn oscillator_series(&self, layout: &Layout, owner: Option<Owner>, h: f64, k: usize, work: &mut [f64]) {
        for (i, o) in self.oscillators.iter().enumerate() {
            let (c, s) = (layout.oscillators + 2 * i * ROW, layout.oscillators + (2 * i + 1) * ROW);
            let (dc, ds) = if owner.is_some() {
                (product(work, layout.clock, c, k), product(work, layout.clock, s, k))
            } else {
                (work[c + k], work[s + k])
            };
            let f = o.omega * h / (k + 1) as f64;
            work[c + k + 1] = -f * ds;
            work[s + k + 1] = f * dc;
        }
    }

    /// The weighted size of the rates at order `k`.
    fn size(&self, layout: &Layout, k: usize, out: &Jet) -> f64 {
        let v = &out.state[k * self.dim + self.n..k * self.dim + 2 * self.n];
        let mut size = v.iter().zip(&self.weights).fold(0.0, |m: f64, (v, w)| m.max(v.abs() * w));
        for (j, c) in self.contacts.iter().enumerate() {
            size = size.max(out.work[layout.of(j, RATE) + k].abs() / c.mobility.sqrt());
        }
        size
    }

    /// How far the series holds.
    ///
    /// In plain time the last two terms must be below `tolerance` times the largest of the first ones. In a
    /// root clock only every (p+q)-th term may be there, and the radius of convergence is finite: the root test over
    /// the last p+q terms gives the radius R, and `(reach/R)^N` is brought below the tolerance.
    fn bound_reach(&self, request: &JetRequest<'_>, layout: &Layout, owner: Option<Owner>, scale: f64, out: &mut Jet) {
        out.span = scale;
        let first = [self.size(layout, 0, out), self.size(layout, 1, out), self.size(layout, 2, out)];
        let window = owner.map_or(2, |o| (o.law.exponent.p + o.law.exponent.q) as usize).min(ORDER);
        let mut last = [0.0; ORDER];
        let last = &mut last[..window];
        for (a, k) in last.iter_mut().zip(ORDER + 1 - window..) {
            *a = self.size(layout, k, out);
        }
        if !first.iter().chain(last.iter()).all(|v| v.is_finite()) {
            out.reach = f64::NAN;
            return;
        }
        let shrink = if owner.is_some() { request.tolerance.powf(1.0 / ORDER as f64) } else { 1.0 };
        let mut reach: f64 = 1.0;
        for _ in 0..4 {
            let size = first[0].max(first[1] * reach).max(first[2] * reach * reach);
            let allowed = if owner.is_some() { size } else { request.tolerance * size };
            let mut next: f64 = 1.0;
            for (a, k) in last.iter().zip(ORDER + 1 - window..) {
                if *a > 0.0 {
                    next = next.min(shrink * (allowed / a).powf(1.0 / k as f64));
                }
            }
            let change = (next - reach).abs();
            reach = next;
            if change <= 0.1 * reach {
                break;
            }
        }
        if owner.is_some() {
            // Not beyond the bound in time.
            let mut left = [0.0; ROW];
            left.iter_mut().zip(&out.time).for_each(|(l, t)| *l = -t);
            left[0] += request.span;
            if let FirstRoot::At(theta) = first_root(&left, reach, 0.0).root {
                reach = theta;
            }
        }
        out.reach = reach;
    }

    /// The guards of the mode and the bounds on what their series leave out.
    fn write_guards(&self, request: &JetRequest<'_>, layout: &Layout, owner: Option<Owner>, scale: f64, out: &mut Jet) {
        let deflect = self.tail(layout, scale, out);
        let Jet { guards, guard_series, remainder, rounding, work, .. } = out;
        guards.clear();
        remainder.clear();
        rounding.clear();
        guard_series.resize(guard_series.len().max(3 * self.contacts.len() * ROW), 0.0);
        for (j, c) in self.contacts.iter().enumerate() {
            let state = contact_mode(request.mode, j);
            for &(watch, sign) in self.watched(c, state) {
                let id = guard_id(j, watch);
                let row = guards.len() * ROW;
                let series = &mut guard_series[row..row + ROW];
                let d = layout.of(j, DEFLECTION);
                let (tail, rounded) = match watch {
                    Watch::DriveFlank | Watch::BackFlank if owner.is_some_and(|o| o.contact == j) => {
                        series.copy_from_slice(&work[layout.y(1)..layout.y(1) + ROW]);
                        (work[layout.tails + j] * scale, 0.0)
                    }
                    Watch::DriveFlank | Watch::BackFlank => {
                        let flank = if watch == Watch::DriveFlank { -sign } else { sign };
                        series.iter_mut().zip(&work[d..d + ROW]).for_each(|(s, d)| *s = flank * d);
                        series[0] += sign * c.gap();
                        (work[layout.tails + j] * deflect, self.rounding(c, request.x))
                    }
                    Watch::Force => self.force_guard(request, layout, j, state, sign, work, series, deflect),
                };
                // What is exactly zero by construction is written so.
                if request.pinned.contains(id) && watch == Watch::Force {
                    series[0] = 0.0;
                }
                if request.still.contains(id)
                    && request.pinned.contains(guard_id(j, Watch::Force))
                    && state == ContactMode::Separated
                {
                    // Released from rest: value, rate and acceleration of the gap are all zero.
                    series[..3].fill(0.0);
                }
                remainder.push(tail);
                rounding.push(4.0 * f64::EPSILON * rounded);
                guards.push(Guard { id, crossing: Crossing::Falling, role: Role::Jump });
            }
        }
    }

    pub(super) fn watched(&self, c: &Contact, state: ContactMode) -> &'static [(Watch, f64)] {
        match c.spec.law {
            Law::Bilateral(_) => &[],
            Law::KelvinVoigt(_, Release::Force) => match state {
                // The force reaches zero no later than the deflection does.
                ContactMode::Drive | ContactMode::Back => &[(Watch::Force, 1.0)],
                _ => watches(state, true, false, c.has_back()),
            },
            Law::KelvinVoigt(_, Release::Deflection) => watches(state, false, false, c.has_back()),
            Law::Power(_) => watches(state, c.latch.is_some(), false, c.has_back()),
            Law::Rigid(_) => watches(state, false, true, c.has_back()),
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn force_guard(
        &self,
        request: &JetRequest<'_>,
        layout: &Layout,
        j: usize,
        state: ContactMode,
        sign: f64,
        work: &[f64],
        series: &mut [f64],
        deflect: f64,
    ) -> (f64, f64) {
        let c = &self.contacts[j];
        if let Law::Power(_) = c.spec.law {
            let f = layout.of(j, FACTOR);
            series.iter_mut().zip(&work[f..f + ROW]).for_each(|(s, f)| *s = sign * f);
            let chi = c.latch.map_or(0.0, |i| request.x[i].recip());
            return (chi * work[layout.tails + j], 1.0);
        }
        let f = layout.of(j, FORCE);
        let sign = sign * state.side();
        series.iter_mut().zip(&work[f..f + ROW]).for_each(|(s, f)| *s = sign * f);
        let (k, damping) = match c.spec.law {
            Law::KelvinVoigt(l, _) => (c.spec.stiffness.maximum(), l.damping),
            _ => (0.0, 0.0),
        };
        let scale = k * self.rounding(c, request.x) + damping * self.rate_size(c, request.x);
        (work[layout.tails + j] * (k * deflect + damping), scale)
    }

    /// Size of the terms whose sum is a deflection: its rounding error is a few units of this.
    fn rounding(&self, c: &Contact, x: &[f64]) -> f64 {
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * x[*i as usize]).abs()).sum();
        terms + c.gap().abs() + c.error.iter().map(|w| w.cosine.abs() + w.sine.abs()).sum::<f64>()
    }

    /// Size of the terms whose sum is a deflection rate.
    fn rate_size(&self, c: &Contact, x: &[f64]) -> f64 {
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * x[self.n + *i as usize]).abs()).sum();
        terms + c.error.iter().map(|w| self.oscillators[w.index].omega * (w.cosine.abs() + w.sine.abs())).sum::<f64>()
    }

    /// Writes what the truncated terms can add to each contact's rate up to `reach`, and returns the
    /// factor that turns that into deflection, s.
    ///
    /// For affine modes `‖x_{k+1}‖ ≤ ‖x_k‖ h L/(k+1)` with L the growth bound: a geometric tail, a proof.
    /// Where a product or a power of series is involved the ratio of the last terms stands for L: an estimate.
    fn tail(&self, layout: &Layout, scale: f64, out: &mut Jet) -> f64 {
        let h = scale * out.reach;
        let last = [ORDER - 2, ORDER - 1, ORDER].map(|k| self.size(layout, k, out) * out.reach.powi(k as i32));
        let mut ratio = h * self.growth / ORDER as f64;
        for o in &self.oscillators {
            ratio = ratio.max(h * o.omega / ORDER as f64);
        }
        if !self.affine && last[0] > 0.0 {
            ratio = ratio.max((last[2] / last[0]).sqrt());
        }
        let ratio = ratio.min(0.75);
        let beyond = last[1].max(last[2]) * ratio / (1.0 - ratio);
        for (j, c) in self.contacts.iter().enumerate() {
            out.work[layout.tails + j] = beyond * c.across;
        }
        h / ORDER as f64
    }
}
