//! Periodic orbits: Newton's method on the section.

use nalgebra::{Complex, DMatrix, DVector};

use super::{
    SectionMap,
    section::{Image, Section},
};
use crate::{simulation::SimulationError, system::Variation};

/// Newton steps at most.
const STEPS: usize = 40;
/// Halvings of a step that makes the residual larger.
const HALVINGS: i32 = 6;
/// Share to which a residual must fall for another step with the same derivative.
const CHORD: f64 = 0.3;
/// Longest step, in scales.
const LONGEST: f64 = 50.0;
/// Residual, in scales, below which an orbit counts as found.
const CLOSED: f64 = 1e-10;
/// Two states nearer than this, in scales, are the same point of an orbit.
pub(super) const SAME: f64 = 1e-6;
/// Distance of a multiplier from the unit circle that rounding may make: that of a pair of ones is the root of a rounding's.
const MARGINAL: f64 = 1e-8;
/// A singular value below this share of the largest one belongs to a direction in which nothing is decided.
const NEUTRAL: f64 = 1e-12;

/// Directions in which a whole train moves without any spring or contact: they do not return, and are left out of the unknowns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drift {
    /// Displacements, orthogonal, `[n]` each.
    pub directions: Vec<Vec<f64>>,
    /// Whether speeds along each are free as well: no damper acts on it.
    pub is_free: Vec<bool>,
}

/// A periodic orbit.
#[derive(Clone, Debug)]
pub struct Orbit {
    /// Period, cycles: the smallest.
    pub period: u64,
    /// Where it starts, at phase 0.
    pub section: Section,
    /// The map over the period.
    pub image: Image,
    /// One for each component of the state, the largest first.
    pub multipliers: Vec<Complex<f64>>,
    /// How many of them are ones of a drift, or of a latched speed that is never written: they say nothing of stability.
    pub neutral: usize,
    /// All others are inside the unit circle.
    pub is_stable: bool,
    /// One of them is so near to the circle that rounding may decide on which side: a train without damping, or a point at which the
    /// motion changes.
    pub is_marginal: bool,
    /// Distance between start and end, in scales.
    pub residual: f64,
    /// `‖(I − J)⁻¹‖` in scales: the state is off by about this times the residual.
    pub condition: f64,
}

/// Why no orbit was found from a start.
#[derive(Clone, Debug, PartialEq)]
pub struct Missed {
    /// The best residual, in scales; infinite where the map could not be evaluated.
    pub residual: f64,
    /// What stopped the search.
    pub reason: String,
}

impl Orbit {
    /// The multiplier of largest size, but those that say nothing of stability.
    #[must_use]
    pub fn largest_multiplier(&self) -> f64 {
        let mut sizes: Vec<f64> = self.multipliers.iter().map(|m| m.norm()).collect();
        for _ in 0..self.neutral {
            let nearest = (0..sizes.len()).min_by(|a, b| (sizes[*a] - 1.0).abs().total_cmp(&(sizes[*b] - 1.0).abs()));
            nearest.map(|i| sizes.remove(i));
        }
        sizes.into_iter().fold(0.0, f64::max)
    }
}

