//! The whole sequence of events from a start: steps, first roots, instants, accumulations.

use flank::hybrid::ContactMode;

use super::{
    instant::{Fired, resolve},
    model::{Law, Model},
    rest::NOTHING,
    roots::{self, First},
    series::expand,
    state::State,
    step::{Guard, clock, guards, is_rigid, rate, resting, step},
    strike::{Bounce, stop},
    wide::{Wide, near, size, wide},
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    DriveContact,
    BackContact,
    Separation,
    Clear,
    Impact,
    Stick,
    Release,
}

#[derive(Clone, Copy, Debug)]
pub struct Event {
    pub t: Wide,
    pub contact: usize,
    pub kind: Kind,
}

/// How far the oracle came.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    Reached,
    /// Enough events.
    Budget,
    /// What follows cannot be told in doubles, and why.
    Ambiguous(String),
}

pub struct Sequence {
    pub events: Vec<Event>,
    /// Slow ends of accumulations: contact, from, to.
    pub tails: Vec<(usize, Wide, Wide)>,
    /// Modes in which the motion leaves the start.
    pub first: Vec<ContactMode>,
    pub ending: Ending,
    /// Up to where it holds.
    pub until: Wide,
}

/// Bounces of one contact that get smaller.
#[derive(Clone, Copy, Default)]
struct Chatter {
    side: f64,
    count: u32,
    fastest: f64,
    rebound: f64,
    slow_since: Option<Wide>,
}

/// Speed of an accumulation's tail that is not compared, and speed at which the rest of it is summed, against its fastest.
const SLOW: f64 = 1e-6;
const SUMMED: f64 = 1e-13;
/// Steps before the oracle gives up.
const STEPS: usize = 60_000;
/// A turn within this share of its terms is a touch that doubles cannot tell.
const TOUCH: f64 = 1e-14;

/// The next events of a motion.
pub struct Runner<'a> {
    pub m: &'a Model,
    pub state: State,
    chatter: Vec<Chatter>,
    pub events: Vec<Event>,
    pub tails: Vec<(usize, Wide, Wide)>,
    steps: usize,
}

/// The motion from `start` to `end`, at most `budget` events (those of tails apart).
pub fn sequence(m: &Model, start: State, end: Wide, budget: usize) -> Sequence {
    let mut run = Runner::new(m, start);
    let mut first = Vec::new();
    let ending = match run.instant(Vec::new(), true) {
        Err(doubt) => Ending::Ambiguous(doubt),
        Ok(()) => {
            first = run.state.contacts.iter().map(|c| c.mode).collect();
            run.to(end, budget)
        }
    };
    for (j, mode) in m.back_of.iter().zip(first.split_off(first.len().saturating_sub(m.back_of.len()))) {
        if mode != ContactMode::Separated {
            first[*j] = mode.turned();
        }
    }
    let until = if ending == Ending::Reached { end } else { run.state.t };
    run.merge_flanks();
    Sequence { events: run.events, tails: run.tails, first, ending, until }
}

/// The state at `end` of the motion from `start`, and the events on the way.
pub fn follow(m: &Model, start: State, end: Wide) -> Result<(State, Vec<Event>), String> {
    let mut run = Runner::new(m, start);
    run.instant(Vec::new(), true)?;
    while !run.advance(end)? {}
    run.merge_flanks();
    Ok((run.state, run.events))
}

impl<'a> Runner<'a> {
    /// Lets the events of back flanks that differ be those of their contacts.
    fn merge_flanks(&mut self) {
        let own = self.m.contacts.len() - self.m.back_of.len();
        for event in &mut self.events {
            if let Some(back) = event.contact.checked_sub(own) {
                event.contact = self.m.back_of[back];
                event.kind = if event.kind == Kind::DriveContact { Kind::BackContact } else { event.kind };
            }
        }
        for (contact, ..) in &mut self.tails {
            *contact = contact.checked_sub(own).map_or(*contact, |back| self.m.back_of[back]);
        }
    }

