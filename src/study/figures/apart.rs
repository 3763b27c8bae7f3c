use serde_json::{Map, Value, json};

use super::{Context, by_name, families};
use crate::{
    plot::{Axis, Figure, Panel, Series, Style},
    scene::Scene,
    study::{
        StudyError,
        steady::{ContactSteady, Steady},
    },
};

/// How the points of a curve were started.
#[derive(Clone, Copy, PartialEq)]
pub enum Way {
    /// Each from the scene's own start.
    Cold,
    /// Each from the motion at the next lower value.
    Up,
    /// Each from the motion at the next higher value.
    Down,
}

/// Every way, how it is named and how it is drawn.
const WAYS: [(Way, &str, Style); 3] = [
    (Way::Cold, "cold start", Style::Joined),
    (Way::Up, "followed up", Style::Line),
    (Way::Down, "followed down", Style::Dashed),
];

/// Measures of one family of meshes along the values of a number.
pub struct Curve {
    /// How it was started.
    pub way: Way,
    /// Steady motions.
    pub rows: Vec<Steady>,
}

impl Curve {
    /// A measure of the first contact whose name starts with `stem`, at each value.
    pub fn measure(&self, stem: &str, pick: impl Fn(&ContactSteady) -> f64) -> Vec<f64> {
        self.rows.iter().filter_map(|row| row.contact(stem)).map(pick).collect()
    }
}

/// What was measured along the curves, by start and family.
pub(in crate::study) fn facts(curves: &[Curve], values: &[f64]) -> Value {
    let mut facts = Map::from_iter([("values".to_owned(), json!(values))]);
    for (way, curve) in ["cold", "up", "down"].into_iter().zip(curves) {
        let measured = curve.rows.first().map(families).unwrap_or_default().into_iter().map(|(_, family)| {
            let measures = json!({
                "no_force": curve.measure(&family, |c| c.report.no_force_fraction),
                "separated": curve.measure(&family, |c| c.report.apart_fraction),
                "amplitude": curve.measure(&family, |c| c.force_amplitude),
            });
            (family, measures)
        });
        facts.insert(way.to_owned(), by_name(measured).into());
    }
    facts.into()
}

/// Title of the panel of a family's time without force, which is there only if the family ever opens.
pub fn fraction_title(family: &str) -> String {
    format!("{family}: time without force")
}

/// Time apart and force amplitude against the number at `pointer`, started in three ways so that branches which exist side by
/// side show.
pub fn apart(
    context: &Context<'_>,
    scene: &Scene,
    id: &str,
    x: Axis,
    (pointer, values): (&str, &[f64]),
) -> Result<(Figure, Vec<Curve>), StudyError> {
    let curves = context.each(&WAYS, |&(way, ..)| {
        let rows = match way {
            Way::Cold => context.cold(scene, pointer, values)?,
            Way::Up => context.followed(scene, pointer, values.iter().copied())?,
            Way::Down => {
                let mut rows = context.followed(scene, pointer, values.iter().rev().copied())?;
                rows.reverse();
                rows
            }
        };
        Ok(Curve { way, rows })
    })?;
    let mut figure = Figure {
        id: id.to_owned(),
        title: format!("Time apart and force amplitude against {}", x.label),
        columns: 2,
        ..Figure::default()
    };
    let (mut closed, mut rest) = (Vec::new(), Vec::new());
    for (_, family) in curves[0].rows.first().map(families).unwrap_or_default() {
        let panel = |title: String, y: Axis| Panel { title, x: x.clone(), y, ..Panel::default() };
        let mut fraction = panel(fraction_title(&family), Axis::new("share of the mesh period", ""));
        let mut amplitude = panel(format!("{family}: force amplitude"), Axis::new("half of the force's range", "N"));
        for (curve, (way, name, style)) in curves.iter().zip(WAYS) {
            let series = |y: Vec<f64>| Series::line(name, way as usize, values.to_vec(), y).styled(style);
            fraction.series.push(series(curve.measure(&family, |c| c.report.no_force_fraction)));
            amplitude.series.push(series(curve.measure(&family, |c| c.force_amplitude)));
        }
        let flight = curves[0].measure(&family, |c| c.report.apart_fraction);
        let flight = Series::line("between the flanks, cold start", 7, values.to_vec(), flight);
        fraction.series.push(flight.styled(Style::Hairline));
        let highest = fraction.series.iter().flat_map(|series| &series.y).fold(0.0, |m: f64, y| m.max(*y));
        fraction.y = fraction.y.between(0.0, f64::max(1.1 * highest, 0.1));
        // A family that never opens has no curve worth looking at.
        if highest > 0.0 {
            figure.panels.extend([fraction, amplitude]);
        } else {
            closed.push(family);
            rest.push(amplitude);
        }
    }
    let irregular = curves.iter().flat_map(|curve| &curve.rows).filter(|row| row.settled.period.is_none()).count();
    figure.panels.append(&mut rest);
    let never = match closed.len() {
        0 => String::new(),
        _ => format!(" Never without force: {}.", closed.join(", ")),
    };
    figure.caption = format!(
        "Points: each motion from the scene's own start; lines: each takes up the motion before it, along rising and falling \
         values. Where they differ, several motions exist side by side, and a jump is a change from one to another. {irregular} of {} motions are not periodic.{never}",
        3 * values.len()
    );
    Ok((figure, curves))
}
