//! One spell of contact, one spell without force.

use serde::Serialize;

use super::{extent::Extent, sum::Sum};
use crate::hybrid::{Clock, ContactMode, Instant};

/// A moment, for output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Moment {
    /// Forcing cycle.
    pub cycle: i64,
    /// Phase in it, s.
    pub phase: f64,
    /// Time, s.
    pub t: f64,
}

impl Moment {
    pub(super) fn new(clock: &Clock, at: Instant) -> Self {
        Self { cycle: at.cycle, phase: at.phase.value(), t: clock.time(at).value() }
    }
}

/// A contact carried force from `start` on for `duration`; a rigid impact has duration zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Episode {
    /// When it began.
    pub start: Moment,
    /// `drive` or `back`.
    pub flank: &'static str,
    /// It began inside the flank's zone, where the law's force rose through zero, and not at the flank.
    pub by_force: bool,
    /// How long, s.
    pub duration: f64,
    /// Largest compressive force, N; absent for an impact.
    pub peak_force: Option<f64>,
    /// Largest penetration, m.
    pub peak_penetration: f64,
    /// Closing speed at the start, m/s.
    pub approach: f64,
    /// Opening speed at the end, m/s.
    pub release: f64,
    /// `release / approach`, for an approach at the flank.
    pub restitution: Option<f64>,
    /// Impulse that pushed the flanks apart, N s.
    pub impulse: f64,
    /// Energy lost in it, J: dissipated, dropped at the release, or lost in the impact.
    pub energy_lost: f64,
}

/// A contact carried no force from `start` on for `duration`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Separation {
    /// When the force ended.
    pub start: Moment,
    /// Until force was carried again, s.
    pub duration: f64,
    /// The part of `duration` spent between the flanks, s; the rest inside a flank's zone without force.
    pub apart: f64,
    /// The flank it left: `drive` or `back`.
    pub from: &'static str,
    /// The flank it met: `drive` or `back`.
    pub to: &'static str,
}

/// The spell a contact is in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spell {
    pub closed: bool,
    pub began: Instant,
    /// Its beginning was seen, and lies in the measured time.
    pub whole: bool,
    /// Side of the flank it is on (closed) or that it left (open).
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

impl Spell {
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

    /// The contact episode on a flank at `gap`, ended with opening speed `release`.
    pub fn episode(&self, clock: &Clock, gap: f64, release: f64) -> Episode {
        Episode {
            start: Moment::new(clock, self.began),
            flank: flank(self.side),
            by_force: self.by_force,
            duration: self.duration.value(),
            peak_force: Some(self.force.peak(self.side).max(0.0)),
            peak_penetration: (self.deflection.peak(self.side) - gap).max(0.0),
            approach: self.approach,
            release,
            restitution: (self.approach > 0.0 && !self.by_force).then(|| release / self.approach),
            impulse: self.side * self.impulse.value(),
            energy_lost: self.lost.value(),
        }
    }

    /// The separation, ended at the flank of `side`.
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
