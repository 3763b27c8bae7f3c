//! How little of a scene is enough: the same scene at falling fidelity, what each step changes and what it saves.
//!
//! [`Plan`] finds what can be made simpler and which freedoms there are; its [`Plan::advice`] measures the steady motion of
//! every simpler model and compares it with the scene's own. Nothing here reads a clock: costs are counted in steps and
//! events, and [`Rung::advance`] is there to be timed.

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

use ladder::{Ladder, Left, Planned, Rungs};
use measure::{Moments, measure};
use model::{FREEDOMS, Model, Step};
use participation::{Group, Mode, groups};
use verdict::Change;

use super::{
    StudyError,
    figures::Context,
    steady::{Rule, go_on, resumed},
};
use crate::{scene::Scene, task::Task};

/// Groups of freedoms that are tried: of more, those with the smallest share in the motion.
const GROUPS: usize = 24;

/// What can be tried on a scene.
#[derive(Debug)]
pub struct Plan {
    scene: Scene,
    rungs: Vec<Planned>,
    left: Vec<Left>,
    groups: Vec<Group>,
}

/// A model that was measured.
#[derive(Debug, Serialize)]
pub struct Rung {
    /// Its ladder; none of the scene itself and of what takes steps of several ladders.
    pub ladder: Option<Ladder>,
    /// The model in words.
    pub words: String,
    /// What a scene has to say for those of its steps that a scene can say, by JSON pointer.
    pub set: BTreeMap<String, Value>,
    /// Its steady motion, taken up from the scene's own.
    pub motion: Motion,
    /// What changed, by family of contacts.
    pub changes: Vec<Change>,
    /// Whether it is enough.
    pub verdict: Verdict,
    /// Its motion from the scene's own start, if that is another one.
    pub own_start: Option<Motion>,
    #[serde(skip)]
    model: Model,
    #[serde(skip)]
    steps: Vec<Step>,
}

impl Rung {
    /// A model that changes nothing yet.
    fn new(planned: Planned, model: Model, motion: Motion) -> Self {
        let Planned { ladder, words, steps } = planned;
        let set = steps.iter().filter_map(Step::value).map(|(pointer, value)| (pointer.to_owned(), value)).collect();
        let (changes, verdict, own_start) = (Vec::new(), Verdict::Enough, None);
        Self { ladder, words, set, motion, changes, verdict, own_start, model, steps }
    }

    /// Runs `cycles` forcing cycles of the steady motion and keeps nothing: for a clock.
    pub fn advance(&self, cycles: u64) -> Result<(), StudyError> {
        let simulation = &self.model.simulation;
        let start = resumed(simulation, &self.motion.end).map_or_else(|| simulation.start(), Ok)?;
        go_on(&mut simulation.engine(start)?, simulation.clock(), cycles, &mut (), Task::default())
    }

    /// Work of a forcing cycle: freedoms times dense steps, as a step costs more the more freedoms there are.
    #[must_use]
    pub fn work(&self) -> f64 {
        self.motion.freedoms as f64 * self.motion.work.steps
    }

    fn is_enough(&self) -> bool {
        self.verdict == Verdict::Enough
    }

    /// The train that was run.
    #[must_use]
    pub fn spec(&self) -> &crate::system::Spec {
        self.model.simulation.structure.spec()
    }

    /// Largest change of the time without force, forcing periods; with its sign.
    #[must_use]
    pub fn apart_change(&self) -> f64 {
        verdict::largest(self.changes.iter().map(|change| change.apart.value))
    }

    /// Largest change of the peak force, relative; with its sign.
    #[must_use]
    pub fn peak_change(&self) -> Option<f64> {
        let peaks: Vec<f64> = self.changes.iter().filter_map(|change| change.peak).map(|peak| peak.value).collect();
        (!peaks.is_empty()).then(|| verdict::largest(peaks.into_iter()))
    }
}

