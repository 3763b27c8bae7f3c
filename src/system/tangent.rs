//! Derivative of the motion: small changes of the state along a mode and across a jump.
//!
//! Between jumps columns `ξ = ∂x` obey `ξ̇ = f_x(t, x) ξ`. Across a jump at a guard h with the reset R they become `R_x ξ + (f⁺ − R_x f⁻ −
//! R_t) h_x ξ/ḣ` (Aizerman and Gantmacher 1958): the saltation matrix. It has a closed form for each kind of jump here; only those of
//! impacts and of a latched speed divide by a speed.

use super::{
    acting::{ActiveContact, Elasticity, Force},
    assemble::{PerContact, Structure, dot, zeros},
    contact_mode::{ContactMode, Watch, contact_mode, guard_of},
    sticking::Sticking,
    variation::{Evaluation, Variation},
};
use crate::{
    gear::contact::Law,
    hybrid::{Columns, GuardSet, Instant, Jump, Mode},
    vectors::Path,
};

/// Number of columns advanced side by side: two vectors of four.
pub(crate) const LANES: usize = 8;
/// One component of these columns.
pub(crate) type Lanes = [f64; LANES];

/// One component of these columns as two vectors. From plain arrays the compiler makes scalar products in large loops.
#[derive(Clone, Copy)]
pub(crate) struct Eight<P: Path>([P::Four; 2]);

impl<P: Path> Eight<P> {
    #[inline(always)]
    pub fn zero(path: P) -> Self {
        Self([path.all(0.0); 2])
    }

    #[inline(always)]
    pub fn new(path: P, x: &Lanes) -> Self {
        let mut all = Self::zero(path);
        for (to, four) in all.0.iter_mut().zip(x.as_chunks().0) {
            *to = path.four(*four);
        }
        all
    }

    /// Adds `by x`.
    #[inline(always)]
    pub fn add(&mut self, path: P, by: f64, x: &Lanes) {
        let by = path.all(by);
        for (sum, four) in self.0.iter_mut().zip(x.as_chunks().0) {
            *sum = path.fused(by, path.four(*four), *sum);
        }
    }

    #[inline(always)]
    pub fn numbers(self, path: P) -> Lanes {
        let mut lanes = [0.0; LANES];
        for (to, four) in lanes.as_chunks_mut().0.iter_mut().zip(self.0) {
            *to = path.numbers(four);
        }
        lanes
    }

    /// Returns whether all sizes are below `most`. NaN is not.
    #[inline(always)]
    pub fn is_below(self, path: P, most: f64) -> bool {
        let ([first, second], most) = (self.0, path.all(most));
        path.above(most, path.sizes(first)) & path.above(most, path.sizes(second)) == 0b1111
    }
}

/// Derivatives of the force of a contact along its direction with respect to deflection, rate and latched speed.
#[derive(Clone, Copy, Debug)]
struct ForceDerivatives {
    contact: usize,
    by_deflection: f64,
    by_rate: f64,
    by_latch: Option<(usize, f64)>,
}

/// `f_x` of a mode in a state.
#[derive(Debug, Default)]
pub(crate) struct Gradient {
    changes: PerContact<Option<ForceDerivatives>>,
}

/// Effects of a jump on columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Saltation {
    /// Contacts of several dependent impacts at one instant, if any: their order decides, and the columns are those of neighbours whose
    /// impacts stay together.
    pub dependent: Vec<usize>,
    /// `ln |det S|`; NaN where contacts come to rest or latch a speed, which have no volume.
    pub volume: f64,
    /// Number of ranks lost in impacts without rebound, of contacts that do not stay at rest.
    pub ranks: usize,
    /// Latched speeds that were rewritten, by index in the state.
    pub latched: Vec<usize>,
    /// Advance of the jump for each column, s; empty if no force and no speed jumps.
    pub earlier: Vec<f64>,
    /// Contacts that cause jumps of forces or speeds.
    pub movers: Vec<usize>,
}

impl Structure {
    /// Returns whether `f_x` is constant along `mode`.
    pub(crate) fn is_affine(&self, mode: &Mode) -> bool {
        let is_constant = |a: ActiveContact| {
            matches!(a.force, Force::Held | Force::Linear { stiffness: Elasticity::Constant(_), .. })
        };
        self.carrying(mode).all(is_constant)
    }

