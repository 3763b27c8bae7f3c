//! The shape of the repository: who may import whom, how large a file may be, what lies where.
//!
//! The table is that of `docs/DESIGN.md`, "Who may import whom".

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// What a module may import of another one.
enum Part {
    All,
    /// These items only.
    Only(&'static [&'static str]),
}

use Part::{All, Only};

/// Module, and what it may import. Nothing imports `cli` or `error`, and a module without a row imports nothing. `python` is a crate of its
/// own, which imports only what is public.
const MAY_IMPORT: &[(&str, &[(&str, Part)])] = &[
    ("linalg", &[("hybrid", Only(&["Wide"]))]),
    ("hybrid", &[]),
    (
        "error",
        &[
            ("accuracy", Only(&["AccuracyError"])),
            ("engine", Only(&["EngineError"])),
            ("import", Only(&["ImportError"])),
            ("map", Only(&["BasinsError", "PlaneError"])),
            ("output", Only(&["Fault", "OutputError"])),
            ("scene", Only(&["SceneError"])),
            ("simulation", Only(&["SimulationError"])),
            ("study", Only(&["StudyError", "identify"])),
            ("sweep", Only(&["GridError", "SweepError"])),
            ("system", Only(&["AssembleError", "StartError"])),
            ("train", Only(&["TrainError"])),
        ],
    ),
    ("gear", &[]),
    ("output", &[]),
    ("sweep", &[("task", All), ("output", All)]),
    ("import", &[("gear", All), ("scene", Only(&["Scene"])), ("output", Only(&["Fault"]))]),
    ("poly", &[("vectors", All)]),
    ("system", &[("gear", All), ("hybrid", All), ("linalg", All), ("vectors", All)]),
    ("kernel", &[("system", All), ("gear", All), ("hybrid", All), ("poly", All), ("vectors", All)]),
    ("train", &[("system", All), ("gear", All), ("hybrid", All), ("linalg", All)]),
    ("integrate", &[("hybrid", All), ("linalg", All), ("poly", All)]),
    ("event", &[("hybrid", All), ("poly", All), ("integrate", Only(&["DenseStep"]))]),
    ("engine", &[("event", All), ("hybrid", All), ("integrate", All), ("poly", All)]),
    (
        "analysis",
        &[
            ("task", All),
            ("engine", All),
            ("event", All),
            ("hybrid", All),
            ("poly", All),
            ("linalg", All),
            ("integrate", Only(&["DenseStep"])),
            ("system", Only(&["Bearing", "BearingSpring", "Structure"])),
        ],
    ),
    (
        "scene",
        &[
            ("gear", All),
            ("system", All),
            ("train", All),
            ("output", Only(&["Fault", "read_at_most", "read_file", "visible"])),
            ("hybrid", Only(&["Clock", "Instant", "Wide"])),
            ("integrate", Only(&["Choice"])),
            ("vectors", All),
        ],
    ),
    ("baseline", &[("gear", All), ("system", All), ("hybrid", All), ("integrate", All)]),
    (
        "accuracy",
        &[
            ("simulation", All),
            ("output", All),
            ("scene", Only(&["Duration"])),
            ("task", All),
            ("analysis", All),
            ("baseline", All),
            ("engine", All),
            ("event", All),
            ("gear", All),
            ("hybrid", All),
            ("integrate", All),
            ("plot", All),
            ("system", All),
            ("train", All),
        ],
    ),
    (
        "simulation",
        &[
            ("analysis", All),
            ("engine", All),
            ("gear", All),
            ("hybrid", All),
            ("integrate", All),
            ("linalg", Only(&["multiplicities"])),
            ("output", All),
            ("scene", All),
            ("system", All),
            ("tangent", All),
            ("train", All),
            ("verify", All),
            ("event", Only(&["EventRecord"])),
            ("task", All),
        ],
    ),
    ("verify", &[("engine", All), ("event", All), ("hybrid", All), ("integrate", All)]),
    ("ensemble", &[("simulation", All), ("engine", All)]),
    ("task", &[]),
    ("vectors", &[]),
    (
        "tangent",
        &[
            ("analysis", Only(&["Quadrature"])),
            ("engine", All),
            ("event", Only(&["EventRecord"])),
            ("hybrid", All),
            ("integrate", Only(&["DenseStep"])),
            ("system", All),
            ("vectors", All),
        ],
    ),
    (
        "orbit",
        &[
            ("tangent", All),
            ("engine", All),
            ("event", Only(&["EventRecord"])),
            ("gear", Only(&["Stiffness", "contact"])),
            ("hybrid", All),
            ("integrate", Only(&["DenseStep"])),
            ("plot", All),
            ("simulation", All),
            ("system", All),
            ("task", All),
        ],
    ),
    (
        "branch",
        &[
            ("orbit", All),
            ("engine", All),
            ("event", Only(&["EventRecord"])),
            ("gear", All),
            ("hybrid", All),
            ("integrate", Only(&["DenseStep"])),
            ("poly", All),
            ("scene", All),
            ("simulation", All),
            ("system", All),
            ("task", All),
        ],
    ),
    ("plot", &[("output", All)]),
    (
        "map",
        &[
            ("engine", All),
            ("ensemble", All),
            ("hybrid", All),
            ("integrate", Only(&["DenseStep"])),
            ("orbit", All),
            ("output", All),
            ("plot", All),
            ("scene", All),
            ("simulation", All),
            ("study", All),
            ("sweep", All),
            ("system", All),
            ("task", All),
        ],
    ),
    (
        "study",
        &[
            ("branch", All),
            ("task", All),
            ("analysis", All),
            ("engine", All),
            ("event", All),
            ("gear", All),
            ("hybrid", All),
            ("integrate", All),
            ("linalg", All),
            ("orbit", All),
            ("plot", All),
            ("scene", All),
            ("simulation", All),
            ("sweep", All),
            ("output", All),
            ("system", All),
            ("train", All),
            ("verify", All),
        ],
    ),
];

