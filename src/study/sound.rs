//! Sound of impacts: impulses at their exact times through a modal transfer path.
//!
//! An impact of momentum p at `t₀` adds `p Σ_k a_k exp(−ζ_k ω_k (t − t₀)) sin(ω_k √(1 − ζ_k²) (t − t₀))` for `t ≥ t₀`. The sum is formed sample by sample as
//! one turning pointer for each mode, which an impact enters at its own time between two samples: no time is rounded to a sample.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::{StudyError, steady::until};
use crate::{
    analysis::{Contacts, EventLog, EventRow, Spectrum, Window},
    output::Fault,
    plot::{Axis, Figure, Guide, Panel, Series},
    simulation::{CancelObserver, Simulation},
    task::Task,
};

/// Samples a second.
pub const RATE: u32 = 48_000;

/// A mode of a transfer path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathMode {
    /// Natural frequency, Hz, `(0, 24000)`.
    pub frequency_hz: f64,
    /// Damping ratio ζ, `(0, 1)`.
    pub damping_ratio: f64,
    /// Amplitude a for an impulse of 1 N s.
    pub amplitude: f64,
}

/// A transfer path from the teeth to a listener.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransferPath {
    /// Modes, at least one.
    pub modes: Vec<PathMode>,
}

impl TransferPath {
    /// Returns a placeholder: no measured gearbox, but equal for all designs.
    #[must_use]
    pub fn placeholder() -> Self {
        let mode = |(frequency_hz, amplitude)| PathMode { frequency_hz, damping_ratio: 0.02, amplitude };
        let modes = [(480.0, 0.3), (1150.0, 1.0), (2300.0, 0.7), (3600.0, 0.4), (5200.0, 0.2)];
        Self { modes: modes.map(mode).to_vec() }
    }

    /// Checks the modes.
    ///
    /// # Errors
    /// A fault for every number out of its range.
    pub fn check(&self) -> Result<(), Vec<Fault>> {
        let mut faults = Vec::new();
        if self.modes.is_empty() {
            faults.push(
                Fault::new("/modes", "no mode", "at least one").remedy("give a frequency, a ratio, an amplitude"),
            );
        }
        let highest = f64::from(RATE / 2);
        for (i, mode) in self.modes.iter().enumerate() {
            let mut check = |key: &str, value: f64, holds: bool, allowed: &str| {
                if !holds {
                    let place = format!("/modes/{i}/{key}");
                    faults.push(Fault::new(&place, value.to_string(), allowed).remedy("write a number in this range"));
                }
            };
            let (f, ratio, a) = (mode.frequency_hz, mode.damping_ratio, mode.amplitude);
            check("frequency_hz", f, f > 0.0 && f < highest, "above 0 and below 24000");
            check("damping_ratio", ratio, ratio > 0.0 && ratio < 1.0, "above 0 and below 1");
            check("amplitude", a, a.is_finite(), "a finite number");
        }
        if faults.is_empty() { Ok(()) } else { Err(faults) }
    }
}

/// Impact in the sound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Blow {
    /// Time from the beginning of the sound, s.
    pub time: f64,
    /// Momentum, N s: effective mass times approach speed; of a rigid contact the impulse.
    pub momentum: f64,
}

/// Lists the impacts in `seconds` after the transient of a run, in order of time.
///
/// # Errors
/// [`StudyError`]: a train without seconds, a run that fails, an interruption.
pub fn impacts(simulation: &Simulation, seconds: f64, task: Task<'_>) -> Result<Vec<Blow>, StudyError> {
    if simulation.dimensionless {
        return Err(StudyError::missing(&simulation.name, "a dimensionless train has no seconds to listen to"));
    }
    let (structure, clock) = (&simulation.structure, *simulation.clock());
    let [_, from, _] = simulation.instants();
    let mut blows = Vec::new();
    let take = |row: EventRow| {
        for event in &row.contacts {
            let begins = event.from == "separated" && (event.blows.is_some() || matches!(event.to, "drive" | "back"));
            if let Some(speed) = event.approach.filter(|speed| begins && *speed > 0.0) {
                let contact = &structure.contacts()[event.mesh];
                let rigid = event.blows.and(event.impulse).map(f64::abs);
                let momentum = rigid.unwrap_or(contact.effective_mass() * speed);
                // The clock keeps digits that are lost in seconds since the start of a long run.
                let at = clock.at(row.n, row.phase);
                blows.push(Blow { time: clock.between(from, at), momentum });
            }
        }
        task.flow()
    };
    let mut engine = simulation.engine(simulation.start()?)?;
    until(&mut engine, from, &mut CancelObserver { task }, task)?;
    let mut log = EventLog::new(structure, Contacts::new(structure, None).keep(0), take);
    until(&mut engine, clock.advance(from, seconds), &mut log, task)?;
    drop(log);
    Ok(blows)
}

