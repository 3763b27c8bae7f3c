//! Measures of the contacts: time apart, contact episodes, extremes of deflection and force.

use std::ops::ControlFlow;

use super::{
    episode::{Blows, Episode, Moment, OpenEpisode, Separation, flank},
    extent::Extent,
    piece::{Piece, Polynomial, measured_parts},
    report::ContactReport,
    sum::Sum,
    track::Track,
};
use crate::{
    engine::{JumpRecord, Observer},
    event::EventRecord,
    hybrid::{Clock, ContactMode, ContactView, HybridSystem, Instant, Mode, Power, StepQuantity, Transition},
    integrate::DenseStep,
};

/// Measures every contact. Durations are sums of arc lengths, so short ones keep their relative accuracy.
#[derive(Clone, Debug)]
pub struct Contacts<'s, S: ?Sized> {
    system: &'s S,
    clock: Clock,
    from: Option<Instant>,
    keep: usize,
    /// True if episodes before the measured time are of no interest.
    skips: bool,
    piece: Piece,
    rows: [Polynomial; 2],
    impulses: Vec<f64>,
    time: Sum,
    tracks: Vec<Track>,
}

impl<'s, S: HybridSystem + ContactView + ?Sized> Contacts<'s, S> {
    /// Measures from `from` on (by default from the start), so that a transient is left out.
    #[must_use]
    pub fn new(system: &'s S, from: Option<Instant>) -> Self {
        let m = system.contact_count();
        Self {
            system,
            clock: *system.clock(),
            from,
            keep: usize::MAX,
            skips: false,
            piece: Piece::new(*system.clock(), system.dim()),
            rows: Default::default(),
            impulses: vec![0.0; m],
            time: Sum::default(),
            tracks: vec![Track::new(); m],
        }
    }

    /// Stores at most `entries` separations and episodes of each contact; statistics include all.
    #[must_use]
    pub fn keep(mut self, entries: usize) -> Self {
        self.keep = entries;
        self
    }

    /// Looks at the measured time alone: durations and peaks of earlier episodes are incomplete.
    #[must_use]
    pub fn only_measured(mut self) -> Self {
        self.skips = true;
        self
    }

    /// Returns the separations of contact `j` that began and ended in the measured time, in order.
    #[must_use]
    pub fn separations(&self, j: usize) -> &[Separation] {
        &self.tracks[j].separations
    }

    /// Returns the contact episodes of contact `j` that began and ended in the measured time, in order.
    #[must_use]
    pub fn episodes(&self, j: usize) -> &[Episode] {
        &self.tracks[j].episodes
    }

    /// Returns the episode of contact `j` that ended at the latest record, in the measured time or not.
    #[must_use]
    pub fn ended(&self, j: usize) -> Option<&Episode> {
        self.tracks[j].ended.as_ref()
    }

