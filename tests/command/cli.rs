//! The command line, from outside: exit codes, what is printed, what is written.
#![cfg(feature = "cli")]

use std::{fs, path::Path};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// A ball that falls on a floor; `run` is its run section.
fn ball(run: &str) -> String {
    let train = r#"{ "kind": "wall", "mass_kg": 1, "load_n": -9.81, "wall": { "side": "below", "position_m": 0 },
        "law": { "kind": "rigid", "restitution": 0.8 } }"#;
    format!(r#"{{ "flank": 1, "train": {train}, "initial": {{ "q": [1] }}, "run": {run} }}"#)
}

fn flank(folder: &TempDir, words: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("flank").unwrap().current_dir(folder).args(words).assert()
}

fn with_scene(text: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.json"), text).unwrap();
    folder
}

fn summary(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("summary.json")).unwrap()).unwrap()
}

fn rows(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("events.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_run_writes_events_and_measures() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5 }"#));
    let done = flank(&folder, &["run", "scene.json", "--out", "out"]).code(0);
    let out = folder.path().join("out");
    let (summary, rows) = (summary(&out), rows(&out));
    assert_eq!(summary["outcome"]["kind"], "reached-end");
    assert_eq!(summary["outcome"]["mode"], "drive");
    assert_eq!(summary["work"]["events"], rows.len());
    assert_eq!(rows[0]["contacts"][0]["kind"], "impact");
    assert!(rows[0]["t"].as_str().unwrap().starts_with("0.451523640985730"));
    assert_eq!(summary["scene"]["sha256"].as_str().unwrap().len(), 64);
    assert!(!out.join("trajectory.csv").exists());
    assert!(text(&done.get_output().stdout).contains("reached end"));
}

#[test]
fn a_pipe_sees_no_progress_bar() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5 }"#));
    let done = flank(&folder, &["run", "scene.json"]).code(0);
    assert_eq!(text(&done.get_output().stderr), "");
    assert!(!text(&done.get_output().stdout).contains('\u{1b}'));
    let quiet = flank(&folder, &["run", "scene.json", "--quiet"]).code(0);
    assert!(quiet.get_output().stdout.is_empty());
}

