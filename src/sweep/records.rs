//! Records of a command as they finish, and their folder.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::{self, File},
    io::{Seek, SeekFrom, Write as _},
    ops::Range,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde_json::{Map, Value};

use super::{
    Begin, Plan, Share, SweepError,
    files::{self, UnfinishedFile},
    source::{Lines, Ordered, Source, same, share_of, with_share},
};
use crate::output::{self, Folder, OutputError, Request, failed};

/// Longest time until a written record is on disk, even if the machine fails.
const SYNC: Duration = Duration::from_secs(2);

/// Files of a command whose rows are stored as they finish.
#[derive(Clone, Copy, Debug)]
pub struct CommandFiles {
    /// Name of the command.
    pub command: &'static str,
    /// Its files: the rows as they finish, the seal that identifies them, then the others without the figure.
    pub files: &'static [&'static str],
}

impl CommandFiles {
    /// Returns the request for the files of the command in `folder`; no file of `input` is replaced.
    #[must_use]
    pub fn request<'a>(&self, begin: Begin, folder: &'a Path, input: Option<&'a Path>) -> Request<'a> {
        // The head of the rows identifies their command.
        let files = if begin == Begin::Resume { &self.files[1..] } else { self.files };
        let files = files.iter().map(|name| (*name).to_owned()).chain(self.figure()).collect();
        Request { folder, command: self.command, input, force: begin != Begin::New, files }
    }

    /// Returns the files that its figure may have.
    fn figure(&self) -> [String; 3] {
        ["svg", "pdf", "png"].map(|ending| format!("figures/{}.{ending}", self.command))
    }
}

/// Rows of a command, with their chains. The rows of a chain are in one part.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Rows<'p> {
    /// Number of rows.
    pub count: usize,
    /// Number of chains.
    pub chains: usize,
    /// Plan of the rows; without one every row is a separate chain.
    pub plan: Option<&'p Plan>,
}

impl Rows<'_> {
    /// Returns rows that are separate chains.
    #[must_use]
    pub fn alone(count: usize) -> Self {
        Self { count, chains: count, plan: None }
    }

    /// Returns the number of rows in a share.
    fn of(&self, share: Share) -> usize {
        share.count(self.chains) * (self.count / self.chains.max(1))
    }
}

/// Records of a command as they finish. Memory grows by one bit a row.
///
/// A record is written at once. The folder is locked during the life of this value; the system removes the lock with the process, however
/// that ends.
#[derive(Debug)]
pub struct Records {
    kept: CommandFiles,
    outputs: Folder,
    folder: PathBuf,
    header: Map<String, Value>,
    share: Share,
    /// File into which records are written; none for merged parts.
    file: Option<File>,
    /// Files that hold records: its own, or that of each part, by index.
    sources: Vec<Source>,
    /// Plan of its rows, if they have chains.
    plan: Option<Plan>,
    /// A bit for each row that has a record.
    has: Vec<u64>,
    rows: usize,
    /// Number of rows in its share.
    own: usize,
    count: usize,
    damaged: usize,
    /// Final files that were missing or changed.
    lost: Vec<String>,
    synced: Instant,
}

