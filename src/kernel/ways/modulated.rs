//! Modes of one degree of freedom whose stiffness follows the forcing: data from which a propagator is formed.
//!
//! Let `φ` be the angle at the start of a span of which those of all waves are multiples. The stiffness over the span is a trigonometric
//! polynomial in φ, and so is every Taylor coefficient of the motion; each factor by a wave of degree h raises the degree by h.
//! So the motion is still a matrix polynomial, now of the start of the span times `1, cos φ, sin φ, cos 2φ, …`. Each part of the
//! stiffness that varies adds a degree and two powers of time: few degrees matter.
//!
//! The cut parts, in time and in φ, are bounded by the same recurrence with the sizes of all numbers, those of waves of order h times `rʰ`:
//! its sum bounds `Σ |c_m| r^m`, and so all degrees beyond m by `r^−(m+1)` of it.

use super::{
    column::MOST_POWERS as ORDERS,
    propagator::{CUT, Input, Output, SHORTEST},
    unit::UnitSeries,
};
use crate::{
    hybrid::Wide,
    kernel::mode::linear_mode::LinearMode,
    system::{Elasticity, LoadWave, Spring, Wave},
};

/// Largest degree in φ.
pub const MOST_DEGREES: usize = 24;
/// Largest permitted contribution of the degrees beyond, relative to the sum of all.
const BEYOND: f64 = 1e-18;
/// Values of r that are tried.
const RATIOS: [f64; 5] = [4.0, 16.0, 64.0, 256.0, 1024.0];
/// First degree that is formed in doubles: such terms are small.
pub const COARSE: usize = 3;
/// Factor, relative to the amplitude of its wave, that multiplies in doubles. Next: degree, relative to the largest, that is omitted.
const SMALL: f64 = 1e-6;
const UNSEEN: f64 = 1e-28;
/// Number of terms of the sums of sizes, and largest permitted last term relative to its sum.
const SUMMED: usize = 120;
const LAST: f64 = 1e-20;
/// Factor on a span for the next trial.
const SHORTER: f64 = 0.8;

/// Wave: its angle in units of φ, its frequency, rad/s, and its parts.
#[derive(Clone, Copy, Debug)]
struct WaveTerm {
    degree: usize,
    omega: f64,
    cosine: f64,
    sine: f64,
}

/// Stiffness of a contact in the mode.
#[derive(Debug)]
struct ModulatedStiffness {
    mean: f64,
    waves: Vec<WaveTerm>,
}

/// Stiffnesses of a mode, as functions of φ.
#[derive(Debug)]
pub struct Modulation {
    /// Order of φ in the clock.
    pub order: u32,
    /// Frequency of φ, rad/s.
    pub omega: f64,
    /// Stiffness of each contact, if it acts.
    stiffness: Vec<Option<ModulatedStiffness>>,
    /// Accelerations by the loads.
    load: Vec<WaveTerm>,
    /// Errors of each contact, and their rates.
    errors: Vec<[Vec<WaveTerm>; 2]>,
    pub degrees: usize,
}

/// Sums of sizes of an output: of all terms, and of those after [`ORDERS`].
pub type OutputSums = [f64; 2];

impl Modulation {
    /// Forms the modulation of a mode. `None` if a stiffness varies in another way or n > 1; `Some(None)` if none varies.
    pub fn new(s: &LinearMode) -> Option<Option<Self>> {
        if !s.is_varying {
            return Some(None);
        }
        let orders = s.oscillators.iter().map(|o| o.order).collect::<Option<Vec<u32>>>()?;
        let order = orders.iter().copied().fold(0, gcd);
        if s.n != 1 || order == 0 {
            return None;
        }
        let swing = |Wave { index, cosine, sine }: &Wave| WaveTerm {
            degree: (orders[*index] / order) as usize,
            omega: s.oscillators[*index].omega,
            cosine: *cosine,
            sine: *sine,
        };
        let swings = |waves: &[Wave]| waves.iter().map(swing).collect::<Vec<_>>();
        let mut stiffness = Vec::new();
        for c in &s.contacts {
            stiffness.push(match (c.law, &c.spring) {
                (Some((Elasticity::Constant(mean), _)), _) => Some(ModulatedStiffness { mean, waves: Vec::new() }),
                (Some((Elasticity::Waves, _)), Some(Spring::Waves(mean, waves))) => {
                    Some(ModulatedStiffness { mean: *mean, waves: swings(waves) })
                }
                (Some(_), _) => return None,
                (None, _) => None,
            });
        }
        let load = |w: &LoadWave| swing(&Wave { index: w.index, cosine: w.cosine[0], sine: w.sine[0] });
        Some(Some(Self {
            order,
            omega: f64::from(order) * s.clock,
            stiffness,
            load: s.load_waves.iter().map(load).collect(),
            errors: s.contacts.iter().map(|c| [swings(&c.error), swings(&c.error_rate)]).collect(),
            degrees: 0,
        }))
    }

