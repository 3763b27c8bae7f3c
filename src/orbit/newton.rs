//! Periodic orbits: Newton's method on one section, or on one for each cycle.

use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    Drift, INTERRUPTED, SectionMap,
    section::{Image, Section, SpareEngine, number},
    shooting::{MOST, Shots, cyclic, eigenvalues, pseudo_inverse},
    unknowns::Unknowns,
};
use crate::{simulation::SimulationError, task::Task};

/// Maximum number of Newton steps.
const STEPS: usize = 40;
/// Halvings of a step that makes the residual larger.
const HALVINGS: i32 = 6;
/// Share to which a residual must fall for another step with the same derivative.
const CHORD: f64 = 0.3;
/// Longest step, in scales, and the one after which the method ends.
const LONGEST: f64 = 50.0;
const SHORT: f64 = 1e-13;
/// Residual, in scales, below which an orbit counts as found.
const CLOSED: f64 = 1e-10;
/// Two states nearer than this, in scales, are the same point of an orbit.
pub(crate) const SAME: f64 = 1e-6;
/// Distance of a multiplier from the unit circle that rounding can cause: for a pair of ones, the root of the rounding of 1.
pub(crate) const MARGINAL: f64 = 1e-8;
/// Largest multiplier of a derivative from which a stable orbit is searched for. On the orbit it is below one, and a run that approaches
/// the orbit comes to where it is. Measured on maps of a pair: with one as the limit some orbits of slow decay are not found.
const PARTING: f64 = 2.0;
/// Rounding of a derivative, relative to its largest multiplier, above which its multipliers come from those of its cycles.
const ROUNDED: f64 = 1e-10;
/// Ratio of two multipliers below which the smaller one follows from their product.
const SMALL: f64 = 1e-3;
/// Reason for which a state that returns starts no orbit.
const UNLIKE: &str = "what contacts do at the start of a cycle is not what the cycle before leaves";

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
pub(crate) struct Options<'a> {
    /// Steps in which the residual must fall by half, or the search ends.
    pub patience: Option<usize>,
    /// True if only stable orbits are searched for.
    pub is_stable: bool,
    /// States of known orbits, which the search avoids.
    pub known: &'a [Vec<f64>],
    /// Task whose cancellation ends the search between two steps.
    pub task: Task<'a>,
}

