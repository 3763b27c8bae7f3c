//! `--verify`: right runs pass, and a run that is wrong in any way does not.
#![cfg(feature = "cli")]

use std::{fs, ops::ControlFlow};

use assert_cmd::Command;
use flank::{
    Simulation,
    engine::Observer,
    event::EventRecord,
    hybrid::HybridSystem,
    integrate::Choice,
    system::Structure,
    verify::{Difference, Verifier},
};
use serde_json::Value;
use tempfile::TempDir;

/// A mass between two walls, struck by a load without symmetry.
const WALLS: &str = r#"{ "flank": 1,
    "train": { "kind": "wall", "mass_kg": 1.3, "stiffness_n_per_m": 1.5, "damping_n_s_per_m": 0.05,
        "load_harmonics": [{ "amplitude_n": 0.5, "frequency_rad_per_s": 1.0, "phase_rad": 0.9 }],
        "wall": { "side": "both", "half_gap_m": 0.4 }, "law": { "kind": "rigid", "restitution": 0.7 } },
    "initial": { "q": [0.1], "v": [0.3] }, "run": { "t_end_s": 40 } }"#;

/// A ball that falls on a floor until it rests: no frequency at all.
const BALL: &str = r#"{ "flank": 1,
    "train": { "kind": "wall", "mass_kg": 1, "load_n": -9.81, "wall": { "side": "below", "position_m": 0 },
        "law": { "kind": "rigid", "restitution": 0.8 } },
    "initial": { "q": [1] }, "run": { "t_end_s": 5 } }"#;

/// A pair under `law` whose error has the phase `phase`.
fn pair(law: &str, phase: f64, run: &str) -> String {
    format!(
        r#"{{ "flank": 1, "train": {{ "kind": "gear-pair", "rack": {{ "module_m": 0.002, "pressure_angle_deg": 20 }},
            "driving": {{ "teeth": 40, "mass_kg": 1.5, "inertia_kg_m2": 0.003 }},
            "driven": {{ "teeth": 60, "mass_kg": 3, "inertia_kg_m2": 0.01 }},
            "mesh": {{ "law": {law}, "stiffness": 2e8, "half_backlash_m": 4e-5,
                "error": [{{ "order": 1, "amplitude_m": 1.8e-5, "phase_rad": {phase} }}] }},
            "speed_rpm": 2000, "torque_nm": 3 }}, "initial": "rest", "run": {run} }}"#
    )
}

const LINEAR: &str = r#"{ "kind": "kelvin-voigt", "damping_ratio": 0.06 }"#;
const POWER: &str =
    r#"{ "kind": "power", "exponent": "3/2", "hysteresis": "lankarani-nikravesh", "restitution": 0.7 }"#;

fn verify(scene: &str, words: &[&str]) -> (TempDir, assert_cmd::assert::Assert) {
    let (folder, mut command) = (tempfile::tempdir().unwrap(), Command::cargo_bin("flank").unwrap());
    fs::write(folder.path().join("scene.json"), scene).unwrap();
    let done = command.current_dir(&folder).args(["run", "scene.json", "--quiet", "--out", "out"]).args(words).assert();
    (folder, done)
}

fn summary(folder: &TempDir) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.path().join("out/summary.json")).unwrap()).unwrap()
}

