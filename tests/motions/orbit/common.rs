//! Forcing that repeats after several periods of the clock: orders below one, frequencies in ratios of whole numbers.

use std::f64::consts::TAU;

use flank::{
    Simulation, Task,
    branch::{Continuation, Family},
    gear::{Stiffness, contact::Law},
    map::{CellRule, Plane},
    orbit::{Orbit, Search, SectionMap},
    scene::Scene,
    simulation::Parameter,
    study::steady::{self, steady},
    system::Spec,
};
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

use super::open;

/// A spur pair of 50 teeth with a run-out of order `order` beside an error once a tooth, loaded so that contact is kept.
fn eccentric(order: &Value) -> Value {
    json!({ "flank": 1, "train": {
        "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
        "driving": { "teeth": 50, "mass_kg": 2.8, "inertia_kg_m2": 0.008,
            "rotation": { "stiffness_n_per_m": 1e5, "damping_ratio": 0.03 } },
        "driven": { "teeth": 50, "mass_kg": 2.8, "inertia_kg_m2": 0.008 },
        "mesh": { "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "total_backlash_m": 1e-4,
            "stiffness": { "kind": "tooth-pairs", "mean": 3.8e8, "modulation": 0.6 },
            "error": [{ "order": order, "amplitude_m": 4e-5 }, { "order": 1, "amplitude_m": 2e-6 }] },
        "speed_rpm": 600, "torque_nm": 20 },
      "initial": "static", "run": { "cycles": 400 } })
}

/// `x'' + 0.2 x' + x = 0.1 cos(w₁ t) + 0.1 cos(w₂ t)`, frequencies alone.
fn forced(w: [f64; 2]) -> Value {
    let load = |w: f64| json!({ "vector_n": [0.1], "frequency_rad_per_s": w });
    json!({ "flank": 1, "train": { "kind": "matrices", "mass_kg": [1], "damping_n_s_per_m": [[0.2]], "stiffness_n_per_m": [[1]],
        "load_harmonics": [load(w[0]), load(w[1])] },
      "initial": { "q": [1], "v": [0] }, "run": { "cycles": 40, "period_s": TAU / w[0] } })
}

fn found(simulation: &Simulation) -> Orbit {
    let found = Search::default().run(simulation, Task::default()).unwrap();
    found.orbits.into_iter().next().unwrap_or_else(|| panic!("{:?}", found.reason))
}

#[test]
fn a_run_out_once_a_turn_gives_the_orbit_of_the_same_train_clocked_by_the_turn() {
    let scene = open(eccentric(&json!("1/50")));
    let common = scene.clone().in_common_cycles().unwrap();
    assert_eq!((scene.structure.common_cycle(), common.periods_per_cycle()), (Ok(50), 50));
    let orbit = found(&common);
    // Written with the frequency of the turn as base, the train has whole orders, and no common cycle is looked for.
    let mut built = Scene::from_value(eccentric(&json!(0.02)), "turn").unwrap().build().unwrap();
    built.spec.omega = built.spec.omega.map(|mesh| mesh / 50.0);
    built.run.period = built.run.period.map(|period| 50.0 * period);
    let turn = found(&Simulation::from_built("turn", built).unwrap().in_common_cycles().unwrap());
    assert_eq!((orbit.period, turn.period, orbit.is_stable), (1, 1, true));
    for (a, b) in orbit.multipliers.iter().zip(&turn.multipliers) {
        assert!((a - b).norm() <= 1e-9, "{a} {b}");
    }
    // Contact is kept, so that the derivative is a product of exponentials.
    let expected = monodromy(scene.structure.spec()).pow(50).complex_eigenvalues();
    for multiplier in &orbit.multipliers {
        assert!(expected.iter().any(|other| (multiplier - other).norm() <= 1e-9), "{multiplier} {expected}");
    }
}

/// The derivative over one period of the only contact's stiffness, in contact all the time.
fn monodromy(spec: &Spec) -> DMatrix<f64> {
    let (n, c) = (spec.freedoms.len(), &spec.contacts[0]);
    let Stiffness::Periodic { period, pieces, .. } = &c.stiffness else { panic!("tooth pairs are pieces") };
    let Law::KelvinVoigt(law, _) = &c.law else { panic!("the law is linear") };
    let (g, inverse) = (DVector::from_column_slice(&c.direction), spec.mass.clone().try_inverse().unwrap());
    let over = |i: usize| {
        let next = pieces.get(i + 1).map_or(1.0 + pieces[0].start, |next| next.start);
        let (stiffness, damping) = (&spec.stiffness + &g * g.transpose() * pieces[i].value, law.damping);
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        a.view_mut((0, n), (n, n)).fill_with_identity();
        a.view_mut((n, 0), (n, n)).copy_from(&(-&inverse * stiffness));
        a.view_mut((n, n), (n, n)).copy_from(&(-&inverse * (&spec.damping + &g * g.transpose() * damping)));
        assert_eq!(pieces[i].slope, 0.0);
        (a * ((next - pieces[i].start) * period)).exp()
    };
    (0..pieces.len()).fold(DMatrix::identity(2 * n, 2 * n), |product, i| over(i) * product)
}

