//! Sizes of the terms that guards and rates are summed from, taken from the outside: rounding is a few units of them.

use std::collections::BTreeMap;

use crate::{
    engine::State,
    hybrid::{Flow, Guard, HybridSystem, Instant, Mode, VectorField},
};

/// What a mode is made of.
#[derive(Clone, Debug, Default)]
pub(super) struct Terms {
    pub guards: Vec<Guard>,
    /// `|∂g/∂x_i|` of each guard, `[guards · dim]`.
    gradients: Vec<f64>,
    /// `|∂f_i/∂x_k|`, `[dim · dim]`.
    jacobian: Vec<f64>,
}

impl Terms {
    /// Size of the terms of guard `g` at `x`, where `x` moves with rate `f` for a time `h`.
    pub fn size(&self, g: usize, x: &[f64], f: &[f64], h: f64) -> f64 {
        let gradient = &self.gradients[g * x.len()..(g + 1) * x.len()];
        gradient.iter().zip(x.iter().zip(f)).map(|(d, (x, f))| d * (x.abs() + h * f.abs())).sum()
    }

    /// What an error of each coordinate does to the guards within a time `h`, relative to their `sizes`:
    /// `Σ_g |∂g/∂x| exp(h|J|)/size`, by the first terms of the exponential.
    fn weigh(&self, sizes: &[f64], h: f64, weights: &mut [f64]) {
        let dim = weights.len();
        let mut term = vec![0.0; dim];
        for (gradient, size) in self.gradients.chunks_exact(dim).zip(sizes).filter(|(_, size)| **size > 0.0) {
            term.iter_mut().zip(gradient).for_each(|(t, d)| *t += d / size);
        }
        weights.copy_from_slice(&term);
        for k in 1..=COUPLINGS {
            let mut next = vec![0.0; dim];
            for (row, t) in self.jacobian.chunks_exact(dim).zip(&term) {
                next.iter_mut().zip(row).for_each(|(n, j)| *n += t * j * h / k as f64);
            }
            weights.iter_mut().zip(&next).for_each(|(w, n)| *w += n);
            term = next;
        }
    }
}

/// Terms of the exponential: couplings from a coordinate to a guard that are seen.
const COUPLINGS: usize = 6;

/// Sizes of errors of the state, by what they do to the guards: a coordinate that is zero by symmetry has no size of its own.
#[derive(Debug)]
pub(super) struct Norm<'a> {
    pub terms: &'a Terms,
    /// Largest terms of each guard so far.
    pub sizes: Vec<f64>,
    weights: Vec<f64>,
}

impl<'a> Norm<'a> {
    pub fn new(terms: &'a Terms, dim: usize) -> Self {
        Self { terms, sizes: vec![0.0; terms.guards.len()], weights: vec![0.0; dim] }
    }

    /// Sizes with a step of length `h` between two states and their rates; sets the weights for it.
    pub fn with_step(&mut self, ends: [(&[f64], &[f64]); 2], h: f64) -> Vec<f64> {
        let size = |(g, size): (usize, &f64)| ends.iter().fold(*size, |m, (x, f)| m.max(self.terms.size(g, x, f, h)));
        let sizes: Vec<f64> = self.sizes.iter().enumerate().map(size).collect();
        self.terms.weigh(&sizes, h, &mut self.weights);
        sizes
    }

    /// The size of error `e_i`, relative to the guards.
    pub fn of(&self, error: impl Fn(usize) -> f64) -> f64 {
        self.weights.iter().enumerate().map(|(i, w)| w * error(i).abs()).sum()
    }
}

/// The field of a system, by values alone.
pub(super) fn field(system: &dyn HybridSystem) -> &dyn VectorField {
    match system.flow() {
        Flow::Jet(_, field) | Flow::Smooth(field) => field,
    }
}

/// Terms of the modes met so far. Where stiffness varies they are those of the first visit: a scale, not a bound.
#[derive(Debug, Default)]
pub(super) struct Sizes {
    modes: BTreeMap<Mode, Terms>,
}

/// Modes kept.
const MODES: usize = 1024;
/// Relative change of a coordinate in a difference quotient, and one for coordinates that are zero and stay so.
const CHANGE: f64 = 1e-3;
const SMALLEST: f64 = 1e-9;

impl Sizes {
    /// The terms of the mode of `state`; `unit` is a time, s, over which its coordinates change.
    pub fn of(&mut self, system: &dyn HybridSystem, state: &State, unit: f64) -> &Terms {
        if self.modes.len() >= MODES && !self.modes.contains_key(&state.jump.mode) {
            self.modes.clear();
        }
        self.modes.entry(state.jump.mode).or_insert_with(|| terms(system, state.jump.mode, state.at, &state.x, unit))
    }
}

fn terms(system: &dyn HybridSystem, mode: Mode, at: Instant, x: &[f64], unit: f64) -> Terms {
    let (dim, field) = (x.len(), field(system));
    let mut guards = Vec::new();
    system.guards(mode, &mut guards);
    let (mut rate, mut column, mut direction) = (vec![0.0; dim], vec![0.0; dim], vec![0.0; dim]);
    field.eval(mode, at, 0.0, x, &mut rate);
    let mut moved = x.to_vec();
    let mut terms = Terms { gradients: vec![0.0; guards.len() * dim], jacobian: vec![0.0; dim * dim], guards };
    for i in 0..dim {
        direction[i] = 1.0;
        field.jac_mul(mode, at, 0.0, x, &direction, &mut column);
        direction[i] = 0.0;
        column.iter().enumerate().for_each(|(k, c)| terms.jacobian[k * dim + i] = c.abs());
        let change = CHANGE * (x[i].abs() + unit * rate[i].abs());
        moved[i] += if change > 0.0 { change } else { SMALLEST };
        for (g, guard) in terms.guards.iter().enumerate() {
            let difference = system.guard(mode, guard.id, at, &moved) - system.guard(mode, guard.id, at, x);
            terms.gradients[g * dim + i] = (difference / (moved[i] - x[i])).abs();
        }
        moved[i] = x[i];
    }
    terms
}
