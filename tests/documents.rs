//! Scenes written in the documents are scenes.

use std::fs;

use flank::{scene::Scene, system::Structure};

#[test]
fn every_scene_in_the_documents_builds_and_starts() {
    let mut found = 0;
    for page in ["README.md", "docs/SCENE.md"] {
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
    assert_eq!(found, 7);
}
