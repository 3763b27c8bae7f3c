//! What simpler models are, who takes part in a motion, and when a change counts. Expected values are derived beside each
//! test.

#![allow(clippy::unwrap_used)] // a test may panic

use nalgebra::DMatrix;
use serde_json::{Value, json};

use super::{
    measure::{CycleWork, Estimate, Mesh, Motion},
    model::{FREEDOMS, Model, Step},
    participation::{groups, modes, motion_shares},
    simplify,
    verdict::{Verdict, changes, judge},
};
use crate::{
    gear::{Stiffness, contact::Law},
    hybrid::ContactView,
    scene::Scene,
    study::steady::Seed,
    system::equilibrium,
};

fn scene(train: Value, initial: Value) -> Scene {
    let whole = json!({ "flank": 1, "train": train, "initial": initial, "run": { "cycles": 10 } });
    Scene::from_value(whole, "test").unwrap()
}

#[track_caller]
fn close(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance, "{found:e} is not {wanted:e} to {tolerance:e}");
}

#[test]
fn modal_weights_are_those_computed_by_hand() {
    // Two masses on one contact of stiffness 2, the first held by a spring of 3, and a third mass beside them. Without the
    // third: K = [[5, -2], [-2, 2]], M = diag(1, 2), λ = ω² = 3 ± √6.
    let train = json!({
        "kind": "matrices", "freedoms": ["a", "b", "beside"], "mass_kg": [1, 2, 4], "stiffness_n_per_m": [3, 0, 5],
        "damping_n_s_per_m": [0.3, 0.2, 0.1], "load_n": [0.3, -0.2, 0],
        "contacts": [{
            "name": "mesh", "direction": [1, -1, 0], "half_backlash_m": 0, "flanks": "drive", "stiffness": 2,
            "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.1 },
            "error": [{ "amplitude_m": 0.4, "frequency_rad_per_s": 2 }]
        }]
    });
    let mut spec = scene(train, json!("rest")).build().unwrap().spec;
    simplify::drop(&mut spec, &["beside".to_owned()], false);
    let groups = groups(&spec.freedoms);
    let still = DMatrix::identity(2, 2);
    let found = modes(&spec, &still, &groups).unwrap();
    for (mode, sign) in found.iter().zip([-1.0, 1.0]) {
        let lambda = 3.0 + sign * 6.0f64.sqrt();
        // φ ∝ (1, (5 − λ)/2).
        let b = (5.0 - lambda) / 2.0;
        let norm = 1.0 + 2.0 * b * b;
        close(mode.omega, lambda.sqrt(), 1e-14);
        close(mode.groups[0], 1.0 / norm, 1e-14);
        // gᵀ M⁻¹ g = 1 + 1/2.
        close(mode.meshes[0], (1.0 - b).powi(2) / norm / 1.5, 1e-14);
        close(mode.strain_of_contacts.unwrap(), 2.0 * (1.0 - b).powi(2) / norm / lambda, 1e-14);
        // S = I: tr(M S) = 3, (M φ)ᵀ (M φ) = (1 + 4 b²)/norm.
        close(mode.motion.unwrap(), (1.0 + 4.0 * b * b) / norm / 3.0, 1e-14);
    }
    let shares = motion_shares(&spec, &still, &groups).unwrap();
    close(shares[0], 1.0 / 3.0, 1e-15);
    assert_eq!(motion_shares(&spec, &DMatrix::zeros(2, 2), &groups), None);
}

#[test]
fn a_linear_law_has_the_tangent_and_the_restitution_of_the_power_law() {
    let scene = Scene::reference().unwrap();
    let model = Model::new(&scene, &[]).unwrap();
    let structure = &model.simulation.structure;
    let laws = simplify::linear_laws(structure).unwrap();
    let linear = Model::new(&scene, &[Step::Linear(laws)]).unwrap();
    let rest = equilibrium(structure.spec()).unwrap();
    for (j, contact) in linear.simulation.structure.spec().contacts.iter().enumerate() {
        let (k, force) = (structure.spec().contacts[j].stiffness.mean(), rest.forces[j]);
        // F = K p^1.5, dF/dp = 1.5 K p^0.5 at p = (F/K)^(2/3).
        let tangent = 1.5 * k * (force / k).powf(1.0 / 3.0);
        close(contact.stiffness.mean(), tangent, 1e-12 * tangent);
        assert!(matches!(contact.law, Law::KelvinVoigt(..)));
        let [e, wanted] = [&linear.simulation.structure, structure].map(|s| s.free_restitution(j, 1.0).unwrap());
        close(e, wanted, 1e-12);
    }
    // The same laws whatever freedoms are left.
    let steps = [Step::Set(FREEDOMS, json!("in-phase")), Step::Linear(simplify::linear_laws(structure).unwrap())];
    let reduced = Model::new(&scene, &steps).unwrap();
    let [few, all] = [&reduced, &linear].map(|model| model.simulation.structure.spec().contacts[0].stiffness.clone());
    assert_eq!(few, all);
}

