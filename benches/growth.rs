//! Growth of the cost of a run with degrees of freedom, contacts, harmonics and length.
//!
//! ```text
//! cargo bench --bench growth
//! cargo bench --bench growth -- --svg docs/growth.svg
//! ```
//!
//! A chain of equal masses between springs, lightly damped; the first mass is driven and strikes a compliant wall, and further masses
//! have walls of their own where there are more contacts. One number is varied at a time. The table has the best of five runs, as every
//! disturbance makes a run longer; the longest run is made once. With `--svg` a chart of it is written too.

use std::{
    error::Error,
    io::{self, Write},
    time::Instant as Stopwatch,
};

use flank::{
    engine::{Counters, Engine, Options, State},
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    integrate::{Choice, build},
    plot::{Axis, Figure, Panel, Series, Style, Theme},
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure},
};
use nalgebra::DMatrix;

const ROUNDS: usize = 5;
/// Cycles of a run that is made once.
const LONG: u64 = 10_000_000;

/// Size of a run: the numbers that are varied.
#[derive(Clone, Copy)]
struct Size {
    freedoms: usize,
    contacts: usize,
    harmonics: usize,
    cycles: u64,
}

const USUAL: Size = Size { freedoms: 8, contacts: 1, harmonics: 1, cycles: 200 };

/// Returns the chain: masses of 1 kg, springs of 1 N/m to the neighbours and to the ground, 1 % of that as damping.
fn chain(size: Size) -> Spec {
    let n = size.freedoms;
    let tridiagonal = |scale: f64| {
        DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 3.0 * scale,
            1 => -scale,
            _ => 0.0,
        })
    };
    let unit = |i: usize| (0..n).map(|k| f64::from(u8::from(k == i))).collect::<Vec<f64>>();
    let contact = |j: usize| ContactSpec {
        name: format!("wall {j}"),
        direction: unit(j * n / size.contacts),
        error: Vec::new(),
        error_offset: 0.0,
        half_backlash: 0.1,
        flanks: Flanks::Drive,
        stiffness: Stiffness::Constant(10.0),
        law: Law::KelvinVoigt(Linear { damping: 0.1 }, Release::Deflection),
        gap_damping: 0.0,
        back: None,
    };
    let load =
        |h: usize| LoadHarmonic { vector: vec![1.0 / (h * h) as f64; n], omega: 1.3 * h as f64, phase: 0.3 * h as f64 };
    Spec {
        freedoms: (0..n).map(|i| format!("u_{i}")).collect(),
        mass: DMatrix::identity(n, n),
        damping: tridiagonal(0.01),
        stiffness: tridiagonal(1.0),
        load: vec![0.2; n],
        load_harmonics: (1..=size.harmonics).map(load).collect(),
        contacts: (0..size.contacts).map(contact).collect(),
        omega: Some(1.3),
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    }
}

/// Returns the seconds of the best run, and its work.
fn run(size: Size) -> Result<(f64, Counters), Box<dyn Error>> {
    let structure = Structure::new(chain(size))?;
    let (from, to) = (structure.clock().at(0, 0.0), structure.clock().at(size.cycles as i64, 0.0));
    let start = structure.start(from, &vec![0.0; size.freedoms], &vec![0.0; size.freedoms])?;
    let (mut best, mut work) = (f64::INFINITY, Counters::default());
    for _ in 0..if size.cycles < LONG { ROUNDS } else { 1 } {
        let integrator = build(Choice::Auto, 1e-13, &structure)?;
        let state = State { at: from, x: start.x.clone(), jump: start.jump.clone() };
        let mut engine = Engine::new(&structure, integrator, Options::default(), state);
        let watch = Stopwatch::now();
        engine.run(to, &mut ())?;
        best = best.min(watch.elapsed().as_secs_f64());
        work = engine.counters();
    }
    Ok((best, work))
}

/// A varied number: its name, and the rise with a power of it that a dashed line through the last point shows.
type Varied = (&'static str, Option<Rise>);

/// A rise: its name, and the power of the varied number.
type Rise = (&'static str, i32);

const PROPORTIONAL: Option<Rise> = Some(("in proportion", 1));
const SQUARE: Option<Rise> = Some(("as the square", 2));
/// Least time shown, µs.
const LEAST: f64 = 0.5;

/// Draws the time for an event against the varied number, one panel for each.
fn chart(points: &[(Varied, f64, f64)]) -> Figure {
    let mut panels: Vec<Panel> = Vec::new();
    for points in points.chunk_by(|a, b| a.0 == b.0) {
        let ((name, rise), last, time) = points[points.len() - 1];
        let y = Axis { logarithmic: true, ..Axis::new("time for an event", "µs") }.between(LEAST, 2000.0);
        let x = Axis { logarithmic: true, ..Axis::new(name, "") };
        let values: Vec<f64> = points.iter().map(|point| point.1).collect();
        let times = points.iter().map(|point| point.2).collect();
        let mut series = vec![Series::line("measured", 0, values.clone(), times).styled(Style::Joined)];
        if let Some((by, power)) = rise {
            let rising = |value: &f64| time * (value / last).powi(power);
            let shown: Vec<f64> = values.into_iter().filter(|value| rising(value) >= LEAST).collect();
            let rise = shown.iter().map(rising).collect();
            series.push(Series::line(by, power as usize, shown, rise).styled(Style::Dashed));
        }
        panels.push(Panel { x, y, series, ..Panel::default() });
    }
    let title = "How the cost of an event grows".to_owned();
    Figure { id: "growth".to_owned(), title, columns: 2, panels, ..Figure::default() }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout().lock();
    let svg = std::env::args().skip_while(|word| word != "--svg").nth(1);
    let vary = |of: Varied, values: &[usize], with: &dyn Fn(usize) -> Size| {
        values.iter().map(|value| (of, *value, with(*value))).collect::<Vec<_>>()
    };
    let sizes = [
        vary(("degrees of freedom", PROPORTIONAL), &[2, 3, 5, 8, 12, 16, 24, 25, 50, 100, 200], &|freedoms| Size {
            freedoms,
            ..USUAL
        }),
        vary(("contacts (24 masses or more)", PROPORTIONAL), &[1, 2, 4, 8, 16, 32, 64], &|contacts| Size {
            contacts,
            freedoms: 24.max(contacts),
            ..USUAL
        }),
        vary(("harmonics of the load", SQUARE), &[1, 3, 10, 30, 100], &|harmonics| Size { harmonics, ..USUAL }),
        vary(("cycles", None), &[1_000, 10_000, 100_000, 1_000_000, LONG as usize], &|cycles| Size {
            cycles: cycles as u64,
            ..USUAL
        }),
    ];
    writeln!(
        out,
        "{:<32} {:>8} {:>9} {:>9} {:>10} {:>10}",
        "varied", "value", "steps", "events", "us/event", "us/step"
    )?;
    let mut points = Vec::new();
    for (of, value, size) in sizes.into_iter().flatten() {
        let (seconds, work) = run(size)?;
        let each = |count: u64| 1e6 * seconds / count.max(1) as f64;
        let (events, steps) = (each(work.events), each(work.steps));
        let name = of.0;
        writeln!(out, "{name:<32} {value:>8} {:>9} {:>9} {events:>10.2} {steps:>10.2}", work.steps, work.events)?;
        points.push((of, value as f64, events));
    }
    if let Some(file) = svg {
        std::fs::write(file, chart(&points).svg(Theme::Light))?;
    }
    Ok(())
}
