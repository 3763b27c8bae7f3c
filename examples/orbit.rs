//! An orbit, its multipliers and the exponents of a chaotic motion, by the library alone.
//!
//! ```text
//! cargo run --release --example orbit
//!
//! period 1 cycles, word c0+ s0+, x = [0.20438660700019684, 0.16194795401091772]
//!   multiplier -0.157256294492082+0.571130689965993i
//!   multiplier -0.157256294492082-0.571130689965993i
//! ...
//! ```

use std::{
    error::Error,
    io::{self, Write},
};

use flank::{
    Simulation, Task,
    orbit::{GuardMap, Lyapunov, Search, SectionMap},
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout();

    // The orbit that the scene approaches, with the derivative of its period.
    let pair = Simulation::from_file("examples/scenes/kahraman-singh.json")?;
    let found = Search::default().run(&pair, Task::default())?;
    let orbit = found.orbits.first().ok_or("no orbit")?;
    writeln!(out, "period {} cycles, word {}, x = {:?}", orbit.period, orbit.word(), orbit.section.x)?;
    for multiplier in &orbit.multipliers {
        writeln!(out, "  multiplier {multiplier:.15}")?;
    }

    // The map itself: a state after a cycle, and what it depends on.
    let map = SectionMap::new(&pair)?;
    let image = map.image(&map.start()?, 1)?;
    writeln!(out, "one cycle from the scene's start: {:?}, derivative {:.6}", image.end.x, image.jacobian)?;

    // From one gain of contact to the next: the state right after it, the time, and the derivative.
    let gains = GuardMap::new(&pair, "c0+")?;
    let crossing = gains.image(&gains.first()?)?;
    writeln!(out, "from gain to gain: time {}, x = {:?}, word {:?}", crossing.time, crossing.end.x, crossing.word)?;

    // All exponents of a chaotic motion. Their sum is known by itself.
    let chaos = Simulation::from_file("examples/scenes/W1a-ch.json")?;
    let exponents = Lyapunov { cycles: Some(20_000), ..Lyapunov::default() }.run(&chaos, Task::default())?;
    writeln!(out, "exponents {:?} ± {:?}", exponents.exponents, exponents.band)?;
    writeln!(out, "sum {:?} (must be {:?})", exponents.sum, exponents.sum_rule)?;
    Ok(())
}
