//! Periodic orbits: Newton's method on the section.

use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    Drift, INTERRUPTED, SectionMap,
    section::{Image, Section, number},
    shooting::{Shots, eigenvalues},
    unknowns::Unknowns,
};
use crate::{simulation::SimulationError, task::Task};

/// Maximum number of Newton steps.
pub(super) const STEPS: usize = 40;
/// Halvings of a step that makes the residual larger.
pub(super) const HALVINGS: i32 = 6;
/// Share to which a residual must fall for another step with the same derivative.
const CHORD: f64 = 0.3;
/// Longest step, in scales.
pub(super) const LONGEST: f64 = 50.0;
/// Residual, in scales, below which an orbit counts as found.
pub(crate) const CLOSED: f64 = 1e-10;
/// Two states nearer than this, in scales, are the same point of an orbit.
pub(crate) const SAME: f64 = 1e-6;
/// Distance of a multiplier from the unit circle that rounding can cause: for a pair of ones, the root of the rounding of 1.
pub(crate) const MARGINAL: f64 = 1e-8;
/// Share of the largest singular value below which a singular value belongs to an undetermined direction.
const NEUTRAL: f64 = 1e-12;

/// Reason for which a state that returns starts no orbit.
pub(super) const UNLIKE: &str = "what contacts do at the start of a cycle is not what the cycle before leaves";

/// A periodic orbit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Orbit {
    /// Smallest period, cycles.
    pub period: u64,
    /// Start of the orbit, at phase 0.
    pub section: Section,
    /// The map over the period.
    pub image: Image,
    /// One multiplier for each component of the state, the largest first.
    pub multipliers: Vec<Complex<f64>>,
    /// Count of multipliers that are ones of a drift, or of a latched speed that is never written: they do not decide on stability.
    pub neutral: usize,
    /// True if all others are inside the unit circle.
    pub is_stable: bool,
    /// True if a multiplier is so near to the circle that rounding may decide on its side: without damping, or where the motion changes.
    /// Also true if impacts that depend on each other fall on one instant: neighbours that part them have other multipliers, or jump.
    pub is_marginal: bool,
    /// Distance between start and end, in scales.
    pub residual: f64,
    /// Norm `‖(I − J)⁻¹‖` in scales: the error of the state is about this times the residual.
    #[serde(deserialize_with = "number")]
    pub condition: f64,
    /// True if the state half a cycle later is the mirror image, with drive and back flanks exchanged; set by a search.
    pub is_symmetric: bool,
    /// Index of the earlier orbit of a search that a symmetry maps to this one: a mirror image, or an exchange of equal planets.
    pub partner: Option<usize>,
}

/// Options of Newton's method.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Options<'a> {
    /// Steps in which the residual must fall by half, or the search ends.
    pub patience: Option<usize>,
    /// States of known orbits, which the search avoids.
    pub known: &'a [Vec<f64>],
    /// Task whose cancellation ends the search between two steps.
    pub task: Task<'a>,
}

impl Options<'_> {
    /// Returns M at `x`, and the change of `ln M` along `step`, for the deflation `M = Π (1 + 1/‖y − y_i‖²)` over the known states y_i. The
    /// residual times M has no zero there (Farrell, Birkisson and Funke 2015).
    fn deflation(&self, unknowns: &Unknowns, x: &[f64], step: Option<&DVector<f64>>) -> [f64; 2] {
        self.known.iter().fold([1.0, 0.0], |[product, change], known| {
            let off = unknowns.between(known, x);
            let square = off.norm_squared();
            let along = step.map_or(0.0, |step| -2.0 * off.dot(step) / (square * (square + 1.0)));
            [product * (1.0 + square.recip()), change + along]
        })
    }
}

/// Failure of the search for an orbit from a start.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NewtonFailure {
    /// Least residual, in scales; infinite if the map could not be evaluated.
    pub residual: f64,
    /// Reason for the end of the search.
    pub reason: String,
}

