//! Packing of a [`Mode`]: one number for each contact, three bits for its state and thirteen for its stiffness piece.

use crate::hybrid::{GuardId, Mode};

pub use crate::hybrid::{ContactMode, Watch};

use ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated};

/// Number of bits of the state of a contact.
const STATE: u32 = 3;
/// Mask of these bits.
const MASK: u16 = (1 << STATE) - 1;
/// Maximum number of pieces of a periodic stiffness in a mode.
pub(crate) const MAX_PIECES: usize = 1 << (u16::BITS - STATE);

/// Returns the state of contact `j` in `mode`.
#[must_use]
pub fn contact_mode(mode: &Mode, j: usize) -> ContactMode {
    match mode.get(j) & MASK {
        1 => Drive,
        2 => Back,
        3 => DriveDetached,
        4 => BackDetached,
        _ => Separated,
    }
}

/// Sets contact `j` to `state`.
pub fn set_contact(mode: &mut Mode, j: usize, state: ContactMode) {
    mode.set(j, mode.get(j) & !MASK | state as u16);
}

/// Returns the stiffness piece of contact `j` in `mode`.
#[must_use]
pub fn piece(mode: &Mode, j: usize) -> u32 {
    u32::from(mode.get(j) >> STATE)
}

pub(crate) fn set_piece(mode: &mut Mode, j: usize, piece: u32) {
    mode.set(j, mode.get(j) & MASK | (piece as u16) << STATE);
}

/// Returns the guard of contact `j` for `watch`.
#[must_use]
pub fn guard_id(j: usize, watch: Watch) -> GuardId {
    GuardId(3 * j as u16 + watch as u16)
}

/// Returns the guards of contact `j`.
pub(crate) fn guards_of(j: usize) -> [GuardId; 3] {
    [Watch::DriveFlank, Watch::BackFlank, Watch::Force].map(|watch| guard_id(j, watch))
}

/// Returns the contact of a guard, and the quantity that the guard watches.
#[must_use]
pub fn guard_of(id: GuardId) -> (usize, Watch) {
    let watch = match id.0 % 3 {
        0 => Watch::DriveFlank,
        1 => Watch::BackFlank,
        _ => Watch::Force,
    };
    (usize::from(id.0 / 3), watch)
}
