//! Which figure of a study is made from which scene.

use serde_json::{Map, Value, json};

use super::{
    Kind, StudyError,
    changes::{self, changes, effects},
    claims::{Claims, Comparison, Points},
    figures::{self, Context, ModeRow, fraction_title, load_pointer, speed_pointer},
    published,
    steady::ContactSteady,
    threshold::{By, Search, Threshold, locate},
    values::values,
};
use crate::{
    output::Table,
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    scene::{Scene, SceneError},
};

/// What one figure came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The figure, if it is one.
    pub figure: Option<Figure>,
    /// The scene it was made from, in words, and its hash.
    pub scene: [String; 2],
    /// Published numbers beside Flank's, in the study of the reference set.
    pub comparisons: Vec<Comparison>,
    /// Numbers better read than seen.
    pub listing: Option<Table>,
}

/// A study: scenes, speeds and loads.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Scene of the loaded train.
    pub heavy: Scene,
    /// Scene of the lightly loaded train.
    pub light: Scene,
    /// Scene of the floating train.
    pub floating: Scene,
    /// What was published about it.
    pub claims: Claims,
    /// Loads, N m.
    pub loads: Vec<f64>,
    /// Loads at which cycles are shown, N m.
    pub shown_loads: Vec<f64>,
    /// Speeds of the lightly loaded train, rev/min.
    pub speeds: Vec<f64>,
    /// Speeds of the lightly loaded train at which the threshold is sought, rev/min.
    pub threshold_speeds: Vec<f64>,
    /// Speeds of the loaded train, rev/min.
    pub heavy_speeds: Vec<f64>,
    /// Speeds at which paths are drawn, rev/min.
    pub path_speeds: Vec<f64>,
    /// Speed at which one displacement is followed, rev/min.
    pub history_speed: f64,
    /// Highest frequency of spectra, Hz.
    pub highest: [f64; 2],
}

/// Speeds at which thresholds are sought, at most: each takes some twenty runs.
const THRESHOLDS: usize = 20;
/// Cycles after which a floating motion counts as irregular: such motions are not waited for any longer.
const FLOATING_CYCLES: u64 = 300;

fn evenly(from: f64, to: f64, count: u32) -> Vec<f64> {
    (0..count).map(|i| from + (to - from) * f64::from(i) / f64::from(count - 1)).collect()
}

impl Plan {
    /// The reference planetary set: presets `reference-heavy`, `reference-light`, `reference-float`.
    ///
    /// # Errors
    /// [`StudyError`] never in fact: presets and claims are part of the library.
    pub fn reference() -> Result<Self, StudyError> {
        // The meshes of the first two are in phase, so that one planet stands for all of them, exactly.
        let scene = |preset: &str, freedoms: &str, rpm: f64| {
            let train = json!({ "kind": "planetary", "preset": preset, "freedoms": freedoms, "speed_rpm": rpm });
            Scene::from_value(json!({ "flank": 1, "train": train, "run": { "cycles": 1 } }), preset)
        };
        Ok(Self {
            heavy: scene("reference-heavy", "in-phase", 500.0)?,
            light: scene("reference-light", "in-phase", 500.0)?,
            floating: scene("reference-float", "full", 500.0)?,
            claims: Claims::from_json(include_str!("published/claims.json"))?,
            loads: evenly(0.0, 40.0, 41),
            shown_loads: vec![0.0, 21.0],
            speeds: evenly(50.0, 2000.0, 79),
            threshold_speeds: evenly(200.0, 2000.0, 19),
            heavy_speeds: evenly(500.0, 3000.0, 101),
            path_speeds: vec![100.0, 300.0, 1000.0, 2000.0],
            history_speed: 2000.0,
            highest: [1500.0, 3000.0],
        })
    }

