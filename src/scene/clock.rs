//! Times and frequencies that the clock of a run resolves.
//!
//! An instant is a cycle, counted exactly, and a phase of 32 digits ([`Instant`](crate::hybrid::Instant)). Cycles are multiplied as
//! doubles, so their number has at most 53 bits. Two switches of a stiffness are two instants if their phases differ as doubles.

use std::f64::consts::TAU;

use super::{
    node::Node,
    run::{Duration, Run},
    shape::Units,
};
use crate::{
    gear::{Harmonic, Stiffness},
    system::{ContactSpec, Spec},
};

/// Limits of frequencies, rad/s, and periods, s: products of several stay far from the ends of a double.
const SMALLEST: f64 = 1e-100;
const LARGEST: f64 = 1e100;
/// Maximum number of cycles of a period: larger whole numbers are no exact doubles.
const MOST_CYCLES: f64 = (1u64 << 53) as f64;
/// Largest relative error of a multiple that is written as a number.
const ROUNDED: f64 = 1e-14;
/// Shortest piece of a stiffness, relative to the longest phase: 256 units in the last place of it.
const SHORTEST: f64 = 256.0 * f64::EPSILON;

fn resolves(value: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&value)
}

fn of_waves(waves: &[Harmonic]) -> impl Iterator<Item = f64> {
    waves.iter().map(|wave| wave.omega)
}

/// Returns the frequencies of a stiffness, rad/s.
fn frequencies(stiffness: &Stiffness) -> Vec<f64> {
    match stiffness {
        Stiffness::Harmonic { harmonics, .. } => of_waves(harmonics).collect(),
        Stiffness::Periodic { period, .. } => vec![TAU / period],
        Stiffness::Constant(_) | Stiffness::Listed { .. } => vec![],
    }
}

/// Returns the shortest piece of a schedule that repeats, s.
fn shortest_piece(stiffness: &Stiffness) -> Option<f64> {
    let Stiffness::Periodic { period, pieces, .. } = stiffness else { return None };
    let starts = pieces.iter().map(|piece| piece.start);
    let ends = starts.clone().skip(1).chain(starts.clone().take(1).map(|first| first + 1.0));
    starts.zip(ends).map(|(start, end)| (end - start) * period).reduce(f64::min)
}

/// Returns the largest time in a schedule, s: its next period, or the last of listed times.
fn furthest(stiffness: &Stiffness) -> f64 {
    match stiffness {
        Stiffness::Periodic { period, origin, .. } => period + origin.abs(),
        Stiffness::Listed { times, .. } => times.iter().map(|[t, _]| t.abs()).fold(0.0, f64::max),
        Stiffness::Constant(_) | Stiffness::Harmonic { .. } => 0.0,
    }
}

/// Refuses numbers that the clock of the run does not resolve.
pub(super) fn check(root: &Node, spec: &Spec, run: &Run) {
    let (train, run_node) = (root.at("train"), root.at("run"));
    let in_unit = |value: f64, unit: &str| {
        if root.units == Units::Si { format!("{value:e} {unit}") } else { format!("{value:e}") }
    };
    let seconds = |t: f64| in_unit(t, "s");
    let stiffnesses = spec.contacts.iter().flat_map(|c| c.schedules().map(|k| (k, format!("{}: a stiffness", c.name))));
    let loads = spec.load_schedules.iter().enumerate().map(|(i, l)| (&l.factor, format!("load {}: a schedule", i + 1)));
    let schedules: Vec<(&Stiffness, String)> = stiffnesses.chain(loads).collect();
    let of_contacts = spec.contacts.iter().flat_map(ContactSpec::errors).flat_map(|error| of_waves(error));
    let of_schedules = schedules.iter().flat_map(|(schedule, _)| frequencies(schedule));
    let of_loads = spec.load_harmonics.iter().map(|load| load.omega);
    let all: Vec<f64> = spec.omega.into_iter().chain(of_loads).chain(of_contacts).chain(of_schedules).collect();
    if let Some(omega) = all.iter().find(|omega| **omega != 0.0 && !resolves(omega.abs())) {
        train.fault(
            format!("a frequency of {}", in_unit(*omega, "rad/s")),
            format!("0, or frequencies from {SMALLEST:e} to {}", in_unit(LARGEST, "rad/s")),
            "check the units of very large and very small frequencies, periods and speeds",
        );
        return;
    }
    // Key of the length of the run, or of the number of cycles before it.
    let t_end = run_node.at_unit("t_end", "s");
    let place = match run.duration {
        Duration::Until(_) => t_end,
        Duration::Cycles(n) if n > run.start_cycle => run_node.at("cycles"),
        Duration::Cycles(_) => run_node.at("start_cycle"),
    };
    let end = run.end();
    if !(end.is_finite() && end <= LARGEST) {
        place.fault(seconds(end), format!("an end of the run up to {}", seconds(LARGEST)), "run shorter");
        return;
    }
    let forcing = spec.omega.map(|omega| TAU / omega);
    // A multiple of the base frequency keeps its phase in any cycle; other frequencies use time.
    let is_multiple =
        |omega: f64| spec.omega.is_some_and(|base| ((omega / base).round() * base - omega).abs() <= ROUNDED * omega);
    let by_time = all.iter().map(|omega| omega.abs()).filter(|omega| *omega > 0.0 && !is_multiple(*omega));
    let fastest = by_time.map(|omega| TAU / omega).chain(run.period).chain(forcing).reduce(f64::min);
    if let Some(period) = fastest.filter(|period| end / period > MOST_CYCLES) {
        place.fault(
            format!("an end at {}, after {:.3e} periods of {}", seconds(end), end / period, seconds(period)),
            format!("at most {MOST_CYCLES:.3e} periods"),
            "run to an earlier time, or start in an earlier cycle",
        );
    }
    for (schedule, name) in &schedules {
        let (time, period) = (furthest(schedule), forcing.unwrap_or(f64::INFINITY));
        if time / period > MOST_CYCLES {
            train.fault(
                format!("{name} with a time of {}, {:.3e} periods of the forcing", seconds(time), time / period),
                format!("at most {MOST_CYCLES:.3e} periods"),
                "check its period and the base frequency",
            );
        }
    }
    let longest_phase = forcing.unwrap_or(end);
    for (schedule, name) in &schedules {
        let shortest = shortest_piece(schedule).filter(|piece| *piece < SHORTEST * longest_phase);
        if let Some(piece) = shortest {
            train.fault(
                format!("{name} that switches after {}", seconds(piece)),
                format!(
                    "pieces of {} and more, as phases go up to {}",
                    seconds(SHORTEST * longest_phase),
                    seconds(longest_phase)
                ),
                "check its period and that of the forcing",
            );
        }
    }
}
