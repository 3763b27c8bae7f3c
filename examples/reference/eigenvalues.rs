//! Natural frequencies of the planetary stage of Lin and Parker, with the type of each mode.

use flank::{
    linalg::{Modes, multiplicities},
    train::{Freedoms, bonded_modes, planetary::presets},
};
use serde_json::{Value, json};

use super::Outcome;

/// Frequencies closer than this, relative, are one: about the rounding of the lowest ones.
const SAME: f64 = 1e-9;

/// One row a frequency, rising.
pub fn table(case: &Value) -> Outcome<Vec<Value>> {
    let text = case["description"].as_str().unwrap_or_default();
    let (_, rest) = text.split_once("N=").ok_or("the description names no number of planets N=…")?;
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    let spec = presets::lin_parker(digits.parse()?).assemble(&Freedoms::FullCarrier)?;
    let modes = bonded_modes(&spec)?;
    let mut first = 0;
    let mut rows = Vec::new();
    for (_, multiplicity) in multiplicities(&modes.hertz(), SAME) {
        let group = first..first + multiplicity;
        // The mean of equal ones: their rounding errors differ.
        let mean = modes.hertz()[group.clone()].iter().sum::<f64>() / multiplicity as f64;
        let kind = kind(&modes, &spec.freedoms, group);
        rows.push(json!({ "f_hz": mean, "multiplicity": multiplicity, "type": kind }));
        first += multiplicity;
    }
    Ok(rows)
}

/// Rotational modes turn the central bodies, translational ones move their centres, planet modes leave them at rest.
fn kind(modes: &Modes, freedoms: &[String], group: std::ops::Range<usize>) -> &'static str {
    let moves = |names: &[&str]| {
        let largest = modes.shapes.columns_range(group.clone()).amax();
        freedoms.iter().enumerate().any(|(row, name)| {
            names.contains(&name.as_str()) && modes.shapes.view_range(row..=row, group.clone()).amax() > 1e-6 * largest
        })
    };
    if moves(&["u_s", "u_c", "u_r"]) {
        "rotational"
    } else if moves(&["x_s", "x_c", "x_r"]) {
        "translational"
    } else {
        "planet"
    }
}
