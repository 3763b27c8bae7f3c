//! Claims of a source about a train, compared with Flank's results.
//!
//! Claims are data: a JSON file lists, figure by figure, numbers and statements. Each has its place in the source, an expression over the
//! measures of the figure, such as `max(sun.range) > 1e-6`, and a note. A number agrees within 5 % and in part within 15 %; a statement
//! agrees if its condition is true.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{
    FigureKind, StudyError,
    expression::{evaluate, fill},
    fit::ClaimKey,
};
pub use crate::plot::Verdict;

/// Row of the table "published, Flank, verdict".
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Comparison {
    /// Figure of the source.
    pub place: String,
    /// Quantity that is compared.
    pub quantity: String,
    /// Published value.
    pub published: String,
    /// Value that Flank finds.
    pub found: String,
    /// Verdict of the comparison.
    pub verdict: Verdict,
    /// True if it was part of the fit that gave the scene its numbers, and is no test of it.
    pub fitted: bool,
    /// Note for quoting it; may be empty.
    pub note: String,
    /// Index among the claims about its figure.
    #[serde(skip)]
    pub number: usize,
    /// Relative difference of a number from the published one, or miss of a statement.
    #[serde(skip)]
    pub off: Option<f64>,
}

/// Largest relative difference at which a number agrees, and at which it agrees in part.
const NEAR: [f64; 2] = [0.05, 0.15];

/// Compares a published number with the one found.
pub(super) fn numbers(place: &str, quantity: &str, (published, found): (f64, f64), unit: &str) -> Comparison {
    let off = (found - published).abs() / published.abs();
    let verdict = match off {
        o if o <= NEAR[0] => Verdict::Agrees,
        o if o <= NEAR[1] => Verdict::Partly,
        _ => Verdict::Deviates,
    };
    let digits = match found.abs() {
        small if small < 1.0 => 3,
        middle if middle < 100.0 => 2,
        _ => 1,
    };
    Comparison {
        place: place.to_owned(),
        quantity: quantity.to_owned(),
        published: format!("{published} {unit}").trim_end().to_owned(),
        found: format!("{found:.digits$} {unit}").trim_end().to_owned(),
        verdict,
        fitted: false,
        note: String::new(),
        number: 0,
        off: Some(off),
    }
}

/// Claims about one figure.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct ClaimGroup {
    /// Expression that is true if the claims about the figure apply.
    when: Option<String>,
    /// Names for expressions, `name = expression`, in order.
    #[serde(rename = "let")]
    names: Vec<String>,
    /// Published points to draw: share of the mesh period without force.
    points: Option<Points>,
    claims: Vec<Claim>,
}

/// Published points of a curve.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Points {
    /// Loads or speeds of the points.
    pub x: Vec<f64>,
    /// Values at these loads or speeds.
    pub y: Vec<f64>,
}

/// Claim of a number (`expected`, `value`, `unit`) or a statement (`published`, `found`, and `agrees`, `partly` or `verdict`).
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Claim {
    place: String,
    quantity: String,
    when: Option<String>,
    expected: Option<f64>,
    unit: String,
    value: String,
    published: String,
    found: Option<String>,
    agrees: Option<String>,
    partly: Option<String>,
    /// Expression for the share by which a false statement is missed, for a fit.
    off: Option<String>,
    verdict: Option<Verdict>,
    /// Condition under which `ambiguous_found` is reported, and agreement is in part.
    ambiguous: Option<String>,
    ambiguous_found: String,
    fitted: bool,
    /// True if it is no part of a fit, and tests it.
    held_out: bool,
    note: String,
}

/// Claims of one source, by figure.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Claims {
    figures: BTreeMap<String, ClaimGroup>,
}

impl Claims {
    /// Reads claims.
    ///
    /// # Errors
    /// [`StudyError::Claim`] for a text that is no list of claims.
    pub fn from_json(text: &str) -> Result<Self, StudyError> {
        serde_json::from_str(text).map_err(|error| StudyError::Claim(error.to_string()))
    }

