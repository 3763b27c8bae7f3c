//! Forces of the meshes and their spectra, at one speed and at several.

use serde_json::{Map, Value, json};

use super::{Context, ModeRow, Units, by_name, lines, representatives};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::{StudyError, steady},
};

/// Forces of one mesh of each family over a few mesh periods, and their spectra up to `highest`, Hz; the facts of each
/// family.
pub fn forces(context: &Context<'_>, scene: &Scene, highest: f64) -> Result<(Figure, Map<String, Value>), StudyError> {
    /// Mesh periods drawn.
    const SHOWN: usize = 4;
    /// Enough for subharmonics to show.
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
        // Bins between the lines of a periodic motion hold rounding only.
        let floor = lines.iter().fold(0.0, |m: f64, l| m.max(l.1)) * 1e-6;
        let (frequency, amplitude): (Vec<f64>, Vec<f64>) = lines.into_iter().filter(|l| l.1 > floor).unzip();
        // Room for the names of the orders above the lines.
        let top = f64::max(1.25e6 * floor, f64::MIN_POSITIVE);
        let orders = (1..5).map(|h| (h, f64::from(h) / period)).take_while(|(_, f)| *f <= highest);
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

/// A number to about four digits, for titles.
fn short(value: f64) -> String {
    let digits = (3 - libm::log10(value.abs().max(1e-300)).floor() as i32).clamp(1, 6) as usize;
    format!("{value:.digits$}")
}

/// `f_m`, `2 f_m`, …
fn order(h: u32) -> String {
    if h == 1 { "f_m".to_owned() } else { format!("{h} f_m") }
}

/// One spectrum of each mesh family.
struct Row {
    rpm: f64,
    mesh_frequency: f64,
    spectra: Vec<(String, Spectrum)>,
}

/// Spectra of the mesh forces at several speeds, one line above the other, with order lines and the natural
/// frequencies `natural` up to `highest`, Hz; the strongest line of each family over all speeds.
pub fn waterfall(
    context: &Context<'_>,
    scene: &Scene,
    (pointer, speeds): (&str, &[f64]),
    natural: &[ModeRow],
    highest: f64,
) -> Result<(Figure, Map<String, Value>), StudyError> {
    const CYCLES: u64 = 48;
    const PER_CYCLE: u32 = 64;
    /// Order lines drawn.
    const ORDERS: u32 = 4;
    /// Bins of less than this share of the strongest line are drawn as the base line.
    const SHOWN: f64 = 1e-3;

    let rows = context.each(speeds, |&rpm| {
        let simulation = Simulation::from_scene(&scene.with(pointer, json!(rpm))?)?;
        let cycles = |period: Option<u64>| period.map_or(2 * CYCLES, |period| CYCLES.next_multiple_of(period));
        let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, false), cycles)?;
        let window = steady::window(&settled);
        let rate = f64::from(PER_CYCLE) / simulation.period()?;
        let spectrum = |(j, family): (usize, String)| (family, Spectrum::new(&recording.force[j], rate, window));
        let spectra = representatives(&simulation).into_iter().map(spectrum).collect();
        Ok(Row { rpm, mesh_frequency: 1.0 / simulation.period()?, spectra })
    })?;
    let step = speeds.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() && step > 0.0 { step } else { 1.0 };
    let count = rows.first().map_or(0, |row| row.spectra.len());
    let mut figure = Figure {
        id: "waterfall".to_owned(),
        title: "Spectra of the mesh forces against speed".to_owned(),
        columns: 2,
        ..Figure::default()
    };
    let (mut scales, mut facts) = (Vec::new(), Vec::new());
    for family in 0..count {
        let up_to = |s: &Spectrum| ((highest / s.resolution) as usize + 1).min(s.amplitude.len());
        let lines = rows.iter().flat_map(|row| {
            let spectrum = &row.spectra[family].1;
            (1..up_to(spectrum)).map(move |k| (row, k as f64 * spectrum.resolution, spectrum.amplitude[k]))
        });
        let line = lines.fold(None, |best: Option<(&Row, f64, f64)>, line| match best {
            Some(best) if best.2 >= line.2 => Some(best),
            _ => Some(line),
        });
        let Some((row, frequency, strongest)) = line else { continue };
        let name = &rows[0].spectra[family].0;
        let order_there = frequency / row.mesh_frequency;
        facts.push((name.clone(), json!({ "rpm": row.rpm, "order": order_there, "amplitude": strongest })));
        // The strongest line reaches over six speeds.
        let scale = if strongest > 0.0 { 6.0 * step / strongest.sqrt() } else { 0.0 };
        scales.push(format!("{name}: {strongest:.0} N"));
        let series = rows
            .iter()
            .map(|row| {
                let spectrum = &row.spectra[family].1;
                let last = up_to(spectrum);
                let height = |k: usize| if k == 0 { 0.0 } else { spectrum.amplitude[k] };
                // Along the base line its ends are enough.
                let flat = |k: usize| height(k) < SHOWN * strongest;
                let drawn = (0..last).filter(|&k| k == 0 || k + 1 == last || !(flat(k - 1) && flat(k) && flat(k + 1)));
                let (x, y) =
                    drawn.map(|k| (k as f64 * spectrum.resolution, row.rpm + scale * height(k).sqrt())).unzip();
                Series::line("", family, x, y).styled(Style::Hairline)
            })
            .collect();
        let (first, last) = (&rows[0], &rows[rows.len() - 1]);
        let orders = (1..=ORDERS).filter_map(|h| {
            let at = |row: &Row| f64::from(h) * row.mesh_frequency;
            let share = ((highest - at(first)) / (at(last) - at(first))).min(1.0);
            (share > 0.0).then(|| Guide::Slanted {
                from: [at(first), first.rpm],
                to: [at(first) + share * (at(last) - at(first)), first.rpm + share * (last.rpm - first.rpm)],
                name: order(h),
            })
        });
        let lines = natural.iter().filter(|mode| mode.hertz <= highest);
        let lines = lines.map(|mode| Guide::Vertical { x: mode.hertz, name: mode.name.clone() });
        figure.panels.push(Panel {
            title: name.clone(),
            x: Axis::new("frequency", "Hz").between(0.0, highest),
            y: Axis::new("speed", "rev/min"),
            series,
            guides: orders.chain(lines).collect(),
            ..Panel::default()
        });
    }
    figure.caption = format!(
        "Each line is the spectrum at one speed, raised by the square root of its amplitude so that weak lines show beside \
         strong ones; the strongest line ({}) reaches over six speed steps. Slanted: orders of the mesh frequency; upright: \
         natural frequencies.",
        scales.join(", ")
    );
    Ok((figure, by_name(facts)))
}
