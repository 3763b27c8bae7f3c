//! Folders that commands write into. What is not Flank's there stays as it is.
//!
//! The manifest [`MANIFEST`] names every file that a command writes, before the file is created: a killed command leaves
//! it too. A later command replaces what the manifest names and nothing else. A file that is being written lies beside its
//! place with `.part` behind its name; the entry of the manifest stands for both.

mod error;

use std::{
    ffi::OsString,
    fs::{self, File},
    io::{self, Write},
    path::{Component, Path, PathBuf},
};

pub use error::OutputError;
use serde::{Deserialize, Serialize};

/// Name of the manifest, a JSON object: version of Flank, command, files relative to the folder with `/`.
pub const MANIFEST: &str = "flank-manifest.json";

#[derive(Debug, Deserialize, Serialize)]
struct Manifest {
    flank: String,
    command: String,
    files: Vec<String>,
}

/// What a command is going to write, and where.
#[derive(Debug)]
pub struct Request<'a> {
    /// The folder.
    pub folder: &'a Path,
    /// The command.
    pub command: &'a str,
    /// A file that the command reads: never replaced.
    pub input: Option<&'a Path>,
    /// Replace what a manifest names.
    pub force: bool,
    /// Every file that may be written, relative to the folder with `/`.
    pub files: Vec<String>,
}

/// A folder that a command writes into.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    manifest: Manifest,
}

impl Request<'_> {
    /// The folder as it is, nothing changed.
    ///
    /// # Errors
    /// [`OutputError`] if the folder is not empty and `force` is not set, if a file is in the way, or if the manifest
    /// cannot be followed.
    pub fn check(&self) -> Result<Folder, OutputError> {
        let occupied = fs::read_dir(self.folder).is_ok_and(|mut entries| entries.next().is_some());
        if occupied && !self.force {
            return Err(OutputError::Occupied(self.folder.to_owned()));
        }
        let written = Manifest::read(&self.folder.join(MANIFEST))?;
        let folder = Folder {
            path: self.folder.to_owned(),
            manifest: written.unwrap_or_else(|| Manifest::new(self.command, Vec::new())),
        };
        let input = self.input.and_then(|input| fs::canonicalize(input).ok());
        for name in &folder.manifest.files {
            let path = folder.place(name)?;
            for path in [part(&path), path] {
                if fs::symlink_metadata(&path).is_ok_and(|data| !data.is_file()) {
                    return Err(OutputError::Foreign(path));
                }
                if input.is_some() && fs::canonicalize(&path).ok() == input {
                    return Err(OutputError::Input(path));
                }
            }
        }
        for name in &self.files {
            folder.vacant(name)?;
        }
        Ok(folder)
    }

    /// Opens the folder, created if need be, and removes what its manifest names.
    ///
    /// # Errors
    /// As [`check`](Self::check), nothing changed then; [`OutputError::File`] if a file cannot be removed.
    pub fn open(&self) -> Result<Folder, OutputError> {
        let mut folder = self.check()?;
        fs::create_dir_all(&folder.path).map_err(|source| OutputError::file(&folder.path, source))?;
        folder.clear(self.command, &[])?;
        Ok(folder)
    }
}

impl Folder {
    /// Removes what the manifest names, `kept` apart, and starts a manifest of `command`.
    pub(crate) fn clear(&mut self, command: &str, kept: &[&str]) -> Result<(), OutputError> {
        for name in self.manifest.files.iter().filter(|name| !kept.contains(&name.as_str())) {
            let path = self.place(name)?;
            remove(&part(&path))?;
            remove(&path)?;
        }
        self.manifest = Manifest::new(command, kept.iter().map(|name| (*name).to_owned()).collect());
        if kept.is_empty() { remove(&self.path.join(MANIFEST)) } else { self.save() }
    }

    /// Enters files in the manifest.
    pub(crate) fn list(&mut self, names: &[&str]) -> Result<(), OutputError> {
        let new: Vec<&&str> = names.iter().filter(|name| !self.lists(name)).collect();
        if new.is_empty() {
            return Ok(());
        }
        self.manifest.files.extend(new.into_iter().map(|name| (*name).to_owned()));
        self.save()
    }

    /// The command that wrote the manifest.
    pub(crate) fn command(&self) -> &str {
        &self.manifest.command
    }

