//! Propagators: a linear mode's motion over one span as a matrix polynomial.
//!
//! With 1, `cos ωt` and `sin ωt` as part of the state, a mode with linear laws and constant stiffnesses is autonomous: the
//! change of the state over a span is a fixed polynomial matrix times where the span starts, whatever the phase. The polynomials are
//! Chebyshev series cut after T₁₉, in Bernstein form, of `(y(θ) − y(0))/θ` for every quantity y: an exact zero at the start of a
//! span is divided out, and the signs of the coefficients tell the zeros that are left.
//!
//! The matrix is a pure function of the mode. It is formed in two doubles and rounded once.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use std::sync::LazyLock;

use smallvec::SmallVec;

use super::{
    Motion,
    modulated::{COARSE, MOST_DEGREES, Modulation},
    motion::Watched,
};
use crate::{
    hybrid::{Instant, Wide},
    poly::COUNT,
    system::{Acting, Contact, Elasticity, Force, Structure, Watch, Wave},
};

/// Powers of θ in the Taylor series that a row is made from. The rest is below 2e-21 of the first,
/// `40·4.5⁴⁰/40!` over 4.5.
pub(super) const TERMS: usize = 40;
/// The span times the mode's fastest rate, rad: what the series cut after T₁₉ leave out is below 1e-17 of the first terms.
const REACH: f64 = 4.5;
/// Powers in that of a mode whose stiffness follows the forcing.
pub(super) const MOST_POWERS: usize = 56;
/// Most components that a span may start from.
pub(super) const MOST_INPUTS: usize = 16;
/// Most terms that the motion over a span is a sum of.
pub(super) const MOST_TERMS: usize = 160;
/// A column this small beside that of degree zero is part of the error of that.
const NEGLIGIBLE: f64 = 1e-19;
/// Shortest span that a modulated mode is worth a propagator for, in [`REACH`], and what may be cut there.
pub(super) const SHORTEST: f64 = 0.25;
pub(super) const CUT: f64 = 1e-16;
/// Room for [`Propagator::angles`].
const MOST_ANGLES: usize = 2 * MOST_DEGREES + 1;
/// Roundings of a value of a row in units of ε, besides half a unit for each input that its coefficients are summed over: half for the
/// columns, one and a half for an angle and its cosine, four each for the polynomials of the basis and the sum over them.
const ROUNDED: f64 = 10.0;

/// The powers of θ as Bernstein coefficients of their Chebyshev series cut after T₁₉, and what is cut.
struct Powers {
    high: [[f64; COUNT]; MOST_POWERS],
    low: [[f64; COUNT]; MOST_POWERS],
    cut: [f64; MOST_POWERS],
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
    let mut powers = Box::new(Powers {
        high: [[0.0; COUNT]; MOST_POWERS],
        low: [[0.0; COUNT]; MOST_POWERS],
        cut: [0.0; MOST_POWERS],
    });
    // θᵐ = Σ a_k T_k, from θ T_k = (T_{k+1} + 2 T_k + T_{|k−1|})/4.
    let mut a = [Wide::default(); MOST_POWERS + 1];
    a[0] = 1.0.into();
    for m in 0..MOST_POWERS {
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
    /// One: all loads and errors together, where the stiffness follows the forcing.
    Forcing,
}

impl Input {
    /// Its value where a span starts: of `x`, n displacements and n velocities, of the `stretches`, and of the oscillators.
    #[inline(always)]
    pub fn value(self, s: &Structure, x: &[f64], stretch: impl Fn(usize) -> f64, waves: &[[f64; 2]]) -> f64 {
        match self {
            Self::Displacement(i) => x[i],
            Self::Velocity(i) => x[s.n + i],
            Self::Stretch(j) => stretch(j),
            Self::Load => load_size(&s.load),
            Self::Cosine(i) => waves[i][0],
            Self::Sine(i) => waves[i][1],
            Self::Forcing => 1.0,
        }
    }
}

/// What is propagated besides the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Output {
    Deflection(usize),
    Force(Acting),
}

/// The columns of a row, and what a unit of each input adds to the error of its coefficients.
#[derive(Debug)]
pub(super) struct Columns {
    pub columns: Box<[[f64; COUNT]]>,
    pub errors: Box<[f64]>,
}

/// A component of the state.
#[derive(Debug)]
pub(super) enum Component {
    /// Its columns.
    Own(Box<[[f64; COUNT]]>),
    /// The row that has the same ones.
    Row(usize),
}

/// The motion of a mode over one span.
#[derive(Debug)]
pub(super) struct Propagator {
    /// s.
    pub span: f64,
    /// What it is a sum of: an input times one of `1, cos φ, sin φ, cos 2φ, …`.
    pub terms: Box<[(Input, usize)]>,
    /// Where the stiffness follows the forcing: rad/s and order of φ, and the largest degree.
    pub modulation: Option<(f64, u32, usize)>,
    /// The state.
    pub state: Box<[Component]>,
    pub rows: Box<[Columns]>,
    /// For each guard its row.
    pub guards: Box<[usize]>,
}

