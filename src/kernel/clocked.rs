//! The recurrence, in the clock of the step, of all modes but linear ones of few degrees of freedom.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use smallvec::SmallVec;

use super::{
    Elasticity, Expansion, FACTOR, FORCE, Force, LANES, Layout, ORDER, PENETRATION, POWER, RATE, ROW, STIFFNESS,
    clock::StepClock,
    compiled::{BlockRows, Four, MOST_BLOCKS, View},
    fours::{Does, FourSeries, convolved},
    product, waves,
};
use crate::{
    gear::contact::PowerLaw,
    hybrid::Jet,
    system::{Spring, Watch},
    vectors::Path,
};

/// A change this much smaller than what it changes is far below rounding.
const UNFELT: f64 = f64::EPSILON / 64.0;

/// Room for the series.
#[derive(Debug, Default)]
pub(super) struct Room {
    /// Of the contacts.
    pub fours: Vec<FourSeries>,
    /// Of displacements, velocities and accelerations, in blocks of four, order by order; zero beyond the last degree of freedom.
    pub displacements: Vec<Four>,
    pub velocities: Vec<Four>,
    pub accelerations: Vec<Four>,
    /// Forces of one order.
    forces: Vec<f64>,
}

impl Expansion<'_> {
    /// All coefficients: in the `clock` of a step with closed power laws, else in plain time.
    #[inline(always)]
    pub(super) fn in_clock<P: Path>(&self, path: P, clock: Option<&StepClock>, out: &mut Jet) {
        macro_rules! sizes {
            ($($b:literal)*) => {
                match self.motion.compiled.together {
                    $($b => self.recur::<P, $b>(path, clock, out),)*
                    blocks => unreachable!("{blocks} blocks, more than {MOST_BLOCKS}"),
                }
            };
        }
        sizes!(1 2 3 4 5 6);
    }

    /// The recurrence on B blocks of degrees of freedom together, several such panels in large trains.
    #[inline(always)]
    fn recur<P: Path, const B: usize>(&self, path: P, clock: Option<&StepClock>, out: &mut Jet) {
        let (presses, clock) = (clock.is_some(), clock.unwrap_or(&StepClock::TIME));
        let (s, h, compiled) = (self.s, self.h, &self.motion.compiled);
        let (n, dim, panels) = (s.n, s.dim, compiled.blocks.len());
        let Jet { state, work, time, .. } = out;
        time.clear();
        if !clock.is_plain() {
            time.resize(ORDER + 1, 0.0);
        }
        let terms = clock.terms();
        self.begin_clock(clock, work);
        let mut rows: SmallVec<[BlockRows<'_, B>; 1]> = SmallVec::new();
        for blocks in &compiled.blocks {
            let Some(of_panel) = blocks.rows() else { unreachable!("not {B} blocks") };
            rows.push(of_panel);
        }
        let mut groups: SmallVec<[View<'_, B, 1>; 4]> = SmallVec::new();
        for group in &compiled.groups {
            groups.push(group.view());
        }
        // Every number is written before it is read, but for zeros beyond the last degree of freedom and the last contact.
        let Room { fours, displacements, velocities, accelerations, forces } = &mut *self.motion.room.borrow_mut();
        fours.resize_with(groups.len(), FourSeries::default);
        forces.resize(LANES * fours.len(), 0.0);
        let [displacements, velocities, accelerations] = [displacements, velocities, accelerations].map(|rows| {
            rows.resize(ROW * panels * B, [0.0; LANES]);
            rows.as_chunks_mut::<B>().0
        });
        displacements.as_flattened_mut().as_flattened_mut()[..n].copy_from_slice(&self.request.x[..n]);
        velocities.as_flattened_mut().as_flattened_mut()[..n].copy_from_slice(&self.request.x[n..2 * n]);
        let mut weights = [0.0; ROW];
        for k in 0..=ORDER {
            let (at, next) = (k * panels, (k + 1) * panels);
            let (q, v) = (&displacements[at..next], &velocities[at..next]);
            for (chunk, (four, group)) in fours.iter_mut().zip(&groups).enumerate() {
                self.rates(path, (chunk, group), four, (k, terms), v, work);
            }
            if let Some(owner) = clock.owner.filter(|_| !clock.is_plain()) {
                let rate = if k > 0 { fours[owner / LANES].rate[k - 1][owner % LANES] } else { 0.0 };
                self.clock_series(owner, clock.root, rate, k, work);
            }
            for (chunk, (four, force)) in fours.iter_mut().zip(forces.as_chunks_mut().0).enumerate() {
                if k == 0 {
                    self.begin((clock, presses), chunk, four, work);
                }
                *force = self.forces(path, clock, chunk, four, k, work);
            }
            let waves = |i: usize| [0, ROW].map(|sine| work[Layout::oscillator(i) + sine + k]);
            let flat = [q.as_flattened().as_flattened(), v.as_flattened().as_flattened()];
            for (panel, of_panel) in rows.iter().enumerate() {
                let a = of_panel.at(path, k, (flat, [&q[panel], &v[panel]]), waves, forces);
                for b in 0..B {
                    accelerations[at + panel][b] = path.numbers(a[b]);
                }
            }
            if let Some(held) = &self.motion.held {
                self.hold(held, k, accelerations[at..next].as_flattened_mut().as_flattened_mut(), work);
            }
            if k == ORDER {
                break;
            }
            let (step, last) = (h / (k + 1) as f64, k.min(terms - 1));
            let clock_row = &work[self.layout.clock..=self.layout.clock + last];
            weights.iter_mut().zip(clock_row).for_each(|(w, rate)| *w = step * rate);
            let weights = &weights[..=last];
            for panel in 0..panels {
                displacements[next + panel] = convolved(path, weights, velocities, panels, at + panel);
                velocities[next + panel] = convolved(path, weights, accelerations, panels, at + panel);
            }
            if let Some(time) = time.get_mut(k + 1) {
                *time = step * work[self.layout.clock + k];
            }
            for (i, o) in s.oscillators.iter().enumerate() {
                let c = Layout::oscillator(i);
                let [mut cosine, mut sine] = [0.0; 2];
                for (i, w) in weights.iter().enumerate() {
                    let at = c + k - i;
                    cosine -= w * work[at + ROW];
                    sine += w * work[at];
                }
                (work[c + k + 1], work[c + ROW + k + 1]) = (o.omega * cosine, o.omega * sine);
            }
        }
        let orders = displacements.chunks_exact(panels).zip(velocities.chunks_exact(panels));
        for (row, (q, v)) in state.chunks_exact_mut(dim).zip(orders).skip(1) {
            let (to_q, to_v) = row[..2 * n].split_at_mut(n);
            for (to, from) in [(to_q, q), (to_v, v)] {
                match (to.as_chunks_mut::<LANES>().0.first_chunk_mut::<B>(), from) {
                    // Of a size that is known when this is compiled.
                    (Some(to), [from]) if n == LANES * B => *to = *from,
                    _ => to.copy_from_slice(&from.as_flattened().as_flattened()[..n]),
                }
            }
        }
        fours.iter().enumerate().for_each(|(chunk, four)| self.keep(chunk, four, work));
    }

    /// Writes the series of four contacts one after the other, as far as they are not there.
    #[inline(always)]
    fn keep(&self, chunk: usize, four: &FourSeries, work: &mut [f64]) {
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            let mut write = |which: usize, lanes: &[[f64; LANES]; ROW]| {
                if let Some(row) = work[self.layout.of(j, which)..].first_chunk_mut::<ROW>() {
                    row.iter_mut().zip(lanes).for_each(|(c, lanes)| *c = lanes[l]);
                }
            };
            write(RATE, &four.rate);
            if !matches!(four.does[l], Does::Nothing | Does::Else) {
                write(PENETRATION, &four.penetration);
                write(FACTOR, &four.factor);
                write(FORCE, &four.force);
                if let Some(row) = work[self.layout.of(j, POWER)..].first_chunk_mut::<ROW>() {
                    row.iter_mut().zip(four.backward.iter().rev()).for_each(|(c, lanes)| *c = lanes[l]);
                }
            }
        }
    }

    /// Rates of four contacts at order `k`, and their deflections, the integrals of `w δ̇`, w of so many terms.
    #[inline(always)]
    fn rates<P: Path, const B: usize>(
        &self,
        path: P,
        (chunk, group): (usize, &View<'_, B, 1>),
        four: &mut FourSeries,
        (k, terms): (usize, usize),
        v: &[[Four; B]],
        work: &mut [f64],
    ) {
        // One sum in the order of the bodies: what is equal stays equal to the last bit.
        let mut rate = path.all(0.0);
        for (panel, directions) in group.panels.iter().zip(group.directions) {
            for b in 0..B {
                for l in 0..LANES {
                    rate = path.fused(path.four(directions[b][l][0]), path.all(v[*panel][b][l]), rate);
                }
            }
        }
        for (index, [[cosine], [sine]]) in group.waves.0.iter().zip(group.waves.1) {
            let o = Layout::oscillator(*index) + k;
            rate = path.fused(path.four(*cosine), path.all(work[o]), rate);
            rate = path.fused(path.four(*sine), path.all(work[o + ROW]), rate);
        }
        let mut rate = path.numbers(rate);
        if k == 0 && !self.request.still.is_empty() {
            let contacts = LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES);
            contacts.zip(&mut rate).filter(|(j, _)| self.is_still(*j)).for_each(|(_, rate)| *rate = 0.0);
        }
        four.rate[k] = rate;
        if k == 0 {
            let rows = (LANES * chunk..self.s.contacts.len()).map(|j| self.layout.of(j, RATE));
            rows.zip(rate).for_each(|(row, rate)| work[row] = rate);
        }
        let at = self.layout.deflection(LANES * chunk, k);
        if k > 0 {
            let terms = terms.min(k);
            let clock = &work[self.layout.clock..self.layout.clock + terms];
            let [sum] = convolved(path, clock, four.rate.as_chunks().0, 1, k - 1);
            let deflection = path.times(path.all(self.h / k as f64), path.four(sum));
            four.penetration[k] = path.numbers(path.times(path.four(four.side), deflection));
            work[at..at + LANES].copy_from_slice(&path.numbers(deflection));
        }
    }

    /// What the contacts of four do, from their penetrations at order zero on. A closed power law `presses` unless it is leaving at this
    /// very instant.
    fn begin(&self, (clock, presses): (&StepClock, bool), chunk: usize, four: &mut FourSeries, work: &mut [f64]) {
        let layout = self.layout;
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            let part = &self.motion.parts[j];
            (four.side[l], four.exponent[l], four.start[l]) = (1.0, 0.0, 1.0);
            (four.stiffness[l], four.chi[l], four.elastic[l]) = (0.0, 0.0, 0.0);
            let c = &self.s.contacts[j];
            (four.per_across[l], four.weight[l]) = (c.across.recip(), c.weight);
            four.penetration[0][l] = part.side * work[layout.stretches + j];
            let Some(power @ Force::Power { law, stiffness, .. }) = part.force() else {
                four.does[l] = if part.acting.is_some() { Does::Else } else { Does::Nothing };
                continue;
            };
            let n = law.exponent.value();
            (four.side[l], four.exponent[l], four.chi[l]) = (part.side, n, power.chi(self.request.x));
            work[layout.of(j, PENETRATION)] = four.penetration[0][l];
            if !part.is_pressed() || !presses {
                four.does[l] = Does::Watched;
                continue;
            }
            four.stiffness[l] = part.side * stiffness;
            let rate = part.side * four.rate[0][l];
            four.does[l] = if self.motion.goes_with(clock.owner.filter(|_| !clock.is_plain()), j, self.request.x, work)
            {
                Does::AsOwner(law)
            } else if clock.owner != Some(j) && four.penetration[0][l] > 0.0 && !self.leaves_unfelt(j, law, rate, work)
            {
                four.start[l] = four.penetration[0][l];
                four.elastic[l] = law.exponent.power(four.start[l]);
                Does::Pressed
            } else {
                Does::Alone(law)
            };
        }
        let is_lone = |does: &Does| matches!(does, Does::Alone(_) | Does::AsOwner(_) | Does::Else);
        four.is_mixed = four.does.iter().any(is_lone);
    }

    /// The forces of four contacts along their directions that are carried at order `k`.
    #[inline(always)]
    fn forces<P: Path>(
        &self,
        path: P,
        clock: &StepClock,
        chunk: usize,
        four: &mut FourSeries,
        k: usize,
        work: &mut [f64],
    ) -> [f64; LANES] {
        let rate = four.rate[k];
        let by_rate = path.times(path.four(four.chi), path.four(four.side));
        let factor = path.times(by_rate, path.four(rate));
        four.factor[k] = path.numbers(if k == 0 { path.plus(factor, path.all(1.0)) } else { factor });
        let [power, product] = four.powers(path, k);
        let mut power = path.numbers(power);
        if four.is_mixed {
            self.lone_powers(clock, chunk, four, k, &mut power, work);
        }
        *four.power(k) = power;
        let all = path.fused(path.four(four.factor[0]), path.four(power), product);
        let mut force = path.numbers(path.times(path.four(four.stiffness), all));
        if four.is_mixed {
            self.other_forces(chunk, four, k, &mut force, work);
        }
        four.force[k] = force;
        force
    }

    /// The powers of penetrations at order `k` that have a way of their own.
    // A call of its own keeps the recurrence small.
    #[inline(never)]
    fn lone_powers(
        &self,
        clock: &StepClock,
        chunk: usize,
        four: &FourSeries,
        k: usize,
        power: &mut [f64; LANES],
        work: &mut [f64],
    ) {
        let layout = self.layout;
        for (l, does) in four.does.iter().enumerate() {
            let j = LANES * chunk + l;
            match (does, clock.owner) {
                (Does::Alone(law), _) => {
                    work[layout.of(j, PENETRATION) + k] = four.penetration[k][l];
                    self.power(clock, j, *law, (k, four.side[l] * four.rate[0][l]), work);
                    power[l] = work[layout.of(j, POWER) + k];
                }
                // What is equal stays equal to the last bit.
                (Does::AsOwner(law), Some(owner)) => {
                    let (own, apart) = (layout.of(owner, PENETRATION) + k, layout.of(j, STIFFNESS));
                    work[apart + k] = four.penetration[k][l] - work[own];
                    let slope = layout.y((law.exponent.p - law.exponent.q) as usize);
                    let changed = law.exponent.value() * super::product(work, slope, apart, k);
                    power[l] = work[layout.of(owner, POWER) + k] + changed;
                }
                _ => {}
            }
        }
    }

    /// The forces at order `k` of contacts without a power law.
    #[inline(never)]
    fn other_forces(&self, chunk: usize, four: &FourSeries, k: usize, force: &mut [f64; LANES], work: &mut [f64]) {
        for (l, _) in four.does.iter().enumerate().filter(|(_, does)| matches!(does, Does::Else)) {
            let j = LANES * chunk + l;
            // Formed where it is zero too: a stiffness that varies and its stretch are read again at later orders.
            let formed = self.linear_force(j, four.rate[k][l], k, work);
            let law = if k == 0 && self.pinned(j, Watch::Force) { 0.0 } else { formed };
            work[self.layout.of(j, FORCE) + k] = law;
            force[l] = if self.motion.parts[j].acting.is_some_and(|a| a.is_carried) { law } else { 0.0 };
        }
    }

    /// The force of a contact without a power law at order `k`; that of one at rest follows from the accelerations.
    fn linear_force(&self, j: usize, rate: f64, k: usize, work: &mut [f64]) -> f64 {
        match self.motion.parts[j].force() {
            Some(Force::Linear { stiffness, damping }) => self.spring(j, stiffness, k, work) + damping * rate,
            _ => 0.0,
        }
    }

    /// `k(t) (δ − σ b)` at order `k`.
    pub(super) fn spring(&self, j: usize, stiffness: Elasticity, k: usize, work: &mut [f64]) -> f64 {
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
    fn leaves_unfelt(&self, j: usize, law: PowerLaw, rate: f64, work: &[f64]) -> bool {
        let c = &self.s.contacts[j];
        let p = work[self.layout.of(j, PENETRATION)];
        let energy = |p: f64| c.spec.stiffness.mean() * c.mobility * law.exponent.power(p) * p;
        rate < 0.0 && p > 0.0 && energy(p) <= UNFELT * rate * rate
    }

    /// `pⁿ` at order `k` of a contact with the `rate` ṗ at the start.
    fn power(&self, clock: &StepClock, j: usize, law: PowerLaw, (k, rate): (usize, f64), work: &mut [f64]) {
        let layout = self.layout;
        let (p, u) = (layout.of(j, PENETRATION), layout.of(j, POWER));
        let exponent = law.exponent;
        if clock.owner == Some(j) && clock.root == exponent.q {
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
        if k > 0 && work[u] == 0.0 && work[p] > 0.0 || k == 0 && self.leaves_unfelt(j, law, rate, work) {
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
            exponent.power(work[p + m].max(0.0))
        } else {
            let sum: f64 = (1..=i).map(|l| (l as f64 * (n + 1.0) - i as f64) * work[p + m + l] * work[u + k - l]).sum();
            sum / (i as f64 * work[p + m])
        };
    }
}
