//! Form of a mode for its recurrences: blocks of four degrees of freedom, and contacts by fours, as columns.
#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler vectorises

use std::{borrow::Cow, cell::RefCell, rc::Rc};

use super::motion::ContactInMode;
use crate::{
    kernel::{Four, LANES},
    system::{Block, Elasticity, FourColumns, Structure, VectorColumns},
    vectors::Path,
};

/// Columns of several fours each, and the index of the factor of each.
#[derive(Debug, Default)]
struct Columns {
    of: Vec<usize>,
    fours: Vec<Four>,
}

impl Columns {
    /// Adds the columns of index `of`, if any of them is not zero.
    fn add(&mut self, of: usize, columns: impl IntoIterator<Item = Four>) {
        let first = self.fours.len();
        self.fours.extend(columns);
        if self.fours[first..].as_flattened().iter().all(|x| *x == 0.0) {
            self.fours.truncate(first);
        } else {
            self.of.push(of);
        }
    }

    /// Returns the indices, and for each its M columns of N fours.
    #[inline(always)]
    fn list<const N: usize, const M: usize>(&self) -> (&[usize], &[[[Four; N]; M]]) {
        let columns = self.fours.as_chunks::<N>().0.as_chunks::<M>().0;
        debug_assert_eq!(columns.len(), self.of.len());
        (&self.of, columns)
    }
}

/// Form of a mode for its recurrences: blocks of four degrees of freedom, and contacts by fours.
///
/// `q̈ = A_q q + A_v q̇ + f − Σ push F`, `δ̇ = direction · q̇ − ė`, `F = stiffness · (δ − σ b) + damping · δ̇`.
#[derive(Debug)]
pub struct Compiled {
    /// Degrees of freedom, in panels of equal size.
    pub blocks: Box<[Blocks]>,
    /// Number of blocks in a panel, for which a recurrence is compiled. Blocks beyond the last degree of freedom are zero.
    pub together: usize,
    /// Contacts: in a linear mode as many fours together as its recurrence is compiled for, else single fours.
    pub groups: Box<[Group]>,
}

/// Panel of blocks of degrees of freedom.
#[derive(Debug)]
pub struct Blocks {
    /// Diagonals of A_q and A_v.
    by_q: Box<[Four]>,
    by_v: Box<[Four]>,
    load: Box<[Four]>,
    /// Columns of A_q, then of A_v, off the diagonal, by degree of freedom.
    couplings: Columns,
    /// Cosine parts, then sine parts of the load, by oscillator.
    waves: Columns,
    /// Columns `−M⁻¹ g`, by contact whose force is formed at each order. A linear mode adds forces of varying stiffness separately.
    pushes: Columns,
}

/// View of B blocks, read at every order.
pub struct BlockRows<'a, const B: usize> {
    by_q: &'a [Four; B],
    by_v: &'a [Four; B],
    load: &'a [Four; B],
    couplings: (&'a [usize], &'a [[[Four; B]; 2]]),
    waves: (&'a [usize], &'a [[[Four; B]; 2]]),
    pushes: (&'a [usize], &'a [[[Four; B]; 1]]),
}

impl Blocks {
    /// Forms the panel of `blocks`, with the forces of the contacts for which `pushes` is true.
    fn new(s: &Structure, blocks: &[Block], pushes: impl Fn(usize) -> bool) -> Self {
        let mut all = Self {
            by_q: blocks.iter().map(|b| b.by_q).collect(),
            by_v: blocks.iter().map(|b| b.by_v).collect(),
            load: blocks.iter().map(|b| b.load).collect(),
            couplings: Columns::default(),
            waves: Columns::default(),
            pushes: Columns::default(),
        };
        for i in 0..s.n {
            let parts = [0, 1].map(|part| blocks.iter().map(move |b| find(&b.couplings, i)[part]));
            all.couplings.add(i, parts.into_iter().flatten());
        }
        // Several loads may belong to one oscillator.
        for (load, wave) in s.load_waves.iter().enumerate() {
            let of = |b: &Block| b.waves.get(load).map_or([[0.0; LANES]; 2], |(_, cosine, sine)| [*cosine, *sine]);
            let parts = [0, 1].map(|part| blocks.iter().map(move |b| of(b)[part]));
            all.waves.add(wave.index, parts.into_iter().flatten());
        }
        for j in (0..s.contacts.len()).filter(|j| pushes(*j)) {
            let push =
                |b: &Block| b.pushes.iter().find(|(of, _)| *of == j).map_or([0.0; LANES], |(_, p)| p.map(|p| -p));
            all.pushes.add(j, blocks.iter().map(push));
        }
        all
    }

