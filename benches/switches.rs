//! Cost of a step, a mode switch and a cycle on scenes of `examples/scenes`.
//!
//! ```text
//! cargo bench --bench switches                 # all scenes
//! cargo bench --bench switches -- W3 W4        # some of them
//! ```
//!
//! Every scene is run once per round, in turn, so that a disturbance of the machine affects all of them; the table holds the medians of the
//! rounds. Only the integration is timed, not the reading and building of a scene. A mode switch is an event or a known stiffness step: its
//! column is the whole time divided by their number, so it contains the smooth motion between them.

use std::{
    error::Error,
    io::{self, Write},
    time::Instant as Stopwatch,
};

use flank::{
    engine::{Counters, Engine, Options, State},
    hybrid::Instant,
    integrate::build,
    scene::{Run, Scene},
    system::{Start, Structure},
};

/// Scenes, and the cycles over which they are timed (none: those of the scene).
const SCENES: [(&str, Option<u64>); 9] = [
    ("W1a-ss", Some(1000)),
    ("W1a-ds", Some(1000)),
    ("W1b-ss", Some(1000)),
    ("W1c-ds", Some(1000)),
    ("W2a", None),
    ("W3", Some(100)),
    ("W4", Some(100)),
    ("W5b-p", Some(1000)),
    ("reference-light", Some(50)),
];

/// Number of rounds for the median; the first one warms up and is ignored.
const ROUNDS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo adds `--bench`.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let chosen = SCENES.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name));
    let loads: Vec<Load> = chosen.map(|(name, cycles)| Load::new(name, *cycles)).collect::<Result<_, _>>()?;
    let mut seconds = vec![Vec::with_capacity(ROUNDS); loads.len()];
    for round in 0..=ROUNDS {
        for (load, seconds) in loads.iter().zip(&mut seconds) {
            let (time, _) = load.run()?;
            if round > 0 {
                seconds.push(time);
            }
        }
    }
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "{:<16} {:>3} {:>3} {:>7} {:>9} {:>9} {:>9} {:>10} {:>10} {:>10}",
        "scene", "n", "m", "cycles", "steps", "events", "switches", "ns/step", "us/switch", "us/cycle"
    )?;
    for (load, seconds) in loads.iter().zip(&mut seconds) {
        seconds.sort_by(f64::total_cmp);
        let median = seconds[ROUNDS / 2];
        let (_, work) = load.run()?;
        let each = |count: u64, unit: f64| match count {
            0 => "-".to_owned(),
            _ => format!("{:.2}", median * unit / count as f64),
        };
        writeln!(
            out,
            "{:<16} {:>3} {:>3} {:>7} {:>9} {:>9} {:>9} {:>10} {:>10} {:>10}",
            load.name,
            load.structure.freedoms(),
            load.structure.contacts().len(),
            load.cycles,
            work.steps,
            work.events,
            work.switches,
            each(work.steps, 1e9),
            each(work.events + work.switches, 1e6),
            each(load.cycles, 1e6),
        )?;
    }
    Ok(())
}

/// Scene, ready to run.
struct Load {
    name: &'static str,
    structure: Structure,
    start: Start,
    run: Run,
    cycles: u64,
}

impl Load {
    fn new(name: &'static str, cycles: Option<u64>) -> Result<Self, Box<dyn Error>> {
        let mut scene = Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR")))?;
        if let Some(cycles) = cycles {
            scene = scene.with("/run/transient_cycles", 0.into())?.with("/run/cycles", cycles.into())?;
        }
        let cycles = scene.resolved()["run"]["cycles"].as_u64().unwrap_or(0);
        let built = scene.build()?;
        let structure = Structure::new(built.spec)?;
        let [from, ..] = built.run.instants(structure.clock());
        let start = structure.start(from, &built.q0, &built.v0)?;
        Ok(Self { name, structure, start, run: built.run, cycles })
    }

    /// Returns the seconds of the integration, and the work done.
    fn run(&self) -> Result<(f64, Counters), Box<dyn Error>> {
        let [at, _, end]: [Instant; 3] = self.run.instants(self.structure.clock());
        let integrator = build(self.run.method, self.run.tolerance, &self.structure)?;
        let state = State { at, x: self.start.x.clone(), jump: self.start.jump.clone() };
        let mut engine = Engine::new(&self.structure, integrator, Options::default(), state);
        let watch = Stopwatch::now();
        engine.run(end, &mut ())?;
        Ok((watch.elapsed().as_secs_f64(), engine.counters()))
    }
}
