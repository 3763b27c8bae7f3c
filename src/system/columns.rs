//! A structure in columns of four, for the recurrences.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::assemble::{Contact, LoadWave, Wave};

/// A structure laid out for vector instructions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct VectorColumns {
    /// The contacts, four at a time.
    pub fours: Vec<FourColumns>,
    /// The degrees of freedom, four at a time.
    pub blocks: Vec<Block>,
}

/// Couplings, loads and contacts of four degrees of freedom; zero beyond the last one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Block {
    /// Diagonals of `−M⁻¹K` and `−M⁻¹C`.
    pub by_q: [f64; 4],
    pub by_v: [f64; 4],
    /// Columns of their entries off the diagonal: degree of freedom, by q, by v.
    pub couplings: Vec<(usize, [f64; 4], [f64; 4])>,
    /// `M⁻¹ f₀`.
    pub load: [f64; 4],
    /// Harmonic loads over M: oscillator, cosine and sine parts.
    pub waves: Vec<(usize, [f64; 4], [f64; 4])>,
    /// `M⁻¹ g` of the contacts that move them.
    pub pushes: Vec<(usize, [f64; 4])>,
    /// `√M_ii`.
    pub weights: [f64; 4],
}

/// Four contacts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FourColumns {
    /// `n` rows of direction components.
    pub directions: Vec<[f64; 4]>,
    /// [`Contact::weight`] of each.
    pub weights: [f64; 4],
    /// Sizes of the gap and of the error of each contact, m.
    pub sizes: [[f64; 4]; 2],
    /// Constant part of the error of each contact, m.
    pub offsets: [f64; 4],
    /// Errors: oscillator, cosine and sine parts.
    pub errors: Vec<(usize, [f64; 4], [f64; 4])>,
    /// Rates of the errors: oscillator, cosine and sine parts.
    pub rates: Vec<(usize, [f64; 4], [f64; 4])>,
}

impl VectorColumns {
    pub fn new(k: &DMatrix<f64>, c: &DMatrix<f64>, contacts: &[Contact], loads: Loads<'_>) -> Self {
        let n = k.nrows();
        Self {
            fours: contacts.chunks(4).map(|four| FourColumns::new(four, n)).collect(),
            blocks: (0..n).step_by(4).map(|first| Block::new(first, (k, c), contacts, loads)).collect(),
        }
    }
}

/// `M⁻¹ f₀`, the harmonic loads and `√M_ii`.
type Loads<'a> = (&'a [f64], &'a [LoadWave], &'a [f64]);

impl Block {
    fn new(
        first: usize,
        (k, c): (&DMatrix<f64>, &DMatrix<f64>),
        contacts: &[Contact],
        (load, waves, weights): Loads<'_>,
    ) -> Self {
        let n = k.nrows();
        // No −0: columns with equal values then have equal bits.
        let four = |f: &dyn Fn(usize) -> f64| -> [f64; 4] {
            std::array::from_fn(|l| if first + l < n { f(first + l) + 0.0 } else { 0.0 })
        };
        let is_any = |four: &[f64; 4]| four.iter().any(|x| *x != 0.0);
        let off = |m: &DMatrix<f64>, j: usize| four(&|i| if i == j { 0.0 } else { -m[(i, j)] });
        let coupling = |j: usize| (j, off(k, j), off(c, j));
        let push = |j: usize| {
            let entry = |i: usize| contacts[j].push.iter().find(|(at, _)| *at as usize == i).map_or(0.0, |(_, p)| *p);
            (j, four(&entry))
        };
        Self {
            by_q: four(&|i| -k[(i, i)]),
            by_v: four(&|i| -c[(i, i)]),
            couplings: (0..n).map(coupling).filter(|(_, k, c)| is_any(k) || is_any(c)).collect(),
            load: four(&|i| load[i]),
            waves: waves.iter().map(|w| (w.index, four(&|i| w.cosine[i]), four(&|i| w.sine[i]))).collect(),
            pushes: (0..contacts.len()).map(push).filter(|(_, push)| is_any(push)).collect(),
            weights: four(&|i| weights[i]),
        }
    }
}

impl FourColumns {
    fn new(four: &[Contact], n: usize) -> Self {
        let part = |f: &dyn Fn(&Contact) -> f64| std::array::from_fn(|l| four.get(l).map_or(0.0, f) + 0.0);
        let waves = |of: fn(&Contact) -> &[Wave]| -> Vec<_> {
            let mut waves: BTreeMap<usize, [[f64; 4]; 2]> = BTreeMap::new();
            for (l, w) in four.iter().enumerate().flat_map(|(l, c)| of(c).iter().map(move |w| (l, w))) {
                let [cosine, sine] = waves.entry(w.index).or_default();
                cosine[l] += w.cosine;
                sine[l] += w.sine;
            }
            waves.into_iter().map(|(o, [cosine, sine])| (o, cosine, sine)).collect()
        };
        Self {
            directions: (0..n).map(|i| part(&|c| c.spec.direction[i])).collect(),
            weights: part(&|c| c.weight),
            sizes: [part(&|c| c.gap().abs()), part(&|c| c.error_sizes[0])],
            offsets: part(&|c| c.spec.error_offset),
            errors: waves(|c| &c.error),
            rates: waves(|c| &c.error_rate),
        }
    }
}
