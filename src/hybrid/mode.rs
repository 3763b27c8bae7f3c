use std::{cmp::Ordering, fmt};

/// Elements of a [`Mode`] that need no allocation.
const FIRST: usize = 16;

/// The discrete state of a hybrid system: a number for each of its elements, which only the system itself reads.
///
/// Modes are equal if all numbers are; numbers that were never set are zero. Sixteen elements need no allocation.
#[derive(Debug, Default, PartialEq, Eq, Hash)]
pub struct Mode {
    first: [u8; FIRST],
    /// The numbers of the other elements; the last one is not zero.
    rest: Vec<u8>,
}

impl Mode {
    /// The number of element `i`.
    #[must_use]
    #[inline]
    pub fn get(&self, i: usize) -> u8 {
        if i < FIRST { self.first[i] } else { self.rest.get(i - FIRST).copied().unwrap_or(0) }
    }

    /// Sets the number of element `i`.
    #[inline]
    pub fn set(&mut self, i: usize, number: u8) {
        if i < FIRST {
            self.first[i] = number;
            return;
        }
        self.rest.resize(self.rest.len().max(i - FIRST + 1), 0);
        self.rest[i - FIRST] = number;
        self.rest.truncate(self.rest.iter().rposition(|number| *number != 0).map_or(0, |last| last + 1));
    }

    /// The mode with `number` for element `i`.
    #[must_use]
    pub fn with(mut self, i: usize, number: u8) -> Self {
        self.set(i, number);
        self
    }
}

impl Clone for Mode {
    #[inline]
    fn clone(&self) -> Self {
        // Most modes have no rest, and cloning an empty vector is a call.
        Self { first: self.first, rest: if self.rest.is_empty() { Vec::new() } else { self.rest.clone() } }
    }
}

/// The numbers of the elements, the last one first, two hexadecimal digits each.
impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let first = u128::from_le_bytes(self.first);
        if self.rest.is_empty() {
            return write!(f, "{first:#x}");
        }
        f.write_str("0x")?;
        self.rest.iter().rev().try_for_each(|number| write!(f, "{number:02x}"))?;
        write!(f, "{first:032x}")
    }
}

/// By the last element that differs.
impl Ord for Mode {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_length = self.rest.len().cmp(&other.rest.len());
        let first = |mode: &Self| u128::from_le_bytes(mode.first);
        let by_rest = by_length.then_with(|| self.rest.iter().rev().cmp(other.rest.iter().rev()));
        by_rest.then_with(|| first(self).cmp(&first(other)))
    }
}

impl PartialOrd for Mode {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
