//! Check of a value against its shape: all faults at once, and the value with every default written out.

use serde_json::{Map, Value};

use super::{
    fault::{Fault, below, nearest, show},
    shape::{Field, Object, Presence, Shape, quoted},
};
use crate::hybrid::Wide;

/// Checks `value` and returns it resolved: defaults written out, numbers in one form. With faults the result must not be used.
pub(super) fn check(value: &Value, shape: &Shape, pointer: &str, faults: &mut Vec<Fault>) -> Value {
    match (shape, value) {
        (Shape::Number(span), Value::Number(number)) => {
            let x = number.as_f64().unwrap_or(f64::NAN);
            if span.holds(x) {
                return Value::from(x);
            }
            faults.push(Fault::new(pointer, show(value), span.describe()).remedy("write a number in this range"));
        }
        (Shape::Whole { min, max }, Value::Number(number)) => match whole(number) {
            Some(n) if (*min..=*max).contains(&n) => return Value::from(n),
            _ => faults
                .push(Fault::new(pointer, show(value), shape.describe()).remedy("write a whole number in this range")),
        },
        (Shape::Flag, Value::Bool(_)) => return value.clone(),
        (Shape::Text(most), Value::String(text)) => match text.chars().count() {
            length if length <= *most => return value.clone(),
            length => {
                let found = format!("a text of {length} characters");
                faults.push(Fault::new(pointer, found, shape.describe()).remedy("shorten it"));
            }
        },
        (Shape::Decimal, Value::String(text)) => {
            if Wide::parse(text).is_some() {
                return value.clone();
            }
            let remedy = "write digits, with a point or an exponent if need be, below 1.8e308";
            faults.push(Fault::new(pointer, show(value), shape.describe()).remedy(remedy));
        }
        (Shape::Ratio, Value::String(text)) => {
            if let Some(ratio) = ratio(text) {
                return Value::from(ratio);
            }
            let remedy = "write two whole numbers, such as \"1/50\", or a number without quotation marks";
            faults.push(Fault::new(pointer, show(value), shape.describe()).remedy(remedy));
        }
        (Shape::Choice(words), Value::String(word)) => {
            if words.contains(word) {
                return value.clone();
            }
            faults.push(misspelt(pointer, word, words));
        }
        (Shape::List { item, min, max }, Value::Array(items)) => {
            if items.len() < *min || items.len() > *max {
                faults.push(
                    Fault::new(pointer, show(value), shape.describe()).remedy("write a list of the allowed length"),
                );
            }
            let each = |(i, v)| check(v, item, &below(pointer, &usize::to_string(&i)), faults);
            return Value::Array(items.iter().enumerate().map(each).collect());
        }
        (Shape::Map(item), Value::Object(map)) => {
            let each = |(k, v): (&String, &Value)| (k.clone(), check(v, item, &below(pointer, k), faults));
            return Value::Object(map.iter().map(each).collect());
        }
        (Shape::Object(object), Value::Object(map)) => return check_object(map, object, None, pointer, faults),
        (Shape::Variant { tag, cases }, Value::Object(map)) => return check_variant(map, tag, cases, pointer, faults),
        (Shape::Either(shapes), _) => {
            if let Some(shape) = shapes.iter().find(|shape| shape.is_about(value)) {
                return check(value, shape, pointer, faults);
            }
            faults.push(wrong_type(pointer, value, shape));
        }
        _ => faults.push(wrong_type(pointer, value, shape)),
    }
    Value::Null
}

fn whole(number: &serde_json::Number) -> Option<u64> {
    // 3.0 is accepted as 3: many programs write every number with a point.
    number
        .as_u64()
        .or_else(|| number.as_f64().filter(|x| (0.0..9.0e15).contains(x) && x.fract() == 0.0).map(|x| x as u64))
}

/// Returns the value of `p/q`, whole numbers from 1 to 10⁴: both can be recovered from the nearest double.
fn ratio(text: &str) -> Option<f64> {
    let (p, q) = text.split_once('/')?;
    let [p, q] = [p, q].map(|part| part.trim().parse::<u16>().ok().filter(|part| (1..=10_000).contains(part)));
    Some(f64::from(p?) / f64::from(q?))
}

fn wrong_type(pointer: &str, value: &Value, shape: &Shape) -> Fault {
    let remedy = match (shape, value) {
        (_, Value::Null) => "write a value: null stands only for a key that may be left out",
        (Shape::Number(_) | Shape::Whole { .. }, Value::String(_)) => "write the number without quotation marks",
        _ => "write a value of the allowed type",
    };
    Fault::new(pointer, show(value), shape.describe()).remedy(remedy)
}

