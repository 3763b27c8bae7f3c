//! Event records as serialisable rows, one for each instant.

use std::ops::ControlFlow;

use serde::Serialize;

use super::contacts::{Contacts, side_at};
use crate::{
    engine::{JumpRecord, Observer},
    event::EventRecord,
    hybrid::{ContactMode, ContactView, HybridSystem, Instant, Mode},
    integrate::DenseStep,
};

/// Digits of a written time: all digits of a pair of doubles.
const DIGITS: usize = 32;

/// Kind of an event of one contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum EventKind {
    /// Force begins on the drive flank.
    DriveContact,
    /// Force begins on the back flank.
    BackContact,
    /// Force ends: at the flank, or inside its zone where the law would begin to pull.
    Separation,
    /// The flank's zone is left without force: a detached contact becomes a separated one.
    Clear,
    /// A rigid flank is struck.
    Impact,
    /// A rigid contact comes to rest.
    Stick,
    /// A resting rigid contact is released.
    Release,
    /// A guard is touched and not crossed.
    Graze,
    /// The first mode of the run is decided for a contact that starts on its flank, and the contact stays apart.
    Start,
}

/// Event of one contact at one instant. Measures of the contact episode that ends there are absent where none ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ContactEvent {
    /// Index of the contact.
    pub mesh: usize,
    /// Name of the contact.
    pub name: String,
    /// Kind of the event.
    pub kind: EventKind,
    /// State of the contact before the event.
    pub from: &'static str,
    /// State of the contact after the event.
    pub to: &'static str,
    /// Deflection δ just before, m.
    pub deflection: f64,
    /// Rate just before, m/s: of the deflection; of the gap (negative while it closes) for a rigid contact.
    pub velocity: f64,
    /// Jumps of the instant in which the contact takes an impulse, for an impact.
    pub blows: Option<u32>,
    /// Closing speed at the beginning of the episode that begins or ends here, m/s; of an impact before its first blow.
    pub approach: Option<f64>,
    /// Opening speed at the end of the ending episode, m/s; of an impact right after its last blow.
    pub release: Option<f64>,
    /// Duration of the force, s; 0 for an impact.
    pub duration: Option<f64>,
    /// Largest force, N.
    pub peak_force: Option<f64>,
    /// Largest penetration, m.
    pub peak_penetration: Option<f64>,
    /// Impulse, N s; of an impact the sum of its blows.
    pub impulse: Option<f64>,
    /// Energy lost, J; of an impact `½ P (1 − e) × approach speed`, summed over its blows.
    pub energy_lost: Option<f64>,
    /// Restitution obtained: release over approach speed; of an impact that of its first blow, absent if it was at rest.
    pub restitution: Option<f64>,
    /// Restitution that the contact's law gives for a free impact.
    pub restitution_free: Option<f64>,
}

/// Events of one instant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EventRow {
    /// Index of the row, from 0.
    pub index: u64,
    /// Forcing cycle n.
    pub n: i64,
    /// Phase in the forcing cycle, s.
    pub phase: f64,
    /// Time as a decimal number, s, to 32 digits.
    pub t: String,
    /// Time rounded to a double, s.
    pub seconds: f64,
    /// True if the record decides the first mode of the run.
    pub start: bool,
    /// True if a known stiffness switch fell on the instant.
    pub switch: bool,
    /// End of an impact sequence: the number of its resolved impacts, and the time left after the last, s.
    pub accumulation: Option<(u32, f64)>,
    /// Jumps iterated at the instant.
    pub jumps: u32,
    /// Largest displacement onto a guard, in the guard's units.
    pub projected: f64,
    /// Value of the guard at the event, in its units.
    pub residual: f64,
    /// Rate of the guard there, in its units per second.
    pub slope: f64,
    /// Uncertainty of the time, s.
    pub uncertainty: f64,
    /// Estimated uncertainty of the time, s, from earlier errors that the motion has amplified; `None` where it is not computed.
    pub inherited_uncertainty: Option<f64>,
    /// True if `uncertainty` is an estimate, not a proven bound.
    pub estimated: bool,
    /// Contacts with an event, in rising order.
    pub contacts: Vec<ContactEvent>,
}

/// Log of event records, which measures the contacts for it.
pub struct EventLog<'s, S: ?Sized, F> {
    system: &'s S,
    contacts: Contacts<'s, S>,
    /// True if nobody reads the rows.
    is_silent: bool,
    rows: u64,
    row: F,
}

impl<'s, S: HybridSystem + ContactView + ?Sized, F: FnMut(EventRow) -> ControlFlow<()>> EventLog<'s, S, F> {
    /// Returns a log that passes its rows to `row`. `contacts` runs inside it and needs no other observer.
    #[must_use]
    pub fn new(system: &'s S, contacts: Contacts<'s, S>, row: F) -> Self {
        Self { system, contacts, is_silent: false, rows: 0, row }
    }

    /// Forms no rows, and measures in the measured time alone.
    #[must_use]
    pub fn silent(mut self) -> Self {
        self.is_silent = true;
        self.contacts = self.contacts.only_measured();
        self
    }

