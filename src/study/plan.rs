//! Plan of a study: its plots, each with its scene and its values.

use serde_json::{Map, Value, json};

use super::{
    FigureKind, StudyError,
    changes::Changes,
    claims::{Claims, Comparison, Points},
    figures::{self, Context, ModeRow, Quantity, fraction_title},
    file::{Plot, Section, StudyFile},
    fit::Question,
    questions::Questions,
    steady::ContactSteady,
    threshold::{LossCriterion, Threshold, ThresholdSearch, locate},
    values::ReferenceRuns,
};
use crate::{
    output::Table,
    plot::{Figure, Guide, Panel, Series, Style},
    scene::{Scene, SceneError},
};

/// Result of one plot.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Entry {
    /// Figure of the plot, if it has one.
    pub figure: Option<Figure>,
    /// Scene of the plot, in words, and its hash.
    pub scene: [String; 2],
    /// Published numbers beside Flank's, if a study has claims.
    pub comparisons: Vec<Comparison>,
    /// Table of numbers, if it has one.
    pub listing: Option<Table>,
}

/// Study: scenes, plots of them, and claims about these.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Title of its page.
    pub title: String,
    /// Scenes by name.
    pub(super) scenes: Vec<(String, Scene)>,
    /// Sections of its page, with their plots.
    pub sections: Vec<Section>,
    /// Published claims about it.
    pub claims: Claims,
    /// Pointer of the load that is varied, if it is not the train's usual one.
    pub load: Option<String>,
    /// Pointer of the speed that is varied, if it is not the train's usual one.
    pub speed: Option<String>,
    /// Numbers that `flank fit` finds.
    pub(super) question: Option<Question>,
    /// True for a trial of a fit: few values, cold starts alone, thresholds to 1 % of the loads.
    pub(super) is_coarse: bool,
}

/// Maximum number of speeds at which thresholds are sought: each takes some twenty runs.
const THRESHOLDS: usize = 20;
/// Width of a threshold's bracket, as a share of the loads: of a study, and of a trial of a fit.
const FINE: f64 = 2.5e-4;
const COARSE: f64 = 1e-2;
/// Maximum number of speeds of a waterfall.
const LINES: usize = 60;
/// Cycles after which a floating motion counts as irregular without a longer run.
const FLOATING_CYCLES: u64 = 300;
/// Default highest frequency of spectra and modes, in mesh frequencies.
const HIGHEST: f64 = 7.0;

impl Plan {
    /// Returns the study of the reference planetary set, with its published numbers.
    ///
    /// # Errors
    /// [`StudyError`] never: scenes and claims are part of the library.
    pub fn reference() -> Result<Self, StudyError> {
        StudyFile::reference()?.plan()
    }

    /// Returns the same with one set of numbers for all figures, preset `reference`, and the ranges in which `flank fit` found them.
    ///
    /// # Errors
    /// [`StudyError`] never: they are part of the library.
    pub fn one_set() -> Result<Self, StudyError> {
        StudyFile::one_set()?.plan()
    }

    /// Returns the plan in a file, whose text is `text`; `read` returns the text of each file that it names.
    ///
    /// # Errors
    /// [`StudyError::File`] for a text that is no study.
    pub fn read(text: &str, read: &dyn Fn(&str) -> Result<String, String>) -> Result<Self, StudyError> {
        StudyFile::read(text, read)?.plan()
    }

    /// Returns plots of any scene. Loads and speeds range from zero (or a tenth) to twice the scene's own. A plot without the necessary
    /// freedoms is refused on request.
    ///
    /// # Errors
    /// [`StudyError`] never: the plan is part of the library.
    pub fn of(scene: &Scene) -> Result<Self, StudyError> {
        let any = StudyFile::any()?.plan()?;
        let name = scene.given()["name"].as_str().unwrap_or(scene.name());
        Ok(Self { title: format!("Study of {name}"), scenes: vec![("scene".to_owned(), scene.clone())], ..any })
    }

    pub(super) fn new(file: StudyFile, scenes: Vec<(String, Scene)>, claims: Claims) -> Self {
        let StudyFile { title, sections, load, speed, fit, .. } = file;
        Self { title, scenes, sections, claims, load, speed, question: fit.map(Question::bounded), is_coarse: false }
    }

