use crate::hybrid::{GuardSet, Instant, Jump, Mode, Transition};

/// Conditioning of the time of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Conditioning {
    /// Value of the guard at the event, in units of the guard.
    pub residual: f64,
    /// Time derivative of the guard at the event; small near a graze.
    pub slope: f64,
    /// Uncertainty of the event time, s: the error of the guard over its slope (or over its curvature at a touch).
    pub time: f64,
    /// True if the uncertainty is an estimate, not a proven bound.
    pub estimated: bool,
}

/// The end of an infinite impact sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Accumulation {
    /// Number of impacts of the sequence that were resolved one by one.
    pub resolved: u32,
    /// Time from the last resolved impact to the accumulation point, s.
    pub remaining: f64,
    /// Uncertainty of that time, s: an estimate from the steadiness of the last rebound ratios.
    pub uncertainty: f64,
}

/// One instant at which the mode or the state changed.
///
/// One record contains all guards that fired at the instant, cascade included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventRecord {
    /// Instant of the event.
    pub at: Instant,
    /// The guards that fired, cascade included.
    pub fired: GuardSet,
    /// Mode before.
    pub from: Mode,
    /// Mode after.
    pub to: Mode,
    /// Mode after with its exact zeros: with `x_plus`, the complete start of the following motion.
    pub jump: Jump,
    /// State before, `[dim]`.
    pub x_minus: Vec<f64>,
    /// State after, `[dim]`.
    pub x_plus: Vec<f64>,
    /// Conditioning of the event time (worst of the batch).
    pub conditioning: Conditioning,
    /// Number of jumps at this instant: 1 without a cascade.
    pub jumps: u32,
    /// True if a known switching time falls on this instant.
    pub switched: bool,
    /// True if the instant is the start of the run: the record is a decision about the first mode.
    pub start: bool,
    /// True if the guards touched zero without crossing: the mode is the same.
    pub graze: bool,
    /// Accumulation point, if the record ends an impact sequence.
    pub accumulation: Option<Accumulation>,
    /// Largest displacement by which the state was moved onto a guard, in units of the guard.
    pub projected: f64,
}

impl EventRecord {
    /// Returns the recorded change as one transition.
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
