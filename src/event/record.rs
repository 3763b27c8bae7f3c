use crate::hybrid::{GuardSet, Instant, Jump, Mode, Transition};

/// How well an event time is determined.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conditioning {
    /// Value of the guard at the event, in the guard's units.
    pub residual: f64,
    /// Its rate of change in time there; small at a near-graze.
    pub slope: f64,
    /// Uncertainty of the event time, s: the error of the guard over its slope (or over its curvature at a touch).
    pub time: f64,
    /// The uncertainty is an estimate, no proven bound.
    pub estimated: bool,
}

/// The end of an infinite impact sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulation {
    /// Impacts of the sequence that were resolved one by one.
    pub resolved: u32,
    /// Time from the last resolved impact to the accumulation point, s.
    pub remaining: f64,
    /// Uncertainty of that time, s: an estimate, by how steadily the last rebounds have shrunk.
    pub uncertainty: f64,
}

/// One instant at which the mode or the state changed.
///
/// All guards that fired at the instant, and all that fired as a consequence, are in one record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventRecord {
    /// When.
    pub at: Instant,
    /// The guards that fired, cascade included.
    pub fired: GuardSet,
    /// Mode before.
    pub from: Mode,
    /// Mode after.
    pub to: Mode,
    /// The mode after with its exact zeros: with `x_plus`, all that the motion goes on from.
    pub jump: Jump,
    /// State before, `[dim]`.
    pub x_minus: Vec<f64>,
    /// State after, `[dim]`.
    pub x_plus: Vec<f64>,
    /// Conditioning of the event time (worst of the batch).
    pub conditioning: Conditioning,
    /// Jumps iterated at this instant: 1 without a cascade.
    pub jumps: u32,
    /// A known switching time fell on this instant.
    pub switched: bool,
    /// The instant is the start of the run: the record is a decision about the first mode.
    pub start: bool,
    /// The guards touched zero and did not cross: no mode changed.
    pub graze: bool,
    /// The record ends an impact sequence at its accumulation point.
    pub accumulation: Option<Accumulation>,
    /// Largest displacement by which the state was moved onto a guard, in the guard's units.
    pub projected: f64,
}

impl EventRecord {
    /// The jump it tells of.
    #[must_use]
    pub fn transition(&self) -> Transition<'_> {
        Transition {
            at: self.at,
            fired: &self.fired,
            from: &self.from,
            to: &self.to,
            x_minus: &self.x_minus,
            x_plus: &self.x_plus,
        }
    }
}
