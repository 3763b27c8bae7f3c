//! Propagators that a thread has formed, by the numbers from which they are formed.

use std::{cell::RefCell, collections::HashMap, rc::Rc};

use smallvec::SmallVec;

use super::{
    Motion,
    fold::Fold,
    propagator::{MOST_INPUTS, Propagator, load_size},
};
use crate::{
    hybrid::LeapCounts,
    system::{Elasticity, Force, Spring, Watch, Wave},
};

/// Largest number of components of the state and contacts for which a product with all columns is cheaper than a recurrence: measured on
/// chains of 2 to 12 masses with one to n walls.
const MOST_OUTPUTS: usize = 17;
/// Number of degrees of freedom up to which a propagator is formed at once: runs of such small trains have few modes.
pub(super) const FEW_FREEDOMS: usize = 3;
/// Number of arcs in a mode after which a propagator of a larger train is formed, at the cost of some fifty arcs by series.
const WORTH_HERE: u64 = 32;

/// Number of arcs after which a run forms the propagator of a mode whose stiffness follows the forcing, at the cost of some hundred arcs
/// by series. Such rules count per run, not per thread: propagators formed by other runs change no bit of this one.
pub(super) const WORTH: u64 = 128;

impl Motion<'_> {
    /// Returns the propagator of the mode, for a run that has `made` these arcs.
    #[inline(always)]
    pub(super) fn propagator(&self, made: LeapCounts) -> Option<&Propagator> {
        if self.is_varying && made.arcs < WORTH || self.structure.n > FEW_FREEDOMS && made.here < WORTH_HERE {
            return None;
        }
        self.propagator.get_or_init(|| self.propagate()).as_deref()
    }

    /// Forms the propagator of the mode, if it pays: few outputs, linear laws, nothing at rest, and stiffnesses that are
    /// constant or, with one degree of freedom, harmonic.
    fn propagate(&self) -> Option<Rc<Propagator>> {
        let s = self.structure;
        let is_simple = self.is_linear && self.held.is_none() && !s.is_conservative;
        if !is_simple || s.oscillators.len() > MOST_INPUTS || self.is_varying && (s.n > 1 || self.has_ramp()) {
            return None;
        }
        let fold = Fold::new(self)?;
        if fold.outputs() > MOST_OUTPUTS {
            return None;
        }
        let numbers = self.numbers(&fold);
        if let Some(known) = FORMED.with_borrow(|formed| formed.get(&numbers).cloned()) {
            return Some(known);
        }
        let propagator = Rc::new(Propagator::new(self, fold)?);
        FORMED.with_borrow_mut(|formed| {
            if formed.len() >= MOST_FORMED {
                formed.clear();
            }
            formed.insert(numbers, Rc::clone(&propagator));
        });
        Some(propagator)
    }

    /// Returns the bits of all numbers from which a propagator is formed, in a fixed order. Places of flanks, restitution and the size of
    /// the load are not among them.
    fn numbers(&self, fold: &Fold) -> Box<[u64]> {
        let s = self.structure;
        let mut bits: Vec<u64> = Vec::with_capacity(64);
        let mut list = |values: &mut dyn Iterator<Item = f64>| {
            let first = bits.len();
            bits.push(0);
            bits.extend(values.map(f64::to_bits));
            bits[first] = (bits.len() - first) as u64;
        };
        let sparse =
            |row: &[(u32, f64)]| row.iter().flat_map(|(i, g)| [f64::from(*i), *g]).collect::<SmallVec<[f64; 8]>>();
        let waves =
            |w: &[Wave]| w.iter().flat_map(|w| [w.index as f64, w.cosine, w.sine]).collect::<SmallVec<[f64; 12]>>();
        list(&mut [self.growth.rate(), self.growth.frequency()].into_iter());
        let size = load_size(&s.load);
        list(&mut s.load.iter().map(|f| if size > 0.0 { f / size } else { 0.0 }));
        list(&mut s.weights.iter().copied());
        list(&mut s.oscillators.iter().map(|o| o.omega));
        s.rows.iter().for_each(|row| list(&mut row.iter().flat_map(|(j, k, c)| [f64::from(*j), *k, *c])));
        for w in &s.load_waves {
            list(&mut std::iter::once(w.index as f64).chain(w.cosine.iter().chain(&w.sine).copied()));
        }
        for (part, c) in self.parts.iter().zip(&s.contacts) {
            list(&mut sparse(&c.direction).into_iter());
            list(&mut sparse(&c.push).into_iter());
            list(&mut waves(&c.error).into_iter());
            list(&mut waves(&c.error_rate).into_iter());
            list(&mut [c.across, c.push_norm, c.stiffest].into_iter().chain(c.error_sizes));
            let law = part.acting.map(|a| match a.force {
                Force::Linear { stiffness: Elasticity::Constant(k), damping } => {
                    [1.0, f64::from(u8::from(a.is_carried)), k, damping]
                }
                Force::Linear { stiffness: _, damping } => [3.0, f64::from(u8::from(a.is_carried)), 0.0, damping],
                _ => [2.0, f64::from(u8::from(a.is_carried)), 0.0, 0.0],
            });
            list(&mut law.into_iter().flatten());
            if let (Some(_), Spring::Waves(mean, swings)) = (part.acting, &c.spring) {
                list(&mut std::iter::once(*mean).chain(waves(swings)).chain(s.load.iter().copied()));
                list(&mut s.oscillators.iter().map(|o| o.order.map_or(-1.0, f64::from)));
            }
        }
        for watched in &self.guards {
            list(&mut [watched.contact as f64, f64::from(u8::from(watched.watch == Watch::Force))].into_iter());
        }
        list(&mut fold.freedoms.iter().chain(&fold.contacts).map(|i| *i as f64));
        bits.into()
    }
}

/// Maximum number of propagators that a thread keeps, some ten kilobytes each.
const MOST_FORMED: usize = 4096;

thread_local! {
    /// Propagators formed on this thread, by their numbers: trains that differ in load or backlash alone share them, and forming one
    /// costs as much as some hundred spans.
    static FORMED: RefCell<HashMap<Box<[u64]>, Rc<Propagator>>> = RefCell::default();
}
