//! Folders of the output of commands, and fields of tables. Foreign files in a folder are not changed.
//!
//! The manifest, `flank-manifest.json`, names every file that a command writes, before the file is created: a killed command leaves it too.
//! A later command replaces only files in the manifest. A file that is being written has `.part` behind its name; one entry of the manifest
//! covers both.

mod fault;
mod text;

use std::{
    fs::{self, File, Metadata, TryLockError},
    io::{self, Read, Write},
    path::{Component, Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::Duration,
};

use serde::{Deserialize, Serialize};

pub use fault::Fault;
pub use text::{Table, csv_line, five_digits, label, visible};
pub(crate) use text::{in_a_line, number};

/// Name of the manifest, a JSON object: version of Flank, command, files relative to the folder with `/`.
const MANIFEST: &str = "flank-manifest.json";

/// Reason why a folder cannot be written into.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The folder is not empty.
    #[error("{0} is not empty")]
    Occupied(PathBuf),
    /// The path is a file.
    #[error("{0} is a file, not a folder")]
    NoFolder(PathBuf),
    /// A file, folder or link that is in no manifest has the name of an output.
    #[error("{0} is in the way: {MANIFEST} does not name it as a file of an earlier command")]
    Foreign(PathBuf),
    /// Another command is writing into the folder.
    #[error("another command is writing into {0}")]
    InUse(PathBuf),
    /// The manifest names the input of the command.
    #[error("{0} is read by this command and would be replaced")]
    Input(PathBuf),
    /// The manifest cannot be followed, and why.
    #[error("{0} cannot be followed: {1}")]
    Manifest(PathBuf, String),
    /// A file cannot be read or written, and why.
    #[error("{0}: {1}")]
    File(PathBuf, io::Error),
}

/// Request of a command to write files into a folder.
#[derive(Debug)]
pub struct Request<'a> {
    /// The folder.
    pub folder: &'a Path,
    /// The command.
    pub command: &'a str,
    /// File that the command reads: never replaced.
    pub input: Option<&'a Path>,
    /// True if files that a manifest names may be replaced.
    pub force: bool,
    /// Every file that may be written, relative to the folder with `/`.
    pub files: Vec<String>,
}

/// Folder that a command writes into, with its manifest.
#[derive(Debug, Deserialize, Serialize)]
pub struct Folder {
    #[serde(skip)]
    path: PathBuf,
    flank: String,
    command: String,
    files: Vec<String>,
    /// Order of `files`: that of the request. Files are not always written in the same order.
    #[serde(skip)]
    order: Vec<String>,
    /// Folder, locked during the life of this value; none if a file system has no locks.
    #[serde(skip)]
    lock: Option<Lock>,
}

