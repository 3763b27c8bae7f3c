//! Import of gearbox files: small files written here, against numbers worked out by hand.

#![cfg(feature = "import")]

use std::{fmt::Write, io::Write as _};

use approx::assert_relative_eq;
use base64::{Engine, engine::general_purpose::STANDARD};
use flank::{
    import::{Import, ImportError, Options, Source, import},
    scene::Scene,
    system::equilibrium,
};
use serde_json::{Value, json};

/// One component: id, type, name, attributes with units and values. An array of numbers is written in base64 if it is `coded`.
type Part = (u32, &'static str, &'static str, Vec<(&'static str, &'static str, Value)>);
/// One relation: type and the roles of components.
type Tie = (&'static str, Vec<(&'static str, u32)>);

/// A gearbox to be written in one of the syntaxes.
#[derive(Clone)]
struct Model {
    version: &'static str,
    parts: Vec<Part>,
    ties: Vec<Tie>,
    /// Load cases: id, component, attribute, unit, value.
    cases: Vec<(u32, u32, &'static str, &'static str, f64)>,
    coded: bool,
}

impl Model {
    fn xml(&self) -> String {
        let value = |value: &Value| match value {
            Value::Array(items) if self.coded => {
                let bytes: Vec<u8> = items.iter().flat_map(|x| x.as_f64().unwrap().to_le_bytes()).collect();
                format!("<array code=\"float64\">{}</array>", STANDARD.encode(bytes))
            }
            Value::Array(items) => {
                let items: String = items.iter().map(|x| format!("<c>{x}</c>\n")).collect();
                format!("\n<array>{items}</array>\n")
            }
            Value::String(text) => text.replace('&', "&amp;"),
            value => value.to_string(),
        };
        let attribute = |(id, unit, own): &(&str, &str, Value)| {
            format!("<attribute id=\"{id}\" unit=\"{unit}\">{}</attribute>", value(own))
        };
        let mut text = format!(
            "\u{feff}<?xml version=\"1.0\"?>\n<model version=\"{}\" applicationId=\"test\"><relations>",
            self.version
        );
        for (i, (kind, ends)) in self.ties.iter().enumerate() {
            let ends: String = ends.iter().map(|(role, id)| format!("<ref id=\"{id}\" role=\"{role}\"/>")).collect();
            writeln!(text, "<relation id=\"{i}\" type=\"{kind}\">{ends}</relation>").unwrap();
        }
        text += "</relations><components>";
        for (id, kind, name, attributes) in &self.parts {
            let attributes: String = attributes.iter().map(attribute).collect();
            writeln!(
                text,
                "<component id=\"{id}\" type=\"{kind}\" name=\"{}\">{attributes}</component>",
                name.replace('&', "&amp;")
            )
            .unwrap();
        }
        text += "</components><load_spectrum id=\"1\">";
        for (case, id, name, unit, number) in &self.cases {
            let attribute = attribute(&(name, unit, json!(number)));
            writeln!(text, "<load_case id=\"{case}\"><component id=\"{id}\">{attribute}</component></load_case>")
                .unwrap();
        }
        text + "</load_spectrum></model>"
    }

