//! The rattle threshold of a spur pair, and its curve in the plane of load and speed, by the library alone.
//!
//! ```text
//! cargo run --release --example branches
//! ```

use std::{
    error::Error,
    io::{self, Write},
};

use flank::{
    Task,
    branch::{Continuation, Family, Kind, curves},
    scene::Scene,
    simulation::Parameter,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();
    let scene = Scene::from_file("examples/scenes/spur-pair.json")?;

    // The scene with its load free, and its speed as the second number.
    let load = Parameter::new(scene.resolved(), &["/train/torque_nm"])?;
    let speed = Parameter::new(scene.resolved(), &["/train/speed_rpm"])?;
    let family = Family::new(&scene, load, [5.0, 200.0])?.with(speed, [2000.0, 2800.0])?;

    // The orbit of the scene, followed over the load: folds, and loads at which contact is first lost.
    let method = Continuation { doublings: 0, ..Continuation::default() };
    let followed = method.run(&family, None, &mut |_| Ok(()), Task::default())?;
    for special in followed.branches.iter().flat_map(|branch| &branch.specials) {
        writeln!(out, "{:<16} {:>22} N m  word {}", special.kind.word(), special.value, special.word)?;
    }

    // Each of these grazes over the speed; that of the motion without events is the rattle threshold.
    for curve in curves(&family, Kind::GrazingDamped, &followed.branches, Vec::new(), &mut |_| Ok(()), Task::default())?
    {
        writeln!(out, "a curve of {} points, {}", curve.points.len(), curve.points[0].word)?;
        for point in curve.points.iter().step_by(10) {
            writeln!(out, "  {:>10.4} rev/min  {:>12.6} N m", point.second, point.value)?;
        }
    }
    Ok(())
}
