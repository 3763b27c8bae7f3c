//! Numbers that a study seeks.

use serde::Deserialize;
use serde_json::{Value, json};

use super::super::{FigureKind, StudyError, file, plan::Plan};
use crate::scene::SceneError;

/// Maximum number of octaves that an implausible number pays for: zero is infinitely many below a plausible range.
const MOST_OCTAVES: f64 = 8.0;

/// Number that is sought.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Number {
    /// Its name.
    pub name: String,
    /// JSON pointers of its places, equal in all scenes.
    pub pointers: Vec<String>,
    /// Scenes that have it; by default those with a number at the first place.
    #[serde(default)]
    pub scenes: Vec<String>,
    /// True if it multiplies the scenes' own values.
    #[serde(default)]
    #[serde(rename = "factor")]
    pub is_factor: bool,
    /// Smallest and largest value. If the smallest one is positive the number has a logarithmic scale.
    pub between: [f64; 2],
    /// Plausible values; all by default.
    pub plausible: Option<[f64; 2]>,
    /// Source of the plausible values.
    #[serde(default)]
    pub source: String,
}

/// Plot of a trial: at few values, from cold starts alone.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TrialPlot {
    /// Its kind.
    #[serde(rename = "plot")]
    pub kind: FigureKind,
    /// Loads or speeds; those of the study by default.
    #[serde(default, deserialize_with = "file::values")]
    pub values: Option<Vec<f64>>,
}

/// Numbers that a study seeks.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Question {
    /// The numbers.
    pub numbers: Vec<Number>,
    /// Plots of a trial; by default those of the study, at all of their values.
    #[serde(default)]
    pub plots: Vec<TrialPlot>,
    #[serde(skip)]
    pub(super) low: Vec<f64>,
    #[serde(skip)]
    pub(super) high: Vec<f64>,
}

impl Number {
    fn is_logarithmic(&self) -> bool {
        self.between[0] > 0.0
    }

    /// Returns the value at a share of the range, exact at its ends.
    fn value(&self, share: f64) -> f64 {
        let [low, high] = self.between;
        match share {
            share if share <= 0.0 => low,
            share if share >= 1.0 => high,
            share if self.is_logarithmic() => (low * libm::pow(high / low, share)).clamp(low, high),
            share => low + share * (high - low),
        }
    }

    /// Returns the share of the range at a value.
    pub(super) fn share(&self, value: f64) -> f64 {
        let [low, high] = self.between;
        let share = if self.is_logarithmic() {
            libm::log(value / low) / libm::log(high / low)
        } else {
            (value - low) / (high - low)
        };
        share.clamp(0.0, 1.0)
    }

    /// Returns the scenes of a study that have it, by their names.
    fn places<'a>(&'a self, plan: &'a Plan) -> impl Iterator<Item = &'a str> {
        let has = |(name, scene): &&'a (String, crate::scene::Scene)| {
            let is_named = self.scenes.is_empty() || self.scenes.contains(name);
            let first = self.pointers.first().and_then(|pointer| scene.resolved().pointer(pointer));
            is_named && first.is_some_and(Value::is_number)
        };
        plan.scenes.iter().filter(has).map(|(name, _)| name.as_str())
    }
}

impl Question {
    /// Ends of all shares.
    pub(in super::super) fn bounded(mut self) -> Self {
        (self.low, self.high) = (vec![0.0; self.numbers.len()], vec![1.0; self.numbers.len()]);
        self
    }

    pub(super) fn check(&self, plan: &Plan) -> Result<(), StudyError> {
        let mut faults = Vec::new();
        if self.numbers.is_empty() {
            faults.push("fit: no numbers to find".to_owned());
        }
        for number in &self.numbers {
            let [low, high] = number.between;
            if !(low.is_finite() && high.is_finite() && low < high) {
                faults.push(format!("{}: between {low} and {high}, which is no range", number.name));
            }
            if number.places(plan).next().is_none() {
                let places = number.pointers.join(", ");
                faults.push(format!("{}: no scene of the study has a number at {places}", number.name));
            }
        }
        let strange = self.plots.iter().filter_map(|plot| plan.plot(plot.kind).err());
        faults.extend(strange.map(|error| format!("fit: {error}")));
        if faults.is_empty() { Ok(()) } else { Err(StudyError::File(faults.join("; "))) }
    }