    /// Returns `f_x` in `mode` in a state.
    pub(crate) fn gradient(&self, mode: &Mode, at: Instant, x: &[f64]) -> Gradient {
        let change = |acting: ActiveContact| {
            let contact = acting.contact;
            let by = |change: [f64; 2]| self.force_change(&acting, at, x, change, &[]);
            match acting.force {
                Force::Held => None,
                Force::Linear { damping, .. } => {
                    Some(ForceDerivatives { contact, by_deflection: by([1.0, 0.0]), by_rate: damping, by_latch: None })
                }
                Force::Power { latch, .. } => {
                    let by_latch = latch.map(|i| (i, self.force_by_latch(&acting, at, x)));
                    Some(ForceDerivatives { contact, by_deflection: by([1.0, 0.0]), by_rate: by([0.0, 1.0]), by_latch })
                }
            }
        };
        Gradient { changes: self.carrying(mode).map(change).collect() }
    }

    /// Writes `f_x ξ` into `out`, for the columns `ξ`.
    pub(crate) fn apply(&self, gradient: &Gradient, held: Option<&Sticking>, columns: &Columns, out: &mut Columns) {
        let (n, m) = (self.n, columns.count);
        out.values[2 * n * m..].fill(0.0);
        out.values[..n * m].copy_from_slice(&columns.values[n * m..2 * n * m]);
        out.values[n * m..2 * n * m].fill(0.0);
        for (i, row) in self.rows.iter().enumerate() {
            for (j, k, c) in row {
                out.add(n + i, -k, columns.row(*j as usize));
                out.add(n + i, -c, columns.row(n + *j as usize));
            }
        }
        let mut force: PerContact<f64> = zeros(m);
        for change in gradient.changes.iter().flatten() {
            let c = &self.contacts[change.contact];
            force.fill(0.0);
            let mut add = |factor: f64, row: &[f64]| force.iter_mut().zip(row).for_each(|(f, r)| *f += factor * r);
            for (i, g) in &c.direction {
                add(change.by_deflection * g, columns.row(*i as usize));
                add(change.by_rate * g, columns.row(n + *i as usize));
            }
            if let Some((latch, by_latch)) = change.by_latch {
                add(by_latch, columns.row(latch));
            }
            c.push.iter().for_each(|(i, p)| out.add(n + *i as usize, -p, &force));
        }
        if let Some(held) = held {
            self.take_out(held, n, out, &mut |_, _| ());
        }
    }

    /// Iterates over the contacts whose forces depend on the state in `mode`, with the index of the latched speed.
    pub(crate) fn changing(&self, mode: &Mode) -> impl Iterator<Item = (usize, Option<usize>)> {
        self.carrying(mode).filter(|a| !a.is_held()).map(|a| (a.contact, self.contacts[a.contact].latch))
    }

    /// Adds `factor gᵀξ` of contact `j`, for the rows of `columns` from `first` on, to `sum`.
    pub(crate) fn add_along(&self, j: usize, first: usize, factor: f64, columns: &Columns, sum: &mut [f64]) {
        for (i, g) in &self.contacts[j].direction {
            sum.iter_mut().zip(columns.row(first + *i as usize)).for_each(|(s, c)| *s += factor * g * c);
        }
    }

    /// Writes `f_x ξ` without contacts, for some columns side by side: a row for each component.
    #[inline(always)]
    pub(crate) fn apply_lanes<P: Path>(&self, path: P, columns: &[Lanes], out: &mut [Lanes]) {
        let n = self.n;
        out[..n].copy_from_slice(&columns[n..2 * n]);
        for (row, out) in self.rows.iter().zip(&mut out[n..2 * n]) {
            let mut sum = Eight::zero(path);
            for (j, k, c) in row {
                sum.add(path, -c, &columns[n + *j as usize]);
                sum.add(path, -k, &columns[*j as usize]);
            }
            *out = sum.numbers(path);
        }
        out[2 * n..].fill([0.0; LANES]);
    }

