//! Flank's events against the oracle's, contact by contact.

use std::time::Duration;

use flank::{
    analysis::EventRow,
    scene::{BuiltScene, Scene},
    system::bonded_modes,
};
use serde_json::Value;

use super::{
    flank_run::{self, Failure},
    model::{Law, Model, Tweak},
    scenes::PRESSED,
    sequence::{Ending, Event, Kind, Sequence, sequence},
    state::State,
    wide::{Wide, near, size, wide},
};

/// What became of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    Right,
    Refused(String),
    Alarmed(String),
    /// First difference in words.
    Wrong(String),
}

pub struct Judged {
    pub verdict: Verdict,
    /// The oracle stopped at something that doubles cannot tell.
    pub ambiguous: Option<String>,
    pub events: usize,
    /// Largest time difference over what is allowed.
    pub worst: f64,
    pub oracle_seconds: f64,
    pub flank_seconds: f64,
    /// The scene as compared, with its end.
    pub scene: Value,
}

/// The truth of a scene, with what the motion amplifies.
pub struct Truth {
    pub sequence: Sequence,
    /// |dt| per relative change of the inputs, one per event.
    pub sensitivity: Vec<f64>,
    /// Up to where the comparison holds.
    pub until: f64,
    pub ambiguous: Option<String>,
    /// Period that tolerances are counted in.
    pub period: f64,
    pub tolerance: f64,
}

/// Relative change of the inputs from which sensitivities are measured.
const TWEAK: f64 = 1e-15;
/// Errors of inputs and of rounding that a motion may amplify (as the issue allows).
const INHERITED: f64 = 2e-14;

pub fn start(m: &Model, built: &BuiltScene, tweak: Tweak) -> State {
    let t = |x: &[f64]| x.iter().map(|x| tweak.of(*x)).collect();
    State::start(m, wide(0.0), t(&built.q0), t(&built.v0))
}

/// The forcing period, or that of the highest natural frequency with all contacts closed.
fn period(built: &BuiltScene, m: &Model) -> f64 {
    let forced = built.spec.omega.or_else(|| m.omegas.iter().map(|w| near(*w)).reduce(f64::min));
    let natural = || bonded_modes(&built.spec).ok()?.hertz().into_iter().reduce(f64::max).filter(|f| *f > 0.0);
    match forced {
        Some(omega) => std::f64::consts::TAU / omega,
        None => natural().map_or(1.0, |f| 1.0 / f),
    }
}

pub fn truth(built: &BuiltScene, budget: usize) -> Truth {
    let m = Model::new(&built.spec, Tweak::NONE);
    let end = wide(built.run.end());
    let period = period(built, &m);
    let is_power = m.contacts.iter().any(|c| matches!(c.law, Law::Power { .. }));
    let tolerance = if is_power { 1e-11 } else { 1e-12 } * period;
    let sequence = sequence(&m, start(&m, built, Tweak::NONE), end, budget);
    let mut until = near(sequence.until);
    let mut ambiguous = if let Ending::Ambiguous(why) = &sequence.ending { Some(why.clone()) } else { None };
    let mut sensitivity = vec![0.0_f64; sequence.events.len()];
    for seed in 1..=3 {
        let tweak = Tweak { amount: TWEAK, seed, ..Tweak::NONE };
        let other = Model::new(&built.spec, tweak);
        let moved = super::sequence::sequence(&other, start(&other, built, tweak), end, budget);
        for j in 0..m.contacts.len() {
            let of = |s: &Sequence| -> Vec<(usize, Event)> {
                s.events.iter().copied().enumerate().filter(|(_, e)| e.contact == j).collect()
            };
            let (a, b) = (of(&sequence), of(&moved));
            let reach = near(moved.until);
            for i in 0..a.len() {
                let t = near(a[i].1.t);
                if t > reach {
                    break;
                }
                match b.get(i) {
                    Some((_, e)) if e.kind == a[i].1.kind => {
                        let dt = size(e.t - a[i].1.t) / TWEAK;
                        sensitivity[a[i].0] = sensitivity[a[i].0].max(dt);
                    }
                    other => {
                        let at = other.map_or(t, |(_, e)| t.min(near(e.t)));
                        if at < until {
                            until = at;
                            ambiguous = Some("a change of the inputs by 1e-15 changes the sequence".into());
                        }
                        break;
                    }
                }
            }
        }
    }
    // Beyond, the motion is chaos to doubles.
    for (e, s) in sequence.events.iter().zip(&sensitivity) {
        if INHERITED * s > 1e-5 * period {
            until = until.min(near(e.t));
        }
    }
    Truth { sequence, sensitivity, until, ambiguous, period, tolerance }
}

/// The truth of a scene in which nothing happens: no series needs to follow the fast oscillations of a stiff contact.
fn nothing(built: &BuiltScene) -> Truth {
    let (until, period) = (built.run.end(), 1.0);
    let sequence =
        Sequence { events: vec![], tails: vec![], first: vec![], ending: Ending::Reached, until: wide(until) };
    Truth { sequence, sensitivity: vec![], until, ambiguous: None, period, tolerance: 1e-11 }
}

