//! Derivative of the motion of a train with respect to one of its parameters.
//!
//! Time is the phase of the forcing, scaled to the seconds of the train: a column `ξ = ∂x/∂α` obeys `ξ̇ = f_x ξ + f_α − f ω_α/ω` with state
//! and phase held in `f_α`. No term grows with time, and sections and switches tied to the forcing keep their phase.

use super::{
    acting::{ActiveContact, Elasticity, Force},
    assemble::{PerContact, Spring, Structure, zeros},
    contact_mode::piece,
    sticking::Sticking,
};
use crate::hybrid::{Columns, Instant, Mode};

/// Trains that differ from one train in a parameter, with the weights of the difference quotient: `∂y/∂α = Σ w y(α + h)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    neighbours: Vec<(f64, Structure)>,
}

impl Variation {
    /// Returns the variation of trains with other values of the parameter, each with its weight. They have the shape of the train: the same
    /// degrees of freedom, contacts, kinds of laws and stiffness, and ratios of frequencies.
    #[must_use]
    pub fn new(neighbours: Vec<(f64, Structure)>) -> Self {
        Self { neighbours }
    }

    /// Returns the derivative of `y` with respect to the parameter.
    pub(crate) fn of(&self, y: impl Fn(&Structure) -> f64) -> f64 {
        self.neighbours.iter().map(|(weight, train)| weight * y(train)).sum()
    }
}

/// Parameters and state of a derivative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evaluation<'a> {
    /// One variation for each column; none if the columns are those of a start.
    pub variations: &'a [Variation],
    pub at: Instant,
    pub x: &'a [f64],
}

impl Structure {
    /// Returns the instant of the same cycle and phase in the clock of `self`, for an instant `at` in the clock of `of`.
    pub(super) fn same_phase(&self, of: &Self, at: Instant) -> Instant {
        match (self.clock.period(), of.clock.period()) {
            (Some(own), Some(other)) if own != other => {
                Instant { phase: at.phase * (own.value() / other.value()), ..at }
            }
            _ => at,
        }
    }

    /// Returns the derivatives of `δ − σ b` and of `δ̇` of contact `j` with respect to the parameter, state and phase held; `side` is σ.
    fn moves(&self, variation: &Variation, j: usize, side: f64, at: Instant, x: &[f64]) -> [f64; 2] {
        let mut moves = [0.0; 2];
        for (weight, train) in &variation.neighbours {
            let (d, rate) = train.deflection(j, train.same_phase(self, at), x);
            moves[0] += weight * (d - side * train.contacts[j].gap());
            moves[1] += weight * rate;
        }
        moves
    }

    /// Adds the parameter derivatives of `δ − σ b` of contact `j` to a row of columns; with `velocities` those of `δ̇`.
    pub(crate) fn add_moves(&self, (j, side): (usize, f64), velocities: bool, by: Evaluation<'_>, row: &mut [f64]) {
        for (r, variation) in row.iter_mut().zip(by.variations) {
            *r += self.moves(variation, j, side, by.at, by.x)[usize::from(velocities)];
        }
    }

    /// Writes `f_α − f ω_α/ω` in `mode` for each parameter, one column each, into `out`. Returns the sizes of the rounded terms in the
    /// differences, of displacements and of velocities: first of their rates, then of themselves.
    pub(crate) fn forcing(
        &self,
        mode: &Mode,
        held: Option<&Sticking>,
        by: Evaluation<'_>,
        out: &mut Columns,
    ) -> [[f64; 2]; 2] {
        let (n, count, Evaluation { at, x, .. }) = (self.n, out.count, by);
        let (mut slopes, mut values) = ([0.0f64; 2], [0.0f64; 2]);
        out.values.fill(0.0);
        let mut forces = zeros(self.contacts.len());
        self.carrying(mode).for_each(|a| forces[a.contact] = self.law_force(&a, at, x));
        // Sizes of the terms of accelerations, which are rounded.
        let mut terms: Vec<f64> = self.load.iter().map(|f| f.abs()).collect();
        for (i, row) in self.rows.iter().enumerate() {
            terms[i] +=
                row.iter().map(|(j, k, c)| (k * x[*j as usize]).abs() + (c * x[n + *j as usize]).abs()).sum::<f64>();
        }
        for acting in self.carrying(mode) {
            let c = &self.contacts[acting.contact];
            let by_deflection = self.force_change(&acting, at, x, [1.0, 0.0], &[]).abs() * self.deflection_size(c, x);
            c.push
                .iter()
                .for_each(|(i, p)| terms[*i as usize] += p.abs() * (forces[acting.contact].abs() + by_deflection));
        }
        let (mut a, mut changes) = (vec![0.0; n], Columns { count, values: vec![0.0; n * count] });
        for (l, variation) in by.variations.iter().enumerate() {
            for (weight, train) in &variation.neighbours {
                let scale = if self.clock.omega() > 0.0 { self.clock.omega() / train.clock.omega() } else { 1.0 };
                train.accelerate(mode, train.same_phase(self, at), x, &mut forces.clone(), &mut a);
                for (i, a) in a.iter().enumerate() {
                    slopes[0] = slopes[0].max((weight * x[n + i]).abs());
                    slopes[1] = slopes[1].max(weight.abs() * (a.abs() + terms[i]));
                    values[0] = values[0].max((weight * x[i]).abs());
                    out.values[i * count + l] += weight * scale * x[n + i];
                    out.values[(n + i) * count + l] += weight * scale * a;
                }
            }
            for acting in self.carrying(mode).filter(|a| !a.is_held()) {
                let moves = self.moves(variation, acting.contact, acting.side, at, x);
                let force =
                    self.force_change(&acting, at, x, moves, &[]) + self.force_by(variation, &acting, mode, at, x);
                let push = self.contacts[acting.contact].push.iter();
                push.for_each(|(i, p)| changes.values[*i as usize * count + l] -= p * force);
            }
        }
        if let Some(held) = held {
            self.take_out(held, 0, &mut changes, &mut |_, _| ());
        }
        out.values[n * count..].iter_mut().zip(&changes.values).for_each(|(o, c)| *o += c);
        values[1] = slopes[0];
        [slopes, values]
    }

