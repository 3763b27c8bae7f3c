//! JSON Schema (draft 2020-12) of a scene, from the shapes that the check uses.

use serde_json::{Map, Value, json};

use super::shape::{Object, Presence, Shape};

/// Returns the schema of a shape; in a partial object no key is required, as a preset may supply it.
pub(super) fn schema_of(shape: &Shape, partial: bool) -> Value {
    match shape {
        Shape::Number(span) => {
            let mut schema = Map::from_iter([("type".to_owned(), json!("number"))]);
            for (bound, closed, open) in
                [(span.low, "minimum", "exclusiveMinimum"), (span.high, "maximum", "exclusiveMaximum")]
            {
                if let Some((limit, included)) = bound {
                    schema.insert((if included { closed } else { open }).to_owned(), json!(limit));
                }
            }
            Value::Object(schema)
        }
        Shape::Whole { min, max } if *max == u64::MAX => json!({ "type": "integer", "minimum": min }),
        Shape::Whole { min, max } => json!({ "type": "integer", "minimum": min, "maximum": max }),
        Shape::Flag => json!({ "type": "boolean" }),
        Shape::Text(usize::MAX) => json!({ "type": "string" }),
        Shape::Text(most) => json!({ "type": "string", "maxLength": most }),
        Shape::Decimal => {
            json!({ "type": "string", "pattern": r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$" })
        }
        Shape::Ratio => json!({ "type": "string", "pattern": r"^\s*\d{1,5}\s*/\s*\d{1,5}\s*$" }),
        Shape::Choice(words) => json!({ "enum": words }),
        Shape::List { item, min, max } => {
            json!({ "type": "array", "items": schema_of(item, partial), "minItems": min, "maxItems": max })
        }
        Shape::Map(item) => json!({ "type": "object", "additionalProperties": schema_of(item, partial) }),
        Shape::Object(object) => schema_of_object(object, None, partial),
        Shape::Variant { tag, cases } => {
            let cases: Vec<Value> =
                cases.iter().map(|(name, object)| schema_of_object(object, Some((tag, name)), partial)).collect();
            json!({ (if partial { "anyOf" } else { "oneOf" }): cases })
        }
        Shape::Either(shapes) => {
            json!({ "anyOf": shapes.iter().map(|shape| schema_of(shape, partial)).collect::<Vec<_>>() })
        }
    }
}

fn schema_of_object(object: &Object, tag: Option<(&str, &str)>, within_partial: bool) -> Value {
    let partial = within_partial || object.partial;
    let mut properties = Map::new();
    let mut required = Vec::new();
    if let Some((tag, name)) = tag {
        properties.insert(tag.to_owned(), json!({ "const": name }));
        if !within_partial {
            required.push(tag);
        }
    }
    for field in &object.fields {
        let mut schema = match field.presence {
            Presence::Needed => schema_of(&field.shape, partial),
            Presence::Free | Presence::Default(_) => {
                json!({ "anyOf": [schema_of(&field.shape, partial), { "type": "null" }] })
            }
        };
        if let Value::Object(schema) = &mut schema {
            schema.insert("description".to_owned(), json!(field.about));
            if let Presence::Default(value) = &field.presence {
                schema.insert("default".to_owned(), value.clone());
            }
        }
        properties.insert(field.key.clone(), schema);
        if matches!(field.presence, Presence::Needed) && !partial {
            required.push(&field.key);
        }
    }
    let written = |key: &String| json!({ "required": [key], "properties": { key: { "not": { "type": "null" } } } });
    let groups: Vec<Value> = object
        .groups
        .iter()
        .map(|group| {
            let mut cases: Vec<Value> = group.keys.iter().map(written).collect();
            if partial || !group.needed {
                cases.push(json!({ "not": { "anyOf": cases } }));
            }
            json!({ "oneOf": cases })
        })
        .collect();
    let mut schema = json!({
        "type": "object",
        "description": object.about,
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    });
    if let (Value::Object(schema), false) = (&mut schema, groups.is_empty()) {
        schema.insert("allOf".to_owned(), Value::Array(groups));
    }
    schema
}
