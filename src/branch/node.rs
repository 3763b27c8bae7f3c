//! Points of a branch: orbits on a line in the space of states and parameter.

use nalgebra::{Complex, DMatrix, DVector};

use super::{course::Course, family::Family};
use crate::{
    orbit::{Drift, Image, Missed, Orbit, Section, SectionMap, Unknowns},
    simulation::{Simulation, SimulationError},
};

/// Newton steps at most.
const STEPS: usize = 14;
/// Residual, in scales, below which a point counts.
const CLOSED: f64 = 1e-9;
/// Two states nearer than this, in scales, are the same point of an orbit.
const SAME: f64 = 1e-6;
/// A step of Newton's method this short, in scales, is the last one.
const SHORT: f64 = 1e-13;
/// The same where rounding keeps the steps from getting shorter.
const SETTLED: f64 = 1e-11;
/// Longest step, in scales.
const LONGEST: f64 = 10.0;
/// Steps after which the derivative by the parameter is taken exactly.
const SLOW: usize = 3;
/// Change of the parameter, in ranges, from which on it shows how the ends move with it.
const SECANT: f64 = 1e-6;
/// A singular value below this share of the largest one belongs to a direction in which nothing is decided.
const NEUTRAL: f64 = 1e-11;

/// A direction in the space of unknowns and parameter, the latter in ranges.
#[derive(Clone, Debug)]
pub struct Direction {
    /// Over the unknowns.
    pub y: DVector<f64>,
    /// Along the parameter.
    pub p: f64,
}

/// An orbit at a value of the parameter, and how the branch goes on.
#[derive(Clone, Debug)]
pub struct Node {
    /// The value.
    pub value: f64,
    /// Where its section stands, as a part of the period.
    pub phase: f64,
    /// Cycles by which the next phase 0 comes after the one that the branch's first orbit begins with.
    pub shift: u64,
    /// The orbit.
    pub orbit: Orbit,
    /// What it passes.
    pub course: Course,
    /// The unknowns there.
    pub unknowns: Unknowns,
    /// Unit tangent of the branch.
    pub tangent: Direction,
    /// How the end of the period moves with the parameter, its start held.
    pub by: DVector<f64>,
    /// `det(J − I)` and `det(J + I)` over the unknowns.
    pub fold: f64,
    /// The latter.
    pub flip: f64,
    /// Newton steps that it took.
    pub steps: usize,
}

/// A hyperplane on which a point is looked for: `row · (Y − Y₀) = target`.
pub struct Plane<'n> {
    /// The point Y₀.
    pub from: &'n Node,
    /// Its row, a direction in that point's unknowns.
    pub row: Direction,
    /// Distance from the point.
    pub target: f64,
    /// Whether the tangent at the new point is wanted.
    pub goes_on: bool,
}

impl Node {
    /// Multipliers that tell of stability.
    pub fn multipliers(&self) -> Vec<Complex<f64>> {
        self.orbit.telling()
    }

    /// Multipliers outside the unit circle: real ones above 1, below −1, and complex pairs.
    pub fn unstable(&self) -> [usize; 3] {
        let mut counts = [0; 3];
        for m in self.multipliers().iter().filter(|m| m.norm() > 1.0) {
            counts[if m.im != 0.0 { 2 } else { usize::from(m.re < 0.0) }] += 1;
        }
        counts
    }

    /// Whether the orbit closes after a part of its period already.
    pub fn has_shorter_period(&self) -> bool {
        let Orbit { section, image, period, .. } = &self.orbit;
        let closes = |k: &u64| self.unknowns.between(&section.x, &image.between[*k as usize - 1]).norm() <= SAME;
        (1..*period).filter(|k| period.is_multiple_of(*k)).any(|k| closes(&k))
    }

    /// `Y − Y₀` along a direction of this node.
    pub fn along(&self, direction: &Direction, range: f64, x: &[f64], value: f64) -> f64 {
        direction.y.dot(&self.unknowns.between(&self.orbit.section.x, x)) + direction.p * (value - self.value) / range
    }

