//! What happens at one instant: guards that fired, impacts, rest and release, and what follows from them at once.

use flank::hybrid::{ContactMode, Watch};

use super::{
    model::{Law, Model},
    rest::{DOUBTFUL, Fate, NOTHING, Rest},
    series::{Clock, expand},
    state::{State, Status},
    step::{clock, guards, is_rigid, rate},
    strike::{Bounce, stop, strike},
    wide::{near, size},
};

/// A guard that fell through zero, or lies beyond it (`zero` false).
#[derive(Clone, Copy, Debug)]
pub struct Fired {
    pub contact: usize,
    pub watch: Watch,
    pub zero: bool,
}

/// Rounds at one instant after which it has no end. Blows that are passed to and fro get weaker by a factor.
const ROUNDS: usize = 4096;
/// A speed relative to the fastest of the instant that is none: the limit of blows passed to and fro.
const LOST: f64 = 1e-20;
/// Orders looked at.
const ORDERS: usize = 10;

/// Carries out the instant; returns what struck.
pub fn resolve(m: &Model, s: &mut State, mut fired: Vec<Fired>) -> Result<(Vec<Bounce>, Vec<bool>), String> {
    let mut bounces = Vec::new();
    let mut struck = vec![false; m.contacts.len()];
    for _ in 0..ROUNDS {
        let mut strikers = Vec::new();
        for f in &fired {
            let (j, side) = (f.contact, f.watch.side());
            match (is_rigid(m, j), f.watch) {
                (true, Watch::Force) => s.contacts[j].zeros = 2,
                (true, _) => {
                    s.contacts[j] = Status { side, ..Status::APART };
                    s.put_on_flank(m, j, side);
                    struck[j] = true;
                    strikers.push(j);
                }
                _ => follow(m, s, f),
            }
        }
        // Left through the flank and let go at once: the flank counts.
        for f in fired.iter().filter(|f| !is_rigid(m, f.contact) && f.watch != Watch::Force) {
            if s.contacts[f.contact].mode == ContactMode::Separated {
                s.contacts[f.contact].force_zero = false;
            }
        }
        if !strikers.is_empty() {
            let last = strike(m, s, &strikers)?;
            let fastest = bounces.iter().chain(&last).map(|b: &Bounce| b.approach).fold(0.0, f64::max);
            let lost = !last.is_empty() && last.iter().all(|b| b.approach <= LOST * fastest);
            bounces.extend(last);
            if lost {
                let quiet = |j: &usize| struck[*j] && size(s.gap(m, *j, s.contacts[*j].side).1) <= LOST * fastest;
                let settling: Vec<usize> = (0..m.contacts.len()).filter(quiet).collect();
                stop(m, s, &settling);
            }
        }
        settle(m, s)?;
        fired = outside(m, s)?;
        if fired.is_empty() {
            return Ok((bounces, struck));
        }
    }
    Err("the instant does not end".into())
}

/// One fired guard of a compliant contact.
fn follow(m: &Model, s: &mut State, f: &Fired) {
    let j = f.contact;
    let status = s.contacts[j];
    let apart = status.mode == ContactMode::Separated;
    let mode = match f.watch {
        Watch::Force if apart => return,
        Watch::Force if status.mode.is_closed() => Status::detached(status.side),
        Watch::Force => Status::closed(status.side),
        flank if apart => Status::closed(flank.side()),
        _ => ContactMode::Separated,
    };
    let side = if f.watch == Watch::Force { status.side } else { f.watch.side() };
    let on_flank = f.watch != Watch::Force;
    let zeros = if on_flank { status.zeros.max(1) } else { status.zeros };
    s.contacts[j] = Status { mode, side, zeros, force_zero: !on_flank && f.zero, opens: false };
    if on_flank {
        s.put_on_flank(m, j, side);
    }
    if let (Law::Power { floor, .. }, true) = (&m.contacts[j].law, apart) {
        let approach = -s.gap(m, j, side).1;
        s.latches[j] = if approach > *floor { approach } else { *floor };
    }
}

