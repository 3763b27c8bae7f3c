//! Measured curves: tables of points against the formulas that they were sampled from.

use std::{f64::consts::TAU, fmt::Write, fs, path::Path};

use approx::assert_relative_eq;
use flank::{
    Simulation,
    gear::{Piece, Stiffness},
    scene::{Scene, SceneError},
};
use serde_json::{Value, json};

const MEASURED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/measured-pair.json");

/// The formulas of the example: stiffness, N/m, and error, m, at x mesh periods.
fn stiffness(x: f64) -> f64 {
    3e8 * (1.0 + 0.2 * (8.0 * (TAU * x).sin()).tanh())
}

fn error(x: f64) -> f64 {
    5e-6 * (TAU * x).sin() + 1e-6 * (3.0 * TAU * x + 0.3).sin()
}

/// A table of `count` points with a head.
fn table(head: &str, count: usize, of: impl Fn(f64) -> f64) -> String {
    let rows = (0..count).map(|i| i as f64 / count as f64);
    rows.fold(head.to_owned() + "\n", |mut text, x| {
        writeln!(text, "{x:?},{:?}", of(x)).unwrap();
        text
    })
}

fn measured() -> Value {
    serde_json::from_str(&fs::read_to_string(MEASURED).unwrap()).unwrap()
}

/// The example with another stiffness and error of its mesh; files lie in `folder`.
fn scene(folder: &Path, stiffness: Value, error: Value) -> Result<Scene, SceneError> {
    let mut scene = measured();
    scene["train"]["meshes"][0]["stiffness"] = stiffness;
    scene["train"]["meshes"][0]["error"] = error;
    let file = folder.join("scene.json");
    fs::write(&file, scene.to_string()).unwrap();
    Scene::from_file(&file)
}

/// Times of the first events, mesh periods.
fn events(scene: Scene, count: u64) -> Vec<f64> {
    let simulation = Simulation::from_scene(scene).unwrap();
    let period = simulation.settings.period.unwrap();
    let mut job = simulation.job();
    job.max_events = count;
    let rows = job.run().unwrap().events;
    // Known switches of the stiffness are rows without a contact.
    rows.iter().filter(|row| !row.contacts.is_empty()).map(|row| row.t.parse::<f64>().unwrap() / period).collect()
}

fn largest_gap(a: &[f64], b: &[f64]) -> f64 {
    assert!(a.len() == b.len() && !a.is_empty(), "{} and {} events", a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The harmonics of the formula, in the words of a scene.
fn harmonics() -> Value {
    json!([
        { "order": 1, "amplitude_m": 5e-6 },
        { "order": 3, "amplitude_m": 1e-6, "phase_rad": 0.3 }
    ])
}

#[test]
fn an_error_of_64_points_gives_the_events_of_its_formula() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("error.csv"), table("x,error [um]", 64, |x| 1e6 * error(x))).unwrap();
    let measured = scene(folder.path(), json!(3e8), json!({ "table": "error.csv" })).unwrap();
    let remark = measured.built().remarks[0].to_string();
    assert!(remark.contains("64 points as 2 harmonics"), "{remark}");
    let exact = scene(folder.path(), json!(3e8), harmonics()).unwrap();
    let gap = largest_gap(&events(measured, 40), &events(exact, 40));
    assert!(gap < 1e-9, "{gap:e}");
}

/// Straight lines come near the formula with the square of their distance.
#[test]
fn lines_converge_to_the_formula() {
    let folder = tempfile::tempdir().unwrap();
    let run = |count: usize, kind: &str| {
        fs::write(folder.path().join("k.csv"), table("x;k [N/um]", count, |x| 1e-6 * stiffness(x)).replace(',', ";"))
            .unwrap();
        let curve = json!({ "kind": "curve", "table": "k.csv", "as": kind });
        events(scene(folder.path(), curve, harmonics()).unwrap(), 10)
    };
    // The poles of the hyperbolic tangent leave a series of 1024 points less than 1e-15 of it.
    let exact = run(1024, "harmonics");
    let gaps = [256, 1024, 4096].map(|count| largest_gap(&run(count, "lines"), &exact));
    for pair in gaps.windows(2) {
        let order = (pair[0] / pair[1]).log2() / 2.0;
        assert!((order - 2.0).abs() < 0.1, "{order} of {gaps:?}");
    }
}

