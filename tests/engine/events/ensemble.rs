//! Members of an ensemble move as they move alone, to the last bit.

use flank::{
    Simulation,
    engine::{Counters, Engine, EngineError},
    ensemble::Ensemble,
    simulation::SimulationError,
};
use rayon::ThreadPoolBuilder;

/// Where a motion is after some cycles, and the work it took.
type End = (Vec<u64>, Counters);

fn follow(_: usize, engine: &mut Engine<'_>, end: flank::hybrid::Instant) -> Result<End, EngineError> {
    engine.run(end, &mut ())?;
    Ok((engine.state().x.iter().map(|x| x.to_bits()).collect(), engine.counters()))
}

/// Starts spread over the states of a train, the same for the same number.
fn start(simulation: &Simulation, i: usize) -> Result<flank::engine::State, SimulationError> {
    let spread = |k: usize| ((i * (2 * k + 1)) as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
    let scale = simulation.structure.spec().contacts.iter().map(|c| c.half_backlash).fold(0.0, f64::max).max(1e-6);
    let moved = |x: &[f64], by: f64| x.iter().enumerate().map(|(k, x)| x + by * spread(k)).collect::<Vec<_>>();
    let omega = simulation.clock().omega().max(1.0);
    simulation.start_at(&moved(&simulation.q0, 0.9 * scale), &moved(&simulation.v0, 0.2 * scale * omega))
}

/// The ends of `members` in the order of `order`, on `threads` threads.
fn ends(simulation: &Simulation, order: &[usize], cycles: f64, threads: usize) -> Vec<(usize, End)> {
    let clock = simulation.clock();
    let end = clock.advance(simulation.instants()[0], cycles * clock.period().map_or(1.0, |t| t.value()));
    let mut ends = Vec::new();
    let mut take = |place: usize, seen: Result<End, EngineError>| {
        ends.push((order[place], seen?));
        Ok(())
    };
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let ensemble = Ensemble::new(simulation, order.len());
    pool.install(|| {
        ensemble.run(|place| start(simulation, order[place]), |i, engine| follow(i, engine, end), &mut take).unwrap();
    });
    ends.sort_by_key(|(member, _)| *member);
    ends
}

/// The same motions, each by an engine of its own.
fn alone(simulation: &Simulation, members: usize, cycles: f64) -> Vec<(usize, End)> {
    let clock = simulation.clock();
    let end = clock.advance(simulation.instants()[0], cycles * clock.period().map_or(1.0, |t| t.value()));
    let one = |i: usize| {
        let mut engine = simulation.engine(start(simulation, i).unwrap()).unwrap();
        (i, follow(i, &mut engine, end).unwrap())
    };
    (0..members).map(one).collect()
}

#[test]
fn a_member_moves_as_it_moves_alone_whatever_its_neighbours() {
    // Linear laws, a Hertz contact, rigid impacts, several contacts; the ball has no period.
    for (scene, members, cycles) in [
        ("kahraman-singh", 1000, 5.0),
        ("W2b", 200, 3.0),
        ("W5b-p", 200, 5.0),
        ("W3", 130, 1.0),
        // Long enough for motions that form what takes them on.
        ("W3", 4, 60.0),
        ("ball-on-wall", 130, 3.0),
    ] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let expected = alone(&simulation, members, cycles);
        assert!(expected.iter().any(|(_, (_, work))| work.events > 0), "{scene}");
        let mut order: Vec<usize> = (0..members).collect();
        assert_eq!(ends(&simulation, &order, cycles, 2), expected, "{scene}");
        // Members 7 or 11 apart become neighbours.
        order.sort_by_key(|i| (i % 7, std::cmp::Reverse(i % 11), *i));
        assert_eq!(ends(&simulation, &order, cycles, 1), expected, "{scene}");
    }
}
