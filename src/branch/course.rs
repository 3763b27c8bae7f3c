//! What an orbit passes in a period: its events, and how near it comes to others.

use std::ops::ControlFlow;

use crate::{
    engine::{Jumped, Observer},
    event::EventRecord,
    hybrid::{GuardId, HybridSystem, Mode, Watch},
    integrate::DenseStep,
    orbit::{
        Section, SectionMap,
        words::{Letter, Speller},
    },
    poly,
    simulation::SimulationError,
    system::{Structure, contact_mode, guard_of},
};

/// Share of the size of a guard that steps may differ by where they meet.
const SMOOTH: f64 = 1e-9;

/// A place at which a guard that does not fire is least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Low {
    /// Which contact.
    pub contact: usize,
    /// Which guard.
    pub watch: Watch,
    /// Whether the contact is closed there.
    pub is_closed: bool,
    /// Events before it.
    pub after: usize,
    /// The guard there, in its own unit, positive inside the mode.
    pub value: f64,
}

/// The events of an orbit and the least values of guards between them.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Events in order.
    pub letters: Vec<Letter>,
    /// When each happens, cycles after the section.
    pub times: Vec<f64>,
    /// Least values of guards, in order.
    pub lows: Vec<Low>,
}

/// Looks for least values along steps.
struct Lowest<'s> {
    structure: &'s Structure,
    x: Vec<f64>,
    row: Vec<f64>,
    lows: Vec<Low>,
    events: usize,
    /// Each guard with its value and slope at the end of the last step; none behind an event.
    ends: Vec<(GuardId, f64, f64)>,
}

impl Lowest<'_> {
    fn take(&mut self, mode: &Mode, id: GuardId, value: f64) {
        let (contact, watch) = guard_of(id);
        let is_closed = contact_mode(mode, contact).is_closed();
        self.lows.push(Low { contact, watch, is_closed, after: self.events, value });
    }
}

impl Observer for Lowest<'_> {
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let s = self.structure;
        let before = std::mem::take(&mut self.ends);
        for (i, id) in step.guards().iter().enumerate() {
            self.row.clear();
            self.row.extend(step.guard(i));
            poly::shift(&mut self.row, 0.0, until);
            // Between two steps a guard can jump, or have a corner: where the stiffness or a forcing does.
            let (start, rise) = (self.row[0], self.row.get(1).copied().unwrap_or_default());
            let last = before.iter().find(|(other, ..)| other == id);
            if let Some((_, end, slope)) = last {
                // What differs by rounding alone is no jump.
                let jump = start - end;
                let size = self.row.iter().fold(end.abs(), |size, c| size.max(c.abs()));
                let jump = if jump.abs() <= SMOOTH * size { 0.0 } else { jump };
                if *slope < 0.0 && (jump > 0.0 || jump == 0.0 && rise > 0.0) {
                    self.take(mode, *id, *end);
                } else if rise > 0.0 && jump < 0.0 {
                    self.take(mode, *id, start);
                }
            }
            let end: f64 = self.row.iter().sum();
            let slope: f64 = self.row.iter().enumerate().map(|(k, c)| k as f64 * c).sum();
            self.ends.push((*id, end, slope));
            for theta in poly::minima(&self.row) {
                let theta = theta * until;
                step.state(theta, &mut self.x);
                let at = s.clock().advance(step.start(), step.time(theta));
                let value = s.guard(mode, *id, at, &self.x);
                self.take(mode, *id, value);
            }
        }
        ControlFlow::Continue(())
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, _: &Jumped<'_>) {
        self.events += 1;
        self.ends.clear();
    }

    fn event(&mut self, _: &EventRecord) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl Course {
    /// Of the orbit of `period` cycles through `section`.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn new(map: &SectionMap<'_>, section: &Section, period: u64) -> Result<Self, SimulationError> {
        let structure = &map.simulation().structure;
        let mut speller = Speller::new(structure, &section.x);
        let mut lowest =
            Lowest { structure, x: section.x.clone(), row: Vec::new(), lows: Vec::new(), events: 0, ends: Vec::new() };
        map.watch(section, period, &mut (&mut speller, &mut lowest))?;
        let clock = structure.clock();
        let (start, length) = (map.at(0), map.simulation().period()?);
        let times = speller.letters.iter().map(|letter| clock.between(start, letter.at) / length).collect();
        Ok(Self { letters: speller.letters, times, lows: lowest.lows })
    }

    /// The tokens in order of time; those of one instant in alphabetic order.
    #[must_use]
    pub fn tokens(&self) -> Vec<&str> {
        self.letters.iter().map(|letter| letter.token.as_str()).collect()
    }

    /// The shortest time from an event of a contact to the next one of it, by the first letters of their tokens, cycles; no bound if there is
    /// none.
    #[must_use]
    pub fn shortest(&self, contact: usize, from: char, to: char) -> f64 {
        let own: Vec<usize> = (0..self.letters.len()).filter(|i| self.letters[*i].contact == contact).collect();
        let next = own.iter().zip(own.iter().cycle().skip(1));
        let pairs =
            next.filter(|(i, k)| self.letters[**i].token.starts_with(from) && self.letters[**k].token.starts_with(to));
        // The period is whole cycles, and longer than any stay.
        let last = self.times.last().map_or(1.0, |time| time.ceil());
        pairs.map(|(i, k)| (self.times[*k] - self.times[*i]).rem_euclid(last)).fold(f64::INFINITY, f64::min)
    }

    /// The middle of the longest part of the period of the forcing without an event in any cycle, as a part of it, from `phase` where the
    /// section stands.
    #[must_use]
    pub fn quiet(&self, phase: f64) -> f64 {
        let mut all: Vec<f64> = self.times.iter().map(|time| (phase + time).rem_euclid(1.0)).collect();
        all.sort_by(f64::total_cmp);
        let Some(first) = all.first().copied() else { return phase };
        all.push(first + 1.0);
        let widest = all.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        widest.map_or(phase, |gap| (0.5 * (gap[0] + gap[1])).rem_euclid(1.0))
    }

    /// Time between the section and the event nearest to it, cycles.
    #[must_use]
    pub fn clearance(&self) -> f64 {
        self.times.iter().map(|time| (time - time.round()).abs()).fold(0.5, f64::min)
    }
}