    /// Returns the measured time, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time.value()
    }

    /// Returns the measures of contact `j` so far.
    #[must_use]
    pub fn report(&self, j: usize) -> ContactReport {
        let time = self.time.value();
        let cycles = self.clock.period().map(|p| time / p.value()).filter(|c| *c > 0.0);
        self.tracks[j].report(self.system.contact_name(j), time, cycles, self.system.is_rigid(j))
    }

    fn measures(&self, at: Instant) -> bool {
        self.from.is_none_or(|from| self.clock.between(from, at) >= 0.0)
    }

    /// Adds the piece `[a, b]` of a step.
    fn piece(&mut self, mode: &Mode, step: &dyn DenseStep, a: f64, b: f64, measured: bool) {
        let Self { system, piece, rows: [deflection, force], tracks, .. } = self;
        piece.cut(step, a, b);
        let length = piece.length;
        if measured {
            self.time.add(length);
        }
        for (j, track) in tracks.iter_mut().enumerate() {
            let state = system.contact_mode(j, mode);
            let is_closed = state.is_closed();
            if measured {
                if state == ContactMode::Separated {
                    track.apart.add(length);
                }
                if !is_closed {
                    track.no_force.add(length);
                    track.force.take([0.0; 2]);
                    track.spread.open(length);
                }
            }
            let in_spell = track.spell.as_mut().map(|spell| {
                spell.duration.add(length);
                if state == ContactMode::Separated {
                    spell.apart.add(length);
                }
                is_closed
            });
            let presses = in_spell.unwrap_or(false);
            if !measured && !presses {
                continue;
            }
            let [of_deflection, of_force] = [StepQuantity::Deflection(j), StepQuantity::Force(j)];
            let side = state.side();
            if !presses {
                piece.rows(step, [of_deflection], [deflection], |at, x, _| [system.deflection(j, side, at, x).0]);
                Extent::extend([&mut track.deflection], deflection);
                continue;
            }
            piece.rows(step, [of_deflection, of_force], [deflection, force], |at, x, _| {
                [system.deflection(j, side, at, x).0, system.force(j, mode, at, x)]
            });
            let impulse = piece.integral(force);
            let [lost] = piece.integrals(step, [Power::Loss(j)], |at, x| [system.dissipation(j, mode, at, x)]);
            let Some(spell) = track.spell.as_mut() else { continue };
            spell.impulse.add(impulse);
            spell.lost.add(lost);
            if measured {
                Extent::extend([&mut track.deflection, &mut spell.deflection], deflection);
                Extent::extend([&mut track.force, &mut spell.force], force);
                track.impulse.add(impulse);
                track.spread.take(piece, force);
                track.lost.add(lost);
            } else {
                Extent::extend([&mut spell.deflection], deflection);
                Extent::extend([&mut spell.force], force);
            }
        }
    }

    /// Updates contact `j` at an instant.
    fn follow(&mut self, j: usize, record: &EventRecord, measured: bool) {
        let system = self.system;
        let (before, after) = (system.contact_mode(j, &record.from), system.contact_mode(j, &record.to));
        let (_, rate) = system.deflection(j, side_at(system, j, record), record.at, &record.x_minus);
        if self.tracks[j].spell.is_none() {
            self.begin(j, before, record.at);
        }
        if measured {
            let track = &mut self.tracks[j];
            track.impulse.add(track.blows.impulse);
            track.lost.add(track.blows.lost);
        }
        let struck = record
            .fired
            .iter()
            .map(|id| system.watch(id))
            .find(|(k, watch)| *k == j && watch.side() != 0.0)
            .map(|(_, watch)| watch.side())
            .filter(|side| {
                // Closing already, or set closing by another impact of the same instant.
                let strikes = side * rate > 0.0 || self.tracks[j].blows.count > 0;
                system.is_rigid(j) && !before.is_closed() && strikes
            });
        match struck {
            Some(side) => {
                self.part(j, side, measured);
                if record.accumulation.is_none() {
                    self.impact(j, side, record, measured);
                }
                self.open(j, after, record.at, side, measured);
            }
            None if !before.is_closed() && after.is_closed() => {
                self.part(j, after.side(), measured);
                self.open(j, after, record.at, after.side(), measured);
                let track = &mut self.tracks[j];
                if let Some(spell) = track.spell.as_mut() {
                    spell.approach = after.side() * rate;
                    spell.by_force = before != ContactMode::Separated;
                }
                if measured && !system.is_rigid(j) {
                    track.counts.contacts[usize::from(after.side() < 0.0)] += 1;
                    if before == ContactMode::Separated {
                        track.struck(after.side(), after.side() * rate);
                    }
                }
            }
            None if before.is_closed() && !after.is_closed() => {
                let release = -before.side() * rate;
                // The work of a switch of this instant is no loss.
                let stored = |mode| system.stored(j, mode, record.at, &record.x_minus);
                let dropped = stored(&system.switched(&record.from, record.at)) - stored(&record.to);
                let track = &mut self.tracks[j];
                if let Some(mut spell) = track.spell.take() {
                    spell.lost.add(dropped);
                    let episode = spell.episode(&self.clock, system.half_backlash(j), release);
                    if measured {
                        track.lost.add(dropped);
                    }
                    if spell.whole && track.episodes.len() < self.keep {
                        track.episodes.push(episode);
                    }
                    track.ended = Some(episode);
                }
                self.open(j, after, record.at, before.side(), measured);
            }
            None => {}
        }
    }

    /// Begins a spell whose beginning was not observed.
    fn begin(&mut self, j: usize, state: ContactMode, at: Instant) {
        self.tracks[j].spell = Some(OpenEpisode::new(state.is_closed(), at, state.side()));
    }

    /// Begins a spell at an event, on (or off) the flank of `side`.
    fn open(&mut self, j: usize, state: ContactMode, at: Instant, side: f64, measured: bool) {
        let track = &mut self.tracks[j];
        let spell = OpenEpisode { whole: measured, ..OpenEpisode::new(state.is_closed(), at, side) };
        track.spell = Some(spell);
        if measured {
            track.counts.separations += u64::from(!spell.closed);
            track.counts.sticks += u64::from(spell.closed && self.system.is_rigid(j));
        }
    }

    /// Ends a spell without force at the flank of `side`.
    fn part(&mut self, j: usize, side: f64, measured: bool) {
        let track = &mut self.tracks[j];
        let Some(spell) = track.spell.take().filter(|s| s.whole && !s.closed && measured) else { return };
        track.separated(spell.separation(&self.clock, side), self.keep);
    }

    /// Adds a rigid impact, with all its blows at the instant: an episode of no duration.
    fn impact(&mut self, j: usize, side: f64, record: &EventRecord, measured: bool) {
        let rates = [&record.x_minus, &record.x_plus].map(|x| self.system.deflection(j, side, record.at, x).1);
        let track = &mut self.tracks[j];
        let Blows { count, first, last, impulse, lost } = track.blows;
        // A flank that closes without impulse: other impacts have turned it back.
        let ([before, after], last) = if count > 0 { (first, last) } else { (rates, rates[1]) };
        let approach = side * before;
        let episode = Episode {
            start: Moment::new(&self.clock, record.at),
            flank: flank(side),
            by_force: false,
            duration: 0.0,
            blows: count,
            peak_force: None,
            peak_penetration: 0.0,
            approach,
            release: -side * last,
            restitution: (approach > 0.0 && count > 0).then(|| -side * after / approach),
            impulse: side * impulse,
            energy_lost: lost,
        };
        track.ended = Some(episode);
        if measured {
            track.counts.contacts[usize::from(side < 0.0)] += 1;
            track.struck(side, approach);
            if track.episodes.len() < self.keep {
                track.episodes.push(episode);
            }
        }
    }
}

