//! Cells, starts and section points per second of maps, basins and diagrams of the gear pair, on one thread and on two.
//!
//! ```text
//! cargo bench --bench maps
//! ```
//!
//! Tables are written to a folder that is removed, without pictures. The best of three runs counts, as every disturbance makes a run longer.

use std::{
    error::Error,
    io::{self, Write},
    path::Path,
    time::Instant as Stopwatch,
};

use flank::{
    Task,
    map::{Basins, CellRule, Diagram, KindMap, Sampling},
    scene::Scene,
    sweep::{Begin, Seeding, Share},
};
use rayon::ThreadPoolBuilder;

const ROUNDS: usize = 3;
/// Cells and starts along each axis, and values of the diagram.
const COUNT: usize = 150;
const VALUES: usize = 400;
const FREQUENCY: &str = "/train/transmission_error/0/frequency=0.4:2";

/// Name of a command, and its work in a folder, which returns the number of its points.
type Work<'a> = (&'a str, &'a (dyn Fn(&Path) -> Result<usize, Box<dyn Error>> + Sync));

/// Returns the rate on `threads` threads, thousands per second.
fn rate(work: &Work<'_>, threads: usize) -> Result<f64, Box<dyn Error>> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut best = 0.0;
    for _ in 0..ROUNDS {
        let folder = tempfile::tempdir()?;
        let watch = Stopwatch::now();
        // An error that is boxed does not cross threads.
        let count = pool.install(|| work.1(folder.path()).map_err(|error| error.to_string()))?;
        best = f64::max(best, count as f64 / watch.elapsed().as_secs_f64() / 1e3);
    }
    Ok(best)
}

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::from_file("examples/scenes/kahraman-singh.json")?;
    let axis = |axis: &str, count: usize| format!("{axis}:{count}");
    let map = KindMap::new(
        scene.clone(),
        &[axis(FREQUENCY, COUNT), axis("/train/mean_load=0.02:0.3", COUNT)],
        CellRule::default(),
        &[] as &[&str],
    )?;
    let starts = [axis("/initial/q/0=-2:2", COUNT), axis("/initial/v/0=-1:1", COUNT)];
    let basins = Basins::new(scene.clone(), &starts, CellRule::default())?;
    let diagram = Diagram::new(scene, &[axis(FREQUENCY, VALUES)], Seeding::Both, Sampling::default())?;
    let cells = |folder: &Path| {
        let mut lines = map.open(folder, Begin::Replace, Share::ALL)?.ok_or("a finished map")?;
        map.run(&mut lines, Task::default())?;
        Ok(map.finish(lines, |_, _| Ok(()))?.cells())
    };
    let ends = |folder: &Path| {
        let mut lines = basins.open(folder, Begin::Replace, Share::ALL)?.ok_or("finished basins")?;
        let survey = basins.survey(Task::default())?.unwrap_or_default();
        basins.run(&mut lines, &survey, Task::default())?;
        Ok(basins.finish(lines, &survey, |_, _| Ok(()))?.figures.starts)
    };
    let points = |folder: &Path| {
        let mut rows = diagram.open(folder, Begin::Replace, Share::ALL)?.ok_or("a finished diagram")?;
        diagram.run(&mut rows, Task::default())?;
        Ok(diagram.finish(rows, |_, _| Ok(()))?.sections as usize)
    };
    let mut out = io::stdout();
    writeln!(out, "Thousands a second\n\n| what | one thread | two threads |\n|---|---|---|")?;
    let all: [Work<'_>; 3] = [("cells of a map", &cells), ("starts of basins", &ends), ("section points", &points)];
    for work in &all {
        writeln!(out, "| {} | {:.2} | {:.2} |", work.0, rate(work, 1)?, rate(work, 2)?)?;
    }
    Ok(())
}