/// Lines of code a file may have: blank lines, comments and tests apart.
const BUDGET: usize = 400;

/// Rooms, with the lines that each may have, comments included: its size of today, so that growth is a decision. The last number is the
/// target, the same where nothing is planned. The rooms of the core, from `kernel` to `vectors` in docs/DESIGN.md, aim at less.
const ROOMS: &[(&str, usize, usize)] = &[
    ("accuracy", 2620, 2620),
    ("analysis", 2520, 2520),
    ("baseline", 1500, 1500),
    ("branch", 3080, 3080),
    ("cli", 4240, 4240),
    ("engine", 2230, 1800),
    ("ensemble", 150, 150),
    ("error", 140, 140),
    ("event", 350, 320),
    ("gear", 1650, 1650),
    ("hybrid", 1890, 1600),
    ("import", 2790, 2790),
    ("integrate", 1770, 1650),
    ("kernel", 100, 100),
    ("kernel/bounds", 1180, 950),
    ("kernel/mode", 950, 800),
    ("kernel/series", 1930, 1500),
    ("kernel/ways", 4760, 2500),
    ("linalg", 200, 160),
    ("map", 2850, 2850),
    ("orbit", 4570, 4490),
    ("output", 590, 590),
    ("plot", 2440, 2440),
    ("poly", 1440, 1250),
    ("python", 1300, 1300),
    ("scene", 4890, 4890),
    ("simulation", 2360, 2360),
    ("study", 9710, 9710),
    ("sweep", 1740, 1740),
    ("system", 5090, 3700),
    ("tangent", 1150, 700),
    ("task", 80, 80),
    ("train", 3510, 3510),
    ("vectors", 330, 320),
    ("verify", 800, 800),
];

/// Rooms of the kernel, each of which may import those before it.
const KERNEL: [&str; 4] = ["mode", "series", "bounds", "ways"];

/// What lies at the top, besides what `.gitignore` names.
const TOP: &[&str] = &[
    ".ci",
    ".clippy.toml",
    ".git",
    ".gitignore",
    ".rustfmt.toml",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
    "benches",
    "docs",
    "examples",
    "pyproject.toml",
    "python",
    "src",
    "tests",
];

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All Rust files below `folder`.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(sources(&entry));
        } else if entry.extension().is_some_and(|e| e == "rs") {
            found.push(entry);
        }
    }
    found.sort();
    found
}

