use serde_json::{Map, Value, json};

use super::{Context, by_name, families};
use crate::{
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    scene::Scene,
    study::StudyError,
};

/// First harmonic and extremes of the mesh forces against speed. A bilateral law is valid while the smallest force is
/// positive.
pub fn harmonics(
    context: &Context<'_>,
    scene: &Scene,
    (pointer, speeds): (&str, &[f64]),
) -> Result<(Figure, Map<String, Value>), StudyError> {
    let rows = context.cold(scene, pointer, speeds)?;
    let panel = |title: &str, label: &str| Panel {
        title: title.to_owned(),
        x: Axis::new("speed of the sun", "rev/min"),
        y: Axis::new(label, "N"),
        ..Panel::default()
    };
    let mut panels = [
        panel("First harmonic", "amplitude at the mesh frequency"),
        panel("Range of the force", "largest and smallest force"),
    ];
    let mut facts = vec![("speeds".to_owned(), json!(speeds))];
    for (colour, (j, family)) in rows.first().map(families).unwrap_or_default().into_iter().enumerate() {
        let first: Vec<f64> = rows.iter().map(|row| row.contacts[j].force_harmonics[0]).collect();
        let extreme = |pick: fn(&crate::analysis::ContactReport) -> Option<f64>| -> Vec<f64> {
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