impl Request<'_> {
    /// Checks the request and returns the folder, nothing changed.
    ///
    /// # Errors
    /// [`OutputError`] if the folder is a file, or is not empty and `force` is not set, if a file is in the way, or if the manifest
    /// cannot be followed.
    pub fn check(&self) -> Result<Folder, OutputError> {
        if let Some(file) = self.folder.ancestors().find(|place| place.is_file()) {
            return Err(OutputError::NoFolder(file.to_owned()));
        }
        if !self.force && is_occupied(self.folder) {
            return Err(OutputError::Occupied(self.folder.to_owned()));
        }
        let path = self.folder.join(MANIFEST);
        let mut folder = match (found(&path), part(&path)) {
            // A first manifest that a killed command left is a file.
            (None, part) if found(&part).is_some_and(|data| !data.is_file()) => return Err(OutputError::Foreign(part)),
            (None, _) => Folder::new(self.command),
            (Some(data), _) if !data.is_file() => return Err(OutputError::Foreign(path)),
            _ => serde_json::from_slice(&fs::read(&path).map_err(failed(&path))?)
                .map_err(|error| OutputError::Manifest(path, error.to_string()))?,
        };
        folder.path = self.folder.to_owned();
        let input = self.input.and_then(|input| fs::canonicalize(input).ok());
        for name in &folder.files {
            let path = folder.place(name)?;
            for path in [part(&path), path] {
                if found(&path).is_some_and(|data| !data.is_file()) {
                    return Err(OutputError::Foreign(path));
                }
                if input.is_some() && fs::canonicalize(&path).ok() == input {
                    return Err(OutputError::Input(path));
                }
            }
        }
        self.files.iter().try_for_each(|name| folder.vacant(name).map(drop))?;
        Ok(folder)
    }

    /// Opens the folder, created if missing, and removes the files of its manifest.
    ///
    /// # Errors
    /// Errors of [`check`](Self::check), nothing changed then; [`OutputError::File`] if a file cannot be removed.
    pub fn open(&self) -> Result<Folder, OutputError> {
        let mut folder = self.lock()?;
        folder.clear(self.command, &[])?;
        folder.order.clone_from(&self.files);
        Ok(folder)
    }

    /// Returns the folder, created if missing, locked, and otherwise unchanged.
    ///
    /// # Errors
    /// Errors of [`check`](Self::check); [`OutputError::InUse`] if another command writes into it.
    pub fn lock(&self) -> Result<Folder, OutputError> {
        self.check()?;
        fs::create_dir_all(self.folder).map_err(failed(self.folder))?;
        let mut waited = Duration::ZERO;
        // A file system without locks offers no alternative.
        let lock = loop {
            let Ok(folder) = File::open(self.folder) else { break None };
            match folder.try_lock() {
                Ok(()) => break Some(Lock(folder)),
                Err(TryLockError::WouldBlock) if waited < Duration::from_millis(WAIT.load(Ordering::Relaxed)) => {
                    thread::sleep(LOOK);
                    waited += LOOK;
                }
                Err(TryLockError::WouldBlock) => return Err(OutputError::InUse(self.folder.to_owned())),
                Err(TryLockError::Error(_)) => break None,
            }
        };
        // Changes by other commands since then are visible only now.
        Ok(Folder { lock, ..self.check()? })
    }

    /// Opens the folder with the files of an earlier run of the same command, to resume it; `force` must be set.
    ///
    /// # Errors
    /// Errors of [`lock`](Self::lock); [`OutputError::Occupied`] if another command wrote into it.
    pub fn reopen(&self) -> Result<Folder, OutputError> {
        let mut folder = self.lock()?;
        if folder.command != self.command {
            return Err(OutputError::Occupied(self.folder.to_owned()));
        }
        folder.files.iter().try_for_each(|name| remove(&part(&folder.place(name)?)))?;
        folder.order.clone_from(&self.files);
        Ok(folder)
    }
}

/// Time for which a command waits for another one that writes into its folder, ms.
static WAIT: AtomicU64 = AtomicU64::new(0);
/// Pause between two checks of a lock.
const LOOK: Duration = Duration::from_millis(50);

/// Makes commands wait up to this time for others that write into their folders.
pub fn wait_for_others(time: Duration) {
    WAIT.store(u64::try_from(time.as_millis()).unwrap_or(u64::MAX), Ordering::Relaxed);
}

/// Locked folder.
#[derive(Debug)]
struct Lock(File);

impl Drop for Lock {
    /// Releases the lock at once: a process that is just being started may hold a copy of the file for a moment.
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

impl Folder {
    fn new(command: &str) -> Self {
        let (flank, command) = (env!("CARGO_PKG_VERSION").to_owned(), command.to_owned());
        Self { path: PathBuf::new(), flank, command, files: Vec::new(), order: Vec::new(), lock: None }
    }

    /// Removes the files of the manifest, except `kept`, and starts a manifest of `command`.
    pub(crate) fn clear(&mut self, command: &str, kept: &[&str]) -> Result<(), OutputError> {
        for name in self.files.iter().filter(|name| !kept.contains(&name.as_str())) {
            let path = self.place(name)?;
            remove(&part(&path))?;
            remove(&path)?;
        }
        *self = Self { path: std::mem::take(&mut self.path), lock: self.lock.take(), ..Self::new(command) };
        if kept.is_empty() { remove(&self.path.join(MANIFEST)) } else { self.list(kept) }
    }

    /// Enters files in the manifest.
    pub(crate) fn list(&mut self, names: &[&str]) -> Result<(), OutputError> {
        let new: Vec<String> = names.iter().filter(|name| !self.lists(name)).map(|name| (*name).to_owned()).collect();
        if new.is_empty() {
            return Ok(());
        }
        self.files.extend(new);
        self.files.sort_by_key(|name| self.order.iter().position(|other| other == name));
        let path = self.path.join(MANIFEST);
        fs::create_dir_all(&self.path).map_err(failed(&self.path))?;
        // Remainder of a manifest of a killed command: `read` has checked that it is Flank's.
        remove(&part(&path))?;
        whole(&path, &json(self).map_err(failed(&path))?)
    }

    /// Returns whether the file system has locks.
    #[must_use]
    pub fn is_locked(&self) -> bool {
        self.lock.is_some()
    }

    /// Returns the command that wrote the manifest.
    pub(crate) fn command(&self) -> &str {
        &self.command
    }

