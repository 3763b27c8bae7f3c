//! Allowed values of a scene: one description for the check, the defaults and the JSON Schema.

use std::sync::LazyLock;

use serde_json::Value;

use super::{law, preset, run};

/// Longest list in a scene.
const MAX_LIST: usize = 1_000_000;

/// Unit suffixes of the keys, or none for a train in dimensionless form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Units {
    Si,
    None,
}

impl Units {
    /// Returns a key with its unit: `key("period", "s")` is `period_s`, or `period` in dimensionless form.
    pub fn key(self, stem: &str, unit: &str) -> String {
        match self {
            Self::Si => format!("{stem}_{unit}"),
            Self::None => stem.to_owned(),
        }
    }
}

/// Range of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// Lower bound, and true if it is included.
    pub low: Option<(f64, bool)>,
    /// Upper bound, and true if it is included.
    pub high: Option<(f64, bool)>,
}

impl Span {
    pub fn holds(&self, x: f64) -> bool {
        x.is_finite()
            && self.low.is_none_or(|(low, closed)| x > low || (closed && x == low))
            && self.high.is_none_or(|(high, closed)| x < high || (closed && x == high))
    }

    pub fn describe(&self) -> String {
        let sign = |closed: bool, strict: &str| if closed { format!("{strict}=") } else { strict.to_owned() };
        match (self.low, self.high) {
            (None, None) => "a finite number".to_owned(),
            (Some((low, closed)), None) => format!("a number {} {low}", sign(closed, ">")),
            (None, Some((high, closed))) => format!("a number {} {high}", sign(closed, "<")),
            (Some((low, a)), Some((high, b))) => {
                format!("a number from {low}{} to {high}{}", excluded(a), excluded(b))
            }
        }
    }
}

fn excluded(closed: bool) -> &'static str {
    if closed { "" } else { " (excluded)" }
}

/// Maximum number of characters of a name: it appears in tables, figures and messages.
const NAME: usize = 200;

/// Allowed form of a value.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    Number(Span),
    Whole {
        min: u64,
        max: u64,
    },
    Flag,
    /// A text of at most this number of characters.
    Text(usize),
    /// A decimal number as text, of any length.
    Decimal,
    /// A ratio of whole numbers as text, `"1/50"`; resolved to its number.
    Ratio,
    Choice(Vec<String>),
    List {
        item: Box<Shape>,
        min: usize,
        max: usize,
    },
    /// An object whose keys are names by the user.
    Map(Box<Shape>),
    Object(Object),
    /// An object whose keys depend on the word under one of them.
    Variant {
        tag: String,
        cases: Vec<(String, Object)>,
    },
    /// One of several shapes, distinguished by their JSON types.
    Either(Vec<Shape>),
}

#[derive(Clone, Debug, Default)]
pub(super) struct Object {
    pub about: String,
    pub fields: Vec<Field>,
    /// Keys that exclude each other.
    pub groups: Vec<KeyGroup>,
    /// True if a part suffices, with the rest from a preset.
    pub partial: bool,
    /// Keys in frequent mistakes, with the right key.
    pub mistakes: Vec<(String, String)>,
}

/// Keys of which at most one, or exactly one, is written.
#[derive(Clone, Debug)]
pub(super) struct KeyGroup {
    pub keys: Vec<String>,
    /// True if one of them is needed.
    pub needed: bool,
}

/// A key of an object.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub key: String,
    pub about: String,
    pub shape: Shape,
    pub presence: Presence,
}

/// Rule for a missing key.
#[derive(Clone, Debug)]
pub(super) enum Presence {
    Needed,
    /// The key may be missing, or be `null`, without a substitute.
    Free,
    /// The key may be missing, or be `null`; this value is its default.
    Default(Value),
}

pub(super) fn scene(units: Units) -> &'static Shape {
    fn read(units: Units) -> Shape {
        let all: Value = serde_json::from_str(include_str!("shapes.json")).expect("the shapes are JSON");
        Reader { all: &all, units }.shape(&all["scene"]).expect("the shapes are whole")
    }
    // Every run needs one of them.
    static SI: LazyLock<Shape> = LazyLock::new(|| read(Units::Si));
    static NONE: LazyLock<Shape> = LazyLock::new(|| read(Units::None));
    if units == Units::None { &NONE } else { &SI }
}

