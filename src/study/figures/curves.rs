//! Figures along the values of a load or a speed.

use serde_json::{Map, Value, json};

use super::{Context, Quantity, by_name, families, number};
use crate::{
    analysis::ContactReport,
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    study::{
        StudyError,
        steady::{ContactSteady, Steady},
        threshold::{LossCriterion, Threshold, ThresholdSearch, locate},
    },
};

/// Starts of the points of a curve.
#[derive(Clone, Copy, PartialEq)]
enum StartRule {
    /// Each point from the start of the scene.
    Cold,
    /// Each point from the motion at the next lower value.
    Up,
    /// Each point from the motion at the next higher value.
    Down,
}

/// Every way, with its name and line style.
const WAYS: [(StartRule, &str, Style); 3] = [
    (StartRule::Cold, "cold start", Style::Joined),
    (StartRule::Up, "followed up", Style::Line),
    (StartRule::Down, "followed down", Style::Dashed),
];

/// Returns a measure of the first contact whose name starts with `stem`, along steady motions.
pub(in crate::study) fn along(rows: &[Steady], stem: &str, pick: impl Fn(&ContactSteady) -> f64) -> Vec<f64> {
    rows.iter().filter_map(|row| row.contact(stem)).map(pick).collect()
}

/// Returns the measures along the curves, by start and family.
pub(in crate::study) fn facts(curves: &[Vec<Steady>], values: &[f64]) -> Value {
    let mut facts = Map::from_iter([("values".to_owned(), json!(values))]);
    for (i, way) in ["cold", "up", "down"].into_iter().enumerate() {
        // A way that was not computed has no rows.
        let rows = curves.get(i).map(Vec::as_slice).unwrap_or_default();
        let measured = curves[0].first().map(families).unwrap_or_default().into_iter().map(|(_, family)| {
            let measures = json!({
                "no_force": along(rows, &family, |c| c.report.no_force_fraction),
                "separated": along(rows, &family, |c| c.report.apart_fraction),
                "amplitude": along(rows, &family, |c| c.force_amplitude),
            });
            (family, measures)
        });
        facts.insert(way.to_owned(), by_name(measured).into());
    }
    facts.into()
}

/// Returns the title of the panel of a family's time without force; only families that open have one.
pub fn fraction_title(family: &str) -> String {
    format!("{family}: time without force")
}

/// Draws time without force and force amplitude against a number, started in three ways, which shows coexisting branches; `cold` restricts
/// it to the first way. Returns the steady motions of cold starts, followed up and followed down.
pub fn apart(
    context: &Context<'_>,
    scene: &Scene,
    (id, cold): (&str, bool),
    (Quantity { pointer, axis: x }, values): (&Quantity, &[f64]),
) -> Result<(Figure, Vec<Vec<Steady>>), StudyError> {
    let force = if scene.built().dimensionless { "" } else { "N" };
    let curves = context.each(&WAYS[..if cold { 1 } else { WAYS.len() }], |&(way, ..)| match way {
        StartRule::Cold => context.cold(scene, pointer, values),
        StartRule::Up => context.followed(scene, pointer, values.iter().copied()),
        StartRule::Down => {
            let mut rows = context.followed(scene, pointer, values.iter().rev().copied())?;
            rows.reverse();
            Ok(rows)
        }
    })?;
    let mut figure = Figure {
        id: id.to_owned(),
        title: format!("Time without force and force amplitude against {}", x.label),
        columns: 2,
        ..Figure::default()
    };
    let (mut closed, mut rest) = (Vec::new(), Vec::new());
    for (_, family) in curves[0].first().map(families).unwrap_or_default() {
        let panel = |title: String, y: Axis| Panel { title, x: x.clone(), y, ..Panel::default() };
        let mut fraction = panel(fraction_title(&family), Axis::new("share of the time", ""));
        let mut amplitude = panel(format!("{family}: force amplitude"), Axis::new("half of the force's range", force));
        for (rows, (way, name, style)) in curves.iter().zip(WAYS) {
            let series = |y: Vec<f64>| Series::line(name, way as usize, values.to_vec(), y).styled(style);
            fraction.series.push(series(along(rows, &family, |c| c.report.no_force_fraction)));
            amplitude.series.push(series(along(rows, &family, |c| c.force_amplitude)));
        }
        let flight = along(&curves[0], &family, |c| c.report.apart_fraction);
        let flight = Series::line("between the flanks, cold start", 7, values.to_vec(), flight);
        fraction.series.push(flight.styled(Style::Hairline));
        let highest = fraction.series.iter().flat_map(|series| &series.y).fold(0.0, |m: f64, y| m.max(*y));
        fraction.y = fraction.y.between(0.0, f64::max(1.1 * highest, 0.1));
        // A family that never opens has no curve.
        if highest > 0.0 {
            figure.panels.extend([fraction, amplitude]);
        } else {
            closed.push(family);
            rest.push(amplitude);
        }
    }
    let irregular = curves.iter().flatten().filter(|row| row.motion.period.is_none()).count();
    figure.panels.append(&mut rest);
    let never = match closed.len() {
        0 => String::new(),
        _ => format!(" Never without force: {}.", closed.join(", ")),
    };
    figure.caption = format!(
        "Points: each motion from the scene's own start; lines: each takes up the motion before it, along rising and falling \
         values. Where they differ, several motions exist side by side, and a jump is a change from one to another. {irregular} of {} motions are not periodic.{never}",
        curves.len() * values.len()
    );
    Ok((figure, curves))
}

