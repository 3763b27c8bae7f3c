//! `flank fit`: numbers that were hidden are found again, the same trials come from the same seed, and a search goes on where it ended.

use flank::{
    Task,
    study::{
        StudyError,
        fit::{Fit, FitResult, Trial},
        plan::Plan,
    },
};
use serde_json::{Value, json};

/// A pair in contact, with these amplitudes of two harmonics of its error.
fn pair(first: f64, second: f64) -> Value {
    json!({
        "flank": 1, "name": "pair",
        "train": {
            "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
            "driving": { "teeth": 30, "mass_kg": 1.5, "inertia_kg_m2": 0.0018 },
            "driven": { "teeth": 45, "mass_kg": 3.4, "inertia_kg_m2": 0.0085 },
            "mesh": { "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "total_backlash_m": 1e-4, "stiffness": 3e8,
                      "error": [{ "order": 1, "amplitude_m": first }, { "order": 2, "amplitude_m": second }] },
            "speed_rpm": 3000, "torque_nm": 60
        },
        "initial": "static", "run": { "cycles": 10 }
    })
}

fn study(scene: &Value, claims: Value) -> Plan {
    let numbers = json!([
        { "name": "first", "pointers": ["/train/mesh/error/0/amplitude_m"], "between": [1e-7, 1e-5], "plausible": [2e-7, 5e-6] },
        { "name": "second", "pointers": ["/train/mesh/error/1/amplitude_m"], "between": [1e-8, 1e-6], "source": "usual" }
    ]);
    let study = json!({
        "flank_study": 1, "title": "fit", "scenes": { "scene": scene },
        "sections": [{ "title": "Forces", "plots": [{ "plot": "forces" }] }],
        "claims": { "figures": { "forces": { "claims": claims } } },
        "fit": { "numbers": numbers }
    });
    Plan::read(&study.to_string(), &|name| Err(name.to_owned())).unwrap()
}

/// Two harmonics of the force, and statements of which two exclude each other.
fn claims(first: f64, second: f64) -> Value {
    json!([
        { "place": "1", "quantity": "first harmonic", "expected": first, "value": "mesh.harmonics[0]", "unit": "N" },
        { "place": "2", "quantity": "second harmonic", "expected": second, "value": "mesh.harmonics[1]", "unit": "N" },
        { "place": "3", "quantity": "contact", "published": "never lost", "found": "{mesh.smallest:.1}", "agrees": "mesh.smallest > 0" },
        { "place": "4", "quantity": "contact", "published": "lost", "found": "{mesh.smallest:.1}", "agrees": "mesh.smallest <= 0" },
        { "place": "5", "quantity": "mean force", "expected": 1, "value": "mesh.mean", "unit": "N", "held_out": true }
    ])
}

fn search(plan: &Plan, count: usize, known: Vec<Trial>) -> (Vec<Trial>, FitResult) {
    let fit = Fit::new(plan, (0, 0.0), 7, 0.25).unwrap();
    let trials = fit.search(count, known, Task::default(), &mut |_| Ok(())).unwrap();
    let found = FitResult::new(&fit, &trials).unwrap();
    (trials, found)
}

#[test]
fn hidden_numbers_are_found_and_exclusions_told() {
    let truth = study(&pair(1.3e-6, 2.1e-7), claims(1.0, 1.0));
    let entry = truth.make(
        flank::study::FigureKind::Forces,
        &flank::study::Context { rule: Default::default(), task: Task::default() },
    );
    let rows = entry.unwrap().comparisons;
    assert_eq!(rows.iter().map(|row| row.fitted).collect::<Vec<_>>(), [true, true, true, true, false]);
    let found: Vec<f64> = rows[..2].iter().map(|row| row.found.split(' ').next().unwrap().parse().unwrap()).collect();
    let plan = study(&pair(3e-6, 1e-7), claims(found[0], found[1]));
    let (trials, result) = search(&plan, 400, Vec::new());
    assert_eq!(trials.len(), 400);
    // The statement that contradicts another one costs one.
    assert!(result.loss < 1.2, "{result:?}");
    let values = result.values();
    assert!((values[0] / 1.3e-6 - 1.0).abs() < 0.02 && (values[1] / 2.1e-7 - 1.0).abs() < 0.02, "{values:?}");
    assert_eq!((result.fitted, result.held_out), ([3, 0, 1, 0], [0, 0, 1, 0]));
    let pairs: Vec<&[String; 2]> = result.never_together.iter().map(|pair| &pair.claims).collect();
    assert!(pairs.iter().all(|pair| pair.iter().any(|claim| claim == "4: contact")), "{pairs:?}");
    assert!(result.numbers[0].as_good[0] <= values[0] && values[0] <= result.numbers[0].as_good[1]);
    assert_eq!(result.figure(&Fit::new(&plan, (0, 0.0), 7, 0.25).unwrap(), &trials).panels.len(), 2);
}

