//! `flank map`, `flank basins` and `flank diagram` on the command line.

use std::{fs, path::Path};

use assert_cmd::Command;
use serde_json::Value;

const PAIR: &str = "examples/scenes/kahraman-singh.json";
const FREQUENCY: &str = "/train/transmission_error/0/frequency";

fn flank(arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("flank").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments);
    command
}

/// Runs it and gives the exit code, what was printed and the errors.
fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = flank(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

/// What each command is asked, its table, and the file of its rows while it works.
fn asked() -> [(Vec<String>, &'static str, &'static str); 3] {
    let words = |text: &str| text.split(' ').map(String::from).collect::<Vec<_>>();
    [
        (
            words(&format!("map {PAIR} --vary {FREQUENCY}=0.5:1.9:9 --vary /train/mean_load=0.03:0.25:8")),
            "map.csv",
            "map.rows",
        ),
        (
            words(&format!("basins {PAIR} --vary /initial/q/0=-2:2:12 --vary /initial/v/0=-1:1:10")),
            "basins.csv",
            "basins.rows",
        ),
        (
            words(&format!(
                "diagram {PAIR} --vary {FREQUENCY}=0.7:0.9:12 --seed both --starts 2 --transient 60 --points 20"
            )),
            "diagram.csv",
            "diagram.journal",
        ),
    ]
}

#[test]
fn the_bytes_do_not_depend_on_threads_or_interruptions() {
    let place = tempfile::tempdir().unwrap();
    for (words, table, rows) in asked() {
        let [one, two, broken] = ["one", "two", "broken"].map(|name| place.path().join(format!("{}-{name}", words[0])));
        let with = |folder: &Path, more: &[&str]| {
            let folder = folder.to_str().unwrap().to_owned();
            let mut all: Vec<&str> = words.iter().map(String::as_str).collect();
            all.extend(["--out", &folder]);
            all.extend(more);
            run(&all)
        };
        for (folder, threads) in [(&one, "1"), (&two, "2")] {
            let (code, _, error) = with(folder, &["--threads", threads]);
            assert_eq!(code, 0, "{error}");
        }
        let manifest: Value = serde_json::from_str(&read(&one, "flank-manifest.json")).unwrap();
        let all = manifest["files"].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned());
        let names: Vec<String> = all.filter(|name| name != rows).collect();
        assert!(names.len() >= 4, "{names:?}");
        for name in &names {
            assert_eq!(fs::read(one.join(name)).unwrap(), fs::read(two.join(name)).unwrap(), "{name}");
        }
        // As if it had been killed: some rows, and half a line.
        fs::create_dir(&broken).unwrap();
        fs::copy(one.join("flank-manifest.json"), broken.join("flank-manifest.json")).unwrap();
        let (mut header, text) =
            (serde_json::from_str::<Value>(&read(&one, &format!("{}.json", words[0]))).unwrap(), read(&one, table));
        ["crc32", "found", "sha256"].iter().for_each(|key| drop(header.as_object_mut().unwrap().remove(*key)));
        let kept: Vec<&str> =
            if rows == "diagram.journal" { Vec::new() } else { text.lines().skip(1).take(13).collect() };
        let header = header.to_string();
        let record = |(row, text): (usize, &&str)| {
            let bytes = [header.as_bytes(), &(row as u64).to_le_bytes(), text.as_bytes()].concat();
            format!("{row} {:08x} {text}\n", crc32fast::hash(&bytes))
        };
        let records: String = kept.iter().enumerate().map(record).collect();
        let head = format!("flank-rows 1 {:08x} {header}\n", crc32fast::hash(header.as_bytes()));
        fs::write(broken.join(rows), format!("{head}{records}13 0a")).unwrap();
        // Without --resume it is not touched; with other arguments it is refused.
        assert_eq!(with(&broken, &[]).0, 2);
        let other = if words[0] == "diagram" { ["--branches", "none"] } else { ["--further", "300"] };
        let (code, _, error) = with(&broken, &["--resume", other[0], other[1]]);
        assert!(code == 2 && (error.contains("holds other work") || words[0] == "diagram"), "{error}");
        if !kept.is_empty() {
            // A row that is changed is told, and computed again.
            let good = read(&broken, rows);
            fs::write(broken.join(rows), good.replacen(kept[4], "0.1,0.2,3", 1)).unwrap();
        }
        let (code, _, error) = with(&broken, &["--resume"]);
        assert!(code == 0 && (kept.is_empty() || error.contains("1 damaged record")), "{error}");
        for name in &names {
            assert_eq!(fs::read(one.join(name)).unwrap(), fs::read(broken.join(name)).unwrap(), "{name}");
        }
        let (code, text, _) = with(&broken, &["--resume"]);
        assert!(code == 0 && text.contains("holds all of it"), "{text}");
    }
}