    #[inline(always)]
    pub fn rows<const B: usize>(&self) -> Option<BlockRows<'_, B>> {
        let [by_q, by_v, load] = [&self.by_q, &self.by_v, &self.load].map(|fours| fours.first_chunk::<B>());
        Some(BlockRows {
            by_q: by_q?,
            by_v: by_v?,
            load: load?,
            couplings: self.couplings.list(),
            waves: self.waves.list(),
            pushes: self.pushes.list(),
        })
    }
}

impl<const B: usize> BlockRows<'_, B> {
    /// Returns the accelerations at order `k` by displacements and velocities, those of the blocks `own`, by oscillators and by forces.
    #[inline(always)]
    pub fn at<P: Path>(
        &self,
        path: P,
        k: usize,
        ([q, v], [own_q, own_v]): ([&[f64]; 2], [&[Four; B]; 2]),
        waves: impl Fn(usize) -> [f64; 2],
        forces: &[f64],
    ) -> [P::Four; B] {
        // Two sums, because each addition waits for the one before.
        let mut a = [path.all(0.0); B];
        let mut by_displacements = a;
        if k == 0 {
            a = self.load.map(|four| path.four(four));
        }
        for (i, [by_q, by_v]) in self.couplings.0.iter().zip(self.couplings.1) {
            let (q, v) = (path.all(q[*i]), path.all(v[*i]));
            for b in 0..B {
                a[b] = path.fused(path.four(by_v[b]), v, a[b]);
                by_displacements[b] = path.fused(path.four(by_q[b]), q, by_displacements[b]);
            }
        }
        for (i, [by_cos, by_sin]) in self.waves.0.iter().zip(self.waves.1) {
            let [cos, sin] = waves(*i);
            let (cos, sin) = (path.all(cos), path.all(sin));
            for b in 0..B {
                a[b] = path.fused(path.four(by_sin[b]), sin, a[b]);
                by_displacements[b] = path.fused(path.four(by_cos[b]), cos, by_displacements[b]);
            }
        }
        for b in 0..B {
            a[b] = path.fused(path.four(self.by_v[b]), path.four(own_v[b]), a[b]);
            by_displacements[b] = path.fused(path.four(self.by_q[b]), path.four(own_q[b]), by_displacements[b]);
            a[b] = path.plus(a[b], by_displacements[b]);
        }
        for (j, [push]) in self.pushes.0.iter().zip(self.pushes.1) {
            let force = path.all(forces[*j]);
            for b in 0..B {
                a[b] = path.fused(path.four(push[b]), force, a[b]);
            }
        }
        a
    }
}

/// Group of several fours of contacts.
#[derive(Debug)]
pub struct Group {
    /// Numbers of panels: the first, and those in which some direction is not zero.
    panels: Vec<usize>,
    /// Contribution of the velocity of each degree of freedom of these panels to the rates.
    directions: Vec<Four>,
    /// True if some bodies are equal: then the sums of a rate have one order.
    is_symmetric: bool,
    /// Contributions of the cosine and of the sine of each oscillator.
    waves: Columns,
    /// Stiffness and damping; zero if no force is carried, or if the stiffness varies.
    laws: Vec<[Four; 2]>,
    /// True if any of these laws is not zero.
    carries: bool,
}

