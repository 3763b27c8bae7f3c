//! Compiled mode: action of every contact, guards watched, and bounds on its rates. An arc reads this and no law.

use std::rc::Rc;

use super::{
    compiled::{Compiled, LARGEST},
    growth::{Forcing, Growth},
};
use crate::{
    hybrid::{GuardId, Mode},
    kernel::{Four, LANES},
    system::{
        ActiveContact, Contact, ContactMode, Elasticity, Force, Sticking, Structure, Watch, contact_mode, guard_id,
    },
};

/// Ratio of a stretch to the terms of its difference below which it loses four bits or more when it is formed.
const SMALL_STRETCH: f64 = 1.0 / 16.0;

/// Contact in a mode.
#[derive(Debug)]
pub struct ContactInMode {
    pub state: ContactMode,
    /// Side of the flank of its law, ±1; 0 if the law acts on the deflection itself.
    pub side: f64,
    /// Deflection σ b at which its law begins, m.
    pub flank: f64,
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

    /// Returns a `stretch` that is kept for the next arc, if it is a small difference of terms of the given `size`; else NaN. A stretch that
    /// is not small cannot drift apart from the state, which is as accurate.
    pub fn kept(&self, stretch: f64, size: f64) -> f64 {
        if !self.is_bilateral() && stretch.abs() < SMALL_STRETCH * size { stretch } else { f64::NAN }
    }

    /// Returns whether the force is that of a closed power law.
    pub fn is_pressed(&self) -> bool {
        matches!(self.acting, Some(ActiveContact { is_carried: true, force: Force::Power { .. }, .. }))
    }
}

/// Guard of a mode.
#[derive(Clone, Copy, Debug)]
pub struct ModeGuard {
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

/// Flanks of four contacts, and the guards that watch them.
#[derive(Clone, Copy, Debug)]
pub struct FlankGuards {
    /// Signs of the deflection in the guards of the drive and of the back flank; 0 without such a guard.
    pub along: [Four; 2],
    /// Value of the guards of an open contact at zero deflection, m; 0 for a contact with a side.
    pub gap: Four,
    /// Distance from the value by the state below which a known gap belongs to a flank, m.
    pub near: Four,
    /// 1 for a contact with a side, else 0.
    pub has_side: Four,
    /// Deflections at which the laws begin, m.
    pub flank: Four,
    /// Largest ratio of a stretch to its terms at which it is kept: see [`ContactInMode::kept`].
    pub kept: Four,
    /// `Contact::across`.
    pub across: Four,
    /// Errors of highest order, [`Amplitude::top`](crate::kernel::mode::growth::Amplitude::top).
    pub top: Four,
}

impl FlankGuards {
    fn new(s: &Structure, parts: &[ContactInMode], guards: &[ModeGuard], forcing: &Forcing, first: usize) -> Self {
        let four = |of: &dyn Fn(usize) -> f64| -> Four {
            std::array::from_fn(|l| if first + l < parts.len() { of(first + l) } else { 0.0 })
        };
        let along = |watch: Watch| {
            four(&|j| {
                guards.iter().find(|guard| guard.contact == j && guard.watch == watch).map_or(0.0, ModeGuard::along)
            })
        };
        let near = |c: &Contact| if c.has_back() { c.gap() } else { f64::INFINITY };
        Self {
            along: [along(Watch::DriveFlank), along(Watch::BackFlank)],
            gap: four(&|j| if parts[j].side == 0.0 { s.contacts[j].gap() } else { 0.0 }),
            near: four(&|j| if parts[j].side == 0.0 { near(&s.contacts[j]) } else { 0.0 }),
            has_side: four(&|j| if parts[j].side == 0.0 { 0.0 } else { 1.0 }),
            flank: four(&|j| parts[j].flank),
            kept: four(&|j| if parts[j].is_bilateral() { 0.0 } else { SMALL_STRETCH }),
            across: four(&|j| s.contacts[j].across),
            top: four(&|j| forcing.errors[j][0].top),
        }
    }
}

/// Smooth motion of a structure in one mode.
#[derive(Debug)]
pub struct Motion<'s> {
    pub structure: &'s Structure,
    pub mode: Mode,
    /// Contacts, by number.
    pub parts: Box<[ContactInMode]>,
    pub guards: Box<[ModeGuard]>,
    /// Guards of position, by fours of contacts.
    pub flanks: Box<[FlankGuards]>,
    /// Rigid contacts at rest.
    pub held: Option<Sticking>,
    pub forcing: Forcing,
    pub growth: Growth,
    /// True if no power law is inside the zone of its flank, nothing rests, and the fast path covers the number of degrees of freedom.
    pub is_linear: bool,
    /// True if some power law is closed.
    pub is_pressed: bool,
    /// True if some stiffness is a series.
    pub is_varying: bool,
    /// Contacts whose force is a guard.
    pub watched_forces: Box<[usize]>,
    /// Data that the recurrences read.
    pub compiled: Rc<Compiled>,
}

impl<'s> Motion<'s> {
    pub fn new(structure: &'s Structure, mode: &Mode) -> Self {
        let part = |j: usize| {
            let (state, acting) = (contact_mode(mode, j), structure.acting(mode, j));
            let side = acting.map_or(state.side(), |a| a.side);
            ContactInMode { state, side, flank: side * structure.contacts[j].offset(), acting }
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
            watched_forces: guards.iter().filter(|g| g.watch == Watch::Force).map(|g| g.contact).collect(),
            flanks: (0..parts.len())
                .step_by(LANES)
                .map(|first| FlankGuards::new(structure, &parts, &guards, &forcing, first))
                .collect(),
            guards,
            growth: Growth::new(structure, &forcing, &parts, held.as_ref()),
            forcing,
            is_linear,
            is_pressed: parts.iter().any(ContactInMode::is_pressed),
            is_varying: parts.iter().any(varies),
            compiled: Compiled::of(structure, &parts, is_linear),
            held,
            parts,
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
