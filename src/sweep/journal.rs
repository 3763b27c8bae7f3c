use std::{
    fs::{self, File, TryLockError},
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write},
    marker::PhantomData,
    ops::Range,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value};

use super::{
    SweepError,
    files::{self, Part},
};
use crate::output::{self, Folder, OutputError, Request, failed};

pub(super) const NAME: &str = "sweep.journal";

/// How a sweep begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// In a folder that is empty, or not there.
    New,
    /// Anew, in any folder; what its manifest names is removed.
    Replace,
    /// Where an earlier one was broken off; from the start if there is none.
    Resume,
}

impl Begin {
    /// What a sweep that begins so writes into `folder`; nothing of `input` is replaced.
    #[must_use]
    pub fn request<'a>(self, folder: &'a Path, input: Option<&'a Path>) -> Request<'a> {
        SWEEP.request(self, folder, input)
    }
}

/// The files of a command whose rows are kept as they finish.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// The command.
    pub command: &'static str,
    /// Its files: the rows as they finish, the seal that says what they are, then the others, its figure apart.
    pub files: &'static [&'static str],
}

/// Those of a sweep.
const SWEEP: Kept = Kept { command: "sweep", files: &["sweep.journal", "sweep.json", "sweep.csv", "sweep.jsonl"] };

impl Kept {
    /// What the command writes into `folder`; nothing of `input` is replaced.
    #[must_use]
    pub fn request<'a>(&self, begin: Begin, folder: &'a Path, input: Option<&'a Path>) -> Request<'a> {
        // The head of a journal says whose it is.
        let files = if begin == Begin::Resume { &self.files[1..] } else { self.files };
        let files = files.iter().map(|name| (*name).to_owned()).chain(self.figure()).collect();
        Request { folder, command: self.command, input, force: begin != Begin::New, files }
    }

    /// Files that its figure may have.
    fn figure(&self) -> [String; 3] {
        ["svg", "pdf", "png"].map(|ending| format!("figures/{}.{ending}", self.command))
    }

    /// The folder of a command that is at work, for its figures.
    pub(super) fn outputs(&self, folder: &Path) -> Result<Folder, SweepError> {
        Ok(self.request(Begin::Replace, folder, None).reopen()?)
    }

    /// Opens the file of rows and locks it, nothing changed; `None` if the work is to be resumed, and is finished.
    pub(super) fn claim(
        &self,
        folder: &Path,
        begin: Begin,
        header: &Map<String, Value>,
    ) -> Result<Option<(File, Folder)>, SweepError> {
        let path = folder.join(self.files[0]);
        let unfinished = fs::symlink_metadata(&path).is_ok();
        match begin {
            Begin::New if unfinished => return Err(SweepError::Unfinished(folder.to_owned())),
            Begin::New if fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) => {
                return Err(OutputError::Occupied(folder.to_owned()).into());
            }
            Begin::Resume if !unfinished && folder.join(self.files[1]).exists() => {
                same(folder, &files::header_of(folder, self.files[1])?, header)?;
                return Ok(None);
            }
            _ => {}
        }
        let mut outputs = self.request(begin, folder, None).check()?;
        if !unfinished {
            if begin == Begin::Resume && outputs.command() != self.command {
                return Err(OutputError::Occupied(folder.to_owned()).into());
            }
            outputs.list(self.files)?;
        }
        let fail = failed(&path);
        let file =
            File::options().read(true).write(true).create(!unfinished).truncate(false).open(&path).map_err(&fail)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(SweepError::InUse(folder.to_owned())),
            // A file system without locks: nothing better can be had there.
            Err(TryLockError::Error(error)) if error.kind() != io::ErrorKind::Unsupported => Err(fail(error).into()),
            _ => Ok(Some((file, outputs))),
        }
    }

    /// Enters the files, and leaves of the rows what is complete up to `end`; what an earlier one left goes.
    pub(super) fn enter(
        &self,
        folder: &Path,
        begin: Begin,
        (file, mut outputs): (&File, Folder),
        end: u64,
    ) -> Result<(), SweepError> {
        if end > 0 && begin == Begin::New {
            return Err(SweepError::Unfinished(folder.to_owned()));
        }
        if begin == Begin::Replace {
            outputs.clear(self.command, &[self.files[0]])?;
        }
        outputs.list(self.files)?;
        // Whatever stands behind the last complete line; everything, if it begins anew.
        file.set_len(end).map_err(failed(&folder.join(self.files[0])))?;
        if end == 0 {
            // What an earlier one left must not be taken for this one's, even if this one is killed.
            let old = self.files[1..].iter().map(|name| folder.join(name));
            old.chain(self.figure().map(|name| folder.join(name))).try_for_each(|path| output::remove(&path))?;
        }
        Ok(())
    }

    /// Writes `others` by name, then the seal, which is the header with what was `found`, and removes the file of rows.
    pub(super) fn seal(
        &self,
        folder: &Path,
        others: &[(&str, String)],
        header: &Map<String, Value>,
        found: &Value,
    ) -> Result<(), SweepError> {
        let mut header = header.clone();
        header.insert("found".to_owned(), found.clone());
        let seal = format!("{:#}\n", Value::from(header));
        let others = others.iter().map(|(name, text)| (*name, text));
        for (name, text) in others.chain([(self.files[1], &seal)]) {
            let mut part = Part::create(folder, name)?;
            part.write(text)?;
            part.publish()?;
        }
        // Nothing depends on the rows any more. The lock is held until the file is gone.
        output::remove(&folder.join(self.files[0]))?;
        Ok(())
    }
}