/// The table of events has a line for each contact of the log; it can go to standard output, and the scene come from standard input.
#[test]
fn events_are_a_table_too() {
    let scene = ball(r#"{ "t_end_s": 5, "period_s": 0.1 }"#).replacen('{', r#"{ "$schema": "scene.schema.json","#, 1);
    let folder = with_scene(&scene);
    flank(&folder, &["run", "scene.json", "--out", "out", "--no-report"]).code(0);
    let read = |name: &str| fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let (log, table) = (read("events.jsonl"), read("events.csv"));
    let rows: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let contacts: usize = rows.iter().map(|row| row["contacts"].as_array().unwrap().len()).sum();
    assert_eq!(table.lines().count(), 1 + contacts);
    assert!(table.starts_with("index,cycle,phase_s,t_s,uncertainty_s,contact,kind,from,to,deflection_m,"), "{table}");
    let first: Vec<&str> = table.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(first[3], rows[0]["t"].as_str().unwrap());
    let mut command = assert_cmd::Command::cargo_bin("flank").unwrap();
    let done = command.args(["run", "-", "--out", "-"]).write_stdin(scene.clone()).assert().code(0);
    assert_eq!(text(&done.get_output().stdout), table);
    flank(&folder, &["run", "scene.json", "--out", "bare", "--no-log", "--no-report"]).code(0);
    assert!(!folder.path().join("bare/events.csv").exists());
    // The schema is no part of the scene.
    let summary = |name: &str| summary(&folder.path().join(name))["scene"]["sha256"].clone();
    fs::write(folder.path().join("scene.json"), ball(r#"{ "t_end_s": 5, "period_s": 0.1 }"#)).unwrap();
    flank(&folder, &["run", "scene.json", "--out", "plain", "--no-log", "--no-report"]).code(0);
    assert_eq!(summary("out"), summary("plain"));
}

#[test]
fn the_parser_writes_completions_and_a_manual() {
    let folder = tempfile::tempdir().unwrap();
    let bash = flank(&folder, &["completions", "bash"]).code(0);
    assert!(text(&bash.get_output().stdout).contains("--no-report"));
    let page = flank(&folder, &["man"]).code(0);
    assert!(text(&page.get_output().stdout).contains(".TH flank"));
    flank(&folder, &["man", "--out", "."]).code(0);
    assert!(folder.path().join("flank-run.1").exists());
}

#[test]
fn a_sound_is_a_file_that_is_not_replaced_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let done = flank(&folder, &["sound", "--seconds", "0.1"]).code(0);
    assert!(text(&done.get_output().stdout).contains("placeholder"));
    let bytes = fs::read(folder.path().join("rattle.wav")).unwrap();
    assert_eq!((&bytes[..4], &bytes[8..12]), (&b"RIFF"[..], &b"WAVE"[..]));
    flank(&folder, &["sound", "--seconds", "0.1"]).code(2);
    flank(&folder, &["sound", "--seconds", "0", "--full-scale", "-1", "--force"]).code(2);
    fs::write(
        folder.path().join("path.json"),
        r#"{ "modes": [{ "frequency_hz": 1e5, "damping_ratio": 2, "amplitude": 1 }] }"#,
    )
    .unwrap();
    let refused = flank(&folder, &["sound", "--path", "path.json", "--force"]).code(2);
    let words = text(&refused.get_output().stderr);
    assert!(words.contains("frequency_hz") && words.contains("damping_ratio"), "{words}");
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5, "output": { "samples_per_cycle": 8 }, "period_s": 0.1 }"#));
    let first = flank(&folder, &["run", "scene.json", "--out", "a"]).code(0);
    let second = flank(&folder, &["run", "scene.json", "--out", "b"]).code(0);
    let report = |stdout: &[u8]| text(stdout).replace("Written into b", "Written into a");
    assert_eq!(report(&first.get_output().stdout), report(&second.get_output().stdout));
    for name in ["events.jsonl", "summary.json", "trajectory.csv", "report.html", "figures/states.svg"] {
        let read = |out: &str| fs::read(folder.path().join(out).join(name)).unwrap();
        assert_eq!(read("a"), read("b"), "{name}");
    }
}

#[test]
fn a_trajectory_has_its_columns_and_samples() {
    let folder = with_scene(&ball(r#"{ "cycles": 4, "period_s": 0.25, "output": { "samples_per_cycle": 8 } }"#));
    flank(&folder, &["run", "scene.json", "--out", "out"]).code(0);
    let text = fs::read_to_string(folder.path().join("out/trajectory.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "t,cycle,phase,x,x_rate,wall deflection,wall force");
    assert_eq!(lines.len(), 1 + 33, "both ends");
    assert!(lines[1].starts_with("0,0,0,1,0,-1,"));
}

#[test]
fn a_fixed_frame_turns_the_central_bodies() {
    let scene = |frame: &str| {
        format!(
            r#"{{ "flank": 1, "train": {{ "kind": "planetary", "preset": "reference-heavy", "speed_rpm": 500 }},
            "initial": "static",
            "run": {{ "cycles": 2, "output": {{ "samples_per_cycle": 4, "frame": "{frame}" }} }} }}"#
        )
    };
    let table = |frame: &str| -> Vec<Vec<f64>> {
        let folder = with_scene(&scene(frame));
        flank(&folder, &["run", "scene.json", "--out", "out", "-q"]).code(0);
        let text = fs::read_to_string(folder.path().join("out/trajectory.csv")).unwrap();
        text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
    };
    let (turning, fixed) = (table("rotating"), table("fixed"));
    assert_eq!(turning.len(), fixed.len());
    // Columns: time, cycle, phase, then x_s, y_s, u_s. Carrier speed 500 rpm · 34/130.
    let speed = 500.0 / 60.0 * std::f64::consts::TAU * 34.0 / 130.0;
    for (a, b) in turning.iter().zip(&fixed) {
        let (sin, cos) = (speed * a[0]).sin_cos();
        let size = a[3].hypot(a[4]).max(1e-12);
        assert!((b[3] - (a[3] * cos - a[4] * sin)).abs() < 1e-9 * size);
        assert!((b[4] - (a[3] * sin + a[4] * cos)).abs() < 1e-9 * size);
        assert_eq!(a[5], b[5], "rotations are the same in both frames");
    }
}

#[test]
fn a_spent_event_budget_leaves_valid_files() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5, "event_budget": 7 }"#));
    let done = flank(&folder, &["run", "scene.json", "--out", "out"]).code(4);
    assert!(text(&done.get_output().stderr).contains("the event budget of the scene, 7, was spent"));
    let out = folder.path().join("out");
    assert_eq!(summary(&out)["outcome"]["kind"], "event-budget-spent");
    assert_eq!(summary(&out)["work"]["events"], 7);
    assert!(rows(&out).len() >= 6);
    assert!(text(&done.get_output().stdout).contains("event budget spent"));
    // The user's own limit is no failure.
    flank(&folder, &["run", "scene.json", "--events", "3", "--out", "few"]).code(0);
    assert_eq!(summary(&folder.path().join("few"))["work"]["events"], 3);
}

/// A wall too stiff for the run by a factor of 10⁶: 5e9 rad of oscillation, at some 2.4 rad per step.
#[test]
fn a_spent_step_budget_is_told_before_and_after() {
    let scene = r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1e18,
        "load_harmonics": [{ "amplitude_n": 1, "frequency_rad_per_s": 1.2 }], "wall": { "side": "above", "position_m": 1 },
        "law": { "kind": "rigid", "restitution": 0.8 } }, "initial": { "q": [-0.2] },
        "run": { "cycles": 1, "step_budget": 1000 } }"#;
    let folder = with_scene(scene);
    let checked = flank(&folder, &["check", "scene.json"]).code(0);
    assert!(text(&checked.get_output().stdout).contains("run.step_budget allows 1000"));
    let done = flank(&folder, &["run", "scene.json", "--out", "out"]).code(1);
    let (summary, told) = (summary(&folder.path().join("out")), text(&done.get_output().stderr));
    assert_eq!(summary["outcome"]["kind"], "failed");
    assert_eq!(summary["work"]["steps"], 1000);
    assert!(summary["outcome"]["reason"].as_str().unwrap().contains("the step budget of 1000 is spent"));
    assert!(told.contains("warning: the run needs some") && told.contains("per cycle"));
    // Runs that nobody looks at have the same budget: an exponent would take as long.
    let done = flank(&folder, &["lyapunov", "scene.json", "--cycles", "1", "--out", "exponent"]).code(1);
    assert!(text(&done.get_output().stderr).contains("step budget"));
}

