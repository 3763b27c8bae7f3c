//! Propagators: motion of a linear mode over one span as a matrix polynomial.
//!
//! With 1, `cos ωt` and `sin ωt` as part of the state, a mode with linear laws and constant stiffnesses is autonomous: the
//! change of the state over a span is a fixed polynomial matrix times the start of the span, for any phase. The polynomials are
//! Chebyshev series cut after T₁₉ or T₂₃, in Bernstein form, of `(y(θ) − y(0))/θ` for every quantity y: an exact zero at the start of a
//! span is divided out, and the signs of the coefficients decide the remaining zeros.
//!
//! The matrix is a pure function of the mode. It is formed in two doubles and rounded once.

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use smallvec::SmallVec;

use super::{
    column::{Columns, Conversion, largest},
    modulated::{COARSE, MOST_DEGREES, Modulation},
    unit::{LANES, UnitSeries, Units, rest, rest_of},
};
use crate::{
    hybrid::Instant,
    kernel::{
        Motion,
        mode::{
            fold::Fold,
            linear_mode::{LinearGuard, LinearMode, load_size},
        },
    },
    system::Structure,
    vectors::Path,
};

/// Length of a span and degree of its columns.
#[derive(Debug)]
pub struct Degree {
    /// Number of fours of coefficients.
    pub fours: usize,
    /// Number of powers of θ in their Taylor series. The rest is below 4e-21 of the first term, `reachᴺ/N!` over the reach.
    pub terms: usize,
    /// Span times the fastest rate of the mode, ρ, rad. The cut part of a motion of size one is below 1e-16: `2 e^(ρ/2) I_n(ρ/2)` for n
    /// coefficients.
    pub reach: f64,
}

/// For one degree of freedom: most arcs are one span, and the signs of longer ones would have more turns to resolve.
pub const SHORT: Degree = Degree { fours: 5, terms: 40, reach: 4.5 };
/// For several degrees of freedom: a fifth more coefficients for a span half as long again.
const LONG: Degree = Degree { fours: 6, terms: 48, reach: 7.0 };

/// Maximum number of inputs of a span.
pub const MOST_INPUTS: usize = 16;
/// Maximum number of terms whose sum is the motion over a span.
pub const MOST_TERMS: usize = 160;
/// Size of a column, relative to that of degree zero, below which it counts as error of that one.
const NEGLIGIBLE: f64 = 1e-19;
/// Shortest span for which a modulated mode has a propagator, in spans of a mode that is not modulated, and largest cut part there.
pub const SHORTEST: f64 = 0.25;
pub const CUT: f64 = 1e-16;
/// Number of values of [`Propagator::angles`].
pub const MOST_ANGLES: usize = 2 * MOST_DEGREES.next_multiple_of(4) + 1;
pub type Angles = [f64; MOST_ANGLES];
/// Roundings of a value of a row in units of ε, besides half a unit for each input that its coefficients are summed over: half for the
/// columns, one and a half for an angle and its cosine, four each for the polynomials of the basis and the sum over them.
const ROUNDED: f64 = 10.0;

/// Component of the start of a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// A displacement.
    Displacement(usize),
    /// A velocity.
    Velocity(usize),
    /// Stretch `δ − σ b` of a contact that carries force.
    Stretch(usize),
    /// Size of the constant load.
    Load,
    /// Cosine `cos ωt` of an oscillator.
    Cosine(usize),
    /// Sine `sin ωt` of an oscillator.
    Sine(usize),
    /// Constant one: all loads and errors together, if the stiffness follows the forcing.
    Forcing,
}

impl Input {
    /// Returns its value at the start of a span: from `x`, n displacements and n velocities, of the `stretches`, and of the oscillators.
    #[inline(always)]
    pub fn value(self, s: &Structure, x: &[f64], stretches: &[f64], waves: &[[f64; 2]]) -> f64 {
        match self {
            Self::Displacement(i) => x[i],
            Self::Velocity(i) => x[s.n + i],
            Self::Stretch(j) => stretches[j],
            Self::Load => load_size(&s.load),
            Self::Cosine(i) => waves[i][0],
            Self::Sine(i) => waves[i][1],
            Self::Forcing => 1.0,
        }
    }
}

