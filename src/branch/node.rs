//! Points of a branch: orbits on a line in the space of states and parameter.

use std::{cell::Cell, rc::Rc};

use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{course::Course, family::Family};
use crate::{
    orbit::{Drift, Image, NewtonFailure, Orbit, Section, SectionMap, Unknowns},
    simulation::Simulation,
};

/// Distance of an orbit's ends that rounding of some ten arcs a cycle leaves, in scales.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Maximum number of Newton steps.
const STEPS: usize = 14;
/// Residual, in scales, below which a point counts.
const CLOSED: f64 = 1e-9;
/// Two states nearer than this, in scales, are the same point of an orbit.
const SAME: f64 = 1e-6;
/// Length of a step of Newton's method, in scales, after which the method ends.
const SHORT: f64 = 1e-13;
/// The same length where rounding limits the steps.
const SETTLED: f64 = 1e-11;
/// Longest step, in scales.
const LONGEST: f64 = 10.0;
/// Steps after which the derivative by the parameter is computed exactly.
const SLOW: usize = 3;
/// Least change of the parameter, in ranges, that updates the derivative of the ends by it.
const SECANT: f64 = 1e-6;
/// Share of the largest singular value below which a singular value belongs to an undetermined direction.
const NEUTRAL: f64 = 1e-11;

/// Values of the parameter and of the second number; without a second number, that of the scene.
pub type Place = [f64; 2];

/// Direction in the space of unknowns and numbers, the latter in ranges.
#[derive(Clone, Debug)]
pub struct Direction {
    /// Part over the unknowns.
    pub y: DVector<f64>,
    /// Part along the parameter.
    pub p: f64,
    /// Part along the second number.
    pub s: f64,
}

impl Direction {
    /// Returns the scalar product.
    pub fn dot(&self, other: &Self) -> f64 {
        self.y.dot(&other.y) + self.p * other.p + self.s * other.s
    }

    /// Returns its length.
    pub fn length(&self) -> f64 {
        libm::hypot(self.y.norm(), libm::hypot(self.p, self.s))
    }

    /// Returns `factor` times the direction.
    pub fn times(&self, factor: f64) -> Self {
        Self { y: &self.y * factor, p: self.p * factor, s: self.s * factor }
    }
}

/// Initial values of Newton's method.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Guess {
    /// State near the orbit.
    pub section: Section,
    /// Values of the numbers.
    pub place: Place,
    /// Period, cycles.
    pub period: u64,
    /// Phase of its section, as a share of the forcing period.
    pub phase: f64,
    /// Cycles, as in [`Node::shift`].
    pub shift: u64,
    /// Derivative of the end of the period by the numbers, in ranges, `[dim, numbers]`; only the steps to the point depend on it. Computed
    /// exactly if absent.
    #[serde(skip)]
    pub by: Option<DMatrix<f64>>,
}

/// Orbit at a value of the parameter, with the tangent of the branch.
#[derive(Clone, Debug)]
pub struct Node {
    /// Value of the parameter.
    pub value: f64,
    /// Value of the second number.
    pub second: f64,
    /// Phase of its section, as a share of the forcing period.
    pub phase: f64,
    /// Cycles from the phase 0 at which the branch's first orbit begins to the next phase 0 of this one.
    pub shift: u64,
    /// Orbit.
    pub orbit: Orbit,
    /// Events of the orbit, and least values of guards.
    pub course: Course,
    /// Unknowns of the orbit.
    pub unknowns: Unknowns,
    /// Unit tangent of the branch.
    pub tangent: Direction,
    /// Derivative of the end of the period by the numbers with its start held; in ranges, `[dim, numbers]`.
    pub by: DMatrix<f64>,
    /// Determinant `det(I − J)` over the unknowns.
    pub fold: f64,
    /// Determinant `det(I + J)` over the unknowns.
    pub flip: f64,
    /// Newton steps to the point.
    pub steps: usize,
}