    /// The chord to another point of the branch, of length one, and its length.
    pub fn chord(&self, to: &Self, range: f64) -> (Direction, f64) {
        let y = self.unknowns.between(&self.orbit.section.x, &to.orbit.section.x);
        let p = (to.value - self.value) / range;
        let length = libm::hypot(y.norm(), p);
        (Direction { y: y / length, p: p / length }, length)
    }

    /// The guess at a distance along a direction.
    pub fn guess(&self, direction: &Direction, range: f64, distance: f64) -> (Section, f64) {
        let change = self.unknowns.lifted(&direction.y);
        let x = self.orbit.section.x.iter().zip(&change).map(|(x, c)| x + distance * c).collect();
        (Section { x, contacts: self.orbit.section.contacts.clone() }, self.value + distance * direction.p * range)
    }
}

/// Solves for points of a branch.
pub struct Solver<'f> {
    /// The trains.
    pub family: &'f Family,
    /// Their drift.
    pub drift: Drift,
    /// The smallest singular values, as a share of the largest, that Newton's method goes along: larger on a symmetric branch, that the
    /// one that leaves it is left alone.
    pub neutral: f64,
}

impl<'f> Solver<'f> {
    /// Of a family.
    pub fn new(family: &'f Family, drift: Drift) -> Self {
        Self { family, drift, neutral: NEUTRAL }
    }

    /// The point of `orbit`, whose map has its section at phase 0: at the phase that its events are farthest from.
    pub fn start(&self, simulation: &Simulation, value: f64, orbit: &Orbit) -> Result<Node, Missed> {
        let map = SectionMap::new(simulation)?;
        let course = Course::new(&map, &orbit.section, orbit.period)?;
        let there = map.at_phase(course.quiet(0.0));
        let section = map.lead(&orbit.section, &there)?;
        let shift = u64::from(there.phase() > 0.0);
        Ok(Node { shift, ..self.at((section, value), orbit.period, there.phase(), None, 1.0)? })
    }

    /// The same point with its section where its events are farthest from.
    pub fn turned(&self, node: &Node) -> Result<Node, Missed> {
        let simulation = self.family.at(node.value)?;
        let map = SectionMap::new(&simulation)?.at_phase(node.phase);
        let there = map.at_phase(node.course.quiet(node.phase));
        let section = map.lead(&node.orbit.section, &there)?;
        let shift = node.shift + u64::from(there.phase() < node.phase);
        let sign = node.tangent.p.signum();
        Ok(Node { shift, ..self.at((section, node.value), node.orbit.period, there.phase(), None, sign)? })
    }

