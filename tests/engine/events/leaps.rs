//! Arcs that a propagator covers at once: line 38.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    engine::{Engine, Observer, Options, State},
    event::EventRecord,
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release, Rigid},
    },
    hybrid::{ContactMode, Mode},
    integrate::{DenseStep, Taylor},
    system::{Structure, contact_mode},
    train::{WalledOscillator, Walls},
};
use proptest::prelude::*;

use super::{
    arcs::{ArcEnds, First, agreed},
    support::{engine, run, state, walled},
};

/// A mass between or before walls, driven at 1 rad/s.
fn driven(law: Law, load: f64, amplitude: f64, phase: f64, damping: f64) -> Structure {
    let walls = Walls::Above { position: 0.1 };
    let load_harmonics = vec![Harmonic { omega: 1.0, amplitude, phase }];
    walled(&WalledOscillator {
        load,
        load_harmonics,
        damping,
        ..WalledOscillator::new(1.0, walls, law, Stiffness::Constant(4.0))
    })
}

/// A mass before or between walls whose stiffness follows the drive: its first and third harmonic, of amplitudes that are shares of the mean.
fn modulated(law: Law, [first, third]: [f64; 2], load: f64, amplitude: f64, phase: f64, omega: f64) -> Structure {
    let wave = |order: f64, share: f64, phase: f64| Harmonic { omega: order * omega, amplitude: share, phase };
    let mut harmonics = vec![wave(1.0, first, 0.3 + phase), wave(3.0, third, 2.0 * phase)];
    harmonics.retain(|wave| wave.amplitude > 0.0);
    let stiffness = Stiffness::Harmonic { mean: 4.0, harmonics };
    let load_harmonics = vec![Harmonic { omega, amplitude, phase }];
    let walls = if phase > 3.0 { Walls::Between { half_gap: 0.1 } } else { Walls::Above { position: 0.1 } };
    walled(&WalledOscillator {
        load,
        load_harmonics,
        damping: 0.05,
        ..WalledOscillator::new(1.0, walls, law, stiffness)
    })
}

/// Linear laws with every release, and a rigid one.
pub fn laws() -> [Law; 4] {
    [
        Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection),
        Law::KelvinVoigt(Linear { damping: 0.3 }, Release::Deflection),
        Law::KelvinVoigt(Linear { damping: 0.3 }, Release::Force),
        Law::Rigid(Rigid::constant(0.7)),
    ]
}

#[test]
fn l38_an_arc_that_a_span_covers_is_one_step() {
    for law in laws() {
        let run = run(&driven(law, 0.3, 1.0, 0.4, 0.05), &[0.0], &[0.2], 100.0);
        assert!(run.counters.events > 10, "{law:?}");
        // A flight of a period is two spans of 4.5 rad; series of order 24 hold for 2.3 rad, of 4 rad/s in the contact.
        assert!(run.counters.steps <= run.counters.arcs + run.counters.arcs / 2 + 16, "{law:?} {:?}", run.counters);
    }
}

#[test]
fn l38_an_observer_of_steps_changes_no_bit_of_the_motion() {
    for law in laws() {
        let system = driven(law, 0.3, 1.0, 0.4, 0.05);
        let plain = run(&system, &[0.0], &[0.2], 100.0);
        let mut shown = ArcEnds::of(2);
        let mut engine = engine(&system, state(&system, &[0.0], &[0.2]), Options::default());
        engine.run(system.clock().instant(100.0), &mut shown).unwrap();
        assert_eq!(shown.records, plain.records, "{law:?}");
        assert_eq!(engine.state(), &plain.state);
        // Displacements and speeds are of order one; two ways over an arc of some radians, a few units in the last place each.
        assert!(shown.worst <= 64.0 * f64::EPSILON, "{law:?} {:e}", shown.worst);
    }
}

/// A propagator that is rounded once moves every leap in the same direction. A stable orbit holds that back, and shows it as a shift from
/// the orbit that series of another order have. After a million leaps there is none but a few units in the last place.
#[test]
fn l38_a_million_leaps_have_no_bias() {
    for name in ["W1a-ss", "W1b-ss"] {
        let pair = Simulation::from_file(format!("examples/scenes/{name}.json")).unwrap();
        let start = || pair.start_at(&pair.q0, &pair.v0).unwrap();
        let mut leaping = pair.engine(start()).unwrap();
        let mut series = Engine::new(&pair.structure, Box::new(Taylor::varied()), Options::default(), start());
        leaping.run(pair.clock().at(500_000, 0.0), &mut ()).unwrap();
        series.run(pair.clock().at(1000, 0.0), &mut ()).unwrap();
        assert!(leaping.counters().events >= 999_000);
        for (leapt, x) in leaping.state().x.iter().zip(&series.state().x) {
            assert!((leapt - x).abs() <= 16.0 * f64::EPSILON, "{name} {leapt:e} {x:e}");
        }
    }
}

/// Arcs of a run before it forms a propagator for a stiffness that follows the drive.
const FORMED: usize = 128;

/// Contacts, and the pieces that they are passed in.
#[derive(Default)]
struct Pieces {
    contacts: u32,
    pieces: u32,
}

impl Pieces {
    fn add(&mut self, mode: &Mode) -> ControlFlow<()> {
        self.pieces += u32::from(contact_mode(mode, 0) != ContactMode::Separated);
        ControlFlow::Continue(())
    }
}

impl Observer for Pieces {
    fn wants_steps(&self, _: &Mode, _: flank::hybrid::Instant) -> bool {
        false
    }

    fn step(&mut self, mode: &Mode, _: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        self.add(mode)
    }

