//! Folders that commands write into: the manifest, what `--force` replaces, what it leaves alone.
#![cfg(feature = "cli")]

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    time::Duration,
};

use serde_json::{Value, json};
use tempfile::TempDir;

const MANIFEST: &str = "flank-manifest.json";

/// The pair of Kahraman and Singh, where teeth separate.
const PAIR: &str = r#"{ "flank": 1,
    "train": { "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true, "mean_load": 0.1,
        "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }] },
    "initial": { "q": [1.1] }, "run": { "cycles": 5 } }"#;
const STAGE: &str =
    r#"{ "flank": 1, "train": { "kind": "planetary", "preset": "lin-parker" }, "run": { "t_end_s": 1 } }"#;

/// Every command that writes a folder, with a scene and little to do.
fn commands() -> [(&'static str, &'static str, Vec<&'static str>); 8] {
    let vary = "/train/planet/translation/stiffness_n_per_m=1e7:1e9";
    [
        ("run", PAIR, vec!["--no-report"]),
        ("run", PAIR, vec!["--trajectory"]),
        ("study", PAIR, vec!["--only", "cycles", "forces", "--threads", "1"]),
        ("sweep", PAIR, vec!["--vary", "/train/mean_load=0.08,0.1"]),
        ("compare", PAIR, vec!["--methods", "rk4", "--cycles", "2", "--most-steps", "300", "--repetitions", "1"]),
        ("stability", PAIR, vec!["--factors", "1", "--steps", "101", "--methods", "rk4", "--cycles", "10"]),
        ("advise", PAIR, vec![]),
        ("identify", STAGE, vec!["--vary", vary, "--target", "translational:2=1200"]),
    ]
}

fn flank(folder: &TempDir, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flank")).current_dir(folder).args(words).output().unwrap()
}

/// Runs a command on `scene` into `out`.
fn make(folder: &TempDir, scene: &str, (command, _, more): &(&str, &str, Vec<&str>), force: bool) -> Output {
    let force = if force { &["--force"][..] } else { &[] };
    flank(folder, &[&[command, scene], &more[..], &["--quiet", "--out", "out"], force].concat())
}

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn with_scene(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.json"), scene).unwrap();
    folder
}

/// Writes a file below `folder/out`.
fn put(folder: &TempDir, name: &str, text: impl AsRef<[u8]>) {
    let path = folder.path().join("out").join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

/// All files below a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for path in fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(own, bytes)| (format!("{name}/{own}"), bytes)));
        } else {
            found.insert(name, fs::read(&path).unwrap());
        }
    }
    found
}

fn manifest(folder: &TempDir) -> Value {
    serde_json::from_slice(&fs::read(folder.path().join("out").join(MANIFEST)).unwrap()).unwrap()
}

fn listed(folder: &TempDir) -> Vec<String> {
    manifest(folder)["files"].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
}

fn tamper(folder: &TempDir, files: &[&str]) {
    put(folder, MANIFEST, json!({ "flank": "0.1.0", "command": "run", "files": files }).to_string());
}

#[test]
fn every_command_names_its_files_and_replaces_no_others() {
    for case in commands() {
        let folder = with_scene(case.1);
        let out = folder.path().join("out");
        assert_eq!(make(&folder, "scene.json", &case, false).status.code(), Some(0), "{case:?}");
        let (first, names) = (files(&out), listed(&folder));
        assert_eq!(manifest(&folder)["command"], case.0);
        assert_eq!(manifest(&folder)["flank"], env!("CARGO_PKG_VERSION"));
        let written = first.keys().filter(|name| *name != MANIFEST);
        assert!(written.clone().count() > 1 && written.clone().all(|name| names.contains(name)), "{case:?}: {names:?}");
        // The journal of a sweep goes when it ends.
        assert!(names.iter().all(|name| first.contains_key(name) || name == "sweep.journal"), "{case:?}: {names:?}");

        // The scene and notes lie in the folder: they stay, and so does what comes out.
        put(&folder, "my.json", case.1);
        put(&folder, "figures/notes.txt", "mine");
        assert_eq!(make(&folder, "out/my.json", &case, false).status.code(), Some(2), "{case:?}");
        let done = make(&folder, "out/my.json", &case, true);
        assert_eq!(done.status.code(), Some(0), "{case:?}: {}", said(&done));
        let mut second = files(&out);
        assert_eq!(second.remove("my.json").unwrap(), case.1.as_bytes());
        assert_eq!(second.remove("figures/notes.txt").unwrap(), b"mine");
        assert_eq!(second.keys().collect::<Vec<_>>(), first.keys().collect::<Vec<_>>(), "{case:?}");
        assert_eq!(second[MANIFEST], first[MANIFEST], "{case:?}");

        // Each of the files, where the user has put it: refused at once.
        for name in names {
            for name in [name.clone(), format!("{name}.part")] {
                let folder = with_scene(case.1);
                put(&folder, &name, "mine");
                let refused = make(&folder, "scene.json", &case, true);
                assert_eq!(refused.status.code(), Some(2), "{case:?} {name}");
                let said = said(&refused).replace(['\n', '│', ' '], "");
                assert!(said.contains(name.rsplit('/').next().unwrap()), "{case:?} {name}: {said}");
                assert!(said.contains("moveit"), "{case:?} {name}: {said}");
                let left = files(&folder.path().join("out"));
                assert_eq!(left, BTreeMap::from([(name.clone(), b"mine".to_vec())]), "{case:?}");
            }
        }
    }
}

