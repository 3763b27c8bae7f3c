//! Stability maps: the analytic limit, every kind of failure, and the command.

use std::{
    f64::consts::{PI, SQRT_2, TAU},
    sync::atomic::AtomicBool,
};

use flank::{
    Simulation, Task,
    accuracy::{
        Contender,
        stability::{LongRunRule, Map, MapPlan, Outcome},
    },
    gear::contact::{Law, Rigid},
    system::Structure,
    train::Quantity,
};

fn simulation(json: &str) -> Simulation {
    Simulation::from_json(json).unwrap()
}

fn made(simulation: &Simulation, methods: &[&str], factors: &[f64], steps: &[u64]) -> Map {
    let plan = MapPlan {
        over: Quantity::Stiffness,
        factors: factors.to_vec(),
        steps: steps.to_vec(),
        methods: methods.iter().map(|word| Contender::parse(word).unwrap()).collect(),
        references: Vec::new(),
        rule: LongRunRule { cycles: 60, ..LongRunRule::default() },
    };
    Map::make(simulation, &plan, Task::default()).unwrap().unwrap()
}

fn outcomes(map: &Map, row: usize, method: usize) -> Vec<Outcome> {
    map.rows[row].cells[method].iter().map(|cell| cell.outcome).collect()
}

/// A mass on a spring that never lets go, damping ratio 0.003, forced once a time unit; ω = 2√2 · `limit`.
fn linear(limit: f64) -> Simulation {
    let omega = 2.0 * SQRT_2 * limit;
    simulation(&format!(
        r#"{{ "flank": 1, "train": {{ "kind": "matrices", "mass_kg": [1], "load_n": [5],
            "load_harmonics": [{{ "vector_n": [50], "frequency_rad_per_s": {TAU} }}],
            "contacts": [{{ "direction": [1], "stiffness": {}, "law": {{ "kind": "bilateral", "damping_n_s_per_m": {} }} }}] }},
            "initial": "static", "run": {{ "cycles": 60 }} }}"#,
        omega * omega,
        2.0 * 0.003 * omega,
    ))
}

#[test]
fn explicit_methods_blow_up_beyond_their_limit_and_newmark_never() {
    // Four times the stiffness is twice the frequency: limits at 50.4 and 100.8 steps for h ω = 2√2, at 71.3 and 142.6 for 2.
    let (factors, steps) = ([1.0, 4.0], [20, 50, 51, 71, 72, 100, 101, 142, 143, 400]);
    let map = made(&linear(50.4), &["rk4", "verlet", "euler", "newmark"], &factors, &steps);
    for (row, limits) in [(0, [50.4, 50.4 * SQRT_2]), (1, [100.8, 100.8 * SQRT_2])] {
        let omega = map.rows[row].omega_max.unwrap();
        assert!((omega - 2.0 * SQRT_2 * limits[0]).abs() < 1e-9 * omega);
        for (method, limit) in [(0, limits[0]), (1, limits[1]), (2, limits[1])] {
            let found = map.rows[row].limit_steps_per_cycle[method].unwrap();
            assert!((found - limit).abs() < 1e-9 * limit, "{found} {limit}");
            for cell in &map.rows[row].cells[method] {
                let beyond = (cell.steps_per_cycle as f64) < limit;
                let method = &map.methods[method];
                assert_eq!(cell.outcome == Outcome::BlowUp, beyond, "{method}, {} steps", cell.steps_per_cycle);
                assert!(beyond || cell.outcome != Outcome::Growth, "{method}, {} steps", cell.steps_per_cycle);
            }
        }
        assert_eq!(map.rows[row].limit_steps_per_cycle[3], None);
        assert!(outcomes(&map, row, 3).iter().all(|outcome| *outcome < Outcome::Growth));
        // Fine steps are right with every method.
        assert!((0..4).all(|method| outcomes(&map, row, method).last() == Some(&Outcome::Right)));
    }
}

/// A sine of amplitude 1, whose crest, halfway through the cycle, touches a feather at 0.999 for
/// 2 arccos(0.999)/2π = 0.0142 of a cycle. Nothing damps what the feather stirs up, so that must stay below rounding: a motion that
/// neither returns nor decays has not settled.
fn brief() -> Simulation {
    simulation(&format!(
        r#"{{ "flank": 1, "train": {{ "kind": "matrices", "mass_kg": [1], "stiffness_n_per_m": [{}],
            "load_harmonics": [{{ "vector_n": [{}], "frequency_rad_per_s": {TAU}, "phase_rad": {PI} }}],
            "contacts": [{{ "direction": [1], "flanks": "drive", "half_backlash_m": 0.999, "stiffness": 1e-12,
                "law": {{ "kind": "kelvin-voigt", "damping_n_s_per_m": 0, "release": "deflection" }} }}] }},
            "initial": {{ "q": [-1] }}, "run": {{ "cycles": 60 }} }}"#,
        PI * PI,
        -3.0 * PI * PI,
    ))
}

