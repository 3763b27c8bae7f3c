//! `docs/REFERENCE.md` is made from the program: its help, the description of scenes, and the files that its commands write.
//!
//! `FLANK_WRITE=1 cargo test --test house reference` writes the page.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
    fs,
    path::Path,
    process::{Command, Output},
};

use serde_json::{Map, Value};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Commands that write files, on small cases: what they are told, and the folder that they write.
const WRITERS: [&str; 16] = [
    "run examples/scenes/W2b.json --trajectory --out run",
    "check examples/scenes/my-pair.json --out check",
    "sweep examples/scenes/my-pair.json --vary /train/torque_nm=4:30:2 --out sweep",
    "map examples/scenes/kahraman-singh.json --vary /train/mean_load=0.1:0.2:2 --vary /train/transmission_error/0/frequency=0.5:0.6:2 --out map",
    "diagram examples/scenes/kahraman-singh.json --vary /train/mean_load=0.1:0.2:2 --out diagram",
    "basins examples/scenes/kahraman-singh.json --vary /initial/q/0=-1:1:4 --vary /initial/v/0=-1:1:4 --out basins",
    "orbit examples/scenes/kahraman-singh.json --out orbit",
    "continue examples/scenes/kahraman-singh.json --vary /train/mean_load=0.1:0.2 --doublings 0 --out continue",
    "lyapunov examples/scenes/W1a-ch.json --cycles 2000 --out lyapunov",
    "compare examples/scenes/W1a-ss.json --methods rk4 --cycles 2 --repetitions 1 --out compare",
    "stability examples/scenes/W1a-ss.json --methods rk4 --factors 1:2:2 --steps 100:1000:2 --cycles 10 --out stability",
    "advise examples/scenes/spur-pair.json --out advise",
    "identify examples/scenes/reference-heavy.json --vary /train/planet/translation/stiffness_n_per_m=1e7:1e9 --target translational:2=889 --out identify",
    "fit examples/studies/rattling-pair.json --trials 4 --seed 1 --out fit",
    "study --only cycles --out study",
    "sound examples/scenes/my-pair.json --out sound.wav",
];

fn flank(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flank")).args(arguments).current_dir(folder).output().unwrap()
}

fn help(arguments: &[&str]) -> String {
    String::from_utf8(flank(&[arguments, &["--help"]].concat(), Path::new(ROOT)).stdout).unwrap()
}

/// Groups of options that several commands have.
const SHARED: [&str; 2] = ["Figures:", "Parts:"];

/// The help of one command in sections: what stands before the options, and each group of options.
fn sections(help: &str) -> Vec<(String, String)> {
    let mut sections = vec![(String::new(), String::new())];
    for line in help.lines() {
        let is_head = line.ends_with(':') && !line.starts_with(' ');
        if is_head {
            sections.push((line.to_owned(), String::new()));
        } else {
            let text = &mut sections.last_mut().unwrap().1;
            text.push_str(line.trim_end());
            text.push('\n');
        }
    }
    sections
}

/// Entries of a group of options that all commands have.
fn is_global(entry: &str) -> bool {
    ["--lock-wait", "-h, --help", "-V, --version"].iter().any(|global| entry.trim_start().starts_with(global))
}

