//! Example scenes: each builds, and its resolved form is the same scene again.

use std::{fs, path::PathBuf};

use flank::scene::Scene;

fn examples() -> Vec<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes");
    let mut files: Vec<_> =
        fs::read_dir(folder).expect("folder of examples").map(|f| f.expect("file").path()).collect();
    files.sort();
    files
}

#[test]
fn every_example_builds_and_resolves_to_itself() {
    for file in examples() {
        let scene = Scene::from_file(&file).unwrap_or_else(|e| panic!("{e}"));
        scene.build().unwrap_or_else(|e| panic!("{e}"));
        let again = Scene::from_json(&scene.resolved().to_string(), "again").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(again.resolved(), scene.resolved(), "{}", file.display());
        assert_eq!(again.hash(), scene.hash());
        assert_eq!(again.build(), scene.build());
    }
}
