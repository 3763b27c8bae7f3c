//! Linear modes in plain time: the fast path.
//!
//! With every closed law linear, the mode is `q̈ = A_q q + A_v q̇ + f(t)` up to the contacts whose stiffness
//! is itself a series. The forces of closed contacts are formed from their deflections, and the recurrence runs on
//! blocks of four degrees of freedom and of four contacts, which the compiler turns into vector instructions.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use smallvec::{SmallVec, smallvec};

use super::{Expansion, FORCE, LANES, Layout, ORDER, PENETRATION, ROW, STIFFNESS, motion::Part, product, waves};
use crate::{
    hybrid::Jet,
    system::{Block, Elasticity, Force, FourColumns, Spring, Structure, Watch},
    vectors::{Path, Work},
};

/// Four numbers in memory.
type Four = [f64; LANES];

/// Columns of several fours each, and the number of what each is multiplied by.
#[derive(Debug, Default)]
struct Columns {
    of: Vec<usize>,
    fours: Vec<Four>,
}

impl Columns {
    /// With the columns of a number, if any of them is not zero.
    fn add(&mut self, of: usize, columns: impl IntoIterator<Item = Four>) {
        let first = self.fours.len();
        self.fours.extend(columns);
        if self.fours[first..].as_flattened().iter().all(|x| *x == 0.0) {
            self.fours.truncate(first);
        } else {
            self.of.push(of);
        }
    }

    /// The numbers, and the columns of each: as many as M, of N fours.
    #[inline(always)]
    fn list<const N: usize, const M: usize>(&self) -> (&[usize], &[[[Four; N]; M]]) {
        let columns = self.fours.as_chunks::<N>().0.as_chunks::<M>().0;
        let count = columns.len().min(self.of.len());
        (&self.of[..count], &columns[..count])
    }
}

/// A linear mode as its recurrence reads it: blocks of four degrees of freedom, and contacts four at a time.
///
/// `q̈ = A_q q + A_v q̇ + f − Σ push F`, `δ̇ = direction · q̇ − ė`, `F = stiffness · (δ − σ b) + damping · δ̇`.
#[derive(Debug)]
pub(super) struct Compiled {
    /// Diagonals of A_q and A_v.
    by_q: Box<[Four]>,
    by_v: Box<[Four]>,
    load: Box<[Four]>,
    /// By degree of freedom: columns of A_q, then of A_v, off the diagonal.
    couplings: Columns,
    /// By oscillator: cosine parts, then sine parts of the load.
    waves: Columns,
    /// By contact that carries force by a constant stiffness: `−M⁻¹ g`.
    pushes: Columns,
    groups: Box<[Group]>,
}

/// Several fours of contacts of a linear mode.
#[derive(Debug)]
struct Group {
    /// What the velocity of each degree of freedom adds to the rates.
    directions: Vec<Four>,
    /// By oscillator: what its cosine adds, then its sine.
    waves: Columns,
    /// Stiffness and damping; zero where no force is carried, or by a stiffness that varies.
    laws: Vec<[Four; 2]>,
    /// Any of them is not zero.
    carries: bool,
}

impl Group {
    /// The contacts `fours`, which start with four number `first`; `law` gives the stiffness and damping of a contact.
    fn new(s: &Structure, first: usize, fours: &[FourColumns], law: impl Fn(usize) -> Option<[f64; 2]>) -> Self {
        let contacts = LANES * first..LANES * (first + fours.len());
        let laws =
            |c: usize| [0, 1].map(|part| std::array::from_fn(|l| law(LANES * c + l).map_or(0.0, |law| law[part])));
        let direction = |i: usize| fours.iter().map(move |four| four.directions[i]);
        let mut waves = Columns::default();
        for i in 0..s.oscillators.len() {
            let parts = [0, 1].map(|part| fours.iter().map(move |four| find(&four.rates, i)[part].map(|x| -x)));
            waves.add(i, parts.into_iter().flatten());
        }
        Self {
            directions: (0..s.n).flat_map(direction).collect(),
            waves,
            laws: (first..first + fours.len()).map(laws).collect(),
            carries: contacts.clone().any(|j| law(j).is_some()),
        }
    }
}

