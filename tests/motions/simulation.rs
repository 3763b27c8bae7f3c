//! The front door: scenes and trains built in Rust run, are watched and written as `flank run` does.

use std::{
    fs,
    ops::ControlFlow,
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
};

use flank::{
    Error, Progress, Simulation, Task,
    analysis::{Grid, Ledger},
    engine::{Engine, Observer, Options},
    event::EventRecord,
    gear::{Stiffness, contact::Law, contact::Rigid},
    hybrid::{Instant, Mode},
    integrate::DenseStep,
    orbit::SectionMap,
    output::OutputError,
    scene::{Duration, Run, Scene},
    simulation::{EndKind, Job, SimulationError},
    train::{WalledOscillator, Walls},
};

/// A ball that falls on a floor for `end` seconds.
fn ball(end: f64) -> String {
    format!(
        r#"{{ "flank": 1, "train": {{ "kind": "wall", "mass_kg": 1, "load_n": -9.81,
            "wall": {{ "side": "below", "position_m": 0 }}, "law": {{ "kind": "rigid", "restitution": 0.8 }} }},
            "initial": {{ "q": [1] }}, "run": {{ "t_end_s": {end} }} }}"#
    )
}

/// The same ball without JSON.
fn ball_in_rust(end: f64) -> Simulation {
    let law = Law::Rigid(Rigid::constant(0.8));
    let walled = WalledOscillator::new(1.0, Walls::Below { position: 0.0 }, law, Stiffness::Constant(1.0));
    let spec = WalledOscillator { load: -9.81, ..walled }.assemble().unwrap();
    Simulation::from_spec("ball", spec, Run::new(Duration::Until(end))).unwrap().starting_at(vec![1.0], vec![0.0])
}

fn example(name: &str) -> String {
    format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"))
}

/// Counts events, and stops at `most`.
struct Count {
    found: usize,
    most: usize,
}

