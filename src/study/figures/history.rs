use serde_json::{Value, json};

use super::{Context, Units};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Band, Figure, Guide, Panel, Series},
    scene::Scene,
    simulation::Simulation,
    study::StudyError,
};

const CYCLES: u64 = 384;
const SHOWN: usize = 24;
const PER_CYCLE: u32 = 32;
/// Where a subharmonic of order 1/2 would stand.
const REGION: [f64; 2] = [0.4, 0.6];
/// Highest frequency shown, mesh frequencies.
const HIGHEST: f64 = 1.6;

/// Displacement of one freedom over time and its spectrum around half the mesh frequency.
pub fn history(context: &Context<'_>, scene: &Scene, freedom: &str) -> Result<(Figure, Value), StudyError> {
    let simulation = Simulation::from_scene(scene)?;
    let row = simulation.freedom(freedom)?;
    let (recording, settled) = context.recorded(&simulation, PER_CYCLE, |_| CYCLES)?;
    let mesh_frequency = 1.0 / simulation.period()?;
    let window = settled.window();
    let spectrum = Spectrum::new(&recording.x[row], f64::from(PER_CYCLE) * mesh_frequency, window);
    let bins = spectrum.frequencies().into_iter().zip(spectrum.amplitude.iter().copied()).skip(1);
    let bins: Vec<(f64, f64)> = bins.take_while(|(f, _)| *f <= HIGHEST * mesh_frequency).collect();
    let in_region = |f: f64| (REGION[0]..=REGION[1]).contains(&(f / mesh_frequency));
    let mut around: Vec<f64> = bins.iter().filter(|(f, _)| in_region(*f)).map(|(_, a)| *a).collect();
    around.sort_by(f64::total_cmp);
    // The floor is what a line at half the mesh frequency must rise above.
    let facts = json!({
        "period": settled.period, "half": spectrum.at(0.5 * mesh_frequency),
        "floor": around.get(around.len() / 2).copied().unwrap_or(0.0),
    });
    let units = Units::of(&simulation);
    let shown = SHOWN * PER_CYCLE as usize + 1;
    let shown = recording.t.iter().zip(&recording.x[row]).take(shown);
    let (t, x): (Vec<f64>, Vec<f64>) = shown.map(|(t, x)| (units.time.0 * t, units.length.0 * x)).unzip();
    let (f, a) = bins.into_iter().map(|(f, a)| (f, units.length.0 * a)).unzip();
    let figure = Figure {
        id: "history".to_owned(),
        title: format!("Displacement {freedom} and its spectrum"),
        caption: format!(
            "{SHOWN} of {CYCLES} mesh periods, carrier frame; spectrum over all of them ({}). Shaded: where a subharmonic of \
             order 1/2 would stand.",
            if settled.period.is_some() { "no window: the motion is periodic" } else { "Hann window" }
        ),
        columns: 2,
        panels: vec![
            Panel {
                x: Axis::new("time", units.time.1),
                y: Axis::new(format!("displacement {freedom}"), units.length.1),
                series: vec![Series::line("", 0, t, x)],
                ..Panel::default()
            },
            Panel {
                x: Axis::new("frequency", units.frequency).between(0.0, HIGHEST * mesh_frequency),
                y: Axis::new("amplitude", units.length.1),
                series: vec![Series::line("", 0, f, a)],
                bands: vec![Band {
                    x: REGION.map(|order| order * mesh_frequency),
                    name: "around f_m/2".into(),
                    colour: 0,
                }],
                guides: [(0.5, "f_m/2"), (1.0, "f_m")]
                    .map(|(order, name)| Guide::Vertical { x: order * mesh_frequency, name: name.to_owned() })
                    .to_vec(),
                ..Panel::default()
            },
        ],
    };
    Ok((figure, facts))
}