#[test]
fn tables_have_the_columns_that_are_documented() {
    let place = tempfile::tempdir().unwrap();
    for (words, table, _) in asked() {
        let folder = place.path().join(&words[0]);
        let mut all: Vec<&str> = words.iter().map(String::as_str).collect();
        all.extend(["--out", folder.to_str().unwrap(), "--quiet"]);
        assert_eq!(run(&all), (0, String::new(), String::new()));
        let head = read(&folder, table).lines().next().unwrap().to_owned();
        let expected = match table {
            "map.csv" => {
                format!(
                    "{FREQUENCY},/train/mean_load,kind,period_cycles,word,exponent,mesh apart_fraction,impacts,cycles,error"
                )
            }
            "basins.csv" => "/initial/q/0,/initial/v/0,attractor,cycles,error".to_owned(),
            _ => "parameter,direction,start,cycle,q x,v x".to_owned(),
        };
        assert_eq!(head, expected);
    }
    let (map, basins, diagram) = (place.path().join("map"), place.path().join("basins"), place.path().join("diagram"));
    assert_eq!(read(&map, "map.csv").lines().count(), 1 + 9 * 8);
    let attractors: Value = serde_json::from_str(&read(&basins, "attractors.json")).unwrap();
    let shares: f64 =
        attractors["attractors"].as_array().unwrap().iter().map(|a| a["fraction"].as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-12, "{shares}");
    // Two starts, two directions, twelve values, twenty cycles.
    assert_eq!(read(&diagram, "diagram.csv").lines().count(), 1 + 2 * 2 * 12 * 20);
    assert_eq!(read(&diagram, "exponents.csv").lines().count(), 1 + 2 * 2 * 12);
    assert!(read(&map, "figures/map.svg").contains("data:image/png;base64,"));
}

#[test]
fn measures_of_contacts_are_those_of_a_sweep() {
    let place = tempfile::tempdir().unwrap();
    let [map, sweep] = ["map", "sweep"].map(|name| place.path().join(name));
    let axes = ["--vary", "/train/mean_load=0.1,0.2", "--vary", &format!("{FREQUENCY}=0.6,0.75")];
    let columns = ["--columns", "apart_fraction,force_max"];
    let all = [&["map", PAIR][..], &axes, &columns, &["--out", map.to_str().unwrap()]].concat();
    assert_eq!(run(&all).0, 0);
    assert_eq!(run(&[&["sweep", PAIR][..], &axes, &["--out", sweep.to_str().unwrap()]].concat()).0, 0);
    let [map, sweep] = [(map, "map.csv"), (sweep, "sweep.csv")].map(|(folder, name)| read(&folder, name));
    let column = |table: &str, name: &str| -> Vec<f64> {
        let place = table.lines().next().unwrap().split(',').position(|other| other == name).unwrap();
        table.lines().skip(1).map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
    };
    for name in ["mesh apart_fraction", "mesh force_max"] {
        for (a, b) in column(&map, name).into_iter().zip(column(&sweep, name)) {
            // Both are measured on an orbit that closes to 1e-10.
            assert!((a - b).abs() <= 1e-8 * b.abs(), "{name}: {a} {b}");
        }
    }
}

#[test]
fn bad_input_is_told_with_its_place() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let out = out.to_str().unwrap();
    let load = "/train/mean_load=0.02:0.3:5";
    let frequency = format!("{FREQUENCY}=0.4:2:5");
    let cases: &[(&[&str], &str)] = &[
        (&["map", PAIR, "--vary", load], "two of them"),
        (
            &["map", PAIR, "--vary", load, "--vary", &frequency, "--vary", "/train/damping_ratio=0.1:0.2:3"],
            "one or two",
        ),
        (&["map", PAIR, "--vary", load, "--vary", &format!("{FREQUENCY}=0.4")], "an axis of one value"),
        (&["map", PAIR, "--vary", load, "--vary", "/run/cycles=100:200:3"], "a whole number"),
        (&["map", PAIR, "--vary", load, "--vary", "/train/none=0:1:3"], "there is no number"),
        (&["map", PAIR, "--vary", load, "--vary", "/train/damping_ratio=-1:0.1:3"], "/train/damping_ratio"),
        (&["map", PAIR, "--vary", load, "--vary", &frequency, "--columns", "force_top"], "apart_fraction"),
        (
            &[
                "map",
                "examples/scenes/ball-on-wall.json",
                "--vary",
                "/train/load_n=-9:-8:3",
                "--vary",
                "/train/mass_kg=1:2:3",
            ],
            "period",
        ),
        (&["basins", PAIR, "--vary", load, "--vary", "/initial/v/0=-1:1:3"], "no coordinate or velocity"),
        (&["basins", PAIR, "--vary", "/initial/q/1=-1:1:3", "--vary", "/initial/v/0=-1:1:3"], "does not have"),
        (&["basins", PAIR, "--vary", "/initial/q/0=-1:1:3", "--vary", "/initial/q/x=-1:1:3"], "varied by two axes"),
        (&["diagram", PAIR, "--vary", load, "--vary", &frequency], "one, with --vary"),
        (&["diagram", PAIR, "--vary", "/train/mean_load=0.1"], "an axis of one value"),
        (&["diagram", PAIR, "--vary", load, "--branches", "no-such-folder"], "no-such-folder"),
    ];
    for (arguments, expected) in cases {
        let (code, _, error) = run(&[arguments, &["--out", out][..]].concat());
        let error = error.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
        assert!(code == 2 && error.contains(expected), "{arguments:?}: {code}\n{error}");
        assert!(!Path::new(out).exists(), "{arguments:?}");
    }
}

