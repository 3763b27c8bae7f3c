//! Advice on a scene: what simpler models are, what they change, and who takes part in a motion.
//!
//! Expected values are derived beside each test. Motions are settled to 1e-12 (relative) where two models are compared, so
//! that their measures agree to a few times that.

#![cfg(feature = "cli")]

use std::{collections::BTreeMap, fs, path::Path};

use assert_cmd::Command;
use flank::{
    Task,
    orbit::Approach,
    scene::Scene,
    study::{
        Context,
        advise::{Advice, AdvisePlan, Rung, Verdict},
        steady::Rule,
    },
};
use serde_json::{Value, json};

fn advice(scene: &Scene, rule: Rule) -> Advice {
    let context = Context { rule, task: Task::default() };
    AdvisePlan::new(scene).unwrap().advice(&context, 0.01).unwrap()
}

/// Settled as far as doubles go.
fn exact() -> Rule {
    let approach = Approach { tolerance: 1e-12, ..Approach::default() };
    Rule { approach, irregular_cycles: 20, ..Rule::default() }
}

fn scene(train: Value, initial: Value) -> Scene {
    let whole = json!({ "flank": 1, "train": train, "initial": initial, "run": { "cycles": 10 } });
    Scene::from_value(whole, "test").unwrap()
}

fn rung<'a>(advice: &'a Advice, words: &str) -> &'a Rung {
    let found = advice.rungs.iter().find(|rung| rung.words == words);
    found.unwrap_or_else(|| panic!("no rung {words}: {:?}", advice.left))
}

#[track_caller]
fn close(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance, "{found:e} is not {wanted:e} to {tolerance:e}");
}

/// Two masses on one contact of stiffness 2, the first held by a spring of 3; a third mass beside them, held by 5, that
/// nothing touches.
fn masses() -> Scene {
    let contact = json!({
        "name": "mesh", "direction": [1, -1, 0], "half_backlash_m": 0, "flanks": "drive",
        "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.1 }, "stiffness": 2,
        "error": [{ "amplitude_m": 0.4, "frequency_rad_per_s": 2 }, { "amplitude_m": 0.1, "frequency_rad_per_s": 4 }]
    });
    let train = json!({
        "kind": "matrices", "freedoms": ["a", "b", "beside"], "mass_kg": [1, 2, 4],
        "stiffness_n_per_m": [3, 0.5, 5], "damping_n_s_per_m": [0.3, 0.2, 0.1], "load_n": [0.3, -0.2, 0],
        "contacts": [contact]
    });
    scene(train, json!("rest"))
}

fn gear_pair(freedoms: &str) -> Scene {
    let gear = |inertia: f64| {
        json!({
            "teeth": 50, "mass_kg": 2.8, "inertia_kg_m2": inertia,
            "translation": { "stiffness_n_per_m": 1e8, "damping_ratio": 0.03 }
        })
    };
    let train = json!({
        "kind": "gear-pair", "freedoms": freedoms,
        "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
        "driving": gear(0.008), "driven": gear(0.012),
        "mesh": {
            "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "total_backlash_m": 1e-4, "stiffness": 3.8e8,
            "error": [{ "order": 1, "amplitude_m": 3e-6 }]
        },
        "speed_rpm": 3000, "torque_nm": 60
    });
    scene(train, json!("static"))
}

#[test]
fn shares_and_weights_sum_to_one() {
    let advice = advice(&Scene::reference().unwrap(), Rule { irregular_cycles: 20, ..Rule::default() });
    assert_eq!(advice.families, ["sun-planet", "ring-planet"]);
    assert_eq!(advice.modes.len(), 16);
    for family in 0..2 {
        close(advice.modes.iter().map(|mode| mode.meshes[family]).sum(), 1.0, 1e-12);
    }
    close(advice.modes.iter().map(|mode| mode.motion.unwrap()).sum(), 1.0, 1e-12);
    close(advice.parts.iter().map(|part| part.share.unwrap()).sum(), 1.0, 1e-12);
    for mode in &advice.modes {
        close(mode.groups.iter().sum(), 1.0, 1e-12);
        assert!((0.0..1.0 + 1e-12).contains(&mode.strain_of_contacts.unwrap()));
    }

    // In-phase motion is a motion of the whole stage: the centres of sun and ring take no part.
    let in_phase = rung(&advice, "planets in phase");
    assert_eq!((in_phase.verdict, in_phase.motion.freedoms), (Verdict::Enough, 6));
    assert_eq!(in_phase.set, BTreeMap::from([("/train/freedoms".to_owned(), json!("in-phase"))]));
    for part in advice.parts.iter().filter(|part| part.group.words.ends_with("centre")) {
        assert!(part.share.unwrap() < 1e-18, "{}", part.group.words);
        let dropped = part.dropped.as_ref().unwrap();
        assert_eq!(dropped.verdict, Verdict::Enough);
        close(dropped.apart_change(), 0.0, 1e-9);
    }
    // Known from the study of this stage: its carrier and its rotations do.
    for words in ["sun rotation", "planets rotation", "carrier rotation"] {
        let part = advice.parts.iter().find(|part| part.group.words == words).unwrap();
        assert_eq!(part.dropped.as_ref().unwrap().verdict, Verdict::NotEnough, "{words}");
    }
    assert_eq!(advice.least().unwrap().words, "planets in phase");
}

