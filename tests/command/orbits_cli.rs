//! `flank orbit` and `flank lyapunov` as commands: files, exit codes, messages.

use std::{
    fs,
    path::Path,
    process::Stdio,
    thread::sleep,
    time::{Duration, Instant},
};

use assert_cmd::{Command, assert::Assert};

use serde_json::Value;
use tempfile::TempDir;

fn flank(words: &[&str], out: &Path) -> Assert {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    Command::cargo_bin("flank").unwrap().current_dir(root).args(words).arg("--out").arg(out).assert()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

const PAIR: &str = "examples/scenes/kahraman-singh.json";

#[test]
fn an_orbit_is_a_file_a_picture_and_a_scene_that_starts_on_it() {
    let folder = TempDir::new().unwrap();
    // The folder is created, and its parents.
    let out = folder.path().join("a/b");
    flank(&["orbit", PAIR], &out).code(0);
    let found = json(&out.join("orbit.json"));
    let orbit = &found["orbits"][0];
    assert_eq!(
        (&orbit["period_cycles"], &orbit["word"], &orbit["stable"]),
        (&1.into(), &"c0+ s0+".into(), &true.into())
    );
    assert_eq!(orbit["x"].as_array().unwrap().len(), found["components"].as_array().unwrap().len());
    for ending in ["csv", "json", "svg", "png"] {
        assert!(out.join(format!("figures/orbit.{ending}")).is_file());
    }
    // From its block the motion comes back.
    let mut scene = json(&Path::new(env!("CARGO_MANIFEST_DIR")).join(PAIR));
    (scene["initial"], scene["run"]) = (orbit["initial"].clone(), serde_json::json!({ "cycles": 1 }));
    let there = folder.path().join("scene.json");
    fs::write(&there, scene.to_string()).unwrap();
    let again = folder.path().join("again");
    flank(&["orbit", there.to_str().unwrap()], &again).code(0);
    assert_eq!(json(&again.join("orbit.json"))["orbits"][0]["x"], orbit["x"]);
    // A folder in use is refused, unless it is to be replaced.
    flank(&["orbit", PAIR], &out).code(2);
    flank(&["orbit", PAIR, "--force", "-q"], &out).code(0).stdout("");
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let run = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        flank(&["orbit", PAIR, "--starts", "6", "--threads", threads], &out).code(0);
        fs::read(out.join("orbit.json")).unwrap()
    };
    assert_eq!(run("one", "1"), run("two", "2"));
}

#[test]
fn a_scene_without_a_period_is_refused_and_nothing_is_written() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    for command in ["orbit", "lyapunov"] {
        let done = flank(&[command, "examples/scenes/ball-on-wall.json"], &out).code(2);
        let said = String::from_utf8_lossy(&done.get_output().stderr).into_owned();
        assert!(said.contains("period"), "{said}");
        assert!(!out.exists());
    }
}

/// A file is no folder; a negative number is told its range; neither begins any work.
#[test]
fn what_cannot_be_asked_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    let said = |words: &[&str], out: &Path| {
        String::from_utf8_lossy(&flank(words, out).code(2).get_output().stderr).into_owned()
    };
    assert!(said(&["orbit", PAIR], &file).contains("is a file, not a folder"));
    assert!(said(&["orbit", PAIR], &file.join("below/it")).contains("file is a file, not a folder"));
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
    let out = folder.path().join("out");
    let negative = said(&["lyapunov", PAIR, "--cycles", "-3"], &out);
    assert!(negative.contains("invalid value '-3' for '--cycles <N>'"), "{negative}");
    assert!(!out.exists());
}

#[test]
fn an_orbit_that_is_not_there_ends_with_the_reason_and_a_file() {
    let folder = TempDir::new().unwrap();
    let scene = folder.path().join("scene.json");
    // Two free bodies with a net load.
    let text = r#"{
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1, 0], [0, 1]], "damping_n_s_per_m": [[0.1, -0.1], [-0.1, 0.1]], "load_n": [0.3, -0.1],
            "load_harmonics": [{ "vector_n": [0.1, 0], "frequency_rad_per_s": 1.0, "phase_rad": 0 }],
            "contacts": [{ "direction": [1, -1], "half_backlash_m": 1, "stiffness": 1, "law": { "kind": "kelvin-voigt" } }]
        },
        "run": { "cycles": 20 }
    }"#;
    fs::write(&scene, text).unwrap();
    let out = folder.path().join("out");
    flank(&["orbit", scene.to_str().unwrap()], &out).code(1);
    let found = json(&out.join("orbit.json"));
    assert_eq!(found["orbits"].as_array().unwrap().len(), 0);
    assert!(found["reason"].as_str().unwrap().contains("accelerates"), "{found}");
    // What has been finished ends again as it did.
    flank(&["orbit", scene.to_str().unwrap(), "--resume"], &out).code(1);
}