#[test]
fn two_passages_inside_a_step_are_missed() {
    // The crest lies in the middle of a step of 1/41; 2001 steps see it.
    let map = made(&brief(), &["rk4", "rk4+cubic"], &[1.0], &[41, 2001]);
    assert_eq!(map.rows[0].events, 2 * map.rows[0].window.unwrap().cycles as usize);
    for method in 0..2 {
        assert_eq!(outcomes(&map, 0, method), [Outcome::Missed, Outcome::Right]);
        let cell = map.rows[0].cells[method][0];
        assert_eq!((cell.missed, cell.spurious), (map.rows[0].events, 0));
    }
}

/// The gear pair of Kahraman and Singh where its teeth separate.
fn pair() -> Simulation {
    simulation(
        r#"{ "flank": 1, "train": { "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true,
            "mean_load": 0.1, "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }] },
            "initial": { "q": [1.1] }, "run": { "cycles": 50 } }"#,
    )
}

#[test]
fn a_sound_run_is_right_and_the_engine_needs_few_steps() {
    let map = made(&pair(), &["rk4", "newmark"], &[0.5, 1.0, 2.0], &[2001]);
    for (row, factor) in map.rows.iter().zip([0.5, 1.0, 2.0]) {
        assert_eq!((row.factor, &row.error), (factor, &None));
        assert!(row.cells.iter().flatten().all(|cell| cell.outcome == Outcome::Right), "{row:?}");
        assert_eq!(row.own_outcome(), Outcome::Right);
        let own = row.own.as_ref().unwrap();
        assert_eq!(own.period, Some(1));
        assert!(own.steps_per_cycle < 20.0);
    }
    assert_eq!(map.fewest(0, &map.rows[1], Outcome::has_right_sequence), Some(2001));
}

#[test]
fn coarse_steps_go_wrong_in_several_ways() {
    let map = made(&pair(), &["rk4", "newmark"], &[1.0, 10.0], &[5, 11, 25]);
    let all: Vec<Outcome> = (0..2)
        .flat_map(|row| (0..2).flat_map(move |method| [(row, method)]))
        .flat_map(|(row, method)| outcomes(&map, row, method))
        .collect();
    assert!(
        all.contains(&Outcome::BlowUp)
            && all.iter().any(|o| matches!(o, Outcome::Missed | Outcome::Spurious | Outcome::Displaced)),
        "{all:?}"
    );
}