/// Quantity that is propagated besides the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Output {
    Deflection(usize),
    Force(usize),
}

/// Columns of a quantity besides the state, and contribution of a unit of each term to the error of its coefficients.
#[derive(Debug)]
pub struct QuantityColumns {
    pub columns: Columns,
    pub errors: Box<[f64]>,
}

impl QuantityColumns {
    /// Returns the error of the coefficients for the terms `z`.
    #[inline(always)]
    pub fn error(&self, z: &[f64]) -> f64 {
        let (z, rest) = z.as_chunks::<4>();
        let (errors, others) = self.errors.as_chunks::<4>();
        let mut sums = [0.0; 4];
        for (errors, z) in errors.iter().zip(z) {
            for l in 0..4 {
                sums[l] += errors[l] * z[l].abs();
            }
        }
        let rest = others.iter().zip(rest).fold(0.0, |sum, (error, z)| sum + error * z.abs());
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
    }
}

/// Columns of a component of the state.
#[derive(Debug)]
pub enum Component {
    /// Columns of its own.
    Own(Columns),
    /// Index of the row with the same columns.
    Row(usize),
    /// Index of the equal component; a train of one degree of freedom has none.
    Same(usize),
}

/// Motion of a mode over one span.
#[derive(Debug)]
pub struct Propagator {
    /// Span, s.
    pub span: f64,
    /// Number of fours of a column.
    pub fours: usize,
    /// Inputs, each with the end of its terms in `waves`. The motion is a sum of inputs times some of `1, cos φ, sin φ, cos 2φ, …`.
    pub inputs: Box<[(Input, usize)]>,
    /// Index of the angle of each term.
    pub waves: Box<[usize]>,
    /// Frequency, rad/s, and order of φ, and the largest degree, if the stiffness follows the forcing.
    pub modulation: Option<(f64, u32, usize)>,
    /// Columns of the state.
    pub state: Box<[Component]>,
    pub rows: Box<[QuantityColumns]>,
    /// Row of the deflection of each contact.
    pub deflections: Box<[usize]>,
    /// Row of each guard.
    pub guards: Box<[usize]>,
    /// First guard that equals each guard.
    pub firsts: Box<[usize]>,
    pub fold: Fold,
}

/// Roundings of the angle of degree m in units of mε: of a product of two angles √5/2 at most (Brent, Percival & Zimmermann 2007), and a
/// unit of the angle itself, rounded up. In any order of products, degree m takes m angles and m − 1 products.
const TURNED: f64 = 2.25;

impl Propagator {
    /// Writes `1, cos φ, sin φ, cos 2φ, …` at the start of a span; only the first if nothing is modulated.
    #[inline(always)]
    pub fn angles<P: Path>(&self, path: P, motion: &Motion, at: Instant, all: &mut Angles) {
        all[0] = 1.0;
        let Some((omega, order, degrees)) = self.modulation else { return };
        let (s, c) = motion.structure.clock.sincos(omega, Some(order), at);
        let turned = |[c1, s1]: [f64; 2], [c2, s2]: [f64; 2]| [c1 * c2 - s1 * s2, s1 * c2 + c1 * s2];
        let (one, two) = ([c, s], turned([c, s], [c, s]));
        let (three, four) = (turned(two, one), turned(two, two));
        let mut cosines = path.four([c, two[0], three[0], four[0]]);
        let mut sines = path.four([s, two[1], three[1], four[1]]);
        let by = four.map(|x| path.all(x));
        // Four degrees at a time: each is formed from the fourth one before it.
        for first in (0..degrees).step_by(4) {
            let [c, s] = [cosines, sines].map(|x| path.numbers(x));
            for l in 0..4 {
                [all[2 * (first + l) + 1], all[2 * (first + l) + 2]] = [c[l], s[l]];
            }
            let next = path.minus(path.times(cosines, by[0]), path.times(sines, by[1]));
            sines = path.plus(path.times(sines, by[0]), path.times(cosines, by[1]));
            cosines = next;
        }
    }

