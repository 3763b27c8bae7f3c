use serde::{Deserialize, Serialize};

use super::sum::Sum;
use crate::system::Structure;

/// Count, extremes and mean of a list of durations, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Statistics {
    /// Number of durations.
    pub count: u64,
    /// Shortest duration, s; absent if there are none.
    pub min: Option<f64>,
    /// Longest duration, s.
    pub max: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
}

/// Impacts of one contact: contact begins out of the gap with an approach speed > 0. A contact that closes again inside the zone of its
/// flank, and the sum of an accumulation, do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Impacts {
    /// Impacts on the drive flank.
    pub drive: u64,
    /// Impacts on the back flank.
    pub back: u64,
    /// Impacts on both flanks per second.
    pub per_second: f64,
    /// Impacts on both flanks per forcing cycle, if there is one.
    pub per_cycle: Option<f64>,
    /// Largest approach speed, m/s; absent without impacts.
    pub speed_max: Option<f64>,
    /// Mean approach speed, m/s.
    pub speed_mean: Option<f64>,
    /// Root of the mean square of the approach speeds, m/s.
    pub speed_rms: Option<f64>,
    /// Speed that 50 % of the impacts do not exceed, m/s: the one in place ⌈n/2⌉ of n, in rising order.
    pub speed_50: Option<f64>,
    /// Speed that 95 % of the impacts do not exceed, m/s.
    pub speed_95: Option<f64>,
    /// Speed that 99 % of the impacts do not exceed, m/s.
    pub speed_99: Option<f64>,
}

impl Impacts {
    /// Returns statistics of approach speeds, those on the drive flank first, over a measured time, s.
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
        // Exact: there are fewer impacts than 2⁵³.
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

/// Measures of one contact over the measured time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ContactReport {
    /// Name of the contact.
    pub name: String,
    /// Measured time, s.
    pub time: f64,
    /// Time between the flanks, s.
    pub apart_time: f64,
    /// Share `apart_time / time`.
    pub apart_fraction: f64,
    /// Time without force, s: between the flanks, or inside a flank's zone while the law would pull.
    pub no_force_time: f64,
    /// Share `no_force_time / time`.
    pub no_force_fraction: f64,
    /// Number of ends of the force (a rigid impact that rebounds ends at once).
    pub separations: u64,
    /// Number of beginnings of force on the drive flank, including rigid impacts.
    pub drive_contacts: u64,
    /// Number of beginnings of force on the back flank, including rigid impacts.
    pub back_contacts: u64,
    /// Number of times that a rigid contact came to rest.
    pub sticks: u64,
    /// Ratio `separations` per forcing cycle, if there is one.
    pub separations_per_cycle: Option<f64>,
    /// Sum `drive_contacts + back_contacts` per forcing cycle.
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
    /// Mean force along the contact's direction, N: `impulse / time`.
    pub force_mean: f64,
    /// Impulse along the contact's direction, including impacts, N s: positive on the drive flank.
    pub impulse: f64,
    /// Standard deviation of the force, N, over the measured time; none for a rigid contact, whose impacts have no force.
    pub force_deviation: Option<f64>,
    /// Share of a planet in the load of its central gear: `N F̄/Σ F̄` of the mean forces of all N, 1 if equal; none for other contacts.
    pub load_share: Option<f64>,
    /// Rattle index `Γ = m_e max|ë|/|F̄|` of the error e(t), effective mass and mean force: above 1 a rigid mesh would lose contact.
    /// None without a varying error or a mean force.
    pub rattle_index: Option<f64>,
    /// Energy lost in the contact, J.
    pub energy_lost: f64,
    /// Loss rate `energy_lost / time`, W.
    pub energy_loss_rate: f64,
    /// Impacts.
    pub impacts: Impacts,
}

/// Returns the reports of all contacts of a train, in their order, with the measures that depend on the train.
#[must_use]
pub fn of_train(mut reports: Vec<ContactReport>, train: &Structure) -> Vec<ContactReport> {
    for group in &train.spec().shared {
        let total: f64 = group.iter().map(|j| reports[*j].force_mean).sum();
        for j in group {
            let share = group.len() as f64 * reports[*j].force_mean / total;
            reports[*j].load_share = Some(share).filter(|share| share.is_finite());
        }
    }
    for (report, contact) in reports.iter_mut().zip(train.contacts()) {
        let index = contact.effective_mass() * contact.spec.largest_acceleration() / report.force_mean.abs();
        report.rattle_index = Some(index).filter(|index| index.is_finite() && *index > 0.0);
    }
    reports
}

/// Force of a bearing on its support in one direction, N.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BearingForce {
    /// Direction: `x`, `y`, `axial`; of a planet `radial` and `tangential` to its carrier.
    pub direction: String,
    /// Mean.
    pub mean: f64,
    /// Standard deviation: RMS value of the difference from the mean.
    pub deviation: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

/// Measures of one bearing, over the measured time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BearingReport {
    /// Name of the supported body.
    pub name: String,
    /// Absolute value of the mean force vector, N.
    pub force_mean: f64,
    /// RMS value of the distance from the mean vector, N.
    pub force_deviation: f64,
    /// Largest absolute value of the force vector, N.
    pub force_max: f64,
    /// Forces by direction.
    pub directions: Vec<BearingForce>,
}