impl Group {
    /// Forms the group of the contacts `fours`, from index `first`, on panels of `together` blocks; `law` gives stiffness and damping.
    fn new(
        s: &Structure,
        together: usize,
        (first, fours): (usize, &[FourColumns]),
        law: impl Fn(usize) -> Option<[f64; 2]>,
    ) -> Self {
        let contacts = LANES * first..LANES * (first + fours.len());
        let laws =
            |c: usize| [0, 1].map(|part| std::array::from_fn(|l| law(LANES * c + l).map_or(0.0, |law| law[part])));
        let direction =
            |i: usize| fours.iter().map(move |four| four.directions.get(i).copied().unwrap_or([0.0; LANES]));
        let (mut panels, mut directions) = (Vec::new(), Vec::new());
        for first in (0..s.n).step_by(LANES * together) {
            let of_panel: Vec<Four> = (first..first + LANES * together).flat_map(direction).collect();
            if first == 0 || of_panel.as_flattened().iter().any(|x| *x != 0.0) {
                panels.push(first / (LANES * together));
                directions.extend(of_panel);
            }
        }
        let mut waves = Columns::default();
        for i in 0..s.oscillators.len() {
            let parts = [0, 1].map(|part| fours.iter().map(move |four| find(&four.rates, i)[part].map(|x| -x)));
            waves.add(i, parts.into_iter().flatten());
        }
        Self {
            panels,
            directions,
            is_symmetric: !s.symmetry.is_empty(),
            waves,
            laws: (first..first + fours.len()).map(laws).collect(),
            carries: contacts.clone().any(|j| law(j).is_some()),
        }
    }

    #[inline(always)]
    pub fn view<const B: usize, const C: usize>(&self) -> View<'_, B, C> {
        View {
            panels: &self.panels,
            directions: self.directions.as_chunks().0.as_chunks().0.as_chunks().0,
            is_symmetric: self.is_symmetric,
            waves: self.waves.list(),
            laws: self.laws.first_chunk().filter(|_| self.carries),
        }
    }
}

/// View of a group of C fours, read at every order.
pub struct View<'a, const B: usize, const C: usize> {
    /// Indices of panels of B blocks.
    pub panels: &'a [usize],
    /// Columns of these panels.
    pub directions: &'a [[[[Four; C]; LANES]; B]],
    is_symmetric: bool,
    pub waves: (&'a [usize], &'a [[[Four; C]; 2]]),
    /// Stiffness and damping, if any law of the group is not zero.
    pub laws: Option<&'a [[Four; 2]; C]>,
}

impl<const B: usize, const C: usize> View<'_, B, C> {
    /// Returns the rates of a linear mode at order `k`, from velocities and oscillators.
    #[inline(always)]
    pub fn rates<P: Path, const N: usize>(
        &self,
        path: P,
        k: usize,
        v: &[Four; B],
        waves: &[[[f64; 2]; N]],
    ) -> [P::Four; C] {
        let mut rates = [path.all(0.0); C];
        // Oscillators come first, because the velocities are available late.
        for (i, [by_cos, by_sin]) in self.waves.0.iter().zip(self.waves.1) {
            let [cos, sin] = waves[*i][k].map(|x| path.all(x));
            for c in 0..C {
                rates[c] = path.fused(path.four(by_cos[c]), cos, rates[c]);
                rates[c] = path.fused(path.four(by_sin[c]), sin, rates[c]);
            }
        }
        let [directions] = self.directions else { unreachable!("not one panel") };
        if self.is_symmetric {
            // The order is fixed, so that contacts of equal bodies have equal rounding, whatever the index of the body.
            for (columns, v) in directions.as_flattened().iter().zip(v.as_flattened()) {
                for c in 0..C {
                    rates[c] = path.fused(path.four(columns[c]), path.all(*v), rates[c]);
                }
            }
            return rates;
        }
        // Four sums, because each addition waits for the one before.
        let zeros = [path.all(0.0); C];
        let mut sums = [rates, zeros, zeros, zeros];
        for b in 0..B {
            for l in 0..LANES {
                let v = path.all(v[b][l]);
                for c in 0..C {
                    sums[l][c] = path.fused(path.four(directions[b][l][c]), v, sums[l][c]);
                }
            }
        }
        for c in 0..C {
            let [first, second, third, fourth] = [sums[0][c], sums[1][c], sums[2][c], sums[3][c]];
            rates[c] = path.plus(path.plus(first, second), path.plus(third, fourth));
        }
        rates
    }

    /// Writes the forces of one order if any law of the group carries force.
    ///
    /// A deflection is the integral of its rate, `(k + 1) δ_{k+1} = h δ̇_k`, and is formed before it is multiplied by the stiffness:
    /// if the train has turned far, a difference of displacements is exact and one of forces is not.
    #[inline(always)]
    pub fn forces<P: Path>(&self, path: P, rates: &[P::Four; C], stretches: &[Four; C], forces: &mut [Four; C]) {
        let Some(laws) = self.laws else { return };
        for c in 0..C {
            let spring = path.times(path.four(laws[c][0]), path.four(stretches[c]));
            forces[c] = path.numbers(path.fused(path.four(laws[c][1]), rates[c], spring));
        }
    }
}

