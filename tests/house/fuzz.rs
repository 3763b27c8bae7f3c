//! Properties that readers of files have for any bytes. `tests/house/readers.rs` tries them too.

use flank::{
    import::{ImportError, Options, import},
    scene::Scene,
    sweep::{Begin, CommandFiles, Records, Rows, Share},
};

/// A scene is read or refused with words; its resolved form is the same scene.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match Scene::from_json(text, "bytes") {
        Ok(scene) => {
            let again = Scene::from_value(scene.resolved().clone(), "bytes").map(|again| again.hash());
            assert_eq!(again, Ok(scene.hash()), "the resolved scene is another one");
        }
        Err(error) => {
            assert!(!error.faults.is_empty());
            let said = error.to_string();
            assert!(!said.contains(|c: char| c.is_control() && c != '\n'), "{said:?} would move a terminal");
        }
    }
}

/// A file of another program makes a scene, or is refused with words.
pub fn imported(bytes: &[u8]) {
    match import(bytes, &Options::default()) {
        Ok(found) => drop(Scene::from_value(found.scene, "bytes")),
        Err(ImportError::Faults(faults)) => assert!(!faults.is_empty()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// Rows of the file, and their texts.
const COUNT: usize = 12;
const TEXTS: [&str; 3] = ["0.5,periodic,1,", "-1e-300,,\"a, b\"", "{\"kept\":[1,2.5]}"];
const KEPT: CommandFiles = CommandFiles { command: "fuzz", files: &["fuzz.rows", "fuzz.json", "fuzz.csv"] };

/// A file of rows with some bytes changed gives the rows that were kept or none; `bytes` are edits: place (two bytes), kind, byte.
pub fn rows(bytes: &[u8]) {
    let folder = tempfile::tempdir().expect("a folder");
    let open = |begin| {
        let header = [("scene".to_owned(), "a hash".into())].into_iter().collect();
        Records::open(folder.path(), KEPT, (begin, Share::ALL), header, Rows::alone(COUNT))
    };
    let text = |row: usize| TEXTS[row % TEXTS.len()];
    let mut records = open(Begin::New).expect("a new file").expect("work to do");
    // The last row is missing.
    (0..COUNT - 1).for_each(|row| records.keep(row, text(row)).expect("a row that is kept"));
    drop(records);
    let path = folder.path().join(KEPT.files[0]);
    let mut kept = std::fs::read(&path).expect("a file");
    for edit in bytes.chunks_exact(4) {
        let place = usize::from(u16::from_le_bytes([edit[0], edit[1]])) % kept.len().max(1);
        match edit[2] % 4 {
            0 if !kept.is_empty() => kept[place] ^= edit[3],
            1 => kept.insert(place, edit[3]),
            2 => kept.truncate(place),
            // Lines in another order, or twice.
            _ => kept.extend_from_within(place..),
        }
    }
    std::fs::write(&path, kept).expect("a file");
    let Ok(Some(mut records)) = open(Begin::Resume) else { return };
    let missing: Vec<usize> = (0..COUNT).filter(|row| !records.has(*row)).collect();
    missing.iter().for_each(|row| records.keep(*row, text(*row)).expect("a row that is kept"));
    let mut next = 0;
    let done = records.in_order(|row, found, _| {
        assert_eq!((row, found), (next, text(next)));
        next += 1;
        Ok(())
    });
    done.expect("rows that can be read");
    assert_eq!(next, COUNT);
}
