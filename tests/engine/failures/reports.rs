//! What is reported, and how failures are: G1, G2, G4.

use std::ops::ControlFlow;

use flank::{
    analysis::{Contacts, EventLog, EventRow},
    engine::{EngineError, Options},
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{HybridSystem, Mode},
    scene::Scene,
    system::Structure,
    train::{WalledOscillator, Walls},
};
use serde_json::{Value, json};

use crate::events::support::{Course, attempt, ball, engine, masses, rigid, state, walled};

/// G1. A row of the log has both sides of the event: what closed with −1 opens with ½, with impulse 1.5 and 0.375 lost.
#[test]
fn g1_a_row_tells_both_sides_of_an_impact() {
    let s = ball(0.5);
    let mut rows: Vec<EventRow> = Vec::new();
    let mut log = EventLog::new(&s, Contacts::new(&s, None), |row| {
        rows.push(row);
        ControlFlow::Continue(())
    });
    engine(&s, state(&s, &[0.5], &[0.0]), Options::default()).run(s.clock().instant(1.5), &mut log).unwrap();
    assert_eq!((rows.len(), rows[0].seconds), (1, 1.0));
    let event = serde_json::to_value(&rows[0].contacts[0]).unwrap();
    for (key, exact) in [
        ("approach", 1.0),
        ("release", 0.5),
        ("restitution", 0.5),
        ("impulse", 1.5),
        ("energy_lost", 0.375),
        ("duration", 0.0),
    ] {
        assert!((event[key].as_f64().unwrap() - exact).abs() <= 4.0 * f64::EPSILON, "{key}: {event}");
    }
    assert_eq!(
        (&event["name"], &event["kind"], &event["from"]),
        (&json!("wall"), &json!("impact"), &json!("separated"))
    );
}

/// G1. A light ball on a heavy one, dropped together, all elastic (arXiv 2007.15005; box2d issue 167): at one instant the floor strikes
/// first, then the balls. Each row has the blow of its own contact: the approach of the second is made by the first. With masses M and m,
/// `r = m/M` and `v = √(2 g h)` the heavy ball leaves with `v (1 − 3r)/(1 + r)`, and no contact loses energy.
#[test]
fn g1_rows_of_a_cascade_have_the_blows_of_their_own_contact() {
    let drop = |restitution: f64| {
        let loads = [-0.6 * 9.81, -0.06 * 9.81];
        let s = masses(&[0.6, 0.06], &loads, &[vec![-1.0, 0.0], vec![1.0, -1.0]], rigid(restitution));
        let (mut rows, mut contacts) = (Vec::new(), Contacts::new(&s, None));
        let mut log = EventLog::new(&s, Contacts::new(&s, None), |row: EventRow| {
            rows.push(row);
            ControlFlow::Continue(())
        });
        let mut engine =
            engine(&s, state(&s, &[1.0, 1.0], &[0.0, 0.0]), Options { max_events: 1, ..Options::default() });
        engine.run(s.clock().instant(0.8), &mut (&mut log, &mut contacts)).unwrap();
        let impacts = rows.last().unwrap().contacts.iter().map(|c| {
            let [approach, release, lost] = [c.approach, c.release, c.energy_lost].map(Option::unwrap);
            (c.blows.unwrap(), approach, release, c.impulse.unwrap(), lost, c.restitution)
        });
        (impacts.collect::<Vec<_>>(), [0, 1].map(|j| contacts.report(j).energy_lost), engine.state().x.clone())
    };
    let (v, r) = ((2.0 * 9.81f64).sqrt(), 0.1);
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-14 * v;
    let (rows, lost, x) = drop(1.0);
    let [floor, between] = rows[..] else { panic!("{rows:?}") };
    assert!(near(x[2], v * (1.0 - 3.0 * r) / (1.0 + r)) && near(x[3] - x[2], 2.0 * v), "{x:?}");
    assert!(floor.0 == 1 && near(floor.1, v) && near(floor.2, v) && near(floor.3, 2.0 * 0.6 * v), "{floor:?}");
    assert!(between.0 == 1 && near(between.1, 2.0 * v) && near(between.2, 2.0 * v), "{between:?}");
    assert!(near(between.3, 2.0 * 0.06 * 2.0 * v / (1.0 + r)), "{between:?}");
    assert_eq!((floor.4, between.4, lost), (0.0, 0.0, [0.0, 0.0]));
    assert_eq!((floor.5, between.5), (Some(1.0), Some(1.0)));
}

