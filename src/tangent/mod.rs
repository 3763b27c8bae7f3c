//! Derivative of the motion: columns along the state of a run, and the errors of a run that they amplify.

mod collocation;
mod exponential;
mod inherited;
mod series;

use std::{collections::BTreeMap, ops::ControlFlow};

pub use inherited::Inherited;

use serde::{Deserialize, Serialize};

use collocation::CollocationColumns;
use exponential::Tables;
use series::{Coefficients, Orders};

use crate::{
    engine::{JumpRecord, Observer, State},
    hybrid::{Columns, HybridSystem, Instant, LaneRecords, LaneTangent, Mode},
    integrate::DenseStep,
    system::{ContactMode, Evaluation, Gradient, Sticking, Structure, Variation, contact_mode},
};

/// Maximum number of halvings of a step.
const DEEPEST: u32 = 12;

/// Point at which a map is only piecewise smooth: dependent impacts fall on one instant. The derivative is that of neighbours whose impacts
/// stay together; neighbours whose impacts separate have another derivative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Corner {
    /// Time since the start of the forcing cycle, s.
    pub phase: f64,
    /// Contacts, by index in the train.
    pub contacts: Vec<usize>,
}

/// Data of a mode.
struct ModeData {
    /// `f_x`, if it is constant.
    gradient: Option<Gradient>,
    held: Option<Sticking>,
    /// Tables of a mode with constant `f_x`.
    tables: Option<Tables>,
    /// Size of its rates without varying contacts, rad/s.
    rate: f64,
}

/// Derivative of the state with respect to a start, and to parameters of the train, along an observed run.
pub struct Tangent<'s> {
    structure: &'s Structure,
    /// `∂x/∂(start)`, `[dim][count]`.
    pub columns: Columns,
    /// Parameters with respect to which the derivative is taken.
    variations: &'s [Variation],
    /// `∂x/∂α`, one column for each parameter.
    by_number: CollocationColumns,
    /// Mode up to which the columns of parameters have been advanced.
    mode: Option<Mode>,
    /// `∫ div f dt + Σ ln |det|` of jumps so far; NaN where contacts rest or latch, which have no volume.
    pub volume: f64,
    /// First corner on the run.
    pub corner: Option<Corner>,
    /// True if a part of the motion could not be resolved: the columns must not be used.
    pub is_unresolved: bool,
    /// True for each latched speed that has been rewritten.
    pub latched: Vec<bool>,
    /// Advance of the open instant per unit of each column, s, of the start and of the parameters, with the contacts that cause it.
    moved: Option<([Vec<f64>; 2], Vec<usize>)>,
    /// True if contacts rest.
    pub(crate) rests: bool,
    /// True if the last jump reduced the rank.
    pub(crate) dies: bool,
    /// Null directions at one time, for each impact that reduced the rank: the number of ranks lost to contacts at rest, and the latched
    /// speeds of open contacts.
    pub(crate) dead: Vec<(usize, Vec<bool>)>,
    resets_only: bool,
    modes: BTreeMap<Mode, ModeData>,
    work: [Columns; 2],
    orders: Orders,
    collocated: CollocationColumns,
    x: Vec<f64>,
}

impl<'s> Tangent<'s> {
    /// Returns the tangent of all components of the state: `columns` is the unit matrix.
    #[must_use]
    pub fn new(structure: &'s Structure) -> Self {
        Self::of(structure, Columns::unit(HybridSystem::dim(structure)))
    }

    /// Returns the tangent of some `columns`.
    #[must_use]
    pub fn of(structure: &'s Structure, columns: Columns) -> Self {
        Self {
            variations: &[],
            by_number: CollocationColumns::new(Columns { count: 0, values: Vec::new() }),
            mode: None,
            work: [columns.clone(), columns.clone()],
            collocated: CollocationColumns::new(columns.clone()),
            orders: Orders::default(),
            x: vec![0.0; HybridSystem::dim(structure)],
            latched: vec![false; HybridSystem::dim(structure) - 2 * structure.freedoms()],
            columns,
            structure,
            volume: 0.0,
            corner: None,
            is_unresolved: false,
            moved: None,
            rests: false,
            dies: false,
            dead: Vec::new(),
            resets_only: false,
            modes: BTreeMap::new(),
        }
    }

