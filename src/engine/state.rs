//! Where a run stands, what it is allowed, and what it has done.

use crate::{
    event::EventRecord,
    hybrid::{Instant, Jump},
};

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
    /// A chatter is summed when the rebound speed has fallen to this fraction of the fastest in the sequence, `(0, 1)`.
    pub chatter_fraction: f64,
    /// It is summed as well when the rebound speed has fallen below this, in the guards' units per second; 0 for never.
    pub chatter_speed: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { max_events: u64::MAX, chatter_fraction: 1e-10, chatter_speed: 0.0 }
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
    /// Impact sequences summed to their accumulation point.
    pub accumulations: u64,
    /// Interval subdivisions of the root isolation.
    pub splits: u64,
}

impl Counters {
    pub(super) fn add(&mut self, record: &EventRecord) {
        self.grazes += u64::from(record.graze);
        self.accumulations += u64::from(record.accumulation.is_some());
        if !record.fired.is_empty() && !record.start && !record.graze {
            self.events += 1;
            self.fired += record.fired.len() as u64;
        }
    }
}
