//! Rows of events, as they are written.

use std::{
    fs::File,
    io::{self, LineWriter, Write},
    ops::ControlFlow,
};

use crate::{
    analysis::{ContactEvent, EventRow},
    output::{csv_line, label, number},
};

/// Writer of event rows: to files, one JSON object a line and one line of a table for each contact, or to memory. Stores the first error.
pub(super) struct EventRows {
    /// Each line reaches a file as it is written.
    files: [Option<LineWriter<File>>; 2],
    error: Option<io::Error>,
    is_kept: bool,
    kept: Vec<EventRow>,
}

/// A column of the table: its name, its unit, its cell.
type Column = (&'static str, &'static str, fn(&EventRow, &ContactEvent) -> String);

const COLUMNS: [Column; 18] = [
    ("index", "", |row, _| row.index.to_string()),
    ("cycle", "", |row, _| row.n.to_string()),
    ("phase", "_s", |row, _| number(row.phase)),
    ("t", "_s", |row, _| row.t.clone()),
    ("uncertainty", "_s", |row, _| number(row.uncertainty)),
    ("contact", "", |_, c| c.name.clone()),
    ("kind", "", |_, c| label(c.kind)),
    ("from", "", |_, c| c.from.to_owned()),
    ("to", "", |_, c| c.to.to_owned()),
    ("deflection", "_m", |_, c| number(c.deflection)),
    ("velocity", "_m_per_s", |_, c| number(c.velocity)),
    ("approach", "_m_per_s", |_, c| cell(c.approach)),
    ("release", "_m_per_s", |_, c| cell(c.release)),
    ("duration", "_s", |_, c| cell(c.duration)),
    ("peak_force", "_n", |_, c| cell(c.peak_force)),
    ("impulse", "_n_s", |_, c| cell(c.impulse)),
    ("energy_lost", "_j", |_, c| cell(c.energy_lost)),
    ("restitution", "", |_, c| cell(c.restitution)),
];

fn cell(value: Option<f64>) -> String {
    value.map_or_else(String::new, number)
}

/// Returns the first line of a table of events. A dimensionless train has no units.
#[must_use]
pub fn event_head(is_dimensionless: bool) -> String {
    csv_line(COLUMNS.iter().map(|(name, unit, _)| format!("{name}{}", if is_dimensionless { "" } else { unit })))
}

/// Returns the lines of an instant, one for each contact with an event.
pub fn event_lines(row: &EventRow) -> impl Iterator<Item = String> {
    row.contacts.iter().map(move |contact| csv_line(COLUMNS.iter().map(|(.., cell)| cell(row, contact))))
}

impl EventRows {
    /// Writes to these files, the table with its head; stores the rows if `is_kept`.
    pub fn new(files: [Option<File>; 2], is_dimensionless: bool, is_kept: bool) -> io::Result<Self> {
        let mut files = files.map(|file| file.map(LineWriter::new));
        if let [_, Some(table)] = &mut files {
            writeln!(table, "{}", event_head(is_dimensionless))?;
        }
        Ok(Self { files, error: None, is_kept, kept: Vec::new() })
    }

    /// Adds a row; interrupts the run if it cannot be written.
    pub fn take(&mut self, row: EventRow) -> ControlFlow<()> {
        match self.write(&row) {
            Ok(()) => {
                if self.is_kept {
                    self.kept.push(row);
                }
                ControlFlow::Continue(())
            }
            Err(error) => {
                self.error = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    fn write(&mut self, row: &EventRow) -> io::Result<()> {
        let [log, table] = &mut self.files;
        if let Some(log) = log {
            writeln!(log, "{}", serde_json::to_string(row)?)?;
        }
        if let Some(table) = table {
            event_lines(row).try_for_each(|line| writeln!(table, "{line}"))?;
        }
        Ok(())
    }

    /// Completes the files and returns the stored rows.
    pub fn finish(mut self) -> io::Result<Vec<EventRow>> {
        self.error.map_or(Ok(()), Err)?;
        self.files.iter_mut().flatten().try_for_each(Write::flush)?;
        Ok(self.kept)
    }
}
