//! The first point of `[0, reach]` at which a polynomial falls below zero.

use smallvec::SmallVec;

use super::{
    MAX_DEGREE,
    bernstein::{self, Bernstein, Signs},
    eval, eval_with_derivatives, eval_with_slope,
};
use crate::vectors::{Baseline, Path};

/// Where a polynomial that starts positive first falls through zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstRoot {
    /// Proven: it does not.
    None,
    /// It does, here; proven to be the first place.
    At(f64),
}

/// What the isolation found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isolation {
    /// The first fall through zero.
    pub root: FirstRoot,
    /// The first place before it where the polynomial is zero to within the uncertainty and does not cross: near its lowest
    /// point, which may lie beyond an end.
    pub touch: Option<f64>,
    /// Subdivisions spent.
    pub splits: u32,
    /// Proven by its coefficients alone: it is above the uncertainty on all of `[0, 1]`.
    pub is_clear: bool,
}

impl Isolation {
    const CLEAR: Self = Self { root: FirstRoot::None, touch: None, splits: 0, is_clear: true };
}

/// Splitting stops at intervals of this many halvings: 2⁻⁵² of the step, one unit in its last place.
const MAX_DEPTH: u32 = 52;

/// Finds the first place in `[0, limit]`, `limit ≤ 1`, where `p` falls through zero.
///
/// `uncertainty ≥ 0` bounds the error of the values of `p` on `[0, 1]` (truncated tail and rounding). Values
/// within it cannot be told from zero: a dip no deeper than that is a touch, not a crossing. If the first
/// non-zero coefficient is negative the polynomial is outside from the start and the root is at 0, unless it comes back
/// without a dip deeper than that.
///
/// # Panics
/// If `p` is empty or has a degree above [`MAX_DEGREE`](super::MAX_DEGREE).
#[must_use]
pub fn first_root(p: &[f64], limit: f64, uncertainty: f64) -> Isolation {
    if bernstein::certainly_positive(p, uncertainty) {
        return Isolation::CLEAR;
    }
    let root = match bernstein::signs(Baseline, p, limit, uncertainty) {
        Signs::Above => FirstRoot::None,
        Signs::Fall(guess) => FirstRoot::At(polish(p, 0.0, limit, guess * limit)),
        Signs::Mixed => return search(p, limit, uncertainty),
    };
    Isolation { root, is_clear: false, ..Isolation::CLEAR }
}

/// Tells if `p` is above `margin` on all of `[0, 1]`, by a quick test that may miss it.
#[inline(always)]
pub(crate) fn is_above(p: &[f64], margin: f64) -> bool {
    bernstein::certainly_positive(p, margin)
}

/// The only zero of `p` in `[0, limit]`, if it ends below `-depth`, or `None` in place of it if `p` stays above `depth`; nothing where the signs
/// of its coefficients prove neither.
pub(crate) fn fall_or_clear(p: &[f64], limit: f64, depth: f64) -> Option<Option<f64>> {
    decided(p, limit, bernstein::signs(Baseline, p, limit, depth))
}

/// As [`fall_or_clear`], compiled for the set of `path`; where signs prove neither, `p` is searched, and clear if it stays above `margin`.
#[inline(always)]
pub(crate) fn fall_or_clear_on<P: Path>(
    path: P,
    p: &[f64],
    limit: f64,
    [margin, depth]: [f64; 2],
) -> Option<Option<f64>> {
    if bernstein::certainly_positive(p, margin) {
        return Some(None);
    }
    decided(p, limit, bernstein::signs(path, p, limit, depth)).or_else(|| {
        let found = search(p, limit, margin);
        (found.touch.is_none() && found.root == FirstRoot::None).then_some(None)
    })
}

#[inline(always)]
fn decided(p: &[f64], limit: f64, signs: Signs) -> Option<Option<f64>> {
    match signs {
        Signs::Above => Some(None),
        Signs::Fall(guess) => Some(Some(polish(p, 0.0, limit, guess * limit))),
        Signs::Mixed => None,
    }
}

/// The first place after `from` at which `p` falls through `level`, or rises through it for a negative `sign`. `is_on` says that it is on
/// the level at `from`: that zero is divided out.
fn passage(p: &[f64], level: f64, from: f64, sign: f64, is_on: bool) -> Option<f64> {
    let mut q = [0.0; MAX_DEGREE + 1];
    let q = &mut q[..p.len()];
    q.copy_from_slice(p);
    super::shift(q, from, 1.0);
    q[0] -= level;
    q.iter_mut().for_each(|c| *c *= sign);
    let rest = if is_on && q.len() > 1 { &q[1..] } else { &q[..] };
    match first_root(rest, 1.0 - from, 0.0).root {
        FirstRoot::At(x) => Some(from + x),
        FirstRoot::None => None,
    }
}

/// A part of `[0, 1]` in which a polynomial is not above a margin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dip {
    pub from: f64,
    pub to: f64,
    /// It goes on at the end of `[0, 1]`.
    pub is_open: bool,
    /// The place at which it falls through zero, on its way below the depth that makes it a crossing.
    pub root: Option<f64>,
}

