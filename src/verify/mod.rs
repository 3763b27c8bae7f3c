//! Check of a run arc by arc, by two independent methods for the next event; see `docs/EVENTS.md`.
//!
//! [`Verifier`] observes a run. From the state after each instant it finds the next event again: by series with other steps and another
//! order, and by values alone. It stops the run at the first [`Difference`].

mod arc;
mod collocation;
mod series;
mod values;

use std::ops::ControlFlow;

use serde::Serialize;

use self::{arc::Arc, collocation::Collocation};
use crate::{
    engine::{Observer, State},
    event::EventRecord,
    hybrid::{ContactMode, ContactView, GuardId, HybridSystem, Instant, Mode, Watch},
    integrate::{Choice, PerMode},
};

/// Accuracy of the check by values, and the time within which it counts events as one, in periods.
pub const TOLERANCE: f64 = 1e-9;

/// First event at which a check disagrees with the run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("at t = {t} s the run has {expected}, the check by {check} {found}{}", self.apart())]
#[non_exhaustive]
pub struct Difference {
    /// Time of the event of the run, or of the missing one, s.
    pub t: f64,
    /// Contacts and kinds of the events of the run.
    pub expected: String,
    /// Contacts and kinds that the check found.
    pub found: String,
    /// Delay of the event of the run, s, if both have one.
    pub amount: Option<f64>,
    /// Name of the check: `series` or `values`.
    pub check: &'static str,
}

impl Difference {
    fn apart(&self) -> String {
        match self.amount {
            Some(s) => format!(", {:e} s {}", s.abs(), if s < 0.0 { "later" } else { "earlier" }),
            None if self.expected == self.found => " with other contacts closed after it".to_owned(),
            None => String::new(),
        }
    }
}

/// Work of one check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Number of arcs with the same end.
    pub compared: u64,
    /// Number of arcs that the check cannot judge: touches, dips and flights below its error, tails of accumulations, stiff arcs.
    pub not_judged: u64,
    /// Number of steps.
    pub steps: u64,
}

/// Result of a verification.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Verification {
    /// The check by series with other steps and another order.
    pub series: Tally,
    /// The check by values.
    pub values: Tally,
    /// First difference, in words.
    pub difference: Option<String>,
}

/// A guard that fires in a mode.
type FiringGuard = (Mode, GuardId);

fn fired(record: &EventRecord) -> impl Iterator<Item = FiringGuard> {
    record.fired.iter().map(|id| (record.from.clone(), id))
}

/// Result of the comparison of an arc.
enum Verdict {
    Same,
    NotJudged,
    /// Events found, and the delay of the run, s.
    Differs(Vec<FiringGuard>, Option<f64>),
}

/// Position of one check. It lags behind the run until no more events can belong to the instant that it is to compare.
struct CheckPosition {
    /// State at the start of the arc.
    last: State,
    /// Events at the end of the arc; if empty, the arc has no event.
    pending: Vec<EventRecord>,
    /// Touches on the arc.
    touches: Vec<EventRecord>,
}

/// Observes a run and checks it. The run must start at the state of the verifier.
pub struct Verifier<'s, S> {
    system: &'s S,
    period: Option<f64>,
    choice: Choice,
    lanes: [CheckPosition; 2],
    tallies: [Tally; 2],
    collocation: Collocation,
    difference: Option<Difference>,
}

const SERIES: usize = 0;
const CHECKS: [&str; 2] = ["series", "values"];
/// Assumed number of steps of an arc, where it is unknown.
const STEPS: u64 = 16;

impl<'s, S: HybridSystem + ContactView> Verifier<'s, S> {
    /// Returns a verifier of a run from `state`. `period` is the unit of its tolerance, s; without one it is the length of each arc.
    /// `choice` is the integrator of the run: arcs of another method than the Taylor series are not compared with series.
    #[must_use]
    pub fn new(system: &'s S, state: &State, period: Option<f64>, choice: Choice) -> Self {
        let lane = || CheckPosition { last: state.clone(), pending: Vec::new(), touches: Vec::new() };
        Self {
            system,
            period,
            choice,
            lanes: [lane(), lane()],
            tallies: Default::default(),
            collocation: Collocation::new(system.dim()),
            difference: None,
        }
    }

    /// Checks the rest: the last events, and the absence of events from there to `end`, the end of the run.
    ///
    /// # Errors
    /// The first [`Difference`] of the run.
    pub fn finish(&mut self, end: Instant) -> Result<(), Difference> {
        for check in 0..CHECKS.len() {
            self.settle(check);
            if self.system.clock().between(self.lanes[check].last.at, end) > 0.0 {
                self.judge(check, end);
            }
        }
        self.difference().map_or(Ok(()), Err)
    }