#[test]
fn an_orbit_in_common_cycles_is_one_of_the_run_from_any_first_cycle() {
    for start in [0, 7, 50, 123] {
        let mut scene = eccentric(&json!("1/50"));
        scene["run"]["start_cycle"] = json!(start);
        let own = open(scene);
        let orbit = found(&own.clone().in_common_cycles().unwrap());
        let map = SectionMap::new(&own).unwrap();
        let end = map.follow(&orbit.section, 50).unwrap();
        let size = orbit.section.x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (a, b) in orbit.section.x.iter().zip(&end.x) {
            assert!((a - b).abs() <= 1e-11 * size, "{start}: {a} {b}");
        }
        let early = map.follow(&orbit.section, 49).unwrap();
        assert!(orbit.section.x.iter().zip(&early.x).any(|(a, b)| (a - b).abs() > 1e-3 * size), "{start}");
    }
}

#[test]
fn frequencies_in_a_ratio_of_whole_numbers_have_the_orbit_of_the_closed_form() {
    for [w1, w2] in [[2.0, 3.0], [3.0, 2.0], [0.7, 1.0], [1.0, 0.01], [1.0, 0.999]] {
        let own = open(forced([w1, w2]));
        let orbit = found(&own.in_common_cycles().unwrap());
        // x = Re Σ a e^{iwt} / (1 − w² + i c w).
        let response = |w: f64| nalgebra::Complex::new(1.0 - w * w, 0.2 * w).inv() * 0.1;
        let q = response(w1).re + response(w2).re;
        let v = -w1 * response(w1).im - w2 * response(w2).im;
        assert_eq!(orbit.period, 1, "{w1} {w2}");
        assert!((orbit.section.x[0] - q).abs() < 1e-9 && (orbit.section.x[1] - v).abs() < 1e-9, "{w1} {w2}");
    }
}

#[test]
fn forcing_without_a_common_cycle_is_refused() {
    for scene in [forced([1.0, 2f64.sqrt()]), forced([1.0, 1.001]), eccentric(&json!(0.02 * (1.0 + 1e-13)))] {
        let own = open(scene).in_common_cycles().unwrap();
        let error = SectionMap::new(&own).unwrap().repeats().unwrap_err().to_string();
        assert!(error.contains("does not repeat") && !error.contains("base_frequency"), "{error}");
    }
}

#[test]
fn sweeps_count_the_common_cycle_and_measure_whole_ones() {
    let scene = Scene::from_value(eccentric(&json!(0.02)), "eccentric").unwrap();
    let steady = steady(scene, None, &steady::Rule::default(), Task::default()).unwrap();
    assert_eq!((steady.motion.kind.word(), steady.motion.period), ("periodic", Some(1)));
    assert_eq!((steady.measured_cycles, steady.motion.cycles % 50), (50, 0));
    // Contact is kept: the mean force is the load over the radius of the base circle.
    let force = 20.0 / (0.075 * (20f64).to_radians().cos());
    assert!((steady.contacts[0].report.force_mean - force).abs() < 1e-9 * force);
}

#[test]
fn maps_and_branches_take_orders_below_one() {
    let scene = Scene::from_value(eccentric(&json!("1/5")), "fifth").unwrap();
    let axes = ["/train/torque_nm=20:30:2", "/train/speed_rpm=590:600:2"];
    let plane = Plane::new(scene.clone(), &axes).unwrap();
    for cell in 0..4 {
        let simulation = plane.simulation(cell).unwrap();
        let decided = CellRule::default().decide(&simulation, simulation.start().unwrap(), Task::default()).unwrap();
        assert_eq!(decided.unwrap().motion.period, Some(1));
    }
    let parameter = Parameter::new(scene.resolved(), &["/train/torque_nm"]).unwrap();
    let family = Family::new(&scene, parameter, [15.0, 25.0]).unwrap();
    let followed = Continuation::default().run(&family, None, &mut |_| Ok(()), Task::default()).unwrap();
    let points = &followed.branches[0].points;
    assert!(points.iter().all(|point| point.period == 1 && point.is_stable && point.residual < 1e-10));
    assert_eq!([points[0].value, points[points.len() - 1].value].map(f64::round), [15.0, 25.0]);
}

#[test]
fn an_orbit_that_amplifies_rounding_over_a_common_cycle_is_shot_by_mesh_periods() {
    let mut scene = eccentric(&json!("1/20"));
    scene["train"]["torque_nm"] = json!(1.0);
    scene["train"]["speed_rpm"] = json!(2500.0);
    scene["train"]["mesh"]["error"][1]["amplitude_m"] = json!(1e-5);
    let common = open(scene).in_common_cycles().unwrap();
    let orbit = found(&common);
    // Of a start in doubles nothing is left after such a period.
    assert!(
        orbit.largest_multiplier() > 1e16 && orbit.residual < 1e-10,
        "{} {}",
        orbit.largest_multiplier(),
        orbit.residual
    );
    assert_eq!(orbit.image.between.len() as u64, orbit.period);
}
