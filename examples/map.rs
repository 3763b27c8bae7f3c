//! Decides the kind of the motion in each cell of a small map over frequency and mean load.
//!
//! `flank map` does the same for a million cells, and keeps them. The library type behind it is `flank::map::KindMap`.
//!
//! ```text
//! cargo run --release --example map
//!
//! mean load 0.3 :   1 none           1 none           1 single-sided   1 single-sided   1 single-sided
//! mean load 0.2 :   1 none           1 none           1 single-sided   1 single-sided   1 single-sided
//! mean load 0.1 :   1 none           1 single-sided   2 single-sided   2 single-sided   - single-sided
//! mean load 0.05:   1 none           2 single-sided   - single-sided   - double-sided   - double-sided
//! ```

use std::{
    error::Error,
    io::{self, Write},
};

use flank::{Simulation, Task, map::CellRule, scene::Scene};
use serde_json::json;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();
    let scene = Scene::from_file("examples/scenes/kahraman-singh.json")?;
    for load in [0.3, 0.2, 0.1, 0.05] {
        write!(out, "mean load {load:<4}:")?;
        for frequency in [0.4, 0.6, 0.8, 1.0, 1.2] {
            let numbers =
                [("/train/mean_load", json!(load)), ("/train/transmission_error/0/frequency", json!(frequency))];
            let simulation = Simulation::from_scene(scene.with_all(numbers)?)?;
            let cell = CellRule::default().decide(&simulation, simulation.start()?, Task::default())?;
            let cell = cell.ok_or("interrupted")?;
            let period = cell.motion.period.map_or_else(|| "-".to_owned(), |period| period.to_string());
            write!(out, "  {period:>2} {:<12}", cell.impacts.word())?;
        }
        writeln!(out)?;
    }
    Ok(())
}
