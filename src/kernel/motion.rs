//! Compiled mode: action of every contact, guards watched, and bounds on its rates. An arc reads this and no law.

use std::{
    cell::{OnceCell, RefCell},
    rc::Rc,
};

use super::{
    Layout,
    bound::{Forcing, Growth},
    clocked::Room,
    compiled::{Compiled, LARGEST},
    pressed::Pressed,
    propagator::Propagator,
};
use crate::{
    hybrid::{GuardId, JetField, Mode},
    system::{ActiveContact, ContactMode, Elasticity, Force, Sticking, Structure, Watch, contact_mode, guard_id},
};

/// Contact in a mode.
#[derive(Debug)]
pub(super) struct ContactInMode {
    pub state: ContactMode,
    /// Side of the flank of its law, ±1; 0 if the law acts on the deflection itself.
    pub side: f64,
    pub acting: Option<ActiveContact>,
}

impl ContactInMode {
    /// Returns whether the law acts on the deflection itself.
    pub fn is_bilateral(&self) -> bool {
        self.acting.is_some_and(|a| a.side == 0.0)
    }

    pub fn force(&self) -> Option<Force> {
        self.acting.map(|a| a.force)
    }

    /// Returns stiffness and damping of the linear law that carries force, if any.
    pub fn carried_linear(&self) -> Option<(Elasticity, f64)> {
        match self.acting? {
            ActiveContact { is_carried: true, force: Force::Linear { stiffness, damping }, .. } => {
                Some((stiffness, damping))
            }
            _ => None,
        }
    }

    /// Returns whether the force is that of a closed power law.
    pub fn is_pressed(&self) -> bool {
        matches!(self.acting, Some(ActiveContact { is_carried: true, force: Force::Power { .. }, .. }))
    }
}

/// Guard of a mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct ModeGuard {
    pub id: GuardId,
    pub contact: usize,
    pub watch: Watch,
    /// Sign that makes the guard positive inside the mode.
    pub sign: f64,
}

impl ModeGuard {
    /// Returns the sign of the deflection in a guard of position.
    pub fn along(&self) -> f64 {
        if self.watch == Watch::DriveFlank { -self.sign } else { self.sign }
    }
}

/// Smooth motion of a structure in one mode.
#[derive(Debug)]
pub(super) struct Motion<'s> {
    pub(super) structure: &'s Structure,
    pub(super) mode: Mode,
    pub(super) layout: Layout,
    /// Contacts, by number.
    pub(super) parts: Box<[ContactInMode]>,
    pub(super) guards: Box<[ModeGuard]>,
    /// Rigid contacts at rest.
    pub(super) held: Option<Sticking>,
    pub(super) forcing: Forcing,
    pub(super) growth: Growth,
    /// True if no power law is inside the zone of its flank, nothing rests, and the fast path covers the number of degrees of freedom.
    pub(super) is_linear: bool,
    /// True if some power law is closed.
    pub(super) is_pressed: bool,
    /// True if some stiffness is a series.
    pub(super) is_varying: bool,
    /// Contacts whose force is a guard.
    pub(super) watched_forces: Box<[usize]>,
    /// Data that the recurrences read.
    pub(super) compiled: Rc<Compiled>,
    /// Buffers for series of modes that are not linear.
    pub(super) room: RefCell<Room>,
    /// Formed at the first request.
    pub(super) propagator: OnceCell<Option<Rc<Propagator>>>,
    /// Formed at the first request.
    pub(super) pressed: OnceCell<Option<Pressed>>,
}

impl<'s> Motion<'s> {
    pub fn new(structure: &'s Structure, mode: &Mode) -> Self {
        let part = |j: usize| {
            let (state, acting) = (contact_mode(mode, j), structure.acting(mode, j));
            ContactInMode { state, side: acting.map_or(state.side(), |a| a.side), acting }
        };
        let parts: Box<[ContactInMode]> = (0..structure.contacts.len()).map(part).collect();
        let guards = (0..parts.len()).flat_map(|contact| {
            let watched = structure.watched(mode, contact).iter();
            watched.map(move |&(watch, sign)| ModeGuard { id: guard_id(contact, watch), contact, watch, sign })
        });
        let guards: Box<[_]> = guards.collect();
        let (held, forcing) = (Sticking::new(structure, mode), Forcing::new(structure));
        let is_affine = |p: &ContactInMode| matches!(p.force(), None | Some(Force::Linear { .. }));
        let is_linear = structure.n <= LARGEST && parts.iter().all(is_affine);
        let varies =
            |p: &ContactInMode| matches!(p.force(), Some(Force::Linear { stiffness, .. }) if stiffness.varies());
        Self {
            structure,
            mode: mode.clone(),
            layout: Layout::new(structure),
            watched_forces: guards.iter().filter(|g| g.watch == Watch::Force).map(|g| g.contact).collect(),
            guards,
            growth: Growth::new(structure, &forcing, &parts, held.as_ref()),
            forcing,
            is_linear,
            is_pressed: parts.iter().any(ContactInMode::is_pressed),
            is_varying: parts.iter().any(varies),
            compiled: Compiled::of(structure, &parts, is_linear),
            held,
            parts,
            room: RefCell::default(),
            propagator: OnceCell::new(),
            pressed: OnceCell::new(),
        }
    }
}

impl Motion<'_> {
    /// Iterates over the contacts that carry force.
    pub fn carrying(&self) -> impl Iterator<Item = ActiveContact> {
        self.parts.iter().filter_map(|part| part.acting).filter(|acting| acting.is_carried)
    }

    /// Returns whether some stiffness rises along a ramp.
    pub fn has_ramp(&self) -> bool {
        let is_ramp =
            |p: &ContactInMode| matches!(p.force(), Some(Force::Linear { stiffness: Elasticity::Ramp { .. }, .. }));
        self.parts.iter().any(is_ramp)
    }
}

impl Structure {
    /// Returns the compiled motion in `mode`.
    pub(crate) fn compile(&self, mode: &Mode) -> Box<dyn JetField + '_> {
        Box::new(Motion::new(self, mode))
    }
}
