//! Maps, basins and diagrams.

use std::ops::ControlFlow;

use flank::{
    Simulation, Task,
    engine::{JumpRecord, Observer},
    hybrid::{ContactMode, ContactView, Instant, Mode},
    integrate::DenseStep,
    map::{Cell, CellRule, Impacts},
    nalgebra::Matrix2,
    orbit::{MotionKind, Section, SectionMap, Tangent},
    scene::Scene,
    system::Structure,
};
use serde_json::json;

/// The dimensionless pair.
fn pair(damping: f64, in_gap: bool, load: f64, amplitude: f64, frequency: f64) -> Simulation {
    pair_of(damping, in_gap, load, amplitude, frequency, json!({ "kind": "constant", "value": 1.0 }))
}

/// With another stiffness.
fn pair_of(
    damping: f64,
    in_gap: bool,
    load: f64,
    amplitude: f64,
    frequency: f64,
    stiffness: serde_json::Value,
) -> Simulation {
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": damping, "damping_in_gap": in_gap, "mean_load": load,
            "transmission_error": [{ "amplitude": amplitude, "frequency": frequency }], "stiffness": stiffness,
        },
        "initial": { "q": [1.1] },
        "run": { "cycles": 10 },
    });
    Simulation::from_scene(Scene::from_value(scene, "pair").unwrap()).unwrap()
}

fn decide(simulation: &Simulation) -> Cell {
    CellRule::default().decide(simulation, simulation.start().unwrap(), Task::default()).unwrap().unwrap()
}

/// Keeps the derivative, the states of the contact and their times from calls: no record of a lane stands in for them.
struct Called<'s> {
    structure: &'s Structure,
    tangent: Tangent<'s>,
    times: [f64; 5],
    /// States of the contact, one after the other.
    states: Vec<ContactMode>,
}

impl Called<'_> {
    fn add(&mut self, mode: &Mode, time: f64) {
        self.times[self.structure.contact_mode(0, mode) as usize] += time;
    }
}

impl Observer for Called<'_> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.tangent.wants_steps(mode, until)
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.add(mode, time);
        self.tangent.leap(mode, time)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.add(mode, step.time(until));
        self.tangent.step(mode, step, until)
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.states.push(self.structure.contact_mode(0, &jumped.to.mode));
        self.tangent.jump(jumped);
    }
}

/// Cells are decided with records of lanes. Arcs and jumps one by one give the same orbits and exponents.
#[test]
fn orbits_of_cells_are_those_of_arcs_and_jumps() {
    let (mut periodic, mut chaotic) = (0, 0);
    for (damping, in_gap, amplitude, kind) in [
        (0.05, true, 0.2, "constant"),
        (0.08, false, 0.25, "constant"),
        (0.03, true, 0.4, "constant"),
        (0.05, true, 0.2, "harmonic"),
        (0.05, true, 0.2, "rectangular"),
    ] {
        for i in 0..6 {
            for j in 0..5 {
                let (frequency, load) = (0.45 + 0.27 * f64::from(i), 0.058 * f64::from(j));
                let stiffness = match kind {
                    "harmonic" => {
                        json!({ "kind": kind, "mean": 1.0, "harmonics": [{ "amplitude": 0.2, "frequency": frequency }] })
                    }
                    "rectangular" => {
                        json!({ "kind": kind, "high": 1.2, "low": 0.7, "duty": 0.6, "period": std::f64::consts::TAU / frequency })
                    }
                    _ => json!({ "kind": kind, "value": 1.0 }),
                };
                let pair = pair_of(damping, in_gap, load, amplitude, frequency, stiffness);
                let cell = decide(&pair);
                let place = format!("{kind} {damping} {in_gap} {amplitude} {frequency} {load}");
                chaotic += usize::from(cell.motion.kind == MotionKind::Chaotic);
                let Some(period) = cell.motion.period else { continue };
                periodic += 1;
                let map = SectionMap::new(&pair).unwrap();
                let (structure, tangent) = (&pair.structure, Tangent::new(&pair.structure));
                let mut called = Called { structure, tangent, times: [0.0; 5], states: Vec::new() };
                map.watch(&cell.section, period, &mut called).unwrap();
                let end = map.follow(&cell.section, period).unwrap();
                let off = end.x.iter().zip(&cell.section.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 1e-9, "{place}: {off:e}");
                let share = called.times[0] / called.times.iter().sum::<f64>();
                assert!((cell.apart[0] - share).abs() < 1e-9, "{place}: {share} {cell:?}");
                // Each event is a token, and the drive flank has the sign +.
                let word = cell.motion.word.clone().unwrap_or_default();
                assert_eq!(word.split_whitespace().count(), called.states.len(), "{place}: {word} {:?}", called.states);
                let drive = called.states.iter().filter(|state| **state == ContactMode::Drive).count();
                assert_eq!(word.matches("c0+").count() + word.matches("a0+").count(), drive, "{place}: {word}");
                let derivative = Matrix2::from_row_slice(&called.tangent.columns.values);
                let largest = derivative.complex_eigenvalues().iter().map(|m| m.norm()).fold(0.0, f64::max);
                let exponent = libm::log(largest) / (period as f64 * pair.period().unwrap());
                // Multipliers of a product of some hundred factors; a defective one is known to the root of that.
                assert!((cell.exponent.unwrap() - exponent).abs() < 1e-6, "{place}: {exponent} {cell:?}");
            }
        }
    }
    assert!(periodic > 40 && chaotic > 10, "{periodic} periodic, {chaotic} chaotic");
}

