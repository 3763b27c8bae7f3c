//! A file of records.
//!
//! ```text
//! flank-rows 1 SUM HEADER          the header, a JSON object: what the records depend on
//! ROW SUM TEXT                     one line for each row that is finished, in any order
//! ```
//!
//! SUM is the CRC-32 of the text after it, eight hexadecimal digits. That of a record continues that of the header and includes the number
//! of the row. A record that is damaged, or belongs to another row or other work, is invalid, and only its row is lost.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufRead, BufReader, Read, Seek, SeekFrom},
    ops::Range,
    path::{Path, PathBuf},
};

use crc32fast::Hasher;
use memchr::memchr;
use serde_json::{Map, Value};

use super::{Share, SweepError};
use crate::output::failed;

/// Begins the file, with the version of its format.
const MAGIC: &str = "flank-rows 1 ";
/// Digits of a checksum.
const DIGITS: usize = 8;
/// A file of records.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub path: PathBuf,
    /// Checksum of its header.
    head: Hasher,
    /// Places of the first record and behind the last one, bytes.
    pub begin: u64,
    pub end: u64,
    /// Number of rows; a row number is less.
    rows: usize,
}

impl Source {
    pub fn new(path: PathBuf, header: &Map<String, Value>, rows: usize) -> Self {
        let mut head = Hasher::new();
        head.update(Value::from(header.clone()).to_string().as_bytes());
        Self { path, head, begin: 0, end: 0, rows }
    }

    /// Returns the first line, without its end.
    pub fn first_line(&self, header: &Map<String, Value>) -> String {
        format!("{MAGIC}{:08x} {}", self.head.clone().finalize(), Value::from(header.clone()))
    }

    fn sum(&self, row: usize, text: &str) -> u32 {
        let mut sum = self.head.clone();
        sum.update(&(row as u64).to_le_bytes());
        sum.update(text.as_bytes());
        sum.finalize()
    }

    /// Returns the line of a record.
    pub fn line(&self, row: usize, text: &str) -> String {
        format!("{row} {:08x} {text}\n", self.sum(row, text))
    }

    /// Returns row and text of a line without its end. `None` if it is no record of this work.
    fn record<'t>(&self, line: &'t [u8]) -> Option<(usize, &'t str)> {
        let line = std::str::from_utf8(line).ok()?;
        let (row, rest) = line.split_once(' ')?;
        let (sum, text) = rest.split_at_checked(DIGITS)?;
        let text = text.strip_prefix(' ')?;
        let row: usize = row.parse().ok().filter(|row| *row < self.rows)?;
        (self.sum(row, text) == u32::from_str_radix(sum, 16).ok()?).then_some((row, text))
    }

    /// Checks that the header is `header`, and finds the start of the records; a file that was cut within its header has none.
    pub fn check(&mut self, folder: &Path, header: &Map<String, Value>) -> Result<(), SweepError> {
        let damaged = |reason: &str| SweepError::Damaged { path: self.path.clone(), reason: reason.to_owned() };
        let file = File::open(&self.path).map_err(failed(&self.path))?;
        let mut line = Vec::new();
        BufReader::new(file).read_until(b'\n', &mut line).map_err(failed(&self.path))?;
        let own = self.first_line(header);
        let Some(first) = line.strip_suffix(b"\n") else {
            // An incomplete header is left by a killed command; any other text belongs to the user.
            return if own.as_bytes().starts_with(&line) {
                Ok(())
            } else {
                Err(damaged("not written by this command"))
            };
        };
        if first != own.as_bytes() {
            let text = std::str::from_utf8(first).ok().and_then(|text| text.strip_prefix(MAGIC));
            let (sum, json) = text.and_then(|text| text.split_at_checked(DIGITS)).unwrap_or_default();
            let json = json.strip_prefix(' ').unwrap_or_default();
            let is_whole = u32::from_str_radix(sum, 16).is_ok_and(|sum| sum == crc32fast::hash(json.as_bytes()));
            let there = serde_json::from_str(json).ok().filter(|_| is_whole);
            let there = there.ok_or_else(|| damaged("its header is damaged, or it was not written by this command"))?;
            return same(folder, &there, header);
        }
        self.begin = line.len() as u64;
        self.end = self.begin;
        Ok(())
    }
}

/// Bytes read at once. The file is open only meanwhile: there may be more parts than files that a process can open.
const BLOCK: u64 = 1 << 16;

/// Lines of a source, one after the other.
pub(super) struct Lines<'s> {
    source: &'s Source,
    /// Bytes that have been read, and their place in the file.
    block: Vec<u8>,
    at: u64,
    /// Place of the next line in the block.
    next: usize,
    end: u64,
}

/// Line of a file: its row, if it is a record, and the place of its text.
pub(super) struct Line {
    pub row: Option<usize>,
    text: Range<u64>,
    /// Place of the next line.
    pub end: u64,
}

