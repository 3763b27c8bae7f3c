use std::{
    collections::{BTreeMap, BTreeSet},
    marker::PhantomData,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value};

use super::{
    CommandFiles, Plan, Records, Share, SweepError,
    records::{Rows, Write},
};
use crate::output::{Folder, OutputError, Request, failed};

/// Start of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// Starts in a folder that is empty or does not exist.
    New,
    /// Starts anew in any folder; files in its manifest are removed.
    Replace,
    /// Resumes after the last row of an interrupted sweep; starts anew if there is none.
    Resume,
}

impl Begin {
    /// Returns the request for the output files in `folder`; the file `input` is never replaced.
    #[must_use]
    pub fn request<'a>(self, folder: &'a Path, input: Option<&'a Path>) -> Request<'a> {
        SWEEP.request(self, folder, input)
    }
}

/// The files of a sweep.
pub(crate) const SWEEP: CommandFiles =
    CommandFiles { command: "sweep", files: &["sweep.journal", "sweep.json", "sweep.csv", "sweep.jsonl"] };

/// Computed row: its result and its end, from which the neighbour may start, or its failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Outcome<R, S> {
    /// Success.
    Done {
        /// The row.
        result: R,
        /// End of the row, from which the neighbour may start.
        end: S,
    },
    /// Failure, with its reason. The neighbour starts fresh.
    Failed(String),
}

/// Rows of a sweep as they finish: [`Records`] that hold the result and the end of each row as JSON.
#[derive(Debug)]
pub struct Journal<R, S> {
    pub(super) records: Records,
    path: PathBuf,
    kind: PhantomData<fn() -> (R, S)>,
}

impl<R: Serialize + DeserializeOwned, S: Serialize + DeserializeOwned> Journal<R, S> {
    /// Opens the journal of a sweep over `plan` in `folder`, created if missing. `header` identifies the sweep: all data on which its rows
    /// depend. `None` if the sweep is to be resumed, and is finished.
    ///
    /// # Errors
    /// Errors of [`Records::open`].
    pub fn open(
        folder: &Path,
        begin: Begin,
        header: Map<String, Value>,
        plan: &Plan,
    ) -> Result<Option<Self>, SweepError> {
        Self::open_for(SWEEP, folder, (begin, Share::ALL), header, plan)
    }

    /// Opens the journal for a share of the work of a command whose files are `kept`.
    pub(crate) fn open_for(
        kept: CommandFiles,
        folder: &Path,
        how: (Begin, Share),
        header: Map<String, Value>,
        plan: &Plan,
    ) -> Result<Option<Self>, SweepError> {
        let records = Records::open(folder, kept, how, header, rows(plan))?;
        Ok(records.map(|records| Self { records, path: folder.join(kept.files[0]), kind: PhantomData }))
    }

    /// Merges the journals of parts, as [`Records::merged`].
    pub(crate) fn merged(
        folders: (&[PathBuf], usize),
        kept: CommandFiles,
        out: (&Path, Begin),
        header: Map<String, Value>,
        plan: &Plan,
    ) -> Result<Self, SweepError> {
        let records = Records::merged(folders, kept, out, header, rows(plan))?;
        Ok(Self { records, path: out.0.join(kept.files[0]), kind: PhantomData })
    }

    /// Returns its records.
    #[must_use]
    pub fn records(&self) -> &Records {
        &self.records
    }

    /// Returns its records, for the final files.
    pub fn records_mut(&mut self) -> &mut Records {
        &mut self.records
    }

    fn read(&self, text: &str) -> Result<Outcome<R, S>, SweepError> {
        Ok(serde_json::from_str(text).map_err(|error| failed(&self.path)(error.into()))?)
    }

    /// Returns the outcomes of some rows, of those that are stored.
    pub(super) fn find(&mut self, rows: &BTreeSet<usize>) -> Result<BTreeMap<usize, Outcome<R, S>>, SweepError> {
        let found = self.records.find(rows)?;
        found.into_iter().map(|(row, text)| Ok((row, self.read(&text)?))).collect()
    }

    /// Passes all rows to `take`, in their order.
    pub(crate) fn each(
        &mut self,
        mut take: impl FnMut(usize, Outcome<R, S>) -> Result<(), SweepError>,
    ) -> Result<(), SweepError> {
        let path = self.path.clone();
        self.records.in_order(|row, text, _| {
            take(row, serde_json::from_str(text).map_err(|error| failed(&path)(error.into()))?)
        })
    }

    /// Stores a row, and returns it as a resumed sweep would read it.
    pub(super) fn keep(&mut self, row: usize, outcome: Outcome<R, S>) -> Result<Outcome<R, S>, SweepError> {
        // JSON has neither infinities nor NaN.
        let read_back = serde_json::to_string(&outcome).and_then(|text| Ok((serde_json::from_str(&text)?, text)));
        let (outcome, text) = match read_back {
            Ok(whole) => whole,
            Err(error) => {
                let outcome = Outcome::Failed(format!("a result with a number that is not finite ({error})"));
                let text = serde_json::to_string(&outcome).map_err(|error| failed(&self.path)(error.into()))?;
                (outcome, text)
            }
        };
        self.records.keep(row, &text)?;
        Ok(outcome)
    }

    /// Passes its folder to `draw`, for figures; before any final file is written.
    pub(crate) fn draw(&mut self, draw: impl FnOnce(&mut Folder) -> Result<(), OutputError>) -> Result<(), SweepError> {
        Ok(draw(self.records.outputs())?)
    }

    /// Writes final files by name and head, each from the lines that `write` makes of every row; then the seal, which is the header with
    /// what was `found`. Removes the journal.
    pub(crate) fn seal(
        &mut self,
        tables: &[(&str, Option<String>)],
        mut write: impl FnMut(usize, usize, Outcome<R, S>, &mut Write<'_>) -> Result<(), SweepError>,
        found: &[(&str, Value)],
    ) -> Result<(), SweepError> {
        let path = self.path.clone();
        let names: Vec<&str> = tables.iter().map(|(name, _)| *name).collect();
        let table = |records: &Records, i: usize, line: &mut Write<'_>| {
            tables[i].1.iter().try_for_each(|head| line(head))?;
            records.in_order(|row, text, _| {
                let outcome = serde_json::from_str(text).map_err(|error| failed(&path)(error.into()))?;
                write(i, row, outcome, line)
            })
        };
        self.records.seal(&names, table, &[], found)
    }
}

/// Returns the rows of a plan.
fn rows(plan: &Plan) -> Rows<'_> {
    Rows { count: plan.rows(), chains: plan.chains(), plan: Some(plan) }
}
