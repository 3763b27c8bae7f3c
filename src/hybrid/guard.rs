/// Names one guard function of a hybrid system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GuardId(pub u16);

/// A scalar function of time and state, watched in one mode.
///
/// It is oriented: the interior of the mode is `g > 0`, and the guard fires where `g` falls through zero. What only
/// watches is an observer, not a guard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guard {
    /// Which function.
    pub id: GuardId,
}

/// A set of guards, as a bit mask over [`GuardId`] 0 to 127.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GuardSet(pub u128);

impl GuardSet {
    /// The empty set.
    pub const EMPTY: Self = Self(0);

    /// Adds a guard.
    ///
    /// # Panics
    /// If the id is 128 or more (debug builds).
    pub fn insert(&mut self, id: GuardId) {
        self.0 |= 1 << id.0;
    }

    /// Whether the guard is in the set.
    #[must_use]
    pub fn contains(self, id: GuardId) -> bool {
        self.0 >> id.0 & 1 == 1
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The members in rising order.
    pub fn iter(self) -> impl Iterator<Item = GuardId> {
        let mut rest = self.0;
        std::iter::from_fn(move || {
            let next = (rest != 0).then(|| GuardId(rest.trailing_zeros() as u16));
            rest &= rest.wrapping_sub(1);
            next
        })
    }
}