/// Draws first harmonic and extremes of the mesh forces against speed. A bilateral law is valid while the smallest force is positive.
/// positive.
pub fn harmonics(
    context: &Context<'_>,
    scene: &Scene,
    (Quantity { pointer, axis }, speeds): (&Quantity, &[f64]),
) -> Result<(Figure, Map<String, Value>), StudyError> {
    let force = if scene.built().dimensionless { "" } else { "N" };
    let rows = context.cold(scene, pointer, speeds)?;
    let panel = |title: &str, label: &str| Panel {
        title: title.to_owned(),
        x: axis.clone(),
        y: Axis::new(label, force),
        ..Panel::default()
    };
    let mut panels = [
        panel("First harmonic", "amplitude at the frequency of the cycle"),
        panel("Range of the force", "largest and smallest force"),
    ];
    let mut facts = vec![("speeds".to_owned(), json!(speeds))];
    for (colour, (j, family)) in rows.first().map(families).unwrap_or_default().into_iter().enumerate() {
        let first: Vec<f64> = rows.iter().map(|row| row.contacts[j].force_harmonics[0]).collect();
        let extreme = |pick: fn(&ContactReport) -> Option<f64>| -> Vec<f64> {
            rows.iter().map(|row| pick(&row.contacts[j].report).unwrap_or_default()).collect()
        };
        let (largest, smallest) = (extreme(|r| r.force_max), extreme(|r| r.force_min));
        panels[0].series.push(Series::line(&family, colour, speeds.to_vec(), first.clone()));
        panels[1].series.push(Series::line(format!("{family}, largest"), colour, speeds.to_vec(), largest));
        let low = Series::line(format!("{family}, smallest"), colour, speeds.to_vec(), smallest.clone());
        panels[1].series.push(low.styled(Style::Dashed));
        facts.push((family, json!({ "first": first, "smallest": smallest })));
    }
    panels[1].guides.push(Guide::Horizontal { y: 0.0, name: "below: the law pulls".to_owned() });
    let figure = Figure {
        id: "harmonics-vs-speed".to_owned(),
        title: "Mesh forces against speed".to_owned(),
        caption: "First harmonic of the mesh forces, and their extremes: where the smallest force falls below zero, a \
                  bilateral law pulls and is no longer valid."
            .to_owned(),
        columns: 2,
        panels: panels.into(),
    };
    Ok((figure, by_name(facts)))
}

/// Draws the largest load at which the meshes of a family still leave their flanks, against speed; returns the loads with their speeds.
pub fn threshold(
    context: &Context<'_>,
    scene: &Scene,
    stem: &str,
    ([load, speed], speeds): (&[Quantity; 2], &[f64]),
    search: &ThresholdSearch,
) -> Result<(Figure, Value), StudyError> {
    let drag = |scene: &Scene, key: &str| number(scene, &format!("/train/load/{key}")).unwrap_or(0.0);
    let rows = context.each(speeds, |&rpm| {
        let scene = scene.with(&speed.pointer, json!(rpm))?;
        let threshold = locate(context, &scene, &load.pointer, (stem, LossCriterion::Deflection), search)?;
        Ok((rpm, threshold, drag(&scene, "drag_torque_nm") + rpm * drag(&scene, "drag_torque_nm_per_rpm")))
    })?;
    let located = || rows.iter().filter_map(|(rpm, threshold, drag)| Some((*rpm, threshold.located()?, *drag)));
    let (speeds, loads): (Vec<f64>, Vec<f64>) = located().map(|(rpm, load, _)| (rpm, load)).unzip();
    let with_drag: Vec<f64> = located().map(|(_, load, drag)| load + drag).collect();
    let has_drag = with_drag != loads;
    let facts = json!({ "speeds": speeds, "loads": loads });
    let line = |name: &str, colour, y| Series::line(name, colour, speeds.clone(), y).styled(Style::Joined);
    let mut series = vec![line("load", 0, loads)];
    series.extend(has_drag.then(|| line("load and drag", 1, with_drag)));
    let count = |wanted: fn(&Threshold) -> bool| rows.iter().filter(|(_, threshold, _)| wanted(threshold)).count();
    let beyond = count(|threshold| matches!(threshold, Threshold::Beyond { .. }));
    let none = count(|threshold| matches!(threshold, Threshold::None));
    let figure = Figure {
        id: "threshold-vs-speed".to_owned(),
        title: "Threshold load (by deflection) against speed".to_owned(),
        caption: format!(
            "Largest {} at which {stem} still leaves its flank, found by bisection to {} {} with a cold start at every load{}. \
             Not drawn: {beyond} speeds whose threshold lies beyond the loads searched, {none} at which the flank is never left.",
            load.axis.label,
            search.resolution,
            load.axis.unit,
            if has_drag { "; with the drag torque at that speed added" } else { "" },
        ),
        columns: 1,
        panels: vec![Panel { x: speed.axis.clone(), y: load.axis.clone(), series, ..Panel::default() }],
    };
    Ok((figure, facts))
}
