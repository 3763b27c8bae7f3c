//! Sections at a guard: the map from one event to the next of its kind.

use flank::{
    Simulation,
    engine::State,
    orbit::{Crossing, GuardMap, SectionMap},
    scene::Scene,
};
use serde_json::{Value, json};

use super::{
    differences::{laws, two_scene},
    open, six_points,
};

/// A ball on a table: `v → ε v`, `2 ε v/g` later. Without a forcing.
#[test]
fn a_bouncing_ball_has_a_section_at_its_impacts() {
    let (restitution, gravity, height): (f64, f64, f64) = (0.8, 9.81, 1.3);
    let ball = open(json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [2.0], "load_n": [-2.0 * gravity],
            "contacts": [{
                "direction": [-1.0], "half_backlash_m": 0.0, "flanks": "drive",
                "law": { "kind": "rigid", "restitution": restitution },
            }],
        },
        "initial": { "q": [height], "v": [0.0] },
        "run": { "t_end_s": 2.0 },
    }));
    let refused = SectionMap::new(&ball).unwrap_err().to_string();
    assert!(refused.contains("GuardMap"), "{refused}");
    let map = GuardMap::new(&ball, "i0+").unwrap();
    let start = map.first().unwrap();
    let speed = restitution * (2.0 * gravity * height).sqrt();
    let of = |x: f64, exact: f64| assert!((x - exact).abs() <= 1e-14 * exact.abs().max(1.0), "{x} {exact}");
    of(start.x[1], speed);
    let Crossing { end, time, jacobian, time_by, by_instant, word, .. } = map.image(&start).unwrap();
    of(time, 2.0 * speed / gravity);
    of(end.x[1], restitution * speed);
    // From the height q: t = (v + √(v² + 2 g q))/g.
    of(time_by[0], 1.0 / speed);
    of(time_by[1], 2.0 / gravity);
    // On the section the ball is on the table, whatever the start.
    of(jacobian[(0, 0)], 0.0);
    of(jacobian[(0, 1)], 0.0);
    of(jacobian[(1, 0)], restitution * gravity / speed);
    of(jacobian[(1, 1)], restitution);
    // Nothing changes with time: a later start is a later end.
    of(by_instant.1, 0.0);
    of(by_instant.0.amax(), 0.0);
    assert_eq!(word, ["i0+"]);
    let number = [ball.variation("/train/load_n/0").unwrap()];
    let (by_load, time_by_load) = map.image_by(&start, &number).unwrap().by_number;
    of(time_by_load[0], speed / (gravity * gravity));
    of(by_load[(1, 0)], 0.0);
}

/// The largest difference of the derivatives of a crossing to extrapolated differences, relative to the largest entry of their kind, as good
/// as the best of several steps makes them: their rounding is some 1e-16 over the step.
fn disagreement(scene: &Value, token: &str) -> Option<f64> {
    let simulation = open(scene.clone());
    let map = GuardMap::new(&simulation, token).unwrap();
    let start = simulation.start().unwrap();
    let image = map.image(&start).ok()?;
    // The largest of differences passes over what is no number.
    assert!(image.jacobian.iter().chain(&image.time_by).all(|entry| entry.is_finite()));
    let clock = simulation.clock();
    let steps = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6];
    let numbers = |crossing: &Crossing| {
        let mut numbers = crossing.end.x.clone();
        numbers.push(crossing.time);
        numbers
    };
    let best = |exact: &[f64], end: &dyn Fn(f64) -> Option<Vec<f64>>| {
        let size = exact.iter().fold(1.0, |m: f64, e| m.max(e.abs()));
        let off = |d: Vec<f64>| d.iter().zip(exact).map(|(d, e)| (d - e).abs() / size).fold(0.0, f64::max);
        steps.iter().filter_map(|step| six_points(*step, end)).map(off).fold(f64::INFINITY, f64::min)
    };
    let word = |crossing: &Crossing| crossing.word.clone();
    let same = |crossing: Crossing| (word(&crossing) == word(&image)).then(|| numbers(&crossing));
    let mut worst = 0.0f64;
    for i in 0..4 {
        let exact: Vec<f64> = (0..start.x.len()).map(|r| image.jacobian[(r, i)]).chain([image.time_by[i]]).collect();
        worst = worst.max(best(&exact, &|off| {
            let mut moved = start.clone();
            moved.x[i] += off;
            map.image(&moved).ok().and_then(same)
        }));
    }
    let exact: Vec<f64> = image.by_instant.0.iter().copied().chain([image.by_instant.1]).collect();
    worst = worst.max(best(&exact, &|off| {
        let later = State { at: clock.advance(start.at, off), ..start.clone() };
        map.image(&later).ok().and_then(same)
    }));
    for pointer in ["/train/load_n/0", "/train/mass_kg/1/1", "/train/contacts/0/half_backlash_m"] {
        let image = map.image_by(&start, &[simulation.variation(pointer).unwrap()]).unwrap();
        let exact: Vec<f64> = image.by_number.0.iter().copied().chain([image.by_number.1[0]]).collect();
        worst = worst.max(best(&exact, &|off| {
            let mut other = simulation.resolved().clone();
            let number = other.pointer_mut(pointer).unwrap();
            *number = (number.as_f64().unwrap() + off).into();
            let other = Simulation::from_scene(Scene::from_value(other, "test").unwrap()).unwrap();
            GuardMap::new(&other, token).unwrap().image(&start).ok().and_then(same)
        }));
    }
    Some(worst)
}

#[test]
fn the_derivative_of_a_crossing_is_that_of_the_motion() {
    let (mut failed, mut kinds) = (Vec::new(), std::collections::BTreeSet::new());
    for (name, contacts) in laws() {
        for token in ["c0+", "s0+", "x0+", "i0+", "r0+", "a0+", "c0-"] {
            for (omega, error) in [(0.6, 0.0), (1.4, 0.05)] {
                let Some(worst) = disagreement(&two_scene(&contacts, omega, error, [0.1, 0.2]), token) else {
                    continue;
                };
                println!("{name:24} {token} {omega} {worst:8.1e}");
                kinds.extend(token.chars().next());
                if worst > 1e-9 {
                    failed.push(format!("{name}, {token} at {omega}: {worst:e}"));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!(kinds.into_iter().collect::<String>(), "acirsx");
}

#[test]
fn sections_that_are_none_or_never_reached_say_so() {
    let pair = open(two_scene(&laws()[0].1, 0.6, 0.0, [0.1, 0.2]));
    for token in ["", "c", "c0", "c1+", "c0*", "z0+", "é0+", "c-1+"] {
        let error = GuardMap::new(&pair, token).unwrap_err().to_string();
        assert!(error.contains("from 0 to 0") && error.contains("c0+"), "{error}");
    }
    let error = GuardMap::new(&pair, "r0+").unwrap().first().unwrap_err().to_string();
    assert!(error.contains("does not reach the section r0+ within"), "{error}");
}
