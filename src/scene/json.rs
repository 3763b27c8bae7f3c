//! JSON text to value, with checks that `serde_json` lacks: duplicate keys, size of the file.

use std::{cell::RefCell, fmt};

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

use super::fault::{Fault, below};

/// Largest scene, bytes.
pub(super) const MAX_BYTES: u64 = 64 << 20;

/// Reads a text as JSON; a text that is not JSON is one fault, duplicate keys are one each.
pub(super) fn parse(text: &str) -> Result<Value, Vec<Fault>> {
    // Some editors start a file with a byte order mark; it carries no meaning in UTF-8.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.len() as u64 > MAX_BYTES {
        return Err(vec![too_large(&format!("{} bytes", text.len()))]);
    }
    if text.trim().is_empty() {
        return Err(vec![
            Fault::new("", "nothing: the text is empty", "a JSON object")
                .remedy("start from an example scene, such as reference-light.json"),
        ]);
    }
    let twice = RefCell::new(Vec::new());
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = Node { pointer: String::new(), twice: &twice }
        .deserialize(&mut reader)
        .and_then(|value| reader.end().map(|()| value))
        .map_err(|error| vec![not_json(text, &error)])?;
    let twice = twice.into_inner();
    if twice.is_empty() { Ok(value) } else { Err(twice) }
}

pub(super) fn too_large(found: &str) -> Fault {
    Fault::new("", found, format!("at most {MAX_BYTES} bytes"))
        .remedy("a scene describes one case; split what does not belong to it")
}

fn not_json(text: &str, error: &serde_json::Error) -> Fault {
    let line = text.lines().nth(error.line().saturating_sub(1)).unwrap_or("");
    let rest: String = line.chars().skip(error.column().saturating_sub(1)).take(12).collect();
    let spelled = |word: &str| rest.trim_start_matches(['-', '+']).to_lowercase().starts_with(word);
    let message = error.to_string();
    let (allowed, remedy) = if spelled("nan") || spelled("inf") {
        ("finite numbers", "JSON has no NaN and no Infinity: write a finite number, or leave the key out")
    } else if message.contains("out of range") {
        ("numbers a double can hold, below 1.8e308", "write a smaller number")
    } else if message.contains("recursion limit") {
        ("at most 127 levels of nesting", "a scene needs fewer than ten: look for a bracket that is never closed")
    } else if error.is_eof() {
        ("a complete JSON object", "the text stops early: look for a missing bracket or quotation mark")
    } else {
        ("JSON", "look for a missing or trailing comma, a comment, or single quotation marks")
    };
    Fault::new("", message, allowed).remedy(remedy)
}

/// Visitor of one value that notes duplicate keys below it.
struct Node<'a> {
    pointer: String,
    twice: &'a RefCell<Vec<Fault>>,
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, v: bool) -> Result<Value, E> {
        Ok(Value::Bool(v))
    }

    fn visit_u64<E>(self, v: u64) -> Result<Value, E> {
        Ok(Value::Number(v.into()))
    }

    fn visit_i64<E>(self, v: i64) -> Result<Value, E> {
        Ok(Value::Number(v.into()))
    }

    fn visit_f64<E>(self, v: f64) -> Result<Value, E> {
        Ok(Number::from_f64(v).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, v: &str) -> Result<Value, E> {
        Ok(Value::String(v.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        loop {
            let node = Node { pointer: below(&self.pointer, &items.len().to_string()), twice: self.twice };
            match list.next_element_seed(node)? {
                Some(item) => items.push(item),
                None => return Ok(Value::Array(items)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = map.next_key::<String>()? {
            let pointer = below(&self.pointer, &key);
            if object.contains_key(&key) {
                self.twice
                    .borrow_mut()
                    .push(Fault::new(&pointer, "a key written twice", "each key once").remedy("keep one of the two"));
            }
            let value = map.next_value_seed(Node { pointer, twice: self.twice })?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}
