//! `flank import`.

use std::{fmt::Write, path::PathBuf};

use serde_json::Value;

use super::print;
use crate::{
    Error,
    import::{Import, LARGEST, Options, import},
    output::{Fault, Table, label, read_file},
};

/// Arguments of `flank import`.
#[derive(Debug, clap::Args)]
pub struct ImportArguments {
    /// Gearbox file in the format REXS: XML, JSON or zip
    file: PathBuf,
    /// Scene to write; the origin of each number is written into a file beside it that ends in .origins.csv
    #[arg(long, value_name = "SCENE", default_value = "scene.json")]
    out: PathBuf,
    /// Load case by its id in the file; the first one if left out
    #[arg(long, value_name = "ID")]
    load_case: Option<String>,
    /// Number of the scene that replaces that of the file
    #[arg(long, value_name = "POINTER=VALUE")]
    set: Vec<String>,
    /// Shaft that stands still, by its name or id
    #[arg(long, value_name = "SHAFT")]
    fix: Vec<String>,
    /// Report numbers that the file does not have, in place of usual values
    #[arg(long)]
    no_defaults: bool,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// Makes a scene of a file.
pub fn execute(arguments: &ImportArguments) -> Result<(), Error> {
    let mut faults = Vec::new();
    let set = arguments.set.iter().filter_map(|text| assignment(text, &mut faults)).collect();
    let origins = arguments.out.with_extension("origins.csv");
    for path in [&arguments.out, &origins] {
        if path.exists() && !arguments.force {
            let fault = Fault::new("--out", format!("{}, which exists", path.display()), "a file that does not exist");
            faults.push(fault.remedy("name another file, or write --force"));
        }
    }
    if !faults.is_empty() {
        return Err(Error::Arguments(faults));
    }
    let bytes = read_file(&arguments.file, LARGEST)
        .map_err(|error| Error::Unread(arguments.file.display().to_string(), error))?;
    let options = Options {
        load_case: arguments.load_case.clone(),
        set,
        fix: arguments.fix.clone(),
        no_defaults: arguments.no_defaults,
    };
    let failed = |error| Error::Import(arguments.file.display().to_string(), error);
    let found = import(&bytes, &options).map_err(failed)?;
    for (path, text) in [(&arguments.out, format!("{:#}\n", found.scene)), (&origins, csv(&found))] {
        std::fs::write(path, text).map_err(|error| Error::file(path.display(), error))?;
    }
    if arguments.quiet {
        return Ok(());
    }
    print(&text(&found, arguments).unwrap_or_default())
}

/// Reads `POINTER=VALUE`, the value as JSON, or else a text.
fn assignment(text: &str, faults: &mut Vec<Fault>) -> Option<(String, Value)> {
    match text.split_once('=') {
        Some((pointer, value)) if pointer.starts_with('/') => {
            let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
            Some((pointer.to_owned(), value))
        }
        _ => {
            let fault = Fault::new("--set", text, "POINTER=VALUE, with the JSON pointer of a number of the scene");
            faults.push(fault.remedy("write it like --set /train/shafts/0/speed_rpm=1500"));
            None
        }
    }
}

fn rows(import: &Import) -> impl Iterator<Item = Vec<String>> + '_ {
    import.origins.iter().map(|origin| {
        let value = origin.value.as_str().map_or_else(|| origin.value.to_string(), str::to_owned);
        vec![origin.pointer.clone(), value, label(origin.source), origin.from.clone()]
    })
}

const HEAD: [&str; 4] = ["number", "value", "origin", "from"];

fn csv(import: &Import) -> String {
    Table::new(HEAD).with(rows(import)).csv()
}

fn text(import: &Import, arguments: &ImportArguments) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    write!(out, "{}", Table::new(HEAD).with(rows(import)))?;
    for note in &import.notes {
        writeln!(out, "note: {note}")?;
    }
    writeln!(out, "scene: {}", arguments.out.display())?;
    Ok(out)
}
