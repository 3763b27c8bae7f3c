//! Scene that an import writes, and the origin of each of its numbers.

use std::collections::BTreeSet;

use serde::Serialize;
use serde_json::{Map, Value};

use super::Options;
use crate::output::Fault;

/// Largest number of faults that are listed.
const MOST: usize = 100;

/// Kind of the origin of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Source {
    /// An attribute of the file.
    File,
    /// A rule with attributes of the file.
    Rule,
    /// A usual value: the file has none.
    Default,
    /// A value given by the user.
    Set,
}

/// Origin of a number of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Origin {
    /// JSON pointer of the number in the scene.
    pub pointer: String,
    /// Value of the number in the scene.
    pub value: Value,
    /// Kind of the origin.
    pub source: Source,
    /// Component and attribute, or the rule.
    pub from: String,
}

/// Scene that is being written, with the origins of its numbers and the faults found.
pub(super) struct Ledger<'o> {
    pub scene: Value,
    pub origins: Vec<Origin>,
    pub faults: Vec<Fault>,
    /// Remarks on data that were read and not used, or used with a doubt.
    pub notes: Vec<String>,
    options: &'o Options,
    set: BTreeSet<&'o str>,
}

impl<'o> Ledger<'o> {
    pub fn new(options: &'o Options) -> Self {
        let scene = Value::Object(Map::new());
        Self { scene, origins: Vec::new(), faults: Vec::new(), notes: Vec::new(), options, set: BTreeSet::new() }
    }

    /// Writes a value without an origin, such as a name or a kind.
    pub fn plain(&mut self, pointer: &str, value: impl Into<Value>) {
        insert(&mut self.scene, pointer, value.into());
    }

    /// Writes a number, unless the user has set another one there.
    pub fn write(&mut self, pointer: &str, value: impl Into<Value>, source: Source, from: impl Into<String>) {
        let (value, source, from) = match self.options.set.iter().find(|(own, _)| own == pointer) {
            Some((own, value)) => {
                self.set.insert(own);
                (value.clone(), Source::Set, "--set".to_owned())
            }
            None => (value.into(), source, from.into()),
        };
        insert(&mut self.scene, pointer, value.clone());
        // A gear in two meshes is written twice, with the same numbers.
        self.origins.retain(|origin| origin.pointer != pointer);
        self.origins.push(Origin { pointer: pointer.to_owned(), value, source, from });
    }

    /// Writes a usual value; without usual values it is requested from the user.
    pub fn usual(&mut self, pointer: &str, value: impl Into<Value>, what: &str) {
        let value = value.into();
        if self.options.no_defaults && !self.is_set(pointer) {
            self.ask(pointer, format!("no {what}"), format!("a value; {value} is usual"));
        } else {
            self.write(pointer, value, Source::Default, what);
        }
    }

    /// Requests a number that the file does not have: a fault, unless the user has set it.
    pub fn ask(&mut self, pointer: &str, found: impl Into<String>, allowed: impl Into<String>) {
        if self.is_set(pointer) {
            self.write(pointer, Value::Null, Source::Set, "");
        } else {
            let remedy = format!("add --set {pointer}=VALUE");
            self.faults.push(Fault::new(pointer, found, allowed).remedy(remedy));
        }
    }

    pub fn fault(&mut self, place: &str, found: impl Into<String>, allowed: &str, remedy: &str) {
        match self.faults.len() {
            ..MOST => self.faults.push(Fault::new(place, found, allowed).remedy(remedy)),
            MOST => self.faults.push(
                Fault::new("the file", format!("more faults than these {MOST}"), "a gearbox")
                    .remedy("mend these first"),
            ),
            _ => {}
        }
    }

    pub fn is_set(&self, pointer: &str) -> bool {
        self.options.set.iter().any(|(own, _)| own == pointer)
    }

    /// Writes the other values that the user has set.
    pub fn finish(&mut self) {
        for (pointer, value) in &self.options.set {
            if !self.set.contains(pointer.as_str()) {
                self.write(pointer, value.clone(), Source::Set, "");
            }
        }
    }
}

/// Puts a value at a pointer. Objects and lists on the way are made; a number names a place in a list.
fn insert(root: &mut Value, pointer: &str, value: Value) {
    let mut at = root;
    for word in pointer.split('/').skip(1) {
        let word = word.replace("~1", "/").replace("~0", "~");
        let index = word.parse::<usize>().ok().filter(|i| *i <= 1000);
        if at.is_null() {
            *at = if index.is_some() { Value::Array(Vec::new()) } else { Value::Object(Map::new()) };
        }
        at = match (at, index) {
            (Value::Array(list), Some(i)) => {
                if list.len() <= i {
                    list.resize(i + 1, Value::Null);
                }
                &mut list[i]
            }
            (at, _) => {
                if !at.is_object() {
                    *at = Value::Object(Map::new());
                }
                at.as_object_mut().expect("it was made one").entry(word).or_insert(Value::Null)
            }
        };
    }
    *at = value;
}
