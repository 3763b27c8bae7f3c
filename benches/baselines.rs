//! Cost of a step of each fixed-step baseline on scenes of `examples/scenes`.
//!
//! ```text
//! cargo bench --bench baselines                # all scenes
//! cargo bench --bench baselines -- W3          # some of them
//! ```
//!
//! Events are recorded, as in a comparison. Rounds alternate over scenes and methods; the table holds medians, ns a step.

use std::{
    error::Error,
    io::{self, Write},
    time::Instant as Stopwatch,
};

use flank::{
    Simulation,
    accuracy::{Contender, Problem, Setting},
};

const SCENES: [&str; 6] = ["W1a-ss", "W1b-ds", "W1c-ds", "W2b", "W3", "W4"];
const METHODS: [&str; 5] = ["rk4", "newmark", "generalized-alpha", "verlet", "euler"];
/// Steps per cycle.
const STEPS: u64 = 1013;
const CYCLES: u64 = 20;
const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let scenes: Vec<&str> = SCENES.into_iter().filter(|s| wanted.is_empty() || wanted.iter().any(|w| w == s)).collect();
    let contenders = METHODS.iter().map(|word| Contender::parse(word)).collect::<Result<Vec<_>, _>>()?;
    let mut out = io::stdout().lock();
    write!(out, "{:<10}", "ns/step")?;
    METHODS.iter().try_for_each(|m| write!(out, " {m:>18}"))?;
    writeln!(out)?;
    for name in scenes {
        let path = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let simulation = Simulation::from_file(path)?;
        let problem = Problem::new(&simulation, Some(CYCLES))?;
        let mut times = vec![Vec::new(); contenders.len()];
        for _ in 0..ROUNDS {
            for (contender, times) in contenders.iter().zip(&mut times) {
                let watch = Stopwatch::now();
                contender.solve(&problem, CYCLES, Setting::StepsPerCycle(STEPS))?;
                times.push(watch.elapsed().as_secs_f64() * 1e9 / (STEPS * CYCLES) as f64);
            }
        }
        write!(out, "{name:<10}")?;
        for times in &mut times {
            times.sort_by(f64::total_cmp);
            write!(out, " {:>18.1}", times[ROUNDS / 2])?;
        }
        writeln!(out)?;
    }
    Ok(())
}
