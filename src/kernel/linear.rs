//! Linear modes in plain time: the fast path.
//!
//! With every closed law linear, the mode is `q̈ = A_q q + A_v q̇ + f(t)` up to the contacts whose stiffness
//! is itself a series. The forces of closed contacts are formed from their deflections, and the recurrence runs on
//! blocks of four degrees of freedom and of four contacts, each a vector.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use smallvec::{SmallVec, smallvec};

use super::{
    Expansion, FORCE, LANES, Layout, ORDER, ROW,
    clock::StepClock,
    compiled::{Blocks, Four, MOST_BLOCKS, MOST_GROUPED, View, group_size},
    motion::ContactInMode,
};
use crate::{
    hybrid::Jet,
    system::{Elasticity, Force, Watch},
    vectors::{Path, Work},
};

/// The recurrence, compiled once for each set of instructions.
struct Recurrence<'a, 'b> {
    expansion: &'a Expansion<'b>,
    out: &'a mut Jet,
}

impl Work for Recurrence<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, path: P) {
        let Self { expansion: e, out } = self;
        macro_rules! sizes {
            ($($b:literal)*) => {
                match (e.s.columns.blocks.len(), group_size(e.s.columns.fours.len())) {
                    $(($b, 1) => e.recurrence::<P, $b, 1>(path, out),
                    ($b, 2) => e.recurrence::<P, $b, 2>(path, out),
                    ($b, MOST_GROUPED) => e.recurrence::<P, $b, MOST_GROUPED>(path, out),)*
                    sizes => unreachable!("blocks and fours {sizes:?}, more than {MOST_BLOCKS} and {MOST_GROUPED}"),
                }
            };
        }
        sizes!(1 2 3 4 5 6);
    }
}

