//! Impacts: all rigid contacts that strike at one instant, those at rest, and where nothing rebounds those that touch.

use super::{
    linear::{complementary, least},
    model::{Law, Model},
    rest::{DOUBTFUL, NOTHING},
    state::{State, Status},
    step::is_rigid,
    wide::{Wide, near, size, wide},
};

/// One contact that struck and bounced.
#[derive(Clone, Copy, Debug)]
pub struct Bounce {
    pub contact: usize,
    pub side: f64,
    pub approach: f64,
    /// Speed after, and restitution.
    pub rebound: Wide,
    pub restitution: Wide,
}

/// Restitution of an approach at `speed`.
fn restitution(m: &Model, j: usize, speed: Wide) -> Wide {
    if let Law::Rigid(law) = &m.contacts[j].law { law.at(speed) } else { wide(0.0) }
}

/// `G M⁻¹ Gᵀ` of some contacts, each seen from its side.
fn coupling(m: &Model, set: &[(usize, f64)]) -> Vec<Vec<Wide>> {
    let entry = |a: &(usize, f64), b: &(usize, f64)| wide(a.1 * b.1) * m.mobility[a.0][b.0];
    set.iter().map(|a| set.iter().map(|b| entry(a, b)).collect()).collect()
}

fn push(m: &Model, s: &mut State, set: &[(usize, f64)], impulses: &[Wide]) {
    for ((j, side), p) in set.iter().zip(impulses) {
        let p = wide(*side) * *p;
        s.v.iter_mut().zip(&m.contacts[*j].push).for_each(|(v, g)| *v = *v - *g * p);
    }
}

/// Applies the impulses. `strikers` are at their flanks, with `side` set.
pub fn strike(m: &Model, s: &mut State, strikers: &[usize]) -> Result<Vec<Bounce>, String> {
    let mut set: Vec<(usize, f64)> = Vec::new();
    let is_dead = |j: &usize| restitution(m, *j, wide(0.0)) == wide(0.0);
    for (j, status) in s.contacts.iter().enumerate().filter(|(j, _)| is_rigid(m, *j)) {
        let touches = status.mode.is_closed() || status.zeros > 0 && is_dead(&j) && strikers.iter().all(is_dead);
        if strikers.contains(&j) || touches {
            set.push((j, status.side));
        }
    }
    let rests = |s: &State, j: usize| !strikers.contains(&j) && s.contacts[j].zeros != 1;
    let mut before = Vec::new();
    let mut scale: f64 = 0.0;
    for (j, side) in &set {
        let (_, rate, _, terms) = s.gap(m, *j, *side);
        scale = scale.max(terms);
        before.push(if rests(s, *j) { wide(0.0) } else { rate });
    }
    // Gaps close at the speed of the approach.
    let returned = |((j, _), rate): (&(usize, f64), &Wide)| {
        if strikers.contains(j) { restitution(m, *j, -*rate) } else { wide(0.0) }
    };
    let e: Vec<Wide> = set.iter().zip(&before).map(returned).collect();
    let a = coupling(m, &set);
    let b: Vec<Wide> = before.iter().zip(&e).map(|(w, e)| *w + *e * *w).collect();
    let slack = NOTHING * scale;
    let Some(found) = complementary(&a, &b, &vec![false; set.len()], slack) else {
        return Err("no set of impulses fits".into());
    };
    push(m, s, &set, &found.x);
    let mut bounces = Vec::new();
    for (i, (j, side)) in set.iter().enumerate() {
        let pressed = near(found.x[i]) * near(a[i][i]);
        let clear = pressed.max(near(found.w[i]));
        if clear > slack && clear < DOUBTFUL * size(before[i]).max(f64::MIN_POSITIVE) {
            return Err(format!("contact {j} is struck by a share {:e}", clear / size(before[i])));
        }
        let is_struck = pressed > slack;
        let after = found.w[i] - e[i] * before[i];
        let opens = near(after) > slack || is_struck && e[i] != wide(0.0);
        let status = &mut s.contacts[*j];
        let stays = status.mode.is_closed() && !opens;
        *status = Status {
            mode: if stays { status.mode } else { Status::APART.mode },
            zeros: if opens { 1 } else { 2 },
            force_zero: false,
            opens,
            side: *side,
        };
        if is_struck && strikers.contains(j) {
            let (approach, rebound) = (size(before[i]), after);
            bounces.push(Bounce { contact: *j, side: *side, approach, rebound, restitution: e[i] });
        }
    }
    // What touches elsewhere has another rate now.
    for j in 0..m.contacts.len() {
        let status = s.contacts[j];
        s.contacts[j].force_zero = false;
        if set.iter().all(|(i, _)| *i != j) && status.zeros > 0 {
            let (_, rate, _, terms) = s.gap(m, j, status.side);
            let still = size(rate) <= NOTHING * terms;
            s.contacts[j] =
                Status { zeros: if still { status.zeros.min(2) } else { 1 }, opens: false, ..s.contacts[j] };
        }
    }
    Ok(bounces)
}

/// Takes the rates of `settling` contacts away, those at rest kept.
pub fn stop(m: &Model, s: &mut State, settling: &[usize]) {
    let at_rest = |j: usize| is_rigid(m, j) && s.contacts[j].mode.is_closed();
    let set: Vec<(usize, f64)> = (0..m.contacts.len())
        .filter(|j| settling.contains(j) || at_rest(*j))
        .map(|j| (j, s.contacts[j].side))
        .collect();
    let rates: Vec<Wide> =
        set.iter().map(|(j, side)| if settling.contains(j) { -s.gap(m, *j, *side).1 } else { wide(0.0) }).collect();
    let impulses = least(&coupling(m, &set), &rates);
    push(m, s, &set, &impulses);
    for j in settling {
        s.contacts[*j] = Status { zeros: 2, opens: false, ..s.contacts[*j] };
    }
}
