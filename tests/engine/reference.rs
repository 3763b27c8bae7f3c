//! Event times against runs in 40-digit arithmetic.
//!
//! Each fixture holds a scene, every event as `[time, kind, contact, sensitivity]`, and intervals in which a chatter
//! sequence is too close to its accumulation point to be resolved. The sensitivity of an event is its shift per unit
//! change of the initial state. No computation in doubles can be nearer than a few units in the last place of its
//! numbers, times the sensitivity; so the tolerance is `1e-12 + ulp(t) + 5e-15 · sensitivity`.

use std::{collections::BTreeMap, ops::ControlFlow};

use flank::{
    analysis::{Contacts, EventLog, EventRow},
    engine::{Engine, Options, Outcome, State},
    integrate::{Choice, build},
    scene::Scene,
    system::Structure,
};
use serde_json::Value;

/// Events by contact and kind, in order: time and sensitivity.
type Events = BTreeMap<(u64, String), Vec<(String, f64)>>;

fn fixture(name: &str) -> Value {
    let path = format!("{}/tests/fixtures/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The events of a scene, as the engine finds them.
fn found(scene: &Value) -> Events {
    let built = Scene::from_value(scene.clone(), "fixture").unwrap().build().unwrap();
    let structure = Structure::new(built.spec.clone()).unwrap();
    let [from, _, to] = built.run.instants(structure.clock());
    let start = structure.start(from, &built.q0, &built.v0).unwrap();
    let integrator = build(Choice::Auto, 1e-13, &structure).unwrap();
    let state = State { at: from, x: start.x, jump: start.jump };
    let mut events = Events::new();
    let mut log = EventLog::new(&structure, Contacts::new(&structure, None).keep(0), |row: EventRow| {
        for contact in &row.contacts {
            let kind = serde_json::to_value(contact.kind).unwrap();
            let key = (contact.mesh as u64, kind.as_str().unwrap().to_owned());
            events.entry(key).or_default().push((row.t.clone(), 0.0));
        }
        ControlFlow::Continue(())
    });
    let mut engine = Engine::new(&structure, integrator, Options::default(), state);
    assert_eq!(engine.run(to, &mut log), Ok(Outcome::ReachedEnd));
    events.retain(|(_, kind), _| !matches!(kind.as_str(), "clear" | "graze" | "start"));
    events
}

fn expected(fixture: &Value) -> Events {
    let mut events = Events::new();
    for row in fixture["events"].as_array().unwrap() {
        let key = (row[2].as_u64().unwrap(), row[1].as_str().unwrap().to_owned());
        events.entry(key).or_default().push((row[0].as_str().unwrap().to_owned(), row[3].as_f64().unwrap()));
    }
    events
}

/// The difference of two decimal numbers, good to far below a unit in the last place of either.
fn difference(a: &str, b: &str) -> f64 {
    let parts = |text: &str| {
        let (whole, fraction) = text.split_once('.').unwrap_or((text, "0"));
        (whole.parse::<f64>().unwrap(), format!("0.{fraction}").parse::<f64>().unwrap())
    };
    let ((i, f), (j, g)) = (parts(a), parts(b));
    (i - j) + (f - g)
}

fn agrees(name: &str) {
    let fixture = fixture(name);
    let windows: Vec<[f64; 2]> = serde_json::from_value(fixture["unresolved"].clone()).unwrap();
    let resolved = |events: Events| -> Events {
        let inside = |t: f64| windows.iter().any(|[from, to]| (*from..=*to).contains(&t));
        let keep = |(key, mut list): ((u64, String), Vec<(String, f64)>)| {
            list.retain(|(t, _)| key.1 != "impact" || !inside(t.parse().unwrap()));
            (!list.is_empty()).then_some((key, list))
        };
        events.into_iter().filter_map(keep).collect()
    };
    let (ours, theirs) = (resolved(found(&fixture["scene"])), resolved(expected(&fixture)));
    let counts = |events: &Events| events.iter().map(|(key, list)| (key.clone(), list.len())).collect::<Vec<_>>();
    assert_eq!(counts(&ours), counts(&theirs), "{name}: contacts, kinds and numbers of events");
    for (key, list) in &theirs {
        for ((t, sensitivity), (ours, _)) in list.iter().zip(&ours[key]) {
            let value: f64 = t.parse().unwrap();
            let tolerance = 1e-12 + value.abs() * f64::EPSILON + 5e-15 * sensitivity;
            let off = difference(ours, t);
            assert!(off.abs() <= tolerance, "{name}, {key:?} at {t}: off by {off:e}, allowed {tolerance:e}");
        }
    }
}

macro_rules! fixtures {
    ($($test:ident: $name:literal,)*) => {
        $(#[test]
        fn $test() {
            agrees($name);
        })*
    };
}

fixtures! {
    one_flank_struck: "single-sided",
    both_flanks_struck: "double-sided",
    stiffness_switches: "rectangular-stiffness",
    contact_and_switch_at_one_instant: "switch-on-contact",
    touch_by_two_parts_in_a_million_million: "graze-touch",
    miss_by_two_parts_in_a_million_million: "graze-miss",
    chatter_rest_and_release: "chatter-table",
    three_impacts_at_one_instant: "three-impacts",
    hertz_with_hysteresis: "hertz-pair",
    six_meshes: "torsional-planetary",
}