    pub fn new(m: &'a Model, state: State) -> Self {
        let chatter = vec![Chatter::default(); m.contacts.len()];
        Self { m, state, chatter, events: Vec::new(), tails: Vec::new(), steps: 0 }
    }

    fn to(&mut self, end: Wide, budget: usize) -> Ending {
        loop {
            let told = self.events.iter().filter(|e| !self.is_slow(e)).count();
            if told >= budget {
                return Ending::Budget;
            }
            match self.advance(end) {
                Ok(true) => return Ending::Reached,
                Ok(false) => {}
                Err(doubt) => return Ending::Ambiguous(doubt),
            }
        }
    }

    fn is_slow(&self, e: &Event) -> bool {
        let since = self.chatter[e.contact].slow_since;
        e.kind == Kind::Impact
            && (since.is_some_and(|s| e.t >= s)
                || self.tails.iter().any(|(j, a, b)| *j == e.contact && e.t >= *a && e.t <= *b))
    }

    /// One step, to an event, a known time or its own end; whether the end is reached.
    pub fn advance(&mut self, end: Wide) -> Result<bool, String> {
        let m = self.m;
        self.steps += 1;
        if self.steps > STEPS {
            return Err("more steps than the oracle takes".into());
        }
        if self.state.t >= end {
            return Ok(true);
        }
        let schedules = m.contacts.iter().map(|c| &c.spring).chain(m.load_schedules.iter().map(|(s, _)| s));
        let switches = schedules.filter_map(|schedule| schedule.next(self.state.t));
        let switch = switches.fold(end, |a, b| if b < a { b } else { a });
        let span = switch - self.state.t;
        let step = step(m, &self.state, near(span)).ok_or("power laws without a common clock")?;
        let bound = step.theta(span);
        let reach = bound.unwrap_or(wide(step.end));
        let mut limit = near(reach);
        let mut found: Vec<(Wide, Guard)> = Vec::new();
        for g in guards(m, &self.state, &step.series) {
            let added: f64 = g.c.iter().rev().fold(0.0, |s, c| s * limit + size(*c));
            let known = if g.zeros == 0 { g.size } else { added };
            if added <= NOTHING * g.size {
                continue;
            }
            match roots::first(&g.c, limit, TOUCH * known) {
                First::None => {}
                First::At(theta) => {
                    limit = limit.min(near(theta) * (1.0 + 1e-14));
                    found.push((theta, g));
                }
                First::Touch(theta) => {
                    let before = found.iter().all(|(t, _)| near(*t) > theta);
                    if before {
                        return Err(format!("contact {} touches its guard", g.contact));
                    }
                }
            }
        }
        let first = found.iter().map(|f| f.0).fold(reach, |a, b| if b < a { b } else { a });
        let batch: Vec<Fired> = found
            .iter()
            .filter(|(theta, _)| size(*theta - first) <= 1e-21 * near(reach))
            .map(|(_, g)| Fired { contact: g.contact, watch: g.watch, zero: true })
            .collect();
        let before = self.state.clone();
        self.state = step.at(&before, first);
        if batch.is_empty() {
            if bound.is_some() {
                self.state.t = switch;
                // Stiffness changes here, and forces with it.
                self.instant(Vec::new(), false)?;
            }
            return Ok(bound.is_some() && switch >= end);
        }
        self.instant(batch, false)?;
        Ok(false)
    }

    /// One instant, told in events.
    fn instant(&mut self, fired: Vec<Fired>, is_start: bool) -> Result<(), String> {
        let before: Vec<ContactMode> = self.state.contacts.iter().map(|c| c.mode).collect();
        let (bounces, struck) = resolve(self.m, &mut self.state, fired)?;
        if is_start {
            return Ok(());
        }
        let t = self.state.t;
        for j in 0..before.len() {
            let (was, is) = (before[j], self.state.contacts[j].mode);
            for kind in kinds(is_rigid(self.m, j), was, is, struck[j]).into_iter().flatten() {
                self.events.push(Event { t, contact: j, kind });
            }
        }
        // Strikes in turn: those so near that time cannot tell them apart are one instant.
        let again = |i: usize| bounces[..i].iter().any(|b| b.contact == bounces[i].contact);
        if (0..bounces.len()).any(again) {
            self.tails.extend(bounces.iter().map(|b| (b.contact, t, t)));
        }
        self.chatters(&bounces)
    }

