//! Numbers of scenes that follow from published values.

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{
    StudyError,
    expression::fill,
    identify::{Identification, Parameter, Target, identify},
};
use crate::{output::Table, scene::Scene, task::Task};

/// Numbers of a scene, and the values from which they are sought.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    /// Name of the scene.
    scene: String,
    /// Each number in words, and in the form of `flank identify`.
    vary: Vec<(String, String)>,
    targets: Vec<String>,
}

/// Questions whose answers a table lists.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Questions {
    title: String,
    /// Words below the table, with expressions over the results of `all`.
    note: String,
    /// Questions with one answer each, compared with the scene.
    questions: Vec<Question>,
    /// Question of all open numbers from all values.
    all: Question,
}

impl Question {
    fn answer(&self, scene: &Scene, task: Task<'_>) -> Result<Identification, StudyError> {
        let parameters =
            self.vary.iter().map(|(_, number)| number.parse::<Parameter>()).collect::<Result<Vec<_>, _>>()?;
        let targets = self.targets.iter().map(|target| target.parse::<Target>()).collect::<Result<Vec<_>, _>>()?;
        identify(scene, &parameters, &targets, task)
    }
}

impl Questions {
    /// Returns the numbers of the scenes beside those that the values give back, with residuals.
    pub fn identified<'s>(
        &self,
        scene: impl Fn(&str) -> Result<&'s Scene, StudyError>,
        task: Task<'_>,
    ) -> Result<Table, StudyError> {
        let mut rows = Vec::new();
        for question in &self.questions {
            let scene = scene(&question.scene)?;
            let answer = question.answer(scene, task)?;
            let residuals = answer.targets.iter();
            let residuals: Vec<String> =
                residuals.map(|t| format!("{} {} {} got {:.2}", t.quantity, t.wanted, t.unit, t.got)).collect();
            let unique = match (answer.uniqueness.is_unique(), answer.solutions.len()) {
                (false, _) => "not unique".to_owned(),
                (true, 1) => "unique within the bounds".to_owned(),
                (true, n) => {
                    let other = answer.solutions[1].values.iter().map(|v| format!("{v:.2e}")).collect::<Vec<_>>();
                    format!("{n} solutions; another: {}", other.join(", "))
                }
            };
            for ((words, _), found) in question.vary.iter().zip(&answer.parameters) {
                rows.push(vec![
                    format!("{words}, {}", scene.name()),
                    format!("{:e}", found.own),
                    format!("{:.4e}", found.found),
                    format!("{:+.2}", 100.0 * (found.found / found.own - 1.0)),
                    residuals.join(", "),
                    unique.clone(),
                ]);
            }
        }
        let all = self.all.answer(scene(&self.all.scene)?, task)?;
        let words = all.uniqueness.to_string().to_lowercase();
        let off = all.targets.iter().map(|t| t.relative_residual.unwrap_or(0.0).abs()).fold(0.0, f64::max);
        let names = Map::from_iter([
            ("answer".to_owned(), Value::from(words.split([':', '.']).next().unwrap_or_default())),
            ("unknowns".to_owned(), json!(all.uniqueness.unknowns)),
            ("targets".to_owned(), json!(all.uniqueness.targets)),
            ("free".to_owned(), json!(all.uniqueness.free.len())),
            ("off".to_owned(), json!(off)),
        ]);
        let note = fill(&self.note, &names).map_err(StudyError::Claim)?;
        let head = ["Number", "In the scene, SI units", "Found", "Off, %", "From these values", "Uniqueness"];
        Ok(Table::new(head).with(rows).titled(&self.title, note))
    }
}
