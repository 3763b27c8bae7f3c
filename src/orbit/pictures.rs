//! Pictures of an orbit against its backlash, and of the convergence of exponents.

use std::{f64::consts::TAU, ops::ControlFlow};

use nalgebra::Complex;

use super::{Exponents, Orbit, SectionMap};
use crate::{
    engine::{JumpRecord, Observer},
    event::EventRecord,
    hybrid::{Instant, Mode},
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    simulation::{Simulation, SimulationError},
};

/// Samples of a cycle, and of the time between two events: contact with a stiff mesh is a short part of a cycle.
const SAMPLES: u64 = 240;
const BETWEEN: u64 = 24;
/// Contacts drawn.
const MOST: usize = 6;
/// Largest multiplier drawn: beside a larger one the unit circle would not be visible, so that it is only named.
const SEEN: f64 = 12.0;
/// Difference, as a share of the range of deflections, within which two curves are drawn as one.
const ALIKE: f64 = 1e-6;

/// Name of the picture of an orbit in file names.
pub const ORBIT: &str = "orbit";
/// Name of the picture of exponents.
pub const EXPONENTS: &str = "exponents";

/// States before and after each jump.
#[derive(Default)]
struct Jumps(Vec<(Instant, Vec<f64>, Vec<f64>)>);

impl Observer for Jumps {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.0.push((jumped.at, jumped.x_minus.to_vec(), jumped.x_plus.to_vec()));
    }

    fn event(&mut self, _: &EventRecord) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Draws the deflection of each contact over the period and against its rate, and the multipliers in the unit circle. `orbit` is the first
/// one of `count`.
///
/// # Errors
/// [`SimulationError`] if the orbit cannot be run.
pub fn orbit(simulation: &Simulation, orbit: &Orbit, count: usize) -> Result<Figure, SimulationError> {
    let structure = &simulation.structure;
    let contacts = &structure.spec().contacts[..structure.contacts().len().min(MOST)];
    let period = simulation.period()?;
    let map = SectionMap::new(simulation)?;
    let mut jumps = Jumps::default();
    map.watch(&orbit.section, orbit.period, &mut jumps)?;
    let mut engine = simulation.engine(map.state(&orbit.section)?)?;
    let (clock, start) = (simulation.clock(), engine.state().at);
    let mut cycles = Vec::new();
    let mut shown = vec![(Vec::new(), Vec::new()); contacts.len()];
    let mut show = |cycle: f64, at: Instant, x: &[f64]| {
        cycles.push(cycle);
        for (j, (deflections, rates)) in shown.iter_mut().enumerate() {
            let (deflection, rate) = structure.deflection(j, at, x);
            deflections.push(deflection);
            rates.push(rate);
        }
    };
    // From event to event, with the states before and after each.
    let (mut from, mut x) = (0.0, engine.state().x.clone());
    let ends =
        jumps.0.iter().map(|(at, before, after)| (clock.between(start, *at) / period, Some((at, before, after))));
    for (to, jump) in ends.chain([(orbit.period as f64, None)]) {
        show(from, clock.at(start.cycle + from.trunc() as i64, from.fract() * period), &x);
        let samples = ((SAMPLES as f64 * (to - from)).ceil() as u64).max(BETWEEN);
        for k in 1..samples {
            let cycle = from + (to - from) * k as f64 / samples as f64;
            let at = clock.at(start.cycle + cycle.trunc() as i64, cycle.fract() * period);
            map.advance(&mut engine, at, &mut ())?;
            show(cycle, at, &engine.state().x);
        }
        from = to;
        if let Some((at, before, after)) = jump {
            show(to, *at, before);
            x.clone_from(after);
        }
    }
    map.advance(&mut engine, map.at(orbit.period), &mut ())?;
    show(orbit.period as f64, map.at(orbit.period), &engine.state().x);
    let (m, speed) = (simulation.unit("m"), simulation.unit("m/s"));
    let flanks_of = contacts.iter().flat_map(|c| [c.half_backlash, -c.half_backlash]);
    let all = || shown.iter().flat_map(|(deflections, _)| deflections.iter().copied());
    let [low, high] = [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)];
    // A flank that the orbit touches is not drawn on the frame.
    let [low, high] = flanks_of.fold([low, high], |[low, high], flank| {
        let near = 0.2 * (high - low);
        let is_near = (low - near..=high + near).contains(&flank);
        if is_near { [low.min(flank), high.max(flank)] } else { [low, high] }
    });
    let margin = 0.05 * (high - low);
    let deflection = || {
        let axis = Axis::new("deflection", m);
        if margin > 0.0 { axis.between(low - margin, high + margin) } else { axis }
    };
    // Equal curves are drawn once, with several names.
    let is_alike = |a: usize, b: usize| {
        let off = shown[a].0.iter().zip(&shown[b].0).map(|(a, b)| (a - b).abs());
        off.fold(0.0, f64::max) <= ALIKE * (high - low)
    };
    let mut drawn: Vec<(usize, String)> = Vec::new();
    for (j, c) in contacts.iter().enumerate() {
        match drawn.iter_mut().find(|(known, _)| is_alike(*known, j)) {
            Some((_, names)) => *names = format!("{names}, {}", c.name),
            None => drawn.push((j, c.name.clone())),
        }
    }
    let lines = |of: &dyn Fn(usize) -> (Vec<f64>, Vec<f64>)| -> Vec<Series> {
        let line = |(j, name): &(usize, String)| {
            let (x, y) = of(*j);
            Series::line(name.clone(), *j, x, y)
        };
        drawn.iter().map(line).collect()
    };
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
        x: Axis::new("time", "cycles").between(0.0, orbit.period as f64),
        y: deflection(),
        series: lines(&|j| (cycles.clone(), shown[j].0.clone())),
        guides: across.collect(),
        ..Panel::default()
    };
    let portrait = Panel {
        title: "Phase portrait".to_owned(),
        x: deflection(),
        y: Axis::new("rate of deflection", speed),
        series: lines(&|j| shown[j].clone()),
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
    // Multipliers that do not decide on stability are written as exact ones.
    let is_neutral = |m: &&Complex<f64>| **m == Complex::new(1.0, 0.0);
    let (far, near): (Vec<_>, Vec<_>) = orbit.multipliers.iter().partition(|m| m.norm() > SEEN);
    let (neutral, others): (Vec<_>, Vec<_>) = near.into_iter().partition(is_neutral);
    let points = |name: &str, of: &[&Complex<f64>], style: Style| Series {
        name: name.to_owned(),
        x: of.iter().map(|m| m.re).collect(),
        y: of.iter().map(|m| m.im).collect(),
        style,
        colour: 1,
    };
    let mut placed = vec![circle.styled(Style::Hairline), points("multipliers", &others, Style::Points)];
    if !neutral.is_empty() {
        placed.push(points("of a drift or an unused latched speed", &neutral, Style::Marks));
    }
    let far: Vec<String> = far.iter().map(|m| format!("{:.3e}", m.norm())).collect();
    let plane = Panel {
        title: if far.is_empty() {
            "Multipliers".to_owned()
        } else {
            format!("Multipliers; not drawn, of size: {}", far.join(", "))
        },
        x: Axis::new("real part", ""),
        y: Axis::new("imaginary part", ""),
        equal_scales: true,
        series: placed,
        ..Panel::default()
    };
    let stable = orbit.stability().1;
    let left_out = structure.contacts().len() - contacts.len();
    let rest = if left_out > 0 { format!(" {left_out} further contacts are not drawn.") } else { String::new() };
    let which = if count > 1 { format!("Orbit 1 of {count}. ") } else { String::new() };
    Ok(Figure {
        id: ORBIT.to_owned(),
        title: format!("Periodic orbit of {}, {stable}", simulation.title()),
        caption: format!("{which}Period {} cycles, {stable}. Word: {}.{rest}", orbit.period, shortened(&orbit.word())),
        columns: 3,
        panels: vec![over, portrait, plane],
    })
}