/// Taylor coefficients of the state, and of deflections and forces, from order 1 on, for one unit input.
pub(super) struct Series {
    pub state: Vec<Vec<Wide>>,
    pub rows: Vec<Vec<Wide>>,
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
        Input::Load | Input::Forcing => {}
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
fn column(series: &[Wide], is_coarse: bool) -> ([f64; COUNT], f64) {
    if series.iter().all(|a| a.hi == 0.0) {
        return ([0.0; COUNT], 0.0);
    }
    let powers = &**POWERS;
    let (mut sum, mut low, mut cut) = ([0.0; COUNT], [0.0; COUNT], 0.0);
    for (m, a) in series.iter().enumerate() {
        cut += a.hi.abs() * powers.cut[m];
        // From here on terms are below 4.5²¹/21!, 1e-6, and so is their part in the rounding.
        if is_coarse || m >= COUNT {
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
}

/// What the Taylor terms after the last one add to an output, by what they add to displacements, velocities and waves.
fn rest_of(motion: &Motion, [displacement, velocity, wave]: [f64; 3], output: &Output) -> f64 {
    let of = |c: &Contact| {
        let [e, rate, _] = c.error_sizes;
        [c.across * displacement + e * wave, c.across * velocity + rate * wave]
    };
    match output {
        Output::Deflection(j) => of(&motion.structure.contacts[*j])[0],
        Output::Force(a) => {
            let c = &motion.structure.contacts[a.contact];
            let [d, r] = of(c);
            c.stiffest * d + a.force.damping().unwrap_or(0.0) * r
        }
    }
}

impl Propagator {
    /// `1, cos φ, sin φ, …` where a span starts; the first alone where nothing is modulated.
    #[inline(always)]
    pub fn angles(&self, motion: &Motion, at: Instant) -> SmallVec<[f64; MOST_ANGLES]> {
        let mut all = SmallVec::new();
        all.push(1.0);
        if let Some((omega, order, degrees)) = self.modulation {
            let (sine, cosine) = motion.structure.clock.sincos(omega, Some(order), at);
            let [mut c, mut s] = [1.0, 0.0];
            for _ in 0..degrees {
                [c, s] = [c * cosine - s * sine, s * cosine + c * sine];
                all.push(c);
                all.push(s);
            }
        }
        all
    }

    pub fn new(motion: &Motion) -> Option<Self> {
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
        // A stiffness that varies makes a force of the stretch at the start, carried or only watched.
        let feels = |j: &usize| {
            let part = &motion.parts[*j];
            part.carried_linear().is_some() || motion.is_varying && matches!(part.force(), Some(Force::Linear { .. }))
        };
        let felt = (0..s.contacts.len()).filter(feels);
        let waves = (0..s.oscillators.len()).flat_map(|i| [Input::Cosine(i), Input::Sine(i)]);
        let own = displacements.chain(felt.map(Input::Stretch));
        let mut modulation = Modulation::new(motion)?;
        let inputs: Vec<Input> = match &modulation {
            None => own.chain([Input::Load]).chain(waves).collect(),
            Some(_) => own.chain([Input::Forcing]).collect(),
        };
        let (span, cuts) = match &mut modulation {
            None => (span, Vec::new()),
            Some(modulation) => modulation.fit(motion, span, &inputs, &outputs)?,
        };
        let mut kept = Vec::new();
        let mut state = vec![Vec::new(); 2 * s.n];
        let mut rows = vec![(Vec::new(), Vec::<f64>::new()); outputs.len()];
        for (number, input) in inputs.into_iter().enumerate() {
            let all = match &modulation {
                None => vec![taylor(motion, span, input, &outputs)],
                Some(modulation) => modulation.series(motion, span, input, &outputs),
            };
            let sizes = |series: &Series| {
                let rows = series.state.iter().chain(&series.rows);
                rows.map(|row| row.iter().map(|c| c.hi.abs()).sum::<f64>()).collect::<Vec<_>>()
            };
            let whole = sizes(&all[0]);
            let is_nothing = |series: &Series| series.state.iter().chain(&series.rows).flatten().all(|c| c.hi == 0.0);
            if all.iter().all(is_nothing) {
                continue;
            }
            let first = kept.len();
            for (wave, series) in all.iter().enumerate() {
                let own = sizes(series);
                if wave > 0 && own.iter().zip(&whole).all(|(own, whole)| *own <= NEGLIGIBLE * whole) {
                    rows.iter_mut().zip(&own[2 * s.n..]).for_each(|((_, errors), size)| errors[first] += size);
                    continue;
                }
                kept.push((input, wave));
                let is_coarse = wave > 2 * (COARSE - 1);
                for (columns, series) in state.iter_mut().zip(&series.state) {
                    columns.push(column(series, is_coarse).0);
                }
                let cut = |i: usize| match (wave, cuts.get(number)) {
                    (0, Some(cuts)) => cuts[2 * s.n + i],
                    (0, None) => rest_of(motion, rest(motion, span, input, &series.state), &outputs[i]),
                    _ => 0.0,
                };
                for (i, ((columns, errors), series)) in rows.iter_mut().zip(&series.rows).enumerate() {
                    let (column, left) = column(series, is_coarse);
                    let size = column.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
                    columns.push(column);
                    // Each degree is formed from the one before.
                    let rounded = (ROUNDED + wave.div_ceil(2) as f64) * f64::EPSILON;
                    errors.push(left + cut(i) + rounded * size);
                }
            }
        }
        if kept.len() > MOST_TERMS {
            return None;
        }
        let summed = 0.5 * kept.len() as f64 * f64::EPSILON;
        for (column, error) in rows.iter_mut().flat_map(|(columns, errors)| columns.iter().zip(errors)) {
            *error += summed * column.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        }
        // A deflection without an error along one displacement is that displacement, up to a constant.
        let place = |columns: Vec<[f64; COUNT]>| match rows.iter().position(|(row, _)| *row == columns) {
            Some(row) => Component::Row(row),
            None => Component::Own(columns.into()),
        };
        let state = state.into_iter().map(place).collect();
        let rows = rows.into_iter().map(|(columns, errors)| Columns { columns: columns.into(), errors: errors.into() });
        Some(Self {
            span,
            terms: kept.into(),
            modulation: modulation.map(|m| (m.omega, m.order, m.degrees)),
            state,
            rows: rows.collect(),
            guards: guards.into(),
        })
    }
}
