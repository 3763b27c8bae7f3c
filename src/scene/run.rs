//! How long to run, how exactly, and what to write.

use serde_json::json;

use super::{
    node::Node,
    shape::{Object, Shape, Units, choice, positive, within},
};
use crate::{
    hybrid::{Clock, Instant},
    integrate::Choice,
    train::Spec,
};

/// How long a run lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Duration {
    /// Whole cycles of the excitation, counted from the start cycle.
    Cycles(u64),
    /// Until this time, s (dimensionless in dimensionless trains).
    Until(f64),
}

const METHODS: [(&str, Choice); 5] = [
    ("auto", Choice::Auto),
    ("taylor", Choice::Taylor),
    ("bdf", Choice::Bdf),
    ("sdirk", Choice::Sdirk),
    ("explicit", Choice::Explicit),
];

/// Frame in which trajectories are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// Turning with the carrier, as the equations are.
    #[default]
    Rotating,
    /// At rest.
    Fixed,
}

/// The run a scene asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// How long.
    pub duration: Duration,
    /// Length of one cycle, s, if the train or the scene names one.
    pub period: Option<f64>,
    /// Cycle in which the run starts: `t = start_cycle · period`.
    pub start_cycle: u64,
    /// Cycles left out of the measures.
    pub transient_cycles: u64,
    /// Most events before the run is stopped.
    pub event_budget: u64,
    /// Integrator.
    pub method: Choice,
    /// Its tolerance, relative to the scale of the motion.
    pub tolerance: f64,
    /// Approach speed below which a chatter sequence may be summed, m/s; `None` leaves it to the engine.
    pub chatter_speed: Option<f64>,
    /// Whether the run is checked arc by arc, see [`verify`](crate::verify).
    pub verify: bool,
    /// Trajectory samples per cycle; 0 writes no trajectory.
    pub samples_per_cycle: u64,
    /// Frame of the trajectory.
    pub frame: Frame,
}

impl Run {
    /// Time at which the run ends, s.
    #[must_use]
    pub fn end(&self) -> f64 {
        match self.duration {
            Duration::Cycles(n) => (self.start_cycle + n) as f64 * self.period.unwrap_or(f64::NAN),
            Duration::Until(end) => end,
        }
    }

    /// Where the run starts, where its measures start and where it ends, on the clock of its train.
    ///
    /// Whole cycles of the clock stay whole, however many they are.
    #[must_use]
    pub fn instants(&self, clock: &Clock) -> [Instant; 3] {
        let forcing = clock.period().map(crate::hybrid::Wide::value);
        // A period written in a scene and that of the clock, 2π/ω, differ by rounding.
        let whole = self.period.zip(forcing).is_some_and(|(own, clock)| (own - clock).abs() <= 1.0e-14 * clock);
        let at = |cycles: u64| match self.period {
            // OK to convert: scenes count up to 10¹² cycles.
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

/// The run section.
pub(super) fn shape(units: Units) -> Shape {
    let tolerance = within(1.0e-16, 1.0e-2);
    let integrator = Object::new("Integrator of the smooth motion between events.")
        .with_default("method", "auto", choice(&METHODS.map(|(name, _)| name)), "Which one.")
        .with_default("tolerance", 1.0e-13, tolerance, "Local error, relative to the scale of the motion.");
    let output = Object::new("What is written besides events and measures.")
        .with_default("samples_per_cycle", 0, Shape::Whole { min: 0, max: 1 << 20 }, "Trajectory samples; 0 for none.")
        .with_default("frame", "rotating", choice(&["rotating", "fixed"]), "Frame of the trajectory.");
    let t_end = units.key("t_end", "s");
    let count = |min| Shape::Whole { min, max: 1_000_000_000_000 };
    let run = Object::new("How long to run, how exactly, and what to write.")
        .free("cycles", count(1), "Cycles to run.")
        .free(t_end.clone(), positive(), "Time to run to, from time 0.")
        .exactly_one(["cycles".to_owned(), t_end])
        .free(units.key("period", "s"), positive(), "Length of a cycle; the excitation's if left out.")
        .with_default("start_cycle", 0, count(0), "Cycle to start in: the phase counts from there.")
        .with_default("transient_cycles", 0, count(0), "Cycles left out of the measures.")
        .with_default(
            "event_budget",
            10_000_000,
            Shape::Whole { min: 1, max: u64::MAX },
            "Most events before the run stops.",
        )
        .with_default("integrator", json!({}), Shape::Object(integrator), "Integrator.")
        .free(
            units.key("chatter_speed", "m_per_s"),
            positive(),
            "Impacts slower than this may be summed as one chatter.",
        )
        .free(
            "verify",
            Shape::Flag,
            "Whether the run is checked arc by arc, by two other ways to its events; false if left out.",
        )
        .with_default("output", json!({}), Shape::Object(output), "Output.")
        .mistake("duration", "write cycles, or t_end_s (t_end in a dimensionless scene)")
        .mistake("dt", "events are located exactly: there is no step to choose; see integrator.tolerance")
        .mistake("step", "events are located exactly: there is no step to choose; see integrator.tolerance");
    Shape::Object(run)
}

/// The run written here, for a train.
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
    let (integrator, output) = (node.at("integrator"), node.at("output"));
    let method = METHODS.iter().find(|(name, _)| *name == integrator.at("method").text());
    Run {
        duration,
        period,
        start_cycle,
        transient_cycles,
        event_budget: node.at("event_budget").whole(),
        method: method.map_or(Choice::Auto, |(_, method)| *method),
        tolerance: integrator.at("tolerance").number(),
        chatter_speed: node.at_unit("chatter_speed", "m_per_s").written().map(|speed| speed.number()),
        verify: node.at("verify").flag(),
        samples_per_cycle: output.at("samples_per_cycle").whole(),
        frame: if output.at("frame").text() == "fixed" { Frame::Fixed } else { Frame::Rotating },
    }
}