/// Hyperplane of a point, numbers in ranges: `row · (x − x₀) + p (value − value₀) + s (second − second₀) = target`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Plane {
    /// Point x₀ of the plane.
    pub x: Vec<f64>,
    /// Values of the numbers at that point.
    pub place: Place,
    /// Coefficients of the state.
    pub row: DVector<f64>,
    /// Coefficient of the parameter.
    pub p: f64,
    /// Coefficient of the second number.
    pub s: f64,
    /// Distance `target` from that point.
    pub target: f64,
    /// True if the tangent at the point is required.
    pub goes_on: bool,
}

/// State at values of the numbers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Spot {
    /// State.
    pub section: Section,
    /// Values of the numbers.
    pub place: Place,
}

impl Spot {
    /// Returns the spot of a node.
    pub fn of(node: &Node) -> Self {
        Self::at(node.at())
    }

    /// Returns the spot of a guess.
    pub fn at(guess: Guess) -> Self {
        Self { section: guess.section, place: guess.place }
    }
}

/// Guess of an orbit that is solved for again, on a plane through the guess.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seed {
    /// Guess.
    pub guess: Guess,
    /// Plane.
    pub plane: Plane,
}

impl Plane {
    /// Returns the plane at a distance from a node along a direction.
    pub fn through(node: &Node, direction: &Direction, target: f64) -> Self {
        let Node { orbit, value, second, unknowns, .. } = node;
        let row = unknowns.row(&direction.y);
        let (x, place) = (orbit.section.x.clone(), [*value, *second]);
        Self { x, place, row, p: direction.p, s: direction.s, target, goes_on: true }
    }

    /// Returns the plane on which a number, the first or the second, has the value of a guess.
    pub fn of_number(guess: &Guess, i: usize) -> Self {
        let (x, place, row) = (guess.section.x.clone(), guess.place, DVector::zeros(guess.section.x.len()));
        let [p, s] = [0, 1].map(|l| f64::from(u8::from(l == i)));
        Self { x, place, row, p, s, target: 0.0, goes_on: true }
    }

    /// Returns the residual of the equation of the plane.
    fn missing(&self, x: &[f64], place: Place, ranges: [f64; 2]) -> f64 {
        let along: f64 = (0..x.len()).map(|i| self.row[i] * (x[i] - self.x[i])).sum();
        let [p, s] = [0, 1].map(|i| (place[i] - self.place[i]) / ranges[i]);
        along + self.p * p + self.s * s - self.target
    }
}

impl Node {
    /// Returns the multipliers that decide on stability.
    pub fn multipliers(&self) -> Vec<Complex<f64>> {
        self.orbit.telling()
    }

    /// Returns the counts of multipliers outside the unit circle: real ones above 1, below −1, and complex ones.
    pub fn unstable(&self) -> [usize; 3] {
        let mut counts = [0; 3];
        for m in self.multipliers().iter().filter(|m| m.norm() > 1.0) {
            counts[if m.im != 0.0 { 2 } else { usize::from(m.re < 0.0) }] += 1;
        }
        counts
    }

    /// Returns one multiplier of each complex pair, the largest first.
    pub fn pairs(&self) -> Vec<Complex<f64>> {
        let mut pairs: Vec<Complex<f64>> = self.multipliers().into_iter().filter(|m| m.im > 0.0).collect();
        pairs.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
        pairs
    }

    /// Returns the index of the complex pair nearest to the unit circle.
    pub fn pair_on_circle(&self) -> usize {
        let off: Vec<f64> = self.pairs().iter().map(|m| (m.norm() - 1.0).abs()).collect();
        (0..off.len()).min_by(|i, j| off[*i].total_cmp(&off[*j])).unwrap_or_default()
    }

    /// Returns whether the orbit closes after a part of its period.
    pub fn has_shorter_period(&self) -> bool {
        let Orbit { section, image, period, .. } = &self.orbit;
        let closes = |k: &u64| self.unknowns.between(&section.x, &image.between[*k as usize - 1].x).norm() <= SAME;
        (1..*period).filter(|k| period.is_multiple_of(*k)).any(|k| closes(&k))
    }

    /// Returns the error of the numbers, in ranges, from the residual of the orbit, at least from rounding.
    pub fn closure(&self) -> f64 {
        self.orbit.residual.max(ROUNDING) * self.orbit.condition
    }