/// Ctrl-C ends every command, also within one cycle that lasts for hours: half of one takes 1e9 rad/s × π steps.
#[cfg(unix)]
#[test]
fn an_interrupt_ends_every_command_within_a_cycle() {
    let folder = with_scene(
        r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1e18,
        "load_harmonics": [{ "amplitude_n": 1, "frequency_rad_per_s": 1 }], "wall": { "side": "above", "position_m": 1 },
        "law": { "kind": "rigid", "restitution": 0.8 } }, "initial": { "q": [-0.2] },
        "run": { "cycles": 1, "step_budget": 1000000000000000 } }"#,
    );
    let (load, wall) = ("/train/load_harmonics/0/amplitude_n=1:2:2", "/train/wall/position_m=1:2:2");
    let (place, speed) = ("/initial/q/0=-0.3:-0.1:2", "/initial/v/0=0:1:2");
    let commands: [&[&str]; 8] = [
        &["run"],
        &["orbit"],
        &["lyapunov"],
        &["sweep", "--vary", load],
        &["diagram", "--vary", load],
        &["continue", "--vary", "/train/load_harmonics/0/amplitude_n=1:2"],
        &["map", "--vary", load, "--vary", wall],
        &["basins", "--vary", place, "--vary", speed],
    ];
    let begin = |words: &&[&str]| {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("flank"));
        command.current_dir(&folder).arg(words[0]).arg("scene.json").args(&words[1..]).args(["--out", words[0]]);
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap()
    };
    for words in &commands {
        let mut child = begin(words);
        // Long enough to be at work; a command that has ended by then was never interrupted.
        std::thread::sleep(std::time::Duration::from_millis(700));
        assert!(child.try_wait().unwrap().is_none(), "{words:?} has ended by itself");
        let id = child.id().to_string();
        assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        // A hang fails the test by its runner's limit, and leaves no process behind.
        let ended = (0..600).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(50));
            child.try_wait().unwrap().is_some()
        });
        let _ = child.kill();
        assert!(ended, "{words:?} does not hear the interrupt");
        assert_ne!(child.wait().unwrap().code(), Some(0), "{words:?}");
    }
}