/// Whether `line`, without an end, can be what a killed process left of the head of rows: anything else is the user's.
pub(super) fn is_torn(line: &[u8], header: &Map<String, Value>) -> bool {
    Value::from(header.clone()).to_string().as_bytes().starts_with(line)
}

/// A row that has been computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Entry<R, S> {
    /// Number of the row.
    pub row: usize,
    /// What came of it.
    pub outcome: Outcome<R, S>,
}

/// What came of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Outcome<R, S> {
    /// It was computed.
    Done {
        /// The row.
        result: R,
        /// Where it ended; the neighbour may start there.
        end: S,
    },
    /// It failed, and why. The neighbour starts fresh.
    Failed(String),
}

/// The rows of a sweep as they finish, in a file: a header, then one JSON object a line, in the order of finishing.
///
/// The file is locked while it is open; the system takes the lock away with the process, however that ends. A line is
/// written at once and is complete when its end of line is there; what a killed process left of a line is dropped.
#[derive(Debug)]
pub struct Journal<R, S> {
    files: Kept,
    pub(super) folder: PathBuf,
    pub(super) header: Map<String, Value>,
    path: PathBuf,
    file: File,
    /// Where the complete lines end.
    end: u64,
    /// Where the line of each row is.
    lines: Vec<Option<Range<u64>>>,
    /// How many rows have one.
    kept: usize,
    kind: PhantomData<fn() -> (R, S)>,
}

impl<R: Serialize + DeserializeOwned, S: Serialize + DeserializeOwned> Journal<R, S> {
    /// Opens the journal of a sweep with `rows` rows in `folder`, created if need be. `header` is what the sweep is known
    /// by: everything that its rows depend on. `None` if the sweep is to be resumed, and is finished.
    ///
    /// # Errors
    /// [`SweepError`] if the folder is occupied, in use or holds another sweep, if the journal is damaged, or if a file
    /// cannot be read or written. Nothing is changed then.
    pub fn open(
        folder: &Path,
        begin: Begin,
        header: Map<String, Value>,
        rows: usize,
    ) -> Result<Option<Self>, SweepError> {
        Self::open_for(SWEEP, folder, begin, header, rows)
    }

    /// The same for another command, whose files are `files`.
    pub(crate) fn open_for(
        files: Kept,
        folder: &Path,
        begin: Begin,
        header: Map<String, Value>,
        rows: usize,
    ) -> Result<Option<Self>, SweepError> {
        let path = folder.join(files.files[0]);
        let Some((file, outputs)) = files.claim(folder, begin, &header)? else { return Ok(None) };
        let mut journal = Self {
            files,
            folder: folder.to_owned(),
            header,
            path,
            file,
            end: 0,
            lines: vec![None; rows],
            kept: 0,
            kind: PhantomData,
        };
        if begin != Begin::Replace {
            journal.read_in()?;
        }
        files.enter(folder, begin, (&journal.file, outputs), journal.end)?;
        if journal.end == 0 {
            let header = Value::from(journal.header.clone()).to_string();
            journal.line(&header)?;
        }
        Ok(Some(journal))
    }