#[test]
fn the_example_is_what_its_formulas_are() {
    let example = Scene::from_file(MEASURED).unwrap();
    let contact = &example.built().spec.contacts[0];
    let period = TAU / example.built().spec.omega.unwrap();
    for i in 0..64 {
        let x = f64::from(i) / 64.0;
        assert_relative_eq!(contact.stiffness.at(x * period), stiffness(x), max_relative = 1e-9);
        assert!((contact.error_at(x * period)[0] - error(x)).abs() < 1e-16);
    }
    let Stiffness::Periodic { pieces, .. } = &contact.stiffness else { panic!("lines") };
    assert_eq!(pieces.len(), 256);
    // The scene needs its files no more, and its hash is that of what they contained.
    let again = Scene::from_value(example.given().clone(), "given").unwrap();
    assert_eq!(again.hash(), example.hash());
    let scaled = example.with("/train/meshes/0/stiffness/scale", json!(2.0)).unwrap();
    assert_relative_eq!(scaled.built().spec.contacts[0].stiffness.at(0.0), 2.0 * stiffness(0.0), max_relative = 1e-12);
    assert_ne!(scaled.hash(), example.hash());
    // A run tells each state of the contact once, not once for each of the 256 pieces.
    let simulation = Simulation::from_scene(example).unwrap();
    let mut job = simulation.job();
    job.max_events = 30;
    assert!(job.run().unwrap().integrator.modes.len() <= 5);
}

/// One turn of a gear: one tooth of thirty is softer.
#[test]
fn a_turn_covers_as_many_mesh_periods_as_the_gear_has_teeth() {
    let folder = tempfile::tempdir().unwrap();
    let soft = |x: f64| if (0.2..0.2 + 1.0 / 30.0).contains(&x) { 2e8 } else { 3e8 };
    fs::write(folder.path().join("turn.csv"), table("turn,k", 120, soft)).unwrap();
    let of = |over: Value| {
        let curve = json!({ "kind": "curve", "table": "turn.csv", "over": over });
        let scene = scene(folder.path(), curve, json!([])).unwrap();
        let contact = scene.built().spec.contacts[0].clone();
        (contact.stiffness.clone(), TAU / scene.built().spec.omega.unwrap())
    };
    let (turn, mesh) = of(json!("driving"));
    let Stiffness::Periodic { period, .. } = turn else { panic!("lines") };
    assert_relative_eq!(period, 0.02, max_relative = 1e-14);
    // All that is forced repeats after a turn.
    assert_relative_eq!(mesh, 0.02 / 30.0, max_relative = 1e-12);
    assert_relative_eq!(turn.at(0.21 * 0.02), 2e8, max_relative = 1e-12);
    assert_eq!(turn, of(json!(30)).0);
}

