//! A lane: the motion of a train of one degree of freedom with one contact, from cycle to cycle, with nothing that is not asked for.
//!
//! What happens is what the engine does with the same leaps, and the numbers are the same to the last bit, up to the stretch of a closed
//! contact that an engine keeps between cycles. A lane makes no record, raises no alarm and shows no step. Where a leap is not decided, or
//! a contact comes to rest, it stops there, and an engine goes on from its state.

use std::cell::OnceCell;

use smallvec::SmallVec;

use super::{
    Motion,
    guards::ROUNDING,
    leap::{Guard, SHARES, SHORTEST, combine, first_fall},
    propagator::{DEGREE, Input, MOST_INPUTS, Propagator, load_size},
};
use crate::{
    gear::contact::Law,
    hybrid::{GuardSet, HybridSystem, Instant, JetRequest, Jump, Mode},
    kernel::SMALL_STRETCH,
    poly::{Pattern, Place, Row},
    system::{Columns, ContactMode, Spring, Structure, Watch, Wave, contact_mode, dot, guard_id, set_contact},
    vectors::{Path, Work},
};

/// Events of a cycle at most: where there are more, impacts come to rest.
const MOST_EVENTS: usize = 256;
/// States of a contact.
const STATES: [ContactMode; 5] = [
    ContactMode::Separated,
    ContactMode::Drive,
    ContactMode::Back,
    ContactMode::DriveDetached,
    ContactMode::BackDetached,
];

/// An event of a lane: what the contact was, what it is, and which guard fell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Passed {
    pub was: u8,
    pub is: u8,
    pub watch: u8,
}

impl Passed {
    /// What the contact was and is, and the guard.
    pub fn parts(self) -> (ContactMode, ContactMode, Watch) {
        let watch = [Watch::DriveFlank, Watch::BackFlank, Watch::Force][usize::from(self.watch)];
        (STATES[usize::from(self.was)], STATES[usize::from(self.is)], watch)
    }
}

/// What is noted on the way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Noted {
    /// Time in each state of the contact, s, in the order of [`ContactMode`].
    pub times: [f64; 5],
    /// Events, where they are asked for.
    pub events: Option<Vec<Passed>>,
    /// Contacts gained and impacts: time since the start of the cycle, s, rate of the deflection before, m/s, and the flank's side; where
    /// they are asked for.
    pub strikes: Option<Vec<[f64; 3]>>,
    /// The derivative by the start, rows `(q, v)`, where it is asked for.
    pub columns: Option<Columns>,
}

/// A mode that was met, ready to be leapt in.
struct Gait<'s> {
    motion: Motion<'s>,
    /// What each guard leads to; of an impact nothing is kept.
    edges: [OnceCell<(ContactMode, GuardSet)>; 3],
}

/// See the head of this file.
pub(crate) struct Lane<'s> {
    structure: &'s Structure,
    gaits: [OnceCell<Box<Gait<'s>>>; 5],
    /// A jump changes the columns.
    salts: bool,
    is_rigid: bool,
    at: Instant,
    x: [f64; 2],
    jump: Jump,
    state: ContactMode,
    carried: f64,
}

/// Where a leap leads.
struct Stride {
    /// s.
    time: f64,
    x: [f64; 2],
    /// Number of the guard that falls at its end.
    falls: Option<usize>,
    is_bound: bool,
    carried: f64,
}

impl<'s> Lane<'s> {
    /// A lane for motions of `structure`; `None` for trains that are more than one degree of freedom and one contact with a linear law of
    /// constant stiffness or a rigid one, under a forcing of one period.
    pub fn new(structure: &'s Structure) -> Option<Self> {
        let [c] = &structure.contacts[..] else { return None };
        let (salts, is_rigid) = match c.spec.law {
            Law::KelvinVoigt(law, _) => (law.damping > 0.0, false),
            Law::Rigid(_) => (true, true),
            _ => return None,
        };
        let is_periodic = structure.clock.period().is_some() && structure.oscillators.iter().all(|o| o.order.is_some());
        let is_constant = is_rigid || matches!(c.spring, Spring::Constant(_));
        let fits = structure.n == 1 && structure.dim == 2 && is_periodic && is_constant && !structure.is_conservative;
        fits.then(|| Self {
            structure,
            gaits: [const { OnceCell::new() }; 5],
            salts,
            is_rigid,
            at: Instant::default(),
            x: [0.0; 2],
            jump: Jump::default(),
            state: ContactMode::Separated,
            carried: f64::NAN,
        })
    }

    /// Goes on from `x` at `at`, in the mode and with the exact zeros of `jump`.
    pub fn place(&mut self, at: Instant, x: [f64; 2], jump: Jump) {
        (self.state, self.carried) = (contact_mode(&jump.mode, 0), f64::NAN);
        (self.at, self.x, self.jump) = (at, x, jump);
    }

    /// Where it stands.
    pub fn at(&self) -> Instant {
        self.at
    }

    /// The state.
    pub fn x(&self) -> [f64; 2] {
        self.x
    }

    /// Mode and exact zeros.
    pub fn jump(&self) -> &Jump {
        &self.jump
    }

