//! Scenes: a train, its start and its run, as one JSON file.
//!
//! A scene has units in its keys and refuses unknown keys. It reports all faults at once, each with its place, the allowed values, and a
//! remedy. [`schema()`] is its JSON Schema, generated from the description that the reader uses. Trains, by `kind`:
//!
//! | kind | train | freedoms |
//! |---|---|---|
//! | `planetary` | a planetary stage, or a preset with some of its numbers replaced | `torsional`, `in-phase`, `full`, `full-carrier`, or by name |
//! | `gear-pair` | two external gears with real teeth | `torsional`, `torsional-translational` |
//! | `gear-pair-dimensionless` | the pair of Kahraman and Singh; keys carry no units | one |
//! | `wall` | a mass against a wall, or between two | one |
//! | `matrices` | masses, dampers, springs and contacts written out | any |
//!
//! ```
//! use flank::scene::Scene;
//!
//! let ball = r#"{
//!     "flank": 1,
//!     "train": {
//!         "kind": "wall", "mass_kg": 1, "load_n": -9.81,
//!         "wall": { "side": "below", "position_m": 0 },
//!         "law": { "kind": "rigid", "restitution": 0.8 }
//!     },
//!     "initial": { "q": [1] },
//!     "run": { "t_end_s": 5 }
//! }"#;
//! let built = Scene::from_json(ball, "ball")?.build()?;
//! assert_eq!(built.spec.freedoms, ["x"]);
//! assert_eq!(built.q0, [1.0]);
//! # Ok::<(), flank::scene::SceneError>(())
//! ```

mod body;
mod build;
mod check;
mod clock;
mod contact;
mod curve;
mod dimensionless;
mod fault;
mod gearbox;
mod harmonics;
mod initial;
mod json;
mod law;
mod load;
mod matrices;
mod mesh;
mod node;
mod pair;
mod planetary;
mod plausible;
mod preset;
mod run;
mod schedule;
mod schema;
mod shape;
mod table;
mod wall;

use std::{
    io::{self, Read},
    path::Path,
};

use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use fault::nearest;
pub use fault::{Fault, SceneError, Warning};
pub use initial::Memory;
pub use run::{Duration, Frame, Run};

pub use self::mesh::ToothMesh;
use crate::{
    output::{read_at_most, read_file, visible},
    system::Spec,
    train::Drawing,
};

/// Scene that has been read, checked and resolved.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    name: String,
    given: Value,
    resolved: Value,
    built: BuiltScene,
}

impl From<&Scene> for Scene {
    fn from(scene: &Scene) -> Self {
        scene.clone()
    }
}

/// Result of a scene: a train in its common form, a start and a run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuiltScene {
    /// The train.
    pub spec: Spec,
    /// Coordinates at the start, m, `[n]`.
    pub q0: Vec<f64>,
    /// Velocities at the start, m/s, `[n]`.
    pub v0: Vec<f64>,
    /// Further data of the start: latched speeds and modes of contacts.
    pub memory: Memory,
    /// The run.
    pub run: Run,
    /// True if the train is in dimensionless form; else SI units (or those of its matrices).
    pub dimensionless: bool,
    /// Speed of a rotating frame in which the train is written, rad/s.
    pub carrier_speed: Option<f64>,
    /// Meshes whose teeth are given, in the order of the contacts.
    pub meshes: Vec<ToothMesh>,
    /// Mean speeds of the shafts and the loose gears of a gearbox, rad/s, by name.
    pub speeds: Vec<(String, f64)>,
    /// Train in the form of a picture, if its gears are known.
    pub drawing: Option<Drawing>,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
    /// Remarks on the fit of series to measured curves.
    pub remarks: Vec<Warning>,
    /// Faults of a start that does not fit the train: they refuse a run from it, not from another start.
    pub start_faults: Vec<Fault>,
}

impl Scene {
    /// Reads a scene; `name` appears in messages. The files of its tables are relative to the current folder.
    ///
    /// # Errors
    /// [`SceneError`] with every fault found.
    pub fn from_json(text: &str, name: &str) -> Result<Self, SceneError> {
        Self::from_text(text, name, Path::new(""))
    }

    /// Reads a scene whose tables are below `folder`.
    fn from_text(text: &str, name: &str, folder: &Path) -> Result<Self, SceneError> {
        let mut given = json::parse(text).map_err(|faults| SceneError::new(name, faults))?;
        let mut faults = Vec::new();
        table::load(&mut given, folder, "", &mut faults);
        if faults.is_empty() {
            return Self::from_value(given, name);
        }
        let expanded = preset::expand(&given);
        check::check(&expanded, shape::scene(build::units_of(&expanded)), "", &mut faults);
        Err(SceneError::new(name, faults))
    }

