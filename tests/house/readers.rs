//! Readers of files take any bytes: the functions of the fuzz targets, on changed files and on noise.

#![cfg(feature = "import")]

use super::fuzz;
use proptest::{prelude::*, sample::Index};

/// Scenes whose bytes are changed, and a gearbox.
const SCENES: [&str; 4] = [
    include_str!("../../examples/scenes/kahraman-singh.json"),
    include_str!("../../examples/scenes/spur-pair.json"),
    include_str!("../../examples/scenes/bouncing-ball.json"),
    include_str!("../../examples/scenes/reference-light.json"),
];
const GEARBOX: &str = include_str!("../../examples/gearboxes/helical-pair.rexs");

/// Bytes of a file with some replaced, put in or taken out.
fn changed(text: &str, edits: &[(Index, u8, u8)]) -> Vec<u8> {
    // What readers look at, more often than chance would have it.
    const TELLING: &[u8] = b"0123456789-+.eE\"{}[]<>/:,\\ \n\x00\x1b\xc3\xff";
    let mut bytes = text.as_bytes().to_vec();
    for (place, kind, byte) in edits {
        let place = place.index(bytes.len());
        let byte = if kind % 2 == 0 { TELLING[usize::from(*byte) % TELLING.len()] } else { *byte };
        match kind / 2 % 4 {
            0 | 1 => bytes[place] = byte,
            2 => bytes.insert(place, byte),
            _ => drop(bytes.remove(place)),
        }
    }
    bytes
}

fn edits() -> impl Strategy<Value = Vec<(Index, u8, u8)>> {
    prop::collection::vec(any::<(Index, u8, u8)>(), 1..5)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn scenes(text in prop::sample::select(SCENES.to_vec()), edits in edits()) {
        fuzz::scene(&changed(text, &edits));
    }

    #[test]
    fn gearboxes(edits in edits()) {
        fuzz::imported(&changed(GEARBOX, &edits));
    }

    #[test]
    fn noise(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
        fuzz::scene(&bytes);
        fuzz::imported(&bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn rows(bytes in prop::collection::vec(any::<u8>(), 4..24)) {
        fuzz::rows(&bytes);
    }
}
