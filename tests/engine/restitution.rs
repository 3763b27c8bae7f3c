//! Restitution that depends on the approach speed: bouncing balls have closed forms.

use approx::assert_relative_eq;
use flank::{
    Simulation,
    analysis::EventKind,
    gear::contact::{MOST_POINTS, Restitution},
    scene::Scene,
};
use serde_json::{Value, json};

/// A ball that falls from 1 m under 9.81 m/s² onto a rigid floor.
fn ball(restitution: Value) -> Result<Scene, String> {
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1.0, "load_n": -9.81, "wall": { "side": "below", "position_m": 0.0 },
            "law": { "kind": "rigid", "restitution": restitution }
        },
        "initial": { "q": { "x": 1.0 } }, "run": { "t_end_s": 20.0 }
    });
    Scene::from_value(scene, "ball").map_err(|error| error.to_string())
}

fn power() -> Value {
    json!({ "kind": "power", "restitution": 0.8, "speed_m_per_s": 4.0, "exponent": 0.25, "smallest_speed_m_per_s": 2.0 })
}

/// Impacts come at the times of free flights, each with the restitution of its own approach.
#[test]
fn every_impact_returns_by_its_own_speed() {
    let table = json!({ "kind": "table", "points": [[0.5, 0.9], [3.0, 0.7], [4.0, 0.6]] });
    let by_power = |v: f64| 0.8 * (v.max(2.0) / 4.0).powf(-0.25);
    let by_table = |v: f64| match v {
        v if v <= 0.5 => 0.9,
        v if v <= 3.0 => 0.9 - 0.2 * (v - 0.5) / 2.5,
        v if v <= 4.0 => 0.7 - 0.1 * (v - 3.0),
        _ => 0.6,
    };
    for (law, e) in [(power(), &by_power as &dyn Fn(f64) -> f64), (table, &by_table)] {
        let record = Simulation::from_scene(ball(law).unwrap()).unwrap().run().unwrap();
        let impacts: Vec<_> = record.events.iter().filter(|row| row.contacts[0].kind == EventKind::Impact).collect();
        assert!(impacts.len() > 30);
        let g: f64 = 9.81;
        let (mut t, mut v) = ((2.0 / g).sqrt(), (2.0 * g).sqrt());
        let mut lost = 0.0;
        for impact in &impacts[..30] {
            assert_relative_eq!(impact.t.parse::<f64>().unwrap(), t, max_relative = 1e-13);
            let [contact] = &impact.contacts[..] else { panic!("one contact") };
            assert_relative_eq!(contact.approach.unwrap(), v, max_relative = 1e-12);
            assert_relative_eq!(contact.restitution_free.unwrap(), e(v), max_relative = 1e-12);
            lost += 0.5 * v * v * (1.0 - e(v) * e(v));
            v *= e(v);
            t += 2.0 * v / g;
        }
        assert!(lost < 9.81);
        // It comes to rest at the limit of the geometric sequence that its slow impacts are in the end.
        while v > 1e-12 {
            v *= e(v);
            t += 2.0 * v / g;
        }
        let last = record.events.last().unwrap();
        assert_eq!(last.contacts[0].kind, EventKind::Stick);
        assert_relative_eq!(last.t.parse::<f64>().unwrap(), t, max_relative = 1e-10);
    }
}

/// Where e changes down to speeds that are lost in rounding, the ball comes to rest too, and not before its time.
#[test]
fn a_restitution_that_changes_to_the_end_comes_to_rest() {
    let law = json!({
        "kind": "power", "restitution": 0.8, "speed_m_per_s": 4.0, "exponent": 0.004, "smallest_speed_m_per_s": 1e-13
    });
    let record = Simulation::from_scene(ball(law).unwrap()).unwrap().run().unwrap();
    let e = |v: f64| 0.8 * (v.max(1e-13) / 4.0).powf(-0.004);
    let g: f64 = 9.81;
    let (mut t, mut v) = ((2.0 / g).sqrt(), (2.0 * g).sqrt());
    while v > 1e-15 {
        v *= e(v);
        t += 2.0 * v / g;
    }
    let last = record.events.last().unwrap();
    assert_eq!(last.contacts[0].kind, EventKind::Stick);
    let stated = last.uncertainty.max(1e-12);
    assert!((last.t.parse::<f64>().unwrap() - t).abs() <= stated, "{} {t} {stated:e}", last.t);
}

#[test]
fn slopes_are_those_of_the_rebound() {
    let mut points = [[0.0; 2]; MOST_POINTS];
    points[..3].copy_from_slice(&[[0.5, 0.9], [3.0, 0.7], [4.0, 0.6]]);
    for law in [
        Restitution::Constant(0.4),
        Restitution::Power { at_speed: 0.8, speed: 4.0, exponent: 0.25, smallest_speed: 2.0 },
        Restitution::Table { points, count: 3 },
    ] {
        for v in [0.1, 0.7, 1.9, 2.2, 3.5, 7.0] {
            let step = 1e-6;
            let difference = ((v + step) * law.at(v + step) - (v - step) * law.at(v - step)) / (2.0 * step);
            assert_relative_eq!(law.rebound_slope(v), difference, max_relative = 1e-8);
        }
        assert!(law.fault().is_none());
        assert_eq!(law.at(0.0), law.at(law.steady_speed().min(1.0)));
    }
}

#[test]
fn what_cannot_come_to_rest_is_refused() {
    for (law, words) in [
        (
            json!({ "kind": "power", "restitution": 0.8, "speed_m_per_s": 4.0, "smallest_speed_m_per_s": 0.1 }),
            "smallest speed",
        ),
        (json!({ "kind": "table", "points": [[0.0, 1.0], [1.0, 0.5]] }), "below 1 at the first speed"),
        (json!({ "kind": "table", "points": [[1.0, 0.5], [0.5, 0.5]] }), "speeds that rise"),
        (json!({ "kind": "table", "points": [[1.0, 0.0]] }), "above 0"),
        (json!({ "kind": "table", "points": [] }), "1 to 8"),
        (json!({ "kind": "law" }), "\"power\""),
        (json!(1.5), "a number from 0 to 1"),
    ] {
        let told = ball(law.clone()).unwrap_err();
        assert!(told.contains("/train/law/restitution") && told.contains(words), "{law}: {told}");
    }
}