/// Reads `shapes.json`, shapes by name. A shape is
///
/// - a text: `number`, `number > 0`, `number 0 to 1 excluded`, `whole 1 to 10`, `flag`, `text`, `decimal`, `ratio`, or `@name`;
/// - a list of shapes, of which one fits;
/// - `{ "choice": words }`, `{ "list": shape, "min", "max" }`, `{ "map": shape }`, `{ "variant": tag, "cases": … }`;
/// - `{ "object": about, "keys": … }`, each key `[name, "needed" | "free" | { "default": value }, shape, about]`, or
///   `@name` for all keys of that object; `period~s` is `period_s`, or `period` in dimensionless form.
struct Reader<'v> {
    all: &'v Value,
    units: Units,
}

/// Returns the texts of a list.
fn texts(list: &Value) -> Vec<String> {
    list.as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

fn names<T>(table: &[(&str, T)]) -> Vec<String> {
    table.iter().map(|(name, _)| (*name).to_owned()).collect()
}

impl Reader<'_> {
    fn shape(&self, value: &Value) -> Option<Shape> {
        let limit = |key: &str, other| value[key].as_u64().map_or(Some(other), |n| usize::try_from(n).ok());
        Some(match value {
            Value::String(words) => self.word(words)?,
            Value::Array(shapes) => Shape::Either(shapes.iter().map(|shape| self.shape(shape)).collect::<Option<_>>()?),
            _ if value["choice"].is_array() => Shape::Choice(texts(&value["choice"])),
            _ if value["choice"] == "formulas" => Shape::Choice(names(&law::MODELS)),
            _ if value["choice"] == "methods" => Shape::Choice(names(&run::METHODS)),
            _ if value["choice"] == "presets" => Shape::Choice(names(&preset::PRESETS)),
            _ if !value["list"].is_null() => Shape::List {
                item: Box::new(self.shape(&value["list"])?),
                min: limit("min", 0)?,
                max: limit("max", MAX_LIST)?,
            },
            _ if !value["map"].is_null() => Shape::Map(Box::new(self.shape(&value["map"])?)),
            _ if !value["variant"].is_null() => {
                let cases = value["cases"].as_array()?.iter();
                let case = |case: &Value| Some((case[0].as_str()?.to_owned(), self.object(&case[1])?));
                Shape::Variant {
                    tag: value["variant"].as_str()?.to_owned(),
                    cases: cases.map(case).collect::<Option<_>>()?,
                }
            }
            _ => Shape::Object(self.object(value)?),
        })
    }

    fn word(&self, text: &str) -> Option<Shape> {
        if let Some(name) = text.strip_prefix('@') {
            return self.shape(self.all.get(name)?);
        }
        let number = |low: Option<(&str, bool)>, high: Option<(&str, bool)>| {
            let bound = |(word, closed): (&str, bool)| word.parse().ok().map(|limit: f64| (limit, closed));
            Shape::Number(Span { low: low.and_then(bound), high: high.and_then(bound) })
        };
        Some(match text.split(' ').collect::<Vec<_>>()[..] {
            ["flag"] => Shape::Flag,
            ["text"] => Shape::Text(usize::MAX),
            ["name"] => Shape::Text(NAME),
            ["decimal"] => Shape::Decimal,
            ["ratio"] => Shape::Ratio,
            ["number"] => number(None, None),
            ["number", ">", low] => number(Some((low, false)), None),
            ["number", ">=", low] => number(Some((low, true)), None),
            ["number", low, "to", high] => number(Some((low, true)), Some((high, true))),
            ["number", low, "excluded", "to", high] => number(Some((low, false)), Some((high, true))),
            ["number", low, "excluded", "to", high, "excluded"] => number(Some((low, false)), Some((high, false))),
            ["whole", min, "to", max] => Shape::Whole { min: min.parse().ok()?, max: max.parse().ok()? },
            _ => return None,
        })
    }

    fn object(&self, value: &Value) -> Option<Object> {
        if let Some(name) = value.as_str() {
            return self.object(self.all.get(name.strip_prefix('@')?)?);
        }
        let units = if value["dimensionless"] == true { Units::None } else { self.units };
        let own = Self { all: self.all, units };
        let mut object = Object {
            about: value["object"].as_str()?.to_owned(),
            partial: value["partial"] == true,
            ..Object::default()
        };
        for row in value["keys"].as_array()? {
            if row.is_string() {
                let part = own.object(row)?;
                object.fields.extend(part.fields);
                object.groups.extend(part.groups);
                object.mistakes.extend(part.mistakes);
                continue;
            }
            let presence = match row[1].as_str() {
                Some("needed") => Presence::Needed,
                Some(_) => Presence::Free,
                None => Presence::Default(row[1]["default"].clone()),
            };
            let about = row[3].as_str()?.to_owned();
            object.fields.push(Field { key: own.key(row[0].as_str()?), about, shape: own.shape(&row[2])?, presence });
        }
        for (name, needed) in [("one of", true), ("at most one of", false)] {
            for keys in value[name].as_array().into_iter().flatten() {
                object.groups.push(KeyGroup { keys: texts(keys).iter().map(|key| own.key(key)).collect(), needed });
            }
        }
        for pair in value["mistakes"].as_array().into_iter().flatten() {
            object.mistakes.push((pair[0].as_str()?.to_owned(), pair[1].as_str()?.to_owned()));
        }
        Some(object)
    }

    fn key(&self, marked: &str) -> String {
        marked.split_once('~').map_or_else(|| marked.to_owned(), |(stem, unit)| self.units.key(stem, unit))
    }
}

