//! How a [`Mode`] is packed: six bits for each contact, three for its state, three for its stiffness piece.

use crate::hybrid::{GuardId, Mode};

/// The state of one contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ContactMode {
    /// Between the flanks: no force.
    Separated,
    /// In contact on the drive flank; resting on it, for a rigid law.
    Drive,
    /// In contact on the back flank; resting on it, for a rigid law.
    Back,
    /// Inside the drive flank's zone while the law would pull: no force.
    DriveDetached,
    /// Inside the back flank's zone while the law would pull: no force.
    BackDetached,
}

use ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated};

impl ContactMode {
    /// Whether the contact carries force.
    #[must_use]
    pub fn is_closed(self) -> bool {
        matches!(self, Drive | Back)
    }

    /// +1 on the drive flank's side, −1 on the back flank's, 0 between.
    #[must_use]
    pub fn side(self) -> f64 {
        match self {
            Drive | DriveDetached => 1.0,
            Back | BackDetached => -1.0,
            Separated => 0.0,
        }
    }

    /// The word used in logs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Separated => "separated",
            Drive => "drive",
            Back => "back",
            DriveDetached => "drive-detached",
            BackDetached => "back-detached",
        }
    }

    fn from_bits(bits: u128) -> Self {
        match bits {
            1 => Drive,
            2 => Back,
            3 => DriveDetached,
            4 => BackDetached,
            _ => Separated,
        }
    }
}

const BITS: usize = 6;

/// The state of contact `j` in `mode`.
#[must_use]
pub fn contact_mode(mode: Mode, j: usize) -> ContactMode {
    ContactMode::from_bits(mode.0 >> (BITS * j) & 7)
}

pub(super) fn with_contact(mode: Mode, j: usize, state: ContactMode) -> Mode {
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

/// What a guard of a contact watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watch {
    /// The drive flank, `δ = b`.
    DriveFlank,
    /// The back flank, `δ = −b`.
    BackFlank,
    /// The force (of a rigid contact: the multiplier; of a power law: its factor `1 + χ ṗ`).
    Force,
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
