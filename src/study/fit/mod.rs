//! Fit of the numbers of a study to most of its claims.
//!
//! The numbers x, each a share of its range, are sought by the covariance matrix adaptation evolution strategy (CMA-ES; Hansen, 2016),
//! which takes the least of
//!
//! ```text
//! f(x) = Σ losses of the claims that are fitted + Σ penalties of implausible numbers
//! ```
//!
//! A number that is off by the share o loses `o/(o + o₁)`, `o₁` = 0.1, as does a statement with a miss (`off`). Other statements lose 0 if
//! they agree, 0.5 if they do in part, else 1. Claims that are held out, and those that contradict the source's own data, lose nothing. A
//! number outside of its plausible range pays `w²/4`, w the octaves it is outside. If a plot cannot be made all of its claims lose 1. A
//! trial is the mean over the numbers and copies of them that differ by a random share.

mod question;
mod result;

pub use question::{Number, Question};
pub use result::{ClaimCount, ExclusivePair, FitResult, FoundNumber};

use std::{cell::RefCell, collections::HashMap};

use basin::{
    BoundedCmaEs, BoxBounds, ConstraintDescription, ConstraintSet, ConstraintSolveError, Constraints, CostFunction,
    DenseMatrix, Executor,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Context, FigureKind, StudyError, claims::Verdict, plan::Plan, steady::Rule};
use crate::{orbit::Approach, task::Task};

/// Relative difference of a number at half of its loss.
const OFF: f64 = 0.1;
/// Spread at which a search ends, and another one begins elsewhere.
const OVER: f64 = 1e-3;
/// Cycles of a trial until its motion counts as irregular, and cycles measured then, if a trial has separate plots.
const MOST_CYCLES: u64 = 48;
const IRREGULAR_CYCLES: u64 = 24;
/// Loss of numbers without a valid train, for each claim.
const NO_TRAIN: f64 = 2.0;

/// Callback for each trial.
pub type Take<'t> = dyn FnMut(&Trial) -> Result<(), StudyError> + Send + 't;

/// Claim of a study: its plot, and its index among the claims about that plot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ClaimKey {
    pub kind: FigureKind,
    pub number: usize,
    pub place: String,
    pub quantity: String,
    pub is_held_out: bool,
}

/// Set of numbers, with the verdicts on the claims.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Trial {
    /// Values of the numbers, in the order of the question.
    pub values: Vec<f64>,
    /// Loss `f`.
    pub loss: f64,
    /// Verdict on each claim: `a` agrees, `p` in part, `d` deviates, `-` cannot be judged.
    pub verdicts: String,
}

/// Claims of a study and the numbers that are fitted.
pub struct Fit<'p> {
    /// Study with the plots of a trial.
    plan: Plan,
    /// Whole study.
    whole: &'p Plan,
    question: &'p Question,
    pub(super) claims: Vec<ClaimKey>,
    /// Number of random copies of each trial, and the share by which their numbers differ.
    jitter: (usize, f64),
    seed: u64,
    /// Spread of the first trials, as a share of the ranges.
    spread: f64,
}

impl<'p> Fit<'p> {
    /// Returns the fit of a study. Each trial is judged together with random copies, whose numbers differ by up to a share; `jitter` gives
    /// both. The first trials lie within `spread` of the scenes' own numbers, a share of the ranges > 0.
    ///
    /// # Errors
    /// [`StudyError::File`] if the study has no number to find or no claims, or if a number is in none of its scenes;
    /// [`StudyError::Simulation`] if its own numbers, within their ranges, give no valid train.
    pub fn new(plan: &'p Plan, jitter: (usize, f64), seed: u64, spread: f64) -> Result<Self, StudyError> {
        let refused = |why: &str| StudyError::File(why.to_owned());
        let question = plan.question.as_ref().ok_or_else(|| refused("it has no \"fit\" with the numbers to find"))?;
        question.check(plan)?;
        let (plan, whole) = (question.coarse(plan), plan);
        question.put(&plan, &question.values(&question.start(&plan, 0)))?;
        let claims: Vec<ClaimKey> = plan.kinds().into_iter().flat_map(|kind| plan.claims.keys(kind)).collect();
        if claims.iter().all(|claim| claim.is_held_out) {
            return Err(refused("it has no claim that is not held out: nothing to fit to"));
        }
        Ok(Self { plan, whole, question, claims, jitter, seed, spread })
    }

    /// Returns a text that is equal for two runs if they may share trials.
    #[must_use]
    pub fn identity(&self) -> String {
        format!(
            "{:?}",
            (
                self.question,
                self.jitter,
                self.seed,
                self.spread,
                &self.claims,
                &self.plan.sections,
                self.plan.scenes().map(|(_, scene)| scene.hash()).collect::<Vec<_>>()
            )
        )
    }

