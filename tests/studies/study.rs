//! The reference study: its figures, and the numbers they rest on.
//!
//! Expected values: an independent prototype (fixed-step Runge–Kutta, checked by halving its step) and a frequency-domain
//! solution of the same equations; tolerances are those stated for them.

#![cfg(feature = "cli")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Stdio,
    thread::sleep,
    time::Duration,
};

use assert_cmd::Command;
use flank::{
    Task,
    plot::Figure,
    study::{
        Context, FigureKind,
        claims::{Comparison, Verdict},
        plan::Plan,
        steady::Rule,
    },
};
use serde_json::Value;

fn context() -> Context<'static> {
    Context { rule: Rule::default(), task: Task::default() }
}

/// The reference study on a few speeds and loads.
fn small() -> Plan {
    Plan::reference().unwrap().varied(Some(vec![0.0, 10.0, 20.0, 22.0, 40.0]), Some(vec![500.0, 1050.0, 2000.0]))
}

#[track_caller]
fn close(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance, "{found} is not {wanted} to {tolerance}");
}

/// Every axis has a label, every number is finite, every series is as long on x as on y.
fn check(figure: &Figure) {
    assert!(!figure.title.is_empty() && !figure.caption.is_empty() && figure.columns >= 1, "{}", figure.id);
    assert!(!figure.panels.is_empty(), "{}", figure.id);
    for panel in &figure.panels {
        assert!(!panel.x.label.is_empty() && !panel.y.label.is_empty(), "{}: {}", figure.id, panel.title);
        assert!(!panel.series.is_empty() || panel.raster.is_some(), "{}: {}", figure.id, panel.title);
        for series in &panel.series {
            assert_eq!(series.x.len(), series.y.len());
            assert!(series.x.iter().chain(&series.y).all(|v| v.is_finite()), "{}: {}", figure.id, series.name);
        }
    }
}

#[test]
fn every_figure_of_the_reference_study_is_made() {
    let plan = small();
    // Changes take as long as all the others; they have a test of their own.
    for kind in FigureKind::ALL.into_iter().filter(|kind| *kind != FigureKind::Changes) {
        let entry = plan.make(kind, &context()).unwrap_or_else(|error| panic!("{}: {error}", kind.id()));
        if let Some(figure) = &entry.figure {
            assert_eq!(figure.id, kind.id());
            check(figure);
        }
        assert_eq!(entry.figure.is_none(), kind.is_table());
        assert_eq!(entry.scene[1].len(), 64);
        if let Some(listing) = &entry.listing {
            assert!(!listing.rows.is_empty() && listing.rows.iter().all(|row| row.len() == listing.head.len()));
        }
    }
}

/// The table of the study itself: what it calls off may be off only where the other implementation's step decides which
/// impact of a cold start is the last one.
#[test]
fn independent_values() {
    let entry = Plan::reference().unwrap().make(FigureKind::Values, &context()).unwrap();
    let rows = entry.listing.unwrap().rows;
    assert!(rows.len() > 100);
    let history =
        ["threshold", "1500 rev/min", "1800 rev/min", "20.5 N m, amplitude", "30 N m, amplitude", "60 N m, amp"];
    for row in &rows {
        let hangs = row[0].starts_with("light: ") && history.iter().any(|words| row[0].contains(words));
        assert!(row[4] == "within" || hangs, "{row:?}");
    }
    // The one threshold with a tolerance of its own.
    let own = rows.iter().find(|row| row[0].starts_with("light: 500 rev/min, threshold")).unwrap();
    assert_eq!(own[4], "within", "{own:?}");
}

#[test]
fn published_points_lie_in_the_panel_they_belong_to() {
    for kind in [FigureKind::ApartVsLoad, FigureKind::ApartVsSpeed] {
        let figure = small().make(kind, &context()).unwrap().figure.unwrap();
        for panel in &figure.panels {
            let published = panel.series.iter().any(|series| series.name == "published");
            assert_eq!(published, panel.title == "ring-planet: time without force", "{}", panel.title);
        }
    }
}

