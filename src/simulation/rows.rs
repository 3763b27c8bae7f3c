//! Rows of events, as they are written.

use std::{
    borrow::Cow,
    fs::File,
    io::{self, LineWriter, Write},
    ops::ControlFlow,
};

use crate::{
    analysis::{ContactEvent, EventRow},
    output::{csv_line, label, number},
};

/// Writer of event rows: to files, one JSON object a line and one line of a table for each contact, or to a callback. Stores the first error.
pub(super) struct EventRows<'a> {
    /// Each line reaches a file as it is written.
    files: [Option<LineWriter<File>>; 2],
    error: Option<io::Error>,
    take: &'a mut dyn FnMut(EventRow) -> ControlFlow<()>,
}

/// Values of a column, by the event of a contact and the row of its instant.
#[derive(Clone, Copy, Debug)]
pub enum EventValues {
    /// Whole numbers.
    Whole(fn(&EventRow) -> i64),
    /// Numbers of the instant.
    Instant(fn(&EventRow) -> f64),
    /// Decimal numbers of the instant in all their digits, and rounded to doubles.
    Decimal(fn(&EventRow) -> (&str, f64)),
    /// Numbers of the contact, absent where its event has none.
    Contact(fn(&ContactEvent) -> Option<f64>),
    /// Names.
    Word(fn(&ContactEvent) -> Cow<'_, str>),
}

/// Column of the table of events, which has a line for each contact of each instant.
#[derive(Clone, Copy, Debug)]
pub struct EventColumn {
    name: &'static str,
    /// End of the name that gives the unit.
    unit: &'static str,
    values: EventValues,
}

impl EventColumn {
    /// Returns the name with its unit; a dimensionless train has no units.
    #[must_use]
    pub fn name(&self, is_dimensionless: bool) -> String {
        format!("{}{}", self.name, if is_dimensionless { "" } else { self.unit })
    }

    /// Returns its values.
    #[must_use]
    pub fn values(&self) -> EventValues {
        self.values
    }

    /// Returns the cell of `contact` at the instant of `row`.
    fn cell(&self, row: &EventRow, contact: &ContactEvent) -> String {
        match self.values {
            Whole(value) => value(row).to_string(),
            Instant(value) => number(value(row)),
            Decimal(value) => value(row).0.to_owned(),
            Contact(value) => value(contact).map_or_else(String::new, number),
            Word(word) => word(contact).into_owned(),
        }
    }
}

use EventValues::{Contact, Decimal, Instant, Whole, Word};

const fn column(name: &'static str, unit: &'static str, values: EventValues) -> EventColumn {
    EventColumn { name, unit, values }
}

/// Columns of the table of events.
pub const EVENT_COLUMNS: [EventColumn; 18] = [
    // Exact: a run has fewer than 2⁶³ events.
    column("index", "", Whole(|row| row.index as i64)),
    column("cycle", "", Whole(|row| row.n)),
    column("phase", "_s", Instant(|row| row.phase)),
    column("t", "_s", Decimal(|row| (&row.t, row.seconds))),
    column("uncertainty", "_s", Instant(|row| row.uncertainty)),
    column("contact", "", Word(|c| Cow::Borrowed(&c.name))),
    column("kind", "", Word(|c| Cow::Owned(label(c.kind)))),
    column("from", "", Word(|c| Cow::Borrowed(c.from))),
    column("to", "", Word(|c| Cow::Borrowed(c.to))),
    column("deflection", "_m", Contact(|c| Some(c.deflection))),
    column("velocity", "_m_per_s", Contact(|c| Some(c.velocity))),
    column("approach", "_m_per_s", Contact(|c| c.approach)),
    column("release", "_m_per_s", Contact(|c| c.release)),
    column("duration", "_s", Contact(|c| c.duration)),
    column("peak_force", "_n", Contact(|c| c.peak_force)),
    column("impulse", "_n_s", Contact(|c| c.impulse)),
    column("energy_lost", "_j", Contact(|c| c.energy_lost)),
    column("restitution", "", Contact(|c| c.restitution)),
];

/// Returns the first line of a table of events.
#[must_use]
pub fn event_head(is_dimensionless: bool) -> String {
    csv_line(EVENT_COLUMNS.iter().map(|column| column.name(is_dimensionless)))
}

/// Returns the lines of an instant, one for each contact with an event.
pub fn event_lines(row: &EventRow) -> impl Iterator<Item = String> {
    row.contacts.iter().map(move |contact| csv_line(EVENT_COLUMNS.iter().map(|column| column.cell(row, contact))))
}

impl<'a> EventRows<'a> {
    /// Writes to these files, the table with its head, and passes the rows to `take`.
    pub fn new(
        files: [Option<File>; 2],
        is_dimensionless: bool,
        take: &'a mut dyn FnMut(EventRow) -> ControlFlow<()>,
    ) -> io::Result<Self> {
        let mut files = files.map(|file| file.map(LineWriter::new));
        if let [_, Some(table)] = &mut files {
            writeln!(table, "{}", event_head(is_dimensionless))?;
        }
        Ok(Self { files, error: None, take })
    }

    /// Adds a row; interrupts the run if it cannot be written.
    pub fn take(&mut self, row: EventRow) -> ControlFlow<()> {
        match self.write(&row) {
            Ok(()) => (self.take)(row),
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

    /// Completes the files.
    pub fn finish(mut self) -> io::Result<()> {
        self.error.map_or(Ok(()), Err)?;
        self.files.iter_mut().flatten().try_for_each(Write::flush)
    }
}
