//! The tangent of a run: columns that travel with the state.

use std::{collections::BTreeMap, ops::ControlFlow, sync::LazyLock};

use crate::{
    analysis::Rule,
    engine::{Jumped, Observer, State},
    hybrid::{HybridSystem, Instant, Mode, Shown},
    integrate::DenseStep,
    system::{By, Columns, ContactMode, Gradient, Sticking, Structure, Variation, contact_mode},
};

/// Highest power of the columns' series.
const ORDER: usize = 28;
/// Nodes of the collocation where `f_x` changes along a step.
const NODES: usize = 10;

/// Gauss–Legendre nodes on `[0, 1]`, weights, the matrix of integrals up to each node, and the weights of the highest Legendre coefficient
/// of what has the given values there.
struct Collocation {
    rule: Rule,
    matrix: Vec<[f64; NODES]>,
    last: [f64; NODES],
}

static COLLOCATION: LazyLock<Collocation> = LazyLock::new(|| {
    let rule = Rule::gauss(NODES);
    // Legendre polynomials on [0, 1] at x up to degree NODES.
    let legendre = |x: f64| {
        let (x, mut p) = (2.0 * x - 1.0, [1.0; NODES + 1]);
        p[1] = x;
        for k in 2..=NODES {
            let n = k as f64;
            p[k] = ((2.0 * n - 1.0) * x * p[k - 1] - (n - 1.0) * p[k - 2]) / n;
        }
        p
    };
    let at: Vec<[f64; NODES + 1]> = rule.nodes.iter().map(|x| legendre(*x)).collect();
    let integral = |i: usize, l: usize| match l {
        0 => rule.nodes[i],
        l => (at[i][l + 1] - at[i][l - 1]) / (2.0 * (2 * l + 1) as f64),
    };
    let entry =
        |i: usize, j: usize| (0..NODES).map(|l| (2 * l + 1) as f64 * rule.weights[j] * at[j][l] * integral(i, l)).sum();
    let matrix = (0..NODES).map(|i| std::array::from_fn(|j| entry(i, j))).collect();
    let last = std::array::from_fn(|j| (2 * NODES - 1) as f64 * rule.weights[j] * at[j][NODES - 1]);
    Collocation { rule, matrix, last }
});

/// Terms of an exponential: over a span on which rates reach [`SPAN`] the rest is below rounding.
const TERMS: usize = 60;
/// Rates times span above which a span is halved: the largest terms of its series are then some hundred times the sum.
const SPAN: f64 = 8.0;
/// The same of a collocation piece.
const PIECE: f64 = 1.5;
/// Picard iterations of a piece.
const SWEEPS: usize = 60;
/// Change in a sweep below which the iteration has converged: some ten roundings of a sum.
const CONVERGED: f64 = 1e-14;
/// Change below which an iteration that makes no more way has converged to the rounding of its terms.
const STALLED: f64 = 1e-9;
/// Largest share of the highest Legendre coefficient of a piece: the ends of pieces are exact to its square.
const RESOLVED: f64 = 1e-8;
/// Roundings of the rates that a difference of trains is formed from.
const ROUNDED: f64 = 64.0 * f64::EPSILON;
/// Halvings of a step.
const DEEPEST: u32 = 12;

/// What is known of a mode.
struct Known {
    /// `f_x`, where it is constant.
    gradient: Option<Gradient>,
    held: Option<Sticking>,
    /// A size of its rates without contacts that vary, rad/s.
    rate: f64,
}

/// Columns that are collocated.
struct Collocated {
    columns: Columns,
    /// Values and slopes at the nodes.
    nodes: Vec<[Columns; 2]>,
    sum: Columns,
}

impl Collocated {
    fn new(columns: Columns) -> Self {
        Self { nodes: vec![[columns.clone(), columns.clone()]; NODES], sum: columns.clone(), columns }
    }
}