    /// Runs to the start of the next cycle. `false` where it cannot decide what comes, and stands before it.
    pub fn cycle(&mut self, noted: &mut Noted) -> bool {
        let structure = self.structure;
        let end = structure.clock.at(self.at.cycle + 1, 0.0);
        let mut events = 0;
        loop {
            let span = structure.clock.between(self.at, end);
            if span <= 0.0 {
                return true;
            }
            if events > MOST_EVENTS || !self.jump.still.is_empty() {
                return false;
            }
            let gait = self.gaits[self.state as usize].get_or_init(|| {
                let mut mode = Mode::default();
                set_contact(&mut mode, 0, self.state);
                Box::new(Gait { motion: Motion::new(structure, &mode), edges: [const { OnceCell::new() }; 3] })
            });
            let carried = [self.carried];
            let request = JetRequest {
                at: self.at,
                x: &self.x,
                low: &[],
                pinned: &self.jump.pinned,
                still: GuardSet::none(),
                carried: if self.carried.is_nan() { &[] } else { &carried },
                span,
                tolerance: 0.0,
            };
            let stride = Forward { motion: &gait.motion, request: &request, columns: noted.columns.as_mut() };
            let Some(stride) = structure.instructions.run(stride) else { return false };
            noted.times[self.state as usize] += stride.time;
            self.x = stride.x;
            self.at = if stride.is_bound { end } else { structure.clock.advance(self.at, stride.time) };
            self.carried = stride.carried;
            self.jump.pinned = GuardSet::default();
            if let Some(falls) = stride.falls {
                events += 1;
                let was = self.state;
                let watch = gait.motion.guards[falls].watch;
                if !self.fire(watch, noted) {
                    return false;
                }
                if let Some(events) = &mut noted.events {
                    events.push(Passed { was: was as u8, is: self.state as u8, watch: watch as u8 });
                }
            }
        }
    }

    /// The contact's guard that watches `watch` falls here.
    fn fire(&mut self, watch: Watch, noted: &mut Noted) -> bool {
        let (s, was) = (self.structure, self.state);
        if let Some(strikes) = noted.strikes.as_mut().filter(|_| was == ContactMode::Separated && watch.side() != 0.0) {
            strikes.push([self.at.phase.value(), s.deflection(0, self.at, &self.x).1, watch.side()]);
        }
        let Some(gait) = self.gaits[was as usize].get() else { return false };
        let zero = &gait.edges[watch as usize];
        let salts = self.salts && noted.columns.is_some();
        if let Some((is, pinned)) = zero.get().filter(|_| !salts) {
            // As of the first time: of a compliant contact it depends on nothing else.
            if watch.side() != 0.0 {
                s.project(std::iter::once((0, watch.side())), self.at, &mut self.x, &mut []);
            }
            set_contact(&mut self.jump.mode, 0, *is);
            (self.state, self.jump.pinned) = (*is, pinned.clone());
            return true;
        }
        let fired = GuardSet::from_iter([guard_id(0, watch)]);
        self.jump.pinned = fired.clone();
        let before = self.x;
        let Ok(jump) = s.jump(&self.jump, &fired, self.at, &mut self.x, &mut []) else { return false };
        if let Some(columns) = noted.columns.as_mut().filter(|_| salts) {
            s.saltate((&self.jump, &jump), (&fired, false, false), self.at, (&before, &self.x), &[], columns);
        }
        self.state = contact_mode(&jump.mode, 0);
        if !self.is_rigid {
            let _ = zero.set((self.state, jump.pinned.clone()));
        }
        self.jump = jump;
        true
    }
}

/// The least and the largest of what is added to a value on the way: zero at its start, and coefficient i of n at `i/n` of `d_i`.
#[inline(always)]
fn range(row: &Row) -> [f64; 2] {
    let (mut low, mut high) = ([0.0f64; 4], [0.0f64; 4]);
    for (row, shares) in row.as_chunks::<4>().0.iter().zip(SHARES.as_chunks::<4>().0) {
        for l in 0..4 {
            let added = row[l] * shares[l];
            // Comparisons that vectors have.
            low[l] = if added < low[l] { added } else { low[l] };
            high[l] = if added > high[l] { added } else { high[l] };
        }
    }
    [low.into_iter().fold(0.0, f64::min), high.into_iter().fold(0.0, f64::max)]
}

/// A leap to be made.
struct Forward<'a> {
    motion: &'a Motion<'a>,
    request: &'a JetRequest<'a>,
    columns: Option<&'a mut Columns>,
}

impl Work for Forward<'_> {
    type Output = Option<Stride>;

    #[inline(always)]
    fn on<P: Path>(self, _: P) -> Option<Stride> {
        let propagator = self.motion.propagator.get_or_init(|| self.motion.propagate()).as_deref()?;
        propagator.stride::<P>(self.motion, self.request, self.columns)
    }
}