    /// Writes final files, each by what `write` puts into it row by row, then `others` by name, then the seal, which is the header with
    /// what was `found`; removes the journal.
    pub(crate) fn seal(
        mut self,
        tables: &[&str],
        mut write: impl FnMut(&mut Self, usize, &mut dyn FnMut(&str) -> Result<(), SweepError>) -> Result<(), SweepError>,
        others: &[(&str, String)],
        found: &Value,
    ) -> Result<(), SweepError> {
        let folder = self.folder.clone();
        for (i, name) in tables.iter().enumerate() {
            let mut table = Part::create(&folder, name)?;
            write(&mut self, i, &mut |line| Ok(table.write(&format!("{line}\n"))?))?;
            table.publish()?;
        }
        self.files.seal(&folder, others, &self.header, found)
    }

    /// Its folder, for figures; before any final file is written.
    pub(crate) fn outputs(&self) -> Result<Folder, SweepError> {
        self.files.outputs(&self.folder)
    }

    /// How many rows are kept.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.kept
    }

    /// Row `row`, if it is kept.
    pub(crate) fn entry(&mut self, row: usize) -> Result<Option<Entry<R, S>>, SweepError> {
        let Some(at) = self.lines[row].clone() else { return Ok(None) };
        let read = |file: &mut File| {
            // OK to convert: a line that was held in memory.
            let mut text = vec![0; (at.end - at.start) as usize];
            file.seek(SeekFrom::Start(at.start))?;
            file.read_exact(&mut text)?;
            Ok(serde_json::from_slice(&text)?)
        };
        Ok(Some(read(&mut self.file).map_err(failed(&self.path))?))
    }

    /// Keeps a row, and gives it back as a resumed sweep would read it. If it cannot be written, the journal ends with its last
    /// complete line.
    pub(super) fn keep(&mut self, entry: Entry<R, S>) -> Result<Entry<R, S>, SweepError> {
        let row = entry.row;
        // JSON has neither infinities nor NaN.
        let read_back = serde_json::to_string(&entry).and_then(|text| Ok((serde_json::from_str(&text)?, text)));
        let (entry, text) = match read_back {
            Ok(whole) => whole,
            Err(error) => {
                let outcome = Outcome::Failed(format!("a result with a number that is not finite ({error})"));
                let entry = Entry { row, outcome };
                let text = serde_json::to_string(&entry).map_err(|error| failed(&self.path)(error.into()))?;
                (entry, text)
            }
        };
        let at = self.line(&text)?;
        self.lines[row] = Some(at);
        self.kept += 1;
        Ok(entry)
    }

    /// Appends a line and says where it is.
    fn line(&mut self, text: &str) -> Result<Range<u64>, SweepError> {
        let start = self.end;
        let write = |file: &mut File| {
            file.seek(SeekFrom::Start(start))?;
            file.write_all(format!("{text}\n").as_bytes())
        };
        write(&mut self.file).map_err(|source| {
            // Best effort: a tail without an end of line is dropped when the journal is read.
            let _ = self.file.set_len(start);
            failed(&self.path)(source)
        })?;
        self.end += text.len() as u64 + 1;
        Ok(start..start + text.len() as u64)
    }

    /// Reads what the file holds: the header, which must be this one's, and rows.
    fn read_in(&mut self) -> Result<(), SweepError> {
        let damaged = |line, reason| SweepError::Damaged { path: self.path.clone(), line, reason };
        let (mut reader, mut line) = (BufReader::new(&self.file), Vec::new());
        for number in 1.. {
            line.clear();
            reader.read_until(b'\n', &mut line).map_err(failed(&self.path))?;
            let Some(text) = line.strip_suffix(b"\n") else {
                if number == 1 && !is_torn(&line, &self.header) {
                    return Err(damaged(1, "no journal of a sweep".to_owned()));
                }
                break;
            };
            if number == 1 {
                let header = serde_json::from_slice(text).map_err(|error| damaged(1, error.to_string()))?;
                same(&self.folder, &header, &self.header)?;
            } else {
                let entry: Entry<R, S> =
                    serde_json::from_slice(text).map_err(|error| damaged(number, error.to_string()))?;
                let rows = self.lines.len();
                let Some(place @ None) = self.lines.get_mut(entry.row) else {
                    return Err(damaged(number, format!("row {} of {rows}, or for the second time", entry.row)));
                };
                *place = Some(self.end..self.end + text.len() as u64);
                self.kept += 1;
            }
            self.end += line.len() as u64;
        }
        Ok(())
    }
}

impl<R, S> Drop for Journal<R, S> {
    /// Gives the lock back at once: a process that is just being started may hold a copy of the file for a moment.
    fn drop(&mut self) {
        let _ = self.file.unlock();
    }
}

/// Whether what was asked of work kept in `folder` is what is asked now.
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
