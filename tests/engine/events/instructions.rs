//! Trains moved by different vector instructions meet the same events, arc by arc.

use flank::{Instructions, Simulation, engine::Options, system::Structure};

use super::arcs::arc;

#[test]
fn all_instructions_meet_the_same_events_arc_by_arc() {
    let sets: Vec<Instructions> = Instructions::NAMES.into_iter().filter_map(Instructions::named).collect();
    assert!(sets.contains(&Instructions::best()) && !sets.is_empty());
    let (mut compared, mut differ) = (0, 0);
    for scene in ["W1a-ds", "W1b-ds", "W2b", "W5b-p", "W3", "W4"] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let systems: Vec<Structure> =
            sets.iter().map(|set| Structure::new(simulation.structure.spec().clone()).unwrap().by(*set)).collect();
        let mut state = simulation.start().unwrap();
        for _ in 0..40 {
            let arcs: Vec<_> = systems.iter().map(|system| arc(system, &state, Options::default())).collect();
            for (other, ..) in &arcs[1..] {
                match (&arcs[0].0, other) {
                    (Some(a), Some(b)) => {
                        assert_eq!((&a.fired, &a.to), (&b.fired, &b.to), "{scene}");
                        let apart = simulation.clock().between(a.at, b.at).abs();
                        let allowed = a.conditioning.time + b.conditioning.time;
                        assert!(apart <= allowed, "{scene}: {apart:e} apart, {allowed:e} allowed");
                        compared += 1;
                        differ += u32::from(a.x_minus != b.x_minus);
                    }
                    (a, b) => assert_eq!(a.is_some(), b.is_some(), "{scene}"),
                }
            }
            state = arcs[0].1.clone();
        }
    }
    assert_eq!(compared, 240 * (sets.len() - 1));
    // The sets are not one and the same: a product and a sum are rounded once or twice.
    assert!(sets.len() == 1 || differ > 0);
}
