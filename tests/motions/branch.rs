//! Branches of orbits and their special points, against closed forms and numbers from elsewhere.

use flank::{
    Simulation, Task,
    branch::{
        Branch, BranchProgress, Codimension, Continuation, Curve, CurvePoint, Family, Special, SpecialKind, curves,
    },
    orbit::{Search, SectionMap},
    scene::Scene,
    simulation::Parameter,
};
use nalgebra::{Complex, Matrix3, Vector3};
use serde_json::{Value, json};

fn follow(scene: &Value, pointers: &[&str], ends: [f64; 2], doublings: u32) -> Vec<Branch> {
    let scene = Scene::from_value(scene.clone(), "test").unwrap();
    let parameter = Parameter::new(scene.resolved(), pointers).unwrap();
    let asked = Continuation { doublings, ..Continuation::default() };
    let family = Family::new(&scene, parameter, ends).unwrap();
    asked.run(&family, None, &mut |_| Ok(()), Task::default()).unwrap().branches
}

fn specials(branches: &[Branch]) -> Vec<&Special> {
    branches.iter().flat_map(|branch| &branch.specials).collect()
}

/// Exactly these special points are on the first branch, each to 1e-11 of its value.
fn expect(branches: &[Branch], expected: &[(SpecialKind, f64)]) {
    let mut found: Vec<(SpecialKind, f64)> = branches[0].specials.iter().map(|s| (s.kind, s.value)).collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for ((kind, value), (expected_kind, expected)) in found.iter().zip(expected) {
        assert_eq!(kind, expected_kind, "{found:?}");
        assert!((value - expected).abs() <= 1e-11 * expected.abs(), "{value} {expected}");
    }
    assert!(specials(branches).iter().all(|special| special.residual <= 1e-9));
}

const FREQUENCY: &str = "/train/transmission_error/0/frequency";

/// A pair, damped everywhere, that starts in contact.
fn pair(damping: f64, load: f64, error: f64, frequency: f64, start: [f64; 2]) -> Value {
    json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": damping, "damping_in_gap": true, "mean_load": load, "stiffness": 1,
            "transmission_error": [{ "amplitude": error, "frequency": frequency }],
        },
        "initial": { "q": [start[0]], "v": [start[1]] },
        "run": { "cycles": 400 },
    })
}

/// The response of a pair with both jumps. It loses contact where the amplitude of the linear vibration is that of the static deflection:
/// `(F_a² − F_m²) Ω⁴ + (2 − 4ζ²) F_m² Ω² − F_m² = 0`. The folds are those of a series code in quadruple precision.
#[test]
fn a_response_of_a_pair_has_its_folds_and_grazes() {
    let (zeta, load, error) = (0.05f64, 0.1f64, 0.05f64);
    let (a, b, c) = (error * error - load * load, (2.0 - 4.0 * zeta * zeta) * load * load, -load * load);
    let root = (b * b - 4.0 * a * c).sqrt();
    let [low, high] = [(-b + root) / (2.0 * a), (-b - root) / (2.0 * a)].map(f64::sqrt);
    let branches = follow(&pair(zeta, load, error, 0.6, [1.1, 0.0]), &[FREQUENCY], [0.5, 1.6], 0);
    expect(
        &branches,
        &[
            (SpecialKind::Fold, 0.708_031_618_721_832),
            (SpecialKind::GrazingSoft, low),
            (SpecialKind::Fold, 0.828_463_984_388_216),
            (SpecialKind::GrazingSoft, high),
        ],
    );
    // The branch between the folds is unstable, the others are stable.
    let between = 0.708_031_618..0.828_463_985;
    let unstable: Vec<f64> = branches[0].points.iter().filter(|p| !p.is_stable).map(|p| p.value).collect();
    assert!(unstable.len() > 5 && unstable.iter().all(|value| between.contains(value)));
    assert_eq!(branches[0].points[0].value, 0.5);
    assert_eq!(branches[0].points.last().unwrap().value, 1.6);
}

/// The first doubling of a single-sided orbit, from elsewhere; here found from the orbits of period four and two that it ends in.
#[test]
fn orbits_lead_back_to_what_they_are_born_from() {
    let branches = follow(&pair(0.05, 0.1, 0.2, 0.9, [1.1, 0.0]), &[FREQUENCY], [0.75, 1.1], 0);
    let doubling =
        specials(&branches).into_iter().find(|s| s.kind == SpecialKind::PeriodDoubling && s.period == 1).unwrap();
    assert!((doubling.value - 0.794_632_401_288).abs() <= 1e-12, "{}", doubling.value);
    assert!((doubling.multiplier.re + 1.0).abs() <= 1e-9 && doubling.multiplier.im == 0.0);
    assert!(branches.iter().any(|branch| branch.points.iter().all(|point| point.period == 1)));
}

/// A mass on a spring before a wall above it.
fn wall(damping: f64, position: f64, load: f64, law: &Value, frequency: f64, start: [f64; 2]) -> Value {
    let mut scene = json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1.0, "damping_n_s_per_m": damping, "load_n": load,
            "load_harmonics": [{ "amplitude_n": 1.0, "frequency_rad_per_s": frequency }],
            "wall": { "side": "above", "position_m": position }, "law": law,
        },
        "initial": { "q": [start[0]], "v": [start[1]] },
        "run": { "cycles": 400 },
    });
    if law["kind"] != "rigid" {
        scene["train"]["contact_stiffness"] = json!(20.0);
    }
    scene
}

const FORCING: &str = "/train/load_harmonics/0/frequency_rad_per_s";

