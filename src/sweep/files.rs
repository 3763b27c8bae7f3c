//! The final files: complete, or not at all.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{BufWriter, Read as _, Write as _},
    path::{Path, PathBuf},
};

use serde::{Serialize, Serializer, de::DeserializeOwned};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::{Journal, Outcome, Plan, RowWork, SweepDirection, SweepError, records::Write};
use crate::output::{Folder, OutputError, csv_line, failed, label, number, part};

const TABLE: &str = "sweep.csv";
const ROWS: &str = "sweep.jsonl";

/// Number of rows of a sweep, and of those that failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Rows.
    pub rows: usize,
    /// Rows that failed.
    pub failed: usize,
}

/// One line of `sweep.jsonl`.
#[derive(Serialize)]
struct SweepLine<'a, R> {
    /// Values by pointer, in the order of the axes.
    #[serde(serialize_with = "by_pointer")]
    at: Vec<(&'a str, f64)>,
    direction: SweepDirection,
    result: Option<&'a R>,
    error: Option<&'a str>,
}

fn by_pointer<S: Serializer>(at: &[(&str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(at.iter().copied())
}

impl<R: Serialize + DeserializeOwned, S: Serialize + DeserializeOwned> Journal<R, S> {
    /// Writes the final files, rows in grid order, and removes the journal:
    ///
    /// - `sweep.csv`: values, direction, `columns` filled by `cells`, error;
    /// - `sweep.jsonl`: the same with the whole of each row;
    /// - files of `picture`;
    /// - `sweep.json`: settings of the sweep, and number of failed rows. It is written last: if it exists, the others are complete.
    ///
    /// # Errors
    /// [`SweepError::Output`] if a file cannot be read or written; the journal is kept then.
    ///
    /// # Panics
    /// Panics if a row is missing, or if the number of `cells` differs from that of the columns.
    pub fn finish(
        mut self,
        plan: &Plan,
        columns: &[impl AsRef<str>],
        cells: impl Fn(&R) -> Vec<String>,
        picture: impl FnOnce(&mut Folder) -> Result<(), OutputError>,
    ) -> Result<Tally, SweepError> {
        assert_eq!(self.records.count(), plan.rows(), "rows of a finished sweep");
        self.draw(picture)?;
        let pointers: Vec<&str> = plan.grid().axes().iter().map(|axis| axis.pointer.as_str()).collect();
        let columns: Vec<&str> = columns.iter().map(AsRef::as_ref).collect();
        let head = pointers.iter().copied().chain(["direction"]).chain(columns.iter().copied()).chain(["error"]);
        let mut tally = Tally { rows: plan.rows(), failed: 0 };
        self.each(|_, outcome| {
            tally.failed += usize::from(matches!(outcome, Outcome::Failed(_)));
            Ok(())
        })?;
        let write = |table: usize, row: usize, outcome: Outcome<R, S>, line: &mut Write<'_>| {
            let RowWork { values, direction, .. } = plan.cell(row);
            let (result, error) = match &outcome {
                Outcome::Done { result, .. } => (Some(result), None),
                Outcome::Failed(why) => (None, Some(why.as_str())),
            };
            if table == 1 {
                let at = pointers.iter().copied().zip(values).collect();
                let text = serde_json::to_string(&SweepLine { at, direction, result, error });
                return line(&text.map_err(|error| failed(Path::new(ROWS))(error.into()))?);
            }
            let measures = result.map_or_else(|| vec![String::new(); columns.len()], &cells);
            assert_eq!(measures.len(), columns.len(), "cells and columns of a sweep");
            let mut fields: Vec<String> = values.iter().copied().map(number).collect();
            fields.push(label(direction));
            fields.extend(measures);
            fields.push(error.unwrap_or_default().to_owned());
            line(&csv_line(fields))
        };
        let found = [("rows", tally.rows.into()), ("failed", tally.failed.into())];
        self.seal(&[(TABLE, Some(csv_line(head))), (ROWS, None)], write, &found)?;
        Ok(tally)
    }
}

/// SHA-256 of files by name.
type Checksums = BTreeMap<String, String>;

/// Returns the CRC-32 of the entries of a seal, in compact form, hexadecimal.
pub(super) fn own_sum(seal: &Map<String, Value>) -> String {
    format!("{:08x}", crc32fast::hash(Value::from(seal.clone()).to_string().as_bytes()))
}

/// Returns the header of finished work, and the checksums of its files.
pub(super) fn header_of(folder: &Path, seal: &str) -> Result<(Map<String, Value>, Checksums), SweepError> {
    let path = folder.join(seal);
    let text = fs::read(&path).map_err(failed(&path))?;
    let damaged = |reason: String| SweepError::Damaged { path: path.clone(), reason };
    let read: Result<Map<String, Value>, _> = serde_json::from_slice(&text);
    let mut header = read.map_err(|error| damaged(error.to_string()))?;
    let sum = header.remove("crc32");
    if sum.as_ref().and_then(Value::as_str) != Some(&own_sum(&header)) {
        return Err(damaged("its checksum does not fit".to_owned()));
    }
    let sums = header.remove("sha256").map(serde_json::from_value).transpose();
    let sums = sums.map_err(|error| damaged(error.to_string()))?.unwrap_or_default();
    ["rows", "failed", "found"].iter().for_each(|key| drop(header.remove(*key)));
    Ok((header, sums))
}

/// Returns the SHA-256 of a file, hexadecimal.
pub(super) fn sum(path: &Path) -> Result<String, OutputError> {
    let mut hash = Sha256::new();
    let mut file = File::open(path).map_err(failed(path))?;
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block).map_err(failed(path))? {
            0 => break,
            count => hash.update(&block[..count]),
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

/// File that is written beside its final place.
pub(super) struct UnfinishedFile {
    path: PathBuf,
    file: BufWriter<File>,
}

impl UnfinishedFile {
    pub(super) fn create(folder: &Path, name: &str) -> Result<Self, OutputError> {
        let path = folder.join(name);
        let part = part(&path);
        let file = File::create(&part).map_err(failed(&part))?;
        Ok(Self { path, file: BufWriter::new(file) })
    }

    pub(super) fn write(&mut self, text: &str) -> Result<(), OutputError> {
        self.file.write_all(text.as_bytes()).map_err(failed(&self.path))
    }

    /// Moves the file to its place, once it is safe on disk.
    pub(super) fn publish(mut self) -> Result<(), OutputError> {
        let safe = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        safe.and_then(|()| fs::rename(part(&self.path), &self.path)).map_err(failed(&self.path))
    }
}
