//! Contact statistics against reference runs and closed forms.

use flank::{
    analysis::{ContactReport, Contacts},
    gear::{
        Stiffness,
        contact::{Law, Linear, Release, restitution},
    },
    system::{ContactSpec, Flanks, Structure},
};
use serde_json::Value;

use super::trains::{self, Case, run};

pub fn reference(case: &str) -> Value {
    let text = include_str!("../../fixtures/measures.json");
    let all: Value = serde_json::from_str(text).unwrap();
    all["cases"][case].clone()
}

pub fn number(v: &Value) -> f64 {
    v.as_str().unwrap().parse().unwrap()
}

fn compare(name: &str, case: &Case, tolerance: f64) -> ContactReport {
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, case, &mut contacts);
    let report = contacts.report(0);
    let want = reference(name);
    for (key, got) in [
        ("no_force_fraction", report.no_force_fraction),
        ("deflection_max", report.deflection_max.unwrap()),
        ("deflection_min", report.deflection_min.unwrap()),
        ("force_abs_max", report.force_abs_max),
    ] {
        let Some(exact) = want[key].as_str().map(|s| s.parse::<f64>().unwrap()) else { continue };
        let error = (got - exact).abs() / exact.abs();
        assert!(error <= tolerance, "{name} {key}: {got} for {exact}");
    }
    for (key, got) in [
        ("separations", report.separations),
        ("drive_contacts", report.drive_contacts),
        ("back_contacts", report.back_contacts),
    ] {
        assert_eq!(Some(got), want[key].as_u64(), "{name} {key}");
    }
    assert!((report.time - case.end).abs() <= 1e-15 * case.end);
    let separations = contacts.separations(0);
    assert_eq!(separations.len() as u64, report.durations.count);
    let sum: f64 = separations.iter().map(|s| s.duration).sum();
    assert!((sum / report.durations.count as f64 - report.durations.mean.unwrap()).abs() < 1e-13);
    assert!(report.apart_time <= report.no_force_time);
    report
}

#[test]
fn measures_equal_those_of_reference_runs() {
    // The tolerance follows how much a run amplifies rounding.
    compare("single_sided", &trains::single_sided(), 1e-13);
    compare("double_sided", &trains::double_sided(), 1e-13);
    compare("force_release", &trains::force_release(), 1e-9);
    compare("rectangular", &trains::rectangular(), 1e-12);
    compare("parametric", &trains::parametric(), 1e-12);
    compare("two_mass", &trains::two_mass(), 1e-12);
    compare("hertz_pair", &trains::hertz_pair(), 1e-12);
}

#[test]
fn hertz_episodes_have_the_peaks_and_restitutions_of_the_reference_run() {
    let case = trains::hertz_pair();
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, &case, &mut contacts);
    let want = reference("hertz_pair");
    let mut worst = [0.0f64; 3];
    for (episode, want) in contacts.episodes(0).iter().zip(want["episodes"].as_array().unwrap()) {
        for (worst, (got, key)) in worst.iter_mut().zip([
            (episode.restitution.unwrap(), "restitution"),
            (episode.peak_force.unwrap(), "peak_force"),
            (episode.peak_penetration, "peak_penetration"),
        ]) {
            let exact = number(&want[key]);
            *worst = worst.max((got - exact).abs() / exact);
        }
    }
    assert!(worst.iter().all(|w| *w < 1e-11), "{worst:?}");
}

#[test]
fn a_rigid_rattle_counts_its_impacts() {
    let case = trains::rattle();
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, &case, &mut contacts);
    let want = reference("rattle");
    for j in 0..2 {
        let report = contacts.report(j);
        assert_eq!(Some(report.drive_contacts), want["impacts"][j].as_u64());
        assert_eq!(report.apart_fraction, 1.0);
        for episode in contacts.episodes(j) {
            assert!((episode.restitution.unwrap() - 0.7).abs() < 1e-14);
            // A free mass of 1 kg: the impulse is the change of speed.
            assert!((episode.impulse - 1.7 * episode.approach).abs() < 1e-14);
            let lost = 0.5 * (1.0 - 0.49) * episode.approach.powi(2);
            assert!((episode.energy_lost - lost).abs() < 1e-14);
        }
    }
}

/// A free mass m strikes a wall at x = 0 with speed v.
fn free_impact(law: Law, stiffness: f64, mass: f64, v: f64, end: f64) -> flank::analysis::Episode {
    let contact = ContactSpec {
        law,
        half_backlash: 0.0,
        flanks: Flanks::Drive,
        stiffness: Stiffness::Constant(stiffness),
        ..trains::mesh(&[1.0])
    };
    let mut spec = trains::single(0.0, 0.0, None, vec![contact]);
    spec.mass[(0, 0)] = mass;
    let case = Case { spec, q: vec![-0.5 * v], v: vec![v], end };
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, &case, &mut contacts);
    assert_eq!(contacts.episodes(0).len(), 1);
    contacts.episodes(0)[0]
}

