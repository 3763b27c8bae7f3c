//! The reference set's numbers beside those of an independent implementation.
//!
//! The other values come from a fixed-step prototype of the same equations (Runge–Kutta, 5 µs, checked by halving the
//! step), the rows marked *events* from a second one with located events (order 8, relative tolerance 1e-8), statics and
//! the heavy load from linear algebra. Each row has the tolerance stated for it; where none was, half a unit of the last
//! digit printed (and 0.3 % of forces under light load), or 0.002 for fractions.

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{
    StudyError,
    expression::evaluate,
    figures::{self, Context, by_name, load_pointer, speed_pointer},
    plan::Plan,
    published::table,
    threshold::{By, Search, locate},
};
use crate::{output::Table, scene::Scene, system::equilibrium, train::TrainError};

/// One run and what is read from it.
#[derive(Deserialize)]
struct Run {
    scene: Which,
    /// Values at JSON pointers of the scene.
    #[serde(default)]
    with: Map<String, Value>,
    measure: Measure,
    /// Quantity, expected, tolerance, and an expression for what Flank finds.
    rows: Vec<(String, f64, f64, String)>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Which {
    Heavy,
    Light,
    Floating,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Measure {
    /// `forces` at rest.
    Rest,
    /// The steady motion of each family of contacts.
    Steady,
    /// The `load` up to which the ring's meshes leave their flanks.
    Threshold,
    /// The paths of `sun` and `ring`.
    Paths,
}

const SEARCH: Search = Search { range: [0.0, 60.0], scan: 13, resolution: 0.02 };

/// All numbers, as a table.
pub(super) fn values(context: &Context<'_>, plan: &Plan) -> Result<Table, StudyError> {
    let runs: Vec<Run> = table(include_str!("published/values.json"))?;
    let rows = context.each(&runs, |run| {
        let scene = match run.scene {
            Which::Heavy => &plan.heavy,
            Which::Light => &plan.light,
            Which::Floating => &plan.floating,
        };
        let scene = scene.with_all(run.with.iter().map(|(pointer, value)| (pointer.as_str(), value.clone())))?;
        let facts = run.measure.facts(context, &scene)?;
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
    let note = format!(
        "{} numbers, {} off. Rows that are off belong to motions whose sun meshes never open in the end: which impact \
         of a cold start was their last one hangs on the step of the other implementation, and with it their damping.",
        holds.len(),
        holds.iter().filter(|holds| !**holds).count()
    );
    let table = Table::new(["Quantity", "Expected", "Tolerance", "Flank", ""]).with(cells);
    Ok(table.titled("Numbers beside an independent implementation", note))
}

/// A number to six decimals, without zeros at its end.
fn short(number: f64) -> String {
    format!("{number:.6}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl Measure {
    fn facts(&self, context: &Context<'_>, scene: &Scene) -> Result<Map<String, Value>, StudyError> {
        let one = |name: &str, value: Value| Map::from_iter([(name.to_owned(), value)]);
        let (load, speed) = (load_pointer(scene).unwrap_or_default(), speed_pointer(scene).unwrap_or_default());
        Ok(match self {
            Self::Rest => one("forces", json!(equilibrium(&scene.built().spec).map_err(TrainError::from)?.forces)),
            Self::Steady => {
                let steady = context.steady(scene, None)?;
                let families = figures::families(&steady).into_iter();
                by_name(families.map(|(j, family)| (family, json!(steady.contacts[j]))))
            }
            Self::Threshold => one(
                "load",
                json!(locate(context, scene, load, ("ring", By::Deflection), &SEARCH)?.middle().unwrap_or(0.0)),
            ),
            Self::Paths => {
                let (_, paths) = figures::trajectories(context, scene, (speed, &[figures::number(scene, speed)?]))?;
                by_name(paths.into_iter().map(|path| (path["body"].as_str().unwrap_or_default().to_owned(), path)))
            }
        })
    }
}