    /// Returns the longest span up to `span` with a small enough cut part, and bounds on that part, as by [`bound`](Self::bound).
    pub fn fit(
        &mut self,
        mode: &LinearMode,
        mut span: f64,
        inputs: &[Input],
        outputs: &[Output],
    ) -> Option<(f64, Vec<Vec<f64>>)> {
        let shortest = SHORTEST * span;
        while span >= shortest {
            if let Some(cut) = self.bound(mode, span, inputs, outputs) {
                return Some((span, cut));
            }
            span *= SHORTER;
        }
        None
    }

    /// Chooses the degrees that are kept over `span`, and bounds the cut parts, by input and output: the state first.
    pub fn bound(
        &mut self,
        mode: &LinearMode,
        span: f64,
        inputs: &[Input],
        outputs: &[Output],
    ) -> Option<Vec<Vec<f64>>> {
        let all = |r: f64| inputs.iter().map(|input| self.sizes(mode, span, *input, outputs, r)).collect::<Vec<_>>();
        let own = all(1.0);
        // Degree beyond which the contribution of each input to each output is below the limit.
        let needed = |sums: &[Vec<OutputSums>], r: f64| {
            let pairs = sums.iter().flatten().zip(own.iter().flatten()).filter(|(_, own)| own[0] > 0.0);
            pairs.fold(0.0, |m: f64, (sum, own)| m.max(libm::log(sum[0] / (BEYOND * own[0])) / libm::log(r)))
        };
        let (mut best, mut sums) = (f64::INFINITY, Vec::new());
        for r in RATIOS {
            let these = all(r);
            let degrees = needed(&these, r).ceil();
            if degrees < best {
                (best, sums) = (
                    degrees,
                    these.iter().map(|row| row.iter().map(|s| s[0] * libm::pow(r, -degrees)).collect()).collect(),
                );
            }
        }
        let is_long = own.iter().flatten().any(|[all, late]| *late > CUT * all);
        if is_long || best > MOST_DEGREES as f64 {
            return None;
        }
        self.degrees = best as usize;
        let mut cut: Vec<Vec<f64>> = sums;
        for (cut, own) in cut.iter_mut().flatten().zip(own.iter().flatten()) {
            *cut += own[1];
        }
        Some(cut)
    }

    /// Bounds the sums of the sizes of all Taylor terms of order one and more, waves of order h times `rʰ`: of q, of v, of the outputs.
    fn sizes(&self, s: &LinearMode, span: f64, input: Input, outputs: &[Output], r: f64) -> Vec<OutputSums> {
        let mut sums = vec![[0.0; 2]; 2 + outputs.len()];
        let is = |other: Input| f64::from(u8::from(input == other));
        let (mut q, mut v) = (is(Input::Displacement(0)), is(Input::Velocity(0)));
        // Contribution of a unit of all waves at every order.
        let of = |swings: &[WaveTerm]| {
            let mut all = vec![0.0; SUMMED + 1];
            for w in swings {
                let mut term = (w.cosine.abs() + w.sine.abs()) * libm::pow(r, w.degree as f64);
                for (order, all) in all.iter_mut().enumerate() {
                    *all += term;
                    term *= w.omega * span / (order + 1) as f64;
                }
            }
            all
        };
        let (load, errors) = (of(&self.load), self.errors.iter().map(|e| [of(&e[0]), of(&e[1])]).collect::<Vec<_>>());
        let swings: Vec<_> =
            self.stiffness.iter().map(|spun| of(spun.as_ref().map_or(&[], |spun| &spun.waves))).collect();
        let is_forced = is(Input::Forcing);
        let mut stretches = vec![Vec::new(); s.contacts.len()];
        let (mut deflections, mut forces) = (vec![0.0; s.contacts.len()], vec![0.0; s.contacts.len()]);
        for order in 0..=SUMMED {
            let mut a = s.rows[0].iter().fold(0.0, |a, (_, k, c)| a + k.abs() * q + c.abs() * v);
            a += is_forced * (if order == 0 { s.whole_load[0].abs() } else { 0.0 } + load[order]);
            for (j, c) in s.contacts.iter().enumerate() {
                let across: f64 = c.direction.iter().map(|(_, g)| g.abs()).sum();
                deflections[j] = across * q + is_forced * errors[j][0][order];
                stretches[j].push(if order == 0 { is(Input::Stretch(j)) } else { deflections[j] });
                let Some(spun) = &self.stiffness[j] else { continue };
                let rate = across * v + is_forced * errors[j][1][order];
                forces[j] = spun.mean * stretches[j][order] + c.damping() * rate;
                forces[j] += stretches[j].iter().rev().zip(&swings[j]).map(|(p, k)| p * k).sum::<f64>();
                if c.is_carried {
                    a += c.push.iter().map(|(_, p)| p.abs()).sum::<f64>() * forces[j];
                }
            }
            if order > 0 {
                let rows = outputs.iter().map(|output| match output {
                    Output::Deflection(j) => deflections[*j],
                    Output::Force(j) => forces[*j],
                });
                for (sum, value) in sums.iter_mut().zip([q, v].into_iter().chain(rows)) {
                    sum[0] += value;
                    sum[1] += if order > ORDERS { value } else { 0.0 };
                    // A sum whose last term is not small is no bound.
                    if order == SUMMED && value > LAST * sum[0] {
                        *sum = [f64::INFINITY; 2];
                    }
                }
            }
            let share = span / (order + 1) as f64;
            (q, v) = (share * v, share * a);
        }
        sums
    }