/// A group of C fours, as it is read at every order.
struct View<'a, const C: usize> {
    directions: &'a [[Four; C]],
    waves: (&'a [usize], &'a [[[Four; C]; 2]]),
    /// Where a force is carried.
    laws: Option<&'a [[Four; 2]; C]>,
}

/// The two columns of number `i`.
fn find(list: &[(usize, Four, Four)], i: usize) -> [Four; 2] {
    list.iter().find(|(of, ..)| *of == i).map_or([[0.0; LANES]; 2], |(_, a, b)| [*a, *b])
}

impl Compiled {
    pub fn new(s: &Structure, parts: &[Part]) -> Self {
        let (blocks, fours) = (&s.columns.blocks, &s.columns.fours);
        let law = |j: usize| match parts.get(j).and_then(Part::carried_linear) {
            Some((Elasticity::Constant(k), damping)) => Some([k, damping]),
            _ => None,
        };
        let size = group_size(fours.len());
        let groups = fours.chunks(size).enumerate();
        let mut compiled = Self {
            by_q: blocks.iter().map(|b| b.by_q).collect(),
            by_v: blocks.iter().map(|b| b.by_v).collect(),
            load: blocks.iter().map(|b| b.load).collect(),
            couplings: Columns::default(),
            waves: Columns::default(),
            pushes: Columns::default(),
            groups: groups.map(|(group, fours)| Group::new(s, group * size, fours, law)).collect(),
        };
        for i in 0..s.n {
            let parts = [0, 1].map(|part| blocks.iter().map(move |b| find(&b.couplings, i)[part]));
            compiled.couplings.add(i, parts.into_iter().flatten());
        }
        // Several loads may follow one oscillator.
        for (load, wave) in s.load_waves.iter().enumerate() {
            let [cosine, sine] = [|b: &Block, i: usize| b.waves[i].1, |b: &Block, i: usize| b.waves[i].2];
            let parts = [cosine, sine].map(|part| blocks.iter().map(move |b| part(b, load)));
            compiled.waves.add(wave.index, parts.into_iter().flatten());
        }
        for j in (0..s.contacts.len()).filter(|j| law(*j).is_some()) {
            let push =
                |b: &Block| b.pushes.iter().find(|(of, _)| *of == j).map_or([0.0; LANES], |(_, p)| p.map(|p| -p));
            compiled.pushes.add(j, blocks.iter().map(push));
        }
        compiled
    }
}

/// Most fours of contacts that the recurrence is compiled for as one group.
const MOST_FOURS: usize = 3;

/// Fours in a group: all of them, or one by one.
fn group_size(fours: usize) -> usize {
    if fours <= MOST_FOURS { fours.max(1) } else { 1 }
}

/// Blocks of four degrees of freedom of the largest structure that the fast path is compiled for.
const MOST_BLOCKS: usize = 6;
/// Degrees of freedom of it.
pub(super) const LARGEST: usize = LANES * MOST_BLOCKS;

/// The recurrence, compiled once for each set of instructions.
struct Recurrence<'a, 'b> {
    expansion: &'a Expansion<'b>,
    out: &'a mut Jet,
}

impl Work for Recurrence<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn on<P: Path>(self, path: P) {
        let Self { expansion: e, out } = self;
        macro_rules! sizes {
            ($($b:literal)*) => {
                match (e.s.columns.blocks.len(), group_size(e.s.columns.fours.len())) {
                    $(($b, 1) => e.recurrence::<P, $b, 1>(path, out),
                    ($b, 2) => e.recurrence::<P, $b, 2>(path, out),
                    ($b, MOST_FOURS) => e.recurrence::<P, $b, MOST_FOURS>(path, out),)*
                    sizes => unreachable!("blocks and fours {sizes:?}, more than {MOST_BLOCKS} and {MOST_FOURS}"),
                }
            };
        }
        sizes!(1 2 3 4 5 6);
    }
}

