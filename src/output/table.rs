use std::fmt::{self, Write};

use serde::Serialize;

/// A table, of words if not of other cells. Displayed, it is laid out for a terminal: the first column flush left, the others flush right.
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
    /// A table with this head.
    pub fn new(head: impl IntoIterator<Item: ToString>) -> Self {
        Self { head: head.into_iter().map(|word| word.to_string()).collect(), ..Self::default() }
    }

    /// The table with these rows too.
    #[must_use]
    pub fn with(mut self, rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        self.rows.extend(rows);
        self
    }

    /// The table under a title, with a note below it.
    #[must_use]
    pub fn titled(self, title: &str, note: impl Into<String>) -> Self {
        Self { title: title.to_owned(), note: note.into(), ..self }
    }
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
