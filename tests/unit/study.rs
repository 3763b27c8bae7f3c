//! What the figures of the reference study rest on.
//!
//! Expected values: an independent prototype (fixed-step Runge–Kutta, checked by halving its step) and a frequency-domain
//! solution of the same equations; tolerances are those stated for them.

#![allow(clippy::unwrap_used)] // a test may panic

use serde_json::{Value, json};

use super::{
    Context, FigureKind,
    changes::Changes,
    figures::{self, along},
    plan::Plan,
    steady::Rule,
    threshold::{LossCriterion, Threshold, ThresholdSearch, locate},
};
use crate::task::Task;

const LOAD: &str = "/train/load/output_torque_nm";

fn context() -> Context<'static> {
    Context { rule: Rule::default(), task: Task::default() }
}

#[track_caller]
fn close(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance, "{found} is not {wanted} to {tolerance}");
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn the_threshold_is_located_in_the_load() {
    let plan = Plan::reference().unwrap();
    let light = plan.scene("light").unwrap();
    let search = ThresholdSearch { range: [0.0, 40.0], scan: 9, resolution: 0.01 };
    let found = locate(&context(), light, LOAD, ("ring", LossCriterion::Deflection), &search).unwrap();
    let Threshold::Located { below, above, clearance_below, clearance_above } = found else { panic!("{found:?}") };
    // Separations vanish between 20.5 and 20.8 N m, whichever way the search goes.
    assert!(20.5 <= below && above <= 20.8 && above - below <= 0.01, "{found:?}");
    // They do not shrink to nothing: the motion that separates ends.
    assert!(clearance_below < -1e-7 && clearance_above >= 0.0, "{found:?}");
    // Nothing to locate where everything separates, or nothing does.
    let at = |by, range| locate(&context(), light, LOAD, ("ring", by), &ThresholdSearch { range, ..search });
    assert_eq!(at(LossCriterion::Deflection, [0.0, 10.0]).unwrap(), Threshold::Beyond { value: 10.0 });
    assert_eq!(at(LossCriterion::Deflection, [30.0, 40.0]).unwrap(), Threshold::None);
    // At 22 N m the meshes stay at their flanks, and carry no force for a ninth of a period.
    let by_force = at(LossCriterion::Force, [0.0, 40.0]).unwrap();
    let Threshold::Located { below, clearance_below, .. } = by_force else { panic!("{by_force:?}") };
    assert!((23.0..25.0).contains(&below) && clearance_below >= 0.0, "{by_force:?}");
}

#[test]
fn modes_of_the_reference_set() {
    let plan = Plan::reference().unwrap();
    let (figure, rows) = figures::modes(plan.scene("full").unwrap(), 3000.0).unwrap();
    let figure = figure.unwrap();
    for (name, hertz) in [
        ("T1", 431.39),
        ("R1", 434.01),
        ("R2", 869.05),
        ("T2", 882.63),
        ("R3", 1060.39),
        ("T3", 1785.12),
        ("R4", 2974.95),
        ("R5", 4460.28),
        ("R6", 5504.81),
        ("T4", 4123.48),
        ("T5", 4215.57),
    ] {
        let row = rows.iter().find(|row| row.name == name).unwrap();
        close(row.hertz, hertz, 0.05);
        close(row.shares.iter().map(|(_, share)| share).sum(), 1.0, 1e-12);
    }
    assert_eq!(rows.len(), 11);
    assert_eq!(figure.panels.len(), 7);
}

/// Cells at the harmonics of the mesh have the level of the force's amplitude there, which the picture of the forces finds from a record of
/// another length.
#[test]
fn levels_are_those_of_the_harmonics() {
    let plan = Plan::reference().unwrap();
    let heavy = plan.scene("heavy").unwrap();
    let speed = plan.speed(heavy).unwrap();
    let (figure, _) = figures::waterfall(&context(), heavy, (&speed, &[500.0, 1000.0]), &[], 1500.0).unwrap();
    let (_, facts) = figures::forces(&context(), heavy, 1500.0).unwrap();
    for (panel, family) in figure.panels.iter().zip(["sun_planet", "ring_planet"]) {
        let raster = panel.raster.as_ref().unwrap();
        // The first row from the top is 1000 rev/min.
        let level =
            |hertz: f64| raster.values[raster.columns + (hertz / 1500.0 * raster.columns as f64) as usize].unwrap();
        let fact = &facts[family];
        for h in 1..=4 {
            let amplitude = number(&fact["harmonics"][h - 1]);
            let at = level(h as f64 * number(&fact["mesh_frequency"]));
            close(at, 20.0 * amplitude.log10(), 0.01);
        }
    }
}

#[test]
fn paths_at_a_hundred_revolutions() {
    let plan = Plan::reference().unwrap();
    let floating = plan.scene("floating").unwrap();
    let speed = plan.speed(floating).unwrap();
    let (figure, found) = figures::trajectories(&context(), floating, (Some(&speed), &[100.0])).unwrap();
    let [sun, ring] = &found[..] else { panic!("two centres") };
    assert_eq!((&sun["period"], &sun["leaves"]), (&json!(1), &json!(288)));
    // Printed to 0.1 µm and 0.001 µm.
    close(1e6 * number(&sun["range"]), 4.7, 0.05);
    close(1e6 * number(&ring["range"]), 0.010, 0.0005);
    assert!(number(&sun["residual"]) < 1e-6 && sun["kind"] == "periodic", "{sun:?}");
    assert!(figure.panels.iter().all(|panel| panel.equal_scales));
}

