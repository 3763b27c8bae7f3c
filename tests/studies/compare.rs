//! Accuracy against work: the truth, the contenders, the command.

use std::{fs, path::Path};

use assert_cmd::Command;
use flank::{
    Simulation,
    accuracy::{AccuracyError, Contender, Order, Problem, Roughness, Score, Setting, Truth, reached},
    baseline::Crossing,
    scene::{Duration, Scene},
};
use serde_json::Value;

struct Case {
    simulation: Simulation,
    period: f64,
    cycles: u64,
}

fn of(scene: &Scene) -> Case {
    let simulation = Simulation::from_scene(scene).unwrap();
    let [at, _, end] = simulation.instants();
    let period = Problem::new(&simulation, None).unwrap().period;
    let cycles = match simulation.settings.duration {
        Duration::Cycles(n) => n,
        Duration::Until(_) => (simulation.clock().between(at, end) / period) as u64,
    };
    Case { simulation, period, cycles }
}

fn workload(name: &str) -> Case {
    of(&Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"))).unwrap())
}

impl Case {
    fn problem(&self) -> Problem<'_> {
        Problem { period: self.period, cycles: self.cycles, ..Problem::new(&self.simulation, None).unwrap() }
    }

    /// Error of event times and whether the sequence is right, for each number of steps.
    fn runs(&self, word: &str, truth: &Truth, steps: &[u64]) -> Vec<(u64, f64)> {
        let contender = Contender::parse(word).unwrap();
        let problem = self.problem();
        let run = |n: &u64| {
            let run = contender.perform(&problem, truth.window.cycles, Setting::StepsPerCycle(*n)).unwrap();
            let score = Score::of(truth, &run, self.period);
            assert!(score.is_right(), "{word} at {n}: {score:?}");
            (*n, score.event_time.unwrap())
        };
        steps.iter().map(run).collect()
    }
}

