//! The recurrence in a root clock: some power law is closed.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use super::{
    CARRIED, Elasticity, Expansion, FACTOR, FORCE, Force, LANES, Layout, Motion, ORDER, PENETRATION, POWER, RATE, ROW,
    STIFFNESS,
    fours::{Does, FourSeries, convolve, convolved, lanes},
    product, waves,
};
use crate::{
    gear::contact::PowerLaw,
    hybrid::{Jet, JetRequest},
    system::{Spring, Watch, guard_id},
    vectors::{Path, fused},
};

/// A change this much smaller than what it changes is far below rounding.
const UNFELT: f64 = f64::EPSILON / 64.0;

/// The contact that owns the clock.
#[derive(Clone, Copy)]
pub(super) struct Owner {
    pub contact: usize,
    pub law: PowerLaw,
    /// The clock's root q, the law's own. It is 1, plain time, where the contact starts from rest: with neither
    /// penetration nor speed a root clock stands still, and `p ~ t²` has its root already.
    pub root: u32,
}

impl Motion<'_> {
    /// Who owns the clock: among closed power-law contacts the one that could reach its boundary first. None if
    /// all of them are just leaving.
    pub(super) fn owner(&self, request: &JetRequest<'_>) -> Option<Owner> {
        let mut nearest: Option<(f64, Owner)> = None;
        for (j, part) in self.parts.iter().enumerate().filter(|(_, part)| part.is_pressed()) {
            let Some(Force::Power { law, .. }) = part.force() else { continue };
            let (p, rate) = self.penetration(j, request);
            if p <= 0.0 && rate < 0.0 {
                // It leaves at this very instant; its clock would run backwards.
                continue;
            }
            let time = if p <= 0.0 { 0.0 } else { p / rate.abs() };
            let root = if p <= 0.0 && rate == 0.0 { 1 } else { law.exponent.q };
            if nearest.is_none_or(|(t, _)| time < t) {
                nearest = Some((time, Owner { contact: j, law, root }));
            }
        }
        nearest.map(|(_, owner)| owner)
    }

    fn penetration(&self, j: usize, request: &JetRequest<'_>) -> (f64, f64) {
        let (s, side) = (self.structure, self.parts[j].side);
        let (deflection, rate) = s.deflection(j, request.at, request.x);
        let flank = if side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank };
        let p = match request.carried.get(j) {
            _ if request.pinned.contains(guard_id(j, flank)) => 0.0,
            Some(stretch) if !stretch.is_nan() => (side * stretch).max(0.0),
            _ => (side * deflection - s.contacts[j].gap()).max(0.0),
        };
        (p, side * rate)
    }

    /// A first guess of the clock's span that reaches the bound in time.
    pub(super) fn root_scale(&self, request: &JetRequest<'_>, owner: Owner) -> f64 {
        let (p, rate) = self.penetration(owner.contact, request);
        let q = f64::from(owner.root);
        // From the boundary: p = ṗ t and t = ṗ^(q−1) s^q. From inside: dt = q y^(q−1) ds.
        let from_boundary = libm::pow(request.span / libm::pow(rate.abs(), q - 1.0), 1.0 / q);
        let from_inside = request.span / (q * libm::pow(p, (q - 1.0) / q));
        from_boundary.min(from_inside).min(1e30)
    }
}