    /// Adds the derivative with respect to parameters of the train, given by `variations`.
    #[must_use]
    pub fn with(mut self, variations: &'s [Variation]) -> Self {
        let (count, dim) = (variations.len(), HybridSystem::dim(self.structure));
        self.by_number = CollocationColumns::new(Columns { count, values: vec![0.0; count * dim] });
        Self { variations, ..self }
    }

    /// Returns `∂x/∂α` of each parameter.
    #[must_use]
    pub fn by_number(&self) -> &Columns {
        &self.by_number.columns
    }

    /// Removes from the columns the directions that contacts at rest in the mode of `state`, the start of the run, do not allow.
    pub fn start(&mut self, state: &State) {
        let State { at, x, jump } = state;
        self.restrain(&jump.mode);
        if !self.variations.is_empty() {
            let by = Evaluation { variations: self.variations, at: *at, x };
            self.structure.restrain(&jump.mode, Some(by), &mut self.by_number.columns);
            self.mode = Some(jump.mode.clone());
        }
    }

    /// Removes from the columns of a start the directions that contacts at rest in `mode` do not allow.
    pub(crate) fn restrain(&mut self, mode: &Mode) {
        self.rests = self.structure.held(mode).is_some();
        self.structure.restrain(mode, None, &mut self.columns);
    }

    /// Advances the columns of parameters over a known switching time at `at`, if the mode has changed since the last call.
    fn switch(&mut self, mode: &Mode, at: Instant, x: &[f64]) {
        let before = self.mode.replace(mode.clone());
        if let Some(before) = before.filter(|before| before != mode) {
            let by = Evaluation { variations: self.variations, at, x };
            self.structure.switch_columns((&before, mode), by, &mut self.by_number.columns);
        }
    }

    /// Clears the latched speeds of contacts that are open in `mode`: they no longer influence the motion.
    pub(crate) fn forget(&mut self, mode: &Mode) {
        let count = self.columns.count;
        for (j, c) in self.structure.contacts.iter().enumerate() {
            if let Some(latch) = c.latch().filter(|_| contact_mode(mode, j) == ContactMode::Separated) {
                self.columns.values[latch * count..(latch + 1) * count].fill(0.0);
            }
        }
    }

    /// Omits the saltation, the effect of earlier or later events of neighbours: only the derivative of each reset remains.
    pub fn without_saltation(&mut self) {
        self.resets_only = true;
    }

    /// Returns for each latched speed whether its contact is open in `mode`.
    fn open(&self, mode: &Mode) -> Vec<bool> {
        let contacts = self.structure.contacts.iter().enumerate().filter(|(_, c)| c.latch().is_some());
        contacts.map(|(j, _)| contact_mode(mode, j) == ContactMode::Separated).collect()
    }

    /// Returns the size of the rates of `mode`, rad/s.
    pub(crate) fn rate(&self, mode: &Mode) -> f64 {
        self.modes.get(mode).map_or(0.0, |known| known.rate)
    }

    fn known(&mut self, mode: &Mode) {
        if !self.modes.contains_key(mode) {
            let s = self.structure;
            let gradient = s.is_affine(mode).then(|| s.gradient(mode, s.clock().instant(0.0), &self.x));
            let held = s.held(mode);
            self.dead.push((held.as_ref().map_or(0, |held| 2 * held.independent()), self.open(mode)));
            let rate = s.rate_of(mode);
            let tables = gradient.as_ref().and_then(|gradient| Tables::new(s, gradient, held.as_ref(), rate));
            let known = ModeData { gradient, held, tables, rate };
            self.modes.insert(mode.clone(), known);
        }
    }
}

/// Smallest size of a component, relative to the largest of its kind.
const FLOOR: f64 = 1e-6;

/// Returns the largest entries of the components: of `n` displacements, `n` velocities and the rest, each kind in its own units.
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