/// The reference states its own error: against event times known to 40 digits it must not be larger. Those also carry the
/// sensitivity of every event to the start, which bounds the growth that neighbouring runs show.
#[test]
fn the_truth_is_as_good_as_it_says() {
    for name in ["single-sided", "double-sided", "rectangular-stiffness", "torsional-planetary"] {
        let text = fs::read_to_string(format!("{}/tests/fixtures/reference/{name}.json", env!("CARGO_MANIFEST_DIR")));
        let fixture: Value = serde_json::from_str(&text.unwrap()).unwrap();
        let mut case = of(&Scene::from_value(fixture["scene"].clone(), name).unwrap());
        if name == "torsional-planetary" {
            // Its load is slower than the run: the mesh is the cycle.
            (case.period, case.cycles) = (std::f64::consts::TAU / 8.0, 15);
        }
        let truth = Truth::find(&case.problem(), 1e3).unwrap();
        let end = truth.window.cycles as f64 * case.period;
        let (mut worst, mut sensitivity): (f64, f64) = (0.0, 0.0);
        // Events of the fixture by contact, in the words of the log.
        let kinds = [("separation", false, false), ("drive_contact", false, true), ("back_contact", true, true)];
        for contact in 0..case.simulation.structure.contacts().len() {
            for (word, back, closing) in kinds {
                // A separation may be from either flank.
                let is = |p: &&Crossing| p.contact == contact && p.closing == closing && (!closing || p.back == back);
                let ours: Vec<f64> = truth.passages.iter().filter(is).map(|p| p.t).collect();
                let theirs = fixture["events"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .filter(|row| row[1] == word && row[2].as_u64() == Some(contact as u64));
                let theirs: Vec<(f64, f64)> = theirs
                    .map(|row| (row[0].as_str().unwrap().parse().unwrap(), row[3].as_f64().unwrap()))
                    .filter(|(t, _)| *t <= end)
                    .collect();
                assert_eq!(ours.len(), theirs.len(), "{name}: {word} of contact {contact}");
                for (ours, (t, s)) in ours.iter().zip(&theirs) {
                    worst = worst.max((ours - t).abs());
                    sensitivity = sensitivity.max(*s);
                }
            }
        }
        // And the fixture's own time is a double here.
        let allowed = truth.error * case.period + 2.0 * f64::EPSILON * end;
        assert!(worst <= allowed, "{name}: {worst:e} s off, {allowed:e} s stated");
        let n = 2 * case.simulation.structure.freedoms();
        let moved = truth.sizes[0].max(truth.sizes[1]) * n as f64;
        assert!(truth.window.growth * case.period <= sensitivity * moved, "{name}: growth {:e}", truth.window.growth);
    }
}

/// Chaos amplifies: the window ends where the limit is passed, earlier for a smaller limit, and the stable motion keeps
/// its whole run.
#[test]
fn the_window_ends_before_chaos_amplifies() {
    let chaotic = workload("W1a-ch");
    let (wide, narrow) = (Truth::find(&chaotic.problem(), 1e4).unwrap(), Truth::find(&chaotic.problem(), 1e2).unwrap());
    assert!(narrow.window.cut && narrow.window.cycles < wide.window.cycles, "{:?} {:?}", narrow.window, wide.window);
    assert!(narrow.window.growth <= 1e2 && wide.window.growth > 1e2);
    let stable = Truth::find(&workload("W1a-ss").problem(), 1e2).unwrap();
    assert!(!stable.window.cut && stable.window.cycles == 50);
    assert!(stable.error < 1e-12, "{:e}", stable.error);
}

#[test]
fn orders_fall_where_the_force_is_rough() {
    // A kink: all methods of order 2 and above are of order 2.
    let kink = workload("W1a-ss");
    assert_eq!(Roughness::of(&kink.simulation.structure), Roughness::Kink);
    let truth = Truth::find(&kink.problem(), 1e3).unwrap();
    for (word, expected) in [("rk4", 2.0), ("newmark", 2.0), ("verlet", 2.0), ("euler", 1.0)] {
        // Where in a step a kink falls scatters the error by a factor of a few: over two decades that is 0.2 in the order.
        let runs = kink.runs(word, &truth, &[101, 331, 1013, 3301, 10103]);
        let order =
            Order::of(&Contender::parse(word).unwrap(), &kink.simulation.structure, &runs, truth.error).unwrap();
        assert!((order.observed.unwrap() - expected).abs() < 0.25, "{word}: {order:?} {runs:?}");
        assert_eq!(order.reason.contains("kink"), word == "rk4", "{word}: {}", order.reason);
    }
    // Stiffness steps that fall inside steps: order 1, whatever the method.
    let jump = workload("W1c-ds");
    assert_eq!(Roughness::of(&jump.simulation.structure), Roughness::Jump);
    let truth = Truth::find(&jump.problem(), 1e3).unwrap();
    for word in ["rk4", "newmark"] {
        let runs = jump.runs(word, &truth, &[331, 1013, 3301, 10103]);
        let order =
            Order::of(&Contender::parse(word).unwrap(), &jump.simulation.structure, &runs, truth.error).unwrap();
        assert!((order.observed.unwrap() - 1.0).abs() < 0.35, "{word}: {order:?} {runs:?}");
    }
}

/// A power law is smooth to its exponent: RK4 is of order n + 1 on it.
#[test]
fn power_laws_leave_one_order_more_than_their_exponent() {
    for (n, q) in [(1.25, 2.25), (2.0, 3.0)] {
        let case = of(&Scene::from_json(
            &format!(
                r#"{{ "flank": 1,
                "train": {{ "kind": "wall", "mass_kg": 1, "load_n": -1, "damping_n_s_per_m": 0.2,
                    "load_harmonics": [{{ "amplitude_n": 0.5, "frequency_rad_per_s": 0.9, "phase_rad": 0.3 }}],
                    "wall": {{ "side": "below", "position_m": 0 }},
                    "law": {{ "kind": "power", "exponent": {n}, "hysteresis_coefficient": 0 }}, "contact_stiffness": 20 }},
                "initial": {{ "q": [0.5] }}, "run": {{ "cycles": 5 }} }}"#
            ),
            "scene",
        )
        .unwrap());
        assert_eq!(Roughness::of(&case.simulation.structure), Roughness::Smooth);
        let truth = Truth::find(&case.problem(), 1e3).unwrap();
        let runs = case.runs("rk4+cubic", &truth, &[331, 1013, 3301, 10_103, 33_013]);
        let order =
            Order::of(&Contender::parse("rk4+cubic").unwrap(), &case.simulation.structure, &runs, truth.error).unwrap();
        assert_eq!(order.expected, q);
        // Scatter as above.
        assert!((order.observed.unwrap() - q).abs() < 0.35, "n = {n}: {order:?} {runs:?}");
    }
}

