//! Points of a branch: orbits on a line in the space of states and parameter.

use nalgebra::{Complex, DMatrix, DVector};

use super::{course::Course, family::Family};
use crate::{
    orbit::{Drift, Missed, Orbit, Section, SectionMap, Unknowns},
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
    /// The orbit.
    pub orbit: Orbit,
    /// What it passes.
    pub course: Course,
    /// The unknowns there.
    pub unknowns: Unknowns,
    /// Unit tangent of the branch.
    pub tangent: Direction,
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
        direction.y.dot(&self.unknowns.between(&self.orbit.section.x, x))
            + direction.p * (value - self.value) / range
    }

    /// The chord to another point of the branch, of length one, and its length.
    pub fn chord(&self, to: &Self, range: f64) -> (Direction, f64) {
        let y = self.unknowns.between(&self.orbit.section.x, &to.orbit.section.x);
        let p = (to.value - self.value) / range;
        let length = y.norm().hypot(p);
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

    fn missed(residual: f64, reason: impl Into<String>) -> Missed {
        Missed { residual, reason: reason.into() }
    }

    fn failed(error: &SimulationError) -> Missed {
        Self::missed(f64::INFINITY, error.to_string())
    }

    /// The point of `orbit`, whose map has its section at phase 0: at the phase that its events are farthest from.
    pub fn start(&self, simulation: &Simulation, value: f64, orbit: &Orbit) -> Result<Node, Missed> {
        let map = SectionMap::new(simulation).map_err(|e| Self::failed(&e))?;
        let course = Course::new(&map, &orbit.section, orbit.period).map_err(|e| Self::failed(&e))?;
        let there = map.at_phase(course.quiet(0.0));
        let section = map.lead(&orbit.section, &there).map_err(|e| Self::failed(&e))?;
        self.at((section, value), orbit.period, there.phase(), None, 1.0)
    }

    /// The same point with its section where its events are farthest from.
    pub fn turned(&self, node: &Node) -> Result<Node, Missed> {
        let simulation = self.family.at(node.value).map_err(|e| Self::failed(&e))?;
        let map = SectionMap::new(&simulation).map_err(|e| Self::failed(&e))?.at_phase(node.phase);
        let there = map.at_phase(node.course.quiet(node.phase));
        let section = map.lead(&node.orbit.section, &there).map_err(|e| Self::failed(&e))?;
        self.at((section, node.value), node.orbit.period, there.phase(), None, node.tangent.p.signum())
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
        let mut best = f64::INFINITY;
        let mut last = f64::INFINITY;
        for step in 0..STEPS {
            let simulation = self.family.at(value).map_err(|e| Self::failed(&e))?;
            let map = SectionMap::new(&simulation).map_err(|e| Self::failed(&e))?.at_phase(phase);
            let variation = self.family.variation(&simulation, value).map_err(|e| Self::failed(&e))?;
            let image = map.image_by(&section, period, &[variation]).map_err(|e| Self::failed(&e))?;
            let unknowns = Unknowns::new(&map, &image, &self.drift);
            let count = unknowns.count();
            if count == 0 {
                return Err(Self::missed(best, "the train drifts as a whole: nothing of its state returns"));
            }
            let off = unknowns.between(&section.x, &image.end.x);
            let reduced = unknowns.reduced(&image.jacobian);
            let by = unknowns.columns(&image.by_number) * range;
            let (row, missing) = match plane {
                Some(plane) => {
                    let row = unknowns.row_of(&plane.from.unknowns, &plane.row.y);
                    (Direction { y: row, p: plane.row.p }, plane.from.along(&plane.row, range, &section.x, value) - plane.target)
                }
                None => (Direction { y: DVector::zeros(count), p: 1.0 }, 0.0),
            };
            let matrix = DMatrix::from_fn(count + 1, count + 1, |i, j| match (i < count, j < count) {
                (true, true) => reduced[(i, j)] - f64::from(u8::from(i == j)),
                (true, false) => by[(i, 0)],
                (false, true) => row.y[j],
                (false, false) => row.p,
            });
            let residual = off.norm().hypot(missing);
            if !residual.is_finite() || matrix.iter().any(|entry| !entry.is_finite()) {
                return Err(Self::missed(best, "the motion leaves the range of numbers"));
            }
            let svd = matrix.svd(true, true);
            let cutoff = self.neutral * svd.singular_values.max();
            let right = DVector::from_fn(count + 1, |i, _| if i < count { -off[i] } else { -missing });
            let Ok(change) = svd.solve(&right, cutoff) else {
                return Err(Self::missed(best, "the derivative cannot be inverted"));
            };
            let length = change.norm();
            let is_done = residual <= CLOSED && (length <= SHORT || step > 1 && length >= 0.25 * last && length <= 1e-8);
            if is_done || step + 1 == STEPS && residual <= CLOSED {
                let ahead = DVector::from_fn(count + 1, |i, _| f64::from(u8::from(i == count)));
                let Ok(tangent) = svd.solve(&ahead, cutoff) else {
                    return Err(Self::missed(best, "the branch has no direction here"));
                };
                let sign = if plane.is_some() { 1.0 } else { sign };
                let tangent = &tangent * (sign / tangent.norm());
                let tangent = Direction { y: tangent.rows(0, count).into_owned(), p: tangent[count] };
                let unit = DMatrix::identity(count, count);
                let (fold, flip) = ((&reduced - &unit).determinant(), (&reduced + &unit).determinant());
                let condition = svd.singular_values.min().recip();
                let course = Course::new(&map, &section, period).map_err(|e| Self::failed(&e))?;
                let orbit = Orbit::of(section, image, &unknowns, period, residual, condition);
                return Ok(Node { value, phase, orbit, course, unknowns, tangent, fold, flip, steps: step });
            }
            if step > 2 && residual > 0.5 * best || length > 10.0 {
                return Err(Self::missed(best, "Newton's method does not converge"));
            }
            (best, last) = (best.min(residual), length);
            let moved = unknowns.lifted(&change.rows(0, count).into_owned());
            section.x.iter_mut().zip(&moved).for_each(|(x, c)| *x += c);
            section.contacts.clone_from(&image.end.contacts);
            if plane.is_some() {
                value += change[count] * range;
            }
        }
        Err(Self::missed(best, "Newton's method does not converge"))
    }
}
