//! Class H: undamped motion that repeats exactly. The oracle finds the period in 32 digits; Flank runs thousands of them.

use std::time::Duration;

use flank::scene::Scene;
use serde_json::{Value, json};

use super::{
    flank_run::{self, Failure},
    judge::{Verdict, start},
    model::{Model, Tweak},
    sequence::{Event, sequence},
    wide::{Wide, near, size, wide},
};

/// Share of a period that the last event may be off.
const ALLOWED: f64 = 1e-11;

/// The period and the events in it.
fn period(events: &[Event]) -> Option<(usize, Wide)> {
    (1..=events.len() / 3).find_map(|k| {
        let p = events[k].t - events[0].t;
        let repeats = |i: usize| {
            let (a, b) = (events[i], events[i + k]);
            (a.contact, a.kind) == (b.contact, b.kind) && size(b.t - a.t - p) < 1e-22 * near(p)
        };
        (0..events.len() - k).all(repeats).then_some((k, p))
    })
}

/// Judges a scene over so many periods: the verdict, the worst error in periods, the time taken.
pub fn judge(value: &Value, periods: usize, limit: Duration) -> (Verdict, f64, f64) {
    let fail = |words: &str| (Verdict::Refused(words.into()), 0.0, 0.0);
    let Ok(scene) = Scene::from_value(value.clone(), "random") else { return fail("not taken") };
    let Ok(built) = scene.build() else { return fail("no train") };
    let m = Model::new(&built.spec, Tweak::NONE);
    let told = sequence(&m, start(&m, &built, Tweak::NONE), wide(1e9), 24).events;
    let Some((k, p)) = period(&told) else { return fail("the oracle sees no period") };
    let mut long = value.clone();
    let key = if built.dimensionless { "t_end" } else { "t_end_s" };
    // Halfway between two events, after the last period.
    let last = told[0].t + p * wide(periods as f64);
    let end = near(last + (told[1].t - told[0].t) * wide(0.5));
    long["run"] = json!({ key: end });
    let Ok(scene) = Scene::from_value(long, "random") else { return fail("not taken") };
    let run = flank_run::run(&scene, limit);
    let verdict = match run.failure {
        Some(Failure::Refused(why)) => Some(Verdict::Refused(why)),
        Some(Failure::Alarmed(why)) => Some(Verdict::Alarmed(why)),
        Some(Failure::Slow) => Some(Verdict::Wrong("takes too long".into())),
        None => None,
    };
    if let Some(verdict) = verdict {
        return (verdict, 0.0, run.seconds);
    }
    let mut worst: f64 = 0.0;
    for (i, (t, contact, kind)) in run.events.iter().enumerate() {
        let want = told[i % k];
        if (want.contact, want.kind) != (*contact, *kind) {
            return (Verdict::Wrong(format!("event {i} is {kind:?}, expected {:?}", want.kind)), worst, run.seconds);
        }
        let off = size(*t - want.t - p * wide((i / k) as f64)) / near(p);
        worst = worst.max(off);
    }
    let count = periods * k + 1;
    let verdict = if run.events.len() != count {
        Verdict::Wrong(format!("{} events, expected {count}", run.events.len()))
    } else if worst > ALLOWED {
        Verdict::Wrong(format!("off by {worst:.2e} periods after {periods}"))
    } else {
        Verdict::Right
    };
    (verdict, worst, run.seconds)
}
