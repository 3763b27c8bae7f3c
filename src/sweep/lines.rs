use std::{
    fs::File,
    io::{BufRead, BufReader, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use serde_json::{Map, Value};

use super::{
    Begin, Kept, SweepError,
    files::Part,
    journal::{is_torn, same},
};
use crate::output::{Folder, failed};

/// The rows of a table in their order, kept in a file as they finish: a header, then one line a row. Memory does not grow with them.
///
/// The file is locked while it is open. A line is written at once and is complete when its end of line is there; what a killed process left
/// of a line is dropped. So the rows that are kept are always the first ones.
#[derive(Debug)]
pub struct Lines {
    kept: Kept,
    folder: PathBuf,
    header: Map<String, Value>,
    path: PathBuf,
    file: File,
    count: usize,
}

impl Lines {
    /// Opens the file of rows in `folder`, created if need be. `header` is what they depend on. `None` if the work is to be resumed, and
    /// is finished.
    ///
    /// # Errors
    /// [`SweepError`] if the folder is occupied, in use or holds other rows, or if a file cannot be read or written. Nothing is changed
    /// then.
    pub fn open(
        folder: &Path,
        kept: Kept,
        begin: Begin,
        header: Map<String, Value>,
    ) -> Result<Option<Self>, SweepError> {
        let path = folder.join(kept.files[0]);
        let Some((file, outputs)) = kept.claim(folder, begin, &header)? else { return Ok(None) };
        let mut lines = Self { kept, folder: folder.to_owned(), header, path, file, count: 0 };
        let mut end = 0;
        if begin != Begin::Replace {
            let fail = failed(&lines.path);
            let (mut reader, mut line) = (BufReader::new(&lines.file), Vec::new());
            loop {
                line.clear();
                reader.read_until(b'\n', &mut line).map_err(&fail)?;
                let is_head = end == 0;
                let Some(text) = line.strip_suffix(b"\n") else {
                    if is_head && !is_torn(&line, &lines.header) {
                        let (path, reason) = (lines.path.clone(), "not written by this command".to_owned());
                        return Err(SweepError::Damaged { path, line: 1, reason });
                    }
                    break;
                };
                if is_head {
                    let header = serde_json::from_slice(text).map_err(|error| SweepError::Damaged {
                        path: lines.path.clone(),
                        line: 1,
                        reason: error.to_string(),
                    })?;
                    same(folder, &header, &lines.header)?;
                } else {
                    lines.count += 1;
                }
                end += line.len() as u64;
            }
        }
        kept.enter(folder, begin, (&lines.file, outputs), end)?;
        lines.file.seek(SeekFrom::End(0)).map_err(failed(&lines.path))?;
        if end == 0 {
            let header = Value::from(lines.header.clone()).to_string();
            lines.write(&header)?;
        }
        Ok(Some(lines))
    }

    fn write(&mut self, line: &str) -> Result<(), SweepError> {
        Ok(self.file.write_all(format!("{line}\n").as_bytes()).map_err(failed(&self.path))?)
    }

    /// Its folder, for figures; before any final file is written.
    pub(crate) fn outputs(&self) -> Result<Folder, SweepError> {
        self.kept.outputs(&self.folder)
    }

    /// How many rows are kept: the first ones.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Keeps the next row.
    ///
    /// # Errors
    /// [`SweepError::Output`] if it cannot be written.
    pub fn push(&mut self, row: &str) -> Result<(), SweepError> {
        self.write(row)?;
        self.count += 1;
        Ok(())
    }

    /// Hands all rows to `take`, in their order.
    ///
    /// # Errors
    /// [`SweepError::Output`] if they cannot be read, or the error of `take`.
    pub fn each(&mut self, mut take: impl FnMut(&str) -> Result<(), SweepError>) -> Result<(), SweepError> {
        let fail = failed(&self.path);
        self.file.seek(SeekFrom::Start(0)).map_err(&fail)?;
        for line in BufReader::new(&self.file).lines().skip(1) {
            take(&line.map_err(&fail)?)?;
        }
        self.file.seek(SeekFrom::End(0)).map_err(fail)?;
        Ok(())
    }

    /// The same, each row having been found to begin with the fields of its `place`.
    ///
    /// # Errors
    /// [`SweepError::Damaged`] with the first row that does not, [`SweepError::Output`] if they cannot be read.
    pub fn checked(mut self, places: usize, place: impl Fn(usize) -> String) -> Result<Self, SweepError> {
        let (path, mut row_number) = (self.path.clone(), 0);
        self.each(|row| {
            let begins = |place: String| row.strip_prefix(&place).is_some_and(|rest| rest.starts_with(','));
            if row_number >= places || !begins(place(row_number)) {
                let reason =
                    format!("it is not row {} of this work, nor are those after it in their places", row_number + 1);
                return Err(SweepError::Damaged { path: path.clone(), line: row_number + 2, reason });
            }
            row_number += 1;
            Ok(())
        })?;
        Ok(self)
    }

    /// Writes the final files and removes the file of rows: the table, with `head` above its rows; `others` by name; last the seal, which
    /// is the header with what was `found`.
    ///
    /// # Errors
    /// [`SweepError::Output`] if a file cannot be read or written; the rows stay then.
    pub fn finish(mut self, head: &str, others: &[(&str, String)], found: &Value) -> Result<(), SweepError> {
        let folder = self.folder.clone();
        let mut table = Part::create(&folder, self.kept.files[2])?;
        table.write(&format!("{head}\n"))?;
        self.each(|row| Ok(table.write(&format!("{row}\n"))?))?;
        table.publish()?;
        self.kept.seal(&folder, others, &self.header, found)
    }
}

impl Drop for Lines {
    /// Gives the lock back at once.
    fn drop(&mut self) {
        let _ = self.file.unlock();
    }
}
