//! Motion of a mode from one unit input: Taylor series in two doubles, and their truncation.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use super::{
    propagator::{Degree, Input, Output},
    two::Two,
};
use crate::{
    hybrid::Wide,
    kernel::mode::linear_mode::{LinearContact, LinearMode},
    system::Wave,
    vectors::{Path, Work},
};

/// Number of motions that are formed side by side.
pub const LANES: usize = 4;

/// Taylor coefficients of the state, and of deflections and forces, from order 1 on, for one unit input.
pub struct UnitSeries {
    pub state: Vec<Vec<Wide>>,
    pub rows: Vec<Vec<Wide>>,
}

impl UnitSeries {
    /// Returns the sum of the sizes of the coefficients of each component and of each row.
    pub fn sizes(&self) -> Vec<f64> {
        let rows = self.state.iter().chain(&self.rows);
        rows.map(|row| row.iter().map(|c| c.hi.abs()).sum()).collect()
    }

    pub fn is_nothing(&self) -> bool {
        self.state.iter().chain(&self.rows).flatten().all(|c| c.hi == 0.0)
    }
}

/// Motions to expand over `span`, each with one of at most four `inputs` one and all others zero. Equal inputs are one together.
pub struct Units<'a> {
    pub mode: &'a LinearMode,
    pub span: f64,
    /// Number of orders.
    pub terms: usize,
    pub inputs: &'a [Input],
    pub outputs: &'a [Output],
}

/// Coefficients of these motions, order by order.
struct At<P: Path> {
    x: Vec<Two<P>>,
    stretches: Vec<Two<P>>,
    waves: Vec<[Two<P>; 2]>,
}

impl Units<'_> {
    #[inline(always)]
    fn start<P: Path>(&self, path: P) -> At<P> {
        let (s, zero, one) = (self.mode, Two::zero(path), Wide::from(1.0));
        let mut x = vec![zero; 2 * s.n];
        let mut stretches = vec![zero; s.contacts.len()];
        let mut waves = vec![[zero; 2]; s.oscillators.len()];
        for (lane, input) in self.inputs.iter().enumerate() {
            let set = |two: &mut Two<P>| *two = two.with(path, lane, one);
            match *input {
                Input::Displacement(i) => (0..s.n).filter(|k| s.fold.freedoms[*k] == i).for_each(|k| set(&mut x[k])),
                Input::Velocity(i) => {
                    (0..s.n).filter(|k| s.fold.freedoms[*k] == i).for_each(|k| set(&mut x[s.n + k]));
                }
                Input::Stretch(j) => {
                    let equal = (0..s.contacts.len()).filter(|k| s.fold.contacts[*k] == j);
                    equal.for_each(|k| set(&mut stretches[k]));
                }
                Input::Load | Input::Forcing => {}
                Input::Cosine(i) => set(&mut waves[i][0]),
                Input::Sine(i) => set(&mut waves[i][1]),
            }
        }
        At { x, stretches, waves }
    }
}

#[inline(always)]
fn along<P: Path>(path: P, direction: &[(u32, f64)], values: &[Two<P>]) -> Two<P> {
    let mut sum = Two::zero(path);
    for (i, g) in direction {
        sum = sum.plus(path, values[*i as usize].times(path, *g));
    }
    sum
}

#[inline(always)]
fn wave<P: Path>(path: P, all: &[Wave], waves: &[[Two<P>; 2]]) -> Two<P> {
    let mut sum = Two::zero(path);
    for w in all {
        let [cosine, sine] = waves[w.index];
        sum = sum.plus(path, cosine.times(path, w.cosine)).plus(path, sine.times(path, w.sine));
    }
    sum
}

/// Returns the force of a contact with a linear law and a constant stiffness.
#[inline(always)]
fn force<P: Path>(path: P, c: &LinearContact, stretch: Two<P>, (v, waves): (&[Two<P>], &[[Two<P>; 2]])) -> Two<P> {
    let Some([k, damping]) = c.constant() else { return Two::zero(path) };
    let rate = along(path, &c.direction, v).minus(path, wave(path, &c.error_rate, waves));
    stretch.times(path, k).plus(path, rate.times(path, damping))
}