    /// Returns the measures.
    #[must_use]
    pub fn contacts(&self) -> &Contacts<'s, S> {
        &self.contacts
    }

    fn describe(&self, record: &EventRecord) -> EventRow {
        let clock = self.system.clock();
        let t = clock.time(record.at);
        let mut contacts = Vec::new();
        for j in 0..self.system.contact_count() {
            for kind in kinds(self.system, j, record).into_iter().flatten() {
                contacts.push(self.contact(j, kind, record));
            }
        }
        EventRow {
            index: self.rows,
            n: record.at.cycle,
            phase: record.at.phase.value(),
            t: t.decimal(DIGITS),
            seconds: t.value(),
            start: record.start,
            switch: record.switched,
            accumulation: record.accumulation.map(|a| (a.resolved, a.remaining)),
            jumps: record.jumps,
            projected: record.projected,
            residual: record.conditioning.residual,
            slope: record.conditioning.slope,
            uncertainty: record.conditioning.time,
            inherited_uncertainty: None,
            estimated: record.conditioning.estimated,
            contacts,
        }
    }

    fn contact(&self, j: usize, kind: EventKind, record: &EventRecord) -> ContactEvent {
        let s = self.system;
        let (before, after) = (s.contact_mode(j, &record.from), s.contact_mode(j, &record.to));
        let side = side_at(s, j, record);
        let (deflection, rate) = s.deflection(j, side, record.at, &record.x_minus);
        let begins = matches!(kind, EventKind::DriveContact | EventKind::BackContact);
        let ended = self
            .contacts
            .ended(j)
            .filter(|_| matches!(kind, EventKind::Separation | EventKind::Impact | EventKind::Release));
        let contact_side = after.side();
        ContactEvent {
            mesh: j,
            name: s.contact_name(j).to_owned(),
            kind,
            from: before.name(),
            to: after.name(),
            deflection,
            velocity: if s.is_rigid(j) { -side * rate } else { rate },
            blows: ended.map(|e| e.blows).filter(|_| kind == EventKind::Impact),
            approach: if begins { Some(contact_side * rate) } else { ended.map(|e| e.approach) },
            release: ended.map(|e| e.release),
            duration: ended.map(|e| e.duration),
            peak_force: ended.and_then(|e| e.peak_force),
            peak_penetration: ended.map(|e| e.peak_penetration),
            impulse: ended.map(|e| e.impulse),
            energy_lost: ended.map(|e| e.energy_lost),
            restitution: ended.and_then(|e| e.restitution),
            restitution_free: ended.and_then(|e| s.free_restitution(j, e.approach)),
        }
    }
}

/// Returns the kinds of the event of contact `j`: up to two (an impact that comes to rest at once).
fn kinds<S: ContactView + ?Sized>(s: &S, j: usize, record: &EventRecord) -> [Option<EventKind>; 2] {
    let (before, after) = (s.contact_mode(j, &record.from), s.contact_mode(j, &record.to));
    let fired = |flank: bool| {
        record.fired.iter().map(|id| s.watch(id)).any(|(k, watch)| k == j && (watch.side() != 0.0 || !flank))
    };
    let (closed, closes) = (before.is_closed(), after.is_closed());
    if record.graze {
        return [fired(false).then_some(EventKind::Graze), None];
    }
    if s.is_rigid(j) {
        let struck = fired(true) && !closed && record.accumulation.is_none();
        let rate = |x: &[f64]| s.deflection(j, side_at(s, j, record), record.at, x).1;
        let moving = rate(&record.x_minus) != rate(&record.x_plus);
        let impact = (struck && (moving || !record.start)).then_some(EventKind::Impact);
        let rest = match (closed, closes) {
            (false, true) => Some(EventKind::Stick),
            (true, false) => Some(EventKind::Release),
            _ => None,
        };
        return if impact.is_some() { [impact, rest] } else { [rest.or(start(record, fired(true))), None] };
    }
    let kind = match (closed, after) {
        (false, ContactMode::Drive) => Some(EventKind::DriveContact),
        (false, ContactMode::Back) => Some(EventKind::BackContact),
        (true, _) if !closes => Some(EventKind::Separation),
        _ if before != after => Some(EventKind::Clear),
        _ => start(record, fired(true)),
    };
    [kind, None]
}

fn start(record: &EventRecord, on_flank: bool) -> Option<EventKind> {
    (record.start && on_flank).then_some(EventKind::Start)
}

impl<S: HybridSystem + ContactView + ?Sized, F: FnMut(EventRow) -> ControlFlow<()>> Observer for EventLog<'_, S, F> {
    fn observed_from(&self) -> Instant {
        if self.is_silent { self.contacts.observed_from() } else { Instant::FIRST }
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.contacts.step(mode, step, until)
    }

    fn wants_jumps(&self) -> bool {
        self.contacts.wants_jumps()
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        self.contacts.jump(jumped);
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.contacts.event(record)?;
        if self.is_silent {
            return ControlFlow::Continue(());
        }
        let row = self.describe(record);
        self.rows += 1;
        (self.row)(row)
    }
}
