//! The folder a command writes into.

use std::{
    fs::{self, File},
    io::{BufWriter, LineWriter},
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::CliError;

/// Files of a run.
pub struct Folder {
    path: PathBuf,
}

/// Name of the measures, written last.
const SUMMARY: &str = "summary.json";

impl Folder {
    /// Refuses a folder that holds anything, unless `force`.
    pub fn check(path: &Path, force: bool) -> Result<(), CliError> {
        let occupied = fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some());
        if occupied && !force { Err(CliError::Occupied(path.display().to_string())) } else { Ok(()) }
    }

    /// Opens `path`, created if need be. One that holds anything is refused unless `force`.
    pub fn open(path: &Path, force: bool) -> Result<Self, CliError> {
        Self::check(path, force)?;
        fs::create_dir_all(path).map_err(|error| CliError::path(path, error))?;
        let folder = Self { path: path.to_owned() };
        // What an earlier run left must not be taken for this one's, even if this one is killed.
        for name in [
            SUMMARY,
            "events.jsonl",
            "trajectory.csv",
            "identify.json",
            "scene.json",
            "report.html",
            "study.json",
            "table.csv",
            "advise.csv",
            "advise.json",
            "timing.json",
            "stability.json",
            "stability.csv",
        ] {
            match fs::remove_file(folder.path.join(name)) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(CliError::path(&folder.path.join(name), error));
                }
                _ => {}
            }
        }
        Ok(folder)
    }

    fn create(&self, name: &str) -> Result<File, CliError> {
        let path = self.path.join(name);
        File::create(&path).map_err(|error| CliError::path(&path, error))
    }

    /// The event log: each line reaches the file as it is written.
    pub fn events(&self) -> Result<LineWriter<File>, CliError> {
        Ok(LineWriter::new(self.create("events.jsonl")?))
    }

    /// The trajectory.
    pub fn trajectory(&self) -> Result<BufWriter<File>, CliError> {
        Ok(BufWriter::new(self.create("trajectory.csv")?))
    }

    /// Writes the measures: complete, or not at all.
    pub fn summary(&self, summary: &impl Serialize) -> Result<(), CliError> {
        self.complete(SUMMARY, summary)
    }

    /// Writes a JSON file: complete, or not at all.
    pub fn complete(&self, name: &str, content: &impl Serialize) -> Result<(), CliError> {
        let text = serde_json::to_string_pretty(content);
        let text = text.map_err(|error| CliError::path(&self.path.join(name), error.into()))?;
        self.bytes(name, (text + "\n").as_bytes())
    }

    /// Writes any file: complete, or not at all.
    pub fn bytes(&self, name: &str, text: &[u8]) -> Result<(), CliError> {
        let (path, part) = (self.path.join(name), self.path.join(format!("{name}.part")));
        fs::write(&part, text).and_then(|()| fs::rename(&part, &path)).map_err(|error| CliError::path(&path, error))
    }
}