/// G2. A mode is told in words: the name of each contact and its state.
#[test]
fn g2_modes_are_told_in_the_words_of_the_train() {
    let s = masses(&[1.0; 3], &[0.0; 3], &[vec![1.0, -1.0, 0.0], vec![0.0, 1.0, -1.0]], rigid(0.5));
    assert_eq!(s.mode_in_words(&Mode::default().with(1, 1)), "contact 0 separated, contact 1 drive");
}

/// G2. A run that dies says with which contacts closed, where and why, and stands at its last good state.
#[test]
fn g2_a_run_that_dies_names_the_contacts_and_the_time() {
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    let s = walled(&WalledOscillator::new(1.0, Walls::Above { position: 1.0 }, law, Stiffness::Constant(-1e300)));
    let (outcome, run) = attempt(&s, state(&s, &[0.0], &[1.0]), s.clock().instant(3.0));
    let text = outcome.unwrap_err().to_string();
    assert!(text.contains("wall drive") && text.contains("t = 1"), "{text}");
    assert_eq!(run.state.x[0], 1.0);
}

/// G2. Jumps without end name the cycle they go round in, not a list of all.
#[test]
fn g2_a_cascade_without_end_names_its_cycle() {
    let course = Course { trap: true, ..Course::new(&[1.0, -1.0]) };
    let (outcome, _) = attempt(&course, course.start(), course.clock.instant(3.0));
    let Err(EngineError::Cycle { cycle, .. }) = &outcome else { panic!("{outcome:?}") };
    assert_eq!(cycle.len(), 2);
    assert!(outcome.unwrap_err().to_string().contains("mode 0x0; mode 0x1"));
}

fn matrices(contacts: Value) -> String {
    let scene = json!({
        "flank": 1,
        "train": { "kind": "matrices", "mass_kg": [1, 1], "contacts": contacts },
        "run": { "t_end_s": 1 }
    });
    Scene::from_value(scene, "train").expect_err("a fault").to_string()
}

/// G2. Two contacts of one name could not be told apart in a log: a fault at the second.
#[test]
fn g2_two_contacts_of_one_name_are_refused() {
    let contact = |name: &str| json!({ "name": name, "direction": [1, 0], "flanks": "drive", "half_backlash_m": 0, "law": { "kind": "rigid", "restitution": 1 } });
    let text = matrices(json!([contact("stop"), contact("stop")]));
    assert!(text.contains("/train/contacts/1/name") && text.contains("stop"), "{text}");
    // A name left out is a name too.
    let mut nameless = contact("x");
    nameless.as_object_mut().unwrap().remove("name");
    assert!(matrices(json!([contact("contact 2"), nameless])).contains("/train/contacts/1/name"));
}

/// G2. What only the assembly sees is refused with its place in the scene.
#[test]
fn g2_a_train_that_cannot_be_assembled_is_refused_at_its_place() {
    let hertz = |exponent: &str| {
        json!({ "direction": [1, 0], "flanks": "drive", "half_backlash_m": 0, "stiffness": 1.0,
                "law": { "kind": "power", "exponent": exponent, "hysteresis": "none" } })
    };
    let mut sloping = hertz("3/2");
    sloping["stiffness"] = json!({ "kind": "switched", "levels": [1, 2], "times_s": [1] });
    assert!(matrices(json!([hertz("2"), sloping])).contains("/train/contacts/1"));
}

/// G4. A run past an accumulation of impacts costs one arc for each impact resolved, and says so: some hundred steps for
/// e = 0.8, not hundreds of thousands.
#[test]
fn g4_the_work_of_a_run_is_counted() {
    let s: Structure = ball(0.8);
    let mut engine = engine(&s, state(&s, &[0.0], &[1.0]), Options::default());
    engine.run(s.clock().instant(100.0), &mut ()).unwrap();
    let work = engine.counters();
    assert_eq!((work.accumulations, work.events), (1, work.arcs - 1));
    assert!((104..=106).contains(&work.events) && work.steps <= 2 * work.arcs, "{work:?}");
}
