//! Runs a reference case and writes what the engine makes of it.
//!
//! ```text
//! cargo run --release --example reference -- CASE.json OUT.json
//! cargo run --release --example reference -- --scene CASE.json SCENE.json
//! ```
//!
//! A case is a JSON file with matrices, contacts, a start and an end, and with the events, impacts or natural
//! frequencies that were computed for it elsewhere, to many digits. The output holds ours, under the same keys.
//! With `--scene` it holds the case as a scene instead.

mod eigenvalues;
mod impact;
mod orbits;
mod simulate;
mod translate;

use std::{error::Error, fs, process::ExitCode};

use serde_json::{Value, json};

/// Whatever goes wrong ends the program with its message.
type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["--scene", case, scene] => convert(case, scene, translate::scene),
        [case, output] => convert(case, output, answer),
        _ => Err("usage: reference [--scene] CASE.json OUT.json".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn convert(input: &str, output: &str, work: impl Fn(&Value) -> Outcome<Value>) -> Outcome<()> {
    let text = fs::read_to_string(input).map_err(|error| format!("{input}: {error}"))?;
    let case: Value = serde_json::from_str(&text).map_err(|error| format!("{input}: {error}"))?;
    let found = work(&case).map_err(|error| format!("{input}: {error}"))?;
    fs::write(output, serde_json::to_string_pretty(&found)?).map_err(|error| format!("{output}: {error}"))?;
    Ok(())
}

/// What the engine makes of a case.
fn answer(case: &Value) -> Outcome<Value> {
    if let Some(table) = orbits::table(case) {
        return Ok(json!({ "table": table? }));
    }
    match case["type"].as_str() {
        None | Some("hertz_deadzone") => simulate::run(&translate::scene(case)?, translate::start_time(case)),
        Some("single_impact_table") => Ok(json!({ "table": impact::table(case)? })),
        Some("eigenvalues") => Ok(json!({ "table": eigenvalues::table(case)? })),
        Some(other) => Err(format!("cases of type \"{other}\" are not known here").into()),
    }
}