/// The derivative of the state with respect to a start, and to numbers of the train, along a run that it watches.
pub struct Tangent<'s> {
    structure: &'s Structure,
    /// `∂x/∂(start)`, `[dim][count]`.
    pub columns: Columns,
    /// The numbers.
    variations: &'s [Variation],
    /// `∂x/∂α`, one column for each number.
    by_number: Collocated,
    /// The mode that the columns of numbers have come to.
    mode: Option<Mode>,
    /// `∫ div f dt + Σ ln |det|` of jumps so far; NaN where contacts rest or latch, which have no volume.
    pub volume: f64,
    /// Several dependent impacts fell on one instant: the map has corners there.
    pub is_piecewise: bool,
    /// A part of the motion could not be resolved: the columns must not be used.
    pub is_unresolved: bool,
    /// The latched speeds that were written anew.
    pub latched: Vec<bool>,
    /// Contacts rest.
    pub(super) rests: bool,
    /// The last jump took a rank.
    pub(super) dies: bool,
    /// The most ranks that contacts at rest have taken at one time.
    pub rested: usize,
    resets_only: bool,
    modes: BTreeMap<Mode, Known>,
    work: [Columns; 2],
    orders: Vec<Columns>,
    base: Vec<Columns>,
    along: Vec<[Vec<f64>; 2]>,
    collocated: Collocated,
    x: Vec<f64>,
}

impl<'s> Tangent<'s> {
    /// The tangent of all components of the state: `columns` is the unit matrix.
    #[must_use]
    pub fn new(structure: &'s Structure) -> Self {
        Self::of(structure, Columns::unit(HybridSystem::dim(structure)))
    }

    /// The tangent of some `columns`.
    #[must_use]
    pub fn of(structure: &'s Structure, columns: Columns) -> Self {
        Self {
            variations: &[],
            by_number: Collocated::new(Columns { count: 0, values: Vec::new() }),
            mode: None,
            work: [columns.clone(), columns.clone()],
            collocated: Collocated::new(columns.clone()),
            orders: Vec::new(),
            base: Vec::new(),
            along: Vec::new(),
            x: vec![0.0; HybridSystem::dim(structure)],
            latched: vec![false; HybridSystem::dim(structure) - 2 * structure.freedoms()],
            columns,
            structure,
            volume: 0.0,
            is_piecewise: false,
            is_unresolved: false,
            rests: false,
            dies: false,
            rested: 0,
            resets_only: false,
            modes: BTreeMap::new(),
        }
    }

    /// Carries the derivative with numbers of the train too, as `variations` have them.
    #[must_use]
    pub fn with(mut self, variations: &'s [Variation]) -> Self {
        let (count, dim) = (variations.len(), HybridSystem::dim(self.structure));
        self.by_number = Collocated::new(Columns { count, values: vec![0.0; count * dim] });
        Self { variations, ..self }
    }

    /// `∂x/∂α` of each number.
    #[must_use]
    pub fn by_number(&self) -> &Columns {
        &self.by_number.columns
    }

    /// Takes out of the columns what contacts at rest in the mode of `state`, where the run starts, do not allow.
    pub fn start(&mut self, state: &State) {
        let State { at, x, jump } = state;
        self.restrain(&jump.mode);
        if !self.variations.is_empty() {
            let by = By { variations: self.variations, at: *at, x };
            self.structure.restrain(&jump.mode, Some(by), &mut self.by_number.columns);
            self.mode = Some(jump.mode.clone());
        }
    }

    /// Takes out of the columns of a start what contacts at rest in `mode` do not allow.
    pub(super) fn restrain(&mut self, mode: &Mode) {
        self.rests = self.structure.held(mode).is_some();
        self.structure.restrain(mode, None, &mut self.columns);
    }

    /// Takes the columns of numbers over a known switching time at `at`, if the mode has changed since it was looked at.
    fn switch(&mut self, mode: &Mode, at: Instant, x: &[f64]) {
        let before = self.mode.replace(mode.clone());
        if let Some(before) = before.filter(|before| before != mode) {
            let by = By { variations: self.variations, at, x };
            self.structure.switch_columns((&before, mode), by, &mut self.by_number.columns);
        }
    }

    /// Forgets the latched speeds of contacts that are open in `mode`: nothing follows from them any more.
    pub(super) fn forget(&mut self, mode: &Mode) {
        let count = self.columns.count;
        for (j, c) in self.structure.contacts().iter().enumerate() {
            if let Some(latch) = c.latch().filter(|_| contact_mode(mode, j) == ContactMode::Separated) {
                self.columns.values[latch * count..(latch + 1) * count].fill(0.0);
            }
        }
    }

