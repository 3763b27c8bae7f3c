//! A run checked arc by arc, by two other ways to the next event; see `docs/EVENTS.md`.
//!
//! [`Verifier`] watches a run. From the state after each instant the next event is found again: by series with other steps
//! and another order, and by values alone. It breaks the run off at the first [`Difference`].

mod collocation;
mod points;
mod series;
mod sizes;

use std::ops::ControlFlow;

use serde::Serialize;

use crate::{
    engine::{Observer, State},
    event::EventRecord,
    hybrid::{ContactMode, ContactView, GuardId, GuardSet, HybridSystem, Instant, Mode, Watch},
    integrate::{Choice, PerMode},
};

/// Accuracy of the check by values, and the time within which events are one to it, in periods.
pub const TOLERANCE: f64 = 1e-9;

/// The first event in which a check does not agree with the run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("at t = {t} s the run has {expected}, the check by {check} {found}{}", self.apart())]
pub struct Difference {
    /// Time of the run's event, or of the one it does not have, s.
    pub t: f64,
    /// Contacts and kinds of the run's events.
    pub expected: String,
    /// Contacts and kinds that the check found.
    pub found: String,
    /// By how much the run's event is later, s, if both have one.
    pub amount: Option<f64>,
    /// Which check: `series` or `values`.
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
    /// Arcs whose end agrees.
    pub compared: u64,
    /// Arcs that the check cannot judge: touches, dips and flights below its error, tails of accumulations, stiff arcs.
    pub not_judged: u64,
    /// Steps taken.
    pub steps: u64,
}

/// What was verified.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verification {
    /// The check by series with other steps and another order.
    pub series: Tally,
    /// The check by values.
    pub values: Tally,
    /// The first difference, in words.
    pub difference: Option<String>,
}

/// Rounding of the two instants that an arc lies between, s.
fn resolution(system: &dyn HybridSystem, at: Instant) -> f64 {
    8.0 * f64::EPSILON * f64::EPSILON * system.clock().time(at).hi.abs()
}

/// A guard that fires in a mode.
#[derive(Clone, Copy, Debug)]
struct Seen {
    mode: Mode,
    id: GuardId,
}

impl Seen {
    fn new(from: &State, id: GuardId) -> Self {
        Self { mode: from.jump.mode, id }
    }
}

/// How an arc compares.
enum Verdict {
    Same,
    NotJudged,
    /// What was found, and by how much the run is later, s.
    Differs(Vec<Seen>, Option<f64>),
}

/// Where one check stands. It lags behind the run until no more events can belong to the instant it is to compare.
struct Lane {
    last: State,
    pending: Vec<EventRecord>,
    touches: Vec<(Instant, GuardSet)>,
    tally: Tally,
}

/// Watches a run and checks it. The run has to start where the verifier does.
pub struct Verifier<'s, S> {
    system: &'s S,
    period: Option<f64>,
    choice: Choice,
    lanes: [Lane; 2],
    series: series::Series,
    points: points::Points,
    sizes: sizes::Sizes,
    difference: Option<Difference>,
}

const SERIES: usize = 0;
/// Steps that an arc takes, where they are not known.
const STEPS: u64 = 16;
const CHECKS: [&str; 2] = ["series", "values"];

impl<'s, S: HybridSystem + ContactView> Verifier<'s, S> {
    /// A verifier of a run from `state`. `period` is the unit of its tolerance, s; without one it is the length of each arc.
    /// `choice` is the integrator of the run: arcs of another method than the Taylor series are not compared with series.
    #[must_use]
    pub fn new(system: &'s S, state: &State, period: Option<f64>, choice: Choice) -> Self {
        let lane = || Lane { last: state.clone(), pending: Vec::new(), touches: Vec::new(), tally: Tally::default() };
        Self {
            system,
            period,
            choice,
            lanes: [lane(), lane()],
            series: series::Series::default(),
            points: points::Points::new(system.dim()),
            sizes: sizes::Sizes::default(),
            difference: None,
        }
    }

    /// Checks what is left: the last events, and that nothing happens from there to `end`, where the run ended.
    ///
    /// # Errors
    /// The first [`Difference`] of the run.
    pub fn finish(&mut self, end: Instant) -> Result<(), Difference> {
        for check in 0..CHECKS.len() {
            self.settle(check);
            if self.difference.is_none() && self.system.clock().between(self.lanes[check].last.at, end) > 0.0 {
                self.judge(check, end);
            }
        }
        self.difference().map_or(Ok(()), Err)
    }

    /// The first difference so far.
    #[must_use]
    pub fn difference(&self) -> Option<Difference> {
        self.difference.clone()
    }