    /// Returns its scenes with their names.
    pub fn scenes(&self) -> impl Iterator<Item = (&str, &Scene)> {
        self.scenes.iter().map(|(name, scene)| (name.as_str(), scene))
    }

    /// Returns the same study at other loads and speeds, if any are given; in rising order.
    #[must_use]
    pub fn varied(mut self, loads: Option<Vec<f64>>, speeds: Option<Vec<f64>>) -> Self {
        let (loads, speeds) = (loads.map(risen), speeds.map(risen));
        for plot in self.sections.iter_mut().flat_map(|section| &mut section.plots) {
            let values = match plot.kind {
                FigureKind::ApartVsLoad => loads.clone(),
                FigureKind::Harmonics | FigureKind::ApartVsSpeed => speeds.clone(),
                FigureKind::Waterfall => speeds.as_ref().map(|speeds| thinned(speeds, LINES)),
                FigureKind::ThresholdVsSpeed => speeds.as_ref().map(|speeds| thinned(speeds, THRESHOLDS)),
                _ => None,
            };
            plot.values = values.or_else(|| plot.values.take());
        }
        self
    }

    /// Returns the kinds of its plots.
    #[must_use]
    pub fn kinds(&self) -> Vec<FigureKind> {
        let all = self.sections.iter().flat_map(|section| &section.plots);
        all.map(|plot| plot.kind).collect()
    }

    /// Returns the scene called `name`, or the only one.
    pub(super) fn scene(&self, name: &str) -> Result<&Scene, StudyError> {
        let named = self.scenes.iter().find(|(known, _)| known == name);
        named.map(|(_, scene)| scene).ok_or_else(|| {
            let names: Vec<&str> = self.scenes.iter().map(|(name, _)| name.as_str()).collect();
            StudyError::File(format!("scenes: no scene {name:?}; it has {}", names.join(", ")))
        })
    }

    pub(super) fn plot(&self, kind: FigureKind) -> Result<&Plot, StudyError> {
        let plot = self.sections.iter().flat_map(|section| &section.plots).find(|plot| plot.kind == kind);
        plot.ok_or_else(|| {
            let ids: Vec<&str> = self.kinds().into_iter().map(FigureKind::id).collect();
            StudyError::File(format!("this study has no {}; it has {}", kind.id(), ids.join(", ")))
        })
    }

    /// Returns the load of a scene, the study's own or the train's usual one.
    pub(super) fn load(&self, scene: &Scene) -> Result<Quantity, StudyError> {
        figures::quantity(scene, self.load.as_deref(), figures::load).ok_or_else(|| lacks(scene, "load"))
    }

    /// Returns the speed of a scene, the study's own or the train's usual one.
    pub(super) fn speed(&self, scene: &Scene) -> Result<Quantity, StudyError> {
        figures::quantity(scene, self.speed.as_deref(), figures::speed).ok_or_else(|| lacks(scene, "speed"))
    }

    /// Returns the values of a plot: the plan's, or those that fit the scene's own.
    fn values(&self, plot: &Plot, scene: &Scene) -> Vec<f64> {
        if let Some(values) = &plot.values {
            return values.clone();
        }
        let own = |quantity: Result<Quantity, StudyError>| {
            quantity.ok().and_then(|quantity| figures::number(scene, &quantity.pointer).ok())
        };
        let speeds = || own(self.speed(scene)).map_or_else(Vec::new, |speed| evenly(0.1 * speed, 2.0 * speed, 39));
        match plot.kind {
            FigureKind::ApartVsLoad => own(self.load(scene)).map_or_else(Vec::new, |load| match load {
                0.0 => evenly(0.0, 40.0, 41),
                load => evenly(0.0, 2.0 * load, 41),
            }),
            FigureKind::Harmonics | FigureKind::ApartVsSpeed => speeds(),
            FigureKind::Waterfall => thinned(&speeds(), LINES),
            FigureKind::ThresholdVsSpeed => thinned(&speeds(), THRESHOLDS),
            FigureKind::Cycles => own(self.load(scene)).into_iter().collect(),
            _ => own(self.speed(scene)).into_iter().collect(),
        }
    }

