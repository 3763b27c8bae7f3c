//! The train as a hybrid automaton: which guard leads where, and what it resets.

use super::{
    assemble::{Contact, MAX_CONTACTS, Structure},
    contact_mode::{ContactMode, Watch, contact_mode, guard_id, guard_of, with_contact, with_piece},
    impact::Striker,
};
use crate::{
    gear::contact::Law,
    hybrid::{Clock, Flow, Guard, GuardId, GuardSet, HybridSystem, Instant, Jump, Mode, ModelError, Rates},
};

use super::assemble::Spring;

/// Why a run cannot start where it was told to.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// A rigid flank is penetrated.
    #[error("{contact} starts {depth:e} m inside its rigid flank; start at or outside it")]
    InsideRigid {
        /// Which contact.
        contact: String,
        /// How deep, m.
        depth: f64,
    },
    /// The initial state has the wrong length or is not finite.
    #[error("the initial state needs {expected} finite displacements and {expected} finite velocities")]
    State {
        /// Number of freedoms.
        expected: usize,
    },
}

/// Where a run starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// State `(q, q̇, latched speeds)`.
    pub x: Vec<f64>,
    /// Mode and exact zeros.
    pub jump: Jump,
}

impl Structure {
    /// The state and mode of a run that starts with displacements `q` and velocities `v`.
    ///
    /// The mode follows the geometry. A contact exactly on a flank starts outside it, with the guard pinned to zero;
    /// the first non-zero derivative then decides, by the same rule as after any jump.
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
        let mut jump = Jump { mode: self.switched(Mode::default(), at), ..Jump::default() };
        for (j, c) in self.contacts.iter().enumerate() {
            let (d, rate) = self.deflection(j, at, &x);
            let back = c.has_back();
            let depth = (d - c.gap()).max(if back { -d - c.gap() } else { f64::NEG_INFINITY });
            let rigid = matches!(c.spec.law, Law::Rigid(_));
            if matches!(c.spec.law, Law::Bilateral(_)) {
                jump.mode = with_contact(jump.mode, j, ContactMode::Drive);
            } else if depth > 0.0 && rigid {
                return Err(StartError::InsideRigid { contact: c.spec.name.clone(), depth });
            } else if depth > 0.0 {
                jump.mode = with_contact(jump.mode, j, Self::resting(d));
            } else if depth == 0.0 {
                let id = guard_id(j, if d >= c.gap() { Watch::DriveFlank } else { Watch::BackFlank });
                jump.pinned.insert(id);
                if rate == 0.0 {
                    jump.still.insert(id);
                }
            }
        }
        Ok(Start { x, jump })
    }

    /// The state and mode of a run that takes up the motion of another one, of this train or of one that differs from it
    /// in a few numbers: `x` is its state `(q, q̇, latched speeds)`, `contacts` the states of its contacts.
    ///
    /// Where the flanks have moved the geometry decides, as at any [`start`](Self::start); a contact that was detached
    /// inside the zone of a flank and still lies there stays so, and latched speeds are kept.
    ///
    /// # Errors
    /// As [`start`](Self::start); [`StartError::State`] for a state of another length.
    pub fn resume(&self, at: Instant, x: &[f64], contacts: &[ContactMode]) -> Result<Start, StartError> {
        if x.len() != self.dim || contacts.len() != self.contacts.len() {
            return Err(StartError::State { expected: self.n });
        }
        let mut start = self.start(at, &x[..self.n], &x[self.n..2 * self.n])?;
        start.x[2 * self.n..].copy_from_slice(&x[2 * self.n..]);
        for (j, &was) in contacts.iter().enumerate() {
            let is = contact_mode(start.jump.mode, j);
            if is.is_closed() && !was.is_closed() && was.side() == is.side() {
                start.jump.mode = with_contact(start.jump.mode, j, was);
            }
        }
        Ok(start)
    }

    /// Follows one fired guard of a compliant contact. `is_zero`: it fell through zero, and is not outside already.
    fn follow(
        &self,
        jump: &mut Jump,
        (j, watch): (usize, Watch),
        is_zero: bool,
        at: Instant,
        x: &mut [f64],
    ) -> Result<(), ModelError> {
        use ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated};
        let c = &self.contacts[j];
        let state = contact_mode(jump.mode, j);
        let next = match (state, watch) {
            (Separated, Watch::DriveFlank) => Drive,
            (Separated, Watch::BackFlank) => Back,
            (Drive | DriveDetached, Watch::DriveFlank) | (Back | BackDetached, Watch::BackFlank) => Separated,
            (Drive, Watch::Force) => DriveDetached,
            (Back, Watch::Force) => BackDetached,
            (DriveDetached, Watch::Force) => Drive,
            (BackDetached, Watch::Force) => Back,
            // Left through the flank in the same batch: nothing remains to release.
            (Separated, Watch::Force) => return Ok(()),
            _ => {
                return Err(ModelError::NoEdge {
                    guard: match watch {
                        Watch::DriveFlank => "drive flank",
                        Watch::BackFlank => "back flank",
                        Watch::Force => "force",
                    },
                    element: self.name_of(j).to_owned(),
                    mode: state.name().to_owned(),
                });
            }
        };
        jump.mode = with_contact(jump.mode, j, next);
        // A force that a stiffness step or an impact elsewhere took past zero is not zero.
        if watch != Watch::Force || is_zero {
            jump.pinned.insert(guard_id(j, watch));
        }
        if watch != Watch::Force {
            let target = if watch == Watch::DriveFlank { c.gap() } else { -c.gap() };
            jump.projected = jump.projected.max(self.project(j, target, at, x));
        }
        if let (Law::Power(l), Some(i), Separated) = (c.spec.law, c.latch, state) {
            let approach = next.side() * self.deflection(j, at, x).1;
            x[i] = approach.max(l.speed_floor);
        }
        Ok(())
    }

    /// Takes the rate of contact `j` out of the velocities.
    fn stop(&self, j: usize, at: Instant, x: &mut [f64]) {
        let (c, rate) = (&self.contacts[j], self.deflection(j, at, x).1);
        c.push.iter().for_each(|(i, p)| x[self.n + *i as usize] -= p / c.mobility * rate);
    }

    /// A resting rigid contact lets go: gap, rate and, at a crossing of the multiplier, acceleration are zero.
    fn release(&self, jump: &mut Jump, j: usize, at: Instant, x: &mut [f64]) {
        let state = contact_mode(jump.mode, j);
        let flank = guard_id(j, if state.side() > 0.0 { Watch::DriveFlank } else { Watch::BackFlank });
        let (mut forces, mut a) = ([0.0; MAX_CONTACTS], vec![0.0; self.n]);
        self.dynamics(jump.mode, at, x, &mut forces, &mut a);
        // The multiplier against the accelerations it is a difference of.
        let size = self.acceleration_size(j, jump.mode, x, |k| forces[k]);
        if (forces[j] * self.contacts[j].mobility).abs() <= 1e3 * f64::EPSILON * size {
            jump.pinned.insert(guard_id(j, Watch::Force));
        }
        jump.pinned.insert(flank);
        jump.still.insert(flank);
        jump.projected = jump.projected.max(self.project(j, state.side() * self.contacts[j].gap(), at, x));
        self.stop(j, at, x);
        jump.mode = with_contact(jump.mode, j, ContactMode::Separated);
    }

    /// Brings `strikers` to their rebound (or to rest), and pins their flanks.
    fn rebound(&self, jump: &mut Jump, strikers: &[Striker], at: Instant, x: &mut [f64]) -> Result<(), ModelError> {
        for s in strikers {
            let target = s.side * self.contacts[s.contact].gap();
            jump.projected = jump.projected.max(self.project(s.contact, target, at, x));
        }
        self.strike(jump.mode, strikers, at, x)?;
        for s in strikers {
            let flank = guard_id(s.contact, if s.side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank });
            jump.pinned.insert(flank);
            let rests = s.restitution == 0.0
                && self.closing_speed(s.contact, s.side, at, x).abs() <= self.speed_rounding(s.contact, at, x);
            if rests {
                jump.mode = with_contact(jump.mode, s.contact, Self::resting(s.side));
                jump.still.insert(flank);
            }
        }
        self.tear_off(jump, strikers, at, x);
        Ok(())
    }

    /// Contacts at rest that an impact elsewhere has sent off their flanks are separated, with a rate.
    fn tear_off(&self, jump: &mut Jump, strikers: &[Striker], at: Instant, x: &mut [f64]) {
        for (j, c) in self.contacts.iter().enumerate() {
            let state = contact_mode(jump.mode, j);
            let at_rest = matches!(c.spec.law, Law::Rigid(_)) && state.is_closed();
            if !at_rest || strikers.iter().any(|s| s.contact == j) {
                continue;
            }
            if self.closing_speed(j, state.side(), at, x) < -self.speed_rounding(j, at, x) {
                jump.projected = jump.projected.max(self.project(j, state.side() * c.gap(), at, x));
                jump.pinned.insert(guard_id(j, if state.side() > 0.0 { Watch::DriveFlank } else { Watch::BackFlank }));
                jump.mode = with_contact(jump.mode, j, ContactMode::Separated);
            }
        }
    }
}

