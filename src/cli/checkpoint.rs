//! Checkpoint of an interrupted command, from which the same command with `--resume` goes on.

use std::{fs, io, path::Path};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value, json};

use super::{Completion, print};
use crate::{
    Error,
    output::{Fault, Folder, OutputError, Request},
    sweep::same,
};

/// Content of a checkpoint: the request, the work done so far, and the end of a finished command.
#[derive(Deserialize)]
struct Content<T> {
    asked: Map<String, Value>,
    work: Option<T>,
    finished: Option<Completion>,
}

/// Start of a command: with work to do, or finished before.
pub enum CommandStart<T> {
    /// Work remains; the second field is the work done so far.
    Open(Checkpoint, Option<T>),
    /// The command was finished before, and ended so.
    Finished(Completion),
}

impl<T: DeserializeOwned> Content<T> {
    /// Reads the checkpoint of an earlier command from `file` of `folder`, if there is one; an error if its request differs.
    fn read(folder: &Path, file: &str, asked: &Map<String, Value>) -> Result<Option<Self>, Error> {
        let path = folder.join(file);
        let text = match fs::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            text => String::from_utf8_lossy(&text.map_err(|error| Error::file(path.display(), error))?).into_owned(),
        };
        let place = path.display().to_string();
        let fault = |found: String| {
            let fault = Fault::new(&place, found, "what an earlier command wrote");
            Error::Arguments(vec![fault.remedy("write --force to begin anew")])
        };
        let content = checked(&text).ok_or_else(|| fault("damaged: its checksum does not fit".to_owned()))?;
        let content: Self = serde_json::from_str(content).map_err(|error| fault(error.to_string()))?;
        same(folder, &content.asked, asked)?;
        Ok(Some(content))
    }
}

/// Folder of a command that can be interrupted, and the name of its checkpoint file.
pub struct Checkpoint {
    pub folder: Folder,
    file: &'static str,
    asked: Map<String, Value>,
}

impl Checkpoint {
    /// Opens the folder, with the checkpoint of the same command if it is to `resume`.
    pub fn begin<T: DeserializeOwned>(
        request: &Request<'_>,
        file: &'static str,
        asked: &Value,
        (resume, quiet): (bool, bool),
    ) -> Result<CommandStart<T>, Error> {
        let asked = asked.as_object().cloned().unwrap_or_default();
        let earlier = if resume { Content::<T>::read(request.folder, file, &asked)? } else { None };
        if let Some(done) = earlier.as_ref().and_then(|content| content.finished) {
            if !quiet {
                print(&format!("{} holds the whole of it\n", request.folder.display()))?;
            }
            return Ok(CommandStart::Finished(done));
        }
        // Files of another command are not removed by --resume.
        let folder = if resume { request.reopen() } else { request.open() }?;
        let (work, mut checkpoint) = (earlier.and_then(|content| content.work), Self { folder, file, asked });
        if work.is_none() {
            // Work that is interrupted before the first checkpoint is identified by its request.
            checkpoint.write(None::<()>, None)?;
        }
        Ok(CommandStart::Open(checkpoint, work))
    }

    /// Writes the work done so far.
    pub fn keep(&mut self, work: &impl Serialize) -> Result<(), OutputError> {
        self.write(Some(work), None)
    }

    /// Writes that the command is finished, and how it ended.
    pub fn finish(&mut self, done: Completion) -> Result<(), OutputError> {
        self.write(None::<()>, Some(done))
    }

    fn write(&mut self, work: Option<impl Serialize>, finished: Option<Completion>) -> Result<(), OutputError> {
        let content = json!({ "asked": self.asked, "work": work, "finished": finished }).to_string();
        let sum = crc32fast::hash(content.as_bytes());
        self.folder.bytes(self.file, format!("{HEAD}{sum:08x}{MIDDLE}{content}{TAIL}"))
    }
}

/// Text around the checksum and the content.
const HEAD: &str = "{\"crc32\":\"";
const MIDDLE: &str = "\",\"content\":";
const TAIL: &str = "}\n";

/// Returns the content of a file, if its checksum fits.
fn checked(text: &str) -> Option<&str> {
    let (sum, rest) = text.strip_prefix(HEAD)?.split_at_checked(8)?;
    let content = rest.strip_prefix(MIDDLE)?.strip_suffix(TAIL)?;
    (u32::from_str_radix(sum, 16).ok()? == crc32fast::hash(content.as_bytes())).then_some(content)
}
