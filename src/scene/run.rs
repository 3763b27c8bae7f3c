//! Duration, accuracy and output of a run.

use super::node::Node;
use crate::{
    hybrid::{Clock, Instant},
    integrate::Choice,
    system::Spec,
    vectors::Instructions,
};

/// Duration of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Duration {
    /// Whole cycles of the excitation, counted from the start cycle.
    Cycles(u64),
    /// Until this time, s (dimensionless in dimensionless trains).
    Until(f64),
}

pub(super) const METHODS: [(&str, Choice); 5] = [
    ("auto", Choice::Auto),
    ("taylor", Choice::Taylor),
    ("bdf", Choice::Bdf),
    ("sdirk", Choice::Sdirk),
    ("explicit", Choice::Explicit),
];

/// Frame in which trajectories are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// Rotating with the carrier, as the equations are.
    #[default]
    Rotating,
    /// At rest.
    Fixed,
}

/// Settings of the run in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Duration.
    pub duration: Duration,
    /// Length of one cycle, s, if given by the train or the scene.
    pub period: Option<f64>,
    /// Cycle in which the run starts: `t = start_cycle · period`.
    pub start_cycle: u64,
    /// Cycles left out of the measures.
    pub transient_cycles: u64,
    /// Maximum number of events before the run stops.
    pub event_budget: u64,
    /// Maximum number of steps before the run fails.
    pub step_budget: u64,
    /// Error of the time of an event that its arc may add, as a share of the period; 0 is full precision.
    pub event_tolerance: f64,
    /// Integrator.
    pub method: Choice,
    /// Tolerance of the integrator, relative to the scale of the motion.
    pub tolerance: f64,
    /// Vector instructions for the sums of its series.
    pub instructions: Instructions,
    /// Approach speed below which a chatter sequence may be summed, m/s; `None`: chosen by the engine.
    pub chatter_speed: Option<f64>,
    /// True if uncertainties of events include the amplification by the run before, see [`Inherited`](crate::tangent::Inherited).
    pub inherited_uncertainty: bool,
    /// True if the run is checked arc by arc, see [`verify`](crate::verify).
    pub verify: bool,
    /// Trajectory samples per cycle; 0 writes no trajectory.
    pub samples_per_cycle: u64,
    /// Frame of the trajectory.
    pub frame: Frame,
}

impl Run {
    /// Returns a run of this length with the defaults of a scene for all other settings.
    ///
    /// ```
    /// use flank::scene::{Duration, Run};
    ///
    /// let run = Run { transient_cycles: 20, ..Run::new(Duration::Cycles(50)) };
    /// assert_eq!(run.event_budget, 10_000_000);
    /// ```
    #[must_use]
    pub fn new(duration: Duration) -> Self {
        Self {
            duration,
            period: None,
            start_cycle: 0,
            transient_cycles: 0,
            event_budget: 10_000_000,
            step_budget: 10_000_000,
            event_tolerance: 0.0,
            method: Choice::Auto,
            tolerance: 1.0e-13,
            instructions: Instructions::best(),
            chatter_speed: None,
            inherited_uncertainty: false,
            verify: false,
            samples_per_cycle: 0,
            frame: Frame::Rotating,
        }
    }

    /// Returns the time at which the run ends, s.
    #[must_use]
    pub fn end(&self) -> f64 {
        match self.duration {
            Duration::Cycles(n) => (self.start_cycle + n) as f64 * self.period.unwrap_or(f64::NAN),
            Duration::Until(end) => end,
        }
    }