#[test]
fn the_in_phase_reduction_equals_all_freedoms() {
    let scene = Scene::reference().unwrap();
    let advice = advice(&scene, exact());
    let rung = rung(&advice, "planets in phase");
    for change in &rung.changes {
        close(change.apart.value, 0.0, 1e-12);
        close(change.peak.unwrap().value, 0.0, 1e-11);
    }
    // In its own words a scene gets the same reduced freedoms.
    let own = scene.with("/train/freedoms", json!("in-phase")).unwrap().build().unwrap().spec;
    assert_eq!(*rung.spec(), own);
}

#[test]
fn a_free_pair_is_its_deflection() {
    let scene = gear_pair("torsional");
    let advice = advice(&scene, exact());
    let whole = &advice.full;
    assert!(whole.motion.apart().value > 0.1, "{:?}", whole.motion);
    let pair = rung(&advice, "one freedom, the deflection");
    let spec = pair.spec();
    // m = m₁ m₂/(m₁ + m₂) with I/r².
    let masses = whole.spec().mass.diagonal();
    close(spec.mass[(0, 0)], masses[0] * masses[1] / (masses[0] + masses[1]), 1e-14);
    // F = T/r, on both gears.
    close(spec.load[0], whole.spec().load[0], 1e-9 * spec.load[0]);
    assert_eq!((spec.stiffness[(0, 0)], spec.damping[(0, 0)]), (0.0, 0.0));
    assert_eq!((pair.motion.freedoms, pair.verdict), (1, Verdict::Enough));
    close(pair.apart_change(), 0.0, 1e-12);
    close(pair.peak_change().unwrap(), 0.0, 1e-11);
}

#[test]
fn translations_are_dropped_before_rotations() {
    let plan = advice(&gear_pair("torsional-translational"), Rule { irregular_cycles: 20, ..Rule::default() });
    let freedoms: Vec<usize> = plan.rungs.iter().take(2).map(|rung| rung.motion.freedoms).collect();
    assert_eq!(freedoms, [2, 1]);
    let words: Vec<&str> = plan.parts.iter().map(|part| part.group.words.as_str()).collect();
    assert_eq!(words, ["body 1 centre", "body 1 rotation", "body 2 centre", "body 2 rotation"]);
}

#[test]
fn a_law_that_nothing_presses_on_has_no_tangent() {
    let scene = Scene::reference().unwrap().with("/train/load", json!({ "output_torque_nm": -400 })).unwrap();
    let plan = AdvisePlan::new(&scene).unwrap();
    // Not run: the plan says it before.
    let text = format!("{plan:?}");
    assert!(text.contains("linear law") && !text.contains("Linear("), "{text}");
}

#[test]
fn a_freedom_that_nothing_touches_can_be_dropped() {
    let advice = advice(&masses(), exact());
    let part = advice.parts.iter().find(|part| part.group.words == "beside").unwrap();
    let dropped = part.dropped.as_ref().unwrap();
    // Newton's method gives it rounding of rounding.
    assert!(part.share.unwrap() <= f64::EPSILON.powi(2));
    assert_eq!(dropped.verdict, Verdict::Enough);
    close(dropped.apart_change(), 0.0, 1e-12);
    close(dropped.peak_change().unwrap(), 0.0, 1e-11);
    assert!(advice.full.motion.apart().value > 0.0);
    for words in ["a", "b"] {
        let part = advice.parts.iter().find(|part| part.group.words == words).unwrap();
        assert!(part.share.unwrap() > 0.01, "{part:?}");
        assert_eq!(part.dropped.as_ref().unwrap().verdict, Verdict::NotEnough);
    }
    // Two harmonics: the second is dropped, the first is all that moves the train.
    assert_eq!(rung(&advice, "excitation up to order 1").spec().contacts[0].error.len(), 1);
    assert!(advice.left.iter().any(|left| left.words == "no excitation of order 1"));
}

