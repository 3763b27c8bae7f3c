//! Propagators that a thread has formed, by their modes.

use std::{cell::RefCell, collections::HashMap, rc::Rc};

use super::{
    Ways,
    propagator::{MOST_INPUTS, Propagator},
};
use crate::{
    hybrid::LeapCounts,
    kernel::{
        Motion,
        mode::{fold::Fold, linear_mode::LinearMode},
    },
    system::Structure,
};

/// Largest number of components of the state and contacts for which a product with all columns is cheaper than a recurrence: measured on
/// chains of 2 to 12 masses with one to n walls.
const MOST_OUTPUTS: usize = 17;
/// Number of degrees of freedom up to which a propagator is formed at once: runs of such small trains have few modes.
pub const FEW_FREEDOMS: usize = 3;
/// Number of arcs in a mode after which a propagator of a larger train is formed, at the cost of some hundred arcs by series.
const WORTH_HERE: u64 = 64;

/// Number of arcs after which a run forms the propagator of a mode whose stiffness follows the forcing, at the cost of some hundred arcs
/// by series. Such rules count per run, not per thread: propagators formed by other runs change no bit of this one.
const WORTH: u64 = 128;

/// Returns whether some mode of the train may have a propagator: one with few outputs, equal ones counted once.
pub fn propagates(s: &Structure) -> bool {
    let [freedoms, contacts] = s.symmetry.firsts(s.n, s.contacts.len());
    let firsts = |of: &[usize]| of.iter().enumerate().filter(|(i, first)| *i == **first).count();
    2 * firsts(&freedoms) + firsts(&contacts) <= MOST_OUTPUTS
}

impl Ways<'_> {
    /// Returns the propagator of the mode, for a run that has `made` these arcs.
    #[inline(always)]
    pub fn propagator(&self, made: LeapCounts) -> Option<&Propagator> {
        let motion = &self.motion;
        if motion.is_varying && made.arcs < WORTH || motion.structure.n > FEW_FREEDOMS && made.here < WORTH_HERE {
            return None;
        }
        self.propagator.get_or_init(|| motion.propagate()).as_deref()
    }
}

impl Motion<'_> {
    /// Forms the propagator of the mode, if it pays: few outputs, linear laws, nothing at rest, and stiffnesses that are
    /// constant or, with one degree of freedom, harmonic.
    fn propagate(&self) -> Option<Rc<Propagator>> {
        let s = self.structure;
        let is_simple = self.is_linear && self.held.is_none() && !s.is_conservative;
        if !is_simple || s.oscillators.len() > MOST_INPUTS || self.is_varying && (s.n > 1 || self.has_ramp()) {
            return None;
        }
        if !propagates(s) {
            return None;
        }
        let fold = Fold::new(self)?;
        let mode = LinearMode::new(self, fold);
        FORMED.with_borrow_mut(|formed| formed.of(mode))
    }
}

/// Maximum number of propagators that a thread keeps, some ten kilobytes each.
const MOST_FORMED: usize = 4096;

/// Propagators by their modes, in groups of equal hashes.
#[derive(Default)]
struct FormedPropagators {
    groups: HashMap<u64, Vec<(LinearMode, Rc<Propagator>)>>,
    count: usize,
}

thread_local! {
    /// Propagators formed on this thread: trains that differ in the size of one load or in backlash alone share them, and forming one costs
    /// as much as some hundred spans.
    static FORMED: RefCell<FormedPropagators> = RefCell::default();
}

impl FormedPropagators {
    /// Returns the propagator of a mode, formed now if it is not known; `None` if the mode has none.
    fn of(&mut self, mode: LinearMode) -> Option<Rc<Propagator>> {
        let key = mode.hash();
        if let Some((_, known)) = self.groups.get(&key).and_then(|group| group.iter().find(|(of, _)| *of == mode)) {
            return Some(Rc::clone(known));
        }
        let propagator = Rc::new(Propagator::new(&mode)?);
        if self.count >= MOST_FORMED {
            *self = Self::default();
        }
        self.count += 1;
        self.groups.entry(key).or_default().push((mode, Rc::clone(&propagator)));
        Some(propagator)
    }
}
