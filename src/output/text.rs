//! Numbers, names and fields as text.

use serde::Serialize;
use serde_json::Value;

/// A number in a table: as many digits as it takes to read the same double, with an exponent where that is shorter.
pub fn number(value: f64) -> String {
    format!("{value:?}")
}

/// A line of a data file without its end: fields joined by commas, in quotes where RFC 4180 asks for them.
pub fn csv_line(fields: impl IntoIterator<Item: AsRef<str>>) -> String {
    let quoted = |field: &str| match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.to_owned(),
    };
    fields.into_iter().map(|field| quoted(field.as_ref())).collect::<Vec<_>>().join(",")
}

/// The name of a variant in data files, as serde writes it.
///
/// # Panics
/// If the value is not written as a text.
pub fn label(variant: impl Serialize) -> String {
    let value = serde_json::to_value(variant).ok();
    value.as_ref().and_then(Value::as_str).expect("a variant is written as its name").to_owned()
}

/// A number to five digits, in the form that reads best; `-` for none.
#[must_use]
pub fn five_digits(value: impl Into<Option<f64>>) -> String {
    match value.into() {
        None => "-".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(v) if !v.is_finite() => "-".to_owned(),
        Some(v) if (1e-3..1e6).contains(&v.abs()) => {
            let decimals = (4 - v.abs().log10().floor() as i32).clamp(0, 8) as usize;
            let text = format!("{v:.decimals$}");
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
        }
        Some(v) => format!("{v:.4e}"),
    }
}
