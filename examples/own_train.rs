//! Builds a train from its own matrices: a motor, and behind a flexible shaft a gear pair with backlash.
//!
//! The coordinates are motions along the line of action, m. The common form is
//! `M q̈ + C q̇ + K q + g F = f`, with the deflection `δ = gᵀq − e(t)` and the drive flank at `δ = b`.
//!
//! ```text
//! cargo run --release --example own_train
//!
//! apart for 0.743762 of the time, 200 separations in 100 cycles
//! ```

use std::{
    error::Error,
    f64::consts::PI,
    io::{self, Write},
};

use flank::{
    Simulation,
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    scene::{Duration, Run},
    system::{ContactSpec, Flanks, Spec},
};
use nalgebra::{DMatrix, dmatrix, dvector};

fn main() -> Result<(), Box<dyn Error>> {
    let omega = 2.0 * PI * 900.0; // mesh frequency, rad/s
    let shaft = dmatrix![1.0, -1.0, 0.0; -1.0, 1.0, 0.0; 0.0, 0.0, 0.0];
    let mesh = ContactSpec {
        name: "mesh".to_owned(),
        direction: vec![0.0, 1.0, -1.0],
        error: vec![Harmonic { amplitude: 2e-5, omega, phase: 0.0 }], // m
        error_offset: 0.0,
        half_backlash: 4e-5, // m
        flanks: Flanks::Both,
        stiffness: Stiffness::Constant(2e8),                              // N/m
        law: Law::KelvinVoigt(Linear { damping: 900.0 }, Release::Force), // N s/m
        gap_damping: 0.0,
        back: None,
    };
    let train = Spec {
        freedoms: ["motor", "pinion", "wheel"].map(String::from).to_vec(),
        mass: DMatrix::from_diagonal(&dvector![3.0, 0.6, 1.1]), // kg
        damping: 60.0 * &shaft,                                 // N s/m
        stiffness: 2e6 * &shaft,                                // N/m
        load: vec![80.0, 0.0, -80.0],                           // N
        load_harmonics: Vec::new(),
        load_schedules: Vec::new(),
        contacts: vec![mesh],
        omega: Some(omega),
        bearings: Vec::new(),
        shared: Vec::new(),
    };
    let settings = Run { transient_cycles: 300, ..Run::new(Duration::Cycles(400)) };
    let run = Simulation::from_spec("own train", train, settings)?.run()?;
    let mesh = &run.summary.contacts[0];
    writeln!(
        io::stdout(),
        "apart for {:.6} of the time, {} separations in 100 cycles",
        mesh.apart_fraction,
        mesh.separations
    )?;
    Ok(())
}