    /// Writes into `z` the terms whose sum is the motion over a span from `at`, from the state `x`, the stretches of the contacts and the
    /// oscillators.
    #[inline(always)]
    pub fn weigh<P: Path>(
        &self,
        path: P,
        motion: &Motion,
        (at, x): (Instant, &[f64]),
        (stretches, waves): (&[f64], &[[f64; 2]]),
        z: &mut SmallVec<[f64; MOST_TERMS]>,
    ) {
        let s = motion.structure;
        if self.modulation.is_none() {
            for (input, _) in &self.inputs {
                z.push(input.value(s, x, stretches, waves));
            }
            return;
        }
        let mut angles = [0.0; MOST_ANGLES];
        self.angles(path, motion, at, &mut angles);
        // No adapter around code compiled for P: it would be a separate function.
        z.resize(self.waves.len(), 0.0);
        let mut first = 0;
        for (input, end) in &self.inputs {
            let value = input.value(s, x, stretches, waves);
            for (z, wave) in z[first..*end].iter_mut().zip(&self.waves[first..*end]) {
                *z = value * angles[*wave];
            }
            first = *end;
        }
    }

    pub fn new(s: &LinearMode) -> Option<Self> {
        let fold = &s.fold;
        let rate = s.rate.max(s.oscillators.iter().fold(0.0, |m: f64, o| m.max(o.omega)));
        let degree = if s.n > 1 { &LONG } else { &SHORT };
        let (fours, span) = (degree.fours, degree.reach / rate);
        if !span.is_normal() {
            return None;
        }
        let is_first = |of: &[usize], i: &usize| of[*i] == *i;
        let contacts: Vec<usize> = (0..s.contacts.len()).filter(|j| is_first(&fold.contacts, j)).collect();
        let row = |j: usize| contacts.iter().position(|first| *first == fold.contacts[j]).unwrap_or(0);
        let deflections: Box<[usize]> = (0..s.contacts.len()).map(row).collect();
        let mut outputs: Vec<Output> = contacts.iter().map(|j| Output::Deflection(*j)).collect();
        let (mut guards, mut firsts) = (Vec::<usize>::new(), Vec::new());
        for (number, guard) in s.guards.iter().enumerate() {
            let equal = LinearGuard { contact: fold.contacts[guard.contact], ..*guard };
            let first = s.guards.iter().position(|other| *other == equal).unwrap_or(number);
            firsts.push(first);
            guards.push(if first < number {
                guards[first]
            } else if guard.is_force && s.contacts[guard.contact].law.is_some() {
                outputs.push(Output::Force(guard.contact));
                outputs.len() - 1
            } else {
                deflections[guard.contact]
            });
        }
        let freedoms: Vec<usize> = (0..s.n).filter(|i| is_first(&fold.freedoms, i)).collect();
        let displacements = freedoms.iter().map(|i| Input::Displacement(*i));
        let velocities = freedoms.iter().map(|i| Input::Velocity(*i));
        // With a varying stiffness, the force depends on the stretch at the start, carried or only watched.
        let feels = |j: &usize| s.contacts[*j].is_carried || s.is_varying && s.contacts[*j].law.is_some();
        let felt = contacts.iter().copied().filter(feels);
        let waves = (0..s.oscillators.len()).flat_map(|i| [Input::Cosine(i), Input::Sine(i)]);
        let own = displacements.chain(velocities).chain(felt.map(Input::Stretch));
        let mut modulation = Modulation::new(s)?;
        let inputs: Vec<Input> = match &modulation {
            None => own.chain([Input::Load]).chain(waves).collect(),
            Some(_) => own.chain([Input::Forcing]).collect(),
        };
        let (span, cuts) = match &mut modulation {
            None => (span, Vec::new()),
            Some(modulation) => modulation.fit(s, span, &inputs, &outputs)?,
        };
        // Series of each input by each wave.
        let all: Vec<Vec<UnitSeries>> = match &modulation {
            None => inputs
                .chunks(LANES)
                .flat_map(|inputs| {
                    let (terms, outputs) = (degree.terms, &outputs);
                    s.instructions.run(Units { mode: s, span, terms, inputs, outputs })
                })
                .map(|series| vec![series])
                .collect(),
            Some(modulation) => inputs.iter().map(|input| modulation.series(s, span, *input, &outputs)).collect(),
        };
        let (mut kept, mut ends) = (Vec::new(), Vec::new());
        let mut state: Vec<Vec<_>> = vec![Vec::new(); 2 * s.n];
        let mut rows: Vec<(Vec<_>, Vec<f64>)> = outputs.iter().map(|_| Default::default()).collect();
        for (number, (input, all)) in inputs.into_iter().zip(all).enumerate() {
            let whole = all[0].sizes();
            if all.iter().all(UnitSeries::is_nothing) {
                continue;
            }
            let first = kept.len();
            for (wave, series) in all.iter().enumerate() {
                if wave > 0 {
                    let own = series.sizes();
                    if own.iter().zip(&whole).all(|(own, whole)| *own <= NEGLIGIBLE * whole) {
                        rows.iter_mut().zip(&own[2 * s.n..]).for_each(|((_, errors), size)| errors[first] += size);
                        continue;
                    }
                }
                kept.push(wave);
                let is_coarse = wave > 2 * (COARSE - 1);
                for (i, (columns, series)) in state.iter_mut().zip(&series.state).enumerate() {
                    if is_first(&fold.freedoms, &(i % s.n)) {
                        columns.push(s.instructions.run(Conversion { series, fours, is_coarse }).0);
                    }
                }
                let cut = |i: usize| match (wave, cuts.get(number)) {
                    (0, Some(cuts)) => cuts[2 * s.n + i],
                    (0, None) => rest_of(s, rest(s, span, degree, input, &series.state), &outputs[i]),
                    _ => 0.0,
                };
                for (i, ((columns, errors), series)) in rows.iter_mut().zip(&series.rows).enumerate() {
                    let (column, left) = s.instructions.run(Conversion { series, fours, is_coarse });
                    columns.push(column);
                    let rounded = (ROUNDED + TURNED * wave.div_ceil(2) as f64) * f64::EPSILON;
                    errors.push(left + cut(i) + rounded * largest(&column));
                }
            }
            ends.push((input, kept.len()));
        }
        if kept.len() > MOST_TERMS {
            return None;
        }
        for (columns, errors) in &mut rows {
            let summed = 0.5 * kept.len() as f64 * f64::EPSILON;
            errors.iter_mut().zip(columns).for_each(|(error, column)| *error += summed * largest(column));
        }
        // A deflection without an error along one displacement is that displacement, up to a constant.
        let place = |(i, columns): (usize, Vec<_>)| match rows.iter().position(|(row, _)| *row == columns) {
            _ if !is_first(&fold.freedoms, &(i % s.n)) => Component::Same(i - i % s.n + fold.freedoms[i % s.n]),
            Some(row) => Component::Row(row),
            None => Component::Own(Columns::new(&columns, fours)),
        };
        let state = state.into_iter().enumerate().map(place).collect();
        let line = |(columns, errors): (Vec<_>, Vec<f64>)| QuantityColumns {
            columns: Columns::new(&columns, fours),
            errors: errors.into(),
        };
        let rows = rows.into_iter().map(line);
        Some(Self {
            span,
            fours,
            inputs: ends.into(),
            waves: kept.into(),
            modulation: modulation.map(|m| (m.omega, m.order, m.degrees)),
            state,
            rows: rows.collect(),
            deflections,
            guards: guards.into(),
            firsts: firsts.into(),
            fold: fold.clone(),
        })
    }
}