/// The force guards of all contacts.
const FORCES: u128 = {
    let (mut set, mut j) = (0, 0);
    while j < MAX_CONTACTS {
        set |= 1 << (3 * j + Watch::Force as usize);
        j += 1;
    }
    set
};

impl Structure {
    /// What still stands of `from` at the same instant: the zeros of the contacts that do not fire again.
    fn standing(from: &Jump, fired: GuardSet) -> Jump {
        let again = fired.iter().fold(0, |set, id| set | 7 << (3 * guard_of(id).0));
        Jump {
            mode: from.mode,
            pinned: GuardSet(from.pinned.0 & !again),
            still: GuardSet(from.still.0 & !again),
            projected: 0.0,
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

    fn flow(&self) -> Flow<'_> {
        Flow::Jet(self, self)
    }

    fn guards(&self, mode: Mode, out: &mut Vec<Guard>) {
        out.clear();
        for (j, c) in self.contacts.iter().enumerate() {
            for (watch, _) in self.watched(c, contact_mode(mode, j)) {
                out.push(Guard { id: guard_id(j, *watch) });
            }
        }
    }

    fn guard(&self, mode: Mode, id: GuardId, at: Instant, x: &[f64]) -> f64 {
        let (j, watch) = guard_of(id);
        let c = &self.contacts[j];
        let state = contact_mode(mode, j);
        let sign = self.watched(c, state).iter().find(|(w, _)| *w == watch).map_or(0.0, |(_, s)| *s);
        let (d, r) = self.deflection(j, at, x);
        sign * match (watch, c.spec.law) {
            (Watch::DriveFlank, _) => c.gap() - d,
            (Watch::BackFlank, _) => d + c.gap(),
            (Watch::Force, Law::Power(_)) => self.factor(c, state.side() * r, x),
            (Watch::Force, Law::Rigid(_)) => {
                let (mut forces, mut a) = ([0.0; MAX_CONTACTS], vec![0.0; self.n]);
                self.dynamics(mode, at, x, &mut forces, &mut a);
                state.side() * forces[j]
            }
            (Watch::Force, _) => state.side() * self.law_force(j, mode, state, at, x),
        }
    }

    fn jump(&self, from: &Jump, fired: GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        let mut jump = Self::standing(from, fired);
        let mut strikers = [Striker { contact: 0, side: 0.0, restitution: 0.0 }; MAX_CONTACTS];
        let mut struck = 0;
        for id in fired.iter() {
            let (j, watch) = guard_of(id);
            match (self.contacts[j].spec.law, watch) {
                (Law::Rigid(_), Watch::Force) => self.release(&mut jump, j, at, x),
                (Law::Rigid(l), flank) => {
                    let side = if flank == Watch::DriveFlank { 1.0 } else { -1.0 };
                    let rebound = l.restitution * self.closing_speed(j, side, at, x);
                    // A rebound lost in rounding is none: the contact comes to rest.
                    let lost = rebound <= self.speed_rounding(j, at, x);
                    strikers[struck] =
                        Striker { contact: j, side, restitution: if lost { 0.0 } else { l.restitution } };
                    struck += 1;
                }
                _ => self.follow(&mut jump, (j, watch), from.pinned.contains(id), at, x)?,
            }
        }
        if struck > 0 {
            // Impulses change rates and multipliers; positions stay.
            jump.still = GuardSet::EMPTY;
            jump.pinned = GuardSet(jump.pinned.0 & !FORCES);
            self.rebound(&mut jump, &strikers[..struck], at, x)?;
        }
        Ok(jump)
    }

    fn next_switch(&self, at: Instant) -> Option<Instant> {
        self.contacts
            .iter()
            .filter_map(|c| match &c.spring {
                Spring::Scheduled(s) => s.next(&self.clock, at),
                _ => None,
            })
            .min_by(|a, b| {
                (a.cycle, a.phase.hi, a.phase.lo)
                    .partial_cmp(&(b.cycle, b.phase.hi, b.phase.lo))
                    .unwrap_or(std::cmp::Ordering::Equal)
            })
    }

    fn switched(&self, mode: Mode, at: Instant) -> Mode {
        self.contacts.iter().enumerate().fold(mode, |mode, (j, c)| match &c.spring {
            Spring::Scheduled(s) => with_piece(mode, j, s.piece(&self.clock, at).0),
            _ => mode,
        })
    }

    fn mode_in_words(&self, mode: Mode) -> String {
        let words = |(j, c): (usize, &Contact)| format!("{} {}", c.spec.name, contact_mode(mode, j).name());
        self.contacts.iter().enumerate().map(words).collect::<Vec<_>>().join(", ")
    }

    fn sizes(&self, mode: Mode, at: Instant, x: &[f64], sizes: &mut [f64]) -> Option<f64> {
        self.pressed_sizes(mode, at, x, sizes)
    }

    fn rates(&self, mode: Mode) -> Option<Rates> {
        Some(self.own_rates(mode))
    }

    fn restitution(&self, id: GuardId) -> Option<f64> {
        match (guard_of(id), &self.contacts.get(usize::from(id.0 / 3))?.spec.law) {
            ((_, Watch::DriveFlank | Watch::BackFlank), Law::Rigid(l)) => Some(l.restitution),
            _ => None,
        }
    }

    fn settle(&self, from: &Jump, fired: GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        let mut jump = Self::standing(from, fired);
        let mut strikers = [Striker { contact: 0, side: 0.0, restitution: 0.0 }; MAX_CONTACTS];
        let mut struck = 0;
        for id in fired.iter() {
            let (j, watch) = guard_of(id);
            let side = if watch == Watch::DriveFlank { 1.0 } else { -1.0 };
            strikers[struck] = Striker { contact: j, side, restitution: 0.0 };
            struck += 1;
        }
        self.come_to_rest(&mut jump, &strikers[..struck], at, x);
        Ok(jump)
    }
}

impl Structure {
    /// The end of a chatter: the remaining rates are taken out whatever their sign, and the contacts rest.
    fn come_to_rest(&self, jump: &mut Jump, strikers: &[Striker], at: Instant, x: &mut [f64]) {
        for s in strikers {
            let c = &self.contacts[s.contact];
            jump.projected = jump.projected.max(self.project(s.contact, s.side * c.gap(), at, x));
            self.stop(s.contact, at, x);
            let flank = guard_id(s.contact, if s.side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank });
            jump.pinned.insert(flank);
            jump.still.insert(flank);
            jump.mode = with_contact(jump.mode, s.contact, Self::resting(s.side));
        }
    }
}
