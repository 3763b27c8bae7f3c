//! Largest value of a number at which a mesh still loses contact: a root in the parameter, not a point of a grid.

use serde::Serialize;
use serde_json::json;

use super::{StudyError, figures::Context};
use crate::scene::Scene;

/// Criterion for the loss of contact of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LossCriterion {
    /// The mesh leaves its flank: [`apart_time`](crate::analysis::ContactReport::apart_time) > 0.
    Deflection,
    /// The mesh carries no force for a time: [`no_force_time`](crate::analysis::ContactReport::no_force_time) > 0.
    Force,
}

/// Range and resolution of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThresholdSearch {
    /// Smallest and largest value.
    pub range: [f64; 2],
    /// Values tried from the largest down until contact is lost at one, ≥ 2: losses may come and go along the range.
    pub scan: usize,
    /// Width of the last bracket.
    pub resolution: f64,
}

/// Result of a search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Threshold {
    /// Contact is kept at every value tried.
    None,
    /// Contact is still lost at the largest value.
    Beyond {
        /// The largest value.
        value: f64,
    },
    /// The loss of contact ends within this bracket.
    Located {
        /// Contact is lost here.
        below: f64,
        /// Contact is kept here.
        above: f64,
        /// Smallest deflection from the flank at `below`, m. By deflection it is < 0: near zero if the flight shrinks to zero, finite if
        /// the motion with flight disappears at once.
        clearance_below: f64,
        /// Smallest deflection at `above`, m, ≥ 0.
        clearance_above: f64,
    },
}

impl Threshold {
    /// Returns the middle of the bracket, or the largest value if the threshold lies beyond it.
    pub fn middle(&self) -> Option<f64> {
        match *self {
            Self::Beyond { value } => Some(value),
            _ => self.located(),
        }
    }

    /// Returns the middle of the bracket.
    pub(super) fn located(&self) -> Option<f64> {
        if let Self::Located { below, above, .. } = self { Some(0.5 * (below + above)) } else { None }
    }
}

/// Returns the largest value of the number at `pointer` at which the contact whose name starts with `stem` loses contact, by `by`. Each
/// steady motion is from the scene's own start; values are scanned from above, then bisected.
pub fn locate(
    context: &Context<'_>,
    scene: &Scene,
    pointer: &str,
    (stem, by): (&str, LossCriterion),
    search: &ThresholdSearch,
) -> Result<Threshold, StudyError> {
    // The sign of the clearance decides on the event; its size shows the kind of the change.
    let clearance = |value: f64| {
        let steady = context.steady(&scene.with(pointer, json!(value))?, None)?;
        let contact = steady.expect(stem, scene)?;
        let time = match by {
            LossCriterion::Deflection => contact.report.apart_time,
            LossCriterion::Force => contact.report.no_force_time,
        };
        Ok::<_, StudyError>((time > 0.0, contact.report.deflection_min.unwrap_or_default()))
    };
    let [low, high] = search.range;
    let steps = search.scan.max(2) - 1;
    let value = |i: usize| low + (high - low) * (i as f64 / steps as f64);
    let mut above: Option<(f64, f64)> = None;
    let mut below = None;
    for i in (0..=steps).rev() {
        match (clearance(value(i))?, above) {
            ((true, _), None) => return Ok(Threshold::Beyond { value: high }),
            ((true, d), Some(_)) => {
                below = Some((value(i), d));
                break;
            }
            ((false, d), _) => above = Some((value(i), d)),
        }
    }
    let (Some(mut below), Some(mut above)) = (below, above) else { return Ok(Threshold::None) };
    while above.0 - below.0 > search.resolution {
        let middle = 0.5 * (below.0 + above.0);
        if middle <= below.0 || middle >= above.0 {
            break;
        }
        match clearance(middle)? {
            (true, d) => below = (middle, d),
            (false, d) => above = (middle, d),
        }
    }
    Ok(Threshold::Located { below: below.0, above: above.0, clearance_below: below.1, clearance_above: above.1 })
}