    fn json(&self) -> String {
        let attribute = |(id, unit, value): &(&str, &str, Value)| {
            let kind = match value {
                Value::Array(_) if self.coded => "floating_point_array_coded",
                Value::Array(_) => "floating_point_array",
                Value::Bool(_) => "boolean",
                Value::String(_) => "enum",
                _ => "floating_point",
            };
            let value = match value {
                Value::Array(items) if self.coded => {
                    let bytes: Vec<u8> = items.iter().flat_map(|x| x.as_f64().unwrap().to_le_bytes()).collect();
                    json!({ "code": "float64", "value": STANDARD.encode(bytes) })
                }
                value => value.clone(),
            };
            json!({ "id": id, "unit": unit, kind: value })
        };
        let parts: Vec<Value> = self
            .parts
            .iter()
            .map(|(id, kind, name, attributes)| {
                json!({ "id": id, "type": kind, "name": name, "attributes": attributes.iter().map(attribute).collect::<Vec<_>>() })
            })
            .collect();
        let ties: Vec<Value> = self
            .ties
            .iter()
            .map(|(kind, ends)| {
                let refs: Vec<Value> = ends.iter().map(|(role, id)| json!({ "id": id, "role": role })).collect();
                json!({ "id": 1, "type": kind, "refs": refs })
            })
            .collect();
        let cases: Vec<Value> = self
            .cases
            .iter()
            .map(|(case, id, name, unit, number)| {
                let attribute = attribute(&(name, unit, json!(number)));
                json!({ "id": case, "components": [{ "id": id, "type": "shaft", "attributes": [attribute] }] })
            })
            .collect();
        json!({ "model": { "version": self.version, "applicationId": "test", "components": parts, "relations": ties,
                           "load_spectrum": { "id": 1, "load_cases": cases } } })
        .to_string()
    }

    fn part(&mut self, id: u32) -> &mut Part {
        self.parts.iter_mut().find(|part| part.0 == id).unwrap()
    }

    /// Sets an attribute, or takes it out.
    fn set(mut self, id: u32, name: &'static str, unit: &'static str, value: impl Into<Option<Value>>) -> Self {
        let attributes = &mut self.part(id).3;
        attributes.retain(|own| own.0 != name);
        attributes.extend(value.into().map(|value| (name, unit, value)));
        self
    }
}

fn gear(teeth: u32, helix: f64, shift: f64) -> Vec<(&'static str, &'static str, Value)> {
    vec![
        ("number_of_teeth", "none", json!(teeth)),
        ("normal_module", "mm", json!(2.0)),
        ("normal_pressure_angle", "deg", json!(20.0)),
        ("helix_angle_reference_diameter", "deg", json!(helix)),
        ("face_width", "mm", json!(18.0)),
        ("addendum_modification_coefficient", "none", json!(shift)),
        ("custom_colour", "none", json!("red")),
    ]
}

/// Two shafts with a helical pair, 21/42 teeth, one coupling to a motor; version 1.5.
fn pair() -> Model {
    let at = |v: f64| ("support_vector", "mm", json!([0.0, v, 0.0]));
    let distance = 2.0 * 63.0 / (2.0 * 15f64.to_radians().cos());
    Model {
        version: "1.5",
        coded: false,
        parts: vec![
            (1, "gear_unit", "box & lid", vec![]),
            (2, "gear_casing", "casing", vec![]),
            (
                3,
                "shaft",
                "motor",
                vec![("rotational_speed", "1/min", json!(-1500.0)), ("defines_speed", "none", json!(true))],
            ),
            (4, "shaft", "in", vec![at(0.0)]),
            (5, "shaft", "out", vec![at(distance)]),
            (6, "coupling", "", vec![("rotational_stiffness", "N mm / rad", json!(5e6))]),
            (7, "cylindrical_gear", "pinion", gear(21, 15.0, 0.0)),
            (8, "cylindrical_gear", "wheel", gear(42, -15.0, 0.0)),
            (
                9,
                "cylindrical_stage",
                "stage",
                vec![
                    ("center_distance", "mm", json!(distance)),
                    ("minimum_normal_backlash", "mm", json!(0.08)),
                    ("maximum_normal_backlash", "mm", json!(0.12)),
                ],
            ),
            (
                10,
                "external_load",
                "drive",
                vec![("torque_around_u_axis", "N m", json!(-30.0)), ("defines_torque", "none", json!(true))],
            ),
            (
                11,
                "shaft_section",
                "",
                vec![
                    ("length", "mm", json!(100.0)),
                    ("outer_diameter_begin", "mm", json!(30.0)),
                    ("outer_diameter_end", "mm", json!(30.0)),
                    ("u_coordinate_on_shaft", "mm", json!(0.0)),
                ],
            ),
            (12, "material", "", vec![("density", "kg / dm^3", json!(7.8))]),
            (
                13,
                "shaft_section",
                "",
                vec![
                    ("length", "mm", json!(50.0)),
                    ("outer_diameter_begin", "mm", json!(40.0)),
                    ("outer_diameter_end", "mm", json!(20.0)),
                ],
            ),
            (
                14,
                "concept_bearing",
                "",
                vec![("radial_stiffness", "N / m", json!(2e8)), ("axial_stiffness", "N / m", json!(0.0))],
            ),
            (15, "concept_bearing", "", vec![("radial_stiffness", "N / mm", json!(3e5))]),
        ],
        ties: vec![
            ("assembly", vec![("assembly", 3), ("part", 10)]),
            ("assembly", vec![("assembly", 3), ("part", 11)]),
            ("reference", vec![("origin", 3), ("referenced", 12)]),
            ("assembly", vec![("assembly", 4), ("part", 7)]),
            ("assembly", vec![("assembly", 5), ("part", 8)]),
            ("assembly", vec![("assembly", 5), ("part", 13)]),
            ("side", vec![("assembly", 6), ("inner_part", 3), ("outer_part", 4)]),
            ("side", vec![("assembly", 14), ("inner_part", 5), ("outer_part", 2)]),
            ("side", vec![("assembly", 15), ("inner_part", 5), ("outer_part", 2)]),
            ("stage", vec![("stage", 9), ("gear_1", 8), ("gear_2", 7)]),
        ],
        cases: vec![],
    }
}