    /// The default scene: the reference planetary set under light load at 500 rev/min.
    ///
    /// # Errors
    /// Never in fact: the scene is part of the library and tested.
    pub fn reference() -> Result<Self, SceneError> {
        Self::from_json(include_str!("../../examples/scenes/reference-light.json"), "reference-light")
    }

    /// Reads a scene from a JSON value.
    ///
    /// # Errors
    /// [`SceneError`] with every fault found.
    pub fn from_value(given: Value, name: &str) -> Result<Self, SceneError> {
        let mut scene = Self::with_any_start(given, name)?;
        match std::mem::take(&mut scene.built.start_faults) {
            faults if faults.is_empty() => Ok(scene),
            faults => Err(SceneError::new(name, faults)),
        }
    }

    /// Reads a scene whose start need not fit its train.
    fn with_any_start(mut given: Value, name: &str) -> Result<Self, SceneError> {
        let name = &visible(name);
        make_visible(&mut given);
        // Used by editors; no part of the scene.
        if let Some(object) = given.as_object_mut().filter(|object| object.get("$schema").is_some_and(Value::is_string))
        {
            object.remove("$schema");
        }
        let (mut faults, expanded) = (Vec::new(), preset::expand(&given));
        let resolved = check::check(&expanded, shape::scene(build::units_of(&expanded)), "", &mut faults);
        if faults.is_empty() {
            match build::build(&resolved) {
                Ok(mut built) => {
                    built
                        .warnings
                        .iter_mut()
                        .for_each(|warning| warning.pointer = as_written(&given, &warning.pointer));
                    built.warnings.extend(preset::replaced_everywhere(&given));
                    if resolved["train"]["strict"] != true || built.warnings.is_empty() {
                        return Ok(Self { name: name.to_owned(), given, resolved, built });
                    }
                    faults = strict(&built.warnings, "/train/strict");
                }
                Err(found) => {
                    let written = |fault: Fault| Fault { pointer: as_written(&given, &fault.pointer), ..fault };
                    faults = found.into_iter().map(written).collect();
                    faults.dedup();
                }
            }
        } else if resolved["train"].is_object() && !faults.iter().any(|fault| fault.pointer.starts_with("/train")) {
            faults.extend(build::faults_of_train(&resolved));
        }
        Err(SceneError::new(name, faults))
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// [`SceneError`] with every fault found; a file that cannot be read is one.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        Self::from_bytes(read_file(path, json::MAX_BYTES), &name, path.parent().unwrap_or(Path::new("")))
    }

    /// Reads a scene from a stream such as standard input.
    ///
    /// # Errors
    /// Errors of [`from_file`](Self::from_file).
    pub fn from_stream(stream: impl Read, name: &str) -> Result<Self, SceneError> {
        Self::from_bytes(read_at_most(stream, json::MAX_BYTES), name, Path::new(""))
    }

    fn from_bytes(bytes: io::Result<Vec<u8>>, name: &str, folder: &Path) -> Result<Self, SceneError> {
        let fail = |fault: Fault| SceneError::new(name, vec![fault]);
        let bytes = bytes.map_err(|error| match error.kind() {
            io::ErrorKind::FileTooLarge => fail(json::too_large(&error.to_string())),
            _ => {
                fail(Fault::new("", error.to_string(), "a scene file that can be read").remedy("check path and rights"))
            }
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let found = format!("a byte that is not text, at offset {}", error.utf8_error().valid_up_to());
            fail(Fault::new("", found, "JSON text in UTF-8").remedy("save the file as UTF-8, without a UTF-16 mark"))
        })?;
        Self::from_text(&text, name, folder)
    }