impl Observer for Count {
    fn event(&mut self, _: &EventRecord) -> ControlFlow<()> {
        self.found += 1;
        if self.found < self.most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

#[test]
fn a_run_has_measures_energy_and_events() {
    let run = Simulation::from_json(&ball(5.0)).unwrap().run().unwrap();
    assert_eq!(run.outcome.kind, EndKind::ReachedEnd);
    assert_eq!(run.events.len() as u64, run.work.events);
    assert_eq!(run.contacts[0].name, "wall");
    assert!(run.energy.closure() < 1e-12);
    // Without a period there are no harmonics; the mean is that of minus the height.
    assert_eq!((&*run.transmission[0].name, &run.transmission[0].harmonics), ("wall", &None));
    assert!(run.transmission[0].mean < 0.0);
    let first = (2.0_f64 / 9.81).sqrt();
    assert!((run.events[0].seconds - first).abs() < 1e-15);
    assert!(run.failure.is_none());
}

#[test]
fn a_train_built_in_rust_moves_as_the_scene_does() {
    let (scene, rust) = (Simulation::from_json(&ball(5.0)).unwrap().run().unwrap(), ball_in_rust(5.0).run().unwrap());
    assert_eq!(scene.events, rust.events);
    assert_eq!(scene.contacts, rust.contacts);
    assert_eq!((rust.train.kind.as_str(), rust.scene.sha256.as_deref()), ("spec", None));
}

#[test]
fn settings_in_rust_are_those_of_a_scene_that_names_none() {
    assert_eq!(Run::new(Duration::Until(5.0)), Scene::from_json(&ball(5.0), "ball").unwrap().built().run);
}

#[test]
fn a_run_without_an_end_is_refused() {
    let spec = ball_in_rust(5.0).structure.spec().clone();
    let of = |run: Run| Simulation::from_spec("ball", spec.clone(), run);
    let endless = [
        Run::new(Duration::Cycles(10)),
        Run::new(Duration::Until(f64::NAN)),
        Run::new(Duration::Until(0.0)),
        Run { period: Some(1.0), transient_cycles: 5, ..Run::new(Duration::Cycles(5)) },
    ];
    for run in endless {
        let error = of(run).unwrap_err();
        assert!(matches!(error, SimulationError::Missing { .. }) && error.to_string().contains("no end"), "{error}");
    }
    assert!(of(Run { period: Some(1.0), ..Run::new(Duration::Cycles(5)) }).is_ok());
    let wrong = ball_in_rust(5.0).starting_at(vec![1.0, 2.0], vec![0.0]).run().unwrap_err();
    assert!(matches!(wrong, SimulationError::Start(_)), "{wrong}");
}

#[test]
fn an_observer_sees_events_and_may_stop() {
    let simulation = Simulation::from_file(example("W1a-ds")).unwrap();
    let mut all = Count { found: 0, most: usize::MAX };
    let run = simulation.observe(&mut all).run().unwrap();
    assert_eq!((run.outcome.kind, all.found as u64), (EndKind::ReachedEnd, run.work.events));
    let mut some = Count { found: 0, most: 7 };
    let run = simulation.observe(&mut some).run().unwrap();
    assert_eq!((run.outcome.kind, run.events.len()), (EndKind::Stopped, 7));
    let run = Job { max_events: 5, ..simulation.job() }.run().unwrap();
    assert_eq!((run.outcome.kind, run.events.len()), (EndKind::EventBudgetSpent, 5));
}

#[test]
fn a_task_cancels_and_follows_a_run() {
    let simulation = Simulation::from_file(example("W4")).unwrap();
    let (cancelled, seen) = (AtomicBool::new(false), Mutex::new(Vec::new()));
    let progress = |progress| {
        let Progress::Share(share) = progress else { panic!("a run reports shares") };
        cancelled.store(share > 0.1, Ordering::Relaxed);
        seen.lock().unwrap().push(share);
    };
    let run = Job { task: Task::new(&cancelled, &progress), ..simulation.job() }.run().unwrap();
    assert_eq!(run.outcome.kind, EndKind::Interrupted);
    let seen = seen.into_inner().unwrap();
    assert!(seen.is_sorted() && *seen.last().unwrap() < 0.5, "{seen:?}");
}

#[test]
fn faults_of_a_scene_name_their_place() {
    let error = Simulation::from_json(&ball(5.0).replace("0.8", "1.8").replace("mass_kg", "mass")).unwrap_err();
    let SimulationError::Scene(error) = error else { panic!("{error}") };
    let places: Vec<&str> = error.faults.iter().map(|fault| fault.pointer.as_str()).collect();
    assert!(places.contains(&"/train/law/restitution") && places.contains(&"/train/mass"), "{places:?}");
}

#[test]
fn a_folder_in_use_is_refused_and_the_scene_is_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = Simulation::from_json(&ball(1.0)).unwrap();
    simulation.write(folder.path()).unwrap();
    let refused = simulation.write(folder.path()).unwrap_err();
    assert!(matches!(refused, SimulationError::Output(OutputError::Occupied(_))), "{refused}");
    Job { replace: true, ..simulation.job() }.write(folder.path()).unwrap();

    let scene = folder.path().join("summary.json");
    fs::write(&scene, ball(1.0)).unwrap();
    let refused =
        Job { replace: true, ..Simulation::from_file(&scene).unwrap().job() }.write(folder.path()).unwrap_err();
    assert!(matches!(refused, SimulationError::Output(OutputError::Input(_))), "{refused}");
    assert_eq!(fs::read_to_string(&scene).unwrap(), ball(1.0));
}

#[test]
fn a_summary_names_the_instructions() {
    let scene = Scene::from_file("examples/scenes/W3.json").unwrap().with("/run/cycles", 3.into()).unwrap();
    let plain = Simulation::from_scene(&scene).unwrap().run().unwrap().summary.integrator;
    assert_eq!(plain.instructions, flank::Instructions::best().name());
    for name in flank::Instructions::NAMES.into_iter().filter(|name| flank::Instructions::named(name).is_some()) {
        let scene = scene.with("/run/integrator/instructions", name.into()).unwrap();
        let used = Simulation::from_scene(scene).unwrap().run().unwrap().summary.integrator;
        assert_eq!(used.instructions, name);
    }
}

#[test]
fn a_borrowed_scene_can_be_used_again() {
    let scene = Scene::from_json(&ball(1.0), "ball").unwrap();
    let borrowed = Simulation::from_scene(&scene).unwrap();
    assert_eq!(borrowed.hash(), Some(scene.hash()));
    assert_eq!(borrowed.run().unwrap().summary, Simulation::from_scene(scene).unwrap().run().unwrap().summary);
}

#[cfg(feature = "cli")]
#[test]
fn it_writes_what_the_command_writes() {
    let files = |folder: &std::path::Path| {
        let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    };
    for (name, more) in
        [("W1a-ds", None), ("ball-on-wall", Some("--verify")), ("reference-light", Some("--trajectory"))]
    {
        let folder = tempfile::tempdir().unwrap();
        let [command, library] = ["command", "library"].map(|name| folder.path().join(name));
        let mut flank = assert_cmd::Command::cargo_bin("flank").unwrap();
        flank
            .args(["run", &example(name), "--quiet", "--no-report", "--out"])
            .arg(&command)
            .args(more)
            .assert()
            .code(0);
        let simulation = Simulation::from_file(example(name)).unwrap();
        let mut job = simulation.job();
        (job.verify, job.trajectory) = (more == Some("--verify"), more == Some("--trajectory"));
        let record = job.write(&library).unwrap();
        assert!(record.events.is_empty() && record.work.events > 0);
        let (theirs, ours) = (files(&command), files(&library));
        assert_eq!(theirs.len(), if more == Some("--trajectory") { 5 } else { 4 });
        for (theirs, ours) in theirs.iter().zip(&ours) {
            assert_eq!(theirs.file_name(), ours.file_name());
            assert!(fs::read(theirs).unwrap() == fs::read(ours).unwrap(), "{}", ours.display());
        }
    }
}

/// A contact with hysteresis that closes without an approach speed latches its floor: legal, and hardly what was meant.
#[test]
fn a_hysteretic_contact_that_starts_at_rest_on_its_flank_is_warned_of() {
    let warned = |q: f64, v: f64, hysteresis: f64| {
        let scene = serde_json::json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [1.0], "load_n": [1.0],
                "contacts": [{
                    "direction": [1.0], "half_backlash_m": 0.0, "flanks": "drive", "stiffness": 9.0,
                    "law": {
                        "kind": "power", "exponent": "3/2", "hysteresis_coefficient": hysteresis, "speed_floor_m_per_s": 1e-6,
                        "initial_speed_m_per_s": 1e-2,
                    },
                }],
            },
            "initial": { "q": [q], "v": [v] },
            "run": { "t_end_s": 1.0 },
        });
        Simulation::from_json(&scene.to_string()).unwrap().warnings_in_words()
    };
    let told = warned(0.0, 0.0, 0.5);
    assert!(told.len() == 1 && told[0].contains("exactly on its flank") && told[0].contains("1e-6 m/s"), "{told:?}");
    for (q, v, hysteresis) in [(0.0, 0.3, 0.5), (0.0, 0.0, 0.0), (-0.1, 0.0, 0.5), (0.1, 0.0, 0.5)] {
        assert!(warned(q, v, hysteresis).is_empty(), "{q} {v} {hysteresis}");
    }
}

