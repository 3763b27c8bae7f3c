//! Course of an orbit over a period: its events, and its least distances from further events.

use std::ops::ControlFlow;

use crate::{
    engine::{JumpRecord, Observer},
    event::EventRecord,
    hybrid::{ContactView, GuardId, HybridSystem, Mode, Watch},
    integrate::DenseStep,
    orbit::{
        Section, SectionMap,
        words::{Letter, WordObserver, letters},
    },
    poly,
    simulation::SimulationError,
    system::{Structure, contact_mode, guard_of},
};

/// Share of the size of a guard by which two steps may differ at their common end.
const SMOOTH: f64 = 1e-9;
/// Share of a step within which a least value counts as one at the common end of two steps.
const NEAR: f64 = 1e-6;

/// Least value of a guard that does not fire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardMinimum {
    /// Index of the contact.
    pub contact: usize,
    /// Guard.
    pub watch: Watch,
    /// True if the contact is closed there.
    pub is_closed: bool,
    /// Number of events before it.
    pub after: usize,
    /// Value of the guard there, in the unit of the guard, positive inside the mode.
    pub value: f64,
}

/// The beginning of a rest of a rigid contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Index of the contact.
    pub contact: usize,
    /// Its load at that instant, positive.
    pub load: f64,
    /// Time summed at the end of the impacts that lead to the rest, cycles.
    pub remaining: f64,
    /// Uncertainty of the instant, cycles.
    pub uncertainty: f64,
}

/// The events of an orbit and the least values of guards between them.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Events in order.
    pub letters: Vec<Letter>,
    /// Time of each event after the section, cycles.
    pub times: Vec<f64>,
    /// Least values of guards, in order.
    pub lows: Vec<GuardMinimum>,
    /// Contacts that come to rest, in order.
    pub rests: Vec<Rest>,
}

/// Search for least values along steps.
struct MinimumSearch<'s> {
    structure: &'s Structure,
    x: Vec<f64>,
    row: Vec<f64>,
    lows: Vec<GuardMinimum>,
    rests: Vec<Rest>,
    events: usize,
    /// Each guard at the end of the last step; empty behind an event.
    ends: Vec<(GuardId, GuardEnd)>,
    /// Each guard at the section, as the orbit leaves it.
    starts: Vec<(GuardId, GuardEnd)>,
}

/// A guard at an end of a step: value, first and second derivative, by parts of the step, and size along it; whether its contact is closed.
#[derive(Clone, Copy)]
struct GuardEnd {
    value: f64,
    slope: f64,
    size: f64,
    bend: f64,
    is_closed: bool,
}

impl MinimumSearch<'_> {
    fn take(&mut self, id: GuardId, is_closed: bool, value: f64) {
        let (contact, watch) = self.structure.watch(id);
        self.lows.push(GuardMinimum { contact, watch, is_closed, after: self.events, value });
    }

    /// Takes the least value at the common end of two steps. A guard jumps or has a corner there if the stiffness or a forcing does.
    fn meet(&mut self, id: GuardId, end: GuardEnd, start: GuardEnd) {
        // A difference within rounding is no jump.
        let jump = start.value - end.value;
        let jump = if jump.abs() <= SMOOTH * start.size.max(end.value.abs()) { 0.0 } else { jump };
        // By rounding, a least value there may seem to lie beside it, in neither of the steps.
        let falls = end.slope <= NEAR * end.bend.max(0.0);
        let rises = start.slope >= -NEAR * start.bend.max(0.0);
        let turns = falls && rises && (end.slope < start.slope || start.bend > 0.0);
        if end.slope < 0.0 && jump > 0.0 || jump == 0.0 && turns {
            self.take(id, end.is_closed, end.value);
        } else if start.slope > 0.0 && jump < 0.0 {
            self.take(id, start.is_closed, start.value);
        }
    }

    /// Takes the least values at the section, where the orbit closes.
    fn close(&mut self) {
        for (id, end) in std::mem::take(&mut self.ends) {
            let start = self.starts.iter().find(|(other, _)| *other == id).map(|(_, start)| *start);
            start.into_iter().for_each(|start| self.meet(id, end, start));
        }
    }
}