fn commands(page: &mut String) {
    let top = help(&[]);
    writeln!(page, "## Commands\n\n```text\n{}\n```\n", top.trim_end()).unwrap();
    let list = sections(&top).into_iter().find(|(head, _)| head == "Commands:").unwrap().1;
    let names: Vec<String> = list.lines().filter_map(|line| line.split_whitespace().next()).map(String::from).collect();
    let mut shared = BTreeMap::new();
    for name in names.iter().filter(|name| *name != "help") {
        let text = help(&[name]);
        writeln!(page, "### `flank {name}`\n\n```text").unwrap();
        let mut written = String::new();
        for (head, body) in sections(&text) {
            if SHARED.contains(&head.as_str()) {
                let entries: Vec<&str> = body.split("\n\n").filter(|entry| !is_global(entry)).collect();
                let body = entries.join("\n\n").trim_matches('\n').to_owned();
                let other = shared.insert(head.clone(), body.clone()).filter(|other| *other != body);
                assert!(other.is_none(), "{name} has other options under {head}:\n{body}\nthan\n{other:?}");
                writeln!(written, "{head} as all commands that have them, below\n").unwrap();
                continue;
            }
            let entries: Vec<&str> = body.split("\n\n").filter(|entry| !is_global(entry)).collect();
            let body = entries.join("\n\n");
            if !body.trim().is_empty() {
                writeln!(written, "{head}\n{}\n", body.trim_matches('\n')).unwrap();
            }
        }
        writeln!(page, "{}\n```\n", written.trim()).unwrap();
    }
    page.push_str("### Options of several commands\n\n```text\n");
    for (head, body) in shared {
        writeln!(page, "{head}\n{}\n", body.trim_matches('\n')).unwrap();
    }
    page.push_str("```\n\n");
}

/// A shape of `src/scene/shapes.json` in words.
fn shape(value: &Value) -> String {
    match value {
        Value::String(name) => match name.strip_prefix('@') {
            Some(name) => format!("[{name}](#{})", name.replace(' ', "-")),
            None => name.clone(),
        },
        Value::Array(either) => either.iter().map(shape).collect::<Vec<_>>().join(", or "),
        Value::Object(object) => {
            let of = |key: &str| object.get(key).map(shape);
            if let Some(words) = object.get("choice") {
                let words =
                    words.as_array().map(|words| words.iter().map(|word| format!("`{}`", word.as_str().unwrap())));
                return words.map_or_else(|| "a name".to_owned(), |words| words.collect::<Vec<_>>().join(", "));
            }
            if let Some(item) = of("list") {
                return format!("list of {item}");
            }
            if let Some(item) = of("map") {
                return format!("object of {item}");
            }
            if let Some(Value::Array(cases)) = object.get("cases") {
                let tag = object["variant"].as_str().unwrap_or_default();
                let cases = cases.iter().map(|case| format!("`{}`: {}", case[0].as_str().unwrap(), shape(&case[1])));
                return format!("by `{tag}`: {}", cases.collect::<Vec<_>>().join("; "));
            }
            let keys: Vec<String> =
                object.get("keys").and_then(Value::as_array).into_iter().flatten().map(key).collect();
            if keys.is_empty() { "object".to_owned() } else { format!("object of {}", keys.join(", ")) }
        }
        other => other.to_string(),
    }
}

/// A key of an object inside a cell.
fn key(entry: &Value) -> String {
    match entry {
        Value::Array(parts) => format!("`{}` ({})", unit(parts[0].as_str().unwrap()), shape(&parts[2])),
        other => shape(other),
    }
}

/// A key with its unit: `speed~m_per_s` is `speed_m_per_s`, or `speed` in dimensionless form.
fn unit(key: &str) -> String {
    key.replace('~', "_")
}

fn presence(value: &Value) -> String {
    match value {
        Value::String(word) if word == "needed" => "needed".to_owned(),
        Value::String(_) => String::new(),
        other => other.get("default").map(|default| format!("`{default}`")).unwrap_or_default(),
    }
}

fn keys(page: &mut String) {
    page.push_str("## Keys of a scene\n\nA link leads to the keys of an object. *Default*: `needed`, a value, or nothing where the key may be left out.\n\n");
    let text = fs::read_to_string(Path::new(ROOT).join("src/scene/shapes.json")).unwrap();
    let shapes: Map<String, Value> = serde_json::from_str(&text).unwrap();
    for (name, value) in &shapes {
        writeln!(page, "### {name}\n").unwrap();
        let Some(entries) = value.get("keys").and_then(Value::as_array) else {
            writeln!(page, "{}\n", shape(value)).unwrap();
            continue;
        };
        if let Some(about) = value.get("object").and_then(Value::as_str) {
            writeln!(page, "{about}\n").unwrap();
        }
        page.push_str("| key | default | value | meaning |\n|---|---|---|---|\n");
        for entry in entries {
            match entry {
                Value::Array(parts) => {
                    let [name, about] = [0, 3].map(|i| parts.get(i).and_then(Value::as_str).unwrap_or_default());
                    let cells = [format!("`{}`", unit(name)), presence(&parts[1]), shape(&parts[2]), about.to_owned()];
                    writeln!(page, "| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | ")).unwrap();
                }
                other => writeln!(page, "| all of {} | | | |", shape(other)).unwrap(),
            }
        }
        page.push('\n');
    }
}

