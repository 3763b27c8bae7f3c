//! Propagators: a linear mode's motion over one span as a matrix polynomial.
//!
//! With 1, `cos ωt` and `sin ωt` as part of the state, a mode with linear laws and constant stiffnesses is autonomous: the
//! change of the state over a span is a fixed polynomial matrix times where the span starts, whatever the phase. The polynomials are
//! Chebyshev series cut after T₁₉, in Bernstein form, of `(y(θ) − y(0))/θ` for every quantity y: an exact zero at the start of a
//! span is divided out, and the signs of the coefficients tell the zeros that are left.
//!
//! The matrix is a pure function of the mode. It is formed in two doubles and rounded once.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use std::{cell::RefCell, collections::HashMap, rc::Rc, sync::LazyLock};

use smallvec::SmallVec;

use super::{Motion, motion::Watched};
use crate::{
    hybrid::Wide,
    system::{Acting, Contact, Elasticity, Force, Watch, Wave},
};

/// Coefficients of a row: degree 19, five vectors of four.
pub(super) const COUNT: usize = 20;
/// Degree of a row, and of one that is not zero at its start.
pub(super) const DEGREE: usize = COUNT - 1;
pub(super) const WHOLE: usize = COUNT;
/// Powers of θ in the Taylor series that a row is made from. The rest is below 2e-21 of the first,
/// `40·4.5⁴⁰/40!` over 4.5.
const TERMS: usize = 40;
/// The span times the mode's fastest rate, rad: what the series cut after T₁₉ leave out is below 1e-17 of the first terms.
const REACH: f64 = 4.5;
/// Most components that a span may start from.
pub(super) const MOST_INPUTS: usize = 16;
/// Degrees of freedom up to which a product with all columns is cheaper than a recurrence.
const MOST_FREEDOMS: usize = 3;
/// Roundings of a value of a row in units of ε, besides half a unit for each input that its coefficients are summed over: half for the
/// columns, one and a half for an angle and its cosine, four each for the polynomials of the basis and the sum over them.
const ROUNDED: f64 = 10.0;

/// The powers of θ as Bernstein coefficients of their Chebyshev series cut after T₁₉, and what is cut.
struct Powers {
    high: [[f64; COUNT]; TERMS],
    low: [[f64; COUNT]; TERMS],
    cut: [f64; TERMS],
}

static POWERS: LazyLock<Box<Powers>> = LazyLock::new(|| {
    // T_k on [0, 1]: (−1)^(k−i) C(2k, 2i)/C(k, i) in degree k, then raised to degree 19.
    let mut chebyshev = [[Wide::default(); COUNT]; COUNT];
    for (k, row) in chebyshev.iter_mut().enumerate() {
        let (mut upper, mut lower) = (1.0, 1.0);
        for i in 0..=k {
            let sign = if (k - i) % 2 == 0 { 1.0 } else { -1.0 };
            row[i] = Wide::quotient((sign * upper).into(), lower);
            let [above, below] = [2 * (k - i), 2 * i].map(|m| m as f64);
            // Binomials below 2⁵³: every product is exact before it is divided.
            upper = (upper * above / (below + 1.0)) * (above - 1.0) / (below + 2.0);
            lower = lower * (0.5 * above) / (0.5 * below + 1.0);
        }
        for degree in k + 1..COUNT {
            let before = *row;
            for i in 0..=degree {
                let kept = before[i] * (degree - i) as f64 + before[i.saturating_sub(1)] * i as f64;
                row[i] = Wide::quotient(kept, degree as f64);
            }
        }
    }
    let mut powers = Box::new(Powers { high: [[0.0; COUNT]; TERMS], low: [[0.0; COUNT]; TERMS], cut: [0.0; TERMS] });
    // θᵐ = Σ a_k T_k, from θ T_k = (T_{k+1} + 2 T_k + T_{|k−1|})/4.
    let mut a = [Wide::default(); TERMS + 1];
    a[0] = 1.0.into();
    for m in 0..TERMS {
        for i in 0..COUNT {
            let sum = (0..COUNT).fold(Wide::default(), |sum, k| sum + a[k] * chebyshev[k][i]);
            (powers.high[m][i], powers.low[m][i]) = (sum.hi, sum.lo);
        }
        powers.cut[m] = a[COUNT..].iter().map(|a| a.hi).sum();
        let before = a;
        for (k, next) in a.iter_mut().enumerate() {
            let at = |k: usize| before.get(k).copied().unwrap_or_default();
            let (lower, upper) = if k == 0 { (Wide::default(), at(1)) } else { (at(k - 1), at(k + 1)) };
            *next = (lower * if k == 1 { 2.0 } else { 1.0 } + at(k) * 2.0 + upper) * 0.25;
        }
    }
    powers
});

