//! Mutual effects of jumps at one instant on the derivative.

use super::{
    assemble::{Structure, zeros},
    contact_mode::{Watch, contact_mode, guard_of},
    tangent::Saltation,
    variation::Evaluation,
};
use crate::hybrid::{Columns, GuardSet, Instant, Jump, Mode};

/// Share of the largest acceleration above which a change is more than rounding.
const SUDDEN: f64 = 1e-9;

impl Structure {
    /// Returns the contacts whose latched speed depends on the order of the jump of a damping force. There are none if all neighbours reach
    /// both flanks together.
    pub(super) fn parted(&self, saltation: &Saltation) -> Vec<usize> {
        let is_latched = |j: usize| self.contacts[j].latch.is_some_and(|latch| saltation.latched.contains(&latch));
        let is_one = |i: usize, j: usize| {
            let [a, b] = [i, j].map(|j| &self.contacts[j].spec);
            (&a.direction, a.half_backlash, &a.error) == (&b.direction, b.half_backlash, &b.error)
        };
        let depends = |i: usize, j: usize| i != j && self.coupling(i, j) != 0.0 && !is_one(i, j);
        let mut parted = Vec::new();
        for i in (0..self.contacts.len()).filter(|i| is_latched(*i)) {
            let soft = saltation.movers.iter().filter(|j| !self.contacts[**j].spec.law.is_rigid());
            let others: Vec<usize> = soft.copied().filter(|j| depends(i, *j)).collect();
            if !others.is_empty() {
                parted.push(i);
                parted.extend(others);
            }
        }
        parted.sort_unstable();
        parted.dedup();
        parted
    }

    /// Returns the advance of a jump, `gᵀδq/δ̇`, s: the mean over the contacts that cause jumps of forces or speeds.
    pub(super) fn move_event(
        &self,
        (from, to): (&Jump, &Jump),
        fired: &GuardSet,
        (at, x): (Instant, &[f64]),
        by: Option<Evaluation<'_>>,
        columns: &Columns,
    ) -> Saltation {
        let mut saltation = Saltation::default();
        for (j, watch) in fired.iter().chain(to.struck.iter()).map(guard_of) {
            let (was, is) = (contact_mode(&from.mode, j), contact_mode(&to.mode, j));
            let law = &self.contacts[j].spec.law;
            let is_sudden = if law.is_rigid() { !was.is_closed() } else { law.jump_damping() > 0.0 && was != is };
            let rate = self.deflection(j, at, x).1;
            if watch == Watch::Force
                || !is_sudden
                || saltation.movers.contains(&j)
                || rate.abs() <= self.speed_rounding(j, at, x)
            {
                continue;
            }
            let along = self.along((j, watch.side()), false, by, columns);
            saltation.earlier.resize(columns.count, 0.0);
            saltation.earlier.iter_mut().zip(along).for_each(|(earlier, along)| *earlier += along / rate);
            saltation.movers.push(j);
        }
        let share = 1.0 / saltation.movers.len().max(1) as f64;
        saltation.earlier.iter_mut().for_each(|earlier| *earlier *= share);
        saltation
    }

    /// Advances `columns` over a jump that follows from another one at the same instant. The forces that it removes or adds are finite, and
    /// act `earlier` by as much. Returns whether there are any.
    pub(crate) fn saltate_after(
        &self,
        (from, to): (&Mode, &Mode),
        (at, x): (Instant, &[f64]),
        earlier: &[f64],
        columns: &mut Columns,
    ) -> bool {
        let acceleration = |mode: &Mode| {
            let (mut forces, mut a) = (zeros(self.contacts.len()), vec![0.0; self.n]);
            self.dynamics(mode, at, x, &mut forces, &mut a);
            a
        };
        let (before, after) = (acceleration(from), acceleration(to));
        let largest = before.iter().chain(&after).fold(0.0, |m: f64, a| m.max(a.abs()));
        let mut is_finite = false;
        for (i, (before, after)) in before.iter().zip(&after).enumerate() {
            columns.add(self.n + i, after - before, earlier);
            is_finite |= (after - before).abs() > SUDDEN * largest;
        }
        is_finite
    }
}