#[test]
fn exponents_are_a_file_and_a_picture() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    flank(
        &["lyapunov", "examples/scenes/W1a-ch.json", "--cycles", "400", "--without-saltation", "--finite", "5"],
        &out,
    )
    .code(0);
    let found = json(&out.join("lyapunov.json"));
    assert_eq!(found["cycles"], 400);
    assert_eq!(found["exponents"].as_array().unwrap().len(), 2);
    assert_eq!(found["band"].as_array().unwrap().len(), 2);
    let [sum, rule] = ["sum", "sum_rule"].map(|key| found[key].as_f64().unwrap());
    assert!((sum - rule).abs() <= 1e-9 * rule.abs());
    assert!(found["finite"]["cycles"] == 5 && found["without_saltation"]["exponents"].is_array());
    assert!(out.join("figures/exponents.svg").is_file());
}

/// What is finished says so; what was asked otherwise is refused; with nothing to go on from, the whole is done.
#[test]
fn orbits_and_exponents_resume() {
    let folder = TempDir::new().unwrap();
    for (words, other) in [
        (vec!["orbit", PAIR, "--starts", "2"], ["--starts", "3"]),
        (vec!["lyapunov", "examples/scenes/W1a-ch.json", "--cycles", "50"], ["--cycles", "60"]),
    ] {
        let out = folder.path().join(words[0]);
        let with = |more: &[&'static str]| [&words[..], more].concat();
        flank(&with(&["--resume", "--threads", "1"]), &out).code(0);
        let file = out.join(format!("{}.json", words[0]));
        let before = fs::read(&file).unwrap();
        flank(&with(&["--resume"]), &out).code(0);
        let said = |assert: Assert| {
            let output = assert.get_output();
            String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
        };
        assert!(said(flank(&with(&["--resume"]), &out).code(0)).contains("holds the whole of it"));
        assert_eq!(fs::read(&file).unwrap(), before);
        let changed = [&words[..2], &other[..], &["--resume"][..]].concat();
        flank(&changed, &out).code(2);
        assert!(said(flank(&changed, &out)).contains(other[0].trim_start_matches('-')));
        flank(&with(&["--resume", "--force"]), &out).code(2);
    }
}

/// An interrupt keeps the blocks of starts that are done; with --resume the bytes are those of a search that was not broken off.
#[test]
fn an_interrupted_search_goes_on() {
    let folder = TempDir::new().unwrap();
    let (broken, whole) = (folder.path().join("broken"), folder.path().join("whole"));
    let words = ["orbit", "examples/scenes/W1a-ch.json", "--period", "3", "--starts", "1024", "--threads", "1"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_flank"))
        .current_dir(root)
        .args(words)
        .arg("--out")
        .arg(&broken)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    let is_kept = || fs::read_to_string(broken.join("orbit.state")).is_ok_and(|state| state.contains(r#""starts":64"#));
    while !is_kept() && child.try_wait().unwrap().is_none() && began.elapsed() < Duration::from_secs(60) {
        sleep(Duration::from_millis(2));
    }
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let done = child.wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(75));
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(said.contains("the same command with --resume goes on"), "{said}");
    assert_eq!(json(&broken.join("orbit.json"))["reason"], "interrupted");
    flank(&[&words[..], &["--resume"]].concat(), &broken).code(0);
    flank(&words, &whole).code(0);
    assert_eq!(fs::read(broken.join("orbit.json")).unwrap(), fs::read(whole.join("orbit.json")).unwrap());
}

/// Three files; a point of a branch starts a scene; what cannot be followed ends with code 2.
#[test]
fn a_branch_is_two_tables_and_a_picture() {
    const FREQUENCY: &str = "/train/transmission_error/0/frequency";
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("branches");
    let axis = format!("{FREQUENCY}=0.55:0.75");
    flank(&["continue", PAIR, "--vary", &axis, "--doublings", "0"], &out).code(0);
    let table = fs::read_to_string(out.join("branches.csv")).unwrap();
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    assert_eq!(head[..6], ["branch", "parameter", "period_cycles", "word", "stable", "multiplier"]);
    assert!(head.contains(&"mesh apart_fraction"));
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert!(rows.len() > 20 && rows.iter().all(|row| row.len() == head.len()));
    assert_eq!((rows[0][1], rows[rows.len() - 1][1]), ("0.55", "0.75"));
    let special = fs::read_to_string(out.join("special.csv")).unwrap();
    assert!(special.starts_with("kind,parameter,period_cycles,word,residual,multiplier_re,multiplier_im"));
    assert!(fs::read_to_string(out.join("figures/branches.svg")).unwrap().starts_with("<svg"));
    // The same bytes for any number of threads.
    let again = folder.path().join("again");
    flank(&["continue", PAIR, "--vary", &axis, "--doublings", "0", "--threads", "2"], &again).code(0);
    assert_eq!(fs::read(again.join("branches.csv")).unwrap(), fs::read(out.join("branches.csv")).unwrap());
    // A point is a start.
    let mut scene = json(&Path::new(env!("CARGO_MANIFEST_DIR")).join(PAIR));
    let last = &rows[rows.len() - 1];
    let number = |cell: &str| cell.parse::<f64>().unwrap();
    *scene.pointer_mut(FREQUENCY).unwrap() = number(last[1]).into();
    scene["initial"] = serde_json::json!({ "q": [number(last[6])], "v": [number(last[7])] });
    let there = folder.path().join("scene.json");
    fs::write(&there, scene.to_string()).unwrap();
    let orbit = folder.path().join("orbit");
    flank(&["orbit", there.to_str().unwrap()], &orbit).code(0);
    let found = &json(&orbit.join("orbit.json"))["orbits"][0];
    assert!((found["x"][0].as_f64().unwrap() - number(last[6])).abs() <= 1e-10);
    for (axis, reason) in [
        (format!("{FREQUENCY}=1.2:1.3"), "own value"),
        (FREQUENCY.to_owned(), "no equals sign"),
        ("/train/none=0:1".to_owned(), "no number"),
        (format!("{FREQUENCY}=1:1"), "without length"),
    ] {
        let refused = flank(&["continue", PAIR, "--vary", &axis], &folder.path().join("none")).code(2);
        let text = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
        assert!(text.contains(reason), "{text}");
        assert!(!folder.path().join("none").exists());
    }
}

/// Curves are a table and a picture; a command that was broken off goes on where it was, and another one does not.
#[test]
fn curves_are_a_table_and_a_picture_and_work_goes_on() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("curves");
    let axes = ["--vary", "/train/transmission_error/0/frequency=0.6:0.9", "--doublings", "0"];
    let second = ["--follow", "period-doubling", "--second", "/train/mean_load=0.05:0.2"];
    let words: Vec<&str> = ["continue", PAIR].into_iter().chain(axes).chain(second).collect();
    flank(&words, &out).code(0);
    let table = fs::read_to_string(out.join("curves.csv")).unwrap();
    assert!(table.starts_with("curve,kind,parameter,second,period_cycles,word,codimension_two"));
    assert!(table.lines().count() > 10 && table.lines().skip(1).all(|line| line.contains(",period-doubling,")));
    assert!(fs::read_to_string(out.join("figures/curves.svg")).unwrap().starts_with("<svg"));
    // What an interrupt at the beginning leaves: neither work nor an end.
    let files =
        ["branches.csv", "special.csv", "figures/branches.svg", "curves.csv", "figures/curves.svg", "continue.json"];
    let whole: Vec<Vec<u8>> = files.iter().map(|name| fs::read(out.join(name)).unwrap()).collect();
    let mut state = json(&out.join("continue.json"));
    assert_eq!(state["content"]["finished"], "Completely");
    state["content"]["finished"] = Value::Null;
    let content = state["content"].to_string();
    let sum = crc32fast::hash(content.as_bytes());
    let kept = format!("{{\"crc32\":\"{sum:08x}\",\"content\":{content}}}\n");
    // A state that is damaged is refused, and nothing is changed.
    fs::write(out.join("continue.json"), kept.replacen("null", "true", 1)).unwrap();
    let words_again: Vec<&str> = words.iter().copied().chain(["--resume"]).collect();
    let refused = flank(&words_again, &out).code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("checksum"));
    fs::write(out.join("continue.json"), kept).unwrap();
    fs::write(out.join("curves.csv.part"), "half a li").unwrap();
    let resumed: Vec<&str> = words.iter().copied().chain(["--resume"]).collect();
    flank(&resumed, &out).code(0);
    for (name, bytes) in files.iter().zip(&whole) {
        assert_eq!(&fs::read(out.join(name)).unwrap(), bytes, "{name}");
    }
    let again = flank(&resumed, &out).code(0);
    assert!(String::from_utf8_lossy(&again.get_output().stdout).contains("whole"));
    let other: Vec<&str> = resumed.iter().map(|word| if *word == "0" { "1" } else { word }).collect();
    let refused = flank(&other, &out).code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("doublings"));
    // Another command's files stay.
    let others = folder.path().join("orbit");
    flank(&["orbit", PAIR], &others).code(0);
    flank(&resumed, &others).code(2);
    assert!(others.join("orbit.json").is_file());
    for (second, reason) in [
        ("/train/transmission_error/0/frequency=0.6:0.9", "one of the first numbers"),
        ("/train/mean_load=0.2:0.3", "own value"),
    ] {
        let words = ["continue", PAIR, axes[0], axes[1], "--follow", "fold", "--second", second];
        let refused = flank(&words, &folder.path().join("none")).code(2);
        assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains(reason), "{reason}");
    }
}
