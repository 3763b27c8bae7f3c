//! Where a run stands, what it is allowed, and what it has done.

use crate::{
    event::EventRecord,
    hybrid::{FULL_PRECISION, Instant, Jump},
};

/// Shares of its tolerance that an arc gives to a step: for the steps it takes, times how much faster than its guard the fastest body may
/// be. That is no bound, events tell what they have; and it is cheap, as a step is longer by the 25th root only.
const SHARES: f64 = 4096.0;

/// Where a run stands.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// When.
    pub at: Instant,
    /// State, `[dim]`.
    pub x: Vec<f64>,
    /// Mode and exact zeros.
    pub jump: Jump,
}

/// A state, and what its doubles alone do not hold.
#[derive(Clone)]
pub(super) struct Point {
    pub state: State,
    /// What the state is beyond the rounding of its `x`, `[dim]`.
    pub low: Vec<f64>,
    /// What the last step kept for the next arc.
    pub carried: Vec<f64>,
}

impl Point {
    pub fn new(state: State) -> Self {
        Self { low: vec![0.0; state.x.len()], carried: Vec::new(), state }
    }
}

/// What a run is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Records after which the run ends with [`EventBudgetSpent`](super::Outcome::EventBudgetSpent).
    pub max_events: u64,
    /// Steps after which the run fails with [`EngineError::Steps`](super::EngineError::Steps).
    pub max_steps: u64,
    /// A chatter is summed when the rebound speed has fallen to this fraction of the fastest in the sequence, `(0, 1)`.
    pub chatter_fraction: f64,
    /// Error of the time of an event that its arc may add, of the period, `[0, 0.001]`; 0 is full precision. It is aimed at: what is
    /// known less well counts as a [near touch](Counters::near_touches).
    pub event_tolerance: f64,
    /// The period that this is a fraction of, s; that of the system's clock if there is none.
    pub period: Option<f64>,
    /// Replaces the fraction where the rebound speed has fallen below this, in the guards' units per second: a chatter of one contact is
    /// summed then too, if the same expansion holds. 0 for never.
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

/// Work done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Dense steps taken, the cut ones included.
    pub steps: u64,
    /// Smooth arcs.
    pub arcs: u64,
    /// Records of a changed mode or state.
    pub events: u64,
    /// Guards fired in them.
    #[serde(rename = "guards_fired")]
    pub fired: u64,
    /// Known switching times passed.
    pub switches: u64,
    /// Touches without crossing.
    pub grazes: u64,
    /// Events whose time is less certain than [`Options::event_tolerance`], touches included: a dip of a guard that is shorter may have
    /// been taken for none. Zero at full precision.
    pub near_touches: u64,
    /// Impact sequences summed to their accumulation point.
    pub accumulations: u64,
    /// Interval subdivisions of the root isolation.
    pub splits: u64,
}

impl Options {
    /// Truncation of a step, relative to the rates.
    pub(super) fn truncation(&self) -> f64 {
        FULL_PRECISION.max(self.event_tolerance / SHARES)
    }

    /// What a step leaves out on request, relative to the rates: zero at full precision.
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