impl Observer for MinimumSearch<'_> {
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let s = self.structure;
        let before = std::mem::take(&mut self.ends);
        let is_first = self.starts.is_empty() && self.events == 0;
        for (i, id) in step.guards().iter().enumerate() {
            self.row.clear();
            self.row.extend(step.guard(i));
            poly::shift(&mut self.row, 0.0, until);
            let size = self.row.iter().fold(0.0, |size: f64, c| size.max(c.abs()));
            let slope = self.row.get(1).copied().unwrap_or_default();
            let bend = 2.0 * self.row.get(2).copied().unwrap_or_default();
            let is_closed = contact_mode(mode, guard_of(*id).0).is_closed();
            let start = GuardEnd { value: self.row[0], slope, size, bend, is_closed };
            if let Some((_, end)) = before.iter().find(|(other, _)| other == id) {
                self.meet(*id, *end, start);
            }
            if is_first {
                self.starts.push((*id, start));
            }
            let value: f64 = self.row.iter().sum();
            let slope: f64 = self.row.iter().enumerate().map(|(k, c)| k as f64 * c).sum();
            let bend: f64 = self.row.iter().enumerate().skip(2).map(|(k, c)| (k * (k - 1)) as f64 * c).sum();
            self.ends.push((*id, GuardEnd { value, slope, bend, ..start }));
            for theta in poly::minima(&self.row) {
                let theta = theta * until;
                step.state(theta, &mut self.x);
                let at = s.clock().advance(step.start(), step.time(theta));
                let value = s.guard(mode, *id, at, &self.x);
                self.take(*id, is_closed, value);
            }
        }
        ControlFlow::Continue(())
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.events += 1;
        self.ends.clear();
        let resting = letters(self.structure, jumped).filter(|(_, token)| token.starts_with('z'));
        let load = |j| {
            let side = self.structure.contact_mode(j, &jumped.to.mode).side();
            let guard = self.structure.guard_of_contact(j, side, Watch::Force);
            self.structure.guard(&jumped.to.mode, guard, jumped.at, jumped.x_plus)
        };
        self.rests.extend(resting.map(|(contact, _)| Rest {
            contact,
            load: load(contact),
            remaining: 0.0,
            uncertainty: f64::NAN,
        }));
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.start {
            // A decision about the first mode, and no event.
            self.rests.clear();
        }
        // The rests that this event begins have no uncertainty yet.
        for rest in self.rests.iter_mut().rev().take_while(|rest| rest.uncertainty.is_nan()) {
            let (remaining, of_sum) = record.accumulation.map_or((0.0, 0.0), |sum| (sum.remaining, sum.uncertainty));
            (rest.remaining, rest.uncertainty) = (remaining, record.conditioning.time + of_sum);
        }
        ControlFlow::Continue(())
    }
}

impl Course {
    /// Returns the course of the orbit of `period` cycles through `section`.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn new(map: &SectionMap<'_>, section: &Section, period: u64) -> Result<Self, SimulationError> {
        let structure = &map.simulation().structure;
        let mut words = WordObserver::new(structure, &section.x);
        let mut lowest = MinimumSearch {
            structure,
            x: section.x.clone(),
            row: Vec::new(),
            lows: Vec::new(),
            rests: Vec::new(),
            events: 0,
            ends: Vec::new(),
            starts: Vec::new(),
        };
        map.watch(section, period, &mut (&mut words, &mut lowest))?;
        lowest.close();
        let clock = structure.clock();
        let (start, length) = (map.at(0), map.simulation().period()?);
        let cycles =
            |rest: &Rest| Rest { remaining: rest.remaining / length, uncertainty: rest.uncertainty / length, ..*rest };
        let rests = lowest.rests.iter().map(cycles).collect();
        let times = words.letters.iter().map(|letter| clock.between(start, letter.at) / length).collect();
        Ok(Self { letters: words.letters, times, lows: lowest.lows, rests })
    }

    /// Returns the tokens in order of time; those of one instant in alphabetic order.
    #[must_use]
    pub fn tokens(&self) -> Vec<&str> {
        self.letters.iter().map(|letter| letter.token.as_str()).collect()
    }

    /// Returns the shortest time from an event of a contact to its next one, by the first letters of their tokens, cycles; infinite if
    /// there is none.
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

    /// Returns the rest that begins with the least load.
    pub fn weakest(&self) -> Option<&Rest> {
        self.rests.iter().min_by(|a, b| a.load.total_cmp(&b.load))
    }

    /// Returns the shortest time from the first instant of a rest to the next event of its contact, cycles.
    pub fn stay(&self, rest: &Rest) -> f64 {
        self.shortest(rest.contact, 'z', 'l')
    }

    /// Returns the middle of the longest part of the forcing period without an event in any cycle, as a share of the period. `phase` is the
    /// phase of the section.
    #[must_use]
    pub fn quiet(&self, phase: f64) -> f64 {
        let mut all: Vec<f64> = self.times.iter().map(|time| (phase + time).rem_euclid(1.0)).collect();
        all.sort_by(f64::total_cmp);
        let Some(first) = all.first().copied() else { return phase };
        all.push(first + 1.0);
        let widest = all.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        widest.map_or(phase, |gap| (0.5 * (gap[0] + gap[1])).rem_euclid(1.0))
    }

    /// Returns the time between the section and the event nearest to it, cycles.
    #[must_use]
    pub fn clearance(&self) -> f64 {
        self.times.iter().map(|time| (time - time.round()).abs()).fold(0.5, f64::min)
    }
}
