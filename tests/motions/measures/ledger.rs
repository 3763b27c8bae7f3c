//! The ledger closes: every joule is in one column.

use flank::{
    Simulation,
    analysis::{Balance, Contacts, Ledger},
    engine::{Engine, Options, State},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    integrate::Taylor,
    system::{ContactSpec, Flanks, Structure},
    train::KahramanSingh,
};

use super::trains::{self, Case, run};

/// Rounding of some thousand steps; exact flows leave nothing else.
const CLOSED: f64 = 1e-12;

fn balance(case: &Case) -> Balance {
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut ledger = Ledger::new(&structure);
    run(&structure, case, &mut ledger);
    let balance = ledger.balance();
    assert!(balance.closure() <= CLOSED, "{balance:?}");
    assert!(balance.projection.abs() <= 1e-12 * balance.throughput, "{balance:?}");
    balance
}

#[test]
fn closes_on_a_forced_pair_with_both_flanks() {
    assert!(balance(&trains::single_sided()).damping > 0.0);
    let b = balance(&trains::double_sided());
    assert_eq!((b.error, b.parametric, b.contact, b.impact), (0.0, 0.0, 0.0, 0.0));
    assert!(b.release.abs() < 1e-28);
}

#[test]
fn closes_on_a_switched_stiffness_with_the_work_of_every_switch() {
    let b = balance(&trains::rectangular());
    assert!(b.switches != 0.0 && b.parametric == b.switches);
}

#[test]
fn closes_on_a_harmonic_stiffness() {
    let b = balance(&trains::parametric());
    assert!(b.parametric != 0.0 && b.switches == 0.0);
}

#[test]
fn closes_where_the_force_releases_a_deflected_contact() {
    let b = balance(&trains::force_release());
    assert!(b.release > 0.0 && b.contact > 0.0);
}

#[test]
fn closes_in_the_root_clock_of_hertz_contacts() {
    let b = balance(&trains::hertz_pair());
    assert!(b.contact > 0.0 && b.release.abs() < 1e-20);
}

#[test]
fn closes_on_rigid_impacts_and_on_chatter_against_a_moving_table() {
    assert!(balance(&trains::rattle()).impact > 0.0);
    let b = balance(&trains::chatter());
    assert!(b.impact > 0.0 && b.error != 0.0);
}

#[test]
fn closes_on_impacts_that_strike_together() {
    let b = balance(&trains::three_at_once());
    assert!(b.impact > 0.0 && b.error == 0.0);
}

#[test]
fn closes_where_hysteresis_would_pull() {
    // Pulled away faster than 1 + χ ṗ allows: the contact lets go while still penetrated.
    let b = balance(&trains::pulled());
    assert!(b.release > 1e-6, "{b:?}");
}

#[test]
fn closes_on_a_stage_with_errors_in_six_meshes() {
    let b = balance(&trains::planetary());
    assert!(b.error != 0.0 && b.contact > 0.0);
}

#[test]
fn a_switch_under_a_held_deflection_does_half_the_stiffness_step_times_its_square() {
    // x = x₀ cos t from rest at x₀; k switches from 1 to 4 at t = 0.25.
    let stiffness = Stiffness::switched(vec![[0.25, 0.0]], [1.0, 4.0]);
    let law = Law::Bilateral(Linear { damping: 0.0 });
    let contact = ContactSpec { stiffness, law, ..trains::mesh(&[1.0]) };
    let spec = trains::single(0.0, 0.0, None, vec![contact]);
    let b = balance(&Case { spec, q: vec![0.3], v: vec![0.0], end: 1.0 });
    let exact = 0.5 * 3.0 * (0.3 * 0.25f64.cos()).powi(2);
    assert!((b.parametric - exact).abs() < 1e-16, "{} {exact}", b.parametric);
}

#[test]
fn a_contact_that_a_switch_opens_loses_what_its_spring_holds_after_the_switch() {
    // Struck at t = 1, the mass leaves at t = 3 with p ≈ 0.54, ṗ ≈ −0.34. There k drops from 1 to 0.04, and k p + 0.6 ṗ is a pull.
    let stiffness = Stiffness::switched(vec![[3.0, 0.0]], [1.0, 0.04]);
    let law = Law::KelvinVoigt(Linear { damping: 0.6 }, Release::Force);
    let contact = ContactSpec { stiffness, law, flanks: Flanks::Drive, ..trains::mesh(&[1.0]) };
    let case = Case { spec: trains::single(0.0, 0.0, None, vec![contact]), q: vec![0.0], v: vec![1.0], end: 4.0 };
    let b = balance(&case);
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, &case, &mut contacts);
    assert!(b.switches < -0.1 && b.release > 0.001, "{b:?}");
    let lost = contacts.report(0).energy_lost;
    assert!((lost - b.contact - b.release).abs() <= 1e-15, "{lost} {b:?}");
}

/// Long steps of a body at rest would explain any residual by the work of its load in a step. One percent of the largest column is told
/// all the same, at any scale of energies; a residual among columns that are rounding themselves is not.
#[test]
fn an_imbalance_of_one_percent_is_told_at_every_scale() {
    for scale in [1e-12, 1.0, 1e15] {
        let sound = Balance {
            start: 2.0 * scale,
            load: 2.8 * scale,
            impact: 4.8 * scale,
            throughput: 50.0 * scale,
            ..Balance::default()
        };
        let off = Balance { load: 2.752 * scale, residual: 0.048 * scale, ..sound };
        let (long, held) = (1e24 * scale, 10.0 * scale);
        let limit = |balance: &Balance| balance.limit([long, held], 50, 0.0);
        assert!(sound.residual <= limit(&sound) && off.residual > limit(&off), "{scale:e}: {:e}", limit(&off));
        let noise =
            Balance { start: 1e-18 * scale, residual: 1e-18 * scale, throughput: 1e-18 * scale, ..Balance::default() };
        assert!(noise.residual <= limit(&noise), "{scale:e}");
    }
}

