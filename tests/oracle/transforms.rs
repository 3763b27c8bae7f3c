//! Flank against itself: a scene and its transform give the same events, contact by contact.

use std::time::Duration;

use flank::scene::Scene;

use super::{
    flank_run::{self, Failure},
    judge::{Verdict, truth},
    scenes::{Extreme, Transform},
    sequence::Kind,
    wide::{Wide, near, size, turn, wide},
};

/// Judges one transform; the time that both runs took.
pub fn judge(t: &Transform, budget: usize, limit: Duration) -> (Verdict, f64) {
    let read = |value| Scene::from_value(value, "random");
    let (base, other) = match (read(t.base.clone()), read(t.other.clone())) {
        (Ok(base), Ok(other)) => (base, other),
        (Err(e), _) | (_, Err(e)) => return (Verdict::Refused(e.to_string()), 0.0),
    };
    let Ok(built) = base.build() else { return (Verdict::Refused("no train".into()), 0.0) };
    // What the motion amplifies, and up to where it can be compared, is the oracle's.
    let truth = truth(&built, budget);
    let (one, two) = (flank_run::run(&base, limit), flank_run::run(&other, limit));
    let seconds = one.seconds + two.seconds;
    for run in [&one, &two] {
        match &run.failure {
            None => {}
            Some(Failure::Refused(why)) => return (Verdict::Refused(why.clone()), seconds),
            Some(Failure::Alarmed(why)) => return (Verdict::Alarmed(why.clone()), seconds),
            Some(Failure::Slow) => return (Verdict::Wrong("takes too long".into()), seconds),
        }
    }
    let shift = built.spec.omega.map_or(wide(0.0), |w| wide(t.cycles as f64) * turn() / wide(w));
    let back = |(u, j, kind): (Wide, usize, Kind)| {
        let kind = match kind {
            Kind::DriveContact if t.mirrored => Kind::BackContact,
            Kind::BackContact if t.mirrored => Kind::DriveContact,
            kind => kind,
        };
        (u * wide(t.time) - shift, j, kind)
    };
    let moved: Vec<_> = two.events.iter().copied().map(back).collect();
    let sensitivity = truth.sensitivity.iter().copied().fold(0.0, f64::max);
    let until = truth.until - 1e-6 * truth.period;
    for j in 0..built.spec.contacts.len() {
        let of = |events: &[(Wide, usize, Kind)]| -> Vec<(Wide, Kind)> {
            let tail = |u: Wide, kind: Kind| {
                kind == Kind::Impact
                    && truth
                        .sequence
                        .tails
                        .iter()
                        .any(|(i, a, b)| *i == j && u >= *a - (*b - *a) && u <= *b + (*b - *a))
            };
            events.iter().filter(|e| e.1 == j && near(e.0) < until && !tail(e.0, e.2)).map(|e| (e.0, e.2)).collect()
        };
        let (a, b) = (of(&one.events), of(&moved));
        for i in 0..a.len().max(b.len()) {
            let (Some(x), Some(y)) = (a.get(i), b.get(i)) else {
                return (
                    Verdict::Wrong(format!("{}: contact {j} has {} and {} events", t.about, a.len(), b.len())),
                    seconds,
                );
            };
            let allowed = 2.0 * truth.tolerance + 4.0 * f64::EPSILON * size(x.0) + 4e-14 * sensitivity;
            if x.1 != y.1 || size(x.0 - y.0) > allowed {
                let words = format!(
                    "{}: contact {j}: {:?} at {:e} becomes {:?}, {:.2e} away, allowed {allowed:.2e}",
                    t.about,
                    x.1,
                    near(x.0),
                    y.1,
                    size(x.0 - y.0)
                );
                return (Verdict::Wrong(words), seconds);
            }
        }
    }
    (Verdict::Right, seconds)
}

/// Judges a scene of class X.
pub fn judge_extreme(extreme: &Extreme, budget: usize, limit: Duration) -> (Verdict, f64) {
    let (scene, first, next) = match extreme {
        Extreme::Transform(transform) => return judge(transform, budget, limit),
        Extreme::Flight { scene, first, next } => (scene, *first, *next),
    };
    let read = match Scene::from_value(scene.clone(), "flight") {
        Ok(read) => read,
        Err(error) => return (Verdict::Refused(error.to_string()), 0.0),
    };
    let run = flank_run::run(&read, limit);
    let verdict = match run.failure {
        Some(Failure::Refused(why)) => Verdict::Refused(why),
        Some(Failure::Alarmed(why)) => Verdict::Alarmed(why),
        Some(Failure::Slow) => Verdict::Wrong("takes too long".into()),
        None => {
            let count = ((read.built().run.end() - first) / next).floor() as usize + 1;
            let off = run.events.iter().enumerate().find_map(|(k, (t, ..))| {
                let want = first + k as f64 * next;
                // Each impact rounds the state once more.
                let allowed = 8.0 * f64::EPSILON * (k + 1) as f64 * want;
                ((near(*t) - want).abs() > allowed).then(|| format!("impact {k} at {:e}, expected {want:e}", near(*t)))
            });
            match off {
                Some(words) => Verdict::Wrong(words),
                None if run.events.len() != count => {
                    Verdict::Wrong(format!("{} impacts, expected {count}", run.events.len()))
                }
                None => Verdict::Right,
            }
        }
    };
    (verdict, run.seconds)
}
