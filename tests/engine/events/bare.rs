//! Leaps that lead where the steps do: line 40.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    engine::{Counters, Observer, Options, State},
    event::EventRecord,
    gear::{
        Harmonic, Piece, Stiffness,
        contact::{Law, Linear, Release, Rigid},
    },
    hybrid::{Instant, Mode},
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure},
};
use nalgebra::DMatrix;
use proptest::prelude::*;

use super::{
    leaps::laws,
    support::{engine, state},
};

/// Keeps records; steps are looked at, or not.
struct Records {
    sees_steps: bool,
    records: Vec<EventRecord>,
}

impl Observer for Records {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        self.sees_steps
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.records.push(record.clone());
        ControlFlow::Continue(())
    }
}

/// A run to `end`, by steps that are looked at or by leaps.
fn course(system: &Structure, start: &State, end: Instant, sees_steps: bool) -> (Vec<EventRecord>, State, Counters) {
    let mut kept = Records { sees_steps, records: Vec::new() };
    let mut engine = engine(system, start.clone(), Options::default());
    engine.run(end, &mut kept).unwrap();
    (kept.records, engine.state().clone(), engine.counters())
}

/// Both ways are the same: records, states and steps, bit for bit; of an uncertainty only the sums are ordered otherwise.
fn agree(system: &Structure, start: &State, end: Instant) -> Result<usize, TestCaseError> {
    let (steps, stood, counted) = course(system, start, end, true);
    let (leaps, stands, counts) = course(system, start, end, false);
    prop_assert_eq!(steps.len(), leaps.len());
    for (a, b) in steps.iter().zip(&leaps) {
        prop_assert_eq!((a.at, &a.fired, &a.from, &a.to), (b.at, &b.fired, &b.from, &b.to));
        prop_assert_eq!((&a.x_minus, &a.x_plus, &a.jump), (&b.x_minus, &b.x_plus, &b.jump));
        let (time, other) = (a.conditioning.time, b.conditioning.time);
        // Both can be unknown: infinite.
        prop_assert!(time == other || (time - other).abs() <= 1e-9 * time, "{:e} {:e}", time, other);
    }
    prop_assert_eq!(stood, stands);
    prop_assert_eq!((counted.steps, counted.arcs, counted.events), (counts.steps, counts.arcs, counts.events));
    Ok(leaps.len())
}

/// A chain of masses before a wall, each coupled to the next by a mesh with backlash, on springs and dampers.
pub fn chain(n: usize, law: Law, kinds: &[usize], sizes: &[f64], load: f64) -> Structure {
    chain_beside(0, n, |_| law, kinds, sizes, load)
}

/// The same beside `idle` masses that nothing moves; each contact has a law.
pub fn chain_beside(
    idle: usize,
    n: usize,
    law: impl Fn(usize) -> Law,
    kinds: &[usize],
    sizes: &[f64],
    load: f64,
) -> Structure {
    let all = n + idle;
    let beside = |x: Vec<f64>| x.into_iter().chain(std::iter::repeat_n(0.0, idle)).collect::<Vec<_>>();
    let stiffness = |j: usize| match kinds[j % kinds.len()] {
        0 => Stiffness::Constant(sizes[j] * 40.0),
        1 => Stiffness::Periodic {
            period: std::f64::consts::TAU,
            origin: 0.3 * j as f64,
            pieces: [(0.0, 50.0), (0.4, 30.0)]
                .map(|(start, value)| Piece { start: start * std::f64::consts::TAU, value, slope: 0.0 })
                .to_vec(),
        },
        _ => Stiffness::Harmonic {
            mean: 40.0,
            harmonics: vec![Harmonic { omega: 1.0, amplitude: 0.2, phase: sizes[j] }],
        },
    };
    let contacts = (0..n).map(|j| ContactSpec {
        name: format!("contact {j}"),
        direction: beside(
            (0..n).map(|i| [0.0, 1.0, -1.0][usize::from(i == j) + 2 * usize::from(i == j + 1)]).collect(),
        ),
        error: vec![Harmonic { omega: 1.0, amplitude: 0.1 * sizes[j], phase: j as f64 }],
        error_offset: 0.0,
        half_backlash: 0.2 + 0.1 * sizes[n + j],
        flanks: if kinds[j % kinds.len()] == 1 { Flanks::Drive } else { Flanks::Both },
        stiffness: stiffness(j),
        law: law(j),
        gap_damping: 0.0,
        back: None,
    });
    Structure::new(Spec {
        freedoms: (0..all).map(|i| format!("x_{i}")).collect(),
        mass: DMatrix::from_fn(
            all,
            all,
            |i, j| if i == j { sizes.get(i).filter(|_| i < n).map_or(1.0, |m| *m) } else { 0.0 },
        ),
        damping: DMatrix::identity(all, all) * 0.1,
        stiffness: DMatrix::identity(all, all) * 0.5,
        load: beside(vec![load; n]),
        load_harmonics: vec![LoadHarmonic { vector: beside(sizes[..n].to_vec()), omega: 1.0, phase: 0.2 }],
        contacts: contacts.collect(),
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    })
    .unwrap()
}