/// Doublings of the orbit with one impact, of one that is undamped: closed form for restitutions 0.5, 0.6 and 0.9, Newton for 0.8. Each is
/// followed on to the next ones.
#[test]
fn impacts_double_where_they_do() {
    for (restitution, expected) in
        [(0.8, 2.653_347_727_855), (0.9, 2.652_885_597_90), (0.6, 2.655_778_891_24), (0.5, 2.658_152_417_31)]
    {
        let scene = wall(0.0, 0.0, 0.0, &json!({ "kind": "rigid", "restitution": restitution }), 2.5, [-0.7, 0.1]);
        let branches = follow(&scene, &[FORCING], [2.4, 2.75], 1);
        let first = &branches[0].specials[0];
        assert_eq!((first.kind, first.period, first.word.as_str()), (SpecialKind::PeriodDoubling, 1, "i0+"));
        // Eleven digits after the point are given.
        assert!((first.value - expected).abs() <= 1e-11, "{restitution}: {} {expected}", first.value);
        assert_eq!((branches[1].level, branches[1].points[0].period), (1, 2));
        assert!(branches[1].points[0].is_stable && !branches[0].points.last().unwrap().is_stable);
    }
}

/// `1/|k − ω² + iωc|`, and the frequencies at which `f` times it is `size`, by bisection.
fn crossing(k: f64, c: f64, size: f64, f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let off = |w: f64| f(w) / (k - w * w).hypot(w * c) - size;
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if off(middle) * off(low) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// A wall at 0.5 is touched where the amplitude of the free vibration is 0.5, whatever it is made of; its law tells the kind.
#[test]
fn a_graze_has_the_kind_of_its_law() {
    let touches = crossing(1.0, 0.1, 0.5, |_| 1.0, 1.5, 2.0);
    let damped = |release: &str| json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.6, "release": release });
    let hysteresis = json!({ "kind": "power", "exponent": "3/2", "hysteresis_coefficient": 0.5, "speed_floor_m_per_s": 1e-6, "initial_speed_m_per_s": 0.05 });
    for (law, kind) in [
        (json!({ "kind": "rigid", "restitution": 0.7 }), SpecialKind::GrazingRigid),
        (damped("deflection"), SpecialKind::GrazingDamped),
        (damped("force"), SpecialKind::GrazingDamped),
        (hysteresis, SpecialKind::GrazingSoft),
    ] {
        let branches = follow(&wall(0.1, 0.5, 0.0, &law, 1.9, [0.0, 0.0]), &[FORCING], [1.65, 2.2], 0);
        expect(&branches, &[(kind, touches)]);
    }
}

/// From the side of the impacts the graze ends the branch: it is the limit of an orbit whose impact loses its speed.
#[test]
fn a_branch_of_impacts_ends_at_its_graze() {
    let law = json!({ "kind": "rigid", "restitution": 0.7 });
    let branches = follow(&wall(0.1, 0.5, 0.0, &law, 1.6, [0.0, 0.0]), &[FORCING], [1.5, 2.0], 0);
    let touches = crossing(1.0, 0.1, 0.5, |_| 1.0, 1.5, 2.0);
    let graze = branches[0].specials.iter().find(|s| s.kind == SpecialKind::GrazingRigid).unwrap();
    // The derivative grows as the inverse of the speed: some digits go.
    assert!((graze.value - touches).abs() <= 1e-11, "{} {touches}", graze.value);
    assert!(branches[0].specials.iter().any(|s| s.kind == SpecialKind::Fold));
}

/// In contact all the time: a force that is kept by the damper falls to zero before the deflection does.
#[test]
fn a_force_that_touches_zero_is_a_graze() {
    // x = −1/3 at rest, 1/6 inside the wall at −1/2, which pushes back with 20/6.
    let by_deflection = |low, high| crossing(21.0, 0.7, 1.0 / 6.0, |_| 1.0, low, high);
    let by_force = |low, high| crossing(21.0, 0.7, 20.0 / 6.0, |w: f64| 20f64.hypot(0.6 * w), low, high);
    for (release, [first, last]) in [
        ("deflection", [by_deflection(3.0, 4.5), by_deflection(4.6, 6.0)]),
        ("force", [by_force(3.0, 4.5), by_force(4.6, 6.0)]),
    ] {
        let law = json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.6, "release": release });
        let branches = follow(&wall(0.1, -0.5, 3.0, &law, 3.0, [0.2, 0.0]), &[FORCING], [2.0, 6.0], 0);
        // Two more are where the zone is left for the gap.
        let is_first = |s: &&Special| s.kind == SpecialKind::GrazingDamped && s.word.is_empty();
        let grazes: Vec<&Special> = branches[0].specials.iter().filter(is_first).collect();
        assert_eq!(grazes.len(), 2);
        for (graze, expected) in grazes.iter().zip([first, last]) {
            assert!((graze.value - expected).abs() <= 1e-11 * expected, "{release}: {} {expected}", graze.value);
        }
    }
}

/// Where a rest ends, impacts whose number grows without end begin. On both sides the run itself has the word that it must have.
#[test]
fn a_rest_ends() {
    let law = json!({ "kind": "rigid", "restitution": 0.3 });
    let scene = wall(0.2, 0.0, 0.0, &law, 0.9, [-0.3, 0.1]);
    let branches = follow(&scene, &[FORCING], [0.8, 1.0], 0);
    let stick = branches[0].specials.iter().find(|s| s.kind == SpecialKind::Stick).unwrap();
    for (side, rests) in [(-1e-7, true), (1e-7, false)] {
        let mut other = scene.clone();
        *other.pointer_mut(FORCING).unwrap() = json!(stick.value + side);
        let simulation = Simulation::from_scene(Scene::from_value(other, "test").unwrap()).unwrap();
        let map = SectionMap::new(&simulation).unwrap();
        let start = map.follow(&map.start().unwrap(), 50).unwrap();
        let word = map.image(&start, 1).unwrap().word.join(" ");
        assert_eq!(word.contains('z'), rests, "{side}: {word}");
    }
}