impl Expansion<'_> {
    /// Forms all coefficients of a linear mode.
    pub(super) fn linear(&self, out: &mut Jet) {
        if self.motion.is_varying {
            self.begin_clock(&StepClock::TIME, &mut out.work);
        }
        self.s.instructions.run(Recurrence { expansion: self, out });
        if self.keeps_low() {
            let carried = self.motion.parts.iter().map(ContactInMode::carried_linear).enumerate();
            let constant = |(j, law)| match law {
                Some((Elasticity::Constant(k), _)) => Some((j, k)),
                _ => None,
            };
            self.low(carried.filter_map(constant).collect(), out);
        }
    }

    /// Forms the orders, each a row of displacements and velocities in blocks of four, zero beyond the last degree of freedom. No vector is
    /// read where single numbers have just been written, which would stall.
    #[inline(always)]
    fn recurrence<P: Path, const B: usize, const C: usize>(&self, path: P, out: &mut Jet) {
        let (s, h, n, layout) = (self.s, self.h, self.s.n, self.layout);
        out.time.clear();
        let varying = self.motion.is_varying;
        let compiled = &self.motion.compiled;
        let Some(rows) = compiled.blocks.first().and_then(Blocks::rows::<B>) else { unreachable!("not {B} blocks") };
        let mut groups: SmallVec<[View<'_, B, C>; 1]> = SmallVec::new();
        for group in &compiled.groups {
            groups.push(group.view());
        }
        let (work, orders) = out.work.split_at_mut(layout.orders);
        let (orders, waves) = orders.split_at_mut(layout.waves - layout.orders);
        let orders = orders.as_chunks_mut::<LANES>().0.as_chunks_mut::<B>().0.as_chunks_mut::<2>().0;
        let Some(orders) = orders.first_chunk_mut::<ROW>() else { unreachable!("no room for {ROW} orders") };
        let (waves, count) = (waves.as_chunks_mut::<2>().0, s.oscillators.len());
        orders[0] = [[[0.0; LANES]; B]; 2];
        for (fours, x) in orders[0].iter_mut().zip(self.request.x.chunks_exact(n)) {
            fours.as_flattened_mut()[..n].copy_from_slice(x);
        }
        for (i, wave) in waves[..count].iter_mut().enumerate() {
            let o = Layout::oscillator(i);
            *wave = [work[o], work[o + ROW]];
        }
        let mut forces: SmallVec<[Four; 4]> = smallvec![[0.0; LANES]; C * compiled.groups.len()];
        let forces = forces.as_mut_slice();
        let starts = work[layout.stretches..layout.sizes].as_chunks::<LANES>().0;
        let mut stretches: SmallVec<[Four; 4]> = SmallVec::from_slice(starts);
        for k in 0..ORDER {
            let step = h / (k + 1) as f64;
            let ([.., [q, v]], [next, ..]) = orders.split_at_mut(k + 1) else { unreachable!("no order {k}") };
            let (row, next_waves) = waves[k * count..].split_at_mut(count);
            self.contacts(path, (k, step), &groups, (v, row), [forces, &mut stretches], work);
            let of = |i: usize| row[i];
            let flat = [q.as_flattened(), v.as_flattened()];
            let mut a = rows.at(path, k, (flat, [q, v]), of, forces.as_flattened());
            if varying {
                let mut sums = a.map(|four| path.numbers(four));
                self.varying_forces(k, flat[1], sums.as_flattened_mut(), work);
                a = sums.map(|four| path.four(four));
            }
            let by = path.all(step);
            for b in 0..B {
                next[0][b] = path.numbers(path.times(by, path.four(v[b])));
                next[1][b] = path.numbers(path.times(by, a[b]));
            }
            for (i, ((next, wave), o)) in next_waves.iter_mut().zip(row).zip(&s.oscillators).enumerate() {
                let f = step * o.omega;
                *next = [-f * wave[1], f * wave[0]];
                if varying {
                    let at = Layout::oscillator(i) + k + 1;
                    [work[at], work[at + ROW]] = *next;
                }
            }
        }
        self.watched_forces(work);
        if !self.is_bare {
            for (row, [q, v]) in out.state.chunks_exact_mut(s.dim).zip(orders).skip(1) {
                row[..n].copy_from_slice(&q.as_flattened()[..n]);
                row[n..2 * n].copy_from_slice(&v.as_flattened()[..n]);
            }
        }
    }

    /// Forms the contact forces at order `k` and the deflections of the next order from velocities and oscillators, by four contacts. The
    /// `stretches` are those of order `k`, and are replaced by those of the next.
    ///
    /// A deflection is the integral of its rate, `(k + 1) δ_{k+1} = h δ̇_k`, and is formed before it is multiplied by the stiffness:
    /// if the train has turned far, a difference of displacements is exact and one of forces is not.
    #[inline(always)]
    fn contacts<P: Path, const B: usize, const C: usize>(
        &self,
        path: P,
        (k, step): (usize, f64),
        groups: &[View<'_, B, C>],
        (v, waves): (&[Four; B], &[[f64; 2]]),
        [forces, stretches]: [&mut [Four]; 2],
        work: &mut [f64],
    ) {
        let deflections = work[self.layout.deflections..self.layout.stretches].as_chunks_mut::<LANES>().0;
        let deflections = deflections.as_chunks_mut::<ROW>().0.as_chunks_mut::<C>().0;
        let own = forces.as_chunks_mut::<C>().0.iter_mut().zip(stretches.as_chunks_mut::<C>().0);
        for (number, ((group, deflections), (forces, stretches))) in groups.iter().zip(deflections).zip(own).enumerate()
        {
            let first = C * number;
            let mut rates = [path.all(0.0); C];
            // Oscillators come first, because the velocities are available late.
            for (i, [by_cos, by_sin]) in group.waves.0.iter().zip(group.waves.1) {
                let [cos, sin] = waves[*i].map(|x| path.all(x));
                for c in 0..C {
                    rates[c] = path.fused(path.four(by_cos[c]), cos, rates[c]);
                    rates[c] = path.fused(path.four(by_sin[c]), sin, rates[c]);
                }
            }
            // The order is fixed, so that contacts of equal bodies have equal rounding, whatever the index of the body.
            let [directions] = group.directions else { unreachable!("not one panel") };
            for b in 0..B {
                for l in 0..LANES {
                    let (columns, v) = (&directions[b][l], path.all(v[b][l]));
                    for c in 0..C {
                        rates[c] = path.fused(path.four(columns[c]), v, rates[c]);
                    }
                }
            }
            if k == 0 && !self.request.still.is_empty() {
                for c in 0..C {
                    let moves: Four =
                        std::array::from_fn(|l| if self.is_still(LANES * (first + c) + l) { 0.0 } else { 1.0 });
                    rates[c] = path.times(path.four(moves), rates[c]);
                }
            }
            let by = path.all(step);
            if let Some(laws) = group.laws {
                for c in 0..C {
                    let spring = path.times(path.four(laws[c][0]), path.four(stretches[c]));
                    forces[c] = path.numbers(path.fused(path.four(laws[c][1]), rates[c], spring));
                }
            }
            for c in 0..C {
                stretches[c] = path.numbers(path.times(by, rates[c]));
                deflections[c][k + 1] = stretches[c];
            }
            if k == 0 && group.laws.is_some() && !self.request.pinned.is_empty() {
                let forces = forces.as_flattened_mut().iter_mut().enumerate();
                let zero = forces.filter(|(l, _)| self.pinned(LANES * first + l, Watch::Force));
                zero.for_each(|(_, force)| *force = 0.0);
            }
        }
    }

    /// Adds the forces of contacts whose stiffness is a series, at order `k`.
    fn varying_forces(&self, k: usize, v: &[f64], a: &mut [f64], work: &mut [f64]) {
        for (j, part) in self.motion.parts.iter().enumerate() {
            let Some((stiffness, damping)) = part.carried_linear() else { continue };
            if stiffness.varies() {
                let force = self.spring(j, stiffness, k, work) + damping * self.rate(j, k, v, work);
                self.s.contacts[j].push.iter().for_each(|(i, p)| a[*i as usize] -= p * force);
            }
        }
    }

    /// Forms the forces that are watched.
    fn watched_forces(&self, work: &mut [f64]) {
        for &j in &self.motion.watched_forces {
            if let Some(Force::Linear { stiffness, damping }) = self.motion.parts[j].force() {
                self.watched_force(j, stiffness, damping, work);
            }
        }
    }

    /// Forms `F = k (δ − σ b) + c δ̇` as a series, with `(δ̇)_k = (k+1) δ_{k+1}/h`.
    fn watched_force(&self, j: usize, stiffness: Elasticity, damping: f64, work: &mut [f64]) {
        let d = |k: usize| self.layout.deflection(j, k);
        for k in 0..=ORDER {
            let rate = if k < ORDER { work[d(k + 1)] * (k + 1) as f64 / self.h } else { 0.0 };
            work[self.layout.of(j, FORCE) + k] = self.spring(j, stiffness, k, work) + damping * rate;
        }
    }
}
