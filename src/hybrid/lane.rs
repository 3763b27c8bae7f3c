use super::{GuardId, Instant, Jump, Mode};

/// What may follow an impact: the guard that fell, and the motion after it.
#[derive(Clone, Copy, Debug)]
pub struct Rebound {
    /// When.
    pub at: Instant,
    /// The guard of the impact.
    pub guard: GuardId,
    /// Its first three derivatives in time after it.
    pub derivatives: [f64; 3],
    /// Rounding of its value, formed from the state alone.
    pub rounding: f64,
    /// How long the motion goes on as it is, s, if nothing happens.
    pub left: f64,
}

/// What a [`Lane`] asks on its way.
pub trait LaneHost {
    /// Whether `mode` is left to its exact flow.
    fn is_exact(&mut self, mode: &Mode) -> bool;

    /// An impact is over, and its rebound known. Whether the sequence that it belongs to ends with it.
    fn ends(&mut self, rebound: &Rebound) -> bool;
}

/// Where a [`Lane`] starts, and where it has led to.
#[derive(Debug)]
pub struct LanePoint<'a> {
    /// When.
    pub at: &'a mut Instant,
    /// State, `[dim]`.
    pub x: &'a mut [f64],
    /// Mode and exact zeros.
    pub jump: &'a mut Jump,
    /// As of [`JetField::carry`](super::JetField::carry).
    pub carried: &'a mut Vec<f64>,
    /// Arcs that the run has made.
    pub arcs: u64,
    /// The guard of an impact there, of which the rebound is not known yet.
    pub impact: Option<GuardId>,
}

/// The most that a [`Lane`] may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Events.
    pub events: u64,
    /// Leaps.
    pub steps: u64,
}

/// What a [`Lane`] has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lap {
    /// Leaps.
    pub steps: u64,
    /// Smooth arcs.
    pub arcs: u64,
    /// Events, each of one guard.
    pub events: u64,
    /// Known switching times passed.
    pub switches: u64,
    /// What has happened at the instant where it started is complete, and the host has been told of its rebound: so a lap that has come no
    /// farther is none that has done nothing.
    pub closes: bool,
    /// Where it ends.
    pub end: LapEnd,
}

/// Where a [`Lane`] ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LapEnd {
    /// Where it could not decide what comes next: at the start of that arc, of which nothing is done. What has happened there is done, and
    /// belongs on record. Unless the start is closed all is as it was.
    #[default]
    Undecided,
    /// At its bound.
    Bound,
    /// After an impact with which its sequence ends.
    Sequence,
}

/// A motion from event to event of which nobody looks at more than where it leads. It has the bits that it has where it is looked at.
pub trait Lane {
    /// Goes on from `point` up to `bound`, within its `budget`, as far as it can decide what comes.
    fn run(&mut self, point: LanePoint<'_>, bound: Instant, budget: Budget, host: &mut dyn LaneHost) -> Lap;
}
