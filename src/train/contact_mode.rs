//! How a [`Mode`] is packed: six bits for each contact, three for its state, three for its stiffness piece.

use crate::hybrid::{GuardId, Mode};

pub use crate::hybrid::{ContactMode, Watch};

use ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated};

fn from_bits(bits: u128) -> ContactMode {
    match bits {
        1 => Drive,
        2 => Back,
        3 => DriveDetached,
        4 => BackDetached,
        _ => Separated,
    }
}

const BITS: usize = 6;

/// The state of contact `j` in `mode`.
#[must_use]
pub fn contact_mode(mode: Mode, j: usize) -> ContactMode {
    from_bits(mode.0 >> (BITS * j) & 7)
}

/// `mode` with contact `j` in `state`.
#[must_use]
pub fn with_contact(mode: Mode, j: usize, state: ContactMode) -> Mode {
    Mode(mode.0 & !(7 << (BITS * j)) | (state as u128) << (BITS * j))
}

/// The stiffness piece of contact `j` in `mode`.
#[must_use]
pub fn piece(mode: Mode, j: usize) -> u32 {
    (mode.0 >> (BITS * j + 3) & 7) as u32
}

pub(super) fn with_piece(mode: Mode, j: usize, piece: u32) -> Mode {
    Mode(mode.0 & !(7 << (BITS * j + 3)) | u128::from(piece & 7) << (BITS * j + 3))
}

/// The guard of contact `j` that watches `watch`.
#[must_use]
pub fn guard_id(j: usize, watch: Watch) -> GuardId {
    GuardId(3 * j as u16 + watch as u16)
}

/// Which contact a guard belongs to, and what it watches.
#[must_use]
pub fn guard_of(id: GuardId) -> (usize, Watch) {
    let watch = match id.0 % 3 {
        0 => Watch::DriveFlank,
        1 => Watch::BackFlank,
        _ => Watch::Force,
    };
    (usize::from(id.0 / 3), watch)
}

/// What fires in a state, with the sign that makes the guard positive inside: `b − δ`, `δ + b` and the
/// compressive force are the positive directions of the three watches in the separated state.
pub(super) fn watches(state: ContactMode, releases_by_force: bool, rigid: bool, back: bool) -> &'static [(Watch, f64)] {
    match state {
        Separated if back => &[(Watch::DriveFlank, 1.0), (Watch::BackFlank, 1.0)],
        Separated => &[(Watch::DriveFlank, 1.0)],
        Drive | Back if rigid => &[(Watch::Force, 1.0)],
        Drive if releases_by_force => &[(Watch::DriveFlank, -1.0), (Watch::Force, 1.0)],
        Back if releases_by_force => &[(Watch::BackFlank, -1.0), (Watch::Force, 1.0)],
        Drive => &[(Watch::DriveFlank, -1.0)],
        Back => &[(Watch::BackFlank, -1.0)],
        DriveDetached => &[(Watch::DriveFlank, -1.0), (Watch::Force, -1.0)],
        BackDetached => &[(Watch::BackFlank, -1.0), (Watch::Force, -1.0)],
    }
}