    /// Returns the errors of the scenes at loads and speeds that they do not allow.
    #[must_use]
    pub fn refused(&self) -> Vec<SceneError> {
        let mut refused = Vec::new();
        for plot in self.sections.iter().flat_map(|section| &section.plots) {
            let Ok(scene) = self.scene(&plot.scene) else { continue };
            let varied = match plot.kind {
                FigureKind::ApartVsLoad | FigureKind::Cycles => self.load(scene),
                FigureKind::Harmonics
                | FigureKind::ApartVsSpeed
                | FigureKind::Waterfall
                | FigureKind::ThresholdVsSpeed => self.speed(scene),
                _ => continue,
            };
            let Ok(Quantity { pointer, .. }) = varied else { continue };
            let values = self.values(plot, scene);
            refused.extend(values.into_iter().filter_map(|value| scene.with(&pointer, json!(value)).err()));
        }
        refused
    }

    /// Returns the approximate number of scenes run for a plot, the unit of progress.
    #[must_use]
    pub fn runs(&self, kind: FigureKind) -> usize {
        let Ok(plot) = self.plot(kind) else { return 0 };
        let count = self.scene(&plot.scene).map_or(0, |scene| self.values(plot, scene).len());
        match kind {
            FigureKind::Forces | FigureKind::History | FigureKind::Modes => 1,
            FigureKind::Values | FigureKind::Identification => 160,
            FigureKind::Changes => 18 * 22,
            FigureKind::Waterfall | FigureKind::Harmonics | FigureKind::Cycles | FigureKind::Trajectories => count,
            FigureKind::ApartVsLoad => 3 * count + 20,
            FigureKind::ApartVsSpeed => 3 * count,
            FigureKind::ThresholdVsSpeed => 20 * count,
        }
    }