/// A ball without rebound on a vibrating table of acceleration Γ g. It is let go where the table falls as fast, `sin θ = 1/Γ`, and flies
/// for at most a cycle; its rest vanishes where it lands at the very place, `Γ cos θ · 2π = (2π)²/2`: at `Γ² = 1 + π²`.
#[test]
fn a_rest_vanishes_where_the_ball_lands_as_it_is_let_go() {
    let mut ball: Value = serde_json::from_str(include_str!("../../examples/scenes/bouncing-ball.json")).unwrap();
    (ball["train"]["law"]["restitution"], ball["train"]["wall_motion"][0]["amplitude_m"]) = (json!(0), json!(2.5));
    let branches = follow(&ball, &["/train/wall_motion/0/amplitude_m"], [2.0, 3.6], 0);
    let specials: Vec<&Special> = branches[0].specials.iter().collect();
    let [stick] = specials[..] else { panic!("{specials:?}") };
    let exact = 1f64.hypot(std::f64::consts::PI);
    assert_eq!((stick.kind, stick.word.as_str()), (SpecialKind::Stick, "l0+ z0+"));
    assert!((stick.value - exact).abs() <= stick.uncertainty.min(1e-12 * exact), "{} {exact}", stick.value);
    // Beyond it the ball strikes without a rest.
    let last = &branches[0].points[branches[0].points.len() - 1];
    assert_eq!((last.value, last.word.as_str()), (3.6, "i0+"));
}

/// Two freedoms, each with a contact: impacts and contacts change places, and a torus is born. The orbit at each point is solved for anew.
/// Two values are those of a program of its own with 40 digits: Taylor series, Newton's method on the period, differences of runs.
#[test]
fn two_contacts_meet_and_a_torus_is_born() {
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1.0, 0.0], [0.0, 1.0]], "damping_n_s_per_m": [[0.06, -0.02], [-0.02, 0.04]],
            "stiffness_n_per_m": [[1.6, -0.6], [-0.6, 0.6]], "load_n": [0.2, 0.0],
            "load_harmonics": [{ "vector_n": [0.8, 0.0], "frequency_rad_per_s": 1.6 }],
            "contacts": [
                { "direction": [1.0, 0.0], "half_backlash_m": 0.4, "flanks": "drive", "law": { "kind": "rigid", "restitution": 0.7 } },
                { "direction": [0.0, 1.0], "half_backlash_m": 0.3, "flanks": "both", "stiffness": 8.0,
                  "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.2, "release": "deflection" } },
            ],
        },
        "initial": { "q": [0.0, 0.0], "v": [0.0, 0.0] },
        "run": { "cycles": 600 },
    });
    let branches = follow(&scene, &[FORCING], [1.2, 2.3], 0);
    for (kind, expected) in
        [(SpecialKind::Torus, 1.216_587_562_158_521), (SpecialKind::Coincidence, 1.692_078_913_237_279_7)]
    {
        let found = branches[0].specials.iter().filter(|special| special.kind == kind).map(|special| special.value);
        let off = found.map(|value| (value - expected).abs()).fold(f64::INFINITY, f64::min);
        assert!(off <= 1e-11 * expected, "{kind:?}: {off:e}");
    }
    let (mut tori, mut meetings) = (0, 0);
    for special in &branches[0].specials {
        let mut there = scene.clone();
        *there.pointer_mut(FORCING).unwrap() = json!(special.value);
        let point = &branches[0].points[special.point];
        there["initial"] = json!({ "q": point.section.x[..2], "v": point.section.x[2..] });
        let simulation = Simulation::from_scene(Scene::from_value(there.clone(), "test").unwrap()).unwrap();
        match special.kind {
            SpecialKind::Torus => {
                let found = Search { period: Some(1), starts: 0 }.run(&simulation, Task::default()).unwrap();
                let off = (found.orbits[0].largest_multiplier() - 1.0).abs();
                assert!(off <= 1e-9 && special.multiplier.im > 0.0, "{off:e}");
                tori += 1;
            }
            SpecialKind::Coincidence => {
                // A little before and behind, the orbit has the same events in another order.
                let words = [-1e-7, 1e-7].map(|side| {
                    let mut beside = there.clone();
                    *beside.pointer_mut(FORCING).unwrap() = json!(special.value + side);
                    let simulation = Simulation::from_scene(Scene::from_value(beside, "test").unwrap()).unwrap();
                    let found = Search { period: Some(1), starts: 0 }.run(&simulation, Task::default()).unwrap();
                    found.orbits[0].word()
                });
                let sorted = |word: &str| {
                    let mut letters: Vec<String> = word.split(' ').map(String::from).collect();
                    letters.sort();
                    letters
                };
                assert_ne!(words[0], words[1]);
                assert_eq!(sorted(&words[0]), sorted(&words[1]));
                meetings += 1;
            }
            _ => {}
        }
    }
    assert!(tori >= 1 && meetings >= 1, "{tori} {meetings}");
}

/// A train of masses one after the other, moved at the first one.
fn chain(matrices: [&Value; 3], load: f64, force: [f64; 2], contacts: &Value) -> Value {
    let [mass, damping, stiffness] = matrices;
    let n = mass.as_array().unwrap().len();
    let first = |size: f64| (0..n).map(|i| if i == 0 { size } else { 0.0 }).collect::<Vec<_>>();
    json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": mass, "damping_n_s_per_m": damping, "stiffness_n_per_m": stiffness, "load_n": first(load),
            "load_harmonics": [{ "vector_n": first(force[0]), "frequency_rad_per_s": force[1] }], "contacts": contacts,
        },
        "initial": { "q": first(0.0), "v": first(0.0) },
        "run": { "cycles": 400 },
    })
}

/// The special point of a kind that is nearest to an expected value.
fn nearest(branches: &[Branch], kind: SpecialKind, expected: f64) -> f64 {
    let off = |value: &f64| (value - expected).abs();
    let found = specials(branches).into_iter().filter(|special| special.kind == kind).map(|special| special.value);
    found.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(f64::NAN)
}

