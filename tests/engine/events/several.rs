//! Arcs of several degrees of freedom that a propagator covers, once a run has made some arcs in their modes: line 38.

use flank::{
    Simulation,
    engine::{Engine, Options, State},
    event::EventRecord,
    gear::{
        Stiffness,
        contact::{Law, PowerLaw, Ratio},
    },
    integrate::Taylor,
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure},
};
use nalgebra::DMatrix;
use proptest::prelude::*;

use super::{
    arcs::{First, agreed},
    bare::{chain, chain_beside},
    leaps::laws,
    support::{Log, engine, state},
};

/// Arcs in a mode before its propagator is formed.
const FORMED: usize = 32;

/// The events of a run from `start` over so many cycles, and where it ends.
fn events(system: &Structure, start: &State, cycles: i64) -> (Vec<EventRecord>, State) {
    let mut log = Log::default();
    let mut engine = engine(system, start.clone(), Options::default());
    engine.run(system.clock().at(cycles, 0.0), &mut log).unwrap();
    log.records.retain(|record| !record.graze);
    (log.records, engine.state().clone())
}

/// The arcs from one of these events to the next end where series of another order and step rule end them, within the uncertainties that
/// both state. How many of them are in a mode that has been met often enough.
fn agree(system: &Structure, records: &[EventRecord]) -> Result<usize, TestCaseError> {
    let mut often = 0;
    for (i, pair) in records.windows(2).enumerate() {
        let before = records[..i].iter().filter(|record| record.to == pair[0].to).count();
        // Sequences of impacts are left to series: they are summed by what came before, and of their gaps a run knows more than its states
        // tell.
        let left = system.clock().between(pair[0].at, pair[1].at);
        let is_long = left > 1e-4 * system.clock().period().unwrap().value() && pair[1].accumulation.is_none();
        if before < FORMED || !is_long || !pair[0].jump.still.is_empty() {
            continue;
        }
        let start = State { at: pair[0].at, x: pair[0].x_plus.clone(), jump: pair[0].jump.clone() };
        let mut other = First(None);
        let mut engine = Engine::new(system, Box::new(Taylor::varied()), Options::default(), start);
        engine.run(system.clock().advance(pair[0].at, 1.5 * left), &mut other).unwrap();
        // Of a gap that it carries on a run knows more than the state behind an event tells. That state is rounded once more than the other
        // way allows for, which starts from it.
        if let Some(other) = &mut other.0 {
            other.conditioning.time *= 2.0;
        }
        agreed(system, Some(pair[1].clone()), other.0)?;
        often += 1;
    }
    Ok(often)
}

#[test]
fn l38_equal_planets_leap_as_one() {
    let set = Simulation::from_file("examples/scenes/W3-sym.json").unwrap();
    let start = set.start_at(&set.q0, &set.v0).unwrap();
    let (records, end) = events(&set.structure, &start, 100);
    assert!(agree(&set.structure, &records).unwrap() > 100);
    for x in records.iter().map(|record| &record.x_plus).chain([&end.x]) {
        // Sun, planets, ring.
        assert!([x[1], x[6]] == [x[2], x[7]] && [x[1], x[6]] == [x[3], x[8]], "{x:?}");
    }
    // All contacts of equal planets change together.
    assert!(records.iter().filter(|record| !record.start).all(|record| record.fired.len() % 3 == 0));
}

#[test]
fn l38_a_planetary_set_leaps_as_series() {
    let set = Simulation::from_file("examples/scenes/W3.json").unwrap();
    let start = set.start_at(&set.q0, &set.v0).unwrap();
    assert!(agree(&set.structure, &events(&set.structure, &start, 200).0).unwrap() > 300);
}