    /// Follows bounces, and sums those that have become small enough.
    fn chatters(&mut self, bounces: &[Bounce]) -> Result<(), String> {
        let t = self.state.t;
        let mut settling = Vec::new();
        for b in bounces {
            let c = &mut self.chatter[b.contact];
            let rebound = near(b.rebound);
            if c.side == b.side && rebound < c.rebound {
                c.count += 1;
            } else {
                *c = Chatter { side: b.side, count: 0, fastest: b.approach, rebound, slow_since: None };
            }
            c.rebound = rebound;
            if b.approach < SLOW * c.fastest && c.slow_since.is_none() {
                c.slow_since = Some(t);
            }
            let steady = if let Law::Rigid(law) = &self.m.contacts[b.contact].law { law.steady() } else { 0.0 };
            if c.count >= 3 && rebound <= SUMMED * c.fastest && rebound < steady && near(b.restitution) > 0.0 {
                settling.push(*b);
            }
        }
        if settling.is_empty() {
            return Ok(());
        }
        // Gap u t − A t²/2 + J t³/6.
        let m = self.m;
        let pace = rate(m, &self.state);
        let plain = clock(m, &self.state, pace).ok_or("no clock")?;
        let h = 1.0 / pace.max(1e-9);
        let held = resting(m, &self.state);
        let series = expand(
            m,
            &self.state,
            super::series::Clock::Fraction(1),
            h,
            4,
            &mut super::rest::Rest::hold(held.into_iter()),
        );
        if plain != super::series::Clock::Fraction(1) {
            return Err("an accumulation while a power law starts".into());
        }
        let mut ends = Vec::new();
        for b in &settling {
            let h = wide(h);
            let g = |k: usize| series.gap(m, b.contact, b.side, k);
            let (a, j) = (-(wide(2.0) * g(2)) / (h * h), wide(6.0) * g(3) / (h * h * h));
            let over = wide(1.0) - b.restitution;
            let small = j * b.rebound / (a * a);
            if near(a) <= 0.0 || size(small) > 1e-6 * near(over) {
                return Ok(());
            }
            ends.push(t + wide(2.0) * b.rebound / (a * over) * (wide(1.0) + wide(2.0) * small / (wide(3.0) * over)));
        }
        let set: Vec<usize> = settling.iter().map(|b| b.contact).collect();
        stop(m, &mut self.state, &set);
        let (_, struck) = resolve(m, &mut self.state, Vec::new())?;
        if struck.contains(&true) || set.iter().any(|j| !self.state.contacts[*j].mode.is_closed()) {
            return Err("an accumulation does not end in rest".into());
        }
        for (j, end) in set.iter().zip(ends) {
            let from = self.chatter[*j].slow_since.unwrap_or(t);
            self.tails.push((*j, from, end));
            self.events.push(Event { t: end, contact: *j, kind: Kind::Stick });
            self.chatter[*j] = Chatter::default();
        }
        Ok(())
    }
}

/// What happened to a contact, as the event log tells it.
fn kinds(rigid: bool, was: ContactMode, is: ContactMode, struck: bool) -> [Option<Kind>; 2] {
    let (closed, closes) = (was.is_closed(), is.is_closed());
    if rigid {
        let impact = (struck && !closed).then_some(Kind::Impact);
        let rest = match (closed, closes) {
            (false, true) => Some(Kind::Stick),
            (true, false) => Some(Kind::Release),
            _ => None,
        };
        return [impact, rest];
    }
    let kind = match (closed, is) {
        (false, ContactMode::Drive) => Some(Kind::DriveContact),
        (false, ContactMode::Back) => Some(Kind::BackContact),
        (true, _) if !closes => Some(Kind::Separation),
        _ if was != is => Some(Kind::Clear),
        _ => None,
    };
    [kind, None]
}