impl Expansion<'_> {
    /// All coefficients of a linear mode.
    pub(super) fn linear(&self, out: &mut Jet) {
        if self.motion.is_varying {
            self.ramps(&mut out.work);
        }
        self.s.instructions.run(Recurrence { expansion: self, out });
        if self.keeps_low() {
            let carried = self.motion.parts.iter().map(Part::carried_linear).enumerate();
            let constant = |(j, law)| match law {
                Some((Elasticity::Constant(k), _)) => Some((j, k)),
                _ => None,
            };
            self.low(carried.filter_map(constant).collect(), out);
        }
    }

    /// Writes the stiffnesses that rise along a ramp as series, in plain time.
    pub(super) fn ramps(&self, work: &mut [f64]) {
        for (j, part) in self.motion.parts.iter().enumerate() {
            if let Some(Force::Linear { stiffness: ramp @ Elasticity::Ramp { slope, .. }, .. }) = part.force() {
                let s = self.layout.of(j, STIFFNESS);
                work[s..s + ROW].fill(0.0);
                work[s] = self.s.stiffness_at(j, ramp, self.request.at).0;
                work[s + 1] = slope * self.h;
            }
        }
    }

    /// `k (δ − σ b)` of contact `j` at order `k`.
    pub(super) fn linear_spring(&self, j: usize, stiffness: Elasticity, k: usize, work: &mut [f64]) -> f64 {
        let stretch = self.stretch(j, k, work);
        if let Elasticity::Constant(stiffness) = stiffness {
            return stiffness * stretch;
        }
        let (s, p) = (self.layout.of(j, STIFFNESS), self.layout.of(j, PENETRATION));
        if let Spring::Waves(mean, stiffness) = &self.s.contacts[j].spring {
            work[s + k] = waves(if k == 0 { *mean } else { 0.0 }, stiffness, k, work);
        }
        work[p + k] = stretch;
        product(work, s, p, k)
    }

    /// Each order is a row: displacements and velocities in blocks of four, zero beyond the last degree of freedom, and the oscillators.
    /// Vectors are never read where single numbers have just been written: that would wait for them.
    #[inline(always)]
    fn recurrence<P: Path, const B: usize, const C: usize>(&self, path: P, out: &mut Jet) {
        let (s, h, n, layout) = (self.s, self.h, self.s.n, self.layout);
        out.time.clear();
        let varying = self.motion.is_varying;
        let compiled = &self.motion.compiled;
        let [Some(by_q), Some(by_v), Some(load)] =
            [&compiled.by_q, &compiled.by_v, &compiled.load].map(|fours| fours.first_chunk::<B>())
        else {
            return;
        };
        let mut forces: SmallVec<[Four; 4]> = smallvec![[0.0; LANES]; C * compiled.groups.len()];
        let forces = forces.as_mut_slice();
        let mut groups: SmallVec<[View<'_, C>; 1]> = SmallVec::new();
        for group in &compiled.groups {
            let laws = group.laws.first_chunk().filter(|_| group.carries);
            groups.push(View { directions: group.directions.as_chunks().0, waves: group.waves.list(), laws });
        }
        let (couplings, driven, pushes) =
            (compiled.couplings.list::<B, 2>(), compiled.waves.list::<B, 2>(), compiled.pushes.list::<B, 1>());
        let (work, orders) = out.work.split_at_mut(layout.orders);
        orders[..layout.stride].fill(0.0);
        orders[..n].copy_from_slice(&self.request.x[..n]);
        orders[LANES * B..][..n].copy_from_slice(&self.request.x[n..2 * n]);
        for i in 0..s.oscillators.len() {
            let o = Layout::oscillator(i);
            orders[2 * LANES * B + 2 * i..][..2].copy_from_slice(&[work[o], work[o + ROW]]);
        }
        let zero = path.all(0.0);
        for k in 0..ORDER {
            let step = h / (k + 1) as f64;
            let (row, next) = orders[k * layout.stride..(k + 2) * layout.stride].split_at_mut(layout.stride);
            let (flat_q, rest) = row.split_at(LANES * B);
            let (flat_v, waves) = rest.split_at(LANES * B);
            let [Some(q), Some(v)] = [flat_q, flat_v].map(|flat| flat.as_chunks::<LANES>().0.first_chunk::<B>()) else {
                return;
            };
            let waves = waves.as_chunks::<2>().0;
            self.contacts::<P, C>(path, (k, step), &groups, (&flat_v[..n], waves), forces, work);
            let mut a = if k == 0 { load.map(|four| path.four(four)) } else { [zero; B] };
            for (i, [by_q, by_v]) in couplings.0.iter().zip(couplings.1) {
                let (q, v) = (path.all(flat_q[*i]), path.all(flat_v[*i]));
                for b in 0..B {
                    a[b] = path.fused(path.four(by_v[b]), v, a[b]);
                    a[b] = path.fused(path.four(by_q[b]), q, a[b]);
                }
            }
            for (i, [by_cos, by_sin]) in driven.0.iter().zip(driven.1) {
                let [cos, sin] = waves[*i].map(|x| path.all(x));
                for b in 0..B {
                    a[b] = path.fused(path.four(by_sin[b]), sin, a[b]);
                    a[b] = path.fused(path.four(by_cos[b]), cos, a[b]);
                }
            }
            for b in 0..B {
                a[b] = path.fused(path.four(by_v[b]), path.four(v[b]), a[b]);
                a[b] = path.fused(path.four(by_q[b]), path.four(q[b]), a[b]);
            }
            for (j, [push]) in pushes.0.iter().zip(pushes.1) {
                let force = path.all(forces.as_flattened()[*j]);
                for b in 0..B {
                    a[b] = path.fused(path.four(push[b]), force, a[b]);
                }
            }
            if varying {
                let mut sums = a.map(|four| path.numbers(four));
                self.varying_forces(k, flat_v, sums.as_flattened_mut(), work);
                a = sums.map(|four| path.four(four));
            }
            let (next_q, rest) = next.split_at_mut(LANES * B);
            let (next_v, next_waves) = rest.split_at_mut(LANES * B);
            let by = path.all(step);
            for (next, v) in next_q.as_chunks_mut::<LANES>().0.iter_mut().zip(v) {
                *next = path.numbers(path.times(by, path.four(*v)));
            }
            for (next, a) in next_v.as_chunks_mut::<LANES>().0.iter_mut().zip(a) {
                *next = path.numbers(path.times(by, a));
            }
            let next_waves = next_waves.as_chunks_mut::<2>().0.iter_mut();
            for (i, ((next, wave), o)) in next_waves.zip(waves).zip(&s.oscillators).enumerate() {
                let f = step * o.omega;
                *next = [-f * wave[1], f * wave[0]];
                if varying {
                    let at = Layout::oscillator(i) + k + 1;
                    [work[at], work[at + ROW]] = *next;
                }
            }
        }
        self.watched_forces(work);
        if !self.is_bare {
            let rows = out.state.chunks_exact_mut(s.dim).zip(orders.chunks_exact(layout.stride)).skip(1);
            for (row, order) in rows {
                row[..n].copy_from_slice(&order[..n]);
                row[n..2 * n].copy_from_slice(&order[LANES * B..][..n]);
            }
        }
    }

    /// The contact forces at order `k`, and the deflections of the next order, four contacts at a time; of velocities and oscillators.
    ///
    /// A deflection is the integral of its rate, `(k + 1) δ_{k+1} = h δ̇_k`, and is formed before it is multiplied by the stiffness:
    /// where the train has turned far, a difference of displacements is exact and one of forces would not be.
    #[inline(always)]
    fn contacts<P: Path, const C: usize>(
        &self,
        path: P,
        (k, step): (usize, f64),
        groups: &[View<'_, C>],
        (v, waves): (&[f64], &[[f64; 2]]),
        forces: &mut [Four],
        work: &mut [f64],
    ) {
        let (deflections, starts) =
            work[self.layout.deflections..].split_at_mut(self.layout.stretches - self.layout.deflections);
        let deflections = deflections.as_chunks_mut::<LANES>().0.as_chunks_mut::<ROW>().0.as_chunks_mut::<C>().0;
        let starts = starts.as_chunks::<LANES>().0.as_chunks::<C>().0;
        let groups = groups.iter().zip(forces.as_chunks_mut::<C>().0);
        for (number, (((group, forces), deflections), starts)) in groups.zip(deflections).zip(starts).enumerate() {
            let mut rates = [path.all(0.0); C];
            // The oscillators first: the velocities come late.
            for (i, [by_cos, by_sin]) in group.waves.0.iter().zip(group.waves.1) {
                let [cos, sin] = waves[*i].map(|x| path.all(x));
                for c in 0..C {
                    rates[c] = path.fused(path.four(by_cos[c]), cos, rates[c]);
                    rates[c] = path.fused(path.four(by_sin[c]), sin, rates[c]);
                }
            }
            for (columns, v) in group.directions.iter().zip(v) {
                let v = path.all(*v);
                for c in 0..C {
                    rates[c] = path.fused(path.four(columns[c]), v, rates[c]);
                }
            }
            let first = C * number;
            if k == 0 && !self.request.still.is_empty() {
                for c in 0..C {
                    let moves: Four =
                        std::array::from_fn(|l| if self.is_still(LANES * (first + c) + l) { 0.0 } else { 1.0 });
                    rates[c] = path.times(path.four(moves), rates[c]);
                }
            }
            let by = path.all(step);
            for c in 0..C {
                deflections[c][k + 1] = path.numbers(path.times(by, rates[c]));
            }
            let Some(laws) = group.laws else { continue };
            for c in 0..C {
                let stretch = path.four(if k == 0 { starts[c] } else { deflections[c][k] });
                let spring = path.times(path.four(laws[c][0]), stretch);
                forces[c] = path.numbers(path.fused(path.four(laws[c][1]), rates[c], spring));
            }
            if k == 0 && !self.request.pinned.is_empty() {
                let forces = forces.as_flattened_mut().iter_mut().enumerate();
                let zero = forces.filter(|(l, _)| self.pinned(LANES * first + l, Watch::Force));
                zero.for_each(|(_, force)| *force = 0.0);
            }
        }
    }

    /// Adds the forces of contacts whose stiffness is a series, at order `k`.
    fn varying_forces(&self, k: usize, v: &[f64], a: &mut [f64], work: &mut [f64]) {
        for (j, part) in self.motion.parts.iter().enumerate() {
            let Some((stiffness, damping)) = part.carried_linear() else { continue };
            if stiffness.varies() {
                let force = self.linear_spring(j, stiffness, k, work) + damping * self.rate(j, k, v, work);
                self.s.contacts[j].push.iter().for_each(|(i, p)| a[*i as usize] -= p * force);
            }
        }
    }

    /// The forces where a force is watched.
    fn watched_forces(&self, work: &mut [f64]) {
        for &j in &self.motion.watched_forces {
            if let Some(Force::Linear { stiffness, damping }) = self.motion.parts[j].force() {
                self.watched_force(j, stiffness, damping, work);
            }
        }
    }

    /// `F = k (δ − σ b) + c δ̇` as a series, with `(δ̇)_k = (k+1) δ_{k+1}/h`.
    fn watched_force(&self, j: usize, stiffness: Elasticity, damping: f64, work: &mut [f64]) {
        let d = |k: usize| self.layout.deflection(j, k);
        for k in 0..=ORDER {
            let rate = if k < ORDER { work[d(k + 1)] * (k + 1) as f64 / self.h } else { 0.0 };
            work[self.layout.of(j, FORCE) + k] = self.linear_spring(j, stiffness, k, work) + damping * rate;
        }
    }
}
