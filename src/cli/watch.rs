//! What a run writes while it goes on.

use std::{
    fs::File,
    io::{LineWriter, Write},
    ops::ControlFlow,
};

use flank::analysis::EventRow;

/// Writes event rows, one JSON object a line; keeps the first error.
pub struct EventFile {
    file: Option<LineWriter<File>>,
    error: Option<std::io::Error>,
}

impl EventFile {
    /// Into `file`, or nowhere.
    pub fn new(file: Option<LineWriter<File>>) -> Self {
        Self { file, error: None }
    }

    /// Writes a row; breaks off if that fails.
    pub fn write(&mut self, row: &EventRow) -> ControlFlow<()> {
        let Some(file) = &mut self.file else { return ControlFlow::Continue(()) };
        let written = serde_json::to_string(row).map_err(Into::into).and_then(|line| writeln!(file, "{line}"));
        match written {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.error = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// Ends the file.
    pub fn finish(self) -> std::io::Result<()> {
        match self.error {
            Some(error) => Err(error),
            None => self.file.map_or(Ok(()), |mut file| file.flush()),
        }
    }
}
