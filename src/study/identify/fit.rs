//! Least-squares problem, and descents into its minima.

use std::{cell::RefCell, convert::Infallible};

use basin::{
    BoundedFiniteDiff, BoxBounds, ConstraintDescription, ConstraintSet, Constraints, Executor, Jacobian, Method,
    Residual, Termination, TrustRegionReflective,
};
use nalgebra::DMatrix;

use super::{
    Parameter, Quantity, Target,
    reading::{Reading, Train, is_linear},
};
use crate::scene::{Scene, Variant};

/// Step of the differences for `∂r/∂x`: with x a logarithm the truncation, `h²/6`, is about the rounding of a natural frequency over h.
/// frequency over h.
const STEP: f64 = 1e-5;
/// Bound of `∂(χ²/2)/∂x`, times the distance to the bound it points to, at which a descent ends. It is the rounding of the differences for
/// misfits of a few standard deviations.
const GRADIENT: f64 = 1e-5;
/// Relative decrease of χ² in a step below which a descent ends.
const PROGRESS: f64 = 1e-8;
/// Maximum number of steps of a descent; those that converge take a few tens.
const ITERATIONS: u64 = 100;
/// Distance from a bound, as a share of the range, within which a minimum is tried on the bound: the method avoids bounds.
const AT_BOUND: f64 = 1e-4;

/// Problem in coordinates x: `ln p` of numbers with a logarithmic scale, the share of the range of others.
pub(super) struct Fit<'a> {
    pub scene: &'a Scene,
    pub parameters: &'a [Parameter],
    pub targets: &'a [Target],
    low: Vec<f64>,
    high: Vec<f64>,
}

/// End of a descent.
#[derive(Clone, Debug)]
pub(super) struct DescentEnd {
    /// Coordinates.
    pub x: Vec<f64>,
    /// Values of the targets there.
    pub readings: Vec<Reading>,
    /// `Σ r²`.
    pub chi_square: f64,
    /// True if the descent came to rest there.
    pub converged: bool,
}

