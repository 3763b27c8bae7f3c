//! Pictures: an orbit against its backlash, and how exponents settle.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::{Exponents, Orbit, SectionMap, words::Speller};
use crate::{
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    simulation::{Simulation, SimulationError},
};

/// Samples of a cycle, and of the time between two events: a stiff contact is a short part of a cycle.
const SAMPLES: u64 = 240;
const BETWEEN: u64 = 24;
/// Contacts drawn.
const MOST: usize = 6;

/// Name of the picture of an orbit in file names.
pub const ORBIT: &str = "orbit";
/// Name of the picture of exponents.
pub const EXPONENTS: &str = "exponents";

/// The deflection of each contact over the period and against its rate, and the multipliers in the unit circle.
///
/// # Errors
/// [`SimulationError`] if the orbit cannot be run.
pub fn orbit(simulation: &Simulation, orbit: &Orbit) -> Result<Figure, SimulationError> {
    let structure = &simulation.structure;
    let contacts = &structure.spec().contacts[..structure.contacts().len().min(MOST)];
    let period = simulation.period()?;
    let map = SectionMap::new(simulation)?;
    let mut speller = Speller::new(structure, &orbit.section.x);
    map.watch(&orbit.section, orbit.period, &mut speller)?;
    let mut engine = simulation.engine(map.state(&orbit.section)?)?;
    let (clock, start) = (simulation.clock(), engine.state().at);
    let events = speller.letters.iter().map(|letter| clock.between(start, letter.at) / period);
    let events: Vec<f64> = std::iter::once(0.0).chain(events).collect();
    let inside = events.windows(2).flat_map(|pair| {
        let share = move |k: u64| k as f64 / BETWEEN as f64;
        (0..BETWEEN).map(move |k| pair[0] + share(k) * (pair[1] - pair[0]))
    });
    let mut cycles: Vec<f64> = (0..=orbit.period * SAMPLES).map(|i| i as f64 / SAMPLES as f64).chain(inside).collect();
    cycles.sort_by(f64::total_cmp);
    cycles.dedup();
    let mut shown = vec![(Vec::new(), Vec::new()); contacts.len()];
    for cycle in &cycles {
        engine.run(clock.at(start.cycle + cycle.trunc() as i64, cycle.fract() * period), &mut ())?;
        let state = engine.state();
        for (j, (deflections, rates)) in shown.iter_mut().enumerate() {
            let (deflection, rate) = structure.deflection(j, state.at, &state.x);
            deflections.push(deflection);
            rates.push(rate);
        }
    }
    let (m, speed) = (simulation.unit("m"), simulation.unit("m/s"));
    let deflection = || Axis::new("deflection", m);
    let line = |j: usize, x: Vec<f64>, y: Vec<f64>| Series::line(contacts[j].name.clone(), j, x, y);
    // The flanks of all contacts, each once.
    let mut flanks: Vec<(f64, &str)> = Vec::new();
    for c in contacts {
        let both = [(c.half_backlash, "drive flank"), (-c.half_backlash, "back flank")];
        let has_back = c.flanks == crate::system::Flanks::Both;
        flanks.extend(both.into_iter().take(1 + usize::from(has_back)));
    }
    flanks.dedup_by(|a, b| a == b);
    flanks.sort_by(|a, b| a.0.total_cmp(&b.0));
    flanks.dedup_by(|a, b| a.0 == b.0);
    let across = flanks.iter().map(|(y, name)| Guide::Horizontal { y: *y, name: (*name).to_owned() });
    let upright = flanks.iter().map(|(x, name)| Guide::Vertical { x: *x, name: (*name).to_owned() });
    let over = Panel {
        title: "Over the period".to_owned(),
        x: Axis::new("cycle", "").between(0.0, orbit.period as f64),
        y: deflection(),
        series: (0..contacts.len()).map(|j| line(j, cycles.clone(), shown[j].0.clone())).collect(),
        guides: across.collect(),
        ..Panel::default()
    };
    let portrait = Panel {
        title: "Phase portrait".to_owned(),
        x: deflection(),
        y: Axis::new("rate", speed),
        series: (0..contacts.len()).map(|j| line(j, shown[j].0.clone(), shown[j].1.clone())).collect(),
        guides: upright.collect(),
        names_above: true,
        ..Panel::default()
    };
    let angle = |i: usize| i as f64 * TAU / 180.0;
    let circle = Series::line(
        "unit circle",
        7,
        (0..=180).map(|i| libm::cos(angle(i))).collect(),
        (0..=180).map(|i| libm::sin(angle(i))).collect(),
    );
    // Those that say nothing of stability are written as exact ones.
    let is_neutral = |m: &&Complex<f64>| **m == Complex::new(1.0, 0.0);
    let (neutral, others): (Vec<_>, Vec<_>) = orbit.multipliers.iter().partition(is_neutral);
    let points = |name: &str, of: &[&Complex<f64>], style: Style| Series {
        name: name.to_owned(),
        x: of.iter().map(|m| m.re).collect(),
        y: of.iter().map(|m| m.im).collect(),
        style,
        colour: 1,
    };
    let mut drawn = vec![circle.styled(Style::Hairline), points("multipliers", &others, Style::Points)];
    if !neutral.is_empty() {
        drawn.push(points("of a drift or an unused latched speed", &neutral, Style::Marks));
    }
    let plane = Panel {
        title: "Multipliers".to_owned(),
        x: Axis::new("real part", ""),
        y: Axis::new("imaginary part", ""),
        equal_scales: true,
        series: drawn,
        ..Panel::default()
    };
    let stable = if orbit.is_stable { "stable" } else { "unstable" };
    let left_out = structure.contacts().len() - contacts.len();
    let rest = if left_out > 0 { format!(" {left_out} further contacts are not drawn.") } else { String::new() };
    Ok(Figure {
        id: ORBIT.to_owned(),
        title: format!("Periodic orbit of {}", simulation.title()),
        caption: format!("Period {} cycles, {stable}. Word: {}.{rest}", orbit.period, shortened(&orbit.word())),
        columns: 3,
        panels: vec![over, portrait, plane],
    })
}

