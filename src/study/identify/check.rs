//! Faults of a question, found before anything is computed from it.

use serde_json::Value;

use super::{Parameter, Quantity, Target, fit::places, reading::Train};
use crate::scene::{Fault, Scene};

/// Share of the range at which a number is tried, beside the bounds: no round share, so that no range of whole numbers is mistaken for one
/// of numbers.
const INSIDE: f64 = 0.618_034;

/// Returns the scene's values of the parameters, or all faults of parameters and targets.
///
/// # Errors
/// Every fault, with the parameter or target as it is written as its place.
pub fn check(scene: &Scene, parameters: &[Parameter], targets: &[Target]) -> Result<Vec<f64>, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut own = Vec::new();
    let mut known: Vec<&str> = Vec::new();
    for parameter in parameters {
        let place = parameter.to_string();
        let before = faults.len();
        for pointer in &parameter.pointers {
            if known.contains(&pointer.as_str()) {
                let fault = Fault::new(&place, format!("{pointer} for the second time"), "numbers that differ");
                faults.push(fault.remedy("vary each number once"));
            }
            known.push(pointer);
        }
        let numbers = parameter.pointers.iter().map(|pointer| number_at(scene.resolved(), pointer, &place));
        let numbers: Vec<f64> = numbers.filter_map(|at| at.map_err(|fault| faults.push(fault)).ok()).collect();
        if !(parameter.low < parameter.high && parameter.low.is_finite() && parameter.high.is_finite()) {
            let fault = Fault::new(&place, "bounds that hold nothing", "LOW < HIGH, both finite");
            faults.push(fault.remedy("write the lower bound first"));
        }
        if parameter.pointers.is_empty() {
            faults.push(Fault::new(&place, "no pointer", "at least one").remedy("name the number to find"));
        }
        if faults.len() == before {
            faults.extend(outside(scene, parameter, &place));
        }
        own.extend(numbers.first());
    }
    faults.extend(unreadable(scene, targets));
    if faults.is_empty() { Ok(own) } else { Err(faults) }
}

/// Returns the number at a pointer, or the fault with the possible choices.
fn number_at(resolved: &Value, pointer: &str, place: &str) -> Result<f64, Fault> {
    let fault = |found: String, remedy: String| Fault::new(place, found, "a pointer to a number").remedy(remedy);
    let (mut value, mut path) = (resolved, String::new());
    for key in pointer.split('/').skip(1) {
        let plain = key.replace("~1", "/").replace("~0", "~");
        let next = match value {
            Value::Object(object) => object.get(&plain),
            Value::Array(items) => plain.parse::<usize>().ok().and_then(|i| items.get(i)),
            _ => None,
        };
        let Some(next) = next else {
            return Err(fault(
                format!("nothing at {path}/{key}"),
                format!("below {path}/ there are: {}", choices(value)),
            ));
        };
        (value, path) = (next, format!("{path}/{key}"));
    }
    match value {
        Value::Object(_) | Value::Array(_) => {
            Err(fault(format!("no number at {path}, but more below it"), format!("go on with: {}", choices(value))))
        }
        other => other.as_f64().ok_or_else(|| {
            fault(format!("{other} at {path}"), "write a number there first, or vary another place".to_owned())
        }),
    }
}

fn choices(place: &Value) -> String {
    match place {
        Value::Object(object) => object.keys().map(String::as_str).collect::<Vec<_>>().join(", "),
        Value::Array(items) => format!("numbers from 0, below {}", items.len()),
        _ => "nothing".to_owned(),
    }
}

/// Returns the fault of values between the bounds that are invalid in the scene.
fn outside(scene: &Scene, parameter: &Parameter, place: &str) -> Option<Fault> {
    let inside = parameter.low + INSIDE * (parameter.high - parameter.low);
    [parameter.low, parameter.high, inside].into_iter().find_map(|value| {
        let refused = scene
            .with_all(
                places(std::slice::from_ref(parameter), &[value]).into_iter().map(|(at, value)| (at, value.into())),
            )
            .err()?;
        let why = refused.faults.first()?;
        let found = format!("{value:?}, for which the scene is refused: {} at {}", why.found, why.pointer);
        Some(Fault::new(place, &found, &why.allowed).remedy("choose bounds that hold only values a scene may have"))
    })
}

/// Returns the faults of targets that the given scene does not have.
fn unreadable(scene: &Scene, targets: &[Target]) -> Vec<Fault> {
    let train = Train::new(&scene.built().spec);
    let mut faults = Vec::new();
    for target in targets {
        let place = target.to_string();
        if !(target.wanted.is_finite() && target.sigma.is_finite() && target.sigma > 0.0) {
            let remedy = "write VALUE:SIGMA, SIGMA > 0";
            faults.push(Fault::new(&place, "no value with a standard deviation", "finite numbers").remedy(remedy));
        }
        if !matches!(target.quantity, Quantity::Force(_)) && target.wanted < 0.0 {
            faults.push(
                Fault::new(&place, "a negative frequency", "a frequency >= 0").remedy("write it without the sign"),
            );
        }
        if let Err(error) = train.read(target) {
            faults.push(Fault::new(&place, error.found, "what the train has").remedy(error.remedy));
        }
    }
    faults
}
