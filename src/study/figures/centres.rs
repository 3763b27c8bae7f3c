//! Motions of the centres: paths, displacements and their spectra.

use serde_json::{Value, json};

use super::{Context, Units, lines, maxima, number};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Band, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::{StudyError, steady},
    train::frame::to_fixed,
};

/// Samples of a path in a mesh period.
pub(super) const PER_CYCLE: u32 = 128;
const BODIES: [(&str, &str, &str); 2] = [("sun", "x_s", "y_s"), ("ring", "x_r", "y_r")];

/// Paths of the centres of sun and ring in the fixed frame over one turn of the carrier; a train without these freedoms has
/// none. The facts are in m, those on the spectrum and on `x(t + T) − x(t)` in the carrier's frame.
pub fn trajectories(
    context: &Context<'_>,
    scene: &Scene,
    (pointer, speeds): (&str, &[f64]),
) -> Result<(Figure, Vec<Value>), StudyError> {
    let columns = context.each(speeds, |&rpm| {
        let scene = scene.with(pointer, json!(rpm))?;
        let simulation = Simulation::from_scene(&scene)?;
        let bodies = BODIES
            .iter()
            .filter_map(|(body, x, y)| Some((*body, simulation.freedom(x).ok()?, simulation.freedom(y).ok()?)));
        let bodies: Vec<(&'static str, usize, usize)> = bodies.collect();
        let Some(speed) = simulation.carrier_speed.filter(|_| !bodies.is_empty()) else {
            return Err(simulation
                .missing("it has no centres that move in a carrier's frame (x_s, y_s or x_r, y_r)")
                .into());
        };
        // The carrier turns once while Z_r teeth of the ring pass.
        let turn = number(&scene, "/train/teeth/ring")? as u64;
        let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, true), |_| turn)?;
        let mut found = Vec::new();
        for (body, x, y) in bodies {
            let points = recording.t.iter().zip(recording.x[x].iter().zip(&recording.x[y]));
            let path: Vec<[f64; 2]> = points.map(|(t, (x, y))| to_fixed([*x, *y], speed * t)).collect();
            let radius: Vec<f64> = path.iter().map(|p| libm::hypot(p[0], p[1])).collect();
            let leaves = settled.period.map(|period| (period, maxima(&radius)));
            let kind =
                leaves.map_or(settled.kind.word().to_owned(), |(period, leaves)| format!("period {period}, {leaves} leaves"));
            let facts = json!({
                "body": body, "rpm": rpm, "kind": settled.kind, "period": settled.period, "leaves": leaves.map(|(_, leaves)| leaves),
                "range": radius.iter().copied().fold(0.0, f64::max), "residual": residual(&recording.x[x]),
            });
            let (px, py) = path.iter().map(|p| (1e6 * p[0], 1e6 * p[1])).unzip();
            let panel = Panel {
                title: format!("{body}, {rpm} rev/min: {kind}"),
                x: Axis::new("x", "µm"),
                y: Axis::new("y", "µm"),
                equal_scales: true,
                series: vec![Series::line("", found.len(), px, py).styled(Style::Hairline)],
                ..Panel::default()
            };
            found.push((panel, facts));
        }
        Ok(found)
    })?;
    let mut figure = Figure {
        id: "trajectories".to_owned(),
        title: "Paths of the centres over one turn of the carrier".to_owned(),
        caption:
            "Fixed frame. Leaves of a periodic path are the maxima of the distance from the centre, counted on 128 samples a mesh period."
                .to_owned(),
        columns: speeds.len(),
        ..Figure::default()
    };
    let mut found = Vec::new();
    for body in 0..columns.iter().map(Vec::len).min().unwrap_or(0) {
        for column in &columns {
            let (panel, facts) = column[body].clone();
            figure.panels.push(panel);
            found.push(facts);
        }
    }
    Ok((figure, found))
}

/// Root mean square of `x(t + T) − x(t)` over that of x (mean taken off).
pub(super) fn residual(x: &[f64]) -> f64 {
    let lag = PER_CYCLE as usize;
    let rms = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.fold((0.0, 0u32), |(s, n), v| (s + v * v, n + 1));
        (sum / f64::from(count.max(1))).sqrt()
    };
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let all = rms(&mut x.iter().map(|v| v - mean));
    let changed = rms(&mut x.windows(lag + 1).map(|w| w[lag] - w[0]));
    if all > 0.0 { changed / all } else { 0.0 }
}

/// Displacement of one freedom over time and its spectrum around half the mesh frequency.
pub fn history(context: &Context<'_>, scene: &Scene, freedom: &str) -> Result<(Figure, Value), StudyError> {
    const CYCLES: u64 = 384;
    const SHOWN: usize = 24;
    const PER_CYCLE: u32 = 32;
    /// Where a subharmonic of order 1/2 would stand.
    const REGION: [f64; 2] = [0.4, 0.6];
    /// Highest frequency shown, mesh frequencies.
    const HIGHEST: f64 = 1.6;

    let simulation = Simulation::from_scene(scene)?;
    let row = simulation.freedom(freedom)?;
    let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, true), |_| CYCLES)?;
    let mesh_frequency = 1.0 / simulation.period()?;
    let window = steady::window(&settled);
    let spectrum = Spectrum::new(&recording.x[row], f64::from(PER_CYCLE) * mesh_frequency, window);
    let bins = lines(&spectrum, HIGHEST * mesh_frequency);
    let in_region = |f: f64| (REGION[0]..=REGION[1]).contains(&(f / mesh_frequency));
    let mut around: Vec<f64> = bins.iter().filter(|(f, _)| in_region(*f)).map(|(_, a)| *a).collect();
    around.sort_by(f64::total_cmp);
    // The floor is what a line at half the mesh frequency must rise above.
    let facts = json!({
        "kind": settled.kind, "period": settled.period, "half": spectrum.at(0.5 * mesh_frequency),
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
