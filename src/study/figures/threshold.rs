use serde_json::json;

use super::{Context, load_pointer, number, speed_pointer};
use crate::{
    plot::{Axis, Figure, Panel, Series, Style},
    scene::Scene,
    study::{
        StudyError,
        threshold::{Search, Threshold, locate},
    },
};

/// The threshold at one speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThresholdRow {
    /// Speed, rev/min.
    pub rpm: f64,
    /// Where the separations end, N m.
    pub threshold: Threshold,
    /// Drag torque at that speed, N m.
    pub drag: f64,
}

/// The largest load at which the meshes of a family still separate, against speed.
pub fn threshold(
    context: &Context<'_>,
    scene: &Scene,
    stem: &str,
    speeds: &[f64],
    search: &Search,
) -> Result<(Figure, Vec<ThresholdRow>), StudyError> {
    let (Some(speed), Some(load)) = (speed_pointer(scene), load_pointer(scene)) else {
        return Err(StudyError::missing(scene.name(), "its train has no speed and load in rev/min and N m"));
    };
    let rows = context.each(speeds, |&rpm| {
        let scene = scene.with(speed, json!(rpm))?;
        let threshold = locate(context, &scene, load, stem, search)?;
        let drag =
            number(&scene, "/train/load/drag_torque_nm") + rpm * number(&scene, "/train/load/drag_torque_nm_per_rpm");
        Ok(ThresholdRow { rpm, threshold, drag })
    })?;
    let points = |value: &dyn Fn(&ThresholdRow, f64) -> f64| -> (Vec<f64>, Vec<f64>) {
        rows.iter().filter_map(|row| Some((row.rpm, value(row, row.threshold.located()?)))).unzip()
    };
    let line = |name: &str, colour, (x, y)| Series::line(name, colour, x, y).styled(Style::Joined);
    let series =
        vec![line("load", 0, points(&|_, load| load)), line("load and drag", 1, points(&|row, load| load + row.drag))];
    let count = |wanted: fn(&Threshold) -> bool| rows.iter().filter(|row| wanted(&row.threshold)).count();
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
    Ok((figure, rows))
}