/// Returns a word short enough for a caption.
fn shortened(word: &str) -> String {
    match word.char_indices().nth(120) {
        Some((end, _)) => format!("{} …", &word[..end]),
        None if word.is_empty() => "none, no contact is gained or lost".to_owned(),
        None => word.to_owned(),
    }
}

/// Draws the convergence of the means of the exponents, each with its band.
#[must_use]
pub fn exponents(simulation: &Simulation, exponents: &Exponents) -> Figure {
    let course = &exponents.course;
    let count = exponents.exponents.iter().flatten().count().min(course.first().map_or(0, |(_, mean, _)| mean.len()));
    let cycles: Vec<f64> = course.iter().map(|(cycles, ..)| *cycles as f64).collect();
    let mut series = Vec::new();
    for l in 0..count {
        let mean: Vec<f64> = course.iter().map(|(_, mean, _)| mean[l]).collect();
        let edges = [-1.0, 1.0].map(|sign| course.iter().map(|(_, mean, band)| mean[l] + sign * band[l]).collect());
        let mut band = |x: Vec<f64>, y: Vec<f64>| {
            series.push(Series::line("one standard error", 7, x, y).styled(Style::Hairline));
        };
        if let [cycle] = cycles[..] {
            // A single point has no line along it.
            band(vec![cycle; 2], edges.concat());
        } else {
            edges.into_iter().for_each(|edge| band(cycles.clone(), edge));
        }
        let name = if count <= 8 { format!("exponent {}", l + 1) } else { "exponents".to_owned() };
        let style = if cycles.len() == 1 { Style::Marks } else { Style::Line };
        series.push(Series::line(name, if count <= 8 { l } else { 0 }, cycles.clone(), mean).styled(style));
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