    /// Returns whether there are no claims.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.figures.is_empty()
    }

    /// Returns the claims about a figure that a fit judges.
    pub(super) fn keys(&self, kind: FigureKind) -> impl Iterator<Item = ClaimKey> {
        let claims = self.figures.get(kind.id()).map(|group| group.claims.as_slice()).unwrap_or_default();
        let judged = claims.iter().enumerate().filter(|(_, claim)| claim.verdict.is_none());
        judged.map(move |(number, claim)| ClaimKey {
            kind,
            number,
            place: claim.place.clone(),
            quantity: claim.name(),
            is_held_out: claim.held_out,
        })
    }

    /// Returns the published points for a figure, if there are any.
    pub(super) fn points(&self, figure: &str) -> Option<&Points> {
        self.figures.get(figure)?.points.as_ref()
    }

    /// Compares the claims about a figure with `facts`, its measures by name.
    ///
    /// # Errors
    /// [`StudyError::Claim`] for a claim that cannot be evaluated.
    pub fn compare(&self, figure: &str, facts: Value) -> Result<Vec<Comparison>, StudyError> {
        let Some(group) = self.figures.get(figure) else { return Ok(Vec::new()) };
        group.compare(facts).map_err(|error| StudyError::Claim(format!("{figure}: {error}")))
    }
}

impl ClaimGroup {
    fn compare(&self, facts: Value) -> Result<Vec<Comparison>, String> {
        let mut names = match facts {
            Value::Object(facts) => facts,
            found => Map::from_iter([("found".to_owned(), found)]),
        };
        if !truth(self.when.as_deref(), &names)?.unwrap_or(true) {
            return Ok(Vec::new());
        }
        for line in &self.names {
            let (name, expression) = line.split_once(" = ").ok_or_else(|| format!("{line}: no name = expression"))?;
            let value = evaluate(expression, &names)?;
            names.insert(name.to_owned(), value);
        }
        let row = |(number, claim): (usize, &Claim)| {
            let row = claim.compare(&names).transpose()?;
            Some(row.map(|row| Comparison { number, ..row }))
        };
        self.claims.iter().enumerate().filter_map(row).collect()
    }
}

impl Claim {
    /// Returns its quantity without values.
    fn name(&self) -> String {
        let parts = self.quantity.split('{').enumerate();
        parts
            .map(|(i, part)| if i == 0 { part } else { part.split_once('}').map_or("", |(_, rest)| rest) })
            .collect::<Vec<_>>()
            .join("…")
    }

    /// Returns the row, or none if the claim does not apply.
    fn compare(&self, names: &Map<String, Value>) -> Result<Option<Comparison>, String> {
        if !truth(self.when.as_deref(), names)?.unwrap_or(true) {
            return Ok(None);
        }
        let quantity = fill(&self.quantity, names)?;
        let mut row = match self.expected {
            Some(expected) => {
                let value =
                    evaluate(&self.value, names)?.as_f64().ok_or_else(|| format!("{} is no number", self.value))?;
                numbers(&self.place, &quantity, (expected, value), &self.unit)
            }
            None => Comparison {
                published: self.published.clone(),
                off: None,
                ..numbers(&self.place, &quantity, (0.0, 0.0), "")
            },
        };
        if let Some(found) = &self.found {
            row.found = fill(found, names)?;
        }
        let holds = |condition: &Option<String>| truth(condition.as_deref(), names);
        if self.expected.is_none() {
            row.verdict = match (holds(&self.agrees)?, holds(&self.partly)?) {
                (Some(true), _) => Verdict::Agrees,
                (_, Some(true)) => Verdict::Partly,
                _ => Verdict::Deviates,
            };
            if let Some(off) = &self.off {
                let missed = evaluate(off, names)?.as_f64().map_or(f64::INFINITY, |off| off.max(0.0));
                row.off = Some(if row.verdict == Verdict::Agrees { 0.0 } else { missed });
            }
        }
        if holds(&self.ambiguous)? == Some(true) {
            row.found = fill(&self.ambiguous_found, names)?;
            row.verdict = if row.verdict == Verdict::Agrees { Verdict::Partly } else { row.verdict };
        }
        row.verdict = self.verdict.unwrap_or(row.verdict);
        Ok(Some(Comparison { fitted: self.fitted, note: fill(&self.note, names)?, ..row }))
    }
}

/// Returns whether a condition is true; none without a condition.
fn truth(condition: Option<&str>, names: &Map<String, Value>) -> Result<Option<bool>, String> {
    let Some(text) = condition else { return Ok(None) };
    let value = evaluate(text, names)?;
    value.as_bool().map(Some).ok_or_else(|| format!("{text} is neither true nor false"))
}
