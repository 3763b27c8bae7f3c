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

impl ThresholdRow {
    /// The load at the threshold, N m: the middle of its bracket; 0 if nothing separates at any load.
    #[must_use]
    pub fn load(&self) -> f64 {
        self.threshold.middle().unwrap_or(0.0)
    }
}

/// The largest load at which the meshes of a family still separate, against speed.
///
/// # Errors
/// [`StudyError`] of the runs.
pub fn threshold(
    context: &Context<'_>,
    scene: &Scene,
    stem: &str,
    speeds: &[f64],
    search: &Search,
) -> Result<(Figure, Vec<ThresholdRow>), StudyError> {
    let (Some(speed), Some(load)) = (speed_pointer(scene), load_pointer(scene)) else {
        return Err(StudyError::Missing {
            name: scene.name().to_owned(),
            missing: "its train has no speed and load in rev/min and N m".to_owned(),
        });
    };
    let rows = context.each(speeds, |&rpm| {
        let scene = scene.with(speed, json!(rpm))?;
        let threshold = locate(context, &scene, load, stem, search)?;
        let drag =
            number(&scene, "/train/load/drag_torque_nm") + rpm * number(&scene, "/train/load/drag_torque_nm_per_rpm");
        Ok(ThresholdRow { rpm, threshold, drag })
    })?;
    let pick = |value: fn(&ThresholdRow) -> f64| rows.iter().map(value).collect::<Vec<_>>();
    let series = vec![
        Series::line("load", 0, speeds.to_vec(), pick(ThresholdRow::load)).styled(Style::Joined),
        Series::line("load and drag", 1, speeds.to_vec(), pick(|row| row.load() + row.drag)).styled(Style::Joined),
    ];
    let beyond = rows.iter().filter(|row| matches!(row.threshold, Threshold::Beyond { .. })).count();
    let figure = Figure {
        id: "threshold-vs-speed".to_owned(),
        title: "Load at which separations end, against speed".to_owned(),
        caption: format!(
            "Largest output torque at which the {stem} meshes still leave their flanks, each found by bisection to {} N m \
             with a cold start at every load; with the drag torque at that speed added. {}",
            search.resolution,
            if beyond > 0 { format!("{beyond} lie beyond the loads searched.") } else { String::new() }
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