    /// What was done.
    #[must_use]
    pub fn verification(&self) -> Verification {
        let [series, values] = &self.lanes;
        Verification {
            series: Tally { steps: self.series.steps, ..series.tally },
            values: Tally { steps: self.points.steps, ..values.tally },
            difference: self.difference.as_ref().map(ToString::to_string),
        }
    }

    /// Compares the events that are waiting, and goes on from the last of them.
    fn settle(&mut self, check: usize) {
        let Some(first) = self.lanes[check].pending.first() else { return };
        if self.difference.is_none() {
            self.judge(check, first.at);
        }
        let lane = &mut self.lanes[check];
        if let Some(record) = lane.pending.pop() {
            lane.last = State { at: record.at, x: record.x_plus, jump: record.jump };
        }
        lane.pending.clear();
        lane.touches.clear();
    }

    /// Compares the arc that ends at `end`.
    fn judge(&mut self, check: usize, end: Instant) {
        let Self { system, lanes, sizes, .. } = self;
        let lane = &mut lanes[check];
        let length = system.clock().between(lane.last.at, end);
        let times = (length, self.period.unwrap_or(length));
        let by_series = match self.choice {
            Choice::Taylor => true,
            Choice::Auto => !PerMode::is_stiff(*system, lane.last.jump.mode, length),
            _ => false,
        };
        let verdict = if times.1 <= 0.0 || check == SERIES && !by_series {
            Verdict::NotJudged
        } else if check == SERIES {
            self.series.check(*system, sizes, &lane.last, &lane.pending, &lane.touches, times)
        } else {
            self.points.check(*system, sizes, &lane.last, &lane.pending, times)
        };
        match verdict {
            Verdict::Same => lane.tally.compared += 1,
            Verdict::NotJudged => lane.tally.not_judged += 1,
            Verdict::Differs(found, amount) => {
                let run = lane.pending.iter().flat_map(|r| r.fired.iter().map(|id| Seen { mode: r.from, id }));
                let expected = words(*system, run);
                let t = system.clock().time(end).value();
                // An event the run does not have is told by its own time.
                let t = if lane.pending.is_empty() { t - amount.unwrap_or(0.0) } else { t };
                let found = words(*system, found.into_iter());
                self.difference = Some(Difference { t, expected, found, amount, check: CHECKS[check] });
            }
        }
    }

    /// The time, s, within which a record belongs to those that are waiting.
    fn window(&mut self, check: usize, record: &EventRecord) -> f64 {
        let lane = &self.lanes[check];
        let Some(first) = lane.pending.first() else { return 0.0 };
        let length = self.system.clock().between(lane.last.at, first.at);
        let unit = self.period.unwrap_or(length);
        if check != SERIES {
            return TOLERANCE * unit;
        }
        let mut time =
            |record| series::uncertainty(self.system, &mut self.sizes, &lane.last, record, (length, unit), STEPS);
        2.0 * (time(first) + time(record))
    }
}

impl<S: HybridSystem + ContactView> Observer for Verifier<'_, S> {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        for check in 0..CHECKS.len() {
            if record.graze {
                self.lanes[check].touches.push((record.at, record.fired));
                continue;
            }
            let first = self.lanes[check].pending.first();
            let apart = first.map(|first| self.system.clock().between(first.at, record.at));
            let given = record.start || record.accumulation.is_some();
            if given || apart.is_some_and(|apart| apart > self.window(check, record)) {
                self.settle(check);
            }
            let lane = &mut self.lanes[check];
            if given {
                // The state at the end of an accumulation is that after its last impact.
                lane.last.x.clone_from(&record.x_plus);
                lane.last.jump = record.jump;
                lane.tally.not_judged += u64::from(!record.start);
            } else {
                lane.pending.push(record.clone());
            }
        }
        if self.difference.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Contacts and what happens to them.
fn words<S: ContactView>(system: &S, seen: impl Iterator<Item = Seen>) -> String {
    let word = |seen: Seen| {
        let (j, watch) = system.watch(seen.id);
        let before = system.contact_mode(j, seen.mode);
        let kind = match (before, watch) {
            (ContactMode::Separated, _) if system.is_rigid(j) => "impact",
            (ContactMode::Separated, Watch::DriveFlank) => "drive_contact",
            (ContactMode::Separated, _) => "back_contact",
            (_, Watch::Force) if before.is_closed() && system.is_rigid(j) => "release",
            // A flank is not watched at rest: what follows at the same instant.
            _ if system.is_rigid(j) => "impact",
            (ContactMode::DriveDetached, Watch::Force) => "drive_contact",
            (ContactMode::BackDetached, Watch::Force) => "back_contact",
            _ if before.is_closed() => "separation",
            _ => "clear",
        };
        format!("{} {kind}", system.contact_name(j))
    };
    let mut words: Vec<String> = seen.map(word).collect();
    words.dedup();
    if words.is_empty() { "no event".to_owned() } else { words.join(", ") }
}