/// Which of the rigid contacts that touch at rate zero stay at rest.
fn settle(m: &Model, s: &mut State) -> Result<(), String> {
    let touches = |j: &usize| {
        let c = s.contacts[*j];
        is_rigid(m, *j) && (c.mode.is_closed() || c.zeros >= 2)
    };
    let set: Vec<(usize, f64)> = (0..m.contacts.len()).filter(touches).map(|j| (j, s.contacts[j].side)).collect();
    if set.is_empty() {
        return Ok(());
    }
    let (mut bare, mut orders) = (s.clone(), ORDERS);
    for (j, status) in bare.contacts.iter_mut().enumerate() {
        match m.contacts[j].law {
            Law::Rigid(_) => status.mode = ContactMode::Separated,
            // A power law that only starts adds less than its whole order.
            Law::Power { p, q, .. } if status.mode.is_closed() && status.zeros > 0 && q > 1 => {
                status.mode = ContactMode::Separated;
                orders = orders.min(p / q);
            }
            _ => {}
        }
    }
    let h = 1.0 / rate(m, s).max(1e-9);
    let mut rest = Rest::decide(set.into_iter());
    let mut order = 0;
    // The least order that decides.
    while order <= orders {
        let mut trial = Rest::decide(rest.contacts.iter().map(|h| (h.contact, h.side)).collect::<Vec<_>>().into_iter());
        expand(m, &bare, Clock::Fraction(1), h, order, &mut trial);
        rest = trial;
        if rest.is_decided() || rest.doubt.is_some() {
            break;
        }
        order += 1;
    }
    if let Some(doubt) = rest.doubt {
        return Err(doubt);
    }
    for held in rest.contacts {
        let status = &mut s.contacts[held.contact];
        *status = match held.fate {
            Fate::Closed => Status { mode: Status::closed(held.side), zeros: held.zeros, opens: false, ..*status },
            Fate::Open => Status { mode: ContactMode::Separated, zeros: held.zeros, opens: true, ..*status },
            Fate::Undecided => Status { opens: true, zeros: ORDERS, ..*status },
        };
    }
    Ok(())
}

/// Guards that are negative right after the instant.
fn outside(m: &Model, s: &mut State) -> Result<Vec<Fired>, String> {
    let rate = rate(m, s);
    let clock = clock(m, s, rate).ok_or("power laws with roots that have no common clock start at one instant")?;
    let held = super::step::resting(m, s);
    let orders = if let Clock::Fraction(q) = clock { (ORDERS * q).min(72) } else { 2 };
    let series = expand(m, s, clock, 1.0 / rate.max(1e-9), orders, &mut Rest::hold(held.into_iter()));
    let mut fired = Vec::new();
    for g in guards(m, s, &series) {
        let status = s.contacts[g.contact];
        if status.opens && g.watch.side() == status.side || is_rigid(m, g.contact) && g.watch == Watch::Force {
            continue;
        }
        for (i, c) in g.c.iter().enumerate() {
            let k = g.zeros + i;
            let terms = match (g.watch, series.clock) {
                (Watch::Force, _) => series.force_size(m, g.contact, k),
                // The root of a depth.
                (_, Clock::Root(j)) if j == g.contact && status.mode != ContactMode::Separated => size(*c),
                _ => series.gap_size(m, g.contact, k),
            };
            if size(*c) <= NOTHING * terms {
                continue;
            }
            if k > 0 && size(*c) < DOUBTFUL * terms {
                return Err(format!("contact {} leaves its guard by a share {:e}", g.contact, size(*c) / terms));
            }
            if near(*c) < 0.0 {
                fired.push(Fired { contact: g.contact, watch: g.watch, zero: k > 0 });
            } else if i > 0 && g.zeros == 0 {
                // It is zero without having been known to be.
                let status = &mut s.contacts[g.contact];
                let steps = if let Clock::Fraction(q) = series.clock { q } else { 1 };
                match g.watch {
                    Watch::Force => status.force_zero = true,
                    flank => (status.side, status.zeros) = (flank.side(), i / steps),
                }
            }
            break;
        }
    }
    Ok(fired)
}