/// The orbit that a cell names closes, by an engine, and has the exponent that the cell says.
#[test]
fn the_orbit_of_a_cell_closes() {
    for (frequency, load) in [(0.6, 0.1), (0.9, 0.1), (1.9, 0.25), (0.5, 0.3)] {
        let pair = pair(0.05, true, load, 0.2, frequency);
        let cell = decide(&pair);
        let period = cell.motion.period.unwrap();
        let map = SectionMap::new(&pair).unwrap();
        let image = map.image(&cell.section, period).unwrap();
        let off = image.end.x.iter().zip(&cell.section.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Newton's method ends at 1e-10 of the state's size at the latest.
        assert!(off < 2e-10, "{frequency} {load}: {off:e}");
        let time = period as f64 * pair.period().unwrap();
        // det J = exp(−2ζ t) with damping everywhere; a pair of complex multipliers has the root of it.
        let pairwise = -0.05;
        let exponent = cell.exponent.unwrap();
        assert!(exponent >= pairwise - 1e-9 && exponent < 0.0, "{exponent}");
        assert!((libm::log(image.jacobian.determinant()) / time + 0.1).abs() < 1e-9);
    }
}

/// A linear motion in contact, and heavy load: nothing is lost. Light load and a large error: both flanks.
#[test]
fn impacts_are_told_by_the_flanks_that_are_met() {
    let quiet = decide(&pair(0.05, true, 0.3, 0.01, 0.5));
    assert_eq!((quiet.impacts, quiet.apart[0], quiet.motion.word.as_deref()), (Impacts::None, 0.0, Some("")));
    // The exponent of a damped oscillator is −ζ.
    assert!((quiet.exponent.unwrap() + 0.05).abs() < 1e-12);
    assert_eq!(decide(&pair(0.05, true, 0.1, 0.2, 0.6)).impacts, Impacts::SingleSided);
    let both = decide(&pair(0.05, true, 0.01, 1.5, 1.2));
    assert_eq!(both.impacts, Impacts::DoubleSided, "{both:?}");
}

/// A start at rest beside a stable orbit: the section says where it is, whatever the path.
#[test]
fn a_cell_is_what_a_long_run_comes_to() {
    let pair = pair(0.05, true, 0.1, 0.2, 0.75);
    let cell = decide(&pair);
    let map = SectionMap::new(&pair).unwrap();
    let start =
        Section { x: vec![1.1, 0.0], contacts: vec![flank::system::contact_mode(&pair.start().unwrap().jump.mode, 0)] };
    // 1000 cycles at a decay of exp(−ζ T) a cycle leave nothing of the start.
    let end = map.follow(&start, 1000).unwrap();
    assert_eq!(cell.motion.period, Some(1));
    for (a, b) in end.x.iter().zip(&cell.section.x) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

/// Trains that are none for a lane go by the engine.
#[test]
fn other_trains_are_decided_too() {
    let wall = json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": 1, "load_harmonics": [{ "amplitude_n": 1, "frequency_rad_per_s": 2.4 }],
            "wall": { "side": "above", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 },
        },
        "initial": { "q": [-0.1] },
        "run": { "cycles": 10 },
    });
    let scene = Scene::from_value(wall, "wall");
    let simulation = Simulation::from_scene(scene.unwrap()).unwrap();
    let cell = decide(&simulation);
    assert_eq!((cell.motion.kind, cell.motion.period), (MotionKind::Periodic, Some(1)));
    // One impact a cycle, no damping: the determinant is ε², and the multipliers are complex (0.176 ± 0.780 i).
    let size = libm::exp(cell.exponent.unwrap() * simulation.period().unwrap());
    assert!((size - 0.8).abs() < 1e-9, "{size}");
    assert_eq!(cell.impacts, Impacts::SingleSided);
}