#[test]
fn a_search_is_repeated_and_gone_on_with_to_the_bit() {
    let plan = study(&pair(3e-6, 1e-7), claims(250.0, 50.0));
    let (all, result) = search(&plan, 30, Vec::new());
    assert_eq!(search(&plan, 30, Vec::new()), (all.clone(), result.clone()));
    // What is known is not tried again, and changes nothing.
    assert_eq!(search(&plan, 30, all[..17].to_vec()), (all.clone(), result));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| search(&plan, 30, Vec::new()).0), all);
}

/// All scenes of the published study with one set have the same bodies, errors and drag, and its numbers are plausible.
#[test]
fn one_set_is_one_set() {
    let plan = Plan::one_set().unwrap();
    let trains: Vec<Value> = plan.scenes().map(|(_, scene)| scene.resolved()["train"].clone()).collect();
    assert_eq!(trains.len(), 4);
    for at in
        ["/sun", "/planet", "/ring", "/carrier", "/sun_mesh/error", "/ring_mesh/error", "/load/drag_torque_nm_per_rpm"]
    {
        assert!(trains[0].pointer(at).is_some());
        assert!(trains.iter().all(|train| train.pointer(at) == trains[0].pointer(at)), "{at}");
    }
    let fit = Fit::new(&plan, (0, 0.0), 1, 0.25).unwrap();
    let mut own = Vec::new();
    let file: Value = serde_json::from_str(include_str!("../../src/study/published/one-set.json")).unwrap();
    for number in file["fit"]["numbers"].as_array().unwrap() {
        let pointer = number["pointers"][0].as_str().unwrap();
        let mut values = plan.scenes().filter_map(|(_, scene)| scene.resolved().pointer(pointer)?.as_f64());
        let value = if number["factor"] == true { 1.0 } else { values.next().unwrap() };
        let [low, high] = [0, 1].map(|end| number["plausible"][end].as_f64().unwrap());
        assert!((low..=high).contains(&value), "{number}");
        own.push(value);
    }
    assert_eq!(own.len(), 29);
    assert!(fit.study(&own).is_some());
}

/// A factor keeps the ratio of two harmonics; a trial makes its own plots alone; a statement that is missed says by how much.
#[test]
fn factors_plots_and_misses_count() {
    let both = ["/train/mesh/error/0/amplitude_m", "/train/mesh/error/1/amplitude_m"];
    let study = json!({
        "flank_study": 1, "title": "fit", "scenes": { "scene": pair(3e-6, 1e-7) },
        "sections": [{ "title": "Forces", "plots": [{ "plot": "forces" }, { "plot": "apart-vs-load", "values": "20:60:41" }] }],
        "claims": { "figures": {
            "forces": { "claims": [{
                "place": "1", "quantity": "ratio", "published": "2", "found": "{mesh.harmonics[0]:.1}", "agrees": "mesh.harmonics[0] < 1",
                "off": "mesh.harmonics[0] / 1000"
            }] },
            "apart-vs-load": { "when": "coarse", "claims": [{
                "place": "2", "quantity": "loads", "expected": 2, "value": "len(values) + len(up.mesh.no_force)", "unit": ""
            }] }
        } },
        "fit": {
            "numbers": [{ "name": "errors", "pointers": both, "between": [0.1, 10.0], "factor": true }],
            "plots": [{ "plot": "forces" }, { "plot": "apart-vs-load", "values": "40,60" }]
        }
    });
    let plan = Plan::read(&study.to_string(), &|name| Err(name.to_owned())).unwrap();
    let fit = Fit::new(&plan, (0, 0.0), 1, 0.25).unwrap();
    let trial = |factor: f64| fit.trial(&[factor], Task::default()).unwrap();
    // The contact is never lost, so that forces are linear in the errors: a force F loses F/(F + 100).
    let lost = |factor: f64| trial(factor).loss;
    let force = |factor: f64| 100.0 * lost(factor) / (1.0 - lost(factor));
    assert_eq!(trial(0.2).verdicts, "da");
    assert!((force(0.4) / force(0.2) - 2.0).abs() < 1e-6, "{} {}", force(0.2), force(0.4));
    let scaled = fit.study(&[0.5]).unwrap();
    let amplitudes =
        scaled.scenes().next().map(|(_, scene)| both.map(|at| scene.resolved().pointer(at).unwrap().as_f64().unwrap()));
    assert_eq!(amplitudes, Some([1.5e-6, 5e-8]));
}