/// A falling ball is at 1 − g t²/2 until it strikes at √(2/g), and leaves with 0.8 of its speed.
#[test]
fn samples_are_the_motion_at_their_times_and_after_an_impact_at_its_time() {
    let simulation = Simulation::from_json(&ball(1.0)).unwrap();
    let strike = (2.0f64 / 9.81).sqrt();
    let end = simulation.instants()[2];
    let sample = |times: &[f64]| simulation.sample(Grid::Times(times.to_vec()), end, Task::default());
    let times = [0.0, 0.1, 0.2, strike.next_down().next_down(), strike, 0.6];
    let table = sample(&times).unwrap();
    assert_eq!(table.names[..5], ["t", "cycle", "phase", "x", "x_rate"]);
    let rows: Vec<&[f64]> = table.values.chunks(table.names.len()).collect();
    assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), times);
    // Errors of some units in the last place of lengths of 1 m and speeds of 4 m/s.
    for row in &rows[..3] {
        assert!((row[3] - (1.0 - 4.905 * row[0] * row[0])).abs() < 1e-14 && (row[4] + 9.81 * row[0]).abs() < 1e-14);
    }
    let speed = 9.81 * strike;
    assert!((rows[3][4] + speed).abs() < 1e-13 && (rows[4][4] - 0.8 * speed).abs() < 1e-13, "{rows:?}");
    // The end of a run belongs to it, times before the start and after the end do not, and others are refused.
    assert_eq!(sample(&[-1.0, 0.5, 1.0, 2.0]).unwrap().values.len(), 2 * table.names.len());
    assert!(matches!(sample(&[0.5, 0.1]), Err(SimulationError::Missing { .. })));
    let cancelled = AtomicBool::new(true);
    let task = Task::new(&cancelled, &|_| ());
    assert!(simulation.sample(Grid::Times(times.to_vec()), end, task).unwrap().values.len() < table.values.len());
}