#[test]
fn a_nearly_singular_mass_matrix_is_warned_of_with_its_condition_number() {
    let scene = |coupling: f64| {
        let train = format!(
            r#"{{ "kind": "matrices", "mass_kg": [[1, {coupling}], [{coupling}, 1]], "stiffness_n_per_m": [[1, 0], [0, 1]] }}"#
        );
        with_scene(&format!(
            r#"{{ "flank": 1, "train": {train}, "initial": {{ "q": [1, 0] }}, "run": {{ "t_end_s": 1 }} }}"#
        ))
    };
    // ‖M‖₁ ‖M⁻¹‖₁ = (1 + c)² / (1 − c²) = (1 + c) / (1 − c).
    for (coupling, number) in [(0.9, None), (0.9999999, Some("2.0e7"))] {
        let done = flank(&scene(coupling), &["check", "scene.json"]).code(0);
        let told = text(&done.get_output().stdout) + &text(&done.get_output().stderr);
        assert_eq!(told.contains("nearly singular"), number.is_some(), "{told}");
        assert!(number.is_none_or(|number| told.contains(number)), "{told}");
    }
}

#[test]
fn a_train_that_nothing_moves_has_no_event_but_its_start() {
    let folder = with_scene(
        r#"{ "flank": 1, "train": { "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
        "driving": { "teeth": 50, "mass_kg": 2.8, "inertia_kg_m2": 0.008,
            "rotation": { "stiffness_n_per_m": 1e5, "damping_ratio": 0.03 } },
        "driven": { "teeth": 50, "mass_kg": 2.8, "inertia_kg_m2": 0.008 },
        "mesh": { "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "total_backlash_m": 1e-4,
            "stiffness": { "kind": "tooth-pairs", "mean": 3.8e8, "modulation": 0.6 } },
        "speed_rpm": 600, "torque_nm": 0 }, "initial": "static", "run": { "cycles": 200 } }"#,
    );
    flank(&folder, &["run", "scene.json", "--out", "out"]).code(0);
    let out = folder.path().join("out");
    assert!(rows(&out).iter().all(|row| row["start"] == true), "{:?}", rows(&out));
    assert_eq!(summary(&out)["energy"]["throughput"], 0.0);
}