impl Orbit {
    /// Returns the orbit through `section`, whose `image` closes; its derivative, in unknowns, is the product of `factors`, the first one
    /// applied first.
    pub(crate) fn of(
        section: Section,
        image: Image,
        (unknowns, factors): (&Unknowns, &[DMatrix<f64>]),
        residual: f64,
        condition: f64,
    ) -> Self {
        let (mut multipliers, period) = (eigenvalues(factors), image.between.len() as u64);
        let neutral = section.x.len() - unknowns.count();
        let is_stable = multipliers.iter().all(|m| m.norm() < 1.0);
        let is_marginal = image.corner.is_some() || multipliers.iter().any(|m| (m.norm() - 1.0).abs() <= MARGINAL);
        // Zeros are known from the events and not computed.
        multipliers.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        multipliers.iter_mut().take(image.zeros).for_each(|m| *m = Complex::new(0.0, 0.0));
        multipliers.extend(std::iter::repeat_n(Complex::new(1.0, 0.0), neutral));
        multipliers.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
        let (is_symmetric, partner) = (false, None);
        Self {
            period,
            section,
            image,
            multipliers,
            neutral,
            is_stable,
            is_marginal,
            residual,
            condition,
            is_symmetric,
            partner,
        }
    }

    /// Returns the multipliers without those that do not decide on stability.
    #[must_use]
    pub fn telling(&self) -> Vec<Complex<f64>> {
        let mut left = self.multipliers.clone();
        for _ in 0..self.neutral {
            let off = |m: &Complex<f64>| (m - Complex::new(1.0, 0.0)).norm();
            let nearest = (0..left.len()).min_by(|a, b| off(&left[*a]).total_cmp(&off(&left[*b])));
            nearest.map(|i| left.remove(i));
        }
        left
    }

    /// Returns the answer to whether it is stable, and an adjective: marginal if no multiplier makes it unstable beyond rounding.
    #[must_use]
    pub fn stability(&self) -> (&'static str, &'static str) {
        match self.is_stable {
            true => ("yes", "stable"),
            false if self.largest_multiplier() <= 1.0 + MARGINAL => ("marginal", "marginal"),
            false => ("no", "unstable"),
        }
    }

    /// Returns the largest absolute value of the multipliers that decide on stability.
    #[must_use]
    pub fn largest_multiplier(&self) -> f64 {
        self.telling().iter().map(|m| m.norm()).fold(0.0, f64::max)
    }
}