#[test]
fn cycles_at_rest_and_under_load() {
    let plan = Plan::reference().unwrap();
    let light = plan.scene("light").unwrap();
    let varied = || [plan.load(light).ok(), plan.speed(light).ok()];
    let (figure, found) = figures::cycles(&context(), light, varied(), &[0.0, 21.0]).unwrap();
    assert_eq!((&found[0]["peaks"], &found[1]["peaks"]), (&json!(2), &json!(2)));
    for (h, wanted) in [18.4, 37.5, 10.3].into_iter().enumerate() {
        close(number(&found[0]["harmonics"][h]), wanted, 0.06);
    }
    close(number(&found[0]["apart"]), 0.2541, 0.002);
    assert_eq!(found[0]["together"], 0.0);
    // Two events a period, at exact times: marks and the ends of bands are the same numbers.
    let upper = &figure.panels[0];
    assert_eq!(upper.bands.len(), 3);
    let marks = upper.series.iter().find(|series| series.name.starts_with("events")).unwrap();
    let ends: Vec<f64> = upper.bands.iter().flat_map(|band| band.x).collect();
    assert_eq!(marks.x, ends);
    // Both meshes of a planet apart at once: at slow speeds only.
    let slow = light.with("/train/speed_rpm", Value::from(50.0)).unwrap();
    let (_, found) = figures::cycles(&context(), &slow, varied(), &[0.0]).unwrap();
    close(number(&found[0]["together"]), 0.243, 0.002);
}

#[test]
fn a_motion_followed_down_keeps_its_branch() {
    let plan = Plan::reference().unwrap();
    let loads: Vec<f64> = (0..8).map(|i| 16.0 + f64::from(i)).collect();
    let light = plan.scene("light").unwrap();
    let load = plan.load(light).unwrap();
    let (_, curves) = figures::apart(&context(), light, ("by-load", false), (&load, &loads)).unwrap();
    let apart = |branch: usize| along(&curves[branch], "ring", |c| c.report.apart_fraction);
    // From above, contact is kept well below the load at which it is first reached from below.
    let (up, down) = (apart(1), apart(2));
    let last = |values: &[f64]| values.iter().rposition(|v| *v > 0.0);
    assert!(last(&down) < last(&up), "{up:?} {down:?}");
}

/// One change at a time, against the prototype's table, printed to 0.001 (0.01 without drag) and 1 N. Its thresholds are no
/// numbers to hold others to: which impact of a cold start is the last one hangs on its step.
#[test]
fn changes_do_what_they_did_in_the_prototype() {
    let plan = Plan::reference().unwrap();
    // Apart at 50 and 500 rev/min, largest force N.
    let table = [
        ("base", 0.349, 0.253, 120.0),
        ("errors x 0.75", 0.328, 0.200, 87.0),
        ("errors x 1.25", 0.362, 0.284, 151.0),
        ("second harmonics x 0.75", 0.361, 0.218, 94.0),
        ("second harmonics x 1.25", 0.340, 0.276, 144.0),
        ("no second harmonics", 0.408, 0.0, 48.0),
        ("errors of the sun meshes x 0.75", 0.340, 0.230, 106.0),
        ("errors of the sun meshes x 1.25", 0.355, 0.273, 134.0),
        ("drag per speed x 0.75", 0.359, 0.286, 114.0),
        ("drag per speed x 1.25", 0.340, 0.223, 122.0),
        ("no drag per speed", 0.389, 0.78, 68.0),
        ("no drag", 0.416, 0.79, 65.0),
        ("restitution 0.3", 0.348, 0.251, 115.0),
        ("restitution 0.95", 0.351, 0.258, 130.0),
        ("sun shaft 1.8e7 N/m", 0.334, 0.190, 98.0),
        ("sun shaft 3e7 N/m", 0.358, 0.286, 133.0),
        ("carrier shaft 2.5e8 N/m", 0.335, 0.143, 84.0),
        ("carrier shaft 1e9 N/m", 0.356, 0.379, 112.0),
        ("sun shaft damping x 0.75", 0.350, 0.242, 113.0),
        ("sun shaft damping x 1.25", 0.349, 0.264, 127.0),
    ];
    let all: Changes = plan.plot(FigureKind::Changes).unwrap().table().unwrap();
    assert_eq!(all.changes.len(), table.len() + 2);
    // Two loads, no bisection: thresholds are not asked for.
    let search = ThresholdSearch { range: [0.0, 60.0], scan: 2, resolution: 60.0 };
    let light = plan.scene("light").unwrap();
    let varied = [plan.load(light).unwrap(), plan.speed(light).unwrap()];
    let found = all.effects(&context(), light, (&varied, &[50.0, 500.0, 2000.0]), &search).unwrap();
    let effect = |words: &str| found.iter().find(|effect| effect.words == words).unwrap();
    for (words, slow, middle, force) in table {
        // The tolerance of all fractions of this set.
        close(effect(words).apart[0], slow, 0.002);
        close(effect(words).apart[1], middle, 0.002);
        close(effect(words).largest, force, 1.0);
    }
    // Damping of the supports: ±0.001 in the fractions, ±1 N.
    for words in ["support damping x 0.75", "support damping x 1.25"] {
        close(effect(words).apart[0], effect("base").apart[0], 0.001);
        close(effect(words).apart[1], effect("base").apart[1], 0.0015);
        close(effect(words).largest, effect("base").largest, 1.0);
    }
}
