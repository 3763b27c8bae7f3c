//! Times one of the workloads of `examples/scenes`, and writes its events.
//!
//! ```text
//! cargo run --release --example workload -- W3 [--cycles N] [--repetitions R] [--events FILE]
//! ```
//!
//! One line of JSON: wall time of the integration per cycle (best and median of the repetitions), the work done, and
//! heap allocations per step once the run is warm. With `--events` the run has the length of its scene, and `FILE`
//! holds rows `[time, surface, direction]`: surface `2j` is the drive flank of contact `j`, `2j + 1` its back flank,
//! and the direction is the sign of the crossing.

use std::{error::Error, fs, io::Write, ops::ControlFlow, process::ExitCode, time::Instant as Stopwatch};

use flank::{
    engine::{Engine, Observer, Options, State},
    event::EventRecord,
    hybrid::{ContactView, HybridSystem, Instant, Mode, Watch},
    integrate::build,
    scene::{Duration, Run, Scene},
    system::{Start, Structure},
};
use serde_json::{Value, json};

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    match run(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}\nusage: workload NAME [--cycles N] [--repetitions R] [--events FILE]");
            ExitCode::FAILURE
        }
    }
}

fn run(words: &[String]) -> Outcome<()> {
    let name = words.first().ok_or("no workload named")?;
    let (mut cycles, mut repetitions, mut events) = (None, 5, None);
    for pair in words[1..].chunks(2) {
        match pair {
            [key, value] if key == "--cycles" => cycles = Some(value.parse::<u64>()?),
            [key, value] if key == "--repetitions" => repetitions = value.parse::<usize>()?.max(1),
            [key, value] if key == "--events" => events = Some(value),
            _ => return Err(format!("{} is not understood", pair[0]).into()),
        }
    }
    let scene = Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR")))?;
    let own = match scene.build()?.run.duration {
        Duration::Cycles(n) => n,
        Duration::Until(_) => return Err("a workload is a scene that counts cycles".into()),
    };
    let cycles = cycles.unwrap_or(if events.is_some() { own } else { usual(name, own) });
    let workload = Workload::new(&scene.with("/run/cycles", cycles.into())?)?;
    if let Some(file) = events {
        fs::write(file, serde_json::to_string(&workload.events()?)?)?;
    }
    let line = workload.measure(repetitions)?;
    let line = merged(json!({ "workload": name, "cycles": cycles }), line, cycles);
    Ok(writeln!(std::io::stdout(), "{line}")?)
}

/// Cycles over which a workload is timed.
fn usual(name: &str, own: u64) -> u64 {
    match name {
        "W2b" => 1000,
        "W2a" | "W5a" | "W5c" => own,
        _ if name.starts_with("W3") || name.starts_with("W4") => 200,
        _ => 2000,
    }
}

struct Workload {
    structure: Structure,
    start: Start,
    run: Run,
    /// Surfaces of a wall are those of the coordinate, not of the deflection.
    sign: f64,
}

impl Workload {
    fn new(scene: &Scene) -> Outcome<Self> {
        let built = scene.build()?;
        let wall = scene.resolved()["train"]["kind"] == "wall";
        let sign = if wall { built.spec.contacts[0].direction[0].signum() } else { 1.0 };
        let structure = Structure::new(built.spec)?;
        let [from, ..] = built.run.instants(structure.clock());
        let start = structure.start(from, &built.q0, &built.v0)?;
        Ok(Self { structure, start, run: built.run, sign })
    }

    /// An engine at the start.
    fn engine(&self) -> Outcome<Engine<'_>> {
        let integrator = build(self.run.method, self.run.tolerance, &self.structure)?;
        let [at, ..] = self.run.instants(self.structure.clock());
        let state = State { at, x: self.start.x.clone(), jump: self.start.jump.clone() };
        Ok(Engine::new(&self.structure, integrator, Options::default(), state))
    }

    fn end(&self) -> Instant {
        self.run.instants(self.structure.clock())[2]
    }

    /// Rows `[time, surface, direction]`.
    fn events(&self) -> Outcome<Vec<Value>> {
        let mut crossings = Crossings { of: self, rows: Vec::new() };
        self.engine()?.run(self.end(), &mut crossings)?;
        Ok(crossings.rows)
    }

    /// Seconds of the integration, best and median, and the work done.
    fn measure(&self, repetitions: usize) -> Outcome<Value> {
        let mut seconds = Vec::with_capacity(repetitions);
        for _ in 0..repetitions {
            let mut engine = self.engine()?;
            let watch = Stopwatch::now();
            engine.run(self.end(), &mut ())?;
            seconds.push(watch.elapsed().as_secs_f64());
        }
        seconds.sort_by(f64::total_cmp);
        let mut engine = self.engine()?;
        let [from, _, to] = self.run.instants(self.structure.clock());
        let clock = self.structure.clock();
        engine.run(clock.advance(from, 0.25 * clock.between(from, to)), &mut ())?;
        let warm = engine.counters();
        let mut finished = Ok(());
        let heap = allocation_counter::measure(|| finished = engine.run(to, &mut ()).map(|_| ()));
        finished?;
        let done = engine.counters();
        Ok(json!({
            "best": seconds[0],
            "median": seconds[repetitions / 2],
            "steps": done.steps,
            "switches": done.switches,
            "events": done.events,
            "allocations": heap.count_total as f64 / (done.steps - warm.steps).max(1) as f64,
        }))
    }
}

/// The line: wall times per cycle.
fn merged(mut line: Value, measured: Value, cycles: u64) -> Value {
    let per_cycle = |key: &str| measured[key].as_f64().unwrap_or(f64::NAN) / cycles as f64;
    line["wall_s_per_cycle"] = json!({ "best": per_cycle("best"), "median": per_cycle("median") });
    for key in ["steps", "switches", "events", "allocations"] {
        line[key] = measured[key].clone();
    }
    line
}

/// Every crossing of a flank.
struct Crossings<'w> {
    of: &'w Workload,
    rows: Vec<Value>,
}

impl Observer for Crossings<'_> {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        let structure = &self.of.structure;
        if record.graze || record.start || record.accumulation.is_some() {
            return ControlFlow::Continue(());
        }
        let t = HybridSystem::clock(structure).time(record.at).value();
        for (j, watch) in record.fired.iter().map(|id| structure.watch(id)) {
            if watch != Watch::Force {
                let rate = self.of.sign * structure.deflection(j, record.at, &record.x_minus).1;
                let surface = 2 * j + usize::from(watch == Watch::BackFlank);
                self.rows.push(json!([t, surface, if rate > 0.0 { 1 } else { -1 }]));
            }
        }
        ControlFlow::Continue(())
    }
}
