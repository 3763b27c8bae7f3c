//! Advice on a scene: what simpler models are, what they change, and who takes part in a motion.
//!
//! Expected values are derived beside each test. Motions are settled to 1e-12 (relative) where two models are compared, so
//! that their measures agree to a few times that.

#![cfg(feature = "cli")]
#![allow(clippy::unwrap_used)] // a test may panic

use std::{collections::BTreeMap, fs, path::Path};

use assert_cmd::Command;
use flank::{
    Task,
    analysis::Settling,
    gear::{Stiffness, contact::Law},
    hybrid::ContactView,
    scene::Scene,
    study::{
        advise::{
            Advice, Plan, Rung,
            measure::{Estimate, Mesh, Motion, Work},
            model::{Model, Step},
            participation::{Group, groups, modes, motion_shares},
            simplify,
            verdict::{Verdict, changes, judge},
        },
        figures::Context,
        steady::{Rule, Seed},
    },
    system::equilibrium,
};
use nalgebra::DMatrix;
use serde_json::{Value, json};

fn advice(scene: &Scene, rule: Rule) -> Advice {
    let context = Context { rule, task: Task::default() };
    Plan::new(scene).unwrap().advice(&context, 0.01).unwrap()
}

/// Settled as far as doubles go.
fn exact() -> Rule {
    let settling = Settling { tolerance: 1e-12, ..Settling::default() };
    Rule { settling, irregular_cycles: 20, ..Rule::default() }
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
fn modal_weights_are_those_computed_by_hand() {
    // Without the mass beside and the second support: K = [[5, -2], [-2, 2]], M = diag(1, 2), λ = ω² = 3 ± √6.
    let built = masses().with("/train/stiffness_n_per_m", json!([3, 0, 5])).unwrap().build().unwrap();
    let mut spec = built.spec;
    simplify::hold(&mut spec, &["beside".to_owned()]);
    let groups = groups(&spec.freedoms);
    let still = DMatrix::identity(2, 2);
    let found = modes(&spec, &still, &groups).unwrap();
    for (mode, sign) in found.iter().zip([-1.0, 1.0]) {
        let lambda = 3.0 + sign * 6.0f64.sqrt();
        // φ ∝ (1, (5 − λ)/2).
        let b = (5.0 - lambda) / 2.0;
        let norm = 1.0 + 2.0 * b * b;
        close(mode.omega, lambda.sqrt(), 1e-14);
        close(mode.groups[0], 1.0 / norm, 1e-14);
        // gᵀ M⁻¹ g = 1 + 1/2.
        close(mode.meshes[0], (1.0 - b).powi(2) / norm / 1.5, 1e-14);
        close(mode.strain_of_contacts.unwrap(), 2.0 * (1.0 - b).powi(2) / norm / lambda, 1e-14);
        // S = I: tr(M S) = 3, (M φ)ᵀ (M φ) = (1 + 4 b²)/norm.
        close(mode.motion.unwrap(), (1.0 + 4.0 * b * b) / norm / 3.0, 1e-14);
    }
    let shares = motion_shares(&spec, &still, &groups).unwrap();
    close(shares[0], 1.0 / 3.0, 1e-15);
    assert_eq!(motion_shares(&spec, &DMatrix::zeros(2, 2), &groups), None);
}

#[test]
fn shares_and_weights_sum_to_one() {
    let advice = advice(&Scene::reference().unwrap(), Rule { irregular_cycles: 20, ..Rule::default() });
    assert_eq!(advice.families, ["sun-planet", "ring-planet"]);
    assert_eq!(advice.modes.len(), 16);
    let sum = |of: &dyn Fn(&flank::study::advise::participation::Mode) -> f64| advice.modes.iter().map(of).sum::<f64>();
    close(sum(&|mode| mode.meshes[0]), 1.0, 1e-12);
    close(sum(&|mode| mode.meshes[1]), 1.0, 1e-12);
    close(sum(&|mode| mode.motion.unwrap()), 1.0, 1e-12);
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
fn a_linear_law_has_the_tangent_and_the_restitution_of_the_power_law() {
    let scene = Scene::reference().unwrap();
    let model = Model::new(&scene, &[]).unwrap();
    let structure = &model.simulation.structure;
    let laws = simplify::linear_laws(structure).unwrap();
    let linear = Model::new(&scene, &[Step::Linear(laws)]).unwrap();
    let rest = equilibrium(structure.spec()).unwrap();
    for (j, contact) in linear.simulation.structure.spec().contacts.iter().enumerate() {
        let (k, force) = (structure.spec().contacts[j].stiffness.mean(), rest.forces[j]);
        // F = K p^1.5, dF/dp = 1.5 K p^0.5 at p = (F/K)^(2/3).
        let tangent = 1.5 * k * (force / k).powf(1.0 / 3.0);
        close(contact.stiffness.mean(), tangent, 1e-12 * tangent);
        assert!(matches!(contact.law, Law::KelvinVoigt(..)));
        let [e, wanted] = [&linear.simulation.structure, structure].map(|s| s.free_restitution(j).unwrap());
        close(e, wanted, 1e-12);
    }
    // The same laws whatever freedoms are left.
    let steps = [Step::Freedoms(json!("in-phase")), Step::Linear(simplify::linear_laws(structure).unwrap())];
    let reduced = Model::new(&scene, &steps).unwrap();
    let [few, all] = [&reduced, &linear].map(|model| model.simulation.structure.spec().contacts[0].stiffness.clone());
    assert_eq!(few, all);
}

#[test]
fn a_law_that_nothing_presses_on_has_no_tangent() {
    let scene = Scene::reference().unwrap().with("/train/load", json!({ "output_torque_nm": -400 })).unwrap();
    let plan = Plan::new(&scene).unwrap();
    // Not run: the plan says it before.
    let text = format!("{plan:?}");
    assert!(text.contains("linear law") && !text.contains("Linear("), "{text}");
}

#[test]
fn a_freedom_that_nothing_touches_can_be_dropped() {
    let advice = advice(&masses(), exact());
    let part = advice.parts.iter().find(|part| part.group.words == "beside").unwrap();
    let dropped = part.dropped.as_ref().unwrap();
    assert_eq!((part.share, dropped.verdict), (Some(0.0), Verdict::Enough));
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
fn ramps_become_steps_in_their_middle() {
    let pair = |stiffness: Value| {
        let train = json!({
            "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true, "mean_load": 0.1,
            "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }], "stiffness": stiffness
        });
        scene(train, json!({ "q": [1.1] }))
    };
    let levels = |ramp: Value, kind: &str| {
        let period = std::f64::consts::TAU / 0.6;
        let mut stiffness = json!({ "kind": kind, "period": period });
        let own = if kind.starts_with("tooth") {
            json!({ "mean": 1, "contact_ratio": 1.6, "phase": 0.3 })
        } else {
            json!({ "high": 1.2, "low": 0.8, "duty": 0.4, "origin": -1.7 })
        };
        for (key, value) in own.as_object().unwrap().iter().chain(ramp.as_object().unwrap()) {
            stiffness[key] = value.clone();
        }
        pair(stiffness)
    };
    for (ramped, stepped) in [("trapezoidal", "rectangular"), ("tooth-pairs-trapezoidal", "tooth-pairs")] {
        let ramped = levels(json!({ "ramp": 0.1 }), ramped);
        let found = Model::new(&ramped, &[Step::Stepped]).unwrap();
        let wanted = levels(json!({}), stepped).build().unwrap().spec;
        let value = |stiffness: &Stiffness, t: f64| match stiffness {
            Stiffness::Periodic { period, origin, pieces } => {
                let place = ((t - origin) / period - pieces[0].start).rem_euclid(1.0) + pieces[0].start;
                assert!(pieces.len() == 2 && pieces.iter().all(|piece| piece.slope == 0.0), "{pieces:?}");
                pieces.iter().rev().find(|piece| piece.start <= place).unwrap().value
            }
            other => panic!("{other:?}"),
        };
        let (a, b) = (&found.simulation.structure.spec().contacts[0].stiffness, &wanted.contacts[0].stiffness);
        for i in 0..1000 {
            let t = 0.02 * f64::from(i) + 0.0013;
            close(value(a, t), value(b, t), 1e-12);
        }
        close(a.mean(), 1.0 - 0.04 * f64::from(u8::from(stepped == "rectangular")), 1e-12);
    }
}

#[test]
fn planets_out_of_phase_are_not_reduced() {
    let scene = Scene::reference().unwrap().with("/train/phases", json!("teeth")).unwrap();
    let text = format!("{:?}", Plan::new(&scene).unwrap());
    assert!(text.contains("the in-phase reduction needs alike planets") && text.contains("rotations only"), "{text}");
}

#[test]
fn freedoms_are_grouped_by_name() {
    let names = |words: &str| words.split(' ').map(String::from).collect::<Vec<_>>();
    let words = |list: &str| groups(&names(list)).into_iter().map(|group: Group| group.words).collect::<Vec<_>>();
    assert_eq!(
        words("x_s y_s u_s xi_1 eta_1 u_1 xi_2 eta_2 u_2 u_c"),
        ["sun centre", "sun rotation", "planets radial", "planets tangential", "planets rotation", "carrier rotation"]
    );
    assert_eq!(words("x_1 y_1 u_1 x_2 y_2 u_2").len(), 4);
    assert_eq!(words("q1 q2 arm"), ["q1", "q2", "arm"]);
}

#[test]
fn scatter_is_taken_into_account() {
    let motion = |apart: [f64; 2], period: Option<u32>| Motion {
        freedoms: 1,
        settled: flank::analysis::Settled { period, ..Default::default() },
        followed: true,
        cycles: 1,
        meshes: vec![Mesh {
            family: "mesh".to_owned(),
            apart: Estimate { value: apart[0], error: apart[1] },
            separations: 1.0,
            separation_s: None,
            peak: None,
            mean_force: Estimate::default(),
        }],
        work: Work::default(),
        end: Seed::default(),
    };
    let verdict = |a: &Motion, b: &Motion| judge(a, b, &changes(a, b), 0.01);
    let full = motion([0.5, 0.003], None);
    // Changes with standard errors √2·0.003: 0.0042; twice that is 0.0085.
    assert_eq!(verdict(&full, &motion([0.501, 0.003], None)), Verdict::Enough);
    assert_eq!(verdict(&full, &motion([0.505, 0.003], None)), Verdict::Unclear);
    assert_eq!(verdict(&full, &motion([0.515, 0.003], None)), Verdict::Unclear);
    assert_eq!(verdict(&full, &motion([0.52, 0.003], None)), Verdict::NotEnough);
    // An irregular motion is not a periodic one, and one of period 1 none of period 2.
    assert_eq!(verdict(&full, &motion([0.5, 0.0], Some(1))), Verdict::NotEnough);
    assert_eq!(verdict(&motion([0.5, 0.0], Some(2)), &motion([0.5, 0.0], Some(1))), Verdict::NotEnough);
    // A long transient of the same measures is.
    assert_eq!(verdict(&motion([0.5, 1e-6], None), &motion([0.5, 0.0], Some(1))), Verdict::Enough);
    // Of one that drifts, ten times the scatter of its ten stretches counts: 10 √10 1e-4 = 0.0032.
    let drifting = motion([0.5, 1e-4], None);
    assert!(drifting.settling());
    for (apart, wanted) in [(0.506, Verdict::Enough), (0.508, Verdict::Unclear), (0.512, Verdict::Unclear)] {
        assert_eq!(verdict(&drifting, &motion([apart, 0.0], Some(1))), wanted);
        assert_eq!(verdict(&motion([apart, 0.0], Some(1)), &drifting), wanted);
    }
    assert_eq!(verdict(&drifting, &motion([0.514, 0.0], None)), Verdict::NotEnough);
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
    let pair = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/spur-pair.json");
    let done = flank(folder.path(), &["advise", pair]).assert().code(0);
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