    /// Leaves out that neighbours meet an event earlier or later: what differentiating each reset alone gives.
    pub fn without_saltation(&mut self) {
        self.resets_only = true;
    }

    /// A size of the rates of `mode`, rad/s.
    pub(super) fn rate(&self, mode: &Mode) -> f64 {
        self.modes.get(mode).map_or(0.0, |known| known.rate)
    }

    fn known(&mut self, mode: &Mode) {
        if !self.modes.contains_key(mode) {
            let s = self.structure;
            let gradient = s.is_affine(mode).then(|| s.gradient(mode, s.clock().instant(0.0), &self.x));
            let held = s.held(mode);
            self.rested = self.rested.max(held.as_ref().map_or(0, |held| 2 * held.independent()));
            let known = Known { gradient, held, rate: s.rate_of(mode) };
            self.modes.insert(mode.clone(), known);
        }
    }

    /// A span of a mode whose `f_x` is constant: `exp(f_x h) ξ` by its series.
    fn exponential(&mut self, mode: &Mode, time: f64) {
        let Self { structure: s, columns, work: [term, next], modes, volume, .. } = self;
        let Some(Known { gradient: Some(gradient), held, rate }) = modes.get(mode) else { return };
        *volume += if held.is_some() { f64::NAN } else { s.divergence(gradient) * time };
        let parts = (rate * time / SPAN).ceil().max(1.0);
        let h = time / parts;
        for _ in 0..parts as u64 {
            term.values.copy_from_slice(&columns.values);
            let size = largest(s.freedoms(), columns);
            for k in 1..=TERMS {
                s.apply(gradient, held.as_ref(), term, next);
                let share = h / k as f64;
                next.values.iter_mut().for_each(|c| *c *= share);
                columns.values.iter_mut().zip(&next.values).for_each(|(c, t)| *c += t);
                std::mem::swap(term, next);
                if k as f64 > rate * h && is_small(term, &size, f64::EPSILON / 16.0) {
                    break;
                }
            }
        }
    }

    /// The columns of a start along a part of a step, by collocation.
    fn collocate_start(&mut self, mode: &Mode, step: &dyn DenseStep, part: [f64; 2]) {
        self.collocated.columns.values.copy_from_slice(&self.columns.values);
        self.collocate(mode, step, part, false, 0);
        self.columns.values.copy_from_slice(&self.collocated.columns.values);
    }

