use serde::{Deserialize, Serialize};

/// Count, extremes and mean of a list of durations, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// How many.
    pub count: u64,
    /// Shortest; absent if there are none.
    pub min: Option<f64>,
    /// Longest.
    pub max: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
}

/// What was measured on one contact, over the measured time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactReport {
    /// Name of the contact.
    pub name: String,
    /// Measured time, s.
    pub time: f64,
    /// Time between the flanks, s.
    pub apart_time: f64,
    /// `apart_time / time`.
    pub apart_fraction: f64,
    /// Time without force, s: between the flanks, or inside a flank's zone while the law would pull.
    pub no_force_time: f64,
    /// `no_force_time / time`.
    pub no_force_fraction: f64,
    /// Times the force ended (a rigid impact that rebounds ends at once).
    pub separations: u64,
    /// Times force began on the drive flank, rigid impacts included.
    pub drive_contacts: u64,
    /// Times force began on the back flank, rigid impacts included.
    pub back_contacts: u64,
    /// Times a rigid contact came to rest.
    pub sticks: u64,
    /// `separations` per forcing cycle, if there is one.
    pub separations_per_cycle: Option<f64>,
    /// `drive_contacts + back_contacts` per forcing cycle.
    pub contacts_per_cycle: Option<f64>,
    /// Durations without force of the separations that began and ended in the measured time.
    pub durations: Statistics,
    /// Largest deflection, m.
    pub deflection_max: Option<f64>,
    /// Smallest deflection, m.
    pub deflection_min: Option<f64>,
    /// Largest force along the contact's direction, N: positive on the drive flank; impacts have none.
    pub force_max: Option<f64>,
    /// Smallest force along the contact's direction, N: 0 if it was ever open, negative on the back flank.
    pub force_min: Option<f64>,
    /// Largest force by absolute value, N; impacts have none.
    pub force_abs_max: f64,
    /// Mean force along the contact's direction, N: the impulse, of impacts too, over the measured time.
    pub force_mean: f64,
    /// Energy lost in the contact, J.
    pub energy_lost: f64,
}