impl Options<'_> {
    /// Returns M at the first of some `sections`, and the change of `ln M` along `step`, for the deflation `M = Π (1 + 1/‖y − y_i‖²)` over
    /// the known states y_i. The residual times M has no zero there (Farrell, Birkisson and Funke 2015).
    fn deflation(&self, shots: &Shots, sections: &[Section], step: Option<&DVector<f64>>) -> [f64; 2] {
        self.known.iter().fold([1.0, 0.0], |[product, change], known| {
            let off = shots.unknowns.between(known, &sections[0].x);
            let square = off.norm_squared();
            let along = step.map_or(0.0, |step| -2.0 * off.dot(&step.rows(0, off.len())) / (square * (square + 1.0)));
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

impl From<SimulationError> for NewtonFailure {
    fn from(error: SimulationError) -> Self {
        Self { residual: f64::INFINITY, reason: error.to_string() }
    }
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
        if let ([large, small], Some(product)) = (&mut multipliers[..], image.log_determinant) {
            if large.norm() < small.norm() {
                std::mem::swap(large, small);
            }
            if large.im == 0.0 && small.norm() < SMALL * large.norm() {
                *small = Complex::new(libm::exp(product - libm::log(large.norm())) * large.re.signum(), 0.0);
            }
        }
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

impl<'s> SectionMap<'s> {
    /// Returns the orbit of `period` cycles near `start`, by Newton's method.
    ///
    /// # Errors
    /// [`NewtonFailure`], if it does not converge.
    pub fn solve(&self, start: &Section, period: u64, drift: &Drift) -> Result<Orbit, NewtonFailure> {
        self.newton(&mut None, (vec![start.clone()], period), drift, Options::default())
    }

    /// Returns the orbit near `trail`, which has a section for each step of the period: for each cycle, unless the map is divided.
    ///
    /// # Errors
    /// [`NewtonFailure`], if Newton's method does not converge, or if the period has more than 600 unknowns.
    pub fn shoot(&self, trail: &[Section], drift: &Drift) -> Result<Orbit, NewtonFailure> {
        self.newton(&mut None, (trail.to_vec(), 1), drift, Options::default())
    }

    /// Returns the orbit near some sections, `cycles` cycles apart, with a `spare` engine.
    pub(super) fn newton(
        &self,
        spare: &mut SpareEngine<'s>,
        (sections, cycles): (Vec<Section>, u64),
        drift: &Drift,
        options: Options<'_>,
    ) -> Result<Orbit, NewtonFailure> {
        let missed = |residual: f64, reason: &str| NewtonFailure { residual, reason: reason.to_owned() };
        if sections.len() > 1 && sections.len() * sections[0].x.len() > MOST {
            return Err(missed(f64::INFINITY, "the period has too many unknowns for multiple shooting"));
        }
        self.repeats()?;
        let mut now = Shots::new((self, spare), (sections, cycles), &[], drift)?;
        let (mut best, first) = (now.residual, now.residual);
        let factors = if options.is_stable { now.factors() } else { Vec::new() };
        let is_finite = factors.iter().flat_map(DMatrix::iter).all(|entry| entry.is_finite());
        if is_finite && eigenvalues(&factors).iter().any(|m| m.norm() > PARTING) {
            return Err(missed(best, "neighbours part too fast for a stable orbit near the end of the run"));
        }
        for step in 0..STEPS {
            if options.task.is_cancelled() {
                return Err(missed(best, INTERRUPTED));
            }
            if options.patience.is_some_and(|steps| step == steps) && now.residual > 0.5 * first {
                return Err(missed(best, "Newton's method does not converge from here"));
            }
            let (step, svd) = now.step().map_err(|reason| missed(best, reason))?;
            // The step of the deflated residual `M F` is a multiple of that of F.
            let [weight, change] = options.deflation(&now, &now.sections, Some(&step));
            let step = step / (1.0 - change);
            let (length, is_closed) = (now.largest(&step), now.residual <= CLOSED);
            if is_closed && length <= SHORT {
                return self.settle(spare, now, drift);
            }
            if length > LONGEST {
                return Err(missed(best, "a step of Newton's method leaves the range of the motion"));
            }
            // The residual needs no derivative. A step along which a small residual falls less than its rounding ends the search.
            let halvings = match options.patience {
                _ if is_closed => 0,
                Some(_) if svd.is_some() => HALVINGS / 3,
                _ => HALVINGS,
            };
            let trial = (0..=halvings).find_map(|halved| {
                let step = &step * 0.5f64.powi(halved);
                let trial = now.moved(&now.sections, &step);
                let there = now.off_at((self, spare), &trial)?;
                let [weight_there, _] = options.deflation(&now, &trial, None);
                (weight_there * now.largest(&there) < weight * now.residual).then_some((trial, there, step, halved))
            });
            let next = trial.and_then(|(mut trial, mut there, mut step, halved)| {
                // Further steps from one section are taken with the same derivative while they reduce the residual enough.
                let svd = svd.filter(|_| halved == 0 && options.known.is_empty());
                let mut inverse = svd.and_then(|svd| pseudo_inverse(svd).ok());
                let (mut before, mut fell) = (now.off.clone(), now.largest(&there) / now.residual);
                while let Some(inverse) = &mut inverse
                    && fell <= CHORD
                    && now.largest(&there) > f64::EPSILON
                {
                    // Broyden's update keeps the inverse up to date along the steps taken.
                    let change = &*inverse * (&there - &before);
                    let along = step.dot(&change);
                    if along.abs() > f64::EPSILON * step.norm_squared() {
                        let row = step.transpose() * &*inverse / along;
                        *inverse += (&step - &change) * row;
                    }
                    step = -(&*inverse * &there);
                    let further = now.moved(&trial, &step);
                    let falls = |off: &DVector<f64>| now.largest(off) < now.largest(&there);
                    let Some(off) = now.off_at((self, spare), &further).filter(falls) else { break };
                    fell = now.largest(&off) / now.largest(&there);
                    (trial, before) = (further, std::mem::replace(&mut there, off));
                }
                Shots::new((self, spare), (trial, cycles), &[], drift).ok()
            });
            match next {
                Some(next) => {
                    best = best.min(next.residual);
                    now = next;
                }
                None if is_closed => return self.settle(spare, now, drift),
                None => return Err(missed(best, "no step of Newton's method makes the residual smaller")),
            }
        }
        if now.residual <= CLOSED {
            return self.settle(spare, now, drift);
        }
        Err(missed(best, "Newton's method does not converge"))
    }

    /// Returns the orbit found, reduced to its smallest period.
    fn settle(&self, spare: &mut SpareEngine<'s>, mut shots: Shots, drift: &Drift) -> Result<Orbit, NewtonFailure> {
        let cycles = shots.cycles;
        if !shots.is_alike() {
            // The states are those of the orbit; the modes of the contacts follow from the motion before them.
            let none = DVector::zeros(shots.off.len());
            shots = Shots::new((self, spare), (shots.moved(&shots.sections, &none), cycles), &[], drift)?;
            if shots.residual.is_nan() || shots.residual > CLOSED || !shots.is_alike() {
                return Err(NewtonFailure { residual: shots.residual, reason: UNLIKE.to_owned() });
            }
        }
        let Shots { sections, whole, unknowns, residual, .. } = &shots;
        let period = whole.between.len();
        let closes = |k: &usize| unknowns.between(&sections[0].x, &whole.between[*k - 1].x).norm() <= SAME;
        if let Some(shorter) = (1..period).filter(|k| period.is_multiple_of(*k)).find(closes) {
            let left = sections[..sections.len().div_ceil(period / shorter)].to_vec();
            let cycles = if cycles == 1 { 1 } else { shorter as u64 };
            return self.newton(spare, (left, cycles), drift, Options::default());
        }
        let mut factors = shots.factors();
        let condition = cyclic(&factors).singular_values().min().recip();
        let rounding = f64::EPSILON * factors.iter().map(DMatrix::norm).fold(0.0, f64::max);
        let largest = || eigenvalues(&factors).iter().map(|m| m.norm()).fold(0.0, f64::max);
        if cycles > 1 && (whole.log_determinant.is_none() || rounding > ROUNDED * largest()) {
            // Multipliers come from the derivative of each cycle: small ones would be lost in their product.
            let starts = sections.iter().chain(&whole.between).take(period).cloned().collect();
            factors = Shots::new((self, spare), (starts, 1), &[], drift)?.factors();
        }
        Ok(Orbit::of(sections[0].clone(), whole.clone(), (unknowns, &factors), *residual, condition))
    }
}