/// Returns whether every component is at most `share` of its size.
fn is_small(columns: &Columns, sizes: &[f64], share: f64) -> bool {
    columns.values.chunks_exact(columns.count).zip(sizes).all(|(row, size)| row.iter().all(|c| c.abs() <= share * size))
}

/// Returns the largest difference of two columns, relative to the sizes of the components.
fn difference(a: &Columns, b: &Columns, sizes: &[f64]) -> f64 {
    let rows = a.values.chunks_exact(a.count).zip(b.values.chunks_exact(b.count)).zip(sizes);
    rows.filter(|(_, size)| **size > 0.0)
        .flat_map(|((a, b), size)| a.iter().zip(b).map(move |(a, b)| (a - b).abs() / size))
        .fold(0.0, f64::max)
}

/// Returns the number of exactly zero multipliers: the most null directions at one time, with latched speeds only if `written` later.
pub(crate) fn zeros(dead: &[(usize, Vec<bool>)], written: &[bool]) -> usize {
    let latched = |open: &[bool]| open.iter().zip(written).filter(|(open, written)| **open && **written).count();
    dead.iter().map(|(ranks, open)| ranks + latched(open)).max().unwrap_or(0)
}

impl Observer for Tangent<'_> {
    fn wants_steps(&self, mode: &Mode, _: Instant) -> bool {
        !self.variations.is_empty() || !self.structure.is_affine(mode)
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        // A jump that may follow another one at the same instant is passed by a call.
        if !self.variations.is_empty() || self.resets_only || self.rests || self.moved.is_some() {
            return None;
        }
        let tangent = Some(LaneTangent { columns: &mut self.columns, volume: &mut self.volume });
        Some(LaneRecords { tangent, ..LaneRecords::default() })
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.moved = None;
        self.known(mode);
        self.exponential(mode, time);
        ControlFlow::Continue(())
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.known(mode);
        if until <= 0.0 {
            return ControlFlow::Continue(());
        }
        self.moved = None;
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

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        let &JumpRecord { at, from, to, fired, x_minus, x_plus, settles } = jumped;
        let s = self.structure;
        let jump = (fired, settles, self.resets_only);
        let saltation = s.saltate((from, to), jump, at, (x_minus, x_plus), &[], &mut self.columns);
        let mut by_number = Vec::new();
        if !self.variations.is_empty() {
            self.switch(&from.mode, at, x_minus);
            let columns = &mut self.by_number.columns;
            by_number = s.saltate((from, to), jump, at, (x_minus, x_plus), self.variations, columns).earlier;
            self.mode = Some(to.mode.clone());
        }
        if !saltation.movers.is_empty() {
            self.moved = Some(([saltation.earlier, by_number], saltation.movers));
        } else if let Some(([earlier, by_number], movers)) = self.moved.as_ref().filter(|_| !self.resets_only) {
            let (modes, place) = ((&from.mode, &to.mode), (at, x_plus));
            let is_finite = s.saltate_after(modes, place, earlier, &mut self.columns);
            s.restrain(&to.mode, None, &mut self.columns);
            if !self.variations.is_empty() {
                let columns = &mut self.by_number.columns;
                s.saltate_after(modes, place, by_number, columns);
                s.restrain(&to.mode, Some(Evaluation { variations: self.variations, at, x: x_plus }), columns);
            }
            if is_finite && movers.len() > 1 {
                let contacts = movers.clone();
                self.corner.get_or_insert_with(|| Corner { phase: at.phase.value(), contacts });
            }
        }
        self.rests = s.held(&to.mode).is_some();
        self.dies = saltation.ranks > 0;
        if saltation.ranks > 0 {
            let (before, after) = (self.open(&from.mode), self.open(&to.mode));
            let throughout = before.iter().zip(after).map(|(before, after)| *before && after);
            self.dead.push((saltation.ranks, throughout.collect()));
        }
        if !saltation.dependent.is_empty() {
            self.corner.get_or_insert_with(|| Corner { phase: at.phase.value(), contacts: saltation.dependent });
        }
        self.volume += saltation.volume;
        saltation.latched.iter().for_each(|latch| self.latched[latch - 2 * s.freedoms()] = true);
    }
}
