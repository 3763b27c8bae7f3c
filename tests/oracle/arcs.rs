//! Arc by arc: from Flank's own state after an instant, the oracle's next event against Flank's, and the difference against
//! the uncertainty that Flank states for it.

use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};

use flank::{
    Simulation,
    engine::{Observer, State as FlankState},
    event::EventRecord,
    hybrid::{ContactMode, Mode, Watch},
    integrate::DenseStep,
    scene::Scene,
    system::{Structure, contact_mode, guard_id},
};
use serde_json::Value;

use super::{
    model::{Law, Model, Tweak},
    sequence::Runner,
    state::{State, Status},
    step::is_rigid,
    wide::{Wide, near, size, wide},
};

/// One event over one arc.
pub struct Arc {
    /// Error of its time, and the uncertainty stated.
    pub error: f64,
    pub stated: f64,
    /// Another contact, or no event at all.
    pub other: Option<String>,
}

impl Arc {
    pub fn is_held(&self) -> bool {
        self.other.is_none() && self.error <= self.stated
    }
}

/// Stops at each instant.
struct Each {
    record: Option<EventRecord>,
    deadline: Instant,
}

impl Observer for Each {
    fn step(&mut self, _: &Mode, _: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        if Instant::now() > self.deadline { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.record = Some(record.clone());
        ControlFlow::Break(())
    }
}

/// Time of an instant in 32 digits.
fn time(structure: &Structure, at: flank::hybrid::Instant) -> Wide {
    let t = structure.clock().time(at);
    wide(t.hi) + wide(t.lo)
}

/// Flank's state with what it knows to be zero.
fn taken(m: &Model, structure: &Structure, from: &FlankState) -> State {
    let known = |set: &flank::hybrid::GuardSet, j: usize, watch: Watch| set.contains(guard_id(j, watch));
    let contacts = (0..m.contacts.len()).map(|j| {
        let mode = contact_mode(&from.jump.mode, j);
        let back = known(&from.jump.pinned, j, Watch::BackFlank);
        let side = if mode == ContactMode::Separated { if back { -1.0 } else { 1.0 } } else { mode.side() };
        let flank = if side > 0.0 { Watch::DriveFlank } else { Watch::BackFlank };
        let pinned = known(&from.jump.pinned, j, flank);
        let still = pinned && known(&from.jump.still, j, flank);
        let force = known(&from.jump.pinned, j, Watch::Force);
        let zeros = match (is_rigid(m, j), mode.is_closed()) {
            (true, true) => 0,
            (rigid, _) => usize::from(pinned) + usize::from(still) + usize::from(rigid && still && force),
        };
        Status { mode, side, zeros, force_zero: force && !is_rigid(m, j), opens: false }
    });
    let n = m.n;
    let numbers = |x: &[f64]| x.iter().map(|x| wide(*x)).collect();
    let latches = (0..m.contacts.len()).map(|j| match (structure.contacts()[j].latch(), &m.contacts[j].law) {
        (Some(i), _) => wide(from.x[i]),
        (None, Law::Power { initial, .. }) => *initial,
        _ => wide(0.0),
    });
    let mut s = State {
        t: time(structure, from.at),
        q: numbers(&from.x[..n]),
        v: numbers(&from.x[n..2 * n]),
        latches: latches.collect(),
        contacts: contacts.collect(),
    };
    for j in 0..m.contacts.len() {
        if s.contacts[j].zeros > 0 {
            let side = s.contacts[j].side;
            s.put_on_flank(m, j, side);
        }
    }
    s
}

/// All arcs of a scene, at most `most`.
pub fn arcs(value: &Value, most: usize) -> Vec<Arc> {
    let mut out = Vec::new();
    let Ok(scene) = Scene::from_value(value.clone(), "random") else { return out };
    let Ok(case) = Simulation::from_scene(&scene) else { return out };
    let (Ok(start), m) = (case.start(), Model::new(case.structure.spec(), Tweak::NONE)) else { return out };
    let end = case.instants()[2];
    let Ok((mut engine, _)) = case.limited(start, u64::MAX) else { return out };
    let deadline = Instant::now() + Duration::from_secs(20);
    let mut fresh = false;
    while out.len() < most {
        let from = engine.state().clone();
        let mut each = Each { record: None, deadline };
        let ended = engine.run(end, &mut each);
        let Some(record) = each.record.filter(|_| ended.is_ok()) else { return out };
        // The first decides the start; switches, sums and touches are no events that end an arc.
        // One at the time of a switch has no uncertainty of its own.
        let is_event = record.conditioning.time > 0.0
            && !record.fired.is_empty()
            && !record.start
            && !record.graze
            && record.accumulation.is_none();
        let is_arc = fresh && is_event;
        if is_arc {
            out.extend(arc(&m, &case.structure, &from, &record));
        }
        // After a touch the state is on a flank only to rounding; where a switch fires a guard, the oracle starts before the switch.
        // Strikes in turn leave speeds that are rounding of the first ones.
        let in_turn = record.jumps > 8;
        let fires_at_switch = record.switched && !record.fired.is_empty();
        fresh = record.accumulation.is_none() && !record.graze && !in_turn && !fires_at_switch;
    }
    out
}

/// `None` if it cannot be told.
fn arc(m: &Model, structure: &Structure, from: &FlankState, record: &EventRecord) -> Option<Arc> {
    let told = time(structure, record.at);
    let state = taken(m, structure, from);
    let span = told - state.t;
    let stated = record.conditioning.time;
    let mut arc = Arc { error: 0.0, stated, other: None };
    // So short a flight is a touch to the oracle, which holds speeds below 1e-13 of their terms for rest.
    if near(span) <= 1e6 * stated {
        return None;
    }
    let mut run = Runner::new(m, state);
    let limit = told + span * wide(0.01) + wide(2.0 * stated);
    while run.events.is_empty() {
        match run.advance(limit) {
            Ok(false) => {}
            Err(_) => return None,
            Ok(true) => {
                arc.other = Some(format!("no event near {:e}", near(told)));
                return Some(arc);
            }
        }
    }
    let first = run.events[0];
    // Of several at one instant, one is enough.
    let fires = record.fired.iter().any(|id| run.events.iter().any(|e| flank::system::guard_of(id).0 == e.contact));
    if !fires {
        arc.other = Some(format!("contact {} at {:e}, not at {:e}", first.contact, near(first.t), near(told)));
    }
    arc.error = size(first.t - told);
    Some(arc)
}
