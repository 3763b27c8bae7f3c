//! The train as a hybrid automaton: successor modes and resets of its guards.

use std::cell::LazyCell;

use smallvec::SmallVec;

use super::{
    acting::Force,
    assemble::{Contact, PerContact, Structure, Wave, dot, zeros},
    contact_mode::{ContactMode, Watch, contact_mode, guard_id, guard_of, guards_of, piece, set_contact, set_piece},
    schedule::{self, Schedule},
    symmetry::Equal,
};
use crate::{
    gear::contact::Law,
    hybrid::{
        Clock, ContactView, GuardId, GuardSet, HybridSystem, Instant, JetField, Jump, Lane, Mode, ModelError, Rates,
        VectorField, normalise,
    },
};

/// Rounding of a deflection relative to the sum of its terms.
const ON_FLANK: f64 = 4.0 * f64::EPSILON;

/// Reason for which a run cannot start in a state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// A rigid flank is penetrated.
    #[error("{contact} starts {depth:e} m inside its rigid flank; start at or outside it")]
    InsideRigid {
        /// Name of the contact.
        contact: String,
        /// Depth, m.
        depth: f64,
    },
    /// The initial state has the wrong length or is not finite.
    #[error("the initial state needs {expected} finite displacements and {expected} finite velocities")]
    State {
        /// Number of degrees of freedom.
        expected: usize,
    },
    /// A closed contact with hysteresis has no approach speed.
    #[error("{contact} is closed with a latched approach speed of {speed:e} m/s; it must be above zero")]
    Latched {
        /// Name of the contact.
        contact: String,
        /// Latched speed of the contact, m/s.
        speed: f64,
    },
}

/// State and mode at the start of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// State `(q, q̇, latched speeds)`.
    pub x: Vec<f64>,
    /// Mode and exact zeros.
    pub jump: Jump,
}

impl Structure {
    /// Returns the state and mode of a run that starts with displacements `q` and velocities `v`.
    ///
    /// The mode follows from the geometry. A contact exactly on a flank starts outside it, with the guard pinned to zero; the first
    /// non-zero derivative then decides, by the same rule as after any jump.
    ///
    /// # Errors
    /// [`StartError`] for a penetrated rigid flank or an unusable state.
    pub fn start(&self, at: Instant, q: &[f64], v: &[f64]) -> Result<Start, StartError> {
        if q.len() != self.n || v.len() != self.n || q.iter().chain(v).any(|y| !y.is_finite()) {
            return Err(StartError::State { expected: self.n });
        }
        let mut x = Vec::with_capacity(self.dim);
        x.extend_from_slice(q);
        x.extend_from_slice(v);
        x.extend(self.contacts.iter().filter(|c| c.latch.is_some()).map(|c| match c.spec.law {
            Law::Power(l) => l.initial_speed,
            _ => 0.0,
        }));
        let mut jump = Jump { mode: self.switched(&Mode::default(), at), ..Jump::default() };
        for (j, c) in self.contacts.iter().enumerate() {
            let (d, rate) = self.deflection(j, at, &x);
            let back = c.has_back();
            let depth = (d - c.gap()).max(if back { -d - c.gap() } else { f64::NEG_INFINITY });
            // A start within rounding of a flank is on the flank.
            let depth = if depth.abs() <= ON_FLANK * self.deflection_size(c, &x) { 0.0 } else { depth };
            let rigid = c.spec.law.is_rigid();
            if c.spec.law.is_bilateral() {
                self.enter(&mut jump.mode, j, ContactMode::Drive, at);
            } else if depth > 0.0 && rigid {
                return Err(StartError::InsideRigid { contact: c.spec.name.clone(), depth });
            } else if depth > 0.0 {
                // A single flank may lie anywhere: a wall has a position.
                let side = if back { d } else { 1.0 };
                self.enter(&mut jump.mode, j, Self::resting(side), at);
            } else if depth == 0.0 {
                let id = guard_id(j, if d > 0.0 || !back { Watch::DriveFlank } else { Watch::BackFlank });
                jump.pinned.insert(id);
                if rate == 0.0 {
                    jump.still.insert(id);
                }
            }
        }
        Ok(Start { x, jump })
    }

