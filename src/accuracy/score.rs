//! Errors of a solution against the reference solution.

use serde::Serialize;

use super::{Truth, contender::Performance, problem::time_apart};
use crate::baseline::Crossing;

/// Errors of one run against the truth, over its window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Score {
    /// Largest error of an event time over the events that were found, periods; absent if none was.
    pub event_time: Option<f64>,
    /// Events of the reference that were not found within 2 % of a period.
    pub missed: usize,
    /// Events found that the reference does not have.
    pub spurious: usize,
    /// Largest error of a contact's time apart, over the window's length; absent where all are rigid.
    pub apart: Option<f64>,
    /// Largest error of coordinates and velocities at the starts of cycles, relative to their sizes; absent for a run that
    /// stopped.
    pub state: Option<f64>,
    /// Largest relative error of a contact's largest force; absent for rigid contacts, and for a run that stopped.
    pub peak_force: Option<f64>,
    /// Largest error of the mechanical energy at the starts of cycles, signed, relative to the largest energy; absent for a
    /// run that stopped.
    pub energy: Option<f64>,
}

impl Score {
    /// The score of a contender's run on a problem of the given period and coordinates.
    #[must_use]
    pub fn of(truth: &Truth, run: &Performance, period: f64) -> Self {
        let end = truth.window.cycles as f64 * period;
        let (matched, missed, spurious) = pairs(&truth.passages, &run.passages, period, end);
        let event_time = largest(matched.iter().map(|(a, b)| (a.t - b.t).abs() / period));
        let apart = time_apart(&run.passages, &truth.closed, &truth.rigid, end);
        let apart = truth.apart.iter().zip(&apart).zip(&truth.rigid).filter(|(_, rigid)| !**rigid);
        let apart = largest(apart.map(|((a, b), _)| (a - b).abs() / end));
        let mut state: f64 = 0.0;
        for (a, b) in truth.sections.iter().zip(&run.sections) {
            let n = a.len() / 2;
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                state = state.max((a - b).abs() / truth.sizes[usize::from(i >= n)]);
            }
        }
        let forces = truth.peak.iter().zip(&run.peak).filter(|(exact, _)| **exact > 0.0);
        let peak_force = largest(forces.map(|(exact, found)| (found - exact).abs() / exact));
        let most = truth.energy.iter().fold(f64::MIN_POSITIVE, |m: f64, e| m.max(e.abs()));
        let energy = truth.energy.iter().zip(&run.energy).map(|(a, b)| (b - a) / most);
        let energy = energy.fold(0.0, |m: f64, e| if e.abs() > m.abs() { e } else { m });
        let whole = run.stopped.is_none();
        let [state, energy] = [state, energy].map(|e| Some(e).filter(|e| whole && e.is_finite()));
        let peak_force = peak_force.filter(|e| whole && e.is_finite());
        let apart = apart.filter(|_| whole);
        Self { event_time, missed, spurious, apart, state, peak_force, energy }
    }

    /// Returns whether the sequence of events is right: none missed, none spurious.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.missed == 0 && self.spurious == 0
    }
}

/// Events further apart than this share of a period are not the same event.
const GATE: f64 = 0.02;
/// Events further apart than this share of the time to the next passage of the same kind are not the same event either.
const NEIGHBOUR: f64 = 0.45;

fn kind(c: &Crossing) -> (usize, bool, bool) {
    (c.contact, c.back, c.closing)
}

/// Returns the pairs of events of the same kind, in order, and the numbers of events of `truth` and of `other` without a partner.
/// Events within the gate of `end` need no partner, as the partner may lie beyond `end`.
pub(super) fn pairs<'a>(
    truth: &'a [Crossing],
    other: &'a [Crossing],
    period: f64,
    end: f64,
) -> (Vec<(&'a Crossing, &'a Crossing)>, usize, usize) {
    let mut kinds: Vec<_> = truth.iter().chain(other).map(kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let (mut matched, mut missed, mut spurious) = (Vec::new(), 0, 0);
    let counts = |c: &Crossing| usize::from(c.t < end - GATE * period);
    for of in kinds {
        let mine: Vec<&Crossing> = truth.iter().filter(|c| kind(c) == of).collect();
        let mut theirs = other.iter().filter(|c| kind(c) == of).peekable();
        for (i, event) in mine.iter().enumerate() {
            let gap = |j: Option<&&Crossing>| j.map_or(f64::INFINITY, |n| NEIGHBOUR * (n.t - event.t).abs());
            let gate = (GATE * period).min(gap(mine.get(i + 1))).min(gap(i.checked_sub(1).and_then(|i| mine.get(i))));
            while let Some(early) = theirs.next_if(|c| c.t < event.t - gate) {
                spurious += counts(early);
            }
            match theirs.next_if(|c| c.t <= event.t + gate) {
                Some(found) => matched.push((*event, found)),
                None => missed += counts(event),
            }
        }
        spurious += theirs.map(counts).sum::<usize>();
    }
    (matched, missed, spurious)
}

/// Returns the largest of the errors, if there are any.
fn largest(errors: impl Iterator<Item = f64>) -> Option<f64> {
    errors.fold(None, |most: Option<f64>, e| Some(most.map_or(e, |m| m.max(e))))
}