    /// Returns `gᵀξ` of contact `j` for the rows of `columns`, those of displacements or of velocities.
    #[inline(always)]
    pub(crate) fn along_lanes<P: Path>(&self, path: P, j: usize, columns: &[Lanes]) -> Lanes {
        let mut sum = Eight::zero(path);
        for (i, g) in &self.contacts[j].direction {
            sum.add(path, *g, &columns[*i as usize]);
        }
        sum.numbers(path)
    }

    /// Subtracts the accelerations by `force` of contact `j` from the rows of velocity.
    #[inline(always)]
    pub(crate) fn push_lanes<P: Path>(&self, path: P, j: usize, force: &Lanes, velocities: &mut [Lanes]) {
        for (i, p) in &self.contacts[j].push {
            let x = &mut velocities[*i as usize];
            let mut sum = Eight::new(path, x);
            sum.add(path, -p, force);
            *x = sum.numbers(path);
        }
    }

    /// Removes the motion of `held` contacts from the rows from `first` on, by changes along `M⁻¹g`. `moves` adds the motion of their
    /// flanks, for each column, to the row of a contact.
    pub(crate) fn take_out(
        &self,
        held: &Sticking,
        first: usize,
        columns: &mut Columns,
        moves: &mut dyn FnMut(usize, &mut [f64]),
    ) {
        let (set, m) = (held.contacts(), columns.count);
        let mut along = vec![0.0; set.len() * m];
        for (row, j) in along.chunks_exact_mut(m).zip(set) {
            self.add_along(*j, first, 1.0, columns, row);
            moves(*j, row);
        }
        let mut by = zeros(set.len());
        for l in 0..m {
            by.iter_mut().enumerate().for_each(|(k, by)| *by = along[k * m + l]);
            held.solve(&mut by);
            for (by, j) in by.iter().zip(set) {
                let push = self.contacts[*j].push.iter();
                push.for_each(|(i, p)| columns.values[(first + *i as usize) * m + l] -= p * by);
            }
        }
    }

    /// Returns the contacts at rest in `mode`, if any.
    pub(crate) fn held(&self, mode: &Mode) -> Option<Sticking> {
        Sticking::new(self, mode)
    }

    /// Removes from `columns` the directions that contacts at rest in `mode` forbid; their flanks move with the parameters of `by`, if any.
    pub(crate) fn restrain(&self, mode: &Mode, by: Option<Evaluation<'_>>, columns: &mut Columns) {
        if let Some(held) = self.held(mode) {
            for (first, velocities) in [(0, false), (self.n, true)] {
                self.take_out(&held, first, columns, &mut |j, row| {
                    by.iter().for_each(|by| self.add_moves((j, contact_mode(mode, j).side()), velocities, *by, row));
                });
            }
        }
    }

    /// Returns the changes of `δ − σ b` of contact `j`, σ its `side`, or of `δ̇` with `velocities`.
    pub(super) fn along(
        &self,
        (j, side): (usize, f64),
        velocities: bool,
        by: Option<Evaluation<'_>>,
        columns: &Columns,
    ) -> Vec<f64> {
        let mut along = vec![0.0; columns.count];
        self.add_along(j, if velocities { self.n } else { 0 }, 1.0, columns, &mut along);
        by.iter().for_each(|by| self.add_moves((j, side), velocities, *by, &mut along));
        along
    }

    /// Advances `columns` over the jump of the damping force of contact `j`, as it changes from `was` to `is` at a flank that `moves`:
    /// `δv⁺ = δv ∓ c w (gᵀδq + moves)`; the speed cancels.
    pub(crate) fn shear(&self, j: usize, (was, is): (ContactMode, ContactMode), moves: &[f64], columns: &mut Columns) {
        let (c, m) = (&self.contacts[j], columns.count);
        let factor = match (was, is) {
            (ContactMode::Separated, _) if is.is_closed() => -c.spec.law.jump_damping(),
            (_, ContactMode::Separated) if was.is_closed() => c.spec.law.jump_damping(),
            _ => return,
        };
        if factor == 0.0 {
            return;
        }
        for (l, moved) in moves.iter().enumerate() {
            let along = c.direction.iter().fold(*moved, |sum, (i, g)| sum + g * columns.values[*i as usize * m + l]);
            c.push.iter().for_each(|(i, p)| columns.values[(self.n + *i as usize) * m + l] += factor * p * along);
        }
    }

