//! Claims and the expressions they are written in.

use flank::study::claims::{Claims, Verdict};
use serde_json::{Value, json};

/// What a template says beside facts, as the quantity of a claim.
fn filled(template: &str, facts: Value) -> Result<String, String> {
    let claims = json!({ "figures": { "figure": { "claims": [{ "quantity": template }] } } });
    let rows = Claims::from_json(&claims.to_string()).and_then(|claims| claims.compare("figure", facts));
    rows.map(|mut rows| rows.remove(0).quantity).map_err(|error| error.to_string())
}

#[test]
fn expressions_have_the_values_they_say() {
    let value = |text: &str| {
        let facts = json!({ "x": [1.0, 2.0, 4.0], "y": [3.0, 5.0, 9.0], "rows": [{ "a": 1 }, { "a": 7 }], "n": 2 });
        filled(&format!("{{{text}}}"), facts)
    };
    for (text, wanted) in [
        ("1 + 2 * 3 - 4 / 2 ^ 2", "6"),
        ("-(n - 1e-1) * 1.5e1", "-28.5"),
        ("r2(x, y)", "1"),
        ("at(x, y, 3)", "7"),
        ("rows.a[1] == 7 && n != none", "true"),
        ("missing.name == none", "true"),
        ("missing > 1 || missing <= 1", "false"),
        ("where(x, y > 4)", "2, 4"),
        ("max(x * 2, y)", "3, 5, 9"),
        ("x[place(y)] + ' N'", "4 N"),
        ("if(all(steps(y) > 1), 'grows', 'falls')", "grows"),
    ] {
        assert_eq!(value(text).as_deref(), Ok(wanted), "{text}");
    }
    for text in ["1 +", "(1", "no_such(1)", "1 2", "'a"] {
        assert!(value(text).is_err(), "{text}");
    }
}

#[test]
fn templates_are_filled() {
    let filled = |text: &str| filled(text, json!({ "x": [1.0, 2.25], "n": -0.5 }));
    assert_eq!(filled("{x:.1} and {n:+.2} of {len(x)}").as_deref(), Ok("1.0, 2.2 and -0.50 of 2"));
    assert!(filled("{missing}").is_err() && filled("{x").is_err());
}

#[test]
fn verdicts_follow_their_rule() -> Result<(), flank::study::StudyError> {
    let claims = json!({ "figures": { "figure": { "claims": [{ "expected": 100, "value": "found", "unit": "N" }] } } });
    let claims = Claims::from_json(&claims.to_string())?;
    for (found, verdict) in [(104.0, Verdict::Agrees), (86.0, Verdict::Partly), (84.0, Verdict::Deviates)] {
        assert_eq!(claims.compare("figure", json!(found))?[0].verdict, verdict);
    }
    Ok(())
}