    /// Returns the JSON pointer of the only place that has this key, in the scene as it is given or else with its defaults, such as
    /// `/train/speed_rpm` for `speed_rpm`. A pointer stands for itself.
    ///
    /// # Errors
    /// [`SceneError`] if no place has the key, or several have it.
    pub fn pointer(&self, key: &str) -> Result<String, SceneError> {
        if key.starts_with('/') {
            return Ok(key.to_owned());
        }
        // A key that the scene gives once may be resolved at several places, as one for all meshes.
        let (mut given, mut places) = (Vec::new(), Vec::new());
        keys(&self.given, "", &mut given);
        keys(&self.resolved, "", &mut places);
        let all = if given.iter().filter(|(name, _)| name == key).count() == 1 { &given } else { &places };
        let found: Vec<&String> = all.iter().filter(|(name, _)| name == key).map(|(_, pointer)| pointer).collect();
        let fault = match &found[..] {
            [pointer] => return Ok((*pointer).clone()),
            [] => {
                let fault =
                    Fault::new(key, "a key that the scene does not have", "a key or a JSON pointer of the scene");
                match nearest(key, places.iter().map(|(name, _)| name.as_str())) {
                    Some(name) => fault.remedy(format!("did you mean {name:?}?")),
                    None => fault.remedy("see the resolved scene for its keys"),
                }
            }
            several => {
                let all = several.iter().map(|pointer| pointer.as_str()).collect::<Vec<_>>().join(", ");
                Fault::new(key, format!("a key at {} places", several.len()), "a key at one place, or a JSON pointer")
                    .remedy(format!("name one of {all}"))
            }
        };
        Err(SceneError::new(&self.name, vec![fault]))
    }

    /// Returns the same scene with another value at a JSON pointer, such as `/train/speed_rpm`.
    ///
    /// # Errors
    /// Errors of [`with_all`](Self::with_all).
    pub fn with(&self, pointer: &str, value: Value) -> Result<Self, SceneError> {
        self.with_all([(pointer, value)])
    }

    /// Returns the same scene with other values at several JSON pointers. Only the whole must be valid. A start that no longer fits is
    /// refused at its use: [`BuiltScene::start_faults`].
    ///
    /// # Errors
    /// [`SceneError`] if a pointer leads nowhere or the scene becomes invalid.
    pub fn with_all<'a>(&self, values: impl IntoIterator<Item = (&'a str, Value)>) -> Result<Self, SceneError> {
        let mut given = self.given.clone();
        let mut lost = Vec::new();
        for (pointer, value) in values {
            let keys = pointer.split('/').skip(1).map(|key| key.replace("~1", "/").replace("~0", "~"));
            let start = (&mut given, Some(&self.resolved));
            let place = keys.into_iter().try_fold(start, |(place, resolved), key| {
                let index = key.parse::<usize>();
                let resolved = resolved.and_then(|all| match all {
                    Value::Array(items) => items.get(index.clone().ok()?),
                    all => all.get(&key),
                });
                let place = match place {
                    // Values of a preset or a default are inserted: a list whole, of an object the requested key.
                    Value::Object(object) => Some(object.entry(key).or_insert_with(|| match resolved {
                        Some(list @ Value::Array(_)) => list.clone(),
                        _ => Value::Object(Map::new()),
                    })),
                    Value::Array(items) => index.ok().and_then(|i| items.get_mut(i)),
                    _ => None,
                };
                Some((place?, resolved))
            });
            match place {
                Some((place, _)) => *place = value,
                None => {
                    let fault = Fault::new(pointer, "a pointer that leads nowhere", "a place in the scene");
                    lost.push(fault.remedy("check the pointer against the resolved scene"));
                }
            }
        }
        if lost.is_empty() { Self::with_any_start(given, &self.name) } else { Err(SceneError::new(&self.name, lost)) }
    }

    /// Returns the name of the scene: its file, or the name given to [`from_json`](Self::from_json).
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the scene as it was written.
    #[must_use]
    pub fn given(&self) -> &Value {
        &self.given
    }

    /// Returns the scene with every default written out.
    #[must_use]
    pub fn resolved(&self) -> &Value {
        &self.resolved
    }

    /// Returns the SHA-256 of the resolved scene, hexadecimal, without name and note.
    #[must_use]
    pub fn hash(&self) -> String {
        hash(&self.resolved)
    }

    /// Returns the train, the start and the run.
    #[must_use]
    pub fn built(&self) -> &BuiltScene {
        &self.built
    }

    /// Returns a copy of [`built`](Self::built).
    ///
    /// # Errors
    /// Never: a scene is built when it is read.
    pub fn build(&self) -> Result<BuiltScene, SceneError> {
        Ok(self.built.clone())
    }

    /// Returns name, resolved scene, and its result.
    pub(crate) fn into_parts(self) -> (String, Value, BuiltScene) {
        (self.name, self.resolved, self.built)
    }

    /// Builds the scene with other numbers at JSON pointers of the resolved scene: as [`with_all`](Self::with_all) and
    /// [`build`](Self::build) together, several times as fast.
    ///
    /// The ranges of keys are not checked again: the numbers must lie between valid ones.
    ///
    /// # Errors
    /// [`SceneError`] if there is no number at a pointer, or no train with these numbers.
    pub fn build_with<'a>(&self, numbers: impl IntoIterator<Item = (&'a str, f64)>) -> Result<BuiltScene, SceneError> {
        Variant::new(self).build(numbers)
    }
}