    /// Returns the derivative of the force of a contact with respect to the parameter, its deflection from the flank and its rate held.
    fn force_by(&self, variation: &Variation, acting: &ActiveContact, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        let (j, side) = (acting.contact, acting.side);
        let (d, rate) = self.deflection(j, at, x);
        let of = |train: &Self| train.acting(mode, j).map_or(Force::Held, |a| a.force);
        match acting.force {
            Force::Linear { .. } => {
                let gap = self.contacts[j].gap();
                let stiffness = |train: &Self| match of(train) {
                    Force::Linear { stiffness, .. } => train.stiffness_beside(self, j, stiffness, at),
                    _ => 0.0,
                };
                let damping = |train: &Self| of(train).damping().unwrap_or_default();
                variation.of(stiffness) * (d - side * gap) + variation.of(damping) * rate
            }
            Force::Power { law, stiffness, latch } => {
                let elastic = libm::pow((side * d - self.contacts[j].gap()).max(0.0), law.exponent.value());
                let by_stiffness = variation.of(|train| match of(train) {
                    Force::Power { stiffness, .. } => stiffness,
                    _ => 0.0,
                });
                let by_hysteresis = variation.of(|train| match of(train) {
                    Force::Power { law, .. } => law.hysteresis,
                    _ => 0.0,
                });
                let hysteresis = latch.map_or(0.0, |latch| by_hysteresis * side * rate / x[latch]);
                side * elastic * (by_stiffness * self.factor(acting, rate, x) + stiffness * hysteresis)
            }
            Force::Held => 0.0,
        }
    }

    /// Returns the stiffness at the phase that `at` has in `of`. On a slope the piece is the one that starts nearest to the piece in `of`,
    /// also shortly before and after it.
    fn stiffness_beside(&self, of: &Self, j: usize, stiffness: Elasticity, at: Instant) -> f64 {
        let here = self.same_phase(of, at);
        match (stiffness, &self.contacts[j].spring, &of.contacts[j].spring) {
            (Elasticity::Ramp { value, slope, number }, Spring::Scheduled(own), Spring::Scheduled(other)) => {
                let start = of.clock.advance(at, -other.elapsed(&of.clock, at, number));
                let start = own.start_near(&self.clock, self.same_phase(of, start), number);
                value + slope * start.map_or(0.0, |start| self.clock.between(start, here))
            }
            _ => self.stiffness_at(j, stiffness, here).0,
        }
    }

    /// Returns the delay, s per unit of the parameter, of the switch of contact `j` to piece `number` near `at`.
    fn switch_moves(&self, variation: &Variation, j: usize, number: u32, at: Instant) -> f64 {
        variation.of(|train| {
            let Spring::Scheduled(schedule) = &train.contacts[j].spring else { return 0.0 };
            let here = train.same_phase(self, at);
            let scale = if self.clock.omega() > 0.0 { train.clock.omega() / self.clock.omega() } else { 1.0 };
            let start = schedule.start_near(&train.clock, here, number);
            start.map_or(0.0, |start| scale * train.clock.between(here, start))
        })
    }

    /// Advances columns of parameters over a known switching time, at which schedules change from the pieces of `from` to those of `to`:
    /// `δx⁺ = δx + (f⁻ − f⁺) δt`.
    pub(crate) fn switch_columns(&self, (from, to): (&Mode, &Mode), by: Evaluation<'_>, columns: &mut Columns) {
        let (n, count) = (self.n, columns.count);
        let mut changes = Columns { count, values: vec![0.0; n * count] };
        for j in (0..self.contacts.len()).filter(|j| piece(from, *j) != piece(to, *j)) {
            let force =
                |mode: &Mode| self.acting(mode, j).filter(|a| a.is_carried).map(|a| self.law_force(&a, by.at, by.x));
            let (Some(before), Some(after)) = (force(from), force(to)) else { continue };
            for (l, variation) in by.variations.iter().enumerate() {
                let change = (before - after) * self.switch_moves(variation, j, piece(to, j), by.at);
                let push = self.contacts[j].push.iter();
                push.for_each(|(i, p)| changes.values[*i as usize * count + l] -= p * change);
            }
        }
        if let Some(held) = self.held(to) {
            self.take_out(&held, 0, &mut changes, &mut |_, _| ());
        }
        columns.values[n * count..].iter_mut().zip(&changes.values).for_each(|(c, d)| *c += d);
    }

    /// Adds the parameter derivatives of the velocities after impacts, with the velocities before held; `by` has the state before.
    pub(crate) fn strike_by(
        &self,
        contacts: &PerContact<usize>,
        returns: impl Fn(&Self, usize, f64) -> f64,
        by: Evaluation<'_>,
        columns: &mut Columns,
    ) {
        let (n, count) = (self.n, columns.count);
        for (l, variation) in by.variations.iter().enumerate() {
            for (weight, train) in &variation.neighbours {
                let active = Sticking::of(train, contacts.iter().copied());
                let here = train.same_phase(self, by.at);
                let rate = |j: usize| train.deflection(j, here, by.x).1;
                train.rebound(
                    &active,
                    |j| returns(train, j, rate(j)),
                    rate,
                    |i, change| {
                        columns.values[(n + i) * count + l] -= weight * change;
                    },
                );
            }
        }
    }
}