#[test]
fn a_start_is_refused_only_where_it_is_used() {
    // A bead in a shaken box (de Souza, Caldas and Viana 2009): above amplitude 1 it would start inside the wall.
    let folder = with_scene(
        r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "wall": { "side": "both", "half_gap_m": 1 },
        "wall_motion": [{ "amplitude_m": 0.5, "frequency_rad_per_s": 1 }], "law": { "kind": "rigid", "restitution": 0.8 } },
        "initial": { "q": [0], "v": [0.6] }, "run": { "cycles": 400, "transient_cycles": 300 } }"#,
    );
    let axis = "/train/wall_motion/0/amplitude_m=0.5,2";
    flank(&folder, &["sweep", "scene.json", "--vary", axis, "--out", "fresh"]).code(3);
    let table = fs::read_to_string(folder.path().join("fresh/sweep.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert!(lines[1].contains("periodic") && !lines[1].contains("inside"), "{table}");
    assert!(lines[2].contains("amplitude_m = 2") && lines[2].contains("inside the rigid flank"), "{table}");
    flank(&folder, &["diagram", "scene.json", "--vary", axis, "--transient", "20", "--points", "5", "--out", "points"])
        .code(0);
    let range = "/train/wall_motion/0/amplitude_m=0.05:2";
    flank(&folder, &["continue", "scene.json", "--period", "1", "--vary", range, "--out", "branch"]).code(0);
    let points = fs::read_to_string(folder.path().join("branch/special.csv")).unwrap();
    // The fold of the orbit of two impacts, at q / √(1 + q²) with q = 2 (1 − r) / (π (1 + r)).
    let q = 2.0 * 0.2 / (std::f64::consts::PI * 1.8);
    let fold = format!("{:.9}", q / f64::sqrt(1.0 + q * q));
    assert!(points.lines().any(|line| line.contains("fold") && line.contains(&fold)), "{fold}: {points}");
    // A value out of its own range still refuses the axis.
    let done = flank(&folder, &["sweep", "scene.json", "--vary", "/train/mass_kg=-1,1", "--out", "mass"]).code(2);
    assert!(text(&done.get_output().stderr).contains("/train/mass_kg"));
}

#[test]
fn a_failed_run_leaves_valid_files_and_says_why() {
    // A spring that pushes away: the motion grows beyond what a double holds.
    let scene = r#"{ "flank": 1, "train": { "kind": "matrices", "mass_kg": [1], "stiffness_n_per_m": [-1e4] },
        "initial": { "q": [1] }, "run": { "t_end_s": 1000 } }"#;
    let folder = with_scene(scene);
    let done = flank(&folder, &["run", "scene.json", "--out", "out"]).code(1);
    let summary = summary(&folder.path().join("out"));
    assert_eq!(summary["outcome"]["kind"], "failed");
    assert!(summary["outcome"]["reason"].as_str().unwrap().contains("finite"));
    assert!(text(&done.get_output().stderr).contains("finite"));
}

#[test]
fn a_measure_beyond_double_precision_is_no_result() {
    let scene = ball(r#"{ "t_end_s": 1 }"#).replace("-9.81", "-1e308");
    assert!(scene.contains("-1e308"));
    let folder = with_scene(&scene);
    let done = flank(&folder, &["run", "scene.json"]).code(1);
    assert!(text(&done.get_output().stderr).contains("double"));
}

#[test]
fn the_reference_scene_has_no_graze_and_no_row_out_of_order() {
    let folder = with_scene("{}");
    flank(&folder, &["run", "--out", "out", "--quiet"]).code(0);
    let rows = rows(&folder.path().join("out"));
    let times: Vec<f64> = rows.iter().map(|row| row["seconds"].as_f64().unwrap()).collect();
    assert!(times.is_sorted());
    for row in &rows {
        for contact in row["contacts"].as_array().unwrap() {
            assert_ne!(contact["kind"], "graze");
        }
    }
}

#[test]
fn a_bad_scene_is_refused_before_anything_is_written() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5, "dt": 1e-3 }"#));
    for words in
        [&["run", "scene.json", "--out", "out"][..], &["check", "scene.json"], &["scene", "show", "scene.json"]]
    {
        let done = flank(&folder, words).code(2);
        assert!(text(&done.get_output().stderr).contains("/run/dt"), "{words:?}");
    }
    assert!(!folder.path().join("out").exists());
    flank(&folder, &["run", "nothing.json"]).code(2);
    flank(&folder, &["walk"]).code(2);
    flank(&folder, &["run", "--trajectory"]).code(2);
}

#[test]
fn a_folder_in_use_is_refused() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 1 }"#));
    let words = ["run", "scene.json", "--out", "out"];
    flank(&folder, &words).code(0);
    let before = fs::read(folder.path().join("out/summary.json")).unwrap();
    let done = flank(&folder, &words).code(2);
    assert!(text(&done.get_output().stderr).contains("--force"));
    assert_eq!(fs::read(folder.path().join("out/summary.json")).unwrap(), before);
    flank(&folder, &[&words[..], &["--force"]].concat()).code(0);
}

#[test]
fn check_tells_what_a_scene_builds() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5 }"#));
    let done = flank(&folder, &["check", "scene.json"]).code(0);
    let told = text(&done.get_output().stdout);
    for word in ["freedoms: x", "rigid", "Natural frequencies", "Integrator", "No warnings"] {
        assert!(told.contains(word), "{word} in:\n{told}");
    }
    let done = flank(&folder, &["check"]).code(0);
    let told = text(&done.get_output().stdout);
    for word in ["reference-light", "ring-planet 3", "Mesh clocks", "nearest order", "warning: "] {
        assert!(told.contains(word), "{word} in:\n{told}");
    }
}