    /// Returns the instants of start, start of measures and end of the run, on the clock of its train.
    ///
    /// Whole cycles of the clock remain exact, for any number.
    #[must_use]
    pub fn instants(&self, clock: &Clock) -> [Instant; 3] {
        let forcing = clock.period().map(crate::hybrid::Wide::value);
        // A period in a scene and that of the clock, 2π/ω, differ by rounding.
        let whole = self.period.zip(forcing).is_some_and(|(own, clock)| (own - clock).abs() <= 1.0e-14 * clock);
        let at = |cycles: u64| match self.period {
            // Exact: scenes count up to 10¹⁵ cycles.
            Some(_) if whole => clock.at(cycles as i64, 0.0),
            Some(period) => clock.instant(cycles as f64 * period),
            None => clock.instant(0.0),
        };
        let end = match self.duration {
            Duration::Cycles(n) => at(self.start_cycle + n),
            Duration::Until(t) => clock.instant(t),
        };
        [at(self.start_cycle), at(self.start_cycle + self.transient_cycles), end]
    }
}

/// Reads the run for a train.
pub(super) fn read(node: &Node, spec: &Spec) -> Run {
    let period_node = node.at_unit("period", "s");
    let period =
        period_node.clone().written().map(|p| p.number()).or(spec.omega.map(|omega| std::f64::consts::TAU / omega));
    let (start_cycle, transient_cycles) = (node.at("start_cycle").whole(), node.at("transient_cycles").whole());
    let cycles = node.at("cycles").written().map(|cycles| cycles.whole());
    if period.is_none() && (cycles.is_some() || start_cycle > 0 || transient_cycles > 0) {
        period_node.refuse(
            "a period > 0, as this run counts cycles and its excitation has no common one",
            format!("add \"{}\", or give the run an end time", node.units.key("period", "s")),
        );
    }
    let t_end = node.at_unit("t_end", "s");
    let start = period.map_or(0.0, |period| start_cycle as f64 * period);
    let duration = cycles.map_or_else(|| Duration::Until(t_end.number()), Duration::Cycles);
    let length = match duration {
        Duration::Cycles(n) => n as f64,
        Duration::Until(end) => {
            if end <= start {
                t_end.refuse(format!("a time after the start, {start}"), "run to a later time or start in cycle 0");
            }
            period.map_or(f64::INFINITY, |period| (end - start) / period)
        }
    };
    if transient_cycles as f64 >= length && length > 0.0 {
        node.at("transient_cycles").refuse(
            format!("fewer cycles than the run has, {length}"),
            "run longer, or leave fewer cycles out of the measures",
        );
    }
    let event_tolerance = node.at("event_tolerance");
    if event_tolerance.clone().written().is_some_and(|tolerance| tolerance.number() > 0.0) && period.is_none() {
        event_tolerance.refuse(
            "0, as there is no period that it could be a fraction of",
            format!("add \"{}\", or leave the key out", node.units.key("period", "s")),
        );
    }
    let (integrator, output) = (node.at("integrator"), node.at("output"));
    let method = METHODS.iter().find(|(name, _)| *name == integrator.at("method").text());
    Run {
        duration,
        period,
        start_cycle,
        transient_cycles,
        event_budget: node.at("event_budget").whole(),
        step_budget: node.at("step_budget").whole(),
        event_tolerance: event_tolerance.written().map_or(0.0, |tolerance| tolerance.number()),
        method: method.map_or(Choice::Auto, |(_, method)| *method),
        tolerance: integrator.at("tolerance").number(),
        instructions: instructions(&integrator.at("instructions")),
        chatter_speed: node.at_unit("chatter_speed", "m_per_s").written().map(|speed| speed.number()),
        inherited_uncertainty: node.at("inherited_uncertainty").flag(),
        verify: node.at("verify").flag(),
        samples_per_cycle: output.at("samples_per_cycle").whole(),
        frame: if output.at("frame").text() == "fixed" { Frame::Fixed } else { Frame::Rotating },
    }
}

/// Reads the vector instructions; by default the best.
fn instructions(node: &Node) -> Instructions {
    let best = Instructions::best();
    let Some(node) = node.clone().written() else { return best };
    Instructions::named(node.text()).unwrap_or_else(|| {
        let remedy = format!("leave the key out for the best that it has, {:?}", best.name());
        node.refuse("vector instructions that this processor has", remedy);
        best
    })
}