#[test]
fn verdicts_do_not_flatter() {
    let rows: Vec<Comparison> = Plan::reference().unwrap().make(FigureKind::Harmonics, &context()).unwrap().comparisons;
    let verdict = |words: &str| rows.iter().find(|row| row.quantity.contains(words)).unwrap().verdict;
    assert_eq!(verdict("at 1050"), Verdict::Deviates);
    assert_eq!(verdict("bilateral law"), Verdict::Deviates);
    assert_eq!(verdict("1050 to 2000 rev/min: sun"), Verdict::Agrees);
    assert_eq!(verdict("1050 to 2000 rev/min: ring"), Verdict::Partly);
    // What presets were identified from is no test of them.
    let fitted = |kind: FigureKind| -> Vec<bool> {
        let entry = Plan::reference().unwrap().make(kind, &context()).unwrap();
        entry.comparisons.iter().map(|row| row.fitted).collect()
    };
    assert!(fitted(FigureKind::Modes).iter().all(|fitted| *fitted));
    assert_eq!(fitted(FigureKind::Forces).iter().filter(|fitted| **fitted).count(), 5);
    // A few points are no curve: nothing is said about them.
    assert!(small().make(FigureKind::Harmonics, &context()).unwrap().comparisons.is_empty());
    assert!(small().make(FigureKind::ApartVsSpeed, &context()).unwrap().comparisons.is_empty());
    let source = Plan::reference().unwrap().contradictions().unwrap();
    assert!(source.len() >= 11 && source.iter().all(|row| row.verdict == Verdict::Contradiction));
    // Kinematics: 209.23 Hz at 500 rev/min, 412 Hz at 984.6, and planets that do not fit.
    let words: String = source.iter().map(|row| row.found.as_str()).collect();
    for number in ["209.23 Hz", "984.6 rev/min", "295.4 Hz", "43.33", "968.0 N", "2343 Hz", "2140 rev/min"] {
        assert!(words.contains(number), "{number}");
    }
}

#[test]
fn identified_numbers_come_out_again() {
    let entry = Plan::reference().unwrap().make(FigureKind::Identification, &context()).unwrap();
    // The source prints none of these numbers: nothing published is compared.
    assert!(entry.comparisons.is_empty());
    let listing = entry.listing.unwrap();
    for row in listing.rows.iter().filter(|row| row[0].contains("exact-frequencies")) {
        // All five printed digits.
        let [own, found] = [1, 2].map(|i| row[i].parse::<f64>().unwrap());
        close(found / own, 1.0, 5e-5);
    }
    assert!(listing.note.contains("answer not unique"), "{}", listing.note);
}

#[test]
fn kinds_are_those_of_the_classifier() {
    let entry = Plan::reference().unwrap().make(FigureKind::Trajectories, &context()).unwrap();
    let row = |words: &str| entry.comparisons.iter().find(|row| row.quantity.contains(words)).unwrap();
    assert!(
        row("100 rev/min").found.starts_with("periodic, period 1") && row("100 rev/min").verdict == Verdict::Agrees
    );
    // `flank sweep` and `flank lyapunov` say chaotic too, with an exponent of 95 ± 3 1/s.
    assert!(row("300 rev/min").found.starts_with("chaotic") && row("300 rev/min").verdict == Verdict::Deviates);
}

fn flank(folder: &Path, words: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("flank").unwrap().current_dir(folder).args(words).assert()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn the_command_writes_every_form_of_a_figure() {
    let folder = tempfile::tempdir().unwrap();
    let done = flank(folder.path(), &["study", "--only", "modes", "cycles", "--out", "a"]).code(0);
    assert!(text(&done.get_output().stdout).contains("report.html"));
    assert_eq!(text(&done.get_output().stderr), "");
    let out = folder.path().join("a");
    for id in ["modes", "cycles"] {
        for kind in ["csv", "json", "svg", "png"] {
            assert!(
                fs::metadata(out.join("figures").join(format!("{id}.{kind}"))).unwrap().len() > 1000,
                "{id}.{kind}"
            );
        }
    }
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.len() < 8_000_000 && page.contains("id=\"cycles\"") && page.contains("431.4 Hz"));
    let summary: Value = serde_json::from_str(&fs::read_to_string(out.join("study.json")).unwrap()).unwrap();
    assert_eq!(summary["figures"][0]["id"], "modes");
    assert_eq!(summary["figures"][0]["table"]["rows"][0][1], "431.39");
    assert!(summary["comparisons"].as_array().unwrap().len() > 5);
    // A folder in use is not written into.
    let refused = flank(folder.path(), &["study", "--only", "modes", "--out", "a"]).code(2);
    assert!(text(&refused.get_output().stderr).contains("--force"));
}

