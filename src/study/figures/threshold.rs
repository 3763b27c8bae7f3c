use serde_json::{Value, json};

use super::{Context, load_pointer, number, speed_pointer};
use crate::{
    plot::{Axis, Figure, Panel, Series, Style},
    scene::Scene,
    study::{
        StudyError,
        threshold::{Search, Threshold, locate},
    },
};

/// The largest load at which the meshes of a family still separate, against speed; the loads located, with their speeds.
pub fn threshold(
    context: &Context<'_>,
    scene: &Scene,
    stem: &str,
    speeds: &[f64],
    search: &Search,
) -> Result<(Figure, Value), StudyError> {
    let (Some(speed), Some(load)) = (speed_pointer(scene), load_pointer(scene)) else {
        return Err(StudyError::missing(scene.name(), "its train has no speed and load in rev/min and N m"));
    };
    let rows = context.each(speeds, |&rpm| {
        let scene = scene.with(speed, json!(rpm))?;
        let threshold = locate(context, &scene, load, stem, search)?;
        let drag =
            number(&scene, "/train/load/drag_torque_nm") + rpm * number(&scene, "/train/load/drag_torque_nm_per_rpm");
        Ok((rpm, threshold, drag))
    })?;
    let located = || rows.iter().filter_map(|(rpm, threshold, drag)| Some((*rpm, threshold.located()?, *drag)));
    let (speeds, loads): (Vec<f64>, Vec<f64>) = located().map(|(rpm, load, _)| (rpm, load)).unzip();
    let with_drag = located().map(|(_, load, drag)| load + drag).collect();
    let facts = json!({ "speeds": speeds, "loads": loads });
    let line = |name: &str, colour, y| Series::line(name, colour, speeds.clone(), y).styled(Style::Joined);
    let series = vec![line("load", 0, loads), line("load and drag", 1, with_drag)];
    let count = |wanted: fn(&Threshold) -> bool| rows.iter().filter(|(_, threshold, _)| wanted(threshold)).count();
    let beyond = count(|threshold| matches!(threshold, Threshold::Beyond { .. }));
    let none = count(|threshold| matches!(threshold, Threshold::None));
    let figure = Figure {
        id: "threshold-vs-speed".to_owned(),
        title: "Load at which separations end, against speed".to_owned(),
        caption: format!(
            "Largest output torque at which the {stem} meshes still leave their flanks, each found by bisection to {} N m \
             with a cold start at every load; with the drag torque at that speed added. Not drawn: {beyond} speeds whose \
             threshold lies beyond the loads searched, {none} without separations.",
            search.resolution
        ),
        columns: 1,
        panels: vec![Panel {
            x: Axis::new("speed of the sun", "rev/min"),
            y: Axis::new("torque at the output", "N m"),
            series,
            ..Panel::default()
        }],
    };
    Ok((figure, facts))
}
