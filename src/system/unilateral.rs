//! Unilateral contact of rigid flanks at one instant: strikes, rest, separation and release.
//!
//! All cases are one complementarity problem in the mobility `W = G M⁻¹Gᵀ`, for positions, then velocities, then accelerations:
//!
//! ```text
//! z ≥ 0,   s = d − W z ≤ 0,   zᵀ s = 0
//! ```
//!
//! - velocities: z are impulses, `d = (1 + e) u` for a contact that closes with speed u > 0, and `d = u` for one that only touches. A
//!   contact takes part if it strikes or rests. It also takes part if it touches with e = 0 and no striker rebounds. Otherwise a touching
//!   contact is struck by a later jump, as with a small gap; joint impulses would be another limit.
//! - accelerations: z are multipliers, d is the closing acceleration without them. Contacts without speed after the impulses take part:
//!   they rest if `s = 0` and release if `s < 0`.
//!
//! `W` is positive semidefinite and both problems are convex. The dual active-set method of Goldfarb and Idnani (1983) solves them; it
//! keeps its active contacts independent and terminates. Kinetic energy falls by `½ Σ P (1 − e) u` if every striker approaches. Rest is
//! data: the speed of a contact at rest is zero, and is never computed from the state.

use smallvec::{SmallVec, smallvec};

use super::{
    assemble::{PerContact, Structure, dot, zeros},
    contact_mode::{ContactMode, Watch, contact_mode, guard_id, guards_of, set_contact},
    sticking::Sticking,
};
use crate::{
    gear::contact::Law,
    hybrid::{GuardSet, Instant, Jump, Mode, ModelError},
};

/// Returns the rounding of a sum of products, relative to the sum of their sizes, for twice as many terms, at least 42.
pub(super) fn rounding(terms: usize) -> f64 {
    2.0 * terms.max(21) as f64 * f64::EPSILON
}

/// Ratio of a pivot to its diagonal entry below which the active contacts already hold the contact.
const DEPENDENT: f64 = 1e-12;

/// A rigid contact on its flank.
#[derive(Clone, Copy, Debug)]
struct Touching {
    contact: usize,
    /// +1 on the drive flank, −1 on the back flank.
    side: f64,
    /// Applied restitution; zero if a rebound would be lost in rounding.
    restitution: f64,
    /// Closing speed, m/s: exactly zero at rest.
    speed: f64,
    /// Rounding of the speed, m/s.
    error: f64,
    /// True if released at this instant: its multiplier is not tested again, and the third derivative decides.
    releases: bool,
    /// True if released and back on its flank at this instant, without speed: its multiplier starts from exactly zero.
    returns: bool,
}

impl Touching {
    fn flank(&self) -> Watch {
        if self.side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank }
    }
}

type Set = PerContact<Touching>;
type Vector = PerContact<f64>;
type Matrix = SmallVec<[Vector; 4]>;

/// Solution of a complementarity problem.
struct Solution {
    z: Vector,
    /// `d − W z`.
    rest: Vector,
    /// Rounding of `rest`.
    slack: Vector,
}

