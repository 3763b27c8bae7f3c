//! Where a run starts: lines 1 to 4.

use flank::{
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::ContactMode::{Drive, Separated},
    system::{StartError, Structure, contact_mode},
    train::{WalledOscillator, Walls},
};

use super::support::{Course, ball, masses, rigid, run, walled};

/// Unit mass between compliant flanks at ±1 under a constant load.
fn gap(load: f64) -> Structure {
    let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    walled(&WalledOscillator {
        load,
        ..WalledOscillator::new(1.0, Walls::Between { half_gap: 1.0 }, law, Stiffness::Constant(1.0))
    })
}

#[test]
fn l1_nothing_fires_at_the_start_of_an_arc_that_leaves_its_guard() {
    // Thrown up from the floor: the only impact is the one at t = 2.
    let run = run(&ball(0.9), &[0.0], &[1.0], 3.0);
    assert_eq!(run.times().len(), 1);
    assert!((run.times()[0] - 2.0).abs() <= 4.0 * f64::EPSILON);
    // The decision at the start is on record, and changed nothing.
    let first = &run.records[0];
    assert!(first.start && first.fired.is_empty() && first.from == first.to && first.x_minus == first.x_plus);
}

#[test]
fn l1_a_guard_left_at_a_jump_does_not_fire_again() {
    // t (t − 1): on the guard at the start, going out; back at 1, and never again.
    let course = Course::new(&[0.0, -1.0, 1.0]);
    let mut from = course.start();
    from.jump.pinned.insert(flank::hybrid::GuardId(0));
    let run = super::support::run_from(&course, from, course.clock.instant(5.0));
    assert_eq!(run.records.len(), 2);
    assert!(run.records[0].start && run.records[0].to.get(0) == 1);
    assert_eq!(run.times(), [1.0]);
}

#[test]
fn l2_a_start_at_rest_on_a_flank_under_load_is_in_contact() {
    let run = run(&gap(0.5), &[1.0], &[0.0], 0.1);
    assert!(run.records[0].start && !run.records[0].fired.is_empty());
    assert_eq!((contact_mode(&run.records[0].from, 0), contact_mode(&run.records[0].to, 0)), (Separated, Drive));
    assert_eq!((run.time(0), run.records.len()), (0.0, 1));
}

#[test]
fn l2_a_start_on_a_flank_moving_off_is_separated() {
    let run = run(&gap(0.5), &[1.0], &[-1.0], 0.1);
    assert!(run.records[0].start && run.records[0].fired.is_empty());
    assert_eq!((contact_mode(&run.records[0].to, 0), run.records.len()), (Separated, 1));
}

#[test]
fn l2_the_first_derivative_that_is_not_zero_decides() {
    // x₀ is at rest on the flank and free of force; its neighbour moves and pulls on it: the third derivative decides.
    let mut spec = masses(&[1.0, 1.0], &[0.0, 0.0], &[vec![1.0, 0.0]], rigid(0.5)).spec().clone();
    spec.contacts[0].law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
    spec.stiffness = nalgebra::dmatrix![1.0, -1.0; -1.0, 1.0];
    let s = Structure::new(spec).unwrap();
    for (speed, mode) in [(1.0, Drive), (-1.0, Separated)] {
        let run = run(&s, &[0.0, 0.0], &[0.0, speed], 0.1);
        assert_eq!((contact_mode(&run.records[0].to, 0), run.records.len()), (mode, 1), "{speed}");
    }
}

#[test]
fn l2_an_approach_on_a_rigid_flank_is_an_impact_at_the_start() {
    let run = run(&ball(0.5), &[0.0], &[-1.0], 0.5);
    assert!(run.records[0].start && !run.records[0].fired.is_empty());
    assert_eq!((run.records[0].x_minus[1], run.records[0].x_plus[1], run.time(0)), (-1.0, 0.5, 0.0));
}

#[test]
fn l3_where_every_derivative_is_zero_the_contact_stays_open_for_ever() {
    for s in [
        gap(0.0),
        walled(&WalledOscillator::new(1.0, Walls::Above { position: 1.0 }, rigid(0.5), Stiffness::Constant(0.0))),
    ] {
        let run = run(&s, &[1.0], &[0.0], 1e6);
        assert_eq!(run.records.len(), 1);
        let first = &run.records[0];
        assert!(first.start && first.fired.is_empty() && contact_mode(&first.to, 0) == Separated);
        assert_eq!((&run.state.x[..2], run.counters.events), (&[1.0, 0.0][..], 0));
    }
}

#[test]
fn l4_a_start_inside_a_flank_is_contact_if_compliant_and_an_error_if_rigid() {
    let at = flank::hybrid::Instant::default();
    let start = gap(0.0).start(at, &[1.25], &[0.0]).unwrap();
    assert_eq!(contact_mode(&start.jump.mode, 0), Drive);
    // Of a wall that lies on the other side of zero too.
    for (walls, inside) in [(Walls::Above { position: -1.0 }, -0.9), (Walls::Below { position: 1.0 }, 0.9)] {
        let law = Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection);
        let single = walled(&WalledOscillator::new(1.0, walls, law, Stiffness::Constant(4.0)));
        assert_eq!(contact_mode(&single.start(at, &[inside], &[0.0]).unwrap().jump.mode, 0), Drive);
    }
    let failed = ball(0.5).start(at, &[-0.25], &[0.0]);
    assert_eq!(failed, Err(StartError::InsideRigid { contact: "wall".into(), depth: 0.25 }));
    assert!(matches!(ball(0.5).start(at, &[f64::NAN], &[0.0]), Err(StartError::State { expected: 1 })));
}
