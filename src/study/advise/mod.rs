//! Sufficient models of a scene: the same scene at falling fidelity, with the change and the saving of each step.
//!
//! [`AdvisePlan`] finds possible simplifications and the groups of freedoms; its [`AdvisePlan::advice`] measures the steady motion of every simpler
//! model and compares it with that of the scene. No function here reads a clock: costs are counted in steps and events, and
//! [`Rung::advance`] allows timing.

mod figures;
mod ladder;
mod measure;
mod model;
mod page;
mod participation;
mod simplify;
#[cfg(test)]
#[path = "../../../tests/unit/advise.rs"]
mod tests;
mod verdict;

pub use measure::Motion;
pub use verdict::Verdict;

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use ladder::{Ladder, Omission, PlannedRung, Rungs};
use measure::{Moments, measure};
use model::{FREEDOMS, Model, Step};
use participation::{FreedomGroup, Mode, groups};
use verdict::FamilyChange;

use super::{
    StudyError,
    figures::Context,
    steady::{Rule, go_on, resumed},
};
use crate::{scene::Scene, task::Task};

/// Maximum number of groups of freedoms that are tried; of more, those with the smallest share in the motion.
const GROUPS: usize = 24;

/// Simplifications that can be tried on a scene.
#[derive(Debug)]
pub struct AdvisePlan {
    scene: Scene,
    rungs: Vec<PlannedRung>,
    left: Vec<Omission>,
    groups: Vec<FreedomGroup>,
}

/// Model that was measured.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Rung {
    /// Ladder of the model, `Freedoms` for all sufficient steps together; none for the scene itself.
    pub ladder: Option<Ladder>,
    /// Name of the model, in words.
    pub words: String,
    /// Values of a scene for those of its steps that a scene can express, by JSON pointer.
    pub set: BTreeMap<String, Value>,
    /// Its steady motion, started from that of the scene.
    pub motion: Motion,
    /// Changes by family of contacts.
    pub changes: Vec<FamilyChange>,
    /// Verdict on whether the model is sufficient.
    pub verdict: Verdict,
    /// Its motion from the start of the scene, if that is another one.
    pub own_start: Option<Motion>,
    #[serde(skip)]
    model: Model,
    #[serde(skip)]
    steps: Vec<Step>,
}

impl Rung {
    /// Returns a model without changes.
    fn new(planned: PlannedRung, model: Model, motion: Motion) -> Self {
        let PlannedRung { ladder, words, steps } = planned;
        let set = steps.iter().filter_map(Step::value).map(|(pointer, value)| (pointer.to_owned(), value)).collect();
        let (changes, verdict, own_start) = (Vec::new(), Verdict::Enough, None);
        Self { ladder, words, set, motion, changes, verdict, own_start, model, steps }
    }

    /// Runs `cycles` forcing cycles of the steady motion without a result, for timing.
    pub fn advance(&self, cycles: u64) -> Result<(), StudyError> {
        let simulation = &self.model.simulation;
        let start = resumed(simulation, &self.motion.end).map_or_else(|| simulation.start(), Ok)?;
        go_on(&mut simulation.engine(start)?, simulation.clock(), cycles, &mut (), Task::default())
    }

    /// Returns the work of a forcing cycle: freedoms times dense steps, as a step costs more the more freedoms there are.
    #[must_use]
    pub fn work(&self) -> f64 {
        self.motion.freedoms as f64 * self.motion.work.steps
    }

    fn is_enough(&self) -> bool {
        self.verdict == Verdict::Enough
    }

    /// Returns the train that was run.
    #[must_use]
    pub fn spec(&self) -> &crate::system::Spec {
        self.model.simulation.structure.spec()
    }

    /// Returns the largest change of the time without force, forcing periods; with its sign.
    #[must_use]
    pub fn apart_change(&self) -> f64 {
        verdict::largest(self.changes.iter().map(|change| change.apart.value))
    }

    /// Returns the largest change of the peak force, relative; with its sign.
    #[must_use]
    pub fn peak_change(&self) -> Option<f64> {
        let peaks: Vec<f64> = self.changes.iter().filter_map(|change| change.peak).map(|peak| peak.value).collect();
        (!peaks.is_empty()).then(|| verdict::largest(peaks.into_iter()))
    }
}

/// Group of freedoms, its share in the motion, and the change from holding it.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Participation {
    /// Freedoms of the group.
    #[serde(flatten)]
    pub group: FreedomGroup,
    /// Share in the kinetic energy of the steady motion; none at rest.
    pub share: Option<f64>,
    /// Train without it.
    pub dropped: Option<Rung>,
}