/// A spur stage of a sun of 20, three planets of 22 and a ring of 64 teeth, its ring held by the casing.
fn planetary() -> Model {
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        ("support_vector", "mm", json!([0.0, -42.0 * sin, 42.0 * cos]))
    };
    let spur = |teeth| gear(teeth, 0.0, 0.0);
    let mut parts = vec![
        (1, "gear_casing", "", vec![]),
        (
            2,
            "shaft",
            "sun",
            vec![("rotational_speed", "1 / min", json!(1200.0)), ("support_vector", "mm", json!([0.0, 0.0, 0.0]))],
        ),
        (3, "shaft", "carrier", vec![]),
        (4, "shaft", "annulus", vec![]),
        (5, "cylindrical_gear", "z20", spur(20)),
        (6, "ring_gear", "z64", spur(64)),
        (7, "external_load", "", vec![("torque_around_u_axis", "N m", json!(12.0))]),
        (
            8,
            "switchable_coupling",
            "",
            vec![("is_engaged", "none", json!(true)), ("rotational_stiffness", "N mm / rad", json!(1e20))],
        ),
        (9, "planetary_stage", "first", vec![]),
        (10, "shaft_section", "", vec![("length", "mm", json!(20.0)), ("outer_diameter", "mm", json!(90.0))]),
    ];
    let mut ties = vec![
        ("assembly", vec![("assembly", 2), ("part", 5)]),
        ("assembly", vec![("assembly", 4), ("part", 6)]),
        ("assembly", vec![("assembly", 2), ("part", 7)]),
        ("side", vec![("assembly", 8), ("inner_part", 4), ("outer_part", 1)]),
        ("planet_carrier_shaft", vec![("planetary_stage", 9), ("shaft", 3)]),
        ("assembly", vec![("assembly", 3), ("part", 10)]),
    ];
    for (i, angle) in [0.0, 240.0, 120.0].into_iter().enumerate() {
        let [shaft, gear, sun, ring] = [20, 30, 40, 50].map(|first| first + u32::try_from(i).unwrap());
        parts.push((shaft, "shaft", "pin", vec![at(angle)]));
        parts.push((gear, "cylindrical_gear", "planet", spur(22)));
        parts.push((
            sun,
            "cylindrical_stage",
            "",
            vec![("center_distance", "mm", json!(42.0)), ("rotating_angle_around_neg_u_axis", "deg", json!(-angle))],
        ));
        parts.push((ring, "cylindrical_stage", "", vec![("center_distance", "mm", json!(42.0))]));
        ties.push(("planet_shaft", vec![("planetary_stage", 9), ("shaft", shaft)]));
        ties.push(("assembly", vec![("assembly", shaft), ("part", gear)]));
        ties.push(("stage", vec![("stage", sun), ("gear_1", 5), ("gear_2", gear)]));
        ties.push(("stage", vec![("stage", ring), ("gear_1", gear), ("gear_2", 6)]));
    }
    Model { version: "1.2", parts, ties, cases: vec![], coded: false }
}