/// A word that fits a caption.
fn shortened(word: &str) -> String {
    match word.char_indices().nth(120) {
        Some((end, _)) => format!("{} …", &word[..end]),
        None if word.is_empty() => "none, no contact is gained or lost".to_owned(),
        None => word.to_owned(),
    }
}

/// How the means of the exponents settle, each with its band.
#[must_use]
pub fn exponents(simulation: &Simulation, exponents: &Exponents) -> Figure {
    let course = &exponents.course;
    let count = exponents.exponents.iter().flatten().count().min(course.first().map_or(0, |(_, mean, _)| mean.len()));
    let cycles: Vec<f64> = course.iter().map(|(cycles, ..)| *cycles as f64).collect();
    let mut series = Vec::new();
    for l in 0..count {
        let mean: Vec<f64> = course.iter().map(|(_, mean, _)| mean[l]).collect();
        for sign in [-1.0, 1.0] {
            let edge = course.iter().map(|(_, mean, band)| mean[l] + sign * band[l]);
            series.push(Series::line("one standard error", 7, cycles.clone(), edge.collect()).styled(Style::Hairline));
        }
        let name = if count <= 8 { format!("exponent {}", l + 1) } else { "exponents".to_owned() };
        series.push(Series::line(name, if count <= 8 { l } else { 0 }, cycles.clone(), mean));
    }
    Figure {
        id: EXPONENTS.to_owned(),
        title: format!("Lyapunov exponents of {}", simulation.title()),
        caption: format!("Means over the cycles after the first {}.", exponents.dropped),
        columns: 1,
        panels: vec![Panel {
            x: Axis { logarithmic: true, ..Axis::new("cycles averaged", "") },
            y: Axis::new("exponent", exponents.unit),
            guides: vec![Guide::Horizontal { y: 0.0, name: String::new() }],
            series,
            ..Panel::default()
        }],
    }
}