    pub(super) fn values(&self, x: &[f64]) -> Vec<f64> {
        self.numbers.iter().zip(x).map(|(number, share)| number.value(*share)).collect()
    }

    /// Returns the start of search number `search`: the values of the scenes, then points that fill the ranges evenly (Roberts, 2018).
    pub(super) fn start(&self, plan: &Plan, search: u64) -> Vec<f64> {
        if search == 0 {
            let own = |number: &Number| {
                let scene = number.places(plan).next().and_then(|name| plan.scene(name).ok());
                let own = |scene: &crate::scene::Scene| scene.resolved().pointer(&number.pointers[0])?.as_f64();
                let value = if number.is_factor { Some(1.0) } else { scene.and_then(own) };
                value.map_or(0.5, |value| number.share(value))
            };
            return self.numbers.iter().map(own).collect();
        }
        let n = self.numbers.len() as f64;
        let phi = (0..64).fold(2.0f64, |phi, _| libm::pow(1.0 + phi, (n + 1.0).recip()));
        (0..self.numbers.len()).map(|j| (0.5 + search as f64 * phi.powi(-(j as i32 + 1))).fract()).collect()
    }

    /// Returns whether a trial makes this plot.
    pub(in super::super) fn makes(&self, kind: FigureKind) -> bool {
        self.plots.is_empty() || self.plots.iter().any(|plot| plot.kind == kind)
    }

    /// Returns the study with the plots of a trial alone.
    pub(super) fn coarse(&self, plan: &Plan) -> Plan {
        let mut plan = plan.clone();
        if self.plots.is_empty() {
            return plan;
        }
        for section in &mut plan.sections {
            section.plots.retain(|plot| self.makes(plot.kind));
            for plot in &mut section.plots {
                let own = self.plots.iter().find(|own| own.kind == plot.kind);
                plot.values = own.and_then(|own| own.values.clone()).or_else(|| plot.values.take());
            }
        }
        plan.is_coarse = true;
        plan
    }

    /// Returns the study with the numbers in its scenes.
    ///
    /// # Errors
    /// Faults of the first scene in which they make no train.
    pub(in super::super) fn put(&self, plan: &Plan, values: &[f64]) -> Result<Plan, SceneError> {
        let mut plan = plan.clone();
        for i in 0..plan.scenes.len() {
            let (name, scene) = &plan.scenes[i];
            let own = self.numbers.iter().zip(values).filter(|(number, _)| number.places(&plan).any(|own| own == name));
            let value = |number: &Number, at: &str, value: f64| {
                let own = scene.resolved().pointer(at).and_then(Value::as_f64);
                json!(if number.is_factor { own.unwrap_or_default() * value } else { value })
            };
            let places: Vec<(&str, Value)> =
                own.flat_map(|(n, v)| n.pointers.iter().map(move |at| (at.as_str(), value(n, at, *v)))).collect();
            if !places.is_empty() {
                plan.scenes[i].1 = scene.with_all(places)?;
            }
        }
        Ok(plan)
    }

    /// Penalty of implausible values.
    pub(super) fn penalty(&self, values: &[f64]) -> f64 {
        let octaves = |(number, value): (&Number, &f64)| {
            let Some([low, high]) = number.plausible else { return 0.0 };
            let off = if *value < low { low / value } else { value / high };
            if off > 1.0 && low > 0.0 {
                libm::log2(off).min(MOST_OCTAVES)
            } else if off > 1.0 || *value < low {
                // Of a range that reaches to zero or below: how many of its widths.
                (value - high).max(low - value) / (high - low)
            } else {
                0.0
            }
        };
        self.numbers.iter().zip(values).map(|pair| 0.25 * octaves(pair).powi(2)).sum()
    }

    /// Copy number `copy` of the values: each differs by up to `share` of itself.
    pub(super) fn moved(&self, values: &[f64], share: f64, seed: u64, copy: u64) -> Vec<f64> {
        let random = |i: usize| {
            // SplitMix64, by the number and the copy alone: copies of all trials are moved alike.
            let mut z = (seed ^ (copy << 32) ^ i as u64)
                .wrapping_add(0x9e37_79b9_7f4a_7c15)
                .wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            2.0 * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 1.0
        };
        values.iter().enumerate().map(|(i, value)| value * (1.0 + share * random(i))).collect()
    }
}
