//! Tables of orbits, multipliers, exponents and points where a motion changes.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    analysis::Contacts,
    engine::{Observer, State},
    event::EventRecord,
    hybrid::HybridSystem,
    orbit::{Lyapunov, Orbit, Search, SectionMap, Tangent},
    scene::Scene,
};
use nalgebra::DMatrix;
use serde_json::{Value, json};

use super::{Outcome, translate};

/// Further starts from which the orbits of a table are looked for.
const STARTS: usize = 60;
/// Cycles of a transient to an attractor.
const TRANSIENT: u64 = 600;
/// Cycles over which a largest exponent is averaged.
const AVERAGED: u64 = 4_000_000;

/// The rows of the table of `case`, if its type is one of these.
pub fn table(case: &Value) -> Option<Outcome<Vec<Value>>> {
    Some(match case["type"].as_str()? {
        "floquet" => floquet(case),
        "bifurcation" if case["table"][0]["w_grazing"].is_array() => grazing(case),
        "bifurcation" => doubling(case),
        "finite_time_lyapunov" => finite_time(case),
        "attractor_points" => attractor(case),
        "asymptotic_lyapunov" => largest(case),
        _ => return None,
    })
}

/// A number, or a decimal string.
fn number(value: &Value, what: &str) -> Outcome<f64> {
    let parsed = value.as_f64().or_else(|| value.as_str()?.parse().ok());
    parsed.ok_or_else(|| format!("{what}: expected a number, found {value}").into())
}

/// `x″ + 2ζx′ + x = F cos ωt` with a rigid wall at σ, which is left out where it is infinite.
fn oscillator(p: &Value, omega: f64, wall: Option<f64>, start: [f64; 2]) -> Outcome<Simulation> {
    let restitution = p["e"].as_f64().unwrap_or(1.0);
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1.0, "stiffness_n_per_m": 1.0,
            "damping_n_s_per_m": 2.0 * number(&p["zeta"], "zeta")?,
            "load_harmonics": [{ "amplitude_n": number(&p["F"], "F")?, "frequency_rad_per_s": omega }],
            "wall": { "side": "above", "position_m": wall.unwrap_or(1e6) },
            "law": { "kind": "rigid", "restitution": restitution },
        },
        "initial": { "q": [start[0]], "v": [start[1]] },
        "run": { "cycles": TRANSIENT },
    });
    open(scene)
}

fn open(scene: Value) -> Outcome<Simulation> {
    Ok(Simulation::from_scene(Scene::from_value(scene, "case")?)?)
}

/// A case with matrices, or the oscillator, from its start.
fn simulation(case: &Value) -> Outcome<Simulation> {
    let p = &case["parameters"];
    let start = |key: &str, otherwise: f64| case["initial_state"][key][0].as_f64().unwrap_or(otherwise);
    let (q, v) = (start("q", 1.1), start("v", 0.1));
    if !p["M"].is_array() {
        return oscillator(p, number(&p["w"], "w")?, Some(number(&p["sigma"], "sigma")?), [q, v]);
    }
    let mut with_end = case.clone();
    with_end["t_end"] = json!(1.0);
    let mut scene = translate::scene(&with_end)?;
    scene["initial"] = json!({ "q": [q], "v": [v] });
    scene["run"] = json!({ "cycles": TRANSIENT });
    open(scene)
}

/// Orbits of period one with one impact, in the order of its phase.
fn one_impact(p: &Value, omega: f64) -> Outcome<Vec<(Simulation, Orbit)>> {
    let sigma = number(&p["sigma"], "sigma")?;
    let simulation = oscillator(p, omega, Some(sigma), [sigma - 0.5, 0.0])?;
    let search = Search { period: Some(1), starts: STARTS };
    let found = search.run(&simulation, flank::Task::default())?;
    let orbits = found.orbits.into_iter().filter(|orbit| orbit.word() == "i0+");
    Ok(orbits.map(|orbit| (simulation.clone(), orbit)).collect())
}

/// The first impact of a run: its time, and the speeds before and after it.
#[derive(Default)]
struct Impact(Option<[f64; 3]>);

impl Observer for Impact {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if self.0.is_none() && !record.start {
            self.0 = Some([record.at.phase.value(), record.x_minus[1], record.x_plus[1]]);
        }
        ControlFlow::Continue(())
    }
}

