//! From a resolved scene to what runs.

use serde_json::{Value, json};

use super::{
    Built, dimensionless,
    fault::Fault,
    initial, matrices,
    node::{Findings, Node},
    run,
    shape::{Object, Shape, Units},
    wall,
};
use crate::train::{Spec, TrainError};

/// The kind of train in dimensionless form.
const DIMENSIONLESS: &str = "gear-pair-dimensionless";

/// Units of the keys of a scene, told by its train.
pub(super) fn units_of(scene: &Value) -> Units {
    if scene.pointer("/train/kind").and_then(Value::as_str) == Some(DIMENSIONLESS) { Units::None } else { Units::Si }
}

/// The shape of a scene.
pub(super) fn shape(units: Units) -> Shape {
    let train = Shape::Variant {
        tag: "kind",
        cases: vec![
            (DIMENSIONLESS, dimensionless::shape()),
            ("matrices", matrices::shape()),
            ("wall", wall::shape()),
        ],
    };
    Shape::Object(
        Object::new("A scene: one train, where it starts, and how it runs.")
            .needed("flank", Shape::Whole { min: 1, max: 1 }, "Version of this format, 1.")
            .default("name", "", Shape::Text, "Name of the scene.")
            .default("note", "", Shape::Text, "Anything worth saying about it.")
            .needed("train", train, "The train.")
            .default("initial", "rest", initial::shape(), "Where the run starts.")
            .needed("run", run::shape(units), "The run.")
            .mistake("version", "write \"flank\": 1")
            .mistake("schema", "write \"flank\": 1"),
    )
}

/// Reads a resolved scene.
pub(super) fn build(resolved: &Value) -> Result<Built, Vec<Fault>> {
    let findings = Findings::default();
    let root = Node::root(resolved, &findings, units_of(resolved));
    let built = read(&root);
    let (faults, warnings) = findings.into_parts();
    match built {
        Some(built) if faults.is_empty() => Ok(Built { warnings, ..built }),
        _ => Err(faults),
    }
}

fn read(root: &Node) -> Option<Built> {
    let train = root.at("train");
    let kind = train.at("kind").text();
    let spec = match kind {
        DIMENSIONLESS => Some(dimensionless::read(&train)),
        "matrices" => Some(matrices::read(&train)),
        _ => wall::read(&train),
    }?;
    let run = run::read(&root.at("run"), &spec);
    let (q0, v0) = initial::read(&root.at("initial"), &spec, &run);
    Some(Built { dimensionless: root.units == Units::None, carrier_speed: None, spec, q0, v0, run, warnings: vec![] })
}

/// What a train's own assembly returned; its refusal becomes a fault of the train.
pub(super) fn assembled<T>(node: &Node, result: Result<T, TrainError>) -> Option<T> {
    result
        .map_err(|error| node.fault(error.to_string(), "data that make a train", "change the value it names"))
        .ok()
}

/// The JSON Schema of a scene.
pub(super) fn schema() -> Value {
    let mut schema = super::schema::schema_of(&shape(Units::Si));
    let dimensionless = super::schema::schema_of(&shape(Units::None));
    let run = |schema: &Value| schema["properties"]["run"].clone();
    let choice = json!({
        "if": { "properties": { "train": { "properties": { "kind": { "const": DIMENSIONLESS } } } } },
        "then": { "properties": { "run": run(&dimensionless) } },
        "else": { "properties": { "run": run(&schema) } },
    });
    schema["properties"]["run"] = json!({});
    schema["allOf"] = json!([choice]);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!("Flank scene");
    schema
}
