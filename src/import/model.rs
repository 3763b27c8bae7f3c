//! Content of a file of the exchange format REXS: components with attributes, relations between them, load cases.

use std::collections::BTreeMap;

/// Value of an attribute.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Value {
    /// One word: a text, a number or a truth value as it is written.
    Word(String),
    /// Words of a list.
    Words(Vec<String>),
    /// Numbers of a JSON list or of an array in base64.
    Numbers(Vec<f64>),
}

/// An attribute of a component.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Attribute {
    /// Unit as it is written.
    pub unit: String,
    /// Value.
    pub value: Value,
}

/// A component: a part of the gearbox, or data about one.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Component {
    /// Identifier in the file.
    pub id: String,
    /// Type.
    pub kind: String,
    /// Name that a user gave, possibly empty.
    pub name: String,
    /// Attributes by name. If two have the same name, the last one counts.
    pub attributes: BTreeMap<String, Attribute>,
}

/// A relation between components.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Relation {
    /// Type.
    pub kind: String,
    /// Roles and identifiers of the components.
    pub refs: Vec<(String, String)>,
}

/// A load case: attributes that replace those of components.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LoadCase {
    /// Identifier in the file.
    pub id: String,
    /// Components with the attributes to replace.
    pub components: Vec<Component>,
}

/// Content of a file: one gearbox.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Model {
    /// Version of the format.
    pub version: String,
    /// Program that wrote the file.
    pub application: String,
    /// Components in the order of the file.
    pub components: Vec<Component>,
    /// Relations in the order of the file.
    pub relations: Vec<Relation>,
    /// Load cases in the order of the file.
    pub load_cases: Vec<LoadCase>,
}

impl Value {
    /// Returns the number, if the value is one finite number.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Word(word) => word.trim().parse().ok().filter(|x: &f64| x.is_finite()),
            Self::Numbers(numbers) => <[f64; 1]>::try_from(numbers.as_slice()).ok().map(|[x]| x),
            Self::Words(_) => None,
        }
    }

    /// Returns the numbers of a list.
    #[must_use]
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::Numbers(numbers) => Some(numbers.clone()),
            Self::Words(words) => words.iter().map(|word| Self::Word(word.clone()).number()).collect(),
            Self::Word(_) => None,
        }
    }

    /// Returns the truth value; of a list that of its first item.
    #[must_use]
    pub fn flag(&self) -> Option<bool> {
        let word = match self {
            Self::Word(word) => word,
            Self::Words(words) => words.first()?,
            Self::Numbers(numbers) => return numbers.first().map(|x| *x != 0.0),
        };
        match word.trim() {
            "true" | "1" => Some(true),
            "false" | "0" => Some(false),
            _ => None,
        }
    }

    /// Returns the value as text for messages.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Word(word) => word.trim().to_owned(),
            Self::Words(words) => words.join(" "),
            Self::Numbers(numbers) => numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" "),
        }
    }
}

impl Component {
    /// Returns the words for a component in messages: type, identifier and name.
    #[must_use]
    pub fn place(&self) -> String {
        if self.name.is_empty() {
            format!("{} {}", self.kind, self.id)
        } else {
            format!("{} {} \"{}\"", self.kind, self.id, self.name)
        }
    }

    /// Returns the truth value of an attribute.
    #[must_use]
    pub fn flag(&self, name: &str) -> Option<bool> {
        self.attributes.get(name)?.value.flag()
    }
}

impl Relation {
    /// Returns the identifier of the component with a role.
    #[must_use]
    pub fn of(&self, role: &str) -> Option<&str> {
        self.refs.iter().find(|(own, _)| own == role).map(|(_, id)| id.as_str())
    }
}

impl Model {
    /// Returns the component with an identifier.
    #[must_use]
    pub fn component(&self, id: &str) -> Option<&Component> {
        self.components.iter().find(|component| component.id == id)
    }

    /// Replaces the attributes that a load case names; returns whether there is such a load case.
    pub fn apply(&mut self, case: &str) -> bool {
        let Some(case) = self.load_cases.iter().find(|own| own.id == case).cloned() else { return false };
        for changed in case.components {
            if let Some(own) = self.components.iter_mut().find(|own| own.id == changed.id) {
                own.attributes.extend(changed.attributes);
            }
        }
        true
    }
}