/// Path below the root, with `/`.
fn name(path: &Path) -> String {
    path.strip_prefix(ROOT).unwrap().components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

/// The code of a file: no blank lines, no comments, nothing from its tests on.
fn code(text: &str) -> String {
    let before_tests = text.split("#[cfg(test)]\nmod tests").next().unwrap_or(text);
    let is_code = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with("//");
    before_tests.lines().filter(is_code).collect::<Vec<_>>().join("\n")
}

/// Every path that starts with `crate::`, braces expanded.
fn imports(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        // Not `$crate::`, nor the end of a longer word.
        let before = code[..at].chars().next_back();
        if !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '$') {
            tree(&code[at + "crate::".len()..], &mut Vec::new(), &mut found);
        }
    }
    found
}

/// One branch of a use tree under `path`; returns how much of `text` it took.
fn tree(text: &str, path: &mut Vec<String>, found: &mut Vec<Vec<String>>) -> usize {
    let start = text.len() - text.trim_start().len();
    let rest = &text[start..];
    if rest.starts_with('{') {
        let mut at = start + 1;
        loop {
            let next = text[at..].trim_start();
            at = text.len() - next.len();
            match next.chars().next() {
                Some('}') | None => return at + 1,
                Some(',') => at += 1,
                _ => at += tree(next, path, found).max(1),
            }
        }
    }
    let word = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '*')).unwrap_or(rest.len());
    path.push(rest[..word].to_owned());
    let mut taken = start + word;
    if rest[word..].starts_with("::") {
        taken += 2 + tree(&rest[word + 2..], path, found);
    } else {
        found.push(path.clone());
        // `as` names belong to the branch.
        if rest[word..].starts_with(" as ") {
            taken += rest[word..].find([',', '}', ';']).unwrap_or(0);
        }
    }
    path.pop();
    taken
}

#[test]
fn use_trees_are_expanded() {
    let text = "use crate::{a::{b, c::{self, d as e}}, f};\nlet x = crate::g::h(1);";
    let joined: Vec<String> = imports(text).iter().map(|path| path.join("::")).collect();
    assert_eq!(joined, ["a::b", "a::c::self", "a::c::d", "f", "g::h"]);
}