/// A smoothed flank has an error of its own, which no step takes away: with tanh it falls in proportion to 1/σ or faster.
#[test]
fn smoothing_leaves_a_floor() {
    let case = workload("W1a-ss");
    let truth = Truth::find(&case.problem(), 1e3).unwrap();
    let floor = |word: &str| {
        let runs = case.runs(word, &truth, &[3301, 10103]);
        assert!((runs[0].1 / runs[1].1 - 1.0).abs() < 0.2, "{word} still falls: {runs:?}");
        runs[1].1
    };
    let (wide, narrow) = (floor("rk4+tanh=100"), floor("rk4+tanh=300"));
    assert!(narrow < 0.5 * wide && narrow > 1e-5, "{wide:e} {narrow:e}");
    assert!(floor("rk4+sqrt=100") > 1e-5 && floor("rk4+poly=100") > 1e-6);
}

#[test]
fn words_name_contenders() {
    for word in ["rk4", "hht=0.2", "generalized-alpha", "verlet+tanh=1e4+cubic", "bdf", "flank-sdirk"] {
        assert_eq!(Contender::parse(word).unwrap().name, word);
    }
    for (word, part) in [
        ("rk5", "known methods"),
        ("hht=0.5", "from 0 to 0.333"),
        ("rk4=2", "takes no number"),
        ("rk4+tanh", "not known"),
        ("rk4+tanh=-1", "not a number"),
        ("flank+cubic", "nothing can be added"),
        ("", "known methods"),
    ] {
        let Err(AccuracyError::Word { problem, .. }) = Contender::parse(word) else { panic!("{word} is taken") };
        assert!(problem.contains(part), "{word}: {problem}");
    }
    assert_eq!(reached(&[], 1.0, Some(2.0)), None);
}

#[test]
fn costs_are_read_off_straight_lines() {
    // Order 2: error = 1/cost².
    let runs = [(Some(1e-2), 1e1), (Some(1e-4), 1e2), (Some(1e-6), 1e3)];
    let (cost, is_reached) = reached(&runs, 1e-5, None).unwrap();
    assert!((cost - 10f64.powf(2.5)).abs() < 1e-9 * cost && is_reached);
    let (cost, is_reached) = reached(&runs, 1e-8, Some(2.0)).unwrap();
    assert!((cost - 1e4).abs() < 1e-8 * cost && !is_reached);
    assert_eq!(reached(&runs, 1e-8, None), None);
    assert_eq!(reached(&runs, 1e-8, Some(0.1)), None);
    assert_eq!(reached(&runs, 0.1, None), Some((10.0, true)));
    // A lucky run in between does not count, and a wrong one is no end to interpolate from.
    assert!(reached(&[(Some(1e-2), 1.0), (Some(1e-7), 2.0), (Some(1e-3), 3.0)], 1e-6, None).is_none());
    assert_eq!(reached(&[(None, 1.0), (Some(1e-7), 2.0)], 1e-6, None), Some((2.0, true)));
    assert_eq!(reached(&[(Some(1e-2), 1.0), (None, 2.0)], 1e-6, Some(2.0)), None);
    // Order 2, and a constant.
    let runs: Vec<(u64, f64)> = (1..8).map(|k| (10 * k, 3.0 / (k * k) as f64)).collect();
    let (contender, case) = (Contender::parse("rk4").unwrap(), workload("W1a-ss"));
    let order = Order::of(&contender, &case.simulation.structure, &runs, 0.0).unwrap();
    assert!((order.observed.unwrap() - 2.0).abs() < 1e-12);
}