    /// Creates a file.
    ///
    /// # Errors
    /// [`OutputError`] if a file of the user has this name, or it cannot be created.
    pub fn create(&mut self, name: &str) -> Result<File, OutputError> {
        let path = self.enter(name)?;
        File::create_new(&path).map_err(failed(&path))
    }

    /// Writes a file: complete, or not at all.
    ///
    /// # Errors
    /// Errors of [`create`](Self::create).
    pub fn bytes(&mut self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(), OutputError> {
        whole(&self.enter(name)?, bytes.as_ref())
    }

    /// Writes a JSON file: complete, or not at all.
    ///
    /// # Errors
    /// Errors of [`create`](Self::create).
    pub fn complete(&mut self, name: &str, content: &impl Serialize) -> Result<(), OutputError> {
        self.bytes(name, json(content).map_err(failed(&self.path.join(name)))?)
    }

    fn enter(&mut self, name: &str) -> Result<PathBuf, OutputError> {
        let path = self.vacant(name)?;
        self.list(&[name])?;
        let folder = path.parent().unwrap_or(&self.path);
        fs::create_dir_all(folder).map_err(failed(folder))?;
        Ok(path)
    }

    fn lists(&self, name: &str) -> bool {
        self.files.iter().any(|file| file == name)
    }

    /// Returns the path of a file to write; an error if a file that the manifest does not name is there.
    fn vacant(&self, name: &str) -> Result<PathBuf, OutputError> {
        let path = self.place(name)?;
        match [path.clone(), part(&path)].into_iter().find(|path| found(path).is_some()) {
            Some(path) if !self.lists(name) => Err(OutputError::Foreign(path)),
            _ => Ok(path),
        }
    }

    /// Returns the path of a file: below the folder, through folders that are no links.
    fn place(&self, name: &str) -> Result<PathBuf, OutputError> {
        let (mut path, mut is_below) = (self.path.clone(), false);
        for component in Path::new(name).components() {
            if is_below && found(&path).is_some_and(|data| !data.is_dir()) {
                return Err(OutputError::Foreign(path));
            }
            is_below = matches!(component, Component::Normal(_));
            if !is_below {
                break;
            }
            path.push(component);
        }
        let why = || OutputError::Manifest(self.path.join(MANIFEST), format!("{name:?} is no path below its folder"));
        if is_below { Ok(path) } else { Err(why()) }
    }
}

/// Reads a file of at most `most` bytes that a user names.
///
/// # Errors
/// Those of reading; [`io::ErrorKind::InvalidInput`] for a folder, a pipe or a device, which may have no end;
/// [`io::ErrorKind::FileTooLarge`].
pub fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        let why = "a folder, a pipe or a device; flank reads files, and standard input in place of -";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, why));
    }
    read_at_most(File::open(path)?, most)
}

/// Reads at most `most` bytes.
///
/// # Errors
/// Those of reading; [`io::ErrorKind::FileTooLarge`].
pub fn read_at_most(from: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("more than {most} bytes")));
    }
    Ok(bytes)
}

/// Reads a text as [`read_file`] reads bytes.
///
/// # Errors
/// Those of [`read_file`]; [`io::ErrorKind::InvalidData`] for bytes that are no UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    let text = String::from_utf8(read_file(path, MOST)?);
    text.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.utf8_error().to_string()))
}

/// Largest size of a text that is read whole, bytes.
const MOST: u64 = 256 << 20;

/// Returns whether a folder holds something. What a killed command left of its first manifest does not count.
pub(crate) fn is_occupied(folder: &Path) -> bool {
    let left = part(Path::new(MANIFEST));
    fs::read_dir(folder).is_ok_and(|entries| entries.flatten().any(|entry| Path::new(&entry.file_name()) != left))
}

/// Returns the metadata of a path, if something is there; links are not followed.
fn found(path: &Path) -> Option<Metadata> {
    fs::symlink_metadata(path).ok()
}

/// Returns the path of a file while it is being written.
pub(crate) fn part(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

pub(crate) fn failed(path: &Path) -> impl Fn(io::Error) -> OutputError {
    move |error| OutputError::File(path.to_owned(), error)
}

fn json(content: &impl Serialize) -> io::Result<Vec<u8>> {
    Ok((serde_json::to_string_pretty(content)? + "\n").into_bytes())
}

fn whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let part = part(path);
    let write = File::create_new(&part).and_then(|mut file| file.write_all(bytes));
    write.and_then(|()| fs::rename(&part, path)).map_err(failed(path))
}

/// Removes a file, if it is there.
pub(crate) fn remove(path: &Path) -> Result<(), OutputError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed(path)(error)),
        _ => Ok(()),
    }
}
