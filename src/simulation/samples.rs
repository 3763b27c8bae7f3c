//! The sampled trajectory as CSV.

use std::{
    fs::File,
    io::{BufWriter, Write},
    ops::ControlFlow,
};

use super::Simulation;
use crate::{
    analysis::{Grid, Sample},
    hybrid::{ContactView, Instant},
    output::csv_line,
    scene::Frame,
    system::Structure,
    train::frame::to_fixed,
};

/// Default samples per cycle.
const PER_CYCLE: u64 = 64;

/// Samples of a run without cycles.
const PER_RUN: f64 = 1000.0;

pub fn sample_grid(simulation: &Simulation) -> Grid {
    let run = &simulation.settings;
    let per_cycle = if run.samples_per_cycle > 0 { run.samples_per_cycle } else { PER_CYCLE };
    if simulation.clock().period().is_some() {
        // Exact: a scene allows 2²⁰ at most.
        return Grid::Phases { per_cycle: per_cycle as u32 };
    }
    let [from, _, to] = simulation.instants();
    let span = simulation.clock().between(from, to);
    Grid::Interval { interval: run.period.map_or(span / PER_RUN, |period| period / per_cycle as f64) }
}

/// Writer of samples: time, cycle, phase, coordinates, velocities, and deflection and force of each contact.
pub struct SampleFile<'s> {
    structure: &'s Structure,
    /// Coordinate pairs in a rotating plane, and its speed, rad/s; empty for output in the frame of the equations.
    turning: Vec<[usize; 2]>,
    speed: f64,
    file: BufWriter<File>,
    error: Option<std::io::Error>,
}

impl<'s> SampleFile<'s> {
    pub fn new(simulation: &'s Simulation, mut file: BufWriter<File>) -> Self {
        let structure = &simulation.structure;
        let spec = structure.spec();
        let names = spec.freedoms.iter().map(|name| name.to_owned());
        let rates = spec.freedoms.iter().map(|name| format!("{name}_rate"));
        let contacts =
            spec.contacts.iter().flat_map(|c| [format!("{} deflection", c.name), format!("{} force", c.name)]);
        let columns = ["t", "cycle", "phase"].map(String::from).into_iter().chain(names).chain(rates).chain(contacts);
        let error = writeln!(file, "{}", csv_line(columns)).err();
        let column = |name: String| spec.freedoms.iter().position(|freedom| *freedom == name);
        let pair = |body| Some([column(format!("x_{body}"))?, column(format!("y_{body}"))?]);
        let speed = simulation.carrier_speed.filter(|_| simulation.settings.frame == Frame::Fixed);
        // Planets are written along and across their radius, which turns with them in any frame.
        let turning = speed.map(|_| ["s", "c", "r"].into_iter().filter_map(pair).collect()).unwrap_or_default();
        Self { structure, turning, speed: speed.unwrap_or(0.0), file, error }
    }

    /// Writes a sample; interrupts the run if that fails.
    pub fn write(&mut self, sample: &Sample<'_>) -> ControlFlow<()> {
        let n = self.structure.freedoms();
        let mut x = sample.x[..2 * n].to_vec();
        self.turn(&mut x, sample.at, n);
        let start = [sample.t.to_string(), sample.at.cycle.to_string(), sample.at.phase.value().to_string()];
        let mut cells: Vec<String> = start.into_iter().chain(x.iter().map(f64::to_string)).collect();
        for j in 0..self.structure.contacts().len() {
            let (deflection, _) = self.structure.deflection(j, sample.at, sample.x);
            let force = self.structure.force(j, sample.mode, sample.at, sample.x);
            cells.extend([deflection.to_string(), force.to_string()]);
        }
        match writeln!(self.file, "{}", csv_line(cells)) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.error = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// Transforms into the frame at rest: positions `R q`, velocities `R (q̇ + ω × q)`.
    fn turn(&self, x: &mut [f64], at: Instant, n: usize) {
        if self.turning.is_empty() {
            return;
        }
        let angle = self.structure.clock().angle(self.speed, None, at);
        for [i, j] in &self.turning {
            let (position, rate) = ([x[*i], x[*j]], [x[n + i], x[n + j]]);
            let carried = [rate[0] - self.speed * position[1], rate[1] + self.speed * position[0]];
            [x[*i], x[*j]] = to_fixed(position, angle);
            [x[n + i], x[n + j]] = to_fixed(carried, angle);
        }
    }

    pub fn finish(mut self) -> std::io::Result<()> {
        self.error.map_or_else(|| self.file.flush(), Err)
    }
}
