//! Flank against itself: a scene and its transform give the same events, contact by contact.

use std::time::Duration;

use flank::scene::Scene;

use super::{
    flank_run::{self, Failure},
    judge::{Verdict, truth},
    scenes::Transform,
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
