//! Runs a thousand starts of one gear pair on all cores, and counts where they end.
//!
//! A member of an ensemble has the bits that the same motion has alone.
//!
//! ```text
//! cargo run --release --example ensemble
//!
//! 957 starts end at 0.20
//! 23 starts end at 1.19
//! 20 starts end at 1.27
//! ```

use std::{
    collections::BTreeMap,
    error::Error,
    io::{self, Write},
};

use flank::{Simulation, ensemble::Ensemble};

fn main() -> Result<(), Box<dyn Error>> {
    let pair = Simulation::from_file("examples/scenes/kahraman-singh.json")?;
    let clock = pair.clock();
    let mut ends: BTreeMap<i64, usize> = BTreeMap::new();
    Ensemble::new(&pair, 1000).run(
        |i| pair.start_at(&[-2.0 + 4.0 * (i % 50) as f64 / 49.0], &[-1.0 + 2.0 * (i / 50) as f64 / 19.0]),
        |_, engine| engine.run(clock.at(300, 0.0), &mut ()).map(|_| engine.state().x[0]),
        |_, position| {
            // An orbit of period 2 ends at one of two positions.
            *ends.entry((position? * 100.0).round() as i64).or_default() += 1;
            Ok(())
        },
    )?;
    for (hundredths, count) in ends {
        writeln!(io::stdout(), "{count} starts end at {:.2}", hundredths as f64 / 100.0)?;
    }
    Ok(())
}