/// Returns the side of the flank of contact `j` in a record.
pub(super) fn side_at<S: ContactView + ?Sized>(system: &S, j: usize, record: &EventRecord) -> f64 {
    let struck = record.fired.iter().map(|id| system.watch(id)).find(|(k, watch)| *k == j && watch.side() != 0.0);
    let [before, after] = [&record.from, &record.to].map(|mode| system.contact_mode(j, mode).side());
    struck.map_or(if before == 0.0 { after } else { before }, |(_, watch)| watch.side())
}

impl<S: HybridSystem + ContactView + ?Sized> Observer for Contacts<'_, S> {
    fn observed_from(&self) -> Instant {
        self.from.filter(|_| self.skips).unwrap_or(Instant::FIRST)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        for j in 0..self.tracks.len() {
            if self.tracks[j].spell.is_none() {
                self.begin(j, self.system.contact_mode(j, mode), step.start());
            }
        }
        for (low, high, is_measured) in measured_parts(&self.clock, self.from, step, until) {
            self.piece(mode, step, low, high, is_measured);
        }
        ControlFlow::Continue(())
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        let Self { system, impulses, tracks, .. } = self;
        let JumpRecord { at, from, to, x_minus, x_plus, .. } = *jumped;
        let (from, to, fired) = (&from.mode, &to.mode, &(jumped.fired | &to.struck));
        system.impulses(&Transition { at, fired, from, to, x_minus, x_plus }, impulses);
        for (j, track) in tracks.iter_mut().enumerate().filter(|(j, _)| impulses[*j] != 0.0) {
            let struck = jumped.to.struck.iter().map(|id| system.watch(id)).find(|(k, _)| *k == j);
            let is_struck = struck.is_some();
            let [before, after] = [from, to].map(|mode| system.contact_mode(j, mode));
            let side = struck.map_or(before.side(), |(_, watch)| watch.side());
            let rates = [x_minus, x_plus].map(|x| system.deflection(j, side, at, x).1);
            let rates = if before.side() == 0.0 { rates } else { [0.0, rates[1]] };
            let restitution = system.free_restitution(j, rates[0].abs()).filter(|_| after.side() == 0.0).unwrap_or(0.0);
            let lost = match is_struck {
                true => 0.5 * impulses[j] * (1.0 - restitution) * rates[0],
                // Brought to rest: the energy of its speed is lost.
                false => 0.5 * impulses[j] * (rates[0] + rates[1]),
            };
            track.blows.add(is_struck, rates, impulses[j], lost);
        }
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        for track in &mut self.tracks {
            track.ended = None;
        }
        if record.graze {
            return ControlFlow::Continue(());
        }
        let measured = self.measures(record.at);
        for j in 0..self.tracks.len() {
            self.follow(j, record, measured);
            self.tracks[j].blows = Blows::default();
        }
        ControlFlow::Continue(())
    }
}