    /// A part of a step along which `f_x` changes, by collocation in the step's clock: the columns of a start, or those of numbers.
    fn collocate(&mut self, mode: &Mode, step: &dyn DenseStep, [from, to]: [f64; 2], of_numbers: bool, depth: u32) {
        let span = to - from;
        let Collocation { rule, matrix, last } = &*COLLOCATION;
        let Self { structure: s, by_number, collocated, x, modes, variations, volume, .. } = self;
        let Some(known) = modes.get(mode) else { return };
        let set = if of_numbers { by_number } else { collocated };
        let Collocated { columns, nodes, sum } = set;
        let clock = s.clock();
        let mut along = Vec::with_capacity(NODES);
        let (mut divergence, mut fastest) = (0.0, 0.0f64);
        for (node, weight) in rule.nodes.iter().zip(&rule.weights) {
            let theta = from + span * node;
            step.state(theta, x);
            let at = clock.advance(step.start(), step.time(theta));
            let (gradient, rate) = (s.gradient(mode, at, x), span * step.rate(theta));
            divergence += weight * rate * s.divergence(&gradient);
            fastest = fastest.max(rate * (known.rate + s.rate_by(&gradient)));
            along.push((gradient, rate, at));
        }
        let mut converged = fastest <= PIECE;
        if converged {
            // What numbers add, at the nodes.
            let (mut forcing, mut rounded): (Vec<Columns>, [f64; 2]) = (Vec::new(), [0.0; 2]);
            for (node, (_, rate, at)) in rule.nodes.iter().zip(&along).take(if of_numbers { NODES } else { 0 }) {
                step.state(from + span * node, x);
                let mut added = columns.clone();
                let [slopes, values] = s.forcing(mode, known.held.as_ref(), By { variations, at: *at, x }, &mut added);
                rounded =
                    std::array::from_fn(|i| rounded[i].max(rate * ROUNDED * slopes[i] + f64::EPSILON * values[i]));
                added.values.iter_mut().for_each(|c| *c *= rate);
                forcing.push(added);
            }
            for [value, _] in &mut *nodes {
                value.values.copy_from_slice(&columns.values);
            }
            converged = false;
            let mut before = f64::INFINITY;
            for _ in 0..SWEEPS {
                for (i, ([value, slope], (gradient, rate, _))) in nodes.iter_mut().zip(&along).enumerate() {
                    s.apply(gradient, known.held.as_ref(), value, slope);
                    slope.values.iter_mut().for_each(|c| *c *= rate);
                    let added = forcing.get(i).into_iter().flat_map(|added| &added.values);
                    slope.values.iter_mut().zip(added).for_each(|(c, a)| *c += a);
                }
                let mut moved = 0.0f64;
                for i in 0..NODES {
                    sum.values.copy_from_slice(&columns.values);
                    for (weight, [_, slope]) in matrix[i].iter().zip(&*nodes) {
                        sum.values.iter_mut().zip(&slope.values).for_each(|(s, f)| *s += weight * f);
                    }
                    let [value, _] = &mut nodes[i];
                    let size = largest(s.freedoms(), sum);
                    moved = moved.max(difference(value, sum, &size));
                    value.values.copy_from_slice(&sum.values);
                }
                // Where terms far larger than a component cancel in it, their rounding ends the iteration.
                if moved <= CONVERGED || moved <= STALLED && moved >= 0.5 * before {
                    converged = true;
                    break;
                }
                before = moved;
            }
            // Is the motion of the columns resolved?
            sum.values.fill(0.0);
            for (weight, [_, slope]) in last.iter().zip(&*nodes) {
                sum.values.iter_mut().zip(&slope.values).for_each(|(s, f)| *s += weight * f);
            }
            let mut sizes = largest(s.freedoms(), columns);
            let ends = largest(s.freedoms(), &nodes[NODES - 1][0]);
            sizes.iter_mut().zip(ends).for_each(|(size, end)| *size = size.max(end));
            // Not below what differences of trains have lost, nor below the rounding of the state over the step of the number.
            let (q, v) = (s.freedoms(), 2 * s.freedoms());
            sizes[..q].iter_mut().for_each(|size| *size = size.max(rounded[0] / RESOLVED));
            sizes[q..v].iter_mut().for_each(|size| *size = size.max(rounded[1] / RESOLVED));
            converged &= is_small(sum, &sizes, RESOLVED);
        }
        if !converged && depth >= DEEPEST {
            self.is_unresolved = true;
            return;
        }
        if !converged {
            let middle = from + 0.5 * span;
            self.collocate(mode, step, [from, middle], of_numbers, depth + 1);
            return self.collocate(mode, step, [middle, to], of_numbers, depth + 1);
        }
        for (weight, [_, slope]) in rule.weights.iter().zip(&*nodes) {
            columns.values.iter_mut().zip(&slope.values).for_each(|(c, f)| *c += weight * f);
        }
        if !of_numbers {
            *volume += if known.held.is_some() { f64::NAN } else { divergence };
        }
    }
}

/// A component this much smaller than the largest of its kind counts as large as that.
const FLOOR: f64 = 1e-6;

/// The series of a step that the derivative along it is made from, in the step's clock.
struct Coefficients {
    /// `dt/dθ`.
    clock: Vec<f64>,
    /// For each contact that changes: it, its latched speed, and its changes times the clock's rate.
    changes: Vec<(usize, Option<usize>, [Vec<f64>; 3])>,
}

impl Coefficients {
    /// Those of `step`; `None` where it does not know them.
    fn new(structure: &Structure, mode: &Mode, step: &dyn DenseStep) -> Option<Self> {
        let show = |what: Shown| {
            let mut series = Vec::new();
            step.show(what, &mut series).then_some(series)
        };
        let clock = show(Shown::Time)?.iter().enumerate().skip(1).map(|(k, t)| k as f64 * t).collect();
        let changes = structure.changing(mode).map(|(j, latch)| {
            let by = [show(Shown::ByDeflection(j))?, show(Shown::ByRate(j))?, show(Shown::ByLatch(j))?];
            Some((j, latch, by))
        });
        Some(Self { clock, changes: changes.collect::<Option<_>>()? })
    }