impl Propagator {
    /// As [`leap`](Self::leap), for one degree of freedom with one contact, and without what an engine wants to know besides.
    #[inline(always)]
    fn stride<P: Path>(
        &self,
        motion: &Motion,
        request: &JetRequest<'_>,
        columns: Option<&mut Columns>,
    ) -> Option<Stride> {
        let s = motion.structure;
        let (x, c) = (request.x, &s.contacts[0]);
        let mut oscillators = [[0.0; 2]; MOST_INPUTS];
        s.oscillate(request.at, |i, cosine, sine| oscillators[i] = [cosine, sine]);
        let wave = |w: &[Wave]| {
            w.iter().fold(0.0, |sum, w| sum + w.cosine * oscillators[w.index][0] + w.sine * oscillators[w.index][1])
        };
        let rate = || dot(&c.direction, &x[1..]) - wave(&c.error_rate);
        let mut start = self.start(motion, request, 0, dot(&c.direction, x) - (c.spec.error_offset + wave(&c.error)));
        if request.pinned.contains(guard_id(0, Watch::Force)) {
            let error = ROUNDING * s.deflection_size(c, x);
            let stretch = start.deflection - motion.parts[0].side * c.offset();
            (start.stretch, start.error) = (motion.forceless(0, request.at, stretch, error, rate), error);
        }
        let mut z = [0.0; MOST_INPUTS];
        for (z, input) in z.iter_mut().zip(&self.inputs) {
            *z = match *input {
                Input::Displacement(_) => x[0],
                Input::Velocity(_) => x[1],
                Input::Stretch(_) => start.stretch,
                Input::Load => load_size(&s.load),
                Input::Cosine(i) => oscillators[i][0],
                Input::Sine(i) => oscillators[i][1],
            };
        }
        let z = &z[..self.inputs.len()];
        let error = |row: usize| self.rows[row].errors.iter().zip(z).fold(0.0, |sum, (e, z)| sum + e * z.abs());
        let deflection: (Row, f64) = (combine::<P>(&self.rows[0].columns, z), error(0));
        // Guards that are not clear of zero, and their numbers. By its control points the deflection stays within a range.
        let mut guards: SmallVec<[Guard; 2]> = SmallVec::new();
        let mut numbers = [0; 3];
        let range = range(&deflection.0);
        for (number, (watched, row)) in motion.guards.iter().zip(&self.guards).enumerate() {
            let force;
            let (row, error) = if *row == 0 {
                &deflection
            } else {
                force = (combine::<P>(&self.rows[*row].columns, z), error(*row));
                &force
            };
            let rate = if watched.watch == Watch::Force { rate() } else { 0.0 };
            let [start, sign, rounding] = self.guard(motion, request, watched, &start, rate);
            // A zero by chance is no exact one.
            if start == 0.0 && rounding > 0.0 {
                return None;
            }
            // Four roundings of the start are more than those of its coefficients.
            let reach = if sign > 0.0 { range[0] } else { -range[1] };
            if watched.watch != Watch::Force
                && start != 0.0
                && start + reach > rounding + *error + 4.0 * f64::EPSILON * start
            {
                continue;
            }
            let guard = Guard::new(start, sign, row, [rounding, *error]);
            if guard.pattern != Pattern::Clear {
                numbers[guards.len()] = number;
                guards.push(guard);
            }
        }
        let part = Guard::sharpen(&mut guards);
        let bound = request.span / self.span;
        let (fall, end) = first_fall::<P>(&guards, part, bound).filter(|(_, end)| *end >= SHORTEST)?;
        let place = Place::new(end, DEGREE);
        let weight = end * place.weight::<P>();
        let added = |row: &[f64]| weight * place.value::<P>(row);
        let mut after = [0.0; 2];
        for ((after, x), columns) in after.iter_mut().zip(x).zip(&self.state) {
            *after = *x + added(&combine::<P>(columns, z));
        }
        if let Some(columns) = columns {
            // The derivative of the leap, `∂x(end)/∂x(start)`.
            let mut flow = [[1.0, 0.0], [0.0, 1.0]];
            for (flow, columns) in flow.iter_mut().zip(&self.state) {
                for (input, column) in self.inputs.iter().zip(columns) {
                    match *input {
                        Input::Displacement(_) => flow[0] += added(column),
                        Input::Stretch(_) => flow[0] += dot(&c.direction, &[1.0]) * added(column),
                        Input::Velocity(_) => flow[1] += added(column),
                        Input::Load | Input::Cosine(_) | Input::Sine(_) => {}
                    }
                }
            }
            let count = columns.count;
            for l in 0..count {
                let [q, v] = [columns.values[l], columns.values[count + l]];
                columns.values[l] = flow[0][0] * q + flow[0][1] * v;
                columns.values[count + l] = flow[1][0] * q + flow[1][1] * v;
            }
        }
        let mut carried = f64::NAN;
        if fall.is_none() && !start.stretch.is_nan() && !motion.parts[0].is_bilateral() {
            let stretch = start.stretch + added(&deflection.0);
            if stretch.abs() < SMALL_STRETCH * s.deflection_size(c, &after) {
                carried = stretch;
            }
        }
        Some(Stride {
            time: end * self.span,
            x: after,
            falls: fall.map(|fall| numbers[fall.index]),
            is_bound: fall.is_none() && bound <= part,
            carried,
        })
    }
}