impl Records {
    /// Opens the records of a `share` of some `rows` in `folder`, created if missing. `header` holds the data on which they depend. `None`
    /// if the work is to be resumed, and is finished.
    ///
    /// # Errors
    /// [`SweepError`] if the folder is occupied, in use or holds other work, if the header is damaged, or if a file cannot be read or
    /// written. Nothing is changed then.
    pub fn open(
        folder: &Path,
        kept: CommandFiles,
        (begin, share): (Begin, Share),
        header: Map<String, Value>,
        rows: Rows<'_>,
    ) -> Result<Option<Self>, SweepError> {
        let path = folder.join(kept.files[0]);
        let unfinished = fs::symlink_metadata(&path).is_ok();
        let mut lost = Vec::new();
        match begin {
            Begin::New if unfinished => return Err(SweepError::Unfinished(folder.to_owned())),
            Begin::New if output::is_occupied(folder) => {
                return Err(OutputError::Occupied(folder.to_owned()).into());
            }
            Begin::Resume if !unfinished && folder.join(kept.files[1]).exists() => {
                let (there, sums) = files::header_of(folder, kept.files[1])?;
                same(folder, &there, &header)?;
                let changed =
                    sums.into_iter().filter(|(name, sum)| files::sum(&folder.join(name)).ok().as_ref() != Some(sum));
                let changed: Vec<String> = changed.map(|(name, _)| name).collect();
                if changed.is_empty() {
                    return Ok(None);
                }
                lost = changed;
            }
            _ => {}
        }
        let mut outputs = kept.request(begin, folder, None).lock()?;
        if !unfinished {
            if begin == Begin::Resume && outputs.command() != kept.command {
                return Err(OutputError::Occupied(folder.to_owned()).into());
            }
            outputs.list(kept.files)?;
        }
        let header = with_share(header, share);
        let file = File::options().read(true).write(true).create(!unfinished).truncate(false).open(&path);
        let file = file.map_err(failed(&path))?;
        let source = Source::new(path, &header, rows.count);
        let mut records = Self {
            kept,
            outputs,
            folder: folder.to_owned(),
            header,
            share,
            file: Some(file),
            sources: vec![source],
            plan: rows.plan.cloned(),
            has: vec![0; rows.count.div_ceil(64)],
            rows: rows.count,
            own: rows.of(share),
            count: 0,
            damaged: 0,
            lost,
            synced: Instant::now(),
        };
        if begin != Begin::Replace {
            records.sources[0].check(folder, &records.header)?;
            records.read_in(0, share)?;
        }
        records.enter(begin)?;
        if records.sources[0].end == 0 {
            let line = records.sources[0].first_line(&records.header) + "\n";
            records.append(&line)?;
            records.sources[0].begin = line.len() as u64;
        }
        Ok(Some(records))
    }

    /// Merges the records of `of` parts, which are in `folders`, to those of an undivided run, to be finished in the folder `out`.
    ///
    /// # Errors
    /// [`SweepError::Parts`] with all faults of the parts, or the errors of [`open`](Self::open).
    pub fn merged(
        (folders, of): (&[PathBuf], usize),
        kept: CommandFiles,
        (out, begin): (&Path, Begin),
        header: Map<String, Value>,
        rows: Rows<'_>,
    ) -> Result<Self, SweepError> {
        let mut faults = Vec::new();
        let mut sources: Vec<Option<Source>> = vec![None; of];
        for folder in folders {
            let path = folder.join(kept.files[0]);
            let place = folder.display();
            let share = share_of(&path).filter(|share| share.of == of).unwrap_or(Share { part: 0, of });
            let own = with_share(header.clone(), share);
            let mut source = Source::new(path, &own, rows.count);
            match source.check(folder, &own) {
                Err(error) => faults.push(error.to_string()),
                Ok(()) if source.begin == 0 => faults.push(format!("{place}: no rows yet")),
                Ok(()) if sources[share.part].is_some() => {
                    faults.push(format!("{place}: part {} is there twice", share.part))
                }
                Ok(()) => sources[share.part] = Some(source),
            }
        }
        let missing: Vec<usize> = (0..of).filter(|part| sources[*part].is_none()).collect();
        if !missing.is_empty() {
            let names: Vec<String> = missing.iter().map(|part| format!("{part}/{of}")).collect();
            faults.push(format!("missing of {of} parts: {}", names.join(", ")));
        }
        let outputs = kept.request(begin, out, None);
        if !faults.is_empty() {
            return Err(SweepError::Parts(faults));
        }
        let mut records = Self {
            kept,
            outputs: outputs.check()?,
            folder: out.to_owned(),
            header,
            share: Share::ALL,
            file: None,
            sources: sources.into_iter().flatten().collect(),
            plan: rows.plan.cloned(),
            has: vec![0; rows.count.div_ceil(64)],
            rows: rows.count,
            own: rows.count,
            count: 0,
            damaged: 0,
            lost: Vec::new(),
            synced: Instant::now(),
        };
        for part in 0..of {
            let before = records.count;
            let share = Share { part, of };
            records.read_in(part, share)?;
            let (has, wanted) = (records.count - before, rows.of(share));
            if has < wanted {
                faults.push(format!(
                    "{}: part {share} has {has} of {wanted} rows: run it again with --resume",
                    records.sources[part].path.display()
                ));
            }
        }
        if faults.is_empty() { Ok(records) } else { Err(SweepError::Parts(faults)) }
    }

    /// Locks the folder of merged parts, before its files are written.
    ///
    /// # Errors
    /// [`SweepError::Output`] if it cannot be written into.
    pub fn begin(&mut self, begin: Begin) -> Result<(), SweepError> {
        let mut outputs = self.kept.request(begin, &self.folder, None).open()?;
        outputs.list(self.kept.files)?;
        self.outputs = outputs;
        Ok(())
    }