    /// The same on `[from, to]`, by a clock that goes from 0 to 1 there.
    fn part(&self, from: f64, to: f64) -> Self {
        let part = |series: &Vec<f64>| {
            let mut shifted = series.clone();
            // Taylor's shift by Horner's scheme, then the scale.
            for i in 0..shifted.len() {
                for k in (i..shifted.len() - 1).rev() {
                    shifted[k] += from * shifted[k + 1];
                }
            }
            let mut power = to - from;
            for c in &mut shifted {
                *c *= power;
                power *= to - from;
            }
            shifted
        };
        let changes = self.changes.iter().map(|(j, latch, by)| (*j, *latch, std::array::from_fn(|i| part(&by[i]))));
        Self { clock: part(&self.clock), changes: changes.collect() }
    }
}

/// `Σ a_i x_{k−i}` over the orders that `a` has, into `sum`.
fn convolve(a: &[f64], k: usize, mut add: impl FnMut(usize, f64)) {
    a.iter().take(k + 1).enumerate().filter(|(_, a)| **a != 0.0).for_each(|(i, a)| add(k - i, *a));
}

/// The largest entries of the components: of `n` displacements, `n` velocities and the rest, each kind in its own units.
fn largest(n: usize, columns: &Columns) -> Vec<f64> {
    let rows = columns.values.chunks_exact(columns.count);
    let mut sizes: Vec<f64> = rows.map(|row| row.iter().fold(0.0, |m: f64, c| m.max(c.abs()))).collect();
    let (q, rest) = sizes.split_at_mut(n);
    let (v, latches) = rest.split_at_mut(n);
    for kind in [q, v, latches] {
        let floor = FLOOR * kind.iter().fold(0.0, |m: f64, size| m.max(*size));
        kind.iter_mut().for_each(|size| *size = size.max(floor));
    }
    sizes
}

/// Whether every component is at most `share` of its size.
fn is_small(columns: &Columns, sizes: &[f64], share: f64) -> bool {
    columns.values.chunks_exact(columns.count).zip(sizes).all(|(row, size)| row.iter().all(|c| c.abs() <= share * size))
}

/// The largest difference of two, relative to the sizes of the components.
fn difference(a: &Columns, b: &Columns, sizes: &[f64]) -> f64 {
    let rows = a.values.chunks_exact(a.count).zip(b.values.chunks_exact(b.count)).zip(sizes);
    rows.filter(|(_, size)| **size > 0.0)
        .flat_map(|((a, b), size)| a.iter().zip(b).map(move |(a, b)| (a - b).abs() / size))
        .fold(0.0, f64::max)
}

