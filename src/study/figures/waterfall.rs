use serde_json::json;

use super::{Context, forces::order, representatives};
use crate::{
    analysis::{Spectrum, Window},
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    study::{Case, StudyError, record::record, steady::settled},
};

const CYCLES: usize = 16;
const PER_CYCLE: u32 = 64;
/// Order lines drawn.
const ORDERS: u32 = 4;

/// One spectrum of each mesh family.
struct Row {
    rpm: f64,
    mesh_frequency: f64,
    spectra: Vec<(String, Spectrum)>,
}

/// Spectra of the mesh forces at several speeds, one line above the other, with order lines and the natural
/// frequencies `natural` (name, Hz) up to `highest`, Hz.
///
/// # Errors
/// [`StudyError`] of the runs.
pub fn waterfall(
    context: &Context<'_>,
    scene: &Scene,
    (pointer, speeds): (&str, &[f64]),
    natural: &[(String, f64)],
    highest: f64,
) -> Result<Figure, StudyError> {
    let rows = context.each(speeds, |&rpm| {
        let case = Case::new(&scene.with(pointer, json!(rpm))?)?;
        let (mut engine, settled, _) = settled(&case, None, &context.rule, context.interrupted)?;
        let cycles = settled.period.map_or(4 * CYCLES, |p| CYCLES.next_multiple_of(p as usize));
        let recording = record(&case, &mut engine, cycles as u64, PER_CYCLE)?;
        let window = if settled.period.is_some() { Window::Rectangular } else { Window::Hann };
        let rate = f64::from(PER_CYCLE) / case.period()?;
        let spectra = representatives(&case)
            .into_iter()
            .map(|(j, family)| (family, Spectrum::new(&recording.force[j], rate, window)))
            .collect();
        (context.done)();
        Ok(Row { rpm, mesh_frequency: 1.0 / case.period()?, spectra })
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
    let mut scales = Vec::new();
    for family in 0..count {
        let up_to = |s: &Spectrum| ((highest / s.resolution) as usize + 1).min(s.amplitude.len());
        let strongest = rows
            .iter()
            .flat_map(|row| row.spectra[family].1.amplitude[1..up_to(&row.spectra[family].1)].iter())
            .fold(0.0, |m: f64, a| m.max(*a));
        // The strongest line reaches over six speeds.
        let scale = if strongest > 0.0 { 6.0 * step / strongest } else { 0.0 };
        let name = &rows[0].spectra[family].0;
        scales.push(format!("{name}: {:.0} N", strongest / 6.0));
        let series = rows
            .iter()
            .map(|row| {
                let spectrum = &row.spectra[family].1;
                let last = up_to(spectrum);
                let y = |k: usize| row.rpm + if k == 0 { 0.0 } else { scale * spectrum.amplitude[k] };
                let x = (0..last).map(|k| k as f64 * spectrum.resolution).collect();
                Series::line("", family, x, (0..last).map(y).collect()).styled(Style::Hairline)
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
        let lines = natural.iter().filter(|(_, hertz)| *hertz <= highest);
        let lines = lines.map(|(name, hertz)| Guide::Vertical { x: *hertz, name: name.clone() });
        figure.panels.push(Panel {
            title: name.clone(),
            x: Axis::new("frequency", "Hz").between(0.0, highest),
            y: Axis::new("speed of the sun, raised by the amplitude", "rev/min"),
            series,
            guides: orders.chain(lines).collect(),
            ..Panel::default()
        });
    }
    figure.caption = format!(
        "Each line is the spectrum at one speed, raised by its amplitude; one speed step stands for {}. Slanted: orders of \
         the mesh frequency; upright: natural frequencies.",
        scales.join(", ")
    );
    Ok(figure)
}
