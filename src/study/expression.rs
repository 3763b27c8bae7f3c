//! Expressions over measured numbers in claims: `max(sun.range) > 1e-6 && at(speeds, ring.first, 500) < 80`.
//!
//! Values are JSON: numbers, texts, truths, lists, objects, and `none`, which an unknown name gives too. Operators and `.name` work on
//! lists item by item. A value that cannot be computed is `none`; comparisons with it are false, except `==` and `!=`.

use serde_json::{Map, Value, json};

use crate::gear::contact::restitution;

/// Operators by rising precedence; all bind to the left.
const LEVELS: [&[&str]; 6] = [&["||"], &["&&"], &["==", "!=", "<=", ">=", "<", ">"], &["+", "-"], &["*", "/"], &["^"]];

/// Returns the value of an expression in which `names` are known.
pub(super) fn evaluate(text: &str, names: &Map<String, Value>) -> Result<Value, String> {
    let mut reader = Reader { rest: text, names };
    let value = reader.binary(0)?;
    match reader.rest.trim() {
        "" => Ok(value),
        rest => Err(format!("{text}: not understood from \"{rest}\" on")),
    }
}

/// Returns a text with every `{expression}`, `{expression:.2}` or `{expression:+.2}` in it replaced by its value.
pub(super) fn fill(template: &str, names: &Map<String, Value>) -> Result<String, String> {
    let (mut text, mut rest) = (String::new(), template);
    while let Some((before, after)) = rest.split_once('{') {
        let (inside, after) = after.split_once('}').ok_or_else(|| format!("{template}: a brace is not closed"))?;
        let (expression, digits) = inside.split_once(':').unwrap_or((inside, ""));
        let value = evaluate(expression, names)?;
        if value.is_null() {
            return Err(format!("{template}: {expression} has no value"));
        }
        text = text + before + &written(&value, digits);
        rest = after;
    }
    Ok(text + rest)
}

/// Returns a value in words; `digits` is empty, `.2` or `+.2`. Lists are joined by commas.
fn written(value: &Value, digits: &str) -> String {
    let places = digits.trim_start_matches(['+', '.']).parse::<usize>();
    match (value, value.as_f64(), places) {
        (Value::Array(items), ..) => items.iter().map(|item| written(item, digits)).collect::<Vec<_>>().join(", "),
        (_, Some(number), Ok(places)) if digits.starts_with('+') => format!("{number:+.places$}"),
        (_, Some(number), Ok(places)) => format!("{number:.places$}"),
        (_, Some(number), Err(_)) => number.to_string(),
        (Value::String(text), ..) => text.clone(),
        _ => value.to_string(),
    }
}

struct Reader<'t> {
    rest: &'t str,
    names: &'t Map<String, Value>,
}

impl<'t> Reader<'t> {
    fn skip(&mut self, mark: &str) -> bool {
        let found = self.rest.trim_start().strip_prefix(mark);
        self.rest = found.unwrap_or(self.rest);
        found.is_some()
    }

    fn need(&mut self, mark: &str) -> Result<(), String> {
        if self.skip(mark) { Ok(()) } else { Err(format!("\"{mark}\" is missing before \"{}\"", self.rest)) }
    }