/// Returns the two columns of index `i`.
fn find(list: &[(usize, Four, Four)], i: usize) -> [Four; 2] {
    list.iter().find(|(of, ..)| *of == i).map_or([[0.0; LANES]; 2], |(_, a, b)| [*a, *b])
}

thread_local! {
    /// Data that all modes share that are not linear, with the columns from which they are formed: a large train has many modes.
    static SHARED: RefCell<Option<(VectorColumns, Rc<Compiled>)>> = const { RefCell::new(None) };
}

impl Compiled {
    /// Returns the compiled form of a mode.
    pub fn of(s: &Structure, parts: &[ContactInMode], is_linear: bool) -> Rc<Self> {
        if is_linear {
            return Rc::new(Self::new(s, parts, true));
        }
        SHARED.with_borrow_mut(|shared| match shared {
            Some((columns, compiled)) if *columns == s.columns => Rc::clone(compiled),
            _ => {
                let compiled = Rc::new(Self::new(s, &[], false));
                *shared = Some((s.columns.clone(), Rc::clone(&compiled)));
                compiled
            }
        })
    }

    fn new(s: &Structure, parts: &[ContactInMode], is_linear: bool) -> Self {
        let fours = &s.columns.fours;
        let law = |j: usize| match parts.get(j).and_then(ContactInMode::carried_linear) {
            Some((Elasticity::Constant(k), damping)) => Some([k, damping]),
            _ => None,
        };
        let mut blocks: Cow<'_, [Block]> = Cow::Borrowed(&s.columns.blocks);
        let together = if blocks.len() <= MOST_BLOCKS { blocks.len() } else { SPARSE };
        if !blocks.len().is_multiple_of(together) {
            let whole = blocks.len().next_multiple_of(together);
            blocks.to_mut().resize_with(whole, Block::default);
        }
        let of_blocks =
            blocks.chunks(together).map(|blocks| Blocks::new(s, blocks, |j| !is_linear || law(j).is_some()));
        let size = if is_linear { group_size(fours.len()) } else { 1 };
        let groups = fours.chunks(size).enumerate();
        Self {
            blocks: of_blocks.collect(),
            together,
            groups: groups.map(|(group, fours)| Group::new(s, together, (group * size, fours), law)).collect(),
        }
    }
}

/// Maximum number of fours of contacts for which the recurrence is compiled as one group.
pub const MOST_GROUPED: usize = 3;

/// Returns the number of fours in a group: all of them, or one.
pub fn group_size(fours: usize) -> usize {
    if fours <= MOST_GROUPED { fours.max(1) } else { 1 }
}

/// Maximum number of blocks of four degrees of freedom for which the recurrences are compiled.
pub const MOST_BLOCKS: usize = 6;
/// Blocks in a panel of larger trains: each body depends on few others, and columns that are zero on a panel are left out.
const SPARSE: usize = 2;
/// Number of degrees of freedom up to which linear modes have a recurrence of their own.
pub const LARGEST: usize = LANES * MOST_BLOCKS;
