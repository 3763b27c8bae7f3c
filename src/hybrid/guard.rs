use std::ops::{BitAnd, BitOr, BitOrAssign, Sub};

/// Names a guard of a hybrid system: a scalar function of time and state, watched in one mode.
///
/// The interior of the mode is `g > 0`, and the guard fires where `g` falls through zero. A quantity that is only watched belongs to an
/// observer, not to a guard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GuardId(pub u16);

/// Bits of a word of a [`GuardSet`].
const BITS: u16 = 128;

/// A set of guards.
///
/// `|`, `&` and `-` are union, intersection and difference. Guards below 128 need no allocation.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct GuardSet {
    /// Bit mask of guards 0 to 127.
    first: u128,
    /// Bit masks of the other guards; the last one is not zero.
    rest: Vec<u128>,
}

impl GuardSet {
    /// Returns the empty set.
    #[must_use]
    pub fn none() -> &'static Self {
        static NONE: GuardSet = GuardSet { first: 0, rest: Vec::new() };
        &NONE
    }

    /// Adds a guard.
    #[inline]
    pub fn insert(&mut self, id: GuardId) {
        let bit = 1 << (id.0 % BITS);
        match usize::from(id.0 / BITS) {
            0 => self.first |= bit,
            word => {
                self.rest.resize(self.rest.len().max(word), 0);
                self.rest[word - 1] |= bit;
            }
        }
    }

    /// Removes a guard.
    #[inline]
    pub fn remove(&mut self, id: GuardId) {
        if id.0 < BITS {
            self.first &= !(1 << id.0);
        } else {
            *self = &*self - &Self::from_iter([id]);
        }
    }

    /// Returns whether the guard is in the set.
    #[must_use]
    #[inline]
    pub fn contains(&self, id: GuardId) -> bool {
        self.word(usize::from(id.0 / BITS)) >> (id.0 % BITS) & 1 == 1
    }

    /// Returns whether the set is empty.
    #[must_use]
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.first == 0 && self.rest.is_empty()
    }

    /// Returns the number of guards in the set.
    #[must_use]
    pub fn len(&self) -> usize {
        (0..=self.rest.len()).map(|i| self.word(i).count_ones() as usize).sum()
    }

    /// Iterates over the members in rising order.
    pub fn iter(&self) -> impl Iterator<Item = GuardId> + Clone + '_ {
        let (mut at, mut word) = (0, self.first);
        std::iter::from_fn(move || {
            while word == 0 {
                word = *self.rest.get(at)?;
                at += 1;
            }
            let bit = word.trailing_zeros() as u16;
            word &= word - 1;
            Some(GuardId(BITS * at as u16 + bit))
        })
    }

    #[inline]
    fn word(&self, i: usize) -> u128 {
        if i == 0 { self.first } else { self.rest.get(i - 1).copied().unwrap_or(0) }
    }

    /// Combines each word of `self` with that of `other` by `join`.
    #[inline]
    fn zip(&self, other: &Self, join: impl Fn(u128, u128) -> u128) -> Self {
        let last = self.rest.len().max(other.rest.len());
        if last == 0 {
            return Self { first: join(self.first, other.first), rest: Vec::new() };
        }
        let mut rest: Vec<u128> = (1..=last).map(|i| join(self.word(i), other.word(i))).collect();
        rest.truncate(rest.iter().rposition(|word| *word != 0).map_or(0, |last| last + 1));
        Self { first: join(self.first, other.first), rest }
    }
}

impl Clone for GuardSet {
    #[inline]
    fn clone(&self) -> Self {
        // Most sets have no rest, and cloning an empty vector is a call.
        Self { first: self.first, rest: if self.rest.is_empty() { Vec::new() } else { self.rest.clone() } }
    }
}

impl FromIterator<GuardId> for GuardSet {
    fn from_iter<I: IntoIterator<Item = GuardId>>(guards: I) -> Self {
        let mut set = Self::default();
        guards.into_iter().for_each(|id| set.insert(id));
        set
    }
}

impl BitOr for &GuardSet {
    type Output = GuardSet;
    fn bitor(self, other: Self) -> GuardSet {
        self.zip(other, |a, b| a | b)
    }
}

impl BitAnd for &GuardSet {
    type Output = GuardSet;
    fn bitand(self, other: Self) -> GuardSet {
        self.zip(other, |a, b| a & b)
    }
}

impl Sub for &GuardSet {
    type Output = GuardSet;
    fn sub(self, other: Self) -> GuardSet {
        self.zip(other, |a, b| a & !b)
    }
}

impl BitOrAssign<&GuardSet> for GuardSet {
    fn bitor_assign(&mut self, other: &GuardSet) {
        *self = &*self | other;
    }
}