    /// Returns the state and mode of a run that continues another motion, of this train or of one with a few other parameters. `x` is the
    /// state `(q, q̇, latched speeds)` of that motion, `contacts` the states of its contacts.
    ///
    /// If the flanks have moved, the geometry decides, as at any [`start`](Self::start). A contact detached inside the zone of a flank and
    /// still there stays detached. Latched speeds are kept. A contact that was open and is now inside the zone of a flank has latched none,
    /// and starts with that of its law.
    ///
    /// # Errors
    /// As [`start`](Self::start); [`StartError::State`] for a state of another length; [`StartError::Latched`] for a latched speed that is
    /// not above zero.
    pub fn resume(&self, at: Instant, x: &[f64], contacts: &[ContactMode]) -> Result<Start, StartError> {
        if x.len() != self.dim || contacts.len() != self.spec.contacts.len() {
            return Err(StartError::State { expected: self.n });
        }
        let mut before = Mode::default();
        contacts.iter().enumerate().for_each(|(j, state)| self.set_contact(&mut before, j, *state));
        let mut start = self.start(at, &x[..self.n], &x[self.n..2 * self.n])?;
        for j in 0..self.flanks() {
            let [was, is] = [&before, &start.jump.mode].map(|mode| contact_mode(mode, j));
            if let Some(latch) = self.contacts[j].latch {
                let (opens, speed) = (is == ContactMode::Separated, x[latch]);
                if opens || was.side() == is.side() {
                    start.x[latch] = speed;
                }
                if !opens && (start.x[latch] <= 0.0 || start.x[latch].is_nan()) {
                    return Err(StartError::Latched {
                        contact: self.contacts[j].spec.name.clone(),
                        speed: start.x[latch],
                    });
                }
            }
            if is.is_closed() && !was.is_closed() && was.side() == is.side() {
                self.enter(&mut start.jump.mode, j, was, at);
            }
        }
        Ok(start)
    }

    /// Follows one fired guard of a compliant contact. `is_zero` marks a guard that fell through zero and was not already outside.
    fn follow(
        &self,
        jump: &mut Jump,
        (j, watch): (usize, Watch),
        is_zero: bool,
        at: Instant,
        x: &mut [f64],
    ) -> Result<(), ModelError> {
        let c = &self.contacts[j];
        let state = contact_mode(&jump.mode, j);
        // The contact left through the flank in the same batch: nothing remains to release.
        if state == ContactMode::Separated && watch == Watch::Force {
            return Ok(());
        }
        let Some(next) = state.after(watch) else {
            return Err(ModelError::NoEdge {
                guard: match watch {
                    Watch::DriveFlank => "drive flank",
                    Watch::BackFlank => "back flank",
                    Watch::Force => "force",
                },
                element: self.name_of(j).to_owned(),
                mode: state.name().to_owned(),
            });
        };
        self.enter(&mut jump.mode, j, next, at);
        // A force taken past zero by a stiffness step or by an impact elsewhere is not zero.
        if watch != Watch::Force || is_zero {
            jump.pinned.insert(guard_id(j, watch));
        }
        if let (Law::Power(l), Some(i), ContactMode::Separated) = (c.spec.law, c.latch, state) {
            let approach = next.side() * self.deflection(j, at, x).1;
            x[i] = approach.max(l.speed_floor);
        }
        Ok(())
    }
}

impl Structure {
    /// Returns the classes with equal displacements and with equal velocities, and their values.
    pub(crate) fn equal(&self, x: &[f64]) -> [Equal; 2] {
        if self.symmetry.is_empty() {
            return [Equal::new(), Equal::new()];
        }
        let [mut q, mut v] = [self.symmetry.equal(&x[..self.n]), self.symmetry.equal(&x[self.n..2 * self.n])];
        let both = |class: usize, others: &Equal| others.iter().any(|(other, _)| *other == class);
        q.retain(|(class, _)| both(*class, &v));
        v.retain(|(class, _)| both(*class, &q));
        [q, v]
    }

    /// Returns whether equal parts of the train are also equal in state and mode.
    pub(crate) fn is_symmetric(&self, mode: &Mode, x: &[f64]) -> bool {
        let (q, v) = x[..2 * self.n].split_at(self.n);
        let latched = |j: usize| self.contacts[j].latch.map(|latch| x[latch]);
        self.symmetry.are_all_equal(q)
            && self.symmetry.are_all_equal(v)
            && self.symmetry.agree(|j| (contact_mode(mode, j), latched(j)))
    }