    /// Returns the chord to another point of the branch, of length one, and the length before scaling.
    pub fn chord(&self, to: &Self, ranges: [f64; 2]) -> (Direction, f64) {
        self.direction(&Spot::of(self), &Spot::of(to), ranges)
    }

    /// Returns the direction from one place to another in this node's unknowns, of length one, and the distance.
    pub fn direction(&self, from: &Spot, to: &Spot, ranges: [f64; 2]) -> (Direction, f64) {
        let y = self.unknowns.between(&from.section.x, &to.section.x);
        let [p, s] = [0, 1].map(|i| (to.place[i] - from.place[i]) / ranges[i]);
        let direction = Direction { y, p, s };
        let length = direction.length();
        (direction.times(1.0 / length), length)
    }

    /// Returns the tangent of another node in this one's unknowns.
    pub fn tangent_of(&self, other: &Self) -> Direction {
        let change = other.unknowns.lifted(&other.tangent.y);
        let y = self.unknowns.between(&vec![0.0; change.len()], change.as_slice());
        Direction { y, ..other.tangent }
    }

    /// Returns the guess at the node.
    pub fn at(&self) -> Guess {
        let (section, by) = (self.orbit.section.clone(), Some(self.by.clone()));
        Guess { section, place: self.place(), period: self.orbit.period, phase: self.phase, shift: self.shift, by }
    }

    /// Returns the seed of the node, to be solved for across a direction.
    pub fn seed(&self, across: &Direction) -> Seed {
        Seed { guess: Guess { by: None, ..self.at() }, plane: Plane::through(self, across, 0.0) }
    }

    /// Returns the guess at a distance along a direction.
    pub fn guess(&self, direction: &Direction, ranges: [f64; 2], distance: f64) -> Guess {
        self.moved(self.at(), direction, ranges, distance)
    }

    /// Returns a guess that is moved by a distance along a direction of this node.
    pub fn moved(&self, mut guess: Guess, direction: &Direction, ranges: [f64; 2], distance: f64) -> Guess {
        let change = self.unknowns.lifted(&direction.y);
        guess.section.x.iter_mut().zip(&change).for_each(|(x, c)| *x += distance * c);
        guess.place[0] += distance * direction.p * ranges[0];
        guess.place[1] += distance * direction.s * ranges[1];
        guess
    }

    /// Returns the values of the numbers.
    pub fn place(&self) -> Place {
        [self.value, self.second]
    }
}

/// Solver for points of a branch.
pub struct Solver<'f> {
    /// Trains along the parameter.
    pub family: &'f Family,
    /// Drift of the trains.
    pub drift: Drift,
    /// Smallest singular value, as a share of the largest, along which Newton's method steps. Larger on a symmetric branch, so that the
    /// direction that breaks the symmetry is left alone.
    pub neutral: f64,
    /// True between two near symmetric orbits: the direction with the smallest singular value, which breaks the symmetry, is left out. Its
    /// part in the guess changes special points by its square only.
    pub is_symmetric: bool,
    /// Plane of all points; with it, the second number is free as well.
    pub slice: Option<Plane>,
    /// Cycles run with their derivative, for a limit of work that is the same on every machine.
    pub spent: Rc<Cell<u64>>,
}

impl<'f> Solver<'f> {
    /// Returns the solver of a family.
    pub fn new(family: &'f Family, drift: Drift) -> Self {
        Self { family, drift, neutral: NEUTRAL, is_symmetric: false, slice: None, spent: Rc::default() }
    }

    /// Returns the point of a seed.
    pub fn grown(&self, seed: &Seed) -> Result<Node, NewtonFailure> {
        self.at(seed.guess.clone(), Some(&seed.plane), 1.0)
    }

    /// Returns the point of `orbit`, whose map has its section at phase 0, with the section at the phase farthest from its events.
    pub fn start(&self, simulation: &Simulation, value: f64, orbit: &Orbit) -> Result<Node, NewtonFailure> {
        let map = SectionMap::new(simulation)?;
        let course = Course::new(&map, &orbit.section, orbit.period)?;
        let there = map.at_phase(course.quiet(0.0));
        let (section, phase) = (map.lead(&orbit.section, &there)?, there.phase());
        let place = [value, self.family.own_place()[1]];
        let shift = u64::from(phase > 0.0);
        self.at(Guess { section, place, period: orbit.period, phase, shift, by: None }, None, 1.0)
    }