#[test]
fn a_job_passes_its_rows_on_and_ends_where_they_say() {
    let simulation = Simulation::from_json(&ball(5.0)).unwrap();
    let all = simulation.run().unwrap();
    let mut seen = Vec::new();
    let mut take = |row| {
        seen.push(row);
        if seen.len() == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let mut job = simulation.job();
    job.rows = Some(&mut take);
    let record = job.run().unwrap();
    assert_eq!(record.outcome.kind, EndKind::Stopped);
    assert!(record.events.is_empty());
    assert_eq!(seen, all.events[..3]);
    // Without a log nothing is stored.
    let mut job = simulation.job();
    job.log = false;
    let record = job.run().unwrap();
    assert!(record.events.is_empty() && record.work == all.work);
}

#[test]
fn every_error_becomes_one() {
    fn failed() -> Result<(), Error> {
        Simulation::from_json("{}")?;
        Ok(())
    }
    assert!(matches!(failed(), Err(Error::Scene(error)) if !error.faults.is_empty()));
    assert!(matches!(Error::from(OutputError::Occupied("here".into())), Error::Output(OutputError::Occupied(_))));
}

/// Where nobody looks at the transient, it runs without steps. The measures, and the last bit of the motion, are the same.
#[test]
fn a_transient_that_nobody_reads_changes_nothing() {
    for name in ["W1a-ds", "W1b-ds", "W2b", "W3", "W4", "W5b-p", "W5b-ch", "W5b-gr", "bouncing-ball", "reference-light"]
    {
        let path = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let set = |pointer: &str, value: u64, scene: Scene| scene.with(pointer, value.into()).unwrap();
        let scene = set("/run/transient_cycles", 0, Scene::from_file(path).unwrap());
        for (cycles, transient) in [(20, 19), (80, 70)] {
            let scene = set("/run/transient_cycles", transient, set("/run/cycles", cycles, scene.clone()));
            let simulation = Simulation::from_scene(scene).unwrap();
            let run = |log: bool| {
                let mut job = simulation.job();
                job.log = log;
                job.run().unwrap()
            };
            let (read, unread) = (run(true), run(false));
            assert_eq!(read.end, unread.end, "{name}");
            assert!(unread.events.is_empty() && !read.events.is_empty(), "{name}");
            let [read, unread] = [&read, &unread].map(|record| serde_json::to_value(&record.summary).unwrap());
            assert_eq!(read, unread, "{name}");
            let energy = &read["energy"];
            let [residual, throughput] = ["residual", "throughput"].map(|key| energy[key].as_f64().unwrap());
            assert!(residual.abs() <= 1e-12 * throughput, "{name}: {energy}");
        }
    }
}

/// Counts the steps that arrive before an instant, and asks for none.
struct StepCount<'a> {
    simulation: &'a Simulation,
    steps: u32,
}

