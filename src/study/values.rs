//! Numbers beside those of an independent implementation of the same equations.
//!
//! Each row has the tolerance stated for it. Those of the reference set come from a fixed-step prototype (Runge–Kutta, 5 µs,
//! checked by halving the step), the rows marked *events* from a second one with located events (order 8, relative tolerance
//! 1e-8), statics and the heavy load from linear algebra. Where no tolerance was stated, it is half a unit of the last
//! digit printed (and 0.3 % of forces under light load), or 0.002 for fractions.

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{
    StudyError,
    expression::evaluate,
    figures::{self, Context, by_name},
    plan::Plan,
    threshold::{LossCriterion, ThresholdSearch, locate},
};
use crate::{output::Table, scene::Scene, system::equilibrium, train::TrainError};

/// Runs, with numbers by another implementation.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReferenceRuns {
    title: String,
    note: String,
    runs: Vec<Run>,
}

/// One run, with its rows.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Run {
    scene: String,
    /// Values at JSON pointers of the scene.
    #[serde(default)]
    with: Map<String, Value>,
    measure: Measure,
    /// Rows: quantity, expected value, tolerance, and an expression for Flank's value.
    rows: Vec<(String, f64, f64, String)>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Measure {
    /// Forces at rest, `forces`.
    Rest,
    /// Steady motion of each family of contacts.
    Steady,
    /// Largest `load` at which the meshes of a family leave their flanks, among these loads.
    Threshold { contact: String, loads: [f64; 2] },
    /// Paths of centres, by the name of the gear.
    Paths,
}

impl ReferenceRuns {
    /// Returns all numbers, as a table.
    pub fn compared(&self, context: &Context<'_>, plan: &Plan) -> Result<Table, StudyError> {
        let rows = context.each(&self.runs, |run| {
            let scene = plan.scene(&run.scene)?;
            let scene = scene.with_all(run.with.iter().map(|(pointer, value)| (pointer.as_str(), value.clone())))?;
            let facts = run.measure.facts(context, plan, &scene)?;
            let read = |(quantity, expected, tolerance, expression): &(String, f64, f64, String)| {
                let found = evaluate(expression, &facts).map_err(StudyError::Claim)?.as_f64();
                let found = found.ok_or_else(|| StudyError::Claim(format!("{expression} is no number")))?;
                let holds = (found - expected).abs() <= *tolerance;
                let numbers = [*expected, *tolerance, (found * 1e5).round() / 1e5].map(short);
                let verdict = if holds { "within" } else { "off" };
                let mut cells = vec![quantity.clone()];
                cells.extend(numbers);
                cells.push(verdict.to_owned());
                Ok((holds, cells))
            };
            run.rows.iter().map(read).collect::<Result<Vec<_>, StudyError>>()
        })?;
        let (holds, cells): (Vec<bool>, Vec<Vec<String>>) = rows.into_iter().flatten().unzip();
        let off = holds.iter().filter(|holds| !**holds).count();
        let note = format!("{} numbers, {off} off. {}", holds.len(), self.note);
        let table = Table::new(["Quantity", "Expected", "Tolerance", "Flank", ""]).with(cells);
        Ok(table.titled(&self.title, note))
    }
}

/// Returns a number to six decimals, without zeros at its end.
fn short(number: f64) -> String {
    format!("{number:.6}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl Measure {
    fn facts(&self, context: &Context<'_>, plan: &Plan, scene: &Scene) -> Result<Map<String, Value>, StudyError> {
        let one = |name: &str, value: Value| Map::from_iter([(name.to_owned(), value)]);
        Ok(match self {
            Self::Rest => one("forces", json!(equilibrium(&scene.built().spec).map_err(TrainError::from)?.forces)),
            Self::Steady => {
                let steady = context.steady(scene, None)?;
                let families = figures::families(&steady).into_iter();
                by_name(families.map(|(j, family)| (family, json!(steady.contacts[j]))))
            }
            Self::Threshold { contact, loads } => {
                let search = ThresholdSearch { range: *loads, scan: 13, resolution: (loads[1] - loads[0]) / 3000.0 };
                let found =
                    locate(context, scene, &plan.load(scene)?.pointer, (contact, LossCriterion::Deflection), &search)?;
                one("load", json!(found.middle().unwrap_or(0.0)))
            }
            Self::Paths => {
                let speed = plan.speed(scene)?;
                let own = figures::number(scene, &speed.pointer)?;
                let (_, paths) = figures::trajectories(context, scene, (Some(&speed), &[own]))?;
                by_name(paths.into_iter().map(|path| (path["body"].as_str().unwrap_or_default().to_owned(), path)))
            }
        })
    }
}