#[test]
fn threads_do_not_enter() {
    let pair = pair();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let map = pool.install(|| made(&pair, &["rk4", "newmark"], &[0.3, 1.0, 3.0], &[11, 101]));
        (serde_json::to_string(&map).unwrap(), map.figure("pair").json())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn a_factor_without_an_answer_says_why() {
    // The force of a rigid contact has no stiffness.
    let mut pair = pair();
    let mut spec = pair.structure.spec().clone();
    spec.contacts[0].law = Law::Rigid(Rigid::constant(0.5));
    (pair.structure, pair.is_static) = (Structure::new(spec).unwrap(), true);
    let map = made(&pair, &["rk4"], &[1.0], &[11]);
    assert!(map.rows[0].error.as_ref().unwrap().contains("equilibrium"), "{:?}", map.rows[0].error);
    assert!(map.rows[0].cells.is_empty());
}

#[test]
fn an_interrupted_map_is_none() {
    let plan = MapPlan {
        over: Quantity::Stiffness,
        factors: vec![1.0],
        steps: vec![11],
        methods: vec![Contender::parse("rk4").unwrap()],
        references: Vec::new(),
        rule: LongRunRule::default(),
    };
    assert!(Map::make(&pair(), &plan, Task::new(&AtomicBool::new(true), &|_| ())).unwrap().is_none());
}

#[cfg(feature = "cli")]
mod command {
    use std::{collections::BTreeMap, fs, path::Path};

    use assert_cmd::Command;
    use serde_json::Value;

    const PAIR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/kahraman-singh.json");

    fn flank(folder: &Path, words: &[&str]) -> assert_cmd::assert::Assert {
        Command::cargo_bin("flank").unwrap().current_dir(folder).arg("stability").args(words).assert()
    }

    fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
        let mut found = BTreeMap::new();
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() {
                found.extend(files(&entry));
            } else {
                found.insert(entry.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&entry).unwrap());
            }
        }
        found
    }

    #[test]
    fn the_files_are_the_same_again_and_say_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let run = |out: &str, threads: &str| {
            let axes = ["--factors", "0.5,2", "--steps", "10:1000:3:log", "--cycles", "40"];
            flank(folder.path(), &[&[PAIR, "--out", out, "--threads", threads], &axes[..]].concat()).code(0);
            files(&folder.path().join(out))
        };
        let (first, second) = (run("a", "1"), run("b", "2"));
        assert_eq!(
            first.keys().collect::<Vec<_>>(),
            [
                "flank-manifest.json",
                "report.html",
                "stability-stiffness.csv",
                "stability-stiffness.json",
                "stability-stiffness.png",
                "stability-stiffness.svg",
                "stability.csv",
                "stability.json",
            ]
        );
        assert!(first == second, "other bytes with other threads");

        let json: Value = serde_json::from_slice(&first["stability.json"]).unwrap();
        let map = &json["map"];
        // 1 is among the factors, ranges of steps are odd.
        assert_eq!(
            map["rows"].as_array().unwrap().iter().map(|r| r["factor"].as_f64().unwrap()).collect::<Vec<_>>(),
            [0.5, 1.0, 2.0]
        );
        assert_eq!(map["steps_per_cycle"], serde_json::json!([11, 101, 1001]));
        assert_eq!(map["references"][0]["steps_per_cycle"], 1000);
        let csv = String::from_utf8(first["stability.csv"].clone()).unwrap();
        // The head, and for each factor Flank and two methods at three steps.
        assert_eq!(csv.lines().count(), 1 + 3 * (1 + 2 * 3));
        for (row, factor) in map["rows"].as_array().unwrap().iter().zip(["0.5", "1.0", "2.0"]) {
            for cell in row["cells"][0].as_array().unwrap() {
                let start = format!("{factor},rk4,{},", cell["steps_per_cycle"]);
                let line = csv.lines().find(|line| line.starts_with(&start)).unwrap();
                assert_eq!(line.split(',').nth(4), cell["outcome"].as_str());
            }
        }
        let drawn: Value = serde_json::from_slice(&first["stability-stiffness.json"]).unwrap();
        assert_eq!(drawn["panels"][0]["tiles"].as_array().unwrap().len(), 9);
        // Tiles meet halfway in ratios, and reach as far beyond the first and the last.
        let edges = [11.0 * (11.0f64 / 101.0).sqrt(), (11.0f64 * 101.0).sqrt(), (101.0f64 * 1001.0).sqrt()];
        for (tile, ends) in drawn["panels"][0]["tiles"].as_array().unwrap().iter().zip(edges.windows(2)) {
            for (end, wanted) in ends.iter().enumerate() {
                assert!((tile["x"][end].as_f64().unwrap() / wanted - 1.0).abs() < 1e-12, "{tile}");
            }
        }
    }

    #[test]
    fn without_a_folder_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let words = [PAIR, "--factors", "1", "--steps", "101", "--methods", "rk4", "--over", "backlash"];
        let done = flank(folder.path(), &words).code(0);
        let told = String::from_utf8(done.get_output().stdout.clone()).unwrap();
        assert!(told.contains("sequence from") && told.contains("101"), "{told}");
        assert!(!told.contains("its step, s"), "a scene without units: {told}");
        assert!(files(folder.path()).is_empty());
        let units = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/spur-pair.json");
        let done = flank(folder.path(), &[units, "--factors", "1", "--steps", "101", "--cycles", "20"]).code(0);
        let told = String::from_utf8(done.get_output().stdout.clone()).unwrap();
        // 60/(2400 · 50) s.
        assert!(told.contains("its step, s") && told.contains("A cycle is 5.0000e-4 s."), "{told}");
    }

    #[test]
    fn bad_arguments_are_told_together() {
        let folder = tempfile::tempdir().unwrap();
        let words = [
            PAIR,
            "--out",
            "out",
            "--methods",
            "tsit45,bogus",
            "--factors",
            "0,1",
            "--steps",
            "10.5,1e9",
            "--over",
            "damping",
        ];
        let done = flank(folder.path(), &words).code(2);
        let told = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        for word in ["damping", "tsit45", "bogus", "--factors", "10.5", "1000000000"] {
            assert!(told.contains(word), "{word}: {told}");
        }
        // Only what a map takes is named as a remedy.
        assert!(!told.contains("esdirk34"), "{told}");
        assert!(!folder.path().join("out").exists());
        flank(folder.path(), &["nothing.json"]).code(2);
        flank(folder.path(), &[PAIR, "--cycles", "0"]).code(2);
        flank(folder.path(), &[PAIR, "--over", "mass"]).code(2);
    }

    #[test]
    fn a_folder_in_use_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("mine"), "x").unwrap();
        flank(folder.path(), &[PAIR, "--factors", "1", "--steps", "101", "--out", "."]).code(2);
        assert_eq!(files(folder.path()).len(), 1);
    }

    #[test]
    fn a_scene_without_cycles_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let ball = r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "load_n": -9.81,
            "wall": { "side": "below", "position_m": 0.1 }, "law": { "kind": "rigid", "restitution": 0.8 } },
            "initial": { "q": [1] }, "run": { "t_end_s": 5 } }"#;
        fs::write(folder.path().join("ball.json"), ball).unwrap();
        let done = flank(folder.path(), &["ball.json", "--over", "backlash"]).code(2);
        assert!(String::from_utf8(done.get_output().stderr.clone()).unwrap().contains("cycles"));
    }
}