/// What one command wrote another one replaces.
#[test]
fn a_folder_changes_hands() {
    let folder = with_scene(PAIR);
    let commands = commands();
    put(&folder, "notes.txt", "mine");
    for case in commands.iter().filter(|case| case.1 == PAIR) {
        assert_eq!(make(&folder, "scene.json", case, true).status.code(), Some(0), "{case:?}");
        let names = listed(&folder);
        let left = files(&folder.path().join("out"));
        assert!(left.keys().all(|name| names.contains(name) || [MANIFEST, "notes.txt"].contains(&name.as_str())));
        // A sweep resumed there would begin among the files of another command.
        if case.0 != "sweep" {
            let vary = ["--vary", "/train/mean_load=0.1", "--out", "out", "--resume"];
            let refused = flank(&folder, &[&["sweep", "scene.json"], &vary[..]].concat());
            assert_eq!(refused.status.code(), Some(2), "{case:?}");
            assert_eq!(files(&folder.path().join("out")), left);
        }
    }
}

/// A scene that a manifest names, directly or behind a link, is read and not replaced.
#[test]
fn the_scene_that_is_read_is_never_replaced() {
    for case in commands() {
        let folder = with_scene(case.1);
        for (name, scene) in [("scene.json", "out/scene.json"), ("sweep.json", "out/sweep.json")] {
            put(&folder, name, case.1);
            tamper(&folder, &["events.jsonl", name]);
            put(&folder, "events.jsonl", "old");
            let before = files(&folder.path().join("out"));
            let refused = make(&folder, scene, &case, true);
            assert_eq!(refused.status.code(), Some(2), "{case:?}");
            assert!(said(&refused).contains("is read by this command"), "{}", said(&refused));
            assert_eq!(files(&folder.path().join("out")), before, "{case:?}");
        }
    }
    #[cfg(unix)]
    {
        let folder = with_scene(PAIR);
        put(&folder, "events.jsonl", PAIR);
        tamper(&folder, &["events.jsonl"]);
        std::os::unix::fs::symlink("out/events.jsonl", folder.path().join("link.json")).unwrap();
        assert_eq!(make(&folder, "link.json", &commands()[0], true).status.code(), Some(2));
        assert_eq!(files(&folder.path().join("out"))["events.jsonl"], PAIR.as_bytes());
    }
}

#[test]
fn a_manifest_points_at_nothing_outside_its_folder() {
    for case in commands() {
        let folder = with_scene(case.1);
        let victim = folder.path().join("victim");
        fs::write(&victim, "mine").unwrap();
        let absolute = victim.to_str().unwrap();
        for name in ["../victim", absolute, "figures/../../victim", "", ".", "./victim", "figures"] {
            put(&folder, "figures/a.svg", "old");
            put(&folder, "events.jsonl", "old");
            tamper(&folder, &["events.jsonl", "figures/a.svg", name]);
            let before = files(folder.path());
            let refused = make(&folder, "scene.json", &case, true);
            assert_eq!(refused.status.code(), Some(2), "{case:?} {name:?}");
            assert_eq!(files(folder.path()), before, "{case:?} {name:?}");
        }
        for text in ["", "mine", "{}", "[1]", r#"{ "flank": "0.1.0", "command": "run" }"#] {
            put(&folder, MANIFEST, text);
            let before = files(folder.path());
            let refused = make(&folder, "scene.json", &case, true);
            assert_eq!(refused.status.code(), Some(2), "{case:?} {text:?}");
            assert_eq!(files(folder.path()), before, "{case:?} {text:?}");
        }
    }
}