/// Most dips of a polynomial: a guard has no more lowest points on a step.
const DIPS: usize = 8;
/// Share of a margin by which it must shrink to count as another one, and how often that is looked for.
const CLOSER: f64 = 0.5;
const TIMES: usize = 8;

/// The dips of `p` in order, up to the first that is a crossing. `bounds` gives the margin and the depth of a crossing up to a place; they
/// grow with it. `inside` says that the first dip begins at the start.
pub(crate) fn dips(p: &[f64], bounds: impl Fn(f64) -> [f64; 2], inside: bool) -> SmallVec<[Dip; 2]> {
    let mut found: SmallVec<[Dip; 2]> = SmallVec::new();
    // Where the search goes on, and the margin that it has just risen through there.
    let ([widest, _], mut at, mut on) = (bounds(1.0), 0.0, f64::NAN);
    for _ in 0..2 * DIPS {
        // Of the widest margin first: it is smaller nearer to the start.
        let (mut margin, mut last, mut end, mut dip) = (widest, widest, 1.0, None);
        for _ in 0..TIMES {
            let begins = margin != on && (inside && at == 0.0 || eval(p, at) <= margin);
            let from = if begins { Some(at) } else { passage(p, margin, at, 1.0, margin == on) };
            let Some(from) = from.filter(|from| *from <= end) else {
                dip = None;
                break;
            };
            // A dip that begins at the start may be over there.
            let is_over = begins && eval(p, at) >= margin;
            let rise =
                if is_over { Some(from) } else { passage(p, margin, from, -1.0, !begins).filter(|to| *to > from) };
            let to = rise.unwrap_or(1.0);
            dip = Some(Dip { from, to, is_open: rise.is_none(), root: None });
            let closer = bounds(to)[0];
            if closer > CLOSER * margin {
                break;
            }
            (last, margin, end) = (margin, closer, to);
        }
        let Some(mut dip) = dip else {
            if end >= 1.0 {
                break;
            }
            (at, on) = (end, last);
            continue;
        };
        let [_, depth] = bounds(dip.to);
        let deep = passage(p, -depth, dip.from, 1.0, false).filter(|deep| *deep <= dip.to);
        dip.root = deep.map(|deep| last_fall(p, dip.from, deep));
        match found.last_mut().filter(|last| last.to >= dip.from) {
            Some(last) => *last = Dip { from: last.from, ..dip },
            None => found.push(dip),
        }
        (at, on) = (dip.to, margin);
        if dip.root.is_some() || dip.is_open || at >= 1.0 {
            break;
        }
    }
    found
}

/// The last place in `[from, to]` at which `p`, negative at `to`, falls through zero; `from` where it is negative all the way.
pub(crate) fn last_fall(p: &[f64], from: f64, to: f64) -> f64 {
    let mut root = from;
    let mut start = (eval(p, from) > 0.0).then_some(from);
    while let Some(at) = start {
        let Some(fall) = passage(p, 0.0, at, 1.0, at > from).filter(|fall| *fall <= to) else { break };
        root = if eval(p, at) > 0.0 && eval(p, to) < 0.0 { polish(p, at, to, fall) } else { fall };
        start = passage(p, 0.0, fall, -1.0, true).filter(|rise| *rise < to && *rise > fall);
    }
    root
}

/// The same where the signs of all coefficients together do not decide.
fn search(p: &[f64], limit: f64, uncertainty: f64) -> Isolation {
    // Trailing terms that together stay far below the uncertainty only make the polynomial longer.
    let (mut n, mut dropped) = (p.len() - 1, 0.0);
    while n > 1 && dropped + p[n].abs() <= 0.125 * uncertainty {
        dropped += p[n].abs();
        n -= 1;
    }
    let (all, p) = (p, &p[..=n]);
    let mut search = Search { p, limit, uncertainty: uncertainty + dropped, shallow: None, touch: None, splits: 0 };
    let start = Bernstein::from_power(p, limit);
    // What went below zero and never came back has crossed, however little.
    let root = search.first(start, 0.0, limit, 0).or(search.shallow);
    if let (Some(t), Some(x)) = (search.touch, root)
        && t < x
        && eval(p, 0.5 * (t + x)) <= search.uncertainty
    {
        // It stays within the uncertainty up to the crossing: one crossing of high order.
        search.touch = None;
    }
    let root = root.map(|root| if n + 1 < all.len() { closer(all, root, limit, dropped) } else { root });
    Isolation {
        root: root.map_or(FirstRoot::None, FirstRoot::At),
        touch: search.touch,
        splits: search.splits,
        is_clear: false,
    }
}

/// A root of the shortened polynomial, moved to that of `p`: by Newton's method, as long as the values shrink and it stays where what was
/// `dropped` explains it.
fn closer(p: &[f64], root: f64, limit: f64, dropped: f64) -> f64 {
    let (mut x, (mut f, mut slope)) = (root, eval_with_slope(p, root));
    while f != 0.0 && slope < 0.0 {
        let next = (x - f / slope).clamp(0.0, limit);
        let (value, rate) = eval_with_slope(p, next);
        if value.abs() >= f.abs() || (next - root).abs() > 4.0 * dropped / slope.abs() {
            break;
        }
        (x, f, slope) = (next, value, rate);
    }
    x
}

