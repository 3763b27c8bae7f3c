//! Numbers, names, fields and tables as text.

use std::fmt::{self, Write};

use serde::Serialize;
use serde_json::Value;

/// Returns a number in a table: with the digits that identify the double, and with an exponent if that is shorter.
pub fn number(value: f64) -> String {
    format!("{value:?}")
}

/// Returns a line of a data file without its end (RFC 4180), with an apostrophe before texts that spreadsheets take for formulas.
pub fn csv_line(fields: impl IntoIterator<Item: AsRef<str>>) -> String {
    let mut line = csv::WriterBuilder::new().buffer_capacity(BUFFER).from_writer(Vec::new());
    for field in fields {
        let field = field.as_ref();
        let is_formula = field.len() > 1 && field.starts_with(['=', '+', '-', '@']) && field.parse::<f64>().is_err();
        let done = if is_formula { line.write_field(format!("'{field}")) } else { line.write_field(field) };
        done.expect("memory takes every field");
    }
    line.write_record(None::<&[u8]>).expect("memory takes every line");
    let bytes = line.into_inner().expect("memory takes every line");
    let mut line = String::from_utf8(bytes).expect("fields and commas are UTF-8");
    line.pop();
    line
}

/// Bytes of the buffer of a line.
const BUFFER: usize = 512;

/// Returns a name in one line, with codes in place of controls and of characters that turn the writing direction.
pub fn visible(name: &str) -> String {
    let turns = |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let is_hidden = |c: char| c.is_control() || turns(c) || matches!(c, '\u{2028}' | '\u{2029}');
    name.chars().map(|c| if is_hidden(c) { c.escape_unicode().to_string() } else { c.to_string() }).collect()
}

/// Returns a text of several lines in one.
pub fn in_a_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}

/// Returns the name of a variant in data files, as serde writes it.
///
/// # Panics
/// If the value is not written as a text.
pub fn label(variant: impl Serialize) -> String {
    let value = serde_json::to_value(variant).ok();
    value.as_ref().and_then(Value::as_str).expect("a variant is written as its name").to_owned()
}

/// Returns a number to five digits, in the form that reads best; `-` for none.
#[must_use]
pub fn five_digits(value: impl Into<Option<f64>>) -> String {
    match value.into() {
        None => "-".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(v) if !v.is_finite() => "-".to_owned(),
        Some(v) if (1e-3..1e6).contains(&v.abs()) => {
            let decimals = (4 - libm::log10(v.abs()).floor() as i32).clamp(0, 8) as usize;
            let text = format!("{v:.decimals$}");
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
        }
        Some(v) => format!("{v:.4e}"),
    }
}

/// Table, by default of words. Its display is laid out for a terminal: the first column flush left, the others flush right.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table<C = String> {
    /// Title; may be empty.
    pub title: String,
    /// Heads of the columns, with units; may be empty.
    pub head: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<C>>,
    /// A line below; may be empty.
    pub note: String,
}

impl Table {
    /// Returns a table with this head.
    pub fn new(head: impl IntoIterator<Item: ToString>) -> Self {
        Self { head: head.into_iter().map(|word| word.to_string()).collect(), ..Self::default() }
    }

    /// Returns the table with these rows added.
    #[must_use]
    pub fn with(mut self, rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        self.rows.extend(rows);
        self
    }

    /// Returns the table with shorter names in its first column, if it then fits a terminal of 100 columns.
    #[must_use]
    pub fn fit(mut self) -> Self {
        let rows = || std::iter::once(&self.head).chain(&self.rows);
        let width = |i: usize| rows().filter_map(|row| row.get(i)).map(|cell| cell.chars().count()).max().unwrap_or(0);
        let columns = rows().map(Vec::len).max().unwrap_or(0);
        let excess = (0..columns).map(|i| width(i) + 2).sum::<usize>().saturating_sub(COLUMNS);
        let length = width(0).saturating_sub(excess);
        if excess > 0 && length >= SHORTEST {
            let names = self.rows.iter_mut().filter_map(|row| row.first_mut());
            names.for_each(|name| *name = shortened(name, length));
        }
        self
    }

    /// Returns the table as a data file (RFC 4180), without title and note.
    #[must_use]
    pub fn csv(&self) -> String {
        std::iter::once(&self.head).chain(&self.rows).map(|row| csv_line(row) + "\r\n").collect()
    }

    /// Returns the table under a title, with a note below it.
    #[must_use]
    pub fn titled(self, title: &str, note: impl Into<String>) -> Self {
        Self { title: title.to_owned(), note: note.into(), ..self }
    }
}

/// Columns of a terminal for a table, and least number of letters left of a name.
const COLUMNS: usize = 100;
const SHORTEST: usize = 16;

/// Returns a name of at most `length` letters: its beginning and its end.
fn shortened(name: &str, length: usize) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= length {
        return name.to_owned();
    }
    let head = (length - 1) / 2;
    let tail = letters.len() - (length - 1 - head);
    letters[..head].iter().chain(&['…']).chain(&letters[tail..]).collect()
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = || Some(&self.head).filter(|head| !head.is_empty()).into_iter().chain(&self.rows);
        let columns = rows().map(Vec::len).max().unwrap_or(0);
        let width = |i: usize| rows().filter_map(|row| row.get(i)).map(|c| c.chars().count()).max();
        let widths: Vec<usize> = (0..columns).map(|i| width(i).unwrap_or(0)).collect();
        for row in rows() {
            let mut line = String::new();
            for (i, (cell, width)) in row.iter().zip(&widths).enumerate() {
                if i == 0 {
                    write!(line, "  {cell:<width$}")?;
                } else {
                    write!(line, "  {cell:>width$}")?;
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}