#[test]
fn cells_that_fail_are_rows_that_say_why() {
    let place = tempfile::tempdir().unwrap();
    let scene = place.path().join("wall.json");
    fs::write(
        &scene,
        r#"{ "flank": 1,
             "train": { "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1, "damping_n_s_per_m": 0.1,
                        "load_harmonics": [{ "amplitude_n": 1, "frequency_rad_per_s": 2.4 }],
                        "wall": { "side": "above", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 } },
             "initial": "rest", "run": { "cycles": 10 } }"#,
    )
    .unwrap();
    let out = place.path().join("out");
    // Starts above the wall are inside it.
    let axes = ["--vary", "/initial/q/x=-0.5:0.5:5", "--vary", "/initial/v/x=-1:1:4"];
    let all = [&["basins", scene.to_str().unwrap()][..], &axes, &["--out", out.to_str().unwrap()]].concat();
    let (code, _, error) = run(&all);
    assert_eq!(code, 3, "{error}");
    let table = read(&out, "basins.csv");
    let failed: Vec<&str> = table.lines().filter(|line| line.contains(",failed,")).collect();
    assert_eq!(failed.len(), 8);
    assert!(failed.iter().all(|line| line.contains("inside its rigid flank")), "{failed:?}");
    assert_eq!(table.lines().count(), 21);
    // A wall that is moved over the start: two of its five places, at two values of damping.
    let map = place.path().join("map");
    let axes = ["--vary", "/train/wall/position_m=-0.5:0.5:5", "--vary", "/train/damping_n_s_per_m=0.05:0.1:2"];
    let start = fs::read_to_string(&scene).unwrap().replace(r#""rest""#, r#"{ "q": [-0.1] }"#);
    fs::write(&scene, start).unwrap();
    let (code, text, error) =
        run(&[&["map", scene.to_str().unwrap()][..], &axes, &["--out", map.to_str().unwrap()]].concat());
    assert!(code == 3 && text.contains("failed: 4 (40.00 %)"), "{text}{error}");
    let table = read(&map, "map.csv");
    let failed: Vec<&str> = table.lines().filter(|line| line.contains(",failed,")).collect();
    assert!(failed.len() == 4 && failed.iter().all(|line| line.contains("inside the rigid flank")), "{failed:?}");
    assert_eq!(table.lines().count(), 11);
}

/// Two bodies with a net load and no drag against the frame accelerate for ever. Where the orbit of one relative to the other is not found, there is no
/// share of time and no exponent, and nothing that is not a number.
#[test]
fn cells_of_a_train_that_accelerates_for_ever_are_transient() {
    let place = tempfile::tempdir().unwrap();
    let scene = place.path().join("free.json");
    fs::write(
        &scene,
        r#"{ "flank": 1,
             "train": { "kind": "matrices", "mass_kg": [[1, 0], [0, 1]], "damping_n_s_per_m": [[0.1, -0.1], [-0.1, 0.1]],
                        "load_n": [0.3, -0.1], "load_harmonics": [{ "vector_n": [0.1, 0], "frequency_rad_per_s": 1, "phase_rad": 0 }],
                        "contacts": [{ "direction": [1, -1], "half_backlash_m": 1, "stiffness": 1, "law": { "kind": "kelvin-voigt" } }] },
             "initial": "rest", "run": { "cycles": 20 } }"#,
    )
    .unwrap();
    let out = place.path().join("out");
    let axes = ["--vary", "/train/load_n/0=0.3:0.4:2", "--vary", "/train/contacts/0/stiffness=1:2:2"];
    let (code, _, error) =
        run(&[&["map", scene.to_str().unwrap(), "--transient", "1"][..], &axes, &["--out", out.to_str().unwrap()]]
            .concat());
    assert_eq!(code, 0, "{error}");
    let table = read(&out, "map.csv");
    for row in table.lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        // Kind, period, word, exponent, time separated, impacts.
        assert_eq!(fields[2..8], ["transient", "", "", "", "", ""], "{row}");
    }
    let found: Value = serde_json::from_str(&read(&out, "map.json")).unwrap();
    assert_eq!(found["found"]["kinds"]["transient"], 4, "{found}");
    assert_eq!(found["found"]["impacts"]["not known"], 4, "{found}");
}