#[test]
fn a_free_hertz_impact_has_its_closed_form_peak_and_duration() {
    let (k, m, v) = (1e6, 1.0, 0.1);
    let e = free_impact(trains::hertz_law(0.0), k, m, v, 1.0);
    let depth = (1.25 * m * v * v / k).powf(0.4);
    // Reference duration of this impact, computed with 40-digit arithmetic.
    let duration = 2.030_462_036_827_76e-2;
    for (got, exact) in [
        (e.peak_penetration, depth),
        (e.peak_force.unwrap(), k * depth.powf(1.5)),
        (e.duration, duration),
        (e.impulse, 2.0 * m * v),
        (e.restitution.unwrap(), 1.0),
    ] {
        assert!((got - exact).abs() < 1e-12 * exact, "{got} {exact}");
    }
    assert!(e.energy_lost.abs() < 1e-20);
}

#[test]
fn hysteresis_returns_what_its_relation_says_and_loses_the_rest() {
    for d in [0.1, 0.3825, 0.7, 2.0] {
        let (k, m, v) = (40.0, 2.0, 0.7);
        let e = free_impact(trains::hertz_law(d), k, m, v, 3.0);
        let exact = restitution(d);
        assert!((e.restitution.unwrap() - exact).abs() < 1e-12, "{d}: {:?} {exact}", e.restitution);
        let depth = (2.5 * m * v * v * (d - d.ln_1p()) / (k * d * d)).powf(0.4);
        assert!((e.peak_penetration - depth).abs() < 1e-12 * depth);
        let lost = 0.5 * m * v * v * (1.0 - exact * exact);
        assert!((e.energy_lost - lost).abs() < 1e-12, "{} {lost}", e.energy_lost);
        assert!((e.impulse - m * v * (1.0 + exact)).abs() < 1e-12);
    }
}

#[test]
fn a_damped_contact_released_by_force_loses_what_its_spring_still_held() {
    let (k, m, v, zeta) = (100.0, 1.0, 0.3, 0.2);
    let law = Law::KelvinVoigt(Linear { damping: 2.0 * zeta * 10.0 }, Release::Force);
    let e = free_impact(law, k, m, v, 1.5);
    let obtained = (-zeta * 2.0 * f64::acos(zeta) / (1.0 - zeta * zeta).sqrt()).exp();
    assert!((e.restitution.unwrap() - obtained).abs() < 1e-13);
    assert!((e.energy_lost - 0.5 * m * v * v * (1.0 - obtained * obtained)).abs() < 1e-15);
    // x = (v/ω_d) Im e^{st}, arg s = π − arccos ζ: the force −m x″ peaks where Im s³e^{st} = 0.
    let (omega, damped) = (10.0, 10.0 * f64::sqrt(1.0 - zeta * zeta));
    let angle = 3.0 * f64::acos(zeta) - std::f64::consts::PI;
    let decay = (-zeta * omega * angle / damped).exp();
    let peak = m * v * omega * omega / damped * decay * f64::sin(2.0 * f64::acos(zeta) - angle);
    assert!((e.peak_force.unwrap() - peak).abs() < 1e-14, "{:?} {peak}", e.peak_force);
}

#[test]
fn time_without_force_is_longer_than_time_apart_where_the_force_releases() {
    let case = trains::force_release();
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, &case, &mut contacts);
    let report = contacts.report(0);
    assert!(report.apart_time < report.no_force_time - 1.0, "{report:?}");
    assert!(contacts.separations(0).iter().all(|s| s.apart < s.duration));
    assert!(report.energy_lost > 0.0);
}

#[test]
fn a_transient_can_be_left_out() {
    let case = trains::single_sided();
    let structure = Structure::new(case.spec.clone()).unwrap();
    let clock = *structure.clock();
    let mut whole = Contacts::new(&structure, None);
    let from = clock.instant(60.0);
    let mut late = Contacts::new(&structure, Some(from));
    run(&structure, &case, &mut (&mut whole, &mut late));
    let report = late.report(0);
    assert!((report.time - 140.0).abs() < 1e-12);
    let after: Vec<_> = whole.separations(0).iter().filter(|s| s.start.t >= 60.0).copied().collect();
    assert_eq!(late.separations(0), after);
    assert!(report.deflection_max < whole.report(0).deflection_max);
}

#[test]
fn chatter_ends_in_rest_and_flights_of_any_length_are_kept() {
    let case = trains::chatter();
    let structure = Structure::new(case.spec.clone()).unwrap();
    let mut contacts = Contacts::new(&structure, None);
    run(&structure, &case, &mut contacts);
    let report = contacts.report(0);
    assert!(report.sticks >= 6, "{report:?}");
    assert!(report.apart_fraction > 0.0 && report.apart_fraction < 1.0);
    assert!(report.durations.min.unwrap() < 1e-10, "{report:?}");
    // Resting forces are the table's: m (g + z̈), at most 9.81 + 0.3 · 6.5², with two roundings of each product and sum.
    let largest = (9.81 + 0.3 * 6.5 * 6.5) * (1.0 + 4.0 * f64::EPSILON);
    assert!(report.force_abs_max > 0.0 && report.force_abs_max <= largest);
    // Momentum: what the table gave is the weight over the time and the change of speed.
    let x = run(&structure, &case, &mut ()).0.x;
    let given = 9.81 * case.end + x[1];
    assert!((report.force_mean * report.time - given).abs() < 1e-8 * given);
}
