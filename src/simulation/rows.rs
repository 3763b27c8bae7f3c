//! Rows of events, as they are written.

use std::{
    borrow::Cow,
    fmt,
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

/// Value of a cell of the table of events.
#[derive(Clone, Debug, PartialEq)]
pub enum EventCell<'a> {
    /// A whole number.
    Whole(i64),
    /// A number, absent where the event has none.
    Number(Option<f64>),
    /// A decimal number in all its digits, and rounded to a double.
    Decimal(&'a str, f64),
    /// A name.
    Word(Cow<'a, str>),
}

impl fmt::Display for EventCell<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(value) => write!(f, "{value}"),
            Self::Number(None) => Ok(()),
            Self::Number(Some(value)) => f.write_str(&number(*value)),
            Self::Decimal(text, _) => f.write_str(text),
            Self::Word(word) => f.write_str(word),
        }
    }
}

/// Column of the table of events, which has a line for each contact of each instant.
#[derive(Clone, Copy, Debug)]
pub struct EventColumn {
    name: &'static str,
    /// End of the name that gives the unit.
    unit: &'static str,
    cell: for<'a> fn(&'a EventRow, &'a ContactEvent) -> EventCell<'a>,
}

impl EventColumn {
    /// Returns the name with its unit; a dimensionless train has no units.
    #[must_use]
    pub fn name(&self, is_dimensionless: bool) -> String {
        format!("{}{}", self.name, if is_dimensionless { "" } else { self.unit })
    }

    /// Returns the value of `contact` at the instant of `row`.
    #[must_use]
    pub fn cell<'a>(&self, row: &'a EventRow, contact: &'a ContactEvent) -> EventCell<'a> {
        (self.cell)(row, contact)
    }
}

const fn column(
    name: &'static str,
    unit: &'static str,
    cell: for<'a> fn(&'a EventRow, &'a ContactEvent) -> EventCell<'a>,
) -> EventColumn {
    EventColumn { name, unit, cell }
}

use EventCell::{Decimal, Number, Whole, Word};

/// Columns of the table of events.
pub const EVENT_COLUMNS: [EventColumn; 18] = [
    // Exact: a run has fewer than 2⁶³ events.
    column("index", "", |row, _| Whole(row.index as i64)),
    column("cycle", "", |row, _| Whole(row.n)),
    column("phase", "_s", |row, _| Number(Some(row.phase))),
    column("t", "_s", |row, _| Decimal(&row.t, row.seconds)),
    column("uncertainty", "_s", |row, _| Number(Some(row.uncertainty))),
    column("contact", "", |_, c| Word(Cow::Borrowed(&c.name))),
    column("kind", "", |_, c| Word(Cow::Owned(label(c.kind)))),
    column("from", "", |_, c| Word(Cow::Borrowed(c.from))),
    column("to", "", |_, c| Word(Cow::Borrowed(c.to))),
    column("deflection", "_m", |_, c| Number(Some(c.deflection))),
    column("velocity", "_m_per_s", |_, c| Number(Some(c.velocity))),
    column("approach", "_m_per_s", |_, c| Number(c.approach)),
    column("release", "_m_per_s", |_, c| Number(c.release)),
    column("duration", "_s", |_, c| Number(c.duration)),
    column("peak_force", "_n", |_, c| Number(c.peak_force)),
    column("impulse", "_n_s", |_, c| Number(c.impulse)),
    column("energy_lost", "_j", |_, c| Number(c.energy_lost)),
    column("restitution", "", |_, c| Number(c.restitution)),
];

/// Returns the first line of a table of events.
#[must_use]
pub fn event_head(is_dimensionless: bool) -> String {
    csv_line(EVENT_COLUMNS.iter().map(|column| column.name(is_dimensionless)))
}

/// Returns the lines of an instant, one for each contact with an event.
pub fn event_lines(row: &EventRow) -> impl Iterator<Item = String> {
    row.contacts
        .iter()
        .map(move |contact| csv_line(EVENT_COLUMNS.iter().map(|column| column.cell(row, contact).to_string())))
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