/// Result of an advice.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Advice {
    /// Name of the scene.
    pub scene: String,
    /// SHA-256 hash of the scene.
    pub scene_sha256: String,
    /// True if its numbers have no units.
    pub dimensionless: bool,
    /// Forcing period, s.
    pub period_s: f64,
    /// Rule for the end of a transient.
    pub rule: Rule,
    /// Largest accepted change: forcing periods, and share of the peak force.
    pub tolerance: f64,
    /// Scene itself.
    pub full: Rung,
    /// Simpler models.
    pub rungs: Vec<Rung>,
    /// Groups of degrees of freedom.
    pub parts: Vec<Participation>,
    /// Families of contacts, in the order of the modes.
    pub families: Vec<String>,
    /// Natural modes; empty if `left` gives the reason.
    pub modes: Vec<Mode>,
    /// All sufficient steps together, if no rung is that already.
    pub together: Option<Rung>,
    /// Models and figures that could not be made or measured.
    pub left: Vec<Omission>,
}

impl Advice {
    /// Returns all measured models: the scene, its rungs, its freedoms held group by group, all steps together.
    pub fn models(&self) -> impl Iterator<Item = &Rung> {
        std::iter::once(&self.full).chain(&self.rungs).chain(self.dropped()).chain(&self.together)
    }

    /// Returns the models that hold one group of freedoms.
    fn dropped(&self) -> impl Iterator<Item = &Rung> {
        self.parts.iter().filter_map(|part| part.dropped.as_ref())
    }

    /// Returns the least sufficient model: all steps together, or the one that takes the least work.
    #[must_use]
    pub fn least(&self) -> Option<&Rung> {
        let single = || self.rungs.iter().chain(self.dropped()).filter(|rung| rung.is_enough());
        let least = || single().min_by(|a, b| a.work().total_cmp(&b.work()));
        self.together.as_ref().filter(|rung| rung.is_enough()).or_else(least)
    }
}

impl AdvisePlan {
    /// Finds the simplifications of `scene`.
    ///
    /// # Errors
    /// [`StudyError::Simulation`] without a forcing period or contacts.
    pub fn new(scene: &Scene) -> Result<Self, StudyError> {
        let Rungs { planned, left, .. } = Rungs::new(scene)?;
        let groups = groups(&scene.built().spec.freedoms);
        Ok(Self { scene: scene.clone(), rungs: planned, left, groups })
    }

    /// Returns the approximate number of models to run, the unit of progress.
    #[must_use]
    pub fn runs(&self) -> usize {
        2 + self.rungs.len() + if self.groups.len() > 1 { self.groups.len().min(GROUPS) } else { 0 }
    }

    /// Measures all models. `tolerance` > 0 is the largest accepted change, in forcing periods of time apart and relative in peak force.
    ///
    /// # Errors
    /// [`StudyError`] of the run of the scene; errors of simpler models are listed in [`Advice::left`].
    pub fn advice(&self, context: &Context<'_>, tolerance: f64) -> Result<Advice, StudyError> {
        let model = Model::new(&self.scene, &[])?;
        let spec = model.simulation.structure.spec().clone();
        let mut moments = Moments::new(spec.freedoms.len());
        let motion = measure(context, &model, None, Some(&mut moments))?;
        context.task.advance();
        let full =
            Rung::new(PlannedRung { ladder: None, words: "the scene".to_owned(), steps: Vec::new() }, model, motion);
        let covariance = moments.covariance();
        let shares = participation::motion_shares(&spec, &covariance, &self.groups);
        let mut left = self.left.clone();
        let modes = participation::modes(&spec, &covariance, &self.groups).unwrap_or_else(|why| {
            left.push(Omission { words: "natural modes".to_owned(), why });
            Vec::new()
        });

        let trial = ModelTrial { scene: &self.scene, context, full: &full, tolerance };
        let held = self.held(shares.as_deref());
        let all: Vec<PlannedRung> =
            self.rungs.iter().cloned().chain(held.iter().map(|(_, planned)| planned.clone())).collect();
        let mut measured = context.each(&all, |planned| trial.measure(planned))?.into_iter();
        let mut rungs = Vec::new();
        for result in measured.by_ref().take(self.rungs.len()) {
            result.map_or_else(|why| left.push(why), |rung| rungs.push(rung));
        }
        let share = |i: usize| shares.as_ref().map(|shares| shares[i]);
        let part =
            |(i, group): (usize, &FreedomGroup)| Participation { group: group.clone(), share: share(i), dropped: None };
        let mut parts: Vec<Participation> = self.groups.iter().enumerate().map(part).collect();
        for ((i, _), result) in held.iter().zip(measured) {
            result.map_or_else(|why| left.push(why), |rung| parts[*i].dropped = Some(rung));
        }

        let mut joined = None;
        if let Some(planned) = together(&rungs, &parts, |names| self.dropped(names)) {
            trial.measure(&planned)?.map_or_else(|why| left.push(why), |rung| joined = Some(rung));
        }
        context.task.advance();
        Ok(Advice {
            scene: self.scene.name().to_owned(),
            scene_sha256: self.scene.hash(),
            dimensionless: full.model.simulation.dimensionless,
            period_s: full.model.simulation.period()?,
            rule: context.rule,
            tolerance,
            families: participation::firsts(&spec).into_iter().map(|(_, family)| family).collect(),
            full,
            rungs,
            parts,
            modes,
            together: joined,
            left,
        })
    }