    /// Takes the longest start whose characters are `wanted`.
    fn take(&mut self, wanted: impl Fn(char) -> bool) -> &'t str {
        self.rest = self.rest.trim_start();
        let (taken, rest) = self.rest.split_at(self.rest.find(|c| !wanted(c)).unwrap_or(self.rest.len()));
        self.rest = rest;
        taken
    }

    fn binary(&mut self, level: usize) -> Result<Value, String> {
        let Some(operators) = LEVELS.get(level) else { return self.unary() };
        let mut left = self.binary(level + 1)?;
        while let Some(operator) = operators.iter().find(|operator| self.skip(operator)) {
            left = apply(operator, &left, &self.binary(level + 1)?);
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Value, String> {
        if self.skip("-") {
            return Ok(apply("-", &json!(0.0), &self.unary()?));
        }
        let mut value = self.primary()?;
        loop {
            if self.skip(".") {
                let name = self.take(is_of_name);
                value = member(&value, name);
            } else if self.skip("[") {
                let index = self.binary(0)?;
                value = index.as_f64().and_then(|i| value.get(i as usize)).cloned().unwrap_or_default();
                self.need("]")?;
            } else {
                return Ok(value);
            }
        }
    }

    fn primary(&mut self) -> Result<Value, String> {
        if self.skip("(") {
            let value = self.binary(0)?;
            return self.need(")").map(|()| value);
        }
        if self.skip("'") {
            let (text, rest) = self.rest.split_once('\'').ok_or("a quote is not closed")?;
            self.rest = rest;
            return Ok(json!(text));
        }
        let name = self.take(is_of_name);
        if name.starts_with(|c: char| c.is_ascii_digit()) {
            let mut text = name.to_owned();
            if self.skip(".") {
                text = text + "." + self.take(is_of_name);
            }
            if text.ends_with('e') && self.skip("-") {
                text = text + "-" + self.take(is_of_name);
            }
            return text.parse::<f64>().map(|number| json!(number)).map_err(|_| format!("\"{text}\" is no number"));
        }
        if name.is_empty() {
            return Err(format!("a value is missing before \"{}\"", self.rest));
        }
        if !self.skip("(") {
            return Ok(self.names.get(name).cloned().unwrap_or_default());
        }
        let mut arguments = Vec::new();
        while !self.skip(")") {
            arguments.push(self.binary(0)?);
            if !self.skip(",") {
                self.need(")")?;
                break;
            }
        }
        call(name, &arguments).ok_or_else(|| format!("there is no function {name} of {} such values", arguments.len()))
    }
}

fn is_of_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

fn member(value: &Value, name: &str) -> Value {
    match value {
        Value::Array(items) => items.iter().map(|item| member(item, name)).collect(),
        _ => value.get(name).cloned().unwrap_or_default(),
    }
}

fn apply(operator: &str, left: &Value, right: &Value) -> Value {
    match (left, right) {
        (Value::Array(a), Value::Array(b)) => a.iter().zip(b).map(|(a, b)| apply(operator, a, b)).collect(),
        (Value::Array(a), b) => a.iter().map(|a| apply(operator, a, b)).collect(),
        (a, Value::Array(b)) => b.iter().map(|b| apply(operator, a, b)).collect(),
        _ => scalar(operator, left, right),
    }
}

fn scalar(operator: &str, left: &Value, right: &Value) -> Value {
    let numbers = left.as_f64().zip(right.as_f64());
    let same = numbers.map_or(left == right, |(a, b)| a == b);
    let (yes, also) = (left.as_bool().unwrap_or(false), right.as_bool().unwrap_or(false));
    match (operator, numbers) {
        ("==", _) => json!(same),
        ("!=", _) => json!(!same),
        ("&&", _) => json!(yes && also),
        ("||", _) => json!(yes || also),
        ("<", _) => json!(numbers.is_some_and(|(a, b)| a < b)),
        (">", _) => json!(numbers.is_some_and(|(a, b)| a > b)),
        ("<=", _) => json!(numbers.is_some_and(|(a, b)| a <= b)),
        (">=", _) => json!(numbers.is_some_and(|(a, b)| a >= b)),
        ("+", Some((a, b))) => json!(a + b),
        ("-", Some((a, b))) => json!(a - b),
        ("*", Some((a, b))) => json!(a * b),
        ("/", Some((a, b))) => json!(a / b),
        ("^", Some((a, b))) => json!(libm::pow(a, b)),
        ("+", None) if left.is_string() || right.is_string() => json!(written(left, "") + &written(right, "")),
        _ => Value::Null,
    }
}

/// Returns the numbers of a list; empty for other values.
fn list(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

/// Returns the larger or smaller value; item by item if one is a list.
fn extreme(pick: fn(f64, f64) -> f64, a: &Value, b: &Value) -> Value {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.iter().zip(b).map(|(a, b)| extreme(pick, a, b)).collect(),
        _ => a.as_f64().zip(b.as_f64()).map_or(Value::Null, |(a, b)| json!(pick(a, b))),
    }
}

/// Evaluates a function; `None` if the function is unknown.
fn call(name: &str, arguments: &[Value]) -> Option<Value> {
    let pick = if name == "max" { f64::max } else { f64::min };
    Some(match (name, arguments) {
        ("if", [condition, yes, no]) => {
            if condition.as_bool()? {
                yes.clone()
            } else {
                no.clone()
            }
        }
        ("abs", [x]) => x.as_f64().map_or(Value::Null, |x| json!(x.abs())),
        ("text", [x, places]) => json!(written(x, &format!(".{}", places.as_f64()?))),
        ("len", [items]) => json!(items.as_array().map_or(0, Vec::len)),
        ("count", [truths]) => json!(truths.as_array()?.iter().filter(|truth| truth.as_bool() == Some(true)).count()),
        ("all", [truths]) => json!(truths.as_array()?.iter().all(|truth| truth.as_bool() == Some(true))),
        ("first", [items, count]) => items.as_array()?.iter().take(count.as_f64()? as usize).cloned().collect(),
        ("last", [items]) => items.as_array()?.last().cloned().unwrap_or_default(),
        // Items whose truth is true.
        ("where", [items, truths]) => {
            let kept = items.as_array()?.iter().zip(truths.as_array()?);
            kept.filter(|(_, truth)| truth.as_bool() == Some(true)).map(|(item, _)| item.clone()).collect()
        }
        ("steps", [items]) => list(items).windows(2).map(|pair| json!(pair[1] - pair[0])).collect(),
        ("max" | "min", [items]) => list(items).into_iter().reduce(pick).map_or(Value::Null, |most| json!(most)),
        ("max" | "min", [first, rest @ ..]) => rest.iter().fold(first.clone(), |a, b| extreme(pick, &a, b)),
        // Index of the largest number of a list, from 0; the first one of several.
        ("place", [items]) => {
            let items = list(items);
            json!((0..items.len()).fold(0, |most, i| if items[i] > items[most] { i } else { most }))
        }
        ("at", [xs, ys, x]) => json!(at(&list(xs), &list(ys), x.as_f64()?)),
        ("r2", [xs, ys]) => json!(linearity(&list(xs), &list(ys))),
        // True if a list contains enough points of a curve, and these among them. A value that was read off a source at one place is
        // compared there, not between its neighbours.
        ("curve", [xs, wanted @ ..]) => {
            let xs = list(xs);
            let there = |x: f64| xs.iter().any(|own| (own - x).abs() <= 1e-9 * x.abs().max(1.0));
            json!(xs.len() >= 20 && wanted.iter().filter_map(Value::as_f64).all(there))
        }
        // Restitution of a contact with this coefficient of hysteresis.
        ("restitution", [coefficient]) => json!(restitution(coefficient.as_f64()?)),
        _ => return None,
    })
}

/// Returns the value at `x` of a curve through points in rising order, linear between them.
fn at(xs: &[f64], ys: &[f64], x: f64) -> Option<f64> {
    match xs.iter().position(|v| *v >= x) {
        Some(0) => ys.first().copied(),
        Some(i) => Some(ys.get(i - 1)? + (ys.get(i)? - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1])),
        None => ys.last().copied(),
    }
}

/// Returns the coefficient of determination of the straight line through points, `1 − Σ(y − ŷ)²/Σ(y − ȳ)²`.
fn linearity(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sum = |a: &[f64], ma: f64, b: &[f64], mb: f64| a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>();
    let (xx, xy, yy) = (sum(x, mx, x, mx), sum(x, mx, y, my), sum(y, my, y, my));
    if xx * yy > 0.0 { xy * xy / (xx * yy) } else { 0.0 }
}
