//! Leaps that lead where the steps do: line 40.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    engine::{Counters, Observer, Options, State},
    event::EventRecord,
    gear::{Harmonic, Piece, Stiffness, contact::Law},
    hybrid::{Instant, Mode},
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure},
};
use nalgebra::DMatrix;
use proptest::prelude::*;

use crate::{
    leaps::laws,
    support::{engine, state},
};

/// Keeps records; steps are looked at, or not.
struct Kept {
    sees_steps: bool,
    records: Vec<EventRecord>,
}

impl Observer for Kept {
    fn wants_steps(&self, _: &Mode) -> bool {
        self.sees_steps
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.records.push(record.clone());
        ControlFlow::Continue(())
    }
}

/// A run to `end`, by steps that are looked at or by leaps.
fn course(system: &Structure, start: &State, end: Instant, sees_steps: bool) -> (Vec<EventRecord>, State, Counters) {
    let mut kept = Kept { sees_steps, records: Vec::new() };
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
        prop_assert!((time - other).abs() <= 1e-9 * time, "{:e} {:e}", time, other);
    }
    prop_assert_eq!(stood, stands);
    prop_assert_eq!((counted.steps, counted.arcs, counted.events), (counts.steps, counts.arcs, counts.events));
    Ok(leaps.len())
}

/// A chain of masses before a wall, each coupled to the next by a mesh with backlash, on springs and dampers.
fn chain(n: usize, law: Law, kinds: &[usize], sizes: &[f64], load: f64) -> Structure {
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
        direction: (0..n).map(|i| [0.0, 1.0, -1.0][usize::from(i == j) + 2 * usize::from(i == j + 1)]).collect(),
        error: vec![Harmonic { omega: 1.0, amplitude: 0.1 * sizes[j], phase: j as f64 }],
        error_offset: 0.0,
        half_backlash: 0.2 + 0.1 * sizes[n + j],
        flanks: if kinds[j % kinds.len()] == 1 { Flanks::Drive } else { Flanks::Both },
        stiffness: stiffness(j),
        law,
    });
    Structure::new(Spec {
        freedoms: (0..n).map(|i| format!("x_{i}")).collect(),
        mass: DMatrix::from_fn(n, n, |i, j| if i == j { sizes[i] } else { 0.0 }),
        damping: DMatrix::identity(n, n) * 0.1,
        stiffness: DMatrix::identity(n, n) * 0.5,
        load: vec![load; n],
        load_harmonics: vec![LoadHarmonic { vector: sizes[..n].to_vec(), omega: 1.0, phase: 0.2 }],
        contacts: contacts.collect(),
        omega: None,
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
