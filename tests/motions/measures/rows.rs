//! Event rows and sampled trajectories.

use std::ops::ControlFlow;

use flank::{
    analysis::{Contacts, EventKind, EventLog, EventRow, Grid, Trajectory},
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{ContactMode, Wide},
    system::{ContactSpec, Structure, contact_mode},
    train::KahramanSingh,
};
use serde_json::Value;

use super::{
    contacts::{number, reference},
    trains::{self, Case, run},
};

fn rows(case: &Case) -> Vec<EventRow> {
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut rows = Vec::new();
    let mut log = EventLog::new(&structure, Contacts::new(&structure, None), |row| {
        rows.push(row);
        ControlFlow::Continue(())
    });
    run(&structure, case, &mut log);
    rows
}

#[test]
fn rows_have_the_kinds_times_and_velocities_of_reference_runs() {
    for (name, case) in [
        ("single_sided", trains::single_sided()),
        ("double_sided", trains::double_sided()),
        ("force_release", trains::force_release()),
        ("two_mass", trains::two_mass()),
        ("hertz_pair", trains::hertz_pair()),
    ] {
        let want = reference(name);
        let events: Vec<_> = rows(&case)
            .into_iter()
            .flat_map(|row| row.contacts.clone().into_iter().map(move |c| (row.seconds, c)))
            .filter(|(_, c)| c.kind != EventKind::Clear)
            .collect();
        for (i, kind) in want["kinds"].as_array().unwrap().iter().enumerate() {
            let (t, event) = &events[i];
            assert_eq!(serde_json::to_value(event.kind).unwrap(), *kind, "{name} {i}");
            assert!((t - number(&want["event_times"][i])).abs() < 1e-12, "{name} {i}");
            assert!((event.velocity - number(&want["velocities"][i])).abs() < 1e-11, "{name} {i}");
        }
    }
}

#[test]
fn rigid_rows_tell_impacts_rest_and_release() {
    for (name, case) in [("rattle", trains::rattle()), ("chatter", trains::chatter())] {
        let want = reference(name);
        let all = rows(&case);
        let mut events = all.iter().flat_map(|row| row.contacts.iter().map(move |c| (row.seconds, c)));
        for expected in want["events"].as_array().unwrap() {
            let (kind, t) = (&expected[1], number(&expected[0]));
            let (seconds, event) = events
                .find(|(_, c)| name == "rattle" || c.kind != EventKind::Impact)
                .unwrap_or_else(|| panic!("{name}: {expected}"));
            assert_eq!(serde_json::to_value(event.kind).unwrap(), *kind);
            assert_eq!(Some(event.mesh as u64), expected[2].as_u64());
            assert!((seconds - t).abs() < 1e-10, "{name}: {seconds} for {t}");
            if event.kind == EventKind::Impact {
                assert!((event.velocity - number(&expected[3])).abs() < 1e-12);
                assert_eq!(event.restitution_free, Some(0.7));
            }
        }
    }
}

#[test]
fn a_flank_released_by_force_is_cleared_later() {
    // Released at F = 0 with δ = 2ζ v/ω and opening speed v, a free mass leaves the zone 2ζ/ω later.
    let (omega, zeta) = (10.0, 0.2);
    let law = Law::KelvinVoigt(Linear { damping: 2.0 * zeta * omega }, Release::Force);
    let stiffness = Stiffness::Constant(omega * omega);
    let spec = trains::single(0.0, 0.0, None, vec![ContactSpec { law, stiffness, ..trains::mesh(&[1.0]) }]);
    let all = rows(&Case { spec, q: vec![0.7], v: vec![0.3], end: 2.0 });
    let kinds: Vec<EventKind> = all.iter().map(|r| r.contacts[0].kind).collect();
    assert_eq!(kinds, [EventKind::DriveContact, EventKind::Separation, EventKind::Clear]);
    assert!((all[2].seconds - all[1].seconds - 2.0 * zeta / omega).abs() < 1e-14);
    let released = &all[1].contacts[0];
    assert_eq!((released.from, released.to), ("drive", "drive-detached"));
    assert!((released.restitution.unwrap() - released.restitution_free.unwrap()).abs() < 1e-13);
    assert!((all[0].contacts[0].approach.unwrap() - 0.3).abs() < 1e-15);
}

#[test]
fn a_row_is_one_json_object_with_a_decimal_time() {
    let all = rows(&trains::single_sided());
    let text = serde_json::to_string(&all[0]).unwrap();
    let row: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(row["contacts"][0]["kind"], "separation");
    assert_eq!(row["contacts"][0]["from"], "drive");
    assert!(row["contacts"][0]["duration"].as_f64().unwrap() > 4.0);
    let t = row["t"].as_str().unwrap();
    assert!(t.len() > 25 && t.starts_with("4.03467676935443"), "{t}");
    assert_eq!(t.parse::<f64>().unwrap(), row["seconds"].as_f64().unwrap());
}

