//! What may stand where: one description that the check, the defaults and the JSON Schema all read.

use serde_json::Value;

/// Longest list a scene may hold.
const MAX_LIST: usize = 1_000_000;

/// Unit suffixes of the keys, or none for a train in dimensionless form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Units {
    /// SI units, named in the keys.
    Si,
    /// Dimensionless.
    None,
}

impl Units {
    /// A key with its unit: `key("period", "s")` is `period_s`, or `period` in dimensionless form.
    pub fn key(self, stem: &str, unit: &str) -> String {
        match self {
            Self::Si => format!("{stem}_{unit}"),
            Self::None => stem.to_owned(),
        }
    }
}

/// Where a number may lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// Lower bound, and whether it belongs to the span.
    pub low: Option<(f64, bool)>,
    /// Upper bound, and whether it belongs to the span.
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

/// What a value may be.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// A finite number.
    Number(Span),
    /// A whole number.
    Whole {
        /// Least.
        min: u64,
        /// Greatest.
        max: u64,
    },
    /// `true` or `false`.
    Flag,
    /// Any text.
    Text,
    /// A decimal number as text, of any length.
    Decimal,
    /// One of a few words.
    Choice(Vec<&'static str>),
    /// A list.
    List {
        /// What each item may be.
        item: Box<Shape>,
        /// Fewest items.
        min: usize,
        /// Most items.
        max: usize,
    },
    /// An object whose keys the user names.
    Map(Box<Shape>),
    /// An object with known keys.
    Object(Object),
    /// An object whose keys depend on the word under one of them.
    Variant {
        /// The key that holds the word.
        tag: &'static str,
        /// What each word brings.
        cases: Vec<(&'static str, Object)>,
    },
    /// One of several shapes, told apart by their JSON types.
    Either(Vec<Shape>),
}

/// An object with known keys.
#[derive(Clone, Debug, Default)]
pub(super) struct Object {
    /// What it is.
    pub about: &'static str,
    /// Its keys.
    pub fields: Vec<Field>,
    /// Keys that exclude each other.
    pub groups: Vec<Group>,
    /// Whether it may be written in part, the rest coming from a preset.
    pub partial: bool,
    /// Keys people write by mistake, and what to write instead.
    pub mistakes: Vec<(&'static str, &'static str)>,
}

/// Keys of which at most one, or exactly one, is written.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// The keys.
    pub keys: Vec<String>,
    /// Whether one of them is needed.
    pub needed: bool,
}

/// A key of an object.
#[derive(Clone, Debug)]
pub(super) struct Field {
    /// The key.
    pub key: String,
    /// What it means.
    pub about: &'static str,
    /// What it may hold.
    pub shape: Shape,
    /// Whether it may be left out.
    pub presence: Presence,
}

/// Whether a key may be left out.
#[derive(Clone, Debug)]
pub(super) enum Presence {
    /// It may not.
    Needed,
    /// It may, or be `null`; nothing stands for it then.
    Free,
    /// It may, or be `null`; this value stands for it then.
    Default(Value),
}

impl Object {
    pub fn new(about: &'static str) -> Self {
        Self { about, ..Self::default() }
    }

    /// A key that must be written.
    pub fn needed(self, key: impl Into<String>, shape: Shape, about: &'static str) -> Self {
        self.field(key.into(), shape, about, Presence::Needed)
    }

    /// A key that may be left out.
    pub fn free(self, key: impl Into<String>, shape: Shape, about: &'static str) -> Self {
        self.field(key.into(), shape, about, Presence::Free)
    }

    /// A key with a default.
    pub fn with_default(
        self,
        key: impl Into<String>,
        value: impl Into<Value>,
        shape: Shape,
        about: &'static str,
    ) -> Self {
        self.field(key.into(), shape, about, Presence::Default(value.into()))
    }

    fn field(mut self, key: String, shape: Shape, about: &'static str, presence: Presence) -> Self {
        self.fields.push(Field { key, about, shape, presence });
        self
    }