impl SectionMap<'_> {
    /// Returns the orbit of `period` cycles near `start`, by Newton's method.
    ///
    /// # Errors
    /// [`NewtonFailure`], if it does not converge.
    pub fn solve(&self, start: &Section, period: u64, drift: &Drift) -> Result<Orbit, NewtonFailure> {
        self.solve_from(start, period, drift, Options::default())
    }

    /// Returns the orbit as [`solve`](Self::solve), with `options`.
    pub(super) fn solve_from(
        &self,
        start: &Section,
        period: u64,
        drift: &Drift,
        options: Options<'_>,
    ) -> Result<Orbit, NewtonFailure> {
        let patience = options.patience;
        let missed = |residual: f64, reason: &str| NewtonFailure { residual, reason: reason.to_owned() };
        self.repeats().map_err(|error| missed(f64::INFINITY, &error.to_string()))?;
        let evaluate = |section: &Section| -> Result<_, SimulationError> {
            let image = self.image(section, period)?;
            let unknowns = Unknowns::new(self, &image, drift);
            let off = unknowns.between(&section.x, &image.end.x);
            Ok((off.norm(), off, unknowns, image))
        };
        let halvings = if patience.is_some() { HALVINGS / 3 } else { HALVINGS };
        let mut section = start.clone();
        let mut now = evaluate(&section).map_err(|error| missed(f64::INFINITY, &error.to_string()))?;
        let (mut best, first) = (now.0, now.0);
        for step in 0..STEPS {
            if options.task.is_cancelled() {
                return Err(missed(best, INTERRUPTED));
            }
            if patience.is_some_and(|steps| step == steps) && now.0 > 0.5 * first {
                return Err(missed(best, "Newton's method does not converge from here"));
            }
            let (residual, off, unknowns, image) = &now;
            if !residual.is_finite() {
                return Err(missed(best, "the motion leaves the range of numbers"));
            }
            let count = unknowns.count();
            if count == 0 {
                return Err(missed(best, "the train drifts as a whole: nothing of its state returns"));
            }
            let reduced = unknowns.reduced(&image.jacobian) - DMatrix::identity(count, count);
            if reduced.iter().any(|entry| !entry.is_finite()) {
                return Err(missed(best, "the derivative leaves the range of numbers"));
            }
            let svd = reduced.svd(true, true);
            let Ok(step) = svd.solve(&-off, NEUTRAL * svd.singular_values.max()) else {
                return Err(missed(best, "the derivative cannot be inverted"));
            };
            let condition = svd.singular_values.min().recip();
            // The step of the deflated residual `M F` is a multiple of that of F.
            let [weight, change] = options.deflation(unknowns, &section.x, Some(&step));
            let step = step / (1.0 - change);
            let length = step.norm();
            if *residual <= CLOSED && (length <= 1e-13 || condition * residual <= 1e-14) {
                return self.settle(section, now, period, drift, condition);
            }
            if length > LONGEST {
                return Err(missed(best, "a step of Newton's method leaves the range of the motion"));
            }
            // The residual needs no derivative: further steps are taken with the same one while they reduce the residual enough.
            let contacts = &image.end.contacts;
            let off_at = |section: &Section| -> Option<DVector<f64>> {
                let end = self.follow(section, period).ok()?;
                Some(unknowns.between(&section.x, &end.x)).filter(|off| off.norm().is_finite())
            };
            let moved = |from: &Section, step: &DVector<f64>, factor: f64| {
                let x = from.x.iter().zip(&unknowns.lifted(step)).map(|(x, change)| x + factor * change).collect();
                Section { x, contacts: contacts.clone() }
            };
            // A step along which a small residual falls less than its rounding ends the search.
            let halvings = if *residual <= CLOSED { 0 } else { halvings };
            let first = (0..=halvings).find_map(|halved| {
                let trial = moved(&section, &step, 0.5f64.powi(halved));
                let there = off_at(&trial)?;
                let [weight_there, _] = options.deflation(unknowns, &trial.x, None);
                (weight_there * there.norm() < weight * *residual).then_some((trial, there, halved))
            });
            let next = first.and_then(|(mut trial, mut there, halved)| {
                // Broyden's update keeps the inverse up to date along the steps taken.
                let Ok(mut inverse) = svd.clone().pseudo_inverse(NEUTRAL * svd.singular_values.max()) else {
                    return None;
                };
                let (mut step, mut before) = (&step * 0.5f64.powi(halved), off.clone());
                let mut fell = if halved == 0 && options.known.is_empty() { there.norm() / residual } else { 1.0 };
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

    /// Returns the orbit found, reduced to its smallest period.
    fn settle(
        &self,
        mut section: Section,
        (mut residual, _, mut unknowns, mut image): (f64, DVector<f64>, Unknowns, Image),
        period: u64,
        drift: &Drift,
        mut condition: f64,
    ) -> Result<Orbit, NewtonFailure> {
        if section.contacts != image.end.contacts {
            // The state is that of the orbit; the modes of the contacts follow from the motion before it.
            section.contacts.clone_from(&image.end.contacts);
            let failed = |error: SimulationError| NewtonFailure { residual, reason: error.to_string() };
            image = self.image(&section, period).map_err(failed)?;
            unknowns = Unknowns::new(self, &image, drift);
            residual = unknowns.between(&section.x, &image.end.x).norm();
            let count = unknowns.count();
            let reduced = unknowns.reduced(&image.jacobian) - DMatrix::identity(count, count);
            condition = reduced.singular_values().min().recip();
            if residual.is_nan() || residual > CLOSED || image.end.contacts != section.contacts {
                return Err(NewtonFailure { residual, reason: UNLIKE.to_owned() });
            }
        }
        for shorter in (1..period).filter(|shorter| period.is_multiple_of(*shorter)) {
            if unknowns.between(&section.x, &image.between[shorter as usize - 1].x).norm() <= SAME {
                return self.solve(&section, shorter, drift);
            }
        }
        let factors = if period == 1 {
            vec![unknowns.reduced(&image.jacobian)]
        } else {
            // Multipliers come from the derivative of each cycle: small ones would be lost in their product.
            let starts = std::iter::once(&section).chain(&image.between).take(period as usize);
            let failed = |error: SimulationError| NewtonFailure { residual, reason: error.to_string() };
            Shots::new(self, starts.cloned().collect(), &[], drift).map_err(failed)?.factors()
        };
        Ok(Orbit::of(section, image, (&unknowns, &factors), residual, condition))
    }
}