/// A group of freedoms, what it takes part in, and what holding it changes.
#[derive(Debug, Serialize)]
pub struct Part {
    /// The freedoms.
    #[serde(flatten)]
    pub group: Group,
    /// Share in the kinetic energy of the steady motion; none at rest.
    pub share: Option<f64>,
    /// The train without it.
    pub dropped: Option<Rung>,
}

/// What was found.
#[derive(Debug, Serialize)]
pub struct Advice {
    /// The scene.
    pub scene: String,
    /// Its hash.
    pub scene_sha256: String,
    /// Whether its numbers have no units.
    pub dimensionless: bool,
    /// Forcing period, s.
    pub period_s: f64,
    /// When a transient is over.
    pub rule: Rule,
    /// Change that still counts as none: forcing periods, and share of the peak force.
    pub tolerance: f64,
    /// The scene itself.
    pub full: Rung,
    /// Simpler models.
    pub rungs: Vec<Rung>,
    /// Freedoms by groups.
    pub parts: Vec<Part>,
    /// Families of contacts, as the modes count them.
    pub families: Vec<String>,
    /// Natural modes; empty if `left` says why.
    pub modes: Vec<Mode>,
    /// All steps that are enough, together, if no rung is that already.
    pub together: Option<Rung>,
    /// What could not be made or measured.
    pub left: Vec<Left>,
}

impl Advice {
    /// All measured models: the scene, its rungs, its freedoms held group by group, all steps together.
    pub fn models(&self) -> impl Iterator<Item = &Rung> {
        std::iter::once(&self.full).chain(&self.rungs).chain(self.dropped()).chain(&self.together)
    }

    /// The models that hold one group of freedoms.
    fn dropped(&self) -> impl Iterator<Item = &Rung> {
        self.parts.iter().filter_map(|part| part.dropped.as_ref())
    }

    /// The least model found to be enough: all steps together, or the one that takes the least work.
    #[must_use]
    pub fn least(&self) -> Option<&Rung> {
        let single = || self.rungs.iter().chain(self.dropped()).filter(|rung| rung.is_enough());
        let least = || single().min_by(|a, b| a.work().total_cmp(&b.work()));
        self.together.as_ref().filter(|rung| rung.is_enough()).or_else(least)
    }
}

impl Plan {
    /// Finds what can be tried on `scene`.
    ///
    /// # Errors
    /// [`StudyError::Simulation`] without a forcing period or contacts.
    pub fn new(scene: &Scene) -> Result<Self, StudyError> {
        let Rungs { planned, left, .. } = Rungs::new(scene)?;
        let groups = groups(&scene.built().spec.freedoms);
        Ok(Self { scene: scene.clone(), rungs: planned, left, groups })
    }

    /// Models that will be run, about: what progress is counted in.
    #[must_use]
    pub fn runs(&self) -> usize {
        2 + self.rungs.len() + if self.groups.len() > 1 { self.groups.len().min(GROUPS) } else { 0 }
    }

