//! A scene run from start to end: its events, where it ends, its measures.

use std::ops::ControlFlow;

use flank::{
    analysis::{Contacts, EventKind, EventLog, EventRow},
    engine::{Engine, Observer, Options, State},
    integrate::{Choice, build},
    scene::Scene,
    system::Structure,
};
use serde_json::{Value, json};

use super::Outcome;

/// Runs `scene` from time `t0`.
pub fn run(scene: &Value, t0: f64) -> Outcome<Value> {
    let (structure, q, v, end) = assemble(scene)?;
    let mut rows = Vec::new();
    let contacts = Contacts::new(&structure, None).keep(0);
    let mut log = EventLog::new(&structure, contacts, |row: EventRow| {
        rows.extend(row.contacts.iter().filter_map(|c| {
            let kind = serde_json::to_value(c.kind).ok()?;
            let known = !matches!(c.kind, EventKind::Clear | EventKind::Graze | EventKind::Start);
            known.then(|| json!({ "t": row.t, "kind": kind, "mesh": c.mesh, "velocity": c.velocity }))
        }));
        ControlFlow::Continue(())
    });
    let state = drive(&structure, [&q, &v], [t0, end], &mut log)?;
    let reports: Vec<_> = (0..structure.contacts().len()).map(|j| log.contacts().report(j)).collect();
    let n = structure.freedoms();
    // Cases count a contact as apart while it carries no force.
    let measures = json!({
        "mesh_apart_fraction": reports.iter().map(|r| r.no_force_fraction).collect::<Vec<_>>(),
        "deflection_max": reports.iter().map(|r| r.deflection_max).collect::<Vec<_>>(),
        "deflection_min": reports.iter().map(|r| r.deflection_min).collect::<Vec<_>>(),
        "abs_mesh_force_max": reports.iter().map(|r| r.force_abs_max).collect::<Vec<_>>(),
    });
    Ok(json!({
        "events": rows,
        "final_state": { "t": end, "q": state.x[..n], "v": state.x[n..2 * n] },
        "measures": measures,
    }))
}

/// The structure, the start `q`, `v` and the end time of a scene.
pub fn assemble(scene: &Value) -> Outcome<(Structure, Vec<f64>, Vec<f64>, f64)> {
    let built = Scene::from_value(scene.clone(), "case")?.build()?;
    Ok((Structure::new(built.spec)?, built.q0, built.v0, built.run.end()))
}

/// Runs `structure` from `start`, coordinates and velocities, over `span`; where it ends.
pub fn drive(structure: &Structure, start: [&[f64]; 2], span: [f64; 2], observer: &mut dyn Observer) -> Outcome<State> {
    let [from, to] = span.map(|t| structure.clock().instant(t));
    let first = structure.start(from, start[0], start[1])?;
    let integrator = build(Choice::Auto, 1e-13, structure)?;
    let state = State { at: from, x: first.x, jump: first.jump };
    let mut engine = Engine::new(structure, integrator, Options::default(), state);
    engine.run(to, observer)?;
    Ok(engine.state().clone())
}
