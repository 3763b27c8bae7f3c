use serde::{Deserialize, Serialize};

use super::sum::Sum;

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

/// Impacts of one contact: contact begins out of the gap with an approach speed > 0. A contact that closes again inside the zone of its flank,
/// and the sum of an accumulation, are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Impacts {
    /// Impacts on the drive flank.
    pub drive: u64,
    /// Impacts on the back flank.
    pub back: u64,
    /// Both, in a second.
    pub per_second: f64,
    /// Both, in a forcing cycle, if there is one.
    pub per_cycle: Option<f64>,
    /// Largest approach speed, m/s; absent if there are no impacts.
    pub speed_max: Option<f64>,
    /// Mean approach speed, m/s.
    pub speed_mean: Option<f64>,
    /// Root of the mean square of the approach speeds, m/s.
    pub speed_rms: Option<f64>,
    /// Speed that 50 % of the impacts do not exceed, m/s: the one in place ⌈n/2⌉ of n, in rising order.
    pub speed_50: Option<f64>,
    /// The same of 95 %.
    pub speed_95: Option<f64>,
    /// The same of 99 %.
    pub speed_99: Option<f64>,
}

impl Impacts {
    /// Statistics of approach speeds, those on the drive flank first, over a measured time, s.
    pub(super) fn new(speeds: &[Vec<f64>; 2], time: f64, cycles: Option<f64>) -> Self {
        let mut sorted = speeds.concat();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len() as f64;
        let mean = |power: i32| {
            let mut sum = Sum::default();
            sorted.iter().for_each(|speed| sum.add(speed.powi(power)));
            sum.value() / n
        };
        let any = |value: f64| Some(value).filter(|_| n > 0.0);
        // OK to convert: there are fewer impacts than 2⁵³.
        let quantile = |percent: f64| sorted.get(((percent * n / 100.0).ceil() as usize).saturating_sub(1)).copied();
        Self {
            drive: speeds[0].len() as u64,
            back: speeds[1].len() as u64,
            per_second: if time > 0.0 { n / time } else { 0.0 },
            per_cycle: cycles.map(|cycles| n / cycles),
            speed_max: sorted.last().copied(),
            speed_mean: any(mean(1)),
            speed_rms: any(mean(2).sqrt()),
            speed_50: quantile(50.0),
            speed_95: quantile(95.0),
            speed_99: quantile(99.0),
        }
    }
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
    /// Standard deviation of the force, N, over the measured time; none of a rigid contact, whose impacts have no force.
    pub force_deviation: Option<f64>,
    /// Energy lost in the contact, J.
    pub energy_lost: f64,
    /// `energy_lost / time`, W.
    pub energy_loss_rate: f64,
    /// Impacts.
    pub impacts: Impacts,
}
