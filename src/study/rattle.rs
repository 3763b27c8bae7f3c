//! Rattle threshold: the load at which the motion without loss of contact begins to lose it.
//!
//! The motion is followed from a load at which it keeps contact towards less load, each one started from the one before. Its margin is the
//! least distance from the event over all contacts: `min δ − b` by deflection, the least force by force, `min δ + b` for the back flank. If
//! the motion is periodic and its margin tends to zero, the threshold is the root of the margin: the graze itself. Only motions with
//! contact kept are used for that root. If the motion ends before, by a jump, there is only a bracket. Contacts have compliant laws: a
//! rigid one rests on its flank without a margin. A bilateral mesh has the load at which it would part.

use serde::Serialize;
use serde_json::{Value, json};

use super::{
    StudyError,
    steady::{Rule, Seed, Steady, steady},
};
use crate::{
    orbit::MotionKind,
    scene::{Fault, Scene, SceneError},
    task::Task,
};

/// Loads tried on the way down.
const SCAN: usize = 48;
/// Maximum number of rounds of the root search: as many halve a bracket down to rounding.
const ROUNDS: usize = 64;
/// Share of the distance to the root that each round leaves.
const NEARER: f64 = 1e-2;
/// Margin that counts as zero, relative to that of the first motion.
const NEGLIGIBLE: f64 = 1e-9;
/// Relative accuracy of the root.
const ACCURACY: f64 = 4e-15;

/// Event of a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Loss {
    /// A mesh leaves its drive flank.
    Deflection,
    /// A mesh carries no force for a time.
    Force,
    /// A mesh strikes its back flank.
    BackFlank,
}

/// Rattle threshold.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
#[non_exhaustive]
pub enum Rattle {
    /// The event occurs at no value tried.
    Never,
    /// The event occurs at the largest value already.
    Always {
        /// The largest value.
        value: f64,
    },
    /// The motion grazes: the event begins below the value.
    Graze {
        /// The value.
        value: f64,
        /// Estimate of its error: the largest of the difference of the last two roots, or the bisected width, and of the rounding of the
        /// margin over its slope.
        uncertainty: f64,
        /// Contact that grazes.
        contact: String,
    },
    /// The motion jumps, or is not periodic, before it grazes: the event begins between two values.
    Bracket {
        /// Largest value with the event.
        with: f64,
        /// Least value without it.
        without: f64,
        /// Margin at that value, m or N.
        margin: f64,
        /// Contact with this margin.
        contact: String,
        /// Kind of the motion without the event there.
        motion: String,
    },
}

/// Motion without the event.
struct QuietMotion {
    value: f64,
    margin: f64,
    /// Rounding of the margin, a small difference of larger numbers.
    rounding: f64,
    contact: String,
    is_periodic: bool,
    motion: String,
    seed: Seed,
}

/// Search over the number at `pointer`, downwards from the larger end of `range`.
#[derive(Clone, Debug)]
pub struct RattleSearch<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// JSON pointer of the load in the resolved scene.
    pub pointer: &'a str,
    /// Ends of the range; the search begins at the second one.
    pub range: [f64; 2],
    /// The event.
    pub loss: Loss,
    /// Rule of the steady motions.
    pub rule: Rule,
}

/// Rounding of a deflection relative to its size, that of some ten steps included.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Least difference of two margins, in their rounding, from which a slope is taken.
const CLEAR: f64 = 16.0;

/// Largest load tried without a range, in loads of the scene.
const MOST: f64 = 512.0;

/// Threshold of loss of contact, with the search that found it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LoadThreshold {
    /// The event.
    pub by: Loss,
    /// JSON pointer of the load in the resolved scene.
    pub pointer: String,
    /// Ends of the range.
    pub range: [f64; 2],
    /// True if the start of the scene leads to another motion before the threshold, which has the event.
    pub shared: bool,
    /// The threshold.
    pub threshold: Rattle,
}

