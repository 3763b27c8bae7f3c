//! Errors of event times over whole runs, against the uncertainty of the arc and what the run before has amplified.

use flank::{Simulation, scene::Scene};
use serde_json::Value;

use super::{
    flank_run::{decimal, kind},
    judge::truth,
    sequence::Kind,
    wide::{Wide, near, size},
};

/// Bars above this share of a period are none: the run says itself that it does not know the time.
const WIDEST: f64 = 1e-6;

/// Ratios of error and bar of the events of a scene, as far as its truth is known.
pub fn bars(value: &Value, budget: usize) -> Vec<f64> {
    let mut value = value.clone();
    let Ok(scene) = Scene::from_value(value.clone(), "random") else { return Vec::new() };
    let truth = truth(scene.built(), budget);
    // What follows is not compared.
    let key = if scene.built().dimensionless { "t_end" } else { "t_end_s" };
    let end = truth.until.min(scene.built().run.end());
    value["run"] = serde_json::json!({ key: end, "inherited_uncertainty": true });
    let Ok(scene) = Scene::from_value(value, "random") else { return Vec::new() };
    let Ok(simulation) = Simulation::from_scene(&scene) else { return Vec::new() };
    // A run that ends by an alarm has no bars.
    let Ok(run) = simulation.run() else { return Vec::new() };
    let rows = run.events.iter().filter(|row| !row.start);
    let met: Vec<(Wide, usize, Kind, f64)> = rows
        .flat_map(|row| {
            let (t, bar) = (decimal(&row.t), row.uncertainty + row.inherited_uncertainty.unwrap_or_default());
            row.contacts.iter().filter_map(move |c| Some((t, c.mesh, kind(c.kind)?, bar)))
        })
        .collect();
    let until = truth.until - 1e-6 * truth.period;
    let mut ratios = Vec::new();
    for j in 0..simulation.structure.contacts().len() {
        // Beyond the first sequence that is summed impacts are counted differently.
        let until = truth.sequence.tails.iter().filter(|(i, ..)| *i == j).fold(until, |m, (_, a, _)| m.min(near(*a)));
        let want = truth.sequence.events.iter().filter(|e| e.contact == j && near(e.t) < until);
        let have = met.iter().filter(|e| e.1 == j);
        let same = want.zip(have).take_while(|(want, have)| want.kind == have.2);
        let known = same.filter(|(_, (.., bar))| *bar < WIDEST * truth.period);
        // The bar is of the motion of the numbers as they are; both times are rounded in their last place.
        ratios.extend(known.map(|(want, (t, _, _, bar))| {
            size(*t - want.t) / (bar + f64::EPSILON * size(want.t)).max(f64::MIN_POSITIVE)
        }));
    }
    ratios
}