    /// Advances `columns` over the jump from `from` to `to`, of the guards `fired`, at `at`; `x_minus` and `x_plus` are the states before
    /// and after. `settles` marks contacts brought to rest at any speed; `resets_only` omits the shift of event times. Columns of
    /// parameters name their `variations`; columns of a start have none.
    pub(crate) fn saltate(
        &self,
        (from, to): (&Jump, &Jump),
        (fired, settles, resets_only): (&GuardSet, bool, bool),
        at: Instant,
        (x_minus, x_plus): (&[f64], &[f64]),
        variations: &[Variation],
        columns: &mut Columns,
    ) -> Saltation {
        let by = (!variations.is_empty()).then_some(Evaluation { variations, at, x: x_minus });
        let mut saltation = Saltation::default();
        if !resets_only {
            saltation = self.move_event((from, to), fired, (at, x_minus), by, columns);
        }
        // Speeds are latched before any force jumps.
        for id in fired.iter() {
            let (j, _) = guard_of(id);
            let (was, is) = (contact_mode(&from.mode, j), contact_mode(&to.mode, j));
            let c = &self.contacts[j];
            match c.spec.law {
                Law::Power(l) if was == ContactMode::Separated => {
                    let Some(latch) = c.latch else { continue };
                    saltation.latched.push(latch);
                    saltation.volume = f64::NAN;
                    let rate = self.deflection(j, at, x_minus).1;
                    if is.side() * rate <= l.speed_floor {
                        columns.row_mut(latch).fill(0.0);
                        let floor = |train: &Self| match train.contacts[j].spec.law {
                            Law::Power(l) => l.speed_floor,
                            _ => 0.0,
                        };
                        let floors = variations.iter().map(|variation| variation.of(floor));
                        columns.row_mut(latch).iter_mut().zip(floors).for_each(|(row, floor)| *row = floor);
                        continue;
                    }
                    // Approach speed at the start of the contact, which comes earlier by `gᵀδq/δ̇`.
                    let relative = self.relative_acceleration(j, &from.mode, at, x_minus);
                    let [mut early, mut row] = [false, true].map(|rate| self.along((j, is.side()), rate, by, columns));
                    if resets_only {
                        early.fill(0.0);
                    }
                    row.iter_mut().zip(&early).for_each(|(r, e)| *r = is.side() * (*r - relative * e / rate));
                    columns.row_mut(latch).copy_from_slice(&row);
                }
                _ => {}
            }
        }
        for id in fired.iter() {
            let (j, watch) = guard_of(id);
            let (was, is) = (contact_mode(&from.mode, j), contact_mode(&to.mode, j));
            if watch != Watch::Force && !resets_only {
                let mut along = vec![0.0; columns.count];
                by.iter().for_each(|by| self.add_moves((j, was.side() + is.side()), false, *by, &mut along));
                self.shear(j, (was, is), &along, columns);
            }
        }
        saltation.dependent = self.parted(&saltation);
        let is_struck = |j: usize| to.struck.iter().any(|id| guard_of(id).0 == j);
        let rests = |mode: &Mode, j: usize| self.contacts[j].spec.law.is_rigid() && contact_mode(mode, j).is_closed();
        let lands = |j: usize| rests(&to.mode, j) && !rests(&from.mode, j);
        let strikers: PerContact<usize> = (0..self.contacts.len())
            .filter(|j| self.contacts[*j].spec.law.is_rigid() && !rests(&from.mode, *j) && (is_struck(*j) || lands(*j)))
            .collect();
        let is_dead =
            |j: usize| matches!(&self.contacts[j].spec.law, Law::Rigid(l) if settles || l.restitution.is_dead());
        if !strikers.is_empty() {
            let sides = fired.iter().chain(to.struck.iter()).map(guard_of).filter(|(_, watch)| watch.side() != 0.0);
            let sides: PerContact<(usize, f64)> = sides.map(|(j, watch)| (j, watch.side())).collect();
            let side = |j: usize| sides.iter().find(|(k, _)| *k == j).map_or(contact_mode(&to.mode, j).side(), |s| s.1);
            self.strike_columns(
                (from, to),
                (&strikers, &side),
                (settles, resets_only),
                (x_minus, x_plus),
                (at, by),
                columns,
            );
            saltation.ranks = strikers.iter().filter(|j| !rests(&to.mode, **j) && is_dead(**j)).count();
            let touched =
                fired.iter().map(guard_of).filter(|(j, watch)| *watch != Watch::Force && !strikers.contains(j));
            let acting: PerContact<usize> = strikers.iter().copied().chain(touched.map(|(j, _)| j)).collect();
            let after = |i: usize, j: usize| strikers.contains(&j) && self.depends((i, j), &from.mode, at, x_minus);
            let depends = |i: &usize| acting.iter().any(|j| i != j && (after(*i, *j) || after(*j, *i)));
            saltation.dependent.extend(acting.iter().copied().filter(depends));
            let logarithm = |j: &usize| match &self.contacts[*j].spec.law {
                Law::Rigid(l) if !settles && !rests(&to.mode, *j) => {
                    let speed = side(*j) * self.deflection(*j, at, x_minus).1;
                    let [e, slope] = [l.restitution.at(speed), l.restitution.rebound_slope(speed)];
                    libm::log(e) + libm::log(slope.abs())
                }
                _ => f64::NAN,
            };
            saltation.volume += strikers.iter().map(logarithm).sum::<f64>();
        } else {
            self.restrain(&to.mode, by.map(|by| Evaluation { x: x_plus, ..by }), columns);
        }
        saltation
    }