impl Observer for StepCount<'_> {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn step(&mut self, _: &Mode, step: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        let [_, measured, _] = self.simulation.instants();
        let left = self.simulation.clock().between(step.start(), measured);
        self.steps += u32::from(left > 0.0);
        ControlFlow::Continue(())
    }
}

#[test]
fn a_transient_that_nobody_reads_has_no_steps() {
    let path = format!("{}/examples/scenes/W1a-ds.json", env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::from_file(path).unwrap().with("/run/transient_cycles", 4.into()).unwrap();
    let simulation = Simulation::from_scene(scene).unwrap();
    let steps = |log: bool| {
        let mut count = StepCount { simulation: &simulation, steps: 0 };
        let mut job = simulation.job();
        job.log = log;
        job.observer = Some(&mut count);
        job.run().unwrap();
        count.steps
    };
    // The leap into the measured time is shown as a whole.
    assert!(steps(true) >= 16 && steps(false) <= 2, "{} {}", steps(true), steps(false));
}

/// Keeps the records of summed impact sequences.
#[derive(Default)]
struct Sums(Vec<(Instant, f64)>);

impl Observer for Sums {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.0.extend(record.accumulation.map(|sum| (record.at, sum.remaining)));
        ControlFlow::Continue(())
    }
}

/// A sequence is summed on a table that moves: it does work on the ball from the last impact on. The record has the later time of the end.
#[test]
fn a_ledger_may_begin_within_a_summed_sequence() {
    let path = format!("{}/examples/scenes/bouncing-ball.json", env!("CARGO_MANIFEST_DIR"));
    // Below an amplitude of 1 the table never falls faster than the ball, which comes to rest on it.
    let scene = Scene::from_file(path).unwrap().with("/train/wall_motion/0/amplitude_m", 0.5.into()).unwrap();
    let simulation = Simulation::from_scene(scene).unwrap();
    let (structure, end) = (&simulation.structure, simulation.instants()[2]);
    let run = |observer: &mut dyn Observer| {
        let options = Options { chatter_speed: 0.02, ..simulation.options() };
        let integrator = simulation.integrator().unwrap();
        Engine::new(structure, integrator, options, simulation.start().unwrap()).run(end, observer).unwrap();
    };
    let mut sums = Sums::default();
    run(&mut sums);
    let (at, remaining) = sums.0.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    for share in [0.01, 0.5, 0.99] {
        let mut ledger = Ledger::new(structure).since(simulation.clock().advance(at, -share * remaining));
        run(&mut ledger);
        let balance = ledger.balance();
        assert!(balance.closure() < 1e-13, "{share} of {remaining:e}: {balance:?}");
    }
}

#[test]
fn a_cancelled_task_ends_a_section_map() {
    for name in ["W1a-ds", "W2b", "W3"] {
        let path = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let simulation = Simulation::from_scene(Scene::from_file(path).unwrap()).unwrap();
        let map = SectionMap::new(&simulation).unwrap();
        let start = map.start().unwrap();
        let cancelled = AtomicBool::new(true);
        let ended = map.with_task(Task::new(&cancelled, &|_| ()));
        assert!(ended.follow(&start, 1_000_000).unwrap_err().to_string().contains("cancelled"), "{name}");
        assert!(ended.image(&start, 1_000_000).unwrap_err().to_string().contains("cancelled"), "{name}");
        cancelled.store(false, Ordering::Relaxed);
        assert_eq!(ended.follow(&start, 3).unwrap(), map.follow(&start, 3).unwrap(), "{name}");
    }
}