    /// Enters the files in the manifest, cuts off bytes behind the last record, and removes files of an earlier command.
    fn enter(&mut self, begin: Begin) -> Result<(), SweepError> {
        let Source { end, path, .. } = &self.sources[0];
        if *end > 0 && begin == Begin::New {
            return Err(SweepError::Unfinished(self.folder.clone()));
        }
        if begin == Begin::Replace {
            self.outputs.clear(self.kept.command, &[self.kept.files[0]])?;
        }
        self.outputs.list(self.kept.files)?;
        self.file.as_ref().map_or(Ok(()), |file| file.set_len(*end)).map_err(failed(path))?;
        if *end == 0 {
            // Files of an earlier command must not be mistaken for files of this one, even if this one is killed.
            let old = self.kept.files[1..].iter().map(|name| self.folder.join(name));
            let figure = self.kept.figure().map(|name| self.folder.join(name));
            old.chain(figure).try_for_each(|path| output::remove(&path))?;
        }
        Ok(())
    }

    /// Finds the records of a source, which belong to a share, and their end.
    fn read_in(&mut self, place: usize, share: Share) -> Result<(), SweepError> {
        let source = self.sources[place].clone();
        if source.begin == 0 {
            return Ok(());
        }
        let mut lines = Lines::new(&source, u64::MAX);
        let mut end = source.begin;
        // A line without its end was being written when its process was killed.
        while let Some(line) = lines.next()? {
            match line.row.filter(|row| share.holds(self.chain(*row))) {
                // A row that occurs twice has the same content.
                Some(row) if self.has(row) => {}
                Some(row) => self.mark(row),
                None => self.damaged += 1,
            }
            end = line.end;
        }
        self.sources[place].end = end;
        Ok(())
    }

    fn chain(&self, row: usize) -> usize {
        self.plan.as_ref().map_or(row, |plan| plan.chain_of(row))
    }

    fn mark(&mut self, row: usize) {
        self.has[row / 64] |= 1 << (row % 64);
        self.count += 1;
    }

    /// Returns whether a row has a record.
    #[must_use]
    pub fn has(&self, row: usize) -> bool {
        self.has[row / 64] >> (row % 64) & 1 == 1
    }

    /// Returns the number of rows that have a record.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the number of rows in its share.
    #[must_use]
    pub fn own(&self) -> usize {
        self.own
    }

    /// Returns its share of the work.
    #[must_use]
    pub fn share(&self) -> Share {
        self.share
    }