/// Judges a scene.
pub fn judge(value: &Value, budget: usize, limit: Duration) -> Judged {
    let began = std::time::Instant::now();
    let mut out = Judged {
        verdict: Verdict::Right,
        ambiguous: None,
        events: 0,
        worst: 0.0,
        oracle_seconds: 0.0,
        flank_seconds: 0.0,
        scene: value.clone(),
    };
    let scene = match Scene::from_value(value.clone(), "random") {
        Ok(scene) => scene,
        Err(e) => {
            out.verdict = Verdict::Refused(e.to_string());
            return out;
        }
    };
    let Ok(built) = scene.build() else { return out };
    let truth = if value["note"] == PRESSED { nothing(&built) } else { truth(&built, budget) };
    out.oracle_seconds = began.elapsed().as_secs_f64();
    out.ambiguous.clone_from(&truth.ambiguous);
    // Flank need not run beyond what is compared; an ambiguous scene must run to its end all the same.
    let until = truth.until + 1e-6 * truth.period;
    if until < built.run.end() && until > 0.0 && truth.ambiguous.is_none() {
        let key = if built.dimensionless { "t_end" } else { "t_end_s" };
        out.scene["run"] = serde_json::json!({ key: until });
    }
    let Ok(scene) = Scene::from_value(out.scene.clone(), "random") else { return out };
    let run = flank_run::run(&scene, limit);
    out.flank_seconds = run.seconds;
    out.verdict = match run.failure {
        Some(Failure::Refused(why)) => Verdict::Refused(why),
        Some(Failure::Slow) => Verdict::Wrong("takes too long".into()),
        failure => {
            let difference = at_start(&truth, &run.zero).or_else(|| compare(&truth, &run.events, &mut out));
            let alarm = if let Some(Failure::Alarmed(why)) = failure { Some(why) } else { None };
            match (difference, alarm) {
                (_, Some(why)) => Verdict::Alarmed(why),
                (Some(words), None) => Verdict::Wrong(words),
                (None, None) => Verdict::Right,
            }
        }
    };
    out
}

/// What the records at t = 0 say wrongly: there is one at most, a start, and it tells the modes that the motion has.
fn at_start(truth: &Truth, zero: &[EventRow]) -> Option<String> {
    let first = &truth.sequence.first;
    if zero.len() > 1 {
        return Some(format!("{} records at t = 0", zero.len()));
    }
    let row = zero.first().filter(|_| !first.is_empty())?;
    if !row.start {
        return Some("a record at t = 0 that is no start".into());
    }
    let other = row.contacts.iter().find(|c| c.to != first[c.mesh].name())?;
    Some(format!("{} starts as {}, expected {}", other.name, other.to, first[other.mesh].name()))
}

/// The first difference.
fn compare(truth: &Truth, got: &[(Wide, usize, Kind)], out: &mut Judged) -> Option<String> {
    let limit = truth.until - 1e-9 * truth.period - truth.tolerance;
    // What is allowed at the end of a tail, the motion's own amplification included.
    let margin = |j: usize, end: Wide| {
        let before = truth.sequence.events.iter().zip(&truth.sensitivity).filter(|(e, _)| e.contact == j && e.t <= end);
        wide(truth.tolerance + INHERITED * before.fold(0.0, |m: f64, (_, s)| m.max(*s)))
    };
    let slow =
        |t: Wide, j: usize, kind: Kind| {
            kind == Kind::Impact
                && truth.sequence.tails.iter().any(|(i, a, b)| {
                    *i == j && t >= *a - (*b - *a) / wide(10.0) - margin(j, *b) && t <= *b + margin(j, *b)
                })
        };
    let mut first: Option<(f64, String)> = None;
    let mut meet = |t: f64, words: String| {
        if first.as_ref().is_none_or(|f| t < f.0) {
            first = Some((t, words));
        }
    };
    let count = got.iter().map(|e| e.1 + 1).max().unwrap_or(0);
    let contacts = truth.sequence.events.iter().map(|e| e.contact + 1).max().unwrap_or(0).max(count);
    for j in 0..contacts {
        let mut want: Vec<(Wide, Kind, f64)> = truth
            .sequence
            .events
            .iter()
            .zip(&truth.sensitivity)
            .filter(|(e, _)| e.contact == j && !slow(e.t, j, e.kind))
            .map(|(e, s)| (e.t, e.kind, *s))
            .collect();
        want.sort_by(|a, b| near(a.0).total_cmp(&near(b.0)));
        // Strikes that time cannot tell apart are one.
        want.dedup_by(|b, a| (a.1, b.1) == (Kind::Impact, Kind::Impact) && near(b.0 - a.0) <= truth.tolerance);
        let mut have: Vec<(Wide, Kind)> =
            got.iter().filter(|e| e.1 == j && !slow(e.0, j, e.2)).map(|e| (e.0, e.2)).collect();
        have.sort_by(|a, b| near(a.0).total_cmp(&near(b.0)));
        have.dedup_by(|b, a| (a.1, b.1) == (Kind::Impact, Kind::Impact) && near(b.0 - a.0) <= truth.tolerance);
        for i in 0..want.len().max(have.len()) {
            let (a, b) = (want.get(i), have.get(i));
            let earliest =
                [a.map(|a| near(a.0)), b.map(|b| near(b.0))].into_iter().flatten().fold(f64::INFINITY, f64::min);
            if earliest > limit {
                break;
            }
            let (Some((t, kind, sensitivity)), Some((u, other))) = (a, b) else {
                meet(
                    earliest,
                    format!("contact {j}: expected {}, got {}", told(a.map(|a| (a.0, a.1))), told(b.copied())),
                );
                break;
            };
            let allowed = truth.tolerance + 2.0 * f64::EPSILON * size(*t) + INHERITED * sensitivity;
            let dt = size(*u - *t);
            if kind != other || dt > allowed {
                let words = format!(
                    "contact {j}: expected {}, got {}, off by {dt:.2e}, allowed {allowed:.2e}",
                    told(Some((*t, *kind))),
                    told(b.copied())
                );
                meet(earliest, words);
                break;
            }
            out.events += 1;
            out.worst = out.worst.max(dt / allowed);
        }
    }
    first.map(|f| f.1)
}

fn told(e: Option<(Wide, Kind)>) -> String {
    e.map_or("nothing".into(), |(t, kind)| format!("{kind:?} at {:.17}", near(t)))
}