    /// Makes values that were equal before a jump equal after it.
    pub(crate) fn restore_equal(&self, [displacements, velocities]: &[Equal; 2], x: &mut [f64], low: &mut [f64]) {
        self.symmetry.restore(displacements, &mut x[..self.n]);
        self.symmetry.restore(velocities, &mut x[self.n..2 * self.n]);
        if !low.is_empty() {
            self.symmetry.share(displacements, &x[..self.n], &mut low[..self.n]);
            self.symmetry.share(velocities, &x[self.n..2 * self.n], &mut low[self.n..2 * self.n]);
        }
    }

    /// Sets contact `j` to `state` at `at`.
    pub(crate) fn enter(&self, mode: &mut Mode, j: usize, state: ContactMode, at: Instant) {
        self.enter_piece(mode, j, state, |schedule| schedule.piece(&self.clock, at).0);
    }

    /// Sets contact `j` to `state`; `number` gives the piece of a schedule that it follows from now on. Without a schedule the piece is
    /// zero, so that equal motions have equal modes.
    pub(crate) fn enter_piece(
        &self,
        mode: &mut Mode,
        j: usize,
        state: ContactMode,
        number: impl FnOnce(&Schedule) -> u32,
    ) {
        let followed = self.followed(mode, j).is_some();
        set_contact(mode, j, state);
        match self.followed(mode, j) {
            Some(_) if followed => {}
            Some(schedule) => set_piece(mode, j, number(schedule)),
            None => set_piece(mode, j, 0),
        }
    }

    /// Returns the part of `from` that remains valid at the same instant: the zeros of the contacts that do not fire again.
    fn standing(from: &Jump, fired: &GuardSet) -> Jump {
        let mut jump =
            Jump { mode: from.mode.clone(), pinned: from.pinned.clone(), still: from.still.clone(), ..Jump::default() };
        if jump.pinned.is_empty() && jump.still.is_empty() {
            return jump;
        }
        for id in fired.iter() {
            for guard in guards_of(guard_of(id).0) {
                jump.pinned.remove(guard);
                jump.still.remove(guard);
            }
        }
        jump
    }
}

impl Structure {
    /// Returns the value of a guard, for a given deflection and rate of its contact.
    fn guard_of_deflection(
        &self,
        mode: &Mode,
        id: GuardId,
        (at, x): (Instant, &[f64]),
        deflection: impl Fn(usize) -> (f64, f64),
    ) -> f64 {
        let (j, watch) = guard_of(id);
        let c = &self.contacts[j];
        let sign = self.watched(mode, j).iter().find(|(w, _)| *w == watch).map_or(0.0, |(_, s)| *s);
        sign * match (watch, self.acting(mode, j)) {
            (Watch::DriveFlank, _) => c.gap() - deflection(j).0,
            (Watch::BackFlank, _) => deflection(j).0 + c.gap(),
            (Watch::Force, None) => 0.0,
            (Watch::Force, Some(a)) => match a.force {
                Force::Power { .. } => self.factor(&a, deflection(j).1, x),
                Force::Linear { .. } => a.side * self.force_of_deflection(&a, (at, x), deflection(j)),
                Force::Held => {
                    let (mut forces, mut accelerations) = (zeros(self.contacts.len()), vec![0.0; self.n]);
                    self.dynamics(mode, at, x, &mut forces, &mut accelerations);
                    a.side * forces[j]
                }
            },
        }
    }
}

impl HybridSystem for Structure {
    fn dim(&self) -> usize {
        self.dim
    }

    fn clock(&self) -> &Clock {
        &self.clock
    }