#[test]
fn ramps_become_steps_in_their_middle() {
    let pair = |stiffness: Value| {
        let train = json!({
            "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true, "mean_load": 0.1,
            "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }], "stiffness": stiffness
        });
        scene(train, json!({ "q": [1.1] }))
    };
    let levels = |ramp: Value, kind: &str| {
        let period = std::f64::consts::TAU / 0.6;
        let mut stiffness = json!({ "kind": kind, "period": period });
        let own = if kind.starts_with("tooth") {
            json!({ "mean": 1, "contact_ratio": 1.6, "phase": 0.3 })
        } else {
            json!({ "high": 1.2, "low": 0.8, "duty": 0.4, "origin": -1.7 })
        };
        for (key, value) in own.as_object().unwrap().iter().chain(ramp.as_object().unwrap()) {
            stiffness[key] = value.clone();
        }
        pair(stiffness)
    };
    for (ramped, stepped) in [("trapezoidal", "rectangular"), ("tooth-pairs-trapezoidal", "tooth-pairs")] {
        let ramped = levels(json!({ "ramp": 0.1 }), ramped);
        let found = Model::new(&ramped, &[Step::Stepped]).unwrap();
        let wanted = levels(json!({}), stepped).build().unwrap().spec;
        let value = |stiffness: &Stiffness, t: f64| match stiffness {
            Stiffness::Periodic { period, origin, pieces } => {
                let place = ((t - origin) / period - pieces[0].start).rem_euclid(1.0) + pieces[0].start;
                assert!(pieces.len() == 2 && pieces.iter().all(|piece| piece.slope == 0.0), "{pieces:?}");
                pieces.iter().rev().find(|piece| piece.start <= place).unwrap().value
            }
            other => panic!("{other:?}"),
        };
        let (a, b) = (&found.simulation.structure.spec().contacts[0].stiffness, &wanted.contacts[0].stiffness);
        for i in 0..1000 {
            let t = 0.02 * f64::from(i) + 0.0013;
            close(value(a, t), value(b, t), 1e-12);
        }
        close(a.mean(), 1.0 - 0.04 * f64::from(u8::from(stepped == "rectangular")), 1e-12);
    }
}

#[test]
fn freedoms_are_grouped_by_name() {
    let names = |words: &str| words.split(' ').map(String::from).collect::<Vec<_>>();
    let words = |list: &str| groups(&names(list)).into_iter().map(|group| group.words).collect::<Vec<_>>();
    assert_eq!(
        words("x_s y_s u_s xi_1 eta_1 u_1 xi_2 eta_2 u_2 u_c"),
        ["sun centre", "sun rotation", "planets radial", "planets tangential", "planets rotation", "carrier rotation"]
    );
    assert_eq!(words("x_1 y_1 u_1 x_2 y_2 u_2").len(), 4);
    assert_eq!(words("q1 q2 arm"), ["q1", "q2", "arm"]);
}

#[test]
fn scatter_is_taken_into_account() {
    let motion = |apart: [f64; 2], period: Option<u64>| Motion {
        freedoms: 1,
        settled: crate::orbit::Motion { period, ..crate::orbit::Motion::of(&crate::orbit::ApproachEnd::default()) },
        followed: true,
        cycles: 1,
        meshes: vec![Mesh {
            family: "mesh".to_owned(),
            apart: Estimate { value: apart[0], error: apart[1] },
            separations: 1.0,
            separation_s: None,
            peak: None,
            mean_force: Estimate::default(),
        }],
        work: CycleWork::default(),
        end: Seed::default(),
    };
    let verdict = |a: &Motion, b: &Motion| judge(a, b, &changes(a, b), 0.01);
    let full = motion([0.5, 0.003], None);
    // Changes with standard errors √2·0.003: 0.0042; twice that is 0.0085.
    assert_eq!(verdict(&full, &motion([0.501, 0.003], None)), Verdict::Enough);
    assert_eq!(verdict(&full, &motion([0.505, 0.003], None)), Verdict::Unclear);
    assert_eq!(verdict(&full, &motion([0.515, 0.003], None)), Verdict::Unclear);
    assert_eq!(verdict(&full, &motion([0.52, 0.003], None)), Verdict::NotEnough);
    // An irregular motion is not a periodic one, and one of period 1 none of period 2.
    assert_eq!(verdict(&full, &motion([0.5, 0.0], Some(1))), Verdict::NotEnough);
    assert_eq!(verdict(&motion([0.5, 0.0], Some(2)), &motion([0.5, 0.0], Some(1))), Verdict::NotEnough);
    // A long transient of the same measures is.
    assert_eq!(verdict(&motion([0.5, 1e-6], None), &motion([0.5, 0.0], Some(1))), Verdict::Enough);
    // Of one that drifts, ten times the scatter of its ten stretches counts: 10 √10 1e-4 = 0.0032.
    let drifting = motion([0.5, 1e-4], None);
    assert!(drifting.settling());
    for (apart, wanted) in [(0.506, Verdict::Enough), (0.508, Verdict::Unclear), (0.512, Verdict::Unclear)] {
        assert_eq!(verdict(&drifting, &motion([apart, 0.0], Some(1))), wanted);
        assert_eq!(verdict(&motion([apart, 0.0], Some(1)), &drifting), wanted);
    }
    assert_eq!(verdict(&drifting, &motion([0.514, 0.0], None)), Verdict::NotEnough);
}