    /// Exactly one of these keys is written.
    pub fn exactly_one<S: Into<String>>(mut self, keys: impl IntoIterator<Item = S>) -> Self {
        self.groups.push(Group { keys: keys.into_iter().map(Into::into).collect(), needed: true });
        self
    }

    /// At most one of these keys is written.
    pub fn at_most_one<S: Into<String>>(mut self, keys: impl IntoIterator<Item = S>) -> Self {
        self.groups.push(Group { keys: keys.into_iter().map(Into::into).collect(), needed: false });
        self
    }

    /// It may be written in part, the rest coming from a preset.
    pub fn partial(mut self) -> Self {
        self.partial = true;
        self
    }

    /// A key often written by mistake.
    pub fn mistake(mut self, key: &'static str, remedy: &'static str) -> Self {
        self.mistakes.push((key, remedy));
        self
    }
}

/// Any finite number.
pub(super) fn number() -> Shape {
    Shape::Number(Span { low: None, high: None })
}

/// A number above zero.
pub(super) fn positive() -> Shape {
    Shape::Number(Span { low: Some((0.0, false)), high: None })
}

/// A number of at least `low`.
pub(super) fn at_least(low: f64) -> Shape {
    Shape::Number(Span { low: Some((low, true)), high: None })
}

/// A number from `low` to `high`, both allowed.
pub(super) fn within(low: f64, high: f64) -> Shape {
    Shape::Number(Span { low: Some((low, true)), high: Some((high, true)) })
}

/// A number strictly between `low` and `high`.
pub(super) fn between(low: f64, high: f64) -> Shape {
    Shape::Number(Span { low: Some((low, false)), high: Some((high, false)) })
}

/// A list of any length.
pub(super) fn list(item: Shape) -> Shape {
    Shape::List { item: Box::new(item), min: 0, max: MAX_LIST }
}

/// A list with a bounded length.
pub(super) fn list_of(min: usize, max: usize, item: Shape) -> Shape {
    Shape::List { item: Box::new(item), min, max }
}

/// One of a few words.
pub(super) fn choice(words: &[&'static str]) -> Shape {
    Shape::Choice(words.to_vec())
}

impl Shape {
    /// What it allows, in words.
    pub fn describe(&self) -> String {
        match self {
            Self::Number(span) => span.describe(),
            Self::Whole { min, max } if min == max => format!("the number {min}"),
            Self::Whole { min, max } if *max == u64::MAX => format!("a whole number >= {min}"),
            Self::Whole { min, max } => format!("a whole number from {min} to {max}"),
            Self::Flag => "true or false".to_owned(),
            Self::Text => "a text".to_owned(),
            Self::Decimal => "a decimal number in quotation marks".to_owned(),
            Self::Choice(words) => quoted(words.iter().copied()),
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
                format!("an object whose \"{tag}\" is {}", quoted(cases.iter().map(|(name, _)| *name)))
            }
            Self::Either(shapes) => shapes.iter().map(Self::describe).collect::<Vec<_>>().join("; or "),
        }
    }

    /// Whether the JSON type of a value is the one this shape is about.
    pub fn is_about(&self, value: &Value) -> bool {
        match self {
            Self::Number(_) | Self::Whole { .. } => value.is_number(),
            Self::Flag => value.is_boolean(),
            Self::Text | Self::Decimal | Self::Choice(_) => value.is_string(),
            // A list of lists is told from a list of numbers by its first item.
            Self::List { item, .. } => {
                value.as_array().is_some_and(|items| items.first().is_none_or(|first| item.is_about(first)))
            }
            Self::Map(_) | Self::Object(_) | Self::Variant { .. } => value.is_object(),
            Self::Either(shapes) => shapes.iter().any(|shape| shape.is_about(value)),
        }
    }
}

/// `"a", "b" or "c"`.
pub(super) fn quoted<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    let words: Vec<String> = words.into_iter().map(|word| format!("\"{word}\"")).collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => words.concat(),
    }
}
