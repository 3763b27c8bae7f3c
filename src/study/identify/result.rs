//! Result of an identification.

use serde::Serialize;

use super::{
    Parameter, Target, Uniqueness,
    fit::{DescentEnd, Fit},
    reading::Reading,
};
use crate::scene::{Scene, SceneError};

/// Result of an identification.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Identification {
    /// Numbers, in the order of the question.
    pub parameters: Vec<FittedNumber>,
    /// Targets, in the order given.
    pub targets: Vec<TargetValue>,
    /// Sum `Σ ((got − wanted)/σ)²`.
    pub chi_square: f64,
    /// True if the descent came to rest: the gradient vanishes, points out of a bound, or no step lowers χ².
    pub converged: bool,
    /// Relative change of each target for a relative change of each number, % per %, `[targets × numbers]`; none where
    /// the target is 0.
    pub sensitivity: Vec<Vec<Option<f64>>>,
    /// Directions that the targets determine or leave open.
    pub uniqueness: Uniqueness,
    /// Different solutions of equal quality, the reported one first. If the solution is not unique, points of a continuum.
    pub solutions: Vec<Solution>,
    /// Descents that ended in poorer minima.
    pub poorer: usize,
    /// Descents made.
    pub starts: usize,
    /// Contacts taken at the tangent stiffness of their static force.
    pub tangent_contacts: Vec<String>,
}

/// Number that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FittedNumber {
    /// Its places in the scene.
    pub pointers: Vec<String>,
    /// Its value in the given scene.
    pub own: f64,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Its value at the solution.
    pub found: f64,
    /// Bound on which it lies, if any.
    pub at_bound: Option<Side>,
    /// Standard error from the standard deviations of the targets, to first order; none for a number that the targets do not determine.
    pub standard_error: Option<f64>,
}

/// One of two bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Lower bound.
    Low,
    /// Upper bound.
    High,
}

/// Target with its value at the solution.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TargetValue {
    /// Quantity, as in the question.
    pub quantity: String,
    /// Unit: `Hz` or `N`.
    pub unit: &'static str,
    /// The wanted value.
    pub wanted: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// The value at the solution.
    pub got: f64,
    /// Difference `got − wanted`.
    pub residual: f64,
    /// Relative difference `(got − wanted)/wanted`; none for a wanted 0.
    pub relative_residual: Option<f64>,
    /// Name of the nearest natural frequency, for a target of that kind.
    pub matched: Option<String>,
}

/// One of several solutions.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Solution {
    /// Numbers, in the order of the question.
    pub values: Vec<f64>,
    /// Sum `Σ ((got − wanted)/σ)²`.
    pub chi_square: f64,
}

impl Identification {
    /// Returns the first of `distinct` with its statistics; none if it has no derivatives.
    pub(super) fn new(fit: &Fit, own: &[f64], distinct: &[DescentEnd], poorer: usize, starts: usize) -> Option<Self> {
        let best = distinct.first()?;
        let (values, jacobian) = (fit.values(&best.x), fit.jacobian(&best.x)?);
        let (uniqueness, variances) = Uniqueness::new(&jacobian, fit.parameters);
        // dp/dx.
        let scale = |(p, value): (&Parameter, &f64)| if p.is_logarithmic() { *value } else { p.high - p.low };
        let scales: Vec<f64> = fit.parameters.iter().zip(&values).map(scale).collect();
        let percent = |i: usize, j: usize| {
            let got = best.readings[i].value;
            (got != 0.0).then(|| jacobian[(i, j)] * fit.targets[i].sigma / got * values[j] / scales[j])
        };
        let found = |(j, p): (usize, &Parameter)| FittedNumber {
            pointers: p.pointers.clone(),
            own: own[j],
            low: p.low,
            high: p.high,
            found: values[j],
            at_bound: [(p.low, Side::Low), (p.high, Side::High)]
                .into_iter()
                .find_map(|(bound, side)| (values[j] == bound).then_some(side)),
            standard_error: variances[j].map(|variance| variance.sqrt() * scales[j]),
        };
        let met = |(target, reading): (&Target, &Reading)| {
            let residual = reading.value - target.wanted;
            TargetValue {
                quantity: target.quantity.to_string(),
                unit: target.quantity.unit(),
                wanted: target.wanted,
                sigma: target.sigma,
                got: reading.value,
                residual,
                relative_residual: (target.wanted != 0.0).then(|| residual / target.wanted),
                matched: reading.matched.clone(),
            }
        };
        let columns = 0..values.len();
        Some(Self {
            parameters: fit.parameters.iter().enumerate().map(found).collect(),
            targets: fit.targets.iter().zip(&best.readings).map(met).collect(),
            chi_square: best.chi_square,
            converged: best.converged,
            sensitivity: (0..fit.targets.len()).map(|i| columns.clone().map(|j| percent(i, j)).collect()).collect(),
            uniqueness,
            solutions: distinct
                .iter()
                .map(|point| Solution { values: fit.values(&point.x), chi_square: point.chi_square })
                .collect(),
            poorer,
            starts,
            tangent_contacts: fit.tangent_contacts(),
        })
    }

    /// Returns the scene with the found numbers.
    ///
    /// # Errors
    /// [`SceneError`] if this is not the scene they were found for.
    pub fn apply(&self, scene: &Scene) -> Result<Scene, SceneError> {
        let places = self
            .parameters
            .iter()
            .flat_map(|found| found.pointers.iter().map(move |pointer| (pointer.as_str(), found.found.into())));
        scene.with_all(places)
    }
}
