//! Cost of the whole derivative of a motion beside the motion, on scenes of `examples/scenes`.
//!
//! ```text
//! cargo bench --bench tangent                                # the table
//! ```
//!
//! Cycles are run from a section that the scene has come to, in turn with and without the derivative. The table holds medians.

use std::{
    error::Error,
    io::{self, Write},
    time::Instant as Stopwatch,
};

use flank::{Simulation, orbit::SectionMap};

/// Scenes, and the cycles over which they are timed.
const SCENES: [(&str, u64); 9] = [
    ("W1a-ss", 1000),
    ("W1b-ds", 500),
    ("W1c-ds", 500),
    ("W5b-p", 1000),
    ("W2b", 200),
    ("W3", 50),
    ("W4", 20),
    ("reference-heavy", 50),
    ("reference-light", 20),
];
/// Cycles before, in which a motion leaves its start.
const BEFORE: u64 = 20;
/// Number of rounds for the median; the first one warms up and is ignored.
const ROUNDS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "| scene | degrees of freedom | 1 + half of them | with ÷ without the derivative |\n|---|---|---|---|"
    )?;
    for (name, cycles) in SCENES {
        let simulation = Simulation::from_file(format!("examples/scenes/{name}.json"))?;
        let map = SectionMap::new(&simulation)?;
        let section = map.follow(&map.start()?, BEFORE)?;
        let mut times = [const { Vec::new() }; 2];
        for _ in 0..=ROUNDS {
            let watch = Stopwatch::now();
            map.follow(&section, cycles)?;
            times[0].push(watch.elapsed().as_secs_f64());
            let watch = Stopwatch::now();
            map.image(&section, cycles)?;
            times[1].push(watch.elapsed().as_secs_f64());
        }
        let [without, with] = times.map(|mut times| {
            times.remove(0);
            times.sort_by(f64::total_cmp);
            times[ROUNDS / 2]
        });
        let freedoms = simulation.structure.freedoms();
        writeln!(out, "| {name} | {freedoms} | {} | {:.2} |", 1.0 + freedoms as f64 / 2.0, with / without)?;
    }
    Ok(())
}