fn flank(arguments: &[&str]) -> std::process::Output {
    Command::cargo_bin("flank").unwrap().args(arguments).output().unwrap()
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn the_command_compares_and_repeats_itself() {
    let scene = format!("{}/examples/scenes/W1a-ds.json", env!("CARGO_MANIFEST_DIR"));
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    for folder in &folders {
        let out = folder.path().to_str().unwrap();
        let run = flank(&[
            "compare",
            &scene,
            "--cycles",
            "5",
            "--most-steps",
            "6000",
            "--repetitions",
            "1",
            "--methods",
            "rk4",
            "newmark",
            "--out",
            out,
        ]);
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let text = String::from_utf8(run.stdout).unwrap();
        assert!(text.contains("Reference: Flank, 18 events") && text.contains("order seen"), "{text}");
    }
    let [a, b] = folders.each_ref().map(|f| f.path());
    for name in ["compare.json", "compare.csv", "figures/work-precision.svg", "figures/work-precision.csv"] {
        assert_eq!(read(a, name), read(b, name), "{name}");
    }
    let json: Value = serde_json::from_str(&read(a, "compare.json")).unwrap();
    assert_eq!(json["reference"]["window_cycles"], 5);
    let rows = json["rows"].as_array().unwrap();
    // Flank at four tolerances and at full precision, two methods at 47, 101, 223, 471, 1011 steps a cycle: six thousand steps in five cycles.
    assert_eq!(rows.len(), 5 + 2 * 5);
    // An integrator that has nothing in common with the reference's confirms it, where there is one.
    let independent = json["reference"]["independent_difference_periods"].as_f64();
    assert_eq!(independent.is_some(), cfg!(feature = "diffsol"));
    assert!(independent.is_none_or(|difference| difference > 0.0 && difference < 1e-10), "{independent:?}");
    assert!(rows.iter().all(|row| row["right_sequence"] == true));
    let times: Value = serde_json::from_str(&read(a, "timing.json")).unwrap();
    assert_eq!(times["rows"].as_array().unwrap().len(), rows.len());
    for name in ["figures/work-precision-time.png", "report.html"] {
        assert!(a.join(name).exists(), "{name}");
    }
}

#[test]
fn the_command_names_every_fault() {
    let scene = format!("{}/examples/scenes/W5b-p.json", env!("CARGO_MANIFEST_DIR"));
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("new");
    let run = flank(&["compare", &scene, "--methods", "rk5", "tsit45", "--out", folder.to_str().unwrap()]);
    let text = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{text}");
    // A rigid contact has no force for an adaptive solver; the other word is none.
    assert!(text.contains("rk5") && text.contains("tsit45"), "{text}");
    assert!(!folder.exists());
    assert_eq!(flank(&["compare", &scene, "--growth", "0.1"]).status.code(), Some(2));
}

/// Starts on a flank, of a spring and of a wall: Flank's own sequence is right, and a fine fixed step's too.
#[test]
fn a_start_on_a_flank_is_nobodys_error() {
    for scene in [
        r#"{ "flank": 1,
        "train": { "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true, "mean_load": 0.1,
            "transmission_error": [{ "amplitude": 0.2, "frequency": 0.9 }] },
        "initial": { "q": [1], "v": [0.5] }, "run": { "cycles": 5 } }"#,
        r#"{ "flank": 1,
        "train": { "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1, "damping_n_s_per_m": 0.1,
            "load_harmonics": [{ "amplitude_n": 1, "frequency_rad_per_s": 0.7 }],
            "wall": { "side": "above", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.5 } },
        "initial": { "q": [0], "v": [-1] }, "run": { "cycles": 5 } }"#,
    ] {
        let case = of(&Scene::from_json(scene, "scene").unwrap());
        let problem = case.problem();
        let truth = Truth::find(&problem, 1e3).unwrap();
        for (word, setting) in [("flank", Setting::RoundOff), ("rk4", Setting::StepsPerCycle(20_011))] {
            let run = Contender::parse(word).unwrap().perform(&problem, truth.window.cycles, setting).unwrap();
            let score = Score::of(&truth, &run, case.period);
            assert!(score.is_right(), "{word}: {score:?}");
        }
    }
}