    /// Returns the first difference so far.
    #[must_use]
    pub fn difference(&self) -> Option<Difference> {
        self.difference.clone()
    }

    /// Returns the result so far.
    #[must_use]
    pub fn verification(&self) -> Verification {
        let [series, values] = self.tallies;
        Verification { series, values, difference: self.difference.as_ref().map(ToString::to_string) }
    }

    /// Compares the pending events, and continues from the last of them.
    fn settle(&mut self, check: usize) {
        let Some(first) = self.lanes[check].pending.first() else { return };
        self.judge(check, first.at);
        let lane = &mut self.lanes[check];
        if let Some(record) = lane.pending.pop() {
            lane.last = State { at: record.at, x: record.x_plus, jump: record.jump };
        }
        lane.pending.clear();
        lane.touches.clear();
    }

    /// Compares the arc that ends at `end`, unless a difference was found before.
    fn judge(&mut self, check: usize, end: Instant) {
        if self.difference.is_some() {
            return;
        }
        let (system, tally) = (self.system, &mut self.tallies[check]);
        let arc = Arc::new(system, &self.lanes[check], end, self.period);
        let is_soft = || !PerMode::is_stiff(system, &arc.lane.last.jump.mode, arc.length);
        let by_series = self.choice == Choice::Taylor || self.choice == Choice::Auto && is_soft();
        let (verdict, steps) = if arc.unit <= 0.0 || check == SERIES && !by_series {
            (Verdict::NotJudged, 0)
        } else if check == SERIES {
            series::check(&arc)
        } else {
            values::check(&arc, &mut self.collocation)
        };
        tally.steps += steps;
        match verdict {
            Verdict::Same => tally.compared += 1,
            Verdict::NotJudged => tally.not_judged += 1,
            Verdict::Differs(found, amount) => {
                let (expected, found) = (words(system, arc.lane.pending.iter().flat_map(fired)), words(system, found));
                let t = system.clock().time(end).value();
                // An event that the run lacks is reported at its own time.
                let t = if arc.lane.pending.is_empty() { t - amount.unwrap_or(0.0) } else { t };
                self.difference = Some(Difference { t, expected, found, amount, check: CHECKS[check] });
            }
        }
    }

    /// Receives a record: it belongs to the pending instant, or settles that instant.
    fn take(&mut self, check: usize, record: &EventRecord) {
        if record.graze {
            return self.lanes[check].touches.push(record.clone());
        }
        let given = record.start || record.accumulation.is_some();
        let lane = &self.lanes[check];
        let later = lane.pending.first().is_some_and(|first| {
            let apart = self.system.clock().between(first.at, record.at);
            let arc = Arc::new(self.system, lane, first.at, self.period);
            let [ours, next] = [first, record].map(|record| arc.uncertainty(record, STEPS));
            let stated = first.conditioning.time + record.conditioning.time;
            apart > if check == SERIES { 2.0 * (ours + next) } else { TOLERANCE * arc.unit + stated }
        });
        if given || later {
            self.settle(check);
        }
        let lane = &mut self.lanes[check];
        if given {
            // The state at the end of an accumulation is the state after its last impact.
            lane.last.x.clone_from(&record.x_plus);
            lane.last.jump = record.jump.clone();
            self.tallies[check].not_judged += u64::from(!record.start);
        } else {
            lane.pending.push(record.clone());
        }
    }
}

impl<S: HybridSystem + ContactView> Observer for Verifier<'_, S> {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        (0..CHECKS.len()).for_each(|check| self.take(check, record));
        if self.difference.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Describes contacts and their events in words.
fn words<S: ContactView>(system: &S, seen: impl IntoIterator<Item = FiringGuard>) -> String {
    let word = |(mode, id): FiringGuard| {
        let (j, watch) = system.watch(id);
        let kind = match (system.contact_mode(j, &mode), watch) {
            (before, Watch::Force) if system.is_rigid(j) && before.is_closed() => "release",
            // A flank is not watched at rest: this is a later jump at the same instant.
            _ if system.is_rigid(j) => "impact",
            (ContactMode::Separated, Watch::DriveFlank) | (ContactMode::DriveDetached, Watch::Force) => "drive_contact",
            (ContactMode::Separated, _) | (ContactMode::BackDetached, Watch::Force) => "back_contact",
            (before, _) if before.is_closed() => "separation",
            _ => "clear",
        };
        format!("{} {kind}", system.contact_name(j))
    };
    let mut words: Vec<String> = seen.into_iter().map(word).collect();
    words.dedup();
    if words.is_empty() { "no event".to_owned() } else { words.join(", ") }
}