    /// Returns `tr f_x`, 1/s.
    pub(crate) fn divergence(&self, gradient: &Gradient) -> f64 {
        let structure = self.rows.iter().enumerate().flat_map(|(i, row)| row.iter().map(move |entry| (i, entry)));
        let damped: f64 = structure.filter(|(i, (j, ..))| *i == *j as usize).map(|(_, (.., c))| c).sum();
        let contacts = gradient.changes.iter().flatten();
        -damped - contacts.map(|c| c.by_rate * self.contacts[c.contact].mobility).sum::<f64>()
    }

    /// Returns the contribution to the divergence, 1/kg, per derivative of the force of contact `j` with respect to its rate.
    pub(crate) fn divergence_by(&self, j: usize) -> f64 {
        -self.contacts[j].mobility
    }

    /// Returns the size of the rates that contacts add, rad/s.
    pub(crate) fn rate_by(&self, gradient: &Gradient) -> f64 {
        let rate = |c: &ForceDerivatives| {
            let mobility = self.contacts[c.contact].mobility;
            (c.by_deflection.abs() * mobility).sqrt() + c.by_rate.abs() * mobility
        };
        gradient.changes.iter().flatten().map(rate).sum()
    }

    /// Returns the size of the rates of a mode, rad/s, with contacts of constant stiffness only.
    pub(crate) fn rate_of(&self, mode: &Mode) -> f64 {
        let free = self.own_rates(&Mode::default());
        let rates = self.rows.iter().map(|row| {
            let sum = |of: &dyn Fn(&(u32, f64, f64)) -> f64| row.iter().map(|entry| of(entry).abs()).sum::<f64>();
            sum(&|entry| entry.1).sqrt() + sum(&|entry| entry.2)
        });
        let contacts = self.carrying(mode).filter_map(|a| match a.force {
            Force::Linear { stiffness: Elasticity::Constant(k), damping } => {
                let mobility = self.contacts[a.contact].mobility;
                Some((k * mobility).sqrt() + damping * mobility)
            }
            _ => None,
        });
        rates.fold(free.oscillating.max(free.damped), f64::max) + contacts.sum::<f64>()
    }

    /// Returns `gᵀv̇ − ë` of contact `j` in `mode`, m/s².
    pub(super) fn relative_acceleration(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        let (mut forces, mut a) = (zeros(self.contacts.len()), vec![0.0; self.n]);
        self.dynamics(mode, at, x, &mut forces, &mut a);
        dot(&self.contacts[j].direction, &a) - self.error(j, at).2
    }
}