fn misspelt(pointer: &str, word: &str, words: &[String]) -> Fault {
    let words = || words.iter().map(String::as_str);
    let remedy = nearest(word, words())
        .map_or_else(|| "choose one of the allowed words".to_owned(), |name| format!("did you mean \"{name}\"?"));
    Fault::new(pointer, show(&Value::from(word)), quoted(words())).remedy(remedy)
}

fn check_variant(
    map: &Map<String, Value>,
    tag: &str,
    cases: &[(String, Object)],
    pointer: &str,
    faults: &mut Vec<Fault>,
) -> Value {
    let names: Vec<String> = cases.iter().map(|(name, _)| name.clone()).collect();
    let quoted_names = || quoted(names.iter().map(String::as_str));
    let place = below(pointer, tag);
    match map.get(tag) {
        Some(Value::String(word)) => match cases.iter().find(|(name, _)| name == word) {
            Some((_, object)) => return check_object(map, object, Some((tag, word)), pointer, faults),
            None => faults.push(misspelt(&place, word, &names)),
        },
        Some(other) => faults.push(
            Fault::new(&place, show(other), quoted_names()).remedy("write one of the allowed words in quotation marks"),
        ),
        None => faults.push(
            Fault::new(&place, "nothing: the key is missing", quoted_names()).remedy(format!("add the key \"{tag}\"")),
        ),
    }
    Value::Null
}

fn check_object(
    map: &Map<String, Value>,
    object: &Object,
    tag: Option<(&str, &str)>,
    pointer: &str,
    faults: &mut Vec<Fault>,
) -> Value {
    for key in map.keys() {
        if object.fields.iter().all(|f| f.key != *key) && tag.is_none_or(|(t, _)| t != key) {
            faults.push(unknown_key(pointer, key, object));
        }
    }
    let mut resolved: Map<String, Value> =
        object.fields.iter().map(|f| (f.key.clone(), check_field(map, f, pointer, faults))).collect();
    if let Some((tag, word)) = tag {
        resolved.insert(tag.to_owned(), Value::from(word));
    }
    for group in &object.groups {
        let written: Vec<&str> =
            group.keys.iter().filter(|k| map.get(*k).is_some_and(|v| !v.is_null())).map(String::as_str).collect();
        let allowed = format!("{} one of {}", if group.needed { "exactly" } else { "at most" }, either(&group.keys));
        if written.len() > 1 {
            let found = format!("{} keys that exclude each other", written.len());
            faults.push(Fault::new(&below(pointer, written[1]), found, allowed).remedy("keep one of them"));
        } else if written.is_empty() && group.needed {
            let place = below(pointer, &group.keys[0]);
            let remedy = format!("add one of the keys {}", either(&group.keys));
            faults.push(Fault::new(&place, "nothing: the key is missing", allowed).remedy(remedy));
        }
    }
    Value::Object(resolved)
}

fn either(keys: &[String]) -> String {
    quoted(keys.iter().map(String::as_str))
}

fn check_field(map: &Map<String, Value>, field: &Field, pointer: &str, faults: &mut Vec<Fault>) -> Value {
    let place = below(pointer, &field.key);
    match (map.get(&field.key), &field.presence) {
        (Some(Value::Null) | None, Presence::Free) => Value::Null,
        // Defaults are checked too, so that defaults within them are written out.
        (Some(Value::Null) | None, Presence::Default(value)) => check(value, &field.shape, &place, faults),
        (Some(value), _) => check(value, &field.shape, &place, faults),
        (None, Presence::Needed) => {
            faults.push(
                Fault::new(&place, "nothing: the key is missing", field.shape.describe())
                    .remedy(format!("add the key \"{}\": {}", field.key, field.about)),
            );
            Value::Null
        }
    }
}

fn unknown_key(pointer: &str, key: &str, object: &Object) -> Fault {
    let names = || object.fields.iter().map(|f| f.key.as_str());
    let remedy = if let Some((_, remedy)) = object.mistakes.iter().find(|(mistake, _)| *mistake == key) {
        remedy.clone()
    } else if let Some(name) = nearest(key, names()) {
        format!("did you mean \"{name}\"?")
    } else {
        "remove the key".to_owned()
    };
    Fault::new(&below(pointer, key), "a key that is not known here", quoted(names())).remedy(remedy)
}
