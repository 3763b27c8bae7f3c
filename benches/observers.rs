//! Cost of measures beside the integration, on scenes of `examples/scenes`.
//!
//! ```text
//! cargo bench --bench observers                              # the table
//! cargo bench --bench observers -- W4 contacts               # one run with one measure, for a count of instructions
//! ```
//!
//! Without measures a train that has a lane runs in it (`docs/EVENTS.md`, 41).
//! `transient` is a job that measures nothing but its last cycle, `run` a job that measures all cycles and receives a row of each event.
//!
//! Every scene is run once per round with each measure, in turn, so that a disturbance of the machine affects all of them. The table holds
//! the median time of a step without measures, and the medians of the others divided by it.

use std::{
    error::Error,
    io::{self, Write},
    ops::ControlFlow,
    time::Instant as Stopwatch,
};

use flank::{
    Simulation,
    analysis::{Contacts, Ledger, TransmissionError},
    scene::Scene,
    simulation::Job,
};

/// Scenes, and the cycles over which they are timed.
const SCENES: [(&str, u64); 6] =
    [("W1a-ss", 1000), ("W1c-ds", 1000), ("W3", 100), ("W4", 100), ("W5b-p", 1000), ("reference-light", 50)];

const MEASURES: [&str; 7] = ["none", "contacts", "energy", "transmission", "all", "transient", "run"];

/// Number of rounds for the median; the first one warms up and is ignored.
const ROUNDS: usize = 9;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    // Cargo adds `--bench`.
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let mut out = io::stdout().lock();
    if let [name, measure] = words.as_slice() {
        let cycles = SCENES.iter().find(|(scene, _)| scene == name).map(|(_, cycles)| *cycles);
        let cycles = cycles.filter(|_| MEASURES.contains(&measure.as_str())).ok_or("no such scene or measure")?;
        let (seconds, steps) = run(&scenes(name, cycles)?, measure)?;
        return Ok(writeln!(out, "{name} {measure}: {steps} steps, {seconds} s")?);
    }
    writeln!(out, "{:<16} {:>8} {:>8}  {}", "scene", "steps", "ns/step", MEASURES[1..].join("  "))?;
    for (name, cycles) in SCENES {
        let scenes = scenes(name, cycles)?;
        let mut times = [const { Vec::new() }; MEASURES.len()];
        let mut count = 0;
        for round in 0..=ROUNDS {
            for (measure, times) in MEASURES.iter().zip(&mut times) {
                let (seconds, steps) = run(&scenes, measure)?;
                count = steps;
                if round > 0 {
                    times.push(seconds);
                }
            }
        }
        let medians = times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[ROUNDS / 2]
        });
        let ratios: Vec<String> = (1..MEASURES.len())
            .map(|i| format!("{:>width$.2}", medians[i] / medians[0], width = MEASURES[i].len()))
            .collect();
        let step = medians[0] * 1e9 / count as f64;
        writeln!(out, "{name:<16} {count:>8} {step:>8.0}  {}", ratios.join("  "))?;
    }
    Ok(())
}

/// Returns a scene whose cycles are all measured, and one of whose cycles only the last is.
fn scenes(name: &str, cycles: u64) -> Outcome<[Simulation; 2]> {
    let scene = Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR")))?;
    let with = |transient: u64| {
        let values = [("/run/cycles", cycles.into()), ("/run/transient_cycles", transient.into())];
        Simulation::from_scene(scene.with_all(values)?)
    };
    Ok([with(0)?, with(cycles - 1)?])
}

/// Returns the seconds of a run, and its steps.
fn run([simulation, late]: &[Simulation; 2], measure: &str) -> Outcome<(f64, u64)> {
    let job = match measure {
        "transient" => Some(Job { log: false, ..late.job() }),
        "run" => Some(simulation.job()),
        _ => None,
    };
    if let Some(mut job) = job {
        let mut rows = |_| ControlFlow::Continue(());
        job.rows = job.log.then_some(&mut rows);
        let watch = Stopwatch::now();
        let record = job.run()?;
        return Ok((watch.elapsed().as_secs_f64(), record.work.steps));
    }
    let structure = &simulation.structure;
    let [_, from, end] = simulation.instants();
    let has = |name: &str| measure == name || measure == "all";
    let contacts = has("contacts").then(|| Contacts::new(structure, Some(from)).keep(0));
    let energy = has("energy").then(|| Ledger::new(structure));
    // Eight harmonics of each contact.
    let contacts_of = 0..structure.contacts().len();
    let transmission = has("transmission").then(|| TransmissionError::new(structure, contacts_of, 8, Some(from)));
    let mut engine = simulation.engine(simulation.start()?)?;
    let watch = Stopwatch::now();
    engine.run(end, &mut ((contacts, energy), transmission))?;
    Ok((watch.elapsed().as_secs_f64(), engine.counters().steps))
}