    /// Returns the same point with its section at the phase farthest from its events.
    pub fn turned(&self, node: &Node) -> Result<Node, NewtonFailure> {
        let simulation = self.family.train(node.place())?;
        let map = SectionMap::new(&simulation)?.at_phase(node.phase);
        let there = map.at_phase(node.course.quiet(node.phase));
        let (section, phase) = (map.lead(&node.orbit.section, &there)?, there.phase());
        let shift = node.shift + u64::from(phase < node.phase);
        let (place, period) = (node.place(), node.orbit.period);
        self.at(Guess { section, place, period, phase, shift, by: None }, None, node.tangent.p.signum())
    }

    /// Returns the orbit near a guess, on a plane or at the guess's value of the parameter. Without a plane, its tangent points to rising
    /// values of the parameter, or to falling ones if `sign` is negative.
    pub fn at(&self, guess: Guess, plane: Option<&Plane>, sign: f64) -> Result<Node, NewtonFailure> {
        let ranges = self.family.ranges();
        let Guess { mut section, mut place, period, phase, shift, by } = guess;
        let (numbers, is_free) = (1 + usize::from(self.slice.is_some()), plane.is_some() || self.slice.is_some());
        let (mut best, mut last) = (f64::INFINITY, f64::INFINITY);
        let mut by = by.filter(|by| by.ncols() == numbers);
        let mut before: Option<(Section, Place, Image)> = None;
        for step in 0..STEPS {
            let spend = || self.spent.set(self.spent.get() + period);
            let simulation = self.family.train(place)?;
            let map = SectionMap::new(&simulation)?.at_phase(phase);
            let exact = || -> Result<(Image, DMatrix<f64>), NewtonFailure> {
                spend();
                let variations = self.family.variations(&simulation, place, numbers)?;
                let image = map.image_by(&section, period, &variations)?;
                let by = DMatrix::from_fn(section.x.len(), numbers, |i, l| image.by_number[(i, l)] * ranges[l]);
                Ok((image, by))
            };
            let is_exact = is_free && (by.is_none() || step >= SLOW);
            let image = if is_exact {
                let (image, exact) = exact()?;
                by = Some(exact);
                image
            } else {
                spend();
                map.image(&section, period)?
            };
            let by = by.get_or_insert_with(|| DMatrix::zeros(section.x.len(), numbers));
            if let Some((from, at, old)) = before.take().filter(|_| !is_exact) {
                // Update from the last step (Broyden 1965).
                let moved = DVector::from_fn(numbers, |l, _| (place[l] - at[l]) / ranges[l]);
                if moved.norm() > SECANT {
                    let steps = DVector::from_fn(section.x.len(), |i, _| section.x[i] - from.x[i]);
                    let ends = DVector::from_fn(section.x.len(), |i, _| image.end.x[i] - old.end.x[i]);
                    let unexplained = ends - &old.jacobian * steps - &*by * &moved;
                    *by += unexplained * moved.transpose() / moved.norm_squared();
                }
            }
            let unknowns = Unknowns::new(&map, &image, &self.drift);
            let count = unknowns.count();
            if count == 0 {
                return Err(missed(best, "the train drifts as a whole: nothing of its state returns"));
            }
            let off = unknowns.between(&section.x, &image.end.x);
            let reduced = unknowns.reduced(&image.jacobian);
            let mut rows: Vec<(Direction, f64)> = Vec::new();
            for plane in plane.iter().copied().chain(&self.slice) {
                let row = Direction { y: unknowns.row_of(&plane.row), p: plane.p, s: plane.s };
                rows.push((row, plane.missing(&section.x, place, ranges)));
            }
            if plane.is_none() {
                rows.insert(0, (Direction { y: DVector::zeros(count), p: 1.0, s: 0.0 }, 0.0));
            }
            let bordered = |by: &DMatrix<f64>| {
                let columns = unknowns.columns(by);
                DMatrix::from_fn(count + numbers, count + numbers, |i, j| match (i < count, j < count) {
                    (true, true) => reduced[(i, j)] - f64::from(u8::from(i == j)),
                    (true, false) => columns[(i, j - count)],
                    (false, true) => rows[i - count].0.y[j],
                    (false, false) => [rows[i - count].0.p, rows[i - count].0.s][j - count],
                })
            };
            let matrix = bordered(by);
            let missing = rows.iter().map(|(_, missing)| missing * missing).sum::<f64>().sqrt();
            let residual = libm::hypot(off.norm(), missing);
            if !residual.is_finite() || matrix.iter().any(|entry| !entry.is_finite()) {
                return Err(missed(best, "the motion leaves the range of numbers"));
            }
            let svd = matrix.svd(true, true);
            let cutoff = |svd: &Svd| match self.is_symmetric {
                true => (1.0 + 1e-9) * svd.singular_values.min(),
                false => self.neutral * svd.singular_values.max(),
            };
            let right = DVector::from_fn(count + numbers, |i, _| if i < count { -off[i] } else { -rows[i - count].1 });
            let Ok(change) = svd.solve(&right, cutoff(&svd)) else {
                return Err(missed(best, "the derivative cannot be inverted"));
            };
            let length = change.norm();
            let is_settled = step > SLOW && length >= 0.25 * last && length <= SETTLED;
            if residual <= CLOSED && (length <= SHORT || is_settled || step + 1 == STEPS) {
                // No step is made along an undetermined direction.
                let cut = cutoff(&svd);
                let decided = svd.singular_values.iter().filter(|value| **value > cut);
                let condition = decided.fold(f64::INFINITY, |least, value| least.min(*value)).recip();
                let tangent = if plane.is_none_or(|plane| plane.goes_on) {
                    *by = exact()?.1;
                    let svd = bordered(by).svd(true, true);
                    let ahead = DVector::from_fn(count + numbers, |i, _| f64::from(u8::from(i == count)));
                    let Ok(tangent) = svd.solve(&ahead, cutoff(&svd)) else {
                        return Err(missed(best, "the branch has no direction here"));
                    };
                    let sign = if plane.is_some() { 1.0 } else { sign };
                    let tangent = &tangent * (sign / tangent.norm());
                    let s = tangent.get(count + 1).copied().unwrap_or_default();
                    Direction { y: tangent.rows(0, count).into_owned(), p: tangent[count], s }
                } else {
                    rows.swap_remove(0).0
                };
                let unit = DMatrix::identity(count, count);
                // Latched states add a multiplier of zero to some orbits, which must not change a sign.
                let (fold, flip) = ((&unit - &reduced).determinant(), (&unit + &reduced).determinant());
                let course = Course::new(&map, &section, period)?;
                let factor = unknowns.reduced(&image.jacobian);
                let orbit = Orbit::of(section, image, (&unknowns, &[factor]), residual, condition);
                let ([value, second], by) = (place, std::mem::take(by));
                return Ok(Node {
                    value,
                    second,
                    phase,
                    shift,
                    orbit,
                    course,
                    unknowns,
                    tangent,
                    by,
                    fold,
                    flip,
                    steps: step,
                });
            }
            let stagnates = residual > 0.5 * best && !(self.is_symmetric && residual <= CLOSED);
            if step > SLOW && stagnates || length > LONGEST {
                return Err(missed(best, "Newton's method does not converge"));
            }
            (best, last) = (best.min(residual), length);
            let from = section.clone();
            let moved = unknowns.lifted(&change.rows(0, count).into_owned());
            section.x.iter_mut().zip(&moved).for_each(|(x, c)| *x += c);
            section.contacts.clone_from(&image.end.contacts);
            before = Some((from, place, image));
            for l in 0..numbers {
                place[l] += change[count + l] * ranges[l];
            }
        }
        Err(missed(best, "Newton's method does not converge"))
    }
}

/// Singular values and vectors.
type Svd = nalgebra::SVD<f64, nalgebra::Dyn, nalgebra::Dyn>;

fn missed(residual: f64, reason: impl Into<String>) -> NewtonFailure {
    NewtonFailure { residual, reason: reason.into() }
}
