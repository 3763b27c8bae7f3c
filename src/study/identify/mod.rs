//! Identification: numbers of a scene from natural frequencies and static contact forces.
//!
//! The chosen numbers p are found by bounded nonlinear least squares,
//!
//! ```text
//! min ½ Σ r_i²,    r_i = (q_i(p) − wanted_i)/σ_i,    low ≤ p ≤ high
//! ```
//!
//! with a trust-region reflective method (Branch, Coleman & Li, SIAM J. Sci. Comput. 21, 1999) from the scene's own
//! values and from points spread over the bounds. Numbers whose lower bound is positive are sought in their logarithm.
//! How well the targets determine them follows from the singular values of `∂r/∂p` at the solution; a direction that
//! no target sees is named, never hidden behind the one point that came out.
//!
//! ```
//! use flank::{
//!     Task,
//!     scene::Scene,
//!     study::identify::{Parameter, Target, identify},
//! };
//!
//! let stage = r#"{ "flank": 1, "train": { "kind": "planetary", "preset": "lin-parker" }, "run": { "t_end_s": 1 } }"#;
//! let scene = Scene::from_json(stage, "stage")?;
//! let bearing: Parameter = "/train/planet/translation/stiffness_n_per_m=1e7:1e9".parse()?;
//! let target: Target = "translational:2=1200".parse()?;
//! let found = identify(&scene, &[bearing], &[target], Task::default())?;
//! assert!((found.targets[0].got - 1200.0).abs() < 1e-6);
//! assert!(found.uniqueness.is_unique());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod check;
mod fit;
mod question;
mod reading;
mod result;
mod uniqueness;

pub use check::check;
use fit::{DescentEnd, Fit};
pub use question::{Parameter, Quantity, Target};
pub use result::{FittedNumber, Identification, Side};
pub use uniqueness::Uniqueness;

use rayon::prelude::*;

use super::StudyError;
use crate::{
    scene::{Fault, Scene},
    task::Task,
};

/// Points a fit starts from, the scene's own among them.
pub const STARTS: usize = 32;
/// Solutions whose χ² differs by less are of equal quality: no target differs by more than a hundredth of its σ.
const EQUAL: f64 = 1e-4;
/// Solutions that differ by less than this share of their bounds, in every number, are one.
const SAME: f64 = 1e-3;

/// An identification that cannot be done, with everything that is wrong with the question.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", report(faults))]
pub struct IdentifyError {
    /// All faults found, at least one. Their places are parameters and targets as they are written.
    pub faults: Vec<Fault>,
}

impl From<Fault> for IdentifyError {
    fn from(fault: Fault) -> Self {
        Self { faults: vec![fault] }
    }
}

/// A fault of the question as a whole.
fn fault(found: &str, allowed: &str) -> Fault {
    Fault::new("the question as a whole", found, allowed)
}

fn report(faults: &[Fault]) -> String {
    let many = if faults.len() == 1 { "1 fault".to_owned() } else { format!("{} faults", faults.len()) };
    faults.iter().fold(format!("the identification has {many}"), |text, fault| format!("{text}\n{fault}"))
}

/// Finds the values of `parameters` for which `scene` comes closest to `targets`; `task` hears of each of the [`STARTS`].
///
/// The solution reported is the best of those found from all starts; among equal ones that from the scene's own values.
///
/// # Errors
/// [`StudyError::Identify`] if a pointer leads to no number, bounds do not hold a scene, or a target names something that
/// the train does not have: all faults at once. [`StudyError::Interrupted`] once `task` is cancelled.
pub fn identify(
    scene: &Scene,
    parameters: &[Parameter],
    targets: &[Target],
    task: Task<'_>,
) -> Result<Identification, StudyError> {
    if parameters.is_empty() || targets.is_empty() {
        let fault = fault("no number to find, or no target to find it from", "at least one of each");
        return Err(
            IdentifyError::from(fault.remedy("name numbers as POINTER=LOW:HIGH, targets as QUANTITY=VALUE")).into()
        );
    }
    let own = check(scene, parameters, targets).map_err(|faults| IdentifyError { faults })?;
    let fit = Fit::new(scene, parameters, targets);
    let descend = |k| {
        if task.is_cancelled() {
            return Err(StudyError::Interrupted);
        }
        let start = if k == 0 { fit.clipped(&own) } else { fit.spread(k) };
        let point = fit.descend(&start);
        task.advance();
        Ok(point)
    };
    let ends = (0..STARTS).into_par_iter().with_max_len(1).map(descend);
    let points: Vec<DescentEnd> = ends.filter_map(Result::transpose).collect::<Result<_, _>>()?;
    let least = points.iter().map(|p| p.chi_square).fold(f64::INFINITY, f64::min);
    let (equal, poorer): (Vec<DescentEnd>, Vec<DescentEnd>) =
        points.into_iter().partition(|p| p.chi_square <= least + EQUAL);
    let mut distinct: Vec<DescentEnd> = Vec::new();
    for point in equal {
        if !distinct.iter().any(|known| fit.distance(known, &point) <= SAME) {
            distinct.push(point);
        }
    }
    Identification::new(&fit, &own, &distinct, poorer.len(), STARTS).ok_or_else(|| {
        let fault = fault("no start from which a train with all targets is found", "bounds that hold one");
        IdentifyError::from(fault.remedy("bring the bounds closer to values that are known to work")).into()
    })
}