/// A component of where a span starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Input {
    /// A displacement.
    Displacement(usize),
    /// A velocity.
    Velocity(usize),
    /// `δ − σ b` of a contact that carries force.
    Stretch(usize),
    /// The size of the constant load.
    Load,
    /// `cos ωt` of an oscillator.
    Cosine(usize),
    /// `sin ωt`.
    Sine(usize),
}

/// What is propagated besides the state.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Output {
    Deflection(usize),
    Force(Acting),
}

/// The columns of a row, and what a unit of each input adds to the error of its coefficients.
#[derive(Debug)]
pub(super) struct Columns {
    pub columns: Box<[[f64; COUNT]]>,
    pub errors: Box<[f64]>,
}

/// The motion of a mode over one span.
#[derive(Debug)]
pub(super) struct Propagator {
    /// s.
    pub span: f64,
    pub inputs: Box<[Input]>,
    /// The state: for each component its columns.
    pub state: Box<[Box<[[f64; COUNT]]>]>,
    pub rows: Box<[Columns]>,
    /// For each guard its row.
    pub guards: Box<[usize]>,
}

/// Taylor coefficients of the state, and of deflections and forces, from order 1 on, for one unit input.
struct Series {
    state: Vec<Vec<Wide>>,
    rows: Vec<Vec<Wide>>,
}

/// The series of a motion with `input` one and all else zero, over `span`.
fn taylor(motion: &Motion, span: f64, input: Input, outputs: &[Output]) -> Series {
    let s = motion.structure;
    let n = s.n;
    let mut state = vec![Vec::with_capacity(TERMS); 2 * n];
    let mut rows = vec![Vec::with_capacity(TERMS); outputs.len()];
    let mut x = vec![Wide::default(); 2 * n];
    let mut stretches = vec![Wide::default(); s.contacts.len()];
    let mut waves = vec![[Wide::default(); 2]; s.oscillators.len()];
    let one = Wide::from(1.0);
    match input {
        Input::Displacement(i) => x[i] = one,
        Input::Velocity(i) => x[n + i] = one,
        Input::Stretch(j) => stretches[j] = one,
        Input::Load => {}
        Input::Cosine(i) => waves[i][0] = one,
        Input::Sine(i) => waves[i][1] = one,
    }
    let along = |j: usize, values: &[Wide]| {
        s.contacts[j].direction.iter().fold(Wide::default(), |sum, (i, g)| sum + values[*i as usize] * *g)
    };
    for order in 0..=TERMS {
        let wave = |w: &[Wave], waves: &[[Wide; 2]]| {
            w.iter().fold(Wide::default(), |sum, w| sum + waves[w.index][0] * w.cosine + waves[w.index][1] * w.sine)
        };
        let (q, v) = x.split_at(n);
        let deflection = |j: usize| along(j, q) - wave(&s.contacts[j].error, &waves);
        let force = |a: &Acting, stretches: &[Wide]| {
            let j = a.contact;
            let Force::Linear { stiffness: Elasticity::Constant(k), damping } = a.force else { return Wide::default() };
            let stretch = if order == 0 { stretches[j] } else { deflection(j) };
            stretch * k + (along(j, v) - wave(&s.contacts[j].error_rate, &waves)) * damping
        };
        if order > 0 {
            state.iter_mut().zip(&x).for_each(|(row, x)| row.push(*x));
            for (row, output) in rows.iter_mut().zip(outputs) {
                row.push(match output {
                    Output::Deflection(j) => deflection(*j),
                    Output::Force(acting) => force(acting, &stretches),
                });
            }
        }
        let mut a = vec![Wide::default(); n];
        let size = load_size(&s.load);
        if order == 0 && input == Input::Load && size > 0.0 {
            a.iter_mut().zip(&s.load).for_each(|(a, f)| *a = Wide::quotient((*f).into(), size));
        }
        for (a, row) in a.iter_mut().zip(&s.rows) {
            for (j, k, c) in row {
                *a = *a - q[*j as usize] * *k - v[*j as usize] * *c;
            }
        }
        for w in &s.load_waves {
            for ((a, cosine), sine) in a.iter_mut().zip(&w.cosine).zip(&w.sine) {
                *a = *a + waves[w.index][0] * *cosine + waves[w.index][1] * *sine;
            }
        }
        for acting in motion.parts.iter().filter_map(|part| part.acting).filter(|a| a.is_carried) {
            let force = force(&acting, &stretches);
            for (i, p) in &s.contacts[acting.contact].push {
                a[*i as usize] = a[*i as usize] - force * *p;
            }
        }
        let share = Wide::quotient(span.into(), (order + 1) as f64);
        let step = |y: Wide| y * share;
        let after: Vec<Wide> = v.iter().chain(&a).map(|y| step(*y)).collect();
        x = after;
        for (w, o) in waves.iter_mut().zip(&s.oscillators) {
            let [cosine, sine] = *w;
            *w = [step(sine * -o.omega), step(cosine * o.omega)];
        }
    }
    Series { state, rows }
}