    /// Returns the groups to hold, by index, each with its rung.
    fn held(&self, shares: Option<&[f64]>) -> Vec<(usize, PlannedRung)> {
        if self.groups.len() < 2 {
            return Vec::new();
        }
        let mut order: Vec<usize> = (0..self.groups.len()).collect();
        if let Some(shares) = shares.filter(|_| order.len() > GROUPS) {
            order.sort_by(|&a, &b| shares[a].total_cmp(&shares[b]));
        }
        order.truncate(GROUPS);
        order.sort_unstable();
        let planned = |i: usize| PlannedRung {
            ladder: Some(Ladder::Freedoms),
            words: format!("without {}", self.groups[i].words),
            steps: vec![self.dropped(&self.groups[i].freedoms)],
        };
        order.into_iter().map(|i| (i, planned(i))).collect()
    }

    /// Returns the step that drops these freedoms: a planetary stage lets its planets follow the carrier, other trains hold them.
    fn dropped(&self, names: &[String]) -> Step {
        let train = &self.scene.resolved()["train"];
        if train["kind"] != "planetary" {
            Step::Hold(names.to_vec())
        } else if train["freedoms"] == "in-phase" {
            Step::Carried(names.to_vec())
        } else {
            let all = self.groups.iter().flat_map(|group| &group.freedoms);
            Step::Set(FREEDOMS, json!(all.filter(|name| !names.contains(name)).collect::<Vec<_>>()))
        }
    }
}

/// Trial of simpler models.
struct ModelTrial<'a> {
    scene: &'a Scene,
    context: &'a Context<'a>,
    full: &'a Rung,
    tolerance: f64,
}

impl ModelTrial<'_> {
    /// Measures a model, or returns the reason for which there is none.
    fn measure(&self, planned: &PlannedRung) -> Result<Result<Rung, Omission>, StudyError> {
        let rung = self.rung(planned);
        self.context.task.advance();
        match rung {
            Err(StudyError::Interrupted) => Err(StudyError::Interrupted),
            Err(error) => Ok(Err(Omission { words: planned.words.clone(), why: error.to_string() })),
            Ok(rung) => Ok(Ok(rung)),
        }
    }

    fn rung(&self, planned: &PlannedRung) -> Result<Rung, StudyError> {
        let model = Model::new(self.scene, &planned.steps)?;
        let full = &self.full.motion;
        let seed = model.seed(&self.full.model, &full.end);
        let motion = measure(self.context, &model, Some(&seed), None)?;
        let changes = verdict::changes(full, &motion);
        let verdict = verdict::judge(full, &motion, &changes, self.tolerance);
        // An insufficient model may have several motions: then the start is tried too.
        let mut own_start = None;
        if verdict != Verdict::Enough && motion.followed {
            let other = measure(self.context, &model, None, None)?;
            let between = verdict::changes(&motion, &other);
            if verdict::judge(&motion, &other, &between, self.tolerance) == Verdict::NotEnough {
                own_start = Some(other);
            }
        }
        Ok(Rung { changes, verdict, own_start, ..Rung::new(planned.clone(), model, motion) })
    }
}

/// Returns all sufficient steps together: of each ladder the lowest rung above which all are sufficient (every one of the law). Without a
/// sufficient rung of the freedoms, adds the groups that can be held. None if fewer than two result.
fn together(rungs: &[Rung], parts: &[Participation], dropped: impl Fn(&[String]) -> Step) -> Option<PlannedRung> {
    let on = |ladder: Ladder| rungs.iter().filter(move |rung| rung.ladder == Some(ladder));
    let lowest = |ladder: Ladder| on(ladder).take_while(|rung| rung.is_enough()).last();
    let mut chosen: Vec<&Rung> = Vec::new();
    for ladder in Ladder::ALL.into_iter().filter(|ladder| *ladder != Ladder::Freedoms) {
        match ladder {
            Ladder::Law => chosen.extend(on(ladder).filter(|rung| rung.is_enough())),
            _ => chosen.extend(lowest(ladder)),
        }
    }
    let freedoms = lowest(Ladder::Freedoms);
    let needless = |part: &&Participation| part.dropped.as_ref().is_some_and(Rung::is_enough);
    let held: Vec<&Participation> = parts.iter().filter(|_| freedoms.is_none()).filter(needless).collect();
    // Last, as they change the set of degrees of freedom.
    chosen.extend(freedoms);
    let mut steps: Vec<Step> = chosen.iter().flat_map(|rung| rung.steps.clone()).collect();
    let mut words: Vec<String> = chosen.iter().map(|rung| rung.words.clone()).collect();
    if !held.is_empty() {
        let names: Vec<String> = held.iter().flat_map(|part| part.group.freedoms.clone()).collect();
        steps.push(dropped(&names));
        words.extend(held.iter().map(|part| format!("without {}", part.group.words)));
    }
    (words.len() > 1).then(|| PlannedRung { ladder: Some(Ladder::Freedoms), words: words.join(", "), steps })
}