/// The figures of a check hold the numbers of the scene: orders that go through zero and the scene's own speed, and critical speeds
/// on both lines.
#[test]
fn check_draws_the_train_and_its_critical_speeds() {
    let folder = tempfile::tempdir().unwrap();
    let scene = format!("{}/examples/scenes/three-shaft-box.json", env!("CARGO_MANIFEST_DIR"));
    flank(&folder, &["check", &scene, "--out", "seen", "--format", "svg"]).code(0);
    let figure = |id: &str| -> Value {
        let path = folder.path().join(format!("seen/figures/{id}.json"));
        serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
    };
    for id in ["train", "stiffness", "error", "loads", "campbell"] {
        assert!(folder.path().join(format!("seen/figures/{id}.svg")).is_file(), "{id}");
    }
    // Four gears with as many corners as their teeth have, and one to close the line.
    let train = &figure("train")["panels"][0];
    let corners = |i: usize| train["series"][i]["x"].as_array().unwrap().len();
    assert_eq!([0, 1, 2, 3].map(corners), [27, 51, 23, 34].map(|teeth| 4 * teeth + 1));
    let campbell = &figure("campbell")["panels"][0];
    let numbers = |axis: &str| -> Vec<f64> {
        campbell["series"][0][axis].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let (speeds, modes) = (numbers("x"), numbers("y"));
    assert!(speeds.len() > 5);
    // At 1500 rev/min the meshes have 675 Hz and 675 · 23/51 Hz: tooth numbers alone.
    for (speed, mode) in speeds.iter().zip(&modes) {
        let order = mode / (675.0 * speed / 1500.0);
        let is_order = |ratio: f64| (order / ratio - (order / ratio).round()).abs() < 1e-9;
        assert!(is_order(1.0) || is_order(23.0 / 51.0), "{speed} {mode}");
    }
}

#[test]
fn schema_and_scenes_are_json() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5 }"#));
    let json = |words: &[&str]| -> Value {
        serde_json::from_slice(&flank(&folder, words).code(0).get_output().stdout).unwrap()
    };
    assert_eq!(json(&["schema"])["title"], "Flank scene");
    assert_eq!(json(&["scene", "show", "scene.json"])["run"]["event_budget"], 10_000_000);
    assert_eq!(json(&["scene", "show"])["name"], "reference-light");
}

/// Ctrl-C ends a long run cleanly.
#[cfg(unix)]
#[test]
fn an_interrupt_leaves_valid_files() {
    let folder = with_scene(
        r#"{ "flank": 1, "train": { "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "mean_load": 0.1,
            "damping_in_gap": true, "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }] },
            "initial": { "q": [1.1], "v": [0] }, "run": { "cycles": 1000000000 } }"#,
    );
    let program = assert_cmd::cargo::cargo_bin("flank");
    let mut child = std::process::Command::new(program)
        .current_dir(&folder)
        .args(["run", "scene.json", "--out", "out", "-q"])
        .spawn()
        .unwrap();
    let events = folder.path().join("out/events.jsonl");
    while fs::metadata(&events).map_or(0, |data| data.len()) < 10_000 {
        assert_eq!(child.try_wait().unwrap(), None, "the run ended by itself");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    let out = folder.path().join("out");
    let summary = summary(&out);
    assert_eq!(summary["outcome"]["kind"], "interrupted");
    assert!(summary["outcome"]["cycle"].as_i64().unwrap() > 0);
    assert!(rows(&out).len() > 10);
}