impl Tangent<'_> {
    /// The columns along a part of a step, by their own series; `false` where they are not short enough.
    fn expand(&mut self, mode: &Mode, c: &Coefficients) -> bool {
        let Self { structure: s, columns, modes, orders, base, along, .. } = self;
        let Some(known) = modes.get(mode) else { return true };
        let (n, m) = (s.freedoms(), columns.count);
        // `gᵀδq` and `gᵀδq̇` of each contact, order by order.
        along.resize_with(c.changes.len(), Default::default);
        along.iter_mut().flatten().for_each(|rows| {
            rows.clear();
            rows.resize(ORDER * m, 0.0);
        });
        orders.resize_with(ORDER + 1, || columns.clone());
        base.resize_with(ORDER, || columns.clone());
        orders[0].values.copy_from_slice(&columns.values);
        let (none, mut force) = (Gradient::default(), vec![0.0; m]);
        for k in 0..ORDER {
            let (low, high) = orders.split_at_mut(k + 1);
            let next = &mut high[0];
            s.apply(&none, None, &low[k], &mut base[k]);
            next.values.fill(0.0);
            convolve(&c.clock, k, |i, a| next.values.iter_mut().zip(&base[i].values).for_each(|(n, b)| *n += a * b));
            for ((j, latch, [by_deflection, by_rate, by_latch]), along) in c.changes.iter().zip(&mut *along) {
                force.fill(0.0);
                for ((first, by), along) in [(0, by_deflection), (n, by_rate)].into_iter().zip(along) {
                    s.add_along(*j, first, 1.0, &low[k], &mut along[k * m..(k + 1) * m]);
                    convolve(by, k, |i, a| {
                        force.iter_mut().zip(&along[i * m..(i + 1) * m]).for_each(|(f, x)| *f += a * x);
                    });
                }
                if let (Some(latch), Some(a)) = (latch, by_latch.get(k)) {
                    force.iter_mut().zip(low[0].row(*latch)).for_each(|(f, l)| *f += a * l);
                }
                s.push_columns(*j, &force, next);
            }
            if let Some(held) = &known.held {
                s.take_out(held, n, next, &mut |_, _| ());
            }
            next.values.iter_mut().for_each(|x| *x /= (k + 1) as f64);
        }
        let sizes = largest(n, columns);
        let is_short = orders[ORDER - 1..].iter().all(|last| is_small(last, &sizes, 4.0 * f64::EPSILON));
        if is_short {
            for order in orders[1..].iter().rev() {
                columns.values.iter_mut().zip(&order.values).for_each(|(c, o)| *c += o);
            }
            let by_rate = c.changes.iter().map(|(j, _, by)| s.divergence_by(*j) * integral(&by[1]));
            let divergence = s.divergence(&none) * integral(&c.clock) + by_rate.sum::<f64>();
            self.volume += if known.held.is_some() { f64::NAN } else { divergence };
        }
        is_short
    }

    /// The same, in as many parts as it takes; what no series is short enough for is collocated.
    fn expand_parts(&mut self, mode: &Mode, step: &dyn DenseStep, c: &Coefficients, [from, to]: [f64; 2], depth: u32) {
        if self.expand(mode, &c.part(from, to)) {
            return;
        }
        if depth >= DEEPEST {
            return self.collocate_start(mode, step, [from, to]);
        }
        let middle = 0.5 * (from + to);
        self.expand_parts(mode, step, c, [from, middle], depth + 1);
        self.expand_parts(mode, step, c, [middle, to], depth + 1);
    }
}

/// The integral of a series over `[0, 1]`.
fn integral(series: &[f64]) -> f64 {
    series.iter().enumerate().map(|(k, c)| c / (k + 1) as f64).sum()
}

impl Observer for Tangent<'_> {
    fn wants_steps(&self, mode: &Mode) -> bool {
        !self.variations.is_empty() || !self.structure.is_affine(mode)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.known(mode);
        self.exponential(mode, time);
        ControlFlow::Continue(())
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.known(mode);
        if until <= 0.0 {
            return ControlFlow::Continue(());
        }
        if self.structure.is_affine(mode) {
            self.exponential(mode, step.time(until));
        } else if let Some(coefficients) = Coefficients::new(self.structure, mode, step) {
            self.expand_parts(mode, step, &coefficients, [0.0, until], 0);
        } else {
            self.collocate_start(mode, step, [0.0, until]);
        }
        if !self.variations.is_empty() {
            let mut x = std::mem::take(&mut self.x);
            step.state(0.0, &mut x);
            self.switch(mode, step.start(), &x);
            self.x = x;
            self.collocate(mode, step, [0.0, until], true, 0);
        }
        ControlFlow::Continue(())
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &Jumped<'_>) {
        let &Jumped { at, from, to, fired, x_minus, x_plus, settles } = jumped;
        let s = self.structure;
        let jump = (fired, settles, self.resets_only);
        let saltation = s.saltate((from, to), jump, at, (x_minus, x_plus), &[], &mut self.columns);
        if !self.variations.is_empty() {
            self.switch(&from.mode, at, x_minus);
            s.saltate((from, to), jump, at, (x_minus, x_plus), self.variations, &mut self.by_number.columns);
            self.mode = Some(to.mode.clone());
        }
        self.rests = s.held(&to.mode).is_some();
        self.dies = saltation.ranks > 0;
        self.rested = self.rested.max(saltation.ranks);
        self.is_piecewise |= saltation.is_piecewise;
        self.volume += saltation.volume;
        saltation.latched.iter().for_each(|latch| self.latched[latch - 2 * s.freedoms()] = true);
    }
}
