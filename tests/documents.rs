//! Scenes written in the documents are scenes.

use std::{collections::BTreeSet, fs};

use flank::{Simulation, scene::Scene, system::Structure};
use serde_json::{Value, json};

#[test]
fn every_scene_in_the_documents_builds_and_starts() {
    let mut found = 0;
    for page in ["README.md", "docs/TUTORIAL.md", "docs/SCENE.md"] {
        let Ok(text) = fs::read_to_string(format!("{}/{page}", env!("CARGO_MANIFEST_DIR"))) else {
            panic!("{page} cannot be read");
        };
        for block in text.split("```json\n").skip(1).filter_map(|rest| rest.split("```").next()) {
            let built = Scene::from_json(block, page).and_then(|scene| scene.build());
            let built = built.unwrap_or_else(|error| panic!("{page}: {error}\n{block}"));
            let structure = Structure::new(built.spec).unwrap_or_else(|error| panic!("{page}: {error}\n{block}"));
            let [from, ..] = built.run.instants(structure.clock());
            assert!(structure.start(from, &built.q0, &built.v0).is_ok(), "{page}\n{block}");
            found += 1;
        }
    }
    assert_eq!(found, 13);
}

/// The places of all values of `value`, as `contacts[].name`.
fn places(value: &Value, at: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| {
            places(value, &if at.is_empty() { key.clone() } else { format!("{at}.{key}") }, found);
        }),
        Value::Array(items) => items.iter().for_each(|item| places(item, &format!("{at}[]"), found)),
        _ => {
            found.insert(at.to_owned());
        }
    }
}

/// Fields that may be null or a list or an object: the null has no place of its own.
const MAY_BE_NULL: [&str; 3] = ["verification", "accumulation", "transmission[].harmonics"];

#[test]
fn every_field_of_a_run_is_listed_with_its_unit_and_no_other() {
    let page = fs::read_to_string(format!("{}/docs/RESULTS.md", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let section = |title: &str| page.split("\n## ").find(|part| part.starts_with(title)).unwrap();
    let listed = |title: &str| -> BTreeSet<String> {
        let rows = section(title).lines().filter(|line| line.starts_with("| `"));
        rows.map(|row| row.split('`').nth(1).unwrap().to_owned()).collect()
    };
    let (mut summaries, mut events) = (BTreeSet::new(), BTreeSet::new());
    // Compliant with hysteresis, rigid with sequences of impacts, and one that is verified with inherited uncertainties.
    for (name, checked) in
        [("reference-light", false), ("W2b", false), ("W5c", false), ("W5b-p", true), ("W1a-ds", false)]
    {
        let scene = Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"))).unwrap();
        let scene = scene.with_all([("/run/verify", json!(checked)), ("/run/inherited_uncertainty", json!(checked))]);
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        Simulation::from_scene(scene.unwrap()).unwrap().write(&out).unwrap();
        let read = |file: &str| fs::read_to_string(out.join(file)).unwrap();
        places(&serde_json::from_str(&read("summary.json")).unwrap(), "", &mut summaries);
        read("events.jsonl").lines().for_each(|line| places(&serde_json::from_str(line).unwrap(), "", &mut events));
    }
    for (title, written) in [("`summary.json`", summaries), ("`events.jsonl`", events)] {
        let written: BTreeSet<_> = written.into_iter().filter(|at| !MAY_BE_NULL.contains(&at.as_str())).collect();
        let listed = listed(title);
        let unlisted: Vec<_> = written.difference(&listed).collect();
        let unwritten: Vec<_> = listed.difference(&written).collect();
        assert!(
            unlisted.is_empty() && unwritten.is_empty(),
            "{title}: not listed {unlisted:?}, not written {unwritten:?}"
        );
    }
}

/// Tells that two lines have the same words, and the same numbers to ten digits: the last ones differ from processor to processor.
#[cfg(feature = "cli")]
fn is_same(a: &str, b: &str) -> bool {
    let number = |word: &str| word.trim_end_matches(':').parse::<f64>().ok();
    let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-10 * a.abs().max(b.abs()) || a.abs().max(b.abs()) < 1e-12;
    let (a, b): (Vec<&str>, Vec<&str>) = (a.split_whitespace().collect(), b.split_whitespace().collect());
    let same = |(a, b): (&&str, &&str)| a == b || number(a).zip(number(b)).is_some_and(|(a, b)| is_near(a, b));
    a.len() == b.len() && a.iter().zip(&b).all(same)
}

/// Each command of the tutorial prints the lines below it.
#[cfg(feature = "cli")]
#[test]
fn the_tutorial_prints_what_it_says() {
    let page = fs::read_to_string(format!("{}/docs/TUTORIAL.md", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let scene = page.split("```json\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    fs::write(folder.path().join("my-pair.json"), scene).unwrap();
    let mut lines = 0;
    for block in page.split("```sh\n").skip(1) {
        let (command, rest) = block.split_once("\n```").unwrap();
        let Some(arguments) = command.strip_prefix("flank ") else { continue };
        let mut flank = std::process::Command::new(env!("CARGO_BIN_EXE_flank"));
        let output = flank.args(arguments.split(' ')).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
        let printed = String::from_utf8(output.stdout).unwrap();
        let said = rest.split("```text\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        for line in said.lines() {
            assert!(printed.lines().any(|own| is_same(own, line)), "{command} does not print\n{line}\n{printed}");
            lines += 1;
        }
    }
    assert_eq!(lines, 8);
}
