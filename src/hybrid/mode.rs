use std::{cmp::Ordering, fmt};

/// Number of elements of a [`Mode`] that need no allocation.
const FIRST: usize = 16;

/// The discrete state of a hybrid system: a number for each of its elements, with a meaning known only to the system.
///
/// Modes are equal if all numbers are; numbers that were never set are zero. Sixteen elements below 256 need no allocation.
#[derive(Debug, Default, PartialEq, Eq, Hash)]
pub struct Mode {
    first: [u8; FIRST],
    /// The numbers of the other elements; the last one is not zero.
    rest: Vec<u8>,
    /// High bytes of the numbers of all elements; the last one is not zero.
    high: Vec<u8>,
}

impl Mode {
    /// Returns the number of element `i`.
    #[must_use]
    #[inline]
    pub fn get(&self, i: usize) -> u16 {
        let low = if i < FIRST { self.first[i] } else { self.rest.get(i - FIRST).copied().unwrap_or(0) };
        u16::from_le_bytes([low, self.high.get(i).copied().unwrap_or(0)])
    }

    /// Sets the number of element `i`.
    #[inline]
    pub fn set(&mut self, i: usize, number: u16) {
        let [low, high] = number.to_le_bytes();
        if high != 0 || !self.high.is_empty() {
            put(&mut self.high, i, high);
        }
        if i < FIRST {
            self.first[i] = low;
        } else {
            put(&mut self.rest, i - FIRST, low);
        }
    }

    /// Returns the mode with `number` for element `i`.
    #[must_use]
    pub fn with(mut self, i: usize, number: u16) -> Self {
        self.set(i, number);
        self
    }
}

/// Stores a byte in a vector whose last byte is never zero.
fn put(bytes: &mut Vec<u8>, i: usize, byte: u8) {
    bytes.resize(bytes.len().max(i + 1), 0);
    bytes[i] = byte;
    bytes.truncate(bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1));
}

impl Clone for Mode {
    #[inline]
    fn clone(&self) -> Self {
        // Most modes have no other bytes, and cloning an empty vector is a call.
        let clone = |bytes: &Vec<u8>| if bytes.is_empty() { Vec::new() } else { bytes.clone() };
        Self { first: self.first, rest: clone(&self.rest), high: clone(&self.high) }
    }
}

/// Writes the low bytes of the elements, last one first, two hexadecimal digits each. High bytes, if any, come before them with a dash.
impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.high.is_empty() {
            self.high.iter().rev().try_for_each(|number| write!(f, "{number:02x}"))?;
            f.write_str("-")?;
        }
        let first = u128::from_le_bytes(self.first);
        if self.rest.is_empty() {
            return write!(f, "{first:#x}");
        }
        f.write_str("0x")?;
        self.rest.iter().rev().try_for_each(|number| write!(f, "{number:02x}"))?;
        write!(f, "{first:032x}")
    }
}

/// Total order without a meaning.
impl Ord for Mode {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_first = || u128::from_le_bytes(self.first).cmp(&u128::from_le_bytes(other.first));
        // Most modes have no other bytes.
        if [self, other].iter().all(|mode| mode.rest.is_empty() && mode.high.is_empty()) {
            return by_first();
        }
        let order = |a: &[u8], b: &[u8]| a.len().cmp(&b.len()).then_with(|| a.iter().rev().cmp(b.iter().rev()));
        order(&self.high, &other.high).then_with(|| order(&self.rest, &other.rest)).then_with(by_first)
    }
}

impl PartialOrd for Mode {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