/// Torques and speeds over a turn, motions of walls and loads are the harmonics that they were sampled from.
#[test]
fn curves_are_read_wherever_harmonics_are() {
    let curve = |count: usize, scale: f64| -> Vec<[f64; 2]> {
        let x = |i: usize| i as f64 / count as f64;
        (0..count).map(|i| [360.0 * x(i), scale * (0.5 + 2.0 * (2.0 * TAU * x(i) + 0.4).cos())]).collect()
    };
    let engine = |orders: Value, torque: f64| {
        let mut scene = measured();
        scene["train"]["meshes"][0]["stiffness"] = json!(3e8);
        scene["train"]["meshes"][0]["error"] = json!([]);
        scene["train"]["shafts"][0]["orders"] = orders;
        scene["train"]["shafts"][0]["torque_nm"] = torque.into();
        Scene::from_value(scene, "engine").unwrap().built().spec.clone()
    };
    let points = engine(json!({ "points": curve(16, 1000.0), "place": "deg", "unit": "N mm" }), 10.0);
    let list = engine(json!([{ "order": 2, "torque_nm": 2.0, "phase_rad": 0.4 }]), 10.5);
    assert_eq!(points.load_harmonics.len(), 1);
    for (a, b) in points.load_harmonics[0].vector.iter().zip(&list.load_harmonics[0].vector) {
        assert_relative_eq!(*a, *b, max_relative = 1e-13);
    }
    assert_relative_eq!(points.load_harmonics[0].phase, list.load_harmonics[0].phase, max_relative = 1e-13);
    for (a, b) in points.load.iter().zip(&list.load) {
        assert_relative_eq!(*a, *b, max_relative = 1e-13);
    }
    // Without a mean it stands beside "balance": what is left of the mean is rounding.
    let zero: Vec<[f64; 2]> = (0..12).map(|i| [f64::from(i) / 12.0, (TAU * f64::from(i) / 12.0).sin()]).collect();
    let mut balanced = measured();
    balanced["train"]["meshes"][0]["stiffness"] = json!(3e8);
    balanced["train"]["meshes"][0]["error"] = json!([]);
    balanced["train"]["shafts"][1]["orders"] = json!({ "points": zero });
    assert!(Scene::from_value(balanced.clone(), "balanced").is_ok());
    balanced["train"]["shafts"][1]["orders"] = json!([]);
    // The mean of a speed is that of the shaft, or a warning says so.
    for (mean, warns) in [(3000.0, false), (1000.0, true)] {
        let speed: Vec<[f64; 2]> = zero.iter().map(|[x, y]| [*x, mean + 10.0 * y]).collect();
        let mut moved = balanced.clone();
        moved["train"]["shafts"][0]["motion"] = json!({ "points": speed });
        moved["train"]["shafts"][0]["torque_nm"] = json!(0);
        let scene = Scene::from_value(moved, "moved").unwrap();
        assert_eq!(scene.built().warnings.iter().any(|w| w.message.contains("it is left out")), warns);
    }
    let wall = |motion: Value, load: Value, [position, force]: [f64; 2]| {
        let scene = json!({
            "flank": 1, "run": { "t_end_s": 1.0 },
            "train": {
                "kind": "wall", "mass_kg": 1.0, "load_n": force, "load_harmonics": load, "wall_motion": motion,
                "wall": { "side": "below", "position_m": position }, "law": { "kind": "rigid", "restitution": 0.5 }
            },
            "initial": { "q": { "x": 9.0 } }
        });
        Scene::from_value(scene, "wall").unwrap().built().spec.clone()
    };
    let measured = |unit: &str, scale: f64| json!({ "points": curve(9, scale), "place": "deg", "unit": unit, "period_s": 0.5, "origin_s": 0.1 });
    // Order 2 of a period of 0.5 s that begins at 0.1 s.
    let phase = 0.4 - 2.0 * TAU * 0.2;
    let harmonic =
        |amplitude: &str| json!([{ amplitude: 2.0, "frequency_rad_per_s": 2.0 * TAU / 0.5, "phase_rad": phase }]);
    let points = wall(measured("mm", 1e3), measured("kN", 1e-3), [0.0, -9.0]);
    let list = wall(harmonic("amplitude_m"), harmonic("amplitude_n"), [0.5, -8.5]);
    for t in [0.0, 0.07, 0.3] {
        assert_relative_eq!(points.contacts[0].error_at(t)[0], list.contacts[0].error_at(t)[0], epsilon = 1e-13);
    }
    assert_relative_eq!(points.load[0], list.load[0], max_relative = 1e-14);
    assert_relative_eq!(points.contacts[0].half_backlash, list.contacts[0].half_backlash, max_relative = 1e-14);
}

