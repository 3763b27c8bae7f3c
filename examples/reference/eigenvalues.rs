//! Natural frequencies of the planetary stage of Lin and Parker, with the family of each.

use flank::{scene::Scene, system::bonded_stiffness, train::planetary::families};
use serde_json::{Value, json};

use super::Outcome;

/// One row a frequency, rising.
pub fn table(case: &Value) -> Outcome<Vec<Value>> {
    let text = case["description"].as_str().unwrap_or_default();
    let (_, rest) = text.split_once("N=").ok_or("the description names no number of planets N=…")?;
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    let planets: u64 = digits.parse()?;
    let train = json!({ "kind": "planetary", "preset": "lin-parker", "planets": planets });
    let scene = Scene::from_value(json!({ "flank": 1, "train": train, "run": { "t_end_s": 1 } }), text)?;
    let spec = scene.build()?.spec;
    let mut rows = Vec::new();
    for part in families(&spec, &bonded_stiffness(&spec, None))? {
        let row = |f| (f, part.multiplicity, part.family);
        rows.extend(part.hertz().into_iter().map(row));
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let row = |(f, multiplicity, family): (f64, usize, _)| json!({ "f_hz": f, "multiplicity": multiplicity, "type": format!("{family}") });
    Ok(rows.into_iter().map(row).collect())
}