    /// The orbit of `guess` at its value of the parameter; its tangent goes to where the parameter rises, or falls where `sign` does.
    pub fn at(
        &self,
        guess: (Section, f64),
        period: u64,
        phase: f64,
        plane: Option<&Plane<'_>>,
        sign: f64,
    ) -> Result<Node, Missed> {
        let range = self.family.range();
        let (mut section, mut value) = guess;
        let (mut best, mut last) = (f64::INFINITY, f64::INFINITY);
        // How the ends move with the parameter: as at the point before, and as the steps show. Only the way to the point depends on it.
        let mut by = plane.map_or_else(|| DVector::zeros(section.x.len()), |plane| plane.from.by.clone());
        let mut before: Option<(Section, f64, Image)> = None;
        for step in 0..STEPS {
            let simulation = self.family.at(value)?;
            let map = SectionMap::new(&simulation)?.at_phase(phase);
            let is_slow = step >= SLOW && plane.is_some();
            let image = if is_slow {
                let variation = self.family.variation(&simulation, value)?;
                map.image_by(&section, period, &[variation])?
            } else {
                map.image(&section, period)?
            };
            if is_slow {
                by = image.by_number.column(0).into_owned();
            } else if let Some((from, at, old)) = before.take().filter(|(_, at, _)| (value - at).abs() > SECANT * range)
            {
                let moved = DVector::from_fn(by.len(), |i, _| section.x[i] - from.x[i]);
                let explained = &old.jacobian * moved;
                by = DVector::from_fn(by.len(), |i, _| (image.end.x[i] - old.end.x[i] - explained[i]) / (value - at));
            }
            let unknowns = Unknowns::new(&map, &image, &self.drift);
            let count = unknowns.count();
            if count == 0 {
                return Err(missed(best, "the train drifts as a whole: nothing of its state returns"));
            }
            let off = unknowns.between(&section.x, &image.end.x);
            let reduced = unknowns.reduced(&image.jacobian);
            let (row, missing) = match plane {
                Some(plane) => {
                    let row = unknowns.row_of(&plane.from.unknowns, &plane.row.y);
                    let along = plane.from.along(&plane.row, range, &section.x, value);
                    (Direction { y: row, p: plane.row.p }, along - plane.target)
                }
                None => (Direction { y: DVector::zeros(count), p: 1.0 }, 0.0),
            };
            let bordered = |by: &DVector<f64>| {
                let column = unknowns.columns(&DMatrix::from_column_slice(by.len(), 1, by.as_slice())) * range;
                DMatrix::from_fn(count + 1, count + 1, |i, j| match (i < count, j < count) {
                    (true, true) => reduced[(i, j)] - f64::from(u8::from(i == j)),
                    (true, false) => column[(i, 0)],
                    (false, true) => row.y[j],
                    (false, false) => row.p,
                })
            };
            let matrix = bordered(&by);
            let residual = libm::hypot(off.norm(), missing);
            if !residual.is_finite() || matrix.iter().any(|entry| !entry.is_finite()) {
                return Err(missed(best, "the motion leaves the range of numbers"));
            }
            let svd = matrix.svd(true, true);
            let cutoff = |svd: &Svd| self.neutral * svd.singular_values.max();
            let right = DVector::from_fn(count + 1, |i, _| if i < count { -off[i] } else { -missing });
            let Ok(change) = svd.solve(&right, cutoff(&svd)) else {
                return Err(missed(best, "the derivative cannot be inverted"));
            };
            let length = change.norm();
            let is_settled = step > SLOW && length >= 0.25 * last && length <= SETTLED;
            if residual <= CLOSED && (length <= SHORT || is_settled || step + 1 == STEPS) {
                let condition = svd.singular_values.min().recip();
                let tangent = if plane.is_none_or(|plane| plane.goes_on) {
                    let variation = self.family.variation(&simulation, value)?;
                    let exact = map.image_by(&section, period, &[variation])?;
                    by = exact.by_number.column(0).into_owned();
                    let svd = bordered(&by).svd(true, true);
                    let ahead = DVector::from_fn(count + 1, |i, _| f64::from(u8::from(i == count)));
                    let Ok(tangent) = svd.solve(&ahead, cutoff(&svd)) else {
                        return Err(missed(best, "the branch has no direction here"));
                    };
                    let sign = if plane.is_some() { 1.0 } else { sign };
                    let tangent = &tangent * (sign / tangent.norm());
                    Direction { y: tangent.rows(0, count).into_owned(), p: tangent[count] }
                } else {
                    row
                };
                let unit = DMatrix::identity(count, count);
                let (fold, flip) = ((&reduced - &unit).determinant(), (&reduced + &unit).determinant());
                let course = Course::new(&map, &section, period)?;
                let orbit = Orbit::of(section, image, &unknowns, period, residual, condition);
                let shift = plane.map_or(0, |plane| plane.from.shift);
                return Ok(Node { value, phase, shift, orbit, course, unknowns, tangent, by, fold, flip, steps: step });
            }
            if step > SLOW && residual > 0.5 * best || length > LONGEST {
                return Err(missed(best, "Newton's method does not converge"));
            }
            (best, last) = (best.min(residual), length);
            let from = section.clone();
            let moved = unknowns.lifted(&change.rows(0, count).into_owned());
            section.x.iter_mut().zip(&moved).for_each(|(x, c)| *x += c);
            section.contacts.clone_from(&image.end.contacts);
            before = Some((from, value, image));
            if plane.is_some() {
                value += change[count] * range;
            }
        }
        Err(missed(best, "Newton's method does not converge"))
    }
}

/// Singular values and vectors.
type Svd = nalgebra::SVD<f64, nalgebra::Dyn, nalgebra::Dyn>;

fn missed(residual: f64, reason: impl Into<String>) -> Missed {
    Missed { residual, reason: reason.into() }
}

impl From<SimulationError> for Missed {
    fn from(error: SimulationError) -> Self {
        missed(f64::INFINITY, error.to_string())
    }
}