impl LoadThreshold {
    /// Searches over the number and the range of `vary`, downwards from its second end. Without them, over the load of the scene: from a
    /// thousandth of it to eight times it, or more.
    ///
    /// # Errors
    /// [`SceneError`] for a train without a load, a number that the scene does not have, or a rigid contact; errors of
    /// [`RattleSearch::run`].
    pub fn find(scene: &Scene, vary: Option<(String, [f64; 2])>, by: Loss, task: Task<'_>) -> Result<Self, StudyError> {
        let is_open = vary.is_none();
        let refused =
            |fault: Fault| StudyError::from(SceneError { name: scene.name().to_owned(), faults: vec![fault] });
        let loaded = || {
            load_of(scene).map(|(pointer, load)| (pointer, [1e-3 * load, 8.0 * load])).ok_or_else(|| {
                let fault = Fault::new("/train", "no load that is a number in this train", "a number and its range");
                refused(fault.remedy("name the number to vary, and its range"))
            })
        };
        let (pointer, range) = vary.map_or_else(loaded, Ok)?;
        if !scene.resolved().pointer(&pointer).is_some_and(Value::is_number) {
            let allowed = "a pointer to a number of the resolved scene";
            return Err(refused(Fault::new(&pointer, "a pointer to no number", allowed)));
        }
        if range[0] == range[1] {
            return Err(refused(Fault::new(&pointer, "a range without length", "two different ends")));
        }
        if scene.built().spec.contacts.iter().any(|contact| contact.law.is_rigid()) {
            let found = "a rigid contact, which rests on its flank without a margin";
            let fault = Fault::new("/train", found, "compliant contact laws");
            return Err(refused(fault.remedy("give the contact a stiffness, or use a sweep")));
        }
        let mut search = RattleSearch { scene, pointer: &pointer, range, loss: by, rule: Rule::default() };
        let mut threshold = search.run(task)?;
        // Without a range the load grows until the teeth keep contact.
        while let (true, Rattle::Always { value }, true) =
            (is_open, &threshold, search.range[1] / search.range[0] < 1e3 * MOST)
        {
            search.range[1] = 8.0 * value;
            threshold = search.run(task)?;
        }
        let (range, shared) = (search.range, search.is_shared(&threshold, task)?);
        Ok(Self { by, pointer, range, shared, threshold })
    }
}

/// Returns the load of a train: JSON pointer and value. None if the train has none.
#[must_use]
pub fn load_of(scene: &Scene) -> Option<(String, f64)> {
    let resolved = scene.resolved();
    let of = |pointer: String| {
        let value = resolved.pointer(&pointer).and_then(Value::as_f64).filter(|value| *value != 0.0)?;
        Some((pointer, value))
    };
    let direct = ["/train/mean_load", "/train/torque_nm", "/train/load/output_torque_nm", "/train/load/drag_torque_nm"];
    let shafts = resolved["train"]["shafts"].as_array().map_or(0, Vec::len);
    let torques = (0..shafts).map(|i| format!("/train/shafts/{i}/torque_nm"));
    let drags = (0..shafts).flat_map(|i| {
        let gears = resolved["train"]["shafts"][i]["gears"].as_array().map_or(0, Vec::len);
        (0..gears).map(move |j| format!("/train/shafts/{i}/gears/{j}/drag/torque_nm"))
    });
    direct.map(String::from).into_iter().chain(torques).chain(drags).find_map(of)
}