#[test]
fn two_pi_is_written_to_thirty_digits() {
    assert_eq!(Wide::TAU.decimal(31), "6.283185307179586476925286766559");
}

#[test]
fn phases_are_the_same_to_the_last_bit_in_every_cycle() {
    let spec = KahramanSingh::new(0.05, 0.1, 0.1, 0.9).assemble().unwrap();
    let structure = Structure::new(spec.clone()).unwrap();
    let period = structure.clock().period().unwrap().value();
    let case = Case { spec, q: vec![1.1], v: vec![0.0], end: 40.0 * period };
    let mut samples: Vec<(u64, i64, f64, f64)> = Vec::new();
    let from = structure.clock().at(3, 0.0);
    let mut trajectory = Trajectory::new(&structure, Grid::Phases { per_cycle: 12 }, from, |s| {
        samples.push((s.index, s.at.cycle, s.at.phase.value(), s.x[0]));
        ControlFlow::Continue(())
    });
    let (end, _) = run(&structure, &case, &mut trajectory);
    let _ = trajectory.finish(&end);
    drop(trajectory);
    assert_eq!(samples.len(), 37 * 12 + 1);
    for (i, (index, cycle, phase, _)) in samples.iter().enumerate() {
        assert_eq!((*index, *cycle), (i as u64, 3 + i as i64 / 12));
        assert_eq!(*phase, samples[i % 12].2);
        assert!((phase - period * (i % 12) as f64 / 12.0).abs() < 1e-15);
    }
}

#[test]
fn samples_are_the_solution_and_at_an_event_the_state_after_it() {
    // Free flight to a rigid wall at x = 1: reached at t = 1 exactly, with speed 1, left with −½.
    let spec = trains::single(0.0, 0.0, None, vec![trains::rigid(0.5, 1.0, 1.0)]);
    let structure = Structure::new(spec.clone()).unwrap();
    let case = Case { spec, q: vec![0.0], v: vec![1.0], end: 2.0 };
    let mut samples = Vec::new();
    let from = structure.clock().instant(0.0);
    let mut trajectory = Trajectory::new(&structure, Grid::Interval { interval: 0.25 }, from, |s| {
        samples.push((s.t, s.x[0], s.x[1]));
        ControlFlow::Continue(())
    });
    let (end, _) = run(&structure, &case, &mut trajectory);
    let _ = trajectory.finish(&end);
    drop(trajectory);
    assert_eq!(samples.len(), 9);
    for (i, (t, x, v)) in samples.iter().enumerate() {
        assert_eq!(*t, 0.25 * i as f64);
        let exact = if *t < 1.0 { (*t, 1.0) } else { (1.0 - 0.5 * (t - 1.0), -0.5) };
        assert!((x - exact.0).abs() < 1e-15 && *v == exact.1, "{t}: {x} {v}");
    }
}

#[test]
fn samples_in_the_root_clock_invert_it() {
    // During a Hertz contact E = ½ v² + (2/5) K p^2.5 is constant: both state and time must be right.
    let mut case = trains::hertz_pair();
    case.spec = trains::single(0.0, 0.0, None, case.spec.contacts.clone());
    case.spec.contacts[0].law = trains::hertz_law(0.0);
    case.v = vec![0.8];
    case.end = 12.0;
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut seen = 0;
    let mut last: Option<(f64, f64, f64)> = None;
    let from = structure.clock().instant(0.0);
    let mut trajectory = Trajectory::new(&structure, Grid::Interval { interval: 1e-3 }, from, |s| {
        let p = (s.x[0].abs() - 1.0).max(0.0);
        let energy = 0.5 * s.x[1] * s.x[1] + 16.0 * p.powf(2.5);
        assert!((energy - 0.32).abs() < 1e-13, "{}: {energy}", s.t);
        // Trapezoid of the velocity: O(h³) apart.
        if let Some((x, v, a)) = last {
            let force = -s.x[0].signum() * 40.0 * p.powf(1.5);
            let step = 1e-3 * 0.5 * (v + s.x[1]) - 1e-6 / 12.0 * (force - a);
            assert!((s.x[0] - x - step).abs() < 1e-10, "{}", s.t);
            last = Some((s.x[0], s.x[1], force));
        } else {
            last = Some((s.x[0], s.x[1], 0.0));
        }
        seen += usize::from(contact_mode(s.mode, 0) != ContactMode::Separated);
        ControlFlow::Continue(())
    });
    run(&structure, &case, &mut trajectory);
    drop(trajectory);
    assert!(seen > 1000, "{seen}");
}