impl<'s> Lines<'s> {
    pub fn new(source: &'s Source, end: u64) -> Self {
        Self { source, block: Vec::new(), at: source.begin, next: 0, end }
    }

    /// Reads more of the file behind the block; returns false at its end.
    fn read(&mut self) -> Result<bool, SweepError> {
        let fail = failed(&self.source.path);
        self.at += self.next as u64;
        self.block.drain(..self.next);
        self.next = 0;
        let from = self.at + self.block.len() as u64;
        if from >= self.end {
            return Ok(false);
        }
        let mut file = File::open(&self.source.path).map_err(&fail)?;
        file.seek(SeekFrom::Start(from)).map_err(&fail)?;
        let before = self.block.len();
        let most = BLOCK.max(before as u64).min(self.end - from);
        file.take(most).read_to_end(&mut self.block).map_err(&fail)?;
        Ok(self.block.len() > before)
    }

    /// Returns the next line that has an end.
    pub fn next(&mut self) -> Result<Option<Line>, SweepError> {
        let mut seen = 0;
        loop {
            if let Some(length) = memchr(b'\n', &self.block[self.next + seen..]).map(|at| seen + at) {
                let line = &self.block[self.next..self.next + length];
                let record = self.source.record(line);
                let end = self.at + (self.next + length) as u64;
                let text = end - record.map_or(0, |(_, text)| text.len() as u64)..end;
                let row = record.map(|(row, _)| row);
                self.next += length + 1;
                return Ok(Some(Line { row, text, end: end + 1 }));
            }
            seen = self.block.len() - self.next;
            if !self.read()? {
                return Ok(None);
            }
        }
    }

    /// Returns the text of the line that was read last.
    pub fn text(&self, line: &Line) -> &str {
        let place = [line.text.start, line.text.end].map(|at| (at - self.at) as usize);
        std::str::from_utf8(&self.block[place[0]..place[1]]).unwrap_or_default()
    }
}

/// Records of a source in the order of their rows. Memory holds only the places of records that precede their turn.
pub(super) struct Ordered<'s> {
    lines: Lines<'s>,
    early: BTreeMap<usize, Range<u64>>,
    last: Option<usize>,
}

impl<'s> Ordered<'s> {
    pub fn new(source: &'s Source) -> Self {
        Self { lines: Lines::new(source, source.end), early: BTreeMap::new(), last: None }
    }

    /// Returns the text of a row; rows must be requested in their order.
    pub fn get(&mut self, row: usize) -> Result<String, SweepError> {
        let path = &self.lines.source.path;
        if let Some(place) = self.early.remove(&row) {
            // OK to convert: a line that was held in memory.
            let mut text = vec![0; (place.end - place.start) as usize];
            let read = File::open(path).and_then(|mut file| {
                file.seek(SeekFrom::Start(place.start))?;
                file.read_exact(&mut text)
            });
            read.map_err(failed(path))?;
            self.last = Some(row);
            return Ok(String::from_utf8_lossy(&text).into_owned());
        }
        while let Some(line) = self.lines.next()? {
            match line.row {
                Some(found) if found == row => {
                    self.last = Some(row);
                    return Ok(self.lines.text(&line).to_owned());
                }
                // A row for the second time has the same content.
                Some(found) if self.last.is_none_or(|last| found > last) => {
                    self.early.entry(found).or_insert(line.text);
                }
                _ => {}
            }
        }
        let reason = format!("row {row} is gone");
        Err(SweepError::Damaged { path: path.clone(), reason })
    }
}

/// Returns a header with the share of the work, if that is not all of it.
pub(super) fn with_share(mut header: Map<String, Value>, share: Share) -> Map<String, Value> {
    if share.of > 1 {
        header.insert("part".to_owned(), share.to_string().into());
    }
    header
}

/// Returns the share in the header of a file, if it can be read.
pub(super) fn share_of(path: &Path) -> Option<Share> {
    let mut line = String::new();
    BufReader::new(File::open(path).ok()?).read_line(&mut line).ok()?;
    let json = line.strip_prefix(MAGIC)?.split_at_checked(DIGITS)?.1;
    serde_json::from_str::<Map<String, Value>>(json).ok()?.get("part")?.as_str()?.parse().ok()
}

/// Checks that work stored in `folder` has the present settings.
///
/// # Errors
/// [`SweepError::Mismatch`], with every entry that differs.
pub fn same(folder: &Path, was: &Map<String, Value>, is: &Map<String, Value>) -> Result<(), SweepError> {
    let keys = was.keys().chain(is.keys().filter(|key| !was.contains_key(*key)));
    let text = |value: Option<&Value>| value.map_or("nothing".to_owned(), Value::to_string);
    let differences: Vec<String> = keys
        .filter(|key| was.get(*key) != is.get(*key))
        .map(|key| format!("{key}: {} there, {} here", text(was.get(key)), text(is.get(key))))
        .collect();
    if differences.is_empty() { Ok(()) } else { Err(SweepError::Mismatch { path: folder.to_owned(), differences }) }
}
