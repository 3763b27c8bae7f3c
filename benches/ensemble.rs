//! Motion cycles per second of an ensemble, against the same motions one by one, on one thread and on two.
//!
//! ```text
//! cargo bench --bench ensemble
//! ```
//!
//! Starts differ in the first coordinate. The best of three runs counts, as every disturbance makes a run longer.

use std::{
    error::Error,
    io::{self, Write},
    time::Instant as Stopwatch,
};

use flank::{Simulation, ensemble::Ensemble};
use rayon::ThreadPoolBuilder;

const ROUNDS: usize = 3;

/// Scenes, with members and cycles of each.
const SCENES: [(&str, usize, i64); 4] =
    [("kahraman-singh", 2000, 100), ("W1a-ss", 2000, 100), ("W1a-ds", 2000, 100), ("W3", 128, 50)];

/// Returns the seconds of the best of the rounds.
fn best(mut run: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        let watch = Stopwatch::now();
        run()?;
        best = best.min(watch.elapsed().as_secs_f64());
    }
    Ok(best)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();
    writeln!(out, "Motion cycles per second, thousands\n")?;
    writeln!(out, "| scene | members | one by one | ensemble, one thread | two threads |\n|---|---|---|---|---|")?;
    for (name, members, cycles) in SCENES {
        let simulation = Simulation::from_file(format!("examples/scenes/{name}.json"))?;
        let clock = simulation.clock();
        let end = clock.advance(simulation.instants()[0], cycles as f64 * simulation.period()?);
        let start = |i: usize| {
            let mut q = simulation.q0.clone();
            q[0] += 0.1 * simulation.structure.spec().contacts[0].half_backlash * i as f64 / members as f64;
            simulation.start_at(&q, &simulation.v0)
        };
        let alone = best(|| {
            for i in 0..members {
                simulation.engine(start(i)?)?.run(end, &mut ())?;
            }
            Ok(())
        })?;
        let together = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
            let ensemble = Ensemble::new(&simulation, members);
            let follow = |_, engine: &mut flank::engine::Engine<'_>| engine.run(end, &mut ());
            best(|| Ok(pool.install(|| ensemble.run(start, follow, |_, end| Ok(end.map(drop)?)))?))
        };
        let rates = [alone, together(1)?, together(2)?].map(|s| (members as f64 * cycles as f64 / s / 1e3).round());
        writeln!(out, "| {name} | {members} | {} | {} | {} |", rates[0], rates[1], rates[2])?;
    }
    Ok(())
}