#[test]
fn l40_planetary_sets_leap_as_they_step() {
    for name in ["W3", "W3-sym", "W4"] {
        let set = Simulation::from_file(format!("examples/scenes/{name}.json")).unwrap();
        let start = set.start_at(&set.q0, &set.v0).unwrap();
        assert!(agree(&set.structure, &start, set.clock().at(20, 0.0)).unwrap() > 50, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    #[test]
    fn l40_chains_leap_as_they_step(
        n in 1..18usize, which in 0..4usize, kinds in prop::collection::vec(0..3usize, 3),
        sizes in prop::collection::vec(0.3..1.5, 34), load in -0.3..0.3,
    ) {
        let system = chain(n, laws()[which], &kinds, &sizes, load);
        let start = state(&system, &vec![0.0; n], &sizes[..n]);
        agree(&system, &start, system.clock().at(3, 0.0))?;
    }
}

/// A body that is stopped by a wall without rebound and leaves it at zero speed is still near it when another impact pushes it back a moment
/// later: it takes part in that impact, however the motion is followed.
#[test]
fn l40_a_contact_that_has_just_been_left_is_near() {
    // Three bodies leap by propagators at once, four by series.
    for n in [3, 4] {
        just_left(n);
    }
}

fn just_left(n: usize) {
    let unit = |i: usize| (0..n).map(|k| f64::from(u8::from(k == i))).collect::<Vec<f64>>();
    let rigid = |restitution| Law::Rigid(Rigid::constant(restitution));
    let soft = Law::KelvinVoigt(Linear { damping: 0.2 }, Release::Deflection);
    let wall = 0.25;
    let train = |strikes: f64, touches: f64| {
        let contact = |name: &str, direction: Vec<f64>, half_backlash, law| ContactSpec {
            name: name.to_owned(),
            direction,
            error: Vec::new(),
            error_offset: 0.0,
            half_backlash,
            flanks: Flanks::Drive,
            stiffness: Stiffness::Constant(1.0),
            law,
            gap_damping: 0.0,
            back: None,
        };
        Structure::new(Spec {
            freedoms: (0..n).map(|i| format!("x_{i}")).collect(),
            mass: DMatrix::identity(n, n),
            damping: DMatrix::identity(n, n) * 0.05,
            stiffness: DMatrix::from_fn(n, n, |i, j| [1.5, -0.5, 0.0, 0.0][i.abs_diff(j)]),
            load: [-1.0, 0.1, 0.1, 0.1][..n].to_vec(),
            load_harmonics: vec![LoadHarmonic { vector: [0.0, 0.1, 0.2, 0.3][..n].to_vec(), omega: 1.0, phase: 0.2 }],
            contacts: vec![
                contact("wall", unit(0), wall, rigid(0.0)),
                contact("between", [-0.7, 0.8, 0.0, 0.0][..n].to_vec(), strikes, rigid(0.7)),
                contact("soft", unit(2), touches, soft),
            ],
            omega: Some(1.0),
            bearings: vec![],
            shared: vec![],
            load_schedules: vec![],
        })
        .unwrap()
    };
    let start = |system: &Structure| state(system, &[wall - 0.3, 0.1, -0.1, 0.05][..n], &[2.0, 5.0, 0.4, 0.3][..n]);
    let far = train(50.0, 50.0);
    let (records, ..) = course(&far, &start(&far), far.clock().instant(3.0), true);
    let at_wall = &records.iter().find(|record| !record.start && !record.graze).unwrap().x_plus;
    let rate = -0.7 * at_wall[n] + 0.8 * at_wall[n + 1];
    assert!(at_wall[n].abs() < 1e-12 && rate > 0.0 && at_wall[n + 2] > 0.0, "{at_wall:?}");
    let mut met = 0;
    for k in 0..50 {
        let dt = 10f64.powf(-14.0 + 0.15 * f64::from(k));
        let strikes = -0.7 * at_wall[0] + 0.8 * at_wall[1] + rate * dt;
        let system = train(strikes, at_wall[2] + at_wall[n + 2] * 0.3 * dt);
        met += agree(&system, &start(&system), system.clock().instant(2.0)).unwrap();
    }
    assert!(met > 150, "{met}");
}

/// Grazes of a gap that is some roundings wide are the same by steps and by leaps.
#[test]
fn l40_grazes_after_leaps_are_kept() {
    let n = 5;
    let contact = |j: usize, half_backlash: f64| ContactSpec {
        name: format!("contact {j}"),
        direction: (0..n).map(|i| f64::from(u8::from(i == j))).collect(),
        error: Vec::new(),
        error_offset: 0.0,
        half_backlash,
        flanks: Flanks::Drive,
        stiffness: Stiffness::Constant(1.0),
        law: Law::KelvinVoigt(Linear { damping: 0.1 }, Release::Deflection),
        gap_damping: 0.0,
        back: None,
    };
    let mut grazes = 0;
    for i in 0..60 {
        let share = |k: f64| (f64::from(i + 1) * k.sqrt()).fract();
        let swing = 10f64.powf(-14.7 + 1.2 * share(2.0));
        let (gap, phase) = (3e-16 + 6.7e-15 * share(3.0), std::f64::consts::TAU * share(5.0));
        let system = Structure::new(Spec {
            freedoms: (0..n).map(|i| format!("x_{i}")).collect(),
            mass: DMatrix::identity(n, n),
            damping: DMatrix::from_fn(n, n, |i, j| if i == j && i > 0 { 0.1 } else { 0.0 }),
            stiffness: DMatrix::from_fn(n, n, |i, j| if i != j { 0.0 } else { 1.0 + f64::from(u8::from(i > 0)) }),
            load: (0..n).map(|i| if i == 0 { 1.0 - gap - swing } else { 0.0 }).collect(),
            load_harmonics: vec![LoadHarmonic {
                vector: (0..n).map(|i| f64::from(u8::from(i > 0))).collect(),
                omega: 1.0,
                phase: 0.2,
            }],
            contacts: vec![contact(0, 1.0), contact(1, 100.0)],
            omega: None,
            bearings: vec![],
            shared: vec![],
            load_schedules: vec![],
        })
        .unwrap();
        let (mut q, mut v) = (vec![0.1; n], vec![0.2; n]);
        (q[0], v[0]) = (1.0 - gap - swing * (1.0 - phase.cos()), -swing * phase.sin());
        let (start, end) = (state(&system, &q, &v), system.clock().instant(30.0));
        let (steps, _, by_steps) = course(&system, &start, end, true);
        let (leaps, _, by_leaps) = course(&system, &start, end, false);
        assert_eq!((by_steps.grazes, by_steps.events), (by_leaps.grazes, by_leaps.events), "{i}");
        let seen = |records: &[EventRecord]| records.iter().map(|r| (r.at, r.graze)).collect::<Vec<_>>();
        assert_eq!(seen(&steps), seen(&leaps), "{i}");
        grazes += by_steps.grazes;
    }
    assert!(grazes > 20, "{grazes}");
}

/// An observer that begins to look at steps with an event sees all that follows.
#[test]
fn l40_observers_may_begin_to_look_at_any_event() {
    struct Late {
        looks: bool,
        seen: u64,
    }
    impl Observer for Late {
        fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
            self.looks
        }

        fn step(&mut self, _: &Mode, _: &dyn flank::integrate::DenseStep, _: f64) -> ControlFlow<()> {
            self.seen += u64::from(self.looks);
            ControlFlow::Continue(())
        }

        fn leap(&mut self, _: &Mode, _: f64) -> ControlFlow<()> {
            assert!(!self.looks, "a leap where steps are wanted");
            ControlFlow::Continue(())
        }

        fn event(&mut self, _: &EventRecord) -> ControlFlow<()> {
            self.looks = true;
            ControlFlow::Continue(())
        }
    }
    for name in ["W3", "W4", "W1a-ss", "W2b"] {
        let set = Simulation::from_file(format!("examples/scenes/{name}.json")).unwrap();
        let start = set.start_at(&set.q0, &set.v0).unwrap();
        let mut late = Late { looks: false, seen: 0 };
        engine(&set.structure, start, Options::default()).run(set.clock().at(10, 0.0), &mut late).unwrap();
        assert!(late.seen > 10, "{name}");
    }
}
