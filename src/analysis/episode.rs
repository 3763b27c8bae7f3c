//! Contact episodes and separations of one contact.

use serde::Serialize;

use super::{extent::Extent, sum::Sum};
use crate::hybrid::{Clock, ContactMode, Instant};

/// An instant in the form of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Moment {
    /// Forcing cycle.
    pub cycle: i64,
    /// Phase in the forcing cycle, s.
    pub phase: f64,
    /// Time, s.
    pub t: f64,
}

impl Moment {
    pub(super) fn new(clock: &Clock, at: Instant) -> Self {
        Self { cycle: at.cycle, phase: at.phase.value(), t: clock.time(at).value() }
    }
}

/// Contact episode: force is carried from `start` on for `duration`, which is zero for a rigid impact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Episode {
    /// Start of the episode.
    pub start: Moment,
    /// Flank: `drive` or `back`.
    pub flank: &'static str,
    /// True if the episode began inside the flank's zone, where the law's force rose through zero, and not at the flank.
    pub by_force: bool,
    /// Duration, s; 0 for a rigid impact.
    pub duration: f64,
    /// Blows of a rigid impact: jumps of its instant in which the contact takes an impulse. 0 for a contact with a duration.
    pub blows: u32,
    /// Largest compressive force, N; absent for an impact.
    pub peak_force: Option<f64>,
    /// Largest penetration, m.
    pub peak_penetration: f64,
    /// Closing speed at the start, m/s; of an impact before its first blow.
    pub approach: f64,
    /// Opening speed at the end, m/s; of an impact right after its last blow.
    pub release: f64,
    /// Ratio `release / approach`, for an approach at the flank; of an impact that of its first blow, absent if it was at rest.
    pub restitution: Option<f64>,
    /// Impulse that pushed the flanks apart, N s; of an impact the sum of its blows.
    pub impulse: f64,
    /// Energy lost, J: dissipated, dropped at the release, or lost in the blows, `½ P (1 − e) × approach` of each.
    pub energy_lost: f64,
}

/// Separation: no force is carried from `start` on for `duration`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Separation {
    /// Instant at which the force ended.
    pub start: Moment,
    /// Time until force was carried again, s.
    pub duration: f64,
    /// Part of `duration` between the flanks, s; the rest was inside a flank's zone without force.
    pub apart: f64,
    /// Flank that the contact left: `drive` or `back`.
    pub from: &'static str,
    /// Flank on which force began again: `drive` or `back`.
    pub to: &'static str,
}

/// Blows of one contact at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Blows {
    pub count: u32,
    /// Rates of the deflection before and after the first blow, m/s: 0 before if the contact was at rest.
    pub first: [f64; 2],
    /// Rate after the last blow, m/s.
    pub last: f64,
    /// Sum of the impulses along the direction, N s.
    pub impulse: f64,
    /// Energy lost, J.
    pub lost: f64,
}

impl Blows {
    /// Adds a jump that changes the rate; it is a blow if the contact `is_struck`.
    pub fn add(&mut self, is_struck: bool, rates: [f64; 2], impulse: f64, lost: f64) {
        self.impulse += impulse;
        self.lost += lost;
        if is_struck {
            self.first = if self.count == 0 { rates } else { self.first };
            self.last = rates[1];
            self.count += 1;
        }
    }
}

/// Current contact episode or separation of a contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenEpisode {
    pub closed: bool,
    pub began: Instant,
    /// True if its beginning was observed and lies in the measured time.
    pub whole: bool,
    /// Side of its flank (closed) or of the flank that it left (open).
    pub side: f64,
    pub by_force: bool,
    pub approach: f64,
    pub duration: Sum,
    pub apart: Sum,
    pub impulse: Sum,
    pub lost: Sum,
    pub deflection: Extent,
    pub force: Extent,
}

pub(super) fn flank(side: f64) -> &'static str {
    if side > 0.0 { ContactMode::Drive.name() } else { ContactMode::Back.name() }
}

impl OpenEpisode {
    pub fn new(closed: bool, began: Instant, side: f64) -> Self {
        Self {
            closed,
            began,
            whole: false,
            side,
            by_force: false,
            approach: 0.0,
            duration: Sum::default(),
            apart: Sum::default(),
            impulse: Sum::default(),
            lost: Sum::default(),
            deflection: Extent::default(),
            force: Extent::default(),
        }
    }

    /// Returns the contact episode on a flank at `gap`, ended with opening speed `release`.
    pub fn episode(&self, clock: &Clock, gap: f64, release: f64) -> Episode {
        Episode {
            start: Moment::new(clock, self.began),
            flank: flank(self.side),
            by_force: self.by_force,
            duration: self.duration.value(),
            blows: 0,
            peak_force: Some(self.force.peak(self.side).max(0.0)),
            peak_penetration: (self.deflection.peak(self.side) - gap).max(0.0),
            approach: self.approach,
            release,
            restitution: (self.approach > 0.0 && !self.by_force).then(|| release / self.approach),
            impulse: self.side * self.impulse.value(),
            energy_lost: self.lost.value(),
        }
    }

    /// Returns the separation, ended at the flank of `side`.
    pub fn separation(&self, clock: &Clock, side: f64) -> Separation {
        Separation {
            start: Moment::new(clock, self.began),
            duration: self.duration.value(),
            apart: self.apart.value(),
            from: flank(self.side),
            to: flank(side),
        }
    }
}