    /// Measures everything. `tolerance` > 0: the change, in forcing periods of time apart and relative in peak force, that
    /// still counts as none.
    ///
    /// # Errors
    /// [`StudyError`] of the scene's own run; what a simpler model fails with is told in [`Advice::left`].
    pub fn advice(&self, context: &Context<'_>, tolerance: f64) -> Result<Advice, StudyError> {
        let model = Model::new(&self.scene, &[])?;
        let spec = model.simulation.structure.spec().clone();
        let mut moments = Moments::new(spec.freedoms.len());
        let motion = measure(context, &model, None, Some(&mut moments))?;
        context.task.advance();
        let full = Rung::new(Planned { ladder: None, words: "the scene".to_owned(), steps: Vec::new() }, model, motion);
        let covariance = moments.covariance();
        let shares = participation::motion_shares(&spec, &covariance, &self.groups);
        let mut left = self.left.clone();
        let modes = participation::modes(&spec, &covariance, &self.groups).unwrap_or_else(|why| {
            left.push(Left { words: "natural modes".to_owned(), why });
            Vec::new()
        });

        let trial = Trial { scene: &self.scene, context, full: &full, tolerance };
        let held = self.held(shares.as_deref());
        let all: Vec<Planned> =
            self.rungs.iter().cloned().chain(held.iter().map(|(_, planned)| planned.clone())).collect();
        let mut measured = context.each(&all, |planned| trial.measure(planned))?.into_iter();
        let mut rungs = Vec::new();
        for result in measured.by_ref().take(self.rungs.len()) {
            result.map_or_else(|why| left.push(why), |rung| rungs.push(rung));
        }
        let share = |i: usize| shares.as_ref().map(|shares| shares[i]);
        let part = |(i, group): (usize, &Group)| Part { group: group.clone(), share: share(i), dropped: None };
        let mut parts: Vec<Part> = self.groups.iter().enumerate().map(part).collect();
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

    /// Groups to hold, by number, and how.
    fn held(&self, shares: Option<&[f64]>) -> Vec<(usize, Planned)> {
        if self.groups.len() < 2 {
            return Vec::new();
        }
        let mut order: Vec<usize> = (0..self.groups.len()).collect();
        if let Some(shares) = shares.filter(|_| order.len() > GROUPS) {
            order.sort_by(|&a, &b| shares[a].total_cmp(&shares[b]));
        }
        order.truncate(GROUPS);
        order.sort_unstable();
        let planned = |i: usize| Planned {
            ladder: Some(Ladder::Freedoms),
            words: format!("without {}", self.groups[i].words),
            steps: vec![self.dropped(&self.groups[i].freedoms)],
        };
        order.into_iter().map(|i| (i, planned(i))).collect()
    }

    /// The step that drops these freedoms: a planetary stage lets its planets follow the carrier, other trains hold them.
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

/// Measures simpler models.
struct Trial<'a> {
    scene: &'a Scene,
    context: &'a Context<'a>,
    full: &'a Rung,
    tolerance: f64,
}

impl Trial<'_> {
    /// The model, or why there is none.
    fn measure(&self, planned: &Planned) -> Result<Result<Rung, Left>, StudyError> {
        let rung = self.rung(planned);
        self.context.task.advance();
        match rung {
            Err(StudyError::Interrupted) => Err(StudyError::Interrupted),
            Err(error) => Ok(Err(Left { words: planned.words.clone(), why: error.to_string() })),
            Ok(rung) => Ok(Ok(rung)),
        }
    }

    fn rung(&self, planned: &Planned) -> Result<Rung, StudyError> {
        let model = Model::new(self.scene, &planned.steps)?;
        let full = &self.full.motion;
        let seed = model.seed(&self.full.model, &full.end);
        let motion = measure(self.context, &model, Some(&seed), None)?;
        let changes = verdict::changes(full, &motion);
        let verdict = verdict::judge(full, &motion, &changes, self.tolerance);
        // A model that is not enough may have more than one motion: then the start, too, decides.
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

/// What is enough by itself, taken together: of each ladder the lowest rung above which all are enough (every one of the
/// law), and if no rung of the freedoms is, the groups that can be held. None if that is nothing, or a rung already.
fn together(rungs: &[Rung], parts: &[Part], dropped: impl Fn(&[String]) -> Step) -> Option<Planned> {
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
    let needless = |part: &&Part| part.dropped.as_ref().is_some_and(Rung::is_enough);
    let held: Vec<&Part> = parts.iter().filter(|_| freedoms.is_none()).filter(needless).collect();
    // Last, as they change what freedoms there are.
    chosen.extend(freedoms);
    let mut steps: Vec<Step> = chosen.iter().flat_map(|rung| rung.steps.clone()).collect();
    let mut words: Vec<String> = chosen.iter().map(|rung| rung.words.clone()).collect();
    if !held.is_empty() {
        let names: Vec<String> = held.iter().flat_map(|part| part.group.freedoms.clone()).collect();
        steps.push(dropped(&names));
        words.extend(held.iter().map(|part| format!("without {}", part.group.words)));
    }
    (words.len() > 1).then(|| Planned { ladder: Some(Ladder::Freedoms), words: words.join(", "), steps })
}