    /// Makes a plot.
    ///
    /// # Errors
    /// [`StudyError`] of the runs, or of a scene without data for the plot; [`StudyError::Interrupted`] once the task is cancelled.
    pub fn make(&self, kind: FigureKind, context: &Context<'_>) -> Result<Entry, StudyError> {
        if context.task.is_cancelled() {
            return Err(StudyError::Interrupted);
        }
        let plot = self.plot(kind)?;
        let scene = self.scene(&plot.scene)?;
        let values = self.values(plot, scene);
        let highest = plot.highest_hz.unwrap_or(HIGHEST / scene.built().run.period.unwrap_or(HIGHEST));
        let entry = |figure: Option<Figure>, words: &str, facts: Value| {
            Ok::<_, StudyError>(Entry {
                figure,
                scene: [format!("{}{}{words}", scene.name(), if words.is_empty() { "" } else { ", " }), scene.hash()],
                listing: None,
                comparisons: self.compared(kind, facts)?,
            })
        };
        let listed = |listing: Table, words: &str| {
            Ok::<_, StudyError>(Entry { listing: Some(listing), ..entry(None, words, Value::Null)? })
        };
        let hasty = Context { rule: floating(context), ..*context };
        Ok(match kind {
            FigureKind::Modes => {
                let (figure, rows) = figures::modes(scene, highest)?;
                let named = |row: &ModeRow| {
                    let (part, share) = row.shares.first()?;
                    Some((row.name.clone(), json!({ "hertz": row.hertz, "part": part, "share": share })))
                };
                let facts: Map<String, Value> = rows.iter().filter_map(named).collect();
                Entry { listing: Some(figures::listing(&rows)), ..entry(figure, "all freedoms", facts.into())? }
            }
            FigureKind::Identification => {
                let questions: Questions = plot.table()?;
                listed(questions.identified(|name| self.scene(name), context.task)?, "all freedoms")?
            }
            FigureKind::Forces => {
                let (figure, facts) = figures::forces(context, scene, highest)?;
                entry(Some(figure), "", facts.into())?
            }
            FigureKind::Waterfall => {
                let modes = figures::modes(self.scene(plot.modes_of.as_deref().unwrap_or(&plot.scene))?, highest);
                let natural = modes.map_or_else(|_| Vec::new(), |(_, rows)| rows);
                let (figure, facts) =
                    figures::waterfall(context, scene, (&self.speed(scene)?, &values), &natural, highest)?;
                entry(Some(figure), "speed varied", facts.into())?
            }
            FigureKind::Harmonics => {
                let (figure, facts) = figures::harmonics(context, scene, (&self.speed(scene)?, &values))?;
                entry(Some(figure), "speed varied", facts.into())?
            }
            FigureKind::Cycles => {
                let varied = [self.load(scene).ok(), self.speed(scene).ok()];
                let (figure, found) = figures::cycles(context, scene, varied, &values)?;
                entry(Some(figure), "load varied", found.into())?
            }
            FigureKind::ApartVsLoad => {
                let (figure, facts) = self.by_load(context, scene, &values)?;
                entry(Some(figure), "load varied", facts)?
            }
            FigureKind::ApartVsSpeed => {
                let (mut figure, curves) =
                    figures::apart(context, scene, (kind.id(), self.is_coarse), (&self.speed(scene)?, &values))?;
                self.publish(&mut figure, &last_family(scene)?);
                entry(Some(figure), "speed varied", figures::facts(&curves, &values))?
            }
            FigureKind::ThresholdVsSpeed => {
                let (stem, varied) = (last_family(scene)?, [self.load(scene)?, self.speed(scene)?]);
                let (figure, facts) =
                    figures::threshold(context, scene, &stem, (&varied, &values), &self.search(scene))?;
                entry(Some(figure), "speed and load varied", facts)?
            }
            FigureKind::Changes => {
                let changes: Changes = plot.table()?;
                let varied = [self.load(scene)?, self.speed(scene)?];
                let effects = changes.effects(context, scene, (&varied, &values), &self.search(scene))?;
                listed(changes.listing(&effects, (&varied, &values)), "numbers varied")?
            }
            FigureKind::Values => {
                let table: ReferenceRuns = plot.table()?;
                listed(table.compared(context, self)?, "and others")?
            }
            FigureKind::Trajectories => {
                let (figure, found) = figures::trajectories(&hasty, scene, (self.speed(scene).ok().as_ref(), &values))?;
                entry(Some(figure), "speed varied", found.into())?
            }
            FigureKind::History => {
                let (scene, words) = match (self.speed(scene), values.first()) {
                    (Ok(speed), Some(value)) => {
                        (scene.with(&speed.pointer, json!(value))?, format!("{value} {}", speed.axis.unit))
                    }
                    _ => (scene.clone(), String::new()),
                };
                let first = scene.built().spec.freedoms.first().cloned().unwrap_or_default();
                let (figure, facts) = figures::history(&hasty, &scene, &first)?;
                entry(Some(figure), &words, facts)?
            }
        })
    }

    /// Compares the claims about a plot with its measures. In a trial of a fit, `coarse` is true in them. In a study with numbers to find,
    /// a claim is fitted if a trial judges it.
    fn compared(&self, kind: FigureKind, mut facts: Value) -> Result<Vec<Comparison>, StudyError> {
        if let Value::Object(facts) = &mut facts {
            facts.insert("coarse".to_owned(), self.is_coarse.into());
        }
        let mut rows = self.claims.compare(kind.id(), facts)?;
        if let Some(question) = &self.question {
            let is_fitted = |row: &Comparison| {
                let mut keys = self.claims.keys(kind);
                question.makes(kind) && keys.any(|key| key.number == row.number && !key.is_held_out)
            };
            rows.iter_mut().for_each(|row| row.fitted = is_fitted(row));
        }
        Ok(rows)
    }

