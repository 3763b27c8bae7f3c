use serde::{Deserialize, Serialize};

use super::{GuardId, Instant, Mode, Transition};

/// The state of one contact.
///
/// The order is part of how a train packs its [`Mode`]: `Separated` is zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
    /// Returns whether the contact carries force.
    #[must_use]
    pub fn is_closed(self) -> bool {
        matches!(self, Drive | Back)
    }

    /// Returns +1 on the side of the drive flank, −1 on that of the back flank, 0 between.
    #[must_use]
    pub fn side(self) -> f64 {
        match self {
            Drive | DriveDetached => 1.0,
            Back | BackDetached => -1.0,
            Separated => 0.0,
        }
    }

    /// Returns the state with the flanks exchanged.
    #[must_use]
    pub fn turned(self) -> Self {
        match self {
            Separated => Separated,
            Drive => Back,
            Back => Drive,
            DriveDetached => BackDetached,
            BackDetached => DriveDetached,
        }
    }

    /// Returns the state of a compliant contact after the guard of `watch` has fallen; `None` if it has no such guard.
    #[must_use]
    pub fn after(self, watch: Watch) -> Option<Self> {
        match (self, watch) {
            (Separated, Watch::DriveFlank) | (DriveDetached, Watch::Force) => Some(Drive),
            (Separated, Watch::BackFlank) | (BackDetached, Watch::Force) => Some(Back),
            (Drive | DriveDetached, Watch::DriveFlank) | (Back | BackDetached, Watch::BackFlank) => Some(Separated),
            (Drive, Watch::Force) => Some(DriveDetached),
            (Back, Watch::Force) => Some(BackDetached),
            _ => None,
        }
    }

    /// Returns the word used in logs.
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
}

/// Quantity that a guard of a contact watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Watch {
    /// The drive flank, `δ = b`.
    DriveFlank,
    /// The back flank, `δ = −b`.
    BackFlank,
    /// The force (of a rigid contact: the multiplier; of a power law: its factor `1 + χ ṗ`).
    Force,
}

impl Watch {
    /// Returns +1 for the drive flank, −1 for the back flank, 0 for the force.
    #[must_use]
    pub fn side(self) -> f64 {
        match self {
            Self::DriveFlank => 1.0,
            Self::BackFlank => -1.0,
            Self::Force => 0.0,
        }
    }
}

/// A system seen through its contacts, for logs and measures.
///
/// Deflections `δ` are compression positive, forces `F` act along the contact's direction: positive on the drive
/// flank, negative on the back flank.
pub trait ContactView {
    /// Returns the number of contacts.
    fn contact_count(&self) -> usize;
    /// Returns the name of contact `j`.
    fn contact_name(&self, j: usize) -> &str;
    /// Returns the state of contact `j` in `mode`.
    fn contact_mode(&self, j: usize, mode: &Mode) -> ContactMode;
    /// Returns the contact of a guard and the quantity that the guard watches.
    fn watch(&self, id: GuardId) -> (usize, Watch);
    /// Returns whether contact `j` is rigid: it cannot be penetrated, only struck or at rest.
    fn is_rigid(&self, j: usize) -> bool;
    /// Returns half the backlash b of contact `j`, m.
    fn half_backlash(&self, j: usize) -> f64;
    /// Returns the share of the approach `speed`, m/s, that the law of contact `j` returns in a free impact, `[0, 1]`, if known.
    fn free_restitution(&self, j: usize, speed: f64) -> Option<f64>;
    /// Returns δ, m, and its rate, m/s, of contact `j`; the error is that of the back flank if `side` is −1, else of the drive flank.
    fn deflection(&self, j: usize, side: f64, at: Instant, x: &[f64]) -> (f64, f64);
    /// Returns `gᵀq = δ + e` of contact `j`, m: the dynamic transmission error of a mesh.
    fn transmission(&self, j: usize, x: &[f64]) -> f64;
    /// Returns the force F of contact `j`, N; zero if it carries none.
    fn force(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64;
    /// Returns the energy stored in the spring of contact `j`, J.
    fn stored(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64;
    /// Returns the power lost in contact `j`, W.
    fn dissipation(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64;
    /// Writes the impulses `P_j` that a jump applied along each direction, N s, into `out` `[contact_count]`.
    fn impulses(&self, transition: &Transition<'_>, out: &mut [f64]);
}