/// Links that replace a file, a folder, the manifest or a half-written file lead nowhere.
#[cfg(unix)]
#[test]
fn links_are_not_followed() {
    use std::os::unix::fs::symlink;
    for case in commands() {
        for (name, listed) in [
            ("figures", "figures/victim"),
            ("events.jsonl", "events.jsonl"),
            ("sweep.journal", "sweep.journal"),
            ("sweep.csv.part", "sweep.csv"),
            ("flank-manifest.json", ""),
            ("flank-manifest.json.part", ""),
        ] {
            let folder = with_scene(case.1);
            let own = folder.path().join("own");
            fs::create_dir(&own).unwrap();
            fs::write(own.join("victim"), "mine").unwrap();
            put(&folder, "old.txt", "mine");
            if listed.is_empty() {
                fs::write(own.join("victim"), r#"{ "flank": "0", "command": "run", "files": ["old.txt"] }"#).unwrap();
            } else {
                tamper(&folder, &["old.txt", listed]);
            }
            let target = if name == "figures" { own.clone() } else { own.join("victim") };
            symlink(target, folder.path().join("out").join(name)).unwrap();
            let before = files(folder.path());
            let refused = make(&folder, "scene.json", &case, true);
            assert_eq!(refused.status.code(), Some(2), "{case:?} {name}");
            assert_eq!(files(folder.path()), before, "{case:?} {name}");
        }
    }
}

/// What a killed run has written the next one replaces.
#[test]
fn a_killed_run_leaves_its_manifest() {
    let folder = with_scene(&PAIR.replace(r#""cycles": 5"#, r#""cycles": 1000000000"#));
    let program = env!("CARGO_BIN_EXE_flank");
    let words = ["run", "scene.json", "--out", "out", "-q", "--trajectory"];
    let mut child = Command::new(program).current_dir(&folder).args(words).stdout(Stdio::null()).spawn().unwrap();
    while fs::metadata(folder.path().join("out/events.jsonl")).map_or(0, |data| data.len()) < 10_000 {
        assert_eq!(child.try_wait().unwrap(), None, "the run ended by itself");
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(listed(&folder), ["events.jsonl", "events.csv", "trajectory.csv"]);
    // As if it had been killed while it wrote its measures.
    tamper(&folder, &["events.jsonl", "events.csv", "trajectory.csv", "summary.json"]);
    put(&folder, "summary.json.part", "{ \"fla");
    put(&folder, "flank-manifest.json.part", "{ \"fla");
    fs::write(folder.path().join("scene.json"), PAIR).unwrap();
    assert_eq!(make(&folder, "scene.json", &commands()[0], true).status.code(), Some(0));
    let left: Vec<String> = files(&folder.path().join("out")).into_keys().collect();
    assert_eq!(left, ["events.csv", "events.jsonl", MANIFEST, "summary.json"]);
}

/// A file of the user's with the name of a journal is neither cut nor replaced.
#[test]
fn a_journal_of_the_users_is_left_alone() {
    for text in ["mine", "mine\n", "{\"axes\":[]}\n", "fla"] {
        for begin in [&[][..], &["--force"], &["--resume"]] {
            let folder = with_scene(PAIR);
            put(&folder, "sweep.journal", text);
            let vary = ["--vary", "/train/mean_load=0.1", "--out", "out"];
            let done = flank(&folder, &[&["sweep", "scene.json"], &vary[..], begin].concat());
            let torn = text == "fla" && begin == ["--resume"];
            assert_eq!(done.status.code(), Some(if torn { 0 } else { 2 }), "{text:?} {begin:?}: {}", said(&done));
            if !torn {
                let left = files(&folder.path().join("out"));
                assert_eq!(left, BTreeMap::from([("sweep.journal".to_owned(), text.into())]), "{text:?} {begin:?}");
            }
        }
    }
}