    /// Tries `count` sets of numbers; those in `known` are not tried again. Calls `take` with every trial in order.
    ///
    /// # Errors
    /// [`StudyError::Interrupted`] once the task is cancelled, and errors of `take`.
    pub fn search(
        &self,
        count: usize,
        known: Vec<Trial>,
        task: Task<'_>,
        take: &mut Take<'_>,
    ) -> Result<Vec<Trial>, StudyError> {
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let known: HashMap<Vec<u64>, Trial> = known.into_iter().map(|trial| (bits(&trial.values), trial)).collect();
        let search = FitSearch { fit: self, count, known, task, trials: RefCell::default(), take: RefCell::new(take) };
        for start in 0.. {
            let solver = BoundedCmaEs::<Vec<f64>, DenseMatrix>::new(self.seed.wrapping_add(start), self.spread)
                .with_absolute_distribution_size_tolerance(OVER);
            let from = self.question.start(&self.plan, start);
            match Executor::from_start(&search, solver, from).max_cost_evals(count as u64).run() {
                Err(ConstraintSolveError::Evaluation(Stop::Enough)) => break,
                Err(ConstraintSolveError::Evaluation(Stop::Failed(error))) => return Err(error),
                // The bounds are 0 and 1, and every loss is a number.
                Err(_) => return Err(StudyError::File("the search cannot go on within these ranges".to_owned())),
                Ok(_) => {}
            }
        }
        Ok(search.trials.into_inner())
    }

    /// Tries one set of numbers.
    ///
    /// # Errors
    /// [`StudyError::Interrupted`].
    pub fn trial(&self, values: &[f64], task: Task<'_>) -> Result<Trial, StudyError> {
        let (mut loss, mut verdicts) = self.judged(values, task)?;
        for copy in 0..self.jitter.0 {
            let moved = self.question.moved(values, self.jitter.1, self.seed, copy as u64);
            let (other, found) = self.judged(&moved, task)?;
            loss += other;
            // A claim is met if it is met by all copies.
            verdicts = verdicts.into_iter().zip(found).map(|(one, other)| worse(one, other)).collect();
        }
        loss /= (self.jitter.0 + 1) as f64;
        Ok(Trial {
            values: values.to_vec(),
            loss: loss + self.question.penalty(values),
            verdicts: verdicts.into_iter().collect(),
        })
    }

    /// Returns loss and verdicts of the claims.
    fn judged(&self, values: &[f64], task: Task<'_>) -> Result<(f64, Vec<char>), StudyError> {
        let mut verdicts = vec!['-'; self.claims.len()];
        let Ok(plan) = self.question.put(&self.plan, values) else {
            return Ok((NO_TRAIN * self.claims.len() as f64, verdicts));
        };
        let mut kinds: Vec<FigureKind> = self.claims.iter().map(|claim| claim.kind).collect();
        kinds.dedup();
        let usual = Rule::default();
        let rule = if plan.is_coarse {
            let approach = Approach { most_cycles: MOST_CYCLES, ..usual.approach };
            Rule { approach, irregular_cycles: IRREGULAR_CYCLES, ..usual }
        } else {
            usual
        };
        let context = Context { rule, task };
        let made: Vec<_> = kinds.par_iter().with_max_len(1).map(|kind| (*kind, plan.make(*kind, &context))).collect();
        let mut losses: Vec<f64> = self.claims.iter().map(|claim| f64::from(u8::from(!claim.is_held_out))).collect();
        for (kind, made) in made {
            let entry = match made {
                Err(StudyError::Interrupted) => return Err(StudyError::Interrupted),
                // A failed motion meets no claim.
                Err(_) => continue,
                Ok(entry) => entry,
            };
            for row in &entry.comparisons {
                let Some(i) = self.claims.iter().position(|claim| (claim.kind, claim.number) == (kind, row.number))
                else {
                    continue;
                };
                let (letter, loss) = match (row.verdict, row.off) {
                    (Verdict::Agrees, None) => ('a', 0.0),
                    (Verdict::Partly, None) => ('p', 0.5),
                    (Verdict::Agrees, Some(off)) => ('a', lost(off)),
                    (Verdict::Partly, Some(off)) => ('p', lost(off)),
                    (Verdict::Deviates, Some(off)) => ('d', lost(off)),
                    (Verdict::Deviates, None) => ('d', 1.0),
                    (Verdict::Contradiction, _) => ('-', 0.0),
                };
                verdicts[i] = letter;
                losses[i] = if self.claims[i].is_held_out { 0.0 } else { loss };
            }
        }
        Ok((losses.iter().sum(), verdicts))
    }
}

/// Returns the loss of a number that is off by a share.
fn lost(off: f64) -> f64 {
    if off.is_finite() { off / (off + OFF) } else { 1.0 }
}

/// Returns the worse one of two verdicts.
fn worse(one: char, other: char) -> char {
    let rank = |letter: char| "apd-".find(letter);
    if rank(one) >= rank(other) { one } else { other }
}

/// Running search.
struct FitSearch<'s, 'p> {
    fit: &'s Fit<'p>,
    count: usize,
    known: HashMap<Vec<u64>, Trial>,
    task: Task<'s>,
    trials: RefCell<Vec<Trial>>,
    take: RefCell<&'s mut Take<'s>>,
}

/// Reason for the end of a search.
enum Stop {
    Enough,
    Failed(StudyError),
}

impl CostFunction for &FitSearch<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Stop;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Stop> {
        if self.trials.borrow().len() >= self.count {
            return Err(Stop::Enough);
        }
        let values = self.fit.question.values(x);
        let key: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
        let trial = match self.known.get(&key) {
            Some(trial) => trial.clone(),
            None => self.fit.trial(&values, self.task.silent()).map_err(Stop::Failed)?,
        };
        (self.take.borrow_mut())(&trial).map_err(Stop::Failed)?;
        self.task.advance();
        let loss = trial.loss;
        self.trials.borrow_mut().push(trial);
        Ok(loss)
    }
}

impl Constraints for &FitSearch<'_, '_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.fit.question.low), Some(&self.fit.question.high)))
    }
}