#[test]
fn modules_import_only_what_the_table_allows() {
    let allowed: BTreeMap<&str, &[(&str, Part)]> = MAY_IMPORT.iter().map(|(module, row)| (*module, *row)).collect();
    let mut wrong = Vec::new();
    for path in sources(&Path::new(ROOT).join("src")) {
        let file = name(&path);
        // A module is a folder or a file.
        let module = file["src/".len()..].split(['/', '.']).next().unwrap_or_default();
        if ["cli", "lib", "main", "python"].contains(&module) {
            continue;
        }
        let Some(row) = allowed.get(module) else {
            wrong.push(format!("{file}: module {module} is not in the table"));
            continue;
        };
        for import in imports(&code(&read(&path))) {
            let [target, item @ ..] = &import[..] else { continue };
            let fits = target == module
                || row.iter().any(|(name, part)| {
                    name == target
                        && match part {
                            All => true,
                            Only(items) => item.first().is_some_and(|item| items.contains(&item.as_str())),
                        }
                });
            if !fits {
                wrong.push(format!("{file} imports {}", import.join("::")));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn rooms_of_the_kernel_import_only_those_before_them() {
    let mut wrong = Vec::new();
    for (place, room) in KERNEL.iter().enumerate() {
        for path in sources(&Path::new(ROOT).join("src/kernel").join(room)) {
            for import in imports(&code(&read(&path))) {
                let [module, target, ..] = &import[..] else { continue };
                if module == "kernel" && KERNEL[place + 1..].contains(&target.as_str()) {
                    wrong.push(format!("{} imports {}", name(&path), import.join("::")));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_stay_within_their_budget() {
    let mut wrong = Vec::new();
    for path in sources(&Path::new(ROOT).join("src")) {
        let (file, lines) = (name(&path), code(&read(&path)).lines().count());
        if lines > BUDGET {
            wrong.push(format!("{file}: {lines} lines of code, {BUDGET} allowed"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn rooms_stay_within_their_budgets() {
    let mut lines: BTreeMap<String, usize> = BTreeMap::new();
    for path in sources(&Path::new(ROOT).join("src")) {
        let file = name(&path);
        let mut parts = file["src/".len()..].split(['/', '.']);
        let mut room = parts.next().unwrap_or_default().to_owned();
        if let Some(inner) = parts.next().filter(|inner| room == "kernel" && KERNEL.contains(inner)) {
            room = format!("{room}/{inner}");
        }
        *lines.entry(room).or_default() += read(&path).lines().count();
    }
    assert!(ROOMS.iter().all(|(_, today, target)| target <= today), "a target is above the size of today");
    let budgets: BTreeMap<&str, usize> = ROOMS.iter().map(|(room, today, _)| (*room, *today)).collect();
    let wrong: Vec<String> = lines
        .iter()
        .filter(|(room, _)| !["lib", "main"].contains(&room.as_str()))
        .map(|(room, lines)| (room, *lines, budgets.get(room.as_str()).copied().unwrap_or(0)))
        .filter(|(_, lines, budget)| lines > budget || lines + 100 < *budget)
        .map(|(room, lines, budget)| format!("{room}: {lines} lines, {budget} allowed (and at most 100 to spare)"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Methods of `f64` whose last bits depend on the system's library.
const ELEMENTARY: [&str; 23] = [
    "sin", "cos", "sin_cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp_m1", "ln",
    "ln_1p", "log10", "log2", "powf", "hypot", "acosh", "asinh", "atanh", "cbrt",
];

#[test]
fn elementary_functions_come_from_one_crate() {
    let mut wrong = Vec::new();
    for path in sources(&Path::new(ROOT).join("src")) {
        let code = code(&read(&path));
        let called = |method: &&&str| code.contains(&format!(".{method}(")) || code.contains(&format!("f64::{method}"));
        wrong.extend(ELEMENTARY.iter().filter(called).map(|method| format!("{}: {method}", name(&path))));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_binary_is_thin() {
    let lines = read(&Path::new(ROOT).join("src/main.rs")).lines().count();
    assert!(lines <= 60, "src/main.rs has {lines} lines");
}

#[test]
fn every_law_and_every_method_says_what_it_is() {
    for folder in ["src/gear/contact", "src/integrate"] {
        for path in sources(&Path::new(ROOT).join(folder)) {
            let text = read(&path);
            let first_item = ["pub struct ", "pub enum ", "pub trait ", "pub fn ", "pub(super) struct "]
                .iter()
                .filter_map(|item| text.find(item))
                .min()
                .unwrap_or(text.len());
            let described = text[..first_item].lines().any(|l| l.starts_with("//!") || l.starts_with("///"));
            assert!(described, "{}: no description before its first item", name(&path));
        }
    }
}

#[test]
fn the_top_holds_nothing_else() {
    let root = Path::new(ROOT);
    let ignored = read(&root.join(".gitignore"));
    let ignored: Vec<&str> = ignored.lines().filter_map(|line| line.strip_prefix('/')).collect();
    for entry in fs::read_dir(root).unwrap() {
        let entry = entry.unwrap().file_name().to_string_lossy().into_owned();
        let known = TOP.contains(&entry.as_str()) || ignored.contains(&entry.trim_end_matches('/'));
        assert!(known, "{entry} lies at the top of the repository");
    }
}

#[test]
fn the_gate_runs_the_test_command_of_the_readme() {
    let root = Path::new(ROOT);
    // A published package has no gate.
    let Ok(gate) = fs::read_to_string(root.join(".ci/run")) else { return };
    let readme = read(&root.join("README.md"));
    let commands: Vec<&str> = readme.lines().filter(|line| line.starts_with("cargo test")).collect();
    assert_eq!(commands.len(), 1, "one test command in the README: {commands:?}");
    assert!(gate.lines().any(|line| line == commands[0]), ".ci/run does not run `{}`", commands[0]);
}
