//! Tables of free impacts on a power law with hysteresis, each simulated.

use std::ops::ControlFlow;

use flank::{
    analysis::Contacts,
    engine::{JumpRecord, Observer},
    event::EventRecord,
    hybrid::Mode,
    integrate::DenseStep,
    system::Structure,
};
use serde_json::{Value, json};

use super::{Outcome, simulate, translate};

/// The rows of a table, in order.
pub fn table(case: &Value) -> Outcome<Vec<Value>> {
    let exponent = exponent(case)?;
    case["table"].as_array().ok_or("a case without a table")?.iter().map(|row| impact(row, &exponent)).collect()
}

/// The exponent, as in `n=10/9`: among the constants, or in the description.
fn exponent(case: &Value) -> Outcome<String> {
    if let Some(n) = case["constants"]["n"].as_str() {
        return Ok(n.to_owned());
    }
    let text = case["description"].as_str().unwrap_or_default();
    let (_, rest) = text.split_once(" n=").ok_or("the description names no exponent n=p/q")?;
    Ok(rest
        .chars()
        .take_while(|c| c.is_ascii_digit() || "/.".contains(*c))
        .collect::<String>()
        .trim_end_matches('.')
        .to_owned())
}

/// A number, or a decimal string.
fn number(value: &Value, otherwise: f64) -> Outcome<f64> {
    match value {
        Value::Null => Ok(otherwise),
        Value::String(text) => Ok(text.parse()?),
        other => other.as_f64().ok_or_else(|| format!("expected a number, found {other}").into()),
    }
}

/// A mass meets the flank at speed `v`; rows without `m`, `K`, `v` are in units where all three are one.
fn impact(row: &Value, exponent: &str) -> Outcome<Value> {
    let (m, k, v) = (number(&row["m"], 1.0)?, number(&row["K"], 1.0)?, number(&row["v"], 1.0)?);
    let hysteresis = number(&row["mu"], 0.0)?;
    let n = match exponent.split_once('/') {
        Some((p, q)) => p.parse::<f64>()? / q.parse::<f64>()?,
        None => exponent.parse()?,
    };
    let scale = (m * v * v / k).powf(1.0 / (n + 1.0)) / v;
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "matrices",
            "mass_kg": [m],
            "contacts": [{
                "direction": [1.0], "flanks": "drive", "half_backlash_m": 0.0, "stiffness": k,
                "law": translate::hertz(exponent.into(), &hysteresis.into()),
            }],
        },
        "initial": { "q": [0.0], "v": [v] },
        // A contact lasts three to four times X/v, and longer the more it loses.
        "run": { "t_end_s": 1000.0 * scale },
    });
    let (structure, q, speed, end) = simulate::assemble(&scene)?;
    let mut watch = Watch { contacts: Contacts::new(&structure, None), turning: Turning::new(&structure) };
    simulate::drive(&structure, [&q, &speed], [0.0, end], &mut watch)?;
    let Some(episode) = watch.contacts.episodes(0).first() else { return Err("the impact does not end".into()) };
    let force = episode.peak_force.unwrap_or(f64::NAN);
    let (x, restitution) = (episode.peak_penetration, episode.release / episode.approach);
    Ok(if row["v"].is_null() {
        json!({ "e_out": restitution, "c_T": episode.duration, "c_X": x, "c_F": force, "c_tmax": watch.turning.at })
    } else {
        json!({ "e_out": restitution, "duration": episode.duration, "max_penetration": x, "peak_force": force })
    })
}

/// Contact measures, and when the deflection is largest.
struct Watch<'s> {
    contacts: Contacts<'s, Structure>,
    turning: Turning,
}

impl Observer for Watch<'_> {
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.contacts.step(mode, step, until)?;
        self.turning.step(mode, step, until)
    }

    fn wants_jumps(&self) -> bool {
        self.contacts.wants_jumps()
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.contacts.jump(jumped);
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.contacts.event(record)?;
        // The first separation ends the impact.
        if self.contacts.episodes(0).is_empty() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

/// The time at which the velocity changes its sign, found by bisection on the dense output.
struct Turning {
    elapsed: f64,
    at: Option<f64>,
    x: Vec<f64>,
}

impl Turning {
    fn new(structure: &Structure) -> Self {
        Self { elapsed: 0.0, at: None, x: vec![0.0; flank::hybrid::HybridSystem::dim(structure)] }
    }

    fn speed(&mut self, step: &dyn DenseStep, theta: f64) -> f64 {
        step.state(theta, &mut self.x);
        self.x[1]
    }
}

impl Observer for Turning {
    fn step(&mut self, _: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        if self.at.is_none() && self.speed(step, until) <= 0.0 {
            let (mut low, mut high) = (0.0, until);
            for _ in 0..100 {
                let middle = 0.5 * (low + high);
                if self.speed(step, middle) > 0.0 { low = middle } else { high = middle }
            }
            self.at = Some(self.elapsed + step.time(low));
        }
        self.elapsed += step.time(until);
        ControlFlow::Continue(())
    }
}