impl SectionMap<'_> {
    /// The drift of the train: null vectors of K that no contact feels.
    #[must_use]
    pub fn drift(&self) -> Drift {
        let spec = self.simulation().structure.spec();
        let n = spec.freedoms.len();
        let weight: Vec<f64> = (0..n).map(|i| spec.mass[(i, i)].sqrt()).collect();
        let stiffest =
            spec.contacts.iter().map(|c| c.stiffness.maximum()).fold(spec.stiffness.amax(), f64::max).max(1e-300);
        let contacts = spec.contacts.len();
        let stacked = DMatrix::from_fn(n + contacts, n, |i, j| {
            let entry =
                if i < n { spec.stiffness[(i, j)] / stiffest / weight[i] } else { spec.contacts[i - n].direction[j] };
            entry / weight[j]
        });
        let svd = stacked.svd(false, true);
        let Some(v) = svd.v_t else { return Drift::default() };
        let largest = svd.singular_values.max();
        let mut drift = Drift::default();
        for (i, value) in svd.singular_values.iter().enumerate() {
            if *value <= 1e-10 * largest {
                let direction: Vec<f64> = v.row(i).iter().zip(&weight).map(|(c, w)| c / w).collect();
                let damped = &spec.damping * DVector::from_column_slice(&direction);
                drift.is_free.push(damped.amax() <= 1e-10 * spec.damping.amax());
                drift.directions.push(direction);
            }
        }
        drift
    }

    /// The scales of the components of the state along a motion: of all displacements, of all velocities, of each latched speed.
    fn scales(&self, image: &Image) -> Vec<f64> {
        let n = self.simulation().structure.freedoms();
        let backlash = self.simulation().structure.spec().contacts.iter().map(|c| c.half_backlash).fold(0.0, f64::max);
        let omega = self.simulation().clock().omega();
        let largest = |sizes: &[f64]| sizes.iter().fold(0.0, |m: f64, s| m.max(*s));
        // Sections alone may find displacements or velocities at zero: each is worth the other times the frequency.
        let (q, v) = (largest(&image.sizes[..n]), largest(&image.sizes[n..2 * n]));
        let q = q.max(v / omega).max(1e-9 * backlash).max(f64::MIN_POSITIVE);
        let v = v.max(omega * q);
        let scale = |i: usize| match i {
            i if i < n => q,
            i if i < 2 * n => v,
            i => image.sizes[i].max(f64::MIN_POSITIVE),
        };
        (0..image.sizes.len()).map(scale).collect()
    }

    /// An orthonormal basis, in scales, of the unknowns: what neither drifts nor stays as it is.
    fn unknowns(&self, image: &Image, drift: &Drift, scales: &[f64]) -> DMatrix<f64> {
        let (n, dim) = (self.simulation().structure.freedoms(), scales.len());
        let mut out: Vec<DVector<f64>> = Vec::new();
        for (direction, is_free) in drift.directions.iter().zip(&drift.is_free) {
            for first in if *is_free { vec![0, n] } else { vec![0] } {
                let mut column = DVector::zeros(dim);
                (0..n).for_each(|i| column[first + i] = direction[i] / scales[first + i]);
                out.push(column);
            }
        }
        for (i, _) in image.latched.iter().enumerate().filter(|(_, latched)| !**latched) {
            out.push(DVector::from_fn(dim, |k, _| if k == 2 * n + i { 1.0 } else { 0.0 }));
        }
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let left_out = out.len();
        for column in out.into_iter().chain((0..dim).map(|i| DVector::from_fn(dim, |k, _| f64::from(u8::from(k == i)))))
        {
            let mut left = column;
            for _ in 0..2 {
                basis.iter().for_each(|b| left -= b * b.dot(&left));
            }
            let norm = left.norm();
            if basis.len() < dim && norm > 1e-6 {
                basis.push(left / norm);
            }
        }
        DMatrix::from_columns(&basis[left_out.min(basis.len())..])
    }

    /// The distance between the ends of an image, in scales, along the unknowns.
    pub(super) fn closure(
        &self,
        start: &Section,
        image: &Image,
        drift: &Drift,
    ) -> (DVector<f64>, DMatrix<f64>, Vec<f64>) {
        let scales = self.scales(image);
        let basis = self.unknowns(image, drift, &scales);
        let off = DVector::from_fn(scales.len(), |i, _| (image.end.x[i] - start.x[i]) / scales[i]);
        (basis.transpose() * off, basis, scales)
    }

    /// The orbit of `period` cycles near `start`, by Newton's method.
    ///
    /// # Errors
    /// [`Missed`], if it does not converge.
    pub fn solve(&self, start: &Section, period: u64, drift: &Drift) -> Result<Orbit, Missed> {
        self.solve_from(start, period, drift, None)
    }

    /// The same; where `patience` is given, the residual must fall by half in as many steps, or the search ends.
    pub(super) fn solve_from(
        &self,
        start: &Section,
        period: u64,
        drift: &Drift,
        patience: Option<usize>,
    ) -> Result<Orbit, Missed> {
        let missed = |residual: f64, reason: &str| Missed { residual, reason: reason.to_owned() };
        let evaluate = |section: &Section| -> Result<_, SimulationError> {
            let image = self.image(section, period)?;
            let (off, basis, scales) = self.closure(section, &image, drift);
            Ok((off.norm(), off, basis, scales, image))
        };
        let halvings = if patience.is_some() { HALVINGS / 3 } else { HALVINGS };
        let mut section = start.clone();
        let mut now = evaluate(&section).map_err(|error| missed(f64::INFINITY, &error.to_string()))?;
        let (mut best, first) = (now.0, now.0);
        for step in 0..STEPS {
            if patience.is_some_and(|steps| step == steps) && now.0 > 0.5 * first {
                return Err(missed(best, "Newton's method does not converge from here"));
            }
            let (residual, off, basis, scales, image) = &now;
            if !residual.is_finite() {
                return Err(missed(best, "the motion leaves the range of numbers"));
            }
            let dim = scales.len();
            let scaled = DMatrix::from_fn(dim, dim, |i, j| image.jacobian[(i, j)] * scales[j] / scales[i]);
            let reduced = basis.transpose() * (scaled - DMatrix::identity(dim, dim)) * basis;
            if reduced.iter().any(|entry| !entry.is_finite()) {
                return Err(missed(best, "the derivative leaves the range of numbers"));
            }
            let svd = reduced.svd(true, true);
            let Ok(step) = svd.solve(&-off, NEUTRAL * svd.singular_values.max()) else {
                return Err(missed(best, "the derivative cannot be inverted"));
            };
            let condition = svd.singular_values.min().recip();
            let length = step.norm();
            if *residual <= CLOSED && (length <= 1e-13 || condition * residual <= 1e-14) {
                return self.settle(section, now, period, drift, condition);
            }
            if length > LONGEST {
                return Err(missed(best, "a step of Newton's method leaves the range of the motion"));
            }
            // The residual needs no derivative: with the same one further steps are taken as long as each is worth it.
            let contacts = &image.end.contacts;
            let off_at = |section: &Section| -> Option<DVector<f64>> {
                let end = self.follow(section, period).ok()?;
                let off = DVector::from_fn(dim, |i, _| (end.x[i] - section.x[i]) / scales[i]);
                Some(basis.transpose() * off).filter(|off| off.norm().is_finite())
            };
            let moved = |from: &Section, step: &DVector<f64>, factor: f64| {
                let full = basis * step;
                let x = (0..dim).map(|i| from.x[i] + factor * full[i] * scales[i]).collect();
                Section { x, contacts: contacts.clone() }
            };
            // A step along which a small residual falls less than its rounding ends the search.
            let halvings = if *residual <= CLOSED { 0 } else { halvings };
            let first = (0..=halvings).find_map(|halved| {
                let trial = moved(&section, &step, 0.5f64.powi(halved));
                let there = off_at(&trial)?;
                (there.norm() < *residual).then_some((trial, there, halved))
            });
            let next = first.and_then(|(mut trial, mut there, halved)| {
                // Broyden's update keeps the inverse up to date along the steps taken.
                let Ok(mut inverse) = svd.clone().pseudo_inverse(NEUTRAL * svd.singular_values.max()) else {
                    return None;
                };
                let (mut step, mut before) = (&step * 0.5f64.powi(halved), off.clone());
                let mut fell = if halved == 0 { there.norm() / residual } else { 1.0 };
                while fell <= CHORD && there.norm() > f64::EPSILON {
                    let change = &inverse * (&there - &before);
                    let along = step.dot(&change);
                    if along.abs() > f64::EPSILON * step.norm_squared() {
                        let row = step.transpose() * &inverse / along;
                        inverse += (&step - &change) * row;
                    }
                    step = -(&inverse * &there);
                    let further = moved(&trial, &step, 1.0);
                    let Some(off) = off_at(&further).filter(|off| off.norm() < there.norm()) else { break };
                    fell = off.norm() / there.norm();
                    (trial, before) = (further, std::mem::replace(&mut there, off));
                }
                evaluate(&trial).ok().map(|there| (trial, there))
            });
            match next {
                Some((trial, there)) => {
                    best = best.min(there.0);
                    (section, now) = (trial, there);
                }
                None if *residual <= CLOSED => return self.settle(section, now, period, drift, condition),
                None => return Err(missed(best, "no step of Newton's method makes the residual smaller")),
            }
        }
        if now.0 <= CLOSED {
            return self.settle(section, now, period, drift, f64::NAN);
        }
        Err(missed(best, "Newton's method does not converge"))
    }

    /// `dx*/dα = (I − J)⁻¹ P_α`: how the start of an orbit moves with numbers of the train, `[dim, count]`; a drifting body stays where it is.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails; [`SimulationError::Missing`] where a multiplier is 1 and the orbit does not go on.
    pub fn orbit_by(&self, orbit: &Orbit, variations: &[Variation]) -> Result<DMatrix<f64>, SimulationError> {
        let image = self.image_by(&orbit.section, orbit.period, variations)?;
        let (_, basis, scales) = self.closure(&orbit.section, &image, &self.drift());
        let dim = scales.len();
        let scaled = DMatrix::from_fn(dim, dim, |i, j| image.jacobian[(i, j)] * scales[j] / scales[i]);
        let moved = DMatrix::from_fn(dim, variations.len(), |i, l| image.by_number[(i, l)] / scales[i]);
        let reduced = basis.transpose() * (DMatrix::identity(dim, dim) - scaled) * &basis;
        let solved = reduced.lu().solve(&(basis.transpose() * moved));
        let solved =
            solved.ok_or_else(|| self.simulation().missing("its orbit has a multiplier 1: it turns back there"))?;
        let full = basis * solved;
        Ok(DMatrix::from_fn(dim, variations.len(), |i, l| full[(i, l)] * scales[i]))
    }

    /// What is known of an orbit that is found; of its smallest period.
    #[allow(clippy::type_complexity)] // what the solver has at hand
    fn settle(
        &self,
        section: Section,
        (residual, _, basis, scales, image): (f64, DVector<f64>, DMatrix<f64>, Vec<f64>, Image),
        period: u64,
        drift: &Drift,
        condition: f64,
    ) -> Result<Orbit, Missed> {
        for shorter in (1..period).filter(|shorter| period.is_multiple_of(*shorter)) {
            let off = DVector::from_fn(scales.len(), |i, _| {
                (image.between[shorter as usize - 1][i] - section.x[i]) / scales[i]
            });
            if (basis.transpose() * off).norm() <= SAME {
                return self.solve(&section, shorter, drift);
            }
        }
        let dim = scales.len();
        let scaled = DMatrix::from_fn(dim, dim, |i, j| image.jacobian[(i, j)] * scales[j] / scales[i]);
        let mut multipliers: Vec<Complex<f64>> = self.reduced_multipliers(&scaled, &basis);
        let neutral = dim - basis.ncols();
        let is_stable = multipliers.iter().all(|m| m.norm() < 1.0);
        let is_marginal = multipliers.iter().any(|m| (m.norm() - 1.0).abs() <= MARGINAL);
        // Zeros are known from the events, and are not computed.
        multipliers.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        multipliers.iter_mut().take(image.zeros).for_each(|m| *m = Complex::new(0.0, 0.0));
        multipliers.extend(std::iter::repeat_n(Complex::new(1.0, 0.0), neutral));
        multipliers.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
        Ok(Orbit { period, section, image, multipliers, neutral, is_stable, is_marginal, residual, condition })
    }

    /// The eigenvalues in the space of the unknowns.
    fn reduced_multipliers(&self, scaled: &DMatrix<f64>, basis: &DMatrix<f64>) -> Vec<Complex<f64>> {
        let reduced = basis.transpose() * scaled * basis;
        reduced.complex_eigenvalues().iter().copied().collect()
    }
}