/// A step that is long for what changes in it: a multiplier goes from 0.82 to 1.43, or the time between two events is known far better from its other
/// side. Both values are those of a program of its own: exact pieces, Newton's method on half the period and on the period.
#[test]
fn what_lies_in_a_long_step_is_located() {
    let contact = json!([{ "direction": [1.0, -1.0], "half_backlash_m": 0.701, "stiffness": 19.367,
                           "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.081, "release": "force" } }]);
    let damping = json!([[0.204_048, -0.091_015], [-0.091_015, 0.091_015]]);
    let stiffness = json!([[1.872, -0.835], [-0.835, 0.835]]);
    let scene = chain([&json!([1.049, 0.792]), &damping, &stiffness], 0.0, [0.538, 0.84], &contact);
    let branches = follow(&scene, &["/train/contacts/0/half_backlash_m"], [0.64, 0.78], 0);
    let (expected, found) = (0.756_471_783_017_940_5, nearest(&branches, SpecialKind::Symmetry, 0.756));
    assert!((found - expected).abs() <= 1e-11 * expected, "{found}");
    assert!(branches[0].unlocated.is_empty(), "{:?}", branches[0].unlocated);

    let contacts = json!([
        { "direction": [0.0, 1.0], "half_backlash_m": 0.391, "stiffness": 14.088,
          "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.77, "release": "force" },
          "error": [{ "amplitude_m": 0.057, "frequency_rad_per_s": 0.821, "phase_rad": 1.931 }] },
        { "direction": [1.0, 0.0], "half_backlash_m": 0.275, "flanks": "drive", "stiffness": 17.569,
          "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.551, "release": "force" } },
    ]);
    let damping = json!([[0.225_356, -0.085_012], [-0.085_012, 0.085_012]]);
    let stiffness = json!([[2.126, -0.802], [-0.802, 0.802]]);
    let scene = chain([&json!([1.187, 0.871]), &damping, &stiffness], 0.176, [0.676, 0.821], &contacts);
    let branches = follow(&scene, &["/train/mass_kg/0"], [0.7552, 1.9931], 1);
    let (expected, found) = (1.587_569_950_491_998, nearest(&branches, SpecialKind::Coincidence, 1.5876));
    assert!((found - expected).abs() <= 1e-11 * expected, "{found}");
    assert!(branches.iter().all(|branch| branch.unlocated.is_empty()));
}

/// Impacts that vanish where the motion without them is on the same side of the graze: it gives the value all its digits, and is followed. The value is
/// that of the orbit without the impact whose gap closes just so, by a program of its own; on that branch the vibration is linear, and
/// touches the wall where its amplitude is the gap.
#[test]
fn the_motion_behind_a_rigid_graze_is_followed() {
    let rigid = |restitution: f64, gap: f64, flanks: &str| json!({ "direction": [0.0, 0.0, 1.0], "half_backlash_m": gap, "flanks": flanks, "law": { "kind": "rigid", "restitution": restitution } });
    let contacts = json!([rigid(0.18, 0.356, "drive"), rigid(0.0, 0.535, "both")]);
    let mass = [0.721, 0.955, 0.89];
    let damping = [[0.117_045, -0.063_09, 0.0], [-0.063_09, 0.119_43, -0.056_34], [0.0, -0.056_34, 0.056_34]];
    let stiffness = [[2.601, -1.402, 0.0], [-1.402, 2.654, -1.252], [0.0, -1.252, 1.252]];
    let scene = chain([&json!(mass), &json!(damping), &json!(stiffness)], 0.0, [0.628, 1.685], &contacts);
    let branches = follow(&scene, &[FORCING], [1.5, 2.2], 0);
    let (expected, found) = (1.782_597_358_597_0, nearest(&branches, SpecialKind::GrazingRigid, 1.7826));
    assert!((found - expected).abs() <= 1e-11 * expected, "{found}");
    let gap = |omega: f64| {
        let matrix = Matrix3::from_fn(|i, j| {
            let inertia = if i == j { mass[i] * omega * omega } else { 0.0 };
            Complex::new(stiffness[i][j] - inertia, omega * damping[i][j])
        });
        let force = Vector3::new(Complex::from(0.628), Complex::from(0.0), Complex::from(0.0));
        (matrix.try_inverse().unwrap() * force)[2].norm() - 0.356
    };
    let touches = nearest(&branches[1..], SpecialKind::GrazingRigid, 1.799);
    // The amplitude changes by some units for one of frequency.
    assert!(gap(touches).abs() <= 1e-11, "{touches}");
}

/// Numbers along which there is no branch.
#[test]
fn what_has_no_branch_is_refused() {
    let scene = Scene::from_file("examples/scenes/reference-heavy.json").unwrap();
    let refused = |pointer: &str, ends: [f64; 2], reason: &str| {
        let parameter = Parameter::new(scene.resolved(), &[pointer]).unwrap();
        let error = Family::new(&scene, parameter, ends);
        let text = error.unwrap_err().to_string();
        assert!(text.contains(reason), "{text}");
    };
    refused("/train/teeth/sun", [20.0, 30.0], "whole number");
    refused("/train/sun_mesh/error/0/order", [0.9, 1.1], "alone changes the frequency");
    assert!(Parameter::new(scene.resolved(), &["/train/masses/none"]).unwrap_err().contains("no number"));
}

/// A frequency and the period of the run move together, the latter by the inverse: at the ends of the range the orbits close in scenes that
/// are written for themselves.
#[test]
fn frequencies_and_periods_move_together() {
    let period = std::f64::consts::TAU / 0.7;
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "mass_kg": [[1.0]], "damping_n_s_per_m": [[0.2]], "stiffness_n_per_m": [[0.3]], "load_n": [0.4],
            "load_harmonics": [
                { "vector_n": [0.3], "frequency_rad_per_s": 0.7 },
                { "vector_n": [0.2], "frequency_rad_per_s": 1.4, "phase_rad": 0.5 },
            ],
            "contacts": [{ "direction": [1.0], "half_backlash_m": 0.5, "stiffness": 6.0, "flanks": "both",
                           "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.3, "release": "deflection" } }],
        },
        "initial": { "q": [0.1], "v": [0.0] },
        "run": { "cycles": 300, "period_s": period },
    });
    let second = "/train/load_harmonics/1/frequency_rad_per_s";
    let branches = follow(&scene, &[FORCING, second, "/run/period_s"], [0.6, 0.9], 0);
    for point in [branches[0].points.first().unwrap(), branches[0].points.last().unwrap()] {
        let factor = point.value / 0.7;
        let mut there = scene.clone();
        for (pointer, value) in [(FORCING, point.value), (second, 1.4 * factor), ("/run/period_s", period / factor)] {
            *there.pointer_mut(pointer).unwrap() = json!(value);
        }
        let simulation = Simulation::from_scene(Scene::from_value(there, "test").unwrap()).unwrap();
        let map = SectionMap::new(&simulation).unwrap();
        let end = map.follow(&point.section, point.period).unwrap();
        // The orbit closes to its residual, 1e-13 of its size and less.
        assert!(end.x.iter().zip(&point.section.x).all(|(a, b)| (a - b).abs() <= 1e-12));
    }
    assert!(branches[0].points.len() > 10);
}

/// Local minima of polynomials: of a quartic with two, of one without, and where the curve only falls.
#[test]
fn minima_are_where_a_polynomial_begins_to_rise() {
    // (x − 0.2)² (x − 0.7)²
    let (s, p) = (0.9, 0.14);
    let found = flank::poly::minima(&[p * p, -2.0 * s * p, s * s + 2.0 * p, -2.0 * s, 1.0]);
    assert_eq!(found.len(), 2);
    assert!((found[0] - 0.2).abs() <= 1e-9 && (found[1] - 0.7).abs() <= 1e-9, "{found:?}");
    assert!(flank::poly::minima(&[1.0, -1.0, -0.1, 0.02]).is_empty());
    assert!(flank::poly::minima(&[0.0, 1.0, -1.0]).is_empty());
}

/// The curves of `kind` of `scene` in the plane of two numbers.
fn plane(scene: &Value, kind: SpecialKind, first: (&str, [f64; 2]), second: (&str, [f64; 2])) -> Vec<Curve> {
    let scene = Scene::from_value(scene.clone(), "test").unwrap();
    let number = |pointer: &str| Parameter::new(scene.resolved(), &[pointer]).unwrap();
    let family = Family::new(&scene, number(first.0), first.1).unwrap().with(number(second.0), second.1).unwrap();
    let asked = Continuation { doublings: 0, ..Continuation::default() };
    let branches = asked.run(&family, None, &mut |_| Ok(()), Task::default()).unwrap().branches;
    curves(&family, kind, &branches, Vec::new(), &mut |_| Ok(()), Task::default()).unwrap()
}

/// One bounce a cycle begins at a fold and ends at a doubling, both in closed form (Holmes 1982).
#[test]
fn a_ball_on_a_table_doubles_on_the_curve_of_holmes() {
    let ball = Scene::from_file("examples/scenes/bouncing-ball.json").unwrap().resolved().clone();
    let fold = |e: f64| std::f64::consts::PI * (1.0 - e) / (1.0 + e);
    let doubling = |e: f64| fold(e).hypot(2.0 * (1.0 + e * e) / (1.0 + e).powi(2));
    for (kind, exact) in [(SpecialKind::Fold, &fold as &dyn Fn(f64) -> f64), (SpecialKind::PeriodDoubling, &doubling)] {
        let amplitude = ("/train/wall_motion/0/amplitude_m", [0.4, 3.0]);
        let curves = plane(&ball, kind, amplitude, ("/train/law/restitution", [0.2, 0.8]));
        assert!(curves.len() == 1 && curves[0].points.len() > 20, "{kind:?}: {}", curves.len());
        for point in &curves[0].points {
            let off = (point.value - exact(point.second)).abs();
            assert!(off <= 1e-11 * point.value, "{kind:?} {}: {off:e}", point.second);
        }
    }
}

/// Grazes of free motions, on both sides of the resonance, in the plane of frequency and load: closed forms of the amplitude.
#[test]
fn grazes_have_the_curves_of_their_closed_forms() {
    let (zeta, error) = (0.05f64, 0.05f64);
    let scene = pair(zeta, 0.1, error, 0.6, [1.1, 0.0]);
    let found = plane(&scene, SpecialKind::GrazingSoft, (FREQUENCY, [0.5, 1.6]), ("/train/mean_load", [0.02, 0.4]));
    assert_eq!(found.len(), 2);
    let amplitude = |w: f64| error * w * w / (1.0 - w * w).hypot(2.0 * zeta * w);
    for point in found.iter().flat_map(|curve| &curve.points) {
        assert!((point.second - amplitude(point.value)).abs() <= 1e-11, "{point:?}");
        assert!(point.codimension_two.is_none() && point.residual <= 1e-9);
    }
    for curve in &found {
        let [first, last] = [curve.points[0].clone(), curve.points.last().unwrap().clone()];
        let on_border = |p: &CurvePoint| [0.5, 1.6].contains(&p.value) || [0.02, 0.4].contains(&p.second);
        assert!(on_border(&first) && on_border(&last), "{:?}", curve.ends);
    }
    // A rigid wall, from the free motion and from the impacts.
    for (frequency, off) in [(1.9, 1e-11), (1.6, 1e-9)] {
        let law = json!({ "kind": "rigid", "restitution": 0.7 });
        let scene = wall(0.1, 0.5, 0.0, &law, frequency, [0.0, 0.0]);
        let second = ("/train/wall/position_m", [0.4, 0.7]);
        let found = plane(&scene, SpecialKind::GrazingRigid, (FORCING, [1.4, 2.2]), second);
        assert_eq!(found.len(), 1);
        assert!(found[0].points.len() > 10);
        for point in &found[0].points {
            let amplitude = 1.0 / (1.0 - point.value * point.value).hypot(0.1 * point.value);
            assert!((point.second - amplitude).abs() <= off, "{point:?} {amplitude}");
        }
    }
}

/// Both folds of a response lie on one curve with a cusp, where the response ceases to bend over. Beside the cusp there are two folds on one
/// side and none on the other.
#[test]
fn folds_meet_at_a_cusp() {
    let scene = pair(0.05, 0.1, 0.05, 0.6, [1.1, 0.0]);
    let found = plane(&scene, SpecialKind::Fold, (FREQUENCY, [0.6, 1.2]), ("/train/mean_load", [0.08, 0.6]));
    assert_eq!(found.len(), 1);
    let special: Vec<&CurvePoint> = found[0].points.iter().filter(|point| point.codimension_two.is_some()).collect();
    let [cusp] = special[..] else { panic!("{special:?}") };
    assert_eq!(cusp.codimension_two, Some(Codimension::Cusp));
    let folds = |load: f64| {
        let branches = follow(&pair(0.05, load, 0.05, 0.6, [1.1, 0.0]), &[FREQUENCY], [0.6, 1.2], 0);
        specials(&branches).into_iter().filter(|special| special.kind == SpecialKind::Fold).count()
    };
    assert_eq!((folds(cusp.second - 1e-3), folds(cusp.second + 1e-3)), (2, 0));
}

/// Points of the curves of a doubling and of the end of a rest are those that a branch at their second number has.
#[test]
fn points_of_curves_are_special_points_of_branches() {
    let rigid = |restitution: f64| json!({ "kind": "rigid", "restitution": restitution });
    let doubling = wall(0.0, 0.0, 0.0, &rigid(0.8), 2.5, [-0.7, 0.1]);
    let rest = wall(0.2, 0.0, 0.0, &rigid(0.0), 1.0, [-0.3, 0.1]);
    for (scene, kind, ends, (pointer, range)) in [
        (doubling, SpecialKind::PeriodDoubling, [2.4, 2.75], ("/train/law/restitution", [0.6, 0.9])),
        (rest, SpecialKind::Stick, [0.8, 2.4], ("/train/load_n", [-0.2, 0.1])),
    ] {
        let found = plane(&scene, kind, (FORCING, ends), (pointer, range));
        assert_eq!(found.len(), 1, "{kind:?}");
        let points = &found[0].points;
        for point in [&points[1], &points[points.len() / 2], &points[points.len() - 2]] {
            let mut other = scene.clone();
            *other.pointer_mut(pointer).unwrap() = json!(point.second);
            let branches = follow(&other, &[FORCING], ends, 0);
            let off = |special: &&Special| (special.value - point.value).abs();
            let nearest =
                specials(&branches).into_iter().filter(|s| s.kind == kind).map(|s| off(&s)).fold(1.0, f64::min);
            assert!(nearest <= 1e-11, "{kind:?} {point:?} {nearest}");
        }
    }
}

/// Work that is broken off after any branch, kept as a file and gone on with, gives the same numbers to the last bit.
#[test]
fn work_that_is_broken_off_goes_on() {
    let scene = Scene::from_value(pair(0.05, 0.1, 0.2, 0.9, [1.1, 0.0]), "test").unwrap();
    let parameter = Parameter::new(scene.resolved(), &[FREQUENCY]).unwrap();
    let family = Family::new(&scene, parameter, [0.75, 1.0]).unwrap();
    let asked = Continuation { doublings: 2, ..Continuation::default() };
    let mut kept: Vec<String> = Vec::new();
    let mut each = |so_far: &BranchProgress| {
        kept.push(serde_json::to_string(so_far).unwrap());
        Ok(())
    };
    let whole = asked.run(&family, None, &mut each, Task::default()).unwrap();
    assert!(whole.branches.len() >= 3, "{}", whole.branches.len());
    for text in &kept[..kept.len() - 1] {
        let earlier: BranchProgress = serde_json::from_str(text).unwrap();
        let again = asked.run(&family, Some(earlier), &mut |_| Ok(()), Task::default()).unwrap();
        assert_eq!(format!("{:?}", again.branches), format!("{:?}", whole.branches));
    }
}

/// Two degrees of freedom between two flanks, without a mean load: where orbits of less symmetry begin. Values of Newton's method on half a
/// period with the sign changed, from a code of its own.
#[test]
fn symmetry_breaks_where_it_does() {
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "matrices", "freedoms": ["a", "b"], "mass_kg": [1.0, 0.6],
            "stiffness_n_per_m": [[2.2, -1.2], [-1.2, 1.7]], "damping_n_s_per_m": [[0.09, -0.03], [-0.03, 0.08]],
            "load_harmonics": [{ "vector_n": [0.6, 0.0], "frequency_rad_per_s": 0.9 }],
            "contacts": [{
                "name": "w", "direction": [0.0, 1.0], "half_backlash_m": 0.9, "stiffness": 9.0,
                "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.05, "release": "deflection" },
            }],
        },
        "initial": { "q": [0.0, 0.0] },
        "run": { "cycles": 300 },
    });
    let branches = follow(&scene, &[FORCING], [0.4, 2.2], 1);
    let breaks: Vec<f64> =
        branches[0].specials.iter().filter(|s| s.kind == SpecialKind::Symmetry).map(|s| s.value).collect();
    assert_eq!(breaks.len(), 2, "{breaks:?}");
    for (found, expected) in breaks.iter().zip([1.204_531_949_196, 1.309_988_578_831]) {
        assert!((found - expected).abs() <= 1e-11, "{found} {expected}");
    }
    // One branch of asymmetric orbits leads from the first to the second.
    assert_eq!(branches.len(), 2);
    assert!(branches[1].points.iter().any(|point| point.is_stable));
}

