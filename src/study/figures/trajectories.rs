use serde_json::{Value, json};

use super::{Context, maxima, number};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Figure, Panel, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::StudyError,
    train::frame::to_fixed,
};

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
        let turn = number(&scene, "/train/teeth/ring") as u64;
        let (recording, settled) = context.recorded(&simulation, PER_CYCLE, |_| turn)?;
        let window = settled.window();
        let mut found = Vec::new();
        for (body, x, y) in bodies {
            let points = recording.t.iter().zip(recording.x[x].iter().zip(&recording.x[y]));
            let path: Vec<[f64; 2]> = points.map(|(t, (x, y))| to_fixed([*x, *y], speed * t)).collect();
            let radius: Vec<f64> = path.iter().map(|p| p[0].hypot(p[1])).collect();
            let spectrum = Spectrum::new(&recording.x[x], f64::from(PER_CYCLE), window);
            let leaves = settled.period.map(|period| (period, maxima(&radius)));
            let kind =
                leaves.map_or("no period".to_owned(), |(period, leaves)| format!("period {period}, {leaves} leaves"));
            let facts = json!({
                "body": body, "rpm": rpm, "period": settled.period, "leaves": leaves.map(|(_, leaves)| leaves),
                "range": radius.iter().copied().fold(0.0, f64::max), "residual": residual(&recording.x[x]),
                "off_harmonics": spectrum.off_multiples(1.0),
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