    fn by_load(&self, context: &Context<'_>, scene: &Scene, loads: &[f64]) -> Result<(Figure, Value), StudyError> {
        let load = self.load(scene)?;
        let (mut figure, curves) =
            figures::apart(context, scene, (FigureKind::ApartVsLoad.id(), self.is_coarse), (&load, loads))?;
        let stem = last_family(scene)?;
        // The grid gives the range of the search: between its last load at which contact is lost and the next one.
        let find = |by: LossCriterion, time: fn(&ContactSteady) -> f64| {
            let last = figures::along(&curves[0], &stem, time).iter().rposition(|time| *time > 0.0);
            let bracket = last.and_then(|i| Some([loads[i], *loads.get(i + 1)?]));
            match bracket {
                Some(range) => {
                    let search = ThresholdSearch { range, scan: 2, ..self.search(scene) };
                    locate(context, scene, &load.pointer, (&stem, by), &search)
                }
                None => Ok(last.map_or(Threshold::None, |i| Threshold::Beyond { value: loads[i] })),
            }
        };
        let deflection = find(LossCriterion::Deflection, |c| c.report.apart_time)?;
        let force = find(LossCriterion::Force, |c| c.report.no_force_time)?;
        if let Some(panel) = fraction_panel(&mut figure, &stem) {
            for (threshold, words) in [(deflection, "between the flanks"), (force, "without force")] {
                let guide = |x: f64| Guide::Vertical { x, name: format!("{words} up to {x:.2} {}", load.axis.unit) };
                panel.guides.extend(threshold.located().map(guide));
            }
        }
        self.publish(&mut figure, &stem);
        let mut facts = figures::facts(&curves, loads);
        facts["threshold"] = json!({ "deflection": deflection, "force": force });
        Ok((figure, facts))
    }

    /// Returns the range of loads in which thresholds of a scene are sought.
    pub(super) fn search(&self, scene: &Scene) -> ThresholdSearch {
        let loads = self.plot(FigureKind::ApartVsLoad).map_or_else(|_| Vec::new(), |plot| self.values(plot, scene));
        let ends = |pick: fn(f64, f64) -> f64, start: f64| loads.iter().copied().fold(start, pick);
        let (low, high) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
        // Thresholds reach beyond the loads of interest at resonances.
        let high = low + 1.5 * (high - low);
        ThresholdSearch {
            range: [low, high],
            scan: 13,
            resolution: if self.is_coarse { COARSE } else { FINE } * (high - low),
        }
    }

    /// Adds published times without force to the panel of a family.
    fn publish(&self, figure: &mut Figure, family: &str) {
        let points = self.claims.points(&figure.id).cloned();
        if let (Some(Points { x, y }), Some(panel)) = (points, fraction_panel(figure, family)) {
            panel.series.push(Series { name: "published".to_owned(), x, y, style: Style::Points, colour: 6 });
        }
    }

    /// Returns the contradictions within the source, by its own data.
    ///
    /// # Errors
    /// [`StudyError::Claim`] for a claim that cannot be evaluated.
    pub fn contradictions(&self) -> Result<Vec<Comparison>, StudyError> {
        let trains = self.scenes.iter().map(|(name, scene)| (name.clone(), scene.resolved()["train"].clone()));
        self.claims.compare("contradictions", Value::Object(trains.collect()))
    }
}

/// Returns the family of contacts whose loss of contact is studied: the last one, such as the ring's in a planetary stage.
fn last_family(scene: &Scene) -> Result<String, StudyError> {
    let missing = || StudyError::missing(scene.name(), "it has no contact");
    let last = scene.built().spec.contacts.last().ok_or_else(missing)?;
    Ok(figures::family(&last.name).to_owned())
}

fn floating(context: &Context<'_>) -> super::steady::Rule {
    let mut rule = context.rule;
    rule.approach.most_cycles = rule.approach.most_cycles.min(FLOATING_CYCLES);
    rule
}

fn lacks(scene: &Scene, what: &str) -> StudyError {
    let remedy = format!("it has no usual {what}: name its number, as in --{what}s POINTER=FROM:TO:COUNT");
    StudyError::missing(scene.name(), remedy)
}

fn evenly(from: f64, to: f64, count: u32) -> Vec<f64> {
    (0..count).map(|i| from + (to - from) * f64::from(i) / f64::from(count - 1)).collect()
}

/// Returns the values in rising order, each once.
fn risen(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// Returns at most `count` of the values, evenly selected, including both ends.
fn thinned(values: &[f64], count: usize) -> Vec<f64> {
    if values.len() <= count || count < 2 {
        return values.to_vec();
    }
    (0..count).map(|i| values[i * (values.len() - 1) / (count - 1)]).collect()
}

fn fraction_panel<'f>(figure: &'f mut Figure, family: &str) -> Option<&'f mut Panel> {
    figure.panels.iter_mut().find(|panel| panel.title == fraction_title(family))
}