/// Samples of a part of the spectrum, whose bins are 6 Hz apart.
const PART: usize = 8192;
/// Ends of the spectrum, Hz, and the lowest level drawn, dB below the highest.
const SHOWN: ([f64; 2], f64) = ([50.0, 20_000.0], 100.0);

/// Draws the spectrum of a sound, in dB re full scale: powers of parts with a Hann window, averaged (Welch's method).
#[must_use]
pub fn spectrum(samples: &[f64], path: &TransferPath) -> Figure {
    let parts: Vec<Spectrum> =
        samples.chunks_exact(PART).map(|part| Spectrum::new(part, f64::from(RATE), Window::Hann)).collect();
    let frequencies = parts.first().map(Spectrum::frequencies).unwrap_or_default();
    let power = |k: usize| parts.iter().map(|part| part.amplitude[k].powi(2)).sum::<f64>() / parts.len() as f64;
    let points = frequencies.iter().enumerate().filter(|(_, f)| (SHOWN.0[0]..=SHOWN.0[1]).contains(*f));
    let (x, y): (Vec<f64>, Vec<f64>) = points
        .map(|(k, f)| (*f, power(k)))
        .filter(|(_, power)| *power > 0.0)
        .map(|(f, power)| (f, 10.0 * libm::log10(power)))
        .unzip();
    let highest = y.iter().fold(f64::NEG_INFINITY, |most: f64, level| most.max(*level)).max(-SHOWN.1);
    let guide = |mode: &PathMode| Guide::Vertical { x: mode.frequency_hz, name: format!("{} Hz", mode.frequency_hz) };
    Figure {
        id: "spectrum".to_owned(),
        title: "Spectrum of the sound".to_owned(),
        caption: "Upright: modes of the transfer path.".to_owned(),
        columns: 1,
        panels: vec![Panel {
            x: Axis { logarithmic: true, ..Axis::new("frequency", "Hz").between(SHOWN.0[0], SHOWN.0[1]) },
            y: Axis::new("level", "dB re full scale").between(highest - SHOWN.1, highest + 10.0),
            series: vec![Series::line("", 0, x, y)],
            guides: path.modes.iter().map(guide).collect(),
            ..Panel::default()
        }],
    }
}

/// Renders impacts through a path: samples from time 0 on, `seconds` long.
#[must_use]
pub fn render(blows: &[Blow], path: &TransferPath, seconds: f64) -> Vec<f64> {
    // Exact: a sound fits into memory.
    let count = (seconds * f64::from(RATE)).round() as usize;
    let step = f64::from(RATE).recip();
    let mut samples = vec![0.0; count];
    for mode in &path.modes {
        let omega = TAU * mode.frequency_hz;
        let (decay, turn) = (mode.damping_ratio * omega, omega * (1.0 - mode.damping_ratio.powi(2)).sqrt());
        let pointer = |time: f64| {
            let (sin, cos) = libm::sincos(turn * time);
            let size = libm::exp(-decay * time);
            [size * cos, size * sin]
        };
        let [cos, sin] = pointer(step);
        let [mut x, mut y] = [0.0; 2];
        let mut next = blows.iter().peekable();
        for (n, sample) in samples.iter_mut().enumerate() {
            [x, y] = [x * cos - y * sin, x * sin + y * cos];
            let now = n as f64 * step;
            while let Some(blow) = next.next_if(|blow| blow.time <= now) {
                let [by_x, by_y] = pointer(now - blow.time);
                (x, y) = (x + blow.momentum * by_x, y + blow.momentum * by_y);
            }
            *sample += mode.amplitude * y;
        }
    }
    samples
}