    /// Returns Taylor coefficients for one unit input, by `1, cos φ, sin φ, …`.
    pub fn series(&self, s: &LinearMode, span: f64, input: Input, outputs: &[Output]) -> Vec<UnitSeries> {
        let count = 2 * self.degrees + 1;
        let zero = vec![Wide::default(); count];
        let unit = |other: Input| {
            let mut trig = zero.clone();
            trig[0] = if input == other { 1.0.into() } else { Wide::default() };
            trig
        };
        let mut all: Vec<UnitSeries> = (0..count)
            .map(|_| UnitSeries { state: vec![Vec::new(); 2], rows: vec![Vec::new(); outputs.len()] })
            .collect();
        let (mut q, mut v) = (unit(Input::Displacement(0)), unit(Input::Velocity(0)));
        let is_forced = input == Input::Forcing;
        let forced = |swings: &[WaveTerm]| swings.iter().map(|w| (w.degree, w.series(span))).collect::<Vec<_>>();
        let load = forced(&self.load);
        let errors: Vec<_> = self.errors.iter().map(|errors| [forced(&errors[0]), forced(&errors[1])]).collect();
        let take_off = |all: &mut [Wide], waves: &[(usize, Vec<[Wide; 2]>)], order: usize, sign: f64| {
            for (degree, series) in waves.iter().filter(|_| is_forced) {
                add(all, *degree, series[order][0] * sign, series[order][1] * sign);
            }
        };
        let mut stretches: Vec<Vec<Vec<Wide>>> = vec![Vec::new(); s.contacts.len()];
        let swings = self.stiffness.iter().map(|spun| spun.iter().flat_map(|spun| &spun.waves).map(|w| w.series(span)));
        let swings: Vec<Vec<_>> = swings.map(Iterator::collect).collect();
        for order in 0..=ORDERS {
            let (mut deflections, mut forces) = (Vec::new(), Vec::new());
            for (j, c) in s.contacts.iter().enumerate() {
                let g: f64 = c.direction.iter().map(|(_, g)| *g).sum();
                let mut deflection: Vec<Wide> = q.iter().map(|x| *x * g).collect();
                let mut rate: Vec<Wide> = v.iter().map(|x| *x * g).collect();
                take_off(&mut deflection, &errors[j][0], order, -1.0);
                take_off(&mut rate, &errors[j][1], order, -1.0);
                stretches[j].push(if order == 0 { unit(Input::Stretch(j)) } else { deflection.clone() });
                deflections.push(deflection);
                let Some(spun) = &self.stiffness[j] else {
                    forces.push(zero.clone());
                    continue;
                };
                let damping = c.damping();
                let own = stretches[j][order].iter().zip(&rate);
                let mut force: Vec<Wide> = own.map(|(p, r)| *p * spun.mean + *r * damping).collect();
                for (w, series) in spun.waves.iter().zip(&swings[j]) {
                    for (p, factor) in stretches[j].iter().rev().zip(series) {
                        add_product(&mut force, p, *factor, (w.degree, w.cosine.abs() + w.sine.abs()));
                    }
                }
                forces.push(force);
            }
            if order > 0 {
                for (t, series) in all.iter_mut().enumerate() {
                    series.state[0].push(q[t]);
                    series.state[1].push(v[t]);
                    for (row, output) in series.rows.iter_mut().zip(outputs) {
                        row.push(match output {
                            Output::Deflection(j) => deflections[*j][t],
                            Output::Force(j) => forces[*j][t],
                        });
                    }
                }
            }
            let mut a = zero.clone();
            if order == 0 && is_forced {
                a[0] = s.whole_load[0].into();
            }
            take_off(&mut a, &load, order, 1.0);
            for (t, a) in a.iter_mut().enumerate() {
                for (_, k, c) in &s.rows[0] {
                    *a = *a - q[t] * *k - v[t] * *c;
                }
                for (j, c) in s.contacts.iter().enumerate().filter(|(_, c)| c.is_carried) {
                    for (_, p) in &c.push {
                        *a = *a - forces[j][t] * *p;
                    }
                }
            }
            let share = Wide::quotient(span.into(), (order + 1) as f64);
            (q, v) = (v.iter().map(|v| *v * share).collect(), a.iter().map(|a| *a * share).collect());
        }
        all
    }
}