/// As of one degree of freedom ([`leaps`](super::leaps)): on a stable orbit, which has four events in a cycle.
#[test]
fn l38_leaps_of_several_bodies_have_no_bias() {
    let n = 4;
    let wall = |j: usize| ContactSpec {
        name: format!("wall {j}"),
        direction: (0..n).map(|i| f64::from(u8::from(i == j))).collect(),
        error: Vec::new(),
        error_offset: 0.0,
        half_backlash: 0.1,
        flanks: Flanks::Drive,
        stiffness: Stiffness::Constant(4.0),
        law: laws()[1],
        gap_damping: 0.0,
        back: None,
    };
    let system = Structure::new(Spec {
        freedoms: (0..n).map(|i| format!("x_{i}")).collect(),
        mass: DMatrix::identity(n, n),
        damping: DMatrix::from_fn(n, n, |i, j| [0.4, -0.1, 0.0, 0.0][i.abs_diff(j)]),
        stiffness: DMatrix::from_fn(n, n, |i, j| [4.1, -2.0, 0.0, 0.0][i.abs_diff(j)]),
        load: vec![0.1; n],
        load_harmonics: vec![LoadHarmonic { vector: vec![1.0; n], omega: 1.0, phase: 0.2 }],
        contacts: vec![wall(0), wall(2)],
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    })
    .unwrap();
    let start = || state(&system, &vec![0.0; n], &vec![0.1; n]);
    let mut leaping = engine(&system, start(), Options::default());
    let mut series = Engine::new(&system, Box::new(Taylor::varied()), Options::default(), start());
    leaping.run(system.clock().at(1000, 0.0), &mut ()).unwrap();
    let early = leaping.state().x.clone();
    series.run(system.clock().at(1000, 0.0), &mut ()).unwrap();
    leaping.run(system.clock().at(100_000, 0.0), &mut ()).unwrap();
    assert!(leaping.counters().events >= 400_000);
    // The roundings of a cycle differ, some units in the last place of numbers of order one, and the orbit answers with a few times that. They
    // are the same after a hundred times as many cycles.
    for (leapt, (early, x)) in leaping.state().x.iter().zip(early.iter().zip(&series.state().x)) {
        assert!((leapt - early).abs() <= 32.0 * f64::EPSILON, "{leapt:e} {early:e}");
        assert!((leapt - x).abs() <= 64.0 * f64::EPSILON, "{leapt:e} {x:e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn l38_chains_leap_as_series(
        n in 2..7usize, which in 0..4usize, kinds in prop::collection::vec(0..2usize, 3),
        sizes in prop::collection::vec(0.3..1.5, 12), load in -0.3..0.3,
    ) {
        let system = chain(n, laws()[which], &kinds, &sizes, load);
        let start = state(&system, &vec![0.0; n], &sizes[..n]);
        agree(&system, &events(&system, &start, 40).0)?;
    }
}

/// Beside so many masses a chain has another recurrence, in more than one panel.
const BESIDE: usize = 24;

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// Masses that nothing moves change no event of a chain: from each state behind an event the next one is the same, within the
    /// uncertainties that both state.
    #[test]
    fn masses_beside_a_chain_change_nothing(
        n in 1..6usize, which in prop::collection::vec(0..5usize, 2), kinds in prop::collection::vec(0..3usize, 3),
        sizes in prop::collection::vec(0.3..1.5, 10), load in -0.3..0.3,
    ) {
        let exponent = Ratio { p: 3, q: 2 };
        let power = Law::Power(PowerLaw { exponent, hysteresis: 0.2, speed_floor: 0.05, initial_speed: 1.0 });
        let law = |j: usize| laws().get(which[j % 2]).copied().unwrap_or(power);
        // A power law has a constant stiffness.
        let kind = |i: usize| if which[i] == 4 { 0 } else { kinds[i] };
        let kinds = if which.contains(&4) { vec![kind(0), kind(1)] } else { kinds.clone() };
        let [narrow, wide] = [0, BESIDE].map(|idle| chain_beside(idle, n, law, &kinds, &sizes, load));
        let start = state(&narrow, &vec![0.0; n], &sizes[..n]);
        let mut log = Log { stop_after: Some(40), ..Log::default() };
        engine(&narrow, start, Options::default()).run(narrow.clock().at(3, 0.0), &mut log).unwrap();
        log.records.retain(|record| !record.graze);
        for pair in log.records.windows(2).filter(|pair| pair[1].accumulation.is_none()) {
            let left = narrow.clock().between(pair[0].at, pair[1].at);
            let next = |system: &Structure, x: Vec<f64>| {
                let mut first = First(None);
                let start = State { at: pair[0].at, x, jump: pair[0].jump.clone() };
                engine(system, start, Options::default()).run(system.clock().advance(pair[0].at, 1.5 * left), &mut first).unwrap();
                first.0
            };
            let x = &pair[0].x_plus;
            let padded = [&x[..n], &[0.0; BESIDE], &x[n..2 * n], &[0.0; BESIDE], &x[2 * n..]].concat();
            agreed(&narrow, next(&narrow, x.clone()), next(&wide, padded))?;
        }
    }
}