impl Expansion<'_> {
    /// All coefficients in the owner's clock.
    #[inline(always)]
    pub(super) fn rooted<P: Path>(&self, owner: Owner, out: &mut Jet) {
        let (s, layout, h) = (self.s, self.layout, self.h);
        let (n, dim) = (s.n, s.dim);
        let Jet { state, work, time, .. } = out;
        time.clear();
        time.resize(ORDER + 1, 0.0);
        let p = (self.motion.parts[owner.contact].side * work[layout.stretches + owner.contact]).max(0.0);
        work[layout.y(1)] = libm::pow(p, 1.0 / f64::from(owner.root));
        // Every number is written before it is read.
        let fours = &mut *self.motion.scratch.borrow_mut();
        fours.resize_with(s.columns.fours.len(), FourSeries::default);
        for k in 0..=ORDER {
            let (low, high) = state.split_at_mut((k + 1) * dim);
            let (q, v) = low[k * dim..k * dim + 2 * n].split_at(n);
            for (chunk, four) in fours.iter_mut().enumerate() {
                self.rates::<P>(chunk, four, k, v, work);
            }
            self.clock_series(owner, k, work);
            for (chunk, four) in fours.iter_mut().enumerate() {
                if k == 0 {
                    self.begin(owner, chunk, four, work);
                }
                self.forces::<P>(owner, chunk, four, k, work);
            }
            self.accelerations(k, q, v, work);
            let a = &mut work[layout.accelerations + k * n..][..n];
            for (four, columns) in fours.iter().zip(&s.columns.fours) {
                for (push, force) in columns.pushes.iter().zip(&four.force[k]).filter(|(_, force)| **force != 0.0) {
                    a.iter_mut().zip(push).for_each(|(a, p)| *a = fused::<P>(-p, *force, *a));
                }
            }
            if let Some(held) = &self.motion.held {
                self.hold(held, k, work);
            }
            if k == ORDER {
                break;
            }
            let step = h / (k + 1) as f64;
            let mut weights = [0.0; ROW];
            weights.iter_mut().zip(&work[layout.clock..=layout.clock + k]).for_each(|(w, rate)| *w = step * rate);
            let (q1, v1) = high[..2 * n].split_at_mut(n);
            convolve::<P>(&weights[..=k], &low[n..], dim, q1);
            convolve::<P>(&weights[..=k], &work[layout.accelerations..], n, v1);
            time[k + 1] = step * work[layout.clock + k];
            for (i, o) in s.oscillators.iter().enumerate() {
                let c = Layout::oscillator(i);
                let (dc, ds) = (product(work, layout.clock, c, k), product(work, layout.clock, c + ROW, k));
                (work[c + k + 1], work[c + ROW + k + 1]) = (-step * o.omega * ds, step * o.omega * dc);
            }
        }
        fours.iter().enumerate().for_each(|(chunk, four)| self.keep(chunk, four, work));
    }

    /// Writes the series of four contacts one after the other, as far as they are not there.
    #[inline(always)]
    fn keep(&self, chunk: usize, four: &FourSeries, work: &mut [f64]) {
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            let mut write = |which: usize, lanes: &[[f64; LANES]; ROW]| {
                let row = &mut work[self.layout.of(j, which)..][..ROW];
                row.iter_mut().zip(lanes).for_each(|(c, lanes)| *c = lanes[l]);
            };
            if matches!(four.does[l], Does::Watched | Does::Pressed) {
                let rows = [&four.penetration, &four.factor, &four.power, &four.force, &four.force];
                [PENETRATION, FACTOR, POWER, FORCE, CARRIED]
                    .into_iter()
                    .zip(rows)
                    .for_each(|(which, row)| write(which, row));
            }
        }
    }

    /// Rates of four contacts at order `k`, and their deflections, the integrals of `w δ̇`.
    #[inline(always)]
    fn rates<P: Path>(&self, chunk: usize, four: &mut FourSeries, k: usize, v: &[f64], work: &mut [f64]) {
        let (s, layout) = (self.s, self.layout);
        let columns = &s.columns.fours[chunk];
        let mut rate = [0.0; LANES];
        for (direction, v) in columns.directions.iter().zip(v) {
            for l in 0..LANES {
                rate[l] = fused::<P>(direction[l], *v, rate[l]);
            }
        }
        for (index, cosine, sine) in &columns.rates {
            let o = Layout::oscillator(*index) + k;
            let (cos, sin) = (work[o], work[o + ROW]);
            for l in 0..LANES {
                rate[l] -= fused::<P>(cosine[l], cos, sine[l] * sin);
            }
        }
        let contacts = LANES * chunk..s.contacts.len().min(LANES * chunk + LANES);
        if k == 0 && !self.request.still.is_empty() {
            contacts.clone().zip(&mut rate).filter(|(j, _)| self.is_still(*j)).for_each(|(_, rate)| *rate = 0.0);
        }
        four.rate[k] = rate;
        let at = layout.deflection(LANES * chunk, k);
        if k > 0 {
            let clock = &work[layout.clock..layout.clock + k];
            let sum = lanes::<P>(clock, &four.rate[..k]);
            for l in 0..LANES {
                work[at + l] = self.h / k as f64 * sum[l];
            }
        }
        for (l, j) in contacts.enumerate() {
            work[layout.of(j, RATE) + k] = rate[l];
            four.penetration[k][l] = four.side[l] * work[at + l];
        }
    }

    /// What the contacts of four do, from their penetrations at order zero on.
    fn begin(&self, owner: Owner, chunk: usize, four: &mut FourSeries, work: &mut [f64]) {
        let layout = self.layout;
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            let part = &self.motion.parts[j];
            (four.side[l], four.exponent[l], four.start[l]) = (1.0, 0.0, 1.0);
            (four.stiffness[l], four.chi[l]) = (0.0, 0.0);
            four.penetration[0][l] = part.side * work[layout.stretches + j];
            let Some(power @ Force::Power { law, stiffness, .. }) = part.force() else {
                four.does[l] = if part.acting.is_some() { Does::Else } else { Does::Nothing };
                continue;
            };
            let n = law.exponent.value();
            (four.side[l], four.exponent[l], four.chi[l]) = (part.side, n, power.chi(self.request.x));
            work[layout.of(j, PENETRATION)] = four.penetration[0][l];
            if !part.is_pressed() {
                four.does[l] = Does::Watched;
                continue;
            }
            four.stiffness[l] = part.side * stiffness;
            four.does[l] = if self.is_twin(owner, j, work) {
                Does::AsOwner
            } else if owner.contact != j && four.penetration[0][l] > 0.0 && !self.leaves_unfelt(j, n, work) {
                four.start[l] = four.penetration[0][l];
                Does::Pressed
            } else {
                Does::Alone(law)
            };
        }
    }

    /// The forces of four contacts along their directions at order `k`, and what of them is carried.
    #[inline(always)]
    fn forces<P: Path>(&self, owner: Owner, chunk: usize, four: &mut FourSeries, k: usize, work: &mut [f64]) {
        let layout = self.layout;
        let mut factor = [0.0; LANES];
        for l in 0..LANES {
            factor[l] = four.chi[l] * four.side[l] * four.rate[k][l] + if k == 0 { 1.0 } else { 0.0 };
        }
        four.factor[k] = factor;
        four.power[k] = four.powers::<P>(k);
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            if let Does::Alone(law) = four.does[l] {
                work[layout.of(j, PENETRATION) + k] = four.penetration[k][l];
                self.power(owner, j, law, k, work);
                four.power[k][l] = work[layout.of(j, POWER) + k];
            }
        }
        let sum = convolved::<P>(&four.power[..=k], &four.factor[..=k]);
        let mut force = [0.0; LANES];
        for l in 0..LANES {
            force[l] = four.stiffness[l] * sum[l];
        }
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            match four.does[l] {
                Does::Nothing | Does::Watched | Does::Pressed => {}
                // The owner's force, as its own clock gives it: what is equal stays equal to the last bit.
                Does::AsOwner => {
                    for which in [PENETRATION, FACTOR, POWER, FORCE, CARRIED] {
                        work[layout.of(j, which) + k] = work[layout.of(owner.contact, which) + k];
                    }
                    force[l] = work[layout.of(j, CARRIED) + k];
                }
                Does::Else => {
                    force[l] = self.linear_force(j, k, work);
                    work[layout.of(j, FORCE) + k] = force[l];
                    force[l] = if self.motion.parts[j].acting.is_some_and(|a| a.is_carried) { force[l] } else { 0.0 };
                    work[layout.of(j, CARRIED) + k] = force[l];
                }
                Does::Alone(_) => {
                    work[layout.of(j, FACTOR) + k] = factor[l];
                    work[layout.of(j, FORCE) + k] = force[l];
                    work[layout.of(j, CARRIED) + k] = force[l];
                }
            }
        }
        four.force[k] = force;
    }

    /// Whether contact `j` is equal to the owner, in its numbers and in its motion. The owner is the first of equals.
    pub(super) fn is_twin(&self, owner: Owner, j: usize, work: &[f64]) -> bool {
        let (s, x, i) = (self.s, self.request.x, owner.contact);
        let latched = |j: usize| s.contacts[j].latch.map(|latch| x[latch]);
        j > i
            && j < s.contacts.len()
            && s.symmetry.are_equal(i, j)
            && self.motion.parts[i].state == self.motion.parts[j].state
            && latched(i) == latched(j)
            && work[self.layout.stretches + i] == work[self.layout.stretches + j]
            && self.rate(i, 0, &x[s.n..], work) == self.rate(j, 0, &x[s.n..], work)
            // What else moves their bodies is equal too.
            && s.is_symmetric(&self.motion.mode, x)
    }

    /// `y`, its powers and `w = q y^(q−1)` at order `k`.
    fn clock_series(&self, owner: Owner, k: usize, work: &mut [f64]) {
        let layout = self.layout;
        let side = self.motion.parts[owner.contact].side;
        let q = owner.root as usize;
        if k > 0 {
            work[layout.y(1) + k] = self.h / k as f64 * side * work[layout.of(owner.contact, RATE) + k - 1];
        }
        for m in 2..q {
            work[layout.y(m) + k] = product(work, layout.y(m - 1), layout.y(1), k);
        }
        work[layout.clock + k] = match q {
            1 => f64::from(u8::from(k == 0)),
            _ => q as f64 * work[layout.y(q - 1) + k],
        };
    }

    /// The force of a contact without a power law at order `k`; that of one at rest follows from the accelerations.
    fn linear_force(&self, j: usize, k: usize, work: &mut [f64]) -> f64 {
        match self.motion.parts[j].force() {
            Some(Force::Linear { stiffness, damping }) => {
                self.spring(j, stiffness, k, work) + damping * work[self.layout.of(j, RATE) + k]
            }
            _ => 0.0,
        }
    }

    /// `k(t) (δ − σ b)` at order `k`.
    fn spring(&self, j: usize, stiffness: Elasticity, k: usize, work: &mut [f64]) -> f64 {
        let layout = self.layout;
        let (s, p) = (layout.of(j, STIFFNESS), layout.of(j, PENETRATION));
        let stretch = self.stretch(j, k, work);
        let at_order = match (stiffness, &self.s.contacts[j].spring) {
            (Elasticity::Constant(value), _) => return value * stretch,
            (Elasticity::Ramp { .. }, _) if k == 0 => self.s.stiffness_at(j, stiffness, self.request.at).0,
            // The elapsed time in the step's clock, times the slope.
            (Elasticity::Ramp { slope, .. }, _) => slope * self.h / k as f64 * work[layout.clock + k - 1],
            (_, Spring::Waves(mean, stiffness)) => waves(if k == 0 { *mean } else { 0.0 }, stiffness, k, work),
            (_, spring) => unreachable!("{stiffness:?} of {spring:?}"),
        };
        work[s + k] = at_order;
        work[p + k] = stretch;
        product(work, s, p, k)
    }

    /// Whether contact `j` is leaving and so near its end that the rest of its force changes neither its rate nor, in
    /// proportion, its penetration: with `p/|ṗ|` left, by `K p^(n+1)/(m ṗ²)`. Where it leaves together with the clock's
    /// owner its branch point would hold up every step.
    fn leaves_unfelt(&self, j: usize, n: f64, work: &[f64]) -> bool {
        let c = &self.s.contacts[j];
        let p = work[self.layout.of(j, PENETRATION)];
        let rate = self.motion.parts[j].side * work[self.layout.of(j, RATE)];
        rate < 0.0 && p > 0.0 && c.spec.stiffness.mean() * c.mobility * libm::pow(p, n + 1.0) <= UNFELT * rate * rate
    }

    /// `pⁿ` at order `k`.
    fn power(&self, owner: Owner, j: usize, law: PowerLaw, k: usize, work: &mut [f64]) {
        let layout = self.layout;
        let (p, u) = (layout.of(j, PENETRATION), layout.of(j, POWER));
        let exponent = law.exponent;
        if owner.contact == j && owner.root == exponent.q {
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
        // Another contact's clock, or plain time. If this contact starts here, p = θ^m β with m exact zeros in front
        // (the owner's q; twice as many from rest), and pⁿ = θ^(mn) βⁿ; βⁿ by the recurrence of a power of a series. Where mn
        // is not whole there is no power series: the force is left out, and the step so short that it changes nothing.
        let n = exponent.value();
        if k > 0 && work[u] == 0.0 && work[p] > 0.0 || k == 0 && self.leaves_unfelt(j, n, work) {
            work[u + k] = 0.0;
            return;
        }
        let m = work[p..=p + k].iter().position(|c| *c != 0.0);
        let Some(m) = m.filter(|m| (m * exponent.p as usize).is_multiple_of(exponent.q as usize)) else {
            work[u + k] = 0.0;
            return;
        };
        let shift = m * exponent.p as usize / exponent.q as usize;
        if k < shift {
            work[u + k] = 0.0;
            return;
        }
        let i = k - shift;
        work[u + k] = if i == 0 {
            libm::pow(work[p + m].max(0.0), n)
        } else {
            let sum: f64 = (1..=i).map(|l| (l as f64 * (n + 1.0) - i as f64) * work[p + m + l] * work[u + k - l]).sum();
            sum / (i as f64 * work[p + m])
        };
    }
}