    /// Returns whether no row of its share is missing.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.count == self.own
    }

    /// Returns the number of damaged lines: their rows are computed again.
    #[must_use]
    pub fn damaged(&self) -> usize {
        self.damaged
    }

    /// Returns the final files of finished work that were missing or changed: all rows are computed again.
    #[must_use]
    pub fn lost(&self) -> &[String] {
        &self.lost
    }

    /// Returns the chains of its share without a record, for rows that are separate chains, as ranges of their indices in the share.
    #[must_use]
    pub fn missing(&self) -> Vec<Range<usize>> {
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for i in (0..self.own).filter(|i| !self.has(self.share.chain(*i))) {
            match ranges.last_mut() {
                Some(last) if last.end == i => last.end += 1,
                _ => ranges.push(i..i + 1),
            }
        }
        ranges
    }

    /// Stores the record of a row: a text in one line.
    ///
    /// # Errors
    /// [`SweepError::Output`] if it cannot be written.
    pub fn keep(&mut self, row: usize, text: &str) -> Result<(), SweepError> {
        debug_assert!(!text.contains('\n'));
        let line = self.sources[0].line(row, text);
        self.append(&line)?;
        self.mark(row);
        if self.synced.elapsed() >= SYNC {
            self.sync()?;
        }
        Ok(())
    }

    /// Waits until all records are on disk.
    ///
    /// # Errors
    /// [`SweepError::Output`] if they cannot be written.
    pub fn sync(&mut self) -> Result<(), SweepError> {
        let synced = self.file.as_ref().map_or(Ok(()), File::sync_data);
        self.synced = Instant::now();
        Ok(synced.map_err(failed(&self.sources[0].path))?)
    }

    fn append(&mut self, line: &str) -> Result<(), SweepError> {
        let Source { path, end, .. } = &mut self.sources[0];
        let Some(file) = &mut self.file else { return Ok(()) };
        let write = file.seek(SeekFrom::Start(*end)).and_then(|_| file.write_all(line.as_bytes()));
        write.map_err(|source| {
            // Best effort: a tail without an end of line is dropped when the records are read.
            let _ = file.set_len(*end);
            failed(path)(source)
        })?;
        *end += line.len() as u64;
        Ok(())
    }

    /// Returns the texts of some rows, of those that have a record.
    ///
    /// # Errors
    /// [`SweepError::Output`] if they cannot be read.
    pub fn find(&self, wanted: &BTreeSet<usize>) -> Result<BTreeMap<usize, String>, SweepError> {
        let mut found = BTreeMap::new();
        for source in self.sources.iter().filter(|_| !wanted.is_empty()) {
            let mut lines = Lines::new(source, source.end);
            while let Some(line) = lines.next()? {
                if let Some(row) = line.row.filter(|row| wanted.contains(row)) {
                    found.entry(row).or_insert_with(|| lines.text(&line).to_owned());
                }
            }
        }
        Ok(found)
    }

    /// Passes all records to `take` in the order of their rows, with the index of the part of each.
    ///
    /// # Errors
    /// [`SweepError::Output`] if they cannot be read, or the error of `take`.
    pub fn in_order(
        &self,
        mut take: impl FnMut(usize, &str, usize) -> Result<(), SweepError>,
    ) -> Result<(), SweepError> {
        let mut ordered: Vec<Ordered<'_>> = self.sources.iter().map(Ordered::new).collect();
        for row in (0..self.rows).filter(|row| self.has(*row)) {
            let part = if ordered.len() == 1 { 0 } else { self.chain(row) % ordered.len() };
            take(row, &ordered[part].get(row)?, part)?;
        }
        Ok(())
    }

    /// Returns its folder, for figures; before any final file is written.
    pub fn outputs(&mut self) -> &mut Folder {
        &mut self.outputs
    }

    /// Writes tables, each from the lines of `write`, and `others` by name; then the seal, which is the header with what was `found`.
    /// Removes the file of records, except those of parts.
    ///
    /// # Errors
    /// [`SweepError::Output`] if a file cannot be read or written; the records are kept then.
    pub(crate) fn seal(
        &self,
        tables: &[&str],
        mut write: impl FnMut(&Self, usize, &mut Write<'_>) -> Result<(), SweepError>,
        others: &[(&str, String)],
        found: &[(&str, Value)],
    ) -> Result<(), SweepError> {
        for (i, name) in tables.iter().enumerate() {
            let mut table = UnfinishedFile::create(&self.folder, name)?;
            write(self, i, &mut |line| Ok(table.write(&format!("{line}\n"))?))?;
            table.publish()?;
        }
        for (name, text) in others {
            let mut part = UnfinishedFile::create(&self.folder, name)?;
            part.write(text)?;
            part.publish()?;
        }
        let figure = self.kept.figure();
        let names = tables.iter().copied().chain(others.iter().map(|(name, _)| *name));
        let names = names.chain(figure.iter().map(String::as_str).filter(|name| self.folder.join(name).is_file()));
        let sums = names.map(|name| Ok((name.to_owned(), Value::from(files::sum(&self.folder.join(name))?))));
        let sums = sums.collect::<Result<Map<String, Value>, OutputError>>()?;
        let mut header = self.header.clone();
        header.insert("sha256".to_owned(), sums.into());
        header.extend(found.iter().map(|(name, value)| ((*name).to_owned(), value.clone())));
        header.insert("crc32".to_owned(), files::own_sum(&header).into());
        let seal = format!("{:#}\n", Value::from(header));
        let mut part = UnfinishedFile::create(&self.folder, self.kept.files[1])?;
        part.write(&seal)?;
        part.publish()?;
        // The records are no longer needed. The lock is held until the file is removed.
        if self.file.is_some() {
            output::remove(&self.sources[0].path)?;
        }
        Ok(())
    }

    /// Writes the table of all rows below `head`, then the seal as [`seal`](Self::seal) does, with what was `found`; `text` makes the line
    /// of a row from its text and its part.
    ///
    /// # Errors
    /// Errors of [`seal`](Self::seal).
    pub(crate) fn table(
        &self,
        head: &str,
        text: impl Fn(&str, usize) -> String,
        others: &[(&str, String)],
        found: Value,
    ) -> Result<(), SweepError> {
        let write = |records: &Self, _: usize, line: &mut Write<'_>| {
            line(head)?;
            records.in_order(|_, row, part| line(&text(row, part)))
        };
        self.seal(&[self.kept.files[2]], write, others, &[("found", found)])
    }
}

/// Writes a line.
pub(crate) type Write<'a> = dyn FnMut(&str) -> Result<(), SweepError> + 'a;