/// The places of all values of `value`, as `contacts[].name`.
fn places(value: &Value, at: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| {
            places(value, &if at.is_empty() { key.clone() } else { format!("{at}.{key}") }, found);
        }),
        Value::Array(items) if !items.is_empty() => {
            items.iter().for_each(|item| places(item, &format!("{at}[]"), found))
        }
        _ => {
            found.insert(at.to_owned());
        }
    }
}

/// Columns of a table, or fields of JSON.
fn fields(path: &Path) -> Option<String> {
    let text = fs::read_to_string(path).ok()?;
    let list = |fields: Vec<String>| fields.iter().map(|field| format!("`{field}`")).collect::<Vec<_>>().join(", ");
    match path.extension()?.to_str()? {
        "csv" => {
            Some(list(csv::Reader::from_reader(text.as_bytes()).headers().ok()?.iter().map(String::from).collect()))
        }
        "json" => {
            let mut found = BTreeSet::new();
            places(&serde_json::from_str(&text).ok()?, "", &mut found);
            Some(list(found.into_iter().collect()))
        }
        "jsonl" => {
            let mut found = BTreeSet::new();
            text.lines()
                .filter_map(|line| serde_json::from_str(line).ok())
                .for_each(|line| places(&line, "", &mut found));
            Some(list(found.into_iter().collect()))
        }
        _ => None,
    }
}

fn files(page: &mut String) {
    page.push_str("## Files\n\nColumns of tables and fields of JSON, as the command above each list writes them. Units are part of the names. `figures/` has a CSV and a JSON\nfile with the numbers of each picture.\n\n");
    let folder = super::pages::commands::folder();
    for writer in WRITERS {
        let words: Vec<&str> = writer.split(' ').collect();
        let out = flank(&words, folder.path());
        assert!(out.status.success(), "{writer}: {}", String::from_utf8_lossy(&out.stderr));
        writeln!(page, "### Files of `flank {}`\n\n`flank {writer}`\n", words[0]).unwrap();
        let target = folder.path().join(words[words.len() - 1]);
        let mut names: Vec<_> = match fs::read_dir(&target) {
            Ok(entries) => entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect(),
            Err(_) => vec![target],
        };
        names.sort();
        for path in names {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            match fields(&path) {
                Some(fields) => writeln!(page, "- `{name}`: {fields}").unwrap(),
                None => writeln!(page, "- `{name}`").unwrap(),
            }
        }
        page.push('\n');
    }
}

#[test]
fn the_reference_page_is_that_of_this_program() {
    let mut page = "# Reference\n\nCommands, options, exit codes, keys and files. This page is made from the program: `FLANK_WRITE=1 cargo test --test house reference`\nwrites it. [RESULTS.md](RESULTS.md) explains the fields of a run, [SCENE.md](SCENE.md) the keys of a scene in context.\n\n".to_owned();
    commands(&mut page);
    keys(&mut page);
    files(&mut page);
    let page = format!("{}\n", page.trim_end());
    let path = Path::new(ROOT).join("docs/REFERENCE.md");
    if std::env::var_os("FLANK_WRITE").is_some() {
        fs::write(&path, &page).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap();
    let other = written.lines().zip(page.lines()).find(|(a, b)| a != b);
    assert!(written == page, "docs/REFERENCE.md is stale, first at {other:?}; FLANK_WRITE=1 writes it");
}