/// Replaces invisible characters in all texts of a scene, except notes, which may have several lines.
fn make_visible(value: &mut Value) {
    match value {
        Value::String(text) if text.contains(|c: char| !c.is_ascii_graphic()) => *text = visible(text),
        Value::Array(items) => items.iter_mut().for_each(make_visible),
        Value::Object(object) => {
            object.iter_mut().filter(|(key, _)| *key != "note").for_each(|(_, item)| make_visible(item))
        }
        _ => {}
    }
}

/// Adds every key below `pointer`, with the pointer of its place.
fn keys(value: &Value, pointer: &str, found: &mut Vec<(String, String)>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| {
            let pointer = fault::below(pointer, key);
            found.push((key.clone(), pointer.clone()));
            keys(value, &pointer, found);
        }),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, value)| keys(value, &format!("{pointer}/{i}"), found));
        }
        _ => {}
    }
}

/// Returns warnings as faults, if `asked` demands a scene without any.
#[must_use]
pub fn strict(warnings: &[Warning], asked: &str) -> Vec<Fault> {
    let fault = |warning: &Warning| {
        let found = format!("a warning: {warning}");
        Fault::new(asked, found, "a scene without warnings").remedy("mend what it says, or leave strict out")
    };
    warnings.iter().map(fault).collect()
}

/// Returns the places of a pointer list in the scene as written: common values of all meshes of a gearbox are under the train.
fn as_written(given: &Value, pointers: &str) -> String {
    let shared = |pointer: &str| {
        let words: Vec<&str> = pointer.split('/').skip(1).collect();
        let rest = match words.as_slice() {
            ["train", "meshes", _, "rack", rest @ ..] | ["train", "stages", _, "rack", rest @ ..] => ("rack", rest),
            ["train", "meshes", _, rest @ ..] => ("mesh", rest),
            ["train", "stages", _, "sun_mesh" | "ring_mesh", rest @ ..] => ("mesh", rest),
            _ => return None,
        };
        let place = std::iter::once(rest.0).chain(rest.1.iter().copied()).fold("/train".to_owned(), |p, w| p + "/" + w);
        let is_shared = !rest.1.is_empty() && given.pointer(pointer).is_none() && given.pointer(&place).is_some();
        is_shared.then_some(place)
    };
    let mut places: Vec<String> = pointers.split(", ").map(|p| shared(p).unwrap_or_else(|| p.to_owned())).collect();
    places.dedup();
    places.join(", ")
}

/// Scene whose numbers are set repeatedly.
pub(crate) struct Variant<'s> {
    scene: &'s Scene,
    resolved: Value,
}

impl<'s> Variant<'s> {
    pub fn new(scene: &'s Scene) -> Self {
        Self { scene, resolved: scene.resolved.clone() }
    }

    /// Builds as [`Scene::build_with`] does; numbers set by earlier calls, even failed ones, keep their values.
    pub fn build<'a>(&mut self, numbers: impl IntoIterator<Item = (&'a str, f64)>) -> Result<BuiltScene, SceneError> {
        let name = &self.scene.name;
        for (pointer, number) in numbers {
            let place = self.resolved.pointer_mut(pointer).filter(|place| place.is_number());
            let fault = match place {
                Some(place) if number.is_finite() => {
                    *place = number.into();
                    continue;
                }
                // JSON has no such number, and the place would be lost.
                Some(_) => Fault::new(pointer, number.to_string(), "a finite number"),
                None => Fault::new(pointer, "a pointer to no number", "a number of the resolved scene"),
            };
            return Err(SceneError::new(name, vec![fault]));
        }
        build::build(&self.resolved).map_err(|faults| SceneError::new(name, faults))
    }
}

/// Returns the SHA-256 of a resolved scene, hexadecimal, without name and note.
pub(crate) fn hash(resolved: &Value) -> String {
    let mut scene = resolved.clone();
    if let Value::Object(object) = &mut scene {
        object.remove("name");
        object.remove("note");
    }
    // JSON without spaces, keys sorted: the same scene is the same text.
    scene.sort_all_objects();
    Sha256::digest(scene.to_string().as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the JSON Schema (draft 2020-12) of a scene.
#[must_use]
pub fn schema() -> Value {
    build::schema()
}
