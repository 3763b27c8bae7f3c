//! Linear modes in plain time: the fast path.
//!
//! With every closed law linear, the mode is `q̈ = A_q q + A_v q̇ + f(t)` up to the contacts whose stiffness
//! is itself a series. The forces of closed contacts are formed from their deflections, and the recurrence runs on
//! blocks of four degrees of freedom and of four contacts, each a vector.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use smallvec::{SmallVec, smallvec};

use super::clock::StepClock;
use crate::{
    hybrid::Jet,
    kernel::{
        Expansion, Four, LANES, ORDER, ROW, StepRows,
        mode::{
            compiled::{BlockRows, Blocks, MOST_BLOCKS, MOST_GROUPED, View, group_size},
            motion::ContactInMode,
        },
    },
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
    pub fn linear(&self, out: &mut Jet) {
        if self.motion.is_varying {
            self.begin_clock(&StepClock::TIME, &mut out.rows);
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
        let (s, n) = (self.s, self.s.n);
        out.time.clear();
        let compiled = &self.motion.compiled;
        let Some(of_blocks) = compiled.blocks.first().and_then(Blocks::rows::<B>) else {
            unreachable!("not {B} blocks")
        };
        let mut groups: SmallVec<[View<'_, B, C>; 1]> = SmallVec::new();
        for group in &compiled.groups {
            groups.push(group.view());
        }
        let rows = &mut out.rows;
        // While they are formed, the other rows are read and written by contact.
        let (mut all_orders, mut all_waves) = (std::mem::take(&mut rows.orders), std::mem::take(&mut rows.waves));
        let orders = all_orders.as_chunks_mut::<B>().0.as_chunks_mut::<2>().0;
        let Some(orders) = orders.first_chunk_mut::<ROW>() else { unreachable!("no room for {ROW} orders") };
        orders[0] = [[[0.0; LANES]; B]; 2];
        for (fours, x) in orders[0].iter_mut().zip(self.request.x.chunks_exact(n)) {
            fours.as_flattened_mut()[..n].copy_from_slice(x);
        }
        self.waves(rows, &mut all_waves);
        let mut forces: SmallVec<[[Four; C]; 1]> = smallvec![[[0.0; LANES]; C]; groups.len()];
        let mut stretches: SmallVec<[[Four; C]; 1]> = SmallVec::from_slice(rows.stretches.as_chunks().0);
        let (forces, stretches) = (forces.as_mut_slice(), stretches.as_mut_slice());
        let recurrence = (groups.as_slice(), &of_blocks, all_waves.as_slice());
        self.order::<P, B, C, true>(path, 0, recurrence, orders, [forces, stretches], rows);
        for k in 1..ORDER {
            self.order::<P, B, C, false>(path, k, recurrence, orders, [forces, stretches], rows);
        }
        self.watched_forces(rows);
        if !self.is_bare {
            for (row, [q, v]) in out.state.chunks_exact_mut(s.dim).zip(orders).skip(1) {
                row[..n].copy_from_slice(&q.as_flattened()[..n]);
                row[n..2 * n].copy_from_slice(&v.as_flattened()[..n]);
            }
        }
        (out.rows.orders, out.rows.waves) = (all_orders, all_waves);
    }

    /// Forms all orders of the oscillators, of which the first is known.
    #[inline(always)]
    fn waves(&self, rows: &mut StepRows, waves: &mut [[[f64; 2]; ROW]]) {
        for ((wave, series), o) in waves.iter_mut().zip(&mut rows.oscillators).zip(&self.s.oscillators) {
            wave[0] = series.each_ref().map(|series| series[0]);
            for k in 0..ORDER {
                let f = self.h / (k + 1) as f64 * o.omega;
                wave[k + 1] = [-f * wave[k][1], f * wave[k][0]];
            }
            if self.motion.is_varying {
                *series = [0, 1].map(|part| std::array::from_fn(|k| wave[k][part]));
            }
        }
    }

    /// Forms order `k + 1` from order `k`; IS_FIRST for the order zero, which loads and exact zeros affect.
    #[inline(always)]
    fn order<P: Path, const B: usize, const C: usize, const IS_FIRST: bool>(
        &self,
        path: P,
        k: usize,
        (groups, of_blocks, waves): (&[View<'_, B, C>], &BlockRows<'_, B>, &[[[f64; 2]; ROW]]),
        orders: &mut [[[Four; B]; 2]; ROW],
        [forces, stretches]: [&mut [[Four; C]]; 2],
        rows: &mut StepRows,
    ) {
        let step = self.h / (k + 1) as f64;
        let ([.., [q, v]], [next, ..]) = orders.split_at_mut(k + 1) else { unreachable!("no order {k}") };
        let deflections = rows.deflections.as_chunks_mut::<C>().0;
        // Several fours are one group. A constant count lets the compiler drop the loop.
        let count = if C > 1 { 1 } else { groups.len() };
        for number in 0..count {
            let (group, deflections) = (&groups[number], &mut deflections[number]);
            let (forces, stretches) = (&mut forces[number], &mut stretches[number]);
            let mut rates = group.rates(path, k, v, waves);
            if IS_FIRST && !self.request.still.is_empty() {
                self.hold_still(path, number * C, &mut rates);
            }
            group.forces(path, &rates, stretches, forces);
            if IS_FIRST && !self.request.pinned.is_empty() {
                let forces = forces.as_flattened_mut().iter_mut().enumerate();
                let zero = forces.filter(|(l, _)| self.pinned(LANES * C * number + l, Watch::Force));
                zero.for_each(|(_, force)| *force = 0.0);
            }
            for c in 0..C {
                let stretch = path.numbers(path.times(path.all(step), rates[c]));
                (stretches[c], deflections[c][k + 1]) = (stretch, stretch);
            }
        }
        let flat = [q.as_flattened(), v.as_flattened()];
        let forces = forces.as_flattened().as_flattened();
        let order = if IS_FIRST { 0 } else { k };
        let mut a = of_blocks.at(path, order, (flat, [q, v]), |i| waves[i][k], forces);
        if self.motion.is_varying {
            let mut sums = a.map(|four| path.numbers(four));
            self.varying_forces(k, flat[1], sums.as_flattened_mut(), rows);
            a = sums.map(|four| path.four(four));
        }
        let by = path.all(step);
        for b in 0..B {
            next[0][b] = path.numbers(path.times(by, path.four(v[b])));
            next[1][b] = path.numbers(path.times(by, a[b]));
        }
    }

    /// Makes the rates of those contacts zero that are exactly at rest, from index `first` of the fours.
    #[inline(always)]
    fn hold_still<P: Path, const C: usize>(&self, path: P, first: usize, rates: &mut [P::Four; C]) {
        for c in 0..C {
            let moves: Four = std::array::from_fn(|l| if self.is_still(LANES * (first + c) + l) { 0.0 } else { 1.0 });
            rates[c] = path.times(path.four(moves), rates[c]);
        }
    }

    /// Adds the forces of contacts whose stiffness is a series, at order `k`.
    fn varying_forces(&self, k: usize, v: &[f64], a: &mut [f64], rows: &mut StepRows) {
        for (j, part) in self.motion.parts.iter().enumerate() {
            let Some((stiffness, damping)) = part.carried_linear() else { continue };
            if stiffness.varies() {
                let force = self.spring(j, stiffness, k, rows) + damping * self.rate(j, k, v, rows);
                self.s.contacts[j].push.iter().for_each(|(i, p)| a[*i as usize] -= p * force);
            }
        }
    }

    /// Forms the forces that are watched.
    fn watched_forces(&self, rows: &mut StepRows) {
        for &j in &self.motion.watched_forces {
            if let Some(Force::Linear { stiffness, damping }) = self.motion.parts[j].force() {
                self.watched_force(j, stiffness, damping, rows);
            }
        }
    }

    /// Forms `F = k (δ − σ b) + c δ̇` as a series, with `(δ̇)_k = (k+1) δ_{k+1}/h`.
    fn watched_force(&self, j: usize, stiffness: Elasticity, damping: f64, rows: &mut StepRows) {
        for k in 0..=ORDER {
            let rate = if k < ORDER { rows.deflection(j, k + 1) * (k + 1) as f64 / self.h } else { 0.0 };
            rows.contacts[j].force[k] = self.spring(j, stiffness, k, rows) + damping * rate;
        }
    }
}