/// A force that jumps where the number of tooth pairs does is least beside the jump, not where its slope is zero: contact is first lost
/// there. Runs a little above that load keep contact, runs a little below do not.
#[test]
fn contact_is_lost_where_the_stiffness_jumps() {
    let scene =
        Scene::from_file("examples/scenes/spur-pair.json").unwrap().with("/train/speed_rpm", json!(2700.0)).unwrap();
    let branches = follow(scene.resolved(), &["/train/torque_nm"], [5.0, 150.0], 0);
    let thresholds = branches[0].specials.iter().filter(|special| special.word.is_empty());
    let [threshold] = thresholds.collect::<Vec<_>>()[..] else { panic!("{:?}", branches[0].specials) };
    assert_eq!(threshold.kind, SpecialKind::GrazingDamped);
    // Another pair of multipliers is always near the unit circle, inside: it is not taken for the one that passes.
    let torus = branches[0].specials.iter().find(|special| special.kind == SpecialKind::Torus).unwrap();
    assert!((torus.multiplier.norm() - 1.0).abs() <= 1e-9 && branches[0].unlocated.is_empty(), "{torus:?}");
    let word = |load: f64| {
        let scene = scene.with("/train/torque_nm", json!(load)).unwrap();
        let simulation = Simulation::from_scene(&scene).unwrap();
        let value = [load, threshold.value];
        let found = Search { period: Some(1), starts: 0 }.run(&simulation, Task::default()).unwrap();
        found.orbits.first().map(|orbit| orbit.word()).unwrap_or_else(|| panic!("{value:?}"))
    };
    assert!(word(threshold.value * (1.0 + 1e-9)).is_empty());
    assert!(!word(threshold.value * (1.0 - 1e-9)).is_empty());
}

