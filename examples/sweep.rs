//! Measures the steady motion at several loads, each from the end of the one before it, without writing a file.
//!
//! `flank sweep` does the same on all cores, and keeps its rows. The library type behind it is `flank::study::SteadySweep`.
//!
//! ```text
//! cargo run --release --example sweep
//!
//! 10 N m: period None, apart 0.764570, largest force 2205.416 N
//! 20 N m: period Some(1), apart 0.285199, largest force 946.050 N
//! 30 N m: period Some(1), apart 0.000000, largest force 916.335 N
//! 40 N m: period Some(1), apart 0.000000, largest force 1178.058 N
//! ```

use std::{
    error::Error,
    io::{self, Write},
};

use flank::{
    Task,
    scene::Scene,
    study::steady::{Rule, steady},
};
use serde_json::json;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();
    let scene = Scene::from_file("examples/scenes/spur-pair.json")?;
    let mut seed = None;
    for torque in [10.0, 20.0, 30.0, 40.0] {
        let scene = scene.with("/train/torque_nm", json!(torque))?;
        let motion = steady(scene, seed.as_ref(), &Rule::default(), Task::default())?;
        let mesh = motion.contact("mesh").ok_or("no mesh")?;
        writeln!(
            out,
            "{torque} N m: period {:?}, apart {:.6}, largest force {:.3} N",
            motion.motion.period,
            mesh.report.apart_fraction,
            mesh.report.force_max.unwrap_or_default()
        )?;
        seed = Some(motion.end);
    }
    Ok(())
}
