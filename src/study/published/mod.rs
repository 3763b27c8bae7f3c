//! The published study of the reference set, as data: [claims](super::claims) about its figures, questions for an
//! identification, values of an independent implementation, and changes to try, each a JSON file beside this one.

use serde::Deserialize;
use serde_json::json;

use super::{
    StudyError,
    identify::{Identification, Parameter, Target, identify},
};
use crate::{output::Table, scene::Scene, task::Task};

/// Reads one of the tables beside this file.
pub(super) fn table<T: for<'de> Deserialize<'de>>(text: &str) -> Result<T, StudyError> {
    serde_json::from_str(text).map_err(|error| StudyError::Claim(error.to_string()))
}

/// Which numbers of a preset, from which printed values.
#[derive(Deserialize)]
struct Question {
    preset: String,
    /// Each number in words, and as `flank identify` reads it.
    vary: Vec<(String, String)>,
    targets: Vec<String>,
}

#[derive(Deserialize)]
struct Questions {
    /// Each has one answer, compared with the preset.
    questions: Vec<Question>,
    /// All open numbers from all that is printed.
    all: Question,
}

impl Question {
    fn answer(&self, task: Task<'_>) -> Result<Identification, StudyError> {
        let train = json!({ "kind": "planetary", "preset": self.preset, "load": { "output_torque_nm": 500 } });
        let scene = Scene::from_value(json!({ "flank": 1, "train": train, "run": { "t_end_s": 1 } }), &self.preset)?;
        let parameters =
            self.vary.iter().map(|(_, number)| number.parse::<Parameter>()).collect::<Result<Vec<_>, _>>()?;
        let targets = self.targets.iter().map(|target| target.parse::<Target>()).collect::<Result<Vec<_>, _>>()?;
        identify(&scene, &parameters, &targets, task)
    }
}

/// The identified numbers: the preset's, and those that the printed values give back, with residuals. The source prints none of them.
pub(super) fn identified(task: Task<'_>) -> Result<Table, StudyError> {
    let Questions { questions, all } = table(include_str!("identified.json"))?;
    let mut rows = Vec::new();
    for question in &questions {
        let answer = question.answer(task)?;
        let residuals: Vec<String> =
            answer.targets.iter().map(|t| format!("{} {} {} got {:.2}", t.quantity, t.wanted, t.unit, t.got)).collect();
        let unique = match (answer.uniqueness.is_unique(), answer.solutions.len()) {
            (false, _) => "not unique".to_owned(),
            (true, 1) => "unique within the bounds".to_owned(),
            (true, n) => {
                let other = answer.solutions[1].values.iter().map(|v| format!("{v:.2e}")).collect::<Vec<_>>();
                format!("{n} solutions; another: {} N/m", other.join(", "))
            }
        };
        for ((words, _), found) in question.vary.iter().zip(&answer.parameters) {
            rows.push(vec![
                format!("{words}, {}", question.preset),
                format!("{:e}", found.own),
                format!("{:.4e}", found.found),
                format!("{:+.2}", 100.0 * (found.found / found.own - 1.0)),
                residuals.join(", "),
                unique.clone(),
            ]);
        }
    }
    let all = all.answer(task)?;
    let words = all.uniqueness.to_string().to_lowercase();
    let first = words.split([':', '.']).next().unwrap_or_default();
    let off = all.targets.iter().map(|t| 100.0 * t.relative_residual.unwrap_or(0.0).abs()).fold(0.0, f64::max);
    let note = format!(
        "The source prints none of these numbers; the presets were identified once, from all printed values together. Asked for all nine \
         open numbers, five frequencies and one force answer {first}: {} numbers from {} targets, {} free directions, largest residual \
         {off:.1} %. The bearing and a nearly free sun are what every fit has in common.",
        all.uniqueness.unknowns,
        all.uniqueness.targets,
        all.uniqueness.free.len()
    );
    let head = ["Number", "Preset, N/m", "Found, N/m", "Off, %", "From printed values", "Uniqueness"];
    Ok(Table::new(head).with(rows).titled("Identified numbers, found again from printed values", note))
}
