//! Forces of the meshes and their spectra, at one speed and at several.

use serde_json::{Map, Value, json};

use super::{Context, ModeRow, Quantity, Units, by_name, lines, mesh_frequency, representatives};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Figure, Guide, Panel, Raster, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::{StudyError, steady},
};

/// Draws forces of one mesh of each family over a few mesh periods, and their spectra up to `highest`, Hz; returns the facts of each
/// family.
pub fn forces(context: &Context<'_>, scene: &Scene, highest: f64) -> Result<(Figure, Map<String, Value>), StudyError> {
    /// Mesh periods drawn.
    const SHOWN: usize = 4;
    /// Cycles of the spectrum, enough for subharmonics.
    const CYCLES: u64 = 16;
    const PER_CYCLE: u32 = 512;

    let simulation = Simulation::from_scene(scene)?;
    let cycles = |period: Option<u64>| period.map_or(CYCLES, |period| CYCLES.next_multiple_of(period));
    let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, false), cycles)?;
    let (cycles, period) = (cycles(settled.period), simulation.period()?);
    let window = steady::window(&settled);
    let units = Units::of(&simulation);
    let mut figure = Figure { id: "forces".to_owned(), columns: 2, ..Figure::default() };
    let mut facts = Vec::new();
    for (colour, (j, family)) in representatives(&simulation).into_iter().enumerate() {
        let force = &recording.force[j];
        let spectrum = Spectrum::new(force, f64::from(PER_CYCLE) / period, window);
        let shown = SHOWN * PER_CYCLE as usize + 1;
        let (t, f): (Vec<f64>, Vec<f64>) =
            recording.t.iter().zip(force).take(shown).map(|(t, f)| (units.time.0 * t, *f)).unzip();
        let (mean, unit) = (spectrum.amplitude[0], units.force);
        let (low, high) = force.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(*f), h.max(*f)));
        figure.panels.push(Panel {
            title: format!("{family}: mean {} {unit}, amplitude {} {unit}", short(mean), short(0.5 * (high - low))),
            x: Axis::new("time", units.time.1),
            y: Axis::new(format!("force, {family}"), units.force),
            series: vec![Series::line("", colour, t, f)],
            guides: vec![Guide::Horizontal { y: mean, name: "mean".to_owned() }],
            ..Panel::default()
        });
        let lines = lines(&spectrum, highest);
        // Bins between the lines of a periodic motion contain rounding only.
        let floor = lines.iter().fold(0.0, |m: f64, l| m.max(l.1)) * 1e-6;
        let (frequency, amplitude): (Vec<f64>, Vec<f64>) = lines.into_iter().filter(|l| l.1 > floor).unzip();
        // Room for the names of the orders above the lines.
        let top = f64::max(1.25e6 * floor, f64::MIN_POSITIVE);
        let own = mesh_frequency(&simulation, j)?;
        let orders = (1..5).map(|h| (h, f64::from(h) * own)).take_while(|(_, f)| *f <= highest);
        figure.panels.push(Panel {
            title: format!("{family}: spectrum"),
            x: Axis::new("frequency", units.frequency).between(0.0, highest),
            y: Axis::new("amplitude", units.force).between(0.0, top),
            series: vec![Series::line("", colour, frequency, amplitude).styled(Style::Stems)],
            guides: orders.map(|(h, x)| Guide::Vertical { x, name: order(h) }).collect(),
            ..Panel::default()
        });
        let found = json!({
            "mean": mean, "largest": high, "smallest": low, "mesh_frequency": 1.0 / period,
            "harmonics": (1..=6).map(|h| spectrum.at(f64::from(h) / period)).collect::<Vec<_>>(),
        });
        facts.push((family, found));
    }
    figure.title = "Mesh forces and their spectra".to_owned();
    figure.caption = match settled.period {
        Some(p) => format!(
            "Force of one mesh of each family over {SHOWN} mesh periods, and its spectrum over {cycles} periods sampled at \
             exact phases (period {p}: no window, no leakage)."
        ),
        None => format!(
            "Force of one mesh of each family, and its spectrum over {cycles} periods (Hann window; the motion has no short period)."
        ),
    };
    Ok((figure, by_name(facts)))
}