/// From the doubling on: the first orbits of the new branch have the events of the old one, and what comes soon after is not stepped over. The
/// doubling and the graze are those of a code of its own; so are the grazes where a zone that is left and regained is left for the gap.
#[test]
fn what_is_near_another_point_is_found() {
    let soft = json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.0, "release": "force" });
    let mut scene = wall(0.08, 0.7, 0.0, &soft, 0.8, [0.0, 0.0]);
    scene["train"]["load_harmonics"][0]["amplitude_n"] = json!(0.5);
    scene["train"]["contact_stiffness"] = json!(28.0);
    let branches = follow(&scene, &[FORCING], [0.5, 1.0], 1);
    let near: Vec<(SpecialKind, f64)> =
        specials(&branches).iter().filter(|s| s.period == 2).map(|s| (s.kind, s.value)).collect();
    for (kind, expected) in
        [(SpecialKind::PeriodDoubling, 0.537_939_195_6), (SpecialKind::GrazingSoft, 0.537_975_080_8)]
    {
        let off = near.iter().filter(|(k, _)| *k == kind).map(|(_, v)| (v - expected).abs()).fold(1.0, f64::min);
        assert!(off <= 2e-10, "{kind:?} {near:?}");
    }
    for (load, expected) in [(0.12, 0.668_585_733_073_63), (0.1069, 0.646_728_843_701_18)] {
        let scene = json!({
            "flank": 1,
            "train": {
                "kind": "gear-pair-dimensionless", "damping_ratio": 0.06, "damping_in_gap": false, "release": "force",
                "mean_load": load, "transmission_error": [{ "amplitude": 0.15, "frequency": 0.6 }],
            },
            "initial": { "q": [1.1] },
            "run": { "cycles": 300 },
        });
        let branches = follow(&scene, &[FREQUENCY], [0.55, 0.72], 0);
        let off = |special: &&Special| (special.value - expected).abs();
        let nearest = specials(&branches).into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        assert!(nearest.kind == SpecialKind::GrazingDamped && off(&nearest) <= 1e-12, "{nearest:?}");
    }
}