impl Shape {
    /// Returns the allowed values, in words.
    pub fn describe(&self) -> String {
        match self {
            Self::Number(span) => span.describe(),
            Self::Whole { min, max } if min == max => format!("the number {min}"),
            Self::Whole { min, max } if *max == u64::MAX => format!("a whole number >= {min}"),
            Self::Whole { min, max } => format!("a whole number from {min} to {max}"),
            Self::Flag => "true or false".to_owned(),
            Self::Text(usize::MAX) => "a text".to_owned(),
            Self::Text(most) => format!("a text of at most {most} characters"),
            Self::Decimal => "a decimal number in quotation marks".to_owned(),
            Self::Ratio => "a ratio \"p/q\" of whole numbers from 1 to 10000".to_owned(),
            Self::Choice(words) => quoted(words.iter().map(String::as_str)),
            Self::List { item, min, max } => {
                let length = match (*min, *max) {
                    (a, b) if a == b => format!(" ({a} items)"),
                    (0, MAX_LIST) => String::new(),
                    (a, MAX_LIST) => format!(" (at least {a})"),
                    (a, b) => format!(" ({a} to {b} items)"),
                };
                format!("a list{length}, each item {}", item.describe())
            }
            Self::Map(item) => format!("an object, each value {}", item.describe()),
            Self::Object(object) => {
                format!("an object with the keys {}", quoted(object.fields.iter().map(|f| f.key.as_str())))
            }
            Self::Variant { tag, cases } => {
                format!("an object whose \"{tag}\" is {}", quoted(cases.iter().map(|(name, _)| name.as_str())))
            }
            Self::Either(shapes) => shapes.iter().map(Self::describe).collect::<Vec<_>>().join("; or "),
        }
    }

    /// Returns whether a value has the JSON type of this shape.
    pub fn is_about(&self, value: &Value) -> bool {
        match self {
            Self::Number(_) | Self::Whole { .. } => value.is_number(),
            Self::Flag => value.is_boolean(),
            Self::Text(_) | Self::Decimal | Self::Ratio | Self::Choice(_) => value.is_string(),
            // A list of lists is distinguished from a list of numbers by its first item.
            Self::List { item, .. } => {
                value.as_array().is_some_and(|items| items.first().is_none_or(|first| item.is_about(first)))
            }
            Self::Map(_) | Self::Object(_) | Self::Variant { .. } => value.is_object(),
            Self::Either(shapes) => shapes.iter().any(|shape| shape.is_about(value)),
        }
    }
}

/// Returns quoted words: `"a", "b" or "c"`.
pub(super) fn quoted<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    let words: Vec<String> = words.into_iter().map(|word| format!("\"{word}\"")).collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => words.concat(),
    }
}
