//! Position of a run, its limits and its counters.

use crate::{
    event::EventRecord,
    hybrid::{FULL_PRECISION, Instant, Jump},
};

/// Divisor from the tolerance of an arc to that of a step. It covers the number of steps, times the ratio of the fastest speed to that of
/// the guard. It is no bound: events report their actual uncertainty. It is cheap: a step shortens only by the 25th root.
const SHARES: f64 = 4096.0;

/// Instant, state and mode of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Current instant.
    pub at: Instant,
    /// State vector, `[dim]`.
    pub x: Vec<f64>,
    /// Mode and exact zeros.
    pub jump: Jump,
}

/// State with the digits that its doubles do not hold.
#[derive(Clone)]
pub(super) struct WideState {
    pub state: State,
    /// Part of the state below the rounding of its `x`, `[dim]`.
    pub low: Vec<f64>,
    /// Values that the last step carried over to the next arc.
    pub carried: Vec<f64>,
}

impl WideState {
    pub fn new(state: State) -> Self {
        Self { low: vec![0.0; state.x.len()], carried: Vec::new(), state }
    }
}

/// Limits and tolerances of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Records after which the run ends with [`EventBudgetSpent`](super::Outcome::EventBudgetSpent).
    pub max_events: u64,
    /// Steps after which the run fails with [`EngineError::Steps`](super::EngineError::Steps).
    pub max_steps: u64,
    /// A chatter is summed when the rebound speed has fallen to this fraction of the fastest in the sequence, `(0, 1)`.
    pub chatter_fraction: f64,
    /// Error that an arc may add to the time of an event, as a fraction of the period, `[0, 0.001]`; 0 is full precision. It is a target:
    /// an event with a larger error counts as a [near touch](Counters::near_touches).
    pub event_tolerance: f64,
    /// Period to which `event_tolerance` refers, s; that of the clock of the system if `None`.
    pub period: Option<f64>,
    /// Rebound speed below which a chatter of one contact is summed even above the fraction, in units of the guard per second. The same
    /// expansion must hold. 0 for never.
    pub chatter_speed: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            max_events: u64::MAX,
            max_steps: u64::MAX,
            chatter_fraction: 1e-10,
            event_tolerance: 0.0,
            period: None,
            chatter_speed: 0.0,
        }
    }
}

/// Counts of the work done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct Counters {
    /// Dense steps taken, including those cut at an event.
    pub steps: u64,
    /// Number of smooth arcs.
    pub arcs: u64,
    /// Records with a changed mode or state.
    pub events: u64,
    /// Guards fired in these records.
    #[serde(rename = "guards_fired")]
    pub fired: u64,
    /// Known switching times passed.
    pub switches: u64,
    /// Touches without crossing.
    pub grazes: u64,
    /// Events whose time is less certain than [`Options::event_tolerance`], touches included. Shorter dips of a guard may have been missed.
    /// Zero at full precision.
    pub near_touches: u64,
    /// Impact sequences summed to their accumulation point.
    pub accumulations: u64,
    /// Interval subdivisions of the root isolation.
    pub splits: u64,
}

impl Options {
    /// Returns the truncation of a step, relative to the rates.
    pub(super) fn truncation(&self) -> f64 {
        FULL_PRECISION.max(self.event_tolerance / SHARES)
    }

    /// Returns the additional truncation of a step on request, relative to the rates: zero at full precision.
    #[must_use]
    pub fn left_out(&self) -> f64 {
        self.truncation() - FULL_PRECISION
    }
}

impl Counters {
    /// Counts a record; `tolerance` is that of its time, s, 0 at full precision.
    pub(super) fn add(&mut self, record: &EventRecord, tolerance: f64) {
        let is_near = record.graze || record.conditioning.time > tolerance;
        self.near_touches += u64::from(is_near && tolerance > 0.0);
        self.grazes += u64::from(record.graze);
        self.accumulations += u64::from(record.accumulation.is_some());
        if !record.fired.is_empty() && !record.start && !record.graze {
            self.events += 1;
            self.fired += record.fired.len() as u64;
        }
    }
}