/// A pair between rigid flanks with an eccentricity, damped and loaded (Mason and Piiroinen 2009; Halse et al. 2007), as a mass in contact.
fn eccentric(restitution: f64) -> Value {
    json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1, "damping_n_s_per_m": 0.6, "load_n": 7.539_822_368_615_503_5,
            "load_harmonics": [{ "amplitude_n": -6, "frequency_rad_per_s": std::f64::consts::TAU }],
            "wall": { "side": "both", "half_gap_m": 0.6 }, "law": { "kind": "rigid", "restitution": restitution },
        },
        "initial": { "q": [0.6], "v": [0] },
        "run": { "cycles": 100, "transient_cycles": 50 },
    })
}

const ECCENTRICITY: &str = "/train/load_harmonics/0/amplitude_n";

/// Permanent contact ends where the forcing is as large as the mean load, for every restitution and from every range.
#[test]
fn a_rest_that_lasts_ends_where_its_least_load_is_zero() {
    for restitution in [0.0, 0.5, 0.9] {
        for ends in [[-8.0, -5.0], [-5.5, -7.9], [-7.7, -4.0], [-7.8, -5.9]] {
            let branches = follow(&eccentric(restitution), &[ECCENTRICITY], ends, 0);
            let exact = -7.539_822_368_615_503_5;
            let found = nearest(&branches, SpecialKind::Stick, exact);
            let stick = specials(&branches).into_iter().find(|special| special.value == found).unwrap();
            let off = (found - exact).abs();
            assert!(off <= stick.uncertainty && off <= 1e-12, "{restitution} {ends:?}: {off:e} {stick:?}");
        }
    }
}

/// A ball that lies on a vibrating table is thrown off at the acceleration of gravity (Holmes 1982).
#[test]
fn a_table_throws_at_the_acceleration_of_gravity() {
    for restitution in [0.0, 0.5, 0.9] {
        let scene = json!({
            "flank": 1,
            "train": {
                "kind": "wall", "mass_kg": 1, "load_n": -1, "wall": { "side": "below", "position_m": 0 },
                "wall_motion": [{ "amplitude_m": 0.9, "frequency_rad_per_s": 1 }],
                "law": { "kind": "rigid", "restitution": restitution },
            },
            "initial": { "q": [1.06] },
            "run": { "cycles": 200, "transient_cycles": 100 },
        });
        for ends in [[0.6, 1.05], [1.02, 0.3]] {
            let branches = follow(&scene, &["/train/wall_motion/0/amplitude_m"], ends, 0);
            let stick = branches[0].specials.iter().find(|s| s.kind == SpecialKind::Stick).unwrap();
            let off = (stick.value - 1.0).abs();
            assert!(off <= stick.uncertainty && off <= 1e-12, "{restitution} {ends:?}: {off:e} {stick:?}");
        }
    }
}