/// Returns every place of the parameters with its value.
pub(super) fn places<'a>(parameters: &'a [Parameter], values: &[f64]) -> Vec<(&'a str, f64)> {
    let of = |(p, value): (&'a Parameter, &f64)| p.pointers.iter().map(|at| (at.as_str(), *value)).collect::<Vec<_>>();
    parameters.iter().zip(values).flat_map(of).collect()
}

impl<'a> Fit<'a> {
    pub fn new(scene: &'a Scene, parameters: &'a [Parameter], targets: &'a [Target]) -> Self {
        let ends = |end: fn(&Parameter) -> f64| parameters.iter().map(|p| coordinate(p, end(p))).collect();
        Self { scene, parameters, targets, low: ends(|p| p.low), high: ends(|p| p.high) }
    }

    /// Returns the values at coordinates, exact on a bound.
    pub fn values(&self, x: &[f64]) -> Vec<f64> {
        let value = |(i, p): (usize, &Parameter)| match x[i] {
            x if x <= self.low[i] => p.low,
            x if x >= self.high[i] => p.high,
            x if p.is_logarithmic() => libm::exp(x).clamp(p.low, p.high),
            x => (p.low + x * (p.high - p.low)).clamp(p.low, p.high),
        };
        self.parameters.iter().enumerate().map(value).collect()
    }

    /// Returns the coordinates of values, clipped to the bounds.
    pub fn clipped(&self, values: &[f64]) -> Vec<f64> {
        let inside = self.parameters.iter().zip(values).map(|(p, v)| coordinate(p, v.clamp(p.low, p.high)));
        inside.collect()
    }

    /// Returns point k ≥ 1 of a sequence that fills the bounds evenly: shares `frac(½ + k φ⁻ʲ)` with φ the root of `φ^{n+1} = φ + 1`
    /// (Roberts, 2018: the golden ratio in n dimensions).
    pub fn spread(&self, k: usize) -> Vec<f64> {
        let n = self.parameters.len() as f64;
        let phi = (0..64).fold(2.0f64, |phi, _| libm::pow(1.0 + phi, (n + 1.0).recip()));
        let share = |j: usize| (0.5 + k as f64 * phi.powi(-(j as i32 + 1))).fract();
        (0..self.parameters.len()).map(|j| self.low[j] + share(j) * (self.high[j] - self.low[j])).collect()
    }

    /// Returns the largest difference of two points in any number, as a share of its range.
    pub fn distance(&self, a: &DescentEnd, b: &DescentEnd) -> f64 {
        let share = |i: usize| (a.x[i] - b.x[i]).abs() / (self.high[i] - self.low[i]);
        (0..a.x.len()).map(share).fold(0.0, f64::max)
    }

    /// Returns the value of every target at these coordinates; none if the train is invalid.
    pub fn readings(&self, x: &[f64]) -> Option<Vec<Reading>> {
        self.readings_in(&mut Variant::new(self.scene), x)
    }

    fn readings_in(&self, scene: &mut Variant<'_>, x: &[f64]) -> Option<Vec<Reading>> {
        let spec = scene.build(places(self.parameters, &self.values(x))).ok()?.spec;
        let train = Train::new(&spec);
        let read = |target| train.read(target).ok().filter(|reading| reading.value.is_finite());
        self.targets.iter().map(read).collect()
    }

    /// Returns the names of contacts whose stiffness depends on their load.
    pub fn tangent_contacts(&self) -> Vec<String> {
        let frequencies = self.targets.iter().any(|target| !matches!(target.quantity, Quantity::Force(_)));
        let contacts = self.scene.built().spec.contacts.iter();
        contacts.filter(|contact| frequencies && !is_linear(contact)).map(|contact| contact.name.clone()).collect()
    }

    /// Returns the minimum in which a descent from `start` ends; none if the train is invalid at the start.
    pub fn descend(&self, start: &[f64]) -> Option<DescentEnd> {
        self.readings(start)?;
        let method = TrustRegionReflective::new()
            .with_absolute_scaled_gradient_tolerance(GRADIENT)
            .with_relative_cost_change_tolerance(PROGRESS);
        let run = Executor::from_start(self.derivable(), method, start.to_vec());
        let ended = run.max_iter(ITERATIONS).run().ok()?;
        // A step too small to change any number counts as rest too.
        let converged = matches!(ended.report.termination, Termination::Converged(_) | Termination::Stalled(_));
        let mut point = self.point(ended.param(), converged)?;
        for i in 0..point.x.len() {
            let (x, reach) = (point.x[i], AT_BOUND * (self.high[i] - self.low[i]));
            let bound = [self.low[i], self.high[i]].into_iter().find(|bound| (x - bound).abs() <= reach);
            let moved = bound.and_then(|bound| {
                let mut x = point.x.clone();
                x[i] = bound;
                self.point(&x, converged)
            });
            if let Some(moved) = moved.filter(|moved| moved.chi_square <= point.chi_square) {
                point = moved;
            }
        }
        Some(point)
    }

    fn point(&self, x: &[f64], converged: bool) -> Option<DescentEnd> {
        let readings = self.readings(x)?;
        let chi_square = self.misfit(&readings).iter().map(|r| r * r).sum();
        Some(DescentEnd { x: x.to_vec(), readings, chi_square, converged })
    }

    fn misfit(&self, readings: &[Reading]) -> Vec<f64> {
        readings.iter().zip(self.targets).map(|(got, target)| (got.value - target.wanted) / target.sigma).collect()
    }

    /// Returns `∂r/∂x` `[targets × parameters]`, by central differences, one-sided at a bound; none beside points without a valid train.
    pub fn jacobian(&self, x: &[f64]) -> Option<DMatrix<f64>> {
        let Ok(jacobian) = self.derivable().jacobian(&x.to_vec());
        let jacobian = DMatrix::from_fn(self.targets.len(), self.parameters.len(), |i, j| jacobian.get(i, j));
        jacobian.iter().all(|slope| slope.is_finite()).then_some(jacobian)
    }

    fn derivable(&self) -> BoundedFiniteDiff<FitProblem<'_>> {
        let trial = FitProblem { fit: self, scene: RefCell::new(Variant::new(self.scene)) };
        BoundedFiniteDiff::new(trial, self.low.clone(), self.high.clone())
            .jacobian_method(Method::Central)
            .with_step(STEP)
    }
}

fn coordinate(parameter: &Parameter, value: f64) -> f64 {
    if parameter.is_logarithmic() {
        libm::log(value)
    } else {
        (value - parameter.low) / (parameter.high - parameter.low)
    }
}

/// Problem with a scene that is changed in place at each trial.
struct FitProblem<'a> {
    fit: &'a Fit<'a>,
    scene: RefCell<Variant<'a>>,
}

impl Residual for FitProblem<'_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;
    type Error = Infallible;

    fn residual(&self, x: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        // The method steps back from points without a valid train.
        let Self { fit, scene } = self;
        let readings = fit.readings_in(&mut scene.borrow_mut(), x);
        Ok(readings.map_or(vec![f64::NAN; fit.targets.len()], |readings| fit.misfit(&readings)))
    }
}

impl Constraints for FitProblem<'_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.fit.low), Some(&self.fit.high)))
    }
}