/// Solves the complementarity problem; `noise` is the rounding of each d. Returns `None` if no z satisfies it.
fn complement(w: &[Vector], d: &Vector, noise: Vector) -> Option<Solution> {
    let n = w.len();
    let mut s = Solution { z: zeros(n), rest: d.clone(), slack: noise };
    if n == 1 {
        s.slack[0] += rounding(1) * d[0].abs();
        if d[0] > s.slack[0] {
            (s.z[0], s.rest[0]) = (d[0] / w[0][0], 0.0);
        }
        return Some(s);
    }
    let noise = s.slack.clone();
    let mut active: PerContact<usize> = PerContact::new();
    // Each contact enters at most once for each contact that may leave.
    for _ in 0..4 * n * n + 4 {
        for i in 0..n {
            let terms = (0..n).map(|j| w[i][j] * s.z[j]);
            s.rest[i] = d[i] - terms.clone().sum::<f64>();
            s.slack[i] = noise[i] + rounding(n) * (d[i].abs() + terms.map(f64::abs).sum::<f64>());
        }
        // The worst violation relative to its mass.
        let violated = (0..n).filter(|i| s.rest[*i] > s.slack[*i] && !active.contains(i));
        let weight = |i: &usize| s.rest[*i] / w[*i][*i].sqrt();
        let Some(enter) = violated.max_by(|a, b| weight(a).total_cmp(&weight(b)).then(b.cmp(a))) else {
            return Some(s);
        };
        let mut left = s.rest[enter];
        loop {
            let mut step = zeros(active.len());
            for (r, k) in step.iter_mut().zip(&active) {
                *r = w[*k][enter];
            }
            solve(w, &active, &mut step);
            let known: f64 = active.iter().zip(&step).map(|(k, r)| w[enter][*k] * r).sum();
            let pivot = w[enter][enter] - known;
            let full = if pivot > DEPENDENT * w[enter][enter] { left / pivot } else { f64::INFINITY };
            let first = (0..active.len())
                .filter(|k| step[*k] > 0.0)
                .map(|k| (s.z[active[k]] / step[k], k))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let length = first.map_or(full, |(partial, _)| full.min(partial));
            if length == f64::INFINITY {
                return None;
            }
            s.z[enter] += length;
            active.iter().zip(&step).for_each(|(k, r)| s.z[*k] -= length * r);
            left -= length * pivot.max(0.0);
            match first {
                Some((partial, k)) if partial < full => {
                    s.z[active[k]] = 0.0;
                    active.remove(k);
                }
                _ => break,
            }
        }
        active.push(enter);
        active.sort_unstable();
        // The residual is recomputed, so that changes of z do not gather rounding.
        let mut exact = zeros(active.len());
        exact.iter_mut().zip(&active).for_each(|(r, k)| *r = d[*k]);
        solve(w, &active, &mut exact);
        active.iter().zip(&exact).for_each(|(k, z)| s.z[*k] = z.max(0.0));
    }
    None
}

/// Solves `W_AA r = r` in place by `L D Lᵀ`; the rows of A are independent.
fn solve(w: &[Vector], active: &[usize], r: &mut Vector) {
    let n = active.len();
    let (mut l, mut pivot) = (Matrix::new(), zeros(n));
    for i in 0..n {
        let mut row = zeros(n);
        for j in 0..=i {
            let other = l.get(j).unwrap_or(&row);
            let known: f64 = (0..j).map(|k| row[k] * other[k] * pivot[k]).sum();
            let entry = w[active[i]][active[j]] - known;
            if i == j { pivot[i] = entry } else { row[j] = entry / pivot[j] }
        }
        l.push(row);
    }
    for i in 0..n {
        r[i] -= (0..i).map(|k| l[i][k] * r[k]).sum::<f64>();
    }
    r.iter_mut().zip(&pivot).for_each(|(r, p)| *r /= p);
    for i in (0..n).rev() {
        r[i] -= (i + 1..n).map(|k| l[k][i] * r[k]).sum::<f64>();
    }
}

