//! Derivative of impacts at one instant.

use super::{
    assemble::{PerContact, Structure, dot, zeros},
    contact_mode::{contact_mode, guard_of, set_contact},
    sticking::Sticking,
    variation::Evaluation,
};
use crate::{
    gear::contact::{Law, Restitution},
    hybrid::{Columns, Instant, Jump, Mode},
};

/// Dependent impacts at one instant: modes and states before and after them.
struct Impact<'a> {
    active: &'a Sticking,
    modes: [&'a Mode; 2],
    states: [&'a [f64]; 2],
    at: Instant,
}

impl Structure {
    /// Advances columns over the impacts of the rigid contacts `strikers` at one instant, group by group. Contacts of different groups, and
    /// contacts at rest beside them, do not change each other's speeds.
    pub(super) fn strike_columns(
        &self,
        (from, to): (&Jump, &Jump),
        (strikers, side): (&[usize], &dyn Fn(usize) -> f64),
        (settles, resets_only): (bool, bool),
        (x_minus, x_plus): (&[f64], &[f64]),
        (at, by): (Instant, Option<Evaluation<'_>>),
        columns: &mut Columns,
    ) {
        let rests = |mode: &Mode, j: usize| self.contacts[j].spec.law.is_rigid() && contact_mode(mode, j).is_closed();
        // A contact at rest that the impact releases without an impulse does not take part.
        let is_struck = |j: usize| to.struck.iter().any(|id| guard_of(id).0 == j);
        let takes_part = |j: &usize| rests(&from.mode, *j) && (rests(&to.mode, *j) || is_struck(*j));
        let resting = (0..self.contacts.len()).filter(takes_part);
        let groups = self.groups(strikers.iter().copied().chain(resting).collect());
        let mut groups = groups.iter().filter(|group| group.iter().any(|j| strikers.contains(j))).peekable();
        // One plus the restitution, as a function of the rate of the deflection; 1 for a contact at rest, or one that comes to rest.
        let of = |train: &Self, (j, rate): (usize, f64), part: fn(&Restitution, f64) -> f64| match &train.contacts[j]
            .spec
            .law
        {
            Law::Rigid(l) if !settles && strikers.contains(&j) && !rests(&to.mode, j) => {
                1.0 + part(&l.restitution, side(j) * rate)
            }
            _ => 1.0,
        };
        // The jumps of soft contacts at this instant are already made.
        let mut mode = to.mode.clone();
        let rigid = (0..self.contacts.len()).filter(|j| self.contacts[*j].spec.law.is_rigid());
        rigid.for_each(|j| set_contact(&mut mode, j, contact_mode(&from.mode, j)));
        let mut x = x_minus.to_vec();
        while let Some(group) = groups.next() {
            let active = Sticking::of(self, group.iter().copied());
            let (before, x_before) = (mode.clone(), x.clone());
            if groups.peek().is_some() {
                group.iter().for_each(|j| set_contact(&mut mode, *j, contact_mode(&to.mode, *j)));
                let rate = |j: usize| self.deflection(j, at, &x_before).1;
                let returns = |j| of(self, (j, rate(j)), Restitution::at);
                self.rebound(&active, returns, rate, |i, by| x[self.n + i] -= by);
            } else {
                (mode, x) = (to.mode.clone(), x_plus.to_vec());
            }
            // Advance of the impact: `gᵀδq/δ̇`, the mean of the contacts that strike together.
            let speeds =
                group.iter().filter(|j| strikers.contains(j)).map(|j| (*j, self.deflection(*j, at, &x_before).1));
            let is_fast =
                |(j, rate): &(usize, f64)| !resets_only && rate.abs() > self.speed_rounding(*j, at, &x_before);
            let fast: PerContact<(usize, f64)> = speeds.filter(is_fast).collect();
            let mut earlier = vec![0.0; columns.count];
            for (j, rate) in &fast {
                let along = self.along((*j, side(*j)), false, by, columns);
                earlier.iter_mut().zip(&along).for_each(|(e, a)| *e += a / (rate * fast.len() as f64));
            }
            let impact = Impact { active: &active, modes: [&before, &mode], states: [&x_before, &x], at };
            // A change of the approach speed also changes the restitution.
            let rate = |j: usize| self.deflection(j, at, &x_before).1;
            let slopes = |j: usize| of(self, (j, rate(j)), Restitution::rebound_slope);
            self.strike_group(&impact, slopes, &earlier, columns);
            // Restitution at the nominal speed, with its slope there: the speed of a neighbour may lie beyond a corner of the law.
            let returns = |train: &Self, j: usize, other: f64| {
                let (own, e) = (rate(j), of(train, (j, rate(j)), Restitution::at));
                if other == 0.0 { e } else { (e * own + slopes(j) * (other - own)) / other }
            };
            by.iter().for_each(|by| self.strike_by(group, returns, *by, columns));
        }
        // Contacts that have come to rest keep zero gap and rate.
        self.restrain(&to.mode, by.map(|by| Evaluation { x: x_plus, ..by }), columns);
    }

    /// Groups the contacts: each with those that an impulse on it reaches, directly or through others.
    fn groups(&self, contacts: PerContact<usize>) -> Vec<PerContact<usize>> {
        let mut groups: Vec<PerContact<usize>> = Vec::new();
        for j in contacts {
            let is_near = |group: &mut PerContact<usize>| group.iter().any(|i| self.coupling(*i, j) != 0.0);
            let mut own: PerContact<usize> = groups.extract_if(.., is_near).flatten().collect();
            own.push(j);
            groups.push(own);
        }
        groups
    }

    /// Returns whether the action of contact `i` at `at` depends on an impact of contact `j` just before: through its speed, or, through a
    /// damper, through its acceleration.
    pub(super) fn depends(&self, (i, j): (usize, usize), mode: &Mode, at: Instant, x: &[f64]) -> bool {
        let mut struck = x.to_vec();
        let rate = self.deflection(j, at, x).1;
        self.contacts[j].push.iter().for_each(|(row, p)| struck[self.n + *row as usize] -= p * rate);
        let acceleration = |x: &[f64]| self.relative_acceleration(i, mode, at, x);
        self.coupling(i, j) != 0.0 || acceleration(&struck) != acceleration(x)
    }

    /// Advances columns over one group of impacts: `v⁺ = v⁻ − W (G W)⁻¹ (I + E) (G v⁻ − ė)` with `W = M⁻¹Gᵀ`, which comes `earlier`, s.
    fn strike_group(
        &self,
        impact: &Impact<'_>,
        returns: impl Fn(usize) -> f64 + Copy,
        earlier: &[f64],
        columns: &mut Columns,
    ) {
        let &Impact { active, modes, states, at } = impact;
        let (n, m) = (self.n, columns.count);
        let acceleration = |i: usize| {
            let (mut forces, mut a) = (zeros(self.contacts.len()), vec![0.0; n]);
            self.dynamics(modes[i], at, states[i], &mut forces, &mut a);
            a
        };
        let (before, after) = (acceleration(0), acceleration(1));
        // `a⁺ − R_v a⁻ − R_t`.
        let mut change: Vec<f64> = after.iter().zip(&before).map(|(after, before)| after - before).collect();
        let rate = |j: usize| dot(&self.contacts[j].direction, &before) - self.error(j, at).2;
        self.rebound(active, returns, rate, |i, by| change[i] += by);
        for (l, earlier) in earlier.iter().enumerate() {
            let mut taken = zeros(n);
            let velocity = |j: usize| {
                let direction = self.contacts[j].direction.iter();
                direction.map(|(i, g)| g * columns.values[(n + *i as usize) * m + l]).sum()
            };
            self.rebound(active, returns, velocity, |i, by| taken[i] += by);
            for i in 0..n {
                columns.values[i * m + l] += (states[1][n + i] - states[0][n + i]) * earlier;
                columns.values[(n + i) * m + l] += change[i] * earlier - taken[i];
            }
        }
    }

    /// Passes `W (G W)⁻¹ (I + E) y` of the contacts in `active`, component by component, to `take`: the loss of velocity in impacts.
    /// `returns` gives one plus the restitution of a contact, `y` its rate.
    pub(crate) fn rebound(
        &self,
        active: &Sticking,
        returns: impl Fn(usize) -> f64,
        y: impl Fn(usize) -> f64,
        mut take: impl FnMut(usize, f64),
    ) {
        let mut by: PerContact<f64> = active.contacts().iter().map(|j| returns(*j) * y(*j)).collect();
        active.solve(&mut by);
        for (by, j) in by.iter().zip(active.contacts()) {
            self.contacts[*j].push.iter().for_each(|(i, p)| take(*i as usize, p * by));
        }
    }
}
