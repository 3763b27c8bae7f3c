//! The recurrence, in the clock of the step, of all modes but linear ones of few degrees of freedom.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use smallvec::SmallVec;

use super::{
    clock::StepClock,
    fours::{ContactAction, FourSeries, convolved},
};
use crate::{
    hybrid::Jet,
    kernel::{
        Elasticity, Expansion, Force, Four, LANES, ORDER, ROW, Series, StepRows,
        mode::compiled::{BlockRows, MOST_BLOCKS, View},
        product, waves,
    },
    system::{ActiveContact, Spring, Watch},
    vectors::Path,
};

/// Buffers of the series.
#[derive(Debug, Default)]
pub struct Room {
    /// Series of the contacts.
    pub fours: Vec<FourSeries>,
    /// Displacements (then velocities, accelerations) in blocks of four, order by order; zero beyond the last degree of freedom.
    pub displacements: Vec<Four>,
    pub velocities: Vec<Four>,
    pub accelerations: Vec<Four>,
    /// Forces of one order.
    forces: Vec<f64>,
}

impl Expansion<'_> {
    /// Forms all coefficients: in the `clock` of a step with closed power laws, else in plain time.
    #[inline(always)]
    pub fn in_clock<P: Path>(&self, path: P, clock: Option<&StepClock>, out: &mut Jet) {
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

    /// Runs the recurrence on B blocks of degrees of freedom together, several such panels in large trains.
    #[inline(always)]
    fn recur<P: Path, const B: usize>(&self, path: P, clock: Option<&StepClock>, out: &mut Jet) {
        let (presses, clock) = (clock.is_some(), clock.unwrap_or(&StepClock::TIME));
        let (s, h, compiled) = (self.s, self.h, &self.motion.compiled);
        let (n, dim, panels) = (s.n, s.dim, compiled.blocks.len());
        let Jet { state, rows, time, .. } = out;
        time.clear();
        if !clock.is_plain() {
            time.resize(ORDER + 1, 0.0);
        }
        let terms = clock.terms();
        self.begin_clock(clock, rows);
        let mut panel_rows: SmallVec<[BlockRows<'_, B>; 1]> = SmallVec::new();
        for blocks in &compiled.blocks {
            let Some(of_panel) = blocks.rows() else { unreachable!("not {B} blocks") };
            panel_rows.push(of_panel);
        }
        let mut groups: SmallVec<[View<'_, B, 1>; 4]> = SmallVec::new();
        for group in &compiled.groups {
            groups.push(group.view());
        }
        // Every number is written before it is read, except zeros beyond the last degree of freedom and the last contact.
        let Room { fours, displacements, velocities, accelerations, forces } = &mut *self.room.borrow_mut();
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
                self.rates(path, (chunk, group), four, (k, terms), v, rows);
            }
            if let Some(owner) = clock.owner.filter(|_| !clock.is_plain()) {
                let rate = if k > 0 { fours[owner / LANES].rate[k - 1][owner % LANES] } else { 0.0 };
                self.clock_series(owner, clock.root, rate, k, rows);
            }
            for (chunk, (four, force)) in fours.iter_mut().zip(forces.as_chunks_mut().0).enumerate() {
                if k == 0 {
                    self.begin((clock, presses), chunk, four, rows);
                }
                *force = self.forces(path, clock, chunk, four, k, rows);
            }
            let waves = |i: usize| rows.oscillators[i].each_ref().map(|series| series[k]);
            let flat = [q.as_flattened().as_flattened(), v.as_flattened().as_flattened()];
            for (panel, of_panel) in panel_rows.iter().enumerate() {
                let a = of_panel.at(path, k, (flat, [&q[panel], &v[panel]]), waves, forces);
                for b in 0..B {
                    accelerations[at + panel][b] = path.numbers(a[b]);
                }
            }
            if let Some(held) = &self.motion.held {
                self.hold(held, k, accelerations[at..next].as_flattened_mut().as_flattened_mut(), rows);
            }
            if k == ORDER {
                break;
            }
            let (step, last) = (h / (k + 1) as f64, k.min(terms - 1));
            let clock_row = &rows.clock.weight[..=last];
            weights.iter_mut().zip(clock_row).for_each(|(w, rate)| *w = step * rate);
            let weights = &weights[..=last];
            for panel in 0..panels {
                displacements[next + panel] = convolved(path, weights, velocities, panels, at + panel);
                velocities[next + panel] = convolved(path, weights, accelerations, panels, at + panel);
            }
            if let Some(time) = time.get_mut(k + 1) {
                *time = step * rows.clock.weight[k];
            }
            for (i, o) in s.oscillators.iter().enumerate() {
                let [of_cosine, of_sine] = &mut rows.oscillators[i];
                let [mut cosine, mut sine] = [0.0; 2];
                for (i, w) in weights.iter().enumerate() {
                    cosine -= w * of_sine[k - i];
                    sine += w * of_cosine[k - i];
                }
                (of_cosine[k + 1], of_sine[k + 1]) = (o.omega * cosine, o.omega * sine);
            }
        }
        let orders = displacements.chunks_exact(panels).zip(velocities.chunks_exact(panels));
        for (row, (q, v)) in state.chunks_exact_mut(dim).zip(orders).skip(1) {
            let (to_q, to_v) = row[..2 * n].split_at_mut(n);
            for (to, from) in [(to_q, q), (to_v, v)] {
                match (to.as_chunks_mut::<LANES>().0.first_chunk_mut::<B>(), from) {
                    (Some(to), [from]) if n == LANES * B => *to = *from, // of a size known when this is compiled
                    _ => to.copy_from_slice(&from.as_flattened().as_flattened()[..n]),
                }
            }
        }
        fours.iter().enumerate().for_each(|(chunk, four)| self.keep(chunk, four, rows));
    }

    /// Writes those series of four contacts, one after the other, that are not yet in the rows.
    #[inline(always)]
    fn keep(&self, chunk: usize, four: &FourSeries, rows: &mut StepRows) {
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            let write = |row: &mut Series, lanes: &[Four; ROW]| {
                row.iter_mut().zip(lanes).for_each(|(c, lanes)| *c = lanes[l]);
            };
            let contact = &mut rows.contacts[j];
            write(&mut contact.rate, &four.rate);
            if !matches!(four.does[l], ContactAction::Nothing | ContactAction::Else) {
                write(&mut contact.force, &four.force);
            }
            if matches!(
                four.does[l],
                ContactAction::Watched | ContactAction::Pressed | ContactAction::AsOwner(_) | ContactAction::Alone(_)
            ) {
                write(&mut contact.penetration, &four.penetration);
                write(&mut contact.factor, &four.factor);
                contact.power.iter_mut().zip(four.backward.iter().rev()).for_each(|(c, lanes)| *c = lanes[l]);
            }
        }
    }

    /// Forms the rates of four contacts at order `k`, and their deflections, the integrals of `w δ̇`; w has a given number of terms.
    #[inline(always)]
    fn rates<P: Path, const B: usize>(
        &self,
        path: P,
        (chunk, group): (usize, &View<'_, B, 1>),
        four: &mut FourSeries,
        (k, terms): (usize, usize),
        v: &[[Four; B]],
        rows: &mut StepRows,
    ) {
        // One sum in the order of the bodies: equal contacts stay equal to the last bit.
        let mut rate = path.all(0.0);
        for (panel, directions) in group.panels.iter().zip(group.directions) {
            for b in 0..B {
                for l in 0..LANES {
                    rate = path.fused(path.four(directions[b][l][0]), path.all(v[*panel][b][l]), rate);
                }
            }
        }
        for (index, [[cosine], [sine]]) in group.waves.0.iter().zip(group.waves.1) {
            let [of_cosine, of_sine] = &rows.oscillators[*index];
            rate = path.fused(path.four(*cosine), path.all(of_cosine[k]), rate);
            rate = path.fused(path.four(*sine), path.all(of_sine[k]), rate);
        }
        let mut rate = path.numbers(rate);
        if k == 0 && !self.request.still.is_empty() {
            let contacts = LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES);
            contacts.zip(&mut rate).filter(|(j, _)| self.is_still(*j)).for_each(|(_, rate)| *rate = 0.0);
        }
        four.rate[k] = rate;
        if k == 0 {
            rows.contacts[LANES * chunk..].iter_mut().zip(rate).for_each(|(contact, rate)| contact.rate[0] = rate);
        }
        if k > 0 {
            let terms = terms.min(k);
            let clock = &rows.clock.weight[..terms];
            let [sum] = convolved(path, clock, four.rate.as_chunks().0, 1, k - 1);
            let deflection = path.times(path.all(self.h / k as f64), path.four(sum));
            four.penetration[k] = path.numbers(path.times(path.four(four.side), deflection));
            rows.deflections[chunk][k] = path.numbers(deflection);
        }
    }

    /// Sets the kind, the constants and order zero of each contact of `four`, from its penetration. A closed power law `presses` unless it
    /// leaves at this very instant.
    fn begin(&self, (clock, presses): (&StepClock, bool), chunk: usize, four: &mut FourSeries, rows: &mut StepRows) {
        for (l, j) in (LANES * chunk..self.s.contacts.len().min(LANES * chunk + LANES)).enumerate() {
            let part = &self.motion.parts[j];
            (four.side[l], four.exponent[l], four.start[l]) = (1.0, 0.0, 1.0);
            (four.stiffness[l], four.chi[l], four.elastic[l]) = (0.0, 0.0, 0.0);
            let c = &self.s.contacts[j];
            (four.per_across[l], four.weight[l]) = (c.across.recip(), c.weight);
            four.penetration[0][l] = part.side * rows.stretch(j);
            (four.spring[l], four.damping[l], four.carried[l]) = (0.0, 0.0, 0.0);
            let Some(power @ Force::Power { law, stiffness, .. }) = part.force() else {
                four.does[l] = match part.acting {
                    None => ContactAction::Nothing,
                    Some(ActiveContact {
                        force: Force::Linear { stiffness: Elasticity::Constant(k), damping },
                        is_carried,
                        ..
                    }) => {
                        (four.spring[l], four.damping[l]) = (k, damping);
                        four.carried[l] = f64::from(u8::from(is_carried));
                        ContactAction::Spring
                    }
                    Some(_) => ContactAction::Else,
                };
                continue;
            };
            let n = law.exponent.value();
            (four.side[l], four.exponent[l], four.chi[l]) = (part.side, n, power.chi(self.request.x));
            rows.contacts[j].penetration[0] = four.penetration[0][l];
            if !part.is_pressed() || !presses {
                four.does[l] = ContactAction::Watched;
                continue;
            }
            four.stiffness[l] = part.side * stiffness;
            let rate = part.side * four.rate[0][l];
            four.does[l] = if self.motion.goes_with(clock.owner.filter(|_| !clock.is_plain()), j, self.request.x, rows)
            {
                ContactAction::AsOwner(law)
            } else if clock.owner != Some(j) && four.penetration[0][l] > 0.0 && !self.leaves_unfelt(j, law, rate, rows)
            {
                four.start[l] = four.penetration[0][l];
                four.elastic[l] = law.exponent.power(four.start[l]);
                ContactAction::Pressed
            } else {
                ContactAction::Alone(law)
            };
        }
        let any = |is: fn(&ContactAction) -> bool| four.does.iter().any(is);
        [four.has_power, four.has_lone, four.has_spring, four.has_other] = [
            any(|does| does.presses() || matches!(does, ContactAction::Watched)),
            any(|does| matches!(does, ContactAction::Alone(_) | ContactAction::AsOwner(_))),
            any(|does| matches!(does, ContactAction::Spring)),
            any(|does| matches!(does, ContactAction::Else)),
        ];
    }

    /// Returns the carried forces of four contacts along their directions at order `k`.
    #[inline(always)]
    fn forces<P: Path>(
        &self,
        path: P,
        clock: &StepClock,
        chunk: usize,
        four: &mut FourSeries,
        k: usize,
        rows: &mut StepRows,
    ) -> [f64; LANES] {
        let rate = path.four(four.rate[k]);
        // Forces by the laws, and their carried parts.
        let [mut laws, mut carried] = [path.all(0.0); 2];
        if four.has_power {
            let by_rate = path.times(path.four(four.chi), path.four(four.side));
            let factor = path.times(by_rate, rate);
            four.factor[k] = path.numbers(if k == 0 { path.plus(factor, path.all(1.0)) } else { factor });
            let [power, product] = four.powers(path, k);
            let mut power = path.numbers(power);
            if four.has_lone {
                self.lone_powers(clock, chunk, four, k, &mut power, rows);
            }
            *four.power(k) = power;
            let all = path.fused(path.four(four.factor[0]), path.four(power), product);
            carried = path.times(path.four(four.stiffness), all);
            laws = carried;
        }
        if four.has_spring {
            let first = LANES * chunk;
            let stretch = if k == 0 { rows.stretches[chunk] } else { rows.deflections[chunk][k] };
            let spring = path.times(path.four(four.spring), path.four(stretch));
            let mut force = path.fused(path.four(four.damping), rate, spring);
            if k == 0 && !self.request.pinned.is_empty() {
                let mut numbers = path.numbers(force);
                let zero = |l: usize| first + l < self.s.contacts.len() && self.pinned(first + l, Watch::Force);
                numbers.iter_mut().enumerate().filter(|(l, _)| zero(*l)).for_each(|(_, force)| *force = 0.0);
                force = path.four(numbers);
            }
            laws = path.plus(laws, force);
            carried = path.fused(path.four(four.carried), force, carried);
        }
        four.force[k] = path.numbers(laws);
        let mut carried = path.numbers(carried);
        if four.has_other {
            self.other_forces(chunk, four, k, &mut carried, rows);
        }
        carried
    }

    /// Forms the forces at order `k` of contacts whose stiffness is a series; those at rest follow from the accelerations.
    #[inline(never)]
    fn other_forces(&self, chunk: usize, four: &FourSeries, k: usize, carried: &mut [f64; LANES], rows: &mut StepRows) {
        for (l, _) in four.does.iter().enumerate().filter(|(_, does)| matches!(does, ContactAction::Else)) {
            let j = LANES * chunk + l;
            let Some(ActiveContact { force: Force::Linear { stiffness, damping }, is_carried, .. }) =
                self.motion.parts[j].acting
            else {
                continue;
            };
            // Formed even if it is zero: later orders read a varying stiffness and its stretch again.
            let formed = self.spring(j, stiffness, k, rows) + damping * four.rate[k][l];
            let force = if k == 0 && self.pinned(j, Watch::Force) { 0.0 } else { formed };
            rows.contacts[j].force[k] = force;
            carried[l] = if is_carried { force } else { 0.0 };
        }
    }

    /// Returns `k(t) (δ − σ b)` at order `k`.
    pub fn spring(&self, j: usize, stiffness: Elasticity, k: usize, rows: &mut StepRows) -> f64 {
        let stretch = self.stretch(j, k, rows);
        let at_order = match (stiffness, &self.s.contacts[j].spring) {
            (Elasticity::Constant(value), _) => return value * stretch,
            (Elasticity::Ramp { .. }, _) if k == 0 => self.s.stiffness_at(j, stiffness, self.request.at).0,
            // Elapsed time in the clock of the step, times the slope.
            (Elasticity::Ramp { slope, .. }, _) => slope * self.h / k as f64 * rows.clock.weight[k - 1],
            (_, Spring::Waves(mean, stiffness)) => waves(if k == 0 { *mean } else { 0.0 }, stiffness, k, rows),
            (_, spring) => unreachable!("{stiffness:?} of {spring:?}"),
        };
        let contact = &mut rows.contacts[j];
        (contact.stiffness[k], contact.penetration[k]) = (at_order, stretch);
        product(&contact.stiffness, &contact.penetration, k)
    }
}