impl WaveTerm {
    /// Returns `c cos(hφ + ωt) + s sin(hφ + ωt)` as a series in t over the span: the factors of `cos hφ` and `sin hφ` at each order.
    fn series(&self, span: f64) -> Vec<[Wide; 2]> {
        let (mut cosine, mut sine) = (Wide::from(1.0), Wide::default());
        let step = Wide::product(self.omega, span);
        let mut all = Vec::with_capacity(ORDERS + 1);
        for order in 0..=ORDERS {
            all.push([cosine * self.cosine + sine * self.sine, cosine * self.sine - sine * self.cosine]);
            let by = (order + 1) as f64;
            (cosine, sine) = (Wide::quotient(sine * step * -1.0, by), Wide::quotient(cosine * step, by));
        }
        all
    }
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Adds to `cos` and `sin` of a multiple of φ, as far as `sum` has degrees.
fn add(sum: &mut [Wide], degree: usize, cosine: Wide, sine: Wide) {
    if degree == 0 {
        sum[0] = sum[0] + cosine;
    } else if 2 * degree < sum.len() {
        sum[2 * degree - 1] = sum[2 * degree - 1] + cosine;
        sum[2 * degree] = sum[2 * degree] + sine;
    }
}

/// Adds doubles to `cos` and `sin` of a multiple of φ, as [`add`] does.
fn add_coarse(sum: &mut [Wide], degree: usize, cosine: f64, sine: f64) {
    if degree == 0 {
        sum[0].hi += cosine;
    } else if 2 * degree < sum.len() {
        sum[2 * degree - 1].hi += cosine;
        sum[2 * degree].hi += sine;
    }
}

/// Adds `(α cos hφ + β sin hφ) p` to `sum`, as far as it has degrees.
fn add_product(sum: &mut [Wide], p: &[Wide], [alpha, beta]: [Wide; 2], (h, amplitude): (usize, f64)) {
    let size = |wide: &Wide| wide.hi.abs();
    let least = UNSEEN * p.iter().map(size).fold(0.0, f64::max);
    let factor = size(&alpha).max(size(&beta));
    if factor <= UNSEEN * amplitude {
        return;
    }
    let is_small = factor <= SMALL * amplitude;
    add(sum, h, alpha * p[0], beta * p[0]);
    for m in 1..=(p.len() - 1) / 2 {
        let (a, b) = (p[2 * m - 1], p[2 * m]);
        if size(&a).max(size(&b)) <= least {
            continue;
        }
        // `sin` of a negative angle is negative.
        let turned = if m >= h { 0.5 } else { -0.5 };
        if is_small || m >= COARSE {
            let ([aa, ab], [ba, bb]) = ([alpha.hi * a.hi, alpha.hi * b.hi], [beta.hi * a.hi, beta.hi * b.hi]);
            add_coarse(sum, m + h, 0.5 * (aa - bb), 0.5 * (ab + ba));
            add_coarse(sum, m.abs_diff(h), 0.5 * (aa + bb), turned * (ab - ba));
        } else {
            let ([aa, ab], [ba, bb]) = ([alpha * a, alpha * b], [beta * a, beta * b]);
            add(sum, m + h, (aa - bb) * 0.5, (ab + ba) * 0.5);
            add(sum, m.abs_diff(h), (aa + bb) * 0.5, (ab - ba) * turned);
        }
    }
}
