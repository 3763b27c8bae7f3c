//! `flank sweep`: killed and resumed, interrupted, refused.

use std::{
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use flank::{
    Task,
    map::sweep_figure,
    plot::Print,
    scene::Scene,
    study::{SteadySweep, steady::Rule},
    sweep::{Begin, Ending, Grid, Plan, Seeding, Share},
};
use serde_json::Value;
use tempfile::TempDir;

/// The pair of Kahraman and Singh where teeth separate; a point takes a millisecond or so.
const SCENE: &str = r#"{
    "flank": 1,
    "train": {
        "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true, "mean_load": 0.1,
        "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }]
    },
    "initial": { "q": [1.1] },
    "run": { "cycles": 1 }
}"#;
const AMPLITUDE: &str = "/train/transmission_error/0/amplitude";
const FILES: [&str; 5] = ["sweep.csv", "sweep.jsonl", "sweep.json", "figures/sweep.svg", "flank-manifest.json"];

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.json"), SCENE).unwrap();
    folder
}

fn sweep(folder: &TempDir, words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flank"));
    command.current_dir(folder).args(["sweep", "scene.json"]).args(words);
    command
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn bytes(folder: &Path) -> Vec<Vec<u8>> {
    assert_eq!(fs::read_dir(folder).unwrap().count(), FILES.len(), "nothing else is left");
    FILES.map(|name| fs::read(folder.join(name)).unwrap()).to_vec()
}

/// A sweep of `count` amplitudes along four loads.
fn large(folder: &TempDir, count: usize, words: &[&str]) -> Command {
    let amplitudes = format!("{AMPLITUDE}=0.1:0.3:{count}");
    let axes = ["--vary", "/train/mean_load=0.06:0.24:4", "--vary", &amplitudes];
    sweep(folder, &[&axes[..], words].concat())
}

/// Waits until the journal in `out` has some rows.
fn wait_for_rows(folder: &TempDir, out: &str, child: &mut Child) {
    let journal = folder.path().join(out).join("sweep.journal");
    while fs::read(&journal).map_or(0, |bytes| bytes.iter().filter(|b| **b == b'\n').count()) < 4 {
        assert!(child.try_wait().unwrap().is_none(), "the sweep ended before it could be disturbed");
        sleep(Duration::from_millis(1));
    }
}

#[test]
fn the_library_writes_what_the_command_writes() {
    let folder = folder();
    assert_eq!(code(&large(&folder, 5, &["--quiet", "--out", "command"]).output().unwrap()), 0);
    let scene = Scene::from_file(folder.path().join("scene.json")).unwrap();
    let grid = Grid::parse(&["/train/mean_load=0.06:0.24:4", &format!("{AMPLITUDE}=0.1:0.3:5")]).unwrap();
    let sweep = SteadySweep::new(scene, Plan::new(grid, Seeding::Fresh), Rule::default()).unwrap();
    let out = folder.path().join("library");
    let mut journal = sweep.open(&out, Begin::New, Share::ALL).unwrap().unwrap();
    assert_eq!(sweep.run(&mut journal, Task::default()).unwrap(), Ending::Complete);
    let drawn = sweep.finish(journal, |rows, folder| {
        let figure = sweep_figure("scene", sweep.plan(), rows, sweep.dimensionless());
        figure.map_or(Ok(()), |figure| figure.draw_into(folder, &Print::default()))
    });
    drawn.unwrap();
    assert_eq!(bytes(&out), bytes(&folder.path().join("command")));
}

#[test]
fn a_table_has_its_columns() {
    let folder = folder();
    let done = sweep(&folder, &["--vary", "/train/mean_load=0.08,0.1", "--seed", "both"]).output().unwrap();
    assert_eq!(code(&done), 0);
    assert_eq!(stdout(&done), "4 rows: sweep/sweep.csv\n");
    assert!(done.stderr.is_empty(), "a pipe sees no progress bar");
    let text = fs::read_to_string(folder.path().join("sweep/sweep.csv")).unwrap();
    let table: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| table[0].iter().position(|column| *column == name).unwrap();
    assert!(table.iter().all(|row| row.len() == table[0].len()));
    let start: Vec<&[&str]> = table[1..].iter().map(|row| &row[..4]).collect();
    assert_eq!(
        start,
        [
            ["0.08", "up", "false", "periodic"],
            ["0.08", "down", "true", "periodic"],
            ["0.1", "up", "true", "periodic"],
            ["0.1", "down", "false", "periodic"],
        ]
    );
    // The mean force of a pair is its load.
    for row in &table[1..] {
        let [load, force] = [0, column("mesh force_mean")].map(|i| row[i].parse::<f64>().unwrap());
        assert!((force - load).abs() < 1e-6 * load, "{force} under {load}");
        assert_eq!(row[column("mesh separations_per_cycle")], "1.0");
        assert_eq!(row[column("error")], "");
    }
    let picture = fs::read_to_string(folder.path().join("sweep/figures/sweep.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("4 periodic") && picture.contains("mesh"));
    let whole: Value = serde_json::from_str(
        fs::read_to_string(folder.path().join("sweep/sweep.jsonl")).unwrap().lines().next().unwrap(),
    )
    .unwrap();
    assert_eq!(whole["at"]["/train/mean_load"], 0.08);
    assert_eq!(whole["result"]["contacts"][0]["name"], "mesh");
}

#[test]
fn columns_of_a_train_with_units_carry_them() {
    let folder = folder();
    let train = r#"{ "kind": "planetary", "preset": "reference-light", "freedoms": "torsional" }"#;
    let scene = format!(r#"{{ "flank": 1, "train": {train}, "run": {{ "cycles": 1 }} }}"#);
    fs::write(folder.path().join("scene.json"), scene).unwrap();
    // The train itself may be varied: fewer planets, fewer contacts.
    let done = sweep(&folder, &["--vary", "/train/planets=3,4", "-q"]).output().unwrap();
    assert_eq!((code(&done), done.stdout.len()), (0, 0));
    let text = fs::read_to_string(folder.path().join("sweep/sweep.csv")).unwrap();
    let table: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| table[0].iter().position(|column| *column == name).unwrap();
    assert!(column("cycle_s") < column("sun-planet 1 force_amplitude_n"));
    let fourth = column("ring-planet 4 force_mean_n");
    assert_eq!(table[1][fourth], "");
    assert!(table[2][fourth].parse::<f64>().unwrap() > 0.0);
}

#[test]
fn one_thread_or_four_the_same_bytes() {
    let folder = folder();
    let all = ["1", "2", "4"].map(|threads| {
        let done = large(&folder, 10, &["--seed", "both", "--threads", threads, "--out", threads]).output().unwrap();
        assert_eq!(code(&done), 0);
        bytes(&folder.path().join(threads))
    });
    assert!(all.iter().all(|bytes| *bytes == all[0]));
}

#[test]
fn a_sweep_killed_ten_times_ends_with_the_same_bytes() {
    let folder = folder();
    let begin = Instant::now();
    let seeding = ["--seed", "both", "--resume", "--out"];
    assert_eq!(code(&large(&folder, 25, &[&seeding[..], &["undisturbed"]].concat()).output().unwrap()), 0);
    let (whole, expected) = (begin.elapsed(), bytes(&folder.path().join("undisturbed")));

    // A linear congruential generator (Knuth, MMIX).
    let mut random = 20_261_121_u64;
    let mut delay = |share: f64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        whole.mul_f64(share * (random >> 11) as f64 / (1u64 << 53) as f64)
    };
    let kill_after = |out: &str, delay: Duration| {
        let mut child = large(&folder, 25, &[&seeding[..], &[out]].concat()).stdout(Stdio::null()).spawn().unwrap();
        sleep(delay);
        child.kill().unwrap();
        child.wait().unwrap();
        let journal = folder.path().join(out).join("sweep.journal");
        fs::read(journal).is_ok_and(|bytes| bytes.iter().filter(|b| **b == b'\n').count() > 1)
    };
    let finish = |out: &str| {
        assert_eq!(code(&large(&folder, 25, &[&seeding[..], &[out]].concat()).output().unwrap()), 0);
        assert_eq!(bytes(&folder.path().join(out)), expected, "{out}");
    };
    // Ten sweeps, each killed once, at any moment of the whole.
    let broken_off = (0..10).filter(|i| {
        let out = format!("once-{i}");
        let broken_off = kill_after(&out, delay(1.0));
        finish(&out);
        broken_off
    });
    assert!(broken_off.count() > 0, "a kill hit a sweep that was going on");
    // One sweep, killed ten times.
    let broken_off = (0..10).filter(|_| kill_after("often", delay(0.3))).count();
    assert!(broken_off > 0, "a kill hit the sweep while it was going on");
    finish("often");
}

#[test]
fn an_interrupt_keeps_rows_and_says_how_to_go_on() {
    let folder = folder();
    let words = ["--threads", "1", "--seed", "up"];
    let mut child = large(&folder, 600, &words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for_rows(&folder, "sweep", &mut child);

    let second = large(&folder, 600, &[&words[..], &["--resume"]].concat()).output().unwrap();
    assert_eq!(code(&second), 73);
    assert!(String::from_utf8_lossy(&second.stderr).contains("another command is writing into"));

    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let done = child.wait_with_output().unwrap();
    assert_eq!(code(&done), 75);
    assert!(stdout(&done).contains("--resume goes on"), "{}", stdout(&done));
    let journal = fs::read_to_string(folder.path().join("sweep/sweep.journal")).unwrap();
    let kept = journal.lines().count() - 1;
    assert!(stdout(&done).contains(&format!("{kept} of 2400 rows are kept in sweep")));
    assert!(kept >= 3 && journal.ends_with('\n'));
    assert!(!journal.contains("failed"), "a point given up is no row");
    assert!(!folder.path().join("sweep/sweep.csv").exists());

    let anew = large(&folder, 600, &words).output().unwrap();
    assert_eq!(code(&anew), 2);
    assert!(String::from_utf8_lossy(&anew.stderr).contains("write --resume to go on with it"));
    let other = sweep(&folder, &["--vary", "/train/mean_load=0.1", "--resume"]).output().unwrap();
    assert_eq!(code(&other), 2);
    assert!(String::from_utf8_lossy(&other.stderr).contains("holds other work"));
    assert_eq!(fs::read_to_string(folder.path().join("sweep/sweep.journal")).unwrap(), journal, "nothing was changed");

    // Begun on a processor with other vector instructions: its rows have other bits.
    let instructions = flank::Instructions::best().name();
    let elsewhere = journal.replacen(&format!("\"instructions\":\"{instructions}\""), "\"instructions\":\"other\"", 1);
    assert_ne!(elsewhere, journal);
    // With the checksum that such a header has.
    let (head, rest) = elsewhere.split_once('\n').unwrap();
    let json = head.splitn(4, ' ').nth(3).unwrap();
    let elsewhere = format!("flank-rows 1 {:08x} {json}\n{rest}", crc32fast::hash(json.as_bytes()));
    fs::write(folder.path().join("sweep/sweep.journal"), elsewhere).unwrap();
    let here = large(&folder, 600, &[&words[..], &["--resume"]].concat()).output().unwrap();
    assert_eq!(code(&here), 2);
    let told = format!("instructions: \"other\" there, \"{instructions}\" here");
    assert!(String::from_utf8_lossy(&here.stderr).contains(&told), "{}", String::from_utf8_lossy(&here.stderr));
}

#[test]
fn bad_input_is_refused_before_anything_is_written() {
    let folder = folder();
    for (words, found) in [
        (&["--vary", "/train/mean_lod=0:1:3", "--vary", "/run/cycles=0:5:3"][..], &["mean_lod", "/run/cycles"][..]),
        (&["--vary", "/train/damping_ratio=0.1:-0.1:3"], &["-0.1"]),
        (
            &["--vary", "mean_load=0:x:1", "--vary", "/a=1:2"],
            &["\"mean_load\" as pointer", "\"x\"", "\"1\" as count", "\"1:2\""],
        ),
        (&["--vary", "/train/mean_load=0:1:3", "--tolerance", "nan"], &["1e-13 to 0.1"]),
        (&["--vary", "/train/mean_load=0:1:3", "--max-cycles", "0"], &["--max-cycles"]),
        (&["--vary", "/train/mean_load=0:1:3", "--resume", "--force"], &["--resume"]),
        (&[], &["--vary"]),
    ] {
        let done = sweep(&folder, words).output().unwrap();
        assert_eq!(code(&done), 2, "{words:?}");
        let text = String::from_utf8(done.stderr).unwrap();
        assert!(found.iter().all(|word| text.contains(word)), "{words:?}: {text}");
        assert!(!folder.path().join("sweep").exists(), "{words:?}");
    }
    // No period, no cycles to compare.
    let ball = r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "load_n": -9.81,
        "wall": { "side": "below", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 } },
        "initial": { "q": [1] }, "run": { "t_end_s": 1 } }"#;
    fs::write(folder.path().join("scene.json"), ball).unwrap();
    let done = sweep(&folder, &["--vary", "/train/mass_kg=1:2:2"]).output().unwrap();
    assert_eq!(code(&done), 2);
    assert!(String::from_utf8(done.stderr).unwrap().contains("no period"));
}

#[test]
fn a_sweep_of_nothing_but_failures_says_so() {
    let folder = folder();
    fs::write(folder.path().join("scene.json"), SCENE.replace(r#""cycles": 1"#, r#""cycles": 1, "event_budget": 5"#))
        .unwrap();
    let done = sweep(&folder, &["--vary", "/train/mean_load=0.08,0.1"]).output().unwrap();
    assert_eq!(code(&done), 1);
    assert_eq!(stdout(&done), "2 rows, 2 of them failed (column error): sweep/sweep.csv\n");
    let text = fs::read_to_string(folder.path().join("sweep/sweep.csv")).unwrap();
    assert!(text.lines().nth(1).unwrap().contains("event budget of the scene"));
}