#[test]
fn questions_without_an_answer_are_refused() {
    type Change<'c> = &'c dyn Fn(&mut Value);
    let scene = pair(3e-6, 1e-7);
    let refused = |change: Change<'_>| {
        let mut study = json!({
            "flank_study": 1, "title": "fit", "scenes": { "scene": scene },
            "sections": [{ "title": "Forces", "plots": [{ "plot": "forces" }] }],
            "claims": { "figures": { "forces": { "claims": claims(1.0, 1.0) } } },
            "fit": { "numbers": [{ "name": "error", "pointers": ["/train/mesh/error/0/amplitude_m"], "between": [1e-6, 2e-5] }] }
        });
        change(&mut study);
        let plan = Plan::read(&study.to_string(), &|name| Err(name.to_owned()));
        match plan.and_then(|plan| Fit::new(&plan, (0, 0.0), 1, 0.25).map(|_| ())) {
            Err(StudyError::File(words)) => words,
            other => panic!("{other:?}"),
        }
    };
    let cases: [(Change<'_>, &str); 6] = [
        (&|study| drop(study.as_object_mut().unwrap().remove("fit")), "no \"fit\""),
        (&|study| study["fit"]["numbers"] = json!([]), "no numbers"),
        (&|study| study["fit"]["numbers"][0]["between"] = json!([2, 1]), "no range"),
        (
            &|study| study["fit"]["numbers"][0]["pointers"] = json!(["/train/x"]),
            "no scene of the study has a number at /train/x",
        ),
        (&|study| study["claims"] = Value::Null, "nothing to fit to"),
        (&|study| study["fit"]["plots"] = json!([{ "plot": "modes" }]), "has no modes; it has forces"),
    ];
    for (change, words) in cases {
        let found = refused(change);
        assert!(found.contains(words), "{found}");
    }
}

/// A search that is gone on with writes the bytes of one that ran through; its trials belong to its question.
#[cfg(feature = "cli")]
#[test]
fn the_command_goes_on_to_the_same_bytes() {
    use std::{fs, path::Path, process::Command};
    let folder = tempfile::tempdir().unwrap();
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/studies/rattling-pair.json");
    let fit = |out: &str, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_flank"));
        command.arg("fit").arg(&study).args(["--out", out, "--seed", "3"]).args(more).current_dir(folder.path());
        command.output().unwrap()
    };
    let whole = fit("whole", &["--trials", "14", "--threads", "1"]);
    assert!(whole.status.success(), "{}", String::from_utf8_lossy(&whole.stderr));
    let text = String::from_utf8(whole.stdout).unwrap();
    assert!(text.contains("14 trials") && text.contains("held out"), "{text}");
    assert!(fit("parts", &["--trials", "5"]).status.success());
    // The last line of a killed run may be cut.
    let trials = folder.path().join("parts/trials.jsonl");
    let cut = fs::read_to_string(&trials).unwrap();
    fs::write(&trials, &cut[..cut.len() - 9]).unwrap();
    assert!(fit("parts", &["--trials", "14", "--resume", "-q"]).status.success());
    for file in ["trials.jsonl", "fit.json", "pair.json", "figures/fit.svg"] {
        let [a, b] = ["whole", "parts"].map(|out| fs::read(folder.path().join(out).join(file)).unwrap());
        assert!(a == b, "{file} differs");
    }
    let other = fit("parts", &["--trials", "14", "--resume", "--copies", "1"]);
    assert_eq!(other.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&other.stderr).contains("belong to another study"));
}