impl Structure {
    /// Resolves the rigid contacts at one instant. `fired` holds the guards that fall through zero now, `from` the mode and the valid
    /// zeros. `settles` brings the fired contacts to rest at any speed (the end of an accumulation).
    ///
    /// # Errors
    /// [`ModelError::ImpactUnsolvable`] if no impulses open all flanks: contacts with different restitution that hold each other.
    pub(crate) fn resolve(
        &self,
        jump: &mut Jump,
        (from, fired): (&Jump, &GuardSet),
        settles: bool,
        at: Instant,
        (x, low): (&mut [f64], &mut [f64]),
    ) -> Result<(), ModelError> {
        if let Some((id, projected)) = low.is_empty().then(|| self.rebound_of(from, fired, settles, at, x)).flatten() {
            jump.projected = jump.projected.max(projected);
            jump.pinned.insert(id);
            jump.struck.insert(id);
            return Ok(());
        }
        let set = self.touching(from, fired, settles, at, x);
        let w = self.mobility(&set);
        let error = |j: usize| self.error(j, at).0;
        let projected = self.project(set.iter().map(|t| (t.contact, t.side)), at, error, x, low);
        jump.projected = jump.projected.max(projected);
        let rates = self.rates_in_two(set.iter().map(|t| t.contact), at, x, low);
        let rests = self.strike(jump, &set, &w, settles, x)?;
        let struck = set.iter().zip(&rates).filter(|(t, _)| jump.struck.contains(guard_id(t.contact, t.flank())));
        let wanted = struck.map(|(t, u)| (t.contact, *u * if t.speed > 0.0 { -t.restitution } else { 0.0 }));
        self.refine(wanted, at, x, low);
        self.stop(set.iter().zip(&rests).filter(|(_, rests)| **rests).map(|(t, _)| t.contact), at, x);
        self.hold(jump, from, &set, &rests, at, x)
    }

    /// Returns `W` of the contacts in `set`.
    fn mobility(&self, set: &Set) -> Matrix {
        let mut matrix = Matrix::new();
        for a in set {
            let mut row = Vector::new();
            set.iter().for_each(|b| row.push(a.side * b.side * self.coupling(a.contact, b.contact)));
            matrix.push(row);
        }
        matrix
    }

    /// Returns the rigid contacts on their flanks that take part.
    fn touching(&self, from: &Jump, fired: &GuardSet, settles: bool, at: Instant, x: &[f64]) -> Set {
        let (mut set, mut supports, mut rebounds) = (Set::new(), Set::new(), false);
        for (j, c) in self.contacts.iter().enumerate() {
            let Law::Rigid(law) = &c.spec.law else { continue };
            let state = contact_mode(&from.mode, j);
            let contact = |side, restitution| {
                let speed = side * self.deflection(j, at, x).1;
                let error = self.speed_rounding(j, at, x);
                Touching { contact: j, side, restitution, speed, error, releases: false, returns: false }
            };
            let was_released = from.pinned.contains(guard_id(j, Watch::Force));
            if state.side() != 0.0 {
                let releases = if state.is_closed() { fired.contains(guard_id(j, Watch::Force)) } else { was_released };
                set.push(Touching { speed: 0.0, error: 0.0, releases, ..contact(state.side(), 0.0) });
                continue;
            }
            for (watch, side) in [(Watch::DriveFlank, 1.0), (Watch::BackFlank, -1.0)] {
                let id = guard_id(j, watch);
                if fired.contains(id) {
                    let striker = contact(side, 0.0);
                    let speed = if from.still.contains(id) || settles { 0.0 } else { striker.speed };
                    // A rebound lost in rounding counts as none: the contact comes to rest.
                    let own = law.restitution.at(speed);
                    let restitution = if settles || own * speed <= striker.error { 0.0 } else { own };
                    let returns = was_released && from.still.contains(id);
                    rebounds |= restitution > 0.0 && speed > 0.0;
                    set.push(Touching { speed, restitution, returns, ..striker });
                } else if from.pinned.contains(id) && law.restitution.is_dead() {
                    let touching = contact(side, 0.0);
                    let still = from.still.contains(id);
                    let stops = still || settles && touching.speed > 0.0;
                    let (speed, error) = if stops { (0.0, 0.0) } else { (touching.speed, touching.error) };
                    supports.push(Touching { speed, error, releases: was_released && still, ..touching });
                }
            }
        }
        if !rebounds {
            set.extend(supports);
            set.sort_unstable_by_key(|t| t.contact);
        }
        set
    }