/// The largest acceleration by a constant load: with the direction alone in the columns, all its sizes share them.
pub(super) fn load_size(load: &[f64]) -> f64 {
    load.iter().fold(0.0, |m: f64, f| m.max(f.abs()))
}

/// Bernstein coefficients of `Σ series_k θᵏ⁻¹` cut after T₁₉, and a bound on what is cut of them.
fn column(series: &[Wide]) -> ([f64; COUNT], f64) {
    if series.iter().all(|a| a.hi == 0.0) {
        return ([0.0; COUNT], 0.0);
    }
    let powers = &**POWERS;
    let (mut sum, mut low, mut cut) = ([0.0; COUNT], [0.0; COUNT], 0.0);
    for (m, a) in series.iter().enumerate() {
        cut += a.hi.abs() * powers.cut[m];
        // From here on terms are below 4.5²¹/21!, 1e-6, and so is their part in the rounding.
        if m >= COUNT {
            for i in 0..COUNT {
                low[i] += a.hi * powers.high[m][i];
            }
            continue;
        }
        for i in 0..COUNT {
            let product = Wide::product(a.hi, powers.high[m][i]);
            let next = Wide::sum(sum[i], product.hi);
            sum[i] = next.hi;
            low[i] += next.lo + product.lo + a.hi * powers.low[m][i] + a.lo * powers.high[m][i];
        }
    }
    sum.iter_mut().zip(low).for_each(|(s, low)| *s += low);
    (sum, cut)
}

/// What the terms after the last one add at most to displacements and velocities, times `√M_ii`, and to a wave of one. With
/// `‖x_{k+1}‖ ≤ (ρ‖x_k‖ + H F_k)/(k + 1)`, ρ at least the span times the growth and times all frequencies, the sum after order N is
/// at most `(ρ‖x_N‖ + H F_N/(1 − r))/((N + 1)(1 − r))` with `r = ρ/(N + 1)`.
fn rest(motion: &Motion, span: f64, input: Input, state: &[Vec<Wide>]) -> [f64; 3] {
    let s = motion.structure;
    let next = (TERMS + 1) as f64;
    let ratio = REACH / next;
    let wave = (1..=TERMS).fold(1.0, |term, k| term * REACH / k as f64);
    let forced = match input {
        Input::Cosine(i) | Input::Sine(i) => motion.forcing_of(i) * wave,
        _ => 0.0,
    };
    let last = |row: &Vec<Wide>| row.last().map_or(0.0, |c| c.hi.abs());
    let size = s.weights.iter().zip(&state[..s.n]).zip(&state[s.n..]);
    let size = size.fold(0.0, |m: f64, ((w, q), v)| m.max(w * last(v)).max(w * last(q) * motion.growth.frequency()));
    let velocity = (REACH * size + span * forced / (1.0 - ratio)) / (next * (1.0 - ratio));
    [span * (size + velocity) / next, velocity, wave * ratio / (1.0 - ratio)]
}