    /// The same figures of another scene. Loads and speeds reach from nothing (or a tenth) to twice the scene's own; figures
    /// its train has no freedoms for are refused when they are asked for.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let own = |pointer: Option<&str>| pointer.and_then(|p| figures::number(scene, p).ok()).unwrap_or(0.0);
        let (load, rpm) = (own(load_pointer(scene)), own(speed_pointer(scene)));
        let reach = if load > 0.0 { 2.0 * load } else { 40.0 };
        let loads = evenly(0.0, reach, 41);
        let speeds = evenly(0.1 * rpm, 2.0 * rpm, 39);
        let mesh_frequency = scene.built().run.period.map_or(1.0, f64::recip);
        Self {
            heavy: scene.clone(),
            light: scene.clone(),
            floating: scene.clone(),
            claims: Claims::default(),
            shown_loads: vec![load],
            path_speeds: vec![rpm],
            history_speed: rpm,
            highest: [7.0 * mesh_frequency, 7.0 * mesh_frequency],
            threshold_speeds: thinned(&speeds, THRESHOLDS),
            heavy_speeds: speeds.clone(),
            loads,
            speeds,
        }
    }

    /// The same study at other loads, N m, and speeds, rev/min, where any are given; in rising order.
    #[must_use]
    pub fn varied(mut self, loads: Option<Vec<f64>>, speeds: Option<Vec<f64>>) -> Self {
        self.loads = loads.map_or(self.loads, risen);
        if let Some(speeds) = speeds.map(risen) {
            self.heavy_speeds.clone_from(&speeds);
            self.threshold_speeds = thinned(&speeds, THRESHOLDS);
            self.speeds = speeds;
        }
        self
    }

    /// What a scene does not allow of the loads and speeds: one error for each that it refuses.
    #[must_use]
    pub fn refused(&self) -> Vec<SceneError> {
        let try_all = |scene: &Scene, pointer: Option<&str>, values: &[f64]| -> Vec<SceneError> {
            let refused = |value: &f64| scene.with(pointer?, json!(value)).err();
            values.iter().filter_map(refused).collect()
        };
        let light = try_all(&self.light, load_pointer(&self.light), &self.loads);
        light.into_iter().chain(try_all(&self.light, speed_pointer(&self.light), &self.speeds)).collect()
    }

    /// Scenes that will be run for a figure, about: what progress is counted in.
    #[must_use]
    pub fn runs(&self, kind: Kind) -> usize {
        match kind {
            Kind::Forces | Kind::History => 1,
            Kind::Modes => 1,
            Kind::Values | Kind::Identification => 160,
            Kind::Changes => 18 * changes().map_or(0, |changes| changes.len()),
            Kind::Waterfall => self.waterfall_speeds().len(),
            Kind::Harmonics => self.heavy_speeds.len(),
            Kind::Cycles => self.shown_loads.len(),
            Kind::ApartVsLoad => 3 * self.loads.len() + 20,
            Kind::ApartVsSpeed => 3 * self.speeds.len(),
            Kind::ThresholdVsSpeed => 20 * self.threshold_speeds.len(),
            Kind::Trajectories => self.path_speeds.len(),
        }
    }

    /// About 26 of the loaded train's speeds: more lines cannot be told apart.
    fn waterfall_speeds(&self) -> Vec<f64> {
        thinned(&self.heavy_speeds, 26)
    }

    /// Makes a figure.
    ///
    /// # Errors
    /// [`StudyError`] of the runs, or of a scene without what the figure shows; [`StudyError::Interrupted`] once the task is
    /// cancelled.
    pub fn make(&self, kind: Kind, context: &Context<'_>) -> Result<Entry, StudyError> {
        if context.task.is_cancelled() {
            return Err(StudyError::Interrupted);
        }
        let speed = |scene: &Scene| speed_pointer(scene).ok_or_else(|| lacks(scene, "speed in rev/min"));
        let load = |scene: &Scene| load_pointer(scene).ok_or_else(|| lacks(scene, "load in N m"));
        let entry = |figure: Option<Figure>, scene: &Scene, words: &str, facts: Value| {
            Ok::<_, StudyError>(Entry {
                figure,
                scene: [format!("{}{}{words}", scene.name(), if words.is_empty() { "" } else { ", " }), scene.hash()],
                listing: None,
                comparisons: self.claims.compare(kind.id(), facts)?,
            })
        };
        let hasty = Context { rule: floating(context), ..*context };
        Ok(match kind {
            Kind::Modes => {
                let (figure, rows) = figures::modes(&self.full()?, self.highest[1])?;
                let listing = Some(figures::listing(&rows));
                let named = |row: &ModeRow| {
                    let (part, share) = row.shares.first()?;
                    Some((row.name.clone(), json!({ "hertz": row.hertz, "part": part, "share": share })))
                };
                let facts: Map<String, Value> = rows.iter().filter_map(named).collect();
                Entry { listing, ..entry(Some(figure), &self.full()?, "all freedoms", facts.into())? }
            }
            Kind::Identification => {
                self.only_reference("printed values to identify it from; see flank identify")?;
                let listing = Some(published::identified(context.task)?);
                Entry { listing, ..entry(None, &self.full()?, "all freedoms", Value::Null)? }
            }
            Kind::Forces => {
                let (figure, facts) = figures::forces(context, &self.heavy, self.highest[0])?;
                entry(Some(figure), &self.heavy, "", facts.into())?
            }
            Kind::Waterfall => {
                let pointer = speed(&self.heavy)?;
                let modes = figures::modes(&self.full()?, self.highest[1]);
                let natural = modes.map_or_else(|_| Vec::new(), |(_, rows)| rows);
                let speeds = self.waterfall_speeds();
                let (figure, facts) =
                    figures::waterfall(context, &self.heavy, (pointer, &speeds), &natural, self.highest[1])?;
                entry(Some(figure), &self.heavy, "speed varied", facts.into())?
            }
            Kind::Harmonics => {
                let pointer = speed(&self.heavy)?;
                let (figure, facts) = figures::harmonics(context, &self.heavy, (pointer, &self.heavy_speeds))?;
                entry(Some(figure), &self.heavy, "speed varied", facts.into())?
            }
            Kind::Cycles => {
                let (figure, found) = figures::cycles(context, &self.light, &self.shown_loads)?;
                entry(Some(figure), &self.light, "load varied", found.into())?
            }
            Kind::ApartVsLoad => self.by_load(context, load(&self.light)?, entry)?,
            Kind::ApartVsSpeed => {
                let pointer = speed(&self.light)?;
                let x = Axis::new("speed", "rev/min");
                let (mut figure, curves) = figures::apart(context, &self.light, kind.id(), x, (pointer, &self.speeds))?;
                self.publish(&mut figure)?;
                entry(Some(figure), &self.light, "speed varied", figures::facts(&curves, &self.speeds))?
            }
            Kind::ThresholdVsSpeed => {
                let (stem, speeds) = (self.last_family()?, &self.threshold_speeds);
                let (figure, facts) = figures::threshold(context, &self.light, &stem, speeds, &self.search())?;
                entry(Some(figure), &self.light, "speed and load varied", facts)?
            }
            Kind::Changes => {
                self.only_reference("a list of changes to try; see flank sweep")?;
                let tried = changes()?;
                let effects = effects(context, &self.light, &self.last_family()?, &tried, &self.search())?;
                let listing = Some(changes::listing(&effects));
                Entry { listing, ..entry(None, &self.light, "numbers varied", Value::Null)? }
            }
            Kind::Values => {
                self.only_reference("independent values to compare with")?;
                let listing = Some(values(context, self)?);
                Entry { listing, ..entry(None, &self.light, "and others", Value::Null)? }
            }
            Kind::Trajectories => {
                let pointer = speed(&self.floating)?;
                let (figure, found) = figures::trajectories(&hasty, &self.floating, (pointer, &self.path_speeds))?;
                entry(Some(figure), &self.floating, "speed varied", found.into())?
            }
            Kind::History => {
                let scene = match speed_pointer(&self.floating) {
                    Some(pointer) => self.floating.with(pointer, json!(self.history_speed))?,
                    None => self.floating.clone(),
                };
                let first = scene.built().spec.freedoms.first().cloned().unwrap_or_default();
                let (figure, facts) = figures::history(&hasty, &scene, &first)?;
                let words = format!("{} rev/min", self.history_speed);
                entry(Some(figure), &self.floating, &words, facts)?
            }
        })
    }

    fn by_load(
        &self,
        context: &Context<'_>,
        pointer: &str,
        entry: impl Fn(Option<Figure>, &Scene, &str, Value) -> Result<Entry, StudyError>,
    ) -> Result<Entry, StudyError> {
        let x = Axis::new("load", "N m");
        let id = Kind::ApartVsLoad.id();
        let (mut figure, curves) = figures::apart(context, &self.light, id, x, (pointer, &self.loads))?;
        let stem = self.last_family()?;
        // The grid has found where to look: between its last load at which contact is lost and the next one.
        let find = |by: By, time: fn(&ContactSteady) -> f64| {
            let last = figures::along(&curves[0], &stem, time).iter().rposition(|time| *time > 0.0);
            let bracket = last.and_then(|i| Some([self.loads[i], *self.loads.get(i + 1)?]));
            match bracket {
                Some(range) => {
                    locate(context, &self.light, pointer, (&stem, by), &Search { range, scan: 2, ..self.search() })
                }
                None => Ok(last.map_or(Threshold::None, |i| Threshold::Beyond { value: self.loads[i] })),
            }
        };
        let deflection = find(By::Deflection, |c| c.report.apart_time)?;
        let force = find(By::Force, |c| c.report.no_force_time)?;
        if let Some(panel) = fraction_panel(&mut figure, &stem) {
            for (threshold, words) in [(deflection, "between the flanks"), (force, "without force")] {
                let guide = |x: f64| Guide::Vertical { x, name: format!("{words} up to {x:.2} N m") };
                panel.guides.extend(threshold.located().map(guide));
            }
        }
        self.publish(&mut figure)?;
        let mut facts = figures::facts(&curves, &self.loads);
        facts["threshold"] = json!({ "deflection": deflection, "force": force });
        entry(Some(figure), &self.light, "load varied", facts)
    }

    fn search(&self) -> Search {
        let ends = |pick: fn(f64, f64) -> f64, start: f64| self.loads.iter().copied().fold(start, pick);
        let (low, high) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
        // Thresholds reach beyond the loads of interest at resonances.
        let high = low + 1.5 * (high - low);
        Search { range: [low, high], scan: 13, resolution: 2.5e-4 * (high - low) }
    }

    /// The family of meshes whose loss of contact is looked at: the last one, as the ring's in a planetary stage.
    fn last_family(&self) -> Result<String, StudyError> {
        let last = self.light.built().spec.contacts.last().ok_or_else(|| lacks(&self.light, "contact"))?;
        Ok(figures::family(&last.name).to_owned())
    }

    /// Puts published times without force into the panel of the last family.
    fn publish(&self, figure: &mut Figure) -> Result<(), StudyError> {
        let points = self.claims.points(&figure.id).cloned();
        if let (Some(Points { x, y }), Some(panel)) = (points, fraction_panel(figure, &self.last_family()?)) {
            panel.series.push(Series { name: "published".to_owned(), x, y, style: Style::Points, colour: 6 });
        }
        Ok(())
    }

    /// Where the source contradicts itself, from its own data.
    ///
    /// # Errors
    /// [`StudyError::Claim`] for a claim that cannot be evaluated.
    pub fn contradictions(&self) -> Result<Vec<Comparison>, StudyError> {
        let train = |scene: &Scene| scene.resolved()["train"].clone();
        self.claims.compare("contradictions", json!({ "heavy": train(&self.heavy), "light": train(&self.light) }))
    }

    /// What only the reference set has.
    fn only_reference(&self, what: &str) -> Result<(), StudyError> {
        if !self.claims.is_empty() {
            return Ok(());
        }
        Err(StudyError::missing(self.light.name(), format!("only the reference set has {what}")))
    }

    /// The loaded train in all its freedoms.
    fn full(&self) -> Result<Scene, StudyError> {
        if self.claims.is_empty() {
            return Ok(self.heavy.clone());
        }
        Ok(self.heavy.with("/train/freedoms", json!("full"))?)
    }
}

fn floating(context: &Context<'_>) -> super::steady::Rule {
    let mut rule = context.rule;
    rule.approach.most_cycles = rule.approach.most_cycles.min(FLOATING_CYCLES);
    rule
}

fn lacks(scene: &Scene, what: &str) -> StudyError {
    StudyError::missing(scene.name(), format!("a train of kind {} has no {what}", figures::kind(scene)))
}

/// In rising order, each once.
fn risen(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// At most `count` of the values, evenly picked, both ends among them.
fn thinned(values: &[f64], count: usize) -> Vec<f64> {
    if values.len() <= count || count < 2 {
        return values.to_vec();
    }
    (0..count).map(|i| values[i * (values.len() - 1) / (count - 1)]).collect()
}

fn fraction_panel<'f>(figure: &'f mut Figure, family: &str) -> Option<&'f mut Panel> {
    figure.panels.iter_mut().find(|panel| panel.title == fraction_title(family))
}
