//! The JSON syntax, read as a stream: data that are not needed take no memory.

use std::{collections::BTreeMap, fmt, marker::PhantomData};

use serde::{
    Deserialize, Deserializer,
    de::{Error, IgnoredAny, SeqAccess, Visitor},
};

use super::{
    ImportError,
    model::{self, Model, Value},
    read::{COMPONENTS, LONGEST, RELATIONS, decoded, is_read, unreadable},
};

/// Reads the JSON syntax.
pub(super) fn read(text: &str) -> Result<Model, ImportError> {
    let file: File = match serde_json::from_str(text) {
        Ok(file) => file,
        Err(error) => return unreadable(error.to_string()),
    };
    let component = |component: Component| {
        let Component { id, kind, name, attributes } = component;
        model::Component { id: id.0, kind, name: name.unwrap_or_default(), attributes: attributes.0 }
    };
    let relation = |relation: Relation| model::Relation {
        kind: relation.kind,
        refs: relation.refs.0.into_iter().map(|end| (end.role, end.id.0)).collect(),
    };
    let case = |case: LoadCase| model::LoadCase {
        id: case.id.0,
        components: case.components.0.into_iter().map(component).collect(),
    };
    let Content { version, application, components, relations, load_spectrum } = file.model;
    Ok(Model {
        version: version.0,
        application: application.unwrap_or_default(),
        components: components.0.into_iter().map(component).collect(),
        relations: relations.0.into_iter().map(relation).collect(),
        load_cases: load_spectrum.unwrap_or_default().load_cases.0.into_iter().map(case).collect(),
    })
}

#[derive(Deserialize)]
struct File {
    model: Content,
}

#[derive(Deserialize)]
struct Content {
    version: Id,
    #[serde(rename = "applicationId")]
    application: Option<String>,
    #[serde(default)]
    components: Few<Component, COMPONENTS>,
    #[serde(default)]
    relations: Few<Relation, RELATIONS>,
    load_spectrum: Option<LoadSpectrum>,
}

#[derive(Default, Deserialize)]
struct LoadSpectrum {
    #[serde(default)]
    load_cases: Few<LoadCase, LONGEST>,
}

#[derive(Deserialize)]
struct LoadCase {
    id: Id,
    #[serde(default)]
    components: Few<Component, COMPONENTS>,
}

#[derive(Deserialize)]
struct Component {
    id: Id,
    #[serde(rename = "type", default)]
    kind: String,
    name: Option<String>,
    #[serde(default)]
    attributes: Attributes,
}

#[derive(Deserialize)]
struct Relation {
    #[serde(rename = "type")]
    kind: String,
    refs: Few<End, LONGEST>,
}

#[derive(Deserialize)]
struct End {
    id: Id,
    role: String,
}

/// Identifier in the file, written as a number or as a text.
struct Id(String);

impl<'de> Deserialize<'de> for Id {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum TextOrNumber {
            Number(u64),
            Text(String),
        }
        Ok(Self(match TextOrNumber::deserialize(deserializer)? {
            TextOrNumber::Number(number) => number.to_string(),
            TextOrNumber::Text(text) => text,
        }))
    }
}

/// List of at most `MOST` items; a longer one is an error.
struct Few<T, const MOST: usize = LONGEST>(Vec<T>);

impl<T, const MOST: usize> Default for Few<T, MOST> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>, const MOST: usize> Deserialize<'de> for Few<T, MOST> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut kept = Vec::new();
        let keep = |item| {
            kept.push(item);
            kept.len() <= MOST
        };
        deserializer.deserialize_seq(Each(keep, PhantomData))?;
        Ok(Self(kept))
    }
}

/// The first [`LONGEST`] items of a list.
struct First<T>(Vec<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for First<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut kept = Vec::new();
        let keep = |item| {
            if kept.len() < LONGEST {
                kept.push(item);
            }
            true
        };
        deserializer.deserialize_seq(Each(keep, PhantomData))?;
        Ok(Self(kept))
    }
}

/// Visitor that reads the items of a list one by one, until its function refuses one.
struct Each<T, F>(F, PhantomData<T>);

impl<'de, T: Deserialize<'de>, F: FnMut(T) -> bool> Visitor<'de> for Each<T, F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut items: A) -> Result<(), A::Error> {
        while let Some(item) = items.next_element()? {
            if !(self.0)(item) {
                return Err(A::Error::custom("a list that is too long for a gearbox"));
            }
        }
        Ok(())
    }
}

/// Attributes that are read, by name.
#[derive(Default)]
struct Attributes(BTreeMap<String, model::Attribute>);

impl<'de> Deserialize<'de> for Attributes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut kept = BTreeMap::new();
        let keep = |attribute: Attribute| {
            let Attribute { id, unit, value } = attribute;
            if let Some(value) = value {
                kept.insert(id, model::Attribute { unit, value });
            }
            true
        };
        deserializer.deserialize_seq(Each(keep, PhantomData))?;
        Ok(Self(kept))
    }
}

struct Attribute {
    id: String,
    unit: String,
    value: Option<Value>,
}

#[derive(Deserialize)]
struct CodeAttribute {
    code: String,
    value: String,
}

impl<'de> Deserialize<'de> for Attribute {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Written)
    }
}

struct Written;

impl<'de> Visitor<'de> for Written {
    type Value = Attribute;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an attribute")
    }

    fn visit_map<A: serde::de::MapAccess<'de>>(self, mut map: A) -> Result<Attribute, A::Error> {
        let mut attribute = Attribute { id: String::new(), unit: String::new(), value: None };
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "id" => attribute.id = map.next_value()?,
                "unit" => attribute.unit = map.next_value::<Option<String>>()?.unwrap_or_default(),
                "floating_point" | "integer" => {
                    attribute.value = map.next_value::<Option<f64>>()?.map(|x| Value::Numbers(vec![x]));
                }
                "boolean" => attribute.value = map.next_value::<Option<bool>>()?.map(|b| Value::Word(b.to_string())),
                "string" | "enum" | "date_time" => {
                    attribute.value = map.next_value::<Option<String>>()?.map(Value::Word)
                }
                "reference_component" => attribute.value = map.next_value::<Option<Id>>()?.map(|id| Value::Word(id.0)),
                "floating_point_array" | "integer_array" => {
                    attribute.value = Some(Value::Numbers(map.next_value::<First<f64>>()?.0));
                }
                "boolean_array" => {
                    let flags = map.next_value::<First<bool>>()?.0;
                    attribute.value = Some(Value::Words(flags.iter().map(bool::to_string).collect()));
                }
                "string_array" | "enum_array" => {
                    attribute.value = Some(Value::Words(map.next_value::<First<String>>()?.0))
                }
                "floating_point_array_coded" | "integer_array_coded" => {
                    let CodeAttribute { code, value } = map.next_value()?;
                    let numbers = decoded(&code, &value)
                        .map_err(|words| A::Error::custom(format!("attribute {}: {words}", attribute.id)))?;
                    attribute.value = Some(Value::Numbers(numbers));
                }
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        attribute.value = attribute.value.filter(|_| is_read(&attribute.id));
        Ok(attribute)
    }
}
