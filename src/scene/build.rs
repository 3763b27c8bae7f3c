//! Construction of the train, start and run of a resolved scene.

use serde_json::{Value, json};

use super::{
    BuiltScene, clock, dimensionless,
    fault::Fault,
    gearbox, initial, matrices,
    node::{Findings, Node},
    pair, planetary, plausible, run,
    shape::{self, Units},
    wall,
};
use crate::{
    gear::Harmonic,
    system::{AssembleError, ContactSpec, Spec},
    train::TrainError,
};

/// Kind of train in dimensionless form.
const DIMENSIONLESS: &str = "gear-pair-dimensionless";

/// Returns the units of the keys of a scene, by its train.
pub(super) fn units_of(scene: &Value) -> Units {
    if scene.pointer("/train/kind").and_then(Value::as_str) == Some(DIMENSIONLESS) { Units::None } else { Units::Si }
}

pub(super) fn build(resolved: &Value) -> Result<BuiltScene, Vec<Fault>> {
    let findings = Findings::default();
    let root = Node::root(resolved, &findings, units_of(resolved));
    let built = read(&root);
    let (meshes, speeds) = (findings.meshes.take(), findings.speeds.take());
    let drawing = findings.drawing.take();
    let (start_faults, remarks) = (findings.start_faults.take(), findings.remarks.take());
    let (faults, warnings) = findings.into_parts();
    match built {
        Some(built) if faults.is_empty() => {
            Ok(BuiltScene { warnings, remarks, meshes, speeds, drawing, start_faults, ..built })
        }
        _ => Err(faults),
    }
}

/// Returns the faults of the train in a scene whose other parts have faults already.
pub(super) fn faults_of_train(resolved: &Value) -> Vec<Fault> {
    let findings = Findings::default();
    read_train(&Node::root(resolved, &findings, units_of(resolved)).at("train"));
    findings.into_parts().0
}

fn read(root: &Node) -> Option<BuiltScene> {
    let (spec, carrier_speed) = read_train(&root.at("train"))?;
    let run = run::read(&root.at("run"), &spec);
    clock::check(root, &spec, &run);
    plausible::size(&root.at("train"), &spec);
    if run.frame == run::Frame::Fixed && carrier_speed.is_none() {
        root.at("run")
            .at("output")
            .at("frame")
            .warn("this train's frame does not turn: fixed and rotating are the same");
    }
    let (q0, v0, memory) =
        initial::read(&root.at("initial"), &spec, run.start_cycle as f64 * run.period.unwrap_or(0.0));
    Some(BuiltScene {
        dimensionless: root.units == Units::None,
        carrier_speed,
        spec,
        q0,
        v0,
        memory,
        run,
        meshes: vec![],
        speeds: vec![],
        drawing: None,
        warnings: vec![],
        remarks: vec![],
        start_faults: vec![],
    })
}

/// Returns the train in its common form, and the speed of its frame if that rotates.
fn read_train(train: &Node) -> Option<(Spec, Option<f64>)> {
    let (spec, carrier_speed) = match train.at("kind").text() {
        DIMENSIONLESS => (dimensionless::read(train), None),
        "matrices" => (matrices::read(train), None),
        "gear-pair" => (pair::read(train)?, None),
        "gearbox" => (gearbox::read(train)?, None),
        "planetary" => planetary::read(train).map(|(spec, speed)| (spec, Some(speed)))?,
        _ => (wall::read(train)?, None),
    };
    if let Some(what) = first_overflow(&spec) {
        train.fault(
            format!("numbers whose products are too large: {what}"),
            "numbers whose products a double can hold",
            "check the units of very large and very small numbers",
        );
    } else if !train.has_faults()
        && let Err(error) = spec.check()
    {
        // If the train lists its contacts, the fault is at the contact concerned.
        let items = train.at("contacts").items();
        let place = match &error {
            AssembleError::Contact { contact, .. } => {
                items.into_iter().zip(&spec.contacts).find(|(_, c)| c.name == *contact).map(|(item, _)| item)
            }
            _ => None,
        };
        let place = place.unwrap_or_else(|| train.clone());
        place.fault(error.to_string(), "a train that can be assembled", "change what it names");
    }
    Some((spec, carrier_speed))
}

/// Returns the name of a product of numbers of a scene that has overflowed, if any.
fn first_overflow(spec: &Spec) -> Option<String> {
    let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
    let structure = [&spec.mass, &spec.damping, &spec.stiffness].iter().all(|matrix| finite(matrix.as_slice()));
    let loads = finite(&spec.load)
        && spec.load_harmonics.iter().all(|load| finite(&load.vector))
        && spec.load_schedules.iter().all(|load| finite(&load.vector) && load.factor.maximum().is_finite());
    let broken = |c: &&ContactSpec| {
        let stiffness: Vec<f64> = c.schedules().flat_map(|k| [k.maximum(), k.mean()]).collect();
        let stiffness = [stiffness, vec![c.law.loss().unwrap_or(0.0), c.half_backlash, c.gap_damping]].concat();
        let error = |h: &Harmonic| h.amplitude.is_finite() && h.phase.is_finite() && h.omega.is_finite();
        !finite(&stiffness) || !finite(&c.direction) || !c.errors().flatten().all(error)
    };
    match spec.contacts.iter().find(broken) {
        _ if !structure => Some("the structure".to_owned()),
        _ if !loads => Some("the loads".to_owned()),
        broken => broken.map(|contact| contact.name.clone()),
    }
}

/// Returns the result of a train's assembly; its refusal becomes a fault at the key concerned.
pub(super) fn assembled<T>(node: &Node, result: Result<T, TrainError>) -> Option<T> {
    let refused = |error: TrainError| {
        let (key, allowed, remedy) = match &error {
            TrainError::Freedom { .. } => ("freedoms", "names of freedoms the train has", "name others, each once"),
            TrainError::NotInPhase { .. } => {
                ("freedoms", "\"in-phase\" for alike planets only", "keep other freedoms, or put the meshes in phase")
            }
            TrainError::Phases { .. } => ("phases", "one phase per planet and mesh", "write as many as planets"),
            TrainError::Standing { .. } => {
                ("speed_rpm", "a speed > 0 where something varies", "give a speed, or leave the variation out")
            }
            _ => ("", "data that make a train", "change the value it names"),
        };
        let place = if key.is_empty() { node.clone() } else { node.at(key) };
        place.fault(error.to_string(), allowed, remedy);
    };
    result.map_err(refused).ok()
}

pub(super) fn schema() -> Value {
    let mut schema = super::schema::schema_of(shape::scene(Units::Si), false);
    let dimensionless = super::schema::schema_of(shape::scene(Units::None), false);
    let run = |schema: &Value| schema["properties"]["run"].clone();
    let choice = json!({
        "if": { "properties": { "train": { "properties": { "kind": { "const": DIMENSIONLESS } } } } },
        "then": { "properties": { "run": run(&dimensionless) } },
        "else": { "properties": { "run": run(&schema) } },
    });
    schema["properties"]["run"] = json!({});
    schema["properties"]["$schema"] = json!({ "type": "string" });
    schema["allOf"] = json!([choice]);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!("Flank scene");
    schema
}