struct Search<'a> {
    p: &'a [f64],
    limit: f64,
    uncertainty: f64,
    /// Where it last fell through zero, as long as it has not gone below the uncertainty since, nor come back.
    shallow: Option<f64>,
    touch: Option<f64>,
    splits: u32,
}

impl Search<'_> {
    fn first(&mut self, b: Bernstein, lo: f64, hi: f64, depth: u32) -> Option<f64> {
        if self.shallow.is_some() {
            return self.follow(b, lo, hi, depth);
        }
        let start = b.first_sign();
        if start < 0.0 && b.b[0] < -self.uncertainty {
            return Some(lo);
        }
        if start < 0.0 {
            // Outside from the start, but not told from zero there.
            self.shallow = Some(lo);
            return self.follow(b, lo, hi, depth);
        }
        let changes = b.sign_changes();
        if changes == 0 {
            self.near(b, lo, hi, depth);
            return None;
        }
        if changes == 1 {
            let is_deep = b.coefficients().iter().any(|c| *c < -self.uncertainty);
            if b.b[b.n] < -self.uncertainty || !is_deep {
                let root = polish(self.p, lo, hi, lo + b.crossing() * (hi - lo));
                return self.fallen(root, &b);
            }
        }
        if depth >= MAX_DEPTH || b.largest() <= self.uncertainty {
            // Not to be told from zero on the whole interval: a touch, unless it comes out negative.
            if b.b[b.n] < 0.0 {
                return self.fallen(0.5 * (lo + hi), &b);
            }
            self.touch.get_or_insert(0.5 * (lo + hi));
            return None;
        }
        self.halves(b, lo, hi, depth)
    }

    fn halves(&mut self, mut b: Bernstein, lo: f64, hi: f64, depth: u32) -> Option<f64> {
        self.splits += 1;
        let mid = 0.5 * (lo + hi);
        let right = b.split();
        self.first(b, lo, mid, depth + 1).or_else(|| self.first(right, mid, hi, depth + 1))
    }

    /// Without a change of sign: the first place where it cannot be told from zero is a touch.
    fn near(&mut self, mut b: Bernstein, lo: f64, hi: f64, depth: u32) {
        if self.touch.is_some() || b.first_sign() <= 0.0 || b.coefficients().iter().all(|c| *c > self.uncertainty) {
            return;
        }
        // Strictly falling to the end of the search: its minimum is not inside.
        if hi >= self.limit && b.coefficients().is_sorted_by(|a, b| a > b) {
            return;
        }
        if b.largest() <= self.uncertainty || depth >= MAX_DEPTH {
            self.touch = Some(0.5 * (lo + hi));
            return;
        }
        self.splits += 1;
        let mid = 0.5 * (lo + hi);
        let right = b.split();
        self.near(b, lo, mid, depth + 1);
        self.near(right, mid, hi, depth + 1);
    }

    /// It fell through zero at `root` and ends the interval below: a crossing if it is deeper than the uncertainty.
    fn fallen(&mut self, root: f64, b: &Bernstein) -> Option<f64> {
        if b.b[b.n] < -self.uncertainty {
            return Some(root);
        }
        self.shallow = Some(root);
        None
    }

    /// After a shallow fall: the crossing it was if the polynomial gets deeper than the uncertainty before it is
    /// back above zero, else a touch.
    fn follow(&mut self, b: Bernstein, lo: f64, hi: f64, depth: u32) -> Option<f64> {
        let end = b.b[b.n];
        let is_deep = b.coefficients().iter().any(|c| *c < -self.uncertainty);
        if end < -self.uncertainty && b.sign_changes() == 0 {
            return self.shallow;
        }
        if !is_deep && (end <= 0.0 || b.sign_changes() <= 1) || depth >= MAX_DEPTH {
            if end > 0.0 {
                self.touch = self.touch.or(self.shallow.take());
            }
            return None;
        }
        self.halves(b, lo, hi, depth)
    }
}

/// The single zero in `[lo, hi]`, where `p` falls: Halley's method kept inside a shrinking bracket.
#[inline(always)]
fn polish(p: &[f64], mut lo: f64, mut hi: f64, start: f64) -> f64 {
    let mut x = start;
    for _ in 0..100 {
        let [f, slope, bent] = eval_with_derivatives(p, x);
        if f == 0.0 {
            return x;
        }
        if f > 0.0 {
            lo = x;
        } else {
            hi = x;
        }
        // By ratios: products of small values vanish.
        let newton = -f / slope;
        let step = newton / (1.0 + 0.5 * newton * (bent / slope));
        let next = if x + step >= lo && x + step <= hi { x + step } else { 0.5 * (lo + hi) };
        if (next - x).abs() <= f64::EPSILON * x || hi - lo <= f64::EPSILON * hi {
            return next;
        }
        x = next;
    }
    x
}