#[test]
fn a_wall_moving_into_a_mass_does_the_work_of_its_impulse() {
    // Mass at rest at 0 before a wall at 0.1 − 0.2 sin t: struck elastically.
    let spec = trains::single(
        0.0,
        0.0,
        None,
        vec![ContactSpec { error: vec![Harmonic::sine(1.0, -0.2, 0.0)], ..trains::rigid(1.0, 1.0, 0.1) }],
    );
    let b = balance(&Case { spec, q: vec![0.0], v: vec![0.0], end: 0.6 });
    // The wall arrives at sin t = ½ with speed 0.2 cos t; the mass leaves with twice that.
    let speed = 0.2 * 0.75f64.sqrt();
    assert!((b.end - 2.0 * speed * speed).abs() < 1e-15 && (b.error - b.end).abs() < 1e-15, "{b:?}");
    assert!(b.impact.abs() < 1e-16, "{b:?}");
}

#[test]
fn stays_closed_over_four_thousand_cycles() {
    // One separation a cycle on the attractor of this pair.
    let spec = KahramanSingh::new(0.05, 0.1, 0.1, 0.9).assemble().unwrap();
    let structure = Structure::new(spec.clone()).unwrap();
    let period = structure.clock().period().unwrap().value();
    let case = Case { spec, q: vec![1.1], v: vec![0.0], end: 4096.0 * period };
    let mut ledger = Ledger::new(&structure);
    let mut contacts = Contacts::new(&structure, Some(structure.clock().at(96, 0.0))).keep(10);
    run(&structure, &case, &mut (&mut ledger, &mut contacts));
    let (report, balance) = (contacts.report(0), ledger.balance());
    assert!(balance.closure() < CLOSED && balance.residual.abs() < 1e-12);
    assert_eq!((report.separations, contacts.separations(0).len()), (4000, 10));
    assert!((report.separations_per_cycle.unwrap() - 1.0).abs() < 1e-12);
    // Over whole cycles the mesh carries the mean load.
    assert!((report.force_mean - 0.1).abs() < 1e-14);
    let spread = report.durations.max.unwrap() - report.durations.min.unwrap();
    assert!(spread < 1e-3 * period, "{spread}");
}

/// Steps far shorter than those before them, as where a run is continued in small pieces: no order of a series may be left over from
/// a longer step. The impulse of the contact is what the momentum, the load and the damper leave over.
#[test]
fn measures_of_short_steps_after_long_ones_are_right() {
    // With the amplitude and the frequency of the load.
    let cases = [
        (trains::parametric(), 0.0, 1.0),
        (trains::rectangular(), 0.12, 0.75),
        (trains::hertz_pair(), 0.8, 0.9),
        (trains::single_sided(), 0.081, 0.9),
    ];
    for (case, amplitude, omega) in cases {
        let structure = Structure::new(case.spec.clone()).unwrap();
        let clock = structure.clock();
        let start = structure.start(clock.instant(0.0), &case.q, &case.v).unwrap();
        let state = State { at: clock.instant(0.0), x: start.x, jump: start.jump };
        let mut engine = Engine::new(&structure, Box::new(Taylor::default()), Options::default(), state);
        let (mut ledger, mut contacts) = (Ledger::new(&structure), Contacts::new(&structure, None));
        let mut end = 0.0;
        for i in 0..10 {
            // A step is asked for all that is left: first for 30 s, then for 0.02 s.
            end = f64::from(30 * (i / 2 + 1)) + if i % 2 == 0 { 0.0 } else { 0.02 };
            engine.run(clock.instant(end), &mut (&mut ledger, &mut contacts)).unwrap();
        }
        let balance = ledger.balance();
        assert!(balance.closure() < 1e-14, "{:e}", balance.closure());
        let report = contacts.report(0);
        let x = &engine.state().x;
        let load = case.spec.load[0] * end + amplitude / omega * (omega * end).sin();
        let exact = load - case.spec.damping[(0, 0)] * (x[0] - case.q[0]) - (x[1] - case.v[0]);
        // Some roundings of the largest force for each of some hundred steps.
        let (impulse, tolerance) = (report.force_mean * report.time, 1e-14 * report.force_abs_max * end);
        assert!((impulse - exact).abs() <= tolerance, "{impulse} {exact}: {:e}", impulse - exact);
    }
}

/// A stiff contact under a load that moves slowly: its steps are some millionths of what they are asked for, and the coefficients of
/// such a step are so large that the product of three series would overflow.
#[test]
fn steps_far_shorter_than_their_arc_are_measured() {
    let run = Simulation::from_json(
        r#"{
            "flank": 1,
            "train": {
                "kind": "wall", "mass_kg": 0.3, "load_n": 500,
                "load_harmonics": [{ "amplitude_n": 200, "frequency_rad_per_s": 1, "phase_rad": 1.57 }],
                "wall": { "side": "above", "position_m": 0 },
                "law": { "kind": "power", "exponent": "3/2", "hysteresis": "flores", "restitution": 0.4 },
                "contact_stiffness": 1e9
            },
            "initial": "static",
            "run": { "t_end_s": 100 }
        }"#,
    );
    let summary = run.unwrap().run().unwrap().summary;
    let lost = summary.contacts[0].energy_lost;
    assert!(lost > 0.0 && (summary.energy.contact - lost).abs() <= 1e-12 * lost, "{lost} {:?}", summary.energy);
}
