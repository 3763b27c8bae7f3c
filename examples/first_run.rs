//! Runs a scene and prints how long the teeth are apart, and the first impacts.
//!
//! ```text
//! cargo run --release --example first_run
//!
//! mesh: 99 separations, 49 contacts of the back flank
//! apart for 0.474843 of the time
//! event at t = 4.7237543575047662436361406435026
//! event at t = 13.114549362437887491950050389278
//! event at t = 16.763868113516094293657943126163
//! ```

use std::{
    error::Error,
    io::{self, Write},
};

use flank::Simulation;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();
    let run = Simulation::from_file("examples/scenes/W1a-ds.json")?.run()?;

    let mesh = &run.summary.contacts[0];
    writeln!(
        out,
        "{}: {} separations, {} contacts of the back flank",
        mesh.name, mesh.separations, mesh.back_contacts
    )?;
    writeln!(out, "apart for {:.6} of the time", mesh.apart_fraction)?;
    for event in run.events.iter().take(3) {
        writeln!(out, "event at t = {}", event.t)?;
    }
    Ok(())
}