    /// Applies the impulses, and returns for each contact whether it has no speed after them.
    fn strike(
        &self,
        jump: &mut Jump,
        set: &[Touching],
        w: &[Vector],
        settles: bool,
        x: &mut [f64],
    ) -> Result<PerContact<bool>, ModelError> {
        let mut rests: PerContact<bool> = smallvec![false; set.len()];
        if settles || set.iter().all(|t| t.speed <= 0.0) {
            rests.iter_mut().zip(set).for_each(|(rests, t)| *rests = t.speed.abs() <= t.error);
            return Ok(rests);
        }
        let (mut d, mut noise) = (zeros(set.len()), zeros(set.len()));
        for (i, t) in set.iter().enumerate() {
            d[i] = (1.0 + if t.speed > 0.0 { t.restitution } else { 0.0 }) * t.speed;
            noise[i] = t.error;
        }
        let solution = complement(w, &d, noise).ok_or_else(|| self.unsolvable(set))?;
        let shares = self.shares(set, w, &d, &solution);
        for ((t, z), share) in set.iter().zip(&solution.z).zip(&shares) {
            if *z > 0.0 || *share > 0.0 {
                jump.struck.insert(guard_id(t.contact, t.flank()));
            }
            for (i, p) in self.contacts[t.contact].push.iter().filter(|_| *z > 0.0) {
                x[self.n + *i as usize] -= p * t.side * z;
            }
        }
        for (i, t) in set.iter().enumerate() {
            let rebounds = t.speed > 0.0 && t.restitution > 0.0;
            rests[i] = !rebounds && solution.rest[i] >= -solution.slack[i];
        }
        // Rates and multipliers of all contacts that the impulses reach are no longer zero.
        for j in 0..self.contacts.len() {
            if set.iter().zip(&solution.z).any(|(t, z)| *z > 0.0 && self.coupling(j, t.contact) != 0.0) {
                guards_of(j).into_iter().for_each(|id| jump.still.remove(id));
                jump.pinned.remove(guard_id(j, Watch::Force));
            }
        }
        Ok(rests)
    }

    /// Returns the impulses of a strike: those of `solution`, or those of least norm if contacts hold each other and none of these pulls.
    /// The motion is the same with both; the latter treat equal contacts equally.
    fn shares(&self, set: &[Touching], w: &[Vector], d: &Vector, solution: &Solution) -> Vector {
        let all: PerContact<usize> = (0..set.len()).filter(|i| solution.rest[*i] >= -solution.slack[*i]).collect();
        if all.len() < 2 {
            return solution.z.clone();
        }
        let together = Sticking::of(self, all.iter().map(|i| set[*i].contact));
        if !together.is_redundant() {
            return solution.z.clone();
        }
        let mut impulses: PerContact<f64> = all.iter().map(|i| set[*i].side * d[*i]).collect();
        together.solve(&mut impulses);
        let mut shares = zeros(set.len());
        for (i, impulse) in all.iter().zip(&impulses) {
            let (share, rounding) = (set[*i].side * impulse, solution.slack[*i] / w[*i][*i]);
            if share < -rounding {
                return solution.z.clone();
            }
            shares[*i] = if share > rounding { share } else { 0.0 };
        }
        shares
    }

