//! Numbers of scenes found from natural frequencies and static forces.
//!
//! The reference stage's values are those printed in its description; each is met to half a unit of its last digit
//! where it follows from the targets, and by the sensitivity times the rounding of the targets otherwise.

use flank::{
    Task,
    gear::contact::Ratio,
    scene::Scene,
    study::{
        StudyError,
        identify::{Identification, IdentifyError, Parameter, Quantity, Side, Target, identify},
    },
    system::bonded_stiffness,
    train::planetary::{Family, families},
};

const BEARING: &str = "/train/planet/translation/stiffness_n_per_m";
const SUN: &str = "/train/sun/translation/stiffness_n_per_m";
const RING: &str = "/train/ring/translation/stiffness_n_per_m";
const SUN_TURN: &str = "/train/sun/rotation/stiffness_n_per_m";
const RING_TURN: &str = "/train/ring/rotation/stiffness_n_per_m";
const CARRIER_TURN: &str = "/train/carrier/rotation/stiffness_n_per_m";
const CARRIER_MASS: &str = "/train/carrier/rotary_mass_kg";
const SUN_MESH: &str = "/train/sun_mesh/stiffness";
const RING_MESH: &str = "/train/ring_mesh/stiffness";

fn stage(preset: &str) -> Scene {
    let text = format!(
        r#"{{ "flank": 1, "train": {{ "kind": "planetary", "preset": "{preset}", "load": {{ "output_torque_nm": 500 }} }},
            "run": {{ "t_end_s": 1 }} }}"#
    );
    Scene::from_json(&text, preset).unwrap()
}

fn vary(pointers: &[&str], [low, high]: [f64; 2]) -> Parameter {
    Parameter { pointers: pointers.iter().map(ToString::to_string).collect(), low, high }
}

fn targets(texts: &[&str]) -> Vec<Target> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