#[test]
fn a_scene_of_ones_own_is_studied_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let pair = format!("{}/examples/scenes/spur-pair.json", env!("CARGO_MANIFEST_DIR"));
    let words = ["study", &pair, "--loads", "0:20:3", "--speeds", "500,1000,1500", "--out", "pair"];
    let done = flank(folder.path(), &words).code(0);
    let said = text(&done.get_output().stdout);
    assert!(!said.contains("not made"), "{said}");
    let made = folder.path().join("pair/figures");
    for id in [
        "forces",
        "waterfall",
        "harmonics-vs-speed",
        "cycles",
        "apart-vs-load",
        "apart-vs-speed",
        "history",
        "trajectories",
        "modes",
    ] {
        assert!(made.join(format!("{id}.svg")).exists(), "{id}");
    }
    // Without a word of the reference set.
    let page = fs::read_to_string(folder.path().join("pair/report.html")).unwrap();
    let body = page.split("<script>").next().unwrap().to_lowercase();
    for word in ["sun", "planet", "carrier", "the ring", "source", "published", "reference"] {
        assert!(!body.contains(word), "{word}");
    }
    // Asked for by name, what cannot be had is an error.
    let box_of_gears = format!("{}/examples/scenes/three-shaft-box.json", env!("CARGO_MANIFEST_DIR"));
    let refused = flank(folder.path(), &["study", &box_of_gears, "--only", "trajectories", "--out", "none"]).code(2);
    assert!(text(&refused.get_output().stderr).contains("its gears"));
    assert_eq!(fs::read_dir(folder.path().join("none")).unwrap().count(), 0);
    // Dimensionless trains have no units.
    let pair = format!("{}/examples/scenes/kahraman-singh.json", env!("CARGO_MANIFEST_DIR"));
    flank(folder.path(), &["study", &pair, "--only", "forces", "cycles", "--out", "plain", "--quiet"]).code(0);
    let figure = fs::read_to_string(folder.path().join("plain/figures/cycles.json")).unwrap();
    assert!(!figure.contains("ms") && !figure.contains("rev/min") && !figure.contains("\"N\""));
}

/// A study of one's own: a scene beside it, a claim, loads of another number, and faults in words.
#[test]
fn a_study_file_holds_scenes_plots_and_claims() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let pair = fs::read_to_string(format!("{}/examples/scenes/spur-pair.json", env!("CARGO_MANIFEST_DIR"))).unwrap();
    write("pair.json", &pair);
    let study = r#"{
        "flank_study": 1, "title": "My paper", "scenes": { "pair": "pair.json" },
        "sections": [{ "title": "Forces", "plots": [{ "plot": "forces", "scene": "pair", "highest_hz": 9000 }] }],
        "claims": { "figures": { "forces": { "claims": [
            { "place": "3a", "quantity": "mean force", "expected": 284, "value": "mesh.mean", "unit": "N" },
            { "place": "3b", "quantity": "mean force", "expected": 400, "value": "mesh.mean", "unit": "N" }
        ] } } }
    }"#;
    write("study.json", study);
    let done = flank(folder.path(), &["study", "study.json", "--out", "mine"]).code(0);
    let said = text(&done.get_output().stdout);
    assert!(said.contains("My paper") && said.contains("1 agree (0 of them were fitted to)"), "{said}");
    assert!(said.contains("1 deviate"), "{said}");
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("mine/study.json")).unwrap()).unwrap();
    assert_eq!(summary["comparisons"][1]["verdict"], "deviates");
    for (wrong, words) in [
        (study.replace("\"scene\": \"pair\"", "\"scene\": \"none\""), "no scene \"none\"; it has pair"),
        (study.replace("\"plot\": \"forces\"", "\"plot\": \"force\""), "unknown variant `force`"),
        (study.replace("pair.json", "other.json"), "other.json"),
        (study.replace("\"flank_study\": 1", "\"flank_study\": 2"), "this version reads 1"),
        (study.replace("highest_hz", "highest"), "unknown field `highest`"),
    ] {
        write("wrong.json", &wrong);
        let refused = flank(folder.path(), &["study", "wrong.json", "--out", "none"]).code(2);
        let said = text(&refused.get_output().stderr);
        assert!(said.contains(words), "{words} in {said}");
    }
    assert!(!folder.path().join("none").exists());
    // Another number as load.
    let loads = "/train/mesh/total_backlash_m=5e-5:2e-4:2";
    let words = ["study", "pair.json", "--only", "apart-vs-load", "--loads", loads, "--out", "other"];
    flank(folder.path(), &words).code(0);
    let figure = fs::read_to_string(folder.path().join("other/figures/apart-vs-load.json")).unwrap();
    assert!(figure.contains("\"label\":\"mesh, total backlash\",\"unit\":\"m\""), "{}", &figure[..400]);
}

