//! Watches a run with an observer: it averages the speed at events, and ends the run at the fiftieth event.
//!
//! An observer sees each event with the states before and after it. The state is `[q, v, latched speeds]`.
//!
//! ```text
//! cargo run --release --example own_observer
//!
//! Stopped after 50 events, mean speed 0.694057919799
//! ```

use std::{
    error::Error,
    io::{self, Write},
    ops::ControlFlow,
};

use flank::{Simulation, engine::Observer, event::EventRecord};

/// Count and sum of the speeds at the events of a train with one degree of freedom.
#[derive(Default)]
struct Speeds {
    events: u32,
    sum: f64,
}

impl Observer for Speeds {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.events += 1;
        self.sum += record.x_minus[1].abs();
        if self.events < 50 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut speeds = Speeds::default();
    let simulation = Simulation::from_file("examples/scenes/W1a-ds.json")?;
    let run = simulation.observe(&mut speeds).run()?;
    let mean = speeds.sum / f64::from(speeds.events);
    writeln!(io::stdout(), "{:?} after {} events, mean speed {mean:.12}", run.outcome.kind, speeds.events)?;
    Ok(())
}
