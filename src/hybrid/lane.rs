use std::ops::ControlFlow;

use super::{Columns, ContactMode, GuardId, Instant, Jump, Mode};

/// Steps of a [`Lane`] between two instants that it passes to its host.
pub(crate) const PASSED: u64 = 1024;

/// Maximum number of steps of a lap with records. A step is at most some two radians of its fastest rate long: in a lap a derivative
/// changes by less than the range of numbers.
pub(crate) const RECORDED: u64 = 256;

/// Guard of an impact and the motion after it.
#[derive(Clone, Copy, Debug)]
pub struct Rebound {
    /// Instant of the impact.
    pub at: Instant,
    /// The guard of the impact.
    pub guard: GuardId,
    /// First three time derivatives of the guard after the impact.
    pub derivatives: [f64; 3],
    /// Rounding of the value of the guard, formed from the state alone.
    pub rounding: f64,
    /// End of the motion in its mode at the latest.
    pub until: Instant,
}

/// Change of a contact in a [`Lane`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneEvent {
    /// Instant of the event.
    pub at: Instant,
    /// Index of the contact.
    pub contact: usize,
    /// State of the contact before.
    pub was: ContactMode,
    /// State of the contact after.
    pub is: ContactMode,
    /// Rate of the contact's deflection before, m/s.
    pub rate: f64,
}

/// Derivative with respect to a start, which a [`Lane`] advances.
#[derive(Debug)]
pub struct LaneTangent<'a> {
    /// The derivative, `[dim][count]`.
    pub columns: &'a mut Columns,
    /// `∫ div f dt + Σ ln |det|` of jumps so far.
    pub volume: &'a mut f64,
}

/// Records that a [`Lane`] makes in place of calls to an observer, as far as the observer requests them.
#[derive(Debug, Default)]
pub struct LaneRecords<'a> {
    /// Time in each state of each contact, s, in the order of [`ContactMode`].
    pub times: Option<&'a mut [[f64; 5]]>,
    /// Changes of contacts, in the order of time.
    pub events: Option<&'a mut Vec<LaneEvent>>,
    /// Largest absolute value of each component of the state at these changes, `[dim]`.
    pub sizes: Option<&'a mut [f64]>,
    /// Derivative.
    pub tangent: Option<LaneTangent<'a>>,
}

impl<'a> LaneRecords<'a> {
    /// Returns whether nothing is requested.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.times.is_none() && self.events.is_none() && self.sizes.is_none() && self.tangent.is_none()
    }

    /// Returns the records that either of two observers requests; `None` if both request the same one.
    #[must_use]
    pub fn and(self, other: Self) -> Option<Self> {
        fn either<T>(first: Option<T>, second: Option<T>) -> Option<Option<T>> {
            if first.is_some() && second.is_some() { None } else { Some(first.or(second)) }
        }
        Some(Self {
            times: either(self.times, other.times)?,
            events: either(self.events, other.events)?,
            sizes: either(self.sizes, other.sizes)?,
            tangent: either(self.tangent, other.tangent)?,
        })
    }
}

/// Host of a [`Lane`], which decides for it.
pub trait LaneHost {
    /// Receives an instant that the lane has passed, once in about a thousand steps. A break ends the lap.
    fn pass(&mut self, at: Instant) -> ControlFlow<()>;

    /// Returns whether the exact flow of `mode` may be used.
    fn is_exact(&mut self, mode: &Mode) -> bool;

    /// Adds `arcs` to the arcs that the run has made in `mode`. Returns their number.
    fn count(&mut self, mode: &Mode, arcs: u64) -> u64;

    /// Receives the largest rounding of a guard that the lane has met, in units of the guard.
    fn meet(&mut self, guard: GuardId, rounding: f64);

    /// Receives the rebound of an impact. Returns whether the impact sequence ends with it.
    fn ends(&mut self, rebound: &Rebound) -> bool;
}

/// Start of a [`Lane`], which overwrites it with its end.
#[derive(Debug)]
pub struct LanePoint<'a> {
    /// Instant.
    pub at: &'a mut Instant,
    /// State, `[dim]`.
    pub x: &'a mut [f64],
    /// Mode and exact zeros.
    pub jump: &'a mut Jump,
    /// Values kept as by [`JetField::carry`](super::JetField::carry).
    pub carried: &'a mut Vec<f64>,
    /// Number of arcs that the run has made.
    pub arcs: u64,
    /// The guard of an impact at the start, if its rebound has not been reported yet.
    pub impact: Option<GuardId>,
}

/// Limits of a [`Lane`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneLimits {
    /// End of the motion.
    pub bound: Instant,
    /// Start of the observation. The lane stops before an arc that ends there or later.
    pub observed: Instant,
    /// Maximum number of events.
    pub events: u64,
    /// Maximum number of leaps and steps.
    pub steps: u64,
}

/// Work done by a [`Lane`], and its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lap {
    /// Number of leaps and steps.
    pub steps: u64,
    /// Number of smooth arcs.
    pub arcs: u64,
    /// Number of events.
    pub events: u64,
    /// Number of guards that fired in these events.
    pub fired: u64,
    /// Number of known switching times passed.
    pub switches: u64,
    /// Number of subdivisions spent on guards.
    pub splits: u64,
    /// True if the instant at the start is complete and the host has received its rebound. It distinguishes a lap without progress beyond
    /// that from a lap that did nothing.
    pub closes: bool,
    /// Kind of its end.
    pub end: LapEnd,
}

/// Kind of the end of a [`Lane`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LapEnd {
    /// Start of an arc whose end the lane could not decide, and of which nothing is done. The instant there is complete and has to be
    /// recorded. Without progress and without `closes`, nothing has changed.
    #[default]
    Undecided,
    /// The bound of the lane.
    Bound,
    /// An impact with which its sequence ends.
    Sequence,
}

/// A motion from event to event without calls to an observer. It has the same bits as the motion under observation.
pub trait Lane {
    /// Returns whether it can make the `records`.
    fn makes(&self, records: &LaneRecords<'_>) -> bool;

    /// Advances from `point` within `limits`, until it cannot decide the next event.
    fn run(
        &mut self,
        point: LanePoint<'_>,
        limits: LaneLimits,
        records: LaneRecords<'_>,
        host: &mut dyn LaneHost,
    ) -> Lap;
}
