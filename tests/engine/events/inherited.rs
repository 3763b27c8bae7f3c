//! What a run has amplified of its errors.

use flank::{Instructions, Simulation, analysis::EventRow, scene::Duration};

/// The events of some cycles of an example.
fn events(scene: &str, cycles: u64, inherited: bool, instructions: Instructions) -> Vec<EventRow> {
    let mut simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
    simulation.settings.duration = Duration::Cycles(cycles);
    simulation.settings.transient_cycles = 0;
    simulation.settings.inherited_uncertainty = inherited;
    simulation.structure = simulation.structure.by(instructions);
    simulation.run().unwrap().events
}

/// Two sets of instructions round differently: their runs drift apart by no more than what both figures of an event say.
#[test]
fn runs_that_round_differently_agree_within_both_uncertainties() {
    let sets: Vec<Instructions> = Instructions::NAMES.into_iter().filter_map(Instructions::named).collect();
    let (mut beyond_local, mut compared, mut ratios) = (0, 0, Vec::new());
    for (scene, cycles) in [("W1a-ds", 40), ("W1a-ch", 30), ("W5b-p", 40), ("W2b", 20), ("W3", 8), ("W4", 4)] {
        let own = events(scene, cycles, true, sets[0]);
        assert!(own.iter().filter(|event| event.inherited_uncertainty.is_some()).count() * 2 > own.len(), "{scene}");
        let other = events(scene, cycles, false, sets[sets.len() - 1]);
        assert!(other.iter().all(|event| event.inherited_uncertainty.is_none()));
        for (a, b) in own.iter().zip(&other) {
            let Some(inherited) = a.inherited_uncertainty else { continue };
            let apart = (a.seconds - b.seconds).abs();
            // Times are compared as doubles: both are rounded.
            let allowed = inherited + a.uncertainty + f64::EPSILON * a.seconds;
            assert!(apart <= allowed, "{scene} at {}: {apart:e} apart, {allowed:e} allowed", a.seconds);
            compared += 1;
            ratios.extend((apart > 0.0).then_some(inherited / apart));
            beyond_local += usize::from(apart > a.uncertainty + f64::EPSILON * a.seconds);
        }
    }
    assert!(compared > 400);
    // A figure that is always far too large would be of no use: half of them are within three digits.
    ratios.sort_by(f64::total_cmp);
    assert!(ratios[ratios.len() / 2] <= 1e3, "{:e}", ratios[ratios.len() / 2]);
    // The local figure alone is no error bar.
    assert!(sets.len() == 1 || beyond_local > compared / 20, "{beyond_local} of {compared}");
}

/// In chaos errors grow as the largest exponent says: 0.0754 a unit of time, so some e^17 over 30 cycles at Ω = 0.8.
#[test]
fn chaos_amplifies_errors() {
    let own = events("W1a-ch", 30, true, Instructions::best());
    let told: Vec<f64> = own.iter().filter_map(|event| event.inherited_uncertainty).collect();
    let growth = told[told.len() - 1] / told[1];
    assert!((1e4..1e10).contains(&growth), "{growth:e}");
}