/// All files of a study, the manifest among them.
fn files(out: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let names = |folder: &Path| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let mut paths = [names(out), names(&out.join("figures"))].concat();
    paths.sort();
    let all = paths.into_iter().filter(|path| path.is_file());
    all.map(|path| (path.strip_prefix(out).unwrap().to_owned(), fs::read(&path).unwrap())).collect()
}

#[test]
fn one_thread_or_four_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let few = ["study", "-q", "--loads", "0:40:5", "--speeds", "500:1500:3"];
    let only =
        ["--only", "modes", "forces", "waterfall", "harmonics-vs-speed", "cycles", "apart-vs-load", "apart-vs-speed"];
    let all = ["1", "2", "4"].map(|threads| {
        flank(folder.path(), &[&few[..], &only, &["--threads", threads, "--out", threads]].concat()).code(0);
        files(&folder.path().join(threads))
    });
    assert_eq!(all[0].len(), 7 * 4 + 5);
    assert!(all.iter().all(|files| *files == all[0]));
}

/// Ctrl-C keeps the figures that are complete, whole, and writes no page.
#[cfg(unix)]
#[test]
fn an_interrupt_keeps_complete_figures() {
    let folder = tempfile::tempdir().unwrap();
    let mut study = std::process::Command::new(env!("CARGO_BIN_EXE_flank"));
    let mut child = study.current_dir(&folder).args(["study", "-q"]).stdout(Stdio::piped()).spawn().unwrap();
    let out = folder.path().join("study");
    while !out.join("figures/modes.png").exists() {
        assert_eq!(child.try_wait().unwrap(), None, "the study ended by itself");
        sleep(Duration::from_millis(10));
    }
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let done = child.wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(75));
    let said = text(&done.stdout);
    assert!(said.starts_with("interrupted: ") && said.contains(" figures are kept in study/figures"), "{said}");
    let manifest: Value = serde_json::from_str(&fs::read_to_string(out.join("flank-manifest.json")).unwrap()).unwrap();
    let listed = manifest["files"].as_array().unwrap();
    // The manifest is no file of its own list.
    assert_eq!(files(&out).len(), listed.len() + 1, "{listed:?}");
    assert!(!out.join("report.html").exists() && !out.join("study.json").exists());
}

#[test]
fn bad_arguments_are_told_all_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let refused = flank(folder.path(), &["study", "--loads", "0:x:3", "--speeds", "1:2:0", "--out", "a"]).code(2);
    let said = text(&refused.get_output().stderr);
    assert!(said.contains("loads") && said.contains("speeds"), "{said}");
    let refused = flank(folder.path(), &["study", "--only", "everything"]).code(2);
    assert!(text(&refused.get_output().stderr).contains("apart-vs-load"));
    assert!(!folder.path().join("a").exists());
}
