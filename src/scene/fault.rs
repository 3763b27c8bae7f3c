//! Faults of a scene, with their places and remedies.

use std::fmt;

use serde_json::Value;

pub use crate::output::Fault;

/// Maximum number of faults printed; a list of a million wrong items has a million.
const SHOWN: usize = 100;

/// Scene that cannot be used, with all its faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.report())]
pub struct SceneError {
    /// File or other name of the scene.
    pub name: String,
    /// All faults found, at least one.
    pub faults: Vec<Fault>,
}

impl SceneError {
    pub(super) fn new(name: &str, faults: Vec<Fault>) -> Self {
        Self { name: name.to_owned(), faults }
    }

    fn report(&self) -> String {
        let many = if self.faults.len() == 1 { "1 fault".to_owned() } else { format!("{} faults", self.faults.len()) };
        let mut text = format!("scene {} has {many}", self.name);
        for fault in self.faults.iter().take(SHOWN) {
            text.push('\n');
            text.push_str(&fault.to_string());
        }
        if self.faults.len() > SHOWN {
            text.push_str(&format!("\n  and {} more", self.faults.len() - SHOWN));
        }
        text
    }
}

/// Warning about a scene that is nevertheless usable.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Warning {
    /// JSON pointer to the cause.
    pub pointer: String,
    /// The warning, one sentence.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.pointer, self.message)
    }
}

/// Returns a value in the short form of messages.
pub(super) fn show(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("a list of {}", items.len()),
        Value::Object(_) => "an object".to_owned(),
        Value::String(text) if text.chars().count() > 60 => {
            format!("\"{}…\"", text.chars().take(60).collect::<String>())
        }
        other => other.to_string(),
    }
}

/// Returns the pointer to `key` below `pointer`, escaped by RFC 6901.
pub(super) fn below(pointer: &str, key: &str) -> String {
    // A scene that is built for each cell of a map comes here for every key.
    if !key.contains(['~', '/']) {
        return [pointer, "/", key].concat();
    }
    format!("{pointer}/{}", key.replace('~', "~0").replace('/', "~1"))
}

/// Returns the name closest to `word`, if one is close enough to be intended.
pub(super) fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase().replace([' ', '_'], "-");
    // No name is as long: further letters bring a word no nearer.
    let start: String = word.chars().take(64).collect();
    let mut best: Option<(usize, &str)> = None;
    for name in names {
        let plain = name.replace('_', "-");
        // A key without its unit, or with the wrong one, is the commonest slip.
        let stem =
            word.len() >= 3 && (plain.starts_with(&format!("{word}-")) || word.starts_with(&format!("{plain}-")));
        let distance = if stem { 1 } else { strsim::levenshtein(&start, &plain) };
        if distance <= 2.max(plain.len() / 3) && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, name));
        }
    }
    best.map(|(_, name)| name)
}