    /// Decides which of the contacts without speed rest and which release, and sets the zeros of all.
    fn hold(
        &self,
        jump: &mut Jump,
        from: &Jump,
        set: &[Touching],
        rests: &[bool],
        at: Instant,
        x: &[f64],
    ) -> Result<(), ModelError> {
        for t in set {
            set_contact(&mut jump.mode, t.contact, ContactMode::Separated);
            jump.pinned.insert(guard_id(t.contact, t.flank()));
        }
        let slow: Set = set.iter().zip(rests).filter(|(_, rests)| **rests).map(|(t, _)| *t).collect();
        for t in &slow {
            jump.still.insert(guard_id(t.contact, t.flank()));
        }
        if slow.is_empty() {
            return Ok(());
        }
        let pressed: Set = slow.iter().filter(|t| !t.releases).copied().collect();
        let (mut forces, mut a) = (zeros(self.contacts.len()), vec![0.0; self.n]);
        self.dynamics(&jump.mode, at, x, &mut forces, &mut a);
        let (mut d, mut noise) = (zeros(set.len()), zeros(set.len()));
        for (i, t) in pressed.iter().enumerate() {
            d[i] = t.side * (dot(&self.contacts[t.contact].direction, &a) - self.error(t.contact, at).2);
            noise[i] = rounding(self.contacts.len())
                * self.acceleration_size(t.contact, self.carrying(&jump.mode), x, |k| forces[k.contact]);
        }
        let w = self.mobility(&pressed);
        let solution = complement(&w, &d, noise).ok_or_else(|| self.unsolvable(&pressed))?;
        let held = self.sharing(&pressed, &w, &d, &solution);
        for j in held.contacts() {
            let side = pressed.iter().find(|t| t.contact == *j).map_or(0.0, |t| t.side);
            set_contact(&mut jump.mode, *j, Self::resting(side));
        }
        // A contact whose gap resting contacts keep at zero carries no force and stays on its flank.
        for t in slow.iter().filter(|t| !held.contacts().contains(&t.contact)) {
            let moves = |j: &usize| !self.contacts[*j].error.is_empty();
            if held.holds(self, t.contact) && !held.contacts().iter().chain([&t.contact]).any(moves) {
                set_contact(&mut jump.mode, t.contact, Self::touching_only(t.side));
            }
        }
        // A multiplier that fell through zero leaves the gap without acceleration, and the third derivative decides. An impulse, or a
        // contact that comes to rest, changes the accelerations and prevents this.
        let comes_to_rest = |t: &Touching| !t.returns && contact_mode(&from.mode, t.contact).side() == 0.0;
        let undisturbed = jump.struck.is_empty() && !pressed.iter().any(comes_to_rest);
        for t in slow.iter().filter(|t| t.releases || t.returns) {
            let force = guard_id(t.contact, Watch::Force);
            if undisturbed && from.pinned.contains(force) {
                jump.pinned.insert(force);
            }
        }
        Ok(())
    }

    /// Returns the contacts of `pressed` that carry the load: all that rest, if no multiplier of least norm pulls. Otherwise it returns
    /// those that carry it in the solution, and those that are independent of them.
    fn sharing(&self, pressed: &Set, w: &[Vector], d: &Vector, solution: &Solution) -> Sticking {
        let of = |set: &[usize]| Sticking::of(self, set.iter().map(|i| pressed[*i].contact));
        let rests = |i: &usize| solution.rest[*i] >= -solution.slack[*i];
        let all: PerContact<usize> = (0..pressed.len()).filter(rests).collect();
        let together = of(&all);
        let mut multipliers = zeros(pressed.len());
        multipliers.iter_mut().zip(&all).for_each(|(m, i)| *m = pressed[*i].side * d[*i]);
        together.solve(&mut multipliers);
        let pushes = |(m, i): (&f64, &usize)| pressed[*i].side * m >= -solution.slack[*i] / w[*i][*i];
        if !together.is_redundant() || multipliers.iter().zip(&all).all(pushes) {
            return together;
        }
        let mut basis: PerContact<usize> = all.iter().copied().filter(|i| solution.z[*i] > 0.0).collect();
        for i in all {
            if solution.z[i] == 0.0 && !of(&basis).holds(self, pressed[i].contact) {
                basis.push(i);
            }
        }
        basis.sort_unstable();
        of(&basis)
    }

    fn unsolvable(&self, set: &[Touching]) -> ModelError {
        let names: Vec<&str> = set.iter().map(|t| self.name_of(t.contact)).collect();
        ModelError::ImpactUnsolvable { elements: names.join(", ") }
    }

