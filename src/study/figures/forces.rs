use serde_json::{Map, Value, json};

use super::{Context, Units, by_name, representatives};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::StudyError,
};

/// Cycles shown.
const SHOWN: usize = 4;
/// Cycles of the spectrum: enough for subharmonics to show.
const CYCLES: u64 = 16;
const PER_CYCLE: u32 = 512;

/// Forces of one mesh of each family over a few mesh periods, and their spectra up to `highest`, Hz; the facts of each
/// family.
pub fn forces(context: &Context<'_>, scene: &Scene, highest: f64) -> Result<(Figure, Map<String, Value>), StudyError> {
    let simulation = Simulation::from_scene(scene)?;
    let cycles = |period: Option<u32>| period.map_or(CYCLES, |period| CYCLES.next_multiple_of(period.into()));
    let (recording, settled) = context.recorded(&simulation, PER_CYCLE, cycles)?;
    let (cycles, period) = (cycles(settled.period), simulation.period()?);
    let window = settled.window();
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
        let lines = spectrum.frequencies().into_iter().zip(spectrum.amplitude.iter().copied()).skip(1);
        let lines: Vec<(f64, f64)> = lines.take_while(|(frequency, _)| *frequency <= highest).collect();
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
    let digits = (3 - value.abs().max(1e-300).log10().floor() as i32).clamp(1, 6) as usize;
    format!("{value:.digits$}")
}

/// `f_m`, `2 f_m`, …
pub(super) fn order(h: u32) -> String {
    if h == 1 { "f_m".to_owned() } else { format!("{h} f_m") }
}