    fn leap(&mut self, mode: &Mode, _: f64) -> ControlFlow<()> {
        self.add(mode)
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.contacts += u32::from(contact_mode(&record.to, 0) != ContactMode::Separated);
        ControlFlow::Continue(())
    }
}

/// Stiffness that follows the drive: a contact is one leap, once a run has made some arcs, and several series before.
#[test]
fn l38_an_arc_of_a_modulated_contact_is_one_step() {
    let pair = Simulation::from_file("examples/scenes/W1b-ds.json").unwrap();
    let mut engine = pair.engine(pair.start_at(&pair.q0, &pair.v0).unwrap()).unwrap();
    let mut pieces = |cycle: i64| {
        let mut pieces = Pieces::default();
        engine.run(pair.clock().at(cycle, 0.0), &mut pieces).unwrap();
        (pieces, engine.counters().arcs as usize)
    };
    let ((first, before), (_, after), (last, _)) = (pieces(30), pieces(40), pieces(100));
    assert!(before < FORMED && after > FORMED && last.contacts > 100);
    assert!(first.pieces >= 2 * first.contacts - 2, "{} {}", first.pieces, first.contacts);
    assert!(last.pieces <= last.contacts + 2, "{} {}", last.pieces, last.contacts);
}

/// A force that is watched and not carried grows with the stiffness: it feels the stretch that its contact starts with.
#[test]
fn l38_a_watched_force_feels_the_stretch_at_the_start() {
    let system = modulated(laws()[2], [0.2, 0.04], 0.375, 1.217, 1.494, 2.434);
    let run = run(&system, &[0.0], &[0.3], 300.0);
    let detached = |mode: &Mode| contact_mode(mode, 0) == ContactMode::DriveDetached;
    // Each of these arcs is tested at its end, by the force of the state.
    assert!(run.records.iter().skip(FORMED).filter(|record| detached(&record.from)).count() > 20);
}

/// One arc from the start, by series of another order and step rule.
fn by_series(system: &Structure, q: f64, v: f64, end: f64) -> Option<EventRecord> {
    let mut first = First(None);
    let start = state(system, &[q], &[v]);
    let mut engine = Engine::new(system, Box::new(Taylor::varied()), Options::default(), start);
    engine.run(system.clock().instant(end), &mut first).unwrap();
    first.0
}

/// A ball with a slow drag c bounces until it rests. The span is 4.5/c, far longer than a flight. Each approach is e times the one
/// before, less what the drag takes.
#[test]
fn l38_flights_much_shorter_than_a_span_keep_their_digits() {
    for damping in [0.3, 0.01, 1e-4, 1e-8, 1e-14] {
        let law = Law::Rigid(Rigid::constant(0.5));
        let walls = Walls::Below { position: 0.0 };
        let ball = WalledOscillator {
            load: -1.0,
            damping,
            ..WalledOscillator::new(1.0, walls, law, Stiffness::Constant(1.0))
        };
        let run = run(&walled(&ball), &[0.5], &[0.0], 30.0);
        let speeds: Vec<f64> = run.events().iter().map(|r| -r.x_minus[1]).collect();
        let rest = run.events().iter().position(|r| r.accumulation.is_some()).unwrap();
        assert!(rest > 30, "{damping} {rest}");
        for i in 1..rest {
            // Over a flight from u the drag takes c u²/(3 A) of an approach, A = 1, relative to it 2 c u/3 and less than c u.
            let ratio = speeds[i] / (0.5 * speeds[i - 1]);
            let u = 0.5 * speeds[i - 1];
            assert!((1.0 - ratio).abs() <= damping * u + 1e-14, "{damping} {i} {ratio}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// The first event of a leap is that of the series, within the uncertainties that both state.
    #[test]
    fn l38_leaps_end_where_series_end(
        which in 0..4usize, load in -0.5..1.5, amplitude in 0.0..3.0, phase in 0.0..6.3, damping in 0.001..0.5,
        q in -0.5..0.1, v in -1.0..1.0,
    ) {
        let system = driven(laws()[which], load, amplitude, phase, damping);
        let mut first = First(None);
        let mut engine = engine(&system, state(&system, &[q], &[v]), Options::default());
        engine.run(system.clock().instant(12.0), &mut first).unwrap();
        let other = by_series(&system, q, v, 12.0);
        agreed(&system, first.0, other)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// The same where the stiffness follows the drive: arc by arc, each from where the run starts it.
    #[test]
    fn l38_modulated_leaps_end_where_series_end(
        which in 0..3usize, first in 0.01..0.6, third in prop_oneof![Just(0.0), 0.0..0.3], load in -0.2..1.5, amplitude in 0.5..3.0,
        phase in 0.0..6.3, omega in 0.2..3.0,
    ) {
        let system = modulated(laws()[which], [first, third], load, amplitude, phase, omega);
        let run = run(&system, &[0.0], &[0.3], 600.0 / omega);
        let records: Vec<_> = run.records.iter().filter(|record| !record.graze).collect();
        for pair in records.windows(2).skip(FORMED).take(30) {
            let start = State { at: pair[0].at, x: pair[0].x_plus.clone(), jump: pair[0].jump.clone() };
            let left = system.clock().between(pair[0].at, pair[1].at);
            let mut other = First(None);
            let mut engine = Engine::new(&system, Box::new(Taylor::varied()), Options::default(), start);
            engine.run(system.clock().advance(pair[0].at, 1.5 * left), &mut other).unwrap();
            agreed(&system, Some(pair[1].clone()), other.0)?;
        }
    }
}