    fn motion<'a>(&'a self, mode: &Mode) -> Option<Box<dyn JetField + 'a>> {
        Some(self.compile(mode))
    }

    fn has_series(&self) -> bool {
        true
    }

    fn lane<'a>(&'a self) -> Option<Box<dyn Lane + 'a>> {
        self.silent()
    }

    fn field(&self) -> &dyn VectorField {
        self
    }

    fn guards(&self, mode: &Mode, out: &mut Vec<GuardId>) {
        out.clear();
        for j in 0..self.contacts.len() {
            for (watch, _) in self.watched(mode, j) {
                out.push(guard_id(j, *watch));
            }
        }
    }

    fn guard(&self, mode: &Mode, id: GuardId, at: Instant, x: &[f64]) -> f64 {
        self.guard_of_deflection(mode, id, (at, x), |j| self.deflection(j, at, x))
    }

    fn guard_values(&self, mode: &Mode, ids: &[GuardId], (at, x): (Instant, &[f64]), take: &mut dyn FnMut(usize, f64)) {
        // All guards use the same oscillators.
        let mut oscillators: SmallVec<[[f64; 2]; 8]> = SmallVec::new();
        self.oscillate(at, |_, cosine, sine| oscillators.push([cosine, sine]));
        let sum = |waves: &[Wave]| {
            waves.iter().fold(0.0, |sum, w| {
                let [cosine, sine] = oscillators[w.index];
                sum + w.cosine * cosine + w.sine * sine
            })
        };
        let deflection = |j: usize| {
            let c = &self.contacts[j];
            let error = c.spec.error_offset + sum(&c.error);
            (dot(&c.direction, x) - error, dot(&c.direction, &x[self.n..]) - sum(&c.error_rate))
        };
        ids.iter().enumerate().for_each(|(i, id)| take(i, self.guard_of_deflection(mode, *id, (at, x), deflection)));
    }

    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        at: Instant,
        x: &mut [f64],
        low: &mut [f64],
    ) -> Result<Jump, ModelError> {
        let low = if self.is_conservative { low } else { &mut [] };
        let mut jump = Self::standing(from, fired);
        let equal = self.equal(x);
        let mut rigid = false;
        let flanks: PerContact<(usize, f64)> =
            fired.iter().map(|id| (guard_of(id).0, guard_of(id).1.side())).filter(|(_, side)| *side != 0.0).collect();
        jump.projected = self.project(flanks.iter().copied(), at, |j| self.error(j, at).0, x, low);
        for id in fired.iter() {
            let (j, watch) = guard_of(id);
            match self.contacts[j].spec.law {
                Law::Rigid(_) => rigid = true,
                _ => self.follow(&mut jump, (j, watch), from.pinned.contains(id), at, x)?,
            }
        }
        if rigid {
            self.resolve(&mut jump, (from, fired), false, at, (x, low))?;
        }
        normalise(x, low);
        self.restore_equal(&equal, x, low);
        Ok(jump)
    }

    fn meet(&self, mode: &Mode, id: GuardId, at: Instant, most: f64, x: &mut [f64], low: &mut [f64]) -> f64 {
        self.meet_guard(mode, id, at, most, x, low)
    }

    fn next_switch(&self, mode: &Mode, at: Instant) -> Option<Instant> {
        let late = LazyCell::new(|| schedule::late(&self.clock, at));
        let ends =
            (0..self.contacts.len()).filter_map(|j| self.followed(mode, j)?.end(&self.clock, *late, piece(mode, j)));
        ends.reduce(|first, end| if end < first { end } else { first })
    }

    fn switched(&self, mode: &Mode, at: Instant) -> Mode {
        let mut mode = mode.clone();
        for j in 0..self.contacts.len() {
            if let Some(schedule) = self.followed(&mode, j) {
                set_piece(&mut mode, j, schedule.piece(&self.clock, at).0);
            }
        }
        mode
    }

    fn mode_in_words(&self, mode: &Mode) -> String {
        let words =
            |(j, c): (usize, &Contact)| format!("{} {}", c.spec.name, ContactView::contact_mode(self, j, mode).name());
        self.contacts().iter().enumerate().map(words).collect::<Vec<_>>().join(", ")
    }

    fn guard_in_words(&self, id: GuardId) -> String {
        let (j, watch) = self.watch(id);
        let what = match watch {
            Watch::DriveFlank => "the drive flank",
            Watch::BackFlank => "the back flank",
            Watch::Force => "the force",
        };
        format!("{what} of {}", self.name_of(j))
    }

    fn is_continuous(&self, id: GuardId) -> bool {
        guard_of(id).1 != Watch::Force
    }

    fn sizes(&self, mode: &Mode, at: Instant, x: &[f64], sizes: &mut [f64]) -> Option<f64> {
        self.pressed_sizes(mode, at, x, sizes)
    }

    fn rates(&self, mode: &Mode) -> Option<Rates> {
        Some(self.own_rates(mode))
    }

    fn restitution(&self, id: GuardId) -> Option<f64> {
        self.rebound_law(id).map(|law| law.restitution.at(0.0))
    }

    fn steady_speed(&self, id: GuardId) -> f64 {
        self.rebound_law(id).map_or(f64::INFINITY, |law| law.restitution.steady_speed())
    }

    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        let mut jump = Self::standing(from, fired);
        let equal = self.equal(x);
        self.resolve(&mut jump, (from, fired), true, at, (x, &mut []))?;
        self.restore_equal(&equal, x, &mut []);
        Ok(jump)
    }
}
