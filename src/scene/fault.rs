//! What is wrong with a scene, where, and what to write instead.

use std::fmt;

use serde_json::Value;

/// Faults printed at once; a list of a million wrong items has a million.
const SHOWN: usize = 100;

/// One thing wrong in a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// JSON pointer to the place, such as `/train/contacts/0/law/kind`; empty for the whole file.
    pub pointer: String,
    /// What stands there.
    pub found: String,
    /// What may stand there.
    pub allowed: String,
    /// What to do about it.
    pub remedy: String,
}

impl Fault {
    /// A fault without a remedy.
    pub fn new(pointer: &str, found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self { pointer: pointer.to_owned(), found: found.into(), allowed: allowed.into(), remedy: String::new() }
    }

    /// The same fault with a remedy.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = remedy.into();
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = if self.pointer.is_empty() { "(the whole scene)" } else { &self.pointer };
        write!(f, "  at {place}\n    found:   {}\n    allowed: {}", self.found, self.allowed)?;
        if !self.remedy.is_empty() {
            write!(f, "\n    remedy:  {}", self.remedy)?;
        }
        Ok(())
    }
}

/// A scene that cannot be used, with everything that is wrong with it.
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

/// Something the user should know about a scene that is nevertheless usable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// JSON pointer to the place that causes it.
    pub pointer: String,
    /// The warning, one sentence.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.pointer, self.message)
    }
}

/// A value as it appears in a message: short, whatever its size.
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

/// Pointer to `key` below `pointer`, escaped as RFC 6901 asks.
pub(super) fn below(pointer: &str, key: &str) -> String {
    format!("{pointer}/{}", key.replace('~', "~0").replace('/', "~1"))
}

/// The name closest to `word`, if one is close enough to be meant.
pub(super) fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase().replace([' ', '_'], "-");
    let mut best: Option<(usize, &str)> = None;
    for name in names {
        let plain = name.replace('_', "-");
        // A key without its unit, or with the wrong one, is the commonest slip.
        let stem =
            word.len() >= 3 && (plain.starts_with(&format!("{word}-")) || word.starts_with(&format!("{plain}-")));
        let distance = if stem { 1 } else { edits(&word, &plain) };
        if distance <= 2.max(plain.len() / 3) && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, name));
        }
    }
    best.map(|(_, name)| name)
}

/// Edits (insert, delete, replace) that turn one word into another.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(64).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