/// A rest within the cycle ends where impacts accumulate at the instant at which the load is zero. The value is that of a program of its own
/// with 40 digits, which follows each flight of a trial until the sequence is left on either side.
#[test]
fn a_rest_within_the_cycle_ends_where_the_load_is_zero_at_accumulation() {
    for ends in [[-8.51, -5.5], [-8.503, -5.0]] {
        let branches = follow(&eccentric(0.9), &[ECCENTRICITY], ends, 0);
        let found = nearest(&branches, SpecialKind::Stick, -8.502);
        let special = specials(&branches).into_iter().find(|s| s.value == found).unwrap();
        let off = (found + 8.502_071_908_645_25).abs();
        assert!(off <= special.uncertainty, "{ends:?}: {off:e} {special:?}");
        assert!(special.uncertainty <= 1e-9 * (ends[0] - ends[1]).abs());
    }
}

/// A graze is on the orbit without the impact, and so is its curve: `A = √((1 − ω²)² + 0.01 ω²)`, from a start with impacts (Dankowicz and
/// Schilder 2013, example 15.2). The fold of the impacts has 30 digits of our own.
#[test]
fn a_curve_of_rigid_grazes_follows_the_motion_without_the_impact() {
    const AMPLITUDE: &str = "/train/load_harmonics/0/amplitude_n";
    let curve = |w: f64| (1.0 - w * w).hypot(0.1 * w);
    let law = json!({ "kind": "rigid", "restitution": 0.8 });
    for (frequency, start) in [(1.0, [-0.98, -0.29]), (0.8, [-0.98, -0.29])] {
        let scene = wall(0.1, 1.0, 0.0, &law, frequency, start);
        let found = plane(&scene, SpecialKind::GrazingRigid, (AMPLITUDE, [0.05, 1.2]), (FORCING, [0.5, 1.4]));
        let points: Vec<&CurvePoint> = found.iter().flat_map(|curve| &curve.points).collect();
        for point in &points {
            let off = (point.value - curve(point.second)).abs();
            assert!(off <= point.uncertainty, "{frequency}: off by {off:e}, {point:?}");
        }
        let seconds = || points.iter().map(|point| point.second);
        let [least, most] = [seconds().fold(9.0, f64::min), seconds().fold(0.0, f64::max)];
        assert!(least <= 0.5 && most >= 1.4, "{frequency}: {least} to {most}");
    }
    let scene = wall(0.1, 1.0, 0.0, &law, 1.0, [-0.98, -0.29]);
    let branches = follow(&scene, &[AMPLITUDE], [0.05, 1.2], 0);
    for (kind, exact) in [(SpecialKind::GrazingRigid, 0.1), (SpecialKind::Fold, 0.099_970_753_628_313_27)] {
        let special = specials(&branches).into_iter().find(|s| s.kind == kind).unwrap();
        assert!((special.value - exact).abs() <= special.uncertainty && special.uncertainty <= 1e-11, "{special:?}");
    }
}

/// A pair of multipliers that no damper moves stays on the unit circle: an undamped free motion passes no torus.
#[test]
fn an_undamped_free_motion_passes_no_torus() {
    let law = json!({ "kind": "rigid", "restitution": 0.8 });
    let branches = follow(&wall(0.0, 50.0, 0.0, &law, 2.5, [-0.19, 0.0]), &[FORCING], [1.6, 3.3], 0);
    assert!(branches.iter().all(|branch| branch.unlocated.is_empty()), "{:?}", branches[0].unlocated);
    assert!(specials(&branches).iter().all(|special| special.kind != SpecialKind::Torus));
}

/// A special point is found from four ranges, in both directions, within its uncertainty.
#[test]
fn a_special_point_is_known_to_its_uncertainty() {
    let rigid = |restitution: f64| json!({ "kind": "rigid", "restitution": restitution });
    let kelvin = json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.5, "release": "force" });
    let cases = [
        (pair(0.05, 0.1, 0.05, 0.75, [1.1, 0.0]), FREQUENCY, [[0.65, 1.6], [0.6, 1.2], [0.68, 1.0], [0.5, 1.4]]),
        (
            wall(0.0, 0.0, 0.0, &rigid(0.8), 2.5, [-0.7, 0.1]),
            FORCING,
            [[2.4, 2.75], [2.45, 2.7], [2.3, 2.8], [2.48, 2.72]],
        ),
        (
            wall(0.1, 0.5, 0.0, &rigid(0.7), 1.6, [0.0, 0.0]),
            FORCING,
            [[1.5, 2.2], [1.4, 2.1], [1.45, 2.0], [1.55, 2.3]],
        ),
        (wall(0.1, 0.5, 0.0, &kelvin, 1.9, [0.0, 0.0]), FORCING, [[1.6, 2.2], [1.65, 2.1], [1.68, 2.0], [1.62, 2.3]]),
        (
            wall(0.2, 0.0, 0.0, &rigid(0.3), 0.9, [-0.3, 0.1]),
            FORCING,
            [[0.85, 1.0], [0.8, 1.05], [0.86, 0.99], [0.82, 1.1]],
        ),
    ];
    for (scene, pointer, ranges) in cases {
        let found: Vec<Vec<Special>> = ranges
            .iter()
            .flat_map(|[from, to]| [[*from, *to], [*to, *from]])
            .map(|ends| specials(&follow(&scene, &[pointer], ends, 0)).into_iter().cloned().collect())
            .collect();
        let mut pairs = 0;
        for (i, special) in found.iter().enumerate().flat_map(|(i, found)| found.iter().map(move |s| (i, s))) {
            for other in found[i + 1..].iter().flatten() {
                let off = (special.value - other.value).abs();
                if special.kind == other.kind && special.period == other.period && off <= 1e-6 {
                    assert!(off <= special.uncertainty + other.uncertainty, "{off:e} {special:?} {other:?}");
                    pairs += 1;
                }
            }
        }
        assert!(pairs >= 20, "{pairs} pairs of {found:?}");
    }
}