impl Motion<'_> {
    /// Weighted acceleration that oscillator `i` of amplitude one makes at most.
    fn forcing_of(&self, i: usize) -> f64 {
        let s = self.structure;
        let loads = s.load_waves.iter().filter(|w| w.index == i).map(|w| w.size(&s.weights));
        let contacts = self.parts.iter().zip(&s.contacts).filter_map(|(part, c)| {
            let (_, damping) = part.carried_linear()?;
            let waves = c.error.iter().filter(|w| w.index == i).map(|w| libm::hypot(w.cosine, w.sine));
            Some(c.push_norm * (c.stiffest + damping * s.oscillators[i].omega) * waves.sum::<f64>())
        });
        loads.sum::<f64>() + contacts.sum::<f64>()
    }

    /// The propagator of the mode, where it pays: few degrees of freedom, linear laws, constant stiffnesses, nothing at rest.
    pub(super) fn propagate(&self) -> Option<Rc<Propagator>> {
        let s = self.structure;
        let few = s.n <= MOST_FREEDOMS && s.oscillators.len() <= MOST_INPUTS && s.symmetry.is_empty();
        let is_simple = self.is_linear && !self.is_varying && self.held.is_none() && !s.is_conservative;
        if !(few && is_simple) {
            return None;
        }
        let numbers = self.numbers();
        if let Some(known) = FORMED.with_borrow(|formed| formed.get(&numbers).cloned()) {
            return Some(known);
        }
        let propagator = Rc::new(Propagator::new(self)?);
        FORMED.with_borrow_mut(|formed| {
            if formed.len() >= MOST_FORMED {
                formed.clear();
            }
            formed.insert(numbers, Rc::clone(&propagator));
        });
        Some(propagator)
    }

    /// The bits of all numbers that a propagator is formed of, in a fixed order. Places of flanks, restitution and the size of the load are
    /// none of them.
    fn numbers(&self) -> Box<[u64]> {
        let s = self.structure;
        let mut bits: Vec<u64> = Vec::with_capacity(64);
        let mut list = |values: &mut dyn Iterator<Item = f64>| {
            let first = bits.len();
            bits.push(0);
            bits.extend(values.map(f64::to_bits));
            bits[first] = (bits.len() - first) as u64;
        };
        let sparse =
            |row: &[(u32, f64)]| row.iter().flat_map(|(i, g)| [f64::from(*i), *g]).collect::<SmallVec<[f64; 8]>>();
        let waves =
            |w: &[Wave]| w.iter().flat_map(|w| [w.index as f64, w.cosine, w.sine]).collect::<SmallVec<[f64; 12]>>();
        list(&mut [self.growth.rate(), self.growth.frequency()].into_iter());
        let size = load_size(&s.load);
        list(&mut s.load.iter().map(|f| if size > 0.0 { f / size } else { 0.0 }));
        list(&mut s.weights.iter().copied());
        list(&mut s.oscillators.iter().map(|o| o.omega));
        s.rows.iter().for_each(|row| list(&mut row.iter().flat_map(|(j, k, c)| [f64::from(*j), *k, *c])));
        for w in &s.load_waves {
            list(&mut std::iter::once(w.index as f64).chain(w.cosine.iter().chain(&w.sine).copied()));
        }
        for (part, c) in self.parts.iter().zip(&s.contacts) {
            list(&mut sparse(&c.direction).into_iter());
            list(&mut sparse(&c.push).into_iter());
            list(&mut waves(&c.error).into_iter());
            list(&mut waves(&c.error_rate).into_iter());
            list(&mut [c.across, c.push_norm, c.stiffest].into_iter().chain(c.error_sizes));
            let law = part.acting.map(|a| match a.force {
                Force::Linear { stiffness: Elasticity::Constant(k), damping } => {
                    [1.0, f64::from(u8::from(a.is_carried)), k, damping]
                }
                _ => [2.0, f64::from(u8::from(a.is_carried)), 0.0, 0.0],
            });
            list(&mut law.into_iter().flatten());
        }
        for watched in &self.guards {
            list(&mut [watched.contact as f64, f64::from(u8::from(watched.watch == Watch::Force))].into_iter());
        }
        bits.into()
    }
}