#[test]
fn planets_out_of_phase_are_not_reduced() {
    let scene = Scene::reference().unwrap().with("/train/phases", json!("teeth")).unwrap();
    let text = format!("{:?}", AdvisePlan::new(&scene).unwrap());
    assert!(text.contains("the in-phase reduction needs alike planets") && text.contains("rotations only"), "{text}");
}

fn flank(folder: &Path, words: &[&str]) -> Command {
    let mut command = Command::cargo_bin("flank").unwrap();
    command.current_dir(folder).args(words);
    command
}

const PAIR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/kahraman-singh.json");

#[test]
fn a_scene_that_has_not_settled_is_called_so() {
    let folder = tempfile::tempdir().unwrap();
    // Without damping its free motion, at half the forcing frequency, never dies.
    let pair = json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": 0, "damping_in_gap": true, "stiffness": 1, "mean_load": 1,
            "transmission_error": [{ "amplitude": 0.05, "frequency": 2 }]
        },
        "initial": { "q": [2.3] }, "run": { "cycles": 10 }
    });
    fs::write(folder.path().join("pair.json"), pair.to_string()).unwrap();
    let done = flank(folder.path(), &["advise", "pair.json"]).assert().code(0);
    let text = String::from_utf8(done.get_output().stdout.clone()).unwrap();
    assert!(text.contains("The scene has not settled in 400 cycles"), "{text}");
    assert!(!text.contains("models no more than it needs"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            let inner = files(&entry.path());
            found.extend(inner.into_iter().map(|(own, bytes)| (format!("{name}/{own}"), bytes)));
        } else {
            found.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    found
}

#[test]
fn the_same_bytes_come_out_but_for_the_time() {
    let folder = tempfile::tempdir().unwrap();
    for (out, threads) in [("one", "1"), ("two", "2")] {
        flank(folder.path(), &["advise", PAIR, "--out", out]).env("RAYON_NUM_THREADS", threads).assert().code(0);
    }
    let [mut one, mut two] = ["one", "two"].map(|out| files(&folder.path().join(out)));
    let timing: Value = serde_json::from_slice(&one.remove("timing.json").unwrap()).unwrap();
    assert!(two.remove("timing.json").is_some());
    assert!(timing["models"][0]["cycle_s"].as_f64().unwrap() > 0.0);
    let names: Vec<&str> = one.keys().map(String::as_str).collect();
    let figures = ["freedoms", "rungs"]
        .iter()
        .flat_map(|id| ["csv", "json", "png", "svg"].map(|kind| format!("figures/{id}.{kind}")));
    let wanted: Vec<String> = ["advise.csv", "advise.json"].map(String::from).into_iter().chain(figures).collect();
    assert!(wanted.iter().all(|name| names.contains(&name.as_str())), "{names:?}");
    assert_eq!(one, two);
    let advise: Value = serde_json::from_slice(&one["advise.json"]).unwrap();
    assert_eq!(advise["advice"]["rungs"][0]["words"], "no damping in the gap");
    // Nothing over a folder in use, unless asked to.
    flank(folder.path(), &["advise", PAIR, "--out", "one"]).assert().code(2);
    flank(folder.path(), &["advise", PAIR, "--out", "one", "--force", "--quiet"]).assert().code(0).stdout("");
}

#[test]
fn what_cannot_be_advised_on_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let ball = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/ball-on-wall.json");
    let no_scene = folder.path().join("none.json");
    fs::write(&no_scene, r#"{ "flank": 1, "train": { "kind": "chain" }, "run": { "cycles": 1 } }"#).unwrap();
    for (words, said) in [
        (vec!["advise", ball, "--out", "out"], "its forcing has no"),
        (vec!["advise", "missing.json", "--out", "out"], "missing.json"),
        (vec!["advise", "none.json", "--out", "out"], "/train/kind"),
        (vec!["advise", PAIR, "--tolerance", "0"], "above 0 and below 1"),
        (vec!["advise", PAIR, "--tolerance", "-1"], "above 0 and below 1"),
        (vec!["advise", PAIR, "--tolerance", "much"], "above 0 and below 1"),
    ] {
        let done = flank(folder.path(), &words).assert().code(2);
        let text = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "{words:?}: {text}");
        assert!(!folder.path().join("out").exists(), "{words:?}");
    }
}
