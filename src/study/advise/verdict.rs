//! Changes of a simpler model, and the verdict on whether it is sufficient.

use serde::Serialize;

use super::measure::{Estimate, Motion};
use crate::output::label;

/// Change of one family of contacts from the scene to a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FamilyChange {
    /// The family.
    pub family: String,
    /// Change of the time without force, forcing periods.
    pub apart: Estimate,
    /// Relative change of that time; none if the scene's is 0.
    pub apart_relative: Option<f64>,
    /// Relative change of the mean duration of a separation, if both have some.
    pub separation_relative: Option<f64>,
    /// Change of the peak force, N.
    pub peak_n: Option<f64>,
    /// Relative change of the peak force; none for rigid contacts and for contacts without force.
    pub peak: Option<Estimate>,
    /// Change of the mean force, N.
    pub mean_force: f64,
}

/// Verdict on whether a model is sufficient.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Time apart and peak force of every family change by no more than the tolerance, and the kind of motion is the same: of one period,
    /// or irregular.
    Enough,
    /// A measure changes by more.
    NotEnough,
    /// A change is too near the tolerance: within twice its standard error for irregular motions, within ten times its scatter for
    /// transients.
    Unclear,
}

impl Verdict {
    /// Returns `enough`, `not enough` or `unclear`.
    pub(super) fn words(self) -> String {
        label(self).replace('-', " ")
    }
}

/// Returns the value largest in size, with its sign; 0 for no value.
pub(super) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |a, b| if b.abs() > a.abs() { b } else { a })
}

/// Returns the changes from `full` to `motion`, family by family of `full`.
pub fn changes(full: &Motion, motion: &Motion) -> Vec<FamilyChange> {
    let between =
        |a: Estimate, b: Estimate| Estimate { value: b.value - a.value, error: libm::hypot(a.error, b.error) };
    let relative = |a: f64, b: f64| (a > 0.0).then(|| (b - a) / a);
    let change = |mesh: &super::measure::Mesh| {
        let now = motion.mesh(&mesh.family)?;
        let peaks = mesh.peak.zip(now.peak);
        let scaled = |e: Estimate, by: f64| Estimate { value: e.value / by, error: e.error / by };
        Some(FamilyChange {
            family: mesh.family.clone(),
            apart: between(mesh.apart, now.apart),
            apart_relative: relative(mesh.apart.value, now.apart.value),
            separation_relative: mesh.separation_s.zip(now.separation_s).and_then(|(a, b)| relative(a, b)),
            peak_n: peaks.map(|(a, b)| b.value - a.value),
            peak: peaks.filter(|(a, _)| a.value > 0.0).map(|(a, b)| scaled(between(a, b), a.value)),
            mean_force: now.mean_force.value - mesh.mean_force.value,
        })
    };
    full.meshes.iter().filter_map(change).collect()
}

/// Least distance of a change from the tolerance, in scatters, for a transient. A slow drift does not average out, and its end is unknown;
/// it moves by about three scatters in the measured stretches.
const DRIFT: f64 = 10.0;

/// Judges `changes` from `full` to `motion`.
pub fn judge(full: &Motion, motion: &Motion, changes: &[FamilyChange], tolerance: f64) -> Verdict {
    let sizes = || changes.iter().flat_map(|change| [Some(change.apart), change.peak]).flatten();
    let periods = [full.settled.period, motion.settled.period];
    let other_kind = match periods {
        [Some(a), Some(b)] => a != b,
        [None, None] => false,
        [Some(_), None] => motion.irregular(),
        [None, Some(_)] => full.irregular(),
    };
    let transient = full.settling() || motion.settling();
    let margin = |change: Estimate| if transient { DRIFT * change.scatter() } else { 2.0 * change.error };
    if other_kind || sizes().any(|change| change.value.abs() - margin(change) > tolerance) {
        Verdict::NotEnough
    } else if sizes().all(|change| change.value.abs() + margin(change) <= tolerance) {
        Verdict::Enough
    } else {
        Verdict::Unclear
    }
}
