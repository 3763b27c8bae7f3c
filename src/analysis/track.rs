//! Measures of one contact while a run goes on.

use super::{
    episode::{Blows, Episode, OpenEpisode, Separation},
    extent::Extent,
    piece::{Piece, Polynomial},
    report::{ContactReport, Impacts, Statistics},
    sum::Sum,
};

#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// Current contact episode or separation.
    pub spell: Option<OpenEpisode>,
    /// Blows at the current instant.
    pub blows: Blows,
    /// Episode that ended at the latest record.
    pub ended: Option<Episode>,
    pub separations: Vec<Separation>,
    pub episodes: Vec<Episode>,
    pub counts: Counts,
    pub apart: Sum,
    pub no_force: Sum,
    pub impulse: Sum,
    pub spread: Spread,
    /// Approach speeds of the impacts on the drive flank and on the back flank, m/s.
    impacts: [Vec<f64>; 2],
    pub lost: Sum,
    pub deflection: Extent,
    /// Extremes of the force along the contact's direction, N.
    pub force: Extent,
    whole: u64,
    durations: Sum,
    shortest: f64,
    longest: f64,
}

/// Integrals of a force and of its square, of differences from its first value, so that a large mean costs no digits.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    origin: Option<f64>,
    sum: Sum,
    squares: Sum,
}

impl Spread {
    /// Adds the force on a piece; `force` is unchanged at the end.
    pub fn take(&mut self, piece: &Piece, force: &mut Polynomial) {
        if force.is_empty() {
            force.push(0.0);
        }
        let first = force[0];
        force[0] -= *self.origin.get_or_insert(first);
        self.sum.add(piece.integral(force));
        self.squares.add(piece.square(force));
        force[0] = first;
    }

    /// Adds a time without force, s.
    pub fn open(&mut self, time: f64) {
        let origin = *self.origin.get_or_insert(0.0);
        self.sum.add(-origin * time);
        self.squares.add(origin * origin * time);
    }

    pub fn mean(&self, time: f64) -> f64 {
        self.origin.unwrap_or_default() + self.sum.value() / time
    }

    pub fn deviation(&self, time: f64) -> f64 {
        (self.squares.value() / time - (self.sum.value() / time).powi(2)).max(0.0).sqrt()
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub separations: u64,
    /// Numbers of contacts on the drive flank and on the back flank.
    pub contacts: [u64; 2],
    pub sticks: u64,
}

impl Track {
    pub fn new() -> Self {
        Self { shortest: f64::INFINITY, ..Self::default() }
    }

    /// Adds a separation that was observed as a whole.
    pub fn separated(&mut self, separation: Separation, keep: usize) {
        self.whole += 1;
        self.durations.add(separation.duration);
        self.shortest = self.shortest.min(separation.duration);
        self.longest = self.longest.max(separation.duration);
        if self.separations.len() < keep {
            self.separations.push(separation);
        }
    }

    /// Adds an impact on the flank of `side`: contact begins out of the gap, with this approach speed, m/s.
    pub fn struck(&mut self, side: f64, approach: f64) {
        if approach > 0.0 {
            self.impacts[usize::from(side < 0.0)].push(approach);
        }
    }

    pub fn report(&self, name: &str, time: f64, cycles: Option<f64>, is_rigid: bool) -> ContactReport {
        let share = |part: &Sum| if time > 0.0 { part.value() / time } else { 0.0 };
        let any = self.whole > 0;
        let Counts { separations, contacts, sticks } = self.counts;
        ContactReport {
            name: name.to_owned(),
            time,
            apart_time: self.apart.value(),
            apart_fraction: share(&self.apart),
            no_force_time: self.no_force.value(),
            no_force_fraction: share(&self.no_force),
            separations,
            drive_contacts: contacts[0],
            back_contacts: contacts[1],
            sticks,
            separations_per_cycle: cycles.map(|c| separations as f64 / c),
            contacts_per_cycle: cycles.map(|c| (contacts[0] + contacts[1]) as f64 / c),
            durations: Statistics {
                count: self.whole,
                min: any.then_some(self.shortest),
                max: any.then_some(self.longest),
                mean: any.then(|| self.durations.value() / self.whole as f64),
            },
            deflection_max: Some(self.deflection.largest).filter(|d| d.is_finite()),
            deflection_min: Some(self.deflection.smallest).filter(|d| d.is_finite()),
            force_max: Some(self.force.largest).filter(|f| f.is_finite()),
            force_min: Some(self.force.smallest).filter(|f| f.is_finite()),
            force_abs_max: self.force.largest.max(-self.force.smallest).max(0.0),
            force_mean: share(&self.impulse),
            impulse: self.impulse.value(),
            force_deviation: (!is_rigid && time > 0.0).then(|| self.spread.deviation(time)),
            load_share: None,
            rattle_index: None,
            energy_lost: self.lost.value(),
            energy_loss_rate: share(&self.lost),
            impacts: Impacts::new(&self.impacts, time, cycles),
        }
    }
}