#[test]
fn an_identification_writes_its_answer_and_the_scene_it_leads_to() {
    let folder = with_scene(
        r#"{ "flank": 1, "train": { "kind": "planetary", "preset": "lin-parker" }, "run": { "t_end_s": 1 } }"#,
    );
    let pointer = "/train/planet/translation/stiffness_n_per_m";
    let (vary, out) = (format!("{pointer}=1e7:1e9"), folder.path().join("out"));
    let ask = ["identify", "scene.json", "--vary", &vary, "--target", "translational:2=1200", "--out", "out"];
    flank(&folder, &ask).code(0);
    let (answer, scene) = (fs::read(out.join("identify.json")).unwrap(), fs::read(out.join("scene.json")).unwrap());
    let read: Value = serde_json::from_slice(&answer).unwrap();
    let value = read["parameters"][0]["found"].as_f64().unwrap();
    let written: Value = serde_json::from_slice(&scene).unwrap();
    assert_eq!(written.pointer(pointer).and_then(Value::as_f64), Some(value));
    assert!((read["targets"][0]["got"].as_f64().unwrap() - 1200.0).abs() < 1e-6);
    assert_eq!(read["scene"]["sha256"].as_str().unwrap().len(), 64);
    // The scene it leads to has the frequency, and a folder in use is left alone.
    let checked = flank(&folder, &["check", "out/scene.json"]).code(0);
    let checked = text(&checked.get_output().stdout);
    assert!(checked.lines().any(|line| line.split_whitespace().take(2).eq(["1200", "2"])), "{checked}");
    flank(&folder, &ask).code(2);
    flank(&folder, &[&ask[..], &["--force", "--quiet"]].concat()).code(0).stdout("");
    assert_eq!(fs::read(out.join("identify.json")).unwrap(), answer);
    assert_eq!(fs::read(out.join("scene.json")).unwrap(), scene);
}

#[test]
fn a_wrong_question_is_answered_with_every_fault_and_no_file() {
    let folder = with_scene(
        r#"{ "flank": 1, "train": { "kind": "planetary", "preset": "lin-parker" }, "run": { "t_end_s": 1 } }"#,
    );
    let vary = ["--vary", "/train/moon/mass_kg=1:2", "/train/sun/mass_kg=2:1"];
    let target = ["--target", "planet:1=700", "force:sun-moon=1", "speed=3"];
    let done = flank(&folder, &[&["identify", "scene.json", "--out", "out"], &vary[..], &target[..]].concat()).code(2);
    let told = text(&done.get_output().stderr);
    for word in ["5 faults", "/train/moon", "lower bound", "0 planet", "ring-planet 3", "\"speed\" as a quantity"] {
        assert!(told.contains(word), "{word} is not in {told}");
    }
    assert!(!folder.path().join("out").exists());
}

/// The pages that question a gearbox: data for programs, refusals with words and exit code 2.
#[test]
fn a_scene_is_questioned_and_imported() {
    let folder = with_scene(&ball(r#"{ "t_end_s": 5 }"#));
    let done = flank(&folder, &["check", "--json"]).code(0);
    let report: Value = serde_json::from_slice(&done.get_output().stdout).unwrap();
    assert_eq!(report["meshes"][1]["name"], "ring mesh");
    assert_eq!(report["modes"].as_array().unwrap().len(), report["freedoms"].as_array().unwrap().len());
    let refused = [
        (&["run", "--strict"][..], "a scene without warnings"),
        (&["threshold", "scene.json", "--vary", "/train/mass_kg=1:2"], "a rigid contact"),
        (&["threshold", "--vary", "/train/speed_rpm"], "POINTER=FROM:TO"),
        (&["sweep", "--vary", "/train/speed_rpm=400:500:2", "--columns", "force"], "force_mean"),
        (&["import", "none.rexs", "--out", "new.json"], "cannot be read"),
        (&["import", "scene.json", "--out", "new.json"], "missing field"),
        (&["import", "none.rexs", "--out", "scene.json"], "which exists"),
        (&["import", "none.rexs", "--set", "speed=3"], "POINTER=VALUE"),
    ];
    for (arguments, words) in refused {
        let done = flank(&folder, arguments).code(2);
        // Lines are broken to the width of a terminal.
        let told = text(&done.get_output().stderr).replace("│", " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(told.contains(words), "{words} in:\n{told}");
    }
    let done = flank(&folder, &["threshold", "--vary", "/train/load/drag_torque_nm=1:40", "--json"]).code(0);
    let found: Value = serde_json::from_slice(&done.get_output().stdout).unwrap();
    assert_eq!((&found["threshold"]["kind"], &found["shared"]), (&Value::from("graze"), &Value::from(true)));
}
