//! `flank fit`: numbers that were hidden are found again, the same trials come from the same seed, and a search goes on where it ended.

#![allow(clippy::unwrap_used)] // a test may panic

use flank::{
    Task,
    study::{
        StudyError,
        fit::{Fit, FitResult, Trial},
        plan::Plan,
    },
};
use serde_json::{Value, json};

/// A pair that rattles, with these error and drag of the true one; claims are its measures, rounded to three digits.
fn pair(amplitude: f64, damping: f64) -> Value {
    json!({
        "flank": 1, "name": "pair",
        "train": {
            "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
            "driving": { "teeth": 30, "mass_kg": 1.5, "inertia_kg_m2": 0.0018 },
            "driven": { "teeth": 45, "mass_kg": 3.4, "inertia_kg_m2": 0.0085 },
            "mesh": { "law": { "kind": "kelvin-voigt", "damping_ratio": damping }, "total_backlash_m": 1e-4, "stiffness": 3e8,
                      "error": [{ "order": 1, "amplitude_m": amplitude }] },
            "speed_rpm": 3000, "torque_nm": 60
        },
        "initial": "static", "run": { "cycles": 10 }
    })
}

fn study(scene: &Value, claims: Value) -> Plan {
    let numbers = json!([
        { "name": "error", "pointers": ["/train/mesh/error/0/amplitude_m"], "between": [1e-6, 2e-5], "plausible": [2e-6, 1e-5] },
        { "name": "damping", "pointers": ["/train/mesh/law/damping_ratio"], "between": [0.01, 0.2], "source": "usual" }
    ]);
    let study = json!({
        "flank_study": 1, "title": "fit", "scenes": { "scene": scene },
        "sections": [{ "title": "Forces", "plots": [{ "plot": "forces" }] }],
        "claims": { "figures": { "forces": { "claims": claims } } },
        "fit": { "numbers": numbers }
    });
    Plan::read(&study.to_string(), &|name| Err(name.to_owned())).unwrap()
}

/// Largest force and the share of its second harmonic: both depend on both numbers.
fn claims(largest: f64, second: f64) -> Value {
    json!([
        { "place": "1", "quantity": "largest force", "expected": largest, "value": "mesh.largest", "unit": "N" },
        { "place": "2", "quantity": "least force", "expected": second, "value": "mesh.smallest", "unit": "N" },
        { "place": "3", "quantity": "contact", "published": "never lost", "found": "{mesh.smallest:.1}", "agrees": "mesh.smallest > 0" },
        { "place": "4", "quantity": "contact", "published": "lost", "found": "{mesh.smallest:.1}", "agrees": "mesh.smallest <= 0" },
        { "place": "5", "quantity": "mean force", "expected": 1, "value": "mesh.mean", "unit": "N", "held_out": true }
    ])
}

fn search(plan: &Plan, count: usize, known: Vec<Trial>) -> (Vec<Trial>, FitResult) {
    let fit = Fit::new(plan, (0, 0.0), 7).unwrap();
    let trials = fit.search(count, known, Task::default(), &mut |_| Ok(())).unwrap();
    let found = FitResult::new(&fit, &trials).unwrap();
    (trials, found)
}

#[test]
fn hidden_numbers_are_found_and_exclusions_told() {
    // What the pair with 4 µm and 0.08 does.
    let truth = study(&pair(4e-6, 0.08), claims(1.0, 1.0));
    let fit = Fit::new(&truth, (0, 0.0), 1).unwrap();
    let entry = truth
        .make(flank::study::Kind::Forces, &flank::study::Context { rule: Default::default(), task: Task::default() });
    let found: Vec<f64> = entry.unwrap().comparisons[..2]
        .iter()
        .map(|row| row.found.split(' ').next().unwrap().parse().unwrap())
        .collect();
    drop(fit);
    let plan = study(&pair(8e-6, 0.03), claims(found[0], found[1]));
    let (trials, result) = search(&plan, 120, Vec::new());
    assert_eq!(trials.len(), 120);
    // Forces are compared at five digits, and the statement that contradicts another one costs one.
    assert!(result.loss < 1.01, "{result:?}");
    let values = result.values();
    assert!((values[0] / 4e-6 - 1.0).abs() < 0.05 && (values[1] / 0.08 - 1.0).abs() < 0.1, "{values:?}");
    assert_eq!((result.fitted, result.held_out), ([3, 0, 1, 0], [0, 0, 1, 0]));
    let pairs: Vec<&[String; 2]> = result.never_together.iter().map(|pair| &pair.claims).collect();
    assert!(pairs.iter().all(|pair| pair.iter().any(|claim| claim == "4: contact")), "{pairs:?}");
    assert!(result.numbers[0].as_good[0] <= values[0] && values[0] <= result.numbers[0].as_good[1]);
    assert_eq!(result.figure(&Fit::new(&plan, (0, 0.0), 7).unwrap(), &trials).panels.len(), 2);
}

#[test]
fn a_search_is_repeated_and_gone_on_with_to_the_bit() {
    let plan = study(&pair(8e-6, 0.03), claims(2500.0, 500.0));
    let (all, result) = search(&plan, 30, Vec::new());
    assert_eq!(search(&plan, 30, Vec::new()), (all.clone(), result.clone()));
    // What is known is not tried again, and changes nothing.
    assert_eq!(search(&plan, 30, all[..17].to_vec()), (all.clone(), result));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| search(&plan, 30, Vec::new()).0), all);
}

#[test]
fn questions_without_an_answer_are_refused() {
    let scene = pair(8e-6, 0.03);
    let refused = |change: &dyn Fn(&mut Value)| {
        let mut study = json!({
            "flank_study": 1, "title": "fit", "scenes": { "scene": scene },
            "sections": [{ "title": "Forces", "plots": [{ "plot": "forces" }] }],
            "claims": { "figures": { "forces": { "claims": claims(1.0, 1.0) } } },
            "fit": { "numbers": [{ "name": "error", "pointers": ["/train/mesh/error/0/amplitude_m"], "between": [1e-6, 2e-5] }] }
        });
        change(&mut study);
        let plan = Plan::read(&study.to_string(), &|name| Err(name.to_owned()));
        match plan.and_then(|plan| Fit::new(&plan, (0, 0.0), 1).map(|_| ())) {
            Err(StudyError::File(words)) => words,
            other => panic!("{other:?}"),
        }
    };
    let cases: [(&dyn Fn(&mut Value), &str); 5] = [
        (&|study| drop(study.as_object_mut().unwrap().remove("fit")), "no \"fit\""),
        (&|study| study["fit"]["numbers"] = json!([]), "no numbers"),
        (&|study| study["fit"]["numbers"][0]["between"] = json!([2, 1]), "no range"),
        (
            &|study| study["fit"]["numbers"][0]["pointers"] = json!(["/train/x"]),
            "no scene of the study has a number at /train/x",
        ),
        (&|study| study["claims"] = Value::Null, "nothing to fit to"),
    ];
    for (change, words) in cases {
        let found = refused(change);
        assert!(found.contains(words), "{found}");
    }
}
