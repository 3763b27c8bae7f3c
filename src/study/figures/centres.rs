//! Motions of the centres: paths, displacements and their spectra.

use serde_json::{Value, json};

use super::{Context, Quantity, Units, lines, maxima};
use crate::{
    analysis::Spectrum,
    plot::{Axis, Band, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    simulation::Simulation,
    study::{StudyError, steady},
    train::{GearDrawing, frame::to_fixed},
};

/// Samples of a path in a mesh period.
pub(super) const PER_CYCLE: u32 = 128;
/// Maximum number of paths beside each other.
const MOST_COLUMNS: usize = 4;
/// Approximate mesh periods of paths in a frame at rest.
const SHOWN: u64 = 16;

/// Draws the paths of the centres of gears in the fixed frame: with a carrier, of those on its axis over one turn of it; else of all over
/// some mesh periods. A train whose centres do not move has none. The facts are in m; spectrum and `x(t + T) − x(t)` are in the frame of
/// the scene.
pub fn trajectories(
    context: &Context<'_>,
    scene: &Scene,
    (speed, speeds): (Option<&Quantity>, &[f64]),
) -> Result<(Figure, Vec<Value>), StudyError> {
    let speeds: Vec<Option<f64>> =
        if speeds.is_empty() { vec![None] } else { speeds.iter().map(|v| Some(*v)).collect() };
    let has_carrier = scene.built().carrier_speed.is_some();
    let columns = context.each(&speeds, |value| {
        let scene = match (speed, value) {
            (Some(speed), Some(value)) => scene.with(&speed.pointer, json!(value))?,
            _ => scene.clone(),
        };
        let simulation = Simulation::from_scene(&scene)?;
        let carrier = simulation.carrier_speed;
        let moves = |gear: &&GearDrawing| {
            let is_on_axis = gear.centre == [0.0; 2] && gear.teeth > 0;
            (carrier.is_none() || is_on_axis) && gear.motion[..2].iter().flatten().any(|part| *part != 0.0)
        };
        let gears: Vec<&GearDrawing> =
            simulation.drawing.iter().flat_map(|drawing| &drawing.gears).filter(moves).collect();
        if gears.is_empty() {
            return Err(simulation.missing("the centres of its gears do not move").into());
        }
        // The carrier turns once while the teeth of the ring pass.
        let ring = simulation.drawing.iter().flat_map(|drawing| &drawing.gears).find(|gear| gear.is_ring);
        let turn = carrier.and(ring).map(|ring| u64::from(ring.teeth));
        let cycles = |period: Option<u64>| turn.unwrap_or_else(|| SHOWN.next_multiple_of(period.unwrap_or(1)));
        let (recording, settled) = context.recorded(&simulation, (PER_CYCLE, true), cycles)?;
        let mut found = Vec::new();
        for gear in gears {
            let along = |row: &[f64]| -> Vec<f64> {
                let value = |i: usize| row.iter().zip(&recording.x).map(|(r, x)| r * x[i]).sum();
                (0..recording.t.len()).map(value).collect()
            };
            let [x, y] = [0, 1].map(|i| along(&gear.motion[i]));
            let points = recording.t.iter().zip(x.iter().zip(&y));
            let turned = |t: &f64| carrier.unwrap_or(0.0) * t;
            let path: Vec<[f64; 2]> = points.map(|(t, (x, y))| to_fixed([*x, *y], turned(t))).collect();
            let radius: Vec<f64> = path.iter().map(|p| libm::hypot(p[0], p[1])).collect();
            let leaves = settled.period.map(|period| (period, maxima(&radius)));
            let kind = match leaves {
                Some((period, leaves)) if has_carrier => format!("period {period}, {leaves} leaves"),
                Some((period, _)) => format!("period {period}"),
                None => settled.kind.word().to_owned(),
            };
            let facts = json!({
                "body": gear.name, "rpm": value, "kind": settled.kind, "period": settled.period,
                "leaves": leaves.map(|(_, leaves)| leaves), "range": radius.iter().copied().fold(0.0, f64::max),
                "residual": residual(&x),
            });
            let (px, py) = path.iter().map(|p| (1e6 * p[0], 1e6 * p[1])).unzip();
            let at = value.zip(speed).map_or(String::new(), |(value, speed)| format!(", {value} {}", speed.axis.unit));
            let panel = Panel {
                title: format!("{}{at}: {kind}", gear.name),
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
    let (over, counted) = if has_carrier {
        (
            " over one turn of the carrier",
            " Leaves of a periodic path are the maxima of the distance from the centre, counted on 128 samples a mesh period.",
        )
    } else {
        ("", "")
    };
    let bodies = columns.iter().map(Vec::len).min().unwrap_or(0);
    let mut figure = Figure {
        id: "trajectories".to_owned(),
        title: format!("Paths of the centres{over}"),
        caption: format!("Fixed frame.{counted}"),
        columns: if speeds.len() > 1 { speeds.len() } else { bodies.min(MOST_COLUMNS) },
        ..Figure::default()
    };
    let mut found = Vec::new();
    for body in 0..bodies {
        for column in &columns {
            let (panel, facts) = column[body].clone();
            figure.panels.push(panel);
            found.push(facts);
        }
    }
    Ok((figure, found))
}

/// Returns the root mean square of `x(t + T) − x(t)` over that of x less its mean.
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

/// Draws the displacement of one freedom over time and its spectrum around half the mesh frequency.
pub fn history(context: &Context<'_>, scene: &Scene, freedom: &str) -> Result<(Figure, Value), StudyError> {
    const CYCLES: u64 = 384;
    const SHOWN: usize = 24;
    const PER_CYCLE: u32 = 32;
    /// Range of a subharmonic of order 1/2, mesh frequencies.
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
    // A line at half the mesh frequency must rise above the floor.
    let facts = json!({
        "kind": settled.kind, "period": settled.period, "half": spectrum.at(0.5 * mesh_frequency),
        "floor": around.get(around.len() / 2).copied().unwrap_or(0.0),
    });
    let span = recording.x[row].iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(*x), b.max(*x)]);
    let units = Units::of(&simulation).fit(0.0, span[1] - span[0]);
    let of = simulation.in_words(freedom);
    let shown = SHOWN * PER_CYCLE as usize + 1;
    let shown = recording.t.iter().zip(&recording.x[row]).take(shown);
    let (t, x): (Vec<f64>, Vec<f64>) = shown.map(|(t, x)| (units.time.0 * t, units.length.0 * x)).unzip();
    let (f, a) = bins.into_iter().map(|(f, a)| (f, units.length.0 * a)).unzip();
    let figure = Figure {
        id: "history".to_owned(),
        title: format!("Spectrum of a motion: {of}"),
        caption: format!(
            "{SHOWN} of {CYCLES} mesh periods{}; spectrum over all of them ({}). Shaded: where a subharmonic of \
             order 1/2 would stand.",
            if simulation.carrier_speed.is_some() { ", carrier frame" } else { "" },
            if settled.period.is_some() { "no window: the motion is periodic" } else { "Hann window" }
        ),
        columns: 2,
        panels: vec![
            Panel {
                x: Axis::new("time", units.time.1),
                y: Axis::new(of, units.length.1),
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