/// Returns a number to about four digits, for titles.
fn short(value: f64) -> String {
    let digits = (3 - libm::log10(value.abs().max(1e-300)).floor() as i32).clamp(1, 6) as usize;
    format!("{value:.digits$}")
}

/// Returns the name of an order: `f_m`, `2 f_m`, …
fn order(h: u32) -> String {
    if h == 1 { "f_m".to_owned() } else { format!("{h} f_m") }
}

/// Levels of each mesh family at one speed.
struct SpeedSpectra {
    mesh_frequency: Vec<f64>,
    spectra: Vec<Spectrum>,
}

/// Draws levels of the mesh forces over frequency and speed, with order lines and the natural frequencies `natural` up to `highest`, Hz.
/// Returns the strongest line of each family over all speeds.
pub fn waterfall(
    context: &Context<'_>,
    scene: &Scene,
    (Quantity { pointer, axis }, speeds): (&Quantity, &[f64]),
    natural: &[ModeRow],
    highest: f64,
) -> Result<(Figure, Map<String, Value>), StudyError> {
    const CYCLES: u64 = 48;
    const PER_CYCLE: u32 = 64;
    /// Number of order lines.
    const ORDERS: u32 = 4;
    /// Cells along the frequency, and most cells along the speed.
    const CELLS: [usize; 2] = [300, 200];
    /// Width of a class, dB.
    const STEP: f64 = 6.0;

    let families = representatives(&Simulation::from_scene(scene)?);
    let rows = context.each(speeds, |&speed| {
        let simulation = Simulation::from_scene(&scene.with(pointer, json!(speed))?)?;
        let cycles = |period: Option<u64>| period.map_or(2 * CYCLES, |period| CYCLES.next_multiple_of(period));
        let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, false), cycles)?;
        let window = steady::window(&settled);
        let rate = f64::from(PER_CYCLE) / simulation.period()?;
        let own = families.iter().map(|(j, _)| mesh_frequency(&simulation, *j)).collect::<Result<_, _>>()?;
        let spectra = families.iter().map(|(j, _)| Spectrum::new(&recording.force[*j], rate, window)).collect();
        Ok(SpeedSpectra { mesh_frequency: own, spectra })
    })?;
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return Err(StudyError::missing(scene.name(), "no speed is given"));
    };
    let (hertz, unit) = if scene.built().dimensionless { ("", "dB re 1") } else { ("Hz", "dB re 1 N") };
    // Cells are as high as the smallest step between speeds; each shows the nearest speed.
    let [slow, fast] = [speeds[0], speeds[speeds.len() - 1]];
    let step = speeds.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
    let high = if step.is_finite() && step > 0.0 { ((fast - slow) / step).round() as usize + 1 } else { 1 };
    let high = high.min(CELLS[1]);
    let half = if high > 1 { 0.5 * (fast - slow) / (high - 1) as f64 } else { 0.5 * slow.abs().max(1.0) };
    let nearest =
        |at: f64| (0..speeds.len()).min_by(|a, b| (speeds[*a] - at).abs().total_cmp(&(speeds[*b] - at).abs()));
    let of_row: Vec<usize> = (0..high).rev().filter_map(|k| nearest(slow + 2.0 * half * k as f64)).collect();
    let mut figure = Figure {
        id: "waterfall".to_owned(),
        title: format!("Spectra of the mesh forces against {}", axis.label),
        caption: format!(
            "Levels of the amplitude of the force, {unit}. Slanted: orders of the mesh frequency f_m; upright: natural frequencies with \
             every mesh closed. White: below the lowest class, or beyond the spectrum."
        ),
        columns: 2,
        ..Figure::default()
    };
    let mut facts = Vec::new();
    let mut levels = Vec::new();
    for (family, (_, name)) in families.iter().enumerate() {
        let up_to = |s: &Spectrum| ((highest / s.resolution) as usize + 1).min(s.amplitude.len());
        let lines = rows.iter().zip(speeds).flat_map(|(row, speed)| {
            let spectrum = &row.spectra[family];
            let line = move |k: usize| {
                (*speed, k as f64 * spectrum.resolution / row.mesh_frequency[family], spectrum.amplitude[k])
            };
            (1..up_to(spectrum)).map(line)
        });
        let strongest = lines.fold(None, |best: Option<(f64, f64, f64)>, line| match best {
            Some(best) if best.2 >= line.2 => Some(best),
            _ => Some(line),
        });
        let Some((speed, order, amplitude)) = strongest else { continue };
        facts.push((name.clone(), json!({ "rpm": speed, "order": order, "amplitude": amplitude })));
        let values = of_row.iter().flat_map(|row| {
            let spectrum = &rows[*row].spectra[family];
            (0..CELLS[0]).map(move |cell| level(spectrum, cell, highest / CELLS[0] as f64))
        });
        levels.push((family, 20.0 * libm::log10(amplitude.max(f64::MIN_POSITIVE)), values.collect::<Vec<_>>()));
    }
    let largest = levels.iter().fold(f64::NEG_INFINITY, |most, (_, level, _)| most.max(*level));
    for (family, _, values) in levels {
        let at = |row: &SpeedSpectra, h: u32| f64::from(h) * row.mesh_frequency[family];
        let orders = (1..=ORDERS).filter_map(|h| {
            let [from, to] = [at(first, h), at(last, h)];
            let share = if to > from { ((highest - from) / (to - from)).min(1.0) } else { 0.0 };
            (share > 0.0).then(|| Guide::Slanted {
                from: [from, slow],
                to: [from + share * (to - from), slow + share * (fast - slow)],
                name: order(h),
            })
        });
        let lines = natural.iter().filter(|mode| 0.0 < mode.hertz && mode.hertz <= highest);
        let lines = lines.map(|mode| Guide::Vertical { x: mode.hertz, name: mode.name.clone() });
        let raster =
            Raster { x: [0.0, highest], y: [slow - half, fast + half], columns: CELLS[0], values, ..Raster::default() };
        figure.panels.push(Panel {
            title: format!("level of {} [{unit}]", families[family].1),
            x: Axis::new("frequency", hertz).between(0.0, highest),
            y: axis.clone().between(slow - half, fast + half),
            raster: Some(raster.of_levels((largest, STEP), unit)),
            guides: orders.chain(lines).collect(),
            ..Panel::default()
        });
    }
    Ok((figure, by_name(facts)))
}

/// Returns the level of the strongest bin of a cell `wide` Hz wide, or of the nearest one, dB re 1; none beyond the spectrum, and for the
/// mean.
fn level(spectrum: &Spectrum, cell: usize, wide: f64) -> Option<f64> {
    let bin = |at: f64| at / spectrum.resolution;
    // Exact: bins are few.
    let first = bin(cell as f64 * wide).ceil() as usize;
    let end = bin((cell + 1) as f64 * wide).ceil() as usize;
    let inside = first.max(1)..end.max(1);
    let amplitude = if inside.is_empty() {
        let nearest = bin((cell as f64 + 0.5) * wide).round() as usize;
        spectrum.amplitude.get(nearest).copied().filter(|_| nearest > 0)
    } else {
        spectrum.amplitude.get(inside).map(|bins| bins.iter().fold(0.0, |most: f64, a| most.max(*a)))
    };
    // A thousandth of a decibel is finer than any reading.
    amplitude.filter(|a| *a > 0.0).map(|a| (2e4 * libm::log10(a)).round() / 1e3)
}