#[test]
fn right_runs_pass() {
    let soft = pair(LINEAR, 1.1, r#"{ "cycles": 12 }"#);
    let hertz = pair(POWER, 2.3, r#"{ "cycles": 12 }"#).replace(r#""torque_nm": 3"#, r#""torque_nm": 0.3"#);
    for (scene, least, unjudged) in [(WALLS, 10, 0), (BALL, 100, 2), (&*soft, 10, 0), (&*hertz, 6, 0)] {
        let (folder, done) = verify(scene, &["--verify"]);
        done.code(0);
        let verification = &summary(&folder)["verification"];
        assert_eq!(verification["difference"], Value::Null);
        for check in ["series", "values"] {
            assert!(verification[check]["compared"].as_u64().unwrap() >= least, "{scene}: {verification}");
            assert!(verification[check]["not_judged"].as_u64().unwrap() <= unjudged, "{scene}: {verification}");
        }
    }
}

#[test]
fn a_scene_can_ask_for_it() {
    let (folder, done) = verify(&WALLS.replace(r#""t_end_s": 40"#, r#""t_end_s": 9, "verify": true"#), &[]);
    done.code(0);
    assert!(summary(&folder)["verification"]["series"]["compared"].as_u64().unwrap() > 0);
    let (folder, done) = verify(WALLS, &[]);
    done.code(0);
    assert_eq!(summary(&folder)["verification"], Value::Null);
}

/// Hands records on, or what a wrong engine would have made of them.
struct Wrong<'v, 's, F> {
    verifier: &'v mut Verifier<'s, Structure>,
    records: usize,
    change: F,
}

impl<F: FnMut(usize, EventRecord) -> Option<EventRecord>> Observer for Wrong<'_, '_, F> {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.records += 1;
        (self.change)(self.records, record.clone()).map_or(ControlFlow::Continue(()), |r| self.verifier.event(&r))
    }
}

/// The verdict on a run of `scene` whose records are changed; `choice` other than Taylor leaves the check by values alone.
fn verdict(
    scene: &str,
    choice: Choice,
    change: impl FnMut(usize, EventRecord) -> Option<EventRecord>,
) -> Result<(), Difference> {
    let case = Simulation::from_json(scene).unwrap();
    let start = case.start().unwrap();
    let period = case.clock().period().map(|t| t.value());
    let mut verifier = Verifier::new(&case.structure, &start, period, choice);
    let mut engine = case.engine(start).unwrap();
    let end = case.instants()[2];
    engine.run(end, &mut Wrong { verifier: &mut verifier, records: 0, change }).unwrap();
    verifier.finish(engine.state().at)
}

const BOTH: [Choice; 2] = [Choice::Taylor, Choice::Explicit];

#[test]
fn a_late_event_is_found() {
    let case = Simulation::from_json(WALLS).unwrap();
    let clock = *case.clock();
    for (choice, late) in [(Choice::Taylor, 1e-12), (Choice::Explicit, 1e-7)] {
        for sign in [1.0, -1.0] {
            let (late, mut known) = (sign * late, 0.0);
            let found = verdict(WALLS, choice, |i, mut record| {
                if i == 5 {
                    record.at = clock.advance(record.at, late);
                    known = record.conditioning.time;
                }
                Some(record)
            });
            let found = found.unwrap_err();
            assert_eq!((&*found.expected, &*found.found), ("walls impact", "walls impact"));
            // The run and the check by series know the event to this each, 2e-13 s; the check by values to its tolerance.
            let off = if choice == Choice::Taylor { 2.0 * known } else { 1e-3 * late.abs() };
            assert!(known > 0.0 && (found.amount.unwrap() - late).abs() <= off, "{found}");
        }
    }
}

#[test]
fn a_missing_event_is_found() {
    for choice in BOTH {
        let found = verdict(WALLS, choice, |i, record| (i != 5).then_some(record)).unwrap_err();
        assert_eq!(found.found, "walls impact");
        assert!(found.amount.unwrap() > 0.1, "{found}");
        // The last one: nothing may follow to the end of the run.
        let mut all = 0;
        verdict(WALLS, choice, |i, record| {
            all = all.max(i);
            Some(record)
        })
        .unwrap();
        let found = verdict(WALLS, choice, |i, record| (i != all).then_some(record)).unwrap_err();
        assert_eq!((&*found.expected, &*found.found), ("no event", "walls impact"));
    }
}

#[test]
fn an_invented_event_is_found() {
    let case = Simulation::from_json(WALLS).unwrap();
    for choice in BOTH {
        let mut last: Option<EventRecord> = None;
        let found = verdict(WALLS, choice, |i, mut record| {
            if i == 6 {
                // Half-way from the last event, with its guard.
                let before = last.take().unwrap();
                let half = 0.5 * case.clock().between(before.at, record.at);
                record = EventRecord { at: case.clock().advance(before.at, half), ..before };
            }
            last = Some(record.clone());
            Some(record)
        });
        assert!(found.is_err());
    }
}

#[test]
fn another_contact_is_found() {
    let soft = pair(LINEAR, 1.1, r#"{ "cycles": 12 }"#);
    let case = Simulation::from_json(&soft).unwrap();
    for choice in BOTH {
        let found = verdict(&soft, choice, |i, mut record| {
            let mut guards = Vec::new();
            case.structure.guards(&record.from, &mut guards);
            if i > 1 && guards.len() > 1 {
                record.fired = &guards.iter().copied().collect() - &record.fired;
            }
            Some(record)
        });
        assert!(found.unwrap_err().expected.contains("contact"));
    }
}

/// A body on a floor under two harmonics whose sum is close to a cosine at first.
fn resting() -> String {
    r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 2, "load_n": -1, "damping_n_s_per_m": 0.2,
        "load_harmonics": [{ "amplitude_n": 0.9, "frequency_rad_per_s": 1.0, "phase_rad": 1.9 },
            { "amplitude_n": 0.7, "frequency_rad_per_s": 3.0, "phase_rad": 0.4 }],
        "wall": { "side": "below", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0 } },
        "initial": { "q": [0.01] }, "run": { "t_end_s": 30 } }"#
        .to_owned()
}

/// A run whose integrator is so coarse that events are late.
fn coarse() -> String {
    pair(LINEAR, 0.0, r#"{ "cycles": 4, "verify": true, "integrator": { "method": "bdf", "tolerance": 1e-2 } }"#)
}

#[test]
fn a_coarse_integration_is_noticed() {
    let (folder, done) = verify(&coarse(), &[]);
    let text = String::from_utf8(done.code(1).get_output().stderr.clone()).unwrap();
    assert!(text.contains("the check by"), "{text}");
    assert!(folder.path().join("out/events.jsonl").exists());
    assert!(summary(&folder)["verification"]["difference"].as_str().unwrap().contains("the check by"));
}

#[test]
fn a_wrong_row_of_a_sweep_says_so() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.json"), coarse()).unwrap();
    let axis = "/run/integrator/tolerance=1e-2,1e-13";
    let mut command = Command::cargo_bin("flank").unwrap();
    command.current_dir(&folder).args(["sweep", "scene.json", "--quiet", "--vary", axis]).assert().code(3);
    let table = fs::read_to_string(folder.path().join("sweep/sweep.csv")).unwrap();
    let rows: Vec<&str> = table.lines().skip(1).collect();
    assert!(rows[0].contains("the check by") && !rows[1].contains("the check by"), "{table}");
}

/// Scenes whose forcing an earlier step rule did not resolve.
#[test]
fn slowly_felt_forcing_is_resolved() {
    let run = r#"{ "cycles": 4 }"#;
    let rigid = pair(r#"{ "kind": "rigid", "restitution": 0.6 }"#, 0.0, run).replace(r#""stiffness": 2e8, "#, "");
    for scene in [pair(LINEAR, 0.0, run), pair(POWER, 0.0, run), rigid, resting()] {
        verify(&scene, &["--verify"]).1.code(0);
    }
}