fn impact(simulation: &Simulation, orbit: &Orbit) -> Outcome<[f64; 3]> {
    let map = SectionMap::new(simulation)?;
    let (mut impact, state) = (Impact::default(), map.state(&orbit.section)?);
    let end = simulation.clock().at(state.at.cycle + 1, 0.0);
    simulation.engine(state)?.run(end, &mut impact)?;
    impact.0.ok_or_else(|| "the orbit has no impact".into())
}

fn multipliers(orbit: &Orbit) -> Value {
    let mut sorted = orbit.multipliers.clone();
    sorted.sort_by(|a, b| b.im.total_cmp(&a.im).then(b.re.total_cmp(&a.re)));
    sorted.iter().map(|m| [m.re, m.im]).collect()
}

fn floquet(case: &Value) -> Outcome<Vec<Value>> {
    let p = &case["parameters"];
    let mut rows = Vec::new();
    for (simulation, orbit) in one_impact(p, number(&p["w"], "w")?)? {
        let [time, before, after] = impact(&simulation, &orbit)?;
        let jacobian = &orbit.image.jacobian;
        rows.push(json!({
            "impact_phase_time": time, "v_before": before, "v_after": after,
            "trace": jacobian.trace(), "det": jacobian.determinant(),
            "multipliers": multipliers(&orbit), "stable": orbit.is_stable,
        }));
    }
    rows.sort_by(|a, b| {
        a["impact_phase_time"]
            .as_f64()
            .partial_cmp(&b["impact_phase_time"].as_f64())
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    Ok(rows)
}

/// The zero of `f` near `start`, by the secant rule.
fn zero(start: f64, mut f: impl FnMut(f64) -> Outcome<f64>) -> Outcome<f64> {
    let (mut a, mut b) = (start, start * (1.0 + 1e-4));
    let (mut fa, mut fb) = (f(a)?, f(b)?);
    for _ in 0..60 {
        if fb == 0.0 || fb == fa || (b - a).abs() <= 1e-15 * b.abs() {
            break;
        }
        let next = b - fb * (b - a) / (fb - fa);
        (a, fa) = (b, fb);
        (b, fb) = (next, f(next)?);
        if fb.abs() >= fa.abs() && (b - a).abs() <= 1e-12 * b.abs() {
            // The last step was rounding.
            return Ok(a);
        }
    }
    Ok(b)
}

/// A first guess: the tabled value to three digits.
fn guess(value: &Value) -> Outcome<f64> {
    let value = number(value, "w")?;
    let unit = 10f64.powi(value.abs().log10().floor() as i32 - 2);
    Ok((value / unit).round() * unit)
}

/// The frequency at which the multiplier of the orbit with one impact is −1: `1 + tr J + det J = 0`.
fn doubling(case: &Value) -> Outcome<Vec<Value>> {
    let p = &case["parameters"];
    let rows = case["table"].as_array().ok_or("a case without a table")?;
    let row = |row: &Value| {
        let start = guess(&row["w"])?;
        let mut orbits = one_impact(p, start)?;
        let (_, mut orbit) = orbits.pop().ok_or("no orbit with one impact near the start")?;
        let mut last = orbit.section.clone();
        let mut solve = |omega: f64| -> Outcome<Orbit> {
            let simulation = oscillator(p, omega, Some(number(&p["sigma"], "sigma")?), [last.x[0], last.x[1]])?;
            let map = SectionMap::new(&simulation)?;
            let orbit = map.solve(&last, 1, &map.drift()).map_err(|missed| missed.reason)?;
            last = orbit.section.clone();
            Ok(orbit)
        };
        let omega = zero(start, |omega| {
            orbit = solve(omega)?;
            Ok(1.0 + orbit.image.jacobian.trace() + orbit.image.jacobian.determinant())
        })?;
        let orbit = solve(omega)?;
        let sigma = number(&p["sigma"], "sigma")?;
        let simulation = oscillator(p, omega, Some(sigma), [orbit.section.x[0], orbit.section.x[1]])?;
        let [time, _, after] = impact(&simulation, &orbit)?;
        let mut values = multipliers(&orbit);
        if let Some(values) = values.as_array_mut() {
            values.sort_by(|a, b| b[0].as_f64().partial_cmp(&a[0].as_f64()).unwrap_or(std::cmp::Ordering::Equal));
        }
        Ok(json!({ "w": omega, "impact_phase_time": time, "v_after": after, "multipliers": values }))
    };
    rows.iter().map(row).collect()
}

/// Frequencies at which the motion without impacts touches the wall.
fn grazing(case: &Value) -> Outcome<Vec<Value>> {
    let rows = case["table"].as_array().ok_or("a case without a table")?;
    let row = |p: &Value| {
        let sigma = number(&p["sigma"], "sigma")?;
        let touch = |omega: f64| -> Outcome<f64> {
            let free = oscillator(p, omega, None, [0.0, 0.0])?;
            let map = SectionMap::new(&free)?;
            let orbit = map.solve(&map.start()?, 1, &map.drift()).map_err(|missed| missed.reason)?;
            let (mut contacts, state) = (Contacts::new(&free.structure, None).keep(0), map.state(&orbit.section)?);
            let end = free.clock().at(state.at.cycle + 1, 0.0);
            free.engine(state)?.run(end, &mut contacts)?;
            Ok(contacts.report(0).deflection_max.ok_or("no deflection")? - sigma)
        };
        let tabled = p["w_grazing"].as_array().ok_or("no w_grazing")?;
        let found: Outcome<Vec<f64>> = tabled.iter().map(|w| zero(guess(w)?, touch)).collect();
        Ok(json!({ "zeta": p["zeta"], "F": p["F"], "sigma": p["sigma"], "w_grazing": found? }))
    };
    rows.iter().map(row).collect()
}

/// The derivative of a run over a time, and what follows from it; how far rounding may have moved the exponent is its change where the
/// start moves by the rounding of the whole run.
fn finite_time(case: &Value) -> Outcome<Vec<Value>> {
    let simulation = simulation(case)?;
    let structure = &simulation.structure;
    let end = number(&case["t_end"], "t_end")?;
    let run = |start: State| -> Outcome<_> {
        let mut tangent = Tangent::new(structure);
        let mut engine = simulation.engine(start)?;
        engine.run(HybridSystem::clock(structure).instant(end), &mut tangent)?;
        let dim = tangent.columns.count;
        let jacobian = DMatrix::from_row_slice(dim, dim, &tangent.columns.values);
        Ok((jacobian.singular_values().max(), jacobian, tangent.volume / end, engine.counters()))
    };
    let start = simulation.start()?;
    let (largest, jacobian, sum, counters) = run(start.clone())?;
    let rounding = 2.0 * f64::EPSILON * ((counters.steps + counters.events) as f64).sqrt();
    let mut error = 0.0f64;
    for sign in [1.0, -1.0] {
        let size = start.x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let mut moved = start.clone();
        moved.x.iter_mut().for_each(|x| *x += sign * rounding * size);
        let (other, ..) = run(moved)?;
        error = error.max((other.ln() - largest.ln()).abs() / end);
    }
    let rows: Vec<Vec<f64>> = jacobian.row_iter().map(|row| row.iter().copied().collect()).collect();
    Ok(vec![json!({
        "lambda_T": largest.ln() / end, "lambda_error": error, "sigma_max": largest, "jacobian": rows, "sum_of_exponents": sum,
        "n_events": counters.events,
    })])
}

/// The points of the orbit that a run comes to, by displacement.
fn attractor(case: &Value) -> Outcome<Vec<Value>> {
    let simulation = simulation(case)?;
    let map = SectionMap::new(&simulation)?;
    let reached = map.follow(&map.start()?, TRANSIENT)?;
    let period = case["period"].as_u64().ok_or("a case without a period")?;
    let orbit = map.solve(&reached, period, &map.drift()).map_err(|missed| missed.reason)?;
    let mut points: Vec<&Vec<f64>> = orbit.image.between.iter().map(|section| &section.x).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(points.iter().map(|x| json!({ "x": x[0], "v": x[1] })).collect())
}

/// The largest exponent of the motion that a run comes to.
fn largest(case: &Value) -> Outcome<Vec<Value>> {
    let asked = Lyapunov { cycles: Some(AVERAGED), ..Lyapunov::default() };
    let found = asked.run(&simulation(case)?, flank::Task::default())?;
    Ok(vec![json!({ "lambda_max": found.exponents[0], "band": found.band[0], "sum": found.sum })])
}