impl RattleSearch<'_> {
    /// Finds the threshold.
    ///
    /// # Errors
    /// [`StudyError`]: a scene that is invalid at a value, a run that fails, an interruption.
    pub fn run(&self, task: Task<'_>) -> Result<Rattle, StudyError> {
        let [low, high] = self.range;
        let Some(mut above) = self.at(high, None, task)? else { return Ok(Rattle::Always { value: high }) };
        let mut before = None;
        let ratio = low / high;
        // Equal ratios over a wide range, else equal steps.
        let value = |i: usize| {
            let share = i as f64 / SCAN as f64;
            if ratio > 0.0 && ratio < 0.1 { high * libm::pow(ratio, share) } else { high + (low - high) * share }
        };
        let mut lost = None;
        for i in 1..=SCAN {
            match self.at(value(i), Some(&above.seed), task)? {
                Some(kept) => before = Some(std::mem::replace(&mut above, kept)),
                None => {
                    lost = Some(value(i));
                    break;
                }
            }
        }
        let Some(mut lost) = lost else { return Ok(Rattle::Never) };
        if let Some(before) = before {
            return self.root(before, above, lost, task);
        }
        // A root needs two motions: the second one may lie anywhere between.
        for _ in 0..ROUNDS {
            let middle = 0.5 * (above.value + lost);
            match self.at(middle, Some(&above.seed), task)? {
                Some(kept) => return self.root(above, kept, lost, task),
                None => lost = middle,
            }
            if (above.value - lost).abs() <= ACCURACY * above.value.abs() {
                break;
            }
        }
        let QuietMotion { value, margin, contact, motion, .. } = above;
        Ok(Rattle::Bracket { with: lost, without: value, margin, contact, motion })
    }

    /// Returns whether a second motion, with the event, follows from the scene's start a thousandth of the range above the threshold.
    ///
    /// # Errors
    /// Errors of [`run`](Self::run).
    pub fn is_shared(&self, found: &Rattle, task: Task<'_>) -> Result<bool, StudyError> {
        let (Rattle::Graze { value, .. } | Rattle::Bracket { without: value, .. }) = found else { return Ok(false) };
        let [_, high] = self.range;
        Ok(self.at(value + 1e-3 * (high - value), None, task)?.is_none())
    }

    /// Returns the steady motion at a value, if it is without the event.
    fn at(&self, value: f64, seed: Option<&Seed>, task: Task<'_>) -> Result<Option<QuietMotion>, StudyError> {
        let scene = self.scene.with(self.pointer, json!(value)).map_err(StudyError::from)?;
        let spec = &scene.built().spec;
        let flanks: Vec<_> = spec.contacts.iter().map(|c| (c.half_backlash, c.law.is_bilateral())).collect();
        let found = steady(scene, seed, &self.rule, task)?;
        let margins = found.contacts.iter().zip(&flanks).filter_map(|(contact, (b, is_bilateral))| {
            let report = &contact.report;
            let deflection = report.deflection_max?.abs().max(*b);
            let (margin, is_there, size) = match self.loss {
                Loss::Deflection => (report.deflection_min? - b, report.apart_time > 0.0, deflection),
                Loss::Force => {
                    // The force per stretch, times the deflection.
                    let stretch = report.deflection_max? - if *is_bilateral { 0.0 } else { *b };
                    let ratio = if stretch > 0.0 { (deflection / stretch).max(1.0) } else { 1.0 };
                    (report.force_min?, report.no_force_time > 0.0, report.force_max? * ratio)
                }
                Loss::BackFlank => (report.deflection_min? + b, report.back_contacts > 0, deflection),
            };
            Some((margin, is_there, ROUNDING * size, &report.name))
        });
        let least = margins.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((margin, _, rounding, contact)) = least.filter(|(margin, is_there, ..)| !is_there && *margin > 0.0)
        else {
            return Ok(None);
        };
        let (contact, is_periodic) = (contact.clone(), found.motion.kind == MotionKind::Periodic);
        let Steady { motion, end, .. } = found;
        Ok(Some(QuietMotion {
            value,
            margin,
            rounding,
            contact,
            is_periodic,
            motion: motion.kind.word().to_owned(),
            seed: end,
        }))
    }

    /// Returns the root of the margin from two motions above it, or a bracket if the margin does not tend to zero.
    fn root(&self, first: QuietMotion, second: QuietMotion, lost: f64, task: Task<'_>) -> Result<Rattle, StudyError> {
        let reach = first.margin;
        let (mut a, mut b, mut lost) = (first, second, lost);
        let mut last: Option<f64> = None;
        // Slope of the last two motions whose margins differ by more than their rounding.
        let mut steep: Option<f64> = None;
        for _ in 0..ROUNDS {
            let slope = (b.margin - a.margin) / (b.value - a.value);
            let rounding = a.rounding + b.rounding;
            if a.contact == b.contact && (b.margin - a.margin).abs() > CLEAR * rounding {
                steep = Some(slope.abs());
            }
            let root = b.value - b.margin / slope;
            // Beyond the event the root is that of another motion.
            let is_between = (root - b.value) * (root - lost) <= 0.0 && a.contact == b.contact && b.is_periodic;
            let change = last.filter(|_| is_between).map(|last| (root - last).abs());
            let width = (b.value - lost).abs();
            let is_done = change.is_some_and(|change| change <= ACCURACY * root.abs());
            if is_done || width <= ACCURACY * b.value.abs() {
                if is_done || b.is_periodic && b.margin <= NEGLIGIBLE * reach {
                    let rounded = steep.map_or(0.0, |steep| rounding / steep);
                    let uncertainty = change.unwrap_or(width).max(f64::EPSILON * b.value.abs()).max(rounded);
                    let value = if is_between { root } else { b.value };
                    return Ok(Rattle::Graze { value, uncertainty, contact: b.contact });
                }
                break;
            }
            last = is_between.then_some(root);
            let next = if is_between { root + NEARER * (b.value - root) } else { 0.5 * (b.value + lost) };
            match self.at(next, Some(&b.seed), task)? {
                Some(kept) => a = std::mem::replace(&mut b, kept),
                None => (lost, last) = (next, None),
            }
        }
        Ok(Rattle::Bracket { with: lost, without: b.value, margin: b.margin, contact: b.contact, motion: b.motion })
    }
}