impl Work for Units<'_> {
    type Output = Vec<UnitSeries>;

    #[inline(always)]
    fn on<P: Path>(self, path: P) -> Vec<UnitSeries> {
        let At { mut x, stretches, mut waves } = self.start(path);
        let Self { mode: s, span, terms, inputs, outputs } = self;
        let n = s.n;
        let mut all = Vec::with_capacity(inputs.len());
        for _ in inputs {
            let rows = |count: usize| (0..count).map(|_| Vec::with_capacity(terms)).collect();
            all.push(UnitSeries { state: rows(2 * n), rows: rows(outputs.len()) });
        }
        let (mut a, mut deflections) = (vec![Two::zero(path); n], vec![Two::zero(path); s.contacts.len()]);
        for order in 0..=terms {
            let (q, v) = x.split_at(n);
            for (j, c) in s.contacts.iter().enumerate() {
                deflections[j] = if order == 0 {
                    stretches[j]
                } else {
                    along(path, &c.direction, q).minus(path, wave(path, &c.error, &waves))
                };
            }
            if order > 0 {
                for (i, x) in x.iter().enumerate() {
                    let numbers = x.numbers(path);
                    for (series, x) in all.iter_mut().zip(numbers) {
                        series.state[i].push(x);
                    }
                }
                for (i, output) in outputs.iter().enumerate() {
                    let value = match output {
                        Output::Deflection(j) => deflections[*j],
                        Output::Force(j) => force(path, &s.contacts[*j], deflections[*j], (v, &waves)),
                    };
                    for (series, value) in all.iter_mut().zip(value.numbers(path)) {
                        series.rows[i].push(value);
                    }
                }
            }
            a.fill(Two::zero(path));
            if order == 0 {
                for (lane, _) in inputs.iter().enumerate().filter(|(_, input)| **input == Input::Load) {
                    for (a, f) in a.iter_mut().zip(&s.load) {
                        *a = a.with(path, lane, *f);
                    }
                }
            }
            for (a, row) in a.iter_mut().zip(&s.rows) {
                for (j, k, c) in row {
                    let j = *j as usize;
                    *a = a.minus(path, q[j].times(path, *k)).minus(path, v[j].times(path, *c));
                }
            }
            for w in &s.load_waves {
                let [cosine, sine] = waves[w.index];
                for ((a, by_cosine), by_sine) in a.iter_mut().zip(&w.cosine).zip(&w.sine) {
                    *a = a.plus(path, cosine.times(path, *by_cosine)).plus(path, sine.times(path, *by_sine));
                }
            }
            for (j, c) in s.contacts.iter().enumerate().filter(|(_, c)| c.is_carried) {
                let force = force(path, c, deflections[j], (v, &waves));
                for (i, p) in &c.push {
                    a[*i as usize] = a[*i as usize].minus(path, force.times(path, *p));
                }
            }
            let share = Wide::quotient(span.into(), (order + 1) as f64);
            for i in 0..n {
                x[i] = x[n + i].by(path, share);
                x[n + i] = a[i].by(path, share);
            }
            for (w, o) in waves.iter_mut().zip(&s.oscillators) {
                let [cosine, sine] = *w;
                *w = [sine.times(path, -o.omega).by(path, share), cosine.times(path, o.omega).by(path, share)];
            }
        }
        all
    }
}

/// Returns bounds on the rest after the last term of displacements and velocities, times `√M_ii`, and of a wave of amplitude one. With
/// `‖x_{k+1}‖ ≤ (ρ‖x_k‖ + H F_k)/(k + 1)`, ρ at least the span times the growth and times all frequencies, the sum after order N is
/// at most `(ρ‖x_N‖ + H F_N/(1 − r))/((N + 1)(1 − r))` with `r = ρ/(N + 1)`.
pub fn rest(s: &LinearMode, span: f64, degree: &Degree, input: Input, state: &[Vec<Wide>]) -> [f64; 3] {
    let (terms, reach) = (degree.terms, degree.reach);
    let next = (terms + 1) as f64;
    let ratio = reach / next;
    let wave = (1..=terms).fold(1.0, |term, k| term * reach / k as f64);
    let forced = match input {
        Input::Cosine(i) | Input::Sine(i) => s.forcing_of(i) * wave,
        _ => 0.0,
    };
    let last = |row: &Vec<Wide>| row.last().map_or(0.0, |c| c.hi.abs());
    let size = s.weights.iter().zip(&state[..s.n]).zip(&state[s.n..]);
    let size = size.fold(0.0, |m: f64, ((w, q), v)| m.max(w * last(v)).max(w * last(q) * s.frequency));
    let velocity = (reach * size + span * forced / (1.0 - ratio)) / (next * (1.0 - ratio));
    [span * (size + velocity) / next, velocity, wave * ratio / (1.0 - ratio)]
}

impl LinearMode {
    /// Returns a bound on the weighted acceleration by oscillator `i` of amplitude one.
    fn forcing_of(&self, i: usize) -> f64 {
        let loads = self.load_waves.iter().filter(|w| w.index == i).map(|w| w.size(&self.weights));
        let contacts = self.contacts.iter().filter(|c| c.is_carried).map(|c| {
            let waves = c.error.iter().filter(|w| w.index == i).map(|w| libm::hypot(w.cosine, w.sine));
            c.push_norm * (c.stiffest + c.damping() * self.oscillators[i].omega) * waves.sum::<f64>()
        });
        loads.sum::<f64>() + contacts.sum::<f64>()
    }
}

/// Returns a bound on the rest of an output after the last Taylor term, from those of displacements, velocities and waves.
pub fn rest_of(s: &LinearMode, [displacement, velocity, wave]: [f64; 3], output: &Output) -> f64 {
    let of = |c: &LinearContact| {
        let [e, rate, _] = c.error_sizes;
        [c.across * displacement + e * wave, c.across * velocity + rate * wave]
    };
    match output {
        Output::Deflection(j) => of(&s.contacts[*j])[0],
        Output::Force(j) => {
            let c = &s.contacts[*j];
            let [d, r] = of(c);
            c.stiffest * d + c.damping() * r
        }
    }
}