/// Propagators that a thread keeps at most: some ten kilobytes each.
const MOST_FORMED: usize = 4096;

thread_local! {
    /// The propagators formed on this thread, by their numbers: trains that differ in load or backlash alone share them, and forming one
    /// costs as much as some hundred spans.
    static FORMED: RefCell<HashMap<Box<[u64]>, Rc<Propagator>>> = RefCell::default();
}

impl Propagator {
    fn new(motion: &Motion) -> Option<Self> {
        let s = motion.structure;
        let rate = motion.growth.rate().max(s.oscillators.iter().fold(0.0, |m: f64, o| m.max(o.omega)));
        let span = REACH / rate;
        if !span.is_normal() {
            return None;
        }
        let mut outputs: Vec<Output> = (0..s.contacts.len()).map(Output::Deflection).collect();
        let mut guards = Vec::with_capacity(motion.guards.len());
        for Watched { contact, watch, .. } in &motion.guards {
            guards.push(match (watch, motion.parts[*contact].acting) {
                (Watch::Force, Some(acting)) => {
                    outputs.push(Output::Force(acting));
                    outputs.len() - 1
                }
                _ => *contact,
            });
        }
        let displacements = (0..s.n).map(Input::Displacement).chain((0..s.n).map(Input::Velocity));
        let carried = (0..s.contacts.len()).filter(|j| motion.parts[*j].carried_linear().is_some());
        let waves = (0..s.oscillators.len()).flat_map(|i| [Input::Cosine(i), Input::Sine(i)]);
        let inputs = displacements.chain(carried.map(Input::Stretch)).chain([Input::Load]).chain(waves);
        let inputs: Vec<Input> = inputs.collect();
        let summed = (ROUNDED + 0.5 * inputs.len() as f64) * f64::EPSILON;
        let mut kept = Vec::new();
        let mut state = vec![Vec::new(); 2 * s.n];
        let mut rows = vec![(Vec::new(), Vec::new()); outputs.len()];
        for input in inputs {
            let series = taylor(motion, span, input, &outputs);
            if series.state.iter().chain(&series.rows).flatten().all(|c| c.hi == 0.0) {
                continue;
            }
            kept.push(input);
            for (columns, series) in state.iter_mut().zip(&series.state) {
                columns.push(column(series).0);
            }
            let [displacement, velocity, wave] = rest(motion, span, input, &series.state);
            for ((columns, errors), (series, output)) in rows.iter_mut().zip(series.rows.iter().zip(&outputs)) {
                let of = |c: &Contact| {
                    let [e, rate, _] = c.error_sizes;
                    [c.across * displacement + e * wave, c.across * velocity + rate * wave]
                };
                let rest = match output {
                    Output::Deflection(j) => of(&s.contacts[*j])[0],
                    Output::Force(a) => {
                        let c = &s.contacts[a.contact];
                        let [d, r] = of(c);
                        c.stiffest * d + a.force.damping().unwrap_or(0.0) * r
                    }
                };
                let (column, cut) = column(series);
                let size = column.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
                columns.push(column);
                errors.push(cut + rest + summed * size);
            }
        }
        if kept.len() > MOST_INPUTS {
            return None;
        }
        let rows = rows.into_iter().map(|(columns, errors)| Columns { columns: columns.into(), errors: errors.into() });
        Some(Self {
            span,
            inputs: kept.into(),
            state: state.into_iter().map(Into::into).collect(),
            rows: rows.collect(),
            guards: guards.into(),
        })
    }
}