    /// Creates a file.
    ///
    /// # Errors
    /// [`OutputError`] if a file of the user's is in the way, or it cannot be created.
    pub fn create(&mut self, name: &str) -> Result<File, OutputError> {
        let path = self.enter(name)?;
        File::create_new(&path).map_err(|source| OutputError::file(&path, source))
    }

    /// Writes a file: complete, or not at all.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn bytes(&mut self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        whole(&self.enter(name)?, bytes)
    }

    /// Writes a JSON file: complete, or not at all.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn complete(&mut self, name: &str, content: &impl Serialize) -> Result<(), OutputError> {
        self.bytes(name, &json(content).map_err(|source| OutputError::file(&self.path.join(name), source))?)
    }

    fn enter(&mut self, name: &str) -> Result<PathBuf, OutputError> {
        let path = self.vacant(name)?;
        self.list(&[name])?;
        let folder = path.parent().unwrap_or(&self.path);
        fs::create_dir_all(folder).map_err(|source| OutputError::file(folder, source))?;
        Ok(path)
    }

    fn lists(&self, name: &str) -> bool {
        self.manifest.files.iter().any(|file| file == name)
    }

    /// Where a file goes, if nothing of the user's is there.
    fn vacant(&self, name: &str) -> Result<PathBuf, OutputError> {
        let path = self.place(name)?;
        let taken = |path: &PathBuf| fs::symlink_metadata(path).is_ok();
        match [path.clone(), part(&path)].into_iter().find(taken) {
            Some(path) if !self.lists(name) => Err(OutputError::Foreign(path)),
            _ => Ok(path),
        }
    }

    /// Where a file is: below the folder, through folders that are no links.
    fn place(&self, name: &str) -> Result<PathBuf, OutputError> {
        let parts: Vec<Component<'_>> = Path::new(name).components().collect();
        if parts.is_empty() || parts.iter().any(|part| !matches!(part, Component::Normal(_))) {
            return Err(OutputError::Manifest(
                self.path.join(MANIFEST),
                format!("{name:?} is no path below its folder"),
            ));
        }
        let mut path = self.path.clone();
        for part in &parts[..parts.len() - 1] {
            path.push(part);
            if fs::symlink_metadata(&path).is_ok_and(|data| !data.is_dir()) {
                return Err(OutputError::Foreign(path));
            }
        }
        Ok(path.join(parts[parts.len() - 1]))
    }

    fn save(&self) -> Result<(), OutputError> {
        let path = self.path.join(MANIFEST);
        fs::create_dir_all(&self.path).map_err(|source| OutputError::file(&self.path, source))?;
        // What a killed command left of a manifest: `read` has found it to be ours.
        remove(&part(&path))?;
        whole(&path, &json(&self.manifest).map_err(|source| OutputError::file(&path, source))?)
    }
}

impl Manifest {
    fn new(command: &str, files: Vec<String>) -> Self {
        Self { flank: env!("CARGO_PKG_VERSION").to_owned(), command: command.to_owned(), files }
    }

    fn read(path: &Path) -> Result<Option<Self>, OutputError> {
        match fs::symlink_metadata(path) {
            Err(_) if fs::symlink_metadata(part(path)).is_ok() => return Err(OutputError::Foreign(part(path))),
            Err(_) => return Ok(None),
            Ok(data) if !data.is_file() => return Err(OutputError::Foreign(path.to_owned())),
            Ok(_) => {}
        }
        let text = fs::read(path).map_err(|source| OutputError::file(path, source))?;
        let manifest = serde_json::from_slice(&text);
        manifest.map(Some).map_err(|error| OutputError::Manifest(path.to_owned(), error.to_string()))
    }
}

/// Where a file is while it is being written.
fn part(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    name.into()
}

fn json(content: &impl Serialize) -> io::Result<Vec<u8>> {
    Ok((serde_json::to_string_pretty(content)? + "\n").into_bytes())
}

fn whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let part = part(path);
    let write = File::create_new(&part).and_then(|mut file| file.write_all(bytes));
    write.and_then(|()| fs::rename(&part, path)).map_err(|source| OutputError::file(path, source))
}

fn remove(path: &Path) -> Result<(), OutputError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => Err(OutputError::file(path, source)),
        _ => Ok(()),
    }
}
