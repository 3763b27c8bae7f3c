//! The reference study: its figures, and the numbers they rest on.
//!
//! Expected values: an independent prototype (fixed-step Runge–Kutta, checked by halving its step) and a frequency-domain
//! solution of the same equations; tolerances are those stated for them.

#![cfg(feature = "cli")]
#![allow(clippy::unwrap_used)] // a test may panic

use std::{fs, path::Path};

use assert_cmd::Command;
use flank::{
    Task,
    plot::Figure,
    study::{
        Kind,
        changes::{changes, effects},
        claims::{Comparison, Verdict},
        figures::{self, Context, Way},
        plan::Plan,
        published,
        steady::Rule,
        threshold::{Search, Threshold, locate},
    },
};
use serde_json::Value;

fn context() -> Context<'static> {
    Context { rule: Rule::default(), task: Task::default() }
}

/// The reference study on a few speeds and loads.
fn small() -> Plan {
    let plan = Plan::reference().unwrap();
    Plan {
        loads: vec![0.0, 10.0, 20.0, 22.0, 40.0],
        speeds: vec![50.0, 500.0, 2000.0],
        threshold_speeds: vec![500.0],
        heavy_speeds: vec![500.0, 1050.0, 2000.0, 3000.0],
        path_speeds: vec![100.0],
        history_speed: 500.0,
        ..plan
    }
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
        assert!(!panel.series.is_empty(), "{}: {}", figure.id, panel.title);
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
    for kind in Kind::ALL.into_iter().filter(|kind| *kind != Kind::Changes) {
        let entry = plan.make(kind, &context()).unwrap_or_else(|error| panic!("{}: {error}", kind.id()));
        if let Some(figure) = &entry.figure {
            assert_eq!(figure.id, kind.id());
            check(figure);
        }
        assert_eq!(entry.figure.is_none(), kind.is_of_reference());
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
    let entry = Plan::reference().unwrap().make(Kind::Values, &context()).unwrap();
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
fn the_threshold_is_located_in_the_load() {
    let plan = Plan::reference().unwrap();
    let search = Search { range: [0.0, 40.0], scan: 9, resolution: 0.01 };
    let found = locate(&context(), &plan.light, "/train/load/output_torque_nm", "ring", &search).unwrap();
    let Threshold::Located { below, above, clearance_below, clearance_above } = found else { panic!("{found:?}") };
    // Separations vanish between 20.5 and 20.8 N m, whichever way the search goes.
    assert!(20.5 <= below && above <= 20.8 && above - below <= 0.01, "{found:?}");
    // They do not shrink to nothing: the motion that separates ends.
    assert!(clearance_below < -1e-7 && clearance_above >= 0.0, "{found:?}");
    // Nothing to locate where everything separates, or nothing does.
    let at =
        |range| locate(&context(), &plan.light, "/train/load/output_torque_nm", "ring", &Search { range, ..search });
    assert_eq!(at([0.0, 10.0]).unwrap(), Threshold::Beyond { value: 10.0 });
    assert_eq!(at([30.0, 40.0]).unwrap(), Threshold::None);
}

#[test]
fn published_points_lie_in_the_panel_they_belong_to() {
    for kind in [Kind::ApartVsLoad, Kind::ApartVsSpeed] {
        let figure = small().make(kind, &context()).unwrap().figure.unwrap();
        for panel in &figure.panels {
            let published = panel.series.iter().any(|series| series.name == "published");
            assert_eq!(published, panel.title == "ring-planet: time without force", "{}", panel.title);
        }
    }
}

#[test]
fn modes_of_the_reference_set() {
    let plan = Plan::reference().unwrap();
    let full = plan.heavy.with("/train/freedoms", Value::from("full")).unwrap();
    let (figure, rows) = figures::modes(&full, 3000.0).unwrap();
    check(&figure);
    for (name, hertz) in [
        ("T1", 431.39),
        ("R1", 434.01),
        ("R2", 869.05),
        ("T2", 882.63),
        ("R3", 1060.39),
        ("T3", 1785.12),
        ("R4", 2974.95),
        ("R5", 4460.28),
        ("R6", 5504.81),
        ("T4", 4123.48),
        ("T5", 4215.57),
    ] {
        let row = rows.iter().find(|row| row.name() == name).unwrap();
        close(row.hertz, hertz, 0.05);
        close(row.shares.iter().map(|(_, share)| share).sum(), 1.0, 1e-12);
    }
    assert_eq!(rows.len(), 11);
    assert_eq!(figure.panels.len(), 7);
}

#[test]
fn paths_at_a_hundred_revolutions() {
    let plan = Plan::reference().unwrap();
    let (figure, found) = figures::trajectories(&context(), &plan.floating, ("/train/speed_rpm", &[100.0])).unwrap();
    check(&figure);
    let [sun, ring] = &found[..] else { panic!("two centres") };
    assert_eq!((sun.period, sun.leaves), (Some(1), Some(288)));
    // Printed to 0.1 µm and 0.001 µm.
    close(1e6 * sun.range, 4.7, 0.05);
    close(1e6 * ring.range, 0.010, 0.0005);
    assert!(sun.residual < 1e-6 && sun.off_harmonics < 1e-6, "{sun:?}");
    assert!(figure.panels.iter().all(|panel| panel.equal_scales));
}

#[test]
fn cycles_at_rest_and_under_load() {
    let plan = Plan::reference().unwrap();
    let (figure, found) = figures::cycles(&context(), &plan.light, &[0.0, 21.0]).unwrap();
    check(&figure);
    assert_eq!((found[0].peaks, found[1].peaks), (2, 2));
    for (h, wanted) in [18.4, 37.5, 10.3].into_iter().enumerate() {
        close(found[0].harmonics[h], wanted, 0.06);
    }
    close(found[0].apart, 0.2541, 0.002);
    assert_eq!(found[0].together, 0.0);
    // Two events a period, at exact times: marks and the ends of bands are the same numbers.
    let upper = &figure.panels[0];
    assert_eq!(upper.bands.len(), 3);
    let marks = upper.series.iter().find(|series| series.name.starts_with("events")).unwrap();
    let ends: Vec<f64> = upper.bands.iter().flat_map(|band| band.x).collect();
    assert_eq!(marks.x, ends);
    // Both meshes of a planet apart at once: at slow speeds only.
    let slow = plan.light.with("/train/speed_rpm", Value::from(50.0)).unwrap();
    close(figures::cycles(&context(), &slow, &[0.0]).unwrap().1[0].together, 0.243, 0.002);
}

#[test]
fn a_motion_followed_down_keeps_its_branch() {
    let plan = Plan::reference().unwrap();
    let loads: Vec<f64> = (0..8).map(|i| 16.0 + f64::from(i)).collect();
    let x = flank::plot::Axis::new("load", "N m");
    let pointer = ("/train/load/output_torque_nm", &loads[..]);
    let (_, curves) = figures::apart(&context(), &plan.light, "by-load", x, pointer).unwrap();
    let apart = |way: Way| {
        let curve = curves.iter().find(|curve| curve.way == way).unwrap();
        curve.measure("ring", |c| c.report.apart_fraction)
    };
    // From above, contact is kept well below the load at which it is first reached from below.
    let (up, down) = (apart(Way::Up), apart(Way::Down));
    let last = |values: &[f64]| values.iter().rposition(|v| *v > 0.0);
    assert!(last(&down) < last(&up), "{up:?} {down:?}");
}

/// One change at a time, against the prototype's table, printed to 0.001 (0.01 without drag) and 1 N. Its thresholds are no
/// numbers to hold others to: which impact of a cold start is the last one hangs on its step.
#[test]
fn changes_do_what_they_did_in_the_prototype() {
    let plan = Plan::reference().unwrap();
    // Apart at 50 and 500 rev/min, largest force N.
    let table = [
        ("base", 0.349, 0.253, 120.0),
        ("errors x 0.75", 0.328, 0.200, 87.0),
        ("errors x 1.25", 0.362, 0.284, 151.0),
        ("second harmonics x 0.75", 0.361, 0.218, 94.0),
        ("second harmonics x 1.25", 0.340, 0.276, 144.0),
        ("no second harmonics", 0.408, 0.0, 48.0),
        ("errors of the sun meshes x 0.75", 0.340, 0.230, 106.0),
        ("errors of the sun meshes x 1.25", 0.355, 0.273, 134.0),
        ("drag per speed x 0.75", 0.359, 0.286, 114.0),
        ("drag per speed x 1.25", 0.340, 0.223, 122.0),
        ("no drag per speed", 0.389, 0.78, 68.0),
        ("no drag", 0.416, 0.79, 65.0),
        ("restitution 0.3", 0.348, 0.251, 115.0),
        ("restitution 0.95", 0.351, 0.258, 130.0),
        ("sun shaft 1.8e7 N/m", 0.334, 0.190, 98.0),
        ("sun shaft 3e7 N/m", 0.358, 0.286, 133.0),
        ("carrier shaft 2.5e8 N/m", 0.335, 0.143, 84.0),
        ("carrier shaft 1e9 N/m", 0.356, 0.379, 112.0),
        ("sun shaft damping x 0.75", 0.350, 0.242, 113.0),
        ("sun shaft damping x 1.25", 0.349, 0.264, 127.0),
    ];
    let all = changes(&plan.light).unwrap();
    assert_eq!(all.len(), table.len() + 2);
    // Two loads, no bisection: thresholds are not asked for.
    let search = Search { range: [0.0, 60.0], scan: 2, resolution: 60.0 };
    let found = effects(&context(), &plan.light, "ring", &all, &search).unwrap();
    let effect = |words: &str| found.iter().find(|effect| effect.words == words).unwrap();
    for (words, slow, middle, force) in table {
        // The tolerance of all fractions of this set.
        close(effect(words).apart[0], slow, 0.002);
        close(effect(words).apart[1], middle, 0.002);
        close(effect(words).largest, force, 1.0);
    }
    // Damping of the supports: ±0.001 in the fractions, ±1 N.
    for words in ["support damping x 0.75", "support damping x 1.25"] {
        close(effect(words).apart[0], effect("base").apart[0], 0.001);
        close(effect(words).apart[1], effect("base").apart[1], 0.0015);
        close(effect(words).largest, effect("base").largest, 1.0);
    }
}

#[test]
fn verdicts_do_not_flatter() {
    let rows: Vec<Comparison> = Plan::reference().unwrap().make(Kind::Harmonics, &context()).unwrap().comparisons;
    let verdict = |words: &str| rows.iter().find(|row| row.quantity.contains(words)).unwrap().verdict;
    assert_eq!(verdict("at 1050"), Verdict::Deviates);
    assert_eq!(verdict("bilateral law"), Verdict::Deviates);
    assert_eq!(verdict("1050 to 2000 rev/min: sun"), Verdict::Agrees);
    assert_eq!(verdict("1050 to 2000 rev/min: ring"), Verdict::Partly);
    // What presets were identified from is no test of them.
    let fitted = |kind: Kind| -> Vec<bool> {
        let entry = Plan::reference().unwrap().make(kind, &context()).unwrap();
        entry.comparisons.iter().map(|row| row.fitted).collect()
    };
    assert!(fitted(Kind::Modes).iter().all(|fitted| *fitted));
    assert_eq!(fitted(Kind::Forces).iter().filter(|fitted| **fitted).count(), 5);
    // A few points are no curve: nothing is said about them.
    assert!(small().make(Kind::Harmonics, &context()).unwrap().comparisons.is_empty());
    assert!(small().make(Kind::ApartVsSpeed, &context()).unwrap().comparisons.is_empty());
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
    let rows = published::identified().unwrap();
    for row in rows.iter().filter(|row| row.quantity.contains("exact-frequencies")) {
        // All five printed digits.
        let number = |text: &str| text.trim_end_matches(" N/m").parse::<f64>().unwrap();
        close(number(&row.found) / number(&row.published), 1.0, 5e-5);
    }
    let all = rows.last().unwrap();
    assert!(all.found.starts_with("not unique"), "{}", all.found);
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
    let done = flank(folder.path(), &["study", "--only", "modes", "cycles", "--out", "a", "--threads", "1"]).code(0);
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
    // The same bytes from two threads; a folder in use is not written into.
    flank(folder.path(), &["study", "--only", "modes", "cycles", "--out", "b", "--threads", "2", "--quiet"]).code(0);
    for name in
        ["report.html", "study.json", "table.csv", "figures/cycles.csv", "figures/cycles.png", "figures/modes.svg"]
    {
        assert_eq!(fs::read(out.join(name)).unwrap(), fs::read(folder.path().join("b").join(name)).unwrap(), "{name}");
    }
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
    assert!(said.contains("not made: modes") && said.contains("not made: trajectories"), "{said}");
    let made = folder.path().join("pair/figures");
    for id in ["forces", "waterfall", "harmonics-vs-speed", "cycles", "apart-vs-load", "apart-vs-speed", "history"] {
        assert!(made.join(format!("{id}.svg")).exists(), "{id}");
    }
    assert!(!made.join("modes.svg").exists());
    assert!(!fs::read_to_string(folder.path().join("pair/report.html")).unwrap().contains("Published, Flank"));
    // Asked for by name, what cannot be had is an error.
    let refused = flank(folder.path(), &["study", &pair, "--only", "trajectories", "--out", "none"]).code(2);
    assert!(text(&refused.get_output().stderr).contains("carrier"));
    assert_eq!(fs::read_dir(folder.path().join("none")).unwrap().count(), 0);
    // Dimensionless trains have no units.
    let pair = format!("{}/examples/scenes/kahraman-singh.json", env!("CARGO_MANIFEST_DIR"));
    flank(folder.path(), &["study", &pair, "--only", "forces", "cycles", "--out", "plain", "--quiet"]).code(0);
    let figure = fs::read_to_string(folder.path().join("plain/figures/cycles.json")).unwrap();
    assert!(!figure.contains("ms") && !figure.contains("rev/min") && !figure.contains("\"N\""));
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
