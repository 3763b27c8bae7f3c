//! The rattle threshold of a spur pair, and its curve in the plane of load and speed, by the library alone.
//!
//! ```text
//! cargo run --release --example continuation
//!
//! grazing-damped       22.829980429595032 N m  word c0+ r0+ x0+ c0+ r0+ x0+
//! grazing-damped        22.93286420367365 N m  word c0+ r0+ x0+
//! fold                  23.30701649658222 N m  word c0+ r0+ x0+
//! ...
//! grazing-damped       25.236995869734123 N m  word
//!    2390.0000 rev/min     24.324738 N m
//!    2398.9194 rev/min     25.134730 N m
//!    2401.0805 rev/min     25.340186 N m
//!    2410.9842 rev/min     26.331586 N m
//! ```

use std::{
    error::Error,
    io::{self, Write},
};

use flank::{
    Task,
    branch::{Continuation, Family, SpecialKind, curves},
    scene::Scene,
    simulation::Parameter,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();
    let scene = Scene::from_file("examples/scenes/spur-pair.json")?;

    // The scene with its load free, and its speed as the second number.
    let load = Parameter::new(scene.resolved(), &["/train/torque_nm"])?;
    let speed = Parameter::new(scene.resolved(), &["/train/speed_rpm"])?;
    let family = Family::new(&scene, load, [20.0, 60.0])?.with(speed, [2390.0, 2430.0])?;

    // The orbit of the scene, followed over the load: folds, and loads at which contact is first lost.
    let method = Continuation { doublings: 0, ..Continuation::default() };
    let followed = method.run(&family, None, &mut |_| Ok(()), Task::default())?;
    for special in followed.branches.iter().flat_map(|branch| &branch.specials) {
        writeln!(out, "{:<16} {:>22} N m  word {}", special.kind.word(), special.value, special.word)?;
    }

    // The graze of the motion without events is the rattle threshold. It is followed over the speed.
    let found =
        curves(&family, SpecialKind::GrazingDamped, &followed.branches, Vec::new(), &mut |_| Ok(()), Task::default())?;
    for point in
        found.iter().filter(|curve| curve.points[0].word.is_empty()).flat_map(|curve| &curve.points).step_by(10)
    {
        writeln!(out, "  {:>10.4} rev/min  {:>12.6} N m", point.second, point.value)?;
    }
    Ok(())
}