fn solve(scene: &Scene, parameters: &[Parameter], texts: &[&str]) -> Identification {
    identify(scene, parameters, &targets(texts), Task::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Every target met as far as rounding goes: natural frequencies of stiff stages carry some 1e-12.
fn assert_met(found: &Identification) {
    for target in &found.targets {
        assert!(target.residual.abs() <= 1e-8 * target.wanted, "{target:?}");
    }
}

/// Natural frequencies of one family, Hz.
fn hertz(scene: &Scene, family: Family) -> Vec<f64> {
    let spec = scene.build().unwrap().spec;
    let parts = families(&spec, &bonded_stiffness(&spec, None)).unwrap();
    parts.iter().find(|part| part.family == family).unwrap().hertz()
}

/// Half a unit of the last digit printed in the natural frequencies and the force decides how far numbers may be off:
/// with that as σ, `n` targets off by σ each move a number by no more than `√n` standard errors.
fn assert_within_rounding(found: &Identification) {
    let root = (found.targets.len() as f64).sqrt();
    for p in &found.parameters {
        let error = p.standard_error.unwrap();
        assert!((p.found - p.own).abs() <= root * error, "{p:?}");
        // Worth asking only if rounding leaves something over.
        assert!(error < 0.01 * p.own, "{p:?}");
    }
}

#[test]
fn the_default_set_follows_from_its_own_printed_frequencies() {
    let scene = stage("reference-heavy");
    let one = |pointer, bounds, target| assert_within_rounding(&solve(&scene, &[vary(&[pointer], bounds)], &[target]));
    one(BEARING, [1e7, 1e9], "translational:2=882.63:0.005");
    one(RING, [1e8, 1e10], "translational:3=1785.12:0.005");
    let turns = [vary(&[SUN_TURN], [1e6, 5e7]), vary(&[CARRIER_TURN], [1e8, 1e10])];
    assert_within_rounding(&solve(&scene, &turns, &["rotational:3=1060.39:0.005", "force:sun-planet 1=773.25:0.005"]));
}

/// The default set is a compromise over all published frequencies. From one published value alone a number comes out
/// off by the error of that compromise, as printed beside it, over the sensitivity.
#[test]
fn published_values_move_the_default_set_by_its_printed_errors() {
    let scene = stage("reference-heavy");
    for (pointer, bounds, target, error) in
        [(BEARING, [1e7, 1e9], "translational:2=889", -0.7e-2), (RING, [1e8, 1e10], "translational:3=1791", -0.3e-2)]
    {
        let found = solve(&scene, &[vary(&[pointer], bounds)], &[target]);
        assert_met(&found);
        let (p, slope) = (&found.parameters[0], found.sensitivity[0][0].unwrap());
        let shift = (p.found / p.own).ln();
        // The error is printed to a tenth of a percent; second order is the square of the shift.
        assert!((shift * slope + error).abs() <= 0.05e-2 + shift * shift, "{p:?}, {slope} % per %");
        assert!(found.uniqueness.is_unique() && found.solutions.len() == 1);
    }
    // The bearing lies in the band of all acceptable fits.
    let bearing = solve(&scene, &[vary(&[BEARING], [1e7, 1e9])], &["translational:2=889"]).parameters[0].found;
    assert!((0.91e8..=1.08e8).contains(&bearing));
    // Shaft stiffnesses to their printed digits, 2.4e7 and 5e8, from carrier mode and mean force.
    let turns = [vary(&[SUN_TURN], [1e6, 1e9]), vary(&[CARRIER_TURN], [1e7, 1e11])];
    let found = solve(&scene, &turns, &["rotational:3=1046", "force:sun-planet 1=774"]);
    assert_met(&found);
    assert!((found.parameters[0].found - 2.4e7).abs() <= 0.05e7);
    assert!((found.parameters[1].found - 5e8).abs() <= 0.5e8);
    // A stiff sun shaft with a soft output shaft does as well, and is not kept back.
    assert_eq!(found.solutions.len(), 2);
    assert!(found.solutions[1].values[0] > 5.0 * found.solutions[0].values[0]);
}

/// Moves along every free direction by a little: targets must stay to second order.
fn assert_free(scene: &Scene, found: &Identification, texts: &[&str]) {
    let solution = found.apply(scene).unwrap();
    for direction in &found.uniqueness.free {
        let step = 1e-3;
        let moved = direction.moves.iter().flat_map(|part| {
            let p = found.parameters.iter().find(|p| p.pointers.join(",") == part.number).unwrap();
            let value = p.found * (step * part.percent).exp();
            p.pointers.iter().map(move |pointer| (pointer.as_str(), value.into()))
        });
        let moved = solution.with_all(moved).unwrap();
        for (target, text) in found.targets.iter().zip(texts) {
            let name: Quantity = text.parse::<Target>().unwrap().quantity;
            let got = read(&moved, &name);
            // Parts below 2 % of the largest are left out of a direction, each with a sensitivity below 1.
            let tolerance = 0.02 * step * found.parameters.len() as f64 + 10.0 * step * step;
            assert!((got - target.got).abs() <= tolerance * target.got, "{name}: {got}, {target:?}, {direction}");
        }
    }
}

/// A quantity of a scene, read by asking for it.
fn read(scene: &Scene, quantity: &Quantity) -> f64 {
    let spec = scene.build().unwrap().spec;
    match quantity {
        Quantity::Family(family, number) => hertz(scene, *family)[number - 1],
        Quantity::Force(name) => {
            let j = spec.contacts.iter().position(|contact| contact.name == *name).unwrap();
            flank::system::equilibrium(&spec).unwrap().forces[j]
        }
        _ => unreachable!("not asked for"),
    }
}

#[test]
fn carrier_stiffness_and_mass_are_traded_off_against_each_other() {
    let (scene, wanted) = (stage("reference-heavy"), ["rotational:3=1046", "force:sun-planet 1=774"]);
    let parameters =
        [vary(&[SUN_TURN], [1e6, 1e9]), vary(&[CARRIER_TURN], [1e7, 1e11]), vary(&[CARRIER_MASS], [1.0, 100.0])];
    let found = solve(&scene, &parameters, &wanted);
    assert_met(&found);
    let uniqueness = &found.uniqueness;
    assert!(!uniqueness.is_unique());
    assert_eq!((uniqueness.rank, uniqueness.free.len()), (2, 1));
    let names: Vec<&str> = uniqueness.free[0].moves.iter().map(|part| part.number.as_str()).collect();
    assert_eq!(names[..2], [CARRIER_TURN, CARRIER_MASS]);
    assert!(found.parameters.iter().all(|p| p.standard_error.is_none()));
    assert!(found.solutions.len() > 10);
    assert_free(&scene, &found, &wanted);
    assert!(uniqueness.to_string().starts_with("Not unique: 3 numbers from 2 targets."));
}

/// 1 % of 412 Hz leaves the sun's support open: it floats.
#[test]
fn the_support_of_a_floating_sun_is_hardly_seen() {
    let scene = stage("reference-heavy");
    let found = solve(&scene, &[vary(&[SUN], [1e4, 1e9])], &["translational:1=431.39"]);
    assert!(found.sensitivity[0][0].unwrap() < 0.01, "{:?}", found.sensitivity);
    assert_eq!(found.uniqueness.weak.len(), 1);
    assert!(found.uniqueness.weak[0].within_sigma_percent.unwrap() > 100.0);
    // The published frequency, 4.7 % below the default set's, lies below what any support gives.
    let found = solve(&scene, &[vary(&[SUN], [0.0, 1e9])], &["translational:1=412"]);
    assert_eq!((found.parameters[0].found, found.parameters[0].at_bound), (0.0, Some(Side::Low)));
    assert!(found.targets[0].got > 1.04 * 412.0);
}

/// Two meshes tied to one number; every value to half a unit of its last printed digit.
#[test]
fn the_set_with_exact_frequencies_comes_out_to_its_printed_digits() {
    let scene = stage("reference-heavy").with(SUN, 0.0.into()).unwrap();
    let meshes = vary(&[SUN_MESH, RING_MESH], [5e7, 1e9]);
    let parameters = [meshes, vary(&[BEARING], [1e7, 1e9]), vary(&[RING], [1e8, 1e10])];
    let found = solve(&scene, &parameters, &["translational:1=412", "translational:2=889", "translational:3=1791"]);
    assert_met(&found);
    for (p, (printed, unit)) in found.parameters.iter().zip([(1.9091e8, 1e4), (1.0008e8, 1e4), (1.9207e9, 1e5)]) {
        assert!((p.found - printed).abs() <= 0.5 * unit, "{p:?}");
    }
    // The ring's support is weakly determined: its mode is hardly the ring's.
    assert_eq!(found.uniqueness.weak[0].moves[0].number, RING);

    let turns = [(CARRIER_MASS, 3.5), (CARRIER_TURN, 9.45e10)].map(|(pointer, value)| (pointer, value.into()));
    let scene = found.apply(&scene).unwrap().with_all(turns).unwrap();
    let parameters = [vary(&[SUN_TURN], [1e7, 1e9]), vary(&[RING_TURN], [1e8, 1e11])];
    // The model's own 1045.8 Hz, as printed.
    let found = solve(&scene, &parameters, &["rotational:2=919", "rotational:3=1045.8"]);
    assert_met(&found);
    let nearest = |printed: [f64; 2]| {
        let off = |s: &[f64]| (s[0] / printed[0] - 1.0).abs().max((s[1] / printed[1] - 1.0).abs());
        found.solutions.iter().map(|s| s.values.clone()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
    };
    let values = nearest([5.09e7, 5.06e8]);
    assert!((values[0] - 5.09e7).abs() <= 0.005e7 && (values[1] - 5.06e8).abs() <= 0.005e8, "{values:?}");
}

#[test]
fn nine_numbers_do_not_follow_from_six_targets() {
    let scene = stage("reference-heavy");
    let parameters = [
        vary(&[SUN_MESH], [1e8, 1e9]),
        vary(&[RING_MESH], [1e8, 1e9]),
        vary(&[BEARING], [1e7, 1e9]),
        vary(&[SUN], [1e4, 1e9]),
        vary(&[RING], [1e8, 1e10]),
        vary(&[SUN_TURN], [1e6, 1e9]),
        vary(&[RING_TURN], [1e7, 1e11]),
        vary(&[CARRIER_TURN], [1e7, 1e11]),
        vary(&[CARRIER_MASS], [1.0, 100.0]),
    ];
    let wanted = [
        "translational:1=412",
        "translational:2=889",
        "translational:3=1791",
        "rotational:2=919",
        "rotational:3=1046",
        "force:sun-planet 1=774",
    ];
    let found = solve(&scene, &parameters, &wanted);
    let uniqueness = &found.uniqueness;
    assert_eq!((uniqueness.unknowns, uniqueness.targets, uniqueness.rank), (9, 6, 6));
    assert_eq!(uniqueness.free.len(), 3);
    assert_free(&scene, &found, &wanted);
    assert!(uniqueness.to_string().starts_with("Not unique: 9 numbers from 6 targets."));
    // Every value can be met, by sets of numbers that have little in common: the fit proves nothing about them.
    assert!(found.chi_square < 1e-6);
    assert!(found.solutions.len() > 1);
}

/// A stage with other stiffnesses than the published ones, identified back from its own frequencies.
#[test]
fn known_stiffnesses_come_back() {
    let published = stage("lin-parker");
    let known = [(SUN_MESH, 4.3e8), (RING_MESH, 5.6e8), (BEARING, 1.3e8), (RING, 0.8e8), (RING_TURN, 1.4e9)];
    let changed = published.with_all(known.map(|(pointer, value)| (pointer, value.into()))).unwrap();
    let of = |family| {
        let rows = hertz(&changed, family).into_iter().enumerate().filter(|(_, f)| *f > 0.0);
        rows.map(|(i, f)| Target::new(Quantity::Family(family, i + 1), f)).collect::<Vec<Target>>()
    };
    let targets = [of(Family::Rotational), of(Family::Translational)].concat();
    let parameters = known.map(|(pointer, _)| vary(&[pointer], [1e7, 1e10]));
    let found = identify(&published, &parameters, &targets, Task::default()).unwrap();
    let least = *found.uniqueness.singular_values.last().unwrap();
    assert!(found.uniqueness.is_unique() && found.uniqueness.weak.is_empty() && least > 1.0);
    for (p, (pointer, value)) in found.parameters.iter().zip(known) {
        // Where descents end, |Jᵀr| is 1e-5 over a distance to the bounds of at least 1; the number is then off by
        // 1e-5 over the square of the least singular value, in its logarithm.
        assert!((p.found / value).ln().abs() <= 1e-5 / (least * least), "{pointer}: {p:?}");
    }
}

#[test]
fn the_nearest_frequency_says_which_it_is() {
    let scene = stage("reference-heavy");
    let bearing = [vary(&[BEARING], [8e7, 1.2e8])];
    let found = solve(&scene, &bearing, &["frequency=890"]);
    assert_eq!(found.targets[0].matched.as_deref(), Some("translational:2"));
    assert_met(&found);
    // Counted over all modes, repeated ones included: R1 comes after the pair T1.
    let found = solve(&scene, &bearing, &["mode:5=890"]);
    assert_met(&found);
    assert!((read(&found.apply(&scene).unwrap(), &Quantity::Family(Family::Translational, 2)) - 890.0).abs() < 1e-5);
}

/// A mass on a power-law wall under load: `ω² m = n K^{1/n} F^{1−1/n}`.
#[test]
fn power_laws_are_taken_at_their_tangent() {
    let wall = |load: f64| {
        let text = format!(
            r#"{{ "flank": 1, "train": {{ "kind": "wall", "mass_kg": 2, "load_n": {load:?},
                "wall": {{ "side": "above", "position_m": 0 }}, "contact_stiffness": 1e9,
                "law": {{ "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0 }} }}, "run": {{ "t_end_s": 1 }} }}"#
        );
        Scene::from_json(&text, "wall").unwrap()
    };
    let (k, load, n) = (3e9f64, 50.0f64, Ratio { p: 3, q: 2 }.value());
    let omega = (n * k.powf(n.recip()) * load.powf(1.0 - n.recip()) / 2.0).sqrt();
    let target = Target::new(Quantity::Mode(1), omega / std::f64::consts::TAU);
    let stiffness = [vary(&["/train/contact_stiffness"], [1e8, 1e10])];
    let found = identify(&wall(load), &stiffness, std::slice::from_ref(&target), Task::default()).unwrap();
    assert!((found.parameters[0].found / k - 1.0).abs() < 1e-8, "{found:?}");
    assert_eq!(found.tangent_contacts.len(), 1);
    // ω goes with K^{1/2n}.
    assert!((found.sensitivity[0][0].unwrap() - 1.0 / 3.0).abs() < 1e-6);
    let error = identify(&wall(0.0), &stiffness, &[target], Task::default()).unwrap_err();
    assert!(error.to_string().contains("give the train a load"), "{error}");
}

#[test]
fn rigid_contacts_have_no_frequencies() {
    let text = r#"{ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 10,
        "wall": { "side": "above", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 } },
        "run": { "t_end_s": 1 } }"#;
    let scene = Scene::from_json(text, "ball").unwrap();
    let stiffness = vary(&["/train/stiffness_n_per_m"], [1.0, 100.0]);
    let error = identify(&scene, &[stiffness], &targets(&["mode:1=3"]), Task::default()).unwrap_err();
    assert!(error.to_string().contains("give them a linear law"), "{error}");
}

#[test]
fn everything_wrong_with_a_question_is_said_at_once() {
    let scene = stage("reference-heavy");
    let parameters = [
        vary(&["/train/sun/rotation/stifness_n_per_m"], [1e6, 1e9]),
        vary(&["/train/sun"], [1.0, 2.0]),
        vary(&[BEARING], [1e9, 1e7]),
        vary(&["/train/planets"], [2.0, 4.0]),
        vary(&["/train/sun/mass_kg"], [-1.0, 4.0]),
        vary(&["/train/sun_mesh/half_backlash_m"], [0.0, 1.0]),
        vary(&[RING, RING], [1e8, 1e9]),
    ];
    let wanted = targets(&["rotational:9=1046", "planet:1=300", "force:sun-planet 4=774"]);
    let error = identify(&scene, &parameters, &wanted, Task::default()).unwrap_err();
    let StudyError::Identify(IdentifyError { faults }) = error else { panic!("{error}") };
    let places = parameters.iter().map(ToString::to_string).chain(wanted.iter().map(ToString::to_string));
    assert_eq!(faults.iter().map(|fault| fault.pointer.clone()).collect::<Vec<_>>(), places.collect::<Vec<_>>());
    assert!(faults.iter().all(|fault| !fault.remedy.is_empty()), "{faults:?}");
    let told = |i: usize, word: &str| assert!(faults[i].to_string().contains(word), "{}", faults[i]);
    told(0, "stiffness_n_per_m");
    told(1, "mass_kg");
    told(3, "whole number");
    told(4, "-1");
    told(5, "null");
    told(6, "second time");
    told(7, "6 rotational");
    told(8, "0 planet");
    told(9, "ring-planet 3");
}

#[test]
fn questions_read_as_they_are_written() {
    for text in ["/a/b=1:2", "/a,/b=1e-7:1e9", "/a=-1.5:0"] {
        assert_eq!(text.parse::<Parameter>().unwrap().to_string(), text);
    }
    for text in ["rotational:2=919:0.5", "mode:1=3:1", "frequency=889:2e-4", "force:sun-planet 1=-774:1e7"] {
        assert_eq!(text.parse::<Target>().unwrap().to_string(), text);
    }
    for text in ["planet:1=300±2", "planet:1=300+-2", "planet:1=300 : 2"] {
        assert_eq!(text.parse::<Target>().unwrap().sigma, 2.0);
    }
    assert_eq!("mode:2=300".parse::<Target>().unwrap().sigma, 3.0);
    for wrong in ["/a", "/a=1", "/a=1:x", "/a=2:1", "/a=1:1", "a=1:2", "/a,=1:2", "/a=0:inf", "/a=NaN:1", "=1:2"] {
        assert!(wrong.parse::<Parameter>().is_err(), "{wrong}");
    }
    for wrong in
        ["mode:0=1", "mode=1", "force=1", "force:=1", "radial:1=1", "mode:1=0", "mode:1=1:0", "mode:1=1:-1", "="]
    {
        assert!(wrong.parse::<Target>().is_err(), "{wrong}");
    }
}