/// What is wrong with a table is told with file, line and column, and all of it.
#[test]
fn faults_of_tables_have_a_place() {
    let folder = tempfile::tempdir().unwrap();
    let with = |text: &str, keys: Value| {
        fs::write(folder.path().join("t.csv"), text).unwrap();
        let mut error = json!({ "table": "t.csv" });
        error.as_object_mut().unwrap().extend(keys.as_object().unwrap().clone());
        scene(folder.path(), json!(3e8), error).map_err(|error| error.to_string())
    };
    let wrong = |text: &str, keys: Value, words: &[&str]| {
        let told = with(text, keys).unwrap_err();
        for word in words {
            assert!(told.contains(word), "{told}\nwants {word}");
        }
    };
    let none = || json!({});
    let place = "/train/meshes/0/error/table";
    wrong(
        "x,e\n0,1\n0.3,abc\n0.5,NaN\n0.6\n",
        none(),
        &[place, "line 3, column 2: \"abc\"", "line 4", "line 5", "3 faults"],
    );
    wrong("", none(), &[place, "0 lines with numbers", "two lines at least"]);
    wrong("0,1\n0.5,2\n0.4,3\n", none(), &["/error/points/2", "places that rise"]);
    wrong("0,1\n0.5,2\n1,3\n", none(), &["does not close", "2e0 above its beginning"]);
    wrong("0,1\n180,2\n", none(), &["within one period", "\"place\": \"deg\""]);
    wrong("x,e [V]\n0,1\n0.5,2\n", none(), &["/error/unit", "\"V\"", "\"um\""]);
    wrong("x,e\n0,1\n0.5,2\n", json!({ "columns": ["x", "f"] }), &["/error/columns/1", "x, e"]);
    wrong("x,e\n0,1\n0.5,2\n", json!({ "points": [[0, 1], [0.5, 2]] }), &["/error", "exactly one of"]);
    wrong("x,e\n0,1\n0.5,2\n", json!({ "over": "driving", "colour": 1 }), &["/error/colour"]);
    fs::remove_file(folder.path().join("t.csv")).unwrap();
    let told = scene(folder.path(), json!(-1), json!({ "table": "t.csv" })).unwrap_err().to_string();
    assert!(told.contains(place) && told.contains("/train/meshes/0/stiffness"), "{told}");
    let told = Scene::from_value(measured(), "value").unwrap_err().to_string();
    assert!(told.contains("a scene from a file or a text"), "{told}");
    // Angles that are rounded close their period; a stiffness below 0 is refused wherever it stands.
    assert!(with("0,1\n3.1416,2\n6.2832,1\n", json!({ "place": "rad" })).is_ok());
    let negative = json!({ "kind": "curve", "points": [[0, 1e8], [0.5, -1e8], [0.7, 2e8]] });
    let told = scene(folder.path(), negative.clone(), json!([])).unwrap_err().to_string();
    assert!(told.contains("stiffness/points") && told.contains("stiffnesses >= 0"), "{told}");
    let mut contact =
        json!({ "direction": [1.0], "half_backlash_m": 0.0, "flanks": "drive", "law": { "kind": "kelvin-voigt" } });
    contact["stiffness"] = negative;
    contact["stiffness"]["period_s"] = json!(1.0);
    let train = json!({ "kind": "matrices", "mass_kg": [1.0], "contacts": [contact] });
    let told = Scene::from_value(json!({ "flank": 1, "train": train, "run": { "t_end_s": 1.0 } }), "one").unwrap_err();
    assert!(told.to_string().contains("stiffnesses >= 0"), "{told}");
    // Semicolons and decimal commas, other columns, a closed period, comments, tabs.
    for (text, keys) in [
        (
            "Winkel;Kraft;Fehler [µm]\n0;9;-1,5\n120;9;0\n240;9;2,5\n360;9;-1,5\n",
            json!({ "columns": ["Winkel", 3], "place": "deg" }),
        ),
        ("# test\n0\t-1.5e-6\n0.3333333333333333\t0\n0.6666666666666666\t2.5e-6\n", none()),
    ] {
        let scene = with(text, keys).unwrap();
        let contact = &scene.built().spec.contacts[0];
        assert_relative_eq!(contact.error_at(0.0)[0] + contact.error_offset, -1.5e-6, max_relative = 1e-9);
        assert_relative_eq!(contact.error_offset, 1e-6 / 3.0, max_relative = 1e-9);
    }
}

/// A period written out fifty times, with a hundred and more pieces, has the events of the period.
#[test]
fn a_period_may_have_thousands_of_pieces() {
    for (name, times) in [("W1c-ds", 4000), ("three-gear-chain", 50)] {
        let file = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let once = Simulation::from_file(file).unwrap();
        let mut spec = once.structure.spec().clone();
        for contact in &mut spec.contacts {
            let Stiffness::Periodic { period, pieces, .. } = &mut contact.stiffness else { panic!("{name}") };
            let start = |i: u32, p: &Piece| Piece { start: (f64::from(i) + p.start) / f64::from(times), ..*p };
            *pieces = (0..times).flat_map(|i| pieces.iter().map(move |p| start(i, p))).collect();
            *period *= f64::from(times);
            assert!(pieces.len() >= 100);
        }
        let often = Simulation::from_spec(name, spec, once.settings.clone())
            .unwrap()
            .starting_at(once.q0.clone(), once.v0.clone());
        let times = |simulation: &Simulation| -> Vec<f64> {
            let mut job = simulation.job();
            job.max_events = 60;
            job.run().unwrap().events.iter().map(|row| row.t.parse().unwrap()).collect()
        };
        let (one, other) = (times(&once), times(&often));
        let period = once.settings.period.unwrap();
        // A start is rounded to 1e-16 of the long period, 4e-13 of the short one; the motion amplifies that over 60 events.
        assert!(largest_gap(&one, &other) < 1e-9 * period, "{name}: {:e}", largest_gap(&one, &other) / period);
    }
}
