//! File of a study: scenes, plots of them by section, and claims.
//!
//! A text in place of a scene, of claims or of a table names a JSON file beside the study.

use std::collections::BTreeMap;

use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;

use super::{FigureKind, StudyError, claims::Claims, fit::Question, plan::Plan};
use crate::{scene::Scene, sweep::Axis};

/// Study in the form of its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyFile {
    /// Version of the format, 1.
    flank_study: u32,
    pub title: String,
    #[serde(default, rename = "note")]
    _note: String,
    #[serde(default)]
    scenes: BTreeMap<String, Value>,
    pub sections: Vec<Section>,
    #[serde(default)]
    claims: Value,
    pub load: Option<String>,
    pub speed: Option<String>,
    /// Numbers to find.
    pub fit: Option<Question>,
}

/// A section of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// Its title.
    pub title: String,
    /// Words below the title.
    #[serde(default)]
    pub text: String,
    /// Its plots.
    pub plots: Vec<Plot>,
}

/// A plot of a scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plot {
    /// Kind of the plot.
    #[serde(rename = "plot")]
    pub kind: FigureKind,
    /// Name of its scene.
    #[serde(default = "only")]
    pub scene: String,
    /// Loads or speeds, `FROM:TO:COUNT` or `V1,V2,…`.
    #[serde(default, deserialize_with = "values")]
    pub values: Option<Vec<f64>>,
    /// Highest frequency of spectra and modes, Hz.
    pub highest_hz: Option<f64>,
    /// Scene whose natural frequencies are drawn in; its own by default.
    pub modes_of: Option<String>,
    /// Numbers that a table compares.
    #[serde(default)]
    table: Value,
}

/// Returns the default name of the scene.
fn only() -> String {
    "scene".to_owned()
}

pub(super) fn values<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let faults = |faults: Vec<crate::output::Fault>| serde::de::Error::custom(joined(&faults));
    Axis::parse(&format!("/values={text}")).map(|axis| Some(axis.all())).map_err(faults)
}

impl Plot {
    /// Reads the numbers that its table compares.
    pub(super) fn table<T: DeserializeOwned>(&self) -> Result<T, StudyError> {
        T::deserialize(&self.table).map_err(|error| StudyError::File(format!("table of {}: {error}", self.kind.id())))
    }
}

/// Texts of the published study with several sets of numbers and with one, and of their files.
const PUBLISHED: &str = include_str!("published/study.json");
const ONE_SET: &str = include_str!("published/one-set.json");
const FILES: [(&str, &str); 4] = [
    ("claims.json", include_str!("published/claims.json")),
    ("changes.json", include_str!("published/changes.json")),
    ("identified.json", include_str!("published/identified.json")),
    ("values.json", include_str!("published/values.json")),
];
/// Plots of any train, with one scene.
const ANY: &str = include_str!("any_train.json");

impl StudyFile {
    /// Returns the published study of the reference set.
    pub fn reference() -> Result<Self, StudyError> {
        Self::published(PUBLISHED)
    }

    /// Returns the same with one set of numbers, and the ranges in which it was found.
    pub fn one_set() -> Result<Self, StudyError> {
        Self::published(ONE_SET)
    }

    fn published(text: &str) -> Result<Self, StudyError> {
        let of = |name: &str| FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| (*text).to_owned());
        Self::read(text, &|name| of(name).ok_or_else(|| format!("{name} is no part of the library")))
    }

    /// Returns the plots of any train, without a scene.
    pub fn any() -> Result<Self, StudyError> {
        Self::read(ANY, &|name| Err(name.to_owned()))
    }

    /// Reads a study; `read` gives the text of a file that it names.
    pub fn read(text: &str, read: &dyn Fn(&str) -> Result<String, String>) -> Result<Self, StudyError> {
        let mut file: Self = parsed(text, "the study")?;
        let all = file.scenes.values_mut().chain([&mut file.claims]);
        for value in all.chain(file.sections.iter_mut().flat_map(|s| &mut s.plots).map(|plot| &mut plot.table)) {
            if let Some(name) = value.as_str().map(str::to_owned) {
                *value = parsed(&read(&name).map_err(StudyError::File)?, &name)?;
            }
        }
        Ok(file)
    }

    /// Returns its plan, with scenes and claims read.
    pub fn plan(self) -> Result<Plan, StudyError> {
        if self.flank_study != 1 {
            return Err(StudyError::File(format!("flank_study is {}; this version reads 1", self.flank_study)));
        }
        let kinds: Vec<FigureKind> =
            self.sections.iter().flat_map(|section| &section.plots).map(|plot| plot.kind).collect();
        if let Some(kind) = kinds.iter().enumerate().find_map(|(i, kind)| kinds[..i].contains(kind).then_some(kind)) {
            return Err(StudyError::File(format!("{} is plotted twice; a study has each plot once", kind.id())));
        }
        let read = |(name, value): (&String, &Value)| Ok((name.clone(), Scene::from_value(value.clone(), name)?));
        let scenes = self.scenes.iter().map(read).collect::<Result<Vec<_>, StudyError>>()?;
        let claims = match &self.claims {
            Value::Null => Claims::default(),
            claims => Claims::deserialize(claims).map_err(|error| StudyError::File(format!("claims: {error}")))?,
        };
        let plan = Plan::new(self, scenes, claims);
        let plots = plan.sections.iter().flat_map(|section| &section.plots);
        // A study of any train takes its scene from elsewhere.
        if !plan.scenes.is_empty() {
            let names = plots.flat_map(|plot| [Some(plot.scene.as_str()), plot.modes_of.as_deref()]).flatten();
            names.map(|name| plan.scene(name).map(|_| ())).collect::<Result<Vec<()>, _>>()?;
        }
        Ok(plan)
    }
}

fn parsed<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, StudyError> {
    serde_json::from_str(text).map_err(|error| StudyError::File(format!("{name}: {error}")))
}

fn joined(faults: &[crate::output::Fault]) -> String {
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}