fn read(text: &str) -> Import {
    import(text.as_bytes(), &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn number(import: &Import, pointer: &str) -> f64 {
    import.scene.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {:#}", import.scene))
}

fn faults(text: &str, options: &Options) -> Vec<(String, String)> {
    match import(text.as_bytes(), options) {
        Err(ImportError::Faults(faults)) => faults.into_iter().map(|fault| (fault.pointer, fault.found)).collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_helical_pair() {
    let found = read(&pair().xml());
    // The motor comes first, and its torque drives: both are about an axis that turns backwards.
    assert_eq!(found.scene["name"], "box & lid");
    let names: Vec<&Value> = (0..3).map(|i| &found.scene["train"]["shafts"][i]["name"]).collect();
    assert_eq!(names, ["motor", "in", "out"]);
    assert_relative_eq!(number(&found, "/train/shafts/0/speed_rpm"), -1500.0);
    assert_relative_eq!(number(&found, "/train/shafts/0/torque_nm"), 30.0);
    assert_eq!(found.scene["train"]["shafts"][2]["torque_nm"], "balance");
    // 100 mm of 30 mm: ρπLd²/4 and ρπLd⁴/32.
    let pi = std::f64::consts::PI;
    assert_relative_eq!(
        number(&found, "/train/shafts/0/mass_kg"),
        7800.0 * pi * 0.1 * 0.03 * 0.03 / 4.0,
        max_relative = 1e-12
    );
    assert_relative_eq!(
        number(&found, "/train/shafts/0/inertia_kg_m2"),
        7800.0 * pi * 0.1 * 0.03_f64.powi(4) / 32.0,
        max_relative = 1e-12
    );
    // A cone from 40 to 20 mm: ∫ρπr²dz and ∫ρπr⁴/2 dz with r = 20 mm − 0.2 z.
    assert_relative_eq!(
        number(&found, "/train/shafts/2/mass_kg"),
        7850.0 * pi * 0.05 * (0.02_f64.powi(3) - 0.01_f64.powi(3)) / 0.03,
        max_relative = 1e-12
    );
    assert_relative_eq!(
        number(&found, "/train/shafts/2/inertia_kg_m2"),
        7850.0 * pi * 0.05 * (0.02_f64.powi(5) - 0.01_f64.powi(5)) / 0.1,
        max_relative = 1e-12
    );
    assert_relative_eq!(number(&found, "/train/shafts/2/translation/stiffness_n_per_m"), 5e8);
    assert!(found.scene["train"]["shafts"][2]["axial"].is_null(), "an axial stiffness of 0 is unknown");
    assert_relative_eq!(number(&found, "/train/couplings/0/rotation/stiffness_nm_per_rad"), 5e3);
    assert_relative_eq!(number(&found, "/train/meshes/0/total_backlash_m"), 1e-4, max_relative = 1e-12);
    assert_eq!(found.scene["train"]["meshes"][0]["gears"], json!(["pinion", "wheel"]));
    assert_eq!(found.scene["train"]["shafts"][1]["gears"][0]["hand"], "right");
    // The force of the mesh is that of the torque.
    let built = Scene::from_json(&found.scene.to_string(), "pair").unwrap().build().unwrap();
    let (alpha, beta) = (20f64.to_radians(), 15f64.to_radians());
    let base = 0.021 / beta.cos() * (alpha.tan() / beta.cos()).atan().cos();
    let base_helix = (beta.sin() * alpha.cos()).asin();
    assert_relative_eq!(
        equilibrium(&built.spec).unwrap().forces[0],
        30.0 / (base * base_helix.cos()),
        max_relative = 1e-9
    );
    // Every number has one origin.
    for origin in &found.origins {
        assert_eq!(found.scene.pointer(&origin.pointer), Some(&origin.value), "{}", origin.pointer);
        assert_eq!(
            found.origins.iter().filter(|other| other.pointer == origin.pointer).count(),
            1,
            "{}",
            origin.pointer
        );
    }
    let mut numbers = Vec::new();
    leaves(&found.scene, "", &mut numbers);
    for pointer in numbers {
        assert!(
            pointer == "/flank" || found.origins.iter().any(|origin| origin.pointer == pointer),
            "{pointer} has no origin"
        );
    }
}

/// Pointers of all numbers.
fn leaves(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| leaves(value, &format!("{at}/{key}"), found)),
        Value::Array(list) if list.iter().any(|item| !item.is_number()) => {
            list.iter().enumerate().for_each(|(i, value)| leaves(value, &format!("{at}/{i}"), found));
        }
        Value::Number(_) | Value::Array(_) => found.push(at.to_owned()),
        _ => {}
    }
}

#[test]
fn a_planetary_stage() {
    let found = read(&planetary().xml());
    let stage = &found.scene["train"]["stages"][0];
    assert_eq!((&stage["planets"], &stage["positions_deg"]), (&json!(3), &Value::Null));
    assert_eq!(
        (&stage["sun"]["shaft"], &stage["carrier"], &stage["ring"]["shaft"]),
        (&json!("sun"), &json!("carrier"), &json!("annulus"))
    );
    assert_eq!(
        found.scene["train"]["shafts"].as_array().unwrap().iter().filter(|shaft| shaft["fixed"] == true).count(),
        1
    );
    let built = Scene::from_json(&found.scene.to_string(), "stage").unwrap().build().unwrap();
    // The carrier turns at Z_s/(Z_s + Z_r) of the sun.
    let speed = |name: &str| built.speeds.iter().find(|(own, _)| own == name).unwrap().1;
    assert_relative_eq!(speed("carrier") / speed("sun"), 20.0 / 84.0, max_relative = 1e-14);
    // Three sun meshes share the torque.
    let base = 0.02 * 20f64.to_radians().cos();
    assert_relative_eq!(equilibrium(&built.spec).unwrap().forces[0], 12.0 / (3.0 * base), max_relative = 1e-9);
}

#[test]
fn all_syntaxes_give_one_scene() {
    for model in [pair(), planetary()] {
        let expected = read(&model.xml()).scene;
        assert_eq!(read(&model.json()).scene, expected);
        let coded = Model { coded: true, ..model.clone() };
        assert_eq!(read(&coded.xml()).scene, expected);
        assert_eq!(read(&coded.json()).scene, expected);
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        archive.start_file("box.rexs", zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(model.xml().as_bytes()).unwrap();
        archive.start_file("picture.png", zip::write::SimpleFileOptions::default()).unwrap();
        let bytes = archive.finish().unwrap().into_inner();
        assert_eq!(import(&bytes, &Options::default()).unwrap().scene, expected);
    }
}

#[test]
fn load_cases_replace_attributes() {
    let mut model = pair();
    model.cases = vec![(7, 10, "torque_around_u_axis", "N m", -10.0), (8, 10, "torque_around_u_axis", "kN m", -0.02)];
    for text in [model.xml(), model.json()] {
        let of = |case: Option<&str>| {
            let options = Options { load_case: case.map(str::to_owned), ..Options::default() };
            number(&import(text.as_bytes(), &options).unwrap(), "/train/shafts/0/torque_nm")
        };
        assert_relative_eq!(of(None), 10.0);
        assert_relative_eq!(of(Some("8")), 20.0);
        let options = Options { load_case: Some("9".to_owned()), ..Options::default() };
        assert_eq!(faults(&text, &options)[0], ("--load-case".to_owned(), "9".to_owned()));
    }
}

#[test]
fn a_later_version_is_read_as_far_as_its_names_are_known() {
    let mut model = pair();
    model.version = "2.0";
    model.parts.push((90, "thermal_network", "", vec![]));
    model.ties.push(("heat_path", vec![("origin", 90), ("referenced", 2)]));
    let found = read(&model.xml());
    assert_eq!(found.scene, read(&pair().xml()).scene);
    assert!(found.notes.iter().any(|note| note.contains("thermal_network")), "{:?}", found.notes);
    assert!(found.notes.iter().any(|note| note.contains("heat_path")), "{:?}", found.notes);
}

#[test]
fn a_stage_without_a_fixed_member_asks_for_one() {
    let model = planetary().set(8, "is_engaged", "none", json!(false));
    let found = faults(&model.xml(), &Options::default());
    assert_eq!(found, [("planetary_stage 9 \"first\"".to_owned(), "no member that stands still".to_owned())]);
    let options = Options { fix: vec!["annulus".to_owned()], ..Options::default() };
    assert_eq!(import(model.xml().as_bytes(), &options).unwrap().scene, read(&planetary().xml()).scene);
    let options = Options { fix: vec!["nobody".to_owned()], ..Options::default() };
    assert_eq!(faults(&model.xml(), &options)[0].0, "--fix");
}

/// Of a ring some writers count the shift the other way: the centre distance tells. Missing shifts follow from it.
#[test]
fn profile_shifts_fit_the_centre_distance() {
    let shifted = |ring: f64| {
        let mut model = planetary();
        // Sun −0.15, planets 0.15: the distance stays; the ring then has the shift of the planets.
        model = model.set(5, "addendum_modification_coefficient", "none", json!(-0.15));
        for planet in 30..33 {
            model = model.set(planet, "addendum_modification_coefficient", "none", json!(0.15));
        }
        model.set(6, "addendum_modification_coefficient", "none", json!(ring))
    };
    let [one, other] = [0.15, -0.15].map(|x| read(&shifted(x).xml()));
    assert_relative_eq!(number(&one, "/train/stages/0/ring/profile_shift"), 0.15);
    assert_relative_eq!(number(&other, "/train/stages/0/ring/profile_shift"), 0.15);
    assert!(other.notes.iter().any(|note| note.contains("sign of the profile shift")), "{:?}", other.notes);
    let open = shifted(0.15).set(6, "addendum_modification_coefficient", "none", None);
    assert!((number(&read(&open.xml()), "/train/stages/0/ring/profile_shift") - 0.15).abs() < 1e-12);
    let wider =
        pair().set(9, "center_distance", "mm", json!(66.0)).set(8, "addendum_modification_coefficient", "none", None);
    let wider = wider.set(5, "support_vector", "mm", json!([0.0, 66.0, 0.0]));
    let sum = number(&read(&wider.xml()), "/train/shafts/2/gears/0/profile_shift");
    // inv α_w − inv α_t = 2 Σx tan α/(Z₁ + Z₂).
    let (alpha, beta) = (20f64.to_radians(), 15f64.to_radians());
    let transverse = (alpha.tan() / beta.cos()).atan();
    let working = (63.0 / beta.cos() * transverse.cos() / 66.0).acos();
    let involute = |x: f64| x.tan() - x;
    assert_relative_eq!(
        sum,
        (involute(working) - involute(transverse)) * 63.0 / (2.0 * alpha.tan()),
        max_relative = 1e-9
    );
}

#[test]
fn numbers_of_the_user_replace_and_complete() {
    let model = pair().set(10, "torque_around_u_axis", "N m", None).set(3, "rotational_speed", "1/min", None);
    let found = faults(&model.xml(), &Options::default());
    let places: Vec<&str> = found.iter().map(|fault| fault.0.as_str()).collect();
    assert_eq!(places, ["/train/shafts/0/speed_rpm", "/train/shafts/0/torque_nm"]);
    let set = [
        ("/train/shafts/0/speed_rpm", json!(900)),
        ("/train/shafts/0/torque_nm", json!(5)),
        ("/train/meshes/0/total_backlash_m", json!(2e-4)),
        ("/train/meshes/0/error", json!([{ "order": 1, "amplitude_m": 1e-6 }])),
    ];
    let set: Vec<(String, Value)> = set.into_iter().map(|(pointer, value)| (pointer.to_owned(), value)).collect();
    let options = Options { set: set.clone(), ..Options::default() };
    let found = import(model.xml().as_bytes(), &options).unwrap();
    for (pointer, value) in &set {
        assert_eq!(found.scene.pointer(pointer), Some(value));
        let origin = found.origins.iter().find(|origin| origin.pointer == *pointer).unwrap();
        assert_eq!(origin.source, Source::Set);
    }
    // Without usual values they are asked for.
    let options = Options { no_defaults: true, ..Options::default() };
    let found = faults(&pair().xml(), &options);
    for pointer in
        ["/train/mesh/law/damping_ratio", "/train/meshes/0/rack/dedendum", "/train/shafts/1/gears/0/inertia_kg_m2"]
    {
        assert!(found.iter().any(|fault| fault.0 == pointer), "{pointer} in {found:?}");
    }
    assert!(!found.iter().any(|fault| fault.0.contains("backlash")), "{found:?}");
}

#[test]
fn odd_files_are_told_by_place() {
    let unreadable = |bytes: &[u8]| match import(bytes, &Options::default()) {
        Err(ImportError::Unreadable(words)) => words,
        other => panic!("{other:?}"),
    };
    assert!(unreadable(b"").contains("empty"));
    assert!(unreadable(b"hello").contains("neither XML"));
    assert!(unreadable(b"<a><b></a>").contains("line 1"));
    assert!(unreadable(b"<a/>").contains("no element <model>"));
    assert!(unreadable(&[0xff, 0xfe, 0x3c]).contains("UTF-8"));
    assert!(unreadable(b"{\"model\": 3}").contains("line 1"));
    assert!(unreadable(b"PK\x03\x04").contains("zip"));
    let doctype = pair().xml().replace("<model ", "<!DOCTYPE model [<!ENTITY x \"y\">]><model ");
    assert!(unreadable(doctype.as_bytes()).contains("document type"));
    let entity = pair().xml().replace("box &amp; lid", "box &lid;");
    assert!(unreadable(entity.as_bytes()).contains("lid"));
    let has = |model: Model, place: &str, found: &str| {
        let faults = faults(&model.xml(), &Options::default());
        assert!(
            faults.iter().any(|fault| fault.0.contains(place) && fault.1.contains(found)),
            "{place}, {found}: {faults:?}"
        );
    };
    has(pair().set(7, "number_of_teeth", "none", None), "\"pinion\"", "no number_of_teeth");
    has(pair().set(7, "number_of_teeth", "none", json!(21.5)), "\"pinion\"", "21.5");
    has(pair().set(7, "face_width", "furlong", json!(2)), "face_width", "furlong");
    has(pair().set(7, "face_width", "mm", json!("wide")), "face_width", "wide");
    has(pair().set(8, "normal_module", "mm", json!(2.5)), "\"stage\"", "normal_module");
    has(pair().set(8, "helix_angle_reference_diameter", "deg", json!(15)), "\"stage\"", "helix angles 15 and 15");
    has(pair().set(9, "center_distance", "mm", json!(90)), "center_distance", "0.09");
    let mut model = pair();
    model.ties.retain(|tie| tie.0 != "stage");
    has(model, "the file", "no stage");
    let mut model = pair();
    model.parts.retain(|part| part.0 != 8);
    has(model, "relation", "component 8");
    let mut model = pair();
    model.part(8).1 = "bevel_gear";
    has(model, "\"stage\"", "bevel_gear");
    let mut model = planetary();
    model.ties.retain(|tie| tie.0 != "planet_carrier_shaft");
    has(model, "\"first\"", "no single carrier");
    let mut model = planetary();
    model.parts.retain(|part| part.0 != 10);
    model.ties.retain(|tie| tie.1.iter().all(|end| end.1 != 10));
    has(model, "/train/shafts/1/inertia_kg_m2", "no inertia");
    // A name in Latin-1, a place counted from another component, a helix angle on one gear only.
    let latin =
        pair().xml().replace('\u{feff}', "").replace("version=\"1.0\"?", "version=\"1.0\" encoding=\"ISO-8859-1\"?");
    let bytes: Vec<u8> =
        latin.replace("casing", "Geh\u{e4}use").chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    assert_eq!(import(&bytes, &Options::default()).unwrap().scene, read(&pair().xml()).scene);
    let moved = pair().set(2, "support_vector", "mm", json!([5.0, 7.0, 9.0]));
    let moved = moved.set(4, "reference_component_for_position", "none", json!(2));
    let moved = moved.set(5, "reference_component_for_position", "none", json!(2));
    assert_eq!(read(&moved.xml()).scene, read(&pair().xml()).scene);
    assert_eq!(
        read(&pair().set(8, "helix_angle_reference_diameter", "deg", None).xml()).scene,
        read(&pair().xml()).scene
    );
    // A shaft whose own axis points backwards, and one across.
    let back = pair().set(3, "u_axis_vector", "mm", json!([-1.0, 0.0, 0.0])).set(
        3,
        "rotational_speed",
        "1/min",
        json!(1500.0),
    );
    let back = back.set(10, "torque_around_u_axis", "N m", json!(30.0));
    assert_eq!(read(&back.xml()).scene, read(&pair().xml()).scene);
    has(pair().set(3, "u_axis_vector", "mm", json!([0.0, 1.0, 0.0])), "u_axis_vector", "0 1 0");
    // An idler is in two meshes, and each of its numbers has one origin.
    let mut row = pair();
    row.parts.push((70, "shaft", "last", vec![]));
    row.parts.push((71, "cylindrical_gear", "end", gear(30, 15.0, 0.0)));
    row.parts.push((72, "cylindrical_stage", "second", vec![]));
    row.ties.push(("assembly", vec![("assembly", 70), ("part", 71)]));
    row.ties.push(("stage", vec![("stage", 72), ("gear_1", 8), ("gear_2", 71)]));
    let found = read(&row.xml());
    for origin in &found.origins {
        assert_eq!(
            found.origins.iter().filter(|other| other.pointer == origin.pointer).count(),
            1,
            "{}",
            origin.pointer
        );
    }
    assert_eq!(found.scene["train"]["meshes"][1]["gears"], json!(["wheel", "end"]));
    // Long lists of attributes that are not read are no matter.
    let long = pair().set(7, "profile", "mm", json!(vec![1.5; 5000]));
    for text in [long.xml(), long.json()] {
        assert_eq!(read(&text).scene, read(&pair().xml()).scene);
    }
    // A tip circle that cannot be one is named and left out.
    let found = read(&pair().set(7, "tip_diameter", "mm", json!(1.0)).xml());
    assert!(found.notes.iter().any(|note| note.contains("tip_diameter")), "{:?}", found.notes);
}

/// Files with bytes turned, cut or doubled end in a scene or an error, never in a panic.
#[test]
fn mutated_files_do_no_harm() {
    let files = [pair().xml(), pair().json(), planetary().xml(), planetary().json()];
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |n: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % n as u64).unwrap()
    };
    for i in 0..10_000 {
        let mut bytes = files[i % files.len()].clone().into_bytes();
        for _ in 0..=random(4) {
            let (at, len) = (random(bytes.len()), 1 + random(40));
            let end = (at + len).min(bytes.len());
            match random(6) {
                0 => bytes[at] = u8::try_from(random(256)).unwrap(),
                1 => drop(bytes.drain(at..end)),
                2 => {
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(at..at, piece);
                }
                3 => bytes.truncate(at.max(1)),
                4 => bytes[at] = b"0123456789.-e<>\"{}[],"[random(21)],
                // A digit more: numbers of another size.
                _ => bytes.insert(at, b'9'),
            }
            if bytes.is_empty() {
                break;
            }
        }
        let _ = import(&bytes, &Options::default());
    }
}