    /// Returns the rounding of a closing speed, m/s, from the terms of its sum.
    pub(crate) fn speed_rounding(&self, j: usize, at: Instant, x: &[f64]) -> f64 {
        let c = &self.contacts[j];
        let terms: f64 = c.direction.iter().map(|(i, g)| (g * x[self.n + *i as usize]).abs()).sum();
        8.0 * f64::EPSILON * (terms + self.error(j, at).1.abs())
    }

    /// Returns the name of contact `j`.
    pub(crate) fn name_of(&self, j: usize) -> &str {
        &self.contacts[j].spec.name
    }

    /// Moves the state onto the flanks of `contacts` (number, side), by the displacement of least kinetic size. Returns the largest error
    /// of a deflection before, m.
    pub(crate) fn project(
        &self,
        contacts: impl Iterator<Item = (usize, f64)> + Clone,
        at: Instant,
        error: impl Fn(usize) -> f64,
        x: &mut [f64],
        low: &mut [f64],
    ) -> f64 {
        let off = contacts.clone().map(|(j, side)| match side * self.contacts[j].gap() {
            flank if low.is_empty() => flank - (dot(&self.contacts[j].direction, x) - error(j)),
            flank => -(self.deflection_in_two(j, at, x, low) - flank.into()).value(),
        });
        let off: PerContact<f64> = off.collect();
        let positions = if low.is_empty() { &mut x[..self.n] } else { &mut low[..self.n] };
        self.shift(contacts.map(|(j, _)| j), &off, positions);
        off.iter().fold(0.0, |m: f64, off| m.max(off.abs()))
    }

    /// Moves the contacts at rest in `mode` onto their flanks, without speed.
    pub(crate) fn rest(&self, mode: &Mode, at: Instant, x: &mut [f64]) {
        let resting = (0..self.contacts.len())
            .filter(|j| self.contacts[*j].spec.law.is_rigid())
            .map(|j| (j, contact_mode(mode, j)))
            .filter(|(_, state)| state.is_closed())
            .map(|(j, state)| (j, state.side()));
        if resting.clone().next().is_some() {
            let equal = self.equal(x);
            self.project(resting.clone(), at, |j| self.error(j, at).0, x, &mut []);
            self.stop(resting.map(|(j, _)| j), at, x);
            self.restore_equal(&equal, x, &mut []);
        }
    }

    /// Subtracts the rates of `contacts` from the velocities.
    fn stop(&self, contacts: impl Iterator<Item = usize> + Clone, at: Instant, x: &mut [f64]) {
        let rates: PerContact<f64> = contacts.clone().map(|j| -self.deflection(j, at, x).1).collect();
        self.shift(contacts, &rates, &mut x[self.n..2 * self.n]);
    }

    /// Adds `M⁻¹Gᵀ y` with `W y = by`, so that `G` times the change is `by`.
    pub(crate) fn shift(&self, contacts: impl Iterator<Item = usize> + Clone, by: &[f64], values: &mut [f64]) {
        if by.iter().all(|by| *by == 0.0) {
            return;
        }
        if let ([by], Some(j)) = (by, contacts.clone().next()) {
            let c = &self.contacts[j];
            c.push.iter().for_each(|(i, p)| values[*i as usize] += p / c.mobility * by);
            return;
        }
        let mut y = PerContact::from_slice(by);
        Sticking::of(self, contacts.clone()).solve(&mut y);
        for (j, y) in contacts.zip(&y) {
            self.contacts[j].push.iter().for_each(|(i, p)| values[*i as usize] += p * y);
        }
    }

    /// Returns the state of a rigid contact at rest on `side`.
    pub(crate) fn resting(side: f64) -> ContactMode {
        if side > 0.0 { ContactMode::Drive } else { ContactMode::Back }
    }

    /// Returns the state of a contact that others hold on its flank, without load.
    fn touching_only(side: f64) -> ContactMode {
        if side > 0.0 { ContactMode::DriveDetached } else { ContactMode::BackDetached }
    }
}