/// Pressed against a wall whose hysteresis keeps the speed of the last gain: each start leaves another speed and another orbit, all of one
/// family.
#[test]
fn orbits_that_keep_a_latched_speed_are_one_family() {
    let place = tempfile::tempdir().unwrap();
    let scene = place.path().join("pressed.json");
    fs::write(
        &scene,
        r#"{ "flank": 1,
             "train": { "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1, "damping_n_s_per_m": 0.4, "load_n": 3,
                        "load_harmonics": [{ "amplitude_n": 0.5, "frequency_rad_per_s": 1.3 }],
                        "wall": { "side": "above", "position_m": 0 }, "contact_stiffness": 20,
                        "law": { "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0.5, "speed_floor_m_per_s": 1e-6 } },
             "initial": "rest", "run": { "cycles": 10 } }"#,
    )
    .unwrap();
    let out = place.path().join("out");
    let axes = ["--vary", "/initial/q/0=-0.6:-0.1:4", "--vary", "/initial/v/0=-1:1:3"];
    let all = [&["basins", scene.to_str().unwrap()][..], &axes, &["--out", out.to_str().unwrap()]].concat();
    let (code, _, error) = run(&all);
    assert_eq!(code, 0, "{error}");
    let found: Value = serde_json::from_str(&read(&out, "attractors.json")).unwrap();
    assert_eq!(found["attractors"].as_array().unwrap().len(), 1, "{found:#}");
    assert_eq!(found["attractors"][0]["is_family"], true);
    assert_eq!(found["attractors"][0]["fraction"], 1.0);
}

/// Without load a gear rests anywhere in its gap: one family, and no boundary.
#[test]
fn rest_in_a_gap_is_one_attractor() {
    let place = tempfile::tempdir().unwrap();
    let mut scene: Value = serde_json::from_str(&fs::read_to_string(PAIR).unwrap()).unwrap();
    scene["train"]["mean_load"] = 0.into();
    scene["train"]["transmission_error"][0]["amplitude"] = 0.3.into();
    scene["train"]["transmission_error"][0]["frequency"] = 0.7.into();
    let path = place.path().join("scene.json");
    fs::write(&path, scene.to_string()).unwrap();
    let out = place.path().join("basins");
    let axes = ["--vary", "/initial/q/0=-0.8:0.8:12", "--vary", "/initial/v/0=-0.1:0.1:12"];
    let words = [&["basins", path.to_str().unwrap()][..], &axes, &["--out", out.to_str().unwrap()]].concat();
    let (code, text, error) = run(&words);
    assert_eq!(code, 0, "{text}{error}");
    let found: Value = serde_json::from_str(&read(&out, "attractors.json")).unwrap();
    let attractors = found["attractors"].as_array().unwrap();
    assert_eq!((attractors.len(), &attractors[0]["is_family"]), (1, &true.into()), "{text}");
    assert_eq!(found["measures"]["basin_entropy"]["value"], 0.0);
}

/// Two frequencies in a ratio of small whole numbers have a cycle together, others do not.
#[test]
fn a_forcing_that_does_not_repeat_with_its_cycle_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let mut scene: Value = serde_json::from_str(&fs::read_to_string(PAIR).unwrap()).unwrap();
    scene["train"]["transmission_error"] =
        serde_json::json!([{ "amplitude": 0.1, "frequency": 0.6 }, { "amplitude": 0.1, "frequency": 0.9 }]);
    scene["run"]["period"] = (std::f64::consts::TAU / 0.3).into();
    let path = place.path().join("scene.json");
    let out = place.path().join("out");
    let mut irrational = scene.clone();
    irrational["train"]["transmission_error"][1]["frequency"] = (0.6 * 2f64.sqrt()).into();
    for (command, axes) in [
        ("map", ["/train/damping_ratio=0.04:0.06:2", "/train/mean_load=0.1:0.2:2"]),
        ("basins", ["/initial/q/0=-1:1:2", "/initial/v/0=-1:1:2"]),
    ] {
        let words =
            [command, path.to_str().unwrap(), "--vary", axes[0], "--vary", axes[1], "--out", out.to_str().unwrap()];
        fs::write(&path, irrational.to_string()).unwrap();
        let (code, _, error) = run(&words);
        assert!(code == 2 && error.contains("0.848528137423857"), "{error}");
        assert!(!out.exists());
        fs::write(&path, scene.to_string()).unwrap();
        let (code, _, error) = run(&words);
        assert_eq!(code, 0, "{error}");
        fs::remove_dir_all(&out).unwrap();
    }
}