/// A ball on a vibrating table: Holmes (J. Sound Vib. 84, 1982), with the acceleration Γ = Aω²/g of the table. The motion with one impact a
/// period needs Γ cos φ = π(1 − ε)/(1 + ε), and doubles at Γ sin φ = 2(1 + ε²)/(1 + ε)², φ the phase of the impact. Both hold exactly.
#[test]
fn the_ball_of_holmes_is_periodic_between_his_curves() {
    let scene = Scene::from_file("examples/scenes/bouncing-ball.json").unwrap();
    let (mut inside, mut found) = (0, 0);
    for i in 0..24 {
        for j in 0..24 {
            let (amplitude, restitution) = (0.405 + 0.11 * f64::from(i), 0.2 + 0.025 * f64::from(j));
            let numbers = [("/train/wall_motion/0/amplitude_m", amplitude), ("/train/law/restitution", restitution)];
            let numbers = numbers.map(|(pointer, value)| (pointer, value.into()));
            let ball = Simulation::from_scene(scene.with_all(numbers).unwrap()).unwrap();
            let motion = decide(&ball).motion;
            let low = std::f64::consts::PI * (1.0 - restitution) / (1.0 + restitution);
            let high = low.hypot(2.0 * (1.0 + restitution.powi(2)) / (1.0 + restitution).powi(2));
            let is_inside = low < amplitude && amplitude < high;
            let is_found = motion.period == Some(1) && motion.word.as_deref() == Some("i0+");
            assert!(is_inside || !is_found, "{amplitude} {restitution}: {motion:?}");
            inside += usize::from(is_inside);
            found += usize::from(is_found);
        }
    }
    // Other motions coexist with it, and some starts come to them.
    assert!(found * 10 > 9 * inside && inside > 80, "{found} of {inside}");
}

/// Planets that start alike move alike, although this motion is unstable against their differences: its exponent is four times that of the
/// motion that it ends on.
#[test]
fn planets_that_start_alike_end_as_those_that_do_not() {
    let stage = |start: f64| {
        let text = std::fs::read_to_string("examples/scenes/reference-light.json").unwrap();
        let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
        scene["train"]["speed_rpm"] = json!(396.61016949153);
        scene["train"]["load"] = json!({ "output_torque_nm": 9.2551020408163 });
        let scene = Scene::from_value(scene, "stage").unwrap();
        let simulation = Simulation::from_scene(scene).unwrap();
        let mut state = simulation.start().unwrap();
        state.x[3] += start;
        CellRule::default().decide(&simulation, state, Task::default()).unwrap().unwrap().motion
    };
    let [alike, other] = [stage(0.0), stage(1e-7)];
    assert_eq!([alike.kind, other.kind], [MotionKind::Chaotic; 2]);
    let [[a, band], [b, other_band]] = [alike.exponent.unwrap(), other.exponent.unwrap()];
    // Three standard errors each.
    assert!((a - b).abs() <= 3.0 * (band + other_band), "{a} ± {band}, {b} ± {other_band}");
}

