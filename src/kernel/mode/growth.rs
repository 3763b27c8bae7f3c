//! Norms of a mode and amplitudes of its forcing, from which the bounds of its steps follow: see
//! [`bound`](crate::kernel::bounds::bound).

use super::motion::ContactInMode;
use crate::kernel::ROW;
use crate::system::{Oscillator, Sticking, Structure};

/// Least order whose remainders [`Amplitude::top`] bounds.
const LEAST_ORDER: i32 = 16;

/// Sums over the harmonics `a cos(ωt + φ)` of one row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Amplitude {
    /// Sum `Σ |a|`.
    pub sum: f64,
    /// `Σ |a| (ω/Ω)^16` with Ω the fastest frequency of loads and errors: the terms of order N ≥ 16 are at most `top (ΩH)ᴺ/N!`.
    pub top: f64,
}

impl Amplitude {
    fn add(&mut self, size: f64, oscillator: Oscillator, fastest: f64) {
        self.sum += size;
        self.top += size * (oscillator.omega / fastest).powi(LEAST_ORDER);
    }
}

/// Sums over the forcing of a structure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forcing {
    /// Fastest frequency Ω of loads and errors, rad/s.
    pub fastest: f64,
    /// Harmonic loads as weighted accelerations, `max_i √M_ii |a_i|`.
    pub load: Amplitude,
    /// Errors of each contact: e, ė, ë.
    pub errors: Vec<[Amplitude; 3]>,
    /// `min (1/ω) (Σ|e|/|e_ω|)^(1/25)` over all errors that are watched, s: the step on which each wave stays resolved.
    pub span: f64,
    /// Largest ë over [`Contact::across`](crate::system::Contact::across).
    pub swing: f64,
    /// Row sums of the weighted `M⁻¹K` and `M⁻¹C` without contacts.
    pub rows: [Vec<f64>; 2],
    /// `‖M⁻¹K‖`, 1/s², and `‖M⁻¹C‖`, 1/s, without contacts.
    pub norms: [f64; 2],
}

impl Forcing {
    pub fn new(s: &Structure) -> Self {
        let oscillators = &s.oscillators;
        let errors = s.contacts.iter().flat_map(|c| &c.error).map(|w| w.index);
        let waves = s.load_waves.iter().map(|w| w.index).chain(errors);
        let fastest = waves.fold(0.0, |m: f64, i| m.max(oscillators[i].omega));
        let mut load = Amplitude::default();
        for w in &s.load_waves {
            load.add(w.size(&s.weights), oscillators[w.index], fastest);
        }
        let mut span = f64::INFINITY;
        let mut errors = Vec::with_capacity(s.contacts.len());
        for c in &s.contacts {
            let mut sums = [Amplitude::default(); 3];
            for w in &c.error {
                let (size, o) = (libm::hypot(w.cosine, w.sine), oscillators[w.index]);
                for (power, sum) in sums.iter_mut().enumerate() {
                    sum.add(size * o.omega.powi(power as i32), o, fastest);
                }
            }
            for w in c.error.iter().filter(|_| !c.spec.law.is_bilateral()) {
                let share = sums[0].sum / libm::hypot(w.cosine, w.sine);
                span = span.min(libm::pow(share, 1.0 / ROW as f64) / oscillators[w.index].omega);
            }
            errors.push(sums);
        }
        let w = &s.weights;
        let mut rows = [vec![0.0; s.n], vec![0.0; s.n]];
        for (i, row) in s.rows.iter().enumerate() {
            for (j, k, c) in row {
                let ratio = w[i] / w[*j as usize];
                rows[0][i] += k.abs() * ratio;
                rows[1][i] += c.abs() * ratio;
            }
        }
        let norms = [0, 1].map(|i: usize| rows[i].iter().copied().fold(0.0, f64::max));
        let swings = s.contacts.iter().zip(&errors).map(|(c, errors)| errors[2].sum / c.across);
        Self { fastest, load, span, swing: swings.fold(0.0, f64::max), rows, norms, errors }
    }
}

/// Norms and amplitudes of the smooth flow of a mode.
#[derive(Debug)]
pub struct Growth {
    /// `‖A_q‖`, 1/s², and `‖A_v‖`, 1/s.
    pub norms: [f64; 2],
    /// Harmonic forcing as a weighted acceleration.
    pub forcing: Amplitude,
    /// Norms and the forcing's top without the contacts at rest.
    pub free: [f64; 3],
    /// Norm of the projection by contacts at rest; 1 without.
    pub projection: f64,
    /// Fastest frequency of a stiffness by which a force is carried or watched, rad/s.
    pub swing: f64,
}

impl Growth {
    /// Forms the norms of the structure, the linear contacts that carry force and the projection by the contacts at rest.
    pub fn new(s: &Structure, forcing: &Forcing, parts: &[ContactInMode], held: Option<&Sticking>) -> Self {
        let [mut by_q, mut by_v] = forcing.rows.clone();
        let (mut total, mut swing) = (forcing.load, 0.0);
        for (j, (part, c)) in parts.iter().zip(&s.contacts).enumerate() {
            if part.acting.is_some() {
                swing = f64::max(swing, c.swing.1);
            }
            let Some((_, damping)) = part.carried_linear() else { continue };
            let stiffness = c.stiffest;
            for (i, p) in &c.push {
                let push = p.abs() * s.weights[*i as usize];
                by_q[*i as usize] += stiffness * push * c.across;
                by_v[*i as usize] += damping * push * c.across;
            }
            let [e, rate, _] = forcing.errors[j];
            total.sum += c.push_norm * (stiffness * e.sum + damping * rate.sum);
            total.top += c.push_norm * (stiffness * e.top + damping * rate.top);
        }
        let largest = |r: &[f64]| r.iter().copied().fold(0.0, f64::max);
        let mut norms = [largest(&by_q), largest(&by_v)];
        let free = [norms[0], norms[1], total.top];
        let mut projection = 1.0;
        if let Some(held) = held {
            projection = 1.0 + project_norms(s, held, |k, norm| norm * s.contacts[k].across);
            norms = norms.map(|n| n * projection);
            total.sum = total.sum * projection + project_norms(s, held, |k, norm| norm * forcing.errors[k][2].sum);
            total.top = total.top * projection + project_norms(s, held, |k, norm| norm * forcing.errors[k][2].top);
        }
        Self { norms, forcing: total, free, projection, swing }
    }
}

impl Growth {
    /// Returns Ω, 1/s.
    pub fn frequency(&self) -> f64 {
        self.norms[0].sqrt()
    }

    /// Returns L, 1/s.
    pub fn rate(&self) -> f64 {
        self.frequency() + self.norms[1]
    }
}

/// Sums `term` over the contacts at rest. `norm` is the weighted acceleration by the multipliers for a unit of
/// the free acceleration of contact `k`, `max_i Σ_j √M_ii |M⁻¹g_j|_i |W⁻¹|_jk`.
fn project_norms(s: &Structure, held: &Sticking, term: impl Fn(usize, f64) -> f64) -> f64 {
    let contacts = held.contacts();
    (0..contacts.len())
        .map(|k| {
            let column = held.inverse_column(k);
            let norm = contacts.iter().zip(&column).map(|(&j, w)| s.contacts[j].push_norm * w.abs()).sum();
            term(contacts[k], norm)
        })
        .sum()
}
