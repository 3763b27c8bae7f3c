//! Scenes written in the documents are scenes.

use std::{collections::BTreeSet, fs};

use flank::{Simulation, scene::Scene, system::Structure};
use serde_json::{Value, json};

fn read(page: &str) -> String {
    fs::read_to_string(format!("{}/{page}", env!("CARGO_MANIFEST_DIR")))
        .unwrap_or_else(|error| panic!("{page}: {error}"))
}

#[test]
fn every_scene_in_the_documents_builds_and_starts() {
    let mut found = 0;
    for page in ["docs/TUTORIAL.md", "docs/SCENE.md"] {
        let text = read(page);
        for block in text.split("```json\n").skip(1).filter_map(|rest| rest.split("```").next()) {
            let built = Scene::from_json(block, page).and_then(|scene| scene.build());
            let built = built.unwrap_or_else(|error| panic!("{page}: {error}\n{block}"));
            let structure = Structure::new(built.spec).unwrap_or_else(|error| panic!("{page}: {error}\n{block}"));
            let [from, ..] = built.run.instants(structure.clock());
            assert!(structure.start(from, &built.q0, &built.v0).is_ok(), "{page}\n{block}");
            found += 1;
        }
    }
    assert_eq!(found, 12);
    // The tutorial's pair is an example too.
    let tutorial = read("docs/TUTORIAL.md");
    assert!(tutorial.contains(&read("examples/scenes/my-pair.json")));
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
    let page = read("docs/RESULTS.md");
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