/// Planets that start alike stay so, and the push out of their symmetry has not grown by the end: what neighbours do there is not chaos.
#[test]
fn a_motion_beside_an_unstable_one_is_not_chaotic() {
    let text = std::fs::read_to_string("examples/scenes/reference-light.json").unwrap();
    let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
    scene["train"]["speed_rpm"] = json!(1000);
    scene["initial"] = json!({ "q": { "u_s": -4e-6 }, "v": { "u_s": -0.02 } });
    let stage = Simulation::from_scene(Scene::from_value(scene, "stage").unwrap()).unwrap();
    let motion = decide(&stage).motion;
    assert!(matches!(motion.kind, MotionKind::Transient | MotionKind::Undecided), "{motion:?}");
    assert!(motion.reason.is_some());
}

/// Neighbours on a torus part in proportion to time. Over some hundred cycles that looks like an exponent, here of 6e-4: over 40,000 cycles a
/// run with steps in closed form has 1e-5.
#[test]
fn a_torus_without_damping_is_not_chaotic() {
    for error in [0.28769, 0.29525] {
        let pair = pair(0.0, true, 0.1, error, 0.4);
        let cell = CellRule::default().decide(&pair, pair.start_at(&[1.1], &[0.0]).unwrap(), Task::default());
        let motion = cell.unwrap().unwrap().motion;
        assert_eq!(motion.kind, MotionKind::Undecided, "{motion:?}");
    }
}

/// In the gap without load nothing brings a gear back: where it stands, it stays.
#[test]
fn what_rests_in_the_gap_is_periodic() {
    // With damping a start with a velocity comes to rest before a flank; without it one that drifts strikes both.
    for (in_gap, v, rests) in [(true, 0.0, true), (true, 0.02, true), (false, 0.0, true), (false, 0.02, false)] {
        let pair = pair(0.05, in_gap, 0.0, 0.2, 0.6);
        let rule = CellRule::default();
        let start = || pair.start_at(&[0.2], &[v]).unwrap();
        let cell = rule.decide(&pair, start(), Task::default()).unwrap().unwrap();
        let place = format!("{in_gap} {v}: {cell:?}");
        if rests {
            assert_eq!((cell.motion.kind, cell.motion.period), (MotionKind::Periodic, Some(1)), "{place}");
            assert_eq!(cell.motion.word.as_deref(), Some(""), "{place}");
            assert_eq!((cell.exponent, cell.impacts), (Some(0.0), Impacts::None), "{place}");
            assert_eq!(cell.apart, [1.0], "{place}");
        } else {
            assert_eq!(cell.impacts, Impacts::DoubleSided, "{place}");
        }
    }
}

/// Rigid flanks have no lanes.
#[test]
fn what_rests_before_a_wall_is_periodic() {
    for (stiffness, is_periodic) in [(0, true), (1, false)] {
        // Without load and damping a mass stays where it stands; on a spring it turns for ever, at a frequency of its own.
        let scene = json!({
            "flank": 1,
            "train": {
                "kind": "wall", "mass_kg": 1, "stiffness_n_per_m": stiffness, "damping_n_s_per_m": 0,
                "load_harmonics": [{ "amplitude_n": 0, "frequency_rad_per_s": 2.4 }],
                "wall": { "side": "above", "position_m": 1 }, "law": { "kind": "rigid", "restitution": 0.8 },
            },
            "initial": { "q": [0.5] },
            "run": { "cycles": 10 },
        });
        let wall = Simulation::from_scene(Scene::from_value(scene, "wall").unwrap()).unwrap();
        let cell = decide(&wall);
        assert_eq!(cell.motion.kind == MotionKind::Periodic, is_periodic, "{cell:?}");
    }
}
