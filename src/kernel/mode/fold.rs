//! Equal degrees of freedom that move as one.
//!
//! Equal bodies and contacts in equal states stay equal (`system/symmetry.rs`). The first one of each class is computed; the
//! others are its copies, equal to the last bit.

use crate::{
    hybrid::JetRequest,
    kernel::Motion,
    system::{Watch, guard_id},
};

/// First degree of freedom, and first contact, that equals each one.
#[derive(Clone, Debug, PartialEq)]
pub struct Fold {
    pub freedoms: Box<[usize]>,
    pub contacts: Box<[usize]>,
    /// True if some are equal.
    pub is_folded: bool,
}

impl Fold {
    /// Returns the fold of the mode; `None` if equal contacts are in different states or under different laws.
    pub fn new(motion: &Motion) -> Option<Self> {
        let (s, parts) = (motion.structure, &motion.parts);
        if s.symmetry.is_empty() {
            let each = |count: usize| (0..count).collect();
            return Some(Self { freedoms: each(s.n), contacts: each(s.contacts.len()), is_folded: false });
        }
        let law = |j: usize| parts[j].acting.map(|acting| (acting.side, acting.is_carried, acting.force));
        let agrees = s.symmetry.agree(|j| (parts[j].state, law(j)));
        let [freedoms, contacts] = s.symmetry.firsts(s.n, s.contacts.len());
        agrees.then_some(Self { freedoms, contacts, is_folded: true })
    }

    /// Returns whether equal bodies and contacts are in equal states at the start of a span.
    #[inline(always)]
    pub fn holds(&self, motion: &Motion, request: &JetRequest<'_>) -> bool {
        !self.is_folded || self.are_equal(motion, request)
    }

    fn are_equal(&self, motion: &Motion, request: &JetRequest<'_>) -> bool {
        let s = motion.structure;
        let zero = |j: usize, watch: Watch| request.pinned.contains(guard_id(j, watch));
        let zeros = |j: usize| [Watch::DriveFlank, Watch::BackFlank, Watch::Force].map(|watch| zero(j, watch));
        let (q, v) = request.x[..2 * s.n].split_at(s.n);
        s.symmetry.are_all_equal(q)
            && s.symmetry.are_all_equal(v)
            && s.symmetry.agree(|j| request.carried.get(j).map(|stretch| stretch.to_bits()))
            && (request.pinned.is_empty() || s.symmetry.agree(zeros))
    }
}
